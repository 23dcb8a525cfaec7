//! Delaunay-only settings.

use enfilade_geom::DVec3;

/// Delaunay-only settings.
#[derive(Clone, Debug, Default)]
pub struct DelaunayConfig {
    /// The measure of portals.
    pub weight: Weight,
    /// The weight at which decimation stops; `None` for the weight's own. [Limit: above 0]
    pub stop: Option<f64>,
    /// Decisions of the user.
    pub choices: Choices,
}

impl DelaunayConfig {
    /// Returns `true` if the user decided anything.
    pub(crate) fn has_choices(&self) -> bool {
        self.choices != Choices::default()
    }
}

/// The measure of a portal's quality.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Weight {
    /// Gjørup's ratio of areas.
    Aspect,
    /// Gjørup's ratio corrected by size; depends on the unit.
    SizeCorrected,
    /// Ratio of radii, at a pinch or at the mouth of a branch; above 1.
    #[default]
    ScaleFree,
}

/// Decisions of the user, by places as in [`Step::position`](crate::delaunay::Step::position). A choice concerns the portal between initial cells whose
/// center is there, and later whatever that has become part of. If there is none, because the scene was repaired or has
/// other points, it concerns the nearest portal that decimation removes without choices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choices {
    /// Portals here stay, whatever their weight. [Units: wu]
    pub keep: Vec<DVec3>,
    /// Portals here are removed once no other portal goes by itself: the rooms present then are merged, however many
    /// steps the user took to see the portal. [Units: wu]
    pub join: Vec<DVec3>,
}

//! Settings of a bake, and the resolved form that the stages use.

mod bsp;
mod decisions;
mod delaunay;
mod merge;

use std::collections::BTreeMap;

use enfilade_geom::Aabb;

use crate::simplify::SimplifySettings;
use crate::voxel::Grid;
use crate::{BakeError, Budget, Method};

pub use bsp::{BspConfig, Guide, Heuristic, Rooms};
pub use decisions::{RoomAnswer, RoomDecision};
pub use delaunay::{Choices, DelaunayConfig, Weight};
pub use merge::MergeSettings;

/// Settings of a bake. The defaults are meant for every scene; none is tuned to one.
#[derive(Clone, Debug)]
pub struct BakeConfig {
    /// The method that finds cells; `None` chooses it: BSP if all structure is made of brushes, else the watershed.
    /// Delaunay if the watershed finds at most one cell in a vessel: a curved surface, closed except at its ends, that
    /// may branch.
    pub method: Option<Method>,
    /// Width of the narrowest opening that must be found: six voxels. [Units: wu] [Limit: above 0]
    pub min_opening: f64,
    /// Width below which openings are closed by seals. [Units: wu]
    pub smallest_hole: SmallestHole,
    /// Settings that decide where rooms end.
    pub merge: MergeSettings,
    /// Cells outdoors: one, or several.
    pub outdoors: Outdoors,
    /// Openings that the scene marks become portals where they are marked ([`Scene::given_portals`](enfilade_geom::scene::Scene::given_portals)).
    pub keeps_given: bool,
    /// Decisions of people about rooms, which win over those of the bake; kept in their order.
    pub decisions: Vec<RoomDecision>,
    /// Bounds on the cost of cells, and the model of costs; no bounds by default.
    pub costs: SimplifySettings,
    /// Watershed, and BSP in buildings: edge of a voxel; `None` chooses it from `min_opening`, `max_voxels` and the scene's size. An edge
    /// that does not fit the budget is refused. [Units: wu] [Limit: above 0]
    pub voxel: Option<f64>,
    /// Watershed, and BSP in buildings: most voxels. A larger scene gets larger voxels, up to the width of the narrowest opening; beyond
    /// that, the bake fails. About 3 bytes each. [Limit: at least 1,000]
    pub max_voxels: usize,
    /// Limits on the resources of a bake.
    pub budget: Budget,
    /// Watershed: basins shallower than this are noise. [Units: wu]
    pub noise: f64,
    /// BSP-only settings.
    pub bsp: BspConfig,
    /// Delaunay-only settings.
    pub delaunay: DelaunayConfig,
}

impl Default for BakeConfig {
    fn default() -> Self {
        Self {
            method: None,
            min_opening: 0.6,
            smallest_hole: SmallestHole::default(),
            merge: MergeSettings::default(),
            outdoors: Outdoors::default(),
            keeps_given: false,
            decisions: Vec::new(),
            costs: SimplifySettings::default(),
            voxel: None,
            max_voxels: 1_600_000_000,
            budget: Budget::default(),
            noise: 0.015,
            bsp: BspConfig::default(),
            delaunay: DelaunayConfig::default(),
        }
    }
}

/// Choice of cells outdoors.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Outdoors {
    /// All that is outdoors is one cell.
    #[default]
    Whole,
    /// Open land is divided in plan into valleys, streets, squares and courtyards, each a cell between the ground and a sky limit.
    /// All that is above and around them stays one cell.
    Split {
        /// Places, x and z, from which the land is flooded instead of the minima of the plan: one cell each. [Units: wu]
        minima: Vec<[f64; 2]>,
    },
}

/// Diameter of balls that decides on gaps: an opening that no such ball passes is a gap and joins no rooms. [Units: wu]
///
/// The default of 10 mm is wider than the gaps that exporters, scanners and hasty modeling leave between surfaces that
/// are meant to touch, and narrower than any opening to look or shoot through.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum SmallestHole {
    /// Seals gaps of 10 mm, or wider ones in a model whose triangles miss each other by more.
    #[default]
    Auto,
    /// Closes gaps by seals, polygons that are matter to every consumer of the world.
    Sealed(f64),
    /// Leaves gaps open, as portals of kind crack. The width still decides which openings are gaps, and so which rooms
    /// there are.
    Open(f64),
}

impl std::fmt::Display for SmallestHole {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Auto => write!(f, "auto"),
            Self::Sealed(width) => write!(f, "{width}"),
            Self::Open(_) => write!(f, "0"),
        }
    }
}

impl SmallestHole {
    /// Width of [`SmallestHole::Auto`] in a model whose triangles fit. [Units: wu]
    pub const LEAST: f64 = 0.01;
    /// Upper bound of the automatic width: wider slits can be seen through. [Units: wu]
    const MOST: f64 = 0.05;
    /// Ratio of the widest slits, where several triangles meet, to the width that nearly all stay below.
    const SPREAD: f64 = 3.0;

    /// Returns the setting for a width given by the user: 0 leaves gaps open.
    #[must_use]
    pub fn of_width(width: f64) -> Self {
        if width == 0.0 {
            Self::Open(Self::LEAST)
        } else {
            Self::Sealed(width)
        }
    }

    /// Resolves `Auto` for a model in which nearly all triangles miss each other by at most `misfit`. [Units: wu]
    #[must_use]
    pub(crate) fn resolved(self, misfit: f64) -> Self {
        match self {
            Self::Auto => Self::Sealed((Self::SPREAD * misfit).clamp(Self::LEAST, Self::MOST)),
            given => given,
        }
    }

    /// Returns how far apart copies of one vertex are in such a model, at most the width of a gap. [Units: wu]
    pub(crate) fn reach(self, misfit: f64) -> f64 {
        (Self::SPREAD * misfit).min(self.resolved(misfit).gap())
    }

    /// Returns the width of the widest gap. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn gap(self) -> f64 {
        match self {
            Self::Auto => Self::LEAST,
            Self::Sealed(width) | Self::Open(width) => width,
        }
    }

    /// Returns `true` if gaps are closed.
    #[must_use]
    #[doc(hidden)]
    pub fn has_seals(self) -> bool {
        !matches!(self, Self::Open(_))
    }

    pub(crate) fn check(self) -> Result<(), BakeError> {
        let gap = self.gap();
        if gap >= 0.0 && gap.is_finite() {
            return Ok(());
        }
        Err(BakeError::Setting {
            name: "smallest_hole",
            value: gap.to_string(),
            limit: "a number of at least 0",
        })
    }
}

/// Voxels of air around the scene: the outdoors must be wider than any opening into it.
pub(crate) const PADDING: usize = 10;

impl BakeConfig {
    /// Returns the defaults for one method.
    #[must_use]
    pub fn of(method: Method) -> Self {
        Self {
            method: Some(method),
            ..Self::default()
        }
    }

    /// Returns the settings of rooms found in voxels as text, by name, for the provenance of the file.
    pub(crate) fn voxel_settings(&self) -> BTreeMap<String, String> {
        let voxel = self.voxel.map(|v| v.to_string());
        let own = [
            ("voxel", voxel.unwrap_or_else(|| "auto".to_owned())),
            ("min_opening", self.min_opening.to_string()),
            ("max_voxels", self.max_voxels.to_string()),
        ];
        let mut out = self.merge.to_settings();
        out.extend(own.map(|(k, v)| (k.to_owned(), v)));
        out
    }

    /// Checks the width of the narrowest opening.
    pub(crate) fn check_opening(&self) -> Result<(), BakeError> {
        positive("min_opening", self.min_opening).map(|_| ())
    }

    /// Returns the grid for a scene of so many triangles within these bounds, if a voxel takes so many bytes. All checks of settings are here.
    ///
    /// # Errors
    /// If a setting is out of its limits, or the budget allows only voxels wider than openings or than requested.
    pub(crate) fn grid(
        &self,
        bounds: &Aabb,
        n_triangles: usize,
        bytes_a_voxel: f64,
    ) -> Result<Grid, BakeError> {
        positive("min_opening", self.min_opening)?;
        self.smallest_hole.check()?;
        let wanted = positive("voxel", self.voxel.unwrap_or(self.min_opening / 6.0))?;
        if self.max_voxels < 1000 {
            return Err(BakeError::Setting {
                name: "max_voxels",
                value: self.max_voxels.to_string(),
                limit: "at least 1000",
            });
        }
        let mut voxel = wanted;
        let most = self.budget.voxels(n_triangles, bytes_a_voxel);
        let most = most.min(self.max_voxels as f64);
        // Growing by a tenth at a time ends close below the budget. Past the scene's size only padding is left, which
        // may still be too much.
        let widest = wanted.max(bounds.size().max_element());
        while n_voxels(bounds, voxel) > most && voxel <= widest.max(self.min_opening) {
            voxel *= 1.1;
        }
        if self.voxel.is_some() {
            // Voxels finer than `f32` precision carry no information.
            let corners = bounds.min.abs().max(bounds.max.abs());
            let finest = voxel.max(corners.max_element() * f64::from(f32::EPSILON));
            if wanted < finest {
                return Err(BakeError::TooFine {
                    wanted,
                    finest,
                    bytes: bytes_a_voxel * n_voxels(bounds, wanted),
                });
            }
        }
        if voxel > wanted && voxel > self.min_opening {
            return Err(BakeError::TooLarge {
                size: bounds.size().to_array(),
                voxel,
                wanted,
                bytes: bytes_a_voxel * n_voxels(bounds, wanted),
                max_voxels: most as usize,
                min_opening: self.min_opening,
            });
        }
        Ok(Grid::covering(bounds, voxel, PADDING))
    }
}

fn positive(name: &'static str, value: f64) -> Result<f64, BakeError> {
    if value > 0.0 && value.is_finite() {
        return Ok(value);
    }
    Err(BakeError::Setting {
        name,
        value: value.to_string(),
        limit: "a number above 0",
    })
}

fn n_voxels(bounds: &Aabb, voxel: f64) -> f64 {
    let n = (bounds.size() / voxel).ceil() + 2.0 * PADDING as f64;
    n.x * n.y * n.z
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::DVec3;

    #[test]
    fn a_large_scene_gets_larger_voxels_and_stays_within_the_budget() {
        let config = BakeConfig {
            max_voxels: 20_000_000,
            ..BakeConfig::default()
        };
        let bounds = Aabb::new(DVec3::ZERO, DVec3::new(200.0, 30.0, 200.0));
        let grid = config.grid(&bounds, 100_000, 2.2).unwrap();
        assert!(grid.n_voxels() <= 20_000_000);
        assert!(grid.voxel > 0.1);
        let small = Aabb::new(DVec3::ZERO, DVec3::splat(5.0));
        assert!((config.grid(&small, 12, 2.2).unwrap().voxel - 0.1).abs() < 1e-12);
    }

    #[test]
    fn a_scene_whose_doors_would_be_lost_is_refused_unless_that_is_wanted() {
        let mut config = BakeConfig {
            max_voxels: 100_000,
            ..BakeConfig::default()
        };
        let bounds = Aabb::new(DVec3::ZERO, DVec3::new(200.0, 30.0, 200.0));
        let error = config.grid(&bounds, 100_000, 3.6).unwrap_err();
        assert!(matches!(error, BakeError::TooLarge { .. }), "{error}");
        let said = error.to_string();
        for word in ["200 x 30 x 200 m", "--unit", "max_voxels", "5 GB"] {
            assert!(said.contains(word), "{word}: {said}");
        }
        config.min_opening = 10.0;
        config.grid(&bounds, 100_000, 3.6).unwrap();
    }

    #[test]
    fn voxels_that_were_asked_for_are_kept_or_refused() {
        let grid = |voxel, budget: Budget| {
            let config = BakeConfig {
                voxel: Some(voxel),
                budget,
                ..BakeConfig::default()
            };
            let bounds = Aabb::new(DVec3::ZERO, DVec3::new(10.0, 3.0, 10.0));
            config.grid(&bounds, 1000, 2.2)
        };
        assert!((grid(0.05, Budget::default()).unwrap().voxel - 0.05).abs() < 1e-12);
        let rich = Budget {
            memory: Some(u64::MAX / 2),
            ..Budget::default()
        };
        // The last ones exceed any memory, and the precision of `f32`.
        for (voxel, budget) in [
            (1e-5, Budget::default()),
            (1e-7, rich),
            (1e-300, rich),
            (f64::MIN_POSITIVE, rich),
        ] {
            let error = grid(voxel, budget).unwrap_err();
            assert!(matches!(error, BakeError::TooFine { .. }), "{error}");
            let said = error.to_string();
            for word in ["--voxel", "--max-memory"] {
                assert!(said.contains(word), "{word}: {said}");
            }
        }
    }

    #[test]
    fn settings_out_of_limits_are_named() {
        let config = BakeConfig {
            voxel: Some(-1.0),
            ..BakeConfig::default()
        };
        let error = config
            .grid(&Aabb::new(DVec3::ZERO, DVec3::ONE), 12, 2.2)
            .unwrap_err();
        assert!(error.to_string().contains("voxel"));
    }
}

//! The answer to a view: visible things in lists, near to far.

use std::fmt;

use enfilade_cpg::{CellId, PortalId, SpecialId};

/// Index into [`Sight::chunks`](crate::Sight::chunks).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ChunkId(pub u32);

/// Index into `World::details`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct DetailId(pub u32);

/// One cell seen through one part of the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visit {
    /// The cell.
    pub cell: CellId,
    /// The portal entered by; `None` for the eye's own cell.
    pub via: Option<PortalId>,
    /// The part of the screen: `[left, bottom, right, top]`, -1 to 1, of the view's face.
    pub rectangle: [f32; 4],
    /// Index of the face in a view that looks all around; otherwise 0.
    pub face: u8,
    /// Depth along the view direction of the nearest point of the portal entered by; 0 for the eye's own
    /// cell. Visits come in ascending order of it. [Units: wu]
    pub depth: f32,
    /// Index of its first plane in [`Seen::planes`].
    pub(crate) first_plane: u32,
    pub(crate) n_planes: u32,
}

/// Statistics of a query.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SeeCounts {
    /// Portals whose outline was clipped.
    pub clips: u32,
    /// Visits contained in others, or joined to them.
    pub spared: u32,
    /// Chunks, details and portals hidden by the shadow of an occluder.
    pub shadowed: u32,
    /// True if the eye was in no cell, so that everything in the view counts as visible.
    pub is_eye_lost: bool,
    /// True if the budget ran out.
    pub is_capped: bool,
}

/// The lists of an answer.
#[derive(Default)]
pub(crate) struct Lists {
    pub(crate) visits: Vec<Visit>,
    pub(crate) planes: Vec<[f32; 4]>,
    pub(crate) cells: Vec<CellId>,
    pub(crate) portals: Vec<PortalId>,
    pub(crate) stopped: Vec<(PortalId, CellId)>,
    pub(crate) specials: Vec<SpecialId>,
    pub(crate) chunks: Vec<ChunkId>,
    pub(crate) details: Vec<DetailId>,
    pub(crate) n_triangles: u64,
    pub(crate) counts: SeeCounts,
}

/// The answer to one view; borrowed from the [`Viewer`](crate::Viewer) until its next query.
#[derive(Clone, Copy)]
pub struct Seen<'a> {
    pub(crate) lists: &'a Lists,
}

impl fmt::Debug for Seen<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Seen")
            .field("cells", &self.cells())
            .field("portals", &self.portals())
            .finish_non_exhaustive()
    }
}

impl<'a> Seen<'a> {
    /// Returns the visits, near to far.
    #[must_use]
    pub fn visits(&self) -> &'a [Visit] {
        &self.lists.visits
    }

    /// Returns the half-spaces `[nx, ny, nz, d]` that bound the view of a visit; inside is `n · p + d >= 0`.
    /// For an engine to cull its own things with, or the GPU. Widened by the tolerance.
    #[must_use]
    pub fn planes(&self, visit: &Visit) -> &'a [[f32; 4]] {
        let first = visit.first_plane as usize;
        &self.lists.planes[first..first + visit.n_planes as usize]
    }

    /// Returns `true` if a moving object in `cells` with the box `aabb` may be seen.
    ///
    /// For objects that are not in the world's lists. Query each object every frame, with the cell of its
    /// [`Follower`](crate::Follower) and those behind portals that its box reaches into. Costs a few box tests per visit of
    /// these cells. A box may be infinite; one with a NaN coordinate is never seen.
    #[must_use]
    pub fn sees_box(&self, cells: &[CellId], aabb: [[f32; 3]; 2]) -> bool {
        let [low, high] = aabb;
        if aabb.as_flattened().iter().any(|x| x.is_nan()) {
            return false;
        }
        let is_inside = |plane: &[f32; 4]| {
            let far = (0..3).map(|k| plane[k] * if plane[k] >= 0.0 { high[k] } else { low[k] });
            let reach = far.sum::<f32>() + plane[3];
            // NaN, from an infinite box, counts as inside.
            reach >= 0.0 || reach.is_nan()
        };
        self.visits()
            .iter()
            .filter(|v| cells.contains(&v.cell))
            .any(|v| self.planes(v).iter().all(is_inside))
    }

    /// Returns the visible cells, each once, near to far.
    #[must_use]
    pub fn cells(&self) -> &'a [CellId] {
        &self.lists.cells
    }

    /// Returns the portals through which something is seen, each once.
    #[must_use]
    pub fn portals(&self) -> &'a [PortalId] {
        &self.lists.portals
    }

    /// Returns the portals not passed, each once, with the cell behind, which may still be visible through another portal:
    /// those that cover less than [`SeeOptions::min_share`](crate::SeeOptions::min_share) of the screen, and
    /// [stops](crate::Stops).
    #[must_use]
    pub fn stopped(&self) -> &'a [(PortalId, CellId)] {
        &self.lists.stopped
    }

    /// Returns the special portals in view, each once.
    #[must_use]
    pub fn specials(&self) -> &'a [SpecialId] {
        &self.lists.specials
    }

    /// Returns the visible chunks of structural batches, each once, by cells near to far.
    #[must_use]
    pub fn chunks(&self) -> &'a [ChunkId] {
        &self.lists.chunks
    }

    /// Returns the visible detail objects, each once, by cells near to far.
    #[must_use]
    pub fn details(&self) -> &'a [DetailId] {
        &self.lists.details
    }

    /// Returns the number of triangles of the visible chunks and details.
    #[must_use]
    pub fn n_triangles(&self) -> u64 {
        self.lists.n_triangles
    }

    /// Returns the statistics of the query.
    #[must_use]
    pub fn counts(&self) -> SeeCounts {
        self.lists.counts
    }
}

//! The answer: what a view sees, in lists near to far.

use enfilade_cpg::{CellId, PortalId};

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
    /// The portal it was entered by; `None` for the eye's own cell.
    pub via: Option<PortalId>,
    /// The part of the screen: `[left, bottom, right, top]`, -1 to 1, of the view's face.
    pub rectangle: [f32; 4],
    /// Face of a view that looks all around; else 0.
    pub face: u8,
    /// Depth of the nearest point of the portal entered by, along the view direction; 0 for the
    /// eye's own cell. [Units: wu] Visits come in ascending order of it.
    pub depth: f32,
    /// Its planes in [`Seen::planes`].
    pub(crate) first_plane: u32,
    pub(crate) n_planes: u32,
}

/// What it took to answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SeeCounts {
    /// Portals whose outline was clipped.
    pub clips: u32,
    /// Visits that lay within others, or were joined to them.
    pub spared: u32,
    /// Chunks, details and portals that the shadow of an occluder hid.
    pub shadowed: u32,
    /// Whether the eye was in no cell, so that all in the view counts as visible.
    pub is_eye_lost: bool,
    /// Whether the budget ran out.
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
    pub(crate) chunks: Vec<ChunkId>,
    pub(crate) details: Vec<DetailId>,
    pub(crate) n_triangles: u64,
    pub(crate) counts: SeeCounts,
}

/// The answer of one view; borrowed from the [`Viewer`](crate::Viewer) until its next question.
#[derive(Clone, Copy)]
pub struct Seen<'a> {
    pub(crate) lists: &'a Lists,
}

impl<'a> Seen<'a> {
    /// The visits, near to far.
    #[must_use]
    pub fn visits(&self) -> &'a [Visit] {
        &self.lists.visits
    }

    /// Half-spaces `[nx, ny, nz, d]`, inside is `n · p + d >= 0`, that bound what a visit sees: for an
    /// engine to cull its own things with, or the GPU. Widened by the tolerance.
    #[must_use]
    pub fn planes(&self, visit: &Visit) -> &'a [[f32; 4]] {
        let first = visit.first_plane as usize;
        &self.lists.planes[first..first + visit.n_planes as usize]
    }

    /// Whether an object that moves may be seen: one that stands in `cells` with the box `aabb`.
    ///
    /// For what is not in the world's lists: ask for each object and frame, with the cell of its
    /// [`Follower`](crate::Follower) and those behind portals that its box reaches into. Costs a few box
    /// tests for each visit of these cells. A box may be infinite; one with a coordinate that is no number is never seen.
    #[must_use]
    pub fn sees_box(&self, cells: &[CellId], aabb: [[f32; 3]; 2]) -> bool {
        let [low, high] = aabb;
        if aabb.as_flattened().iter().any(|x| x.is_nan()) {
            return false;
        }
        let is_inside = |plane: &[f32; 4]| {
            let far = (0..3).map(|k| plane[k] * if plane[k] >= 0.0 { high[k] } else { low[k] });
            let reach = far.sum::<f32>() + plane[3];
            // Of an infinite box, what is no number counts as inside.
            reach >= 0.0 || reach.is_nan()
        };
        self.visits()
            .iter()
            .filter(|v| cells.contains(&v.cell))
            .any(|v| self.planes(v).iter().all(is_inside))
    }

    /// The visible cells, each once, near to far.
    #[must_use]
    pub fn cells(&self) -> &'a [CellId] {
        &self.lists.cells
    }

    /// The portals that something is seen through, each once.
    #[must_use]
    pub fn portals(&self) -> &'a [PortalId] {
        &self.lists.portals
    }

    /// The portals that cover less than [`SeeOptions::min_share`](crate::SeeOptions::min_share) of the
    /// screen, each once, with the cell behind: which may be visible through another portal.
    #[must_use]
    pub fn stopped(&self) -> &'a [(PortalId, CellId)] {
        &self.lists.stopped
    }

    /// The visible chunks of structural batches, each once, by cells near to far.
    #[must_use]
    pub fn chunks(&self) -> &'a [ChunkId] {
        &self.lists.chunks
    }

    /// The visible detail objects, each once, by cells near to far.
    #[must_use]
    pub fn details(&self) -> &'a [DetailId] {
        &self.lists.details
    }

    /// Triangles of the visible chunks and details.
    #[must_use]
    pub fn n_triangles(&self) -> u64 {
        self.lists.n_triangles
    }

    /// What it took.
    #[must_use]
    pub fn counts(&self) -> SeeCounts {
        self.lists.counts
    }
}

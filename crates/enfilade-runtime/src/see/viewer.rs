//! Options of a viewer, and its buffers, kept from frame to frame.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fmt;

use glam::DVec3;

use super::stops::Stops;
use super::window::{NONE, Stepping};
use crate::occluder::Shadows;
use crate::region::{Clipper, Narrowing, Region};
use crate::seen::{Lists, SeeCounts};
use crate::sight::Sight;

/// Options of a [`Viewer`].
#[derive(Clone, Copy, Debug)]
pub struct SeeOptions {
    /// Method of narrowing the view at portals.
    pub narrowing: Narrowing,
    /// True if large polygons inside cells hide the things behind them.
    pub occlusion: bool,
    /// True if the visibility precomputed for the eye's cell (`enfilade pvs --parts`) bounds the answer.
    pub precomputed: bool,
    /// Maximum number of portals clipped; after that, all cells within reach count as visible.
    pub max_clips: u32,
    /// Smallest portal followed, as its rectangle's share of the screen. Smaller ones are listed in
    /// [`Seen::stopped`](crate::Seen::stopped), for the caller to draw a cheap stand-in (Gjørup 1999, section 2.3.2; Dirkse
    /// 2002, section 4.1.1). [Limit: 0 to 1; only at 0 are answers supersets]
    pub min_share: f32,
}

impl Default for SeeOptions {
    fn default() -> Self {
        Self {
            narrowing: Narrowing::PolygonOf(8),
            occlusion: true,
            precomputed: true,
            max_clips: 20_000,
            min_share: 0.0,
        }
    }
}

pub(super) struct Pending {
    pub(super) cell: u32,
    pub(super) via: u32,
    pub(super) region: Region,
    /// World-space normal of the portal entered by, and its distance from the eye; the visible part lies beyond.
    pub(super) entry: Option<(DVec3, f64)>,
    pub(super) near: f64,
    /// Next visit of the same cell.
    pub(super) next: u32,
    pub(super) state: Stage,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Stage {
    Waiting,
    Entered,
    /// Joined to another.
    Gone,
}

/// State of a cell in the current face; valid while `stamp` is current.
#[derive(Clone, Copy)]
pub(super) struct Mark {
    pub(super) stamp: u32,
    pub(super) head: u32,
    pub(super) n_waiting: u8,
    pub(super) n_entered: u8,
}

/// Queries visibility for one eye, frame by frame. Keeps its buffers: allocates nothing once they have
/// grown to the needs of the world's views.
///
/// Memory: 16 bytes per cell, 8 bytes per portal, 4 bytes per chunk and detail.
pub struct Viewer {
    pub(super) options: SeeOptions,
    pub(super) stops: Stops,
    pub(super) marks: Vec<Mark>,
    pub(super) cell_stamps: Vec<u32>,
    pub(super) portal_stamps: Vec<u32>,
    pub(super) stop_stamps: Vec<u32>,
    pub(super) special_stamps: Vec<u32>,
    pub(super) item_stamps: Vec<u32>,
    /// A bit per chunk and detail: set if it may be seen from the eye's cell. Valid if `is_bounded`.
    pub(super) allowed: Vec<u64>,
    pub(super) is_bounded: bool,
    pub(super) face_stamp: u32,
    pub(super) frame_stamp: u32,
    pub(super) pending: Vec<Pending>,
    pub(super) queue: BinaryHeap<Reverse<(u64, u32)>>,
    pub(super) clipper: Clipper,
    pub(super) shadows: Shadows,
    pub(super) out: Lists,
    pub(super) stepping: Stepping,
}

impl fmt::Debug for Viewer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Viewer")
            .field("options", &self.options)
            .finish_non_exhaustive()
    }
}

impl Viewer {
    /// Makes a viewer of `sight` with default options.
    #[must_use]
    pub fn new(sight: &Sight) -> Self {
        Self::with_options(sight, SeeOptions::default())
    }

    /// Makes a viewer of `sight`.
    #[must_use]
    pub fn with_options(sight: &Sight, options: SeeOptions) -> Self {
        let mark = Mark {
            stamp: 0,
            head: NONE,
            n_waiting: 0,
            n_entered: 0,
        };
        Self {
            options,
            stops: Stops::default(),
            marks: vec![mark; sight.n_cells()],
            cell_stamps: vec![0; sight.n_cells()],
            portal_stamps: vec![0; sight.n_portals()],
            stop_stamps: vec![0; sight.n_portals()],
            special_stamps: vec![0; sight.n_specials()],
            item_stamps: vec![0; sight.drawn.chunks.len() + sight.drawn.details.len()],
            allowed: Vec::new(),
            is_bounded: false,
            face_stamp: 0,
            frame_stamp: 0,
            pending: Vec::new(),
            queue: BinaryHeap::new(),
            clipper: Clipper::new(),
            shadows: Shadows::new(),
            out: Lists::default(),
            stepping: Stepping::default(),
        }
    }

    /// Returns the options, which may be changed between queries.
    pub fn options_mut(&mut self) -> &mut SeeOptions {
        &mut self.options
    }

    /// Returns the portals at which views stop, which may be changed between queries.
    pub fn stops_mut(&mut self) -> &mut Stops {
        &mut self.stops
    }

    /// Loads the precomputed visibility of the eye's cell, if the world has it.
    pub(super) fn bound_by(&mut self, sight: &Sight, cell: u32) {
        let Some(seen) = sight
            .drawn
            .seen_from
            .as_ref()
            .filter(|_| self.options.precomputed)
        else {
            return;
        };
        self.allowed.clear();
        self.allowed.resize(self.item_stamps.len().div_ceil(64), 0);
        for &[first, end] in seen.runs_of(cell as usize) {
            for item in first..end {
                self.allowed[item as usize / 64] |= 1 << (item % 64);
            }
        }
        self.is_bounded = true;
    }

    pub(super) fn begin(&mut self) {
        self.is_bounded = false;
        self.stepping.gate = None;
        let out = &mut self.out;
        out.visits.clear();
        out.planes.clear();
        out.cells.clear();
        out.portals.clear();
        out.stopped.clear();
        out.specials.clear();
        out.chunks.clear();
        out.details.clear();
        out.n_triangles = 0;
        out.counts = SeeCounts::default();
        if self.frame_stamp == u32::MAX {
            self.cell_stamps.fill(0);
            self.portal_stamps.fill(0);
            self.stop_stamps.fill(0);
            self.special_stamps.fill(0);
            self.item_stamps.fill(0);
            self.frame_stamp = 0;
        }
        self.frame_stamp += 1;
    }
}

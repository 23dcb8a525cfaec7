//! Portal traversal: visibility from one eye, frame by frame.
//!
//! Starting in the eye's cell, cross each portal whose outline survives clipping to the current view, and
//! narrow the view to the surviving part (Luebke & Georges, "Portals and Mirrors", I3D 1995; Dirkse 2002,
//! chapter 3; Gjørup 1999, section 2.3.4). Unlike these, we do not search depth first but nearest first,
//! from a queue:
//!
//! - A visit is a cell, a `Region` of the screen and the plane of the portal entered by, beyond which
//!   it begins. It holds nothing of the path that led there, so two visits of a cell can be compared: one
//!   contained in another adds nothing and is not entered. This also replaces Dirkse's lock against
//!   endless loops.
//! - While visits of a cell wait, they are joined if that wastes little (his section 8.4).
//! - After 12 visits, the next joins all regions so far, and the last takes the whole screen. So a cell is
//!   entered at most 16 times and an exit clipped at most 16 times, however the portals lie: linear in the
//!   exits within reach.
//!
//! **Errs to visible**, everywhere: see `region.rs` for rounding. If the budget runs out, everything left
//! within reach is visible; an eye in no cell sees every cell in its view.

mod listing;
mod queue;
mod steps;
mod stops;
mod traversal;
mod viewer;
mod window;

use enfilade_cpg::CellId;

use crate::boxes::Planes;
use crate::seen::Seen;
use crate::sight::Sight;
use crate::state::SightState;
use crate::view::View;
use traversal::Traversal;

pub use steps::StepQuestion;
pub use stops::Stops;
pub use viewer::{SeeOptions, Viewer};
pub use window::{Crossing, Gate, SpecialView, Window};

impl Viewer {
    /// Returns everything in `view` that is visible in `sight` with the doors of `state`. `sight` must be the one
    /// that the viewer was made for, or of a world with as many cells, portals, chunks and details.
    ///
    /// Time grows with the visible part, not with the world: a few microseconds for rooms. Allocates only
    /// while buffers grow.
    ///
    /// # Panics
    ///
    /// If `sight` is of a larger world than the viewer was made for.
    pub fn see<'a>(&'a mut self, sight: &Sight, state: &SightState, view: &View) -> Seen<'a> {
        let start = sight.locator.locate(view.eye).map(|c| c.0);
        self.see_in(sight, state, view, start)
    }

    /// As [`Viewer::see`], for an eye whose cell is known, from a [`Follower`](crate::Follower) or because
    /// there is no locator. The answer is wrong if the eye is not in `cell`.
    ///
    /// # Panics
    ///
    /// As [`Viewer::see`], and if there is no such cell.
    pub fn see_from<'a>(
        &'a mut self,
        sight: &Sight,
        state: &SightState,
        view: &View,
        cell: CellId,
    ) -> Seen<'a> {
        self.see_in(sight, state, view, Some(cell.0))
    }

    fn see_in<'a>(
        &'a mut self,
        sight: &Sight,
        state: &SightState,
        view: &View,
        start: Option<u32>,
    ) -> Seen<'a> {
        self.begin();
        for face in 0..view.n_faces {
            let mut traversal = Traversal {
                viewer: self,
                sight,
                state,
                view,
                face: &view.faces[face],
                face_index: face as u8,
                planes: Planes::new(view.eye, sight.extent),
                slack: sight.tolerance * view.faces[face].stretch,
            };
            traversal.start(start);
            traversal.run();
        }
        Seen { lists: &self.out }
    }

    /// Returns everything in `view` as if nothing hid anything: each cell, chunk and detail whose box meets it.
    /// For comparison, and for programs that draw through walls.
    ///
    /// # Panics
    ///
    /// As [`Viewer::see`].
    pub fn see_through_walls<'a>(&'a mut self, sight: &Sight, view: &View) -> Seen<'a> {
        self.begin();
        let state = SightState::new_empty();
        let occlusion = std::mem::replace(&mut self.options.occlusion, false);
        for face in 0..view.n_faces {
            let mut traversal = Traversal {
                viewer: self,
                sight,
                state: &state,
                view,
                face: &view.faces[face],
                face_index: face as u8,
                planes: Planes::new(view.eye, sight.extent),
                slack: sight.tolerance * view.faces[face].stretch,
            };
            traversal.begin_face();
            traversal.enter_all_in_view();
        }
        self.options.occlusion = occlusion;
        Seen { lists: &self.out }
    }
}

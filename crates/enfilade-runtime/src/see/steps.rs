//! Queries in steps, for worlds that move within worlds: each world has its own [`Sight`] and its own [`Viewer`], and
//! the part of one that is visible through an opening of another is passed on as a [`Window`].

use enfilade_cpg::CellId;

use super::traversal::Traversal;
use super::viewer::Viewer;
use super::window::{Crossing, Gate, NONE, SpecialView, Window};
use crate::boxes::Planes;
use crate::seen::Seen;
use crate::sight::Sight;
use crate::state::SightState;
use crate::view::View;

/// A stepped query for one face of a view of one world.
#[derive(Clone, Copy)]
pub struct StepQuestion<'a> {
    /// The world.
    pub sight: &'a Sight,
    /// State of its doors.
    pub state: &'a SightState,
    /// The view, in the world's own frame.
    pub view: &'a View,
    /// Index of the view's face. [Limit: below `view.n_faces()`]
    pub face: usize,
    /// The cell that stands for the surroundings of the world: a view that reaches it through a portal leaves the world.
    pub border: Option<CellId>,
    /// Per cell, `true` if visits of it are [recorded](crate::Viewer::take_crossings).
    pub is_watched: &'a [bool],
    /// The special portal through which the view comes, if any.
    pub gate: Option<Gate>,
}

/// Stepped queries: [`begin_steps`](Viewer::begin_steps); for each face of the view [`begin_face`](Viewer::begin_face), then
/// any number of [`add_eye`](Viewer::add_eye) and [`add_window`](Viewer::add_window), each followed by
/// [`advance`](Viewer::advance); at last [`answer`](Viewer::answer). Precomputed visibility does not bound the answer.
///
/// Terminates: a window within earlier ones adds nothing, and a cell is entered at most 16 times per face.
impl Viewer {
    /// Begins a query.
    #[doc(hidden)]
    pub fn begin_steps(&mut self) {
        self.begin();
        self.stepping.crossings.clear();
        self.stepping.specials.clear();
    }

    /// Begins one face of the query.
    #[doc(hidden)]
    pub fn begin_face(&mut self, question: &StepQuestion) {
        self.stepping.border = question.border.map(|c| c.0);
        self.stepping.gate = question.gate;
        self.stepping.is_watched.clear();
        let is_watched = question.is_watched;
        self.stepping.is_watched.extend_from_slice(is_watched);
        self.traversal(question).begin_face();
    }

    /// Adds the eye, in a cell or in none.
    #[doc(hidden)]
    pub fn add_eye(&mut self, question: &StepQuestion, cell: Option<CellId>) {
        self.stepping.is_on = true;
        let precomputed = std::mem::replace(&mut self.options.precomputed, false);
        self.traversal(question).add_eye(cell.map(|c| c.0));
        self.options.precomputed = precomputed;
        self.stepping.is_on = false;
    }

    /// Adds the view of a cell through a part of the screen.
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    #[doc(hidden)]
    pub fn add_window(&mut self, question: &StepQuestion, cell: CellId, window: &Window) {
        let Window {
            region,
            entry,
            near,
        } = *window;
        let entry = entry.or(self.stepping.entry());
        self.traversal(question)
            .push(cell.0, NONE, region, entry, near);
    }

    /// Continues the traversal from everything added so far.
    #[doc(hidden)]
    pub fn advance(&mut self, question: &StepQuestion) {
        self.stepping.is_on = true;
        self.traversal(question).run();
        self.stepping.is_on = false;
    }

    /// Appends to `into` the visits of watched cells and of the border since the last call.
    #[doc(hidden)]
    pub fn take_crossings(&mut self, into: &mut Vec<Crossing>) {
        into.append(&mut self.stepping.crossings);
    }

    /// Appends to `into` the views of special portals since the last call, in no order.
    #[doc(hidden)]
    pub fn take_specials(&mut self, into: &mut Vec<SpecialView>) {
        into.append(&mut self.stepping.specials);
    }

    /// Returns everything seen so far.
    #[must_use]
    #[doc(hidden)]
    pub fn answer(&self) -> Seen<'_> {
        Seen { lists: &self.out }
    }

    fn traversal<'v, 'a>(&'v mut self, question: &StepQuestion<'a>) -> Traversal<'v, 'a> {
        let StepQuestion {
            sight,
            state,
            view,
            face,
            ..
        } = *question;
        Traversal {
            viewer: self,
            sight,
            state,
            view,
            face: &view.faces[face],
            face_index: face as u8,
            planes: Planes::new(view.eye, sight.extent),
            slack: sight.tolerance * view.faces[face].stretch,
        }
    }
}

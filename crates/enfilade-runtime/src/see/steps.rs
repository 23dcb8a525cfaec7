//! A question asked in steps, for worlds that move within worlds: each world has its own [`Sight`] and its own [`Viewer`], and
//! what is seen of one through an opening of another is handed on as a [`Window`].

use enfilade_cpg::CellId;

use super::traversal::Traversal;
use super::viewer::Viewer;
use super::window::{Crossing, NONE, Window};
use crate::boxes::Planes;
use crate::seen::Seen;
use crate::sight::Sight;
use crate::state::SightState;
use crate::view::View;

/// One face of a view of one world that is asked in steps.
#[derive(Clone, Copy)]
pub struct StepQuestion<'a> {
    /// The world.
    pub sight: &'a Sight,
    /// How its doors stand.
    pub state: &'a SightState,
    /// The view, in the world's own frame.
    pub view: &'a View,
    /// Which of the view's faces. [Limit: below `view.n_faces()`]
    pub face: usize,
    /// The cell that is no place but all that is around the world: a view that reaches it through a portal leaves the world.
    pub border: Option<CellId>,
    /// By cell, whether visits of it are [told](crate::Viewer::take_crossings).
    pub is_watched: &'a [bool],
}

/// In steps: [`begin_steps`](Viewer::begin_steps); for each face of the view [`begin_face`](Viewer::begin_face), then
/// [`add_eye`](Viewer::add_eye) and [`add_window`](Viewer::add_window) as often as something comes, each time
/// [`advance`](Viewer::advance); at last [`answer`](Viewer::answer). What is computed before run-time does not bound the answer.
///
/// Ends: a window within what was seen before adds nothing, and a cell is entered at most 16 times a face.
impl Viewer {
    /// Begins a question.
    pub fn begin_steps(&mut self) {
        self.begin();
        self.stepping.crossings.clear();
    }

    /// Begins a face of it.
    pub fn begin_face(&mut self, question: &StepQuestion) {
        self.stepping.border = question.border.map(|c| c.0);
        self.stepping.is_watched.clear();
        let is_watched = question.is_watched;
        self.stepping.is_watched.extend_from_slice(is_watched);
        self.traversal(question).begin_face();
    }

    /// The eye, in a cell, or in none.
    pub fn add_eye(&mut self, question: &StepQuestion, cell: Option<CellId>) {
        self.stepping.is_on = true;
        let precomputed = std::mem::replace(&mut self.options.precomputed, false);
        self.traversal(question).add_eye(cell.map(|c| c.0));
        self.options.precomputed = precomputed;
        self.stepping.is_on = false;
    }

    /// What is seen of a cell through a part of the screen.
    ///
    /// # Panics
    ///
    /// When there is no such cell.
    pub fn add_window(&mut self, question: &StepQuestion, cell: CellId, window: &Window) {
        let Window {
            region,
            entry,
            near,
        } = *window;
        self.traversal(question)
            .push(cell.0, NONE, region, entry, near);
    }

    /// Follows what was added.
    pub fn advance(&mut self, question: &StepQuestion) {
        self.stepping.is_on = true;
        self.traversal(question).run();
        self.stepping.is_on = false;
    }

    /// Moves what has come to watched cells and to the border since the last time to the end of `into`.
    pub fn take_crossings(&mut self, into: &mut Vec<Crossing>) {
        into.append(&mut self.stepping.crossings);
    }

    /// What was seen so far.
    #[must_use]
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

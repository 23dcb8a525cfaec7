//! Visibility in a world and in the worlds that move in it.
//!
//! Each part is followed by its own [`Viewer`], in its own frame. A view that leaves a part through one of its doors continues in
//! the surrounding places behind the door, and in the doors that it meets; a view of a cell in which parts stand continues in
//! these from outside. The part of the screen is passed on unchanged: it depends on the eye alone, not on the frame. Parts take
//! turns until none has anything new, which ends because each adds only what it had not seen.

use enfilade_cpg::CellId;
use enfilade_runtime::{Crossing, SeeOptions, Seen, StepQuestion, View, Viewer, Window};

use crate::space::{PartId, Place, Space};

/// Queries visibility in a [`Space`] for one eye, frame by frame; keeps its buffers.
pub struct SpaceViewer {
    parts: Vec<PartView>,
    options: SeeOptions,
    queue: Vec<(PartId, CellId, Window)>,
    crossings: Vec<Crossing>,
    seen: Vec<PartId>,
}

struct PartView {
    viewer: Viewer,
    /// In the part's frame; `None` until the query reaches the part.
    view: Option<View>,
    /// True if the current face was begun.
    is_begun: bool,
}

impl SpaceViewer {
    /// Makes a viewer of `space` with default options.
    #[must_use]
    pub fn new(space: &Space) -> Self {
        Self::with_options(space, SeeOptions::default())
    }

    /// Makes a viewer of `space`.
    #[must_use]
    pub fn with_options(space: &Space, options: SeeOptions) -> Self {
        let mut viewer = Self {
            parts: Vec::new(),
            options,
            queue: Vec::new(),
            crossings: Vec::new(),
            seen: Vec::new(),
        };
        viewer.grow(space);
        viewer
    }

    /// Makes room for added parts.
    fn grow(&mut self, space: &Space) {
        for part in &space.parts[self.parts.len()..] {
            self.parts.push(PartView {
                viewer: Viewer::with_options(&part.sight, self.options),
                view: None,
                is_begun: false,
            });
        }
    }

    /// Returns everything that `view`, in the frame of part `frame`, sees. A view in the frame of the part that the eye is in is
    /// exact wherever that part is.
    ///
    /// Time grows with the visible part, and a little with the number of parts. Allocates only while buffers grow.
    ///
    /// # Panics
    ///
    /// If there is no such part, or `space` is not the one that the viewer was made for.
    pub fn see<'a>(&'a mut self, space: &Space, frame: PartId, view: &View) -> SpaceSeen<'a> {
        self.grow(space);
        for id in self.seen.drain(..) {
            self.parts[id.idx()].view = None;
        }
        let eye = enfilade_geom::DVec3::from_array(view.eye().map(f64::from));
        let at = space.locate(frame, eye);
        for face in 0..view.n_faces() {
            for &id in &self.seen {
                self.parts[id.idx()].is_begun = false;
            }
            self.see_face(space, frame, view, face, at);
        }
        self.seen.sort_unstable();
        SpaceSeen { viewer: self }
    }

    fn see_face(
        &mut self,
        space: &Space,
        frame: PartId,
        view: &View,
        face: usize,
        at: Option<Place>,
    ) {
        // An eye in no cell sees everything in view, of all parts.
        let start = at.map_or(PartId::ROOT, |place| place.part);
        self.begin(space, frame, view, face, start);
        let part = &mut self.parts[start.idx()];
        let question = question_of(space, start, part.view.as_ref().unwrap_or(view), face);
        part.viewer.add_eye(&question, at.map(|place| place.cell));
        part.viewer.advance(&question);
        part.viewer.take_crossings(&mut self.crossings);
        self.hand_on(space, start);
        if let Some(place) = at {
            // An eye in the seam of two parts is in both.
            let eye = enfilade_geom::DVec3::from_array(view.eye().map(f64::from));
            let eye = space.between(frame, start).point(eye);
            let queue = &mut self.queue;
            space.for_each_beyond(place, eye, |other, portal, cell| {
                if space.parts[other.idx()].state.is_open(portal) {
                    queue.push((other, cell, Window::screen()));
                }
            });
        }
        if at.is_none() {
            for id in (1..space.parts.len() as u32).map(PartId) {
                if let Some(border) = space.parts[id.idx()].border {
                    self.queue.push((id, border, Window::screen()));
                }
            }
        }
        while let Some((id, cell, window)) = self.queue.pop() {
            self.begin(space, frame, view, face, id);
            let part = &mut self.parts[id.idx()];
            let question = question_of(space, id, part.view.as_ref().unwrap_or(view), face);
            part.viewer.add_window(&question, cell, &window);
            part.viewer.advance(&question);
            part.viewer.take_crossings(&mut self.crossings);
            self.hand_on(space, id);
        }
    }

    /// Prepares a part for a face, if necessary.
    fn begin(&mut self, space: &Space, frame: PartId, view: &View, face: usize, id: PartId) {
        let part = &mut self.parts[id.idx()];
        if part.view.is_none() {
            let to_frame = space.between(id, frame);
            part.view = Some(view.in_frame(&to_frame.matrix3(), to_frame.at));
            part.viewer.begin_steps();
            part.is_begun = false;
            self.seen.push(id);
        }
        let part = &mut self.parts[id.idx()];
        if !part.is_begun {
            part.is_begun = true;
            let question = question_of(space, id, part.view.as_ref().unwrap_or(view), face);
            part.viewer.begin_face(&question);
        }
    }

    /// Queues the continuations in other parts.
    fn hand_on(&mut self, space: &Space, from: PartId) {
        let own = &space.parts[from.idx()];
        let queue = &mut self.queue;
        let mut add = |to: PartId, cell: CellId, window: &Window| {
            let turn = space.between(to, from).matrix3();
            queue.push((to, cell, window.in_frame(&turn)));
        };
        for crossing in self.crossings.drain(..) {
            let window = &crossing.window;
            if own.border != Some(crossing.cell) {
                for &guest in &own.guests[crossing.cell.idx()] {
                    if let Some(border) = space.parts[guest.idx()].border {
                        add(guest, border, window);
                    }
                }
                continue;
            }
            let is_way = |portal| crossing.via.is_none_or(|via| via == portal);
            for door in own.doors.iter().filter(|d| is_way(d.portal)) {
                for place in &door.leads_to {
                    add(place.part, place.cell, window);
                }
                for &(other, portal) in &door.meets {
                    let its = &space.parts[other.idx()];
                    if let Some(border) = its.border {
                        // Its door may be nearer than the one that the view leaves by.
                        let radius = its.layout.opening(portal).radius();
                        add(other, border, &window.earlier(space.docking.depth(radius)));
                    }
                }
            }
        }
    }
}

fn question_of<'a>(space: &'a Space, id: PartId, view: &'a View, face: usize) -> StepQuestion<'a> {
    let part = &space.parts[id.idx()];
    StepQuestion {
        sight: &part.sight,
        state: &part.state,
        view,
        face,
        border: part.border,
        is_watched: &part.has_guests,
    }
}

/// The answer to a view, part by part.
#[derive(Clone, Copy)]
pub struct SpaceSeen<'a> {
    viewer: &'a SpaceViewer,
}

impl<'a> SpaceSeen<'a> {
    /// Returns the visible parts, ascending, each with its visible contents in its own frame: draw them at its
    /// [pose](Space::pose). The border cell of a part stands for its outside.
    pub fn parts(&self) -> impl ExactSizeIterator<Item = (PartId, Seen<'a>)> + use<'a> {
        let viewer = self.viewer;
        let answer = |id: &PartId| (*id, viewer.parts[id.idx()].viewer.answer());
        viewer.seen.iter().map(answer)
    }

    /// Returns the visible contents of one part; `None` if nothing of it is seen.
    #[must_use]
    pub fn of_part(&self, part: PartId) -> Option<Seen<'a>> {
        let is_seen = self.viewer.seen.binary_search(&part).is_ok();
        is_seen.then(|| self.viewer.parts[part.idx()].viewer.answer())
    }
}

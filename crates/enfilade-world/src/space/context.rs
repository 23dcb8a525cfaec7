//! Contexts of a view: the worlds as seen by one eye, real or moved by special portals.

use enfilade_cpg::{CellId, SpecialId};
use enfilade_geom::{DVec3, Similarity};
use enfilade_runtime::{
    Crossing, Gate, SeeOptions, Seen, SpecialView, StepQuestion, Stops, View, Viewer, Window,
};

use super::{PartId, Place, Space};

/// Buffers of the parts' turns.
#[derive(Default)]
pub(super) struct ViewBuffers {
    pub(super) queue: Vec<(PartId, CellId, Window)>,
    pub(super) crossings: Vec<Crossing>,
    pub(super) views: Vec<SpecialView>,
    /// Special portals in view of a context: by part, then by number.
    pub(super) found: Vec<(PartId, SpecialView)>,
}

/// The worlds as seen by one eye, real or moved by special portals.
pub(super) struct Context {
    pub(super) parts: Vec<PartView>,
    pub(super) seen: Vec<PartId>,
    /// The view, in the frame of a part.
    pub(super) view: Option<View>,
    pub(super) frame: PartId,
    /// Map from that frame to the frame of the query: where things appear.
    pub(super) map: Similarity,
    pub(super) via: Option<SeenVia>,
    pub(super) back: Option<(PartId, SpecialId)>,
    /// The opening by which the view comes in: normal, and height of its plane, in `frame`. `None` if it begins at the eye.
    pub(super) opening: Option<(DVec3, f64)>,
    /// Where the eye is, if the view begins there.
    pub(super) at: Option<Place>,
    /// The plane beyond which the view begins, relative to the eye in `frame`.
    pub(super) gate: Option<(DVec3, f64)>,
    /// Share of the query's screen that the whole screen of this context takes.
    pub(super) share: f64,
    /// True if the view begins at the eye: for the query's own, and for cameras.
    pub(super) is_direct: bool,
    /// Where the view of the current face begins.
    pub(super) starts: Vec<(CellId, Option<Window>)>,
    pub(super) rectangle: [f64; 4],
    /// Portals of the root at which the view stops.
    pub(super) stops: Stops,
}

pub(super) struct PartView {
    /// Made when first needed.
    pub(super) viewer: Option<Viewer>,
    /// In the part's frame; `None` until the query reaches the part.
    pub(super) view: Option<View>,
    /// True if the current face was begun.
    pub(super) is_begun: bool,
}

/// The special portal in which a context is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SeenVia {
    /// Index of the context that sees it.
    pub parent: usize,
    /// Its part.
    pub part: PartId,
    /// The special portal.
    pub special: SpecialId,
    /// Index of the pass that shows this context.
    pub pass: usize,
}

/// A special portal that was not looked into.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct StoppedSpecial {
    /// The special portal, and the context that sees it.
    pub via: SeenVia,
    /// Its share of the screen.
    pub share: f32,
}

impl Context {
    pub(super) fn answer(&self, part: PartId) -> Seen<'_> {
        let viewer = self.parts[part.idx()].viewer.as_ref();
        viewer.expect("a seen part has a viewer").answer()
    }

    /// Returns `true` if no line of sight of this context meets a special portal, which tolerances alone would show: it lies in the
    /// plane of the opening by which the view comes in, or before it; or it is the other side of the doorway in which the eye
    /// is, of which the eye's cell sees a special side, too. Without this, views that come out at a doorway with panes would be handed to and fro there.
    pub(super) fn never_meets(&self, space: &Space, part: PartId, special: SpecialId) -> bool {
        if self.back == Some((part, special)) {
            return true;
        }
        let layout = space.layout(part);
        let opening = layout.special_opening(special);
        let near = 4.0 * layout.tolerance();
        if let Some((normal, height)) = self.opening {
            let to_frame = space.between(part, self.frame);
            let mut vertices = opening.pieces().flatten();
            return vertices.all(|p| normal.dot(to_frame.point(*p)) <= height + near);
        }
        let (Some(at), Some(eye)) = (self.at, self.view.as_ref().map(View::exact_eye)) else {
            return false;
        };
        let eye = space.between(self.frame, part).point(eye);
        let graph = &space.parts[part.idx()].world.graph;
        let is_other_side = || {
            let own = layout.portal_of_special(special);
            let of_eye = own.and_then(|portal| graph.special_side(portal, at.cell));
            of_eye.is_some_and(|side| side != special)
        };
        at.part == part && opening.height_of(eye).abs() <= near && is_other_side()
    }

    pub(super) fn begin_face(&mut self) {
        for &id in &self.seen {
            self.parts[id.idx()].is_begun = false;
        }
    }

    /// Adds the eye in a cell of a part, or in no cell.
    pub(super) fn add_eye(
        &mut self,
        space: &Space,
        options: &SeeOptions,
        face: usize,
        part: PartId,
        cell: Option<CellId>,
        buffers: &mut ViewBuffers,
    ) {
        self.turn(space, options, face, part, buffers, |viewer, question| {
            viewer.add_eye(question, cell);
        });
        let (Some(cell), Some(eye)) = (cell, self.view.as_ref().map(View::exact_eye)) else {
            return;
        };
        // An eye in the seam of two parts is in both.
        let eye = space.between(self.frame, part).point(eye);
        let queue = &mut buffers.queue;
        space.for_each_beyond(Place { part, cell }, eye, |other, portal, cell| {
            if space.parts[other.idx()].state.is_open(portal) {
                queue.push((other, cell, Window::screen()));
            }
        });
    }

    /// Follows everything queued, and what it leads to.
    pub(super) fn follow(
        &mut self,
        space: &Space,
        options: &SeeOptions,
        face: usize,
        buffers: &mut ViewBuffers,
    ) {
        while let Some((id, cell, window)) = buffers.queue.pop() {
            self.turn(space, options, face, id, buffers, |viewer, question| {
                viewer.add_window(question, cell, &window);
            });
        }
    }

    /// Gives a part its turn: begins it if necessary, adds to its view, follows it, and queues the continuations elsewhere.
    fn turn(
        &mut self,
        space: &Space,
        options: &SeeOptions,
        face: usize,
        id: PartId,
        buffers: &mut ViewBuffers,
        add: impl FnOnce(&mut Viewer, &StepQuestion<'_>),
    ) {
        let Some(of_frame) = &self.view else { return };
        while self.parts.len() <= id.idx() {
            self.parts.push(PartView {
                viewer: None,
                view: None,
                is_begun: false,
            });
        }
        let own = &mut self.parts[id.idx()];
        let sight = &space.parts[id.idx()].sight;
        let viewer = (own.viewer).get_or_insert_with(|| Viewer::with_options(sight, *options));
        let to_frame: Similarity = space.between(id, self.frame).into();
        if own.view.is_none() {
            own.view = Some(of_frame.in_frame(&to_frame));
            viewer.begin_steps();
            if id == PartId::ROOT {
                viewer.stops_mut().clone_from(&self.stops);
            }
            own.is_begun = false;
            self.seen.push(id);
        }
        let part = &space.parts[id.idx()];
        let question = StepQuestion {
            sight,
            state: &part.state,
            view: own.view.as_ref().unwrap_or(of_frame),
            face,
            border: part.border,
            is_watched: &part.has_guests,
            gate: (!self.is_direct).then(|| Gate {
                back: self.back.filter(|back| back.0 == id).map(|back| back.1),
                plane: (self.gate).map(|(n, h)| (to_frame.turn.conjugate() * n, h)),
            }),
        };
        if !own.is_begun {
            own.is_begun = true;
            viewer.begin_face(&question);
        }
        add(viewer, &question);
        viewer.advance(&question);
        viewer.take_crossings(&mut buffers.crossings);
        viewer.take_specials(&mut buffers.views);
        let views = buffers.views.drain(..).map(|view| (id, view));
        buffers.found.extend(views);
        hand_on(space, id, buffers);
    }
}

/// Queues the continuations in other parts.
fn hand_on(space: &Space, from: PartId, buffers: &mut ViewBuffers) {
    let own = &space.parts[from.idx()];
    let queue = &mut buffers.queue;
    let mut add = |to: PartId, cell: CellId, window: &Window| {
        let map = space.between(to, from).into();
        queue.push((to, cell, window.in_frame(&map)));
    };
    for crossing in buffers.crossings.drain(..) {
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
            let around = door.leads_to.iter().filter(|_| !door.is_covered);
            for place in around {
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

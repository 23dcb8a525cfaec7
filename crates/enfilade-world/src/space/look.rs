//! Visibility in a world, in the worlds that move in it, and through special portals.
//!
//! Each part is followed by its own [`Viewer`](enfilade_runtime::Viewer), in its own frame. A view that leaves a part through one of its doors continues in
//! the surrounding places behind the door, and in the doors that it meets; a view of a cell in which parts stand continues in
//! these from outside. The part of the screen is passed on unchanged: it depends on the eye alone, not on the frame. Parts take
//! turns until none has anything new, which ends because each adds only what it had not seen.
//!
//! A special portal opens another *context* (Dirkse 2002, section 6.1.2): the same worlds, seen by an eye that is moved, turned,
//! scaled or reflected by the special portal's map, through the part of the screen that the special portal covers, and from its
//! plane on. Each context has its own record of what was visited, so a room is seen once directly and once more in each mirror.
//! Contexts form a tree: a mirror in a mirror is a context of its own. The largest on the screen come first; a context ends the
//! recursion where it covers less than the [least share](SpecialOptions::min_share) of the screen, or where there are
//! [too many](SpecialOptions::max_contexts), which the answer tells. A straight line meets a plane once, so no view returns
//! through the special portal that it came by.

use std::collections::BinaryHeap;
use std::fmt;

use enfilade_cpg::{MonitorCamera, Way};
use enfilade_geom::Similarity;
use enfilade_runtime::{SeeOptions, SpecialView, Stops, View, Window};

use super::context::{Context, SeenVia, StoppedSpecial, ViewBuffers};
use super::seen::SpaceSeen;

use crate::space::{PartId, Space};

/// Bounds of the views through special portals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpecialOptions {
    /// Number of contexts of one query, the direct view included. Each takes the memory of a [`Viewer`](enfilade_runtime::Viewer) for each part that it
    /// reaches. [Limit: at least 1]
    pub max_contexts: usize,
    /// Smallest special portal looked into, as its share of the screen. Smaller ones are listed as
    /// [stopped](SpaceSeen::stopped_specials). [Limit: 0 to 1]
    pub min_share: f32,
    /// Total area of the rectangles around what is drawn apart, and so takes memory for pictures: later passes, which are blended
    /// over the first, and monitors. What is beyond it is listed as stopped. [Units: screens]
    pub max_apart: f32,
}

impl Default for SpecialOptions {
    /// 64 contexts, a share of 1/4096, which is 15 by 15 pixels of a picture of 1280 by 720, and four screens of pictures.
    fn default() -> Self {
        Self {
            max_contexts: 64,
            min_share: 1.0 / 4096.0,
            max_apart: 4.0,
        }
    }
}

/// Queries visibility in a [`Space`] for one eye, frame by frame; keeps its buffers.
pub struct SpaceViewer {
    /// The first is the direct view. Those from `n_contexts` on are spare.
    contexts: Vec<Context>,
    n_contexts: usize,
    options: SeeOptions,
    specials: SpecialOptions,
    /// Stops of the direct view in the root.
    stops: Stops,
    /// Contexts to look into in the current face, the largest on the screen first.
    open: BinaryHeap<Open>,
    stopped: Vec<StoppedSpecial>,
    is_capped: bool,
    /// Total area of the rectangles around what is drawn apart. [Units: screens]
    apart: f64,
    buffers: ViewBuffers,
}

impl fmt::Debug for SpaceViewer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SpaceViewer")
            .field("options", &self.options)
            .field("specials", &self.specials)
            .finish_non_exhaustive()
    }
}

/// A context to look into. Ordered by its share of the screen, then by age.
#[derive(Clone, Copy, PartialEq)]
struct Open {
    share: f64,
    context: usize,
}

impl Eq for Open {}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let by_age = || other.context.cmp(&self.context);
        self.share.total_cmp(&other.share).then_with(by_age)
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// A rectangle around nothing.
const NOTHING: [f64; 4] = [
    f64::INFINITY,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NEG_INFINITY,
];

/// The rectangle around the screen.
const SCREEN: [f64; 4] = [-1.0, -1.0, 1.0, 1.0];

impl SpaceViewer {
    /// Makes a viewer of `space` with default options.
    #[must_use]
    pub fn new(space: &Space) -> Self {
        Self::with_options(space, SeeOptions::default())
    }

    /// Makes a viewer of `space`.
    #[must_use]
    pub fn with_options(_space: &Space, options: SeeOptions) -> Self {
        Self {
            contexts: Vec::new(),
            n_contexts: 0,
            options,
            specials: SpecialOptions::default(),
            stops: Stops::default(),
            open: BinaryHeap::new(),
            stopped: Vec::new(),
            is_capped: false,
            apart: 0.0,
            buffers: ViewBuffers::default(),
        }
    }

    /// Returns the bounds of views through special portals, which may be changed between queries.
    pub fn specials_mut(&mut self) -> &mut SpecialOptions {
        &mut self.specials
    }

    /// Returns the portals of the root at which the direct view stops, which may be changed between queries.
    pub fn stops_mut(&mut self) -> &mut Stops {
        &mut self.stops
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
        self.n_contexts = 0;
        self.stopped.clear();
        self.is_capped = false;
        self.apart = 0.0;
        let root = self.add_context(frame, view.clone(), Similarity::IDENTITY);
        self.contexts[root].stops.clone_from(&self.stops);
        for face in 0..view.n_faces() {
            self.open.clear();
            self.contexts[root].begin_face();
            self.see_directly(space, root, face);
            self.find_specials(space, root);
            while let Some(Open { context, .. }) = self.open.pop() {
                if self.contexts[context].is_direct {
                    self.see_directly(space, context, 0);
                } else {
                    self.see_from_starts(space, context, face);
                }
                self.find_specials(space, context);
            }
        }
        for context in &mut self.contexts[..self.n_contexts] {
            context.seen.sort_unstable();
        }
        SpaceSeen {
            contexts: &self.contexts[..self.n_contexts],
            stopped: &self.stopped,
            is_capped: self.is_capped,
        }
    }

    /// Adds a context that has seen nothing yet; `map` maps the frame of part `frame` to that of the query.
    fn add_context(&mut self, frame: PartId, view: View, map: Similarity) -> usize {
        let index = self.n_contexts;
        self.n_contexts += 1;
        if index == self.contexts.len() {
            self.contexts.push(Context {
                parts: Vec::new(),
                seen: Vec::new(),
                view: None,
                frame,
                map,
                via: None,
                back: None,
                opening: None,
                at: None,
                gate: None,
                share: 1.0,
                is_direct: true,
                starts: Vec::new(),
                rectangle: SCREEN,
                stops: Stops::default(),
            });
        }
        let context = &mut self.contexts[index];
        for id in context.seen.drain(..) {
            context.parts[id.idx()].view = None;
        }
        context.view = Some(view);
        (context.frame, context.map) = (frame, map);
        (context.via, context.back, context.gate) = (None, None, None);
        (context.opening, context.at) = (None, None);
        context.share = 1.0;
        context.is_direct = true;
        context.starts.clear();
        context.rectangle = SCREEN;
        context.stops.clear();
        index
    }

    /// Follows the view of an eye that is where it looks from.
    fn see_directly(&mut self, space: &Space, context: usize, face: usize) {
        let (own, buffers) = (&mut self.contexts[context], &mut self.buffers);
        let Some(eye) = own.view.as_ref().map(View::exact_eye) else {
            return;
        };
        let at = space.locate(own.frame, eye);
        own.at = at;
        // An eye in no cell sees everything in view, of all parts.
        let start = at.map_or(PartId::ROOT, |place| place.part);
        own.add_eye(
            space,
            &self.options,
            face,
            start,
            at.map(|p| p.cell),
            buffers,
        );
        if at.is_none() {
            for id in (1..space.parts.len() as u32).map(PartId) {
                if let Some(border) = space.parts[id.idx()]
                    .border
                    .filter(|_| space.is_present(id))
                {
                    buffers.queue.push((id, border, Window::screen()));
                }
            }
        }
        own.follow(space, &self.options, face, buffers);
    }

    /// Follows the view from the special portal by which it comes.
    fn see_from_starts(&mut self, space: &Space, context: usize, face: usize) {
        let (own, buffers) = (&mut self.contexts[context], &mut self.buffers);
        own.begin_face();
        let frame = own.frame;
        let mut starts = std::mem::take(&mut own.starts);
        for (cell, window) in starts.drain(..) {
            match window {
                Some(window) => buffers.queue.push((frame, cell, window)),
                None => own.add_eye(space, &self.options, face, frame, Some(cell), buffers),
            }
        }
        own.starts = starts;
        own.follow(space, &self.options, face, buffers);
    }

    /// Opens a context for each pass of each special portal in view of a context.
    fn find_specials(&mut self, space: &Space, parent: usize) {
        let mut found = std::mem::take(&mut self.buffers.found);
        found.sort_by_key(|(part, view)| (*part, view.special));
        for views in found.chunk_by(|a, b| a.0 == b.0 && a.1.special == b.1.special) {
            let (part, special) = (views[0].0, views[0].1.special);
            if self.contexts[parent].never_meets(space, part, special) {
                continue;
            }
            let graph = &space.parts[part.idx()].world.graph;
            let share = views.iter().map(|v| v.1.window.share()).sum::<f64>();
            let share = share.min(1.0) * self.contexts[parent].share;
            for pass in 0..graph.specials[special.idx()].passes.len() {
                let via = SeenVia {
                    parent,
                    part,
                    special,
                    pass,
                };
                let is_followed = graph.specials[special.idx()].passes[pass].way != Way::Through;
                if is_followed {
                    self.open_special(space, via, share, views);
                }
            }
        }
        found.clear();
        self.buffers.found = found;
    }

    /// Opens the context of a monitor's picture. A camera without direction shows nothing.
    fn open_monitor(&mut self, space: &Space, via: SeenVia, share: f64, camera: &MonitorCamera) {
        let layout = &space.parts[via.part.idx()].layout;
        let [_, right, up] = layout.special_rectangle(via.special);
        let aspect = (right.length() / up.length()) as f32;
        let view = View::perspective(camera.eye, camera.toward, camera.up, camera.fov_y, aspect);
        if let Ok(view) = view {
            let context = self.add_context(via.part, view, Similarity::IDENTITY);
            let own = &mut self.contexts[context];
            (own.via, own.share) = (Some(via), share);
            own.begin_face();
            self.open.push(Open { share, context });
        }
    }

    /// Opens the context of one pass, or adds to the one that an earlier face has opened.
    fn open_special(
        &mut self,
        space: &Space,
        via: SeenVia,
        share: f64,
        views: &[(PartId, SpecialView)],
    ) {
        let SeenVia {
            parent,
            part,
            special,
            pass,
        } = via;
        let known = self.contexts[..self.n_contexts]
            .iter()
            .position(|c| c.via == Some(via));
        let own = &space.parts[part.idx()];
        let side = &own.world.graph.specials[special.idx()];
        let way = &side.passes[pass].way;
        let around = rectangle_of(views);
        let [l, b, r, t] = around;
        let area = (r - l).max(0.0) * (t - b).max(0.0) * 0.25 * self.contexts[parent].share;
        let is_apart = pass > 0 || matches!(way, Way::Monitor(_));
        let apart = self.apart + if is_apart { area } else { 0.0 };
        if known.is_none() {
            let is_full = self.n_contexts >= self.specials.max_contexts
                || apart > f64::from(self.specials.max_apart);
            if is_full || share < f64::from(self.specials.min_share) {
                self.is_capped |= is_full;
                let share = share as f32;
                self.stopped.push(StoppedSpecial { via, share });
                return;
            }
        }
        if let Way::Monitor(camera) = way {
            if known.is_none() {
                self.apart = apart;
                self.open_monitor(space, via, share, camera);
            }
            return;
        }
        let layout = &own.layout;
        let Some(map) = layout.map_of_pass(special, pass) else {
            return;
        };
        let to = side
            .leads_to()
            .filter(|_| *way != Way::Mirror)
            .map_or(side.cell, |(to, _)| to);
        if own.state.is_locked(to) {
            return;
        }
        let back = match way {
            Way::Lead { back, .. } => *back,
            _ => Some(special),
        };
        // The map leads to the other side, so its inverse leads from the frame of what is seen to where it appears.
        let appears = map.inverse();
        let context = match known {
            Some(context) => context,
            None => {
                let of_parent = &self.contexts[parent];
                let seen_by = of_parent.parts[part.idx()].view.as_ref();
                let Some(view) = seen_by.map(|view| view.in_frame(&appears)) else {
                    return;
                };
                let to_frame = space.between(part, of_parent.frame).into();
                let whole = of_parent.map.after(&to_frame).after(&appears);
                let screen = of_parent.share;
                let polygon = layout.special_opening(special);
                let normal = map.direction(polygon.normal());
                let context = self.add_context(part, view, whole);
                let own = &mut self.contexts[context];
                (own.via, own.share) = (Some(via), screen);
                own.back = back.map(|back| (part, back));
                own.opening = Some((normal, normal.dot(map.point(polygon.center()))));
                own.is_direct = false;
                own.rectangle = NOTHING;
                self.apart = apart;
                context
            }
        };
        let own = &mut self.contexts[context];
        own.starts.clear();
        own.gate = None;
        for (_, view) in views {
            let window = view.window.in_frame(&appears);
            own.gate = window.plane();
            own.starts.push((to, (!view.is_at_eye).then_some(window)));
        }
        own.rectangle = joined(own.rectangle, around);
        // One piece of it near the eye leaves no plane for the others either.
        if views.iter().any(|v| v.1.window.plane().is_none()) {
            own.gate = None;
        }
        self.open.push(Open { share, context });
    }
}

/// Returns the rectangle of the screen around a special portal.
fn rectangle_of(views: &[(PartId, SpecialView)]) -> [f64; 4] {
    let each = views.iter().map(|(_, view)| view.window.rectangle());
    each.fold(NOTHING, joined)
}

/// Returns the rectangle around two.
fn joined([l, b, r, t]: [f64; 4], [left, bottom, right, top]: [f64; 4]) -> [f64; 4] {
    [l.min(left), b.min(bottom), r.max(right), t.max(top)]
}

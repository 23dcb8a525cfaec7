//! The draw list of a frame: ranges of triangles, each once, near to far.
//!
//! A frame must not cost the processor more than the adapter. So adjacent chunks of a batch become one draw; all
//! visible objects of a mesh become one draw, in however many rooms; and buffers are reused from frame to frame.

use std::ops::Range;

use enfilade_cpg::{CellId, PortalId};
use enfilade_runtime::{ChunkId, DetailId, Seen, Sight, SightState, View};
use glam::Vec3;

use crate::scene::{Finish, GpuWorld, Span};

/// Why an object is drawn although it is not visible, for pictures that explain culling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum DrawReason {
    /// It is visible.
    Seen = 0,
    /// It is outside the view frustum.
    OutOfView = 1,
    /// It is in the view frustum, but no chain of portals leads there.
    BehindWalls = 2,
    /// A large polygon of a visible cell hides it.
    Occluded = 3,
}

/// Bits of an instance's index; the bits above hold its reason.
pub(crate) const INSTANCE_MASK: u32 = 0x0fff_ffff;

/// A rectangle of pixels: `[x, y, width, height]`.
pub(crate) type Scissor = [u32; 4];

/// One draw.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    pub(crate) first: u32,
    pub(crate) n: u32,
    pub(crate) texture: u32,
    pub(crate) finish: Finish,
    /// True if its vertices have normals.
    pub(crate) is_smooth: bool,
    /// Range of [`RenderList::instances`].
    pub(crate) instances: Range<u32>,
    /// `None` for the whole picture.
    pub(crate) scissor: Option<Scissor>,
    /// Distance from the eye of a transparent run. [Units: wu]
    pub(crate) distance: f32,
    /// Rank in the world, wherever its triangles lie: chunks, then meshes, then plugs.
    pub(crate) order: u32,
}

impl Run {
    fn of(span: &Span, instances: Range<u32>, scissor: Option<Scissor>, order: usize) -> Self {
        Self {
            order: order as u32,
            first: span.first,
            n: span.n,
            texture: span.texture,
            finish: span.finish,
            is_smooth: span.is_smooth,
            instances,
            scissor,
            distance: 0.0,
        }
    }
}

/// Reductions for distant rooms and objects. All of them change pictures and are off by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sparing {
    /// Portals that cover fewer pixels are not looked through: their outlines are filled with the mean color of
    /// the cell behind. [Units: px²]
    pub stop_below: f32,
    /// True to leave those outlines empty.
    pub stop_at_nothing: bool,
    /// Objects in cells visible through fewer pixels are not drawn; the walls of these cells are. [Units: px²]
    pub objects_below: f32,
    /// Objects use fewer triangles if their surface moves by at most this many pixels; 0 for never. Only for worlds
    /// [loaded with levels](GpuWorld::load_with_levels); applies to frustum culling, too. [Units: px]
    pub lod: f32,
}

/// The picture for which an answer is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Shot<'a> {
    /// The view of the query.
    pub view: &'a View,
    /// The state of doors, such as shut portals.
    pub state: &'a SightState,
    /// Size of the picture. [Units: px]
    pub size: [u32; 2],
    /// True to draw each batch only in the rectangle where its cells are visible.
    pub has_scissors: bool,
}

/// The draws of one frame, in order.
#[derive(Clone, Debug, Default)]
pub struct RenderList {
    pub(crate) opaque: Vec<Run>,
    /// Far to near.
    pub(crate) transparent: Vec<Run>,
    /// Index of each drawn instance, with its reason in the highest four bits. Structure has index 0.
    pub(crate) instances: Vec<u32>,
    /// Polygons drawn in place of cells behind small portals.
    pub(crate) stand_ins: Vec<(PortalId, CellId)>,
    /// Portals filled by textures of what lies behind them.
    pub(crate) doorways: Vec<(PortalId, CellId)>,
    n_triangles: u64,
}

impl RenderList {
    /// Returns the number of drawn triangles.
    #[must_use]
    pub fn n_triangles(&self) -> u64 {
        self.n_triangles
    }

    /// Returns the number of draws.
    #[must_use]
    #[doc(hidden)]
    pub fn n_draws(&self) -> usize {
        self.opaque.len() + self.transparent.len()
    }

    /// Returns the portals drawn as a polygon each instead of the cells behind them.
    #[must_use]
    #[doc(hidden)]
    pub fn stand_ins(&self) -> &[(PortalId, CellId)] {
        &self.stand_ins
    }

    /// Returns the portals drawn as textures of what lies behind them.
    #[must_use]
    #[doc(hidden)]
    pub fn doorways(&self) -> &[(PortalId, CellId)] {
        &self.doorways
    }

    /// Leaves out draws from the end, transparent ones first, until there are `most` triangles.
    pub(crate) fn cut_to(&mut self, most: u64) {
        for runs in [&mut self.transparent, &mut self.opaque] {
            while self.n_triangles > most
                && let Some(last) = runs.last_mut()
            {
                let copies = u64::from(last.instances.end - last.instances.start).max(1);
                let whole = u64::from(last.n / 3) * copies;
                let rest = most.saturating_sub(self.n_triangles - whole);
                self.n_triangles -= whole;
                last.n = (rest / copies) as u32 * 3;
                self.n_triangles += u64::from(last.n / 3) * copies;
                if last.n == 0 {
                    runs.pop();
                } else {
                    break;
                }
            }
        }
    }

    /// Leaves out the transparent surfaces that a cell sees, which frames that see the cell draw on their own.
    pub(crate) fn leave_out_glass_of(&mut self, world: &GpuWorld, cell: CellId) {
        let instances = &self.instances;
        self.transparent.retain(|run| {
            let number = instances[run.instances.start as usize] & INSTANCE_MASK;
            let cells = match number.checked_sub(1) {
                Some(detail) => &world.details[detail as usize].cells,
                None => &world.batch_cells[world.batch_of[run.order as usize] as usize],
            };
            !cells.contains(&cell)
        });
    }

    /// Appends the draws of another list.
    #[doc(hidden)]
    pub fn append(&mut self, other: &Self) {
        let base = self.instances.len() as u32;
        self.instances.extend_from_slice(&other.instances);
        let moved = |run: &Run| Run {
            instances: run.instances.start + base..run.instances.end + base,
            ..run.clone()
        };
        self.stand_ins.extend_from_slice(&other.stand_ins);
        self.doorways.extend_from_slice(&other.doorways);
        self.opaque.extend(other.opaque.iter().map(moved));
        self.transparent.extend(other.transparent.iter().map(moved));
        self.n_triangles += other.n_triangles;
    }

    /// Sorts draws in the order of the world, so that two lists draw their common part in the same order.
    pub(crate) fn sort(&mut self) {
        self.opaque.sort_by_key(|r| r.order);
        self.transparent.sort_by_key(|r| r.order);
    }

    /// Returns an empty list with structure as its only instance.
    pub(crate) fn of_structure() -> Self {
        Self {
            instances: vec![0],
            ..Self::default()
        }
    }

    fn clear(&mut self) {
        self.opaque.clear();
        self.transparent.clear();
        self.instances.clear();
        self.stand_ins.clear();
        self.doorways.clear();
        self.n_triangles = 0;
    }
}

/// Builds draw lists frame by frame; reuses its buffers.
#[derive(Default)]
pub struct Lister {
    list: RenderList,
    stamp: u32,
    /// For each cell, number of the frame that last saw it, and the part of the screen where it is visible.
    rectangles: Vec<(u32, [f32; 4])>,
    /// For each batch, its place in drawing order.
    ranks: Vec<(u32, u32)>,
    chunks: Vec<(u32, u32)>,
    /// Mesh, level, object.
    details: Vec<(u32, u32, u32)>,
    plugs: Vec<PortalId>,
    /// Visible cells, ascending.
    cells: Vec<CellId>,
    far: Vec<Run>,
}

/// Adds a run; extends the last one if it continues it.
fn push_run(runs: &mut Vec<Run>, run: Run) {
    if let Some(last) = runs.last_mut()
        && last.first + last.n == run.first
        && last.texture == run.texture
        && last.finish == run.finish
        && last.is_smooth == run.is_smooth
        && last.instances == run.instances
        && last.scissor == run.scissor
    {
        last.n += run.n;
    } else {
        runs.push(run);
    }
}

impl Lister {
    /// Returns a lister; it serves any number of worlds, one after the other.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Moves out the last list with its buffers; give them back with [`Lister::give`].
    pub(crate) fn take(&mut self) -> RenderList {
        std::mem::take(&mut self.list)
    }

    pub(crate) fn list(&self) -> &RenderList {
        &self.list
    }

    pub(crate) fn list_mut(&mut self) -> &mut RenderList {
        &mut self.list
    }

    pub(crate) fn give(&mut self, list: RenderList) {
        self.list = list;
    }

    /// Lists everything, whatever the view, with plugs of the portals that `state` shuts.
    pub fn everything(
        &mut self,
        world: &GpuWorld,
        sight: &Sight,
        state: &SightState,
        eye: [f32; 3],
    ) -> &RenderList {
        let chunks = 0..world.chunks.len() as u32;
        let details = 0..world.details.len() as u32;
        self.begin(DrawReason::Seen);
        self.chunks.extend(chunks.map(|c| (0, c)));
        self.details
            .extend(details.map(|d| (world.details[d as usize].mesh, 0, d)));
        self.plugs.extend(state.shut_portals());
        self.finish(world, sight, eye, None)
    }

    /// Lists the answer of a query. With scissors, each batch is drawn within the rectangle where its cells are
    /// visible; views all around take no scissors.
    pub fn seen(
        &mut self,
        world: &GpuWorld,
        sight: &Sight,
        seen: &Seen<'_>,
        shot: &Shot<'_>,
        sparing: &Sparing,
    ) -> &RenderList {
        let is_flat = seen.visits().iter().all(|v| v.face == 0);
        let is_whole = seen.counts().is_eye_lost || seen.counts().is_capped;
        let is_cut = shot.has_scissors && is_flat && !is_whole;
        let size = is_cut.then_some(shot.size);
        self.begin(DrawReason::Seen);
        if size.is_some() {
            self.rectangles.resize(sight.n_cells(), (0, [0.0; 4]));
            for v in seen.visits() {
                let r = &mut self.rectangles[v.cell.0 as usize];
                let [left, bottom, right, top] = v.rectangle;
                *r = if r.0 == self.stamp {
                    let [l, b, t, u] = r.1;
                    (r.0, [l.min(left), b.min(bottom), t.max(right), u.max(top)])
                } else {
                    (self.stamp, v.rectangle)
                };
            }
        }
        self.ranks.resize(world.batch_cells.len(), (0, 0));
        let mut n_ranks = 0;
        for c in seen.chunks() {
            let rank = &mut self.ranks[world.batch_of[c.0 as usize] as usize];
            if rank.0 != self.stamp {
                *rank = (self.stamp, n_ranks);
                n_ranks += 1;
            }
            self.chunks.push((rank.1, c.0));
        }
        for d in seen.details() {
            let placed = &world.details[d.0 as usize];
            if let Some(size) = size.filter(|_| sparing.objects_below > 0.0) {
                let pixels = self.scissor(&placed.cells, size);
                let n = pixels.map_or(0.0, |[.., w, h]| w as f32 * h as f32);
                if n < sparing.objects_below {
                    continue;
                }
            }
            let level = world.level(placed, sparing.lod, || {
                let center = placed.center.to_array();
                (shot.view).pixels_per_meter(center, placed.radius, shot.size)
            });
            self.details.push((placed.mesh, level, d.0));
        }
        if !sparing.stop_at_nothing {
            self.list.stand_ins.extend_from_slice(seen.stopped());
        }
        if world.is_hollow() {
            self.stand_in_for_bare(world, seen);
        }
        self.cells.clear();
        self.cells.extend_from_slice(seen.cells());
        self.cells.sort_unstable();
        // Plugs of shut portals of visible cells.
        let shut = shot.state.shut_portals();
        self.plugs.extend(shut.filter(|p| {
            let mut ends = world.portal_cells[p.0 as usize].iter();
            is_whole || ends.any(|c| self.cells.binary_search(c).is_ok())
        }));
        self.finish(world, sight, shot.view.eye(), size)
    }

    /// Lists chosen chunks and details, colored by reason, with plugs of all portals that `state` shuts.
    pub fn chosen(
        &mut self,
        world: &GpuWorld,
        sight: &Sight,
        state: &SightState,
        chunks: impl Iterator<Item = ChunkId>,
        details: impl Iterator<Item = DetailId>,
        reason: DrawReason,
    ) -> &RenderList {
        self.begin(reason);
        self.chunks.extend(chunks.map(|c| (0, c.0)));
        self.details
            .extend(details.map(|d| (world.details[d.0 as usize].mesh, 0, d.0)));
        self.plugs.extend(state.shut_portals());
        self.finish(world, sight, [0.0; 3], None)
    }

    /// Fills the portals into cells of which nothing is there.
    fn stand_in_for_bare(&mut self, world: &GpuWorld, seen: &Seen<'_>) {
        for visit in seen.visits().iter().filter(|v| world.is_bare(v.cell)) {
            let Some(portal) = visit.via else { continue };
            let ends = world.portal_cells[portal.0 as usize];
            let stand_in = (portal, visit.cell);
            // Between two bare cells nothing could be seen to lie behind it.
            let is_first = ends.iter().any(|c| *c != visit.cell && !world.is_bare(*c));
            if is_first && !self.list.stand_ins.contains(&stand_in) {
                self.list.stand_ins.push(stand_in);
            }
        }
    }

    fn begin(&mut self, reason: DrawReason) {
        self.stamp = self.stamp.wrapping_add(1);
        if self.stamp == 0 {
            self.rectangles.clear();
            self.ranks.clear();
            self.stamp = 1;
        }
        self.list.clear();
        self.list.instances.push((reason as u32) << 28);
        self.chunks.clear();
        self.details.clear();
        self.plugs.clear();
        self.far.clear();
    }

    /// Returns the rectangle where a batch is visible; `None` if it is not.
    fn scissor(&self, cells: &[CellId], size: [u32; 2]) -> Option<Scissor> {
        let mut r = [f32::INFINITY, f32::INFINITY, -f32::INFINITY, -f32::INFINITY];
        for c in cells {
            if let Some(&(stamp, [left, bottom, right, top])) = self.rectangles.get(c.0 as usize)
                && stamp == self.stamp
            {
                r = [
                    r[0].min(left),
                    r[1].min(bottom),
                    r[2].max(right),
                    r[3].max(top),
                ];
            }
        }
        let [w, h] = size.map(|n| n as f32);
        // One pixel of margin for rounding.
        let low = |x: f32, n: f32| ((x * 0.5 + 0.5) * n - 1.0).floor().clamp(0.0, n) as u32;
        let high = |x: f32, n: f32| ((x * 0.5 + 0.5) * n + 1.0).ceil().clamp(0.0, n) as u32;
        let (x0, x1) = (low(r[0], w), high(r[2], w));
        let (y0, y1) = (low(-r[3], h), high(-r[1], h));
        (x0 < x1 && y0 < y1).then(|| [x0, y0, x1 - x0, y1 - y0])
    }

    fn finish(
        &mut self,
        world: &GpuWorld,
        sight: &Sight,
        eye: [f32; 3],
        size: Option<[u32; 2]>,
    ) -> &RenderList {
        let eye = Vec3::from(eye);
        let reason = self.list.instances[0];
        // Within a batch, keep the order of the buffer, so that neighbors join.
        self.chunks.sort_unstable();
        let mut batch = (u32::MAX, None);
        for &(_, c) in &self.chunks {
            let b = world.batch_of[c as usize];
            if batch.0 != b {
                let scissor = size.map(|size| self.scissor(&world.batch_cells[b as usize], size));
                batch = (b, scissor);
            }
            let scissor = match batch.1 {
                None => None,
                Some(Some(s)) => Some(s),
                Some(None) => continue,
            };
            for span in world.spans_of(c) {
                self.list.n_triangles += u64::from(span.n / 3);
                let run = Run::of(span, 0..1, scissor, c as usize);
                if span.is_transparent {
                    let [low, high] = sight.chunks()[c as usize].aabb.map(Vec3::from);
                    let distance = ((low + high) * 0.5).distance(eye);
                    self.far.push(Run { distance, ..run });
                } else {
                    push_run(&mut self.list.opaque, run);
                }
            }
        }
        for &portal in &self.plugs {
            let span = world.plugs[portal.0 as usize];
            self.list.n_triangles += u64::from(span.n / 3);
            let order = world.chunks.len() + world.meshes.len() + portal.idx();
            push_run(&mut self.list.opaque, Run::of(&span, 0..1, None, order));
        }
        self.details.sort_unstable();
        for group in (self.details).chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let (mesh, level, _) = group[0];
            let first = self.list.instances.len() as u32;
            let instances = group.iter().map(|d| (d.2 + 1) | reason);
            self.list.instances.extend(instances);
            let last = self.list.instances.len() as u32;
            let level = (world.meshes.get(mesh as usize)).and_then(|m| m.get(level as usize));
            for span in level.into_iter().flat_map(|l| &l.spans) {
                self.list.n_triangles += u64::from(span.n / 3) * u64::from(last - first);
                let order = world.chunks.len() + mesh as usize;
                let run = |instances| Run::of(span, instances, None, order);
                if span.is_transparent {
                    for (at, &(.., detail)) in (first..last).zip(group) {
                        let center = world.details[detail as usize].center;
                        self.far.push(Run {
                            distance: center.distance(eye),
                            ..run(at..at + 1)
                        });
                    }
                } else {
                    self.list.opaque.push(run(first..last));
                }
            }
        }
        // Equal distances in the order of the world, so that pictures are deterministic.
        self.far
            .sort_by(|a, b| (b.distance.total_cmp(&a.distance)).then(a.order.cmp(&b.order)));
        self.list.transparent.append(&mut self.far);
        &self.list
    }
}

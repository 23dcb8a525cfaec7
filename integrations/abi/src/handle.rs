//! An open world with the state of its doors and the buffers of its answers.

mod rooms;
mod whys;

use enfilade_cpg::wire::decode_glb;
use enfilade_cpg::{CellId, MotionKind, PortalId, PortalKind, World};
use enfilade_runtime::{
    DetailId, Follower, Sight, SightSkeleton, SightState, Sightlines, Start, Step, Target, View,
    Viewer,
};

use crate::answers::{
    EnfBatch, EnfChunk, EnfDetail, EnfFact, EnfHit, EnfLeaf, EnfList, EnfPortal, EnfSeen, EnfStart,
    EnfStep, EnfVisit,
};
use crate::status as s;
use crate::status::Failure;

/// An open world. Its contents are private to the library.
pub struct EnfWorld {
    world: World,
    sight: Sight,
    state: SightState,
    viewer: Viewer,
    /// Made when first asked for: programs that only cull do not pay for it.
    lines: Option<Sightlines>,
    seen: SeenBuffers,
    ids: Vec<u32>,
    cell_portals: Vec<u32>,
    crossed: Vec<u32>,
    facts: Vec<EnfFact>,
    text: String,
    storeys: String,
}

/// Answers of the last view, as plain numbers.
#[derive(Default)]
struct SeenBuffers {
    cells: Vec<u32>,
    shares: Vec<f32>,
    portals: Vec<u32>,
    chunks: Vec<u32>,
    batches: Vec<u32>,
    details: Vec<u32>,
    specials: Vec<u32>,
    visits: Vec<EnfVisit>,
    planes: Vec<[f32; 4]>,
    /// Per cell, its index in `cells`; valid only for those.
    place: Vec<u32>,
    /// Per batch, the number of the last view that saw it.
    stamps: Vec<u32>,
    stamp: u32,
}

fn refill<T>(to: &mut Vec<u32>, from: &[T], id: impl Fn(&T) -> u32) {
    to.clear();
    to.extend(from.iter().map(id));
}

/// Finds an item, or says that there is none.
fn item<'a, T>(items: &'a [T], index: u32, kind: &str) -> Result<&'a T, Failure> {
    let n = items.len();
    let found = items.get(index as usize);
    found.ok_or_else(|| Failure::argument(format!("no {kind} {index}; there are {n}")))
}

fn finite(p: [f32; 3]) -> Result<[f32; 3], Failure> {
    let is_finite = p.iter().all(|x| x.is_finite());
    is_finite
        .then_some(p)
        .ok_or_else(|| Failure::argument(format!("the point {p:?} is not finite")))
}

impl EnfWorld {
    /// Decodes and prepares a world file.
    ///
    /// # Errors
    ///
    /// If the bytes are not a world.
    pub fn open(glb: &[u8]) -> Result<Self, Failure> {
        let world = decode_glb(glb).map_err(Failure::world)?;
        let sight = Sight::build(&world).map_err(Failure::world)?;
        Ok(Self::of(world, sight))
    }

    /// Prepares a hollow world, as packed worlds have it in their head.
    ///
    /// # Errors
    ///
    /// If the bytes are not a world, or not with its skeleton.
    pub fn open_hollow(glb: &[u8], skeleton: &[u8]) -> Result<Self, Failure> {
        let world = decode_glb(glb).map_err(Failure::world)?;
        let skeleton = SightSkeleton::decode(skeleton).map_err(Failure::world)?;
        let sight = Sight::build_hollow(&world, skeleton).map_err(Failure::world)?;
        Ok(Self::of(world, sight))
    }

    fn of(world: World, sight: Sight) -> Self {
        // As large as they may become, so that they stay where they are.
        let seen = SeenBuffers {
            cells: Vec::with_capacity(sight.n_cells()),
            shares: Vec::with_capacity(sight.n_cells()),
            portals: Vec::with_capacity(sight.n_portals()),
            chunks: Vec::with_capacity(sight.chunks().len()),
            batches: Vec::with_capacity(sight.n_batches()),
            details: Vec::with_capacity(world.details.len()),
            specials: Vec::with_capacity(sight.n_specials()),
            place: vec![0; sight.n_cells()],
            stamps: vec![0; sight.n_batches()],
            ..SeenBuffers::default()
        };
        Self {
            state: SightState::new(&sight),
            viewer: Viewer::new(&sight),
            lines: None,
            seen,
            ids: Vec::new(),
            cell_portals: Vec::new(),
            crossed: Vec::new(),
            facts: Vec::new(),
            text: String::new(),
            storeys: String::new(),
            world,
            sight,
        }
    }

    /// Counts a kind of things.
    ///
    /// # Errors
    ///
    /// If there is not such a kind.
    pub fn count(&self, what: u32) -> Result<usize, Failure> {
        Ok(match what {
            s::ENF_CELLS => self.world.graph.cells.len(),
            s::ENF_PORTALS => self.world.graph.portals.len(),
            s::ENF_BATCHES => self.world.batches.len(),
            s::ENF_DETAILS => self.world.details.len(),
            s::ENF_CHUNKS => self.sight.chunks().len(),
            s::ENF_SPECIALS => self.world.graph.specials.len(),
            s::ENF_PLACES => self.world.graph.places.len(),
            _ => return Err(Failure::argument(format!("no count has the number {what}"))),
        })
    }

    /// Describes a portal and its state.
    ///
    /// # Errors
    ///
    /// If it does not exist.
    pub fn portal(&self, portal: u32) -> Result<EnfPortal, Failure> {
        let p = item(&self.world.graph.portals, portal, "portal")?;
        let id = PortalId(portal);
        let is_open = self.state.is_open(id);
        Ok(EnfPortal {
            outline: p.outline.as_ptr().cast(),
            n_outline: p.outline.len() as u32,
            cells: p.cells.map(|c| c.0),
            kind: match p.kind {
                PortalKind::Open => s::ENF_OPENING,
                PortalKind::Door => s::ENF_DOOR,
                PortalKind::Window => s::ENF_WINDOW,
                PortalKind::Crack => s::ENF_CRACK,
            },
            is_open: is_open.into(),
            openness: (self.state.leaves(id)).unwrap_or(f32::from(u8::from(is_open))),
            n_leaves: self.sight.leaves(id).len() as u32,
            normal: p.normal,
            area: p.area,
            leaf_depth: self.sight.depth_of_leaves(id),
        })
    }

    /// Describes a leaf of a portal.
    ///
    /// # Errors
    ///
    /// If portal or leaf do not exist.
    pub fn leaf(&self, portal: u32, leaf: u32) -> Result<EnfLeaf, Failure> {
        item(&self.world.graph.portals, portal, "portal")?;
        let leaf = item(self.sight.leaves(PortalId(portal)), leaf, "leaf")?;
        let (motion, through, axis) = match leaf.motion.kind {
            MotionKind::Turn { through, axis } => (s::ENF_TURN, through, axis),
            MotionKind::Slide { along } => (s::ENF_SLIDE, [0.0; 3], along),
        };
        Ok(EnfLeaf {
            detail: leaf.detail.0,
            motion,
            shut: leaf.motion.shut,
            open: leaf.motion.open,
            through,
            axis,
        })
    }

    /// Describes a batch and its triangles; a hollow world has none.
    ///
    /// # Errors
    ///
    /// If it does not exist.
    pub fn batch(&self, batch: u32) -> Result<EnfBatch, Failure> {
        let b = item(&self.world.batches, batch, "batch")?;
        let indices = self.sight.indices(batch);
        let primitive = &b.primitive;
        let has_normals =
            !primitive.positions.is_empty() && primitive.normals.len() == primitive.positions.len();
        Ok(EnfBatch {
            positions: primitive.positions.as_ptr().cast(),
            normals: if has_normals {
                primitive.normals.as_ptr().cast()
            } else {
                std::ptr::null()
            },
            indices: indices.as_ptr(),
            n_vertices: primitive.positions.len() as u32,
            n_indices: indices.len() as u32,
            material: primitive.material.unwrap_or(s::ENF_NO_ID),
            is_seal: b.is_seal.into(),
        })
    }

    /// Describes a placed object.
    ///
    /// # Errors
    ///
    /// If it does not exist.
    pub fn detail(&self, detail: u32) -> Result<EnfDetail, Failure> {
        let d = item(&self.world.details, detail, "detail")?;
        let bounds = self.sight.detail_box(DetailId(detail));
        let aabb = bounds.map(|b| b.map(|p| p.as_vec3().to_array()));
        Ok(EnfDetail {
            name: d.name.as_ptr().cast(),
            name_length: d.name.len() as u32,
            mesh: d.mesh,
            n_triangles: self.sight.detail_triangles(detail),
            transform: d.transform,
            aabb: six(aabb.unwrap_or_default()),
        })
    }

    /// Describes a chunk.
    ///
    /// # Errors
    ///
    /// If it does not exist.
    pub fn chunk(&self, chunk: u32) -> Result<EnfChunk, Failure> {
        let c = item(self.sight.chunks(), chunk, "chunk")?;
        Ok(EnfChunk {
            batch: c.batch,
            first_index: c.first_index,
            n_indices: c.n_indices,
            aabb: six(c.aabb),
        })
    }

    fn list(&self) -> EnfList {
        EnfList {
            ids: self.ids.as_ptr(),
            n: self.ids.len() as u32,
        }
    }

    /// Lists the cells that see a batch.
    ///
    /// # Errors
    ///
    /// If it does not exist.
    pub fn cells_of_batch(&mut self, batch: u32) -> Result<EnfList, Failure> {
        let b = item(&self.world.batches, batch, "batch")?;
        refill(&mut self.ids, &b.cells, |c| c.0);
        Ok(self.list())
    }

    /// Lists the cells that an object touches; for a leaf, all that it sweeps.
    ///
    /// # Errors
    ///
    /// If it does not exist.
    pub fn cells_of_detail(&mut self, detail: u32) -> Result<EnfList, Failure> {
        item(&self.world.details, detail, "detail")?;
        let cells = self.sight.cells_of_detail(&self.world, DetailId(detail));
        refill(&mut self.ids, &cells, |c| c.0);
        Ok(self.list())
    }

    /// Lists the portals of which an object is a leaf.
    ///
    /// # Errors
    ///
    /// If it does not exist.
    pub fn portals_of_detail(&mut self, detail: u32) -> Result<EnfList, Failure> {
        item(&self.world.details, detail, "detail")?;
        self.ids.clear();
        (self.ids).extend(self.sight.portals_of(DetailId(detail)).map(|p| p.0));
        Ok(self.list())
    }

    /// Lists the cells that may be visible from a cell; `None` if the file does not say.
    ///
    /// # Errors
    ///
    /// If it does not exist.
    pub fn pvs_row(&mut self, cell: u32) -> Result<Option<EnfList>, Failure> {
        item(&self.world.graph.cells, cell, "cell")?;
        let Some(pvs) = &self.world.pvs else {
            return Ok(None);
        };
        self.ids.clear();
        self.ids.extend(pvs.visible_from(CellId(cell)).map(|c| c.0));
        Ok(Some(self.list()))
    }

    /// Finds the cell of a point; `None` in solid matter.
    ///
    /// # Errors
    ///
    /// If it is not finite.
    pub fn locate(&self, p: [f32; 3]) -> Result<Option<u32>, Failure> {
        Ok(self.sight.locate(finite(p)?).map(|c| c.0))
    }

    /// Finds a place to begin a walk; `None` in a world without cells.
    ///
    /// # Errors
    ///
    /// Never.
    pub fn start(&mut self) -> Result<Option<EnfStart>, Failure> {
        let start = Start::find(&self.world, &self.sight, &self.state);
        Ok(start.map(|Start { eye, yaw, .. }| EnfStart { eye, yaw }))
    }

    /// Follows a step from cell to cell.
    ///
    /// # Errors
    ///
    /// If an end is not finite.
    pub fn step(&mut self, from: [f32; 3], to: [f32; 3]) -> Result<EnfStep, Failure> {
        let mut follower = Follower::new(&self.sight, finite(from)?);
        let step = follower.step(&self.sight, finite(to)?);
        refill(&mut self.crossed, follower.crossed(), |p| p.0);
        Ok(EnfStep {
            crossed: self.crossed.as_ptr(),
            n_crossed: self.crossed.len() as u32,
            cell: follower.cell().map_or(s::ENF_NO_ID, |c| c.0),
            is_relocated: (step == Step::Relocated).into(),
        })
    }

    /// Turns the leaves of a portal, or opens and closes one without leaves.
    ///
    /// # Errors
    ///
    /// If it does not exist or `share` is NaN.
    pub fn set_openness(&mut self, portal: u32, share: f32) -> Result<(), Failure> {
        item(&self.world.graph.portals, portal, "portal")?;
        if share.is_nan() {
            return Err(Failure::argument("the openness is not a number"));
        }
        let id = PortalId(portal);
        if self.sight.leaves(id).is_empty() {
            if share > 0.0 {
                self.state.open(id);
            } else {
                self.state.close(id);
            }
        } else {
            self.state.set_leaves(id, share);
        }
        Ok(())
    }

    /// Closes a portal whatever its leaves are made of, or opens it fully.
    ///
    /// # Errors
    ///
    /// If it does not exist.
    pub fn set_closed(&mut self, portal: u32, is_closed: bool) -> Result<(), Failure> {
        item(&self.world.graph.portals, portal, "portal")?;
        if is_closed {
            self.state.close(PortalId(portal));
        } else {
            self.state.open(PortalId(portal));
        }
        Ok(())
    }

    /// Locks a cell, which is then never seen from others, or unlocks it.
    ///
    /// # Errors
    ///
    /// If it does not exist.
    pub fn lock(&mut self, cell: u32, is_locked: bool) -> Result<(), Failure> {
        item(&self.world.graph.cells, cell, "cell")?;
        self.state.lock(CellId(cell), is_locked);
        Ok(())
    }

    /// Returns the transform from an object's pose in the file to its present one; `None` if it was not moved.
    ///
    /// # Errors
    ///
    /// If it does not exist.
    pub fn pose(&self, detail: u32) -> Result<Option<[f32; 16]>, Failure> {
        item(&self.world.details, detail, "detail")?;
        let pose = self.state.pose(DetailId(detail));
        Ok(pose.map(|m| m.as_mat4().to_cols_array()))
    }

    /// Answers a view.
    ///
    /// # Errors
    ///
    /// If the view is not one.
    pub fn see(&mut self, view: Result<View, impl ToString>) -> Result<EnfSeen, Failure> {
        let view = view.map_err(Failure::argument)?;
        let eye_cell = self.sight.locate(view.eye());
        let answer = self.viewer.see(&self.sight, &self.state, &view);
        let n_triangles = answer.n_triangles().min(u32::MAX.into()) as u32;
        let out = &mut self.seen;
        refill(&mut out.cells, answer.cells(), |c| c.0);
        refill(&mut out.portals, answer.portals(), |p| p.0);
        refill(&mut out.chunks, answer.chunks(), |c| c.0);
        refill(&mut out.details, answer.details(), |d| d.0);
        refill(&mut out.specials, answer.specials(), |i| i.0);
        out.visits.clear();
        out.planes.clear();
        out.shares.clear();
        out.shares.resize(out.cells.len(), 0.0);
        for (at, &cell) in (0..).zip(&out.cells) {
            out.place[cell as usize] = at;
        }
        let faces = view.n_faces() as f32;
        for visit in answer.visits() {
            let planes = answer.planes(visit);
            let [left, bottom, right, top] = visit.rectangle;
            let share = (right - left) * (top - bottom) / 4.0 / faces;
            if let Some(sum) = (out.shares).get_mut(out.place[visit.cell.idx()] as usize) {
                *sum = (*sum + share).min(1.0);
            }
            out.visits.push(EnfVisit {
                cell: visit.cell.0,
                via: visit.via.map_or(s::ENF_NO_ID, |p| p.0),
                rectangle: visit.rectangle,
                depth: visit.depth,
                face: visit.face.into(),
                first_plane: out.planes.len() as u32,
                n_planes: planes.len() as u32,
            });
            out.planes.extend_from_slice(planes);
        }
        out.fill_batches(&self.sight);
        Ok(out.answer(n_triangles, eye_cell.map_or(s::ENF_NO_ID, |c| c.0)))
    }

    /// Returns `true` if a box in `cells` may be visible in the last view.
    pub fn sees_box(&self, cells: &[u32], aabb: [f32; 6]) -> bool {
        if aabb.iter().any(|x| x.is_nan()) {
            return false;
        }
        let is_inside = |plane: &[f32; 4]| {
            let far = (0..3).map(|k| plane[k] * aabb[if plane[k] >= 0.0 { 3 + k } else { k }]);
            let reach = far.sum::<f32>() + plane[3];
            // NaN, from an infinite box, counts as inside.
            reach >= 0.0 || reach.is_nan()
        };
        let visits = self.seen.visits.iter().filter(|v| cells.contains(&v.cell));
        visits.into_iter().any(|v| {
            let first = v.first_plane as usize;
            let planes = &self.seen.planes[first..first + v.n_planes as usize];
            planes.iter().all(is_inside)
        })
    }

    fn lines(&mut self) -> &Sightlines {
        let world = &self.world;
        self.lines.get_or_insert_with(|| Sightlines::build(world))
    }

    /// Returns `true` if nothing solid is between two points; objects do not count.
    ///
    /// # Errors
    ///
    /// If one is not finite.
    pub fn is_clear(&mut self, a: [f32; 3], b: [f32; 3]) -> Result<bool, Failure> {
        let (a, b) = (finite(a)?, finite(b)?);
        self.lines();
        let lines = self.lines.as_ref();
        Ok(lines.is_some_and(|l| l.is_clear(&self.state, a, b)))
    }

    /// Finds the first thing on a segment.
    ///
    /// # Errors
    ///
    /// If an end is not finite.
    pub fn pick(&mut self, a: [f32; 3], b: [f32; 3]) -> Result<Option<EnfHit>, Failure> {
        self.lines();
        let Some(lines) = &self.lines else {
            return Ok(None);
        };
        let hit = lines.pick(&self.state, a, b).map_err(Failure::argument)?;
        let Some(hit) = hit else { return Ok(None) };
        let (target, index, primitive, triangle) = match hit.target {
            Target::Wall { batch, triangle } => (s::ENF_WALL, batch, 0, triangle),
            Target::Detail {
                detail,
                primitive,
                triangle,
            } => (s::ENF_DETAIL, detail.0, primitive, triangle),
            Target::Portal(p) => (s::ENF_CLOSED_PORTAL, p.0, 0, 0),
        };
        let portal = match hit.target {
            Target::Wall { .. } => None,
            Target::Detail { detail, .. } => self.sight.portals_of(detail).next(),
            Target::Portal(p) => Some(p),
        };
        Ok(Some(EnfHit {
            t: hit.t as f32,
            position: hit.position,
            normal: hit.normal,
            target,
            index,
            primitive,
            triangle,
            cell: hit.cell.map_or(s::ENF_NO_ID, |c| c.0),
            portal: portal.map_or(s::ENF_NO_ID, |p| p.0),
        }))
    }
}

impl SeenBuffers {
    /// Lists the batches of the chunks.
    fn fill_batches(&mut self, sight: &Sight) {
        self.batches.clear();
        self.stamp = self.stamp.wrapping_add(1);
        if self.stamp == 0 {
            self.stamps.fill(0);
            self.stamp = 1;
        }
        for &chunk in &self.chunks {
            let batch = sight.chunks()[chunk as usize].batch;
            let stamp = &mut self.stamps[batch as usize];
            if *stamp != self.stamp {
                *stamp = self.stamp;
                self.batches.push(batch);
            }
        }
    }

    fn answer(&self, n_triangles: u32, eye_cell: u32) -> EnfSeen {
        EnfSeen {
            cells: self.cells.as_ptr(),
            shares: self.shares.as_ptr(),
            portals: self.portals.as_ptr(),
            chunks: self.chunks.as_ptr(),
            batches: self.batches.as_ptr(),
            details: self.details.as_ptr(),
            specials: self.specials.as_ptr(),
            visits: self.visits.as_ptr(),
            planes: self.planes.as_ptr().cast(),
            n_cells: self.cells.len() as u32,
            n_portals: self.portals.len() as u32,
            n_chunks: self.chunks.len() as u32,
            n_batches: self.batches.len() as u32,
            n_details: self.details.len() as u32,
            n_specials: self.specials.len() as u32,
            n_visits: self.visits.len() as u32,
            n_planes: self.planes.len() as u32,
            n_triangles,
            eye_cell,
        }
    }
}

fn six(aabb: [[f32; 3]; 2]) -> [f32; 6] {
    let [[a, b, c], [d, e, f]] = aabb;
    [a, b, c, d, e, f]
}

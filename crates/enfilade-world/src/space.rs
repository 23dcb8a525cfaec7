//! A world, and worlds that move in it: a lift in its shaft, a boat on the sea, a cabin on the boat (Dirkse 2002, sections 5.2
//! and 5.5.4).
//!
//! Each *part* is a world with cells and portals of its own, in a frame of its own: a tree of rigid motions, the first part at
//! its root. A part stands in cells of its parent, its *host*. Its outdoor cell, its *border*, is not a place: it stands for the
//! surroundings, so a portal to it leads into the host's cells that its opening currently touches. So doors that meet lead from
//! one to the other, doors that separate lead into the air between them, and a door in front of a wall leads nowhere, without a
//! rule for each case.
//!
//! Coordinates are relative to a part; poses are in `f64`, so that a part ten kilometers away is as exact as a near one.

use std::sync::{Arc, OnceLock};

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::{Aabb, DVec3, LooseGrid};
use enfilade_runtime::{DetailId, Sight, SightError, SightState, Sightlines};

use crate::layout::Layout;
use crate::pose::Pose;
use changes::Changes;
use walls::Walls;

pub(crate) use changes::Change;

pub use context::{SeenVia, StoppedSpecial};
pub use follow::Followed;
pub use id::{PartId, Place};
pub use images::SpecialImage;
pub(crate) use joined::Joined;
pub use look::{SpaceViewer, SpecialOptions};
pub use meet::Docking;
pub use seen::{SeenContext, SpaceSeen};
pub use sweep::Passing;
pub use trace::{SightRay, TraceEnd, Traced};

mod changes;
mod context;
mod doors;
mod follow;
mod id;
mod images;
mod joined;
mod locate;
mod look;
mod meet;
mod seen;
mod sweep;
mod trace;
pub(crate) mod walls;
mod withdrawn;

/// Reason why a part cannot be added or moved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpaceError {
    /// A world that [`Sight::build`] rejects.
    #[error("part {part}: {source}")]
    Sight {
        /// Its index.
        part: u32,
        /// The reason.
        source: SightError,
    },
    /// There is no such part.
    #[error("there is no part {part}; there are {n_parts}")]
    NoPart {
        /// The requested index.
        part: u32,
        /// The number of parts.
        n_parts: usize,
    },
    /// A pose that is not finite, or whose rotation does not have unit length.
    #[error(
        "the pose of part {part} is not a rigid motion: its numbers must be finite and its rotation of unit length"
    )]
    NotRigid {
        /// Its index.
        part: u32,
    },
    /// The root cannot move or be taken out.
    #[error("part 0 is the world that all others move in; it cannot be moved or taken out")]
    RootMoved,
    /// A part is to be taken out in which others stand.
    #[error("part {guest} stands in part {part}; it must be taken out first")]
    HasGuests {
        /// Its index.
        part: u32,
        /// Index of the first that stands in it.
        guest: u32,
    },
}

/// A world that stands in another.
pub(crate) struct Part {
    pub(crate) world: Arc<World>,
    // Copies of a part share these.
    pub(crate) layout: Arc<Layout>,
    pub(crate) sight: Arc<Sight>,
    /// Made by the first query of contacts.
    walls: Arc<OnceLock<Walls>>,
    /// Made by the first query of a line.
    lines: Arc<OnceLock<Sightlines>>,
    pub(crate) state: SightState,
    /// The cell that stands for the surroundings.
    pub(crate) border: Option<CellId>,
    pub(crate) host: PartId,
    pub(crate) children: Vec<PartId>,
    /// Poses in the host's frame, and in the root's.
    pub(crate) local: Pose,
    pub(crate) pose: Pose,
    /// Bounding box of everything in it, in its own frame.
    pub(crate) hull: Aabb,
    /// The portals to the border.
    pub(crate) doors: Vec<BorderDoor>,
    /// Places where it stands.
    pub(crate) stands_in: Vec<Place>,
    /// Per cell the parts that stand in it, ascending.
    pub(crate) guests: Vec<Vec<PartId>>,
    pub(crate) has_guests: Vec<bool>,
    /// Index of its first cell among those of all parts.
    pub(crate) first_cell: u32,
    /// `false` while it is [withdrawn](Space::withdraw).
    pub(crate) is_present: bool,
}

impl Part {
    fn model(&self) -> Model {
        Model {
            world: Arc::clone(&self.world),
            layout: Arc::clone(&self.layout),
            sight: Arc::clone(&self.sight),
            walls: Arc::clone(&self.walls),
            lines: Arc::clone(&self.lines),
            hull: self.hull,
        }
    }

    /// Returns its box in the root's frame, with the tolerance of its geometry.
    fn bounds(&self) -> Aabb {
        if self.hull.is_empty() {
            return Aabb::EMPTY;
        }
        let corners = self.hull.corners().map(|p| self.pose.point(p));
        Aabb::of_points(&corners).expanded(self.layout.tolerance())
    }
}

/// The world that copies of a part share, and everything prepared from it.
struct Model {
    world: Arc<World>,
    layout: Arc<Layout>,
    sight: Arc<Sight>,
    walls: Arc<OnceLock<Walls>>,
    lines: Arc<OnceLock<Sightlines>>,
    hull: Aabb,
}

impl Model {
    fn new(world: Arc<World>, sight: Sight) -> Self {
        let layout = Layout::new(&world);
        Self {
            hull: hull_of(&world, &sight, &layout),
            layout: Arc::new(layout),
            sight: Arc::new(sight),
            walls: Arc::default(),
            lines: Arc::default(),
            world,
        }
    }
}

/// A portal from a part to its surroundings.
pub(crate) struct BorderDoor {
    pub(crate) portal: PortalId,
    /// The cell inside.
    pub(crate) inner: CellId,
    /// The surrounding places that its opening touches.
    pub(crate) leads_to: Vec<Place>,
    /// Doors of other parts that it meets.
    pub(crate) meets: Vec<(PartId, PortalId)>,
    /// True if one of them covers all of its opening without a gap: nothing of the surroundings is seen through it.
    pub(crate) is_covered: bool,
}

/// A world and the worlds that move in it: the model of all queries.
///
/// Holds the worlds, their layout and prepared visibility, poses of parts and the state of doors, each once. Whatever is derived
/// from it, such as the cells of things or the reach of lamps, brings itself up to date when it is queried.
pub struct Space {
    pub(crate) parts: Vec<Part>,
    n_cells: usize,
    /// The boxes of all parts but the root.
    neighbors: LooseGrid,
    pub(crate) docking: Docking,
    changes: Changes,
    buffers: Buffers,
}

#[derive(Default)]
struct Buffers {
    points: Vec<DVec3>,
    other: Vec<DVec3>,
    cells: Vec<CellId>,
    stack: Vec<i32>,
    order: Vec<PartId>,
    near: Vec<PartId>,
}

impl Space {
    /// Makes a space of one world without moving parts.
    ///
    /// # Errors
    ///
    /// If [`Sight::build`] rejects the world.
    pub fn new(world: impl Into<Arc<World>>) -> Result<Self, SpaceError> {
        let world = world.into();
        let sight = sight_of(&world, 0)?;
        Ok(Self::with_sight(world, sight))
    }

    /// As [`Space::new`], given the sight of this world: for hollow worlds, that of [`Sight::build_hollow`]. Their walls and objects
    /// stop bodies and casts as far as they are there; see [`SightSkeleton`](enfilade_runtime::SightSkeleton).
    #[must_use]
    pub fn with_sight(world: impl Into<Arc<World>>, sight: Sight) -> Self {
        let mut space = Self {
            parts: Vec::new(),
            n_cells: 0,
            neighbors: LooseGrid::default(),
            docking: Docking::default(),
            changes: Changes::default(),
            buffers: Buffers::default(),
        };
        space.push(
            Model::new(world.into(), sight),
            PartId::ROOT,
            Pose::IDENTITY,
        );
        space
    }

    /// Adds a world that stands in another, at a pose in the host's frame. Its outdoors stands for its surroundings; a world
    /// without outdoors is closed to sight both ways. O(its size).
    ///
    /// # Errors
    ///
    /// If [`Sight::build`] rejects the world, the host does not exist, or the pose is not a rigid motion.
    pub fn add_part(
        &mut self,
        world: impl Into<Arc<World>>,
        host: PartId,
        pose: Pose,
    ) -> Result<PartId, SpaceError> {
        self.check(host)?;
        let part = self.parts.len() as u32;
        if !pose.is_rigid() {
            return Err(SpaceError::NotRigid { part });
        }
        let world = world.into();
        let sight = sight_of(&world, part)?;
        self.add_model(Model::new(world, sight), host, pose)
    }

    /// Adds another part with the world of `part`, with doors of its own, all open. Copies share the world and everything
    /// prepared from it. O(cells and portals).
    ///
    /// # Errors
    ///
    /// If a part does not exist, or the pose is not a rigid motion.
    pub fn add_copy(
        &mut self,
        part: PartId,
        host: PartId,
        pose: Pose,
    ) -> Result<PartId, SpaceError> {
        self.check(part)?;
        self.check(host)?;
        if !pose.is_rigid() {
            let part = self.parts.len() as u32;
            return Err(SpaceError::NotRigid { part });
        }
        let model = self.parts[part.idx()].model();
        self.add_model(model, host, pose)
    }

    fn add_model(&mut self, model: Model, host: PartId, pose: Pose) -> Result<PartId, SpaceError> {
        let part = PartId(self.parts.len() as u32);
        self.push(model, host, pose);
        self.parts[host.idx()].children.push(part);
        self.set_pose(part, pose)?;
        Ok(part)
    }

    fn push(&mut self, model: Model, host: PartId, local: Pose) {
        let part = self.parts.len() as u32;
        let Model {
            world,
            layout,
            sight,
            walls,
            lines,
            hull,
        } = model;
        let n_cells = layout.n_cells();
        let border = layout.outdoors().filter(|_| part > 0);
        let exits = border.map_or(&[][..], |cell| layout.exits(cell));
        let doors = exits
            .iter()
            .map(|exit| BorderDoor {
                portal: exit.portal,
                inner: exit.to,
                leads_to: Vec::new(),
                meets: Vec::new(),
                is_covered: false,
            })
            .collect();
        self.parts.push(Part {
            hull,
            state: SightState::new(&sight),
            sight,
            border,
            host,
            children: Vec::new(),
            local,
            pose: local,
            doors,
            stands_in: Vec::new(),
            guests: vec![Vec::new(); n_cells],
            has_guests: vec![false; n_cells],
            first_cell: self.n_cells as u32,
            walls,
            lines,
            layout,
            world,
            is_present: true,
        });
        self.n_cells += n_cells;
        self.neighbors.push(Aabb::EMPTY);
    }

    /// Moves a part, and everything that stands in it, to a pose in its host's frame. O(parts that stand in it, cells that they
    /// touch, parts beside them). Allocates nothing once its lists have grown.
    ///
    /// # Errors
    ///
    /// If the part does not exist, or is the root, or the pose is not a rigid motion.
    pub fn set_pose(&mut self, part: PartId, pose: Pose) -> Result<(), SpaceError> {
        self.check(part)?;
        if part == PartId::ROOT {
            return Err(SpaceError::RootMoved);
        }
        if !pose.is_rigid() {
            return Err(SpaceError::NotRigid { part: part.0 });
        }
        self.parts[part.idx()].local = pose;
        self.bring_back(part);
        let mut buffers = std::mem::take(&mut self.buffers);
        buffers.order.clear();
        buffers.order.push(part);
        let mut at = 0;
        while let Some(&moved) = buffers.order.get(at) {
            at += 1;
            let host = self.parts[moved.idx()].host;
            let host_pose = self.parts[host.idx()].pose;
            let own = &mut self.parts[moved.idx()];
            own.pose = host_pose.after(&own.local);
            buffers.order.extend_from_slice(&own.children);
            let bounds = own.bounds();
            self.neighbors.set(moved.0, bounds);
            let own = &self.parts[moved.idx()];
            // Parts that stand entirely within their host have moved with it.
            let is_within = own.stands_in.iter().all(|p| p.part == host);
            if moved == part || !is_within {
                self.settle(moved, &mut buffers);
            }
        }
        self.buffers = buffers;
        self.changed(Change::Part(part));
        Ok(())
    }

    /// Updates the places where a part stands, and those to which its doors lead.
    fn settle(&mut self, id: PartId, buffers: &mut Buffers) {
        let mut stands_in = self.unsettle(id);
        let own = &self.parts[id.idx()];
        buffers.points.clear();
        let corners = own.hull.corners();
        buffers.points.extend(corners.map(|p| own.local.point(p)));
        if !own.hull.is_empty() {
            self.touched(own.host, own.layout.tolerance(), buffers, &mut stands_in);
        }
        for place in &stands_in {
            let host = &mut self.parts[place.part.idx()];
            let guests = &mut host.guests[place.cell.idx()];
            if let Err(at) = guests.binary_search(&id) {
                guests.insert(at, id);
            }
            host.has_guests[place.cell.idx()] = true;
        }
        self.parts[id.idx()].stands_in = stands_in;
        for door in 0..self.parts[id.idx()].doors.len() {
            let mut leads_to = std::mem::take(&mut self.parts[id.idx()].doors[door].leads_to);
            leads_to.clear();
            let own = &self.parts[id.idx()];
            let opening = own.layout.opening(own.doors[door].portal);
            buffers.points.clear();
            let corners = opening.pieces().flatten();
            buffers.points.extend(corners.map(|p| own.local.point(*p)));
            self.touched(own.host, own.layout.tolerance(), buffers, &mut leads_to);
            self.parts[id.idx()].doors[door].leads_to = leads_to;
        }
        self.meet(id, buffers);
    }

    /// Takes a part off the lists of the places where it stands; returns the empty list of these.
    fn unsettle(&mut self, id: PartId) -> Vec<Place> {
        let mut stands_in = std::mem::take(&mut self.parts[id.idx()].stands_in);
        for place in stands_in.drain(..) {
            let host = &mut self.parts[place.part.idx()];
            let guests = &mut host.guests[place.cell.idx()];
            if let Ok(at) = guests.binary_search(&id) {
                guests.remove(at);
            }
            host.has_guests[place.cell.idx()] = !guests.is_empty();
        }
        stands_in
    }

    /// Adds the places that the hull of `buffers.points`, in the frame of `host`, may touch; beyond a host's border those of
    /// the host's host.
    fn touched(&self, host: PartId, margin: f64, buffers: &mut Buffers, places: &mut Vec<Place>) {
        let part = &self.parts[host.idx()];
        buffers.cells.clear();
        let margin = margin + part.layout.tolerance();
        let Buffers {
            points,
            cells,
            stack,
            ..
        } = &mut *buffers;
        part.layout.cells_near(points, margin, cells, stack);
        let mut is_beyond = false;
        for &cell in &*cells {
            if part.border == Some(cell) {
                is_beyond = true;
            } else {
                places.push(Place { part: host, cell });
            }
        }
        if is_beyond {
            for p in points {
                *p = part.local.point(*p);
            }
            self.touched(part.host, margin, buffers, places);
        }
    }

    fn check(&self, part: PartId) -> Result<(), SpaceError> {
        let n_parts = self.parts.len();
        if part.idx() < n_parts {
            Ok(())
        } else {
            Err(SpaceError::NoPart {
                part: part.0,
                n_parts,
            })
        }
    }

    /// Returns the number of parts, the root included.
    #[must_use]
    pub fn n_parts(&self) -> usize {
        self.parts.len()
    }

    /// Returns the world of a part.
    #[must_use]
    pub fn world(&self, part: PartId) -> &Arc<World> {
        &self.parts[part.idx()].world
    }

    /// Returns the cells and portals of a part.
    ///
    /// # Panics
    ///
    /// If there is no such part; likewise in all queries of one.
    #[must_use]
    pub fn layout(&self, part: PartId) -> &Layout {
        &self.parts[part.idx()].layout
    }

    /// Returns the prepared visibility of a part.
    #[must_use]
    pub fn sight(&self, part: PartId) -> &Sight {
        &self.parts[part.idx()].sight
    }

    /// Returns what bodies can hit in a part.
    pub(crate) fn walls(&self, part: PartId) -> &Walls {
        let part = &self.parts[part.idx()];
        (part.walls).get_or_init(|| Walls::new(&part.world, &part.sight, &part.layout))
    }

    /// Returns what lines of sight can hit in a part. The first query of one of its copies prepares it.
    #[must_use]
    pub(crate) fn sightlines(&self, part: PartId) -> &Sightlines {
        let part = &self.parts[part.idx()];
        (part.lines).get_or_init(|| Sightlines::build(&part.world))
    }

    /// Returns the state of a part's doors.
    #[must_use]
    pub fn state(&self, part: PartId) -> &SightState {
        &self.parts[part.idx()].state
    }

    /// Returns the pose of a part in the root's frame.
    #[must_use]
    pub fn pose(&self, part: PartId) -> &Pose {
        &self.parts[part.idx()].pose
    }

    /// Returns the pose of a part in its host's frame.
    #[must_use]
    #[doc(hidden)]
    pub fn local_pose(&self, part: PartId) -> &Pose {
        &self.parts[part.idx()].local
    }

    /// Returns the part in which it stands; the root for the root.
    #[must_use]
    #[doc(hidden)]
    pub fn host(&self, part: PartId) -> PartId {
        self.parts[part.idx()].host
    }

    /// Returns the motion that maps points of one part's frame to another's.
    #[must_use]
    pub fn between(&self, from: PartId, to: PartId) -> Pose {
        if from == to {
            return Pose::IDENTITY;
        }
        self.pose(to).inverse().after(self.pose(from))
    }

    /// Returns the parts that stand in a cell, ascending.
    #[must_use]
    #[doc(hidden)]
    pub fn guests(&self, place: Place) -> &[PartId] {
        &self.parts[place.part.idx()].guests[place.cell.idx()]
    }

    /// Returns the doors of other parts that a part's door currently meets, within the tolerance of [`Docking`].
    #[must_use]
    #[doc(hidden)]
    pub fn meets(&self, part: PartId, portal: PortalId) -> &[(PartId, PortalId)] {
        let doors = &self.parts[part.idx()].doors;
        let door = doors.iter().find(|d| d.portal == portal);
        door.map_or(&[], |d| &d.meets)
    }

    /// Returns the places around a part to which one of its doors currently leads; none in front of a wall, and for inner
    /// portals.
    #[must_use]
    pub fn leads_to(&self, part: PartId, portal: PortalId) -> &[Place] {
        let doors = &self.parts[part.idx()].doors;
        let door = doors.iter().find(|d| d.portal == portal);
        door.map_or(&[], |d| &d.leads_to)
    }
}

fn sight_of(world: &World, part: u32) -> Result<Sight, SpaceError> {
    Sight::build(world).map_err(|source| SpaceError::Sight { part, source })
}

/// Returns the box around all cells but the outdoors, and all that is drawn.
fn hull_of(world: &World, sight: &Sight, layout: &Layout) -> Aabb {
    let mut hull = Aabb::EMPTY;
    for (cell, _) in world.graph.indoor_cells() {
        hull = hull.union(layout.cell(cell).bounds);
    }
    for chunk in sight.chunks() {
        let [low, high] = (chunk.aabb).map(|p| DVec3::from_array(p.map(f64::from)));
        hull = hull.union(Aabb::new(low, high));
    }
    for detail in (0..world.details.len() as u32).map(DetailId) {
        if let Some([low, high]) = sight.detail_box(detail) {
            hull = hull.union(Aabb::new(low, high));
        }
    }
    hull
}

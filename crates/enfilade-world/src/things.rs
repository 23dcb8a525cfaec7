//! Things that stand and move in cells: the cells of each, and the things in a view.
//!
//! After Dirkse 2002, chapter 5: every cell that a thing reaches into refers to it, so that it is found where it sticks out of
//! its own cell. A thing is in the cell of its origin; as it moves, its cell and the cells that refer to it change. Its [`Tie`]
//! determines its frame of motion.
//!
//! References are links in two lists at once, of a thing and of a cell, taken from one pool: a move is O(cells reached), and
//! allocates nothing once the pool has grown.

mod flood;
mod id;
mod links;
mod saved;

use enfilade_cpg::PortalId;
use enfilade_geom::DVec3;
use enfilade_runtime::Visit;

use crate::pose::Pose;
use crate::shape::Shape;
use crate::space::{Change, PartId, Place, Space, SpaceSeen};
use links::{Links, NONE};

pub use flood::{Flood, Posted};
pub use id::{Moved, ThingError, ThingId, Tie};

#[derive(Clone, Debug)]
struct Slot {
    generation: u32,
    thing: Option<Thing>,
}

#[derive(Clone, Debug)]
struct Thing {
    shape: Shape,
    reach: f64,
    tie: Tie,
    /// In the frame of a part, or of the thing that it is a child of.
    pose: Pose,
    /// In the frame of a part.
    placed: Pose,
    frame: PartId,
    place: Option<Place>,
    /// Origin at the last search for its cells, and the distance that it may move until the next.
    settled_at: DVec3,
    clearance: f64,
    /// Position at the last search for its place, and the distance that it may move until the next.
    located_at: DVec3,
    room: f64,
    first_link: u32,
    n_links: u32,
    first_child: u32,
    next_sibling: u32,
}

/// The things of a [`Space`].
#[derive(Clone, Debug, Default)]
pub struct Things {
    slots: Vec<Slot>,
    free_slots: Vec<u32>,
    links: Links,
    globals: Vec<ThingId>,
    flood: Flood,
    stamps: Vec<u32>,
    stamp: u32,
    seen: Vec<ThingId>,
    /// Number of the last change of the space that it knows.
    known: u64,
    affected: Vec<u32>,
    in_cell: Vec<u32>,
    points: Vec<DVec3>,
}

impl Things {
    /// Makes an empty registry.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a thing at a pose in the frame of a part; that of a [child](Tie::Child) is relative to its parent, and `frame` is
    /// ignored. Allocates while lists grow.
    ///
    /// # Errors
    ///
    /// If the pose is not a rigid motion, or the part or parent does not exist.
    pub fn add(
        &mut self,
        space: &Space,
        shape: Shape,
        frame: PartId,
        pose: Pose,
        tie: Tie,
    ) -> Result<ThingId, ThingError> {
        Self::check(space, frame, &pose)?;
        if let Tie::Child(parent) = tie {
            self.thing(parent)?;
        }
        let index = self.free_slots.pop().unwrap_or_else(|| {
            self.slots.push(Slot {
                generation: 0,
                thing: None,
            });
            self.slots.len() as u32 - 1
        });
        let slot = &mut self.slots[index as usize];
        let id = ThingId {
            index,
            generation: slot.generation,
        };
        slot.thing = Some(Thing {
            reach: shape.reach(),
            shape,
            tie,
            pose,
            placed: pose,
            frame,
            place: None,
            settled_at: pose.at,
            clearance: 0.0,
            located_at: pose.at,
            room: 0.0,
            first_link: NONE,
            n_links: 0,
            first_child: NONE,
            next_sibling: NONE,
        });
        match tie {
            Tie::Global => self.globals.push(id),
            Tie::Child(parent) => {
                let first = std::mem::replace(&mut self.at_mut(parent.index).first_child, index);
                self.at_mut(index).next_sibling = first;
                self.follow_parent(space, index);
            }
            Tie::Carried | Tie::Free => {
                self.settle(space, index);
            }
        }
        Ok(id)
    }

    /// Removes a thing; its children stay where they are, free.
    ///
    /// # Errors
    ///
    /// If the thing does not exist.
    pub fn remove(&mut self, id: ThingId) -> Result<(), ThingError> {
        let thing = self.thing(id)?;
        let (tie, mut child) = (thing.tie, thing.first_child);
        while child != NONE {
            let own = self.at_mut(child);
            own.tie = Tie::Free;
            own.pose = own.placed;
            child = std::mem::replace(&mut own.next_sibling, NONE);
        }
        match tie {
            Tie::Global => self.globals.retain(|g| *g != id),
            Tie::Child(parent) => self.unlink_child(parent.index, id.index),
            Tie::Carried | Tie::Free => {}
        }
        self.drop_links(id.index);
        let slot = &mut self.slots[id.index as usize];
        slot.thing = None;
        slot.generation = slot.generation.wrapping_add(1);
        self.free_slots.push(id.index);
        Ok(())
    }

    /// Moves a thing, and its children with it, to a pose in the frame of a part; that of a child is relative to its parent.
    /// O(openings of the cells that it reaches) if it comes near one, otherwise about 100 ns.
    ///
    /// # Errors
    ///
    /// If the thing or part does not exist, or the pose is not a rigid motion.
    pub fn set_pose(
        &mut self,
        space: &Space,
        id: ThingId,
        frame: PartId,
        pose: Pose,
    ) -> Result<Moved, ThingError> {
        Self::check(space, frame, &pose)?;
        self.update(space);
        let from = self.thing(id)?.place;
        let thing = self.at_mut(id.index);
        thing.pose = pose;
        if let Tie::Child(_) = thing.tie {
            self.follow_parent(space, id.index);
        } else {
            (thing.placed, thing.frame) = (pose, frame);
            if thing.tie != Tie::Global {
                self.settle(space, id.index);
            }
            self.carry_children(space, id.index);
        }
        let to = self.at(id.index).place;
        Ok(Moved { from, to })
    }

    /// Updates the cells of things after parts have moved. Queries do it by themselves. O(things in the cells of the parts that
    /// have moved since, and in those in which they stand).
    fn update(&mut self, space: &Space) {
        let mut affected = std::mem::take(&mut self.affected);
        affected.clear();
        match space.changes_since(&mut self.known) {
            // A shut portal does not cut a thing that stands in it, so doors do not matter.
            Some(changes) => changes.for_each(|change| {
                if let Change::Part(part) = change {
                    self.add_things_at(space, part, &mut affected);
                }
            }),
            None => affected.extend((0..).zip(&self.slots).filter_map(|(i, s)| {
                let is_placed = s.thing.as_ref().is_some_and(|t| t.tie != Tie::Global);
                is_placed.then_some(i)
            })),
        }
        affected.sort_unstable();
        affected.dedup();
        for &thing in &affected {
            let own = self.at_mut(thing);
            (own.clearance, own.room) = (0.0, 0.0);
            self.settle(space, thing);
        }
        self.affected = affected;
    }

    /// Adds the things that stand in a part and those in it, around it, or at doors that meet its own: all that one of its doors
    /// may have passed over, or that may stick out of it.
    fn add_things_at(&self, space: &Space, part: PartId, affected: &mut Vec<u32>) {
        let own = &space.parts[part.idx()];
        let cells = own.first_cell..own.first_cell + own.layout.n_cells() as u32;
        for cell in cells {
            self.add_things_of(cell, affected);
        }
        for place in &own.stands_in {
            self.add_things_of(Self::cell_index(space, *place), affected);
        }
        for &(other, portal) in own.doors.iter().flat_map(|d| &d.meets) {
            let its = &space.parts[other.idx()];
            for door in its.doors.iter().filter(|d| d.portal == portal) {
                self.add_things_of(its.first_cell + door.inner.0, affected);
            }
        }
        for child in own.children.iter().copied() {
            self.add_things_at(space, child, affected);
        }
    }

    /// Returns the pose of a thing in the frame of a part.
    ///
    /// # Errors
    ///
    /// If the thing does not exist.
    pub fn pose(&mut self, space: &Space, id: ThingId) -> Result<(PartId, Pose), ThingError> {
        self.update(space);
        let thing = self.thing(id)?;
        Ok((thing.frame, thing.placed))
    }

    /// Returns the place of its origin; `None` if it is in solid matter or global.
    ///
    /// # Errors
    ///
    /// If the thing does not exist.
    pub fn place(&mut self, space: &Space, id: ThingId) -> Result<Option<Place>, ThingError> {
        self.update(space);
        Ok(self.thing(id)?.place)
    }

    /// Returns the places that it reaches into, in arbitrary order. A thing in solid matter keeps its last ones.
    pub fn places<'a>(
        &'a mut self,
        space: &'a Space,
        id: ThingId,
    ) -> impl Iterator<Item = Place> + use<'a> {
        self.update(space);
        let first = self.thing(id).map_or(NONE, |t| t.first_link);
        let cells = self.links.of_thing(first);
        cells.map(|cell| place_of(space, cell))
    }

    /// Returns the things that reach into a cell, in arbitrary order.
    pub fn things_in<'a>(
        &'a mut self,
        space: &Space,
        place: Place,
    ) -> impl Iterator<Item = ThingId> + use<'a> {
        self.update(space);
        self.in_cell(Self::cell_index(space, place))
    }

    /// Returns the things in a view, ascending, each once: those whose shape meets the visible part of a cell that they are in,
    /// and all global ones. No visible thing is missing.
    pub fn see(&mut self, space: &Space, seen: &SpaceSeen) -> &[ThingId] {
        self.update(space);
        self.seen.clear();
        self.seen.extend_from_slice(&self.globals);
        if self.stamp == u32::MAX {
            self.stamps.fill(0);
            self.stamp = 0;
        }
        self.stamp += 1;
        self.stamps.resize(self.slots.len(), 0);
        for (part, seen) in seen.parts() {
            for visit in seen.visits() {
                self.see_cell(space, part, visit, seen.planes(visit));
            }
        }
        self.seen.sort_unstable();
        &self.seen
    }

    fn see_cell(&mut self, space: &Space, part: PartId, visit: &Visit, planes: &[[f32; 4]]) {
        let place = Place {
            part,
            cell: visit.cell,
        };
        let cell = Self::cell_index(space, place);
        let mut in_cell = std::mem::take(&mut self.in_cell);
        in_cell.clear();
        in_cell.extend(self.links.in_cell(cell));
        for &index in &in_cell {
            if self.stamps[index as usize] == self.stamp {
                continue;
            }
            let mut points = std::mem::take(&mut self.points);
            let thing = self.at(index);
            let pose = space.between(thing.frame, part).after(&thing.placed);
            let is_in = planes.iter().all(|&[x, y, z, d]| {
                let n = DVec3::new(x.into(), y.into(), z.into());
                n.dot(pose.at) + f64::from(d) >= -thing.reach * n.length()
            }) && {
                thing.shape.place(&pose, &mut points);
                planes.iter().all(|&[x, y, z, d]| {
                    let n = DVec3::new(x.into(), y.into(), z.into());
                    let far = points.iter().map(|p| n.dot(*p));
                    let far = far.fold(f64::NEG_INFINITY, f64::max);
                    far + f64::from(d) >= -thing.shape.radius() * n.length()
                })
            };
            self.points = points;
            if is_in {
                self.stamps[index as usize] = self.stamp;
                let generation = self.slots[index as usize].generation;
                self.seen.push(ThingId { index, generation });
            }
        }
        self.in_cell = in_cell;
    }

    fn check(space: &Space, frame: PartId, pose: &Pose) -> Result<(), ThingError> {
        if frame.idx() >= space.n_parts() {
            return Err(ThingError::NoPart);
        }
        if pose.is_rigid() {
            Ok(())
        } else {
            Err(ThingError::NotRigid)
        }
    }

    fn thing(&self, id: ThingId) -> Result<&Thing, ThingError> {
        let slot = self.slots.get(id.index as usize);
        slot.filter(|s| s.generation == id.generation)
            .and_then(|s| s.thing.as_ref())
            .ok_or(ThingError::NoThing)
    }

    /// Returns an existing thing by its slot.
    fn at(&self, index: u32) -> &Thing {
        let thing = self.slots[index as usize].thing.as_ref();
        thing.expect("lists hold no removed things")
    }

    fn at_mut(&mut self, index: u32) -> &mut Thing {
        let thing = self.slots[index as usize].thing.as_mut();
        thing.expect("lists hold no removed things")
    }

    fn cell_index(space: &Space, place: Place) -> u32 {
        space.parts[place.part.idx()].first_cell + place.cell.0
    }

    fn in_cell(&self, cell: u32) -> impl Iterator<Item = ThingId> + use<'_> {
        self.links.in_cell(cell).map(|index| ThingId {
            index,
            generation: self.slots[index as usize].generation,
        })
    }

    fn add_things_of(&self, cell: u32, into: &mut Vec<u32>) {
        into.extend(self.in_cell(cell).map(|id| id.index));
    }

    /// Moves a child to its pose relative to its parent.
    fn follow_parent(&mut self, space: &Space, index: u32) {
        let Tie::Child(parent) = self.at(index).tie else {
            return;
        };
        let (frame, pose) = {
            let parent = self.at(parent.index);
            (parent.frame, parent.placed)
        };
        let thing = self.at_mut(index);
        thing.placed = pose.after(&thing.pose);
        thing.frame = frame;
        self.settle(space, index);
        self.carry_children(space, index);
    }

    fn carry_children(&mut self, space: &Space, index: u32) {
        let mut child = self.at(index).first_child;
        while child != NONE {
            self.follow_parent(space, child);
            child = self.at(child).next_sibling;
        }
    }

    fn unlink_child(&mut self, parent: u32, child: u32) {
        let next = self.at(child).next_sibling;
        let mut at = self.at(parent).first_child;
        if at == child {
            self.at_mut(parent).first_child = next;
            return;
        }
        while at != NONE {
            let sibling = self.at_mut(at);
            if sibling.next_sibling == child {
                sibling.next_sibling = next;
                return;
            }
            at = sibling.next_sibling;
        }
    }

    /// Updates the place of a thing, and the places that it reaches into.
    fn settle(&mut self, space: &Space, index: u32) {
        let thing = self.at(index);
        if thing.tie == Tie::Global {
            return;
        }
        let (frame, placed) = (thing.frame, thing.placed);
        let (found, located_at, room) = locate(space, thing);
        let is_near = found == thing.place
            && thing.n_links == 1
            && placed.at.distance(thing.settled_at) < thing.clearance;
        let thing = self.at_mut(index);
        (thing.located_at, thing.room) = (located_at, room);
        let Some(place) = found else {
            thing.place = None;
            return;
        };
        thing.place = found;
        let frame_of_tie = match thing.tie {
            Tie::Carried => place.part,
            Tie::Free | Tie::Global => PartId::ROOT,
            Tie::Child(_) => frame,
        };
        if frame_of_tie != frame {
            thing.placed = space.between(frame, frame_of_tie).after(&placed);
            thing.pose = thing.placed;
            thing.frame = frame_of_tie;
        }
        if is_near {
            return;
        }
        let clearance = clearance_in(space, place, self.at(index));
        if clearance > 0.0 {
            self.relink(space, index, &[place]);
            self.set_clearance(index, clearance);
            return;
        }
        let mut flood = std::mem::take(&mut self.flood);
        let thing = self.at(index);
        let posted = Posted {
            shape: &thing.shape,
            reach: thing.reach,
            frame: thing.frame,
            pose: &thing.placed,
        };
        // A shut portal does not cut a thing that stands in it.
        let all = |_: PartId, _: PortalId| true;
        let places = flood.reach(space, place, &posted, all);
        self.relink(space, index, places);
        let clearance = flood.clearance();
        self.flood = flood;
        self.set_clearance(index, clearance);
    }

    fn set_clearance(&mut self, index: u32, clearance: f64) {
        let thing = self.at_mut(index);
        thing.settled_at = thing.placed.at;
        thing.clearance = clearance;
    }

    /// Replaces the cells that refer to a thing by those that it reaches.
    fn relink(&mut self, space: &Space, index: u32, places: &[Place]) {
        self.links.grow(space.n_cells());
        let cells = places.iter().map(|p| Self::cell_index(space, *p));
        let is_same = cells.eq(self.links.of_thing(self.at(index).first_link));
        if is_same {
            return;
        }
        self.drop_links(index);
        let mut first = NONE;
        for place in places.iter().rev() {
            first = self
                .links
                .add(index, Self::cell_index(space, *place), first);
        }
        let thing = self.at_mut(index);
        (thing.first_link, thing.n_links) = (first, places.len() as u32);
    }

    fn drop_links(&mut self, index: u32) {
        let thing = self.at_mut(index);
        thing.n_links = 0;
        let first = std::mem::replace(&mut thing.first_link, NONE);
        self.links.drop_all(first);
    }
}

/// Returns the place of a thing, the point of the search, and a distance from there within which the place is the same.
fn locate(space: &Space, thing: &Thing) -> (Option<Place>, DVec3, f64) {
    let at = thing.placed.at;
    if let Some(place) = thing.place
        && place.part == thing.frame
        && at.distance(thing.located_at) < thing.room
        && !space.parts[place.part.idx()].has_guests[place.cell.idx()]
    {
        return (thing.place, thing.located_at, thing.room);
    }
    // In the root alone, so that the result equals that of `Space::locate`.
    if thing.frame == PartId::ROOT {
        let root = &space.parts[0];
        let (cell, room) = root.layout.locate_with_room(at);
        if let Some(cell) = cell.filter(|c| !root.has_guests[c.idx()]) {
            let part = PartId::ROOT;
            return (Some(Place { part, cell }), at, room);
        }
    }
    (space.locate(thing.frame, at), at, 0.0)
}

/// Returns the distance by which a thing in a place may move without meeting an opening of its cell; not above 0 if it may meet
/// one now, if other parts stand in the cell, or if the thing is in the frame of another part. [Units: wu]
fn clearance_in(space: &Space, place: Place, thing: &Thing) -> f64 {
    let part = &space.parts[place.part.idx()];
    if place.part != thing.frame || part.has_guests[place.cell.idx()] {
        return 0.0;
    }
    let distance = part.layout.distance_to_exits(place.cell, thing.placed.at);
    distance - thing.reach - part.layout.tolerance()
}

/// Returns the place of a cell, given its index among those of all parts. O(log parts).
fn place_of(space: &Space, cell: u32) -> Place {
    let part = space.parts.partition_point(|p| p.first_cell <= cell) - 1;
    let local = cell - space.parts[part].first_cell;
    Place {
        part: PartId(part as u32),
        cell: enfilade_cpg::CellId(local),
    }
}

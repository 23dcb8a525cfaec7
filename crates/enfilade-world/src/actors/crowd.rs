//! All actors: their plans, the events that change them, and the actors in each cell.
//!
//! Each actor has one plan at a time. A timing wheel reports the actors whose plans leave a cell or end; only these are updated:
//! O(1) each, and O(log points) if several of their changes have passed at once. Cells list their actors (Gjørup 1999, section
//! 3.3.4). With many actors each access is a cache miss, so the data of a change fits one cache line, and changes are made in
//! rounds of one kind of work, in which the processor overlaps several misses.
//! An event happens at its own time, not at that of the frame that finds it due, so frames do not matter.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use enfilade_cpg::CellId;
use enfilade_geom::DVec3;

use crate::actors::chance::Chance;
use crate::actors::plan::{Knot, PlanDraft, next_change, part_at, place_at};
use crate::actors::wheel::Wheel;
use crate::saved::{SavedActor, SavedActors, SavedError};

/// Least duration of a plan, which bounds the number of events. [Units: s]
const LEAST_PLAN: f64 = 1e-3;
/// Stands for no actor.
const NONE: u32 = u32::MAX;

/// An actor of [`Actors`], counted from 0 in order of addition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ActorId(pub u32);

/// Reason why an actor needs a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Cause {
    /// It was just added.
    Came,
    /// Its plan has ended.
    Done,
    /// It received a [message](Actors::tell).
    Told(u32),
}

/// The moment at which an actor gets a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ActorEvent {
    /// The actor.
    pub actor: ActorId,
    /// Index of the event among this actor's, from 0.
    pub number: u32,
    /// Time of the event. [Units: s]
    pub time: f64,
    /// Position at that time. [Units: wu]
    pub at: DVec3,
    /// Cell at that time.
    pub cell: CellId,
    /// Reason.
    pub cause: Cause,
}

/// Position of an actor.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ActorPlace {
    /// Position. [Units: wu]
    pub at: DVec3,
    /// Velocity; 0 if it stays. [Units: wu/s]
    pub velocity: DVec3,
    /// Its cell.
    pub cell: CellId,
}

/// A message for an actor; ordered by time, then by order of sending.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Told {
    /// Bits of the time, ordered as times are.
    time: u64,
    order: u64,
    actor: u32,
    what: u32,
}

/// An actor without the points of its plan. One cache line.
#[derive(Clone, Debug)]
#[repr(align(64))]
struct Member {
    /// Time of its next update. [Units: s]
    due: f64,
    /// End of its plan; infinite if it stays. [Units: s]
    end: f64,
    knots: Vec<Knot>,
    /// Part of its plan at its last update.
    part: u32,
    /// Cell that lists it; [`NONE`] once removed.
    cell: u32,
    /// Neighbors in the list of the cell.
    before: u32,
    after: u32,
    n_events: u32,
}

/// All actors of a world.
///
/// Advancing time allocates nothing once plans have reached their greatest length.
///
/// ```
/// use enfilade_cpg::CellId;
/// use enfilade_geom::DVec3;
/// use enfilade_world::{ActorEvent, Actors, Chance, PlanDraft, WayPoint};
///
/// // A guard who walks up and down between two rooms, resting a while at each end.
/// let ends = [DVec3::ZERO, DVec3::X * 8.0];
/// let mut plan = |event: &ActorEvent, chance: &mut Chance, plan: &mut PlanDraft<'_>| {
///     let here = event.cell.0 as usize;
///     plan.walk(WayPoint { at: (ends[0] + ends[1]) * 0.5, cell: event.cell }, 1.4);
///     plan.walk(WayPoint { at: ends[1 - here], cell: CellId(1 - here as u32) }, 1.4);
///     plan.wait(chance.range([2.0, 10.0]));
/// };
/// let mut actors = Actors::new(2, 7);
/// let guard = actors.add(ends[0], CellId(0), &mut plan);
///
/// // In one go or frame by frame, it reaches the same position.
/// let mut other = actors.clone();
/// actors.advance(3600.0, &mut plan);
/// (0..=3600).for_each(|s| other.advance(f64::from(s), &mut plan));
/// assert_eq!(actors.place(guard), other.place(guard));
/// ```
#[derive(Clone, Debug)]
pub struct Actors {
    seed: u64,
    now: f64,
    members: Vec<Member>,
    /// Per actor: the points of its plan.
    points: Vec<Vec<DVec3>>,
    /// Per cell: the first actor in its list.
    heads: Vec<u32>,
    wheel: Wheel,
    told: BinaryHeap<Reverse<Told>>,
    n_told: u64,
    due: Vec<u32>,
    n_updates: u64,
}

impl Actors {
    /// Makes an empty set of actors at time 0.
    #[must_use]
    pub fn new(n_cells: usize, seed: u64) -> Self {
        Self {
            seed,
            now: 0.0,
            members: Vec::new(),
            points: Vec::new(),
            heads: vec![NONE; n_cells],
            wheel: Wheel::new(),
            told: BinaryHeap::new(),
            n_told: 0,
            due: Vec::new(),
            n_updates: 0,
        }
    }

    /// Returns the state of all as plain values.
    #[must_use]
    pub fn saved(&self) -> SavedActors {
        let plan = |id: usize| {
            let knots = self.members[id].knots.iter().zip(&self.points[id]);
            let finite = |time: f64| time.is_finite().then_some(time);
            let points = knots.map(|(k, p)| (finite(k.time), k.cell.0, p.to_array()));
            points.collect()
        };
        let members = self.members.iter().enumerate();
        let mut told: Vec<Told> = self.told.iter().map(|t| t.0).collect();
        told.sort_unstable();
        SavedActors {
            seed: self.seed,
            now: self.now,
            members: members
                .map(|(id, m)| SavedActor {
                    is_removed: m.cell == NONE,
                    n_events: m.n_events,
                    plan: plan(id),
                })
                .collect(),
            told: told
                .iter()
                .map(|t| (unordered(t.time), t.order, t.actor, t.what))
                .collect(),
            n_told: self.n_told,
        }
    }

    /// Makes actors that play on from a saved state, in a world of `n_cells` cells.
    ///
    /// # Errors
    ///
    /// If a number is not finite, or a cell or actor does not exist.
    pub fn restored(n_cells: usize, saved: &SavedActors) -> Result<Self, SavedError> {
        let mut actors = Self::new(n_cells, saved.seed);
        actors.now = saved.now;
        actors.n_told = saved.n_told;
        let what = "actor";
        for (index, it) in saved.members.iter().enumerate() {
            let times = it.plan.iter().filter_map(|k| k.0);
            let mut numbers = it.plan.iter().flat_map(|k| k.2).chain(times);
            let is_in_order = it.plan.is_sorted_by_key(|k| k.0.unwrap_or(f64::INFINITY));
            if !saved.now.is_finite() || !numbers.all(f64::is_finite) {
                return Err(SavedError::NotFinite { what, index });
            }
            let mut cells = it.plan.iter().map(|k| k.1 as usize);
            let is_empty = it.plan.is_empty() && !it.is_removed;
            if is_empty || !is_in_order || !cells.all(|c| c < n_cells) {
                return Err(SavedError::NoSuch { what, index });
            }
            actors.put(it);
        }
        for &(time, order, actor, what) in &saved.told {
            actors.told.push(Reverse(Told {
                time: ordered(time),
                order,
                actor,
                what,
            }));
        }
        Ok(actors)
    }

    /// Adds an actor that was saved.
    fn put(&mut self, it: &SavedActor) {
        let id = self.members.len() as u32;
        let knots = it.plan.iter().map(|&(time, cell, _)| Knot {
            time: time.unwrap_or(f64::INFINITY),
            cell: CellId(cell),
        });
        let knots: Vec<Knot> = knots.collect();
        self.points
            .push(it.plan.iter().map(|k| DVec3::from_array(k.2)).collect());
        self.members.push(Member {
            due: f64::INFINITY,
            end: match &knots[..] {
                [_, .., last] => last.time,
                _ => f64::INFINITY,
            },
            knots,
            part: 0,
            cell: NONE,
            before: NONE,
            after: NONE,
            n_events: it.n_events,
        });
        if !it.is_removed {
            self.look_ahead(id, self.now);
            let part = self.members[id as usize].part as usize;
            let cell = self.members[id as usize].knots[part].cell;
            self.link(id, cell.0);
            self.list(id);
        }
    }

    /// Adds an actor now. `plan` makes its first plan, as in [`Actors::advance`].
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    pub fn add(
        &mut self,
        at: DVec3,
        cell: CellId,
        plan: impl FnMut(&ActorEvent, &mut Chance, &mut PlanDraft<'_>),
    ) -> ActorId {
        let id = self.members.len() as u32;
        let time = self.now;
        self.members.push(Member {
            due: f64::INFINITY,
            end: f64::INFINITY,
            knots: vec![Knot { time, cell }],
            part: 0,
            cell: cell.0,
            before: NONE,
            after: NONE,
            n_events: 0,
        });
        self.points.push(vec![at]);
        self.link(id, cell.0);
        self.event(id, time, Cause::Came, &mut { plan });
        self.look_ahead(id, time);
        self.list(id);
        ActorId(id)
    }

    /// Removes an actor; its id is not reused. Removing it again has no effect.
    ///
    /// # Panics
    ///
    /// If there never was such an actor.
    pub fn remove(&mut self, actor: ActorId) {
        if self.members[actor.0 as usize].cell != NONE {
            self.unlink(actor.0);
            let member = &mut self.members[actor.0 as usize];
            (member.cell, member.due) = (NONE, f64::INFINITY);
            member.knots = Vec::new();
            self.points[actor.0 as usize] = Vec::new();
        }
    }

    /// Sends an actor the message `what` at a time: it then gets a new plan, whatever its current one. A time that has passed,
    /// or is NaN, counts as now, at the next [`Actors::advance`]. [Units: s]
    pub fn tell(&mut self, actor: ActorId, time: f64, what: u32) {
        let time = time.max(self.now);
        self.n_told += 1;
        self.told.push(Reverse(Told {
            time: ordered(time),
            order: self.n_told,
            actor: actor.0,
            what,
        }));
    }

    /// Advances time to `time`; time does not run back. [Units: s]
    ///
    /// Calls `plan` for each event on the way with the event, its own random numbers, and an empty plan that starts there and
    /// then. If `plan` adds nothing, the actor stays until it receives a message. `plan` must depend only on its arguments and
    /// on constants; then positions do not depend on the times at which this is called. The events of an actor come in order of
    /// time; those of different actors in arbitrary order.
    ///
    /// O(actors that changed their cell + Σ events); nothing for actors that stay.
    pub fn advance(
        &mut self,
        time: f64,
        mut plan: impl FnMut(&ActorEvent, &mut Chance, &mut PlanDraft<'_>),
    ) {
        self.n_updates = 0;
        if !(time >= self.now && time.is_finite()) {
            return;
        }
        while let Some(&Reverse(told)) = self.told.peek() {
            let when = unordered(told.time);
            if when > time {
                break;
            }
            self.told.pop();
            let member = self.members.get(told.actor as usize);
            if member.is_some_and(|m| m.cell != NONE) {
                self.events_until(told.actor, when, &mut plan);
                self.event(told.actor, when, Cause::Told(told.what), &mut plan);
                // The next step of its plan is due from here on.
                self.look_ahead(told.actor, when);
                self.list(told.actor);
            }
        }
        let mut due = std::mem::take(&mut self.due);
        due.clear();
        let members = &mut self.members;
        let when = |id: u32| {
            let due = &mut members[id as usize].due;
            // Once only, though several entries may be left of it.
            let next = if *due <= time { f64::INFINITY } else { *due };
            std::mem::replace(due, next)
        };
        self.wheel.due(self.now, time, when, &mut due);
        self.touch(&due);
        for &id in &due {
            self.events_until(id, time, &mut plan);
            self.look_ahead(id, time);
        }
        due.iter().for_each(|&id| self.list(id));
        self.n_updates += due.len() as u64;
        self.due = due;
        self.now = time;
    }

    /// Returns the current time. [Units: s]
    #[must_use]
    pub fn now(&self) -> f64 {
        self.now
    }

    /// Returns the number of actors ever added.
    #[must_use]
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Returns `true` if no actor was ever added.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// Returns the number of actors updated by the last [`Actors::advance`].
    #[must_use]
    pub fn n_updates(&self) -> u64 {
        self.n_updates
    }

    /// Returns the current position of an actor; `None` once removed. O(log points of its plan); does not change any state.
    ///
    /// # Panics
    ///
    /// If there never was such an actor.
    #[must_use]
    pub fn place(&self, actor: ActorId) -> Option<ActorPlace> {
        let member = &self.members[actor.0 as usize];
        if member.cell == NONE {
            return None;
        }
        let part = part_at(&member.knots, member.part as usize, self.now);
        let plan = (&member.knots[..], &self.points[actor.0 as usize][..]);
        let (at, velocity) = place_at(plan.0, plan.1, part, self.now);
        Some(ActorPlace {
            at,
            velocity,
            cell: member.knots[part].cell,
        })
    }

    /// Returns the actors in a cell now, in arbitrary order; none for a cell that does not exist.
    pub fn in_cell(&self, cell: CellId) -> impl Iterator<Item = ActorId> + '_ {
        let some = |id: u32| (id != NONE).then_some(id);
        let first = self.heads.get(cell.idx()).and_then(|&id| some(id));
        let next = move |&id: &u32| some(self.members[id as usize].after);
        std::iter::successors(first, next).map(ActorId)
    }

    /// Prefetches the data that updates of these actors will read: no load waits for another here, so the misses overlap. Saves a
    /// sixth of a frame of 100,000 actors.
    fn touch(&self, due: &[u32]) {
        let mut sum = 0;
        for &id in due {
            let member = &self.members[id as usize];
            let knot = member.knots.get(member.part as usize + 1);
            sum ^= knot.map_or(0, |k| k.cell.0);
            for near in [member.before, member.after] {
                sum ^= self.members.get(near as usize).map_or(0, |m| m.part);
            }
        }
        std::hint::black_box(sum);
    }

    /// Handles all events of an actor up to a time at which its plan ends.
    fn events_until(
        &mut self,
        id: u32,
        time: f64,
        plan: &mut impl FnMut(&ActorEvent, &mut Chance, &mut PlanDraft<'_>),
    ) {
        while self.members[id as usize].end <= time {
            let end = self.members[id as usize].end;
            self.event(id, end, Cause::Done, plan);
        }
    }

    /// Gives an actor a new plan from a time on, at or before the end of its old one.
    fn event(
        &mut self,
        id: u32,
        time: f64,
        cause: Cause,
        plan: &mut impl FnMut(&ActorEvent, &mut Chance, &mut PlanDraft<'_>),
    ) {
        let member = &mut self.members[id as usize];
        let (knots, points) = (&mut member.knots, &mut self.points[id as usize]);
        let part = part_at(knots, member.part as usize, time);
        let (at, _) = place_at(knots, points, part, time);
        let cell = knots[part].cell;
        let event = ActorEvent {
            actor: ActorId(id),
            number: member.n_events,
            time,
            at,
            cell,
            cause,
        };
        member.n_events += 1;
        member.part = 0;
        let mut chance = Chance::new(self.seed, id, event.number);
        let mut draft = PlanDraft::new(knots, points, Knot { time, cell }, at);
        plan(&event, &mut chance, &mut draft);
        draft.take_at_least(time, LEAST_PLAN);
        let is_any = knots.len() > 1;
        member.end =
            knots.last().map_or(
                f64::INFINITY,
                |k| if is_any { k.time } else { f64::INFINITY },
            );
    }

    /// Finds the part of an actor's plan at a time, and the time of its next update.
    fn look_ahead(&mut self, id: u32, time: f64) {
        let member = &mut self.members[id as usize];
        let part = part_at(&member.knots, member.part as usize, time);
        member.part = part as u32;
        member.due = next_change(&member.knots, part);
    }

    /// Adds an actor to the list of its cell and to the wheel.
    fn list(&mut self, id: u32) {
        let member = &self.members[id as usize];
        let (cell, due) = (member.knots[member.part as usize].cell.0, member.due);
        if member.cell != cell {
            self.unlink(id);
            self.link(id, cell);
        }
        self.wheel.set(id, due);
    }

    fn link(&mut self, id: u32, cell: u32) {
        let head = &mut self.heads[cell as usize];
        let after = std::mem::replace(head, id);
        if after != NONE {
            self.members[after as usize].before = id;
        }
        let member = &mut self.members[id as usize];
        (member.cell, member.before, member.after) = (cell, NONE, after);
    }

    fn unlink(&mut self, id: u32) {
        let Member {
            cell,
            before,
            after,
            ..
        } = self.members[id as usize];
        match before {
            NONE => self.heads[cell as usize] = after,
            b => self.members[b as usize].after = after,
        }
        if after != NONE {
            self.members[after as usize].before = before;
        }
    }
}

/// Returns bits that are ordered as the numbers are.
fn ordered(x: f64) -> u64 {
    let bits = x.to_bits();
    bits ^ if bits >> 63 == 1 { u64::MAX } else { 1 << 63 }
}

fn unordered(bits: u64) -> f64 {
    f64::from_bits(bits ^ if bits >> 63 == 0 { u64::MAX } else { 1 << 63 })
}

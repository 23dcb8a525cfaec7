//! Covers W13: positions at a time depend on seed and events alone, and equal those of stepping every actor through every frame.

use std::collections::VecDeque;

use enfilade_cpg::{CellId, CellSet, Pvs};
use enfilade_geom::DVec3;
use enfilade_testkit::{GridParams, Rng, room_grid};

use super::{ActorEvent, ActorId, Actors, AwakeCells, Cause, Chance, Errands, PlanDraft, WayPoint};
use crate::layout::Layout;

const SEED: u64 = 42;

/// Rooms and the paths between all of them, through the middles of openings.
struct Town {
    layout: Layout,
    /// Per destination and cell: the exit towards it.
    next: Vec<Vec<Option<usize>>>,
    pvs: Pvs,
}

impl Town {
    fn new(n: usize) -> Self {
        let layout = Layout::new(&room_grid(&GridParams {
            outdoors: false,
            ..GridParams::offices(n, 1)
        }));
        let n_cells = layout.n_cells();
        let cell = |c: usize| CellId(c as u32);
        let mut next = vec![vec![None; n_cells]; n_cells];
        for (to, row) in next.iter_mut().enumerate() {
            let mut queue = VecDeque::from([cell(to)]);
            while let Some(c) = queue.pop_front() {
                for exit in layout.exits(c) {
                    let back = layout.exits(exit.to);
                    let i = back.iter().position(|e| e.portal == exit.portal);
                    if exit.to.idx() != to && row[exit.to.idx()].is_none() {
                        row[exit.to.idx()] = i;
                        queue.push_back(exit.to);
                    }
                }
            }
        }
        let near = |c: usize| {
            let mut set = CellSet::new(n_cells);
            set.insert(cell(c));
            for exit in layout.exits(cell(c)) {
                set.insert(exit.to);
            }
            set
        };
        let rows: Vec<CellSet> = (0..n_cells).map(near).collect();
        let pvs = Pvs::of_rows(&rows);
        Self { layout, next, pvs }
    }

    fn way(&self, from: CellId, to: u32, way: &mut Vec<WayPoint>) {
        let mut cell = from;
        while let Some(i) = self.next[to as usize][cell.idx()] {
            let exit = self.layout.exits(cell)[i];
            let at = self.layout.opening(exit.portal).center();
            way.push(WayPoint { at, cell });
            cell = exit.to;
        }
        let at = self.layout.cell(cell).bounds.center();
        way.push(WayPoint { at, cell });
    }

    fn errand(
        &self,
        event: &ActorEvent,
        chance: &mut Chance,
        plan: &mut PlanDraft<'_>,
        errands: &mut Errands,
    ) {
        let n = self.layout.n_cells() as u32;
        if let Cause::Told(place) = event.cause {
            // At a running pace.
            let mut way = Vec::new();
            self.way(event.cell, place % n, &mut way);
            way.iter().for_each(|&p| plan.walk(p, 4.0));
            plan.wait(30.0);
            return;
        }
        errands.plan(chance, plan, n, |to, way| self.way(event.cell, to, way));
    }

    fn populate(&self, n: u32) -> Actors {
        let mut actors = Actors::new(self.layout.n_cells(), SEED);
        let mut errands = errands();
        for i in 0..n {
            let cell = CellId(i % self.layout.n_cells() as u32);
            let at = self.layout.cell(cell).bounds.center();
            actors.add(at, cell, |event, chance, plan| {
                self.errand(event, chance, plan, &mut errands);
            });
        }
        actors
    }

    fn advance(&self, actors: &mut Actors, time: f64) {
        let mut errands = errands();
        actors.advance(time, |event, chance, plan| {
            self.errand(event, chance, plan, &mut errands);
        });
    }
}

fn errands() -> Errands {
    let mut errands = Errands::default();
    errands.stay = [0.0, 20.0];
    errands
}

/// Hash of all positions, to the bit.
fn hash(actors: &Actors) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |x: u64| hash = (hash ^ x).wrapping_mul(0x0100_0000_01b3).rotate_left(17);
    for id in 0..actors.len() as u32 {
        let place = actors.place(ActorId(id));
        add(place.map_or(1, |p| u64::from(p.cell.0) + 2));
        for x in place.map_or([0.0; 3], |p| p.at.to_array()) {
            add(x.to_bits());
        }
    }
    hash
}

#[test]
fn the_state_at_a_time_is_the_same_however_a_camera_walked() {
    let town = Town::new(60);
    let end = 400.0;
    let told = |actors: &mut Actors| {
        for i in 0..40 {
            actors.tell(ActorId(i * 7), 3.0 + f64::from(i) * 7.3, i * 11);
        }
    };
    let mut whole = town.populate(400);
    told(&mut whole);
    town.advance(&mut whole, end);
    let expected = hash(&whole);
    for walk in 0..100 {
        let mut rng = Rng::new(walk);
        let mut actors = town.populate(400);
        told(&mut actors);
        let mut awake = AwakeCells::new(town.layout.n_cells(), 5.0);
        let mut eye = CellId(0);
        let longest = [0.05, 2.0, 60.0][walk as usize % 3];
        let mut n_seen = 0;
        while actors.now() < end {
            let now = (actors.now() + rng.range(longest * 0.3, longest)).min(end);
            town.advance(&mut actors, now);
            let exits = town.layout.exits(eye);
            if !exits.is_empty() && rng.chance(0.1) {
                eye = exits[rng.below(exits.len())].to;
            }
            awake.update(now, town.pvs.visible_from(eye));
            let seen = awake.cells().iter().flat_map(|&c| actors.in_cell(c));
            n_seen += seen.filter_map(|a| actors.place(a)).count();
        }
        assert!(n_seen > 0);
        assert_eq!(hash(&actors), expected, "walk {walk}");
    }
    let mut other = town.populate(400);
    town.advance(&mut other, end);
    assert_ne!(hash(&other), expected, "messages change the state");
}

/// An actor that is stepped from frame to frame.
struct Stepped {
    at: DVec3,
    cell: CellId,
    /// Start of the current leg with its time, and the legs to come.
    from: (f64, DVec3),
    then: VecDeque<(f64, WayPoint)>,
    n_events: u32,
}

impl Stepped {
    fn step(&mut self, town: &Town, id: u32, now: f64) {
        loop {
            while let Some(&(time, to)) = self.then.front() {
                self.cell = to.cell;
                if now < time {
                    let share = (now - self.from.0) / (time - self.from.0);
                    self.at = self.from.1 + (to.at - self.from.1) * share;
                    return;
                }
                self.from = (time, to.at);
                self.then.pop_front();
            }
            // As an errand is planned: destination, speed, stay.
            let mut chance = Chance::new(SEED, id, self.n_events);
            self.n_events += 1;
            let to = chance.below(town.layout.n_cells() as u32);
            let speed = chance.range(Errands::default().speed);
            let stay = chance.range(errands().stay);
            let mut way = Vec::new();
            town.way(self.cell, to, &mut way);
            let (mut time, mut at) = self.from;
            for point in way {
                let seconds = at.distance(point.at) / speed;
                (time, at) = (time + seconds, point.at);
                if seconds > 0.0 {
                    self.then.push_back((time, point));
                }
            }
            let cell = CellId(to);
            let reached = self.then.back().map_or(self.cell, |_| cell);
            self.then
                .push_back((time + stay, WayPoint { at, cell: reached }));
        }
    }
}

#[test]
fn actors_equal_those_stepped_through_every_frame() {
    let town = Town::new(30);
    let n = 150;
    let mut actors = town.populate(n);
    let start = |i: u32| {
        let cell = CellId(i % town.layout.n_cells() as u32);
        let at = town.layout.cell(cell).bounds.center();
        Stepped {
            at,
            cell,
            from: (0.0, at),
            then: VecDeque::new(),
            n_events: 0,
        }
    };
    let mut stepped: Vec<Stepped> = (0..n).map(start).collect();
    for frame in 0..=60 * 120 {
        let now = f64::from(frame) / 60.0;
        for (id, actor) in (0..).zip(&mut stepped) {
            actor.step(&town, id, now);
        }
        // Queried seldom, and at odd times.
        if frame % 997 != 0 {
            continue;
        }
        town.advance(&mut actors, now);
        for (id, expected) in (0..).map(ActorId).zip(&stepped) {
            let place = actors.place(id).unwrap();
            assert_eq!(place.at, expected.at, "{id:?} at {now}");
            assert_eq!(place.cell, expected.cell, "{id:?} at {now}");
        }
        for c in (0..town.layout.n_cells() as u32).map(CellId) {
            let mut listed: Vec<u32> = actors.in_cell(c).map(|a| a.0).collect();
            listed.sort_unstable();
            let there = (0..n).filter(|&i| stepped[i as usize].cell == c);
            assert_eq!(listed, there.collect::<Vec<_>>(), "{c}");
        }
    }
    let events: u32 = stepped.iter().map(|s| s.n_events).sum();
    assert!(events > 3 * n, "{events}");
}

#[test]
fn velocities_are_those_of_the_places() {
    let town = Town::new(30);
    let mut actors = town.populate(100);
    town.advance(&mut actors, 50.0);
    let before: Vec<_> = (0..100)
        .map(|i| actors.place(ActorId(i)).unwrap())
        .collect();
    town.advance(&mut actors, 50.001);
    let mut n_moving = 0;
    for (i, was) in (0..).map(ActorId).zip(&before) {
        let is = actors.place(i).unwrap();
        n_moving += usize::from(was.velocity != DVec3::ZERO);
        if is.velocity == was.velocity {
            let by = (is.at - was.at) * 1000.0;
            assert!(by.distance(was.velocity) < 1e-6, "{by} {was:?}");
        }
    }
    assert!(n_moving > 10);
}

#[test]
fn only_actors_that_change_their_cell_are_updated() {
    let town = Town::new(60);
    let mut actors = town.populate(5000);
    let mut sum = 0;
    for frame in 0..600 {
        town.advance(&mut actors, f64::from(frame) / 60.0);
        sum += actors.n_updates();
    }
    assert!(sum > 0 && sum < 5000 * 600 / 60, "{sum}");
}

/// Cells 0 and 1: an actor that receives a message walks to the other one in a second and stays.
fn across(event: &ActorEvent, plan: &mut PlanDraft<'_>) {
    if let Cause::Told(_) = event.cause {
        let to = CellId(1 - event.cell.0);
        let at = event.at + DVec3::X;
        plan.walk(
            WayPoint {
                at,
                cell: event.cell,
            },
            2.0,
        );
        plan.walk(
            WayPoint {
                at: at + DVec3::X,
                cell: to,
            },
            2.0,
        );
    }
}

#[test]
fn messages_arrive_at_their_own_time_and_removed_actors_are_nowhere() {
    let mut actors = Actors::new(2, 1);
    let mut causes = Vec::new();
    let a = actors.add(DVec3::ZERO, CellId(0), |e, _, _| {
        causes.push((e.number, e.cause));
    });
    let b = actors.add(DVec3::ZERO, CellId(0), |_, _, _| {});
    assert_eq!(causes, [(0, Cause::Came)]);
    actors.tell(a, 10.0, 7);
    actors.tell(a, 20.5, 8);
    actors.tell(b, f64::NAN, 0);
    let advance = |actors: &mut Actors, time: f64| {
        let mut events = Vec::new();
        actors.advance(time, |e, _, plan| {
            events.push((e.actor, e.time, e.cause));
            across(e, plan);
        });
        events
    };
    let expected = [(b, 0.0, Cause::Told(0)), (b, 1.0, Cause::Done)];
    assert_eq!(advance(&mut actors, 9.0), expected);
    let there = |actors: &Actors, id| actors.place(id).map(|p| (p.at.x, p.cell.0));
    assert_eq!(there(&actors, b), Some((2.0, 1)));
    assert_eq!(there(&actors, a), Some((0.0, 0)));
    // Message at 10, on its way at 10.75, though updated only then.
    assert_eq!(advance(&mut actors, 10.75), [(a, 10.0, Cause::Told(7))]);
    assert_eq!(there(&actors, a), Some((1.5, 1)));
    let events = advance(&mut actors, 30.0);
    assert!(
        events.contains(&(a, 11.0, Cause::Done)) && events.contains(&(a, 20.5, Cause::Told(8)))
    );
    assert_eq!(there(&actors, a), Some((4.0, 0)));
    assert_eq!(actors.in_cell(CellId(0)).collect::<Vec<_>>(), [a]);
    // Time does not run back.
    assert!(advance(&mut actors, 5.0).is_empty());
    assert_eq!(actors.now(), 30.0);
    actors.tell(b, 31.0, 1);
    actors.remove(b);
    actors.remove(b);
    assert!(advance(&mut actors, 40.0).iter().all(|e| e.0 != b));
    assert_eq!(there(&actors, b), None);
    assert_eq!(actors.in_cell(CellId(1)).count(), 0);
    assert_eq!(actors.in_cell(CellId(7)).count(), 0);
}

#[test]
fn odd_plans_come_to_an_end() {
    let mut actors = Actors::new(1, 1);
    let mut n = 0;
    let mut odd = |event: &ActorEvent, _: &mut Chance, plan: &mut PlanDraft<'_>| {
        n += 1;
        let to = WayPoint {
            at: event.at + DVec3::X * 1e-9,
            cell: CellId(0),
        };
        plan.walk(to, 0.0);
        plan.walk(to, f64::NAN);
        plan.wait(-1.0);
        plan.wait(f64::NAN);
        plan.walk(
            WayPoint {
                at: DVec3::NAN,
                ..to
            },
            1.0,
        );
        // Far too short.
        plan.walk(to, 1.0);
    };
    let a = actors.add(DVec3::ZERO, CellId(0), &mut odd);
    actors.advance(1.0, &mut odd);
    assert!(actors.place(a).unwrap().at.is_finite());
    assert!((900..=1002).contains(&n), "{n}");
}

#[test]
fn time_goes_by_without_allocations() {
    let town = Town::new(60);
    let mut actors = town.populate(300);
    let mut awake = AwakeCells::new(town.layout.n_cells(), 1.0);
    let mut errands = errands();
    let mut now = 0.0;
    let mut frames = |n: usize| {
        let mut sum = DVec3::ZERO;
        for _ in 0..n {
            now += 0.5;
            actors.advance(now, |event, chance, plan| {
                town.errand(event, chance, plan, &mut errands);
            });
            awake.update(now, town.pvs.visible_from(CellId(5)));
            let seen = awake.cells().iter().flat_map(|&c| actors.in_cell(c));
            sum += seen
                .filter_map(|a| actors.place(a))
                .map(|p| p.at)
                .sum::<DVec3>();
        }
        sum
    };
    frames(20_000);
    let counted = allocation_counter::measure(|| {
        let _ = frames(200);
    });
    assert_eq!(counted.count_total, 0);
}

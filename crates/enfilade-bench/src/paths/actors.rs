//! Actors near and far: their state does not depend on the camera; and the cost of a frame with many.
//!
//! People in generated offices without an outdoors walk to one of 64 rooms through the centers of openings, stay, and
//! walk on; in real buildings, by the paths of walkers from place to place. The camera perceives everything within three
//! portals of its cell.

use std::collections::VecDeque;
use std::time::Instant;

use anyhow::{Context, ensure};
use enfilade::cpg::{CellSet, Pvs};
use enfilade::geom::DVec3;
use enfilade::world::{
    ActorEvent, ActorId, ActorPlace, Actors, Agent, AwakeCells, Chance, Errands, Layout,
    LayoutExit, PartId, Path, PathSearch, PlanDraft, Space, WalkMap, WayPoint,
};
use enfilade::{CellId, World};
use enfilade_testkit::{GridParams, Rng, room_grid};

use super::walk::Places;
use crate::rows::Figure;

const ACTORS: u32 = 100_000;
const PLACES: u32 = 64;
/// Places of errands in a building.
const N_IN_BUILDING: usize = 32;
const SEED: u64 = 5;
/// Frames per second.
const RATE: f64 = 60.0;
/// Marks the absence of an exit.
const NONE: u8 = u8::MAX;

/// Rooms, and the path from each to some places.
struct Town {
    layout: Layout,
    ways: TownWays,
    pvs: Pvs,
    n_actors: u32,
}

enum TownWays {
    Offices {
        places: Vec<CellId>,
        /// For each exit of each cell, the point of the opening and the cell behind it; and where each cell's exits begin.
        hops: Vec<(DVec3, CellId)>,
        first: Vec<u32>,
        /// For each place and cell, the index of the next exit; [`NONE`] at the place, and where there is no path.
        next: Vec<Vec<u8>>,
    },
    /// Places on floors with their cells, and the way from each to each; empty if there is none.
    Building {
        places: Vec<(DVec3, CellId)>,
        ways: Vec<Vec<Vec<WayPoint>>>,
    },
}

impl Town {
    fn new(scene: &str) -> anyhow::Result<Self> {
        let n = scene.strip_prefix("offices-").context("offices-N")?;
        let layout = Layout::new(&room_grid(&GridParams {
            outdoors: false,
            furniture: 0,
            ..GridParams::offices(n.parse()?, 1)
        }));
        let n_cells = layout.n_cells();
        let mut rng = Rng::new(1);
        let mut any = || CellId(rng.below(n_cells) as u32);
        let places: Vec<CellId> = (0..PLACES).map(|_| any()).collect();
        let (mut hops, mut first) = (Vec::new(), Vec::new());
        for c in (0..n_cells as u32).map(CellId) {
            first.push(hops.len() as u32);
            let point = |e: &LayoutExit| (layout.opening(e.portal).center(), e.to);
            hops.extend(layout.exits(c).iter().map(point));
        }
        let next = places.iter().map(|&place| {
            let mut row = vec![NONE; n_cells];
            let mut queue = VecDeque::from([place]);
            while let Some(c) = queue.pop_front() {
                for exit in layout.exits(c) {
                    let mut back = layout.exits(exit.to).iter();
                    let at = back.position(|e| e.portal == exit.portal);
                    if exit.to != place && row[exit.to.idx()] == NONE {
                        row[exit.to.idx()] = at.map_or(NONE, |i| i as u8);
                        queue.push_back(exit.to);
                    }
                }
            }
            row
        });
        let next = next.collect();
        Ok(Self {
            pvs: near_cells(&layout),
            layout,
            ways: TownWays::Offices {
                places,
                hops,
                first,
                next,
            },
            n_actors: ACTORS,
        })
    }

    /// Makes a town of a building, with places where people can stand and the paths between them.
    fn of_building(world: &World) -> anyhow::Result<Self> {
        let space = Space::new(world.clone())?;
        let layout = Layout::new(world);
        let map = WalkMap::new(&space, Agent::default());
        let mut random = Places::new(Agent::default());
        let on_root = |at: DVec3| (PartId::ROOT, at);
        let (mut search, mut path) = (PathSearch::new(), Path::default());
        let mut places: Vec<(DVec3, CellId)> = Vec::new();
        for _ in 0..100 * N_IN_BUILDING {
            let Some(at) = random.any(&space) else { break };
            // Paths begin and end on the floor of the map.
            let found = search.find(&map, &space, [at, at].map(on_root), |_, _| true, &mut path);
            let middle = at + DVec3::Y * 0.5 * Agent::default().height;
            if let (Ok(()), Some(cell)) = (found, layout.locate(middle))
                && places.len() < N_IN_BUILDING
            {
                places.push((path.points[0].at, cell));
            }
        }
        let mut ways = vec![vec![Vec::new(); places.len()]; places.len()];
        let mut n_ways = 0;
        for (i, from) in places.iter().enumerate() {
            for (j, to) in places.iter().enumerate().filter(|(j, _)| *j != i) {
                let ends = [from.0, to.0].map(on_root);
                if search
                    .find(&map, &space, ends, |_, _| true, &mut path)
                    .is_ok()
                {
                    path.add_way_points(&layout, from.1, &mut ways[i][j]);
                    // An errand from there begins where this one ends.
                    if let Some(last) = ways[i][j].last_mut() {
                        last.at = to.0;
                    }
                    n_ways += 1;
                }
            }
        }
        ensure!(n_ways > places.len(), "only {n_ways} ways");
        Ok(Self {
            pvs: near_cells(&layout),
            layout,
            ways: TownWays::Building { places, ways },
            n_actors: ACTORS / 20,
        })
    }

    fn way(&self, at: DVec3, mut cell: CellId, place: u32, way: &mut Vec<WayPoint>) {
        match &self.ways {
            TownWays::Offices {
                places,
                hops,
                first,
                next,
            } => {
                let next = &next[place as usize];
                while next[cell.idx()] != NONE {
                    let hop = first[cell.idx()] + u32::from(next[cell.idx()]);
                    let (at, to) = hops[hop as usize];
                    way.push(WayPoint { at, cell });
                    cell = to;
                }
                if cell == places[place as usize] {
                    let at = self.layout.cell(cell).bounds.center();
                    way.push(WayPoint { at, cell });
                }
            }
            TownWays::Building { places, ways } => {
                let to = place as usize % places.len();
                if let Some(from) = places.iter().position(|p| p.0 == at) {
                    way.extend_from_slice(&ways[from][to]);
                }
            }
        }
    }

    fn home(&self, id: u32) -> (DVec3, CellId) {
        if let TownWays::Building { places, .. } = &self.ways {
            return places[id as usize % places.len()];
        }
        let cell =
            CellId((u64::from(id) * self.layout.n_cells() as u64 / u64::from(ACTORS)) as u32);
        (self.layout.cell(cell).bounds.center(), cell)
    }

    /// Returns `true` if the middle of a body at a place is in its cell, or is beside it by less than the floors of paths resolve.
    fn is_in_cell(&self, place: &ActorPlace) -> bool {
        let agent = Agent::default();
        let heights = [0.5, 0.25, 0.75, 0.4, 0.6].map(|share| DVec3::Y * share * agent.height);
        // Floors are squares of a quarter of the radius: the crossing of a portal is up to one off in either direction.
        let side = 0.25 * agent.radius * 1.5;
        let around = [DVec3::ZERO, DVec3::X, -DVec3::X, DVec3::Z, -DVec3::Z].map(|v| v * side);
        let mut all = heights.iter().flat_map(|up| around.map(|v| *up + v));
        all.any(|v| self.layout.locate(place.at + v) == Some(place.cell))
    }

    fn populate(&self) -> Actors {
        let mut actors = Actors::new(self.layout.n_cells(), SEED);
        let mut plans = self.plans();
        for id in 0..self.n_actors {
            let (at, cell) = self.home(id);
            actors.add(at, cell, &mut plans);
        }
        actors
    }

    fn plans(&self) -> impl FnMut(&ActorEvent, &mut Chance, &mut PlanDraft<'_>) + '_ {
        let mut errands = Errands::default();
        move |event, chance, plan| {
            errands.plan(chance, plan, PLACES, |to, way| {
                self.way(event.at, event.cell, to, way);
            });
        }
    }

    /// Returns the next cell of a strolling camera.
    fn stroll(&self, eye: CellId, rng: &mut Rng) -> CellId {
        let exits = self.layout.exits(eye);
        if exits.is_empty() || rng.chance(0.02) {
            return CellId(rng.below(self.layout.n_cells()) as u32);
        }
        exits[rng.below(exits.len())].to
    }
}

/// Returns the cells within three portals of each.
fn near_cells(layout: &Layout) -> Pvs {
    let near = |c: u32| {
        let mut set = CellSet::new(layout.n_cells());
        set.insert(CellId(c));
        let mut edge = vec![CellId(c)];
        for _ in 0..3 {
            let around = edge.iter().flat_map(|&c| layout.exits(c)).map(|e| e.to);
            edge = around.filter(|&c| set.insert(c)).collect();
        }
        set
    };
    let rows: Vec<CellSet> = (0..layout.n_cells() as u32).map(near).collect();
    Pvs::of_rows(&rows)
}

/// Returns a hash of all positions, exact to the bit.
fn hash(actors: &Actors) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for id in 0..actors.len() as u32 {
        let Some(place) = actors.place(ActorId(id)) else {
            continue;
        };
        for x in place.at.to_array().map(f64::to_bits) {
            hash = (hash ^ x ^ u64::from(place.cell.0))
                .wrapping_mul(0x0100_0000_01b3)
                .rotate_left(17);
        }
    }
    hash
}

/// An actor stepped in every frame.
struct Stepped {
    at: DVec3,
    cell: CellId,
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
            let mut chance = Chance::new(SEED, id, self.n_events);
            self.n_events += 1;
            let usual = Errands::default();
            let to = chance.below(PLACES);
            let speed = chance.range(usual.speed);
            let stay = chance.range(usual.stay);
            let mut way = Vec::new();
            town.way(self.from.1, self.cell, to, &mut way);
            let (mut time, mut at) = self.from;
            let mut cell = self.cell;
            for point in way {
                let seconds = at.distance(point.at) / speed;
                (time, at) = (time + seconds, point.at);
                if seconds > 0.0 {
                    self.then.push_back((time, point));
                }
                cell = point.cell;
            }
            let stays = WayPoint { at, cell };
            self.then.push_back((time + stay, stays));
        }
    }
}

/// Counts camera walks that change any actor's state, and actors whose state differs from that of stepping every frame.
pub(super) fn state(scene: &str) -> anyhow::Result<Figure> {
    state_of(&Town::new(scene)?)
}

/// As [`state`], in a building; also counts actors that are not where their cell is, or in another cell's list.
pub(super) fn state_in(world: &World) -> anyhow::Result<Figure> {
    let town = Town::of_building(world)?;
    let mut figure = state_of(&town)?;
    let mut actors = town.populate();
    let (mut n_astray, mut n_unlisted, mut n, mut n_moving) = (0_u64, 0_u64, 0_u64, 0_u64);
    let mut worst = String::new();
    for k in 1..=200 {
        actors.advance(f64::from(k) * 1.7, town.plans());
        let mut listed = vec![0_u32; town.layout.n_cells()];
        for id in (0..town.n_actors).map(ActorId) {
            let place = actors.place(id).context("all stay")?;
            listed[place.cell.idx()] += 1;
            n += 1;
            n_moving += u64::from(place.velocity != DVec3::ZERO);
            if !town.is_in_cell(&place) {
                n_astray += 1;
                let here = town.layout.locate(place.at + DVec3::Y * 0.9);
                worst = format!("; {} in {here:?}, not {}", place.at, place.cell);
            }
        }
        for (cell, n) in (0..).map(CellId).zip(listed) {
            let in_cell = actors.in_cell(cell).filter_map(|a| actors.place(a));
            n_unlisted += u64::from(in_cell.filter(|p| p.cell == cell).count() != n as usize);
        }
    }
    figure.value += (n_astray + n_unlisted) as f64;
    figure.note += &format!(
        "; of {n} positions, {n_moving} of them on the way, {n_astray} are not in the actor's cell; {n_unlisted} lists differ{worst}"
    );
    Ok(figure)
}

fn state_of(town: &Town) -> anyhow::Result<Figure> {
    const WALKS: u64 = 100;
    const END: f64 = 300.0;
    let mut whole = town.populate();
    whole.advance(END, town.plans());
    let expected = hash(&whole);
    let mut n_other = 0;
    let mut n_frames = 0;
    for walk in 0..WALKS {
        let mut rng = Rng::new(walk);
        let mut actors = town.populate();
        let mut plans = town.plans();
        let mut awake = AwakeCells::new(town.layout.n_cells(), 3.0);
        let mut eye = CellId(0);
        let longest = [0.05, 1.0, 20.0][walk as usize % 3];
        while actors.now() < END {
            let now = (actors.now() + rng.range(longest * 0.2, longest)).min(END);
            actors.advance(now, &mut plans);
            eye = town.stroll(eye, &mut rng);
            awake.update(now, town.pvs.visible_from(eye));
            let seen = awake.cells().iter().flat_map(|&c| actors.in_cell(c));
            let sum: DVec3 = seen.filter_map(|a| actors.place(a)).map(|p| p.at).sum();
            std::hint::black_box(sum);
            n_frames += 1;
        }
        n_other += u64::from(hash(&actors) != expected);
    }
    let start = Instant::now();
    let mut n_off = 0_u64;
    let n_actors = town.n_actors;
    for id in 0..n_actors {
        let (at, cell) = town.home(id);
        let mut stepped = Stepped {
            at,
            cell,
            from: (0.0, at),
            then: VecDeque::new(),
            n_events: 0,
        };
        for frame in 0..=(END * RATE) as u32 {
            stepped.step(town, id, f64::from(frame) / RATE);
        }
        let place = whole.place(ActorId(id)).context("all stay")?;
        n_off += u64::from(place.at != stepped.at || place.cell != stepped.cell);
    }
    let stepping = start.elapsed().as_secs_f64() / (END * RATE) * 1e6;
    let note = format!(
        "of {WALKS} camera walks of {n_frames} frames in all, {n_other} end with another state of {n_actors} actors after {END} s; \
             {n_off} actors differ, to the bit, from stepping all of them every frame, which takes {stepping:.0} µs a frame"
    );
    Ok(Figure::new((n_other + n_off) as f64, 0.0, note))
}

/// Measures a frame of all actors: time advances, cells wake, actors in them are placed. [Units: µs]
pub(super) fn cost(scene: &str) -> anyhow::Result<Figure> {
    const FRAMES: usize = 3600;
    let town = Town::new(scene)?;
    let mut actors = town.populate();
    let mut plans = town.plans();
    // After the first minutes, in which all actors start at once.
    let begin = 600.0;
    actors.advance(begin, &mut plans);
    let mut awake = AwakeCells::new(town.layout.n_cells(), 3.0);
    let mut rng = Rng::new(2);
    let mut eye = CellId(17);
    let (mut times, mut advancing, mut n_updates, mut n_awake) = (Vec::new(), Vec::new(), 0, 0);
    for frame in 0..FRAMES {
        // Into another room every three seconds.
        if frame % 180 == 0 {
            eye = town.stroll(eye, &mut rng);
        }
        let now = begin + frame as f64 / RATE;
        let start = Instant::now();
        actors.advance(now, &mut plans);
        advancing.push(start.elapsed().as_secs_f64() * 1e6);
        awake.update(now, town.pvs.visible_from(eye));
        let mut sum = DVec3::ZERO;
        for actor in awake.cells().iter().flat_map(|&c| actors.in_cell(c)) {
            if let Some(place) = actors.place(actor) {
                sum += place.at;
                n_awake += 1;
            }
        }
        std::hint::black_box(sum);
        times.push(start.elapsed().as_secs_f64() * 1e6);
        n_updates += actors.n_updates();
    }
    let mean = times.iter().sum::<f64>() / FRAMES as f64;
    times.sort_by(f64::total_cmp);
    advancing.sort_by(f64::total_cmp);
    Ok(Figure {
        // The median: on a shared machine, the mean measures the interruptions.
        value: times[FRAMES / 2],
        most: 50.0,
        note: format!(
            "µs per frame in the median, {:.1} of them to advance time; mean {mean:.1}, 99th percentile {:.1}; {ACTORS} actors in {} rooms, {:.0} of which change room or plan each frame and {:.0} are awake",
            advancing[FRAMES / 2],
            times[FRAMES * 99 / 100],
            town.layout.n_cells(),
            n_updates as f64 / FRAMES as f64,
            f64::from(n_awake) / FRAMES as f64,
        ),
    })
}

//! Things in cells: the cells that a shape reaches, tested against all openings; time of a move; cost of movers in
//! Dirkse's maze.

use std::time::Instant;

use anyhow::Context;
use enfilade::geom::{Aabb, DVec3};
use enfilade::internals::geom::Sets;
use enfilade::runtime::{Sight, SightOptions, SightState, View, Viewer};
use enfilade::world::{Flood, PartId, Place, Pose, Posted, Shape, Space, SpaceViewer, Things, Tie};
use enfilade::{CellId, World};
use enfilade_render::walk;
use enfilade_testkit::{GridParams, Rng, dirkse_maze, room_grid};

use super::gaps::{gaps_of, joined};
use crate::rows::{Figure, baked};

/// Number of random shapes, and of steps of a thing.
const SHAPES: usize = 1_000_000;
const STEPS: usize = 10_000_000;
/// As in Dirkse 2002, section 8.2.
const SAMPLES: usize = 290;
const GHOSTS: usize = 4;
const GHOST_TRIANGLES: f64 = 11_188.0;

/// Generates a world by the name of its scene.
pub(super) fn offices(scene: &str) -> anyhow::Result<World> {
    let n = scene.strip_prefix("offices-").context("offices-N")?;
    Ok(room_grid(&GridParams {
        merges: 0.2,
        turn: 0.3,
        holes: 0.2,
        ..GridParams::offices(n.parse()?, 1)
    }))
}

/// Returns a random point in a cell that is not outdoors.
pub(super) fn random_indoors(space: &Space, rng: &mut Rng) -> DVec3 {
    let layout = space.layout(PartId::ROOT);
    loop {
        let cell = CellId(rng.below(layout.n_cells()) as u32);
        let p = rng.point_in(&layout.cell(cell).bounds);
        let found = layout.locate(p);
        if found.is_some_and(|c| !layout.cell(c).is_outdoor) {
            return p;
        }
    }
}

/// Counts shapes whose flood differs from the cells that the openings they meet join to their own, computed by other
/// code.
pub(super) fn cells(scene: &str) -> anyhow::Result<Figure> {
    let world = offices(scene)?;
    let gaps = gaps_of(&world);
    let space = Space::new(world)?;
    let layout = space.layout(PartId::ROOT);
    let n_cells = layout.n_cells();
    let mut flood = Flood::default();
    let mut rng = Rng::new(1);
    let (mut n_wrong, mut n_several) = (0, 0);
    for i in 0..SHAPES {
        let pose = Pose {
            turn: rng.turn(),
            at: random_indoors(&space, &mut rng),
        };
        let half = DVec3::from_array([0, 1, 2].map(|_| rng.range(0.05, 3.0)));
        let is_ball = i % 2 == 0;
        let shape = if is_ball {
            Shape::sphere(half.x)?
        } else {
            Shape::block(&Aabb::new(-half, half))?
        };
        let start = layout.locate(pose.at).context("an air point")?;
        // An opening within rounding may count as met or not.
        let margin = 4.0 * layout.tolerance();
        let mut least = joined(&gaps, n_cells, half, is_ball, &pose);
        let mut most = joined(&gaps, n_cells, half + margin, is_ball, &pose);
        let place = Place {
            part: PartId::ROOT,
            cell: start,
        };
        let posted = Posted::new(&shape, PartId::ROOT, &pose);
        let reached = flood.reach(&space, place, &posted, |_, _| true);
        let is_in = |sets: &mut Sets, cell: u32| sets.find(cell) == sets.find(start.0);
        let n_least = (0..n_cells as u32)
            .filter(|c| is_in(&mut least, *c))
            .count();
        let known = reached.iter().filter(|p| is_in(&mut least, p.cell.0));
        let is_same =
            known.count() == n_least && reached.iter().all(|p| is_in(&mut most, p.cell.0));
        n_wrong += usize::from(!is_same);
        n_several += usize::from(reached.len() > 1);
    }
    let note = format!("of {SHAPES} balls and boxes, {n_several} in several cells");
    Ok(Figure::new(n_wrong as f64, 0.0, note))
}

/// Walks a thing of 0.3 m and counts steps after which its cell differs from the locator's.
pub(super) fn moved(scene: &str) -> anyhow::Result<Figure> {
    let steps = Steps::take(scene)?;
    let note = format!(
        "of {STEPS} steps of 5 mm to 10 cm, {} into another cell",
        steps.n_changed
    );
    Ok(Figure::new(steps.n_wrong as f64, 0.0, note))
}

/// Measures a step that stays in its cell. [Units: ns]
pub(super) fn stays(scene: &str) -> anyhow::Result<Figure> {
    let steps = Steps::take(scene)?;
    let note = format!(
        "ns a step that stays in its cell; a query of the locator alone takes {:.0} ns; {STEPS} steps",
        steps.locate_ns
    );
    Ok(Figure::new(steps.stay_ns, 150.0, note))
}

/// Measures a step into another cell. [Units: ns]
pub(super) fn crosses(scene: &str) -> anyhow::Result<Figure> {
    let steps = Steps::take(scene)?;
    let note = format!("ns a step into another cell, {} of them", steps.n_changed);
    Ok(Figure::new(steps.cross_ns, 1000.0, note))
}

struct Steps {
    n_wrong: usize,
    n_changed: usize,
    stay_ns: f64,
    cross_ns: f64,
    locate_ns: f64,
}

impl Steps {
    fn take(scene: &str) -> anyhow::Result<Self> {
        let space = Space::new(offices(scene)?)?;
        let mut things = Things::new();
        let mut rng = Rng::new(2);
        let mut at = random_indoors(&space, &mut rng);
        let shape = Shape::sphere(0.3)?;
        let root = PartId::ROOT;
        let id = things.add(
            &space,
            shape,
            root,
            Pose::from_translation(at),
            Tie::Carried,
        )?;
        // The path is known beforehand, so that only steps are timed.
        let mut way = Vec::with_capacity(STEPS);
        let mut cells = Vec::with_capacity(STEPS);
        let mut heading = DVec3::X;
        while way.len() < STEPS {
            if rng.chance(0.02) {
                heading = rng.turn() * DVec3::X;
            }
            let to = at + heading * rng.range(0.005, 0.1);
            let found = space.locate(root, to);
            let is_indoor = found.is_some_and(|p| !space.layout(p.part).cell(p.cell).is_outdoor);
            if is_indoor {
                at = to;
                way.push(to);
                cells.push(found);
            } else {
                heading = rng.turn() * DVec3::X;
            }
        }
        let mut own = Self {
            n_wrong: 0,
            n_changed: 0,
            stay_ns: 0.0,
            cross_ns: 0.0,
            locate_ns: 0.0,
        };
        let start = Instant::now();
        for p in &way {
            std::hint::black_box(space.locate(root, *p));
        }
        own.locate_ns = start.elapsed().as_nanos() as f64 / STEPS as f64;
        // Runs of steps that stay are timed together; a crossing alone, minus the time of the clock.
        let clock = {
            let start = Instant::now();
            for _ in 0..1000 {
                std::hint::black_box(Instant::now());
            }
            start.elapsed().as_nanos() as f64 / 1000.0
        };
        let (mut stay, mut cross, mut n_stayed) = (0.0, 0.0, 0);
        let mut k = 0;
        let mut last = things.place(&space, id)?;
        while k < STEPS {
            let start = Instant::now();
            let mut end = k;
            while end < STEPS && cells[end] == last {
                let pose = Pose::from_translation(way[end]);
                let step = things.set_pose(&space, id, root, pose)?;
                own.n_wrong += usize::from(step.to != last);
                end += 1;
            }
            if end > k {
                stay += start.elapsed().as_nanos() as f64 - clock;
                n_stayed += end - k;
            }
            k = end;
            if k < STEPS {
                let pose = Pose::from_translation(way[k]);
                let start = Instant::now();
                let step = things.set_pose(&space, id, root, pose)?;
                cross += start.elapsed().as_nanos() as f64 - clock;
                own.n_wrong += usize::from(step.to != cells[k]);
                own.n_changed += 1;
                last = cells[k];
                k += 1;
            }
        }
        own.stay_ns = stay / n_stayed.max(1) as f64;
        own.cross_ns = cross / own.n_changed.max(1) as f64;
        Ok(own)
    }
}

/// Measures the largest share of all triangles that a view of the maze with four ghosts processes, in percent.
pub(super) fn maze(_: &str) -> anyhow::Result<Figure> {
    let world = baked(&dirkse_maze(1).scene)?;
    let space = Space::new(world.clone())?;
    let root = PartId::ROOT;
    // One triangle per chunk, as Dirkse counts.
    let by_triangle = SightOptions {
        chunk_triangles: 1,
        ..SightOptions::default()
    };
    let sight = &Sight::build_with(&world, &by_triangle)?;
    let state = SightState::new(sight);
    let steps = walk(&world, sight, SAMPLES);
    let mut things = Things::new();
    let ghosts = (0..GHOSTS)
        .map(|_| {
            things
                .add(
                    &space,
                    Shape::sphere(0.5)?,
                    root,
                    Pose::IDENTITY,
                    Tie::Carried,
                )
                .map_err(Into::into)
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    let all = sight.n_triangles() as f64 + GHOSTS as f64 * GHOST_TRIANGLES;
    let mut viewer = SpaceViewer::new(&space);
    let mut fine = Viewer::new(sight);
    let (mut most, mut most_whole, mut global, mut own) = (0.0_f64, 0.0_f64, 0.0, 0.0);
    for (i, &(eye, toward)) in steps.iter().enumerate() {
        // They follow the same path, each at its own distance.
        for (k, &ghost) in ghosts.iter().enumerate() {
            let behind = (i + steps.len() * (2 * k + 1) / (2 * GHOSTS)) % steps.len();
            let at = DVec3::from_array(steps[behind].0.map(f64::from));
            things.set_pose(&space, ghost, root, Pose::from_translation(at))?;
        }
        let view = View::perspective(eye, toward, [0.0, 1.0, 0.0], 60_f32.to_radians(), 4.0 / 3.0)?;
        let frustum = fine.see_through_walls(sight, &view);
        let n_frustum = frustum.n_triangles() as f64;
        let in_frustum = ghosts.iter().filter(|g| {
            let at = things
                .pose(&space, **g)
                .map_or(DVec3::ZERO, |p| p.1.at)
                .as_vec3();
            let cells = frustum.cells();
            frustum.sees_box(cells, [(at - 0.5).to_array(), (at + 0.5).to_array()])
        });
        let n_global = in_frustum.count() as f64 * GHOST_TRIANGLES;
        let n_seen = fine.see(sight, &state, &view).n_triangles() as f64;
        let seen = viewer.see(&space, root, &view);
        let n_own = things.see(&space, &seen).len() as f64 * GHOST_TRIANGLES;
        most_whole = most_whole.max((n_frustum + n_global) / all * 100.0);
        // As Dirkse counts: the maze and its dots; ghosts separately.
        most = most.max(n_seen / sight.n_triangles() as f64 * 100.0);
        global += n_global;
        own += n_own;
    }
    let n = steps.len().max(1) as f64;
    let note = format!(
        "% of the maze's triangles at most (Dirkse 0.69), by the view frustum with ghosts {most_whole:.1} % (67.76); triangles of \
             ghosts a view: {:.0} if global, {:.0} in cells",
        global / n,
        own / n
    );
    Ok(Figure::new(most, 0.69, note))
}

//! Things, lamps and moving rooms in real buildings. The judges are trees of triangles and the polygons of portals as they are
//! stored, read from the world alone: they share the locator with what they judge, and nothing else.

use std::sync::Arc;

use anyhow::{Context, ensure};
use enfilade::geom::{Aabb, DQuat, DVec3, Triangle};
use enfilade::internals::geom::{Bvh, Sets};
use enfilade::runtime::View;
use enfilade::world::{PartId, Place, Pose, Shape, Space, SpaceViewer, ThingId, Things, Tie};
use enfilade::{CellId, PortalId, World};
use enfilade_testkit::oracle::first_hit;
use enfilade_testkit::{GridParams, Rng, cabin, room_grid};

use super::gaps::{Gap, gaps_of, joined};
use super::lit::Lit;
use super::parts::{Docked, Pair};
use super::solids::{Solid, first_item, hull, items_of};
use crate::rows::Figure;

const ROOT: PartId = PartId::ROOT;

const SHAPES: usize = 1_000_000;
/// Points of a shape that must be in the cells that it reaches.
const POINTS: usize = 4;

const SAMPLES: usize = 4_000_000;

const POSES: usize = 300;
/// Rays of a view.
const RAYS: usize = 4000;

/// Returns a random point in the air: of a random cell, outdoors too.
fn point_in_air(space: &Space, rng: &mut Rng) -> (CellId, DVec3) {
    let layout = space.layout(ROOT);
    loop {
        let cell = CellId(rng.below(layout.n_cells()) as u32);
        let p = rng.point_in(&layout.cell(cell).bounds);
        if layout.locate(p) == Some(cell) {
            return (cell, p);
        }
    }
}

/// Counts things whose cells differ from those joined by the openings that they meet, and points of things, seen from their
/// origins through the triangles of the building, in cells that do not list them.
pub(super) fn cells(world: &World) -> anyhow::Result<Figure> {
    let space = Space::new(world.clone())?;
    let layout = space.layout(ROOT);
    let gaps = gaps_of(world);
    let walls = Bvh::build(&structure(world));
    let mut things = Things::new();
    let ids = [true, false].map(|is_ball| thing(&space, &mut things, is_ball, DVec3::ONE));
    let mut ids = [ids[0].as_ref().copied().ok(), ids[1].as_ref().copied().ok()];
    let mut rng = Rng::new(1);
    let margin = 4.0 * layout.tolerance();
    let (mut n_wrong, mut n_several, mut n_points, mut n_lost) = (0, 0, 0_usize, 0_usize);
    let mut half = [DVec3::ONE; 2];
    let mut worst = String::new();
    for i in 0..SHAPES {
        let (start, at) = point_in_air(&space, &mut rng);
        let pose = Pose {
            turn: rng.turn(),
            at,
        };
        let k = i % 2;
        let is_ball = k == 0;
        // Shapes last for a while, so that things move, too.
        if i % 16 < 2 {
            half[k] = DVec3::from_array([0, 1, 2].map(|_| rng.range(0.05, 3.0)));
            if let Some(id) = ids[k].take() {
                things.remove(id)?;
            }
            ids[k] = Some(thing(&space, &mut things, is_ball, half[k])?);
        }
        let (id, half) = (ids[k].context("a thing")?, half[k]);
        things.set_pose(&space, id, ROOT, pose)?;
        let listed: Vec<CellId> = things.places(&space, id).map(|p| p.cell).collect();
        let mut least = joined(&gaps, layout.n_cells(), half, is_ball, &pose);
        let mut most = joined(&gaps, layout.n_cells(), half + margin, is_ball, &pose);
        let is_in = |sets: &mut Sets, c: u32| sets.find(c) == sets.find(start.0);
        let all = 0..layout.n_cells() as u32;
        let needed = all.filter(|c| is_in(&mut least, *c));
        let is_whole = needed.into_iter().all(|c| listed.contains(&CellId(c)));
        let is_same = is_whole && listed.iter().all(|c| is_in(&mut most, c.0));
        // The lists of cells must agree with those of things.
        let part = ROOT;
        let is_listed = |cell: CellId, things: &mut Things| {
            things
                .things_in(&space, Place { part, cell })
                .any(|t| t == id)
        };
        let agrees = listed.iter().all(|c| is_listed(*c, &mut things))
            && (listed.contains(&CellId(0)) || !is_listed(CellId(0), &mut things));
        if !(is_same && agrees) {
            n_wrong += 1;
            worst = format!("; {half} ball {is_ball} at {at}");
        }
        n_several += usize::from(listed.len() > 1);
        for _ in 0..POINTS {
            let q = pose.point(if is_ball {
                rng.turn() * DVec3::X * (half.x * rng.unit())
            } else {
                rng.point_in(&Aabb::new(-half, half))
            });
            // A point on a portal may be on either side, after rounding.
            let beyond = q + (q - at).normalize_or_zero() * 8.0 * layout.tolerance();
            let cell = layout
                .locate(q)
                .filter(|_| !walls.any_hit(at, beyond, |_| false));
            let Some(cell) = cell.filter(|c| layout.locate(beyond) == Some(*c)) else {
                continue;
            };
            n_points += 1;
            n_lost += usize::from(!listed.contains(&cell));
        }
    }
    ensure!(n_several > 0 && n_points > 0, "no shape met a portal");
    let note = format!(
        "of {SHAPES} balls and boxes, {n_several} in several cells, {n_wrong} with other cells than those of the openings \
             that they meet; {n_lost} of {n_points} points in sight of their middle are in another cell{worst}"
    );
    Ok(Figure::new((n_wrong + n_lost) as f64, 0.0, note))
}

fn thing(
    space: &Space,
    things: &mut Things,
    is_ball: bool,
    half: DVec3,
) -> anyhow::Result<ThingId> {
    let shape = if is_ball {
        Shape::sphere(half.x)?
    } else {
        Shape::block(&Aabb::new(-half, half))?
    };
    Ok(things.add(space, shape, ROOT, Pose::IDENTITY, Tie::Carried)?)
}

/// Returns the structural triangles of a world, seals included.
fn structure(world: &World) -> Vec<Triangle> {
    let batches = world.batches.iter();
    batches.flat_map(|b| b.primitive.triangles()).collect()
}

/// Returns the world without its objects, leaves of doors included: only walls block, and every portal has an opening.
fn bare(world: &World) -> World {
    let mut world = world.clone();
    world.details.clear();
    for portal in &mut world.graph.portals {
        portal.fittings.clear();
    }
    world
}

/// Counts points that a lamp reaches in a straight line, past all walls and shut openings, without the space reporting so.
pub(super) fn lights(world: &World) -> anyhow::Result<Figure> {
    let world = bare(world);
    let mut space = Space::new(world.clone())?;
    let shut: Vec<PortalId> = world.graph.portal_ids().step_by(3).collect();
    for portal in &shut {
        space.close(ROOT, *portal);
    }
    let walls = Bvh::build(&structure(&world));
    let leaves = shut.iter().map(|p| Gap::of(&world.graph[*p]));
    let leaves: Vec<Triangle> = leaves
        .flat_map(|g| g.triangles().collect::<Vec<_>>())
        .collect();
    let lit = Lit::sampled(
        &space,
        SAMPLES,
        |rng| point_in_air(&space, rng).1,
        |at, beyond| {
            !walls.any_hit(at, beyond, |_| false) && first_hit(&leaves, at, beyond).is_none()
        },
    )?;
    let Lit {
        n_lit,
        n_lost,
        n_known,
        n_beyond,
    } = lit;
    ensure!(n_beyond > 0, "no sample was lit in another cell");
    let note = format!(
        "of {n_lit} lit samples of {SAMPLES}, {n_beyond} of them in other cells than the lamp; {n_known} are reported as \
             lit, {:.2} × as many",
        n_known as f64 / n_lit as f64
    );
    Ok(Figure::new(n_lost as f64, 0.0, note))
}

/// Places a part anew until the box around it is free of the host's triangles.
fn free_pose(
    layout: &Space,
    solid: &Solid,
    host: PartId,
    own: &Aabb,
    turns: f64,
    rng: &mut Rng,
) -> Option<Pose> {
    let layout = layout.layout(host);
    for _ in 0..20_000 {
        let cell = CellId(rng.below(layout.n_cells()) as u32);
        let middle = rng.point_in(&layout.cell(cell).bounds);
        // Beside a cabin there may be a wall of the building.
        let is_beside = layout.n_cells() == 2 && layout.cell(cell).is_outdoor;
        if is_beside || layout.locate(middle) != Some(cell) {
            continue;
        }
        let turn = DQuat::from_rotation_y(rng.range(-turns, turns));
        let pose = Pose {
            turn,
            at: middle - turn * own.center(),
        };
        let corners = own.corners().map(|p| pose.point(p));
        if solid.is_free(&Aabb::of_points(&corners).expanded(0.02)) {
            return Some(pose);
        }
    }
    None
}

/// Counts first hits of rays that are not in the answer: a building that sails with a cabin in it, and in that another.
pub(super) fn poses(world: &World) -> anyhow::Result<Figure> {
    let root = room_grid(&GridParams::offices(4, 3));
    let mut space = Space::new(root)?;
    let building = space.add_part(
        world.clone(),
        ROOT,
        Pose::from_translation(DVec3::X * 300.0),
    )?;
    // 0.9 to 1.8 m wide, and a third of that.
    let (large, small) = (cabin(7, 0.3, 2), cabin(3, 0.08, 1));
    let boxes = [hull(&large), hull(&small)];
    let room = space.add_part(large, building, Pose::IDENTITY)?;
    let inner = space.add_part(small, room, Pose::IDENTITY)?;
    let parts = [ROOT, building, room, inner];
    let solids = parts.map(|p| (p, Solid::of(&space, p)));
    let mut viewer = SpaceViewer::new(&space);
    let mut rng = Rng::new(1);
    let (mut n_lost, mut n_hits, mut n_across, mut n_parts) = (0_usize, 0_usize, 0_usize, 0_usize);
    let mut n_poses = 0;
    let mut worst = String::new();
    while n_poses < POSES {
        let sail = Pose {
            turn: rng.turn(),
            at: DVec3::X * 300.0 + rng.turn() * DVec3::X * 100.0,
        };
        space.set_pose(building, sail)?;
        let there = free_pose(&space, &solids[1].1, building, &boxes[0], 3.0, &mut rng);
        space.set_pose(room, there.context("no room for a cabin")?)?;
        let there = free_pose(&space, &solids[2].1, room, &boxes[1], 3.0, &mut rng);
        space.set_pose(inner, there.context("no room for a box")?)?;
        // In each of the three, or beside the cabin.
        let frame = [building, building, room, inner][n_poses % 4];
        let layout = space.layout(frame);
        let eye = if n_poses % 4 == 0 {
            let near = space.pose(room).point(boxes[0].center());
            space.pose(building).point_back(near) + rng.turn() * DVec3::X * rng.range(0.3, 2.0)
        } else {
            let cell = CellId(rng.below(layout.n_cells()) as u32);
            rng.point_in(&layout.cell(cell).bounds)
        };
        // Rounded as the view is.
        let eye = eye.as_vec3();
        let cell = layout.locate(eye.as_dvec3()).map(|c| layout.cell(c));
        // Not in a wall: the surroundings of a cabin may be one.
        if cell.is_none_or(|c| c.is_outdoor && frame != building) {
            continue;
        }
        n_poses += 1;
        let view = View::around(eye.to_array())?;
        let seen = viewer.see(&space, frame, &view);
        let known = items_of(&seen);
        n_parts += seen.parts().count();
        for _ in 0..RAYS {
            let direction = rng.turn() * DVec3::X;
            if let Some(item) = first_item(&space, &solids, frame, [eye.as_dvec3(), direction]) {
                n_hits += 1;
                n_across += usize::from(item.0 != frame);
                if !known.contains(&item) {
                    n_lost += 1;
                    worst = format!("; {} from {eye} in {} along {direction}", item.0.0, frame.0);
                }
            }
        }
    }
    ensure!(n_across > 0, "no ray left its part");
    let note = format!(
        "rays lost of {n_hits}, {n_across} of them into other parts, in {POSES} poses of the building and two cabins in it, \
             one in the other; {:.1} parts a view{worst}",
        n_parts as f64 / POSES as f64
    );
    Ok(Figure::new(n_lost as f64, 0.0, note))
}

/// Poses of docking in a building.
const ROOMS: usize = 4;

/// As the row `docking` of cabins in the open, but in the rooms of a building; and cabins that dock at the building's own
/// openings to the outdoors.
pub(super) fn docking(world: &World) -> anyhow::Result<Figure> {
    let world = Arc::new(bare(world));
    let space = Space::new(world.clone())?;
    let solid = Solid::of(&space, ROOT);
    let mut rng = Rng::new(3);
    let mut total = Docked::default();
    for k in 0..ROOMS {
        let size = 0.15 + 0.05 * k as f32;
        let own = hull(&cabin(1, size, 2));
        // A box around both, whichever window it is.
        let both = own.expanded(own.size().max_element() + 0.02);
        let pose = free_pose(&space, &solid, ROOT, &both, 3.0, &mut rng);
        let mut pair = Pair::within(world.clone(), pose.context("no room for two cabins")?, size)?;
        pair.dock(&format!("room {k}"), &mut total)?;
    }
    let n_openings = dock_at_openings(&world, &solid, &mut total)?;
    ensure!(n_openings > 0, "no opening to dock at");
    let figure = total.figure()?;
    Ok(Figure {
        note: format!(
            "{n_openings} openings of the building, {ROOMS} pairs of cabins in its rooms; {}",
            figure.note
        ),
        ..figure
    })
}

/// Docks a cabin at each opening of the building that it fits into.
fn dock_at_openings(
    world: &Arc<World>,
    solid: &Solid,
    total: &mut Docked,
) -> anyhow::Result<usize> {
    let mut n = 0;
    let layout = enfilade::world::Layout::new(world);
    for id in world.graph.portal_ids() {
        let opening = layout.opening(id);
        let Some(outdoors) = layout.outdoors() else {
            break;
        };
        let [first, second] = opening.cells();
        if opening.normal().y.abs() > 0.1 || ![first, second].contains(&outdoors) {
            continue;
        }
        let out = opening.normal() * if second == outdoors { 1.0 } else { -1.0 };
        // In the middle of its largest piece.
        let area = |p: &&[DVec3]| Aabb::of_points(*p).size().length_squared();
        let piece = opening.pieces().max_by(|a, b| area(a).total_cmp(&area(b)));
        let Some(middle) = piece.map(|p| p.iter().sum::<DVec3>() / p.len() as f64) else {
            continue;
        };
        for size in [0.3, 0.15, 0.08, 0.04_f32] {
            let pair = Pair::at_opening(world.clone(), id, middle, out, size)?;
            // The window must be within the opening, and nothing in the way, however far it is off.
            if pair.is_within_opening() && solid.is_free(&pair.second_hull().expanded(0.012)) {
                let mut pair = pair;
                pair.dock(&format!("portal {}", id.0), total)?;
                n += 1;
                break;
            }
        }
    }
    Ok(n)
}

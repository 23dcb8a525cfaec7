//! Moving rooms: crossings of openings, visibility at a pose, lamps, and the cost of a frame.

use std::time::Instant;

use anyhow::ensure;
use enfilade::geom::{DQuat, DVec3};
use enfilade::internals::geom::Ray;
use enfilade::runtime::{Sightlines, View};
use enfilade::world::{PartId, Passing, Pose, Shape, Space, SpaceViewer, Things, Tie};
use enfilade::{PortalId, World};
use enfilade_testkit::{GridParams, Rng, cabin, room_grid};

use super::lit::Lit;
use super::solids::{items_of, model};
use super::things::{offices, random_indoors};
use crate::measure::{median, point};
use crate::rows::Figure;

const MOTIONS: usize = 1_000_000;
/// Straight lines that approximate the curve of a motion.
const SUB_STEPS: usize = 1024;
/// Largest turn of a motion. [Units: rad]
const MOST_TURN: f64 = 30.0 * std::f64::consts::PI / 180.0;

const POSES: usize = 1000;
const DEEP: usize = 16;
/// Size of a picture whose pixels are rays.
const PICTURE: [usize; 2] = [96, 72];

const SAMPLES: usize = 10_000_000;

fn vector(rng: &mut Rng, reach: f64) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|_| rng.range(-reach, reach)))
}

/// Counts crossings that 1,024 straight lines per motion find and the run-time does not report.
pub(super) fn passings(_: &str) -> anyhow::Result<Figure> {
    let world = cabin(1, 1.0, 0);
    let mut space = Space::new(room_grid(&GridParams::two_rooms()))?;
    let part = space.add_part(world.clone(), PartId::ROOT, Pose::IDENTITY)?;
    let mut rng = Rng::new(4);
    let mut found: Vec<Passing> = Vec::new();
    let (mut n_missed, mut n_known) = (0, 0);
    for _ in 0..MOTIONS {
        let start = Pose {
            turn: rng.turn(),
            at: vector(&mut rng, 4.0),
        };
        let axis = vector(&mut rng, 1.0).normalize_or(DVec3::Y);
        let end = Pose {
            turn: DQuat::from_axis_angle(axis, rng.range(0.0, MOST_TURN)) * start.turn,
            at: start.at + vector(&mut rng, 2.0),
        };
        let window = PortalId(rng.below(world.graph.portals.len()) as u32);
        let opening = space.layout(part).opening(window);
        let p = start
            .toward(&end, rng.unit())
            .point(opening.center() + vector(&mut rng, 1.0));
        found.clear();
        space.passings(part, [&start, &end], p, &mut found);
        let at = |k: usize| {
            let t = k as f64 / SUB_STEPS as f64;
            start.toward(&end, t).point_back(p)
        };
        let mut a = at(0);
        for k in 1..=SUB_STEPS {
            let b = at(k);
            let [ha, hb] = [a, b].map(|q| opening.height_of(q));
            if (ha > 0.0) != (hb > 0.0) && is_inside(&opening, a.lerp(b, ha / (ha - hb))) {
                n_known += 1;
                let t = k as f64 / SUB_STEPS as f64;
                let about = t - 1.0 / SUB_STEPS as f64 - 1e-6..=t + 1e-6;
                let is_told = found
                    .iter()
                    .any(|x| x.portal == window && about.contains(&x.at));
                n_missed += usize::from(!is_told);
            }
            a = b;
        }
    }
    let note =
        format!("of {n_known} passings through one window in {MOTIONS} motions of 30° at most");
    Ok(Figure::new(n_missed as f64, 0.0, note))
}

/// Returns `true` for a point inside an opening by more than 0.1 mm: at its rim, lines and curves differ.
fn is_inside(opening: &enfilade::world::Opening, q: DVec3) -> bool {
    opening.pieces().any(|piece| {
        (0..piece.len()).all(|i| {
            let along = piece[(i + 1) % piece.len()] - piece[i];
            opening.normal().cross(along).dot(q - piece[i]) > 1e-4 * along.length()
        })
    })
}

/// Counts pixels of views from rooms nested 16 deep whose first hit, in the whole model at that time, is not in the
/// answer.
pub(super) fn poses(_: &str) -> anyhow::Result<Figure> {
    let size = |k: usize| 1.6_f32.powi((DEEP - k) as i32);
    let worlds: Vec<World> = (0..=DEEP)
        .map(|k| cabin(7, size(k), if k == DEEP { 2 } else { 0 }))
        .collect();
    let mut space = Space::new(worlds[0].clone())?;
    let mut host = PartId::ROOT;
    for world in &worlds[1..] {
        host = space.add_part(world.clone(), host, Pose::IDENTITY)?;
    }
    let mut viewer = SpaceViewer::new(&space);
    let mut rng = Rng::new(1);
    let (mut n_lost, mut n_hits, mut n_parts) = (0_usize, 0_usize, 0_usize);
    for _ in 0..POSES {
        for k in 1..worlds.len() {
            let pose = pose_within(&mut rng, &worlds[k], &worlds[k - 1]);
            space.set_pose(PartId(k as u32), pose)?;
        }
        let (tree, items) = model(&space, worlds.len());
        let frame = PartId(rng.below(worlds.len()) as u32);
        let [low, high] = worlds[frame.0 as usize].graph.cells[0].aabb.map(point);
        let eye = DVec3::from_array([0, 1, 2].map(|k| rng.range(low[k], high[k]))).as_vec3();
        let toward = (vector(&mut rng, 1.0) * DVec3::new(1.0, 0.4, 1.0)).as_vec3();
        let up = [0.0, 1.0, 0.0];
        let aspect = PICTURE[0] as f32 / PICTURE[1] as f32;
        let view = View::perspective(eye.to_array(), toward.to_array(), up, 1.1, aspect)?;
        let seen = viewer.see(&space, frame, &view);
        let known = items_of(&seen);
        n_parts += seen.parts().count();
        let forward = toward.as_dvec3().normalize();
        let right = forward.cross(DVec3::Y).normalize();
        let (up, tan) = (right.cross(forward), 0.55_f64.tan());
        let pose = space.pose(frame);
        for i in 0..PICTURE[0] * PICTURE[1] {
            let [x, y] = [(i % PICTURE[0], 0), (i / PICTURE[0], 1)]
                .map(|(i, k)| (i as f64 + 0.5) / PICTURE[k] as f64 * 2.0 - 1.0);
            let direction = forward + right * (x * tan * f64::from(aspect)) + up * (y * tan);
            let ray = Ray {
                origin: pose.point(eye.as_dvec3()),
                direction: pose.direction(direction),
                t_max: f64::INFINITY,
            };
            if let Some(hit) = tree.closest_hit(&ray, |_| false) {
                n_hits += 1;
                n_lost += usize::from(!known.contains(&items[hit.triangle as usize]));
            }
        }
    }
    let note = format!(
        "pixels lost of {n_hits} in {POSES} poses of {DEEP} nested rooms, each ray-traced against all its triangles; \
             {:.1} rooms a view",
        n_parts as f64 / POSES as f64
    );
    Ok(Figure::new(n_lost as f64, 0.0, note))
}

/// Returns a small motion around the position of a cabin in the middle of a larger one.
fn pose_within(rng: &mut Rng, own: &World, host: &World) -> Pose {
    let boxes = [own, host].map(|w| w.graph.cells[0].aabb.map(point));
    let [own, host_middle] = boxes.map(|b| (b[0] + b[1]) * 0.5);
    let size = boxes[1][1] - boxes[1][0];
    let axis = DVec3::new(rng.range(-0.3, 0.3), 1.0, rng.range(-0.3, 0.3)).normalize();
    let turn = DQuat::from_axis_angle(axis, rng.range(-0.15, 0.15));
    let shift = [0, 1, 2].map(|k| rng.range(-0.03, 0.03) * size[k]);
    Pose {
        turn,
        at: host_middle + DVec3::from_array(shift) - turn * own,
    }
}

/// Measures the error of a point of a room that moves ten kilometers away, after as many motions. [Units: mm]
pub(super) fn far(_: &str) -> anyhow::Result<Figure> {
    let worlds = [cabin(5, 1.0, 0), cabin(5, 1.0, 0), cabin(6, 0.3, 0)];
    let mut space = Space::new(worlds[0].clone())?;
    let at = DVec3::new(10_000.0, 3.0, -7_000.0);
    let start = Pose {
        turn: Rng::new(1).turn(),
        at,
    };
    let ship = space.add_part(worlds[1].clone(), PartId::ROOT, start)?;
    let boat = space.add_part(
        worlds[2].clone(),
        ship,
        pose_within(&mut Rng::new(3), &worlds[2], &worlds[1]),
    )?;
    let p = DVec3::new(0.4, 0.2, 0.3);
    let before = space.between(boat, PartId::ROOT).point(p);
    for k in 0..2 * POSES {
        let step = Pose::about(at, DVec3::Y, if k % 2 == 0 { 0.01 } else { -0.01 });
        let pose = step.after(space.local_pose(ship));
        space.set_pose(ship, pose)?;
    }
    let there = space.between(boat, PartId::ROOT).point(p);
    let back = space.between(PartId::ROOT, boat).point(there);
    let value = there.distance(before).max(back.distance(p)) * 1e3;
    let note = format!(
        "mm off, 12 km from the root's origin, after {} motions",
        2 * POSES
    );
    Ok(Figure::new(value, 1.0, note))
}

/// Counts points that a lamp reaches in a straight line without the space reporting so.
pub(super) fn lamps(scene: &str) -> anyhow::Result<Figure> {
    let mut world = offices(scene)?;
    world.details.clear();
    let mut space = Space::new(world.clone())?;
    for portal in world.graph.portal_ids().step_by(3) {
        space.close(PartId::ROOT, portal);
    }
    let lines = Sightlines::build(&world);
    let state = space.state(PartId::ROOT);
    let lit = Lit::sampled(
        &space,
        SAMPLES,
        |rng| random_indoors(&space, rng),
        |at, beyond| {
            let [at, beyond] = [at, beyond].map(|p| p.as_vec3().to_array());
            lines.is_clear(state, at, beyond)
        },
    )?;
    let Lit {
        n_lit,
        n_lost,
        n_known,
        ..
    } = lit;
    ensure!(n_lit > 0, "no sample was lit");
    let note = format!(
        "of {n_lit} lit samples of {SAMPLES}; {n_known} are reported as lit, {:.2} × as many",
        n_known as f64 / n_lit as f64
    );
    Ok(Figure::new(n_lost as f64, 0.0, note))
}

/// Measures the time of a frame with 10,000 cells relative to 1,000: a lift moves, 200 of 10,000 things move, an eye
/// looks.
pub(super) fn cost(_: &str) -> anyhow::Result<Figure> {
    let [small, large] = [1000, 10_000].map(frame_us);
    let (small, large) = (small?, large?);
    let note = format!(
        "{large:.0} µs a frame with 10,000 cells, {small:.0} µs with 1,000; 10,000 things each"
    );
    Ok(Figure::new(large / small, 1.5, note))
}

/// Returns the median time of a frame. [Units: µs]
fn frame_us(n_cells: usize) -> anyhow::Result<f64> {
    let world = offices(&format!("offices-{n_cells}"))?;
    let mut space = Space::new(world.clone())?;
    let lift = space.add_part(cabin(1, 0.4, 0), PartId::ROOT, Pose::IDENTITY)?;
    let mut things = Things::new();
    let mut rng = Rng::new(3);
    let mut ids = Vec::new();
    for _ in 0..10_000 {
        let pose = Pose::from_translation(random_indoors(&space, &mut rng));
        ids.push(things.add(
            &space,
            Shape::sphere(0.3)?,
            PartId::ROOT,
            pose,
            Tie::Carried,
        )?);
    }
    let shaft = random_indoors(&space, &mut rng);
    let mut viewer = SpaceViewer::new(&space);
    let mut times = Vec::new();
    for i in 0..600 {
        let eye = random_indoors(&space, &mut rng).as_vec3().to_array();
        let toward = vector(&mut rng, 1.0).as_vec3().to_array();
        let view = View::perspective(eye, toward, [0.0, 1.0, 0.0], 1.1, 1.6)?;
        let start = Instant::now();
        let at = Pose::from_translation(shaft + DVec3::Y * (f64::from(i % 20) * 0.05));
        space.set_pose(lift, at)?;
        for k in 0..200 {
            let id = ids[(i as usize * 200 + k) % ids.len()];
            let (frame, pose) = things.pose(&space, id)?;
            let step = Pose::from_translation(pose.at + vector(&mut rng, 0.03));
            let moved = things.set_pose(&space, id, frame, step)?;
            if moved.to.is_none() {
                things.set_pose(&space, id, frame, pose)?;
            }
        }
        let seen = viewer.see(&space, PartId::ROOT, &view);
        std::hint::black_box(things.see(&space, &seen).len());
        if i >= 100 {
            times.push(start.elapsed().as_secs_f64() * 1e6);
        }
    }
    Ok(median(&mut times))
}

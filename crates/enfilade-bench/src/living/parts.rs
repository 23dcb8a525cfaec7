//! Many moving parts, and parts that dock: the cost of a motion, and views through doors that meet but for a small error.

use std::collections::BTreeSet;
use std::time::Instant;

use anyhow::{Context, ensure};
use enfilade::geom::{Bvh, DVec3, Ray, Triangle};
use enfilade::runtime::View;
use enfilade::world::{PartId, Pose, Shape, Space, SpaceViewer, Things, Tie};
use enfilade::{CellId, PortalId, World};
use enfilade_testkit::{GridParams, Rng, cabin, room_grid};

use super::rooms::point;
use crate::rows::Figure;

/// Rounds of motions, of which the median counts.
const ROUNDS: usize = 30;
/// Distance of cabins 5 m wide, so that neighbors' boxes overlap as they move. [Units: wu]
const PITCH: f64 = 5.5;

/// Returns a space with as many cabins on a square lattice as the name says, and their poses.
fn fleet(n: usize) -> anyhow::Result<(Space, Vec<Pose>)> {
    let cabin = std::sync::Arc::new(cabin(1, 1.0, 0));
    let mut space = Space::new(room_grid(&GridParams::offices(10, 1)))?;
    let width = (n as f64).sqrt().ceil() as usize;
    let mut poses = Vec::new();
    for k in 0..n {
        let at = DVec3::new((k % width) as f64, 0.0, (k / width) as f64) * PITCH;
        let pose = Pose::from_translation(at + DVec3::X * 100.0);
        space.add_part(cabin.clone(), PartId::ROOT, pose)?;
        poses.push(pose);
    }
    Ok((space, poses))
}

/// Returns the median time of moving each part once, divided by their number. [Units: µs]
fn motion_us(n: usize) -> anyhow::Result<f64> {
    let (mut space, poses) = fleet(n)?;
    let mut rng = Rng::new(2);
    let mut times = Vec::new();
    for _ in 0..ROUNDS {
        let shifts: Vec<DVec3> = (0..n)
            .map(|_| {
                DVec3::new(
                    rng.range(-0.4, 0.4),
                    rng.range(-0.4, 0.4),
                    rng.range(-0.4, 0.4),
                )
            })
            .collect();
        let start = Instant::now();
        for (k, (pose, shift)) in poses.iter().zip(&shifts).enumerate() {
            let pose = Pose::from_translation(pose.at + *shift);
            space.set_pose(PartId(k as u32 + 1), pose)?;
        }
        times.push(start.elapsed().as_secs_f64() * 1e6 / n as f64);
    }
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied().context("no rounds")
}

/// Measures the time of moving one of many parts. [Units: µs]
pub(super) fn one(scene: &str) -> anyhow::Result<Figure> {
    let n: usize = scene.rsplit('-').next().context("no number")?.parse()?;
    Ok(Figure {
        value: motion_us(n)?,
        most: 10.0,
        note: format!(
            "µs a motion of one of {n} cabins, {PITCH} m apart, median of {ROUNDS} rounds"
        ),
    })
}

/// Measures the time a part of moving all of 1,600, relative to moving all of 100.
pub(super) fn all(_: &str) -> anyhow::Result<Figure> {
    let [few, many] = [100, 1600].map(motion_us);
    let (few, many) = (few?, many?);
    Ok(Figure {
        value: many / few,
        most: 1.5,
        note: format!(
            "times as long a part if all of 1,600 move as if all of 100 do; {:.2} ms a frame",
            many * 1.6
        ),
    })
}

/// A pair of cabins whose windows face each other.
struct Pair {
    space: Space,
    worlds: [World; 2],
    ids: [PartId; 2],
    /// The pose of the second if the windows coincide, the middle of the seam, and the direction out of the first.
    touching: Pose,
    middle: DVec3,
    outward: DVec3,
}

impl Pair {
    fn new(has_air: bool) -> anyhow::Result<Self> {
        let root = room_grid(&if has_air {
            GridParams::offices(4, 3)
        } else {
            GridParams::two_rooms()
        });
        let worlds = [cabin(1, 1.0, 2), cabin(1, 1.0, 2)];
        let mut space = Space::new(root.clone())?;
        let first = Pose::from_translation(DVec3::X * 100.0);
        let a = space.add_part(worlds[0].clone(), PartId::ROOT, first)?;
        let window = space.layout(a).opening(PortalId(0));
        let is_inner_first = Some(window.cells()[1]) == space.layout(a).outdoors();
        let outward = window.normal() * if is_inner_first { 1.0 } else { -1.0 };
        let middle = window.center();
        let touching = first.after(&Pose::about(middle, DVec3::Y, std::f64::consts::PI));
        let b = space.add_part(worlds[1].clone(), PartId::ROOT, touching)?;
        Ok(Self {
            space,
            worlds,
            ids: [a, b],
            touching,
            middle: first.point(middle),
            outward,
        })
    }

    /// Moves the second away from the first by `gap`, turned by `angle` about a vertical axis in the seam.
    fn set(&mut self, gap: f64, angle: f64) -> anyhow::Result<()> {
        let turn = Pose::about(self.middle, DVec3::Y, angle);
        let shift = Pose::from_translation(self.outward * gap);
        let pose = shift.after(&turn).after(&self.touching);
        Ok(self.space.set_pose(self.ids[1], pose)?)
    }

    /// Returns the chunks and objects of the other cabin that an eye in one sees, as numbers.
    fn seen(
        &self,
        viewer: &mut SpaceViewer,
        from: usize,
        eye: DVec3,
    ) -> anyhow::Result<BTreeSet<u64>> {
        let view = View::around(eye.as_vec3().to_array())?;
        let seen = viewer.see(&self.space, self.ids[from], &view);
        let Some(seen) = seen.of_part(self.ids[1 - from]) else {
            return Ok(BTreeSet::new());
        };
        let details = seen.details().iter().map(|d| u64::from(d.0) | 1 << 32);
        Ok(seen
            .chunks()
            .iter()
            .map(|c| u64::from(c.0))
            .chain(details)
            .collect())
    }

    /// Returns those objects and chunks of the other cabin that rays through the seam hit first, by tracing the
    /// triangles of both.
    fn hit(&self, from: usize, eye: DVec3, rng: &mut Rng) -> BTreeSet<u64> {
        let mut triangles: Vec<Triangle> = Vec::new();
        let mut items = Vec::new();
        for k in [0, 1] {
            let (world, sight) = (&self.worlds[k], self.space.sight(self.ids[k]));
            let pose = self.space.between(self.ids[k], self.ids[from]);
            for (id, chunk) in (0_u64..).zip(sight.chunks()) {
                let positions = &world.batches[chunk.batch as usize].primitive.positions;
                let first = chunk.first_index as usize;
                let indices = &sight.indices(chunk.batch)[first..first + chunk.n_indices as usize];
                for t in indices.chunks_exact(3) {
                    triangles.push([0, 1, 2].map(|i| pose.point(point(positions[t[i] as usize]))));
                    items.push((k, id));
                }
            }
            for (id, object) in (1_u64 << 32..).zip(&world.details) {
                let placement = pose.matrix() * object.placement();
                for p in &world.detail_meshes[object.mesh as usize].primitives {
                    for t in p.indices.chunks_exact(3) {
                        let vertex = |i: usize| {
                            placement.transform_point3(point(p.positions[t[i] as usize]))
                        };
                        triangles.push([0, 1, 2].map(vertex));
                        items.push((k, id));
                    }
                }
            }
        }
        let bvh = Bvh::build(&triangles);
        let opening = self.space.layout(self.ids[from]).opening(PortalId(0));
        let bounds = opening.bounds();
        let mut found = BTreeSet::new();
        for _ in 0..400 {
            let share = DVec3::from_array([0, 1, 2].map(|_| rng.range(0.05, 0.95)));
            let target = bounds.min + bounds.size() * share;
            let ray = Ray {
                origin: eye,
                direction: target - eye,
                t_max: f64::INFINITY,
            };
            if let Some(hit) = bvh.closest_hit(&ray, |_| false) {
                let (k, id) = items[hit.triangle as usize];
                found.extend((k != from).then_some(id));
            }
        }
        found
    }

    /// Returns `true` if a ball in the doorway of one is in the other, too.
    fn passes(&self, from: usize) -> anyhow::Result<bool> {
        let opening = self.space.layout(self.ids[from]).opening(PortalId(0));
        let is_inner_first =
            Some(opening.cells()[1]) == self.space.layout(self.ids[from]).outdoors();
        let inward = opening.normal() * if is_inner_first { -1.0 } else { 1.0 };
        let mut things = Things::new();
        let pose = Pose::from_translation(opening.center() + inward * 0.05);
        let ball = things.add(
            &self.space,
            Shape::sphere(0.055)?,
            self.ids[from],
            pose,
            Tie::Carried,
        )?;
        Ok(things
            .places(&self.space, ball)
            .any(|p| p.part == self.ids[1 - from]))
    }
    /// Counts what is lost across the seam from one cabin, and the items that rays hit.
    fn judge(
        &self,
        from: usize,
        viewer: &mut SpaceViewer,
        rng: &mut Rng,
    ) -> anyhow::Result<[usize; 2]> {
        let met = self.space.meets(self.ids[from], PortalId(0));
        let mut wrong = usize::from(met != [(self.ids[1 - from], PortalId(0))]);
        wrong += usize::from(!self.passes(from)?);
        let layout = self.space.layout(self.ids[from]);
        let cell = layout.cell(CellId(0)).bounds;
        let mut n_items = 0;
        for k in 0..8 {
            let share = DVec3::from_array([0, 1, 2].map(|_| rng.range(0.1, 0.9)));
            let mut eye = cell.min + cell.size() * share;
            if k == 0 {
                // In the overlap, or just before the seam.
                eye = layout.opening(PortalId(0)).center();
                eye += (cell.center() - eye).normalize() * 0.003;
            }
            let hit = self.hit(from, eye, rng);
            let seen = self.seen(viewer, from, eye)?;
            n_items += hit.len();
            wrong += hit.difference(&seen).count();
        }
        Ok([wrong, n_items])
    }
}

/// Counts items seen, meetings and balls that differ between cabins that dock with an error and cabins that touch.
pub(super) fn docking(_: &str) -> anyhow::Result<Figure> {
    let (mut n_wrong, mut n_items, mut n_poses) = (0_usize, 0_usize, 0_usize);
    let mut worst = Vec::new();
    for has_air in [false, true] {
        let mut pair = Pair::new(has_air)?;
        let mut viewer = SpaceViewer::new(&pair.space);
        let mut rng = Rng::new(7);
        for gap_mm in [-10.0, -5.0, -1.0, -0.1, 0.0, 0.1, 1.0, 5.0, 10.0_f64] {
            for degrees in [-1.0, -0.5, 0.0, 0.5, 1.0_f64] {
                n_poses += 1;
                pair.set(gap_mm * 1e-3, degrees.to_radians())?;
                let mut wrong = 0;
                for from in [0, 1] {
                    let [lost, hit] = pair.judge(from, &mut viewer, &mut rng)?;
                    wrong += lost;
                    n_items += hit;
                }
                n_wrong += wrong;
                if wrong > 0 {
                    worst.push(format!("{gap_mm} mm {degrees}° air {has_air}: {wrong}"));
                }
            }
        }
    }
    ensure!(n_items > 0, "no ray passed a seam");
    Ok(Figure {
        value: n_wrong as f64,
        most: 0.0,
        note: format!(
            "meetings, balls in a doorway and items hit by rays that are lost in {n_poses} poses from 1 cm apart to 1 cm \
             into each other, turned by up to 1°; {n_items} items hit. {}",
            worst.join("; ")
        ),
    })
}

//! Many moving parts, and parts that dock: the cost of a motion, and views through doors that meet but for a small error.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, ensure};
use enfilade::geom::{Aabb, DVec3};
use enfilade::internals::geom::Ray;
use enfilade::runtime::View;
use enfilade::world::{PartId, Pose, Shape, Space, SpaceViewer, Things, Tie};
use enfilade::{PortalId, World};
use enfilade_testkit::{GridParams, Rng, cabin, room_grid};

use super::solids::{PartItem, Solid, hull};
use crate::measure::median;
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
    Ok(median(&mut times))
}

/// Measures the time of moving one of many parts. [Units: µs]
pub(super) fn one(scene: &str) -> anyhow::Result<Figure> {
    let n: usize = scene.rsplit('-').next().context("no number")?.parse()?;
    let note =
        format!("µs a motion of one of {n} cabins, {PITCH} m apart, median of {ROUNDS} rounds");
    Ok(Figure::new(motion_us(n)?, 10.0, note))
}

/// Measures the time a part of moving all of 1,600, relative to moving all of 100.
pub(super) fn all(_: &str) -> anyhow::Result<Figure> {
    let [few, many] = [100, 1600].map(motion_us);
    let (few, many) = (few?, many?);
    let note = format!(
        "times as long a part if all of 1,600 move as if all of 100 do; {:.2} ms a frame",
        many * 1.6
    );
    Ok(Figure::new(many / few, 1.5, note))
}

/// Two parts with an opening each that face each other: cabins, or a building and a cabin.
pub(super) struct Pair {
    space: Space,
    ids: [PartId; 2],
    solids: [Solid; 2],
    portals: [PortalId; 2],
    /// A point of either opening, and the direction out of the part there, in the part's frame.
    seams: [(DVec3, DVec3); 2],
    /// The pose of the second if the openings coincide.
    touching: Pose,
}

impl Pair {
    fn new(has_air: bool) -> anyhow::Result<Self> {
        let root = room_grid(&if has_air {
            GridParams::offices(4, 3)
        } else {
            GridParams::two_rooms()
        });
        Self::within(root, Pose::from_translation(DVec3::X * 100.0), 1.0)
    }

    /// Places two cabins in a world, the first at a pose.
    pub(super) fn within(
        root: impl Into<Arc<World>>,
        first: Pose,
        size: f32,
    ) -> anyhow::Result<Self> {
        let mut space = Space::new(root)?;
        let a = space.add_part(cabin(1, size, 2), PartId::ROOT, first)?;
        let seam = window(&space, a);
        Self::meeting(space, a, PortalId(0), seam, size)
    }

    /// Places a cabin in front of an opening of a building to the outdoors, at a point of it.
    pub(super) fn at_opening(
        building: Arc<World>,
        portal: PortalId,
        middle: DVec3,
        outward: DVec3,
        size: f32,
    ) -> anyhow::Result<Self> {
        let mut space = Space::new(room_grid(&GridParams::offices(4, 3)))?;
        let pose = Pose::from_translation(DVec3::X * 300.0);
        let a = space.add_part(building, PartId::ROOT, pose)?;
        Self::meeting(space, a, portal, (middle, outward), size)
    }

    /// Adds a cabin whose window coincides with an opening.
    fn meeting(
        mut space: Space,
        a: PartId,
        portal: PortalId,
        seam: (DVec3, DVec3),
        size: f32,
    ) -> anyhow::Result<Self> {
        let b = space.add_part(cabin(1, size, 2), PartId::ROOT, Pose::IDENTITY)?;
        let own = window(&space, b);
        let angle = |v: DVec3| v.x.atan2(v.z);
        // Upright, with the window towards the opening.
        let turn = Pose::about(own.0, DVec3::Y, angle(-seam.1) - angle(own.1));
        let touching = Pose::from_translation(seam.0 - own.0).after(&turn);
        let touching = space.pose(a).after(&touching);
        let solids = [a, b].map(|p| Solid::of(&space, p));
        space.set_pose(b, touching)?;
        Ok(Self {
            space,
            ids: [a, b],
            solids,
            portals: [portal, PortalId(0)],
            seams: [seam, own],
            touching,
        })
    }

    /// Returns the box of the second in the frame of the first, touching.
    pub(super) fn second_hull(&self) -> Aabb {
        let to = self.space.between(self.ids[1], self.ids[0]);
        let corners = hull(self.space.world(self.ids[1])).corners();
        Aabb::of_points(&corners.map(|p| to.point(p)))
    }

    /// Returns `true` if the second's opening is within the first's.
    pub(super) fn is_within_opening(&self) -> bool {
        let to = self.space.between(self.ids[1], self.ids[0]);
        let [own, its] = [0, 1].map(|k| self.space.layout(self.ids[k]).opening(self.portals[k]));
        let mut corners = its.pieces().flatten().map(|p| to.point(*p));
        corners.all(|p| {
            own.pieces().any(|piece| {
                (0..piece.len()).all(|i| {
                    let along = piece[(i + 1) % piece.len()] - piece[i];
                    own.normal().cross(along).dot(p - piece[i]) > 0.0
                })
            })
        })
    }

    /// Moves the second away from the first by `gap`, turned by `angle` about a vertical axis in the seam.
    fn set(&mut self, gap: f64, angle: f64) -> anyhow::Result<()> {
        let first = self.space.pose(self.ids[0]);
        let turn = Pose::about(first.point(self.seams[0].0), DVec3::Y, angle);
        let shift = Pose::from_translation(first.direction(self.seams[0].1) * gap);
        let pose = shift.after(&turn).after(&self.touching);
        Ok(self.space.set_pose(self.ids[1], pose)?)
    }

    /// Returns the chunks and objects of the other part that an eye in one sees.
    fn seen(
        &self,
        viewer: &mut SpaceViewer,
        from: usize,
        eye: DVec3,
    ) -> anyhow::Result<HashSet<PartItem>> {
        let view = View::around(eye.as_vec3().to_array())?;
        let seen = viewer.see(&self.space, self.ids[from], &view);
        let Some(seen) = seen.of_part(self.ids[1 - from]) else {
            return Ok(HashSet::new());
        };
        let details = seen.details().iter().map(|d| PartItem::Detail(*d));
        let chunks = seen.chunks().iter().map(|c| PartItem::Chunk(*c));
        Ok(chunks.chain(details).collect())
    }

    /// Returns those objects and chunks of the other part that rays through the opening hit first, by tracing the
    /// triangles of both.
    fn hit(&self, from: usize, eye: DVec3, rng: &mut Rng) -> HashSet<PartItem> {
        let opening = self
            .space
            .layout(self.ids[from])
            .opening(self.portals[from]);
        let bounds = opening.bounds();
        let mut found = HashSet::new();
        for _ in 0..400 {
            let share = DVec3::from_array([0, 1, 2].map(|_| rng.range(0.05, 0.95)));
            let target = bounds.min + bounds.size() * share;
            let hit = [0, 1].map(|k| {
                let to = self.space.between(self.ids[from], self.ids[k]);
                let ray = Ray {
                    origin: to.point(eye),
                    direction: to.direction(target - eye),
                    t_max: f64::INFINITY,
                };
                let hit = self.solids[k].tree.closest_hit(&ray, |_| false);
                hit.map_or((f64::INFINITY, 0), |h| (h.t, h.triangle))
            });
            let (own, other) = (hit[from], hit[1 - from]);
            if other.0 < own.0 {
                found.insert(self.solids[1 - from].items[other.1 as usize]);
            }
        }
        found
    }

    /// Returns `true` if a ball in the doorway of one is in the other, too.
    fn passes(&self, from: usize) -> anyhow::Result<bool> {
        let (middle, outward) = self.seams[from];
        let mut things = Things::new();
        let pose = Pose::from_translation(middle - outward * 0.05);
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

    /// Counts what is lost across the seam from one part, and the items that rays hit.
    fn judge(
        &self,
        from: usize,
        viewer: &mut SpaceViewer,
        rng: &mut Rng,
    ) -> anyhow::Result<[usize; 2]> {
        let met = self.space.meets(self.ids[from], self.portals[from]);
        let mut wrong = usize::from(met != [(self.ids[1 - from], self.portals[1 - from])]);
        wrong += usize::from(!self.passes(from)?);
        let layout = self.space.layout(self.ids[from]);
        let cells = layout.opening(self.portals[from]).cells();
        let inner = cells[usize::from(Some(cells[0]) == layout.outdoors())];
        let cell = layout.cell(inner).bounds;
        let (middle, outward) = self.seams[from];
        let mut n_items = 0;
        for k in 0..8 {
            let share = DVec3::from_array([0, 1, 2].map(|_| rng.range(0.1, 0.9)));
            let mut eye = cell.min + cell.size() * share;
            if k == 0 {
                // In the overlap, or just before the seam.
                eye = middle
                    + ((middle - outward).lerp(cell.center(), 0.5) - middle).normalize() * 0.003;
            }
            if k % 2 == 1 {
                // Near, as from afar little is seen of a small one.
                eye = middle.lerp(eye, 0.2);
            }
            // Rounded as the view is.
            let eye = eye.as_vec3().as_dvec3();
            if layout.locate(eye) != Some(inner) {
                continue;
            }
            let hit = self.hit(from, eye, rng);
            let seen = self.seen(viewer, from, eye)?;
            n_items += hit.len();
            wrong += hit.difference(&seen).count();
        }
        Ok([wrong, n_items])
    }

    /// Docks with all errors within the tolerance.
    pub(super) fn dock(&mut self, name: &str, total: &mut Docked) -> anyhow::Result<()> {
        let mut viewer = SpaceViewer::new(&self.space);
        let mut rng = Rng::new(7);
        for gap_mm in [-10.0, -5.0, -1.0, -0.1, 0.0, 0.1, 1.0, 5.0, 10.0_f64] {
            for degrees in [-1.0, -0.5, 0.0, 0.5, 1.0_f64] {
                total.n_poses += 1;
                self.set(gap_mm * 1e-3, degrees.to_radians())?;
                let mut wrong = 0;
                for from in [0, 1] {
                    let [lost, hit] = self.judge(from, &mut viewer, &mut rng)?;
                    wrong += lost;
                    total.n_items += hit;
                }
                total.n_wrong += wrong;
                if wrong > 0 {
                    let worst = format!("{gap_mm} mm {degrees}° {name}: {wrong}");
                    total.worst.push(worst);
                }
            }
        }
        Ok(())
    }
}

/// Returns the center of a cabin's first window, and the direction out of it.
fn window(space: &Space, part: PartId) -> (DVec3, DVec3) {
    let layout = space.layout(part);
    let window = layout.opening(PortalId(0));
    let is_inner_first = Some(window.cells()[1]) == layout.outdoors();
    let outward = window.normal() * if is_inner_first { 1.0 } else { -1.0 };
    (window.center(), outward)
}

/// Losses by docking with an error.
#[derive(Default)]
pub(super) struct Docked {
    n_wrong: usize,
    n_items: usize,
    n_poses: usize,
    worst: Vec<String>,
}

impl Docked {
    pub(super) fn figure(&self) -> anyhow::Result<Figure> {
        ensure!(self.n_items > 0, "no ray passed a seam");
        let note = format!(
            "meetings, balls in a doorway and items hit by rays that are lost in {} poses from 1 cm apart to 1 cm into \
                 each other, turned by up to 1°; {} items hit. {}",
            self.n_poses,
            self.n_items,
            self.worst.join("; ")
        );
        Ok(Figure::new(self.n_wrong as f64, 0.0, note))
    }
}

/// Counts items seen, meetings and balls that differ between cabins that dock with an error and cabins that touch.
pub(super) fn docking(_: &str) -> anyhow::Result<Figure> {
    let mut total = Docked::default();
    for has_air in [false, true] {
        Pair::new(has_air)?.dock(&format!("air {has_air}"), &mut total)?;
    }
    total.figure()
}

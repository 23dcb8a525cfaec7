//! A walker with gravity, steps, and collisions.
//!
//! Collide and slide (Fauerby, *Improved collision detection and response*, 2003), with a capsule that begins above the height
//! of a step: it moves by casts, loses the component of its motion into an obstacle, and goes on, a few times. So it passes over
//! low obstacles, and a foot, a ball of half its radius, finds the floor below. Objects that have moved into it meanwhile, such
//! as leaves of doors, push it out. Two to five casts per step.
//!
//! It keeps a gap to all obstacles ([`GAP`]); without it, rounding decides at seams of walls. Motion is level, so only the level
//! parts of normals count.
//!
//! It is in the frame of the part whose floor it stands on, so a lift or a ship carries it along. It passes a special portal when
//! its middle does, and stays upright and of its size there, however the other side is turned.

use enfilade_geom::{DVec3, Similarity};
use enfilade_runtime::{DetailId, Target};

use super::agent::Agent;
use crate::bodies::{Body, Cast, Caster, Impact};
use crate::space::{PartId, Place, Space};

/// Gap kept to walls. [Units: wu]
pub(super) const GAP: f64 = 0.005;
/// Maximum number of changes of direction in a step: along a wall, then along the next one where two meet.
const SLIDES: usize = 4;
/// Depth of the search for a floor. [Units: wu]
const FAR: f64 = 500.0;
/// Longest time step. [Units: s]
const LONGEST: f64 = 0.1;
/// Acceleration. [Units: wu/s²]
const GRAVITY: f64 = 9.81;
/// Speed of rising when climbing. [Units: wu/s]
const CLIMB: f64 = 6.0;

/// A person who walks in a world. Allocates nothing once the buffers have grown.
#[derive(Clone, Debug)]
pub struct Walker {
    /// Position of the eye in the frame of its part; may be set. [Units: wu]
    pub eye: DVec3,
    /// The part whose floor it stands on; may be set.
    pub frame: PartId,
    agent: Agent,
    /// Downward speed. [Units: wu/s]
    falling: f64,
    /// The last place that it was in.
    place: Option<Place>,
    /// The map of the special portals passed in the last step.
    passed: Similarity,
    /// The last obstacle in its way in the last step, and its part.
    obstacle: Option<(PartId, Target)>,
    caster: Caster,
}

impl Walker {
    /// Makes a walker at rest with its eye at a point of a part's frame.
    #[must_use]
    pub fn new(agent: Agent, frame: PartId, eye: DVec3) -> Self {
        Self {
            eye,
            frame,
            agent,
            falling: 0.0,
            place: None,
            passed: Similarity::IDENTITY,
            obstacle: None,
            caster: Caster::new(),
        }
    }

    /// Returns the place that it is in, or was in last; `None` before the first step, and if it was never in one.
    #[must_use]
    pub fn place(&self) -> Option<Place> {
        self.place
    }

    /// Returns its size and abilities.
    #[must_use]
    #[doc(hidden)]
    pub fn agent(&self) -> &Agent {
        &self.agent
    }

    /// Returns the point below its eye where it stands, or would stand after a fall of no height. [Units: wu]
    #[must_use]
    pub fn feet(&self) -> DVec3 {
        self.eye - DVec3::Y * self.agent.eye
    }

    /// Returns the last obstacle that was in its way in the last step, if any, and its part.
    #[must_use]
    #[doc(hidden)]
    pub fn obstacle(&self) -> Option<(PartId, Target)> {
        self.obstacle
    }

    /// Returns the map of the special portals that it passed in the last step, from the frame before to that after: turn the
    /// direction of its eye and its wishes by it. The identity otherwise, also where it boards a part.
    #[must_use]
    pub fn passed(&self) -> Similarity {
        self.passed
    }

    /// Walks by the level part of `wish` for some seconds, at most a tenth. Stopped by walls, objects, leaves of doors in
    /// their current pose and shut openings; falls, and climbs up to the height of a step. In no cell, nothing stops it and it
    /// does not fall. Enters and leaves parts through their doors; `wish` is in the frame of its part. [Units: wu/s, s]
    ///
    /// # Panics
    ///
    /// If its part is not of `space`.
    pub fn step(&mut self, space: &Space, wish: DVec3, seconds: f64) {
        self.step_where(space, wish, seconds, |_, _| true);
    }

    /// As [`Walker::step`], ignoring objects for which `counts` returns `false`.
    pub(crate) fn step_where(
        &mut self,
        space: &Space,
        wish: DVec3,
        seconds: f64,
        counts: impl Fn(PartId, DetailId) -> bool,
    ) {
        let seconds = seconds.clamp(0.0, LONGEST);
        let flat = DVec3::new(wish.x, 0.0, wish.z) * seconds;
        self.passed = Similarity::IDENTITY;
        if !(flat.is_finite() && self.eye.is_finite()) {
            return;
        }
        self.slide(space, flat, &counts);
        self.push_out(space, &counts);
        self.stand(space, seconds, &counts);
    }

    /// Returns `true` if it touches an object for which `counts` returns `true`.
    pub(crate) fn touches(
        &mut self,
        space: &Space,
        counts: impl Fn(PartId, DetailId) -> bool,
    ) -> bool {
        let (body, below) = self.body();
        let at = self.eye + below;
        let Some(place) = self.locate(space, at) else {
            return false;
        };
        let mut is_touched = false;
        self.caster
            .for_each_contact(space, &body, self.frame, at, place, |contact| {
                if let Target::Detail { detail, .. } = contact.target {
                    is_touched |= counts(contact.place.part, detail);
                }
            });
        is_touched
    }

    /// Returns its capsule, and the vector from the eye to the capsule's center.
    fn body(&self) -> (Body, DVec3) {
        let (body, up) = self.agent.body();
        (body, DVec3::Y * (up - self.agent.eye))
    }

    /// Returns the place of a point of it; in solid matter, the last one.
    fn locate(&mut self, space: &Space, p: DVec3) -> Option<Place> {
        self.place = space.locate(self.frame, p).or(self.place);
        self.place
    }

    /// Moves by a displacement that nothing stops, through special portals; returns their map.
    fn go(&mut self, space: &Space, by: DVec3) -> Similarity {
        let below = self.body().1;
        let step = space.follow(self.frame, self.eye + below, by);
        if step.n_passed == 0 {
            self.eye += by;
            return Similarity::IDENTITY;
        }
        (self.frame, self.eye) = (step.frame, step.at - below);
        self.place = step.place.or(self.place);
        self.passed = step.map.after(&self.passed);
        step.map
    }

    fn slide(&mut self, space: &Space, flat: DVec3, counts: &impl Fn(PartId, DetailId) -> bool) {
        let (body, below) = self.body();
        self.obstacle = None;
        let mut left = flat;
        for _ in 0..SLIDES {
            let length = left.length();
            let from = self.eye + below;
            let Some(place) = self.locate(space, from).filter(|_| length > 1e-9) else {
                self.go(space, left);
                return;
            };
            // Farther by as much as the gap may take of it at a slanted obstacle.
            let direction = left / length;
            let cast = Cast {
                body: &body,
                frame: self.frame,
                from,
                by: direction * (length + GAP),
                place,
            };
            let hit = (self.caster).cast_where(space, &cast, counts);
            let Some(impact) = hit else {
                self.go(space, left);
                return;
            };
            self.obstacle = Some((impact.place.part, impact.target));
            let level = DVec3::new(impact.normal.x, 0.0, impact.normal.z);
            let Some(normal) = level.try_normalize() else {
                return;
            };
            let gap = GAP / -impact.normal.dot(direction);
            let free = (impact.t * (length + GAP) - gap).clamp(0.0, length);
            let passed = self.go(space, direction * free);
            left -= direction * free;
            left -= normal * normal.dot(left).min(0.0);
            left = passed.vector(left).with_y(0.0);
        }
    }

    /// Moves out of obstacles, deepest first.
    fn push_out(&mut self, space: &Space, counts: &impl Fn(PartId, DetailId) -> bool) {
        let (body, below) = self.body();
        for _ in 0..SLIDES {
            let at = self.eye + below;
            let Some(place) = self.locate(space, at) else {
                return;
            };
            let mut deepest = (0.0, DVec3::ZERO);
            self.caster
                .for_each_contact(space, &body,self.frame, at, place, |contact| {
                    let level = DVec3::new(contact.normal.x, 0.0, contact.normal.z);
                    let is_ignored =
                        matches!(contact.target, Target::Detail { detail, .. } if !counts(contact.place.part, detail));
                    if contact.depth > deepest.0
                        && !is_ignored
                        && let Some(normal) = level.try_normalize()
                    {
                        deepest = (contact.depth, normal);
                    }
                });
            let (depth, normal) = deepest;
            if depth == 0.0 {
                return;
            }
            self.go(space, normal * (depth + GAP));
        }
    }

    /// Moves onto the floor, or towards it.
    fn stand(&mut self, space: &Space, seconds: f64, counts: &impl Fn(PartId, DetailId) -> bool) {
        let step = self.agent.step;
        let (foot, up) = self.agent.foot();
        let from = self.feet() + DVec3::Y * up;
        let floor = self.locate(space, from).and_then(|place| {
            let cast = Cast {
                body: &foot,
                frame: self.frame,
                from,
                by: -DVec3::Y * FAR,
                place,
            };
            (self.caster).cast_where(space, &cast, counts)
        });
        let Some(floor) = floor else {
            // No floor below: do not fall.
            self.falling = 0.0;
            return;
        };
        let above = floor.t * FAR - step;
        if self.falling == 0.0 && above <= step {
            // Steps are climbed, and descended, in a few frames.
            let most = CLIMB * seconds;
            self.board(space, above.clamp(-most, most), &floor);
            return;
        }
        self.falling += GRAVITY * seconds;
        if above <= self.falling * seconds {
            self.falling = 0.0;
            let fall = above.clamp(-CLIMB * seconds, above.max(0.0));
            self.board(space, fall, &floor);
        } else {
            self.go(space, -DVec3::Y * self.falling * seconds);
        }
    }

    /// Moves down onto a floor, and changes to the frame of its part.
    fn board(&mut self, space: &Space, down: f64, floor: &Impact) {
        let passed = self.go(space, -DVec3::Y * down);
        let part = floor.place.part;
        let to_part = space.between(self.frame, part);
        // Not where the floor is seen through a special portal.
        let is_here = passed == Similarity::IDENTITY && floor.map == to_part.into();
        if part != self.frame && is_here {
            self.eye = to_part.point(self.eye);
            self.frame = part;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::Layout;
    use enfilade_cpg::{CellId, DetailObject, PortalId, World};
    use enfilade_geom::scene::{Mesh, Primitive};
    use enfilade_geom::{Aabb, DMat4};
    use enfilade_testkit::{GridParams, Rng, room_grid, with_doors};

    struct Scene {
        space: Space,
        walker: Walker,
    }

    impl Scene {
        fn new(world: &World, eye: DVec3) -> Self {
            Self {
                walker: Walker::new(Agent::default(), PartId::ROOT, eye),
                space: Space::new(world.clone()).unwrap(),
            }
        }

        fn walk(&mut self, wish: DVec3, seconds: f64) {
            for _ in 0..(seconds / 0.02).round() as usize {
                self.walker.step(&self.space, wish, 0.02);
            }
        }
    }

    fn middle(world: &World) -> DVec3 {
        let [low, high] = world.graph.cells[0]
            .aabb
            .map(|p| DVec3::from(p.map(f64::from)));
        (low + high) * 0.5
    }

    fn add_box(world: &mut World, low: DVec3, high: DVec3) {
        let triangles = Aabb::new(low, high).triangles();
        let corners = triangles.iter().flatten();
        let positions: Vec<[f32; 3]> = corners.map(|p| p.as_vec3().to_array()).collect();
        let primitives = vec![Primitive {
            indices: (0..positions.len() as u32).collect(),
            positions,
            ..Primitive::default()
        }];
        let mesh = world.detail_meshes.len() as u32;
        world.detail_meshes.push(Mesh {
            primitives,
            ..Mesh::default()
        });
        world.details.push(DetailObject {
            name: String::new(),
            mesh,
            transform: DMat4::IDENTITY.to_cols_array().map(|x| x as f32),
            cells: vec![CellId(0)],
            source: None,
            part_of: None,
        });
    }

    /// Covers W12: a walker never gets through a wall, or deep into one, however it runs and turns.
    #[test]
    fn walls_and_furniture_stop_a_running_walker() {
        let world = room_grid(&GridParams {
            outdoors: false,
            doors: 0.0,
            windows: 0.0,
            holes: 0.0,
            ..GridParams::offices(9, 5)
        });
        let mut site = Scene::new(&world, middle(&world));
        let room = site.space.layout(PartId::ROOT).cell(CellId(0)).bounds;
        let mut rng = Rng::new(6);
        let radius = Agent::default().radius;
        // Not in a cupboard.
        loop {
            let share = DVec3::new(rng.unit(), 0.53, rng.unit());
            let from = room.min + room.size() * share;
            site.walker.eye = from;
            site.walk(DVec3::X, 0.5);
            if site.walker.eye.x > from.x + 0.45 {
                break;
            }
        }
        let start = site.walker.eye;
        let mut farthest = 0.0_f64;
        for _ in 0..300 {
            let wish = DVec3::new(rng.range(-30.0, 30.0), 0.0, rng.range(-30.0, 30.0));
            site.walk(wish, 0.2);
            let eye = site.walker.eye;
            for k in [0, 2] {
                assert!(eye[k] > room.min[k] + radius - 1e-6, "{eye}");
                assert!(eye[k] < room.max[k] - radius + 1e-6, "{eye}");
            }
            farthest = farthest.max(eye.distance(start));
        }
        assert!(farthest > 1.0);
        assert_eq!(site.walker.place().map(|p| p.cell), Some(CellId(0)));
    }

    /// Covers W12: a walker slides along a wall at the speed that is left, and stands still where two walls meet.
    #[test]
    fn a_walker_slides_along_a_wall() {
        let world = room_grid(&GridParams {
            size: [1, 1, 1],
            doors: 0.0,
            windows: 0.0,
            furniture: 0,
            ..GridParams::offices(1, 1)
        });
        let mut site = Scene::new(&world, middle(&world));
        site.walk(DVec3::X * 5.0, 2.0);
        let from = site.walker.eye;
        site.walk(DVec3::new(1.0, 0.0, 1.0), 0.5);
        let by = site.walker.eye - from;
        assert!((by.z - 0.5).abs() < 0.01 && by.x.abs() < 0.02, "{by}");
        site.walk(DVec3::new(3.0, 0.0, 2.0), 3.0);
        let corner = site.walker.eye;
        site.walk(DVec3::new(3.0, 0.0, 2.0), 1.0);
        assert!(site.walker.eye.distance(corner) < 1e-3);
    }

    /// Covers W12: low obstacles are climbed, high ones stop, and beyond an edge the walker falls.
    #[test]
    fn steps_are_climbed_and_tables_stop() {
        for (height, is_stopped) in [(0.75, true), (0.28, false)] {
            let mut world = room_grid(&GridParams {
                size: [1, 1, 1],
                windows: 0.0,
                furniture: 0,
                ..GridParams::offices(1, 1)
            });
            let from = middle(&world);
            let [low, high] = world.graph.cells[0]
                .aabb
                .map(|p| DVec3::from(p.map(f64::from)));
            let edge = DVec3::new(from.x + 0.6, low.y, low.z);
            let far = DVec3::new(from.x + 0.9, low.y + height, high.z);
            add_box(&mut world, edge, far);
            let mut site = Scene::new(&world, from);
            site.walk(DVec3::ZERO, 2.0);
            let floor = site.walker.eye.y;
            assert!((floor - low.y - Agent::default().eye).abs() < 0.01);
            let mut highest = floor;
            for _ in 0..60 {
                site.walk(DVec3::X, 0.02);
                highest = highest.max(site.walker.eye.y);
            }
            assert_eq!(site.walker.eye.x < edge.x, is_stopped, "{height}");
            assert_eq!(highest > floor + 0.25, !is_stopped, "{highest}");
            site.walk(DVec3::X, 2.0);
            assert!((site.walker.eye.y - floor).abs() < 0.01);
        }
    }

    /// Covers W12: stairs are climbed and descended at the height of their steps, also those with narrow treads, as winding ones
    /// have near their middle, and those with a low ceiling.
    #[test]
    fn narrow_treads_are_walked_up_and_down() {
        let mut world = room_grid(&GridParams {
            size: [1, 1, 1],
            windows: 0.0,
            furniture: 0,
            ..GridParams::offices(1, 1)
        });
        let from = middle(&world);
        let [low, high] = world.graph.cells[0]
            .aabb
            .map(|p| DVec3::from(p.map(f64::from)));
        let (rise, run) = (0.19, 0.14);
        let at = |i: i32| from.x + 0.4 + run * f64::from(i);
        let top = |i: i32| low.y + rise * f64::from(i + 1);
        for i in 0..4 {
            let edge = DVec3::new(at(i), low.y, low.z);
            add_box(&mut world, edge, DVec3::new(high.x, top(i), high.z));
        }
        let mut site = Scene::new(&world, from);
        site.walk(DVec3::ZERO, 2.0);
        site.walk(DVec3::X, 1.2);
        assert!(
            (site.walker.feet().y - top(3)).abs() < 0.01,
            "{}",
            site.walker.feet()
        );
        // On the way down it is never above the step before.
        for _ in 0..60 {
            site.walk(-DVec3::X, 0.02);
            let feet = site.walker.feet();
            let foot = 0.5 * Agent::default().radius;
            let passed = (0..4).filter(|&i| feet.x + foot > at(i) - 0.03).count();
            let floor = low.y + rise * passed as f64;
            assert!(feet.y < floor + 0.1, "{feet} {floor}");
        }
        assert!((site.walker.feet().y - low.y).abs() < 0.01);
    }

    /// Covers W12: a leaf that swings shut pushes a walker in its way along, and does not pass it.
    #[test]
    fn a_leaf_pushes_a_walker_in_its_way() {
        let world = with_doors(room_grid(&GridParams::two_rooms()), |_| false);
        let door = Layout::new(&world).opening(PortalId(0)).center();
        let mut site = Scene::new(&world, middle(&world));
        site.space.set_leaves(PartId::ROOT, PortalId(0), 1.0);
        site.walker.eye = DVec3::new(door.x + 0.4, 1.6, door.z);
        site.walk(DVec3::ZERO, 1.0);
        let before = site.walker.eye;
        for i in 1..=100 {
            site.space
                .set_leaves(PartId::ROOT, PortalId(0), 1.0 - i as f32 / 100.0);
            site.walk(DVec3::ZERO, 0.02);
        }
        let after = site.walker.eye;
        assert!(before.distance(after) > 0.05, "{before} {after}");
        // Not in the leaf, nor in the wall.
        let (body, below) = site.walker.body();
        let mut caster = Caster::new();
        let mut deepest = 0.0_f64;
        caster.for_each_contact(
            &site.space,
            &body,
            PartId::ROOT,
            after + below,
            Place {
                part: PartId::ROOT,
                cell: CellId(1),
            },
            |contact| {
                deepest = deepest.max(contact.depth);
            },
        );
        assert!(deepest < 1e-3, "{deepest} at {after}");
    }

    /// Covers W12: a hole in the floor leads into the room below, another cell.
    #[test]
    fn holes_in_floors_lead_down() {
        let world = room_grid(&GridParams {
            size: [1, 2, 1],
            holes: 1.0,
            furniture: 0,
            outdoors: false,
            ..GridParams::offices(1, 3)
        });
        let hole = Layout::new(&world).opening(PortalId(0)).center();
        let mut site = Scene::new(&world, hole + DVec3::Y * 2.0);
        site.walk(DVec3::ZERO, 3.0);
        assert!(
            (site.walker.eye.y - 1.6).abs() < 0.01,
            "{}",
            site.walker.eye
        );
        assert_eq!(site.walker.place().map(|p| p.cell), Some(CellId(0)));
        // Shut, it holds.
        let mut site = Scene::new(&world, hole + DVec3::Y * 2.0);
        site.space.close(PartId::ROOT, PortalId(0));
        site.walk(DVec3::ZERO, 3.0);
        assert!((site.walker.eye.y - hole.y - 1.6).abs() < 0.01);
    }

    /// Covers W12.
    #[test]
    fn walking_allocates_nothing_once_warm() {
        let world = with_doors(room_grid(&GridParams::offices(20, 2)), |_| false);
        let mut site = Scene::new(&world, middle(&world));
        for portal in world.graph.portal_ids() {
            site.space.open(PartId::ROOT, portal);
        }
        let mut rng = Rng::new(1);
        let mut walk = |n: usize| {
            for _ in 0..n {
                let wish = DVec3::new(rng.range(-4.0, 4.0), 0.0, rng.range(-4.0, 4.0));
                site.walk(wish, 0.4);
            }
        };
        walk(200);
        let counted = allocation_counter::measure(|| walk(50));
        assert_eq!(counted.count_total, 0);
    }
}

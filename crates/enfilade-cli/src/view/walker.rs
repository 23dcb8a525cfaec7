//! Somebody who walks: gravity, steps, walls, furniture, doors.

use enfilade::cpg::{DetailObject, PortalId, World};
use enfilade::geom::scene::Primitive;
use enfilade::geom::{Aabb, Bvh, DVec3, Ray, Triangle, closest_point_on_triangle};
use enfilade::runtime::{DetailId, Sight, SightState};

use enfilade_cli::cameras::EYE_HEIGHT;

/// Half the breadth of a body. [Units: wu]
const RADIUS: f64 = 0.22;
/// What is no higher is stepped onto or over. [Units: wu]
const STEP: f64 = 0.3;
const EYE: f64 = EYE_HEIGHT as f64;

/// A body in a world; or, when it flies, an eye.
pub(super) struct Walker {
    /// Walls and furniture.
    still: Bvh,
    leaves: Vec<Leaf>,
    openings: Openings,
    pub(super) eye: DVec3,
    /// Downwards. [Units: wu/s]
    falling: f64,
    pub(super) flies: bool,
}

/// The leaf of a door.
struct Leaf {
    detail: DetailId,
    /// As the model has it.
    bvh: Bvh,
}

/// What portals without leaves are filled with when they are closed.
struct Openings {
    bvh: Bvh,
    triangles: Vec<Triangle>,
    portals: Vec<PortalId>,
}

impl Openings {
    fn of(world: &World, sight: &Sight) -> Self {
        let (mut triangles, mut portals) = (Vec::new(), Vec::new());
        for (id, portal) in (0..).map(PortalId).zip(&world.graph.portals) {
            if !sight.leaves(id).is_empty() {
                continue;
            }
            for piece in &portal.pieces {
                let corner = |i: usize| DVec3::from(piece[i].map(f64::from));
                for k in 2..piece.len() {
                    triangles.push([0, k - 1, k].map(corner));
                    portals.push(id);
                }
            }
        }
        Self {
            bvh: Bvh::build(&triangles),
            triangles,
            portals,
        }
    }

    /// The nearest point of what is closed, within a body's reach.
    fn nearest(&self, p: DVec3, state: &SightState) -> Option<DVec3> {
        let mut best: Option<DVec3> = None;
        self.bvh
            .for_each_in_box(&Aabb::new(p, p).expanded(RADIUS), |t| {
                let at = closest_point_on_triangle(p, &self.triangles[t as usize]);
                let limit = best.map_or(RADIUS, |b| b.distance(p));
                if !state.is_open(self.portals[t as usize]) && at.distance(p) < limit {
                    best = Some(at);
                }
            });
        best
    }
}

fn triangles_of(primitive: &Primitive, place: impl Fn(DVec3) -> DVec3) -> Vec<Triangle> {
    let corner = |i: u32| place(DVec3::from(primitive.positions[i as usize].map(f64::from)));
    let corners = primitive.indices.chunks_exact(3);
    corners.map(|t| [t[0], t[1], t[2]].map(corner)).collect()
}

fn triangles_of_detail(world: &World, detail: &DetailObject) -> Vec<Triangle> {
    let transform = detail.placement();
    let mesh = &world.detail_meshes[detail.mesh as usize];
    let primitives = mesh.primitives.iter();
    primitives
        .flat_map(|p| triangles_of(p, |q| transform.transform_point3(q)))
        .collect()
}

impl Walker {
    pub(super) fn new(world: &World, sight: &Sight, eye: [f32; 3]) -> Self {
        let mut still: Vec<Triangle> = Vec::new();
        for batch in &world.batches {
            still.extend(triangles_of(&batch.primitive, |p| p));
        }
        let mut leaves = Vec::new();
        for (id, detail) in (0..).map(DetailId).zip(&world.details) {
            let triangles = triangles_of_detail(world, detail);
            if sight.portals_of(id).next().is_some() {
                leaves.push(Leaf {
                    detail: id,
                    bvh: Bvh::build(&triangles),
                });
            } else {
                still.extend(triangles);
            }
        }
        Self {
            still: Bvh::build(&still),
            leaves,
            openings: Openings::of(world, sight),
            eye: DVec3::from(eye.map(f64::from)),
            falling: 0.0,
            flies: false,
        }
    }

    /// Moves by `wish` (meters a second) for `seconds`, stopped by walls, furniture, leaves of doors as `state` has them, and
    /// portals that it closes.
    pub(super) fn step(&mut self, wish: DVec3, seconds: f64, state: &SightState) {
        let seconds = seconds.clamp(0.0, 0.1);
        if self.flies {
            self.eye += wish * seconds;
            return;
        }
        let flat = DVec3::new(wish.x, 0.0, wish.z) * seconds;
        // In steps shorter than the body is wide, so that no wall is jumped over.
        let n = (flat.length() / (RADIUS * 0.5)).ceil().max(1.0);
        for _ in 0..n as usize {
            self.eye += flat / n;
            self.push_out(state);
        }
        self.stand(seconds);
    }

    /// Out of what stands in the way, at the height of the eye, the hips and above a step.
    fn push_out(&mut self, state: &SightState) {
        for _ in 0..3 {
            for height in [0.0, 0.55, EYE - STEP - RADIUS] {
                let p = self.eye - DVec3::Y * height;
                let Some(near) = self.nearest(p, state) else {
                    continue;
                };
                let away = p - near;
                let flat = DVec3::new(away.x, 0.0, away.z);
                if let Some(direction) = flat.try_normalize() {
                    self.eye += direction * (RADIUS - away.length());
                }
            }
        }
    }

    /// The nearest point of what stands in the way, within a body's reach.
    fn nearest(&self, p: DVec3, state: &SightState) -> Option<DVec3> {
        let still = self.still.nearest(p, RADIUS).map(|n| n.point);
        let leaves = self.leaves.iter().filter_map(|leaf| {
            let pose = state.pose(leaf.detail);
            let local = pose.map_or(p, |m| m.inverse().transform_point3(p));
            let near = leaf.bvh.nearest(local, RADIUS)?.point;
            Some(pose.map_or(near, |m| m.transform_point3(near)))
        });
        let closed = self.openings.nearest(p, state);
        (still.into_iter().chain(closed).chain(leaves))
            .min_by(|a, b| a.distance(p).total_cmp(&b.distance(p)))
    }

    /// Onto the floor, or towards it.
    fn stand(&mut self, seconds: f64) {
        let knee = self.eye - DVec3::Y * (EYE - STEP);
        let far = 500.0;
        let ray = Ray::segment(knee, knee - DVec3::Y * far);
        let Some(hit) = self.still.closest_hit(&ray, |_| false) else {
            // Nothing below: there is nothing to fall onto.
            self.falling = 0.0;
            return;
        };
        let above = hit.t * far - STEP;
        self.falling += 9.81 * seconds;
        if above <= self.falling * seconds {
            self.falling = 0.0;
            // Steps are climbed in a few frames.
            self.eye.y -= above.clamp(-6.0 * seconds, above.max(0.0));
        } else {
            self.eye.y -= self.falling * seconds;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade::cpg::{Fitting, FittingPart, Motion, MotionKind};
    use enfilade::geom::scene::Mesh;
    use enfilade_testkit::{GridParams, room_grid};

    /// Rooms in a row, and somebody in the middle of the first.
    fn rooms(n: usize) -> World {
        room_grid(&GridParams {
            size: [n, 1, 1],
            doors: if n > 1 { 1.0 } else { 0.0 },
            windows: 0.0,
            furniture: 0,
            ..GridParams::offices(1, 1)
        })
    }

    fn walker(world: &World) -> (Walker, SightState) {
        let sight = Sight::build(world).unwrap();
        let [low, high] = world.graph.cells[0].aabb;
        let eye = [0, 1, 2].map(|k| (low[k] + high[k]) * 0.5);
        (Walker::new(world, &sight, eye), SightState::new(&sight))
    }

    /// A box as an object.
    fn add_block(world: &mut World, low: [f64; 3], high: [f64; 3]) -> u32 {
        let triangles = Aabb::new(low.into(), high.into()).triangles();
        let corners = triangles.iter().flatten();
        let positions: Vec<[f32; 3]> = corners.map(|p| p.as_vec3().to_array()).collect();
        let primitive = Primitive {
            indices: (0..positions.len() as u32).collect(),
            positions,
            ..Primitive::default()
        };
        let mesh = world.detail_meshes.len() as u32;
        world.detail_meshes.push(Mesh {
            primitives: vec![primitive],
            ..Mesh::default()
        });
        world.details.push(DetailObject {
            mesh,
            transform: enfilade::geom::DMat4::IDENTITY
                .to_cols_array()
                .map(|x| x as f32),
            cells: vec![enfilade::cpg::CellId(0)],
            name: String::new(),
            source: None,
            part_of: None,
        });
        world.details.len() as u32 - 1
    }

    /// Walks for two seconds.
    fn walk(walker: &mut Walker, state: &SightState, wish: DVec3) {
        for _ in 0..100 {
            walker.step(wish, 0.02, state);
        }
    }

    #[test]
    fn who_falls_comes_to_stand_and_walls_hold() {
        let world = rooms(1);
        let (mut walker, state) = walker(&world);
        let cell = &world.graph.cells[0];
        walk(&mut walker, &state, DVec3::new(6.0, 0.0, 2.0));
        let floor = f64::from(cell.aabb[0][1]);
        assert!((walker.eye.y - floor - EYE).abs() < 0.02, "{}", walker.eye);
        for (k, at) in [(0, walker.eye.x), (2, walker.eye.z)] {
            assert!(at < f64::from(cell.aabb[1][k]) && at > f64::from(cell.aabb[0][k]));
        }
    }

    #[test]
    fn who_flies_goes_through() {
        let world = rooms(1);
        let (mut walker, state) = walker(&world);
        walker.flies = true;
        for _ in 0..200 {
            walker.step(DVec3::new(10.0, 0.0, 0.0), 0.05, &state);
        }
        assert!(walker.eye.x > f64::from(world.graph.cells[0].aabb[1][0]));
    }

    #[test]
    fn a_table_stops_and_a_low_step_is_climbed() {
        for (height, is_stopped) in [(0.75, true), (0.28, false)] {
            let mut world = rooms(1);
            let [low, high] = world.graph.cells[0].aabb.map(|p| p.map(f64::from));
            let x = (low[0] + high[0]) * 0.5 + 0.6;
            let top = [x + 0.4, low[1] + height, high[2]];
            add_block(&mut world, [x, low[1], low[2]], top);
            let (mut walker, state) = walker(&world);
            walk(&mut walker, &state, DVec3::ZERO);
            walk(&mut walker, &state, DVec3::X);
            assert_eq!(walker.eye.x < x, is_stopped, "{height}: {} {x}", walker.eye);
        }
    }

    #[test]
    fn a_stair_is_climbed() {
        let mut world = rooms(1);
        let [low, high] = world.graph.cells[0].aabb.map(|p| p.map(f64::from));
        let x = (low[0] + high[0]) * 0.5 + 0.5;
        // Steep: 19 cm up on 23 cm.
        for i in 1..=4 {
            let n = f64::from(i);
            let from = [x + 0.23 * n, low[1], low[2]];
            add_block(
                &mut world,
                from,
                [x + 0.23 * 5.0, low[1] + 0.19 * n, high[2]],
            );
        }
        let (mut walker, state) = walker(&world);
        walk(&mut walker, &state, DVec3::ZERO);
        let floor = walker.eye.y;
        let mut highest = floor;
        for _ in 0..200 {
            walker.step(DVec3::X, 0.01, &state);
            highest = highest.max(walker.eye.y);
        }
        assert!((highest - floor - 0.76).abs() < 0.03, "{}", highest - floor);
    }

    #[test]
    fn a_shut_door_stops_and_an_open_one_lets_through() {
        let mut world = rooms(2);
        let between = |p: &enfilade::cpg::Portal| p.cells.map(|c| c.0) == [0, 1];
        let at = world.graph.portals.iter().position(between).unwrap();
        let door = PortalId(at as u32);
        let corners = world.graph.portals[at].outline.clone();
        let corners = corners.iter().map(|p| DVec3::from(p.map(f64::from)));
        let hole = Aabb::of_points(&corners.collect::<Vec<_>>());
        let thick = DVec3::X * 0.02;
        let leaf = add_block(
            &mut world,
            (hole.min - thick).to_array(),
            (hole.max + thick).to_array(),
        );
        world.graph.portals[at].fittings.push(Fitting {
            detail: leaf,
            part: FittingPart::Leaf,
            motion: Some(Motion {
                kind: MotionKind::Turn {
                    through: hole.min.as_vec3().to_array(),
                    axis: [0.0, 1.0, 0.0],
                },
                shut: 0.0,
                open: std::f32::consts::FRAC_PI_2,
            }),
        });
        let reached = |world: &World, share: Option<f32>, is_closed: bool| {
            let (mut walker, mut state) = walker(world);
            if let Some(share) = share {
                state.set_leaves(door, share);
            }
            if is_closed {
                state.close(door);
            }
            walker.eye.z = (hole.min.z + hole.max.z) * 0.5;
            walk(&mut walker, &state, DVec3::ZERO);
            walk(&mut walker, &state, DVec3::X * 3.0);
            walker.eye.x
        };
        let wall = hole.min.x;
        // The model has it shut.
        assert!(reached(&world, None, false) < wall && reached(&world, Some(0.0), false) < wall);
        assert!(
            reached(&world, Some(1.0), false) > wall && reached(&world, Some(1.0), true) < wall
        );
        // Without its leaf the opening itself is closed.
        world.graph.portals[at].fittings.clear();
        world.details.pop();
        assert!(reached(&world, None, true) < wall && reached(&world, None, false) > wall);
    }
}

//! A person who walks in the window, or flies: the walker of the living world, with an eye of its own.

use enfilade::geom::DVec3;
use enfilade::world::{Agent, PartId, Space, Walker as Body};

use enfilade_render::EYE_HEIGHT;

use super::strider::step_in_cells;
use crate::living::Player;

/// Greatest speed. [Units: wu/s]
pub(super) const RUN: f32 = 5.0;

/// A body in a space or, when it flies, an eye.
pub(super) struct Walker {
    body: Body,
    /// The part that carries it.
    pub(super) frame: PartId,
    /// Position of the eye in the frame of its part.
    pub(super) eye: DVec3,
    pub(super) flies: bool,
    /// `true` where parts move, and carry those who stand on them. Otherwise the frame is always that of the root.
    pub(super) rides: bool,
    /// `true` in worlds whose walls and furniture may be absent: then cells are the guide.
    by_cells: bool,
}

impl Walker {
    pub(super) fn new(eye: [f32; 3], by_cells: bool) -> Self {
        let agent = Agent {
            eye: EYE_HEIGHT.into(),
            ..Agent::default()
        };
        let eye = DVec3::from(eye.map(f64::from));
        Self {
            body: Body::new(agent, PartId::ROOT, eye),
            frame: PartId::ROOT,
            eye,
            flies: false,
            rides: false,
            by_cells,
        }
    }

    pub(super) fn player(&self) -> Player {
        Player {
            frame: self.frame,
            eye: self.eye,
        }
    }

    /// Moves by `wish` (meters per second) for `seconds`; walls, furniture, leaves of doors and shut portals stop it.
    pub(super) fn step(&mut self, wish: DVec3, seconds: f64, space: &Space) {
        if self.flies {
            self.leave(space);
            self.eye += wish * seconds.clamp(0.0, 0.1);
            return;
        }
        if self.by_cells {
            self.eye = step_in_cells(self.eye, wish, seconds, space);
            return;
        }
        (self.body.eye, self.body.frame) = (self.eye, self.frame);
        self.body.step(space, wish, seconds);
        (self.eye, self.frame) = (self.body.eye, self.body.frame);
        if !self.rides {
            self.leave(space);
        }
    }

    /// Goes on in the frame of the root.
    fn leave(&mut self, space: &Space) {
        self.eye = space.between(self.frame, PartId::ROOT).point(self.eye);
        self.frame = PartId::ROOT;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade::bake::edit::special::LinkOptions;
    use enfilade::cpg::{DetailObject, PortalId, World};
    use enfilade::cpg::{Fitting, FittingPart, Motion, MotionKind};
    use enfilade::geom::Aabb;
    use enfilade::geom::scene::{Mesh, Primitive};
    use enfilade::internals::bake::edit::special::{SpecialSpot, link};
    use enfilade_testkit::{GridParams, room_grid};

    /// Rooms in a row, and a person in the middle of the first.
    fn rooms(n: usize) -> World {
        room_grid(&GridParams {
            size: [n, 1, 1],
            doors: if n > 1 { 1.0 } else { 0.0 },
            windows: 0.0,
            furniture: 0,
            ..GridParams::offices(1, 1)
        })
    }

    fn walker(world: &World) -> (Walker, Space) {
        let [low, high] = world.graph.cells[0].aabb;
        let eye = [0, 1, 2].map(|k| (low[k] + high[k]) * 0.5);
        (Walker::new(eye, false), Space::new(world.clone()).unwrap())
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
    fn walk(walker: &mut Walker, space: &Space, wish: DVec3) {
        for _ in 0..100 {
            walker.step(wish, 0.02, space);
        }
    }

    #[test]
    fn who_falls_comes_to_stand_and_walls_hold() {
        let world = rooms(1);
        let (mut walker, space) = walker(&world);
        let cell = &world.graph.cells[0];
        walk(&mut walker, &space, DVec3::new(6.0, 0.0, 2.0));
        let floor = f64::from(cell.aabb[0][1]);
        assert!(
            (walker.eye.y - floor - f64::from(EYE_HEIGHT)).abs() < 0.02,
            "{}",
            walker.eye
        );
        for (k, at) in [(0, walker.eye.x), (2, walker.eye.z)] {
            assert!(at < f64::from(cell.aabb[1][k]) && at > f64::from(cell.aabb[0][k]));
        }
    }

    #[test]
    fn who_flies_goes_through() {
        let world = rooms(1);
        let (mut walker, space) = walker(&world);
        walker.flies = true;
        for _ in 0..200 {
            walker.step(DVec3::new(10.0, 0.0, 0.0), 0.05, &space);
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
            let (mut walker, space) = walker(&world);
            walk(&mut walker, &space, DVec3::ZERO);
            walk(&mut walker, &space, DVec3::X);
            assert_eq!(walker.eye.x < x, is_stopped, "{height}: {} {x}", walker.eye);
        }
    }

    #[test]
    fn a_stair_is_climbed() {
        let mut world = rooms(1);
        let [low, high] = world.graph.cells[0].aabb.map(|p| p.map(f64::from));
        let x = (low[0] + high[0]) * 0.5 + 0.5;
        // Steep: steps 19 cm high and 23 cm deep.
        for i in 1..=4 {
            let n = f64::from(i);
            let from = [x + 0.23 * n, low[1], low[2]];
            add_block(
                &mut world,
                from,
                [x + 0.23 * 5.0, low[1] + 0.19 * n, high[2]],
            );
        }
        let (mut walker, space) = walker(&world);
        walk(&mut walker, &space, DVec3::ZERO);
        let floor = walker.eye.y;
        let mut highest = floor;
        for _ in 0..200 {
            walker.step(DVec3::X, 0.01, &space);
            highest = highest.max(walker.eye.y);
        }
        assert!((highest - floor - 0.76).abs() < 0.03, "{}", highest - floor);
    }

    #[test]
    fn who_walks_into_a_link_passes_the_panels_that_it_was_made_of() {
        let mut world = rooms(1);
        let [low, high] = world.graph.cells[0].aabb.map(|p| p.map(f64::from));
        let middle = |k: usize| (low[k] + high[k]) * 0.5;
        // Panels of 1 x 2 m in the wall at larger x and in that at smaller z, a little behind the plane of the link.
        let (x, z) = (high[0] - 1e-3, low[2] + 1e-3);
        let [bottom, top] = [low[1], low[1] + 2.0];
        let [z0, z1] = [middle(2) - 0.5, middle(2) + 0.5];
        let [x0, x1] = [middle(0) - 0.5, middle(0) + 0.5];
        let corners = |points: [[f64; 3]; 4]| SpecialSpot::Wall(points.map(DVec3::from).to_vec());
        let from = corners([[x, bottom, z0], [x, bottom, z1], [x, top, z1], [x, top, z0]]);
        let into = corners([[x0, bottom, z], [x1, bottom, z], [x1, top, z], [x0, top, z]]);
        add_block(&mut world, [x, bottom, z0], [x + 0.005, top, z1]);
        add_block(&mut world, [x0, bottom, z - 0.005], [x1, top, z]);
        let (mut straight, plain) = walker(&world);
        walk(&mut straight, &plain, DVec3::X * 3.0);
        assert!(straight.eye.x > x - 1.0, "{}", straight.eye);
        link(&mut world, &from, &into, &LinkOptions::default()).unwrap();
        let (mut walker, space) = walker(&world);
        let start = walker.eye;
        for _ in 0..100 {
            walker.step(DVec3::X * 3.0, 0.02, &space);
            if walker.eye.x < x - 1.0 && (walker.eye - start).length() > 1.0 {
                break;
            }
        }
        // Out of the other wall, and on along it.
        assert!(walker.eye.z < middle(2) - 0.5, "{}", walker.eye);
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
            let (mut walker, mut space) = walker(world);
            if let Some(share) = share {
                space.set_leaves(PartId::ROOT, door, share);
            }
            if is_closed {
                space.close(PartId::ROOT, door);
            }
            walker.eye.z = (hole.min.z + hole.max.z) * 0.5;
            walk(&mut walker, &space, DVec3::ZERO);
            walk(&mut walker, &space, DVec3::X * 3.0);
            walker.eye.x
        };
        let wall = hole.min.x;
        // The door is shut in the model.
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

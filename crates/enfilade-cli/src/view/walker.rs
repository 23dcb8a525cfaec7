//! Somebody who walks: gravity, steps, walls.

use enfilade::cpg::World;
use enfilade::geom::{Bvh, DVec3, Triangle};

use enfilade_cli::cameras::EYE_HEIGHT;

/// Half the breadth of a body. [Units: wu]
const RADIUS: f64 = 0.22;
/// The highest step that is climbed. [Units: wu]
const STEP: f64 = 0.45;
const EYE: f64 = EYE_HEIGHT as f64;

/// A body in a world; or, when it flies, an eye.
pub(super) struct Walker {
    walls: Bvh,
    pub(super) eye: DVec3,
    /// Downwards. [Units: wu/s]
    falling: f64,
    pub(super) flies: bool,
}

impl Walker {
    pub(super) fn new(world: &World, eye: [f32; 3]) -> Self {
        let mut triangles: Vec<Triangle> = Vec::new();
        for batch in &world.batches {
            let p = &batch.primitive;
            let corner = |i: u32| DVec3::from(p.positions[i as usize].map(f64::from));
            let corners = p.indices.chunks_exact(3);
            triangles.extend(corners.map(|t| [corner(t[0]), corner(t[1]), corner(t[2])]));
        }
        Self {
            walls: Bvh::build(&triangles),
            eye: DVec3::from(eye.map(f64::from)),
            falling: 0.0,
            flies: false,
        }
    }

    /// Moves by `wish` (meters a second) for `seconds`.
    pub(super) fn step(&mut self, wish: DVec3, seconds: f64) {
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
            self.push_out();
        }
        self.stand(seconds);
    }

    /// Out of walls, at the height of the eye, the hips and above a step.
    fn push_out(&mut self) {
        for _ in 0..3 {
            for height in [0.0, 0.55, EYE - STEP - RADIUS] {
                let p = self.eye - DVec3::Y * height;
                let Some(near) = self.walls.nearest(p, RADIUS) else {
                    continue;
                };
                let away = p - near.point;
                let away = DVec3::new(away.x, 0.0, away.z);
                if let Some(direction) = away.try_normalize() {
                    self.eye += direction * (RADIUS - near.distance);
                }
            }
        }
    }

    /// Onto the floor, or towards it.
    fn stand(&mut self, seconds: f64) {
        let knee = self.eye - DVec3::Y * (EYE - STEP);
        let far = 500.0;
        let ray = enfilade::geom::Ray::segment(knee, knee - DVec3::Y * far);
        let Some(hit) = self.walls.closest_hit(&ray, |_| false) else {
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
    use enfilade_testkit::{GridParams, room_grid};

    fn walker() -> (World, Walker) {
        let world = room_grid(&GridParams {
            size: [1, 1, 1],
            doors: 0.0,
            windows: 0.0,
            furniture: 0,
            ..GridParams::offices(1, 1)
        });
        let [low, high] = world.graph.cells[0].aabb;
        let eye = [0, 1, 2].map(|k| (low[k] + high[k]) * 0.5);
        let walker = Walker::new(&world, eye);
        (world, walker)
    }

    #[test]
    fn who_falls_comes_to_stand_and_walls_hold() {
        let (world, mut walker) = walker();
        let cell = &world.graph.cells[0];
        for _ in 0..200 {
            walker.step(DVec3::new(3.0, 0.0, 1.0), 0.02);
        }
        let floor = f64::from(cell.aabb[0][1]);
        assert!((walker.eye.y - floor - EYE).abs() < 0.02, "{}", walker.eye);
        for (k, at) in [(0, walker.eye.x), (2, walker.eye.z)] {
            assert!(at < f64::from(cell.aabb[1][k]) && at > f64::from(cell.aabb[0][k]));
        }
    }

    #[test]
    fn who_flies_goes_through() {
        let (world, mut walker) = walker();
        walker.flies = true;
        for _ in 0..200 {
            walker.step(DVec3::new(10.0, 0.0, 0.0), 0.05);
        }
        assert!(walker.eye.x > f64::from(world.graph.cells[0].aabb[1][0]));
    }
}

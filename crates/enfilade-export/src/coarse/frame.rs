//! Axes along the walls of a building.

use enfilade_geom::DVec3;

use crate::surfaces::RoomSurfaces;

/// Steps of the angle in a quarter turn.
const STEPS: usize = 360;

/// Axes that are turned around +Y.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    cos: f64,
    sin: f64,
}

impl Frame {
    /// Returns the axes along which most of the walls' area lies.
    pub(crate) fn along_walls(rooms: &[RoomSurfaces]) -> Self {
        let quarter = std::f64::consts::FRAC_PI_2;
        let mut by_angle = vec![0.0; STEPS];
        let walls = rooms.iter().flat_map(|r| &r.surfaces);
        let walls = walls.filter(|s| s.normal[1].abs() < 0.1 && s.opening().is_none());
        let angle = |s: &[f64; 3]| s[2].atan2(s[0]).rem_euclid(quarter);
        let step = |a: f64| (a / quarter * STEPS as f64).round() as usize % STEPS;
        for wall in walls.clone() {
            by_angle[step(angle(&wall.normal))] += wall.area;
        }
        let most = (0..STEPS).max_by(|&a, &b| by_angle[a].total_cmp(&by_angle[b]));
        let rough = most.unwrap_or(0) as f64 / STEPS as f64 * quarter;
        // The mean of those near, as differences, which do not wrap around.
        let (mut sum, mut weight) = (0.0, f64::MIN_POSITIVE);
        for wall in walls {
            let off = (angle(&wall.normal) - rough + quarter / 2.0).rem_euclid(quarter);
            let off = off - quarter / 2.0;
            if off.abs() < quarter / STEPS as f64 {
                sum += off * wall.area;
                weight += wall.area;
            }
        }
        let off = sum / weight;
        let turned = if (rough + off).abs() < 1e-6 {
            0.0
        } else {
            rough + off
        };
        let (sin, cos) = turned.sin_cos();
        Self { cos, sin }
    }

    /// Returns a vector of the world with these axes.
    pub(crate) fn to_frame(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        [x * self.cos + z * self.sin, y, z * self.cos - x * self.sin]
    }

    /// Returns a vector with these axes as that of the world.
    pub(crate) fn to_world(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        [x * self.cos - z * self.sin, y, z * self.cos + x * self.sin]
    }

    /// Tells the surfaces of a room with these axes.
    pub(crate) fn turn(&self, room: &mut RoomSurfaces) {
        for surface in &mut room.surfaces {
            surface.normal = self.to_frame(surface.normal);
            for p in surface.loops.iter_mut().flatten() {
                *p = self.to_frame(*p);
            }
        }
    }

    /// Returns a portal's outline with these axes.
    pub(crate) fn outline(&self, outline: &[[f32; 3]]) -> Vec<DVec3> {
        let points = outline.iter().map(|p| self.to_frame(p.map(f64::from)));
        points.map(DVec3::from).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_turn_forth_and_back() {
        let (sin, cos) = 0.3_f64.sin_cos();
        let frame = Frame { cos, sin };
        let back = frame.to_world(frame.to_frame([1.0, 2.0, 3.0]));
        assert!(DVec3::from(back).distance(DVec3::new(1.0, 2.0, 3.0)) < 1e-12);
        let along = frame.to_frame([cos, 0.0, sin]);
        assert!((along[0] - 1.0).abs() < 1e-12);
    }
}

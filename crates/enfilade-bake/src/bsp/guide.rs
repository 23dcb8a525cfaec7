//! Planes with which a tree begins: grids, and planes that the user gives.

use enfilade_geom::{Aabb, DVec3, Plane};

use crate::config::Guide;

/// Most planes of one family of a grid; finer grids are coarsened to this.
const MAX_FAMILY: f64 = 256.0;

impl Guide {
    /// Returns `true` if it contains nothing.
    pub(super) fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Returns all its planes within bounds.
    pub(super) fn planes(&self, bounds: &Aabb) -> Vec<Plane> {
        let mut out = self.planes.clone();
        for b in &self.boxes {
            for n in [DVec3::X, DVec3::Y, DVec3::Z] {
                out.push(Plane::through(b.min, n));
                out.push(Plane::through(b.max, n));
            }
        }
        let mut family = |n: DVec3, step: f64| {
            let reach = n.abs().dot(bounds.size()) * 0.5;
            let middle = n.dot(bounds.center());
            let step = step.max(2.0 * reach / MAX_FAMILY);
            let first = ((middle - reach) / step).ceil() as i64;
            let last = ((middle + reach) / step).floor() as i64;
            out.extend((first..=last).map(|k| Plane {
                normal: n,
                d: -(k as f64) * step,
            }));
        };
        if let Some(step) = self.grid.filter(|s| *s > 0.0) {
            [DVec3::X, DVec3::Y, DVec3::Z]
                .into_iter()
                .for_each(|n| family(n, step));
        }
        if let Some(step) = self.tetrahedra.filter(|s| *s > 0.0) {
            for signs in [
                [1.0, 1.0, 1.0],
                [1.0, -1.0, -1.0],
                [-1.0, 1.0, -1.0],
                [-1.0, -1.0, 1.0],
            ] {
                family(DVec3::from_array(signs).normalize(), step);
            }
        }
        out
    }
}

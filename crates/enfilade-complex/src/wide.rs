//! Seals that would close a hole.
//!
//! Gaps are told piece by piece, at a few points of each, and pieces at the rims of thin leaves count as gaps where they
//! are narrow. So a large piece may have a hole between the points, and several narrow ones side by side may close one.
//! Here the seals are looked at together and all over: one is too wide where a ball of the smallest hole has room in the middle of it, and the
//! disk as wide as the ball is closed by it and those beside it.
//!
//! A part of a seal is cut in two until all of it is near matter, or too far from where seals end for a disk, or [`FINEST`].
//! Distances change no faster than places do, so both hold for a part if they hold for its middle with its radius to spare.

use enfilade_geom::{Bvh, DVec3, Triangle};
use rayon::prelude::*;

/// A hole is told where the ball has this much room around it: seals overlap what they join by about as much. [Units: wu]
const ROOM: f64 = 5e-4;
/// Smaller parts are not cut. [Units: wu]
const FINEST: f64 = 5e-4;
/// Points on the rim of a disk.
const AROUND: usize = 16;

/// A seal: its vertices and the normal of its plane.
type Polygon<'a> = (&'a [DVec3], DVec3);

/// Tells of each seal whether it closes a hole through which a ball of this diameter passes.
pub(super) fn wide(seals: &[Polygon<'_>], model: &Bvh, hole: f64) -> Vec<bool> {
    let parts = |(p, _): &Polygon<'_>| -> Vec<Triangle> {
        (2..p.len()).map(|k| [p[0], p[k - 1], p[k]]).collect()
    };
    let closed: Vec<Triangle> = seals.iter().flat_map(parts).collect();
    let holes = Holes {
        model,
        closed: Bvh::build(&closed),
        radius: 0.5 * hole + ROOM,
    };
    let is_wide = |seal: &Polygon<'_>| holes.has_one(parts(seal), seal.1);
    seals.par_iter().map(is_wide).collect()
}

struct Holes<'a> {
    model: &'a Bvh,
    closed: Bvh,
    /// Radius of the ball. [Units: wu]
    radius: f64,
}

impl Holes<'_> {
    fn has_one(&self, mut parts: Vec<Triangle>, normal: DVec3) -> bool {
        while let Some(t) = parts.pop() {
            let middle = (t[0] + t[1] + t[2]) / 3.0;
            let size = t.iter().map(|p| p.distance(middle)).fold(0.0, f64::max);
            let is_far = match self.model.nearest(middle, self.radius) {
                Some(n) if n.distance + size <= self.radius => continue,
                near => near.is_none(),
            };
            let bare = self.most_bare(middle, normal);
            if bare - ROOM > size {
                continue;
            }
            if is_far && bare <= ROOM {
                return true;
            }
            if size > FINEST {
                let length = |k: usize| t[k].distance(t[(k + 1) % 3]);
                let longest = (1..3).fold(0, |l, k| if length(k) > length(l) { k } else { l });
                let [a, b, c] = [0, 1, 2].map(|k| t[(longest + k) % 3]);
                let half = a.midpoint(b);
                parts.extend([[a, half, c], [half, b, c]]);
            }
        }
        false
    }

    /// The greatest distance from all seals on the rim of a disk about a point of one.
    fn most_bare(&self, p: DVec3, normal: DVec3) -> f64 {
        let u = normal.any_orthonormal_vector();
        let v = normal.cross(u);
        let mut most = 0.0_f64;
        for k in 0..AROUND {
            let angle = std::f64::consts::TAU * k as f64 / AROUND as f64;
            let at = p + (u * angle.cos() + v * angle.sin()) * self.radius;
            let near = self.closed.nearest(at, 2.0 * self.radius);
            most = most.max(near.map_or(2.0 * self.radius, |n| n.distance));
        }
        most
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle([x0, y0, x1, y1]: [f64; 4]) -> Vec<DVec3> {
        [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
            .map(|[x, y]| DVec3::new(x, y, 0.0))
            .to_vec()
    }

    /// A seal: its vertices and the normal of its plane.
    type Polygon<'a> = (&'a [DVec3], DVec3);

    /// Tells of each seal whether it is too wide for a hole of 10 mm.
    fn judged(walls: &[[f64; 4]], seals: &[[f64; 4]]) -> Vec<bool> {
        let corners = walls.iter().map(|&w| rectangle(w));
        let fans = corners.flat_map(|c| [[c[0], c[1], c[2]], [c[0], c[2], c[3]]]);
        let seals: Vec<Vec<DVec3>> = seals.iter().map(|&at| rectangle(at)).collect();
        let seals: Vec<Polygon<'_>> = seals.iter().map(|s| (&s[..], DVec3::Z)).collect();
        wide(&seals, &Bvh::build(&fans.collect::<Vec<_>>()), 0.01)
    }

    #[test]
    fn a_slit_that_widens_is_a_gap_no_more() {
        let walls = |width: f64| [[-1.0, 0.0, 0.0, 3.0], [width, 0.0, 1.0, 3.0]];
        assert_eq!(judged(&walls(0.009), &[[0.0, 0.0, 0.009, 3.0]]), [false]);
        assert_eq!(judged(&walls(0.02), &[[0.0, 0.0, 0.02, 3.0]]), [true]);
    }

    #[test]
    fn a_hole_that_no_sample_meets_is_found_and_narrow_pieces_close_it_together() {
        // Bars 8 mm apart; one is missing at a third of the width.
        let bars = (0..=60).filter(|&k| k != 20).map(|k| 0.01 * f64::from(k));
        let bars: Vec<_> = bars.map(|x| [x, 0.0, x + 0.002, 0.6]).collect();
        assert_eq!(judged(&bars, &[[0.0, 0.0, 0.6, 0.6]]), [true]);
        let walls = [[-1.0, 0.0, 0.0, 3.0], [0.1, 0.0, 1.0, 3.0]];
        let strips = (0..20).map(|k| 0.005 * f64::from(k));
        let strips: Vec<_> = strips.map(|x| [x, 0.0, x + 0.005, 3.0]).collect();
        let found = judged(&walls, &strips);
        assert!(found[2..18].iter().all(|&w| w), "{found:?}");
        // One that stands in the open for itself is no hole.
        assert_eq!(judged(&walls, &strips[9..10]), [false]);
    }
}

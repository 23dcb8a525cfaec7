//! Holes in a model as rays measure them: how much of a wall one can see through. Knows triangles only, and nothing of the bake.
//!
//! Parallel rays along the opening's normal, on a fine grid, pass through the thickness of the wall; the hole is the connected set of rays
//! that hit nothing, around the opening's center. Rays do not see surfaces edge on, such as a floor at a sill, so two rays are neighbors
//! only where no triangle parts them within the wall. A hole that the truth divides among openings is divided by the nearest rectangle.
//!
//! Limits: a sheet edge on that lies wholly before or behind the wall parts nothing. A hole that reaches [`AROUND`] beyond the
//! opening's rectangle has no measure. The grid's step is at most a hundredth of a side.

use serde_json::Value;

use super::score::{V3, along, cross, dot, list, sub, unit, vec3};

/// Space around the opening's rectangle in which the hole must end. [Units: wu]
const AROUND: f64 = 0.5;
/// Depth of the rays beyond each face of the wall: plaster, and sheets that are a little off. [Units: wu]
const BEYOND: f64 = 0.05;
/// Depth beside the opening's plane at which neighbors are parted, in walls without thickness. [Units: wu]
const BESIDE: f64 = 0.01;
/// The widest step between rays. [Units: wu]
const STEP: f64 = 0.02;
/// Least rays across an opening.
const ACROSS: f64 = 200.0;

/// An opening's rectangle in its wall.
pub(super) struct HolePlace {
    pub(super) center: V3,
    pub(super) normal: V3,
    /// Directions of its sides.
    sides: [V3; 2],
    pub(super) half: [f64; 2],
    pub(super) thickness: f64,
}

impl HolePlace {
    /// Returns the place of an opening of the truth: the rectangle around its outline.
    pub(super) fn of(opening: &Value) -> Option<Self> {
        let outline = list(&opening["corners"]).iter();
        let outline: Vec<V3> = outline.filter_map(vec3).collect();
        let first = sub(*outline.get(1)?, outline[0]);
        let normal = unit(vec3(&opening["normal"])?);
        // Upright openings stand; others lie along their first side.
        let up = along([0.0, 1.0, 0.0], normal, -normal[1]);
        let level = if dot(up, up) > 0.25 {
            unit(cross(up, normal))
        } else {
            unit(along(first, normal, -dot(first, normal)))
        };
        let mut place = Self {
            center: vec3(&opening["centre"])?,
            normal,
            sides: [level, cross(normal, level)],
            half: [0.0; 2],
            thickness: opening["thickness"].as_f64().unwrap_or(0.0),
        };
        for k in 0..2 {
            let at = outline
                .iter()
                .map(|&p| dot(sub(p, place.center), place.sides[k]));
            let (low, high) = at.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
            place.center = along(place.center, place.sides[k], (low + high) / 2.0);
            place.half[k] = (high - low) / 2.0;
        }
        (place.half[0] > 0.0 && place.half[1] > 0.0).then_some(place)
    }

    /// Returns a direction by sides and normal.
    pub(super) fn local(&self, d: V3) -> V3 {
        [
            dot(d, self.sides[0]),
            dot(d, self.sides[1]),
            dot(d, self.normal),
        ]
    }

    /// Returns the distance of a point of the plane from the rectangle.
    fn distance(&self, point: V3) -> f64 {
        let [x, y, z] = self.local(sub(point, self.center));
        let beyond = [x, y].map(f64::abs);
        let beyond = [
            beyond[0] - self.half[0],
            beyond[1] - self.half[1],
            z.abs() - self.thickness,
        ];
        let beyond = beyond.map(|b| b.max(0.0));
        dot(beyond, beyond).sqrt()
    }
}

/// Rays through a wall, around an opening.
pub(super) struct Hole {
    step: f64,
    n: [usize; 2],
    /// Rays that hit something, or belong to another opening.
    is_shut: Vec<bool>,
    /// True where something parts a ray from the next one along each side.
    is_parted: [Vec<bool>; 2],
}

impl Hole {
    pub(super) fn of(place: &HolePlace, others: &[&HolePlace], triangles: &[[V3; 3]]) -> Self {
        let step = (2.0 * place.half[0].min(place.half[1]) / ACROSS).min(STEP);
        let reach = place.half.map(|h| h + AROUND);
        let n = reach.map(|r| (2.0 * r / step).ceil() as usize);
        let mut hole = Self {
            step,
            n,
            is_shut: vec![false; n[0] * n[1]],
            is_parted: [0, 1].map(|_| vec![false; n[0] * n[1]]),
        };
        let depth = place.thickness / 2.0 + BEYOND;
        let beside = (place.thickness / 4.0).max(BESIDE);
        for triangle in triangles {
            // In steps from the first ray, and meters of depth.
            let local = triangle.map(|p| place.local(sub(p, place.center)));
            if local.iter().all(|p| p[2] > depth) || local.iter().all(|p| p[2] < -depth) {
                continue;
            }
            let t = local.map(|p| {
                let at = |k: usize| p[k] / step + (n[k] as f64 - 1.0) / 2.0;
                [at(0), at(1), p[2]]
            });
            hole.shut(&t, depth);
            for z in [-beside, 0.0, beside] {
                hole.part(&t, z);
            }
        }
        hole.leave(place, others);
        hole
    }

    /// Shuts the rays that a triangle meets within the depth.
    fn shut(&mut self, t: &[V3; 3], depth: f64) {
        let [a, b, c] = *t;
        let twice =
            |p: V3, q: V3, r: V3| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
        let whole = twice(a, b, c);
        if whole == 0.0 {
            return;
        }
        let (columns, rows) = (self.range(t, 0), self.range(t, 1));
        for (j, i) in rows.flat_map(|j| columns.clone().map(move |i| (j, i))) {
            let p = [i as f64, j as f64, 0.0];
            let w = [twice(p, b, c), twice(a, p, c), twice(a, b, p)].map(|w| w / whole);
            let z = w[0] * a[2] + w[1] * b[2] + w[2] * c[2];
            if w.iter().all(|&w| w >= 0.0) && z.abs() <= depth {
                self.is_shut[j * self.n[0] + i] = true;
            }
        }
    }

    /// Returns the rays within a triangle's extent along a side.
    fn range(&self, points: &[V3], k: usize) -> std::ops::Range<usize> {
        let (low, high) = points
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p[k]), h.max(p[k])));
        let n = self.n[k] as f64;
        low.ceil().clamp(0.0, n) as usize..(high.floor() + 1.0).clamp(0.0, n) as usize
    }

    /// Parts neighboring rays where a triangle comes between them at a depth.
    fn part(&mut self, t: &[V3; 3], z: f64) {
        let cuts = (0..3).filter_map(|e| {
            let (p, q) = (t[e], t[(e + 1) % 3]);
            let is_across = (p[2] < z) != (q[2] < z);
            is_across.then(|| along(p, sub(q, p), (z - p[2]) / (q[2] - p[2])))
        });
        let cuts: Vec<V3> = cuts.collect();
        let [p, q] = cuts[..] else {
            return;
        };
        for k in 0..2 {
            let other = 1 - k;
            for line in self.range(&[p, q], other) {
                let s = (line as f64 - p[other]) / (q[other] - p[other]);
                let at = (p[k] + s * (q[k] - p[k])).floor();
                if s.is_finite() && at >= 0.0 && at < self.n[k] as f64 {
                    let ij = if k == 0 {
                        [at as usize, line]
                    } else {
                        [line, at as usize]
                    };
                    self.is_parted[k][ij[1] * self.n[0] + ij[0]] = true;
                }
            }
        }
    }

    /// Shuts rays that are nearer to another opening in this wall.
    fn leave(&mut self, place: &HolePlace, others: &[&HolePlace]) {
        let size = |p: &HolePlace| p.half[0].hypot(p.half[1]) + AROUND;
        let is_near = |o: &&&HolePlace| {
            let off = place.local(sub(o.center, place.center));
            let is_flat = off[2].abs() <= place.thickness + BEYOND;
            is_flat && dot(off, off).sqrt() < size(place) + size(o)
        };
        let near: Vec<&HolePlace> = others.iter().filter(is_near).copied().collect();
        if near.is_empty() {
            return;
        }
        for index in 0..self.is_shut.len() {
            let ij = [index % self.n[0], index / self.n[0]];
            let at = |k: usize| (ij[k] as f64 - (self.n[k] as f64 - 1.0) / 2.0) * self.step;
            let point = along(
                along(place.center, place.sides[0], at(0)),
                place.sides[1],
                at(1),
            );
            let own = place.distance(point);
            self.is_shut[index] |= near.iter().any(|o| o.distance(point) < own);
        }
    }

    /// Returns the area of the hole around the middle; `None` if it does not end. [Units: wu²]
    pub(super) fn area(&self) -> Option<f64> {
        let [w, h] = self.n;
        let middle = [w / 2, h / 2];
        let off =
            |&i: &usize| (i % w).abs_diff(middle[0]).pow(2) + (i / w).abs_diff(middle[1]).pow(2);
        let start = (0..w * h).filter(|&i| !self.is_shut[i]).min_by_key(off)?;
        let mut is_seen = vec![false; w * h];
        is_seen[start] = true;
        let (mut open, mut n) = (vec![start], 0_usize);
        while let Some(i) = open.pop() {
            let (x, y) = (i % w, i / w);
            if x == 0 || y == 0 || x + 1 == w || y + 1 == h {
                return None;
            }
            n += 1;
            let [right, up] = &self.is_parted;
            let next = [
                (i - 1, right[i - 1]),
                (i + 1, right[i]),
                (i - w, up[i - w]),
                (i + w, up[i]),
            ];
            for (to, is_parted) in next {
                if !is_parted && !self.is_shut[to] && !is_seen[to] {
                    is_seen[to] = true;
                    open.push(to);
                }
            }
        }
        Some(n as f64 * self.step * self.step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// A wall of two faces with a hole of 1 × 2 m, jambs and a floor edge on.
    #[test]
    fn rays_measure_a_doorway_and_end_at_the_floor() {
        let outline = json!([
            [-0.4, 0.1, 0.0],
            [0.4, 0.1, 0.0],
            [0.4, 1.8, 0.0],
            [-0.4, 1.8, 0.0]
        ]);
        let door = json!({"centre": [0.0, 1.0, 0.0], "normal": [0.0, 0.0, 1.0], "thickness": 0.2, "corners": outline});
        let place = HolePlace::of(&door).unwrap();
        let mut wall = Vec::new();
        let mut face = |a: V3, b: V3, c: V3, d: V3| wall.extend([[a, b, c], [a, c, d]]);
        for z in [-0.1, 0.1] {
            face(
                [-3.0, 0.0, z],
                [-0.5, 0.0, z],
                [-0.5, 3.0, z],
                [-3.0, 3.0, z],
            );
            face([0.5, 0.0, z], [3.0, 0.0, z], [3.0, 3.0, z], [0.5, 3.0, z]);
            face([-0.5, 2.0, z], [0.5, 2.0, z], [0.5, 3.0, z], [-0.5, 3.0, z]);
        }
        let open = Hole::of(&place, &[], &wall).area();
        assert_eq!(open, None, "without a floor the hole has no end");
        let mut face = |a: V3, b: V3, c: V3, d: V3| wall.extend([[a, b, c], [a, c, d]]);
        face(
            [-3.0, 0.0, -3.0],
            [3.0, 0.0, -3.0],
            [3.0, 0.0, 3.0],
            [-3.0, 0.0, 3.0],
        );
        let area = Hole::of(&place, &[], &wall).area().unwrap();
        assert!((area - 2.0).abs() < 0.03, "{area}");
    }
}

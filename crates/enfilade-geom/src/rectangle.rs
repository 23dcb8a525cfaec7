//! The rectangle around something flat, such as an opening, a door leaf or a window, and how much of it is covered.

use crate::{Aabb, Attitude, DVec2, DVec3, Triangle, faces, is_rather_level, triangle_area_normal};

/// Samples along each side of a rectangle.
const SAMPLES: usize = 32;
/// Normals that differ by less than 11 degrees count as one direction.
const ONE_DIRECTION: f64 = 0.98;
/// Most directions that surfaces are sorted into, so that a sphere costs no more than a box.
const MOST_DIRECTIONS: usize = 64;

/// A box along directions of its own, seen as a rectangle with a depth.
#[derive(Clone, Debug)]
pub struct Rectangle {
    /// Horizontal direction along it.
    pub across: DVec3,
    /// Upward direction along it.
    pub up: DVec3,
    /// Direction out of it.
    pub normal: DVec3,
    /// Least coordinate along `across`, `up` and `normal`. [Units: wu]
    pub low: DVec3,
    /// Greatest coordinate along them. [Units: wu]
    pub high: DVec3,
}

impl Rectangle {
    /// Returns the rectangle around points, with `normal` pointing out of it.
    #[must_use]
    pub fn around<'p>(normal: DVec3, points: impl IntoIterator<Item = &'p DVec3>) -> Self {
        let across = DVec3::Y.cross(normal).normalize_or(DVec3::X);
        Self::along([normal, across], points)
    }

    fn along<'p>(
        [normal, across]: [DVec3; 2],
        points: impl IntoIterator<Item = &'p DVec3>,
    ) -> Self {
        let mut out = Self {
            across,
            up: normal.cross(across),
            normal,
            low: DVec3::INFINITY,
            high: DVec3::NEG_INFINITY,
        };
        for p in points {
            let q = out.place(*p);
            (out.low, out.high) = (out.low.min(q), out.high.max(q));
        }
        out
    }

    /// Returns the rectangle around a thing along its own faces: across the one of the three that most of its surface
    /// shows in which it is thinnest. `O(n log n)`.
    #[must_use]
    pub fn of(triangles: &[Triangle]) -> Self {
        let directions = directions(triangles);
        let first = directions.iter().take(3);
        let tried = first.map(|&normal| {
            // A level thing turns with its sides.
            let side = directions.iter().filter(|d| !faces(**d, normal));
            let mut side = side.filter_map(|d| (d - normal * normal.dot(*d)).try_normalize());
            let across = match Attitude::of(normal) {
                Attitude::Level => side.next().unwrap_or(DVec3::X),
                _ => DVec3::Y.cross(normal).normalize(),
            };
            Self::along([normal, across], triangles.as_flattened())
        });
        tried
            .min_by(|a, b| a.size().z.total_cmp(&b.size().z))
            .unwrap_or_else(|| Self::around(DVec3::Y, triangles.as_flattened()))
    }

    /// Returns the upright rectangle around a thing, along the walls that most of its surface is, or across them if it is
    /// thinner so. `O(n log n)`.
    #[must_use]
    pub fn upright(triangles: &[Triangle]) -> Self {
        let side = directions(triangles)
            .into_iter()
            .find(|d| !is_rather_level(*d));
        let side = side.map_or(DVec3::Z, |d| d.with_y(0.0).normalize());
        let [facing, aside] = [side, DVec3::Y.cross(side)]
            .map(|normal| Self::around(normal, triangles.as_flattened()));
        // Jambs make up most of a frame's surface; its shape shows in the direction in which it is thinnest.
        if aside.size().z < facing.size().z {
            aside
        } else {
            facing
        }
    }

    /// Returns the coordinates of a point along its three directions. [Units: wu]
    #[must_use]
    pub fn place(&self, p: DVec3) -> DVec3 {
        DVec3::new(self.across.dot(p), self.up.dot(p), self.normal.dot(p))
    }

    /// Returns the point with these coordinates.
    #[must_use]
    pub fn point(&self, place: DVec3) -> DVec3 {
        self.across * place.x + self.up * place.y + self.normal * place.z
    }

    /// Returns the point in the middle of its box.
    #[must_use]
    pub fn center(&self) -> DVec3 {
        self.point((self.low + self.high) * 0.5)
    }

    /// Returns width, height and depth. [Units: wu]
    #[must_use]
    pub fn size(&self) -> DVec3 {
        self.high - self.low
    }

    /// Returns the bounding box of triangles along its directions.
    #[must_use]
    pub fn bounds(&self, triangles: &[Triangle]) -> Aabb {
        let points = triangles.iter().flatten();
        points.fold(Aabb::EMPTY, |b, p| b.including(self.place(*p)))
    }

    /// Returns its vertices in the middle of its depth, in order around it.
    fn vertices(&self) -> [DVec3; 4] {
        let (low, high) = (self.low, self.high);
        let vertices = [
            (low.x, low.y),
            (high.x, low.y),
            (high.x, high.y),
            (low.x, high.y),
        ];
        vertices.map(|(x, y)| self.point(DVec3::new(x, y, 0.5 * (low.z + high.z))))
    }

    /// Returns the two triangles that are the rectangle in the middle of its depth.
    #[must_use]
    pub fn middle(&self) -> [Triangle; 2] {
        let [a, b, c, d] = self.vertices();
        [[a, b, c], [a, c, d]]
    }

    /// Returns points along its rim in the middle of its depth, `n` on each side.
    pub fn rim(&self, n: usize) -> impl Iterator<Item = DVec3> + '_ {
        let vertices = self.vertices();
        (0..4 * n).map(move |i| {
            let along = ((i % n) as f64 + 0.5) / n as f64;
            vertices[i / n].lerp(vertices[(i / n + 1) % 4], along)
        })
    }

    /// Returns the samples that the triangles cover, seen along its normal.
    #[must_use]
    pub fn mask(&self, triangles: impl IntoIterator<Item = Triangle>) -> Mask {
        let mut mask = Mask::default();
        let size = self.size().truncate();
        let step = size / SAMPLES as f64;
        if step.min_element() <= 0.0 || step.is_nan() {
            return mask;
        }
        for t in triangles {
            let p = t.map(|c| (self.place(c).truncate() - self.low.truncate()) / step);
            mask.add(p);
        }
        mask
    }
}

/// Returns the direction that most of the surface faces, up to sign.
#[must_use]
pub fn facing(triangles: &[Triangle]) -> DVec3 {
    directions(triangles).first().copied().unwrap_or(DVec3::Y)
}

/// Returns the directions that the surface faces, the largest area first.
///
/// The largest triangles define the directions: the many small ones of moldings, handles and scanned edges may
/// face anywhere.
fn directions(triangles: &[Triangle]) -> Vec<DVec3> {
    let normals = triangles.iter().map(triangle_area_normal);
    let mut normals: Vec<DVec3> = normals.collect();
    normals.sort_by(|a, b| b.length_squared().total_cmp(&a.length_squared()));
    let mut found: Vec<(DVec3, f64)> = Vec::new();
    for n in normals {
        let area = n.length();
        let Some(n) = n.try_normalize() else { continue };
        if let Some(d) = found.iter_mut().find(|d| d.0.dot(n).abs() > ONE_DIRECTION) {
            d.1 += area;
        } else if found.len() < MOST_DIRECTIONS {
            found.push((one_way(n), area));
        }
    }
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    found.into_iter().map(|d| d.0).collect()
}

/// Returns a direction or its reverse, the same for both.
fn one_way(d: DVec3) -> DVec3 {
    /// Largest component that rounding makes of zero.
    const NONE: f64 = 1e-6;
    let first = [d.x, d.z, d.y].into_iter().find(|c| c.abs() > NONE);
    if first.is_some_and(|c| c < 0.0) {
        -d
    } else {
        d
    }
}

/// The samples of a rectangle that something covers: one bit per sample, rows from the bottom up.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Mask([u32; SAMPLES]);

impl Mask {
    /// Adds a triangle, in units of samples.
    fn add(&mut self, p: [DVec2; 3]) {
        let area = (p[1] - p[0]).perp_dot(p[2] - p[0]);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let low = p[0].min(p[1]).min(p[2]).max(DVec2::ZERO);
        let high = p[0].max(p[1]).max(p[2]).min(DVec2::splat(SAMPLES as f64));
        if low.cmpgt(high).any() {
            return;
        }
        let range = |k: usize| {
            let first = (low[k] - 0.5).ceil().max(0.0) as usize;
            let last = (high[k] - 0.5).floor().max(-1.0) + 1.0;
            first..(last as usize).min(SAMPLES)
        };
        // Edges count as covered, so that no seam between two triangles stays open.
        let is_in = |q: DVec2| {
            (0..3).all(|k| {
                let (a, b) = (p[k], p[(k + 1) % 3]);
                (b - a).perp_dot(q - a) * area.signum() >= -1e-9
            })
        };
        for row in range(1) {
            for column in range(0) {
                if is_in(DVec2::new(column as f64 + 0.5, row as f64 + 0.5)) {
                    self.0[row] |= 1 << column;
                }
            }
        }
    }

    fn n(&self) -> u32 {
        self.0.iter().map(|row| row.count_ones()).sum()
    }

    /// Returns the share of these samples that `other` covers; 0 if there are none.
    #[must_use]
    pub fn share_in(&self, other: &Self) -> f64 {
        let both = self
            .0
            .iter()
            .zip(&other.0)
            .map(|(a, b)| (a & b).count_ones());
        f64::from(both.sum::<u32>()) / f64::from(self.n().max(1))
    }

    /// Returns these samples as a share of the whole rectangle.
    #[must_use]
    pub fn share(&self) -> f64 {
        f64::from(self.n()) / (SAMPLES * SAMPLES) as f64
    }

    /// Returns the share of the lowest row that these samples cover.
    #[must_use]
    pub fn share_at_foot(&self) -> f64 {
        f64::from(self.0[0].count_ones()) / SAMPLES as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_covers_its_rim_and_a_leaf_the_rest() {
        let of = |low: [f64; 3], high: [f64; 3]| Aabb::new(low.into(), high.into()).triangles();
        let posts = [
            of([0.0, 0.0, 0.0], [0.1, 2.0, 0.1]),
            of([0.9, 0.0, 0.0], [1.0, 2.0, 0.1]),
            of([0.1, 1.9, 0.0], [0.9, 2.0, 0.1]),
        ]
        .concat();
        let corners: Vec<DVec3> = posts.iter().flatten().copied().collect();
        let r = Rectangle::around(DVec3::Z, &corners);
        assert!((r.size() - DVec3::new(1.0, 2.0, 0.1)).length() < 1e-12);
        let frame = r.mask(posts);
        // 0.2 of 1 m are posts, and 0.05 of the rest is the head.
        assert!((frame.share() - 0.24).abs() < 0.03, "{}", frame.share());
        assert!(frame.share_at_foot() < 0.3);
        let leaf = r.mask(of([0.1, 0.0, 0.04], [0.9, 1.9, 0.08]));
        assert!((leaf.share() - 0.76).abs() < 0.04, "{}", leaf.share());
        assert!(leaf.share_in(&frame) < 0.01);
        let p = DVec3::new(0.3, 1.2, -4.0);
        assert!(r.point(r.place(p)).distance(p) < 1e-12);
    }
}

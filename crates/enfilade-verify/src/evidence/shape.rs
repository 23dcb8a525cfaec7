//! Openings, tables, polygons and planes of the checker.

use enfilade_cpg::SightGraph;
use enfilade_geom::DVec3;

/// Sine of the least angle at which a line crosses an opening; half the value that `docs/evidence.md` requires.
const MIN_SINE: f64 = 5e-10;

/// Length from which a sum of weighted rows counts as not zero.
const UNBALANCED: f64 = 1e-13;

/// A directed portal. Directions are numbered as in [`SightGraph`]; `d ^ 1` is the reverse.
pub(super) struct Opening {
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) normal: DVec3,
    pub(super) corners: Vec<DVec3>,
    pub(super) pieces: Vec<Vec<DVec3>>,
}

pub(super) struct Openings {
    pub(super) all: Vec<Opening>,
    out: Vec<Vec<usize>>,
    /// Largest absolute coordinate.
    pub(super) scale: f64,
}

/// `normal · p >= offset`, or, between two polygons, a plane with the first behind (up to `behind`) and the second in
/// front (from `front` on).
#[derive(Clone, Copy)]
pub(super) struct Plane {
    pub(super) normal: DVec3,
    pub(super) behind: f64,
    pub(super) front: f64,
}

/// A part of an opening.
#[derive(Clone)]
pub(super) struct Part {
    pub(super) opening: usize,
    pub(super) corners: Vec<DVec3>,
}

impl Openings {
    pub(super) fn new(graph: &SightGraph) -> Self {
        let mut all = Vec::with_capacity(2 * graph.portals.len());
        let mut out = vec![Vec::new(); graph.n_cells as usize];
        let mut scale = 1e-300_f64;
        for portal in &graph.portals {
            let corners = &portal.winding;
            for p in corners.iter().chain(portal.pieces.iter().flatten()) {
                scale = scale.max(p.abs().max_element());
            }
            let mut sum = DVec3::ZERO;
            let mut reach = 0.0_f64;
            for k in 1..corners.len() - 1 {
                sum += (corners[k] - corners[0]).cross(corners[k + 1] - corners[0]);
            }
            for p in corners {
                reach = reach.max(p.distance_squared(corners[0]));
            }
            let normal = if sum.length() > 1e-12 * reach {
                sum.normalize_or_zero()
            } else {
                DVec3::ZERO
            };
            let pieces = if portal.pieces.is_empty() {
                vec![corners.clone()]
            } else {
                portal.pieces.clone()
            };
            for side in [0, 1] {
                out[portal.cells[side] as usize].push(all.len());
                all.push(Opening {
                    from: portal.cells[side],
                    to: portal.cells[1 - side],
                    normal: if side == 0 { normal } else { -normal },
                    corners: corners.clone(),
                    pieces: pieces.clone(),
                });
            }
        }
        Self { all, out, scale }
    }

    /// Returns the unit normal about which the vertices of an opening run counter-clockwise.
    pub(super) fn turn(&self, d: usize) -> DVec3 {
        if d.is_multiple_of(2) {
            self.all[d].normal
        } else {
            -self.all[d].normal
        }
    }

    /// Returns a generous bound on the rounding of a product of a unit normal and a point.
    pub(super) fn rounding(&self) -> f64 {
        1e-13 * self.scale
    }

    /// Returns the directions out of a cell, by portal, except one.
    pub(super) fn exits(&self, cell: u32, but: usize) -> impl Iterator<Item = usize> + '_ {
        self.out[cell as usize]
            .iter()
            .copied()
            .filter(move |&d| d != but)
    }

    /// Returns the directions into a cell, by portal, except one.
    pub(super) fn entries(&self, cell: u32, but: usize) -> impl Iterator<Item = usize> + '_ {
        self.out[cell as usize]
            .iter()
            .map(|&d| d ^ 1)
            .filter(move |&d| d != but)
    }

    fn low(&self, d: usize) -> f64 {
        least(self.all[d].normal, &self.all[d].corners)
    }

    /// Returns `true` if weights, none negative and of sum one, balance the rows of a chain of openings.
    ///
    /// The row of an edge is positive for a line that passes on its inner side, that of an opening for a line that
    /// crosses it in its direction. All are positive for a line through the chain; then their weighted sum is
    /// positive, too, not zero.
    pub(super) fn are_balanced(&self, chain: &[usize], weights: &[(usize, f64)]) -> bool {
        let corners = || chain.iter().flat_map(|&d| &self.all[d].corners);
        let n = corners().count() as f64;
        let middle = corners().fold(DVec3::ZERO, |sum, &p| sum + p / n);
        let reach = corners().fold(f64::MIN_POSITIVE, |r, &p| {
            r.max((p - middle).abs().max_element())
        });
        let mut rows = Vec::new();
        for &d in chain {
            let opening = &self.all[d];
            let corners = &opening.corners;
            // Vertices run counter-clockwise about `turn`, so clockwise for the opposite direction.
            let side = if d.is_multiple_of(2) { 1.0 } else { -1.0 };
            for (i, &p) in corners.iter().enumerate() {
                let q = corners[(i + 1) % corners.len()];
                let [a, b] = [p, q].map(|p| (p - middle) / reach);
                let (direction, moment) = (a.cross(b) * side, (b - a) * side);
                let length = direction.length().hypot(moment.length());
                rows.push((p != q).then(|| [direction / length, moment / length]));
            }
            rows.push(Some([opening.normal, DVec3::ZERO]));
        }
        let mut sum = [DVec3::ZERO; 2];
        let mut total = 0.0;
        for &(i, weight) in weights {
            let Some(Some(row)) = rows.get(i) else {
                return false;
            };
            if weight.is_nan() || weight < 0.0 {
                return false;
            }
            total += weight;
            sum[0] += row[0] * weight;
            sum[1] += row[1] * weight;
        }
        // An opening without area has no sides, and a row of zeros that would balance anything.
        let is_flat = chain.iter().any(|&d| self.all[d].normal == DVec3::ZERO);
        (total - 1.0).abs() <= 1e-9
            && !is_flat
            && sum[0].length().hypot(sum[1].length()) <= UNBALANCED
    }

    /// Returns the position on a line where it crosses an opening's plane from front to back.
    pub(super) fn crossing(&self, d: usize, origin: DVec3, direction: DVec3) -> Option<f64> {
        let opening = &self.all[d];
        let speed = opening.normal.dot(direction);
        let middle = (self.low(d) - least(-opening.normal, &opening.corners)) * 0.5;
        (speed > MIN_SINE * direction.length())
            .then(|| (middle - opening.normal.dot(origin)) / speed)
    }

    /// Returns `true` if a point of the plane lies inside one of the opening's pieces.
    pub(super) fn is_inside(&self, d: usize, p: DVec3, margin: f64) -> bool {
        let turn = self.turn(d);
        self.all[d].pieces.iter().any(|piece| {
            (0..piece.len()).all(|k| {
                let next = piece[(k + 1) % piece.len()];
                let inward = turn.cross(next - piece[k]).normalize_or_zero();
                inward.dot(p - piece[k]) >= margin
            })
        })
    }

    /// Returns `true` if sides of planes or distance alone show that no line crosses `s` and later `t`.
    pub(super) fn are_apart(&self, s: usize, t: usize, clearance: f64, far: f64) -> bool {
        let (a, b) = (&self.all[s], &self.all[t]);
        let thin = |plane: DVec3, other: DVec3| clearance * sine(plane, other) + self.rounding();
        let in_front = -least(-a.normal, &b.corners) - self.low(s);
        let behind = -least(-b.normal, &b.corners) - least(b.normal, &a.corners);
        (a.normal != DVec3::ZERO && in_front <= thin(a.normal, b.normal))
            || (b.normal != DVec3::ZERO && behind <= thin(b.normal, a.normal))
            || gap(&a.corners, &b.corners) > far
    }

    /// Returns the plane that a line must cross at an opening.
    pub(super) fn plane(&self, d: usize) -> Plane {
        let opening = &self.all[d];
        Plane {
            normal: opening.normal,
            behind: -least(-opening.normal, &opening.corners),
            front: self.low(d),
        }
    }

    /// Returns the part in front of a plane, up to slightly more; `None` if no line with clearance meets it.
    pub(super) fn in_front(&self, part: Part, plane: &Plane, clearance: f64) -> Option<Part> {
        self.keep(part, plane.normal, plane.front, clearance)
    }

    /// Returns the part behind a plane.
    pub(super) fn behind(&self, part: Part, plane: &Plane, clearance: f64) -> Option<Part> {
        self.keep(part, -plane.normal, -plane.behind, clearance)
    }

    pub(super) fn keep(
        &self,
        part: Part,
        normal: DVec3,
        offset: f64,
        clearance: f64,
    ) -> Option<Part> {
        let hair = 1e-9 * self.scale;
        let heights: Vec<f64> = part
            .corners
            .iter()
            .map(|p| normal.dot(*p) - offset)
            .collect();
        if heights.iter().all(|&h| h >= -hair) {
            return Some(part);
        }
        if self.is_out(&heights, normal, part.opening, clearance) {
            return None;
        }
        let mut corners = Vec::with_capacity(part.corners.len() + 1);
        for (k, &p) in part.corners.iter().enumerate() {
            let j = (k + 1) % part.corners.len();
            let (h, g) = (heights[k] + hair, heights[j] + hair);
            if h >= 0.0 {
                corners.push(p);
            }
            let q = part.corners[j];
            // From the inner end, as the format requires.
            if h > 0.0 && g < 0.0 {
                corners.push(p + (q - p) * (h / (h - g)));
            } else if h < 0.0 && g > 0.0 {
                corners.push(q + (p - q) * (g / (g - h)));
            }
        }
        Some(Part { corners, ..part })
    }

    /// Returns `true` if an opening with these heights over a plane has no room for a line with clearance beyond it.
    fn is_out(&self, heights: &[f64], normal: DVec3, opening: usize, clearance: f64) -> bool {
        let high = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // A thousandth more than claimed, since two programs round differently.
        let wide = 1.001 * clearance;
        (high < wide && high < wide * sine(normal, self.all[opening].normal))
            || high < -1e-9 * self.scale
    }

    /// Returns `true` if a whole opening lies behind a plane.
    pub(super) fn is_behind(&self, d: usize, plane: &Plane, clearance: f64) -> bool {
        let opening = &self.all[d];
        let heights: Vec<f64> = opening
            .corners
            .iter()
            .map(|p| plane.normal.dot(*p) - plane.front)
            .collect();
        self.is_out(&heights, plane.normal, d, clearance)
    }

    /// Returns planes with the first part behind and the second in front, through an edge of one and a vertex of the
    /// other.
    pub(super) fn between(&self, first: &Part, second: &Part) -> Vec<Plane> {
        let mut planes = Vec::new();
        let both = [(first, second), (second, first)];
        for (side, (own, other)) in both.into_iter().enumerate() {
            let turn = self.turn(own.opening);
            let ahead = self.all[own.opening].normal * if side == 0 { 1.0 } else { -1.0 };
            for (k, &p) in own.corners.iter().enumerate() {
                let edge = own.corners[(k + 1) % own.corners.len()] - p;
                let inward = turn.cross(edge);
                // The first vertex that a half-plane meets when it turns about the edge, away from the polygon.
                let seen = |q: DVec3| (inward.dot(q - p), ahead.dot(q - p).max(0.0));
                // Vertices on the edge's line lie in all such planes.
                let is_off = |q: &DVec3| {
                    let (x, y) = seen(*q);
                    let near = 1e4 * self.rounding() * self.rounding();
                    x * x + y * y * edge.length_squared() > near * edge.length_squared()
                };
                let off = other.corners.iter().copied().filter(is_off);
                let first_met = off.reduce(|best, q| {
                    let ((x, y), (u, v)) = (seen(q), seen(best));
                    if x * v - y * u > 0.0 { q } else { best }
                });
                let Some(q) = first_met else { continue };
                if seen(q).1 <= self.rounding() {
                    continue;
                }
                let across = edge.cross(q - p);
                if across.length() <= self.rounding() * self.rounding() {
                    continue;
                }
                let normal = across / across.length();
                let sign = if side == 0 { 1.0 } else { -1.0 };
                let is_flipped = normal.dot(inward) * sign > 0.0;
                let normal = if is_flipped { -normal } else { normal };
                let behind = -least(-normal, &first.corners);
                let front = least(normal, &second.corners);
                if front >= behind - self.rounding() {
                    planes.push(Plane {
                        normal,
                        behind,
                        front,
                    });
                }
            }
        }
        planes
    }
}

fn least(normal: DVec3, points: &[DVec3]) -> f64 {
    points
        .iter()
        .map(|p| normal.dot(*p))
        .fold(f64::INFINITY, f64::min)
}

/// Returns a lower bound of the distance of two polygons: that of balls around them.
fn gap(a: &[DVec3], b: &[DVec3]) -> f64 {
    let ball = |points: &[DVec3]| {
        let center = points.iter().sum::<DVec3>() / points.len() as f64;
        let radius = points
            .iter()
            .map(|p| p.distance(center))
            .fold(0.0, f64::max);
        (center, radius)
    };
    let ((c, r), (d, s)) = (ball(a), ball(b));
    c.distance(d) - r - s
}

fn sine(a: DVec3, b: DVec3) -> f64 {
    let cosine = a.dot(b);
    (1.0 - cosine * cosine).max(0.0).sqrt()
}

/// A square table of bits.
pub(super) struct Table {
    n_words: usize,
    words: Vec<u64>,
}

impl Table {
    pub(super) fn new(n: usize) -> Self {
        let n_words = n.div_ceil(64);
        Self {
            n_words,
            words: vec![0; n * n_words],
        }
    }

    pub(super) fn set(&mut self, row: usize, column: usize) {
        set(&mut self.words[row * self.n_words..], column);
    }

    pub(super) fn n_words(&self) -> usize {
        self.n_words
    }

    pub(super) fn fill_row(&mut self, row: usize, bytes: &[u8]) {
        for (i, &byte) in bytes.iter().enumerate() {
            self.words[row * self.n_words + i / 8] |= u64::from(byte) << (i % 8 * 8);
        }
    }

    pub(super) fn row(&self, row: usize) -> &[u64] {
        &self.words[row * self.n_words..][..self.n_words]
    }

    pub(super) fn get(&self, row: usize, column: usize) -> bool {
        get(self.row(row), column)
    }

    pub(super) fn ones(&self, row: usize) -> impl Iterator<Item = usize> + '_ {
        self.row(row).iter().enumerate().flat_map(|(i, &word)| {
            (0..64)
                .filter(move |k| word >> k & 1 != 0)
                .map(move |k| i * 64 + k)
        })
    }
}

pub(super) fn get(row: &[u64], column: usize) -> bool {
    row[column / 64] >> (column % 64) & 1 != 0
}

pub(super) fn set(row: &mut [u64], column: usize) {
    row[column / 64] |= 1 << (column % 64);
}

//! Walls that block all lines from one opening to another.
//!
//! A tree describes how to halve the two openings; each of its leaves lists triangles. They block the lines between
//! two pieces if their rim (the edges that an odd number of them have) stays off the hull of the pieces, none of them
//! touches a piece, and some line between the pieces crosses an odd number of them: as a line moves, that number
//! changes by twos, unless the line passes over the rim or an end of it passes through a triangle.

use enfilade_geom::{DVec3, Triangle};

use super::EvidenceError;
use super::decode::Tree;
use super::shape::Openings;

const FIRST: u8 = 0;
const SECOND: u8 = 1;
const SHEET: u8 = 2;

/// Deepest halving: within recursion limits, and more than floats can resolve.
const MAX_DEPTH: u32 = 200;

/// Checks that every tree blocks all lines between its two openings.
pub(super) fn check(
    openings: &Openings,
    trees: &[Tree],
    clearance: f64,
    walls: Option<&[Triangle]>,
) -> Result<(), EvidenceError> {
    for tree in trees {
        let fail = |problem| EvidenceError::Hidden {
            from: tree.from,
            to: tree.to,
            problem,
        };
        let walls = walls.ok_or(fail(
            "they are claimed hidden by walls, but there are no walls",
        ))?;
        let mut reader = BeamReader {
            rest: &tree.bytes,
            walls,
            // Smaller distances are rounding.
            apart: 8.0 * openings.rounding(),
        };
        let (s, t) = (tree.from, tree.to);
        for first in openings.open_parts(s, clearance) {
            for second in openings.open_parts(t, clearance) {
                // A line leaves the second opening on the far side of the first, and reaches it from its back.
                let second = kept(&second, openings.all[s].normal, openings.middle(s));
                let first = kept(&first, -openings.all[t].normal, -openings.middle(t));
                if !first.is_empty() && !second.is_empty() {
                    reader.node(&first, &second, 0).map_err(fail)?;
                }
            }
        }
        if !reader.rest.is_empty() {
            return Err(fail("their tree continues after the last piece"));
        }
    }
    Ok(())
}

struct BeamReader<'a> {
    rest: &'a [u8],
    walls: &'a [Triangle],
    apart: f64,
}

impl BeamReader<'_> {
    fn byte(&mut self) -> Result<u8, &'static str> {
        let (&byte, rest) = self.rest.split_first().ok_or("their tree ends early")?;
        self.rest = rest;
        Ok(byte)
    }

    fn node(&mut self, first: &[DVec3], second: &[DVec3], depth: u32) -> Result<(), &'static str> {
        if depth > MAX_DEPTH {
            return Err("their tree is too deep");
        }
        match self.byte()? {
            FIRST => {
                for half in split(first) {
                    self.node(&half, second, depth + 1)?;
                }
                Ok(())
            }
            SECOND => {
                for half in split(second) {
                    self.node(first, &half, depth + 1)?;
                }
                Ok(())
            }
            SHEET => {
                let n = self.byte()?;
                let mut sheet = Vec::with_capacity(n.into());
                for _ in 0..n {
                    let (id, rest) = self
                        .rest
                        .split_first_chunk()
                        .ok_or("their tree ends early")?;
                    self.rest = rest;
                    let triangle = self.walls.get(u32::from_le_bytes(*id) as usize);
                    sheet.push(
                        *triangle
                            .ok_or("their tree contains a triangle that is not in the world")?,
                    );
                }
                self.sheet(&sheet, first, second)
            }
            _ => Err("their tree has an unknown symbol"),
        }
    }

    /// Checks that triangles block all lines between two polygons.
    fn sheet(
        &self,
        sheet: &[Triangle],
        first: &[DVec3],
        second: &[DVec3],
    ) -> Result<(), &'static str> {
        if first.len() < 3 || second.len() < 3 {
            return Ok(());
        }
        let hull = hull(first, second, self.apart);
        for rim in rim(sheet) {
            if !is_off(rim, &hull, self.apart) {
                return Err("a line may pass around the triangles between them");
            }
        }
        let (p, q) = (near_middle(first), near_middle(second));
        let mut is_odd = false;
        for triangle in sheet {
            if touches(triangle, first, self.apart) || touches(triangle, second, self.apart) {
                return Err("a triangle between them touches an opening");
            }
            is_odd ^= self.is_crossed(triangle, p, q)?;
        }
        if is_odd {
            Ok(())
        } else {
            Err("a line between them passes through the triangles unblocked")
        }
    }

    fn is_crossed(&self, triangle: &Triangle, p: DVec3, q: DVec3) -> Result<bool, &'static str> {
        let unsure = Err("a line between them passes too close to an edge to decide");
        let [a, b, c] = *triangle;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let (above, below) = (normal.dot(p - a), normal.dot(q - a));
        if (above > self.apart && below > self.apart)
            || (above < -self.apart && below < -self.apart)
        {
            return Ok(false);
        }
        let fall = above - below;
        if fall.abs() <= 0.5e-4 * p.distance(q) {
            return unsure;
        }
        let met = p + (q - p) * (above / fall);
        let near = 1e4 * self.apart;
        let inside = [[a, b], [b, c], [c, a]].map(|[from, to]| {
            let inward = normal.cross(to - from).normalize_or_zero();
            inward.dot(met - from)
        });
        if inside.iter().any(|&x| x < -near) {
            Ok(false)
        } else if inside.iter().all(|&x| x > near) && above.abs().min(below.abs()) > self.apart {
            Ok(true)
        } else {
            unsure
        }
    }
}

impl Openings {
    /// Returns the region where lines may cross an opening: its pieces, moved onto its plane, without a border.
    fn open_parts(&self, d: usize, border: f64) -> Vec<Vec<DVec3>> {
        let opening = &self.all[d];
        let (turn, middle) = (self.turn(d), self.middle(d));
        let mut parts = Vec::new();
        for piece in &opening.pieces {
            let flat = |p: &DVec3| *p + opening.normal * (middle - opening.normal.dot(*p));
            let mut part: Vec<DVec3> = piece.iter().map(flat).collect();
            for (k, &p) in piece.iter().enumerate() {
                let next = piece[(k + 1) % piece.len()];
                let inward = turn.cross(next - p).normalize_or_zero();
                part = kept(&part, inward, inward.dot(p) + border);
            }
            parts.push(part);
        }
        parts
    }

    /// Returns the height of an opening's plane along its normal.
    fn middle(&self, d: usize) -> f64 {
        let heights = self.all[d]
            .corners
            .iter()
            .map(|p| self.all[d].normal.dot(*p));
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(x), h.max(x))
        });
        (low + high) * 0.5
    }
}

/// Returns the part of a convex polygon with `normal · p >= least`; nothing if less than a triangle is left.
fn kept(polygon: &[DVec3], normal: DVec3, least: f64) -> Vec<DVec3> {
    let mut out = Vec::new();
    for (k, &p) in polygon.iter().enumerate() {
        let q = polygon[(k + 1) % polygon.len()];
        let (h, g) = (normal.dot(p) - least, normal.dot(q) - least);
        if h >= 0.0 {
            out.push(p);
        }
        if h > 0.0 && g < 0.0 {
            out.push(p + (q - p) * (h / (h - g)));
        } else if h < 0.0 && g > 0.0 {
            out.push(q + (p - q) * (g / (g - h)));
        }
    }
    if out.len() < 3 {
        out.clear();
    }
    out
}

/// Returns two halves of a polygon, cut across its longest side, the upper half first.
fn split(polygon: &[DVec3]) -> [Vec<DVec3>; 2] {
    let mut bounds = [DVec3::MAX, DVec3::MIN];
    for &p in polygon {
        bounds = [bounds[0].min(p), bounds[1].max(p)];
    }
    let size = bounds[1] - bounds[0];
    let axis = if size.x >= size.y.max(size.z) {
        DVec3::X
    } else if size.y >= size.z {
        DVec3::Y
    } else {
        DVec3::Z
    };
    let middle = axis.dot(bounds[0] + bounds[1]) * 0.5;
    [kept(polygon, axis, middle), kept(polygon, -axis, -middle)]
}

/// Returns the edges of an odd number of triangles; vertices are equal if their coordinates are.
fn rim(sheet: &[Triangle]) -> Vec<[DVec3; 2]> {
    let key = |p: DVec3| (p + DVec3::ZERO).to_array().map(f64::to_bits);
    let mut edges = Vec::with_capacity(3 * sheet.len());
    for &[a, b, c] in sheet {
        for edge in [[a, b], [b, c], [c, a]] {
            let mut ends = edge.map(key);
            ends.sort_unstable();
            edges.push((ends, edge));
        }
    }
    edges.sort_by_key(|e| e.0);
    let same = edges.chunk_by(|a, b| a.0 == b.0);
    same.filter(|of| of.len() % 2 == 1)
        .map(|of| of[0].1)
        .collect()
}

/// Returns half-spaces `normal · p >= least` that contain both polygons and touch them.
fn hull(first: &[DVec3], second: &[DVec3], apart: f64) -> Vec<(DVec3, f64)> {
    let mut sides = Vec::new();
    let mut add = |normal: DVec3| {
        if normal != DVec3::ZERO {
            let heights = first.iter().chain(second).map(|p| normal.dot(*p));
            sides.push((normal, heights.fold(f64::INFINITY, f64::min)));
        }
    };
    for (own, other) in [(first, second), (second, first)] {
        let turn = turn_of(own);
        add(turn);
        add(-turn);
        for k in 0..own.len() {
            let edge = own[(k + 1) % own.len()] - own[k];
            for &corner in other {
                let normal = edge.cross(corner - own[k]).normalize_or_zero();
                let heights = first.iter().chain(second).map(|p| normal.dot(*p - own[k]));
                let (low, high) =
                    heights.fold((0.0_f64, 0.0_f64), |(l, h), x| (l.min(x), h.max(x)));
                // Other planes cut through the polygons and bound nothing.
                if low >= -4.0 * apart {
                    add(normal);
                }
                if high <= 4.0 * apart {
                    add(-normal);
                }
            }
        }
    }
    sides
}

/// Returns `true` if a segment does not meet a hull.
fn is_off([a, b]: [DVec3; 2], hull: &[(DVec3, f64)], apart: f64) -> bool {
    let mut within = [0.0_f64, 1.0_f64];
    for &(normal, least) in hull {
        let (h, g) = (normal.dot(a) - least + apart, normal.dot(b) - least + apart);
        if h.max(g) < 0.0 {
            return true;
        }
        if h < 0.0 {
            within[0] = within[0].max(h / (h - g));
        }
        if g < 0.0 {
            within[1] = within[1].min(h / (h - g));
        }
    }
    within[0] > within[1]
}

/// Returns `true` if no plane separates a triangle from a convex polygon.
fn touches(triangle: &Triangle, polygon: &[DVec3], apart: f64) -> bool {
    let is_between = |axis: DVec3| {
        let axis = axis.normalize_or_zero();
        let range = |points: &[DVec3]| {
            let mut range = [f64::INFINITY, f64::NEG_INFINITY];
            for p in points {
                let x = axis.dot(*p);
                range = [range[0].min(x), range[1].max(x)];
            }
            range
        };
        let (t, p) = (range(triangle), range(polygon));
        t[1] + apart < p[0] || p[1] + apart < t[0]
    };
    let turn = turn_of(polygon);
    let sides = [0, 1, 2].map(|k| triangle[(k + 1) % 3] - triangle[k]);
    if is_between(turn) || is_between(sides[0].cross(sides[1])) {
        return false;
    }
    for (k, &p) in polygon.iter().enumerate() {
        let edge = polygon[(k + 1) % polygon.len()] - p;
        if is_between(turn.cross(edge)) || sides.iter().any(|side| is_between(side.cross(edge))) {
            return false;
        }
    }
    true
}

fn turn_of(polygon: &[DVec3]) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for k in 1..polygon.len() - 1 {
        sum += (polygon[k] - polygon[0]).cross(polygon[k + 1] - polygon[0]);
    }
    sum.normalize_or_zero()
}

/// Returns an inner point other than the centroid: walls are often cut into triangles along lines of symmetry.
fn near_middle(polygon: &[DVec3]) -> DVec3 {
    let mut sum = DVec3::ZERO;
    let mut weights = 0.0;
    for (k, &p) in polygon.iter().enumerate() {
        let weight = 1.0 + 0.13 * (k % 5) as f64;
        sum += p * weight;
        weights += weight;
    }
    sum / weights
}

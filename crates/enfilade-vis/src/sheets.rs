//! Sheets of triangles, and the beams that they close; `occlude` explains the method.
//!
//! Errs to visible: anything too near to a border to be certain closes nothing.

use std::collections::HashMap;

use enfilade_geom::{Bvh, DVec3, Triangle};

/// Most triangles of a sheet.
const MAX_SHEET: usize = 96;

/// Symbols of a tree of beams.
mod symbol {
    /// The piece of the first opening is halved.
    pub(crate) const FIRST: u8 = 0;
    /// The piece of the second opening is halved.
    pub(crate) const SECOND: u8 = 1;
    /// A sheet is in the way: number of triangles, and their indices.
    pub(crate) const SHEET: u8 = 2;
}

/// Triangles and their edges.
pub(crate) struct Sheets<'a> {
    pub(crate) triangles: &'a [Triangle],
    pub(crate) bvh: &'a Bvh,
    /// For each triangle, its edges.
    edges: Vec<[u32; 3]>,
    /// For each edge, its ends and the triangles around it.
    ends: Vec<[DVec3; 2]>,
    around: Vec<Vec<u32>>,
}

/// The lines from one polygon to another.
pub(crate) struct Beam {
    pub(crate) ends: [Vec<DVec3>; 2],
    /// Node of the tree: a leaf's sheet, or the indices of two halves.
    pub(crate) what: Part,
}

pub(crate) enum Part {
    Open,
    Sheet(Vec<u32>),
    /// The end that was halved, and the two halves.
    Halves(usize, [Option<usize>; 2]),
}

impl<'a> Sheets<'a> {
    pub(crate) fn new(triangles: &'a [Triangle], bvh: &'a Bvh) -> Self {
        let mut corners = HashMap::new();
        let mut by_ends = HashMap::new();
        let (mut ends, mut around) = (Vec::new(), Vec::<Vec<u32>>::new());
        let mut edges = Vec::with_capacity(triangles.len());
        for (i, triangle) in triangles.iter().enumerate() {
            let ids = triangle.map(|p| {
                // Adding zero turns -0 into +0.
                let key = (p + DVec3::ZERO).to_array().map(f64::to_bits);
                let next = corners.len() as u32;
                *corners.entry(key).or_insert(next)
            });
            edges.push([0, 1, 2].map(|k| {
                let (a, b) = (ids[k], ids[(k + 1) % 3]);
                let edge = *by_ends.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    ends.push([triangle[k], triangle[(k + 1) % 3]]);
                    around.push(Vec::new());
                    ends.len() as u32 - 1
                });
                around[edge as usize].push(i as u32);
                edge
            }));
        }
        Self {
            triangles,
            bvh,
            edges,
            ends,
            around,
        }
    }

    /// Returns a sheet that crosses the beam, grown from a triangle over every edge that touches the beam.
    pub(crate) fn grown(
        &self,
        seed: u32,
        beam: &Beam,
        hull: &Hull,
        line: [DVec3; 2],
    ) -> Option<Vec<u32>> {
        // `None` also if the triangle touches an end of the beam.
        let is_crossed = |t: u32| {
            let triangle = &self.triangles[t as usize];
            let is_crossed = crosses(triangle, line, hull.apart)?;
            let is_apart = |end: &Vec<DVec3>| are_apart(triangle, end, hull.apart);
            beam.ends.iter().all(is_apart).then_some(is_crossed)
        };
        let mut n_crossed = u32::from(is_crossed(seed)?);
        let mut sheet = vec![seed];
        let mut rim: Vec<(u32, u32)> = self.edges[seed as usize].map(|e| (e, seed)).to_vec();
        let mut at = 0;
        while at < rim.len() {
            let (edge, of) = rim[at];
            if hull.is_apart(self.ends[edge as usize]) {
                at += 1;
                continue;
            }
            let others = self.around[edge as usize].iter().copied();
            let next = others.filter(|t| !sheet.contains(t)).max_by(|&a, &b| {
                let [a, b] = [a, b].map(|t| self.flatness(edge, of, t));
                a.total_cmp(&b)
            })?;
            if sheet.len() == MAX_SHEET {
                return None;
            }
            n_crossed += u32::from(is_crossed(next)?);
            sheet.push(next);
            for e in self.edges[next as usize] {
                match rim.iter().position(|&(r, _)| r == e) {
                    Some(i) => {
                        rim.remove(i);
                        at -= usize::from(i < at);
                    }
                    None => rim.push((e, next)),
                }
            }
        }
        (n_crossed % 2 == 1).then_some(sheet)
    }

    /// Returns how straight a sheet continues over an edge: the cosine of the turn.
    fn flatness(&self, edge: u32, from: u32, to: u32) -> f64 {
        let [a, b] = self.ends[edge as usize];
        let along = (b - a).normalize_or_zero();
        let away = |t: u32| {
            let third = self.triangles[t as usize]
                .iter()
                .map(|&p| p - a - along * along.dot(p - a))
                .max_by(|p, q| p.length_squared().total_cmp(&q.length_squared()));
            third.unwrap_or_default().normalize_or_zero()
        };
        -away(from).dot(away(to))
    }
}

/// Half-spaces that enclose a beam, each touching it.
pub(crate) struct Hull {
    sides: Vec<(DVec3, f64)>,
    apart: f64,
}

impl Hull {
    pub(crate) fn new(beam: &Beam, apart: f64) -> Self {
        let [p, q] = &beam.ends;
        let mut hull = Self {
            sides: Vec::new(),
            apart,
        };
        for (own, other) in [(p, q), (q, p)] {
            let n = own.len();
            let turn = area_normal(own);
            hull.add(turn, p, q);
            hull.add(-turn, p, q);
            for i in 0..n {
                let (a, b) = (own[i], own[(i + 1) % n]);
                for c in extremes([a, b], turn, other) {
                    let normal = (b - a).cross(c - a).normalize_or_zero();
                    let touches = |x: &DVec3| normal.dot(*x - a);
                    let all = p.iter().chain(q).map(touches);
                    let (low, high) = all.fold((0.0, 0.0), |(l, h), x| (x.min(l), x.max(h)));
                    if -low <= apart {
                        hull.add(normal, p, q);
                    }
                    if high <= apart {
                        hull.add(-normal, p, q);
                    }
                }
            }
        }
        hull
    }

    /// Adds the half-space with this normal that holds the beam. It is valid for any normal, however inaccurate.
    fn add(&mut self, normal: DVec3, p: &[DVec3], q: &[DVec3]) {
        if normal != DVec3::ZERO {
            let heights = p.iter().chain(q).map(|x| normal.dot(*x));
            self.sides
                .push((normal, heights.fold(f64::INFINITY, f64::min)));
        }
    }

    /// Returns `true` if a segment does not touch the beam.
    fn is_apart(&self, [a, b]: [DVec3; 2]) -> bool {
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        for &(normal, least) in &self.sides {
            let (h, g) = (
                normal.dot(a) - least + self.apart,
                normal.dot(b) - least + self.apart,
            );
            if h < 0.0 && g < 0.0 {
                return true;
            }
            if h < 0.0 {
                first = first.max(h / (h - g));
            } else if g < 0.0 {
                last = last.min(h / (h - g));
            }
        }
        // Positions along the segment have no unit; their error is less than a millionth.
        first > last + 1e-6
    }
}

/// Returns the first and the last of some points that a plane meets as it turns about an edge of a polygon, whose normal is
/// `turn`, from beyond the edge.
fn extremes([a, b]: [DVec3; 2], turn: DVec3, points: &[DVec3]) -> [DVec3; 2] {
    let inward = turn.cross(b - a).normalize_or_zero();
    // Grows with the angle, from -2 to 2.
    let angle = |p: DVec3| {
        let (x, y) = (inward.dot(p - a), turn.dot(p - a));
        let part = x / (x.abs() + y.abs()).max(f64::MIN_POSITIVE);
        if y < 0.0 { part - 1.0 } else { 1.0 - part }
    };
    let mut ends = [(f64::INFINITY, a), (f64::NEG_INFINITY, a)];
    for &p in points {
        let at = angle(p);
        if at < ends[0].0 {
            ends[0] = (at, p);
        }
        if at > ends[1].0 {
            ends[1] = (at, p);
        }
    }
    ends.map(|end| end.1)
}

fn area_normal(points: &[DVec3]) -> DVec3 {
    let o = points[0];
    let sum: DVec3 = points.windows(2).map(|e| (e[0] - o).cross(e[1] - o)).sum();
    sum.normalize_or_zero()
}

/// Returns `true` if a segment crosses a triangle; `None` if it comes too near to its plane or an edge to be certain.
fn crosses(triangle: &Triangle, [p, q]: [DVec3; 2], apart: f64) -> Option<bool> {
    let [a, b, c] = *triangle;
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let (h, g) = (normal.dot(p - a), normal.dot(q - a));
    if h.min(g) > apart || h.max(g) < -apart {
        return Some(false);
    }
    // A line along the plane crosses it at no certain place.
    if (h - g).abs() <= 1e-4 * (q - p).length() {
        return None;
    }
    let at = p + (q - p) * (h / (h - g));
    let near = 1e4 * apart;
    let mut is_inside = true;
    for (from, to) in [(a, b), (b, c), (c, a)] {
        let inward = normal.cross(to - from).normalize_or_zero();
        let height = inward.dot(at - from);
        // To be clearly outside of one edge is enough.
        if height < -near {
            return Some(false);
        }
        is_inside &= height > near;
    }
    let is_through = h.abs() > apart && g.abs() > apart;
    (is_inside && is_through).then_some(true)
}

/// Returns `true` if a plane separates a triangle and a convex polygon.
fn are_apart(triangle: &Triangle, polygon: &[DVec3], apart: f64) -> bool {
    let extent = |points: &[DVec3], axis: DVec3| {
        let heights = points.iter().map(|p| axis.dot(*p));
        heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(x), h.max(x))
        })
    };
    let parts = |axis: DVec3| {
        let axis = axis.normalize_or_zero();
        let ((a, b), (c, d)) = (extent(triangle, axis), extent(polygon, axis));
        b + apart < c || d + apart < a
    };
    let turn = area_normal(polygon);
    let [a, b, c] = *triangle;
    let n = polygon.len();
    let sides = (0..n).map(|i| polygon[(i + 1) % n] - polygon[i]);
    parts(turn)
        || parts((b - a).cross(c - a))
        || sides.clone().any(|side| {
            parts(turn.cross(side)) || [b - a, c - b, a - c].iter().any(|e| parts(e.cross(side)))
        })
}

/// Returns the part of a convex polygon where `normal · p >= least`.
pub(crate) fn cut(points: &[DVec3], normal: DVec3, least: f64) -> Vec<DVec3> {
    let n = points.len();
    let mut out = Vec::with_capacity(n + 1);
    for i in 0..n {
        let (p, q) = (points[i], points[(i + 1) % n]);
        let (h, g) = (normal.dot(p) - least, normal.dot(q) - least);
        if h >= 0.0 {
            out.push(p);
        }
        if (h > 0.0 && g < 0.0) || (h < 0.0 && g > 0.0) {
            // Computed from the inner end, so that both directions of an edge give the same point.
            out.push(if h > 0.0 {
                p + (q - p) * (h / (h - g))
            } else {
                q + (p - q) * (g / (g - h))
            });
        }
    }
    if out.len() < 3 { Vec::new() } else { out }
}

/// Returns a point inside, off the lines of symmetry along which walls are cut into triangles.
pub(crate) fn inner_point(points: &[DVec3]) -> DVec3 {
    let weight = |i: usize| 1.0 + 0.13 * (i % 5) as f64;
    let sum: DVec3 = points.iter().enumerate().map(|(i, &p)| p * weight(i)).sum();
    sum / (0..points.len()).map(weight).sum::<f64>()
}

/// Returns the halves of a polygon across its longest axis, the upper half first.
pub(crate) fn halves(points: &[DVec3]) -> [Vec<DVec3>; 2] {
    let low = points.iter().copied().fold(DVec3::MAX, DVec3::min);
    let high = points.iter().copied().fold(DVec3::MIN, DVec3::max);
    let size = high - low;
    let axis = if size.x >= size.y && size.x >= size.z {
        DVec3::X
    } else if size.y >= size.z {
        DVec3::Y
    } else {
        DVec3::Z
    };
    let middle = axis.dot(low + high) * 0.5;
    [1.0, -1.0].map(|sign| cut(points, axis * sign, middle * sign))
}

pub(crate) fn size(points: &[DVec3]) -> f64 {
    let o = points[0];
    points.iter().map(|p| p.distance(o)).fold(0.0, f64::max)
}

/// Appends the tree of a beam and its descendants; `docs/evidence.md` describes the format.
pub(crate) fn write_tree(beams: &[Beam], at: usize, out: &mut Vec<u8>) {
    match &beams[at].what {
        Part::Sheet(sheet) => {
            out.extend([symbol::SHEET, sheet.len() as u8]);
            out.extend(sheet.iter().flat_map(|t| t.to_le_bytes()));
        }
        Part::Halves(end, halves) => {
            out.push(if *end == 0 {
                symbol::FIRST
            } else {
                symbol::SECOND
            });
            for half in halves.iter().flatten() {
                write_tree(beams, *half, out);
            }
        }
        Part::Open => {}
    }
}

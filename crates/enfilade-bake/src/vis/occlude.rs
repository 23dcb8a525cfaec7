//! Walls inside cells: whether all lines from one opening to another end at them.
//!
//! Planes between openings say nothing of a wall that juts into a cell. Here the lines from a piece of one opening
//! to a piece of another, a *beam*, are held against the triangles themselves. A *sheet* is a set of triangles that
//! share edges; its rim are the edges that an odd number of them have. Where the rim does not touch the hull of
//! the two pieces, no triangle touches the pieces, and one line of the beam crosses the sheet an odd number of times,
//! every line does: lines change into each other without leaving the beam, and the number can only change by two.
//! Otherwise the larger piece is halved. A line that is free on the way shows that the cells see each other.
//!
//! The question is that of Nirenstein, Blake and Gain, *Exact From-Region Visibility Culling* (EGWR 2002), who
//! subtract polyhedra in Plücker space. Halving needs no five-dimensional hulls, each leaf can be checked
//! by itself, and what it cannot settle in [`MAX_BEAMS`] pieces stays visible: it errs to visible.

use std::collections::HashMap;

use enfilade_geom::{Bvh, DVec3, Ray, Triangle};
use rayon::prelude::*;

use super::bits;
use super::dirs::Dirs;
use super::rays::{Line, walk};
use super::search::Search;

/// Pieces that the lines between two openings may be cut into: at first, when a line that is easily found
/// spares the rest, and then.
const FEW_BEAMS: usize = 300;
const MAX_BEAMS: usize = 20_000;
/// Triangles of a sheet.
const MAX_SHEET: usize = 96;
/// Places along a line from which a sheet is grown.
const MAX_SEEDS: usize = 6;
/// Distances that count as apart, in roundings; a checker asks for half of it.
const APART: f64 = 16.0;

/// Symbols of a tree of beams.
pub(super) mod symbol {
    /// The piece of the first opening is halved.
    pub(crate) const FIRST: u8 = 0;
    /// The piece of the second opening is halved.
    pub(crate) const SECOND: u8 = 1;
    /// A sheet is in the way: number of triangles, and which.
    pub(crate) const SHEET: u8 = 2;
}

/// That no line leads through one opening and a later one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Closed {
    pub(super) from: u32,
    pub(super) to: u32,
    /// Trees of beams, one for each two pieces of the openings that a line passes both of.
    pub(super) tree: Vec<u8>,
}

/// Triangles and their edges.
pub(super) struct Sheets<'a> {
    triangles: &'a [Triangle],
    bvh: &'a Bvh,
    /// By triangle.
    edges: Vec<[u32; 3]>,
    /// By edge, its ends and the triangles that have it.
    ends: Vec<[DVec3; 2]>,
    around: Vec<Vec<u32>>,
}

/// What the lines from one opening to another meet.
enum Verdict {
    /// By a tree of beams, or because neighbors are.
    Closed(Option<Vec<u8>>),
    Line(Line),
    Unknown,
}

/// What is known of two cells: openings between which no line leads, how that is shown, and a line.
#[derive(Default)]
struct Settled {
    closed: Vec<(usize, usize, Option<Vec<u8>>)>,
    line: Option<Line>,
}

/// Lines from a polygon to another.
struct Beam {
    ends: [Vec<DVec3>; 2],
    /// Where it was written down: a leaf's sheet, or the beams that follow.
    what: Part,
}

enum Part {
    Open,
    Sheet(Vec<u32>),
    /// Which end was halved, and the two halves.
    Halves(usize, [Option<usize>; 2]),
}

impl<'a> Sheets<'a> {
    pub(super) fn new(triangles: &'a [Triangle], bvh: &'a Bvh) -> Self {
        let mut corners = HashMap::new();
        let mut by_ends = HashMap::new();
        let (mut ends, mut around) = (Vec::new(), Vec::<Vec<u32>>::new());
        let mut edges = Vec::with_capacity(triangles.len());
        for (i, triangle) in triangles.iter().enumerate() {
            let ids = triangle.map(|p| {
                // Zero has two signs.
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

    /// A sheet that crosses the beam, grown from a triangle over every edge that touches the beam.
    fn grown(&self, seed: u32, beam: &Beam, hull: &Hull, line: [DVec3; 2]) -> Option<Vec<u32>> {
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
        let mut n_crossed = 0;
        for &t in &sheet {
            n_crossed += u32::from(crosses(&self.triangles[t as usize], line, hull.apart)?);
        }
        let is_free = n_crossed % 2 == 1
            && sheet.iter().all(|&t| {
                let triangle = &self.triangles[t as usize];
                beam.ends
                    .iter()
                    .all(|end| are_apart(triangle, end, hull.apart))
            });
        is_free.then_some(sheet)
    }

    /// How straight a sheet goes on over an edge: cosine of the turn.
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

/// Half-spaces around a beam, each touching it.
struct Hull {
    sides: Vec<(DVec3, f64)>,
    apart: f64,
}

impl Hull {
    fn new(beam: &Beam, apart: f64) -> Self {
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
                for &c in other {
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

    /// Whatever the normal, the half-space holds the beam: nothing rests on how well it was computed.
    fn add(&mut self, normal: DVec3, p: &[DVec3], q: &[DVec3]) {
        if normal != DVec3::ZERO {
            let heights = p.iter().chain(q).map(|x| normal.dot(*x));
            self.sides
                .push((normal, heights.fold(f64::INFINITY, f64::min)));
        }
    }

    /// Whether a segment does not touch the beam.
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
        // Shares of the segment have no unit; a millionth of it is more than they can be wrong.
        first > last + 1e-6
    }
}

fn area_normal(points: &[DVec3]) -> DVec3 {
    let o = points[0];
    let sum: DVec3 = points.windows(2).map(|e| (e[0] - o).cross(e[1] - o)).sum();
    sum.normalize_or_zero()
}

/// Whether a segment crosses a triangle; `None` where it comes too near to its plane's or its edges' border to say.
fn crosses(triangle: &Triangle, [p, q]: [DVec3; 2], apart: f64) -> Option<bool> {
    let [a, b, c] = *triangle;
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let (h, g) = (normal.dot(p - a), normal.dot(q - a));
    if h.min(g) > apart || h.max(g) < -apart {
        return Some(false);
    }
    // A line that runs along the plane crosses it at no sure place.
    if (h - g).abs() <= 1e-4 * (q - p).length() {
        return None;
    }
    let at = p + (q - p) * (h / (h - g));
    let near = 1e4 * apart;
    let mut is_inside = true;
    for (from, to) in [(a, b), (b, c), (c, a)] {
        let inward = normal.cross(to - from).normalize_or_zero();
        let height = inward.dot(at - from);
        // One edge that it is clearly outside of is enough.
        if height < -near {
            return Some(false);
        }
        is_inside &= height > near;
    }
    let is_through = h.abs() > apart && g.abs() > apart;
    (is_inside && is_through).then_some(true)
}

/// Whether a plane passes between a triangle and a convex polygon.
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

/// The part of a convex polygon where `normal · p >= least`.
fn cut(points: &[DVec3], normal: DVec3, least: f64) -> Vec<DVec3> {
    let n = points.len();
    let mut out = Vec::with_capacity(n + 1);
    for i in 0..n {
        let (p, q) = (points[i], points[(i + 1) % n]);
        let (h, g) = (normal.dot(p) - least, normal.dot(q) - least);
        if h >= 0.0 {
            out.push(p);
        }
        if (h > 0.0 && g < 0.0) || (h < 0.0 && g > 0.0) {
            // From the inner end, so that both directions of an edge give the same point.
            out.push(if h > 0.0 {
                p + (q - p) * (h / (h - g))
            } else {
                q + (p - q) * (g / (g - h))
            });
        }
    }
    if out.len() < 3 { Vec::new() } else { out }
}

/// A point inside, off the lines of symmetry along which walls are cut into triangles.
fn inner_point(points: &[DVec3]) -> DVec3 {
    let weight = |i: usize| 1.0 + 0.13 * (i % 5) as f64;
    let sum: DVec3 = points.iter().enumerate().map(|(i, &p)| p * weight(i)).sum();
    sum / (0..points.len()).map(weight).sum::<f64>()
}

/// Across the longest side, the upper half first.
fn halves(points: &[DVec3]) -> [Vec<DVec3>; 2] {
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

fn size(points: &[DVec3]) -> f64 {
    let o = points[0];
    points.iter().map(|p| p.distance(o)).fold(0.0, f64::max)
}

impl Dirs {
    /// Where lines may cross the pieces of an opening: on its plane, so far inside their edges.
    fn open_parts(&self, d: usize, inset: f64) -> Vec<Vec<DVec3>> {
        let dir = &self.all[d];
        let height = (dir.low + dir.high) * 0.5;
        let pieces = &self.pieces[dir.pieces.start as usize..dir.pieces.end as usize];
        let part = |piece: &std::ops::Range<u32>| {
            let range = piece.start as usize..piece.end as usize;
            let mut points: Vec<DVec3> = self.points[range.clone()]
                .iter()
                .map(|&p| p + dir.normal * (height - dir.normal.dot(p)))
                .collect();
            for &(inward, offset) in &self.edges[range] {
                points = cut(&points, inward, offset + inset);
            }
            points
        };
        pieces.iter().map(part).collect()
    }

    /// Pairs of polygons that every line through one opening and a later one passes.
    fn beams(&self, s: usize, t: usize, inset: f64) -> Vec<[Vec<DVec3>; 2]> {
        let (a, b) = (&self.all[s], &self.all[t]);
        let height = |d: &super::dirs::Dir| (d.low + d.high) * 0.5;
        let targets = self.open_parts(t, inset);
        let mut out = Vec::new();
        for from in self.open_parts(s, inset) {
            for to in &targets {
                let from = cut(&from, -b.normal, -height(b));
                let to = cut(to, a.normal, height(a));
                if !from.is_empty() && !to.is_empty() {
                    out.push([from, to]);
                }
            }
        }
        out
    }
}

impl Search<'_> {
    /// Settles pairs of cells that only walls inside other cells can hide from each other: by a line, or by beams
    /// that sheets of triangles close. Near pairs first, as what they settle serves those beyond.
    /// Goes on while `on_round` says so.
    pub(super) fn settle_by_walls(
        &mut self,
        sheets: &Sheets<'_>,
        inset: f64,
        on_round: &mut dyn FnMut(u64, u64) -> bool,
    ) {
        let visible = self.visible();
        let n = self.dirs.n_cells;
        let mut pairs = Vec::new();
        for a in 0..n {
            let unseen: Vec<usize> = bits::ones(visible.row(a))
                .filter(|&b| b > a && !self.seen.get(a, b))
                .collect();
            if !unseen.is_empty() {
                let steps = self.steps_from(a);
                pairs.extend(unseen.into_iter().map(|b| (steps[b], a, b)));
            }
        }
        pairs.sort_unstable();
        for round in pairs.chunk_by(|x, y| x.0 == y.0) {
            if !on_round(1, 1) {
                return;
            }
            let found: Vec<Settled> = round
                .par_iter()
                .with_max_len(1)
                .map(|&(_, a, b)| self.settle_pair(sheets, inset, a, b))
                .collect();
            for Settled { closed, line } in found {
                for (s, t, tree) in closed {
                    self.might.clear(s, t);
                    let back = self.dirs.reverse[s] as usize;
                    self.might.clear(self.dirs.reverse[t] as usize, back);
                    self.closed.extend(tree.map(|tree| Closed {
                        from: s as u32,
                        to: t as u32,
                        tree,
                    }));
                }
                self.keep(line.into_iter().collect());
            }
            self.grow();
        }
    }

    /// Least number of openings between a cell and each other one.
    fn steps_from(&self, cell: usize) -> Vec<u32> {
        let mut steps = vec![u32::MAX; self.dirs.n_cells];
        let mut queue = std::collections::VecDeque::from([cell as u32]);
        steps[cell] = 0;
        while let Some(at) = queue.pop_front() {
            for d in self.dirs.exits(at) {
                let to = self.dirs.all[d].to;
                if steps[to as usize] == u32::MAX {
                    steps[to as usize] = steps[at as usize] + 1;
                    queue.push_back(to);
                }
            }
        }
        steps
    }

    fn settle_pair(&self, sheets: &Sheets<'_>, inset: f64, a: usize, b: usize) -> Settled {
        let dirs = self.dirs;
        let mut settled = Settled::default();
        if self.seen.get(a, b) {
            return settled;
        }
        let entries = dirs.entries(b as u32).iter();
        let exits = dirs.exits(a as u32);
        let both = exits.flat_map(|s| entries.clone().map(move |&t| (s, t as usize)));
        let mut open: Vec<_> = both.filter(|&(s, t)| self.might.get(s, t)).collect();
        for most in [FEW_BEAMS, MAX_BEAMS] {
            let mut left = Vec::new();
            for (s, t) in std::mem::take(&mut open) {
                let verdict = if self.follows_from_neighbors(s, t) {
                    Verdict::Closed(None)
                } else {
                    self.settle_openings(sheets, inset, (s, t), most)
                };
                match verdict {
                    Verdict::Closed(tree) => settled.closed.push((s, t, tree)),
                    Verdict::Line(line) => {
                        settled.line = Some(line);
                        return settled;
                    }
                    // The cells count as seeing each other, whatever the rest say.
                    Verdict::Unknown if most == MAX_BEAMS => return settled,
                    Verdict::Unknown => left.push((s, t)),
                }
            }
            open = left;
        }
        settled
    }

    /// Whether each way on after the first opening, or each way to the second, is known to be closed.
    fn follows_from_neighbors(&self, s: usize, t: usize) -> bool {
        let (dirs, might) = (self.dirs, &self.might);
        if dirs.all[t].from == dirs.all[s].to {
            return false;
        }
        dirs.after(s)
            .all(|q| q == dirs.reverse[s] as usize || !might.get(s, q) || !might.get(q, t))
            || dirs
                .entries(dirs.all[t].from)
                .iter()
                .map(|&p| p as usize)
                .all(|p| p == dirs.reverse[t] as usize || !might.get(s, p) || !might.get(p, t))
    }

    fn settle_openings(
        &self,
        sheets: &Sheets<'_>,
        inset: f64,
        (s, t): (usize, usize),
        most: usize,
    ) -> Verdict {
        let mut tree = Vec::new();
        let mut n_left = most;
        for ends in self.dirs.beams(s, t, inset) {
            match self.settle_beams(sheets, (s, t), ends, &mut n_left) {
                Ok(beams) => write_tree(&beams, 0, &mut tree),
                Err(verdict) => return verdict,
            }
        }
        Verdict::Closed(Some(tree))
    }

    /// Breadth first: lines of large beams are tried before those of small ones.
    fn settle_beams(
        &self,
        sheets: &Sheets<'_>,
        (s, t): (usize, usize),
        ends: [Vec<DVec3>; 2],
        n_left: &mut usize,
    ) -> Result<Vec<Beam>, Verdict> {
        let apart = APART * self.tolerance.rounding;
        let mut beams = vec![Beam {
            ends,
            what: Part::Open,
        }];
        let mut at = 0;
        while at < beams.len() {
            if *n_left == 0 {
                return Err(Verdict::Unknown);
            }
            *n_left -= 1;
            let beam = &beams[at];
            if beam.ends.iter().any(Vec::is_empty) {
                at += 1;
                continue;
            }
            let line = [inner_point(&beam.ends[0]), inner_point(&beam.ends[1])];
            let mut hits: Vec<(f64, u32)> = Vec::new();
            sheets
                .bvh
                .for_each_hit(&Ray::segment(line[0], line[1]), |hit| {
                    hits.push((hit.t, hit.triangle));
                });
            if hits.is_empty()
                && let Some(line) = self.free_line(s, t, line)
            {
                return Err(Verdict::Line(line));
            }
            hits.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let hull = Hull::new(beam, apart);
            let sheet = spread(hits.len()).find_map(|i| sheets.grown(hits[i].1, beam, &hull, line));
            beams[at].what = match sheet {
                Some(sheet) => Part::Sheet(sheet),
                None => {
                    let end = usize::from(size(&beams[at].ends[1]) > size(&beams[at].ends[0]));
                    let mut next = [None, None];
                    for (half, points) in next.iter_mut().zip(halves(&beams[at].ends[end])) {
                        // Nothing is left of a polygon as thin as rounding, and nothing leads through it.
                        let is_empty = points.is_empty();
                        if !is_empty && size(&points) < 1e3 * apart {
                            return Err(Verdict::Unknown);
                        }
                        let mut ends = beams[at].ends.clone();
                        ends[end] = points;
                        *half = Some(beams.len());
                        beams.push(Beam {
                            ends,
                            what: if is_empty {
                                Part::Sheet(Vec::new())
                            } else {
                                Part::Open
                            },
                        });
                    }
                    Part::Halves(end, next)
                }
            };
            at += 1;
        }
        Ok(beams)
    }

    fn free_line(&self, s: usize, t: usize, [from, to]: [DVec3; 2]) -> Option<Line> {
        let margin = self.tolerance.rounding * 16.0;
        let mut chain = vec![s as u32];
        let direction = to - from;
        walk(
            self.dirs,
            s,
            from,
            direction,
            margin,
            self.blocker,
            &mut chain,
        );
        chain.contains(&(t as u32)).then_some(Line {
            origin: from,
            direction,
            chain,
        })
    }
}

/// Some of so many places, the ends first.
fn spread(n: usize) -> impl Iterator<Item = usize> {
    let front = 0..n.min(MAX_SEEDS);
    front.map(move |i| if i % 2 == 0 { i / 2 } else { n - 1 - i / 2 })
}

fn write_tree(beams: &[Beam], at: usize, out: &mut Vec<u8>) {
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

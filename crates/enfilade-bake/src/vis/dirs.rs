//! The graph as the search wants it: each portal as two directions, numbered so that the directions into
//! one cell are neighbors.

use std::ops::Range;

use enfilade_cpg::SightGraph;
use enfilade_geom::DVec3;

use super::bits::BitTable;

/// A portal crossed one way.
#[derive(Clone, Debug)]
pub(super) struct Dir {
    pub(super) from: u32,
    pub(super) to: u32,
    /// Direction in [`SightGraph`]'s numbers.
    pub(super) id: u32,
    /// Unit normal, from `from` to `to`; zero where the winding has no area.
    pub(super) normal: DVec3,
    /// Least and greatest of `normal · p` over the winding, which is planar only up to rounding.
    pub(super) low: f64,
    pub(super) high: f64,
    /// Unit normal that the corners run counter-clockwise about: `normal` or its opposite.
    pub(super) turn: DVec3,
    pub(super) center: DVec3,
    pub(super) radius: f64,
    /// Corners in [`Dirs::points`], shared with the opposite direction.
    pub(super) corners: Range<u32>,
    /// The convex parts that are truly open, in [`Dirs::pieces`].
    pub(super) pieces: Range<u32>,
}

/// All directions.
#[derive(Debug)]
pub(super) struct Dirs {
    pub(super) n_cells: usize,
    pub(super) all: Vec<Dir>,
    /// The same portal the other way.
    pub(super) reverse: Vec<u32>,
    /// Directions into cell `c` are `into[c]..into[c + 1]`.
    pub(super) into: Vec<u32>,
    /// Corners of each piece, in `points`.
    pub(super) pieces: Vec<Range<u32>>,
    /// Corners of all windings and pieces.
    pub(super) points: Vec<DVec3>,
    /// By corner of `points`: the inward normal of the edge that starts there, and its offset.
    pub(super) edges: Vec<(DVec3, f64)>,
    /// Largest absolute coordinate, at least 1e-300. Errors are relative to it.
    pub(super) scale: f64,
}

impl Dirs {
    /// Takes time and memory linear in the corners, but for a sort of the portals.
    pub(super) fn new(graph: &SightGraph) -> Self {
        let mut points = Vec::new();
        let mut edges = Vec::new();
        let mut pieces = Vec::new();
        let mut all = Vec::with_capacity(graph.portals.len() * 2);
        for (i, portal) in graph.portals.iter().enumerate() {
            let turn = unit_normal(&portal.winding);
            let n = portal.winding.len();
            let mut add = |winding: &[DVec3]| {
                let start = points.len() as u32;
                for (k, &p) in winding.iter().enumerate() {
                    let next = winding[(k + 1) % winding.len()];
                    let inward = turn.cross(next - p).normalize_or_zero();
                    edges.push((inward, inward.dot(p)));
                    points.push(p);
                }
                start..points.len() as u32
            };
            let corners = add(&portal.winding);
            let first_piece = pieces.len() as u32;
            if portal.pieces.is_empty() {
                pieces.push(corners.clone());
            }
            pieces.extend(portal.pieces.iter().map(|piece| add(piece)));
            let center = portal.winding.iter().sum::<DVec3>() / n as f64;
            let radius = portal
                .winding
                .iter()
                .map(|p| p.distance(center))
                .fold(0.0, f64::max);
            for side in 0..2 {
                let normal = if side == 0 { turn } else { -turn };
                let heights = portal.winding.iter().map(|&p| normal.dot(p));
                all.push(Dir {
                    from: portal.cells[side],
                    to: portal.cells[1 - side],
                    id: (2 * i + side) as u32,
                    normal,
                    low: heights.clone().fold(f64::INFINITY, f64::min),
                    high: heights.fold(f64::NEG_INFINITY, f64::max),
                    turn,
                    center,
                    radius,
                    corners: corners.clone(),
                    pieces: first_piece..pieces.len() as u32,
                });
            }
        }
        all.sort_by_key(|dir| (dir.to, dir.id));
        let n_cells = graph.n_cells as usize;
        let mut into = vec![0u32; n_cells + 1];
        for dir in &all {
            into[dir.to as usize + 1] += 1;
        }
        for c in 0..n_cells {
            into[c + 1] += into[c];
        }
        let mut place = vec![0u32; all.len()];
        for (k, dir) in all.iter().enumerate() {
            place[dir.id as usize] = k as u32;
        }
        let reverse = all.iter().map(|dir| place[dir.id as usize ^ 1]).collect();
        let scale = points
            .iter()
            .map(|p: &DVec3| p.abs().max_element())
            .fold(1e-300, f64::max);
        Self {
            n_cells,
            all,
            reverse,
            into,
            pieces,
            points,
            edges,
            scale,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.all.len()
    }

    /// The directions into a cell.
    pub(super) fn entries(&self, cell: u32) -> Range<usize> {
        self.into[cell as usize] as usize..self.into[cell as usize + 1] as usize
    }

    /// The directions out of a cell.
    pub(super) fn exits(&self, cell: u32) -> &[u32] {
        &self.reverse[self.entries(cell)]
    }

    pub(super) fn winding(&self, dir: usize) -> &[DVec3] {
        let corners = &self.all[dir].corners;
        &self.points[corners.start as usize..corners.end as usize]
    }

    /// The set of directions that lead into the cells of a set.
    pub(super) fn entries_of(&self, cells: &[u64], out: &mut [u64]) {
        out.fill(0);
        for cell in super::bits::ones(cells) {
            let range = self.entries(cell as u32);
            super::bits::set_range(out, range.start, range.end);
        }
    }

    /// Whether a line can cross `first` and, farther on, `then`, by the sides of their planes alone.
    pub(super) fn may_follow(&self, first: usize, then: usize, clearance: f64) -> bool {
        let (a, b) = (&self.all[first], &self.all[then]);
        self.reaches_front(a, b, clearance) && self.reaches_back(b, a, clearance)
    }

    /// Whether `b` reaches in front of the plane of `a`.
    fn reaches_front(&self, a: &Dir, b: &Dir, clearance: f64) -> bool {
        let height = a.normal.dot(b.center) - a.low;
        if height > b.radius || height < -b.radius {
            return height > 0.0;
        }
        let reach = self.points[b.corners.start as usize..b.corners.end as usize]
            .iter()
            .map(|&p| a.normal.dot(p))
            .fold(f64::NEG_INFINITY, f64::max)
            - a.low;
        is_past(reach, a, b, clearance)
    }

    /// Whether `b` reaches behind the plane of `a`.
    fn reaches_back(&self, a: &Dir, b: &Dir, clearance: f64) -> bool {
        let height = a.normal.dot(b.center) - a.high;
        if height > b.radius || height < -b.radius {
            return height < 0.0;
        }
        let reach = self.points[b.corners.start as usize..b.corners.end as usize]
            .iter()
            .map(|&p| a.normal.dot(p))
            .fold(f64::INFINITY, f64::min);
        is_past(a.high - reach, a, b, clearance)
    }

    /// For each direction, those that a line through it might cross farther on.
    ///
    /// A flood over neighbors that lie on the right sides, made symmetric: `a` then `b` is the same
    /// question as `b` back then `a` back. Time: directions times directions reached.
    pub(super) fn might_see(&self, clearance: f64, far: Option<f64>) -> BitTable {
        use rayon::prelude::*;
        let n = self.len();
        let mut might = BitTable::new(n, n);
        let n_words = might.n_words().max(1);
        might
            .words_mut()
            .par_chunks_mut(n_words)
            .enumerate()
            .for_each_init(Vec::new, |stack, (first, row)| {
                self.flood(first, (clearance, far), row, stack);
            });
        self.make_symmetric(&mut might);
        might
    }

    /// Clears what is not seen both ways.
    pub(super) fn make_symmetric(&self, might: &mut BitTable) {
        for a in 0..self.len() {
            let back = self.reverse[a] as usize;
            let gone: Vec<usize> = super::bits::ones(might.row(a))
                .filter(|&b| !might.get(self.reverse[b] as usize, back))
                .collect();
            for b in gone {
                might.clear(a, b);
            }
        }
    }

    /// A line that leaves the first cell and ends beyond `next` crosses both openings: where the balls around
    /// them are farther apart than the far plane, no such line is short enough.
    fn is_near(&self, first: usize, next: usize, far: Option<f64>) -> bool {
        let (a, b) = (&self.all[first], &self.all[next]);
        far.is_none_or(|far| a.center.distance(b.center) - a.radius - b.radius <= far)
    }

    fn flood(
        &self,
        first: usize,
        (clearance, far): (f64, Option<f64>),
        row: &mut [u64],
        stack: &mut Vec<u32>,
    ) {
        stack.push(first as u32);
        while let Some(at) = stack.pop() {
            for &next in self.exits(self.all[at as usize].to) {
                // A line crosses a plane once, so never an opening twice.
                if next != self.reverse[at as usize]
                    && next as usize != first
                    && next != self.reverse[first]
                    && !super::bits::get(row, next as usize)
                    && self.is_near(first, next as usize, far)
                    && self.may_follow(first, next as usize, clearance)
                {
                    super::bits::set(row, next as usize);
                    stack.push(next);
                }
            }
        }
    }
}

/// Whether an opening that reaches this far past the plane of `a` lets lines with clearance through.
fn is_past(reach: f64, a: &Dir, b: &Dir, clearance: f64) -> bool {
    reach > clearance
        || (reach > 0.0 && reach > clearance * sine(a.normal, b.turn))
        || a.normal == DVec3::ZERO
}

/// Sine of the angle between two planes with unit normals.
pub(super) fn sine(a: DVec3, b: DVec3) -> f64 {
    let cosine = a.dot(b);
    (1.0 - cosine * cosine).max(0.0).sqrt()
}

/// Unit normal that the corners run counter-clockwise about, by Newell's sum; zero where their area is lost
/// in rounding.
fn unit_normal(winding: &[DVec3]) -> DVec3 {
    let o = winding[0];
    let sum: DVec3 = winding.windows(2).map(|e| (e[0] - o).cross(e[1] - o)).sum();
    let reach = winding
        .iter()
        .map(|p| p.distance_squared(o))
        .fold(0.0, f64::max);
    if sum.length() > 1e-12 * reach {
        sum.normalize_or_zero()
    } else {
        DVec3::ZERO
    }
}

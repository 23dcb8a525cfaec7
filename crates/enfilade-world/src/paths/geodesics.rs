//! Shortest paths through the air of a concave cell, where a wall may be between two points.
//!
//! A graph of points that see each other: [`Corner`]s at convex edges of the cell's walls, and the points of its portals. All
//! lengths between `Corner`s are found once (Floyd, "Algorithm 97: shortest path", 1962); a query takes the best path over those
//! that its ends see. A path may bend at any point of an edge, while `Corner`s are a meter apart: the bends of the path slide
//! along their edges to where it is shortest, one after another, by unfolding the edge (Sharir & Schorr 1986). Walls are the
//! structure of the cell, its portals are closed: paths stay inside. Furniture is ignored.
//!
//! Lengths are those of true paths, never less than the shortest; after sliding, within a thousandth of it about sharp edges, and
//! less exact about round surfaces. `O(n³)` for `n` `Corner`s, once; a query costs a line of sight for each `Corner` of the cell.

use enfilade_cpg::{CellId, World};
use enfilade_geom::{Bvh, DVec3, Triangle};

use crate::layout::{Layout, Opening};
use crate::paths::edges::{Corner, corners as corners_of};
use crate::paths::ways::Ways;
use crate::space::{PartId, Space};

/// Distance between points along an edge. [Units: wu]
const SPACING: f64 = 1.0;
/// Greatest distance, for cells with too many. [Units: wu]
const SPARSEST: f64 = 4.0;
/// Maximum number of `Corner`s of a cell; beyond, some of those near to others are left out.
const MAX_CORNERS: usize = 1024;
/// `Corner`s nearer to each other than this are merged at first. [Units: wu]
const NEAR: f64 = 0.05;
/// Maximum number of points of a cell's portals; with more, as about a tower of a thousand windows, lines stay straight.
const MAX_POINTS: usize = 2048;
/// Distance of points from walls and portals. [Units: wu]
const OFF: f64 = 1e-3;
/// Number of times that each bend of a path slides.
const SLIDES: usize = 24;

/// Path graphs of the concave cells of a part. Made once.
#[derive(Clone, Debug)]
pub struct Geodesics {
    /// Per cell; `None` where lines between any two points stay in the air, or are assumed to.
    cells: Vec<Option<Concave>>,
    off: f64,
}

/// Lines of sight from both ends of a query, kept for the next one with the same end.
#[derive(Clone, Debug, Default)]
pub(crate) struct Seen {
    /// `Corner`s, ascending by the least length over them.
    order: Vec<(f64, u32)>,
    ends: [View; 2],
}

/// Lengths from a point to the `Corner`s of its cell: infinite where a wall is between, NaN where that is not known yet.
#[derive(Clone, Debug, Default)]
struct View {
    from: Option<(CellId, DVec3)>,
    lengths: Vec<f64>,
}

/// The first and the last `Corner` of the shortest path found, by index.
struct BestBends {
    length: f64,
    first: usize,
    last: usize,
}

impl View {
    fn begin(&mut self, cell: CellId, at: DVec3, n: usize) {
        if self.from != Some((cell, at)) || self.lengths.len() != n {
            self.from = Some((cell, at));
            self.lengths.clear();
            self.lengths.resize(n, f64::NAN);
        }
    }

    fn length(&mut self, concave: &Concave, at: DVec3, corner: usize) -> f64 {
        let length = &mut self.lengths[corner];
        if length.is_nan() {
            *length = concave.straight(at, concave.corners[corner].at);
        }
        *length
    }
}

#[derive(Clone, Debug)]
struct Concave {
    /// Walls and portals.
    walls: Bvh,
    corners: Vec<Corner>,
    /// Lengths between `Corner`s, row by row.
    lengths: Vec<f32>,
    /// The next `Corner` on the path.
    next: Vec<u16>,
    /// The points of its portals, moved off these.
    points: Vec<DVec3>,
    /// Per point, its length to each `Corner`.
    of_points: Vec<f32>,
}

impl Geodesics {
    /// Prepares a part, for the points of its `ways` in its own frame, and stores the lengths between them in all concave cells there. Takes
    /// milliseconds for a cell with tens of `Corner`s, a second for one with hundreds.
    ///
    /// # Panics
    ///
    /// If there is no such part.
    #[must_use]
    pub fn new(space: &Space, part: PartId, ways: &mut Ways) -> Self {
        let (layout, world) = (space.layout(part), space.world(part));
        let off = OFF.max(8.0 * layout.tolerance());
        let mut cells = Vec::new();
        for cell in (0..layout.n_cells() as u32).map(CellId) {
            let concave = Concave::new(layout, world, ways, cell, off);
            if let Some(concave) = &concave {
                ways.set_lengths(cell, concave.between_points());
            }
            cells.push(concave);
        }
        Self { cells, off }
    }

    /// Returns `true` if lines between points of a cell may meet its walls, and paths around them are known; `false` for a cell
    /// with more than 2,048 points.
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    #[must_use]
    #[doc(hidden)]
    pub fn is_concave(&self, cell: CellId) -> bool {
        self.cells[cell.idx()].is_some()
    }

    /// Writes the lengths from a point in a cell to the [points of its portals](Ways::points_of), for
    /// [`LengthSearch::run_from`](crate::LengthSearch::run_from) and
    /// [`arrivals_by`](crate::LengthSearch::arrivals_by). Clears `lengths` first; infinite where no path was found. [Units: wu]
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    pub fn lengths_from(&self, ways: &Ways, cell: CellId, p: DVec3, lengths: &mut Vec<f64>) {
        lengths.clear();
        let Some(concave) = &self.cells[cell.idx()] else {
            lengths.extend(ways.points_of(cell).map(|(_, q)| p.distance(q)));
            return;
        };
        let direct = concave.points.iter().map(|&q| concave.straight(p, q));
        lengths.extend(direct);
        let n = concave.corners.len();
        for (c, corner) in concave.corners.iter().enumerate() {
            let first = concave.straight(p, corner.at);
            if first < f64::INFINITY {
                for (k, length) in lengths.iter_mut().enumerate() {
                    *length = length.min(first + f64::from(concave.of_points[k * n + c]));
                }
            }
        }
    }

    /// Returns the length of the shortest path between two points of a cell, and writes its bends to `bends` (cleared first),
    /// each with its edge; `None` if no path was found. Points on walls and portals see nothing: move them
    /// [a little](Self::off) into the cell. [Units: wu]
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    pub fn way(
        &self,
        cell: CellId,
        [from, to]: [DVec3; 2],
        bends: &mut Vec<Corner>,
    ) -> Option<f64> {
        self.way_with(cell, [from, to], &mut Seen::default(), bends)
    }

    /// As [`Geodesics::way`], with a reusable buffer.
    pub(crate) fn way_with(
        &self,
        cell: CellId,
        [from, to]: [DVec3; 2],
        seen: &mut Seen,
        bends: &mut Vec<Corner>,
    ) -> Option<f64> {
        bends.clear();
        let Some(concave) = &self.cells[cell.idx()] else {
            return Some(from.distance(to));
        };
        if concave.straight(from, to) < f64::INFINITY {
            return Some(from.distance(to));
        }
        seen.ends[0].begin(cell, from, concave.corners.len());
        seen.ends[1].begin(cell, to, concave.corners.len());
        concave.bend(from, to, seen, bends)?;
        concave.slide(from, to, bends);
        let ends = bends.iter().map(|b| b.at).chain([to]);
        let (length, _) = ends.fold((0.0, from), |(sum, at), p| (sum + at.distance(p), p));
        Some(length)
    }

    /// Returns the distance by which points are moved off walls and portals. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn off(&self) -> f64 {
        self.off
    }
}

impl Concave {
    /// `None` for a cell without `Corner`s, or with too many points.
    fn new(layout: &Layout, world: &World, ways: &Ways, cell: CellId, off: f64) -> Option<Self> {
        if ways.points_of(cell).count() > MAX_POINTS {
            return None;
        }
        let batches = world.batches_of(cell);
        let mut walls: Vec<Triangle> = batches.flat_map(|b| b.primitive.triangles()).collect();
        // Rather fewer points of each edge, along which bends slide, than fewer edges.
        let mut spacing = SPACING;
        let mut corners = corners_of(layout, cell, &walls, spacing, off);
        while corners.len() > MAX_CORNERS && spacing < SPARSEST {
            spacing *= 2.0;
            corners = corners_of(layout, cell, &walls, spacing, off);
        }
        if corners.is_empty() {
            return None;
        }
        thin_out(&mut corners);
        for exit in layout.exits(cell) {
            for piece in layout.opening(exit.portal).pieces() {
                let fan = piece.windows(2).skip(1);
                walls.extend(fan.map(|w| [piece[0], w[0], w[1]]));
            }
        }
        let points = ways
            .points_of(cell)
            .map(|(portal, p)| into_cell(&layout.opening(portal), cell, p, off));
        let mut concave = Self {
            walls: Bvh::build(&walls),
            points: points.collect(),
            lengths: Vec::new(),
            next: Vec::new(),
            of_points: Vec::new(),
            corners,
        };
        concave.fill();
        Some(concave)
    }

    /// Returns the length of the line between two points; infinite if a wall is between them.
    fn straight(&self, a: DVec3, b: DVec3) -> f64 {
        if self.walls.any_hit(a, b, |_| false) {
            f64::INFINITY
        } else {
            a.distance(b)
        }
    }

    /// Finds all lengths.
    fn fill(&mut self) {
        let n = self.corners.len();
        self.lengths = vec![f32::INFINITY; n * n];
        self.next = (0..n * n).map(|i| (i % n) as u16).collect();
        for i in 0..n {
            self.lengths[i * n + i] = 0.0;
            for j in 0..i {
                let length = self.straight(self.corners[i].at, self.corners[j].at) as f32;
                self.lengths[i * n + j] = length;
                self.lengths[j * n + i] = length;
            }
        }
        let mut onward = Vec::new();
        for via in 0..n {
            onward.clear();
            onward.extend_from_slice(&self.lengths[via * n..][..n]);
            let rows = self.lengths.chunks_exact_mut(n);
            for (row, next) in rows.zip(self.next.chunks_exact_mut(n)) {
                let (first, step) = (row[via], next[via]);
                if first == f32::INFINITY || first == 0.0 {
                    continue;
                }
                for ((length, next), rest) in row.iter_mut().zip(next).zip(&onward) {
                    let through = first + rest;
                    let is_less = through < *length;
                    *length = if is_less { through } else { *length };
                    *next = if is_less { step } else { *next };
                }
            }
        }
        for k in 0..self.points.len() {
            let mut row = vec![f32::INFINITY; n];
            for (s, corner) in self.corners.iter().enumerate() {
                let first = self.straight(self.points[k], corner.at) as f32;
                if first < f32::INFINITY {
                    let onward = &self.lengths[s * n..][..n];
                    for (least, rest) in row.iter_mut().zip(onward) {
                        *least = least.min(first + rest);
                    }
                }
            }
            self.of_points.extend(row);
        }
    }

    /// Returns the lengths between the points of its portals.
    fn between_points(&self) -> Vec<f64> {
        let (n, n_points) = (self.corners.len(), self.points.len());
        let mut lengths = vec![0.0; n_points * n_points];
        for i in 0..n_points {
            for j in 0..i {
                let mut least = self.straight(self.points[i], self.points[j]);
                if least == f64::INFINITY {
                    let [a, b] = [i, j].map(|k| &self.of_points[k * n..][..n]);
                    // From one point to a `Corner` by its path, and from there to the other by its own.
                    let through = a.iter().zip(b).map(|(x, y)| x + y);
                    least = f64::from(through.fold(f32::INFINITY, f32::min));
                }
                lengths[i * n_points + j] = least;
                lengths[j * n_points + i] = least;
            }
        }
        lengths
    }

    /// Finds the `Corner`s of the shortest path through any.
    fn bend(&self, from: DVec3, to: DVec3, seen: &mut Seen, bends: &mut Vec<Corner>) -> Option<()> {
        let n = self.corners.len();
        let mut best = BestBends {
            length: f64::INFINITY,
            first: 0,
            last: 0,
        };
        let Seen { order, ends } = seen;
        let [first, last] = ends;
        // In ellipses about both ends, from narrow to wide: what is outside makes the path longer than what is found.
        for share in [1.05, 1.2, 1.6, f64::INFINITY] {
            let widest = share * from.distance(to);
            order.clear();
            let corners = self.corners.iter().enumerate();
            let least = corners.map(|(i, c)| (from.distance(c.at) + c.at.distance(to), i as u32));
            order.extend(least.filter(|l| l.0 < widest.min(best.length)));
            order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            self.bend_within(from, to, order, [first, last], &mut best);
            if best.length <= widest {
                break;
            }
        }
        let BestBends {
            length,
            first: mut at,
            last: end,
        } = best;
        if length == f64::INFINITY {
            return None;
        }
        bends.push(self.corners[at]);
        while at != end {
            at = usize::from(self.next[at * n + end]);
            bends.push(self.corners[at]);
        }
        Some(())
    }

    /// Finds the first and the last `Corner` of the shortest path over some `Corner`s, given with the least length over each,
    /// ascending.
    fn bend_within(
        &self,
        from: DVec3,
        to: DVec3,
        corners: &[(f64, u32)],
        [first, last]: [&mut View; 2],
        best: &mut BestBends,
    ) {
        let n = self.corners.len();
        for &(least, i) in corners {
            if least >= best.length {
                break;
            }
            let i = i as usize;
            let start = first.length(self, from, i);
            if start == f64::INFINITY {
                continue;
            }
            let row = &self.lengths[i * n..][..n];
            for &(_, j) in corners {
                let j = j as usize;
                // Most are too long without what is left.
                let most = start + f64::from(row[j]);
                if most >= best.length || most + self.corners[j].at.distance(to) >= best.length {
                    continue;
                }
                let whole = most + last.length(self, to, j);
                if whole < best.length {
                    *best = BestBends {
                        length: whole,
                        first: i,
                        last: j,
                    };
                }
            }
        }
    }

    /// Slides bends along their edges to where the path is shortest, while no wall gets in between.
    fn slide(&self, from: DVec3, to: DVec3, bends: &mut [Corner]) {
        for _ in 0..SLIDES {
            let mut moved = 0.0_f64;
            for i in 0..bends.len() {
                let before = i.checked_sub(1).map_or(from, |k| bends[k].at);
                let after = bends.get(i + 1).map_or(to, |b| b.at);
                let at = shortest_about(bends[i].edge, before, after);
                let is_free = self.straight(before, at) < f64::INFINITY
                    && self.straight(at, after) < f64::INFINITY;
                if is_free {
                    moved = moved.max(at.distance(bends[i].at));
                    bends[i].at = at;
                }
            }
            if moved < 1e-5 {
                break;
            }
        }
    }
}

/// Returns the point of a segment with the least sum of lengths to two points: rotate one about the segment's line until both are
/// coplanar, on opposite sides; the line between them crosses there.
fn shortest_about([a, b]: [DVec3; 2], p: DVec3, q: DVec3) -> DVec3 {
    let length = a.distance(b);
    let d = (b - a).normalize_or_zero();
    let along = |x: DVec3| (x - a).dot(d);
    let away = |x: DVec3| (x - a - d * along(x)).length();
    let (h, g) = (away(p), away(q));
    let t = (along(p) * g + along(q) * h) / (h + g).max(1e-12);
    a + d * t.clamp(0.0, length)
}

/// Moves a point of an opening a little into a cell and off the walls at its edges.
pub(crate) fn into_cell(opening: &Opening<'_>, cell: CellId, p: DVec3, off: f64) -> DVec3 {
    let side = if opening.cells()[1] == cell {
        1.0
    } else {
        -1.0
    };
    // Away from the edges of its own piece: the common middle may lie in a wall between two.
    let holds = |piece: &&[DVec3]| {
        let edges = (0..piece.len()).map(|i| (piece[i], piece[(i + 1) % piece.len()]));
        let depths = edges.map(|(a, b)| {
            let inward = opening.normal().cross(b - a).normalize_or_zero();
            inward.dot(p - a)
        });
        depths.fold(f64::INFINITY, f64::min) >= -0.1 * off
    };
    let piece = opening.pieces().find(holds).unwrap_or(&[]);
    let middle = piece.iter().sum::<DVec3>() / piece.len().max(1) as f64;
    let inward = if piece.is_empty() {
        DVec3::ZERO
    } else {
        middle - p
    };
    p + opening.normal() * side * off + inward.clamp_length_max(off)
}

/// Leaves out `Corner`s near to others until there are few enough.
fn thin_out(corners: &mut Vec<Corner>) {
    let mut near = NEAR;
    loop {
        let mut kept: Vec<Corner> = Vec::new();
        for c in &*corners {
            if kept.iter().all(|k| k.at.distance(c.at) > near) {
                kept.push(*c);
            }
            if kept.len() > MAX_CORNERS {
                break;
            }
        }
        if kept.len() <= MAX_CORNERS {
            *corners = kept;
            return;
        }
        near *= 1.5;
    }
}

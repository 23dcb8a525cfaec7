//! Shortest ways through the air of a concave cell, where a wall of it may be between two points.
//!
//! A graph of the points that see each other: [corners](Corner) at the edges of the cell's walls, and the points of its portals. All
//! lengths between corners are found once (Floyd, "Algorithm 97: shortest path", 1962); a way is then the best over the corners that its
//! ends see. A way may bend at any point of an edge, and corners are a meter apart: the bends of a way that was found slide along
//! their edges to where it is shortest, each in turn, by unfolding the edge (Sharir & Schorr 1986). Walls are the structure of the cell,
//! its portals are closed: ways stay within. Furniture is not considered.
//!
//! Lengths are those of true ways, never less than the shortest; slid, within a thousandth of it in rooms with corners, and farther off
//! about what is round. `O(n³)` for `n` corners, once; a question costs a line of sight for each corner of the cell.

use enfilade_cpg::{CellId, World};
use enfilade_geom::scene::Primitive;
use enfilade_geom::{Bvh, DVec3, Triangle, Winding};

use crate::edges::{Corner, corners};
use crate::layout::{Layout, Opening};
use crate::search::Ways;

/// Between points along an edge. [Units: wu]
const SPACING: f64 = 1.0;
/// Corners of a cell, at most: beyond, some of those near to others are left out.
const MAX_CORNERS: usize = 256;
/// Corners this near to each other are one at first. [Units: wu]
const NEAR: f64 = 0.05;
/// Points of a cell's portals, at most: with more, as about a tower of a thousand windows, lines stay straight.
const MAX_POINTS: usize = 2048;
/// How far points lie off walls and portals. [Units: wu]
const OFF: f64 = 1e-3;
/// Times that each bend of a way slides.
const SLIDES: usize = 24;

/// What is known of the concave cells of a world. Made once.
#[derive(Clone, Debug)]
pub struct Geodesics {
    /// By cell; `None` where lines between any two points stay in the air, or are taken to.
    cells: Vec<Option<Concave>>,
    off: f64,
}

#[derive(Clone, Debug)]
struct Concave {
    /// Walls and portals.
    walls: Bvh,
    corners: Vec<Corner>,
    /// From corner to corner, row by row.
    lengths: Vec<f32>,
    /// The next corner on the way.
    next: Vec<u16>,
    /// The points of its portals, off these.
    points: Vec<DVec3>,
    /// By point, its length to each corner.
    of_points: Vec<f32>,
}

impl Geodesics {
    /// Of a world, for the points of `ways`, which is given the lengths between them in all concave cells. Milliseconds for a cell with
    /// tens of corners, a second for one with hundreds.
    #[must_use]
    pub fn new(layout: &Layout, world: &World, ways: &mut Ways) -> Self {
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

    /// Whether lines between points of a cell may meet its walls, and ways around them are known: not in a cell with more than 2,048 points.
    ///
    /// # Panics
    ///
    /// When there is no such cell.
    #[must_use]
    pub fn is_concave(&self, cell: CellId) -> bool {
        self.cells[cell.idx()].is_some()
    }

    /// The lengths from a point in a cell to the [points of its portals](Ways::points_of), for
    /// [`LengthSearch::run_from`](crate::LengthSearch::run_from) and
    /// [`arrivals_by`](crate::LengthSearch::arrivals_by). `lengths` is cleared; infinite where no way was found. [Units: wu]
    ///
    /// # Panics
    ///
    /// When there is no such cell.
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

    /// The shortest way between two points of a cell: its length, and in `bends`, which is cleared, where it bends, each with the edge
    /// that it bends about; `None` where none was found. A point on a portal is taken a little into the cell. [Units: wu]
    ///
    /// # Panics
    ///
    /// When there is no such cell.
    pub fn way(
        &self,
        cell: CellId,
        [from, to]: [DVec3; 2],
        bends: &mut Vec<Corner>,
    ) -> Option<f64> {
        bends.clear();
        let Some(concave) = &self.cells[cell.idx()] else {
            return Some(from.distance(to));
        };
        if concave.straight(from, to) < f64::INFINITY {
            return Some(from.distance(to));
        }
        concave.bend(from, to, bends)?;
        concave.slide(from, to, bends);
        let ends = bends.iter().map(|b| b.at).chain([to]);
        let (length, _) = ends.fold((0.0, from), |(sum, at), p| (sum + at.distance(p), p));
        Some(length)
    }

    /// How far points are taken off walls and portals. [Units: wu]
    #[must_use]
    pub fn off(&self) -> f64 {
        self.off
    }
}

impl Concave {
    /// `None` for a cell without corners, or with too many points.
    fn new(layout: &Layout, world: &World, ways: &Ways, cell: CellId, off: f64) -> Option<Self> {
        if ways.points_of(cell).count() > MAX_POINTS {
            return None;
        }
        let batches = world.batches_of(cell);
        let mut walls: Vec<Triangle> = batches.flat_map(|b| triangles(&b.primitive)).collect();
        let mut corners = corners(layout, cell, &walls, SPACING, off);
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

    /// The length of the line between two points; infinite where a wall is between them.
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
        for via in 0..n {
            for i in 0..n {
                let first = self.lengths[i * n + via];
                if first == f32::INFINITY || i == via {
                    continue;
                }
                for j in 0..n {
                    let through = first + self.lengths[via * n + j];
                    if through < self.lengths[i * n + j] {
                        self.lengths[i * n + j] = through;
                        self.next[i * n + j] = self.next[i * n + via];
                    }
                }
            }
        }
        for k in 0..self.points.len() {
            let seen: Vec<f32> = (self.corners.iter())
                .map(|c| self.straight(self.points[k], c.at) as f32)
                .collect();
            let least = (0..n).map(|c| {
                let through = (0..n).map(|s| seen[s] + self.lengths[s * n + c]);
                through.fold(f32::INFINITY, f32::min)
            });
            let row: Vec<f32> = least.collect();
            self.of_points.extend(row);
        }
    }

    /// Lengths between the points of its portals.
    fn between_points(&self) -> Vec<f64> {
        let (n, n_points) = (self.corners.len(), self.points.len());
        let mut lengths = vec![0.0; n_points * n_points];
        for i in 0..n_points {
            for j in 0..i {
                let mut least = self.straight(self.points[i], self.points[j]);
                if least == f64::INFINITY {
                    let [a, b] = [i, j].map(|k| &self.of_points[k * n..][..n]);
                    // From one point to a corner by its way, and from there to the other by its own.
                    let through = a.iter().zip(b).map(|(x, y)| x + y);
                    least = f64::from(through.fold(f32::INFINITY, f32::min));
                }
                lengths[i * n_points + j] = least;
                lengths[j * n_points + i] = least;
            }
        }
        lengths
    }

    /// The corners of the shortest way by them.
    fn bend(&self, from: DVec3, to: DVec3, bends: &mut Vec<Corner>) -> Option<()> {
        let n = self.corners.len();
        let mut best = (f64::INFINITY, 0, 0);
        // What is farther than the best by the line alone needs no line of sight.
        for (i, a) in self.corners.iter().enumerate() {
            if from.distance(a.at) + a.at.distance(to) >= best.0 {
                continue;
            }
            let first = self.straight(from, a.at);
            for (j, b) in self.corners.iter().enumerate() {
                let most = first + f64::from(self.lengths[i * n + j]) + b.at.distance(to);
                if most < best.0 && self.straight(b.at, to) < f64::INFINITY {
                    best = (most, i, j);
                }
            }
        }
        let (length, mut at, end) = best;
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

    /// Slides bends along their edges to where the way is shortest, as long as nothing gets between.
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

/// The point of a segment with the least sum of lengths to two points: with one turned about the segment's line until both are in
/// one plane, on either side, that of the line between them.
fn shortest_about([a, b]: [DVec3; 2], p: DVec3, q: DVec3) -> DVec3 {
    let length = a.distance(b);
    let d = (b - a).normalize_or_zero();
    let along = |x: DVec3| (x - a).dot(d);
    let away = |x: DVec3| (x - a - d * along(x)).length();
    let (h, g) = (away(p), away(q));
    let t = (along(p) * g + along(q) * h) / (h + g).max(1e-12);
    a + d * t.clamp(0.0, length)
}

/// A point of an opening, taken a little into a cell and off the walls at its edges.
fn into_cell(opening: &Opening<'_>, cell: CellId, p: DVec3, off: f64) -> DVec3 {
    let side = if opening.cells()[1] == cell {
        1.0
    } else {
        -1.0
    };
    // Away from the edges of its own piece: the middle of all may lie in a wall between two.
    let holds = |piece: &&[DVec3]| Winding::new(piece.to_vec()).contains_in_plane(p, 0.1 * off);
    let piece = opening.pieces().find(holds).unwrap_or(&[]);
    let middle = piece.iter().sum::<DVec3>() / piece.len().max(1) as f64;
    let inward = if piece.is_empty() {
        DVec3::ZERO
    } else {
        middle - p
    };
    p + opening.normal() * side * off + inward.clamp_length_max(off)
}

/// Leaves out corners near to others, until there are not too many.
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

fn triangles(primitive: &Primitive) -> impl Iterator<Item = Triangle> {
    let corner = |i: u32| {
        let p = primitive.positions[i as usize];
        DVec3::from_array(p.map(f64::from))
    };
    (primitive.indices.chunks_exact(3)).map(move |t| [corner(t[0]), corner(t[1]), corner(t[2])])
}

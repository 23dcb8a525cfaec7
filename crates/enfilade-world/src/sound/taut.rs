//! The shortest string from a point through a sequence of openings to a point.
//!
//! Minimizes `Σ |xᵢ₊₁ − xᵢ|` with each `xᵢ` in its opening: a convex problem if openings are convex (a second-order cone program;
//! Lobo, Vandenberghe, Boyd & Lebret, "Applications of second-order cone programming", 1998, §2). Three methods take turns:
//!
//! 1. *Sweeps*: each point moves to its best place between its neighbors, which has a closed form: reflection at the plane, then
//!    unfolding about an edge. They find the edges and vertices at which points are caught.
//! 2. *Newton's method* on the faces found, a block tridiagonal system of 2 × 2 blocks: a few steps where sweeps would need
//!    hundreds.
//! 3. Where points of neighboring openings coincide, and both stall, an *interior-point method* with logarithmic barriers
//!    (Boyd & Vandenberghe, "Convex Optimization", 2004, §11.3) and lengths smoothed at zero: its gap shrinks by a constant
//!    factor per step, whatever the openings.
//!
//! All end by the same test. For any vectors `uᵢ` of length 1 or less, one per leg, `uₙ·b − u₀·a + Σᵢ min over opening i of
//! (uᵢ₋₁ − uᵢ)·x` is at most the length of any string (the dual problem): with the legs' directions for `u` it equals the
//! string's length at the optimum, and elsewhere its distance from that length bounds the error. O(vertices) per step.
//!
//! Numerically: legs of zero length have no direction, so these end with step 3; slivers of openings have ill-conditioned
//! barriers, so a step that does not shorten is rejected.

use enfilade_geom::DVec3;

use crate::sound::blocks::{Block, solve};
use crate::sound::pieces::{add_barrier, barrier, best_place, middle, plane_axes, room};

/// Relative gap between the length and its lower bound that ends the search.
const GAP: f64 = 1e-9;
/// Rounds of sweeps and Newton before the interior-point method.
const ROUNDS: usize = 12;
/// Maximum number of steps of the interior-point method.
const STEPS: usize = 200;

/// A string pulled taut, with reusable buffers: allocates nothing once they have grown.
#[derive(Clone, Debug, Default)]
pub struct TautString {
    /// Both ends, and a point in each opening between.
    points: Vec<DVec3>,
    next: Vec<DVec3>,
    kept: Vec<DVec3>,
    /// Per inner point, the directions in which it may move: zero vectors if it may not.
    axes: Vec<[DVec3; 2]>,
    blocks: Vec<Block>,
    pieces: Vec<u32>,
    directions: Vec<DVec3>,
    length: f64,
    bound: f64,
    /// A lower bound of the length through the pieces passed.
    own_bound: f64,
}

impl TautString {
    /// Makes it without buffers.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Pulls the string taut from `from` through `n` openings to `to`, and returns its length. `pieces(i)` returns the convex
    /// planar polygons of opening `i`, at least one, each with an area, or an edge of two points. [Units: wu]
    ///
    /// Starts at the middles of openings; O(vertices) per step, about ten steps, rarely a hundred. If the pieces of an opening
    /// together are not convex, the result is a local optimum, and [`TautString::bound`] is that of its hull.
    pub fn pull<'a, I>(
        &mut self,
        from: DVec3,
        to: DVec3,
        n: usize,
        pieces: impl Fn(usize) -> I,
    ) -> f64
    where
        I: Iterator<Item = &'a [DVec3]>,
    {
        self.points.clear();
        self.points.push(from);
        for i in 0..n {
            let first = pieces(i).next().unwrap_or_default();
            self.points.push(middle(first));
        }
        self.points.push(to);
        self.tighten(pieces)
    }

    /// As [`TautString::pull`], from a string near the shortest: `start(i)` is a point near opening `i`.
    pub fn pull_from<'a, I>(
        &mut self,
        from: DVec3,
        to: DVec3,
        start: impl ExactSizeIterator<Item = DVec3>,
        pieces: impl Fn(usize) -> I,
    ) -> f64
    where
        I: Iterator<Item = &'a [DVec3]>,
    {
        self.points.clear();
        self.points.push(from);
        self.points.extend(start);
        self.points.push(to);
        self.tighten(pieces)
    }

    /// Returns both ends, and a point in each opening between them. [Units: wu]
    #[must_use]
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Returns the length of the string. [Units: wu]
    #[must_use]
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Returns a lower bound of the length of any string through these openings. [Units: wu]
    #[must_use]
    pub fn bound(&self) -> f64 {
        self.bound
    }

    /// Returns the unit vector in which the string leaves its start, towards the first distinct point; zero if there is none.
    #[must_use]
    pub fn departure(&self) -> DVec3 {
        let from = self.points.first().copied().unwrap_or_default();
        away(from, self.points.iter().copied(), self.length)
    }

    /// Returns the unit vector from the end back along the string, towards the last distinct point; zero if there is none.
    #[must_use]
    pub fn arrival(&self) -> DVec3 {
        let to = self.points.last().copied().unwrap_or_default();
        away(to, self.points.iter().rev().copied(), self.length)
    }

    fn tighten<'a, I>(&mut self, pieces: impl Fn(usize) -> I) -> f64
    where
        I: Iterator<Item = &'a [DVec3]>,
    {
        let n = self.points.len() - 2;
        self.axes.clear();
        self.axes.resize(n, [DVec3::ZERO; 2]);
        self.blocks.clear();
        self.blocks.resize(n, Block::default());
        self.pieces.clear();
        self.pieces.resize(n, 0);
        self.next.clear();
        self.next.reserve(n + 2);
        self.directions.clear();
        self.directions.reserve(n + 1);
        (self.bound, self.own_bound) = (0.0, 0.0);
        // From the first sweep on, points are in their openings.
        for _ in 0..ROUNDS {
            self.sweep(n, &pieces, false);
            if self.is_short(&pieces) {
                return self.length;
            }
            self.newton(&pieces);
        }
        let before = self.length;
        self.kept.clone_from(&self.points);
        self.interior(&pieces);
        for _ in 0..2 {
            self.sweep(n, &pieces, true);
        }
        if !self.is_short(&pieces) && self.length > before {
            // Through pieces that are not the best, or past edges, which it leaves where they were.
            self.points.clone_from(&self.kept);
            self.sweep(n, &pieces, true);
            self.is_short(&pieces);
        }
        self.length
    }

    /// Moves each point to its best place between its neighbors; forth, and back if `both`.
    fn sweep<'a, I>(&mut self, n: usize, pieces: &impl Fn(usize) -> I, both: bool)
    where
        I: Iterator<Item = &'a [DVec3]>,
    {
        let back = (0..n.saturating_sub(1))
            .rev()
            .take(if both { n } else { 0 });
        for i in (0..n).chain(back) {
            let (a, b) = (self.points[i], self.points[i + 2]);
            let mut least = f64::INFINITY;
            for (k, piece) in pieces(i).enumerate() {
                let (place, axes) = best_place(a, b, piece);
                let length = place.distance(a) + place.distance(b);
                if length < least {
                    least = length;
                    self.points[i + 1] = place;
                    self.axes[i] = axes;
                    self.pieces[i] = k as u32;
                }
            }
        }
    }

    /// Returns `true` if the string is the shortest up to the gap; sets length and bound.
    fn is_short<'a, I>(&mut self, pieces: &impl Fn(usize) -> I) -> bool
    where
        I: Iterator<Item = &'a [DVec3]>,
    {
        self.length = 0.0;
        self.directions.clear();
        for p in self.points.windows(2) {
            let leg = p[1] - p[0];
            let length = leg.length();
            self.length += length;
            self.directions.push(leg / length.max(1e-300));
        }
        self.own_bound = 0.0;
        self.lift_bound(pieces);
        self.length - self.own_bound <= GAP * self.length
    }

    /// Raises the bound to that of the current directions.
    fn lift_bound<'a, I>(&mut self, pieces: &impl Fn(usize) -> I)
    where
        I: Iterator<Item = &'a [DVec3]>,
    {
        let n = self.points.len() - 2;
        // Relative to the start, for precision.
        let from = self.points[0];
        let last = self.directions[n].dot(self.points[n + 1] - from);
        let (mut bound, mut own_bound) = (last, last);
        for i in 0..n {
            let turn = self.directions[i] - self.directions[i + 1];
            let (mut least, mut own) = (f64::INFINITY, f64::INFINITY);
            for (k, piece) in pieces(i).enumerate() {
                let corners = piece.iter().map(|p| turn.dot(*p - from));
                let nearest = corners.fold(f64::INFINITY, f64::min);
                least = least.min(nearest);
                if k as u32 == self.pieces[i] {
                    own = nearest;
                }
            }
            bound += least;
            own_bound += own;
        }
        self.bound = self.bound.max(bound);
        self.own_bound = self.own_bound.max(own_bound);
    }

    /// Takes a step of Newton's method along the faces at which points are caught, as far as it shortens.
    fn newton<'a, I>(&mut self, pieces: &impl Fn(usize) -> I)
    where
        I: Iterator<Item = &'a [DVec3]>,
    {
        let n = self.axes.len();
        assemble(&self.points, &self.axes, 1e-9, &mut self.blocks);
        if !solve(&mut self.blocks) {
            return;
        }
        let mut share: f64 = 1.0;
        // First each as far as its own opening lets it: where many are caught anew, the least share of all would make little way.
        self.next.clear();
        self.next.push(self.points[0]);
        for i in 0..n {
            let step = self.step(i);
            let piece = pieces(i).nth(self.pieces[i] as usize).unwrap_or_default();
            let room = room(self.points[i + 1], step, piece);
            self.next.push(self.points[i + 1] + step * room);
            share = share.min(room);
        }
        self.next.push(self.points[n + 1]);
        let before = length_of(&self.points);
        if length_of(&self.next) < before {
            std::mem::swap(&mut self.points, &mut self.next);
            return;
        }
        for _ in 0..6 {
            self.try_step(share);
            if length_of(&self.next) < before {
                std::mem::swap(&mut self.points, &mut self.next);
                return;
            }
            share *= 0.25;
        }
    }

    fn step(&self, i: usize) -> DVec3 {
        let [u, v] = self.blocks[i].right;
        self.axes[i][0] * u + self.axes[i][1] * v
    }

    fn try_step(&mut self, share: f64) {
        self.next.clear();
        self.next.push(self.points[0]);
        for i in 0..self.axes.len() {
            let p = self.points[i + 1] + self.step(i) * share;
            self.next.push(p);
        }
        self.next.push(self.points[self.axes.len() + 1]);
    }

    /// The interior-point method, through the pieces that contain the points, from their middles.
    fn interior<'a, I>(&mut self, pieces: &impl Fn(usize) -> I)
    where
        I: Iterator<Item = &'a [DVec3]>,
    {
        let n = self.axes.len();
        let piece =
            |chosen: &[u32], i: usize| pieces(i).nth(chosen[i] as usize).unwrap_or_default();
        for i in 0..n {
            let corners = piece(&self.pieces, i);
            self.axes[i] = plane_axes(corners);
            // On an edge it stays, which has no inside.
            if corners.len() > 2 {
                self.points[i + 1] = middle(corners);
            }
        }
        let n_edges: usize = (0..n).map(|i| piece(&self.pieces, i).len()).sum();
        let (mut weight, least) = (0.1 * self.length, 0.02 * GAP * self.length);
        let least = least / (n + n_edges + 1) as f64;
        for _ in 0..STEPS {
            assemble(&self.points, &self.axes, weight, &mut self.blocks);
            for i in 0..n {
                add_barrier(
                    self.points[i + 1],
                    piece(&self.pieces, i),
                    weight,
                    &self.axes[i],
                    &mut self.blocks[i],
                );
            }
            if !solve(&mut self.blocks) {
                break;
            }
            self.set_newton_directions(weight);
            self.lift_bound(pieces);
            let mut share: f64 = 1.0;
            for i in 0..n {
                let room = room(self.points[i + 1], self.step(i), piece(&self.pieces, i));
                // Stop short of an edge.
                share = share.min(if room < 1.0 { 0.95 * room } else { 1.0 });
            }
            let value = |points: &[DVec3], chosen: &[u32]| {
                let legs = points
                    .windows(2)
                    .map(|p| rounded(p[0].distance(p[1]), weight));
                let barriers = (0..n).map(|i| barrier(points[i + 1], piece(chosen, i)));
                legs.sum::<f64>() + weight * barriers.sum::<f64>()
            };
            let before = value(&self.points, &self.pieces);
            let mut gain = 0.0;
            for _ in 0..30 {
                self.try_step(share);
                gain = before - value(&self.next, &self.pieces);
                if gain > 0.0 {
                    std::mem::swap(&mut self.points, &mut self.next);
                    break;
                }
                share *= 0.5;
            }
            let gap = length_of(&self.points) - self.own_bound;
            if weight < least || gap <= 0.5 * GAP * self.length {
                break;
            }
            if gain < 0.1 * weight {
                weight *= 0.2;
            }
        }
    }

    /// Sets the legs' directions after the solved step, from their derivatives: these satisfy the constraints of the dual
    /// problem exactly, while the directions of almost zero legs are far off.
    fn set_newton_directions(&mut self, round: f64) {
        self.directions.clear();
        let n = self.axes.len();
        for leg in 0..=n {
            let d = self.points[leg + 1] - self.points[leg];
            let root = d.length().hypot(round);
            let u = d / (root + round);
            let start = leg.checked_sub(1).map_or(DVec3::ZERO, |i| self.step(i));
            let end = if leg < n { self.step(leg) } else { DVec3::ZERO };
            let step = end - start;
            let moved = u + step / (root + round) - u * (u.dot(step) / root);
            self.directions.push(moved / moved.length().max(1.0));
        }
    }
}

/// A length with the barrier of its cone: the minimum over `t` of `t − round · log(t² − length²)`.
///
/// Self-concordant like the barrier, so that Newton's method needs no more steps where lengths vanish.
fn rounded(length: f64, round: f64) -> f64 {
    let t = round + length.hypot(round);
    t - round * (2.0 * round * t).ln()
}

fn length_of(points: &[DVec3]) -> f64 {
    points.windows(2).map(|p| p[0].distance(p[1])).sum()
}

fn away(from: DVec3, mut points: impl Iterator<Item = DVec3>, length: f64) -> DVec3 {
    let apart = points.find(|p| p.distance(from) > 1e-9 * length);
    apart.map_or(DVec3::ZERO, |p| (p - from).normalize_or_zero())
}

/// Assembles the system of Newton's method for the sum of lengths, each [smoothed](rounded) at `round`.
fn assemble(points: &[DVec3], axes: &[[DVec3; 2]], round: f64, blocks: &mut [Block]) {
    for (block, axes) in blocks.iter_mut().zip(axes) {
        *block = Block::default();
        for (k, axis) in axes.iter().enumerate() {
            // A point that cannot move is a row of its own.
            block.diagonal[k][k] = if *axis == DVec3::ZERO { 1.0 } else { 0.0 };
        }
    }
    for (leg, ends) in points.windows(2).enumerate() {
        let d = ends[1] - ends[0];
        let root = (d.length_squared() + round * round).sqrt();
        let length = root + round;
        let u = d / length;
        // The second derivative along two axes.
        let curve = |x: DVec3, y: DVec3| x.dot(y) / length - x.dot(u) * y.dot(u) / root;
        for (at, sign) in [(leg.wrapping_sub(1), -1.0), (leg, 1.0)] {
            let (Some(block), Some(axes)) = (blocks.get_mut(at), axes.get(at)) else {
                continue;
            };
            for k in 0..2 {
                block.right[k] -= sign * u.dot(axes[k]);
                for l in 0..2 {
                    block.diagonal[k][l] += curve(axes[k], axes[l]);
                }
            }
        }
        if leg > 0 && leg < blocks.len() {
            let (before, after) = (axes[leg - 1], axes[leg]);
            blocks[leg - 1].above = before.map(|x| after.map(|y| -curve(x, y)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn doorway(x: f64, z: f64) -> Vec<DVec3> {
        let corner = |y: f64, z: f64| DVec3::new(x, y, z);
        vec![
            corner(0.0, z),
            corner(2.0, z),
            corner(2.0, z + 1.0),
            corner(0.0, z + 1.0),
        ]
    }

    /// W11.
    #[test]
    fn a_string_through_a_doorway_aside_bends_at_its_jamb() {
        let door = doorway(0.0, 2.0);
        let (a, b) = (DVec3::new(-3.0, 1.0, 0.0), DVec3::new(3.0, 1.0, 0.0));
        let mut string = TautString::new();
        let length = string.pull(a, b, 1, |_| [door.as_slice()].into_iter());
        assert!((length - 2.0 * 13f64.sqrt()).abs() < 1e-9, "{length}");
        assert!(string.bound() <= length + 1e-12 && string.bound() > length * (1.0 - 1e-6));
        assert!(string.points()[1].distance(DVec3::new(0.0, 1.0, 2.0)) < 1e-6);
        assert!((string.departure() - DVec3::new(3.0, 0.0, 2.0).normalize()).length() < 1e-6);
        assert!((string.arrival() - DVec3::new(-3.0, 0.0, 2.0).normalize()).length() < 1e-6);
    }

    /// W11.
    #[test]
    fn a_string_through_nothing_is_straight() {
        let mut string = TautString::new();
        let none: [&[DVec3]; 0] = [];
        let to = DVec3::new(0.0, 3.0, 4.0);
        assert_eq!(string.pull(DVec3::ZERO, to, 0, |_| none.into_iter()), 5.0);
        assert_eq!(string.bound(), 5.0);
        assert_eq!(string.pull(to, to, 0, |_| none.into_iter()), 0.0);
        assert_eq!(string.departure(), DVec3::ZERO);
    }
}

//! Sight lines followed from cell to cell. A line proves visible everything that it crosses.

use enfilade_geom::DVec3;

use crate::dirs::Dirs;
use crate::rng::Rng;

/// Returns `true` if something solid lies between two points.
pub(crate) type Blocker<'a> = &'a (dyn Fn(DVec3, DVec3) -> bool + Sync);

/// A line that proves that pairs of cells see each other.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Line {
    /// A point in the opening that the walk started from.
    pub(crate) origin: DVec3,
    /// Direction; any length.
    pub(crate) direction: DVec3,
    /// The directions crossed, in order.
    pub(crate) chain: Vec<u32>,
}

/// Sine of the least angle at which a crossing counts. Where a line along the plane of an opening meets it is a
/// matter of rounding.
pub(crate) const MIN_SINE: f64 = 1e-9;

/// Longest chain followed.
const MAX_STEPS: usize = 4096;

/// Follows the line from a point of the opening `first` through it and on; appends the directions crossed, without
/// `first`.
///
/// Counts only crossings that lie at least `margin` inside an opening, so that each is proved. May stop early.
pub(crate) fn walk(
    dirs: &Dirs,
    first: usize,
    origin: DVec3,
    direction: DVec3,
    margin: f64,
    blocker: Option<Blocker<'_>>,
    out: &mut Vec<u32>,
) {
    let mut at = first;
    let mut t = 0.0;
    for _ in 0..MAX_STEPS {
        let back = dirs.reverse[at] as usize;
        let mut best = None;
        let mut best_t = f64::INFINITY;
        for exit in dirs.after(at) {
            let [x, y, z, middle] = dirs.planes[exit];
            let normal = DVec3::new(x, y, z);
            let speed = normal.dot(direction);
            if speed <= 0.0 {
                continue;
            }
            let exit_t = (middle - normal.dot(origin)) / speed;
            if exit_t < t || exit_t >= best_t {
                continue;
            }
            if exit == back {
                continue;
            }
            if dirs.is_inside(exit, origin + direction * exit_t, margin) {
                best = Some(exit);
                best_t = exit_t;
            }
        }
        let Some(exit) = best else { return };
        if let Some(is_blocked) = blocker
            && is_blocked(origin + direction * t, origin + direction * best_t)
        {
            return;
        }
        out.push(exit as u32);
        at = exit;
        t = best_t;
    }
}

impl Dirs {
    /// Returns `true` if a point of an opening's plane lies at least `margin` inside one of its pieces.
    #[inline]
    pub(crate) fn is_inside(&self, dir: usize, p: DVec3, margin: f64) -> bool {
        let pieces = &self.all[dir].pieces;
        self.pieces[pieces.start as usize..pieces.end as usize]
            .iter()
            .any(|piece| {
                self.edges[piece.start as usize..piece.end as usize]
                    .iter()
                    .all(|(inward, offset)| inward.dot(p) - offset >= margin)
            })
    }

    /// Returns `true` if a line crosses all openings of its chain in order, each at least `margin` inside.
    pub(crate) fn is_crossed(&self, line: &Line, margin: f64) -> bool {
        let mut before = f64::NEG_INFINITY;
        let least = MIN_SINE * line.direction.length();
        line.chain.iter().all(|&d| {
            let dir = &self.all[d as usize];
            let speed = dir.normal.dot(line.direction);
            let t = ((dir.low + dir.high) * 0.5 - dir.normal.dot(line.origin)) / speed;
            let is_next = speed > least && t >= before;
            before = t;
            is_next && self.is_inside(d as usize, line.origin + line.direction * t, margin)
        })
    }

    /// Returns a random point of an opening, uniform over a random triangle of its fan.
    pub(crate) fn random_point(&self, dir: usize, rng: &mut Rng) -> DVec3 {
        let pieces = &self.all[dir].pieces;
        let n_pieces = (pieces.end - pieces.start) as usize;
        let piece = &self.pieces[pieces.start as usize + rng.below(n_pieces)];
        let corners = &self.points[piece.start as usize..piece.end as usize];
        let k = 1 + rng.below(corners.len() - 2);
        let (mut u, mut v) = (rng.unit(), rng.unit());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        corners[0] + (corners[k] - corners[0]) * u + (corners[k + 1] - corners[0]) * v
    }
}

//! Columns of solid matter above the squares of a grid in plan, from triangles.
//!
//! As in Recast (Mononen, "Recast Navigation", 2009): each triangle is clipped to the squares that it touches, and the heights of
//! the clipped part form a span. So no wall is missed, however thin; each is up to one square too thick. O(triangles + squares
//! that they cover). Clipping rounds; a square that a triangle only touches may count as covered.

use enfilade_geom::{DVec3, Triangle};

/// A grid of squares in plan.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Squares {
    /// Minimum along each axis. [Units: wu]
    pub(crate) origin: [f64; 2],
    /// Side of a square. [Units: wu]
    pub(crate) side: f64,
    /// Number along x and z.
    pub(crate) n: [usize; 2],
}

impl Squares {
    /// Returns the square of a point, if it is in the grid.
    pub(crate) fn at(&self, p: DVec3) -> Option<[usize; 2]> {
        let x = self.along(p);
        let is_in = |k: usize| x[k] >= 0.0 && x[k] < self.n[k] as f64;
        (is_in(0) && is_in(1)).then(|| x.map(|x| x as usize))
    }

    /// Converts a point to coordinates in squares.
    pub(crate) fn along(&self, p: DVec3) -> [f64; 2] {
        [
            (p.x - self.origin[0]) / self.side,
            (p.z - self.origin[1]) / self.side,
        ]
    }

    /// Returns the square beside one: to +x, +z, −x or −z; `None` at the border.
    pub(crate) fn beside(&self, square: u32, direction: usize) -> Option<usize> {
        let axis = direction % 2;
        let mut at = [square as usize % self.n[0], square as usize / self.n[0]];
        if direction < 2 {
            at[axis] += 1;
        } else {
            at[axis] = at[axis].checked_sub(1)?;
        }
        (at[axis] < self.n[axis]).then(|| self.number(at))
    }

    pub(crate) fn number(&self, at: [usize; 2]) -> usize {
        at[1] * self.n[0] + at[0]
    }
}

/// A height interval of solid matter above a square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    pub(crate) square: u32,
    pub(crate) low: f32,
    pub(crate) high: f32,
    /// True if its top is flat enough to stand on.
    pub(crate) is_floor: bool,
}

/// Tops nearer to each other than this are merged. [Units: wu]
const SAME: f32 = 0.02;

/// Returns the spans of all triangles, ascending by square and height, none touching another. `slope` is the steepest floor.
/// [Units: rad]
pub(crate) fn spans(
    squares: &Squares,
    triangles: impl Iterator<Item = Triangle>,
    slope: f64,
) -> Vec<Span> {
    let mut spans = Vec::new();
    let (mut row, mut part, mut rest) = (Vec::new(), Vec::new(), Vec::new());
    for t in triangles {
        let normal = (t[1] - t[0]).cross(t[2] - t[0]).normalize_or_zero();
        // Models do not record which side of a floor is up.
        let is_floor = normal.y.abs() >= slope.cos();
        let Some([first, last]) = range(squares, &t, 1) else {
            continue;
        };
        rest.clear();
        rest.extend_from_slice(&t);
        for z in first..=last {
            let [low, high] = [z, z + 1].map(|z| squares.origin[1] + z as f64 * squares.side);
            clip(&rest, 2, low, high, &mut row);
            let Some([first, last]) = range(squares, &row, 0) else {
                continue;
            };
            for x in first..=last {
                let [low, high] = [x, x + 1].map(|x| squares.origin[0] + x as f64 * squares.side);
                clip(&row, 0, low, high, &mut part);
                let heights = part.iter().map(|p| p.y as f32);
                let (low, high) = heights.fold((f32::INFINITY, f32::NEG_INFINITY), |h, y| {
                    (h.0.min(y), h.1.max(y))
                });
                if low <= high {
                    spans.push(Span {
                        square: squares.number([x, z]) as u32,
                        low,
                        high,
                        is_floor,
                    });
                }
            }
        }
    }
    spans.sort_unstable_by(|a, b| {
        (a.square.cmp(&b.square))
            .then(a.low.total_cmp(&b.low))
            .then(a.high.total_cmp(&b.high))
    });
    merged(spans)
}

fn merged(spans: Vec<Span>) -> Vec<Span> {
    let mut merged: Vec<Span> = Vec::with_capacity(spans.len() / 2);
    for span in spans {
        match merged.last_mut() {
            Some(below) if below.square == span.square && span.low <= below.high + SAME => {
                if span.high > below.high + SAME {
                    below.is_floor = span.is_floor;
                } else if span.high >= below.high - SAME {
                    below.is_floor |= span.is_floor;
                }
                below.high = below.high.max(span.high);
            }
            _ => merged.push(span),
        }
    }
    merged
}

/// Returns the range of squares that points cover along an axis of the grid; `None` if it is empty.
fn range(squares: &Squares, points: &[DVec3], axis: usize) -> Option<[usize; 2]> {
    let along = points.iter().map(|&p| squares.along(p)[axis]);
    let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |h, x| {
        (h.0.min(x), h.1.max(x))
    });
    let n = squares.n[axis] as f64;
    // False for NaN, too.
    let is_in = low < n && high >= 0.0;
    is_in.then(|| [low, high].map(|x| x.clamp(0.0, n - 1.0) as usize))
}

/// Writes the part of a convex polygon from `low` to `high` along an axis.
fn clip(polygon: &[DVec3], axis: usize, low: f64, high: f64, part: &mut Vec<DVec3>) {
    part.clear();
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (from, to) = (a[axis], b[axis]);
        if (low..=high).contains(&from) {
            part.push(a);
        }
        // Crossings of the edge with both sides, in order along the edge.
        let mut cuts = [low, high].map(|x| (x - from) / (to - from));
        if cuts[0] > cuts[1] {
            cuts.swap(0, 1);
        }
        for t in cuts {
            if t > 0.0 && t < 1.0 {
                part.push(a.lerp(b, t));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Squares = Squares {
        origin: [0.0, 0.0],
        side: 0.5,
        n: [8, 8],
    };

    fn square(y: f64, low: f64, high: f64) -> [Triangle; 2] {
        let at = |x, z| DVec3::new(x, y, z);
        let c = [at(low, low), at(high, low), at(high, high), at(low, high)];
        [[c[0], c[1], c[2]], [c[0], c[2], c[3]]]
    }

    #[test]
    fn a_floor_covers_its_squares_and_a_slanted_wall_those_it_crosses() {
        let floor = spans(&GRID, square(1.0, 0.1, 2.9).into_iter(), 0.8);
        assert_eq!(floor.len(), 36);
        let at_one = |s: &Span| s.is_floor && (s.low - 1.0).abs() < 1e-6 && s.low <= s.high;
        assert!(floor.iter().all(at_one));
        let [a, b] = [DVec3::new(0.1, 0.0, 0.1), DVec3::new(3.9, 0.0, 3.7)];
        let wall = [[a, b, b + DVec3::Y], [a, b + DVec3::Y, a + DVec3::Y]];
        let crossed = spans(&GRID, wall.into_iter(), 0.8);
        assert!(crossed.iter().all(|s| !s.is_floor && s.high - s.low > 0.99));
        // Each point of the wall is in a covered square.
        for i in 0..=1000 {
            let at = GRID.number(GRID.at(a.lerp(b, f64::from(i) / 1000.0)).unwrap()) as u32;
            assert!(crossed.iter().any(|s| s.square == at));
        }
        assert!(crossed.len() < 20);
    }

    #[test]
    fn touching_spans_merge_and_the_top_one_is_the_floor() {
        let span = |low, high, is_floor| Span {
            square: 3,
            low,
            high,
            is_floor,
        };
        let wall_on_floor = merged(vec![span(0.0, 0.0, true), span(0.0, 2.0, false)]);
        assert_eq!(wall_on_floor, [span(0.0, 2.0, false)]);
        let table = merged(vec![span(0.0, 0.0, true), span(0.7, 0.8, true)]);
        assert_eq!(table.len(), 2);
    }
}

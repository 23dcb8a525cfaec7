//! Plans: points with times, straight lines between them.
//!
//! Evaluating one is a binary search for the time, and one interpolation: O(log points). A position on a line is computed from
//! its ends, not accumulated, so that rounding does not depend on the times of queries.

use enfilade_cpg::CellId;
use enfilade_geom::DVec3;

/// A point of a path, and the cell crossed on the way there from the point before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WayPoint {
    /// Position. [Units: wu]
    pub at: DVec3,
    /// The cell on the way to it.
    pub cell: CellId,
}

/// Time of a point of a plan; from then until the next one the actor is in `cell`. Points are stored apart: few queries need
/// them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Knot {
    pub(super) time: f64,
    pub(super) cell: CellId,
}

/// A plan under construction: it starts at the place and time of its event, and each call extends it.
#[derive(Debug)]
pub struct PlanDraft<'a> {
    knots: &'a mut Vec<Knot>,
    points: &'a mut Vec<DVec3>,
}

impl<'a> PlanDraft<'a> {
    /// Starts at a place, replacing the old plan.
    pub(super) fn new(
        knots: &'a mut Vec<Knot>,
        points: &'a mut Vec<DVec3>,
        start: Knot,
        at: DVec3,
    ) -> Self {
        knots.clear();
        knots.push(start);
        points.clear();
        points.push(at);
        Self { knots, points }
    }

    fn last(&mut self) -> (&mut Knot, &mut DVec3) {
        let last = self.knots.len() - 1;
        (&mut self.knots[last], &mut self.points[last])
    }

    /// Stays for some seconds; for ever if infinite. Ignores NaN and negative times.
    pub fn wait(&mut self, seconds: f64) {
        if seconds > 0.0 {
            let (&mut last, &mut at) = self.last();
            self.knots.push(Knot {
                time: last.time + seconds,
                ..last
            });
            self.points.push(at);
        }
    }

    /// Walks straight to a point. Ignores points that are not finite, and speeds not above 0. [Units: wu, wu/s]
    pub fn walk(&mut self, to: WayPoint, speed: f64) {
        let (last, at) = self.last();
        let seconds = at.distance(to.at) / speed;
        if !(seconds >= 0.0 && seconds.is_finite() && speed > 0.0) {
            return;
        }
        last.cell = to.cell;
        let time = last.time + seconds;
        // Skip a walk that takes no time.
        if time > last.time {
            let cell = to.cell;
            self.knots.push(Knot { time, cell });
            self.points.push(to.at);
        } else {
            *at = to.at;
        }
    }

    /// Returns the end of the plan so far. [Units: s]
    #[must_use]
    pub fn end(&self) -> f64 {
        self.knots.last().map_or(0.0, |k| k.time)
    }

    /// Stretches a plan to a least duration, which bounds the number of events.
    pub(super) fn take_at_least(&mut self, start: f64, seconds: f64) {
        let rest = seconds - (self.end() - start);
        if rest > 0.0 && self.knots.len() > 1 {
            self.wait(rest);
        }
    }
}

/// Returns the index, at least `from`, of the part of a plan at a time. O(1) for the next few, O(log parts) for others.
pub(super) fn part_at(knots: &[Knot], from: usize, time: f64) -> usize {
    for i in from..from + 4 {
        if knots.get(i + 1).is_none_or(|k| k.time > time) {
            return i;
        }
    }
    from + knots[from..].partition_point(|k| k.time <= time) - 1
}

/// Returns the position and velocity of a plan at a time in one of its parts. [Units: wu, wu/s]
pub(super) fn place_at(knots: &[Knot], points: &[DVec3], part: usize, time: f64) -> (DVec3, DVec3) {
    let (from, at) = (&knots[part], points[part]);
    let Some(to) = knots.get(part + 1) else {
        return (at, DVec3::ZERO);
    };
    let seconds = to.time - from.time;
    let share = (time - from.time) / seconds;
    let by = points[part + 1] - at;
    (at + by * share, by / seconds)
}

/// Returns the time of the first change of cell after a part, or the end of the plan.
pub(super) fn next_change(knots: &[Knot], part: usize) -> f64 {
    let later = &knots[part + 1..];
    let change = later.iter().find(|k| k.cell != knots[part].cell);
    change.or(later.last()).map_or(f64::INFINITY, |k| k.time)
}

//! Plans: places with times, straight lines between them.
//!
//! Evaluating one is a search by halving for the time, and one interpolation: O(log places). The share of a line is computed from
//! its ends, not summed up, so that rounding does not depend on when one asks.

use enfilade_cpg::CellId;
use enfilade_geom::DVec3;

/// A point of a way, and the cell that one walks through to get there from the point before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WayPoint {
    /// Where. [Units: wu]
    pub at: DVec3,
    /// The cell on the way to it.
    pub cell: CellId,
}

/// When an actor is at a point of its plan; from then until the next one it is in `cell`. Points stand apart: few ask for them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Knot {
    pub(super) time: f64,
    pub(super) cell: CellId,
}

/// A plan being made: it starts where and when its event is, and goes on with each call.
#[derive(Debug)]
pub struct PlanDraft<'a> {
    knots: &'a mut Vec<Knot>,
    points: &'a mut Vec<DVec3>,
}

impl<'a> PlanDraft<'a> {
    /// From one place on, in place of what was.
    pub(super) fn new(
        (knots, points): (&'a mut Vec<Knot>, &'a mut Vec<DVec3>),
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

    /// Stays for some seconds; for ever where that is infinite. What is no time, or below 0, is passed over.
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

    /// Walks straight to a point. What is not finite, and speeds not above 0, are passed over. [Units: wu, wu/s]
    pub fn walk(&mut self, to: WayPoint, speed: f64) {
        let (last, at) = self.last();
        let seconds = at.distance(to.at) / speed;
        if !(seconds >= 0.0 && seconds.is_finite() && speed > 0.0) {
            return;
        }
        last.cell = to.cell;
        let time = last.time + seconds;
        // What takes no time has been done.
        if time > last.time {
            let cell = to.cell;
            self.knots.push(Knot { time, cell });
            self.points.push(to.at);
        } else {
            *at = to.at;
        }
    }

    /// When the plan is at its end so far. [Units: s]
    #[must_use]
    pub fn end(&self) -> f64 {
        self.knots.last().map_or(0.0, |k| k.time)
    }

    /// Draws a plan that takes any time out to a least time, so that events cannot be without end.
    pub(super) fn take_at_least(&mut self, start: f64, seconds: f64) {
        let rest = seconds - (self.end() - start);
        if rest > 0.0 && self.knots.len() > 1 {
            self.wait(rest);
        }
    }
}

/// The part of a plan that a time is in: its number, which is not before `from`. O(1) for the next few, O(log parts) for others.
pub(super) fn part_at(knots: &[Knot], from: usize, time: f64) -> usize {
    for i in from..from + 4 {
        if knots.get(i + 1).is_none_or(|k| k.time > time) {
            return i;
        }
    }
    from + knots[from..].partition_point(|k| k.time <= time) - 1
}

/// Where a plan is at a time in one of its parts, and which way it goes, at which speed. [Units: wu, wu/s]
pub(super) fn place_at(
    (knots, points): (&[Knot], &[DVec3]),
    part: usize,
    time: f64,
) -> (DVec3, DVec3) {
    let (from, at) = (&knots[part], points[part]);
    let Some(to) = knots.get(part + 1) else {
        return (at, DVec3::ZERO);
    };
    let seconds = to.time - from.time;
    let share = (time - from.time) / seconds;
    let by = points[part + 1] - at;
    (at + by * share, by / seconds)
}

/// When a plan changes its cell next after one of its parts, or is at its end.
pub(super) fn next_change(knots: &[Knot], part: usize) -> f64 {
    let later = &knots[part + 1..];
    let change = later.iter().find(|k| k.cell != knots[part].cell);
    change.or(later.last()).map_or(f64::INFINITY, |k| k.time)
}

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

/// A place at a time; from then until the next one, the actor is in `cell`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Knot {
    pub(super) time: f64,
    pub(super) at: DVec3,
    pub(super) cell: CellId,
}

/// A plan being made: it starts where and when its event is, and goes on with each call.
#[derive(Debug)]
pub struct PlanDraft<'a> {
    knots: &'a mut Vec<Knot>,
}

impl<'a> PlanDraft<'a> {
    /// From one place on, in place of what was.
    pub(super) fn new(knots: &'a mut Vec<Knot>, start: Knot) -> Self {
        knots.clear();
        knots.push(start);
        Self { knots }
    }

    /// Goes on with one.
    pub(super) fn resume(knots: &'a mut Vec<Knot>) -> Self {
        Self { knots }
    }

    fn last(&mut self) -> &mut Knot {
        let last = self.knots.len() - 1;
        &mut self.knots[last]
    }

    /// Stays for some seconds; for ever where that is infinite. What is no time, or below 0, is passed over.
    pub fn wait(&mut self, seconds: f64) {
        if seconds > 0.0 {
            let last = *self.last();
            self.knots.push(Knot {
                time: last.time + seconds,
                ..last
            });
        }
    }

    /// Walks straight to a point. What is not finite, and speeds not above 0, are passed over. [Units: wu, wu/s]
    pub fn walk(&mut self, to: WayPoint, speed: f64) {
        let last = self.last();
        let seconds = last.at.distance(to.at) / speed;
        if !(seconds >= 0.0 && seconds.is_finite() && speed > 0.0) {
            return;
        }
        last.cell = to.cell;
        let time = last.time + seconds;
        let knot = Knot {
            time,
            at: to.at,
            cell: to.cell,
        };
        // What takes no time has been done.
        if time > last.time {
            self.knots.push(knot);
        } else {
            *last = knot;
        }
    }

    /// When the plan is at its end so far. [Units: s]
    #[must_use]
    pub fn end(&self) -> f64 {
        self.knots.last().map_or(0.0, |k| k.time)
    }
}

/// The part of a plan that a time is in: its number.
pub(super) fn part_at(knots: &[Knot], time: f64) -> usize {
    knots.partition_point(|k| k.time <= time).saturating_sub(1)
}

/// Where a plan is at a time, and which way it goes, at which speed. [Units: wu, wu/s]
pub(super) fn place_at(knots: &[Knot], time: f64) -> (DVec3, DVec3, CellId) {
    let i = part_at(knots, time);
    let from = &knots[i];
    let Some(to) = knots.get(i + 1) else {
        return (from.at, DVec3::ZERO, from.cell);
    };
    let seconds = to.time - from.time;
    let share = (time - from.time) / seconds;
    let by = to.at - from.at;
    (from.at + by * share, by / seconds, from.cell)
}

/// When, after a time, a plan first changes its cell or is at its end.
pub(super) fn next_change(knots: &[Knot], time: f64) -> f64 {
    let i = part_at(knots, time);
    let later = knots[i + 1..].iter();
    let change = later.clone().find(|k| k.cell != knots[i].cell);
    change.or(later.last()).map_or(f64::INFINITY, |k| k.time)
}

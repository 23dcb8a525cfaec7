//! *Sealed*: the portals that an unblocked segment crosses lead from its first cell to its last.

use enfilade_cpg::CellId;
use enfilade_geom::DVec3;

use crate::report::{Break, Failure, FailureKind, Tally};
use crate::rng::Rng;
use crate::sample::draw_segment;
use crate::subject::{Crossing, Subject};

/// Attempts to find a segment whose ends are off all surfaces.
const DRAWS: usize = 4;

/// Draws segment number `i` and judges it; returns its path if nothing blocks it and no promise breaks.
pub(crate) fn try_segment(
    subject: &Subject,
    rng: &mut Rng,
    i: u64,
    tally: &mut Tally,
) -> Option<Path> {
    let drawn = (0..DRAWS).find_map(|_| {
        let (a, b) = draw_segment(subject, rng, i);
        let is_usable =
            a != b && !subject.is_close_to_surface(a) && !subject.is_close_to_surface(b);
        is_usable.then_some([a, b])
    });
    if drawn.is_none() {
        tally.sealed.drawn += 1;
        tally.sealed.on_surface += 1;
    }
    check_segment(subject, rng, i, drawn?, tally)
}

/// Judges a segment whose ends are clear of all surfaces.
pub(crate) fn check_segment(
    subject: &Subject,
    rng: &mut Rng,
    i: u64,
    [a, b]: [DVec3; 2],
    tally: &mut Tally,
) -> Option<Path> {
    let counts = &mut tally.sealed;
    counts.drawn += 1;
    let ends = [subject.locator.locate(a), subject.locator.locate(b)];
    if subject.blockers.any_hit(a, b, |_| false) {
        counts.blocked += 1;
        return None;
    }
    if ends == [None, None] {
        counts.solid += 1;
        return None;
    }
    if subject.is_grazing(a, b) {
        counts.grazing += 1;
        return None;
    }
    let start = match ends {
        [Some(start), Some(_)] => start,
        [one, other] => {
            counts.cell_to_solid += 1;
            let ends = if one.is_some() { [a, b] } else { [b, a] };
            if let Some(cell) = one.or(other) {
                tally.add_failure(subject, into_solid(subject, i, ends, cell));
            }
            return None;
        }
    };
    counts.judged += 1;
    let mut crossings = Vec::new();
    subject.crossings(a, b, &mut crossings);
    counts.crossings += crossings.len() as u64;
    let followed = follow(subject, rng, [a, b], start, &mut crossings);
    if let Err(wrong) = &followed {
        tally.add_failure(subject, Failure::of_break(wrong, i, [a, b], &crossings));
    }
    followed.ok()
}

/// Returns the failure of an unblocked segment from a cell into solid.
fn into_solid(subject: &Subject, i: u64, [a, b]: [DVec3; 2], cell: CellId) -> Failure {
    let mut crossings = Vec::new();
    subject.crossings(a, b, &mut crossings);
    let wrong = Break {
        kind: FailureKind::IntoSolid,
        ..locate_change(subject, a, b, [0.0, 1.0], cell, None)
    };
    Failure::of_break(&wrong, i, [a, b], &crossings)
}

/// The path of a segment that was followed to its end.
pub(crate) struct Path {
    pub(crate) ends: [DVec3; 2],
    /// The cells that it passes, each with the range of the segment in it, from 0 (start) to 1 (end). At least one.
    pub(crate) cells: Vec<(CellId, [f64; 2])>,
    /// For each doorway that it passes, `true` if one does not look through it along the segment, and against it: its side
    /// is a special portal that does not let through.
    pub(crate) is_closed: Vec<[bool; 2]>,
}

impl Path {
    /// Returns `true` if one looks along the path from its `from`th cell to its `to`th, either way.
    pub(crate) fn is_open(&self, from: usize, to: usize) -> bool {
        let is_back = usize::from(from > to);
        let passed = from.min(to)..from.max(to);
        self.is_closed[passed].iter().all(|closed| !closed[is_back])
    }
}

/// Follows the segment through `crossings` to the cell of `b`, or returns where the portals do not lead there.
///
/// Swaps crossings whose order is within the tolerance as needed.
pub(crate) fn follow(
    subject: &Subject,
    rng: &mut Rng,
    ends: [DVec3; 2],
    start: CellId,
    crossings: &mut [Crossing],
) -> Result<Path, Break> {
    let [a, b] = ends;
    let mut cell = start;
    let mut t = 0.0;
    let mut cells = Vec::with_capacity(crossings.len() + 1);
    let mut is_closed = Vec::with_capacity(crossings.len());
    for k in 0..crossings.len() {
        subject.settle_order(cell, &mut crossings[k..]);
        let crossing = crossings[k];
        check_between(subject, rng, a, b, [t, crossing.t], cell)?;
        let view = &subject.portals[crossing.portal.0 as usize];
        let wrong = |kind, expected, found| Break {
            kind,
            expected: Some(expected),
            found: Some(found),
            portal: Some(crossing.portal),
            at: a.lerp(b, crossing.t),
        };
        let [from, to] = if crossing.is_forward {
            view.cells
        } else {
            [view.cells[1], view.cells[0]]
        };
        if cell == to && cell != from {
            return Err(wrong(FailureKind::WrongWay, cell, from));
        }
        if cell != from {
            return Err(wrong(FailureKind::WrongSide, cell, from));
        }
        let sides = view.is_closed;
        let is_turned = !crossing.is_forward;
        is_closed.push([usize::from(is_turned), usize::from(!is_turned)].map(|side| sides[side]));
        let is_seen = is_closed.iter().all(|closed| !closed[0]);
        let pvs = subject.world.pvs.as_ref().filter(|_| is_seen);
        if pvs.is_some_and(|p| !p.sees(start, to)) {
            return Err(wrong(FailureKind::Hidden, start, to));
        }
        cells.push((cell, [t, crossing.t]));
        cell = to;
        t = crossing.t;
    }
    check_between(subject, rng, a, b, [t, 1.0], cell)?;
    let end = subject.locator.locate(b);
    if end == Some(cell) {
        cells.push((cell, [t, 1.0]));
        return Ok(Path {
            ends,
            cells,
            is_closed,
        });
    }
    Err(locate_change(subject, a, b, [t, 1.0], cell, end))
}

/// Checks that the locator returns the same cell everywhere between two crossings.
fn check_between(
    subject: &Subject,
    rng: &mut Rng,
    a: DVec3,
    b: DVec3,
    [from, to]: [f64; 2],
    cell: CellId,
) -> Result<(), Break> {
    let length = a.distance(b);
    if (to - from) * length < 8.0 * subject.eps {
        return Ok(());
    }
    for s in [0.5, rng.unit()] {
        let t = from + (to - from) * s;
        let p = a.lerp(b, t);
        let found = subject.locator.locate(p);
        if found != Some(cell) && subject.nearest_portal(p).is_none() {
            return Err(locate_change(subject, a, b, [from, t], cell, found));
        }
    }
    Ok(())
}

/// Bisects the position where the locator's answer leaves `cell` on the way from `from` to `to`.
fn locate_change(
    subject: &Subject,
    a: DVec3,
    b: DVec3,
    [mut from, mut to]: [f64; 2],
    cell: CellId,
    mut found: Option<CellId>,
) -> Break {
    for _ in 0..48 {
        let t = 0.5 * (from + to);
        let here = subject.locator.locate(a.lerp(b, t));
        if here == Some(cell) {
            from = t;
        } else {
            (to, found) = (t, here);
        }
    }
    let at = a.lerp(b, to);
    // At a portal, the locator and that portal disagree about the cell behind it.
    let portal = subject.nearest_portal(at);
    let kind = match (portal, found) {
        (Some(_), _) => FailureKind::EndMismatch,
        (None, None) => FailureKind::InSolid,
        (None, Some(_)) => FailureKind::MissedPortal,
    };
    Break {
        kind,
        expected: Some(cell),
        found,
        portal,
        at,
    }
}

//! Forks: places where three or more tubes of one width meet.
//!
//! No ball distinguishes an arm from its stem there. Instead, remove a ball a little wider than the tubes: at a fork,
//! the space nearby falls apart into three or more pieces that each continue for [`DEEP`] diameters. A tube gives two
//! pieces; a hall, a pillar or a bend gives fewer. Only nearby space is examined, so that arms that meet again farther
//! on still count as arms.
//!
//! `O(n log n)` in the parts of tubes; in halls, one ball in hundreds is tested, by what is next to it.

use std::collections::BTreeMap;

use enfilade_geom::Sets;

use super::arms::{ArmPiece, Walls, measure_arm};
use super::balls::Balls;
use super::rule::{Arm, DEEP, Meeting, NARROWS, REMOVED, STRIDE, WIDEST, is_fork, meeting};

/// A place where tubes meet.
pub(crate) struct Fork {
    /// The part that contains the ball in its middle.
    pub(crate) part: u32,
    /// Radius of that ball. [Units: wu]
    pub(crate) radius: f64,
    /// Radius of the removed ball. [Units: wu]
    pub(crate) removed: f64,
    /// Parts in the removed ball.
    pub(crate) middle: Vec<u32>,
    /// Arms, widest first.
    pub(crate) arms: Vec<ArmPiece>,
    /// Least distance between the mouths of two arms. [Units: radii]
    spread: f64,
}

/// Positions of parts in a list, for one list at a time.
struct Places {
    round: u32,
    /// Round and place of each part.
    of_part: Vec<(u32, u32)>,
}

impl Places {
    fn new(n_parts: usize) -> Self {
        Self {
            round: 0,
            of_part: vec![(0, 0); n_parts],
        }
    }

    fn clear(&mut self) {
        self.round += 1;
    }

    fn get(&self, t: u32) -> Option<u32> {
        let (round, place) = self.of_part[t as usize];
        (round == self.round).then_some(place)
    }

    fn set(&mut self, t: u32, place: usize) {
        self.of_part[t as usize] = (self.round, place as u32);
    }
}

/// Thickness of the shell around a removed ball by which a hall is told. Any gives the same forks: a thinner one more false alarms, a
/// thicker one takes longer. [Units: radii]
const NEXT: f64 = 1.0;

/// State that a search for forks keeps from one place to the next.
struct Search {
    was_tested: Vec<bool>,
    places: Places,
}

/// Surroundings of a part within its region.
struct Surroundings {
    /// Parts with the distances of their balls' centers, nearest first. [Units: wu]
    parts: Vec<(f64, u32)>,
    /// Distance of the nearest ball that is much wider; infinite if there is none. [Units: wu]
    wide: f64,
}

/// Returns the distance from the middle of a fork within which its arms are examined. [Units: wu]
pub(crate) fn reach(removed: f64, radius: f64) -> f64 {
    removed + 2.0 * DEEP * radius
}

/// Returns all forks with their middle at one of some parts, given widest first; the balls removed for any two of them are
/// disjoint.
pub(crate) fn find_forks(
    balls: &impl Balls,
    middles: impl Iterator<Item = u32>,
    walls: &Walls<'_>,
) -> Vec<Fork> {
    let n = balls.n_parts();
    let mut search = Search {
        was_tested: vec![false; n],
        places: Places::new(n),
    };
    let mut found: Vec<Fork> = Vec::new();
    for c in middles {
        if !search.was_tested[c as usize] {
            found.extend(balls.fork_at(c, walls, &mut search));
        }
    }
    disjoint(balls, found)
}

/// Returns the best of some forks.
fn disjoint(balls: &impl Balls, mut found: Vec<Fork>) -> Vec<Fork> {
    // The best first: a ball beside the middle of a crossing may leave two of its arms in one piece.
    found.sort_by(|a, b| {
        (b.arms.len().cmp(&a.arms.len()))
            .then((a.removed / a.radius).total_cmp(&(b.removed / b.radius)))
            .then(b.spread.total_cmp(&a.spread))
            .then(a.part.cmp(&b.part))
    });
    let mut forks: Vec<Fork> = Vec::new();
    for fork in found {
        let is_near = |other: &Fork| {
            let [p, q] = [fork.part, other.part].map(|t| balls.center(t));
            p.distance(q) < fork.removed + other.removed
        };
        let may_go_on = balls.allowance().spend(1 + forks.len() as u64 / 16);
        if may_go_on && !forks.iter().any(is_near) {
            forks.push(fork);
        }
    }
    forks
}

/// The search, for all that has balls.
trait ForkSearch: Balls + Sized {
    /// Returns the neighbors of a part that a ball [`NARROWS`] times narrower than `radius` reaches.
    fn wide_ways(&self, t: u32, radius: f64) -> impl Iterator<Item = u32> {
        let ways = self.ways(t);
        ways.filter(move |w| w.1 * NARROWS >= radius).map(|w| w.0)
    }

    /// Returns the parts that a ball [`NARROWS`] times narrower than that of part `c` reaches. `None` if `c` cannot be
    /// the middle of a fork: if a wider ball is beside it, or a much wider one nearer than the arms are long.
    fn surroundings(&self, c: u32, search: &mut Search) -> Option<Surroundings> {
        let (radius, region) = (self.radius(c), self.owner(c));
        let center = self.center(c);
        let [least, .., most] = REMOVED.map(|k| (k + 2.0 * DEEP) * radius);
        let Search { was_tested, places } = search;
        let mut wide = f64::INFINITY;
        places.clear();
        places.set(c, 0);
        let mut parts = vec![(0.0, c)];
        let mut next = 0;
        while let Some(&(distance, t)) = parts.get(next) {
            next += 1;
            if !self.allowance().spend(2) {
                return None;
            }
            if distance < STRIDE * radius {
                was_tested[t as usize] = true;
            }
            if distance < REMOVED[0] * radius && self.radius(t) > WIDEST * radius {
                return None;
            }
            if self.radius(t) > NARROWS * radius {
                if distance < least {
                    return None;
                }
                wide = wide.min(distance);
            }
            for other in self.wide_ways(t, radius) {
                if self.owner(other) == region && places.get(other).is_none() {
                    let distance = self.center(other).distance(center);
                    if distance <= most {
                        places.set(other, parts.len());
                        parts.push((distance, other));
                    }
                }
            }
        }
        parts.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Some(Surroundings { parts, wide })
    }

    /// Returns `false` if the least removed ball leaves one piece of the space, as in a hall, to judge by what is next to it: pieces
    /// of that may meet farther on, but do not fall apart there. So nearly all places of a hall are passed over for a tenth of the time.
    fn may_part(&self, c: u32, search: &mut Search) -> bool {
        let (radius, region, center) = (self.radius(c), self.owner(c), self.center(c));
        let removed = REMOVED[0] * radius;
        let Search { was_tested, places } = search;
        places.clear();
        places.set(c, 0);
        let mut parts = vec![(0.0, c)];
        let mut next = 0;
        while let Some(&(distance, t)) = parts.get(next) {
            next += 1;
            if !self.allowance().spend(2) {
                return false;
            }
            if distance < STRIDE * radius {
                was_tested[t as usize] = true;
            }
            for other in self.wide_ways(t, radius) {
                if self.owner(other) != region || places.get(other).is_some() {
                    continue;
                }
                let away = self.center(other).distance(center);
                if away <= removed + NEXT * radius {
                    places.set(other, parts.len());
                    parts.push((away, other));
                } else if distance <= removed {
                    // A part larger than the shell.
                    return true;
                }
            }
        }
        let is_outer = |place: u32| parts[place as usize].0 > removed;
        let mut sets = Sets::new(parts.len());
        let mut touching = Vec::new();
        for (i, &(_, t)) in (0..).zip(&parts) {
            if !is_outer(i) {
                continue;
            }
            let mut touches = false;
            for j in self.wide_ways(t, radius).filter_map(|o| places.get(o)) {
                if is_outer(j) {
                    sets.join(i, j);
                } else {
                    touches = true;
                }
            }
            if touches {
                touching.push(i);
            }
        }
        let mut pieces = touching.into_iter().map(|i| sets.find(i));
        pieces
            .next()
            .is_some_and(|first| pieces.any(|piece| piece != first))
    }

    /// Returns the fork about a ball, if there is one.
    fn fork_at(&self, c: u32, walls: &Walls<'_>, search: &mut Search) -> Option<Fork> {
        let radius = self.radius(c);
        if !self.may_part(c, search) {
            return None;
        }
        let around = self.surroundings(c, search)?;
        for removed in REMOVED.map(|k| k * radius) {
            let reach = reach(removed, radius);
            if around.wide < reach {
                return None;
            }
            self.allowance().spend(around.parts.len() as u64);
            let parts = &around.parts[..around.parts.partition_point(|a| a.0 <= reach)];
            let (middle, outer) = parts.split_at(parts.partition_point(|a| a.0 <= removed));
            let mut pieces = self.pieces(outer, radius, &mut search.places);
            self.keep_those_at(middle, radius, &mut pieces, &mut search.places);
            let goes_on = |&(d, t): &(f64, u32)| d + self.radius(t) >= reach;
            pieces.retain(|piece| piece.iter().any(goes_on));
            match meeting(pieces.len()) {
                Meeting::None => return None,
                Meeting::Unclear => {}
                Meeting::Fork => {
                    let middle = middle.iter().map(|a| a.1).collect();
                    return self.fork_of(c, removed, middle, &pieces, walls);
                }
            }
        }
        None
    }

    /// Returns the connected pieces of some parts, in their order.
    fn pieces(
        &self,
        parts: &[(f64, u32)],
        radius: f64,
        places: &mut Places,
    ) -> Vec<Vec<(f64, u32)>> {
        places.clear();
        let mut sets = Sets::new(parts.len());
        for (i, &(_, t)) in parts.iter().enumerate() {
            places.set(t, i);
            for other in self.wide_ways(t, radius) {
                if let Some(j) = places.get(other) {
                    sets.join(i as u32, j);
                }
            }
        }
        let mut pieces: BTreeMap<u32, Vec<(f64, u32)>> = BTreeMap::new();
        for (i, &part) in parts.iter().enumerate() {
            pieces.entry(sets.find(i as u32)).or_default().push(part);
        }
        pieces.into_values().collect()
    }

    /// Drops the pieces that do not touch the middle.
    fn keep_those_at(
        &self,
        middle: &[(f64, u32)],
        radius: f64,
        pieces: &mut Vec<Vec<(f64, u32)>>,
        places: &mut Places,
    ) {
        places.clear();
        for (i, a) in middle.iter().enumerate() {
            places.set(a.1, i);
        }
        let at_middle = |&(_, t): &(f64, u32)| {
            let mut ways = self.wide_ways(t, radius);
            ways.any(|other| places.get(other).is_some())
        };
        pieces.retain(|piece| piece.iter().any(at_middle));
    }

    fn fork_of(
        &self,
        c: u32,
        removed: f64,
        middle: Vec<u32>,
        pieces: &[Vec<(f64, u32)>],
        walls: &Walls<'_>,
    ) -> Option<Fork> {
        let radius = self.radius(c);
        let arms = pieces
            .iter()
            .map(|p| measure_arm(self, p, removed, radius, walls));
        let mut arms: Vec<ArmPiece> = arms.filter(|a| a.kind != Arm::Stub).collect();
        arms.sort_by(|a, b| {
            b.radius
                .total_cmp(&a.radius)
                .then_with(|| a.parts.cmp(&b.parts))
        });
        let kinds: Vec<Arm> = arms.iter().map(|a| a.kind).collect();
        if !is_fork(&kinds) {
            return None;
        }
        let mut spread = f64::INFINITY;
        for (i, a) in arms.iter().enumerate() {
            for b in &arms[..i] {
                spread = spread.min(a.mouth.distance(b.mouth) / radius);
            }
        }
        Some(Fork {
            part: c,
            radius,
            removed,
            middle,
            arms,
            spread,
        })
    }
}

impl<B: Balls> ForkSearch for B {}

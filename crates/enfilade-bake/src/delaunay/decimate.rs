//! Decimation: merges neighboring cells, one portal at a time, until rooms are left.
//!
//! Gjørup 1999, §4.1.4 and §4.2.3: every portal between two cells has a weight; the cells on both sides of the portal
//! of least weight are merged, and so on. His two weights, and ours:
//!
//! | weight | definition | source |
//! | --- | --- | --- |
//! | [`Weight::Aspect`] | largest projected cell ÷ portal | §4.1.4 |
//! | [`Weight::SizeCorrected`] | the same ÷ square root of the projected cell | §4.3.2 |
//! | [`Weight::ScaleFree`] | radius of the lesser cell's largest ball ÷ that of the ball that passes; at the mouth of a branch, the trunk's ÷ the branch's, if that is more | ours |
//!
//! His first fails at doors if cells begin alike, his second depends on the model's scale, and both leave spikes for
//! the end (§4.3.2, §4.3.3). A ratio of two radii has no scale; a tetrahedron in the middle of a room has the same ball
//! as its neighbors; and a spike has none, so it goes first. Doors weigh 1.8 and more, alcoves and bulges less than
//! 1.5.
//!
//! Decimation begins with [`Cells`], parts of the air already merged, and is recorded down to the last portal
//! ([`Decimation`]), so that a user can go forward and back, and overrule it. The record includes the steps that return
//! a branch (`branches`) to its trunk.
//!
//! Ties are broken by the ids of cells, which depend on coordinates only. `O(n log n)`.

mod remaining;

use std::cmp::Ordering;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};
use std::f64::consts::PI;

use enfilade_geom::{Aabb, Allowance, DVec3};

use super::cells::{CellPortal, Cells};
use crate::budget::WORK_A_LOOK;
use crate::config::{Choices, Weight};

pub use remaining::RemainingPortal;
pub(super) use remaining::{Resolved, begun_before, remaining};

/// A cell of less than this share of its ball's volume does not contain the ball, which lies in a neighbor: it is a
/// bundle of spikes. Bundles have a hundredth or so, rooms several times the ball.
const HOLDS: f64 = 0.1;
/// Cost of each portal that a step changes, in units of [`Allowance`].
const WORK_A_PAIR: u64 = 5;

/// Factor on the weight of a crevice's portal at the mouth of a branch. Weights of crevices are negative, so crevices
/// behind mouths merge last: only if they have no other way.
const LAST: f64 = 1e-9;

/// Weight of a portal that the user joined: less than that of any other.
pub const JOINED: f64 = -2.0;

/// Least value of radii and areas in weights, so that no ratio is infinite. [Units: wu, wu²]
const TINY: f64 = 1e-9;

/// One step: two cells are merged under the lesser id.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The cell that stays.
    pub into: u32,
    /// The cell that vanishes.
    pub from: u32,
    /// Weight of the portal between them.
    pub weight: f64,
    /// The weight is that of a branch at its mouth, not that of a pinch.
    pub is_mouth: bool,
    /// Center of that portal; if it was merged from several, of the widest of them. [Units: wu]
    pub position: DVec3,
}

impl Choices {
    /// Greatest distance of a choice from a portal's center. [Units: radii of the ball that passes]
    pub const REACH: f64 = 1.0;

    /// Returns the portal that each choice is about, with its place. `undecided` are the portals removed without
    /// choices.
    fn resolved(&self, cells: &Cells, undecided: &[(u32, u32)]) -> Vec<Resolved> {
        let portal = |p: &DVec3| {
            let off = |pair: &(u32, u32)| cells.portals[pair].center.distance(*p);
            let is_at = |pair: &&(u32, u32)| off(pair) == 0.0;
            cells.portals.keys().find(is_at).copied().or_else(|| {
                let nearest = undecided.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
                let is_near =
                    |pair: &&(u32, u32)| off(pair) <= Self::REACH * cells.portals[pair].radius;
                nearest.filter(is_near).copied()
            })
        };
        let join = self.join.iter().map(|p| (p, Choice::Join));
        // The later of two choices about the same portal holds.
        let all = join.chain(self.keep.iter().map(|p| (p, Choice::Keep)));
        let resolved = |(p, choice): (&DVec3, Choice)| {
            Some(Resolved {
                pair: portal(p)?,
                choice,
                at: *p,
            })
        };
        all.filter_map(resolved).collect()
    }
}

/// Decision of the user on one portal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// It stays, whatever its weight.
    Keep,
    /// The rooms on both sides become one.
    Join,
}

/// A recorded decimation, from the first cells down to one cell in each connected part of the air.
pub struct Decimation {
    /// Number of cells before the first step.
    pub n_cells: usize,
    /// The steps, in order.
    pub steps: Vec<Step>,
    /// Number of steps after which it stops by itself.
    pub stop: usize,
}

impl Decimation {
    /// Returns the cell to which each initial cell belongs after the first `n` steps.
    #[must_use]
    pub fn after(&self, n: usize) -> Vec<u32> {
        let mut cell: Vec<u32> = (0..self.n_cells as u32).collect();
        // A cell vanishes before the cell that absorbed it, so go backward from the last step.
        for s in self.steps.iter().take(n).rev() {
            cell[s.from as usize] = cell[s.into as usize];
        }
        cell
    }
}

/// Returns the weight at which decimation stops by itself, for [`Weight::ScaleFree`] and, as Gjørup suggests (§4.3.1),
/// for his ratio. The size-corrected weight has no natural stop.
#[must_use]
pub fn default_stop(weight: Weight) -> f64 {
    match weight {
        Weight::Aspect => 3.0,
        Weight::SizeCorrected => 1.0,
        Weight::ScaleFree => 1.5,
    }
}

/// Removes portals, least weight first, and records each step.
///
/// A cell in which no ball of `min_radius` fits is a crevice, and one much smaller than its ball is a bundle of spikes:
/// both are merged across their largest opening before all else, except choices.
#[must_use]
pub fn decimate(
    cells: &Cells,
    weight: Weight,
    stop: f64,
    min_radius: f64,
    choices: &Choices,
    allowance: &Allowance,
) -> Decimation {
    let rules = Rules {
        weight,
        stop,
        min_radius,
    };
    decided(cells, rules, choices, allowance).0
}

/// Returns the record of a decimation, and the portals that its choices are about.
pub(super) fn decided(
    cells: &Cells,
    rules: Rules,
    choices: &Choices,
    allowance: &Allowance,
) -> (Decimation, Vec<Resolved>) {
    let (undecided, portals) = Merging::new(cells, rules, &BTreeMap::new()).run(allowance);
    if *choices == Choices::default() {
        return (undecided, Vec::new());
    }
    // No user means a crevice in a doorway.
    let steps = undecided.steps.iter().zip(portals);
    let portals: Vec<(u32, u32)> = steps.filter(|s| s.0.weight > 0.0).map(|s| s.1).collect();
    let resolved = choices.resolved(cells, &portals);
    let merging = Merging::new(cells, rules, &by_portal(&resolved));
    (merging.run(allowance).0, resolved)
}

/// Returns the choice that holds for each portal.
fn by_portal(resolved: &[Resolved]) -> BTreeMap<(u32, u32), Choice> {
    resolved.iter().map(|r| (r.pair, r.choice)).collect()
}

/// Rules that select the next portal, and that stop.
#[derive(Clone, Copy)]
pub(super) struct Rules {
    pub(super) weight: Weight,
    pub(super) stop: f64,
    /// [Units: wu]
    pub(super) min_radius: f64,
}

/// A cell during the merging.
#[derive(Clone, Copy)]
struct Body {
    /// Radius of its largest ball. [Units: wu]
    radius: f64,
    /// [Units: wu³]
    volume: f64,
    /// [Units: wu]
    bounds: Aabb,
}

impl Rules {
    /// Returns `true` if a cell is too narrow for a room, or a bundle of spikes.
    fn is_crevice(&self, cell: &Body) -> bool {
        let ball = 4.0 / 3.0 * PI * cell.radius.powi(3);
        cell.radius < self.min_radius || ball.is_finite() && cell.volume < HOLDS * ball
    }

    /// Returns the weight of a portal between two cells, without choices.
    fn weigh(&self, portal: &Live, [a, b]: [&Body; 2]) -> f64 {
        if self.is_crevice(a) || self.is_crevice(b) {
            // Between -1 and 0, widest opening first.
            let last = if portal.mouth > 0.0 { LAST } else { 1.0 };
            return -last / (1.0 + 1.0 / portal.radius.max(TINY));
        }
        if self.weight == Weight::ScaleFree {
            let least = a.radius.min(b.radius);
            return (least / portal.radius.max(TINY)).max(portal.mouth);
        }
        let area = portal.vector.length().max(TINY);
        let projected = |b: &Aabb| {
            let s = b.size().max(DVec3::ZERO);
            let n = (portal.vector / area).abs();
            n.dot(DVec3::new(s.y * s.z, s.z * s.x, s.x * s.y))
        };
        let largest = projected(&a.bounds).max(projected(&b.bounds));
        let aspect = largest / area;
        match self.weight {
            Weight::Aspect => aspect,
            _ => aspect / largest.sqrt(),
        }
    }

    /// Returns `true` if the weight of a portal is that of a branch at its mouth.
    fn is_mouth(&self, portal: &Live, weight: f64) -> bool {
        self.weight == Weight::ScaleFree && portal.mouth > 0.0 && weight == portal.mouth
    }

    /// Returns `true` if the portals of a cell must be weighed again after it changes from `before` to `after`.
    fn weighs_anew(&self, before: &Body, after: &Body) -> bool {
        before.radius != after.radius
            || self.is_crevice(before) != self.is_crevice(after)
            || self.weight != Weight::ScaleFree && before.bounds != after.bounds
    }
}

/// A portal in the queue. It is stale if the portal now has another version.
#[derive(Clone)]
struct QueuedPortal {
    weight: f64,
    pair: (u32, u32),
    version: u32,
}

impl Ord for QueuedPortal {
    fn cmp(&self, other: &Self) -> Ordering {
        // The heap returns the greatest first: least weight, then least ids.
        other
            .weight
            .total_cmp(&self.weight)
            .then(other.pair.cmp(&self.pair))
            .then(other.version.cmp(&self.version))
    }
}

impl PartialOrd for QueuedPortal {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for QueuedPortal {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for QueuedPortal {}

/// A portal that still exists, merged from one or several.
#[derive(Clone, Copy)]
struct Live {
    /// Radius of the widest ball that passes. [Units: wu]
    radius: f64,
    /// [`CellPortal::mouth`] of the widest one.
    mouth: f64,
    /// Sum of area vectors, from the lesser to the greater slot. [Units: wu²]
    vector: DVec3,
    /// The widest of its initial portals, and the center of that. [Units: wu]
    widest: (u32, u32),
    center: DVec3,
    /// The user wants it to stay; two cells with such a portal among theirs never merge.
    stays: bool,
    /// The user wants it to go.
    goes: bool,
    version: u32,
}

impl Live {
    fn new(pair: (u32, u32), portal: &CellPortal, choice: Option<Choice>) -> Self {
        Self {
            radius: portal.radius,
            mouth: portal.mouth,
            vector: portal.vector,
            widest: pair,
            center: portal.center,
            stays: choice == Some(Choice::Keep),
            goes: choice == Some(Choice::Join),
            version: 0,
        }
    }

    /// Absorbs another portal between the same two cells.
    fn absorb(&mut self, other: &Self) {
        if (other.radius, other.mouth) > (self.radius, self.mouth) {
            (self.radius, self.mouth) = (other.radius, other.mouth);
            (self.widest, self.center) = (other.widest, other.center);
        }
        self.vector += other.vector;
        self.stays |= other.stays;
        self.goes |= other.goes;
    }
}

/// Returns the key of the portal between two cells: lesser slot first.
fn pair_of(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

/// A decimation in progress.
///
/// A merged cell takes the slot of the one that had more neighbors, so that a hall that absorbs thousands of crevices
/// is not moved each time.
#[derive(Clone)]
pub(super) struct Merging {
    rules: Rules,
    /// The cell in each slot.
    bodies: Vec<Body>,
    /// For each slot, the slots to which a portal leads.
    neighbors: Vec<BTreeSet<u32>>,
    portals: BTreeMap<(u32, u32), Live>,
    queue: BinaryHeap<QueuedPortal>,
    /// For each slot, the original cell id as reported in [`Step`].
    ids: Vec<u32>,
    steps: Vec<Step>,
    /// For each step, the widest of the initial portals that it removed.
    removed: Vec<(u32, u32)>,
    stop_at: Option<usize>,
    /// Portals that the user joined are in the queue with their own weight.
    has_joins: bool,
}

impl Merging {
    fn new(cells: &Cells, rules: Rules, choices: &BTreeMap<(u32, u32), Choice>) -> Self {
        let n = cells.radii.len();
        let body = |c: usize| Body {
            radius: cells.radii[c],
            volume: cells.volumes[c],
            bounds: cells.boxes[c],
        };
        let mut neighbors = vec![BTreeSet::new(); n];
        let mut portals = BTreeMap::new();
        for (&(a, b), portal) in &cells.portals {
            neighbors[a as usize].insert(b);
            neighbors[b as usize].insert(a);
            let choice = choices.get(&(a, b)).copied();
            portals.insert((a, b), Live::new((a, b), portal, choice));
        }
        let mut merging = Self {
            rules,
            bodies: (0..n).map(body).collect(),
            neighbors,
            portals,
            queue: BinaryHeap::new(),
            ids: (0..n as u32).collect(),
            steps: Vec::new(),
            removed: Vec::new(),
            stop_at: None,
            has_joins: false,
        };
        let all = merging.portals.iter();
        merging.queue = all.map(|(&pair, p)| merging.candidate(pair, p)).collect();
        merging
    }

    /// Merges until no portal is left. Also returns, for each step, the initial portal that it removed.
    fn run(mut self, allowance: &Allowance) -> (Decimation, Vec<(u32, u32)>) {
        while let Some(candidate) = self.next_candidate() {
            if !allowance.spend(WORK_A_LOOK + WORK_A_PAIR * self.n_pairs(candidate.pair)) {
                break;
            }
            self.remove(&candidate);
        }
        let decimation = Decimation {
            n_cells: self.bodies.len(),
            stop: self.stop_at.unwrap_or(self.steps.len()),
            steps: self.steps,
        };
        (decimation, self.removed)
    }

    /// Takes the next portal to remove from the queue, and notes whether the decimation stops before it.
    fn next_candidate(&mut self) -> Option<QueuedPortal> {
        while let Some(candidate) = self.queue.pop() {
            if self.is_stale(&candidate) {
                continue;
            }
            if self.stop_at.is_none() && candidate.weight > self.rules.stop {
                if self.take_up_joins() {
                    self.queue.push(candidate);
                    continue;
                }
                self.stop_at = Some(self.steps.len());
            }
            return Some(candidate);
        }
        None
    }

    /// Returns the number of portals that a step may weigh again.
    fn n_pairs(&self, (a, b): (u32, u32)) -> u64 {
        let degrees = [a, b].map(|c| self.neighbors[c as usize].len() as u64);
        degrees[0] + degrees[1]
    }

    fn candidate(&self, pair: (u32, u32), portal: &Live) -> QueuedPortal {
        let weight = if portal.stays {
            f64::INFINITY
        } else if portal.goes && self.has_joins {
            JOINED
        } else {
            let bodies = [pair.0, pair.1].map(|c| &self.bodies[c as usize]);
            self.rules.weigh(portal, bodies)
        };
        QueuedPortal {
            weight,
            pair,
            version: portal.version,
        }
    }

    fn is_stale(&self, candidate: &QueuedPortal) -> bool {
        let portal = self.portals.get(&candidate.pair);
        portal.is_none_or(|p| p.version != candidate.version)
    }

    /// Queues the portals that the user joined, once; returns `false` if there are none. Joins apply to the rooms that
    /// result without them: those that the user saw.
    fn take_up_joins(&mut self) -> bool {
        if self.has_joins {
            return false;
        }
        self.has_joins = true;
        let goes = self.portals.iter().filter(|(_, p)| p.goes && !p.stays);
        let goes: Vec<QueuedPortal> = goes.map(|(&pair, p)| self.candidate(pair, p)).collect();
        let is_any = !goes.is_empty();
        self.queue.extend(goes);
        is_any
    }

    /// Removes a portal: merges the cells on both sides.
    fn remove(&mut self, candidate: &QueuedPortal) {
        let (a, b) = candidate.pair;
        let degree = |x: u32| self.neighbors[x as usize].len();
        let [into, from] = if degree(a) >= degree(b) {
            [a, b]
        } else {
            [b, a]
        };
        self.record(candidate, [into, from]);
        self.portals.remove(&candidate.pair);
        let weighs_anew = self.merge_bodies(into, from);
        let moved = self.move_portals(into, from);
        let touched = if weighs_anew {
            self.neighbors[into as usize].iter().copied().collect()
        } else {
            moved
        };
        for other in touched {
            self.queue_anew(pair_of(into, other));
        }
    }

    fn record(&mut self, candidate: &QueuedPortal, [into, from]: [u32; 2]) {
        let portal = &self.portals[&candidate.pair];
        let [one, other] = [into, from].map(|x| self.ids[x as usize]);
        self.steps.push(Step {
            into: one.min(other),
            from: one.max(other),
            weight: candidate.weight,
            is_mouth: self.rules.is_mouth(portal, candidate.weight),
            position: portal.center,
        });
        self.removed.push(portal.widest);
        self.ids[into as usize] = one.min(other);
    }

    /// Merges two bodies; returns `true` if the portals of `into` must be weighed again.
    fn merge_bodies(&mut self, into: u32, from: u32) -> bool {
        let [before, other] = [into, from].map(|x| self.bodies[x as usize]);
        let after = Body {
            radius: before.radius.max(other.radius),
            volume: before.volume + other.volume,
            bounds: before.bounds.union(other.bounds),
        };
        self.bodies[into as usize] = after;
        self.rules.weighs_anew(&before, &after)
    }

    /// Makes the portals of `from` portals of `into`; returns the cells to which they lead.
    fn move_portals(&mut self, into: u32, from: u32) -> Vec<u32> {
        self.neighbors[into as usize].remove(&from);
        let mut others = std::mem::take(&mut self.neighbors[from as usize]);
        others.remove(&into);
        for &other in &others {
            self.neighbors[other as usize].remove(&from);
            self.neighbors[other as usize].insert(into);
            self.neighbors[into as usize].insert(other);
            let mut portal = self
                .portals
                .remove(&pair_of(from, other))
                .expect("neighbors have a portal");
            // Vectors point from the lesser to the greater slot.
            if (from < other) != (into < other) {
                portal.vector = -portal.vector;
            }
            let pair = pair_of(into, other);
            match self.portals.entry(pair) {
                Entry::Vacant(entry) => {
                    entry.insert(portal);
                }
                Entry::Occupied(mut entry) => entry.get_mut().absorb(&portal),
            }
        }
        others.into_iter().collect()
    }

    fn queue_anew(&mut self, pair: (u32, u32)) {
        let live = self
            .portals
            .get_mut(&pair)
            .expect("neighbors have a portal");
        // Unlike any earlier version of this pair, since the number of steps only grows.
        live.version = self.steps.len() as u32;
        let live = *live;
        let candidate = self.candidate(pair, &live);
        self.queue.push(candidate);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crevice_before_a_mouth_stays_on_its_side() {
        let portal = |radius: f64, mouth: f64| CellPortal {
            radius,
            mouth,
            vector: DVec3::X,
            center: DVec3::ZERO,
            links: Vec::new(),
        };
        // A trunk, a branch, and a crevice of the branch that opens a little wider to the trunk.
        let cells = Cells {
            cell_of_part: Vec::new(),
            radii: vec![f64::INFINITY, 2.0, 1.0, 0.1],
            volumes: vec![1000.0, 100.0, 20.0, 0.1],
            boxes: vec![Aabb::EMPTY; 4],
            portals: [
                ((1, 2), portal(0.95, 2.0)),
                ((1, 3), portal(0.97, 2.0)),
                ((2, 3), portal(0.96, 0.0)),
            ]
            .into(),
        };
        let weight = Weight::ScaleFree;
        let done = decimate(
            &cells,
            weight,
            default_stop(weight),
            0.3,
            &Choices::default(),
            &Allowance::default(),
        );
        assert_eq!((done.steps[0].into, done.steps[0].from), (2, 3));
        assert_eq!(done.stop, 1);
    }
}

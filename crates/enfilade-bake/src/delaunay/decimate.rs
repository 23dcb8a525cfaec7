//! Decimation: tetrahedra become cells, cells become rooms, one portal at a time.
//!
//! Gjørup 1999, §4.1.4 and §4.2.3: every pair of neighbors has a weight, the pair of least weight
//! becomes one cell, and so on. His two weights are here beside ours:
//!
//! | weight | is | source |
//! | --- | --- | --- |
//! | [`Weight::Aspect`] | largest projected cell ÷ portal | §4.1.4 |
//! | [`Weight::SizeCorrected`] | the same ÷ square root of the projected cell | §4.3.2 |
//! | [`Weight::ScaleFree`] | radius of the lesser cell's largest ball ÷ that of the ball that passes; at the mouth of a branch, the trunk's ÷ the branch's, if that is more | ours |
//!
//! His first slips through doors where cells begin alike, his second depends on the model's scale,
//! and both leave spikes for the end (§4.3.2, §4.3.3). A ratio of two radii has no scale, a
//! tetrahedron in the middle of a room has the same ball as its neighbors, and a spike has none, so
//! it goes first. Doors come out at 1.8 and more, alcoves and bulges below 1.5.
//!
//! It goes in two rounds. The first joins what flows into one another, by radius, in one sweep over
//! all links: millions of tetrahedra become a few cells a room ([`Cells`]). The second is Gjørup's,
//! with a heap, and is recorded down to the last portal ([`Decimation`]), so that a person can go
//! forwards and back, and overrule it. Between the two, cells are cut where branches leave them
//! (`branches`), which no pinch shows: the steps that give a branch back to its trunk are part of the record.
//!
//! Ties are broken by the numbers of tetrahedra, which depend on coordinates only. `O(n log n)`.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

use enfilade_geom::{Aabb, DVec3, Sets};

use super::branches::Branches;
use super::space::Space;

/// Two cells whose lesser ball is hardly larger than what passes between them are parts of one
/// bulge: differences this small come from where points happen to be sampled.
const FLOWS: f64 = 1.05;

/// A cell of less than this share of its ball's volume does not hold the ball, which lies in a neighbor: it is
/// a bundle of spikes. Bundles have a hundredth or so, rooms several times the ball.
const HOLDS: f64 = 0.1;

/// Weights of crevices that open to the mouth of a branch only, beside those of others: nearer to zero.
const LAST: f64 = 1e-9;

/// The cell around the scene.
pub const OUTDOOR_CELL: u32 = 0;

/// Weight of a portal that a person joined: less than that of any other.
pub const JOINED: f64 = -2.0;

/// How the quality of a portal is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Weight {
    /// Gjørup's ratio of areas.
    Aspect,
    /// Gjørup's ratio corrected by size; depends on the unit.
    SizeCorrected,
    /// Ratio of radii, at a pinch or at the mouth of a branch; above 1.
    #[default]
    ScaleFree,
}

/// Cells before decimation, and how they meet.
pub struct Cells {
    /// Cell of each part of the space.
    pub cell_of_part: Vec<u32>,
    /// Radius of the largest ball in each cell. [Units: wu]
    pub radii: Vec<f64>,
    /// Volume of each cell. [Units: wu³]
    pub volumes: Vec<f64>,
    /// Box of each cell. [Units: wu]
    pub boxes: Vec<Aabb>,
    /// Where two cells meet, lesser number first.
    pub portals: BTreeMap<(u32, u32), CellPortal>,
}

/// Where two cells meet.
#[derive(Clone, Debug)]
pub struct CellPortal {
    /// Radius of the widest ball that passes. [Units: wu]
    pub radius: f64,
    /// Where that ball enters a branch: how many times wider what it leaves is. 0 elsewhere.
    pub mouth: f64,
    /// Sum of the facets' area normals, from the lesser to the greater cell. [Units: wu²]
    pub vector: DVec3,
    /// Mean of the middles of the facets. [Units: wu]
    pub center: DVec3,
    /// Links of the space.
    pub links: Vec<u32>,
}

/// Joins tetrahedra that flow into one another to cells. Outdoors is [`OUTDOOR_CELL`].
#[must_use]
pub fn flow_together(space: &Space) -> Cells {
    let n = space.radii.len();
    let mut sets = Sets::new(n);
    let mut radius = space.radii.clone();
    let mut outdoors: Option<u32> = None;
    for t in (0..n as u32).filter(|&t| space.radii[t as usize] == f64::INFINITY) {
        let first = *outdoors.get_or_insert(t);
        sets.join(first, t);
    }
    let mut order: Vec<u32> = (0..space.links.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| {
        let (p, q) = (
            space.links[a as usize].radius,
            space.links[b as usize].radius,
        );
        q.total_cmp(&p).then(a.cmp(&b))
    });
    for l in order {
        let link = &space.links[l as usize];
        let [a, b] = link.parts.map(|t| sets.find(t));
        let (ra, rb) = (radius[a as usize], radius[b as usize]);
        if a == b || ra.min(rb) > FLOWS * link.radius {
            continue;
        }
        radius[sets.join(a, b) as usize] = ra.max(rb);
    }
    let roots: Vec<u32> = (0..n as u32).map(|t| sets.find(t)).collect();
    gathered(space, |t| (roots[t as usize], 0), &Branches::none(n))
}

/// Cells that end where branches begin.
pub(super) fn parted(space: &Space, cells: &Cells, branches: &Branches) -> Cells {
    let key = |t: u32| {
        let t = t as usize;
        (cells.cell_of_part[t], branches.label_of_part[t])
    };
    gathered(space, key, branches)
}

/// Cells of parts with equal keys, in the order of their first parts.
fn gathered(space: &Space, key: impl Fn(u32) -> (u32, u32), branches: &Branches) -> Cells {
    let n = space.radii.len() as u32;
    let mut number: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    if let Some(t) = (0..n).find(|&t| space.radii[t as usize] == f64::INFINITY) {
        number.insert(key(t), OUTDOOR_CELL);
    }
    let mut cells = Cells {
        cell_of_part: vec![0; n as usize],
        radii: vec![f64::INFINITY],
        volumes: vec![0.0],
        boxes: vec![Aabb::EMPTY],
        portals: BTreeMap::new(),
    };
    for t in 0..n {
        let next = cells.radii.len() as u32;
        let cell = *number.entry(key(t)).or_insert(next);
        if cell == next {
            cells.radii.push(0.0);
            cells.volumes.push(0.0);
            cells.boxes.push(Aabb::EMPTY);
        }
        let radius = &mut cells.radii[cell as usize];
        *radius = radius.max(space.radii[t as usize]);
        cells.volumes[cell as usize] += space.volumes[t as usize];
        cells.cell_of_part[t as usize] = cell;
        let b = &mut cells.boxes[cell as usize];
        *b = space.corners(t).iter().fold(*b, |b, &p| b.including(p));
    }
    for (l, link) in space.links.iter().enumerate() {
        let [a, b] = link.parts.map(|t| cells.cell_of_part[t as usize]);
        if a == b {
            continue;
        }
        let portal = cells
            .portals
            .entry((a.min(b), a.max(b)))
            .or_insert(CellPortal {
                radius: 0.0,
                mouth: 0.0,
                vector: DVec3::ZERO,
                center: DVec3::ZERO,
                links: Vec::new(),
            });
        let labels = link.parts.map(|t| branches.label_of_part[t as usize]);
        let mouth = branches.weight(labels);
        if (link.radius, mouth) > (portal.radius, portal.mouth) {
            (portal.radius, portal.mouth) = (link.radius, mouth);
        }
        let normal = space.area_vector(link);
        portal.vector += if a < b { normal } else { -normal };
        let outline = space.outline(link);
        portal.center += outline.iter().sum::<DVec3>() / outline.len() as f64;
        portal.links.push(l as u32);
    }
    for portal in cells.portals.values_mut() {
        portal.center /= portal.links.len() as f64;
    }
    cells
}

/// One step: two cells become one, which keeps the lesser number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The cell that stays.
    pub into: u32,
    /// The cell that is gone.
    pub from: u32,
    /// What the portal between them weighed.
    pub weight: f64,
    /// The weight is that of a branch at its mouth, not that of a pinch.
    pub is_mouth: bool,
    /// Middle of that portal, or of the widest of the portals that it has become from. [Units: wu]
    pub position: DVec3,
}

/// What a person decided, by places as [`Step::position`] tells them. A choice is about the portal between cells before
/// decimation that has its middle there, and later about whatever that has become part of. Where none has, since the
/// scene was mended or has other points, it is about the nearest that goes if nobody decides.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choices {
    /// Portals here stay, whatever they weigh. [Units: wu]
    pub keep: Vec<DVec3>,
    /// Portals here go once nothing else goes by itself: the rooms that are there then become one, however many steps a
    /// person took to see the portal. [Units: wu]
    pub join: Vec<DVec3>,
}

impl Choices {
    /// How far from a portal's middle a choice may lie. [Units: radii of the ball that passes]
    pub const REACH: f64 = 1.0;

    /// The portals that are decided about: true to keep. `undecided` are the portals that go if nobody decides.
    fn of(&self, cells: &Cells, undecided: &[(u32, u32)]) -> BTreeMap<(u32, u32), bool> {
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
        let join = self.join.iter().filter_map(portal).map(|p| (p, false));
        let keep = self.keep.iter().filter_map(portal).map(|p| (p, true));
        join.chain(keep).collect()
    }
}

/// A decimation on record, from the cells of [`flow_together`] down to one cell a connected part.
pub struct Decimation {
    /// Number of cells before the first step.
    pub n_cells: usize,
    /// The steps, in order.
    pub steps: Vec<Step>,
    /// After how many steps it stops by itself.
    pub stop: usize,
}

/// The weight at which decimation stops by itself, for [`Weight::ScaleFree`] and, as Gjørup suggests
/// (§4.3.1), for his ratio. The size-corrected weight has no natural stop.
#[must_use]
pub fn default_stop(weight: Weight) -> f64 {
    match weight {
        Weight::Aspect => 3.0,
        Weight::SizeCorrected => 1.0,
        Weight::ScaleFree => 1.5,
    }
}

struct Candidate {
    weight: f64,
    pair: (u32, u32),
    version: u32,
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        // The heap gives the greatest first; least weight first, then least numbers.
        other
            .weight
            .total_cmp(&self.weight)
            .then(other.pair.cmp(&self.pair))
            .then(other.version.cmp(&self.version))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

struct Live {
    radius: f64,
    mouth: f64,
    vector: DVec3,
    /// The widest one that it has become from, whose radius this is.
    widest: (u32, u32),
    /// A person wants it to stay; two cells with such a portal among theirs never join.
    stays: bool,
    /// A person wants it to go.
    goes: bool,
    version: u32,
}

/// Removes portals, least weight first, and records each step.
///
/// A cell in which no ball of `min_radius` fits is a crevice, and one much smaller than its ball is a
/// bundle of spikes: both join the neighbor that they open to most before anything else is decided, choices
/// excepted.
#[must_use]
pub fn decimate(
    cells: &Cells,
    weight: Weight,
    stop: f64,
    min_radius: f64,
    choices: &Choices,
) -> Decimation {
    let (undecided, portals) = decided(cells, weight, stop, min_radius, &BTreeMap::new());
    if *choices == Choices::default() {
        return undecided;
    }
    // Nobody means a crevice that lies in a doorway.
    let steps = undecided.steps.iter().zip(portals);
    let portals: Vec<(u32, u32)> = steps.filter(|s| s.0.weight > 0.0).map(|s| s.1).collect();
    decided(
        cells,
        weight,
        stop,
        min_radius,
        &choices.of(cells, &portals),
    )
    .0
}

/// Also gives the portal of each step, as it was before decimation.
fn decided(
    cells: &Cells,
    weight: Weight,
    stop: f64,
    min_radius: f64,
    choices: &BTreeMap<(u32, u32), bool>,
) -> (Decimation, Vec<(u32, u32)>) {
    let n = cells.radii.len();
    let mut radius = cells.radii.clone();
    let mut volumes = cells.volumes.clone();
    let mut boxes = cells.boxes.clone();
    let mut neighbors = vec![BTreeSet::new(); n];
    let mut portals: BTreeMap<(u32, u32), Live> = BTreeMap::new();
    for (&(a, b), portal) in &cells.portals {
        neighbors[a as usize].insert(b);
        neighbors[b as usize].insert(a);
        let choice = choices.get(&(a, b)).copied();
        portals.insert(
            (a, b),
            Live {
                radius: portal.radius,
                mouth: portal.mouth,
                vector: portal.vector,
                widest: (a, b),
                stays: choice == Some(true),
                goes: choice == Some(false),
                version: 0,
            },
        );
    }
    let is_crevice = |radius: f64, volume: f64| {
        let ball = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
        radius < min_radius || ball.is_finite() && volume < HOLDS * ball
    };
    let weigh = |portal: &Live,
                 pair: (u32, u32),
                 radius: &[f64],
                 volumes: &[f64],
                 boxes: &[Aabb],
                 has_joins: bool|
     -> f64 {
        let (a, b) = (pair.0 as usize, pair.1 as usize);
        if portal.stays {
            return f64::INFINITY;
        }
        if portal.goes && has_joins {
            return JOINED;
        }
        let least = radius[a].min(radius[b]);
        if [a, b].iter().any(|&c| is_crevice(radius[c], volumes[c])) {
            // Widest opening first among crevices; through the mouth of a branch when there is no other.
            let last = if portal.mouth > 0.0 { LAST } else { 1.0 };
            return -last / (1.0 + 1.0 / portal.radius.max(1e-9));
        }
        if weight == Weight::ScaleFree {
            return (least / portal.radius.max(1e-9)).max(portal.mouth);
        }
        let area = portal.vector.length().max(1e-9);
        let projected = |b: &Aabb| {
            let s = b.size().max(DVec3::ZERO);
            let n = (portal.vector / area).abs();
            n.dot(DVec3::new(s.y * s.z, s.z * s.x, s.x * s.y))
        };
        let largest = projected(&boxes[a]).max(projected(&boxes[b]));
        let aspect = largest / area;
        match weight {
            Weight::Aspect => aspect,
            _ => aspect / largest.sqrt(),
        }
    };
    let mut queue: BinaryHeap<Candidate> = portals
        .iter()
        .map(|(&pair, p)| Candidate {
            weight: weigh(p, pair, &radius, &volumes, &boxes, false),
            pair,
            version: 0,
        })
        .collect();
    // What is known of a cell lies in the slot of the one that had more neighbors, so that a hall that takes in
    // thousands of crevices is not moved each time; `names` are the numbers that steps tell.
    let mut names: Vec<u32> = (0..n as u32).collect();
    let (mut steps, mut widest): (Vec<Step>, Vec<(u32, u32)>) = Default::default();
    let mut stop_at = None;
    // Portals that a person joined are among the next.
    let mut has_joins = false;
    while let Some(c) = queue.pop() {
        let Some(portal) = portals.get(&c.pair).filter(|p| p.version == c.version) else {
            continue;
        };
        if c.weight > stop && stop_at.is_none() {
            // Rooms are what they are without the joins before they are joined: what was shown is what was meant.
            if !has_joins {
                has_joins = true;
                let before = queue.len();
                let goes = portals.iter().filter(|(_, p)| p.goes && !p.stays);
                queue.extend(goes.map(|(&pair, p)| Candidate {
                    weight: JOINED,
                    pair,
                    version: p.version,
                }));
                if queue.len() > before {
                    queue.push(c);
                    continue;
                }
            }
            stop_at = Some(steps.len());
        }
        let [into, from] = {
            let (a, b) = c.pair;
            let count = |x: u32| neighbors[x as usize].len();
            if count(a) >= count(b) { [a, b] } else { [b, a] }
        };
        let [one, other] = [into, from].map(|x| names[x as usize]);
        steps.push(Step {
            into: one.min(other),
            from: one.max(other),
            weight: c.weight,
            is_mouth: weight == Weight::ScaleFree && portal.mouth > 0.0 && c.weight == portal.mouth,
            position: cells.portals[&portal.widest].center,
        });
        widest.push(portal.widest);
        names[into as usize] = one.min(other);
        portals.remove(&c.pair);
        let joined_radius = radius[into as usize].max(radius[from as usize]);
        let joined_box = boxes[into as usize].union(boxes[from as usize]);
        // The weight of a portal that nothing joined changes with its cells only.
        let joined_volume = volumes[into as usize] + volumes[from as usize];
        let was_crevice = is_crevice(radius[into as usize], volumes[into as usize]);
        let weighs_anew = joined_radius != radius[into as usize]
            || was_crevice != is_crevice(joined_radius, joined_volume)
            || weight != Weight::ScaleFree && joined_box != boxes[into as usize];
        radius[into as usize] = joined_radius;
        volumes[into as usize] = joined_volume;
        boxes[into as usize] = joined_box;
        neighbors[into as usize].remove(&from);
        let mut touched = Vec::new();
        for other in std::mem::take(&mut neighbors[from as usize]) {
            if other == into {
                continue;
            }
            neighbors[other as usize].remove(&from);
            neighbors[other as usize].insert(into);
            neighbors[into as usize].insert(other);
            touched.push(other);
            let old = portals
                .remove(&(from.min(other), from.max(other)))
                .expect("neighbors have a portal");
            // Vectors point from the lesser to the greater number.
            let sign = if (from < other) == (into < other) {
                1.0
            } else {
                -1.0
            };
            let pair = (into.min(other), into.max(other));
            let live = portals.entry(pair).or_insert(Live {
                // Less than any, so that it takes the other's place.
                radius: -1.0,
                mouth: 0.0,
                vector: DVec3::ZERO,
                widest: pair,
                stays: false,
                goes: false,
                version: 0,
            });
            if (old.radius, old.mouth) > (live.radius, live.mouth) {
                (live.radius, live.mouth, live.widest) = (old.radius, old.mouth, old.widest);
            }
            live.vector += old.vector * sign;
            live.stays |= old.stays;
            live.goes |= old.goes;
        }
        if weighs_anew {
            touched = neighbors[into as usize].iter().copied().collect();
        }
        for other in touched {
            let pair = (into.min(other), into.max(other));
            let live = portals.get_mut(&pair).expect("neighbors have a portal");
            // Unlike any version of this pair before, since steps only grow in number.
            live.version = steps.len() as u32;
            queue.push(Candidate {
                weight: weigh(live, pair, &radius, &volumes, &boxes, has_joins),
                pair,
                version: live.version,
            });
        }
    }
    let decimation = Decimation {
        n_cells: n,
        stop: stop_at.unwrap_or(steps.len()),
        steps,
    };
    (decimation, widest)
}

impl Decimation {
    /// The cell that each cell of the beginning belongs to after the first `n` steps.
    #[must_use]
    pub fn after(&self, n: usize) -> Vec<u32> {
        let mut cell: Vec<u32> = (0..self.n_cells as u32).collect();
        // A cell is gone before the one that it went into: from the last on.
        for s in self.steps.iter().take(n).rev() {
            cell[s.from as usize] = cell[s.into as usize];
        }
        cell
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
        );
        assert_eq!((done.steps[0].into, done.steps[0].from), (2, 3));
        assert_eq!(done.stop, 1);
    }
}

//! *Conservative*, finer than cells: visible volumes and parts contain everything that lines find.
//!
//! An unblocked line is a proof in both directions: each end is visible from the other. So the paths of all segments
//! and rays are checked, and further lines are aimed at things that the file calls hidden. A file that stores too
//! much as visible breaks no promise and is not found.

use enfilade_cpg::{CellId, PartNumbers, PortalId, Pvs, World};
use enfilade_geom::{Aabb, Bvh, DVec3, Ray, Triangle};

use crate::details::triangles_of;
use crate::report::{Break, Failure, FailureKind, Tally};
use crate::rng::Rng;
use crate::sealed::{Path, follow};
use crate::subject::{Subject, is_closed, point_of_triangle, to_dvec};

/// Attempts to find a target.
const DRAWS: usize = 8;
/// Inset of points of a portal's piece from its rim, as a share of the way to its center.
const INSET: f64 = 0.02;

/// A world's claims about visibility by pair of cells, prepared for queries.
pub(crate) struct Visible<'a> {
    world: &'a World,
    pvs: &'a Pvs,
    numbers: PartNumbers,
    /// First pair of each cell.
    first_pair: Vec<usize>,
    /// Ordered pairs of different cells of which the first sees the second.
    pairs: Vec<[CellId; 2]>,
    /// Parts in each cell. Empty if the world stores no visible parts.
    parts_of: Vec<Vec<u32>>,
    /// Triangles of each detail, if the world stores visible parts; and a tree of all, with the detail of each.
    details: Vec<Vec<Triangle>>,
    detail_bvh: Bvh,
    detail_of: Vec<u32>,
    slack: f64,
}

/// A line from a point of a cell to a point of air, or of a part.
struct AimedLine {
    from: CellId,
    a: DVec3,
    b: DVec3,
    part: Option<u32>,
}

impl<'a> Visible<'a> {
    /// Returns `None` if the world stores only whole cells.
    pub(crate) fn new(world: &'a World, eps: f64) -> Option<Self> {
        let pvs = world.pvs.as_ref()?;
        if pvs.volumes.is_none() && pvs.parts.is_none() {
            return None;
        }
        let numbers = PartNumbers::new(world);
        let mut first_pair = Vec::new();
        let mut n_pairs = 0;
        for c in (0..pvs.n_cells() as u32).map(CellId) {
            first_pair.push(n_pairs);
            n_pairs += pvs.n_visible_from(c);
        }
        let mut parts_of = Vec::new();
        let mut details = Vec::new();
        if pvs.parts.is_some() {
            parts_of = vec![Vec::new(); world.graph.cells.len()];
            for (i, batch) in world.batches.iter().enumerate() {
                for c in &batch.cells {
                    parts_of[c.idx()].extend(numbers.of_batch(i));
                }
            }
            for (i, detail) in (0..).zip(&world.details) {
                for c in &detail.cells {
                    parts_of[c.idx()].push(numbers.of_detail(i));
                }
            }
            details = world
                .details
                .iter()
                .map(|d| triangles_of(world, d))
                .collect();
        }
        let all = (0..).zip(&details);
        let detail_of = all.flat_map(|(d, own): (u32, _)| std::iter::repeat_n(d, own.len()));
        let detail_of = detail_of.collect();
        Some(Self {
            world,
            pvs,
            numbers,
            first_pair,
            pairs: pvs
                .pairs()
                .filter(|(a, b)| a != b)
                .map(|(a, b)| [a, b])
                .collect(),
            parts_of,
            detail_bvh: Bvh::build(&details.concat()),
            detail_of,
            details,
            slack: eps,
        })
    }

    fn pair(&self, from: CellId, to: CellId) -> Option<usize> {
        let mut before = 0;
        for &[first, end] in self.pvs.runs_from(from) {
            if to.0 < first {
                return None;
            }
            if to.0 < end {
                return Some(self.first_pair[from.idx()] + before + (to.0 - first) as usize);
            }
            before += (end - first) as usize;
        }
        None
    }

    /// Returns `true` if the volume of a pair contains a point, up to rounding.
    fn holds(&self, pair: usize, p: DVec3) -> bool {
        let Some(volumes) = &self.pvs.volumes else {
            return true;
        };
        let is_before = |&[x, y, z, d]: &[f64; 4]| DVec3::new(x, y, z).dot(p) + d >= -self.slack;
        let mut pieces = volumes.pieces_of(pair);
        pieces.any(|piece| piece.iter().all(is_before))
    }

    /// Returns `true` if a part of any of `cells` is stored as visible from a cell.
    fn lists(&self, from: CellId, cells: &[CellId], part: u32) -> bool {
        let Some(parts) = &self.pvs.parts else {
            return true;
        };
        let pairs = cells.iter().filter_map(|&c| self.pair(from, c));
        let mut rows = pairs.map(|pair| parts.runs_of(pair));
        rows.any(|row| {
            let at = row.partition_point(|run| run[1] <= part);
            row.get(at).is_some_and(|run| run[0] <= part)
        })
    }

    fn cells_of(&self, subject: &Subject, part: u32) -> &'a [CellId] {
        match part.checked_sub(self.numbers.n_triangles()) {
            Some(detail) => &self.world.details[detail as usize].cells,
            None => &self.world.batches[subject.own[part as usize].1 as usize].cells,
        }
    }

    /// Returns problems that need no ray, a line each.
    pub(crate) fn check(&self) -> Vec<String> {
        let mut out = Vec::new();
        let cells = self.world.graph.cells.iter();
        for (c, cell) in (0..).map(CellId).zip(cells) {
            // A cell sees itself, so the pair exists.
            let Some(own) = self.pair(c, c) else { continue };
            let [low, high] = cell.aabb.map(to_dvec);
            let corners = Aabb::new(low, high).corners();
            if !corners.iter().all(|&p| self.holds(own, p)) {
                out.push(format!(
                    "{}: its volume does not contain all of itself",
                    cell.name
                ));
            }
            let Some(parts) = self.parts_of.get(c.idx()) else {
                continue;
            };
            if let Some(part) = parts.iter().find(|&&p| !self.lists(c, &[c], p)) {
                out.push(format!(
                    "{}: part {part} is in it, but not visible from it",
                    cell.name
                ));
            }
        }
        for (i, portal) in self.world.graph.portals.iter().enumerate() {
            let points = portal.pieces.iter().flat_map(|piece| {
                let corners: Vec<DVec3> = piece.iter().copied().map(to_dvec).collect();
                let middle = corners.iter().sum::<DVec3>() / corners.len().max(1) as f64;
                corners.into_iter().map(move |p| p.lerp(middle, INSET))
            });
            let points: Vec<DVec3> = points.collect();
            let [a, b] = portal.cells;
            let id = PortalId(i as u32);
            for [from, to] in [[a, b], [b, a]] {
                if is_closed(self.world, id, from) {
                    continue;
                }
                let pair = self.pair(from, to);
                if !pair.is_some_and(|pair| points.iter().all(|&p| self.holds(pair, p))) {
                    let [from, to] = [from, to].map(|c| &self.world.graph[c].name);
                    out.push(format!(
                        "portal {i}: the volume that {from} sees of {to} does not contain it"
                    ));
                }
            }
        }
        out
    }

    /// Returns the first contradiction on a path: one cell sees the other, but not the part of it that the path runs
    /// through.
    fn break_on(&self, path: &Path) -> Option<Break> {
        let cells = &path.cells;
        for (i, from) in cells.iter().enumerate() {
            for (j, to) in cells.iter().enumerate().skip(i + 1) {
                let both = [([i, j], [from, to]), ([j, i], [to, from])];
                for (ends, [eye, seen]) in both {
                    if !path.is_open(ends[0], ends[1]) {
                        continue;
                    }
                    let wrong = |kind, at| Break {
                        kind,
                        expected: Some(eye.0),
                        found: Some(seen.0),
                        portal: None,
                        at,
                    };
                    let [first, last] = [0.02, 0.98].map(|s| {
                        let t = seen.1[0] + (seen.1[1] - seen.1[0]) * s;
                        path.ends[0].lerp(path.ends[1], t)
                    });
                    let Some(pair) = self.pair(eye.0, seen.0) else {
                        return Some(wrong(FailureKind::Hidden, first));
                    };
                    if let Some(p) = [first, last].into_iter().find(|&p| !self.holds(pair, p)) {
                        return Some(wrong(FailureKind::OutsideVolume, p));
                    }
                }
            }
        }
        None
    }

    /// Judges an unblocked path.
    pub(crate) fn check_cells(&self, subject: &Subject, path: &Path, i: u64, tally: &mut Tally) {
        tally.visible.lines += 1;
        if let Some(wrong) = self.break_on(path) {
            let failure = Failure::of_break(&wrong, i, path.ends, &[]);
            tally.add_failure(subject, failure);
        }
    }

    /// Judges the end of a path: one of these parts, or several in one place, of which one suffices.
    pub(crate) fn check_parts(
        &self,
        subject: &Subject,
        path: &Path,
        parts: &[u32],
        i: u64,
        tally: &mut Tally,
    ) {
        let Some(last) = path.cells.last() else {
            return;
        };
        // A wall whose batch does not list the cell before it is met from behind, or lies upon another.
        let is_met = |part: &&u32| {
            **part >= self.numbers.n_triangles() || self.cells_of(subject, **part).contains(&last.0)
        };
        let parts: Vec<u32> = parts.iter().filter(is_met).copied().collect();
        if self.pvs.parts.is_none() || parts.is_empty() {
            return;
        }
        tally.visible.parts += 1;
        let is_seen = |from: CellId| {
            let mut parts = parts.iter();
            parts.any(|&p| self.lists(from, self.cells_of(subject, p), p))
        };
        let last_idx = path.cells.len() - 1;
        let is_open = |i: &usize| path.is_open(*i, last_idx);
        let eyes = (0..=last_idx).filter(is_open).map(|i| path.cells[i].0);
        if let Some(from) = eyes.into_iter().find(|&c| !is_seen(c)) {
            let wrong = Break {
                kind: FailureKind::HiddenPart,
                expected: Some(from),
                found: Some(last.0),
                portal: None,
                at: path.ends[1],
            };
            let failure = Failure::of_break(&wrong, i, path.ends, &[]);
            tally.add_failure(subject, failure);
        }
    }

    /// Aims line number `i` through a portal at something stored as hidden.
    pub(crate) fn try_line(&self, subject: &Subject, rng: &mut Rng, i: u64, tally: &mut Tally) {
        tally.visible.drawn += 1;
        if self.pairs.is_empty() {
            return;
        }
        let [from, to] = self.pairs[rng.below(self.pairs.len())];
        let Some(a) = point_beside_portal(subject, rng, from) else {
            return;
        };
        let is_part = i % 2 == 1 || self.pvs.volumes.is_none();
        let aimed = if is_part {
            self.hidden_part(subject, rng, [from, to])
        } else {
            None
        };
        let (b, part) = match aimed {
            Some((p, part)) => (p, Some(part)),
            None if subject.sampled.binary_search(&to).is_ok() => {
                let pair = self.pair(from, to);
                let is_out = |p: &DVec3| pair.is_none_or(|pair| !self.holds(pair, *p));
                let mut draws = (0..DRAWS).map(|_| subject.point_in_cell(rng, to));
                let Some(p) = draws.find(is_out) else { return };
                (p, None)
            }
            None => return,
        };
        let line = AimedLine { from, a, b, part };
        self.try_aimed(subject, rng, line, i, tally);
    }

    /// Follows a line from a point of a cell to a point of air, or to a part.
    fn try_aimed(
        &self,
        subject: &Subject,
        rng: &mut Rng,
        AimedLine { from, a, b, part }: AimedLine,
        i: u64,
        tally: &mut Tally,
    ) {
        // Stop slightly before a triangle of a wall; a triangle of an object may be anywhere in the air.
        let is_wall = part.is_some_and(|p| p < self.numbers.n_triangles());
        let end = if is_wall {
            let back = (a - b).normalize_or_zero();
            b + back * (4.0 * subject.eps / slope(subject, part, back).max(1e-3))
        } else {
            b
        };
        if a.distance(end) < 100.0 * subject.eps
            || subject.is_close_to_surface(a)
            || subject.is_close_to_surface(end) && !is_wall
            || subject.blockers.any_hit(a, end, |_| false)
            || subject.is_grazing(a, end)
        {
            return;
        }
        let mut crossings = Vec::new();
        subject.crossings(a, end, &mut crossings);
        // Other checks find a path that is itself broken.
        let Ok(path) = follow(subject, rng, [a, end], from, &mut crossings) else {
            return;
        };
        self.check_cells(subject, &path, i, tally);
        match part {
            // Something else may lie on the wall, or just before it.
            Some(part) if is_wall && !is_first(subject, part, [a, b]) => {}
            Some(part) => self.check_parts(subject, &path, &[part], i, tally),
            None => self.check_details(subject, &path, i, tally),
        }
    }

    /// Judges the objects that a path passes: they do not hide, since they may move.
    fn check_details(&self, subject: &Subject, path: &Path, i: u64, tally: &mut Tally) {
        let [a, b] = path.ends;
        let mut met: Vec<u32> = Vec::new();
        let ray = Ray::segment(a, b);
        self.detail_bvh.for_each_hit(&ray, |hit| {
            met.push(
                self.numbers
                    .of_detail(self.detail_of[hit.triangle as usize]),
            );
        });
        met.sort_unstable();
        met.dedup();
        for part in met {
            self.check_parts(subject, path, &[part], i, tally);
        }
    }

    /// Returns a point of a part stored as hidden, preferably one in the visible volume.
    fn hidden_part(
        &self,
        subject: &Subject,
        rng: &mut Rng,
        [from, to]: [CellId; 2],
    ) -> Option<(DVec3, u32)> {
        let parts = self.parts_of.get(to.idx()).filter(|p| !p.is_empty())?;
        let pair = self.pair(from, to);
        let mut any = None;
        for _ in 0..DRAWS {
            let part = parts[rng.below(parts.len())];
            if self.lists(from, self.cells_of(subject, part), part) {
                continue;
            }
            let t = match part.checked_sub(self.numbers.n_triangles()) {
                None => subject.own[part as usize].0,
                Some(d) => {
                    let own = &self.details[d as usize];
                    if own.is_empty() {
                        continue;
                    }
                    own[rng.below(own.len())]
                }
            };
            let p = point_of_triangle(rng, &t);
            any = Some((p, part));
            if pair.is_some_and(|pair| self.holds(pair, p)) {
                break;
            }
        }
        any
    }
}

/// Returns `true` if a triangle of the world is the first that a line to a point of it meets; a source numbers
/// triangles differently.
fn is_first(subject: &Subject, part: u32, [a, b]: [DVec3; 2]) -> bool {
    let ray = Ray {
        origin: a,
        direction: (b - a).normalize_or_zero(),
        t_max: f64::INFINITY,
    };
    let hit = subject.blockers.closest_hit(&ray, |_| false);
    !subject.has_source && hit.is_some_and(|hit| hit.triangle == part)
}

/// Returns the sine of the angle between a line and the triangle of a wall: 1 head-on, 0 along it.
fn slope(subject: &Subject, part: Option<u32>, direction: DVec3) -> f64 {
    let t = part.map(|p| subject.own[p as usize].0);
    let n = t.map(|t| (t[1] - t[0]).cross(t[2] - t[0]).normalize_or_zero());
    n.map_or(1.0, |n| n.dot(direction).abs())
}

/// Returns a point of a cell close to one of its portals.
fn point_beside_portal(subject: &Subject, rng: &mut Rng, cell: CellId) -> Option<DVec3> {
    let portals = &subject.world.graph[cell].portals;
    if portals.is_empty() {
        return None;
    }
    let portal = portals[rng.below(portals.len())];
    let view = &subject.portals[portal.0 as usize];
    if view.fan.is_empty() {
        return None;
    }
    let into = if view.cells[0] == cell {
        -view.normal
    } else {
        view.normal
    };
    let away = into * rng.log_range(10.0 * subject.eps, 1.0);
    let p = subject.point_of_portal(rng, portal) + away;
    (subject.locator.locate(p) == Some(cell)).then_some(p)
}

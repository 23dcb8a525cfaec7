//! Bounds of what might be seen through an opening, without a table of all pairs: a flood that keeps for each opening
//! that it reaches the box around the part that lines may cross.
//!
//! A line through the source and the part of an opening stays between the planes that separate the two; the next
//! opening is clipped by them. Parts that several chains leave of an opening are merged in a box, so that each opening
//! is entered a few times at most, nearest first. Weaker than the search (`flow`), which follows each chain by itself,
//! and stronger than the sides of planes (`dirs`): it stays near where windows face a street, while half of a town lies
//! in front of each.
//!
//! Errs to visible, by the rules of `clip`.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use enfilade_geom::{Aabb, DVec3};

use crate::clip::{Arena, Poly};
use crate::dirs::Dirs;
use crate::flow::{back_of, facing, front_of};
use crate::planes::{FacedOutline, Four, Side, hide, separators};
use crate::tolerance::{HalfSpace, Tolerance};

/// Times that the box around an opening's part grows before all of the opening counts.
const MAX_GROWN: u8 = 3;

/// The graph of a flood and its limits.
#[derive(Clone, Copy)]
pub(crate) struct Ground<'a> {
    pub(crate) dirs: &'a Dirs,
    pub(crate) tolerance: Tolerance,
    pub(crate) far: Option<f64>,
}

/// An opening that a flood has reached.
struct Reached {
    dir: u32,
    /// Box around the part that lines from the source may cross.
    part: Aabb,
    n_grown: u8,
    /// All of the opening counts; the part cannot grow any more.
    is_whole: bool,
    is_queued: bool,
}

/// Buffers of a flood, kept for the next.
pub(crate) struct Windows {
    /// For each direction, one more than its place in `reached`; 0 if it is not reached.
    places: Vec<u32>,
    reached: Vec<Reached>,
    /// Distances from the source as bits, which order positive numbers, and directions.
    queue: BinaryHeap<Reverse<(u64, u32)>>,
    arena: Arena,
    planes: Vec<Four>,
}

impl Windows {
    pub(crate) fn new(dirs: &Dirs) -> Self {
        Self {
            places: vec![0; dirs.len()],
            reached: Vec::new(),
            queue: BinaryHeap::new(),
            arena: Arena::default(),
            planes: Vec::new(),
        }
    }

    /// Returns the directions that a line through `source` might cross after it, ascending; only those that `allows`
    /// holds for, which all others on the way must be too. `None` if there are more than `most`.
    pub(crate) fn flood(
        &mut self,
        ground: &Ground<'_>,
        source: usize,
        most: usize,
        allows: impl Fn(usize) -> bool,
    ) -> Option<Vec<u32>> {
        for reached in self.reached.drain(..) {
            self.places[reached.dir as usize] = 0;
        }
        self.queue.clear();
        self.enter(ground, source, source, &allows);
        while let Some(Reverse((_, at))) = self.queue.pop() {
            if self.reached.len() > most {
                return None;
            }
            self.enter(ground, source, at as usize, &allows);
        }
        let mut all: Vec<u32> = self.reached.iter().map(|reached| reached.dir).collect();
        all.sort_unstable();
        (all.len() <= most).then_some(all)
    }

    /// Adds what lies behind an opening, seen through its part.
    fn enter(
        &mut self,
        ground: &Ground<'_>,
        source: usize,
        pass: usize,
        allows: &impl Fn(usize) -> bool,
    ) {
        let Ground {
            dirs, tolerance, ..
        } = ground;
        self.arena.release(0);
        self.planes.clear();
        let mut from = self.arena.push(dirs.winding(source), source as u32);
        let source_turn = dirs.all[source].turn;
        if pass != source {
            let place = self.places[pass] as usize - 1;
            self.reached[place].is_queued = false;
            let Some(part) = self.part_of(ground, place) else {
                return;
            };
            let back = back_of(dirs, pass);
            if !back.holds(dirs.balls[source]) {
                let Some(clipped) = self.arena.clip(from, back, source_turn, tolerance) else {
                    return;
                };
                from = clipped;
            }
            separators(
                FacedOutline::new(self.arena.get(from), facing(dirs, source as u32)),
                FacedOutline::new(self.arena.get(part), facing(dirs, pass as u32)),
                tolerance,
                &mut self.planes,
            );
        }
        let ends = [source, dirs.reverse[source] as usize];
        let back = dirs.reverse[pass] as usize;
        for next in dirs.after(pass) {
            if next == back || ends.contains(&next) || !allows(next) {
                continue;
            }
            let place = self.places[next] as usize;
            if place > 0 && self.reached[place - 1].is_whole {
                continue;
            }
            let mark = self.arena.mark();
            if let Some(part) = self.narrow(ground, source, from, pass, next) {
                self.reach(dirs, source, part);
            }
            self.arena.release(mark);
        }
    }

    /// Returns the part of an opening that its box holds.
    fn part_of(&mut self, ground: &Ground<'_>, place: usize) -> Option<Poly> {
        let Reached {
            dir,
            part,
            is_whole,
            ..
        } = self.reached[place];
        let winding = ground.dirs.winding(dir as usize);
        let mut poly = self.arena.push(winding, dir);
        // Parts are never dropped for being thin: lines with clearance were found to cross them.
        let whole = Tolerance {
            clearance: 0.0,
            ..ground.tolerance
        };
        let turn = ground.dirs.all[dir as usize].turn;
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            if is_whole {
                break;
            }
            for (normal, offset) in [(axis, axis.dot(part.min)), (-axis, -axis.dot(part.max))] {
                poly = (self.arena).clip(poly, HalfSpace { normal, offset }, turn, &whole)?;
            }
        }
        Some(poly)
    }

    /// Returns the part of the opening `next` that lines from `from`, a part of the source, might cross after `pass`.
    fn narrow(
        &mut self,
        ground: &Ground<'_>,
        source: usize,
        from: Poly,
        pass: usize,
        next: usize,
    ) -> Option<Poly> {
        let Ground {
            dirs, tolerance, ..
        } = ground;
        let ball = dirs.balls[next];
        let has_sides = |a: usize| {
            dirs.is_past(a, next, tolerance.clearance)
                && dirs.is_past(dirs.reverse[next] as usize, a, tolerance.clearance)
        };
        if hide(&self.planes, ball)
            || !has_sides(source)
            || pass != source && !has_sides(pass)
            || !dirs.is_near(source, next, ground.far)
        {
            return None;
        }
        let turn = dirs.all[next].turn;
        let back = back_of(dirs, next);
        if !back.holds(dirs.balls[source]) {
            let source_turn = dirs.all[source].turn;
            self.arena.clip(from, back, source_turn, tolerance)?;
        }
        let mut target = self.arena.push(dirs.winding(next), next as u32);
        let front = front_of(dirs, source as u32);
        if !front.holds(ball) {
            target = self.arena.clip(target, front, turn, tolerance)?;
        }
        let front = front_of(dirs, pass as u32);
        if pass != source && !front.holds(ball) {
            target = self.arena.clip(target, front, turn, tolerance)?;
        }
        let planes = (&self.planes[..], Side::After);
        self.arena
            .clip_all(target, planes.0, planes.1, ball, turn, tolerance)
    }

    /// Adds a part of an opening to what is reached; queues the opening if that is new.
    fn reach(&mut self, dirs: &Dirs, source: usize, part: Poly) {
        let dir = part.dir as usize;
        let found = Aabb::of_points(self.arena.get(part));
        let all = Aabb::of_points(dirs.winding(dir));
        let place = self.places[dir] as usize;
        if place == 0 {
            self.reached.push(Reached {
                dir: part.dir,
                part: found,
                n_grown: 0,
                is_whole: holds(&found, &all),
                is_queued: false,
            });
            self.places[dir] = self.reached.len() as u32;
        } else {
            let reached = &mut self.reached[place - 1];
            if holds(&reached.part, &found) {
                return;
            }
            reached.part = reached.part.union(found);
            reached.n_grown += 1;
            reached.is_whole = reached.n_grown > MAX_GROWN || holds(&reached.part, &all);
        }
        let reached = &mut self.reached[self.places[dir] as usize - 1];
        if !std::mem::replace(&mut reached.is_queued, true) {
            let distance = dirs.all[source].center.distance(dirs.all[dir].center);
            self.queue.push(Reverse((distance.to_bits(), part.dir)));
        }
    }
}

/// Returns `true` if one box holds another.
fn holds(outer: &Aabb, inner: &Aabb) -> bool {
    outer.min.cmple(inner.min).all() && outer.max.cmpge(inner.max).all()
}

#[cfg(test)]
mod tests {
    use enfilade_cpg::{SightGraph, SightPortal};
    use enfilade_testkit::{Rng, town, village};

    use super::*;
    use crate::rays::walk;

    fn ground(dirs: &Dirs) -> Ground<'_> {
        Ground {
            dirs,
            tolerance: Tolerance::new(dirs.scale, 1e-8 * dirs.scale),
            far: None,
        }
    }

    #[test]
    fn a_flood_reaches_all_that_a_line_crosses_and_little_more() {
        for (graph, has_gates) in [(town(400, 1).graph, true), (village(40, 1).graph, false)] {
            let dirs = Dirs::new(&graph);
            let ground = ground(&dirs);
            let mut windows = Windows::new(&dirs);
            let mut rows = Vec::new();
            for d in 0..dirs.len() {
                rows.push(windows.flood(&ground, d, usize::MAX, |_| true).unwrap());
            }
            let mut rng = Rng::new(3);
            let mut n_crossed = 0;
            let mut random = crate::rng::Rng::new(1);
            for _ in 0..200_000 {
                let d = rng.below(dirs.len());
                let origin = dirs.random_point(d, &mut random);
                let mut chain = Vec::new();
                let direction = rng.turn() * DVec3::X * DVec3::new(1.0, 0.1, 1.0);
                if direction.dot(dirs.all[d].normal) > 0.0 && dirs.is_inside(d, origin, 1e-6) {
                    walk(&dirs, d, origin, direction, 1e-6, None, &mut chain);
                }
                for &q in &chain {
                    assert!(rows[d].binary_search(&q).is_ok(), "{d} {q}");
                }
                n_crossed += chain.len();
            }
            assert!(n_crossed > 1_000, "{n_crossed}");
            let n_reached: usize = rows.iter().map(Vec::len).sum();
            let sides = dirs.might_see(1e-8 * dirs.scale, None).count_all() as usize;
            assert!(
                n_reached < sides / if has_gates { 5 } else { 1 },
                "{n_reached} {sides}"
            );
        }
    }

    #[test]
    fn floods_keep_to_what_is_allowed_and_give_up_in_time() {
        let graph = town(400, 1).graph;
        let dirs = Dirs::new(&graph);
        let ground = ground(&dirs);
        let mut windows = Windows::new(&dirs);
        for d in (0..dirs.len()).step_by(7) {
            let all = windows.flood(&ground, d, usize::MAX, |_| true).unwrap();
            let even = windows.flood(&ground, d, usize::MAX, |q| q % 2 == 0);
            assert!(even.unwrap().iter().all(|q| q % 2 == 0 && all.contains(q)));
            let n = all.len();
            assert_eq!(windows.flood(&ground, d, n, |_| true), Some(all));
            assert!(n == 0 || windows.flood(&ground, d, n - 1, |_| true).is_none());
        }
    }

    #[test]
    fn windows_in_one_plane_do_not_see_each_other() {
        // Three windows side by side, from a room each into a common one.
        let window = |i: u32| SightPortal {
            cells: [i, 3],
            winding: [[0.0, 0.0], [0.5, 0.0], [0.5, 1.0], [0.0, 1.0]]
                .map(|[x, y]| DVec3::new(x + 0.1 + f64::from(i), y + 0.3, 7.7))
                .to_vec(),
            pieces: Vec::new(),
        };
        let graph = SightGraph {
            n_cells: 4,
            portals: (0..3).map(window).collect(),
        };
        let dirs = Dirs::new(&graph);
        let mut windows = Windows::new(&dirs);
        for d in 0..dirs.len() {
            let row = windows.flood(&ground(&dirs), d, usize::MAX, |_| true);
            assert_eq!(row, Some(Vec::new()));
        }
    }

    #[test]
    fn an_opening_that_two_ways_lead_to_is_seen_through_by_both() {
        // From a window through either of two doors, and on through one gate that is as wide as both: behind it, each door
        // shows one window.
        let opening = |cells: [u32; 2], [low, high]: [f64; 2], z: f64| SightPortal {
            cells,
            winding: [[low, 0.0], [high, 0.0], [high, 1.0], [low, 1.0]]
                .map(|[x, y]| DVec3::new(x, y, z))
                .to_vec(),
            pieces: Vec::new(),
        };
        let graph = SightGraph {
            n_cells: 6,
            portals: vec![
                opening([0, 1], [-0.5, 0.5], 0.0),
                opening([1, 2], [-3.0, -2.0], 2.0),
                opening([1, 2], [2.0, 3.0], 2.0),
                opening([2, 3], [-9.0, 9.0], 3.0),
                opening([3, 4], [-6.0, -5.0], 4.0),
                opening([3, 5], [5.0, 6.0], 4.0),
            ],
        };
        let dirs = Dirs::new(&graph);
        let mut windows = Windows::new(&dirs);
        let of_name = |name| (0..dirs.len()).find(|&d| dirs.name(d) == name).unwrap();
        let row = windows.flood(&ground(&dirs), of_name(0), usize::MAX, |_| true);
        let mut names: Vec<u32> = (row.unwrap().iter())
            .map(|&d| dirs.name(d as usize))
            .collect();
        names.sort_unstable();
        assert_eq!(names, [2, 4, 6, 8, 10]);
    }
}

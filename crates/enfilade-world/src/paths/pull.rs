//! Paths over floors, pulled taut.
//!
//! A path found square by square bends where squares do. Each bend moves straight towards the line between its neighbors, as far
//! as floors allow, by halving; where a line is caught, as a string at a post, it gets another bend; bends that a straight line
//! can skip are removed. No step makes the path longer, so the process ends, at a path that is the shortest of those it can be
//! pulled to without leaving the floors. O(rounds · bends · squares along them).

use enfilade_geom::DVec3;

use crate::paths::floors::{Floors, Hindrance};
use crate::paths::strides::walk_straight;

/// A point of a path, and its floor.
pub(crate) type Bend = (DVec3, u32);

/// Maximum number of rounds; most paths are taut after three.
const ROUNDS: usize = 10;
/// Maximum number of bends of a path while it is pulled.
const MAX_BENDS: usize = 256;

/// Pulls a path taut: removes bends that straight lines can skip, and moves the others towards the line between their neighbors.
/// Adds a bend where a line is caught.
pub(crate) fn pull_taut(
    floors: &Floors,
    bends: &mut Vec<Bend>,
    may: &mut impl FnMut(Hindrance) -> bool,
) {
    drop_bends(floors, bends, may);
    for _ in 0..ROUNDS {
        let mut shorter = 0.0;
        let mut i = 1;
        while i + 1 < bends.len() {
            shorter += move_bend(floors, bends, i, may);
            i += 1 + catch(floors, bends, i, may);
        }
        // Between catches, bends come free.
        for i in 1..bends.len().saturating_sub(1) {
            shorter += move_bend(floors, bends, i, may);
        }
        drop_bends(floors, bends, may);
        if shorter < 1e-4 {
            break;
        }
    }
}

/// Adds bends where the lines to a bend's neighbors would be caught if it moved a little on; returns their number.
fn catch(
    floors: &Floors,
    bends: &mut Vec<Bend>,
    i: usize,
    may: &mut impl FnMut(Hindrance) -> bool,
) -> usize {
    let [a, b, c] = [bends[i - 1], bends[i], bends[i + 1]];
    let target = toward(a.0, b.0, c.0);
    let side = floors.squares().side;
    let far = (target - b.0).with_y(0.0).length();
    if far < side || bends.len() + 2 > MAX_BENDS {
        return 0;
    }
    let p = b.0.lerp(target, (side / far).min(1.0));
    let mut n = 0;
    // From either neighbor: the last floor before the obstacle, and the line that passes it.
    for (from, leg, at) in [(c, [b, c], i + 1), (a, [a, b], i)] {
        let mut last = from.1;
        let end = walk_straight(floors, from.0, from.1, p, may, |_, _, to| last = to);
        if end.is_some() {
            continue;
        }
        let line = (b.0 - from.0).with_y(0.0);
        // A little beyond, or it would be caught there itself.
        let passed = (floors.point(last) - from.0).with_y(0.0).dot(line) / line.length();
        let t = (passed.max(0.0) + 1.5 * side) / line.length();
        let caught = from.0 + line * t;
        let is_between =
            t > 0.0 && t < 1.0 && caught.distance(from.0).min(caught.distance(b.0)) > side;
        if !is_between {
            continue;
        }
        // A line along the border of two squares may be caught where the whole is not.
        let reached = straight(floors, leg[0], caught, may)
            .filter(|&floor| straight(floors, (caught, floor), leg[1].0, may) == Some(leg[1].1));
        if let Some(floor) = reached {
            bends.insert(at, (caught.with_y(floors.point(floor).y), floor));
            n += 1;
        }
    }
    n
}

/// Returns the point of the line between two, in plan, that is nearest to a third.
fn toward(a: DVec3, b: DVec3, c: DVec3) -> DVec3 {
    let line = (c - a).with_y(0.0);
    let t = (b - a).with_y(0.0).dot(line) / line.length_squared().max(1e-12);
    a + line * t.clamp(0.0, 1.0)
}

/// Returns the floor at the end of a straight walk; `None` if blocked.
pub(crate) fn straight(
    floors: &Floors,
    from: Bend,
    to: DVec3,
    may: &mut impl FnMut(Hindrance) -> bool,
) -> Option<u32> {
    walk_straight(floors, from.0, from.1, to, may, |_, _, _| {})
}

/// Removes all bends that a straight line can skip, from the start on.
fn drop_bends(floors: &Floors, bends: &mut Vec<Bend>, may: &mut impl FnMut(Hindrance) -> bool) {
    let mut n_kept = 1;
    for i in 1..bends.len() {
        let next = bends.get(i + 1).copied();
        let can_skip = next
            .is_some_and(|next| straight(floors, bends[n_kept - 1], next.0, may) == Some(next.1));
        if !can_skip {
            bends[n_kept] = bends[i];
            n_kept += 1;
        }
    }
    bends.truncate(n_kept);
}

/// Moves a bend as far towards the line between its neighbors as the floors allow; returns the reduction in length.
fn move_bend(
    floors: &Floors,
    bends: &mut [Bend],
    i: usize,
    may: &mut impl FnMut(Hindrance) -> bool,
) -> f64 {
    let [a, b, c] = [bends[i - 1], bends[i], bends[i + 1]];
    let target = toward(a.0, b.0, c.0);
    let (mut low, mut high) = (0.0, 1.0);
    let mut best = b;
    let mut share = 1.0;
    for _ in 0..8 {
        let p = b.0.lerp(target, share);
        let floor = straight(floors, a, p, may);
        let fits = floor.filter(|&f| straight(floors, (p, f), c.0, may) == Some(c.1));
        match fits {
            Some(floor) => {
                best = (p.with_y(floors.point(floor).y), floor);
                low = share;
            }
            None => high = share,
        }
        if low == 1.0 {
            break;
        }
        share = 0.5 * (low + high);
    }
    bends[i] = best;
    let plan = |p: DVec3, q: DVec3| (p - q).with_y(0.0).length();
    plan(a.0, b.0) + plan(b.0, c.0) - plan(a.0, best.0) - plan(best.0, c.0)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::bodies::Agent;
    use crate::layout::Layout;
    use enfilade_cpg::{Batch, Cell, CellId, CellPortalGraph, Locator, World};
    use enfilade_geom::Aabb;
    use enfilade_geom::scene::Primitive;

    #[test]
    fn a_slack_path_is_pulled_to_the_wall_end() {
        let [low, high] = [DVec3::new(0.0, -1.0, 0.0), DVec3::new(10.0, 3.0, 10.0)];
        let floor = Aabb::new(low, high.with_y(0.0));
        let block = Aabb::new(DVec3::new(4.0, 0.0, 0.0), DVec3::new(6.0, 3.0, 4.0));
        let corners = [floor, block].map(|b| b.triangles()).concat().concat();
        let positions: Vec<[f32; 3]> = corners.iter().map(|p| p.as_vec3().to_array()).collect();
        let mut world = World::default();
        world.batches.push(Batch {
            cells: vec![CellId(0)],
            primitive: Primitive {
                indices: (0..positions.len() as u32).collect(),
                positions,
                ..Primitive::default()
            },
            ..Batch::default()
        });
        world.graph = CellPortalGraph {
            cells: vec![Cell::default()],
            locator: Arc::new(Locator {
                bounds: Aabb::new(low, high),
                root: Locator::leaf(Some(CellId(0))),
                ..Locator::default()
            }),
            ..CellPortalGraph::default()
        };
        let floors = Floors::new(&Layout::new(&world), None, &world, Agent::default(), |_| {
            true
        });
        let on = |x: f64, z: f64| {
            let p = DVec3::new(x, 0.0, z);
            (p, floors.below(p).unwrap())
        };
        let mut bends = vec![on(2.0, 2.0), on(5.0, 8.0), on(8.0, 2.0)];
        pull_taut(&floors, &mut bends, &mut |_| true);
        let length: f64 = bends.windows(2).map(|w| w[0].0.distance(w[1].0)).sum();
        // Tangents to circles about both wall ends, short arcs, and the side between.
        let (r, d) = (Agent::default().radius, 8.0_f64.sqrt());
        let least =
            2.0 * (d * d - r * r).sqrt() + 2.0 + 2.0 * r * (45.0_f64.to_radians() + (r / d).asin());
        assert!(
            length > least - 0.06 && length < least + 0.1,
            "{length} {least}"
        );
    }
}

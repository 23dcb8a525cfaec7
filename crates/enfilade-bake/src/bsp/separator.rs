//! Separators: portals of one plane that together close a path (Lefebvre & Hornus 2003, §2.1 step 2).
//!
//! An edge of a portal is valid if each of its points is on a solid surface or on another portal of the
//! separator. A portal with an invalid edge is removed, which may make its neighbors' edges invalid in
//! turn; the remaining ones fall into connected sets. The paper checks edge by edge with an epsilon; here each
//! edge records the intervals that are covered, and the portals that cover them.
//!
//! Time: near-linear in portals and surfaces that are spread out; each removal visits the neighbors of
//! one portal only.

use std::collections::BTreeMap;

use enfilade_geom::{Aabb, BoxTree, DVec3, Sets};
use rayon::prelude::*;
use smallvec::SmallVec;

use crate::complex::poly;

use super::leaves::Bsp;
use super::tree::Fragment;

/// Portals of one plane whose rim lies on solid surfaces.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Separator {
    pub(super) plane: u32,
    /// Indices of leaf portals, ascending.
    pub(super) portals: Vec<u32>,
    pub(super) area: f64,
}

/// Distance that counts as touching. [Units: tolerance of planes]
const EPS: f64 = 4.0;

/// Returns all valid separators, ordered by plane and first portal.
pub(super) fn find(bsp: &Bsp<'_>) -> Vec<Separator> {
    find_in(bsp, EPS, &|_| true)
}

/// Returns the valid separators in planes that may be a wall's.
pub(super) fn find_in_walls(bsp: &Bsp<'_>) -> Vec<Separator> {
    let is_wall = bsp.wall_planes();
    find_in(bsp, EPS, &|plane| is_wall[plane as usize])
}

/// Returns the valid separators in planes that only a guide gave.
pub(super) fn find_in_guides(bsp: &Bsp<'_>) -> Vec<Separator> {
    // Curved surfaces give the tree many slivers, which are closed; portals beside one are as far apart as it was wide.
    find_in(bsp, 2.0 * EPS, &|plane| plane >= bsp.n_own_planes)
}

/// Returns the length of a separator's rim that lies on surfaces of each plane. [Units: wu]
pub(super) fn rim(bsp: &Bsp<'_>, s: &Separator, solids: &BoxTree) -> BTreeMap<u32, f64> {
    let eps = 2.0 * EPS * bsp.tolerance.plane;
    let mut lengths = BTreeMap::new();
    for &p in &s.portals {
        let points = &bsp.portals[p as usize].points;
        for (i, &a) in points.iter().enumerate() {
            let b = points[(i + 1) % points.len()];
            solids.for_each_in_box(&Aabb::of_points(&[a, b]).expanded(eps), |surface| {
                if !bsp.purse.spend(2) {
                    return;
                }
                let f = &bsp.surfaces[surface as usize];
                if let Some([from, to]) = on_surface(a, b, f, bsp, eps) {
                    *lengths.entry(f.plane).or_default() += (to - from) * a.distance(b);
                }
            });
        }
    }
    lengths
}

fn find_in(bsp: &Bsp<'_>, reach: f64, is_wanted: &dyn Fn(u32) -> bool) -> Vec<Separator> {
    let boxes: Vec<Aabb> = bsp
        .surfaces
        .iter()
        .map(|f| Aabb::of_points(&f.points))
        .collect();
    let solids = BoxTree::new(&boxes);
    let mut order: Vec<u32> = (0..bsp.portals.len() as u32)
        .filter(|&p| is_wanted(bsp.portals[p as usize].plane))
        .collect();
    order.sort_by_key(|&i| (bsp.portals[i as usize].plane, i));
    let groups: Vec<&[u32]> = order
        .chunk_by(|&a, &b| bsp.portals[a as usize].plane == bsp.portals[b as usize].plane)
        .collect();
    groups
        .into_par_iter()
        .flat_map_iter(|g| of_plane(bsp, reach, g, &solids))
        .collect()
}

type Interval = [f64; 2];

/// One edge of a portal.
struct Edge {
    /// Intervals covered by solid surfaces.
    solid: SmallVec<[Interval; 4]>,
    /// Intervals covered by other portals of the plane, each with the portal's index in the group.
    others: SmallVec<[(u32, Interval); 2]>,
    /// Share of the edge that rounding may leave uncovered.
    slack: f64,
}

fn of_plane(bsp: &Bsp<'_>, reach: f64, group: &[u32], solids: &BoxTree) -> Vec<Separator> {
    let edges = edges(bsp, reach * bsp.tolerance.plane, group, solids);
    let mut is_alive = vec![true; group.len()];
    let mut queue: Vec<u32> = (0..group.len() as u32).collect();
    while let Some(k) = queue.pop() {
        if !bsp.purse.spend(5) {
            break;
        }
        if !is_alive[k as usize] || edges[k as usize].iter().all(|e| e.is_covered(&is_alive)) {
            continue;
        }
        is_alive[k as usize] = false;
        queue.extend(
            edges[k as usize]
                .iter()
                .flat_map(|e| e.others.iter().map(|o| o.0)),
        );
    }
    // Connected sets of the remaining portals.
    let mut sets = Sets::new(group.len());
    for k in (0..group.len()).filter(|&k| is_alive[k]) {
        for &(o, _) in edges[k].iter().flat_map(|e| &e.others) {
            if is_alive[o as usize] {
                sets.join(k as u32, o);
            }
        }
    }
    let mut by_root = BTreeMap::<u32, Vec<u32>>::new();
    for k in (0..group.len()).filter(|&k| is_alive[k]) {
        by_root
            .entry(sets.find(k as u32))
            .or_default()
            .push(group[k]);
    }
    by_root
        .into_values()
        .map(|portals| Separator {
            plane: bsp.portals[portals[0] as usize].plane,
            area: portals
                .iter()
                .map(|&p| poly::area(&bsp.portals[p as usize].points))
                .sum(),
            portals,
        })
        .collect()
}

/// Returns the edges of each portal of a group.
fn edges(bsp: &Bsp<'_>, eps: f64, group: &[u32], solids: &BoxTree) -> Vec<Vec<Edge>> {
    let points = |k: usize| &bsp.portals[group[k] as usize].points;
    let boxes: Vec<Aabb> = (0..group.len())
        .map(|k| Aabb::of_points(points(k)).expanded(eps))
        .collect();
    let near = BoxTree::new(&boxes);
    let edge_of = |k: usize, a: DVec3, b: DVec3| {
        edge(a, b, eps, bsp, solids, |take| {
            let around = Aabb::of_points(&[a, b]).expanded(eps);
            near.for_each_in_box(&around, |o| {
                if o as usize != k
                    && bsp.purse.spend(3)
                    && let Some(i) = shared(a, b, points(o as usize), eps)
                {
                    take(o, i);
                }
            });
        })
    };
    let edges_of = |k: usize| {
        let ends = points(k).iter().zip(points(k).iter().cycle().skip(1));
        ends.map(|(&a, &b)| edge_of(k, a, b)).collect()
    };
    (0..group.len()).map(edges_of).collect()
}

impl Edge {
    /// Returns `true` if all of it is on solids or on portals still alive.
    fn is_covered(&self, is_alive: &[bool]) -> bool {
        let mut all: SmallVec<[Interval; 8]> = self.solid.iter().copied().collect();
        all.extend(
            self.others
                .iter()
                .filter(|o| is_alive[o.0 as usize])
                .map(|o| o.1),
        );
        covers(&mut all, self.slack)
    }
}

/// Returns `true` if the intervals cover 0 to 1 with no gap wider than `slack`.
fn covers(intervals: &mut [Interval], slack: f64) -> bool {
    intervals.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let mut to = 0.0;
    for i in intervals.iter() {
        if i[0] > to + slack {
            return false;
        }
        to = f64::max(to, i[1]);
    }
    to >= 1.0 - slack
}

fn edge(
    a: DVec3,
    b: DVec3,
    eps: f64,
    bsp: &Bsp<'_>,
    solids: &BoxTree,
    others: impl FnOnce(&mut dyn FnMut(u32, Interval)),
) -> Edge {
    let length = a.distance(b);
    let mut e = Edge {
        solid: SmallVec::new(),
        others: SmallVec::new(),
        slack: (2.0 * eps / length).min(1.0),
    };
    if e.slack >= 0.5 {
        // Shorter than the distance that counts as touching.
        e.solid.push([0.0, 1.0]);
        return e;
    }
    solids.for_each_in_box(&Aabb::of_points(&[a, b]).expanded(eps), |s| {
        if !bsp.purse.spend(2) {
            return;
        }
        e.solid
            .extend(on_surface(a, b, &bsp.surfaces[s as usize], bsp, eps));
    });
    if !covers(&mut e.solid, e.slack) {
        others(&mut |o, i| e.others.push((o, i)));
    }
    e
}

/// Returns the interval of an edge that lies on a surface.
fn on_surface(a: DVec3, b: DVec3, f: &Fragment, bsp: &Bsp<'_>, eps: f64) -> Option<Interval> {
    let plane = &bsp.tree.planes[f.plane as usize];
    if plane.signed_distance(a).abs() > eps || plane.signed_distance(b).abs() > eps {
        return None;
    }
    let normal = if f.is_flipped {
        -plane.normal
    } else {
        plane.normal
    };
    let n = f.points.len();
    let mut i = [0.0, 1.0];
    for k in 0..n {
        let (p, q) = (f.points[k], f.points[(k + 1) % n]);
        let Some(inward) = normal.cross(q - p).try_normalize() else {
            continue;
        };
        let (da, db) = (inward.dot(a - p) + eps, inward.dot(b - p) + eps);
        match (da < 0.0, db < 0.0) {
            (true, true) => return None,
            (true, false) => i[0] = f64::max(i[0], da / (da - db)),
            (false, true) => i[1] = f64::min(i[1], da / (da - db)),
            (false, false) => {}
        }
    }
    (i[0] < i[1]).then_some(i)
}

/// Returns the interval of an edge that runs along an edge of another polygon in its plane.
fn shared(a: DVec3, b: DVec3, other: &[DVec3], eps: f64) -> Option<Interval> {
    let along = b - a;
    let length = along.length();
    let u = along / length;
    let n = other.len();
    (0..n).find_map(|k| {
        let (p, q) = (other[k], other[(k + 1) % n]);
        let off = |r: DVec3| ((r - a) - u * u.dot(r - a)).length();
        // The other polygon is on the other side, so its edge runs the other way.
        if off(p) > eps || off(q) > eps || u.dot(q - p) >= 0.0 {
            return None;
        }
        let (from, to) = (u.dot(q - a) / length, u.dot(p - a) / length);
        let i = [from.max(0.0), to.min(1.0)];
        (i[1] - i[0] > eps / length).then_some(i)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_cover_an_edge_or_leave_a_gap() {
        assert!(covers(&mut [[0.5, 1.0], [0.0, 0.5]], 1e-9));
        assert!(!covers(&mut [[0.6, 1.0], [0.0, 0.5]], 1e-9));
        assert!(covers(&mut [[0.6, 1.0], [0.0, 0.5]], 0.11));
        assert!(!covers(&mut [[0.0, 0.9]], 1e-9));
        assert!(covers(&mut [[0.0, 0.9], [0.2, 0.4], [0.3, 1.0]], 1e-9));
        assert!(!covers(&mut [], 1e-9));
    }
}

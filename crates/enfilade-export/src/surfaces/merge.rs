//! Polygons with holes from pieces that share their vertices: edges inside of a group cancel, the others make loops.
//!
//! **Complexity:** O(n log n) for n edges, and O(holes × loops) to find the loop around each hole.

use std::collections::BTreeMap;

use enfilade_geom::DVec3;

use super::weld::tidied;

/// Loops with less area are slivers, whichever way they turn. [Units: wu²]
const SPECK: f64 = 1e-9;

/// A polygon as loops of vertex numbers, the outer one first, counter-clockwise; holes are clockwise.
pub(crate) type Rings = Vec<Vec<u32>>;

/// Returns the polygons that the pieces of one plane cover, in the order of their least vertex.
pub(crate) fn merged(points: &[DVec3], normal: DVec3, pieces: &[&[u32]]) -> Vec<Rings> {
    let rings = loops(points, normal, open_edges(pieces.iter().copied()));
    let (mut outer, mut holes, mut turned) = (Vec::new(), Vec::new(), Vec::new());
    for ring in rings {
        let area = ring_area(points, &ring).dot(normal);
        if area > SPECK {
            outer.push((area, vec![ring]));
        } else if area < -SPECK {
            holes.push(ring);
        } else {
            // Without it, the boundary would not close.
            turned.push(vec![ring]);
        }
    }
    for hole in holes {
        let around = outer
            .iter_mut()
            .filter(|(_, rings)| is_around(points, normal, &rings[0], &hole));
        match around.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((_, rings)) => rings.push(hole),
            // A sliver that welding turned over: without it, the boundary would not close.
            None => turned.push(vec![hole]),
        }
    }
    outer.into_iter().map(|o| o.1).chain(turned).collect()
}

/// Returns the directed edges without an opposite, each as often as it lacks one.
pub(crate) fn open_edges<'p>(pieces: impl Iterator<Item = &'p [u32]>) -> BTreeMap<[u32; 2], u32> {
    let mut counts: BTreeMap<[u32; 2], i64> = BTreeMap::new();
    for ring in pieces {
        for (i, &a) in ring.iter().enumerate() {
            let b = ring[(i + 1) % ring.len()];
            let sign = if a < b { 1 } else { -1 };
            *counts.entry([a.min(b), a.max(b)]).or_default() += sign;
        }
    }
    let directed = |([a, b], n): ([u32; 2], i64)| {
        let edge = if n > 0 { [a, b] } else { [b, a] };
        (n != 0).then_some((edge, n.unsigned_abs() as u32))
    };
    counts.into_iter().filter_map(directed).collect()
}

/// Follows edges to loops; where several begin in a vertex, the loop stays around its own area.
pub(crate) fn loops(
    points: &[DVec3],
    normal: DVec3,
    mut edges: BTreeMap<[u32; 2], u32>,
) -> Vec<Vec<u32>> {
    let mut out = Vec::new();
    while let Some((&[start, next], _)) = edges.first_key_value() {
        let mut walk = vec![start];
        let mut edge = [start, next];
        loop {
            take(&mut edges, edge);
            let at = edge[1];
            if let Some(k) = walk.iter().position(|&v| v == at) {
                // A loop is closed; the rest of the walk goes on from here.
                let ring = tidied(walk.split_off(k));
                if !ring.is_empty() {
                    out.push(ring);
                }
                if walk.is_empty() {
                    break;
                }
            }
            walk.push(at);
            let came = edge[0];
            let Some(to) = next_vertex(points, normal, &edges, [came, at]) else {
                break;
            };
            edge = [at, to];
        }
    }
    out
}

fn take(edges: &mut BTreeMap<[u32; 2], u32>, edge: [u32; 2]) {
    if let Some(n) = edges.get_mut(&edge) {
        *n -= 1;
        if *n == 0 {
            edges.remove(&edge);
        }
    }
}

/// Returns the end of the edge from a vertex that is first clockwise from where the walk came.
fn next_vertex(
    points: &[DVec3],
    normal: DVec3,
    edges: &BTreeMap<[u32; 2], u32>,
    [came, at]: [u32; 2],
) -> Option<u32> {
    let p = points[at as usize];
    let back = points[came as usize] - p;
    let clockwise = |to: u32| {
        let d = points[to as usize] - p;
        let angle = f64::atan2(d.cross(back).dot(normal), d.dot(back));
        if angle <= 1e-12 {
            angle + std::f64::consts::TAU
        } else {
            angle
        }
    };
    let ends = edges.range([at, 0]..=[at, u32::MAX]).map(|(e, _)| e[1]);
    ends.min_by(|&a, &b| clockwise(a).total_cmp(&clockwise(b)))
}

/// Returns the area vector of a loop.
pub(crate) fn ring_area(points: &[DVec3], ring: &[u32]) -> DVec3 {
    let Some(&first) = ring.first() else {
        return DVec3::ZERO;
    };
    let o = points[first as usize];
    let at = |v: u32| points[v as usize] - o;
    let twice: DVec3 = ring.windows(2).map(|e| at(e[0]).cross(at(e[1]))).sum();
    0.5 * twice
}

/// Returns `true` if a loop surrounds another, by most of whose vertices that are not its own.
fn is_around(points: &[DVec3], normal: DVec3, outer: &[u32], inner: &[u32]) -> bool {
    let own = inner.iter().filter(|v| !outer.contains(v));
    let (mut n, mut n_inside) = (0, 0);
    for &v in own {
        n += 1;
        n_inside += usize::from(is_inside(points, normal, outer, points[v as usize]));
    }
    if n == 0 {
        let middle = inner.iter().map(|&v| points[v as usize]).sum::<DVec3>() / inner.len() as f64;
        return is_inside(points, normal, outer, middle);
    }
    2 * n_inside > n
}

/// Returns `true` if a point of the plane lies in a loop, by the even-odd rule.
pub(crate) fn is_inside(points: &[DVec3], normal: DVec3, ring: &[u32], p: DVec3) -> bool {
    let (u, v) = enfilade_geom::Plane::through(p, normal).basis();
    let flat = |i: u32| {
        let d = points[i as usize] - p;
        (d.dot(u), d.dot(v))
    };
    let mut is_in = false;
    for (i, &a) in ring.iter().enumerate() {
        let (a, b) = (flat(a), flat(ring[(i + 1) % ring.len()]));
        if (a.1 > 0.0) != (b.1 > 0.0) && a.0 + (b.0 - a.0) * (a.1 / (a.1 - b.1)) > 0.0 {
            is_in = !is_in;
        }
    }
    is_in
}

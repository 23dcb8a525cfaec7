//! Surfaces that answer each other through a construction, and the walls in which openings are.

use std::collections::{BTreeMap, HashSet};

use enfilade_cpg::CellId;
use enfilade_geom::DVec3;

use super::room::{Behind, BoundarySurface, RoomSurfaces};

/// Farthest distance between the middles of two answering surfaces, across the construction. [Units: wu]
const MIDDLE: f64 = 0.02;
/// Largest difference of their areas, as a share of the larger.
const AREA: f64 = 0.02;
/// Cosine of the largest angle between them.
const ALONG: f64 = 0.999;
/// Deepest recess between a wall and an opening in it. [Units: wu]
const DEEPEST: f64 = 1.5;
/// Widest reveal between the edge of an opening and its wall. [Units: wu]
const WIDEST: f64 = 0.3;

/// Finds the pairs among the surfaces of all rooms. O(n log n) for n surfaces, as few lie between two rooms.
pub(crate) fn pair(rooms: &mut [RoomSurfaces]) {
    let mut by_cells: BTreeMap<[CellId; 2], Vec<[usize; 2]>> = BTreeMap::new();
    for (r, room) in rooms.iter().enumerate() {
        for (s, surface) in room.surfaces.iter().enumerate() {
            if let Behind::Cell(other) = surface.behind {
                by_cells.entry([room.cell, other]).or_default().push([r, s]);
            }
        }
    }
    let mut pairs = Vec::new();
    let mut taken = HashSet::new();
    for ([cell, other], own) in &by_cells {
        if cell >= other {
            continue;
        }
        let Some(theirs) = by_cells.get(&[*other, *cell]) else {
            continue;
        };
        let mut found: Vec<(f64, [usize; 2], [usize; 2])> = Vec::new();
        for &[r, s] in own {
            for &[q, t] in theirs {
                let (a, b) = (&rooms[r].surfaces[s], &rooms[q].surfaces[t]);
                found.extend(distance(a, b).map(|d| (d, [r, s], [q, t])));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, a, b) in found {
            if !taken.contains(&a) && !taken.contains(&b) {
                taken.extend([a, b]);
                pairs.push((a, b));
            }
        }
    }
    for ([r, s], [q, t]) in pairs {
        rooms[r].surfaces[s].pair = Some(t);
        rooms[q].surfaces[t].pair = Some(s);
    }
}

/// Returns how far two surfaces are from answering each other; `None` if they do not.
fn distance(a: &BoundarySurface, b: &BoundarySurface) -> Option<f64> {
    let (n, m) = (DVec3::from(a.normal), DVec3::from(b.normal));
    let is_same_opening = a.opening() == b.opening();
    let difference = (a.area - b.area).abs();
    if !is_same_opening || n.dot(m) > -ALONG || difference > AREA * a.area.max(b.area) + 1e-4 {
        return None;
    }
    let across = DVec3::from(b.center()) - DVec3::from(a.center());
    // An opening has no thickness, but its faces may be those of its wall.
    let depth = match a.opening() {
        Some(_) => n.dot(across),
        None => a.thickness,
    };
    let off = across - n * depth;
    (off.length() <= MIDDLE + AREA * a.area.sqrt()).then(|| off.length() + difference)
}

/// Finds the surface around each opening of a room: parallel, in front of it, and nearest to its edges. O(openings × surfaces).
pub(crate) fn find_hosts(room: &mut RoomSurfaces) {
    for i in 0..room.surfaces.len() {
        if room.surfaces[i].opening().is_none() {
            continue;
        }
        let own = &room.surfaces[i];
        let fits = |host: &BoundarySurface| {
            host.opening().is_none()
                && DVec3::from(host.normal).dot(DVec3::from(own.normal)) > ALONG
        };
        let candidates = room.surfaces.iter().enumerate().filter(|(_, h)| fits(h));
        let reached = candidates.filter_map(|(k, h)| Some((reach(own, h)?, k)));
        let best = reached.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        room.surfaces[i].host = best.map(|b| b.1);
    }
}

/// Returns how far the nearer half of an opening's vertices is from a wall, seen along the normal; `None` if it is not in that wall.
fn reach(opening: &BoundarySurface, host: &BoundarySurface) -> Option<f64> {
    let normal = DVec3::from(opening.normal);
    let outer = &opening.loops[0];
    let depth = (DVec3::from(outer[0]) - DVec3::from(host.loops[0][0])).dot(normal);
    if !(-0.05..DEEPEST).contains(&depth) {
        return None;
    }
    let flat = |p: DVec3| p - normal * normal.dot(p);
    let mut distances = Vec::with_capacity(outer.len());
    for &p in outer {
        let p = flat(DVec3::from(p));
        let mut nearest = f64::INFINITY;
        for ring in &host.loops {
            for (i, &a) in ring.iter().enumerate() {
                let b = ring[(i + 1) % ring.len()];
                let (a, b) = (flat(DVec3::from(a)), flat(DVec3::from(b)));
                let t = (p - a).dot(b - a) / (b - a).length_squared().max(f64::MIN_POSITIVE);
                nearest = nearest.min(a.lerp(b, t.clamp(0.0, 1.0)).distance(p));
            }
        }
        distances.push(nearest);
    }
    // A wall in several parts, each an object, is on one side of it only.
    distances.sort_by(f64::total_cmp);
    let nearest = &distances[..outer.len().div_ceil(2)];
    let mean = nearest.iter().sum::<f64>() / nearest.len() as f64;
    // The larger of two walls around it holds it: a lintel is a strip of its own at times.
    (mean <= WIDEST).then_some(mean + 0.1 * depth.abs() - 0.01 * host.area.min(10.0))
}

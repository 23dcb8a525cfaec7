//! Recesses of openings: the air between an opening and the face of its wall.
//!
//! A recess is the part of a room's boundary beyond the plane of the wall that is connected with the opening there. Its edge must be
//! one loop in that plane, its mouth, which takes its place; so the boundary stays closed by construction. Where it is not, as under
//! an arch with a deeper wall above, or where the other room's side has another size, the recess stays. O(parts) for each opening.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::poly::{self, Poly, Sides};
use enfilade_geom::{DVec3, Plane};

use super::merge::{loops, open_edges, ring_area};
use super::part::Part;
use super::piece::SurfaceCover;
use super::room::{BoundarySurface, RoomSurfaces};
use super::weld::weld;

/// An opening nearer to the face of its wall has no recess. [Units: wu]
const SHALLOW: f64 = 3e-3;
/// Farthest distance of the mouth's edge from the plane of the wall. [Units: wu]
const FLAT: f64 = 4e-3;
/// Vertices that are closer are one. [Units: wu]
const WELD: f64 = 2e-3;
/// Widest reveal. [Units: wu]
const WIDEST: f64 = 0.35;
/// Largest difference between the areas of the mouths on both sides of a wall, as a share.
const ALIKE: f64 = 0.01;

/// An opening and the plane of its wall, facing out of the room.
struct Recess {
    portal: PortalId,
    wall: Plane,
    /// Box around the opening, along two axes in the plane of the wall and its normal. [Units: wu]
    axes: [DVec3; 3],
    low: DVec3,
    high: DVec3,
}

/// The face that takes the place of a recess.
struct Mouth {
    ring: Vec<DVec3>,
    area: f64,
    /// The parts on its walls, as indices.
    walls: BTreeSet<usize>,
}

/// Fills the recesses of all openings where both sides allow it.
pub(crate) fn fill(rooms: &[RoomSurfaces], by_cell: &mut BTreeMap<CellId, Vec<Part>>) {
    let mut found: BTreeMap<PortalId, Vec<(CellId, Recess, f64)>> = BTreeMap::new();
    let mut n_sides: BTreeMap<PortalId, usize> = BTreeMap::new();
    for room in rooms {
        let parts = &by_cell[&room.cell];
        for surface in &room.surfaces {
            let Some(portal) = surface.opening() else {
                continue;
            };
            *n_sides.entry(portal).or_default() += 1;
            if let Some(recess) = recess_of(room, surface, portal) {
                let area = match mouth(parts, &recess) {
                    Some(mouth) => mouth.area,
                    None if depth(&recess) <= SHALLOW => surface.area,
                    None => continue,
                };
                found
                    .entry(portal)
                    .or_default()
                    .push((room.cell, recess, area));
            }
        }
    }
    for (portal, sides) in found {
        let areas = sides.iter().map(|s| s.2);
        let (low, high) = areas.fold((f64::MAX, 0.0_f64), |(l, h), a| (l.min(a), h.max(a)));
        if sides.len() != n_sides[&portal] || high - low > ALIKE * high {
            continue;
        }
        for (cell, recess, _) in sides {
            if let Some(parts) = by_cell.get_mut(&cell)
                && let Some(mouth) = mouth(parts, &recess)
            {
                *parts = closed(parts, &recess, &mouth);
            }
        }
    }
}

fn depth(recess: &Recess) -> f64 {
    recess.high.z
}

fn recess_of(room: &RoomSurfaces, opening: &BoundarySurface, portal: PortalId) -> Option<Recess> {
    let host = &room.surfaces[opening.host?];
    let normal = DVec3::from(host.normal);
    let wall = Plane::through(DVec3::from(host.loops[0][0]), normal);
    let (u, v) = wall.basis();
    let (mut low, mut high) = (DVec3::MAX, DVec3::MIN);
    for &p in &opening.loops[0] {
        let p = DVec3::from(p);
        let at = DVec3::new(p.dot(u), p.dot(v), wall.signed_distance(p));
        (low, high) = (low.min(at), high.max(at));
    }
    Some(Recess {
        portal,
        wall,
        axes: [u, v, normal],
        low,
        high,
    })
}

/// Returns the part of a polygon beyond the wall, near the opening.
fn beyond(recess: &Recess, points: &[DVec3]) -> Option<Poly> {
    let part: Poly = match poly::split(points, &recess.wall, 1e-4) {
        Sides::Front => points.into(),
        Sides::Both(front, _) => front,
        Sides::On | Sides::Back => return None,
    };
    let [u, v, _] = recess.axes;
    let is_near = |p: &DVec3| {
        let (x, y, z) = (p.dot(u), p.dot(v), recess.wall.signed_distance(*p));
        x >= recess.low.x - WIDEST
            && x <= recess.high.x + WIDEST
            && y >= recess.low.y - WIDEST
            && y <= recess.high.y + WIDEST
            && z <= recess.high.z + FLAT
    };
    part.iter().all(is_near).then_some(part)
}

/// Finds the mouth of a recess; `None` if there is no recess, or not a simple one.
fn mouth(parts: &[Part], recess: &Recess) -> Option<Mouth> {
    if depth(recess) <= SHALLOW {
        return None;
    }
    let all = parts.iter().enumerate();
    let near: Vec<(usize, Poly)> = all
        .filter_map(|(i, part)| Some((i, beyond(recess, &part.points)?)))
        .collect();
    let welded = weld(near.iter().map(|n| n.1.as_slice()), WELD);
    let mut by_edge: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
    for (k, ring) in welded.polygons.iter().enumerate() {
        for (i, &a) in ring.iter().enumerate() {
            let b = ring[(i + 1) % ring.len()];
            by_edge.entry([a.min(b), a.max(b)]).or_default().push(k);
        }
    }
    let is_opening = |k: usize| parts[near[k].0].key.cover == SurfaceCover::Opening(recess.portal);
    let mut is_reached: Vec<bool> = (0..near.len()).map(is_opening).collect();
    let mut open: Vec<usize> = (0..near.len()).filter(|&k| is_reached[k]).collect();
    while let Some(k) = open.pop() {
        let ring = &welded.polygons[k];
        for (i, &a) in ring.iter().enumerate() {
            let b = ring[(i + 1) % ring.len()];
            for &other in &by_edge[&[a.min(b), a.max(b)]] {
                if !is_reached[other] {
                    is_reached[other] = true;
                    open.push(other);
                }
            }
        }
    }
    let reached: Vec<usize> = (0..near.len()).filter(|&k| is_reached[k]).collect();
    let edges = open_edges(reached.iter().map(|&k| welded.polygons[k].as_slice()));
    let is_flat = |v: &u32| {
        recess
            .wall
            .signed_distance(welded.points[*v as usize])
            .abs()
            <= FLAT
    };
    if edges.is_empty() || !edges.keys().flatten().all(is_flat) {
        return None;
    }
    // The mouth has the edge of what it takes the place of.
    let rings = loops(&welded.points, recess.wall.normal, edges);
    let [ring] = rings.as_slice() else {
        return None;
    };
    let area = ring_area(&welded.points, ring).dot(recess.wall.normal);
    let points = ring.iter().map(|&v| welded.points[v as usize]);
    (area > 0.0).then(|| Mouth {
        ring: points.map(|p| recess.wall.project(p)).collect(),
        area,
        walls: reached.iter().map(|&k| near[k].0).collect(),
    })
}

/// Returns the parts of a boundary with the mouth in place of the recess.
fn closed(parts: &[Part], recess: &Recess, mouth: &Mouth) -> Vec<Part> {
    let mut out = Vec::with_capacity(parts.len());
    let mut opening = None;
    for (i, part) in parts.iter().enumerate() {
        if part.key.cover == SurfaceCover::Opening(recess.portal) {
            opening.get_or_insert(part);
        }
        if !mouth.walls.contains(&i) {
            out.push(part.clone());
            continue;
        }
        // The part before the wall stays.
        if let Sides::Both(_, back) = poly::split(&part.points, &recess.wall, 1e-4) {
            out.push(Part {
                points: back.to_vec(),
                ..part.clone()
            });
        }
    }
    out.extend(opening.map(|part| Part {
        normal: recess.wall.normal,
        points: mouth.ring.clone(),
        depth: depth(recess),
        ..part.clone()
    }));
    out
}

//! Walls together with the openings in their faces, as models of energy want them: one polygon, and openings inside of it.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use enfilade_cpg::CellId;
use enfilade_geom::DVec3;

use super::merge::merged;
use super::room::{Behind, BoundarySurface, RoomSurfaces};

/// Farthest distance of an opening from the plane of its wall. [Units: wu]
const FLAT: f64 = 5e-3;

/// A surface of a room with the openings that were cut out of it.
#[derive(Clone, Debug)]
pub(crate) struct HostedFace {
    /// The surface, as an index: a wall, or an opening that is not in the face of one.
    pub(crate) surface: usize,
    /// Loops of the polygon with its openings filled, as in a boundary surface. [Units: wu]
    pub(crate) loops: Vec<Vec<[f64; 3]>>,
    /// The openings in it, as indices.
    pub(crate) openings: Vec<usize>,
}

/// Returns the faces of all rooms. An opening is put into its wall if what is behind both is the same, and, where that is a room, the
/// same happens there. O(n log n) for n vertices.
///
/// `is_hosted` returns `false` for openings that stay faces of their own.
pub(crate) fn hosted_faces(
    rooms: &[RoomSurfaces],
    is_hosted: &dyn Fn(&BoundarySurface) -> bool,
) -> Vec<Vec<HostedFace>> {
    let by_cell: BTreeMap<CellId, usize> =
        rooms.iter().enumerate().map(|(i, r)| (r.cell, i)).collect();
    let mut wanted = BTreeSet::new();
    for (r, room) in rooms.iter().enumerate() {
        for o in 0..room.surfaces.len() {
            if is_hosted(&room.surfaces[o]) && fits(rooms, &by_cell, r, o) {
                wanted.insert((r, o));
            }
        }
    }
    loop {
        let before = wanted.len();
        // A wall whose openings do not fill it keeps none.
        for (r, room) in rooms.iter().enumerate() {
            for s in 0..room.surfaces.len() {
                let own = openings_of(room, s, r, &wanted);
                if !own.is_empty() && filled(room, s, &own).is_none() {
                    for &o in &own {
                        wanted.remove(&(r, o));
                    }
                }
            }
        }
        let partner = |&(r, o): &(usize, usize)| {
            let surface = &rooms[r].surfaces[o];
            let (Behind::Cell(cell), Some(pair)) = (surface.behind, surface.pair) else {
                return None;
            };
            Some((*by_cell.get(&cell)?, pair))
        };
        let keeps = |at: &(usize, usize)| partner(at).is_none_or(|p| wanted.contains(&p));
        let kept: BTreeSet<(usize, usize)> = wanted.iter().filter(|a| keeps(a)).copied().collect();
        wanted = kept;
        if wanted.len() == before {
            break;
        }
    }
    let faces = rooms.iter().enumerate().map(|(r, room)| {
        let faces = (0..room.surfaces.len()).filter(|&s| !wanted.contains(&(r, s)));
        faces
            .map(|s| {
                let openings = openings_of(room, s, r, &wanted);
                let loops = filled(room, s, &openings);
                HostedFace {
                    surface: s,
                    loops: loops.unwrap_or_else(|| room.surfaces[s].loops.clone()),
                    openings,
                }
            })
            .collect()
    });
    faces.collect()
}

fn openings_of(
    room: &RoomSurfaces,
    host: usize,
    r: usize,
    wanted: &BTreeSet<(usize, usize)>,
) -> Vec<usize> {
    let own = room.openings_in(host);
    own.filter(|&o| wanted.contains(&(r, o))).collect()
}

/// Returns `true` if an opening lies in the face of its wall, and that is between the same spaces.
fn fits(rooms: &[RoomSurfaces], by_cell: &BTreeMap<CellId, usize>, r: usize, o: usize) -> bool {
    let opening = &rooms[r].surfaces[o];
    let Some(host) = opening.host.filter(|_| opening.opening().is_some()) else {
        return false;
    };
    let wall = &rooms[r].surfaces[host];
    let normal = DVec3::from(wall.normal);
    let origin = DVec3::from(wall.loops[0][0]);
    let is_flat = |p: &[f64; 3]| (DVec3::from(*p) - origin).dot(normal).abs() <= FLAT;
    if wall.behind != opening.behind || !opening.loops.iter().flatten().all(is_flat) {
        return false;
    }
    let Behind::Cell(cell) = opening.behind else {
        return false;
    };
    match (by_cell.get(&cell), wall.pair, opening.pair) {
        (Some(&q), Some(wall), Some(answer)) => rooms[q].surfaces[answer].host == Some(wall),
        (Some(_), _, _) => false,
        (None, _, _) => true,
    }
}

/// Returns the loops of a wall with openings filled; `None` if they are not one polygon.
fn filled(room: &RoomSurfaces, host: usize, openings: &[usize]) -> Option<Vec<Vec<[f64; 3]>>> {
    let mut numbers: HashMap<[u64; 3], u32> = HashMap::new();
    let mut points: Vec<DVec3> = Vec::new();
    let mut rings: Vec<Vec<u32>> = Vec::new();
    for &s in [host].iter().chain(openings) {
        for ring in &room.surfaces[s].loops {
            let number = |p: &[f64; 3]| {
                *numbers.entry(p.map(f64::to_bits)).or_insert_with(|| {
                    points.push(DVec3::from(*p));
                    points.len() as u32 - 1
                })
            };
            rings.push(ring.iter().map(number).collect());
        }
    }
    let normal = DVec3::from(room.surfaces[host].normal);
    let all: Vec<&[u32]> = rings.iter().map(Vec::as_slice).collect();
    let polygons = merged(&points, normal, &all);
    let [polygon] = polygons.as_slice() else {
        return None;
    };
    let at = |&v: &u32| points[v as usize].to_array();
    let loops = polygon.iter().map(|ring| ring.iter().map(at).collect());
    Some(loops.collect())
}

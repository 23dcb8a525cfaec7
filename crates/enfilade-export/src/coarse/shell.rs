//! Faces of rooms made of bricks.

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, World};
use enfilade_geom::DVec3;

use super::bricks::Bricks;
use crate::surfaces::{
    Behind, Key, Part, RoomSurfaces, SurfaceCover, assembled, flat_openings, ground_level,
    is_ground,
};

/// Places that are closer are one. [Units: wu]
const SAME: f64 = 1e-3;

/// Returns the shells of all rooms that have bricks, by cell; surfaces that answer each other are equal.
pub(crate) fn shells(world: &World, bricks: &Bricks) -> Vec<RoomSurfaces> {
    let by_cell = parts_of(world, bricks);
    let options = flat_openings();
    let mut rooms: Vec<RoomSurfaces> = (by_cell.iter())
        .map(|(&cell, parts)| assembled(cell, parts, &options))
        .collect();
    pair(&mut rooms);
    rooms
}

/// A layer of faces of bricks in one plane, on one side of it.
#[derive(Clone, Copy)]
struct BrickSide {
    axis: usize,
    is_up: bool,
}

impl BrickSide {
    fn number(self, line: usize) -> u32 {
        (line as u32) << 3 | (self.axis as u32) << 1 | u32::from(self.is_up)
    }

    fn step(self, mut at: [usize; 3], counts: [usize; 3]) -> Option<[usize; 3]> {
        let next = if self.is_up {
            at[self.axis] + 1
        } else {
            at[self.axis].wrapping_sub(1)
        };
        at[self.axis] = next;
        (next < counts[self.axis]).then_some(at)
    }

    /// Returns the axes of the plane: the normal is their cross product if it leads up the axis.
    fn across(self) -> [usize; 2] {
        [(self.axis + 1) % 3, (self.axis + 2) % 3]
    }
}

/// A rectangle of faces with the same answers: the first and the last brick along both axes, and the depth of the construction.
type Covered = BTreeMap<(CellId, Key), BTreeMap<[usize; 2], f64>>;

fn parts_of(world: &World, bricks: &Bricks) -> BTreeMap<CellId, Vec<Part>> {
    let ground = ground_level(world);
    let mut by_cell: BTreeMap<CellId, Vec<Part>> = BTreeMap::new();
    for axis in 0..3 {
        for is_up in [false, true] {
            let side = BrickSide { axis, is_up };
            let mut layers: BTreeMap<usize, Covered> = BTreeMap::new();
            for at in bricks.places() {
                let Some(cell) = bricks.cell(at).filter(|&c| world.graph[c].is_room()) else {
                    continue;
                };
                let next = side.step(at, bricks.counts());
                if next.and_then(|n| bricks.cell(n)) == Some(cell) {
                    continue;
                }
                let (key, depth) = answer(world, bricks, side, at, ground);
                let [u, v] = side.across().map(|a| at[a]);
                let layer = layers.entry(at[axis] + usize::from(is_up)).or_default();
                layer.entry((cell, key)).or_default().insert([u, v], depth);
            }
            for (line, layer) in layers {
                for ((cell, key), faces) in layer {
                    let parts = by_cell.entry(cell).or_default();
                    add_rectangles(bricks, side, line, key, faces, parts);
                }
            }
        }
    }
    by_cell
}

/// Returns what lies behind the face of a brick, and how far.
fn answer(
    world: &World,
    bricks: &Bricks,
    side: BrickSide,
    at: [usize; 3],
    ground: Option<f64>,
) -> (Key, f64) {
    let ends = &bricks.ends[side.axis];
    let line_of = |p: [usize; 3], is_far: bool| p[side.axis] + usize::from(side.is_up == is_far);
    let own = line_of(at, true);
    let mut normal = DVec3::ZERO;
    normal[side.axis] = if side.is_up { 1.0 } else { -1.0 };
    let reach = flat_openings().max_thickness;
    let top = DVec3::Y * bricks.ends[1][at[1] + usize::from(side.axis != 1 || side.is_up)];
    let mut key = Key {
        plane: side.number(own),
        cover: SurfaceCover::Bare,
        behind: Behind::Matter,
        far: None,
    };
    let mut place = at;
    while let Some(next) = side.step(place, bricks.counts()) {
        let far = line_of(next, false);
        let depth = (ends[far] - ends[own]).abs();
        if depth > reach {
            break;
        }
        place = next;
        let Some(cell) = bricks.cell(next) else {
            continue;
        };
        key.behind = Behind::Cell(cell);
        if world.graph[cell].is_room() {
            let opposite = BrickSide {
                is_up: !side.is_up,
                ..side
            };
            key.far = Some((opposite.number(far), SurfaceCover::Bare));
        } else if world.graph[cell].outdoor && is_ground(ground, &[top], normal) {
            key.behind = Behind::Ground;
        }
        return (key, depth);
    }
    if is_ground(ground, &[top], normal) && normal.y < -0.5 {
        key.behind = Behind::Ground;
    }
    (key, reach)
}

/// Merges faces of bricks to rectangles, each as wide as can be, and adds them.
fn add_rectangles(
    bricks: &Bricks,
    side: BrickSide,
    line: usize,
    key: Key,
    mut faces: BTreeMap<[usize; 2], f64>,
    parts: &mut Vec<Part>,
) {
    let [u, v] = side.across();
    while let Some((&[u0, v0], &depth)) = faces.first_key_value() {
        let mut v1 = v0 + 1;
        while faces.contains_key(&[u0, v1]) {
            v1 += 1;
        }
        let mut u1 = u0 + 1;
        while (v0..v1).all(|k| faces.contains_key(&[u1, k])) {
            u1 += 1;
        }
        for i in u0..u1 {
            for k in v0..v1 {
                faces.remove(&[i, k]);
            }
        }
        let corner = |[i, k]: [usize; 2]| {
            let mut p = DVec3::ZERO;
            p[side.axis] = bricks.ends[side.axis][line];
            p[u] = bricks.ends[u][i];
            p[v] = bricks.ends[v][k];
            p
        };
        let mut points: Vec<DVec3> = [[u0, v0], [u1, v0], [u1, v1], [u0, v1]]
            .map(corner)
            .to_vec();
        let mut normal = DVec3::ZERO;
        normal[side.axis] = if side.is_up { 1.0 } else { -1.0 };
        if !side.is_up {
            points.reverse();
        }
        parts.push(Part {
            key,
            normal,
            points,
            depth,
        });
    }
}

/// Pairs surfaces of two rooms that cover the same rectangle with the same area on both sides of a construction.
fn pair(rooms: &mut [RoomSurfaces]) {
    let mut by_place: BTreeMap<Vec<i64>, Vec<[usize; 2]>> = BTreeMap::new();
    for (r, room) in rooms.iter().enumerate() {
        for (s, surface) in room.surfaces.iter().enumerate() {
            let Behind::Cell(other) = surface.behind else {
                continue;
            };
            let cells = [room.cell.min(other), room.cell.max(other)];
            let across = DVec3::from(surface.normal) * surface.thickness;
            let points = surface.loops.iter().flatten().map(|&p| DVec3::from(p));
            let points = points.flat_map(|p| [p, p + across]);
            let (low, high) =
                points.fold((DVec3::MAX, DVec3::MIN), |(l, h), p| (l.min(p), h.max(p)));
            let sizes = low.to_array().into_iter().chain(high.to_array());
            let sizes = sizes
                .chain([surface.area])
                .map(|x| (x / SAME).round() as i64);
            let key = cells.map(|c| i64::from(c.0)).into_iter().chain(sizes);
            by_place.entry(key.collect()).or_default().push([r, s]);
        }
    }
    for found in by_place.values() {
        if let [[r, s], [q, t]] = *found.as_slice()
            && r != q
        {
            rooms[r].surfaces[s].pair = Some(t);
            rooms[q].surfaces[t].pair = Some(s);
        }
    }
}

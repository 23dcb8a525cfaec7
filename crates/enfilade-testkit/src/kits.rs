//! Pieces to put levels together from: rooms, corridors and stairs, each a closed solid with doorways in its outer faces.

use enfilade_geom::scene::Scene;
use enfilade_geom::{Aabb, DVec3};

use crate::site::Site;
use crate::solid::{MeshBuilder, aabb};

/// Thickness of walls, and of floors and ceilings. [Units: wu]
const WALL: f64 = 0.2;
const SLAB: f64 = 0.2;
/// Width and height of all doorways. [Units: wu]
const DOORWAY: [f64; 2] = [1.2, 2.1];
/// Rise of the stairs. [Units: wu]
const RISE: f64 = 3.2;

/// A piece before its bake.
#[derive(Clone, Debug)]
pub struct PieceScene {
    /// Name, unique in its kit.
    pub name: &'static str,
    /// The model.
    pub scene: Scene,
}

/// A doorway: the middle of its sill in the outer face of the piece, and the way out.
type Doorway = ([f64; 3], DVec3);

/// Builds a piece of air boxes, `outer` with their walls, and doorways. `inside` adds solids in it.
fn piece(
    name: &'static str,
    color: [f32; 3],
    outer: &[Aabb],
    doorways: &[Doorway],
    inside: impl FnOnce(&mut MeshBuilder),
) -> PieceScene {
    let skin = DVec3::new(WALL, SLAB, WALL);
    let mut air: Vec<Aabb> = (outer.iter())
        .map(|b| Aabb::new(b.min + skin, b.max - skin))
        .collect();
    for &(sill, out) in doorways {
        let along = DVec3::Y.cross(out).abs() * (DOORWAY[0] * 0.5);
        let sill = DVec3::from_array(sill);
        let through = out * (WALL + 0.1);
        let [low, high] = [sill - along, sill + along + DVec3::Y * DOORWAY[1]];
        air.push(Aabb::of_points(&[low, high, low - through, high - through]));
    }
    let mut site = Site::new(name);
    let plaster = site.material(name, color);
    let mut walls = MeshBuilder::new(plaster);
    walls.carved(outer, &air);
    inside(&mut walls);
    site.structure(name, walls);
    let scene = site.finish().scene;
    PieceScene { name, scene }
}

/// Returns doorways of a box around the origin in plan: the given ones of east, south, west, north.
fn doorways(size: [f64; 2], sides: &str) -> Vec<Doorway> {
    let [x, z] = size.map(|s| 0.5 * s);
    let all = [
        ('e', [x, 0.0, 0.0], DVec3::X),
        ('s', [0.0, 0.0, z], DVec3::Z),
        ('w', [-x, 0.0, 0.0], -DVec3::X),
        ('n', [0.0, 0.0, -z], -DVec3::Z),
    ];
    let chosen = all.into_iter().filter(|d| sides.contains(d.0));
    chosen.map(|d| (d.1, d.2)).collect()
}

/// Returns a box around the origin in plan, outer measures, with the given air height over floor 0.
fn around([x, z]: [f64; 2], height: f64) -> Aabb {
    let (x, z) = (0.5 * x, 0.5 * z);
    aabb([-x, -SLAB, -z], [x, height + SLAB, z])
}

fn plain(
    name: &'static str,
    color: [f32; 3],
    size: [f64; 2],
    height: f64,
    sides: &str,
) -> PieceScene {
    let outer = [around(size, height)];
    piece(name, color, &outer, &doorways(size, sides), |_| ())
}

/// Returns a corridor of two legs from north to east, of outer width `width`; each door is `reach` from the middle.
fn bend(name: &'static str, color: [f32; 3], width: f64, reach: f64) -> PieceScene {
    let half = 0.5 * width;
    let top = 2.6 + SLAB;
    let outer = [
        aabb([-half, -SLAB, -reach], [half, top, half]),
        aabb([-half, -SLAB, -half], [reach, top, half]),
    ];
    let doors = [
        ([0.0, 0.0, -reach], -DVec3::Z),
        ([reach, 0.0, 0.0], DVec3::X),
    ];
    piece(name, color, &outer, &doors, |_| ())
}

/// Returns a stair from a low door in the south to a high one in the north.
fn stair(name: &'static str, color: [f32; 3]) -> PieceScene {
    let outer = [aabb([-1.2, -SLAB, -4.0], [1.2, RISE + 2.6 + SLAB, 4.0])];
    let doors = [([0.0, 0.0, 4.0], DVec3::Z), ([0.0, RISE, -4.0], -DVec3::Z)];
    piece(name, color, &outer, &doors, |walls| {
        let (n, going) = (16, 0.3);
        for i in 1..=n {
            let foot = 2.6 - f64::from(i) * going;
            let end = if i == n { -3.8 } else { foot };
            let rise = RISE * f64::from(i) / f64::from(n);
            walls.cuboid(aabb([-1.0, 0.0, end], [1.0, rise, foot + going]));
        }
    })
}

/// Returns the kit of a dungeon: halls, corridors, a stair, and a niche that closes what is left open.
#[must_use]
pub fn dungeon_kit() -> Vec<PieceScene> {
    let stone = [0.55, 0.53, 0.5];
    let pillars = |walls: &mut MeshBuilder| {
        for [x, z] in [[-3.0, -2.0], [3.0, -2.0], [-3.0, 2.0], [3.0, 2.0]] {
            walls.cuboid(aabb([x - 0.3, 0.0, z - 0.3], [x + 0.3, 4.0, z + 0.3]));
        }
    };
    let great = [around([12.0, 8.0], 4.0)];
    vec![
        plain("chamber", [0.6, 0.5, 0.4], [6.0, 6.0], 3.0, "eswn"),
        piece(
            "hall",
            [0.65, 0.45, 0.4],
            &great,
            &doorways([12.0, 8.0], "eswn"),
            pillars,
        ),
        plain("corridor", stone, [2.0, 6.0], 2.6, "sn"),
        plain("cross", stone, [4.0, 4.0], 2.6, "eswn"),
        bend("bend", stone, 2.0, 3.0),
        stair("stair", [0.5, 0.55, 0.6]),
        plain("niche", [0.45, 0.5, 0.45], [2.0, 1.6], 2.6, "s"),
    ]
}

/// Returns the kit of an office: corridors with rooms along them.
#[must_use]
pub fn office_kit() -> Vec<PieceScene> {
    let white = [0.85, 0.84, 0.8];
    let desk = |walls: &mut MeshBuilder| {
        walls.cuboid(aabb([-1.2, 0.0, -1.6], [0.4, 0.74, -0.8]));
    };
    let size = [4.0, 5.0];
    vec![
        piece(
            "office",
            [0.75, 0.8, 0.85],
            &[around(size, 2.7)],
            &doorways(size, "s"),
            desk,
        ),
        plain("meeting", [0.85, 0.75, 0.65], [4.0, 8.0], 2.7, "s"),
        plain("corridor", white, [4.0, 2.4], 2.7, "eswn"),
        plain("lobby", [0.8, 0.7, 0.5], [8.0, 8.0], 3.6, "eswn"),
    ]
}

/// Returns the kit of a maze: square tiles with doorways in some of their sides.
#[must_use]
pub fn maze_kit() -> Vec<PieceScene> {
    let hedge = [0.4, 0.55, 0.35];
    let tile = |name, sides| plain(name, hedge, [3.0, 3.0], 2.6, sides);
    vec![
        tile("end", "s"),
        tile("straight", "sn"),
        tile("turn", "es"),
        tile("fork", "esn"),
        tile("crossing", "eswn"),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle::{n_open_edges, structural_triangles};

    #[test]
    fn all_pieces_are_closed_solids_with_names_of_their_own() {
        for kit in [dungeon_kit(), office_kit(), maze_kit()] {
            let mut names: Vec<_> = kit.iter().map(|p| p.name).collect();
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), kit.len());
            for p in &kit {
                let t = structural_triangles(&p.scene);
                assert_eq!(n_open_edges(&t), 0, "{}", p.name);
            }
        }
    }
}

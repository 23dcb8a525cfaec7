//! Pieces to put levels together from: rooms, corridors and stairs, each a closed solid with doorways in its outer faces.

use enfilade_geom::scene::{Object, Role, Scene};
use enfilade_geom::{Aabb, DMat4, DQuat, DVec3};

use crate::site::Site;
use crate::solid::{MeshBuilder, aabb, snapped};

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

/// Builds a piece: boxes with their walls, the air in them, and doorways.
fn piece(
    name: &'static str,
    color: [f32; 3],
    outer: &[Aabb],
    mut air: Vec<Aabb>,
    doorways: &[Doorway],
) -> PieceScene {
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
    site.structure(name, walls);
    let scene = site.finish().scene;
    PieceScene { name, scene }
}

/// Returns the air in a box with walls, floor and ceiling.
fn inside(outer: &Aabb) -> Aabb {
    let skin = DVec3::new(WALL, SLAB, WALL);
    Aabb::new(outer.min + skin, outer.max - skin)
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

/// Returns a room of one box with doorways in the middle of some sides, in few triangles.
fn plain(
    name: &'static str,
    color: [f32; 3],
    size: [f64; 2],
    height: f64,
    sides: &str,
) -> PieceScene {
    let mut site = Site::new(name);
    let plaster = site.material(name, color);
    let mut walls = MeshBuilder::new(plaster);
    let (mut floor, mut ceiling) = (Vec::new(), Vec::new());
    for (k, side) in "eswn".chars().enumerate() {
        // Seen from inside, the wall runs from -half to half, and its outer face is at `reach`.
        let turn = DQuat::from_rotation_y(-(k as f64) * std::f64::consts::FRAC_PI_2);
        let [reach, half] = [size[k % 2] * 0.5, size[(k + 1) % 2] * 0.5];
        let at = |out: f64, along: f64, y: f64| {
            let p = turn * DVec3::new(out, 0.0, along);
            DVec3::new(snapped(p.x), snapped(y), snapped(p.z))
        };
        let (inner, clear) = (reach - WALL, half - WALL);
        let [below, above] = [-SLAB, height + SLAB];
        let d = [DOORWAY[0] * 0.5, DOORWAY[1]];
        let frame = |out: f64, h: f64, low: f64, top: f64| {
            [[-h, low], [h, low], [h, top], [-h, top]].map(|[z, y]| at(out, z, y))
        };
        let outside = frame(reach, half, below, above);
        let inside = frame(inner, clear, 0.0, height);
        floor.push(inside[0]);
        ceiling.push(inside[3]);
        if !sides.contains(side) {
            walls.convex(&reversed(outside)).convex(&inside);
            continue;
        }
        let hole = frame(reach, d[0], 0.0, d[1]);
        let mouth = frame(inner, d[0], 0.0, d[1]);
        floor.extend([mouth[0], mouth[1]]);
        for i in 0..4 {
            let next = (i + 1) % 4;
            walls.convex(&reversed([outside[i], outside[next], hole[next], hole[i]]));
            walls.convex(&[mouth[i], mouth[next], hole[next], hole[i]]);
            if i > 0 {
                walls.convex(&[inside[i], inside[next], mouth[next], mouth[i]]);
            }
        }
    }
    let middle = DVec3::ZERO;
    for i in 0..floor.len() {
        walls.convex(&[middle, floor[(i + 1) % floor.len()], floor[i]]);
    }
    walls.convex(&ceiling);
    let [top, bottom] = [
        around(size, height).faces()[3],
        around(size, height).faces()[2],
    ];
    walls.convex(&top).convex(&bottom);
    site.structure(name, walls);
    let scene = site.finish().scene;
    PieceScene { name, scene }
}

fn reversed([a, b, c, d]: [DVec3; 4]) -> [DVec3; 4] {
    [d, c, b, a]
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
    piece(
        name,
        color,
        &outer,
        outer.iter().map(inside).collect(),
        &doors,
    )
}

/// Returns a stair from a low door in the south to a high one in the north.
fn stair(name: &'static str, color: [f32; 3]) -> PieceScene {
    let outer = [aabb([-1.2, -SLAB, -4.0], [1.2, RISE + 2.6 + SLAB, 4.0])];
    let doors = [([0.0, 0.0, 4.0], DVec3::Z), ([0.0, RISE, -4.0], -DVec3::Z)];
    let (n, going, top) = (16, 0.3, RISE + 2.6);
    let mut air = vec![aabb([-1.0, 0.0, 2.6], [1.0, top, 3.8])];
    for i in 1..=n {
        let foot = 2.6 - f64::from(i) * going;
        let end = if i == n { -3.8 } else { foot };
        let rise = RISE * f64::from(i) / f64::from(n);
        air.push(aabb([-1.0, rise, end], [1.0, top, foot + going]));
    }
    piece(name, color, &outer, air, &doors)
}

/// Returns the air of a hall of 12 × 8 × 4 m with four pillars.
fn between_pillars() -> Vec<Aabb> {
    let strip = |x: [f64; 2], z: [f64; 2]| aabb([x[0], 0.0, z[0]], [x[1], 4.0, z[1]]);
    let mut air = Vec::new();
    for x in [[-5.8, -3.3], [-2.7, 2.7], [3.3, 5.8]] {
        air.push(strip(x, [-3.8, 3.8]));
    }
    for x in [[-3.3, -2.7], [2.7, 3.3]] {
        for z in [[-3.8, -2.3], [-1.7, 1.7], [2.3, 3.8]] {
            air.push(strip(x, z));
        }
    }
    air
}

/// Returns a wall that closes a doorway from outside: the middle of its sill is at the origin, and the way out is +z.
fn plug(color: [f32; 3]) -> PieceScene {
    let mut site = Site::new("plug");
    let mut wall = MeshBuilder::new(site.material("plug", color));
    let [half, height] = [DOORWAY[0] * 0.5 + WALL, DOORWAY[1] + SLAB];
    wall.cuboid(aabb([-half, -SLAB, 0.0], [half, height, WALL]));
    site.structure("plug", wall);
    let scene = site.finish().scene;
    PieceScene {
        name: "plug",
        scene,
    }
}

/// Returns the kit of a dungeon: halls, corridors, a stair, and a niche and a wall that close what is left open.
#[must_use]
pub fn dungeon_kit() -> Vec<PieceScene> {
    let stone = [0.55, 0.53, 0.5];
    let great = [around([12.0, 8.0], 4.0)];
    vec![
        plain("chamber", [0.6, 0.5, 0.4], [6.0, 6.0], 3.0, "eswn"),
        piece(
            "hall",
            [0.65, 0.45, 0.4],
            &great,
            between_pillars(),
            &doorways([12.0, 8.0], "eswn"),
        ),
        plain("corridor", stone, [2.0, 6.0], 2.6, "sn"),
        plain("cross", stone, [4.0, 4.0], 2.6, "eswn"),
        bend("bend", stone, 2.0, 3.0),
        stair("stair", [0.5, 0.55, 0.6]),
        plain("niche", [0.45, 0.5, 0.45], [2.0, 1.6], 2.6, "s"),
        plug(stone),
    ]
}

/// Returns the kit of an office: corridors with rooms along them.
#[must_use]
pub fn office_kit() -> Vec<PieceScene> {
    let white = [0.85, 0.84, 0.8];
    vec![
        with_desk(plain("office", [0.75, 0.8, 0.85], [4.0, 5.0], 2.7, "s")),
        plain("meeting", [0.85, 0.75, 0.65], [4.0, 8.0], 2.7, "s"),
        plain("corridor", white, [4.0, 2.4], 2.7, "eswn"),
        plain("lobby", [0.8, 0.7, 0.5], [8.0, 8.0], 3.6, "eswn"),
    ]
}

/// Puts a desk into a room, as an object.
fn with_desk(mut room: PieceScene) -> PieceScene {
    let mut desk = MeshBuilder::new(0);
    desk.cuboid(aabb([-1.2, 0.0, -1.6], [0.4, 0.74, -0.8]));
    let mesh = room.scene.meshes.len() as u32;
    room.scene.meshes.push(desk.build("desk", &[]));
    room.scene.objects.push(Object {
        name: "desk".into(),
        mesh,
        transform: DMat4::IDENTITY,
        role: Role::Detail,
        reason: "generated".into(),
        filling: None,
        node: None,
    });
    room
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
    use enfilade_testkit::oracle::{n_open_edges, signed_volume, structural_triangles};

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
                assert!(signed_volume(&t) > 0.0, "{}", p.name);
            }
        }
    }
}

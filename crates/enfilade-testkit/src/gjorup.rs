//! The test models of Gjørup, "Cell and portal based visibility" (master's thesis, 1999), section 4.3,
//! rebuilt from their descriptions and counts.
//!
//! The models themselves were never published. The text determines:
//!
//! - *Optimised rooms* (4.3.1): four unaligned rooms joined by short corridors, 64 shared
//!   vertices, 8 for each room and corridor, 96 triangles. Four portals separate the rooms, so
//!   there are four corridors and they form a ring. 96 triangles are possible only if the
//!   corridors are as high as the rooms: 4 rooms of 16 and 4 corridors of 8; floors and ceilings
//!   ignore the corridors' vertices on their edges.
//! - *Tessellated rooms* (4.3.2): 200 vertices and 400 triangles of roughly equal size; a closed
//!   surface with one hole (V = F / 2), so without T-junctions.
//! - *Distorted rooms* (4.3.3): each room rotated about all three axes, some vertices moved;
//!   96 triangles.
//! - *Cavern* (4.3.4): six rooms of one shape, 7 portals, transitions without an edge,
//!   548 triangles. Seven portals join six rooms in a 2 × 3 lattice, and 548 = 6 · 88 + 10 · 2:
//!   a globe of 12 meridians and 4 parallels (96 triangles) whose middle belt has four of its
//!   quadrangles extended into necks (88), the 10 necks that lead nowhere closed by two
//!   triangles. The thesis counts 68 vertices per room (408); shared, they are 272.
//!
//! Sizes in meters, angles and the choice of moved vertices are ours. Surfaces are the insides of the
//! air, without thickness, and face it.

use enfilade_geom::{DMat3, DMat4, DVec3};

use crate::transform::transformed;
use enfilade_demo::Rng;
use enfilade_demo::interior::Interior;
use enfilade_demo::solid::newell;
use enfilade_demo::{Convex, Opening, OpeningKind, Room, Side};
use enfilade_demo::{Generated, Site};

/// Variant of the four-room model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Variant {
    /// Minimal: 96 triangles.
    Optimised,
    /// 400 triangles of roughly equal size.
    Tessellated,
    /// 96 triangles, hardly two of them parallel.
    Distorted,
}

/// Plans of the rooms, `[[x0, z0], [x1, z1]]`, no two walls in one plane. [Units: wu]
const PLANS: [[[f64; 2]; 2]; 4] = [
    [[0.0, 0.0], [4.6, 4.2]],
    [[5.4, 0.7], [10.0, 5.3]],
    [[6.1, 6.2], [10.9, 10.3]],
    [[0.5, 5.1], [5.2, 9.5]],
];
const HEIGHT: f64 = 2.5;

/// Corridors: room and wall at the start, room and wall at the end, and the extent along both.
///
/// Wall `i` of a room runs from its vertex `i` to vertex `i + 1`; vertices are (x0, z0), (x1, z0),
/// (x1, z1), (x0, z1).
const CORRIDORS: [(usize, usize, usize, usize, [f64; 2]); 4] = [
    (0, 1, 1, 3, [2.0, 2.9]),
    (1, 2, 2, 0, [7.5, 8.4]),
    (2, 3, 3, 1, [7.0, 7.9]),
    (3, 0, 0, 2, [1.6, 2.5]),
];

/// Rotations of the distorted rooms about x, y and z. [Units: degrees]
const TURNS: [[f64; 3]; 4] = [
    [4.0, -5.0, 3.0],
    [-3.0, 4.0, 4.0],
    [3.0, 4.0, -4.0],
    [-4.0, -3.0, -3.0],
];

/// Moved vertices of the distorted rooms: room, vertex (floor 0-3, ceiling 4-7), displacement.
const MOVED: [(usize, usize, [f64; 3]); 8] = [
    (0, 0, [-0.30, -0.10, -0.25]),
    (0, 6, [0.10, 0.35, 0.05]),
    (1, 1, [0.25, -0.15, -0.20]),
    (1, 7, [-0.05, 0.25, 0.10]),
    (2, 2, [0.35, -0.05, 0.30]),
    (2, 4, [0.05, 0.30, -0.05]),
    (3, 3, [-0.25, -0.20, 0.20]),
    (3, 5, [0.10, 0.20, -0.10]),
];

/// Returns the rotation about x, then y, then z. [Units: degrees]
fn turn([x, y, z]: [f64; 3]) -> DMat3 {
    DMat3::from_rotation_z(z.to_radians())
        * DMat3::from_rotation_y(y.to_radians())
        * DMat3::from_rotation_x(x.to_radians())
}

/// The four rooms of section 4.3, the whole rotated by `degrees` about x, y and z in that order.
///
/// Its truth: four rooms and, as openings, the four corridors, each the rectangle in its middle with the
/// corridor's length for thickness.
#[must_use]
pub fn gjorup_rooms(variant: Variant, degrees: [f64; 3]) -> Generated {
    let name = match variant {
        Variant::Optimised => "gjorup-optimised",
        Variant::Tessellated => "gjorup-tessellated",
        Variant::Distorted => "gjorup-distorted",
    };
    let mut rooms = FourRooms::new(variant);
    let corridors = CORRIDORS
        .map(|(a, wall_a, b, wall_b, extent)| rooms.add_ends(a, wall_a, b, wall_b, extent));
    let volumes = [0, 1, 2, 3].map(|r| rooms.add_room(r));
    let mut mesh = rooms.mesh;
    for Corridor { p, q, .. } in &corridors {
        mesh.quad([p[0], p[1], q[0], q[1]]);
        mesh.quad([p[2], q[3], q[2], p[3]]);
        mesh.quad([p[0], q[1], q[3], p[2]]);
        mesh.quad([p[1], p[3], q[2], q[0]]);
    }
    let mut site = Site::new(name);
    let storey = site.storey("rooms", 0.0);
    for (r, corners) in rooms.corners.iter().enumerate() {
        let part = solid_of(corners.map(|i| mesh.corners[i as usize]));
        let mut room = Room::new(&format!("room {r}"), storey, vec![part], &[]);
        room.volume = volumes[r];
        site.add_room(room);
    }
    for corridor in &corridors {
        site.add_opening(corridor.opening(&mesh));
    }
    if variant == Variant::Tessellated {
        mesh.bisect_to(400);
    }
    finish(site, mesh, degrees)
}

/// The vertices of a corridor's end on a wall, in the wall's direction: floor 0, floor 1, ceiling 0,
/// ceiling 1.
type End = [u32; 4];

/// The four rooms under construction.
struct FourRooms {
    variant: Variant,
    mesh: Interior,
    /// Floor vertices 0-3 and ceiling vertices 4-7 of every room.
    corners: [[u32; 8]; 4],
    /// Per room and wall.
    ends: [[Option<End>; 4]; 4],
}

impl FourRooms {
    fn new(variant: Variant) -> Self {
        let mut mesh = Interior::default();
        let corners = [0, 1, 2, 3].map(|r| {
            [0, 1, 2, 3, 4, 5, 6, 7].map(|k| {
                let p = plan_corner(r, k);
                let is_distorted = variant == Variant::Distorted;
                mesh.corner(if is_distorted { distorted(r, k, p) } else { p })
            })
        });
        Self {
            variant,
            mesh,
            corners,
            ends: [[None; 4]; 4],
        }
    }

    /// Adds the two ends of a corridor.
    fn add_ends(
        &mut self,
        a: usize,
        wall_a: usize,
        b: usize,
        wall_b: usize,
        extent: [f64; 2],
    ) -> Corridor {
        let p = self.add_end(a, wall_a, extent);
        let q = self.add_end(b, wall_b, extent);
        Corridor {
            rooms: [a, b],
            p,
            q,
        }
    }

    fn add_end(&mut self, room: usize, wall: usize, extent: [f64; 2]) -> End {
        let axis = wall % 2;
        let (a, b) = (wall, (wall + 1) % 4);
        let corner = |k: usize| {
            PLANS[room][usize::from(if axis == 0 { k == 1 || k == 2 } else { k >= 2 })][axis]
        };
        let share = extent.map(|x| (x - corner(a)) / (corner(b) - corner(a)));
        let share = [share[0].min(share[1]), share[0].max(share[1])];
        let made = [(0, 0), (0, 1), (4, 0), (4, 1)].map(|(lift, i)| {
            let edge = [a + lift, b + lift].map(|k| self.corners[room][k]);
            let edge = edge.map(|c| self.mesh.corners[c as usize]);
            self.mesh.corner(edge[0].lerp(edge[1], share[i]))
        });
        self.ends[room][wall] = Some(made);
        made
    }

    /// Adds walls, floor and ceiling of a room around the ends of its corridors; returns its volume.
    fn add_room(&mut self, r: usize) -> f64 {
        let (mesh, c) = (&mut self.mesh, &self.corners[r]);
        let first = mesh.triangles.len();
        let mut ceiling = Vec::new();
        let mut floor = Vec::new();
        let mut plugs = Vec::new();
        for j in 0..4 {
            let k = (j + 1) % 4;
            floor.push(c[j]);
            ceiling.push(c[j + 4]);
            let Some([f0, f1, t0, t1]) = self.ends[r][j] else {
                mesh.quad([c[j], c[k], c[k + 4], c[j + 4]]);
                continue;
            };
            mesh.quad([c[j], f0, t0, c[j + 4]]);
            mesh.quad([f1, c[k], c[k + 4], t1]);
            plugs.push([f0, f1, t1, t0]);
            if self.variant == Variant::Tessellated {
                floor.extend([f0, f1]);
                ceiling.extend([t0, t1]);
            }
        }
        floor.reverse();
        for polygon in [floor, ceiling] {
            if let [a, b, c, d] = polygon[..] {
                mesh.quad([a, b, c, d]);
            } else {
                mesh.polygon(&polygon);
            }
        }
        mesh.air_volume(&mesh.triangles[first..], &plugs)
    }
}

/// Returns a vertex of a room by its plan: floor 0-3, ceiling 4-7. [Units: wu]
fn plan_corner(r: usize, k: usize) -> DVec3 {
    let [low, high] = PLANS[r];
    let plan = [low, [high[0], low[1]], high, [low[0], high[1]]];
    let y = if k < 4 { 0.0 } else { HEIGHT };
    DVec3::new(plan[k % 4][0], y, plan[k % 4][1])
}

/// Returns the same vertex of the distorted room.
fn distorted(r: usize, k: usize, p: DVec3) -> DVec3 {
    let [low, high] = PLANS[r];
    let middle = DVec3::new(
        f64::midpoint(low[0], high[0]),
        HEIGHT * 0.5,
        f64::midpoint(low[1], high[1]),
    );
    let moves = MOVED.iter().filter(|m| m.0 == r && m.1 == k);
    moves.fold(middle + turn(TURNS[r]) * (p - middle), |p, m| {
        p + DVec3::from_array(m.2)
    })
}

/// Returns the solid of a room's eight vertices.
fn solid_of(corners: [DVec3; 8]) -> Convex {
    // Faces of distorted rooms are not planar; triangulated as in the mesh (corridors aside), they
    // bound the room to within a few centimeters.
    let faces: [[u32; 4]; 6] = [
        [1, 2, 3, 0],
        [4, 7, 6, 5],
        [0, 4, 5, 1],
        [1, 5, 6, 2],
        [2, 6, 7, 3],
        [3, 7, 4, 0],
    ];
    let triangles = faces
        .iter()
        .flat_map(|f| [vec![f[0], f[1], f[2]], vec![f[0], f[2], f[3]]]);
    Convex {
        corners: corners.to_vec(),
        faces: triangles.collect(),
    }
}

/// A corridor: the rooms that it joins, and its ends in them.
struct Corridor {
    rooms: [usize; 2],
    p: End,
    q: End,
}

impl Corridor {
    /// Returns the rectangle in its middle.
    fn opening(&self, mesh: &Interior) -> Opening {
        let at = |i: u32| mesh.corners[i as usize];
        // `q` runs against `p`.
        let middle = |i: usize, j: usize| at(self.p[i]).midpoint(at(self.q[j]));
        let corners = [middle(1, 0), middle(0, 1), middle(2, 3), middle(3, 2)];
        let along = at(self.q[0]) - at(self.p[1]);
        let [a, b] = self.rooms;
        Opening {
            kind: OpeningKind::Opening,
            name: format!("corridor {a} to {b}"),
            center: corners.iter().sum::<DVec3>() / 4.0,
            normal: newell(&corners).normalize(),
            width: corners[0].distance(corners[1]),
            height: corners[1].distance(corners[2]),
            thickness: along.length(),
            corners,
            rooms: [Side::Room(a), Side::Room(b)],
        }
    }
}

fn finish(mut site: Site, mesh: Interior, degrees: [f64; 3]) -> Generated {
    let material = site.sheet_material("stone", [0.6, 0.57, 0.52]);
    let mesh = site.add_mesh(mesh.into_mesh("walls", material, true));
    site.place(
        "walls",
        mesh,
        DMat4::IDENTITY,
        enfilade_geom::scene::Role::Structural,
    );
    let generated = site.finish();
    if degrees == [0.0; 3] {
        return generated;
    }
    transformed(generated, &DMat4::from_mat3(turn(degrees)))
}

/// Distance between the centers of neighboring cavern rooms. [Units: wu]
///
/// A power of two, so that both rooms compute the same vertices for their common neck.
const PITCH: f64 = 8.0;
/// Half measures of a cavern room without its necks. [Units: wu]
const GLOBE: DVec3 = DVec3::new(3.0, 2.2, 3.0);
const MERIDIANS: usize = 12;
/// Latitudes of the parallels. [Units: degrees]
const PARALLELS: [f64; 4] = [-52.0, -16.0, 16.0, 52.0];
/// Half width and half height of a neck. [Units: wu]
const NECK: [f64; 2] = [0.55, 0.75];

/// The cavern of section 4.3.4, rotated by `degrees` about x, y and z in that order (the thesis rotates
/// it by 7, 8 and 9).
///
/// Its truth: six rooms, given by an ellipsoid well inside each, and the seven necks.
#[must_use]
pub fn gjorup_cavern(degrees: [f64; 3]) -> Generated {
    let mut site = Site::new("gjorup-cavern");
    let storey = site.storey("cavern", -GLOBE.y);
    let shape = cavern_shape();
    let mut mesh = Interior::default();
    for cell in 0..6 {
        let center = DVec3::new((cell % 3) as f64, 0.0, (cell / 3) as f64) * PITCH;
        let first = mesh.triangles.len();
        let necks = add_globe(&mut mesh, &shape, center, cell);
        for &(quad, other) in necks.iter().filter(|n| n.1 > cell) {
            site.add_opening(neck(&mesh, quad, [cell, other]));
        }
        let plugs: Vec<[u32; 4]> = necks.iter().map(|n| n.0).collect();
        let part = Convex::ellipsoid(center, GLOBE * 0.75);
        let mut room = Room::new(&format!("room {cell}"), storey, vec![part], &[]);
        room.volume = mesh.air_volume(&mesh.triangles[first..], &plugs);
        site.add_room(room);
    }
    finish(site, mesh, degrees)
}

/// Vertices of a cavern room by parallel and meridian, about its center.
type Shape = [[DVec3; MERIDIANS]; 4];

/// The common shape of all rooms: every vertex a little off the globe, with its four necks.
fn cavern_shape() -> Shape {
    let mut rng = Rng::new(1999);
    let mut shape = [[DVec3::ZERO; MERIDIANS]; 4];
    for (ring, latitude) in PARALLELS.iter().enumerate() {
        for (m, corner) in shape[ring].iter_mut().enumerate() {
            // Meridians 11 and 0 bound the quadrangle towards +x, 2 and 3 that towards +z, ...
            let longitude = (m as f64 * 30.0 + 15.0).to_radians();
            let (sin, cos) = latitude.to_radians().sin_cos();
            let direction = DVec3::new(cos * longitude.cos(), sin, cos * longitude.sin());
            *corner = direction * GLOBE * rng.range(0.92, 1.08);
        }
    }
    // Necks end halfway to the neighbor, off center, the same on opposite sides.
    for quarter in 0..4 {
        let along_x = quarter % 2 == 0;
        let sign = if quarter < 2 { 1.0 } else { -1.0 };
        let offset = if along_x {
            [0.25, -0.5]
        } else {
            [-0.375, -0.25]
        };
        for (m, side) in [((quarter * 3 + 11) % 12, -1.0), (quarter * 3, 1.0)] {
            // Longitude grows from +x to +z: the side of greater longitude is +z at +x, but -x
            // at +z.
            let turned = side * sign * if along_x { 1.0 } else { -1.0 };
            for (ring, up) in [(1, -1.0), (2, 1.0)] {
                let across = offset[0] + turned * NECK[0];
                let height = offset[1] + up * NECK[1];
                let reach = sign * PITCH * 0.5;
                shape[ring][m] = if along_x {
                    DVec3::new(reach, height, across)
                } else {
                    DVec3::new(across, height, reach)
                };
            }
        }
    }
    shape
}

/// Adds a room of the cavern; returns the ends of the necks that lead on, and the rooms behind them.
fn add_globe(
    mesh: &mut Interior,
    shape: &Shape,
    center: DVec3,
    cell: usize,
) -> Vec<([u32; 4], usize)> {
    let ids = shape.map(|ring| ring.map(|p| mesh.corner(center + p)));
    let top = mesh.corner(center + DVec3::Y * GLOBE.y);
    let bottom = mesh.corner(center - DVec3::Y * GLOBE.y);
    let mut necks = Vec::new();
    for m in 0..MERIDIANS {
        let n = (m + 1) % MERIDIANS;
        // Seen from inside, longitude grows to the right.
        mesh.triangles.push([bottom, ids[0][n], ids[0][m]]);
        mesh.triangles.push([top, ids[3][m], ids[3][n]]);
        for ring in 0..3 {
            let (low, high) = (&ids[ring], &ids[ring + 1]);
            let quad = [low[m], low[n], high[n], high[m]];
            let neighbor = (ring == 1).then(|| neighbor_beyond(m, cell)).flatten();
            match neighbor {
                None => mesh.quad(quad),
                Some(other) => necks.push((quad, other)),
            }
        }
    }
    necks
}

/// Returns the room behind the neck that begins at meridian `m`: 2 towards +z, 5 towards -x, 8 to -z, 11 to +x.
fn neighbor_beyond(m: usize, cell: usize) -> Option<usize> {
    let (ix, iz) = (cell % 3, cell / 3);
    match m {
        11 => (ix < 2).then(|| cell + 1),
        2 => (iz < 1).then_some(cell + 3),
        5 => (ix > 0).then(|| cell - 1),
        8 => (iz > 0).then(|| cell - 3),
        _ => None,
    }
}

/// Returns the opening at the end of a neck; `quad` faces the first room.
fn neck(mesh: &Interior, quad: [u32; 4], rooms: [usize; 2]) -> Opening {
    let [a, b, c, d] = quad.map(|i| mesh.corners[i as usize]);
    let corners = [b, a, d, c];
    Opening {
        kind: OpeningKind::Opening,
        name: format!("neck {} to {}", rooms[0], rooms[1]),
        center: corners.iter().sum::<DVec3>() / 4.0,
        normal: newell(&corners).normalize(),
        width: a.distance(b),
        height: b.distance(c),
        // Nominal: over this length the neck is hardly wider than at its narrowest.
        thickness: 0.5,
        corners,
        rooms: rooms.map(Side::Room),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle::{n_corners_and_edges, n_open_edges, signed_volume, structural_triangles};

    #[test]
    fn the_four_rooms_have_the_counts_of_the_thesis() {
        for (variant, corners, triangles) in [
            (Variant::Optimised, 64, 96),
            (Variant::Tessellated, 200, 400),
            (Variant::Distorted, 64, 96),
        ] {
            let g = gjorup_rooms(variant, [0.0; 3]);
            let t = structural_triangles(&g.scene);
            assert_eq!(t.len(), triangles);
            assert_eq!(n_corners_and_edges(&t).0, corners);
            assert_eq!((g.truth.rooms.len(), g.truth.openings.len()), (4, 4));
        }
    }

    #[test]
    fn the_rooms_enclose_the_volume_of_their_plans() {
        let area = |[[x0, z0], [x1, z1]]: [[f64; 2]; 2]| (x1 - x0) * (z1 - z0);
        let rooms: f64 = PLANS.into_iter().map(area).sum::<f64>() * HEIGHT;
        // Corridors are 0.9 m wide and 0.8 to 0.9 m long.
        let corridors = 0.9 * (0.8 + 0.9 + 0.9 + 0.9) * HEIGHT;
        for variant in [Variant::Optimised, Variant::Tessellated] {
            let t = structural_triangles(&gjorup_rooms(variant, [0.0; 3]).scene);
            // Positions are f32: 1e-6 of 200 m³.
            assert!((signed_volume(&t) + rooms + corridors).abs() < 1e-3);
        }
        let g = gjorup_rooms(Variant::Optimised, [7.0, 8.0, 9.0]);
        let told: f64 = g.truth.rooms.iter().map(|r| r.volume).sum();
        assert!((told - rooms).abs() < 1e-9);
    }

    #[test]
    fn tessellated_triangles_are_of_roughly_one_size_and_closed() {
        let g = gjorup_rooms(Variant::Tessellated, [0.0; 3]);
        let t = structural_triangles(&g.scene);
        assert_eq!(n_open_edges(&t), 0);
        let longest = |t: &[DVec3; 3]| {
            (0..3)
                .map(|i| t[i].distance(t[(i + 1) % 3]))
                .fold(0.0, f64::max)
        };
        let edges: Vec<f64> = t.iter().map(longest).collect();
        assert!(
            edges.iter().all(|&e| e < 2.6),
            "{:?}",
            edges.iter().copied().fold(0.0, f64::max)
        );
    }

    #[test]
    fn no_two_walls_of_the_plain_rooms_lie_in_one_plane() {
        for axis in 0..2 {
            let mut planes: Vec<f64> = PLANS.iter().flatten().map(|p| p[axis]).collect();
            planes.sort_by(f64::total_cmp);
            assert!(planes.windows(2).all(|w| w[1] - w[0] > 0.1), "{planes:?}");
        }
    }

    #[test]
    fn the_cavern_has_the_counts_of_the_thesis() {
        let g = gjorup_cavern([7.0, 8.0, 9.0]);
        let t = structural_triangles(&g.scene);
        assert_eq!(t.len(), 548);
        assert_eq!(n_corners_and_edges(&t).0, 272);
        assert_eq!(n_open_edges(&t), 0);
        assert_eq!((g.truth.rooms.len(), g.truth.openings.len()), (6, 7));
        let told: f64 = g.truth.rooms.iter().map(|r| r.volume).sum();
        // Turned positions are rounded to f32.
        assert!((signed_volume(&t) + told).abs() < 1e-2);
        // Seven necks, nothing else, join six rooms: two rings.
        let (corners, edges) = n_corners_and_edges(&t);
        assert_eq!(corners as i64 - edges as i64 + t.len() as i64, 2 - 2 * 2);
    }
}

//! Corridors as high as the rooms that they open to, without a frame at their mouths. Covers V12.

use enfilade_bake::{BakeConfig, BakeContext, Method, Silent, bake};
use enfilade_cpg::CellPortalGraph;
use enfilade_geom::scene::{Material, Mesh, Object, Primitive, Role, Scene};
use enfilade_geom::{DMat4, DVec3};
use enfilade_testkit::solid::{MeshBuilder, aabb};

fn graph_of(method: Method, mesh: Mesh) -> CellPortalGraph {
    let scene = Scene {
        meshes: vec![mesh],
        materials: vec![Material::default()],
        objects: vec![Object {
            name: String::new(),
            mesh: 0,
            transform: DMat4::IDENTITY,
            role: Role::Structural,
            reason: String::new(),
            filling: None,
            node: None,
        }],
        ..Scene::default()
    };
    let context = BakeContext::new(&Silent, None);
    let baked = bake(&scene, &BakeConfig::of(method), &context).unwrap();
    baked.world.graph
}

/// Rooms and corridors, 2.7 m high, in plan: minimum and maximum (x, z).
fn plan(method: Method, air: &[[f64; 4]]) -> CellPortalGraph {
    let voids: Vec<_> = air
        .iter()
        .map(|&[x0, z0, x1, z1]| aabb([x0, 0.0, z0], [x1, 2.7, z1]))
        .collect();
    let lump = voids.iter().fold(voids[0], |b, v| b.union(*v));
    let mut mesh = MeshBuilder::new(0);
    mesh.carved(&[lump.expanded(0.3)], &voids);
    graph_of(method, mesh.build("", &[]))
}

fn n_indoors(graph: &CellPortalGraph) -> usize {
    graph.indoor_cells().count()
}

/// Returns the positions of the portals along x, ascending.
fn portals_at(graph: &CellPortalGraph) -> Vec<f64> {
    let middle = |outline: &[[f32; 3]]| {
        let sum: f64 = outline.iter().map(|p| f64::from(p[0])).sum();
        sum / outline.len() as f64
    };
    let mut at: Vec<f64> = graph.portals.iter().map(|p| middle(&p.outline)).collect();
    at.sort_by(f64::total_cmp);
    at
}

fn a_corridor_between_two_rooms_has_a_portal_at_both_ends(method: Method) {
    for width in [0.9, 1.2, 1.6, 2.0] {
        let (lo, hi) = (3.0 - width * 0.5, 3.0 + width * 0.5);
        let graph = plan(
            method,
            &[
                [0.0, 0.0, 6.0, 6.0],
                [6.0, lo, 26.0, hi],
                [26.0, 0.0, 32.0, 6.0],
            ],
        );
        assert_eq!(n_indoors(&graph), 3, "{width}");
        let at = portals_at(&graph);
        assert_eq!(at.len(), 2, "{width}: {at:?}");
        // Fronts of tetrahedra, which are as long as the corridor is wide, are more ragged than those of voxels.
        let astray = match method {
            Method::Delaunay => 0.5 * width,
            _ => 0.3,
        };
        for (x, end) in at.iter().zip([6.0, 26.0]) {
            assert!((x - end).abs() < astray, "{width}: {at:?}");
        }
    }
}

fn corridors_that_bend_and_cross_are_one_room(method: Method) {
    let room = |x: f64, z: f64| [x, z, x + 6.0, z + 6.0];
    let bend = plan(
        method,
        &[
            room(0.0, 0.0),
            [6.0, 2.2, 15.0, 3.8],
            [13.4, 3.8, 15.0, 12.0],
            room(11.0, 12.0),
        ],
    );
    assert_eq!((n_indoors(&bend), bend.portals.len()), (3, 2));
    let along = [6.0, 2.2, 26.0, 3.8];
    let branch = plan(
        method,
        &[
            room(0.0, 0.0),
            along,
            room(26.0, 0.0),
            [15.0, 3.8, 16.6, 12.0],
            room(12.8, 12.0),
        ],
    );
    assert_eq!((n_indoors(&branch), branch.portals.len()), (4, 3));
    let crossing = plan(
        method,
        &[
            room(0.0, 0.0),
            along,
            room(26.0, 0.0),
            [15.0, -8.0, 16.6, 12.0],
            room(12.8, 12.0),
            room(12.8, -14.0),
        ],
    );
    assert_eq!((n_indoors(&crossing), crossing.portals.len()), (5, 4));
}

fn alcoves_and_doors_stay_what_they_are(method: Method) {
    let alcove = plan(method, &[[0.0, 0.0, 6.0, 6.0], [6.0, 2.2, 8.0, 3.8]]);
    assert_eq!(n_indoors(&alcove), 1);
    // A corridor that has doors to two chambers hardly wider than itself, and opens to a hall at its end.
    let doors = plan(
        method,
        &[
            [0.0, 0.0, 6.0, 6.0],
            [6.0, 2.2, 16.0, 3.8],
            [8.0, 3.8, 8.9, 4.0],
            [7.0, 4.0, 9.4, 8.0],
            [13.0, 3.8, 13.9, 4.0],
            [12.2, 4.0, 14.6, 8.0],
        ],
    );
    assert_eq!((n_indoors(&doors), doors.portals.len()), (4, 3));
}

fn a_tube_between_two_spheres_is_a_room_with_two_portals(method: Method) {
    // Radius at positions along x: spheres of 3 m at 0 and 16, a tube of 0.8 m between them.
    let mouth = (9.0_f64 - 0.64).sqrt();
    let ring = |x: f64, c: f64| (x, (9.0 - (x - c) * (x - c)).max(0.0).sqrt());
    let n = 24;
    let step = |i: usize, lo: f64, hi: f64| lo + (hi - lo) * i as f64 / n as f64;
    let mut profile: Vec<(f64, f64)> = (0..=n).map(|i| ring(step(i, -3.0, mouth), 0.0)).collect();
    profile.extend((0..=n).map(|i| ring(step(i, 16.0 - mouth, 19.0), 16.0)));
    let sides = 48;
    let mut part = Primitive {
        material: Some(0),
        ..Primitive::default()
    };
    for &(x, r) in &profile {
        for k in 0..sides {
            let a = std::f64::consts::TAU * f64::from(k) / f64::from(sides);
            let p = DVec3::new(x, r * a.cos(), r * a.sin());
            part.positions.push(p.as_vec3().to_array());
        }
    }
    for i in 0..profile.len() as u32 - 1 {
        for k in 0..sides as u32 {
            let at = |i: u32, k: u32| i * sides as u32 + k % sides as u32;
            let [a, b, c, d] = [at(i, k), at(i, k + 1), at(i + 1, k + 1), at(i + 1, k)];
            part.indices.extend([a, c, b, a, d, c]);
        }
    }
    let graph = graph_of(
        method,
        Mesh {
            name: String::new(),
            primitives: vec![part],
        },
    );
    assert_eq!(n_indoors(&graph), 3);
    let at = portals_at(&graph);
    assert_eq!(at.len(), 2, "{at:?}");
    assert!(
        (at[0] - mouth).abs() < 0.3 && (at[1] - 16.0 + mouth).abs() < 0.3,
        "{at:?}"
    );
}

/// Makes a test of each function with the given methods.
macro_rules! by {
    ($($of:ident $method:ident: $($name:ident),* $(,)?;)*) => {
        $(mod $of {
            $(#[test]
            fn $name() {
                super::$name(enfilade_bake::Method::$method);
            })*
        })*
    };
}

by! {
    watershed Watershed:
        a_corridor_between_two_rooms_has_a_portal_at_both_ends,
        corridors_that_bend_and_cross_are_one_room,
        alcoves_and_doors_stay_what_they_are,
        a_tube_between_two_spheres_is_a_room_with_two_portals;
    // Each facet of a curved surface has a plane of its own: no scene for a partition.
    bsp Bsp:
        a_corridor_between_two_rooms_has_a_portal_at_both_ends,
        corridors_that_bend_and_cross_are_one_room,
        alcoves_and_doors_stay_what_they_are;
    // A tube between two spheres is divided where balls meet by chance: its two halves are too short for limbs.
    delaunay Delaunay:
        a_corridor_between_two_rooms_has_a_portal_at_both_ends,
        corridors_that_bend_and_cross_are_one_room,
        alcoves_and_doors_stay_what_they_are;
}

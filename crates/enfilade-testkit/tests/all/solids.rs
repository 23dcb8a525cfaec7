//! The solid modeller: every solid is closed and has the right volume.

use enfilade_geom::scene::{Mesh, Object, Role, Scene};
use enfilade_geom::{Aabb, DMat4, DVec3, Triangle};
use enfilade_testkit::oracle::{
    n_corners_and_edges, n_open_edges, object_triangles, signed_volume,
};
use enfilade_testkit::solid::{MeshBuilder, Steps, aabb, icosahedron, triangulate};
use enfilade_testkit::{Convex, Rng};
use proptest::prelude::*;

fn triangles(b: MeshBuilder) -> Vec<Triangle> {
    let mesh: Mesh = b.build("solid", &[]);
    let object = Object {
        name: String::new(),
        mesh: 0,
        transform: DMat4::IDENTITY,
        role: Role::Structural,
        reason: String::new(),
        filling: None,
        node: None,
    };
    let scene = Scene {
        meshes: vec![mesh],
        objects: vec![object],
        ..Scene::default()
    };
    object_triangles(&scene, 0)
}

/// Vertices are rounded to `f32`: relative 6e-8 of up to 10 m, over up to 600 m² of surface.
const VOLUME_SLACK: f64 = 1e-3;

#[test]
fn a_wall_with_door_and_window_is_closed_and_each_edge_joins_two_faces() {
    let mut wall = MeshBuilder::new(0);
    let holes = [
        aabb([1.0, 0.0, 0.0], [1.9, 2.1, 0.3]),
        aabb([3.0, 0.9, 0.0], [4.5, 2.2, 0.3]),
    ];
    wall.carved(&[aabb([0.0; 3], [6.0, 2.7, 0.3])], &holes);
    let t = triangles(wall);
    assert_eq!(n_open_edges(&t), 0);
    // Each edge in exactly two triangles.
    assert_eq!(n_corners_and_edges(&t).1 * 2, t.len() * 3);
    let want = 6.0 * 2.7 * 0.3 - 0.9 * 2.1 * 0.3 - 1.5 * 1.3 * 0.3;
    assert!((signed_volume(&t) - want).abs() < VOLUME_SLACK);
}

#[test]
fn stairs_have_their_volume_and_are_closed() {
    for n in [2, 5, 18] {
        let steps = Steps {
            n,
            riser: 0.17,
            going: 0.27,
            waist: 0.1,
        };
        for uphill in [DVec3::X, -DVec3::X, DVec3::Z, -DVec3::Z] {
            let mut b = MeshBuilder::new(0);
            b.flight(DVec3::new(1.0, 2.0, 3.0), uphill, 1.2, &steps);
            let t = triangles(b);
            assert_eq!(n_open_edges(&t), 0);
            let told = steps.volume_below(1.2, f64::INFINITY);
            assert!((signed_volume(&t) - told).abs() < 2e-3, "{n}: {told}");
            let top = t.iter().flatten().map(|p| p.y).fold(0.0, f64::max);
            // f32 near 5.
            assert!((top - (2.0 + (n - 1) as f64 * 0.17)).abs() < 1e-6);
        }
    }
}

#[test]
fn an_icosahedron_has_twenty_outward_faces() {
    let (corners, faces) = icosahedron();
    let t: Vec<Triangle> = faces.iter().map(|f| f.map(|i| corners[i])).collect();
    assert_eq!(n_open_edges(&t), 0);
    // Volume over the cube of the edge: 5 (3 + √5) / 12.
    let edge = corners[faces[0][0]].distance(corners[faces[0][1]]);
    let want = 5.0 * (3.0 + 5.0_f64.sqrt()) / 12.0 * edge.powi(3);
    assert!((signed_volume(&t) - want).abs() < 1e-12);
}

#[test]
fn an_ellipsoid_is_convex_closed_and_turned_outwards() {
    let center = DVec3::new(3.0, -1.0, 2.0);
    let e = Convex::ellipsoid(center, DVec3::new(3.0, 1.0, 2.0));
    let t: Vec<Triangle> = e
        .triangles()
        .iter()
        .map(|t| t.map(|i| e.corners[i as usize]))
        .collect();
    assert_eq!(n_open_edges(&t), 0);
    assert!(e.corners.iter().all(|&c| e.contains(c, -1e-9)));
    assert!(e.contains(center, 0.9) && !e.contains(center, 1.1));
    let smooth = 4.0 / 3.0 * std::f64::consts::PI * 6.0;
    assert!(e.volume() < smooth && e.volume() > 0.9 * smooth);
}

fn arb_box() -> impl Strategy<Value = Aabb> {
    // On a grid of half meters: coinciding planes are the hard case.
    (
        prop::array::uniform3(0..12i32),
        prop::array::uniform3(1..8i32),
    )
        .prop_map(|(low, size)| {
            let low = DVec3::from_array(low.map(f64::from)) * 0.5;
            Aabb::new(low, low + DVec3::from_array(size.map(f64::from)) * 0.5)
        })
}

proptest! {
    #[test]
    fn carved_boxes_are_closed_and_as_large_as_their_set(
        solids in prop::collection::vec(arb_box(), 1..5),
        voids in prop::collection::vec(arb_box(), 0..5),
    ) {
        let mut b = MeshBuilder::new(0);
        b.carved(&solids, &voids);
        let t = triangles(b);
        prop_assert_eq!(n_open_edges(&t), 0);
        // Count the cubes of half a meter by their middles.
        let mut n = 0;
        for i in 0..20 * 20 * 20 {
            let p = DVec3::new(f64::from(i % 20), f64::from(i / 20 % 20), f64::from(i / 400));
            let p = (p + 0.5) * 0.5;
            n += i32::from(
                solids.iter().any(|s| s.contains(p)) && !voids.iter().any(|v| v.contains(p)),
            );
        }
        prop_assert!((signed_volume(&t) - f64::from(n) * 0.125).abs() < VOLUME_SLACK);
    }

    #[test]
    fn triangulations_cover_polygons_once(seed in 0..10_000u64, n in 3..24usize) {
        // A star-shaped polygon with some vertices in the middle of straight edges, in a plane of
        // any orientation.
        let mut rng = Rng::new(seed);
        let u = DVec3::new(rng.range(-1.0, 1.0), rng.range(-1.0, 1.0), 1.1).normalize();
        let v = u.cross(DVec3::new(0.3, rng.range(0.5, 1.0), -0.2)).normalize();
        let mut corners: Vec<DVec3> = (0..n)
            .map(|i| {
                let (s, c) = (std::f64::consts::TAU * i as f64 / n as f64).sin_cos();
                (u * c + v * s) * rng.range(1.0, 4.0)
            })
            .collect();
        for _ in 0..3 {
            let i = rng.below(corners.len());
            let middle = corners[i].midpoint(corners[(i + 1) % corners.len()]);
            corners.insert(i + 1, middle);
        }
        let normal = u.cross(v);
        let found = triangulate(&corners);
        prop_assert_eq!(found.len(), corners.len() - 2);
        let area = |t: [DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]).dot(normal) * 0.5;
        let whole: f64 =
            (1..corners.len() - 1).map(|i| area([corners[0], corners[i], corners[i + 1]])).sum();
        let mut sum = 0.0;
        for t in &found {
            let a = area(t.map(|i| corners[i]));
            prop_assert!(a > 0.0, "a triangle of area {}", a);
            sum += a;
        }
        // All have the right orientation and together the polygon's area: none overlaps another.
        prop_assert!((sum - whole).abs() < 1e-9);
    }

    #[test]
    fn prisms_are_closed_whichever_way_they_are_swept(seed in 0..10_000u64, n in 3..12usize) {
        let mut rng = Rng::new(seed);
        let profile: Vec<DVec3> = (0..n)
            .map(|i| {
                let (s, c) = (std::f64::consts::TAU * i as f64 / n as f64).sin_cos();
                DVec3::new(c, 0.0, s) * rng.range(1.0, 3.0)
            })
            .collect();
        let along = DVec3::new(rng.range(-1.0, 1.0), rng.range(0.5, 2.0), 0.0);
        let mut volumes = Vec::new();
        for along in [along, -along] {
            let mut b = MeshBuilder::new(0);
            b.prism(&profile, along);
            let t = triangles(b);
            prop_assert_eq!(n_open_edges(&t), 0);
            volumes.push(signed_volume(&t));
        }
        prop_assert!(volumes[0] > 0.0 && (volumes[0] - volumes[1]).abs() < VOLUME_SLACK);
    }
}

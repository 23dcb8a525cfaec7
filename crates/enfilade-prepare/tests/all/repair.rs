//! Repairs of surfaces with known defects. Covers S5.

use crate::import_common as common;

use std::collections::HashMap;

use common::{box_primitive, scene_of, world};
use enfilade_geom::scene::{Object, Primitive, Role, Scene};
use enfilade_geom::{ConvexSolid, DMat4, DVec3, Plane, Triangle};
use enfilade_import::{
    BadOption, CleaningOptions, Finding, ImportOptions, RepairOptions, RepairReport,
    cleaning_report, decode_obj, export_glb, repair,
};
use enfilade_prepare::put_back;
use enfilade_testkit::oracle::{n_open_edges, object_triangles, signed_volume};
use enfilade_testkit::{Disturbance, Fault, Rng, disturb, furnished_house};
use proptest::prelude::*;

fn repaired(scene: &Scene, options: &RepairOptions) -> (Scene, RepairReport) {
    let mut out = scene.clone();
    let report = repair(&mut out, options).unwrap();
    (out, report)
}

fn changes(report: &RepairReport) -> Vec<(&'static str, u64)> {
    let counts = report.counts().into_iter();
    counts.take(9).filter(|c| c.1 > 0).collect()
}

fn is_unchanged_by(scene: &Scene, options: &RepairOptions) {
    let (again, report) = repaired(scene, options);
    assert_eq!(changes(&report), []);
    assert!(report.is_settled);
    assert_eq!(export_glb(&again), export_glb(scene));
}

fn alone(primitive: Primitive) -> Scene {
    scene_of(primitive, &[DMat4::IDENTITY])
}

/// A box of 2 x 3 x 4 m, each side `n` squares by `n`, closed.
fn fine_box(n: u32) -> Primitive {
    let mut out = Primitive::default();
    let mut number = HashMap::new();
    let coarse = box_primitive([2.0, 3.0, 4.0]);
    for [a, b, c] in coarse.triangles() {
        let mut at = |i: u32, j: u32| {
            // Each vertex in whole numbers of steps, so that neighbors agree to the bit.
            let p = (a * f64::from(n - i - j) + b * f64::from(i) + c * f64::from(j)) / f64::from(n);
            let p = p.as_vec3().to_array();
            *number.entry(p.map(f32::to_bits)).or_insert_with(|| {
                out.positions.push(p);
                out.positions.len() as u32 - 1
            })
        };
        let mut indices = Vec::new();
        for i in 0..n {
            for j in 0..n - i {
                indices.extend([at(i, j), at(i + 1, j), at(i, j + 1)]);
                if i + j + 1 < n {
                    indices.extend([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
        out.indices.extend(indices);
    }
    out
}

fn flip(primitive: &mut Primitive, triangles: impl IntoIterator<Item = usize>) {
    for t in triangles {
        primitive.indices.swap(3 * t, 3 * t + 1);
    }
}

#[test]
fn what_is_whole_keeps_its_bits() {
    let house = furnished_house().scene;
    let (out, report) = repaired(&house, &RepairOptions::default());
    assert_eq!(changes(&report), []);
    assert_eq!(export_glb(&out), export_glb(&house));
    // Fine detail that is closed stays unchanged, however small its triangles are.
    let mut tiny = fine_box(8);
    tiny.positions.iter_mut().flatten().for_each(|x| *x *= 1e-3);
    is_unchanged_by(&alone(tiny), &RepairOptions::default());
}

#[test]
fn a_jittered_building_is_closed_again() {
    let house = furnished_house().scene;
    let by = Disturbance {
        jitter: 1e-4,
        seed: 7,
        ..Disturbance::default()
    };
    let spoilt = disturb(&house, &by);
    let options = RepairOptions::default();
    let (out, report) = repaired(&spoilt, &options);
    assert!(report.welded_corners > 1000, "{report}");
    assert!(report.is_settled);
    assert_eq!(out.objects.len(), house.objects.len());
    let mut n_closed = 0;
    for o in 0..house.objects.len() {
        if house.objects[o].role != Role::Structural {
            continue;
        }
        let (before, after) = (object_triangles(&house, o), object_triangles(&out, o));
        let is_closed = n_open_edges(&before) == 0;
        n_closed += usize::from(is_closed);
        assert!(
            n_open_edges(&after) <= n_open_edges(&before),
            "{}: {} edges open",
            house.objects[o].name,
            n_open_edges(&after)
        );
        if is_closed {
            let (v, w) = (signed_volume(&before), signed_volume(&after));
            assert!((v - w).abs() < 2e-3 * v.abs(), "{v} {w}");
        }
    }
    assert!(n_closed > 5, "{n_closed}");
    is_unchanged_by(&out, &options);
}

#[test]
fn t_junctions_of_a_subdivided_cube_are_split() {
    // One side has eight triangles, its neighbors two.
    let fine = fine_box(2);
    let coarse = box_primitive([2.0, 3.0, 4.0]);
    let mut mixed = coarse.clone();
    mixed.indices.drain(0..6);
    let first = mixed.positions.len() as u32;
    mixed.positions.extend(&fine.positions);
    let of_side = fine.indices[..2 * 4 * 3].iter().map(|i| i + first);
    mixed.indices.extend(of_side);
    let scene = alone(mixed);
    assert!(n_open_edges(&world(&scene)) > 0);
    let (out, report) = repaired(&scene, &RepairOptions::default());
    assert_eq!(
        changes(&report),
        [("T-junctions split", 4), ("objects changed", 1)]
    );
    assert_eq!(n_open_edges(&world(&out)), 0);
    assert!((signed_volume(&world(&out)) - 24.0).abs() < 1e-6);
    is_unchanged_by(&out, &RepairOptions::default());
}

#[test]
fn cut_edges_carry_what_lies_between() {
    // Two triangles meet one along its edge from (0,0) to (2,0); the middle is a quarter along.
    let primitive = Primitive {
        positions: vec![
            [0., 0., 0.],
            [2., 0., 0.],
            [1., 1., 0.],
            [0.5, 0., 0.],
            [1., -1., 0.],
        ],
        uvs: vec![vec![[0., 0.], [4., 8.], [0., 0.], [9., 9.], [0., 0.]]],
        colors: vec![[0.0; 4], [1.0; 4], [0.0; 4], [0.5; 4], [0.0; 4]],
        normals: vec![[0., 0., 1.]; 5],
        indices: vec![0, 1, 2, 3, 0, 4, 1, 3, 4],
        ..Primitive::default()
    };
    let (out, report) = repaired(&alone(primitive), &RepairOptions::default());
    assert_eq!(report.t_junctions, 1);
    let p = &out.meshes[0].primitives[0];
    let of_cut: Vec<_> = (0..p.positions.len())
        .filter(|&i| p.positions[i] == [0.5, 0., 0.])
        .map(|i| (p.uvs[0][i], p.colors[i], p.normals[i]))
        .collect();
    assert!(
        of_cut.contains(&([1., 2.], [0.25; 4], [0., 0., 1.])),
        "{of_cut:?}"
    );
    assert!(
        of_cut.contains(&([9., 9.], [0.5; 4], [0., 0., 1.])),
        "{of_cut:?}"
    );
}

#[test]
fn what_is_there_twice_or_has_no_area_goes() {
    let mut cube = box_primitive([1.0; 3]);
    cube.indices.extend_from_within(3..9);
    cube.indices.extend([0, 0, 1]);
    let scene = scene_of(cube, &[DMat4::IDENTITY, DMat4::IDENTITY]);
    let (out, report) = repaired(&scene, &RepairOptions::default());
    assert_eq!(
        changes(&report),
        [
            ("degenerate triangles removed", 2),
            ("duplicate triangles removed", 16),
            ("objects changed", 2)
        ]
    );
    assert_eq!((out.objects.len(), world(&out).len()), (1, 12));
    assert_eq!(n_open_edges(&world(&out)), 0);

    // A copy with reversed winding, on a closed shell.
    let mut cube = box_primitive([1.0; 3]);
    cube.indices.extend_from_within(3..6);
    flip(&mut cube, [12]);
    let (out, report) = repaired(&alone(cube), &RepairOptions::default());
    assert_eq!(report.duplicate_triangles, 1);
    assert_eq!(n_open_edges(&world(&out)), 0);

    // Both sides of a sheet, and touching sides of boxes, are not duplicates.
    let mut sheet = box_primitive([1.0; 3]);
    sheet.indices.truncate(6);
    let n = sheet.indices.len() / 3;
    sheet.indices.extend_from_within(..);
    flip(&mut sheet, n..2 * n);
    is_unchanged_by(&alone(sheet), &RepairOptions::default());
    let beside = DMat4::from_translation(DVec3::X);
    let boxes = scene_of(box_primitive([1.0; 3]), &[DMat4::IDENTITY, beside]);
    is_unchanged_by(&boxes, &RepairOptions::default());
}

#[test]
fn a_cap_goes_and_what_lay_behind_it_is_cut() {
    // Edge 0 1 of one triangle and vertex 3 of two others, with a triangle without height between them.
    let primitive = Primitive {
        positions: vec![
            [0., 0., 0.],
            [2., 0., 0.],
            [1., 1., 0.],
            [1., -4e-6, 0.],
            [1., -1., 0.],
        ],
        indices: vec![0, 1, 2, 1, 0, 3, 3, 0, 4, 1, 3, 4],
        ..Primitive::default()
    };
    let open = |s: &Scene| n_open_edges(&world(s));
    let scene = alone(primitive);
    assert_eq!(open(&scene), 4);
    let (out, report) = repaired(&scene, &RepairOptions::default());
    assert_eq!(report.degenerate_triangles, 1);
    assert_eq!((open(&out), world(&out).len()), (4, 4));
}

#[test]
fn rims_of_sheets_and_large_openings_are_no_holes() {
    let options = RepairOptions {
        hole: 3.0,
        ..RepairOptions::default()
    };
    // A sheet of two triangles, a single triangle, and a bent sheet.
    let mut sheet = box_primitive([1.0; 3]);
    sheet.indices.truncate(6);
    is_unchanged_by(&alone(sheet.clone()), &options);
    sheet.indices.truncate(3);
    is_unchanged_by(&alone(sheet), &options);
    // A box without its top, whose diagonal is 1.42 m.
    let mut open = box_primitive([1.0; 3]);
    open.indices.drain(18..24);
    let small = RepairOptions {
        hole: 1.41,
        ..RepairOptions::default()
    };
    let (_, report) = repaired(&alone(open.clone()), &small);
    assert_eq!((report.filled_holes, report.open_rims), (0, 1));
    let (out, report) = repaired(&alone(open), &options);
    assert_eq!((report.filled_holes, report.filling_triangles), (1, 2));
    assert_eq!(n_open_edges(&world(&out)), 0);
    assert!((signed_volume(&world(&out)) - 1.0).abs() < 1e-6);
}

#[test]
fn single_missing_triangles_are_put_back_and_told() {
    let whole = box_primitive([1.0, 1.0, 4.0]);
    let n_whole = world(&alone(whole.clone())).len();
    for missing in [0, 5, 11] {
        let mut torn = whole.clone();
        torn.indices.drain(3 * missing..3 * missing + 3);
        let mut scene = alone(torn);
        let found = put_back(&mut scene);
        assert_eq!((found.n, found.examples.len()), (1, 1), "{missing}");
        assert_eq!(world(&scene).len(), n_whole);
        assert_eq!(n_open_edges(&world(&scene)), 0);
        assert_eq!(put_back(&mut scene), Finding::default());
    }
}

#[test]
fn openings_of_four_corners_rims_and_steep_caps_are_not_put_back() {
    // A box without a face, a sheet of one triangle, and a tetrahedron without its base: its faces stand too steep to go on into it.
    let mut open = box_primitive([1.0; 3]);
    open.indices.drain(18..24);
    let mut sheet = box_primitive([1.0; 3]);
    sheet.indices.truncate(3);
    let tent = Primitive {
        positions: vec![[0.; 3], [1., 0., 0.], [0.5, 0., 0.8], [0.5, 1.0, 0.3]],
        indices: vec![0, 3, 1, 1, 3, 2, 2, 3, 0],
        ..Primitive::default()
    };
    for primitive in [open, sheet, tent] {
        let mut scene = alone(primitive);
        let before = world(&scene);
        assert_eq!(put_back(&mut scene), Finding::default());
        assert_eq!(world(&scene), before);
    }
}

#[test]
fn a_hole_takes_material_and_texture_from_its_rim() {
    let mut open = box_primitive([1.0; 3]);
    let n = open.positions.len();
    open.normals = vec![[0., 1., 0.]; n];
    open.uvs = vec![(0..n).map(|i| [i as f32, 0.5]).collect()];
    open.indices.drain(18..21);
    let options = RepairOptions {
        hole: 2.0,
        ..RepairOptions::default()
    };
    let (out, report) = repaired(&alone(open.clone()), &options);
    assert_eq!(report.filling_triangles, 1);
    let p = &out.meshes[0].primitives[0];
    let added = &p.indices[p.indices.len() - 3..];
    let corners: Vec<DVec3> = added
        .iter()
        .map(|&i| DVec3::from_array(p.positions[i as usize].map(f64::from)))
        .collect();
    let normal = (corners[1] - corners[0])
        .cross(corners[2] - corners[0])
        .normalize();
    for &i in added {
        assert_eq!(
            DVec3::from_array(p.normals[i as usize].map(f64::from)),
            normal
        );
        let from = open
            .positions
            .iter()
            .position(|q| *q == p.positions[i as usize]);
        assert_eq!(p.uvs[0][i as usize], [from.unwrap() as f32, 0.5]);
    }
}

#[test]
fn a_wall_without_a_triangle_is_filled_among_the_sheets_of_a_room() {
    // Six sheets, each an object of its own; one lacks a triangle.
    let cube = box_primitive([4.0, 3.0, 4.0]);
    let mut scene = alone(cube.clone());
    scene.objects.clear();
    scene.meshes.clear();
    for side in 0..6 {
        let mut one = alone(Primitive {
            indices: cube.indices[6 * side..6 * side + 6].to_vec(),
            ..cube.clone()
        });
        if side == 2 {
            one.meshes[0].primitives[0].indices.truncate(3);
        }
        scene.objects.push(Object {
            mesh: side as u32,
            ..one.objects[0].clone()
        });
        scene.meshes.append(&mut one.meshes);
    }
    let options = RepairOptions {
        hole: 8.0,
        ..RepairOptions::default()
    };
    let (out, report) = repaired(&scene, &options);
    assert_eq!((report.filled_holes, report.changed_objects), (1, 1));
    assert_eq!(n_open_edges(&world(&out)), 0);
}

#[test]
fn solids_face_outwards_and_rooms_inwards() {
    let all = |p: &mut Primitive| flip(p, 0..12);
    // A wall that is inside out.
    let mut wall = box_primitive([4.0, 3.0, 0.2]);
    all(&mut wall);
    let (out, report) = repaired(&alone(wall), &RepairOptions::default());
    assert_eq!((report.turned_triangles, report.shells_outwards), (12, 1));
    assert!(signed_volume(&world(&out)) > 0.0);
    // A room modeled from within, with one triangle turned.
    let mut room = box_primitive([4.0, 3.0, 5.0]);
    all(&mut room);
    flip(&mut room, [5]);
    let (out, report) = repaired(&alone(room), &RepairOptions::default());
    assert_eq!((report.turned_triangles, report.shells_rooms), (1, 1));
    assert!((signed_volume(&world(&out)) + 60.0).abs() < 1e-6);
    // A hollow wall: the inside of its lining faces the hollow.
    let mut hollow = box_primitive([4.0, 3.0, 0.3]);
    let mut inner = box_primitive([3.8, 2.8, 0.1]);
    all(&mut inner);
    let first = hollow.positions.len() as u32;
    let moved = inner.positions.iter().map(|p| p.map(|x| x + 0.1));
    hollow.positions.extend(moved);
    hollow
        .indices
        .extend(inner.indices.iter().map(|i| i + first));
    is_unchanged_by(&alone(hollow), &RepairOptions::default());
}

#[test]
fn normals_of_turned_triangles_turn_along() {
    let mut cube = box_primitive([1.0; 3]);
    let center = DVec3::splat(0.5);
    cube.normals = cube
        .positions
        .iter()
        .map(|p| {
            (DVec3::from_array(p.map(f64::from)) - center)
                .normalize()
                .as_vec3()
                .to_array()
        })
        .collect();
    flip(&mut cube, [4]);
    // An exporter that computes normals from triangles gets this one's wrong.
    for &i in &cube.indices[12..15] {
        cube.normals[i as usize] = cube.normals[i as usize].map(|x| -x);
    }
    let wrong = cube.indices[12];
    let (out, report) = repaired(&alone(cube.clone()), &RepairOptions::default());
    assert_eq!(report.turned_triangles, 1);
    let p = &out.meshes[0].primitives[0];
    let t = p.indices.chunks_exact(3).nth(4).unwrap();
    for &i in t {
        let at = DVec3::from_array(p.positions[i as usize].map(f64::from)) - center;
        assert!(at.dot(DVec3::from_array(p.normals[i as usize].map(f64::from))) > 0.0);
    }
    // Vertices that other triangles use stay unchanged.
    let at = cube.positions[wrong as usize];
    let kept = (0..p.positions.len()).filter(|&i| p.positions[i] == at);
    assert!(
        kept.map(|i| p.normals[i])
            .any(|n| n == cube.normals[wrong as usize])
    );
}

#[test]
fn placed_meshes_that_change_get_one_of_their_own() {
    let mut cube = box_primitive([1.0; 3]);
    cube.indices.drain(18..21);
    let far = DMat4::from_translation(DVec3::X * 5.0);
    let scene = scene_of(cube, &[DMat4::IDENTITY, far]);
    let mut scene = Scene { ..scene };
    scene.objects[1].role = Role::Detail;
    let options = RepairOptions {
        hole: 2.0,
        ..RepairOptions::default()
    };
    let (out, report) = repaired(&scene, &options);
    assert_eq!((report.filled_holes, out.meshes.len()), (1, 2));
    assert_eq!(out.objects[1].transform, far);
    assert_eq!(object_triangles(&out, 1), object_triangles(&scene, 1));
    // Objects without defects still share their mesh.
    let whole = scene_of(box_primitive([1.0; 3]), &[DMat4::IDENTITY, far]);
    assert_eq!(repaired(&whole, &options).0.meshes.len(), 1);
}

#[test]
fn brushes_are_left_alone_and_options_are_checked() {
    let mut cube = box_primitive([1.0; 3]);
    cube.indices.truncate(30);
    let mut scene = alone(cube);
    let sides = [DVec3::X, DVec3::Y, DVec3::Z];
    let planes: Vec<Plane> = sides
        .iter()
        .flat_map(|&n| [Plane::through(n, n), Plane::through(DVec3::ZERO, -n)])
        .collect();
    scene.solids = vec![ConvexSolid::from_planes(&planes, 100.0, 1e-6).unwrap()];
    let (out, report) = repaired(&scene, &RepairOptions::default());
    assert!(report.is_of_brushes && report.to_string().contains("brushes"));
    assert_eq!(world(&out), world(&scene));
    for (weld, hole) in [
        (0.0, 0.1),
        (f64::NAN, 0.1),
        (1.0, 0.1),
        (1e-3, -1.0),
        (1e-3, 11.0),
    ] {
        let error = repair(&mut scene, &RepairOptions { weld, hole });
        assert!(matches!(error, Err(BadOption { .. })), "{weld} {hole}");
    }
}

#[test]
fn an_import_repairs_on_request_only() {
    let text = b"v 0 0 0\nv 2 0 0\nv 1 1 0\nv 1 0 0\nv 1 -1 0\nf 1 2 3\nf 4 1 5\nf 2 4 5\n";
    let plain = decode_obj(text, &ImportOptions::default()).unwrap();
    assert_eq!((plain.report.repair, world(&plain.scene).len()), (None, 3));
    let options = ImportOptions {
        repair: Some(RepairOptions::default()),
        ..ImportOptions::default()
    };
    let better = decode_obj(text, &options).unwrap();
    assert_eq!(better.report.repair.unwrap().t_junctions, 1);
    assert_eq!(world(&better.scene).len(), 4);
}

/// A fault of real models, with further disturbances.
fn messy() -> impl Strategy<Value = (Fault, Disturbance)> {
    let jitter = prop_oneof![Just(0.0), 0.0_f64..4e-4];
    let by = (jitter, prop_oneof![Just(0.0), Just(0.02)], any::<u64>());
    (0..Fault::ALL.len(), by).prop_map(|(fault, (jitter, drop, seed))| {
        let by = Disturbance {
            jitter,
            drop,
            seed,
            ..Disturbance::default()
        };
        (Fault::ALL[fault], by)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn repairing_twice_changes_nothing((fault, by) in messy(), hole in prop_oneof![Just(0.1), Just(2.0)]) {
        let scene = disturb(&fault.build().scene, &by);
        let options = RepairOptions { hole, ..RepairOptions::default() };
        let (out, report) = repaired(&scene, &options);
        prop_assert!(report.is_settled, "{}", report);
        let (again, report) = repaired(&out, &options);
        prop_assert_eq!(changes(&report), []);
        prop_assert_eq!(export_glb(&again), export_glb(&out));
    }

    #[test]
    fn dropped_triangles_of_a_closed_shell_come_back(
        n in 3_u32..7, gone in prop::collection::btree_set(0_usize..1000, 1..6), jitter in 0.0_f64..1e-4, seed in any::<u64>(),
    ) {
        let mut shell = fine_box(n);
        let all = shell.indices.len() / 3;
        let gone: std::collections::BTreeSet<usize> = gone.iter().map(|t| t % all).collect();
        shell.indices = (0..all).filter(|t| !gone.contains(t))
            .flat_map(|t| shell.indices[3 * t..3 * t + 3].to_vec()).collect();
        let by = Disturbance { jitter, seed, ..Disturbance::default() };
        let spoilt = disturb(&alone(shell), &by);
        let options = RepairOptions { hole: 9.0, ..RepairOptions::default() };
        let (out, report) = repaired(&spoilt, &options);
        prop_assert_eq!(n_open_edges(&world(&out)), 0);
        prop_assert!(report.filled_holes > 0);
        // Holes within a side restore its area; one around an edge may cut it short.
        prop_assert!((signed_volume(&world(&out)) - 24.0).abs() < 4.0);
        let left = cleaning_report(&out, None, &CleaningOptions::default()).unwrap();
        prop_assert_eq!((left.open_edges.n, left.non_manifold_edges.n, left.flipped_triangles.n), (0, 0, 0));
    }

    #[test]
    fn turned_triangles_of_closed_shells_face_outwards(
        n in 1_u32..5, turned in prop::collection::vec(prop::bool::weighted(0.3), 1..200),
    ) {
        let mut shell = fine_box(n);
        let all = shell.indices.len() / 3;
        let wrong: Vec<usize> = (0..all).filter(|t| turned[t % turned.len()]).collect();
        prop_assume!(2 * wrong.len() < all);
        // Triangles of one side are equal: less than half of each side means less than half of the area.
        let area = |t: &usize| {
            let [a, b, c] = [0, 1, 2].map(|k| DVec3::from_array(
                shell.positions[shell.indices[3 * t + k] as usize].map(f64::from)));
            (b - a).cross(c - a).length()
        };
        let of_wrong: f64 = wrong.iter().map(area).sum();
        prop_assume!(of_wrong < 0.499 * (0..all).map(|t| area(&t)).sum::<f64>());
        flip(&mut shell, wrong.iter().copied());
        let (out, report) = repaired(&alone(shell), &RepairOptions::default());
        prop_assert_eq!(report.turned_triangles, wrong.len() as u64);
        prop_assert_eq!(n_open_edges(&world(&out)), 0);
        prop_assert!((signed_volume(&world(&out)) - 24.0).abs() < 1e-5);
    }

    #[test]
    fn the_order_of_triangles_makes_no_difference_to_welding(seed in any::<u64>()) {
        let by = Disturbance { jitter: 1e-4, seed, ..Disturbance::default() };
        let spoilt = disturb(&alone(fine_box(4)), &by);
        let corners = |s: &Scene| -> Vec<[u64; 3]> {
            let bits = |t: Triangle| t.map(|p| p.to_array().map(f64::to_bits));
            let mut all: Vec<_> = world(s).into_iter().flat_map(bits).collect();
            all.sort_unstable();
            all
        };
        let (one, _) = repaired(&spoilt, &RepairOptions::default());
        let mut other = spoilt.clone();
        let indices = &mut other.meshes[0].primitives[0].indices;
        let mut triangles: Vec<[u32; 3]> = indices.as_chunks().0.to_vec();
        Rng::new(seed).shuffle(&mut triangles);
        *indices = triangles.into_iter().flatten().collect();
        let (other, _) = repaired(&other, &RepairOptions::default());
        prop_assert_eq!(corners(&one), corners(&other));
    }
}

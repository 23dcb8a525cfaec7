//! The cleaning report on surfaces with known defects. Covers S5.

use crate::import_common as common;

use common::{box_primitive, scene_of, v};
use enfilade_geom::scene::{Primitive, Role, Scene};
use enfilade_geom::{DMat4, DVec3};
use enfilade_import::{CleaningOptions, CleaningReport, ShellCounts, cleaning_report, decode_obj};
use proptest::prelude::*;

fn clean(scene: &Scene) -> CleaningReport {
    cleaning_report(scene, None, &CleaningOptions::default()).unwrap()
}

fn of(primitive: Primitive) -> CleaningReport {
    clean(&scene_of(primitive, &[DMat4::IDENTITY]))
}

fn counts(report: &CleaningReport) -> Vec<(&'static str, u64)> {
    let findings = report.findings();
    findings
        .into_iter()
        .filter(|(_, f)| f.n > 0)
        .map(|(name, f)| (name, f.n))
        .collect()
}

fn cube() -> Primitive {
    box_primitive([1.0; 3])
}

#[test]
fn a_closed_box_is_clean_also_with_a_vertex_a_face() {
    assert_eq!(counts(&of(cube())), []);
    // Each triangle has its own vertices: welding closes the box again.
    let shared = cube();
    let mut apart = Primitive::default();
    for &i in &shared.indices {
        apart.indices.push(apart.positions.len() as u32);
        apart.positions.push(shared.positions[i as usize]);
    }
    assert_eq!(counts(&of(apart)), [("duplicate vertices", 36 - 8)]);
}

#[test]
fn faults_are_told_apart() {
    let mut open = cube();
    open.indices.truncate(33);
    assert_eq!(
        counts(&of(open)),
        [("open edges", 3), ("holes in surfaces", 1)]
    );

    let mut flipped = cube();
    flipped.indices.swap(0, 1);
    assert_eq!(counts(&of(flipped)), [("flipped triangles", 1)]);

    let mut inverted = cube();
    inverted
        .indices
        .chunks_exact_mut(3)
        .for_each(|t| t.swap(0, 1));
    assert_eq!(counts(&of(inverted)), [("inverted shells", 1)]);

    let mut twice = cube();
    twice.indices.extend_from_within(0..3);
    assert_eq!(
        counts(&of(twice)),
        [("duplicate triangles", 1), ("non-manifold edges", 3)]
    );

    let mut point = cube();
    point.indices.extend([0, 0, 1]);
    assert_eq!(counts(&of(point)), [("degenerate triangles", 1)]);

    let fin = Primitive {
        positions: vec![
            [0., 0., 0.],
            [0., 1., 0.],
            [1., 0., 0.],
            [-1., 0., 0.],
            [0., 0., 1.],
        ],
        indices: vec![0, 1, 2, 1, 0, 3, 0, 1, 4],
        ..Primitive::default()
    };
    assert_eq!(
        counts(&of(fin)),
        [("open edges", 6), ("non-manifold edges", 1)]
    );

    let sliver = Primitive {
        positions: vec![[0., 0., 0.], [4., 0., 0.], [2., 5e-6, 0.]],
        indices: vec![0, 1, 2],
        ..Primitive::default()
    };
    assert_eq!(of(sliver).degenerate_triangles.n, 1);
}

#[test]
fn an_open_surface_has_no_inside() {
    // Turned inwards and without its top: not a shell, whatever its signed volume.
    let mut open = cube();
    open.indices.chunks_exact_mut(3).for_each(|t| t.swap(0, 1));
    open.indices.drain(18..24);
    assert_eq!(counts(&of(open)), [("open edges", 4)]);
}

#[test]
fn a_corner_in_the_middle_of_an_edge_is_a_t_junction() {
    let primitive = |y: f32| Primitive {
        positions: vec![
            [0., 0., 0.],
            [2., 0., 0.],
            [1., 1., 0.],
            [1., y, 0.],
            [0., -1., 0.],
            [2., -1., 0.],
        ],
        indices: vec![0, 1, 2, 0, 4, 3, 3, 5, 1],
        ..Primitive::default()
    };
    let report = of(primitive(0.0));
    assert_eq!(report.t_junctions.n, 1);
    assert_eq!(report.t_junctions.examples[0].position, DVec3::X);
    assert_eq!(report.t_junctions.examples[0].name, "thing");
    // 0.05 mm off still is one, 1 mm off is a gap.
    assert_eq!(of(primitive(-5e-5)).t_junctions.n, 1);
    assert_eq!(of(primitive(-1e-3)).t_junctions.n, 0);
}

#[test]
fn objects_close_each_other_but_do_not_make_edges_non_manifold() {
    // Two boxes that share a face: four edges with four triangles each, two of either box.
    let both = scene_of(
        cube(),
        &[DMat4::IDENTITY, DMat4::from_translation(DVec3::X)],
    );
    assert_eq!(counts(&clean(&both)), [("duplicate triangles", 2)]);
    let mut detail = both;
    detail.objects[1].role = Role::Detail;
    assert_eq!(counts(&clean(&detail)), []);
    let options = CleaningOptions {
        has_detail: true,
        ..CleaningOptions::default()
    };
    assert_eq!(
        cleaning_report(&detail, None, &options)
            .unwrap()
            .n_triangles,
        24
    );
}

#[test]
fn what_the_import_found_is_in_the_report_and_the_table() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0.1\nv 0 1 0\nv nan 0 0\nf 1 2 3 4\nf 1 2 5";
    let imported = decode_obj(text.as_bytes(), &Default::default()).unwrap();
    let options = CleaningOptions::default();
    let report = cleaning_report(&imported.scene, Some(&imported.report), &options).unwrap();
    assert_eq!(
        (report.non_planar_polygons.n, report.nonfinite_vertices.n),
        (1, 1)
    );
    let table = report.to_string();
    assert!(
        table.contains("non-planar polygons            1  0.500 0.500 0.025"),
        "{table}"
    );
    // Findings that do not occur have no row.
    assert!(
        !table.contains("duplicate") && !table.contains("rooms"),
        "{table}"
    );
    assert!(table.lines().all(|row| !row.ends_with(" 0")), "{table}");
}

#[test]
fn options_out_of_range_are_refused() {
    let scene = scene_of(cube(), &[DMat4::IDENTITY]);
    for (weld, t_junction) in [(0.0, 1.0), (f64::NAN, 1.0), (1e-3, 1e-4), (1e-5, 2.0)] {
        let options = CleaningOptions {
            weld,
            t_junction,
            has_detail: false,
            ..CleaningOptions::default()
        };
        assert!(
            cleaning_report(&scene, None, &options).is_err(),
            "{weld} {t_junction}"
        );
    }
}

/// A closed torus of `n` x `n` quads.
fn torus(n: u32) -> Primitive {
    let mut torus = Primitive::default();
    let angle = |i: u32| f64::from(i % n) / f64::from(n) * std::f64::consts::TAU;
    for i in 0..n {
        for j in 0..n {
            let r = 10.0 + 3.0 * angle(j).cos();
            let p = v(r * angle(i).cos(), 3.0 * angle(j).sin(), r * angle(i).sin());
            torus.positions.push(p.to_array().map(|c| c as f32));
            let at = |i: u32, j: u32| (i % n) * n + j % n;
            let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
            torus.indices.extend([a, b, c, a, c, d]);
        }
    }
    torus
}

#[test]
fn a_large_mesh_takes_linear_time() {
    let report = of(torus(300));
    assert_eq!((report.n_triangles, counts(&report)), (180_000, vec![]));
    // Every triangle alone and slightly moved: all edges open, nothing to weld.
    let whole = torus(300);
    let mut burst = Primitive::default();
    for (t, corners) in whole.indices.chunks_exact(3).enumerate() {
        for &i in corners {
            burst.indices.push(burst.positions.len() as u32);
            let p = whole.positions[i as usize];
            burst.positions.push([p[0], p[1] + t as f32 * 1e-3, p[2]]);
        }
    }
    let report = of(burst);
    assert_eq!(report.open_edges.n, 540_000);
    assert!(report.is_complete);
}

proptest! {
    /// The number of turned triangles of a closed surface is exact.
    #[test]
    fn flipped_triangles_are_counted(turned in prop::collection::btree_set(0usize..128, 0..64)) {
        let mut mesh = torus(8);
        for &t in &turned {
            mesh.indices.swap(3 * t, 3 * t + 1);
        }
        let report = of(mesh);
        prop_assert_eq!(report.flipped_triangles.n, turned.len().min(128 - turned.len()) as u64);
        prop_assert_eq!(report.open_edges.n + report.non_manifold_edges.n, 0);
        // At half and half, either side may count as turned.
        prop_assert!(turned.len() == 64 || report.inverted_shells.n == 0);
    }

    /// Removing triangles opens exactly the edges that an independent count finds.
    #[test]
    fn open_edges_are_counted(removed in prop::collection::btree_set(0usize..128, 0..100)) {
        let mut mesh = torus(8);
        let kept: Vec<u32> = mesh.indices.chunks_exact(3).enumerate()
            .filter(|(t, _)| !removed.contains(t)).flat_map(|(_, c)| c.to_vec()).collect();
        mesh.indices = kept;
        let mut uses = std::collections::HashMap::new();
        for t in mesh.indices.chunks_exact(3) {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                *uses.entry((a.min(b), a.max(b))).or_insert(0) += 1;
            }
        }
        let expected = uses.values().filter(|&&n| n == 1).count() as u64;
        prop_assert_eq!(of(mesh).open_edges.n, expected);
    }

    /// Vertices nearer than the welding distance are one, wherever they lie; farther ones are two.
    #[test]
    fn welding_knows_no_borders(
        at in prop::array::uniform3(-2e-4f32..2e-4),
        off in prop::array::uniform3(-1.0f64..1.0),
    ) {
        let off = DVec3::from_array(off).try_normalize().unwrap_or(DVec3::X);
        // Two triangles with a common edge, the second one moved by `step`.
        let n_open = |step: f64| {
            let p = |q: DVec3| q.to_array().map(|c| c as f32);
            let a = v(at[0].into(), at[1].into(), at[2].into());
            let b = a + DVec3::X * 0.01;
            let move_by = off * step;
            of(Primitive {
                positions: vec![p(a), p(b), p(a + DVec3::Y), p(b + move_by), p(a + move_by),
                    p(a - DVec3::Y)],
                indices: vec![0, 1, 2, 3, 4, 5],
                ..Primitive::default()
            }).open_edges.n
        };
        prop_assert_eq!(n_open(0.9e-5), 4);
        prop_assert_eq!(n_open(1.1e-5), 6);
    }
}

#[test]
fn missing_triangles_are_holes_and_rims_of_sheets_are_none() {
    assert_eq!(of(cube()).holes.n, 0);
    let mut open = cube();
    open.indices.drain(0..3);
    let report = of(open.clone());
    assert!(report.is_holes_complete);
    assert_eq!((report.holes.n, report.open_edges.n), (1, 3));
    let corners = cube().indices[0..3].to_vec();
    let missing = corners
        .iter()
        .map(|&i| DVec3::from(open.positions[i as usize].map(f64::from)));
    let middle = missing.sum::<DVec3>() / 3.0;
    assert!(report.holes.examples[0].position.distance(middle) < 1e-6);
    // A box without a face may be intended, and a single face has a rim but no hole.
    let mut faceless = cube();
    faceless.indices.drain(0..6);
    assert_eq!(of(faceless).holes.n, 0);
    let mut sheet = cube();
    sheet.indices.truncate(6);
    assert_eq!(of(sheet).holes.n, 0);
}

#[test]
fn shells_are_solids_rooms_or_open() {
    let shells = |primitive: Primitive| {
        let ShellCounts {
            solids,
            rooms,
            open,
            ..
        } = of(primitive).shells;
        [solids, rooms, open]
    };
    assert_eq!(shells(cube()), [1, 0, 0]);
    let mut room = cube();
    room.indices.chunks_exact_mut(3).for_each(|t| t.swap(0, 1));
    assert_eq!(shells(room), [0, 1, 0]);
    let mut open = cube();
    open.indices.truncate(30);
    assert_eq!(shells(open), [0, 0, 1]);
    // One triangle is turned: the majority decides.
    let mut flipped = cube();
    flipped.indices.swap(0, 1);
    assert_eq!(shells(flipped), [1, 0, 0]);
}

#[test]
fn triangles_that_run_through_each_other_are_counted_within_an_object() {
    // Two boxes that run through each other: crossing within one object, allowed between two objects.
    let mut both = cube();
    let other = cube();
    let moved = other.positions.iter();
    both.positions
        .extend(moved.map(|p| [p[0] + 0.2, p[1] + 0.3, p[2] + 0.45]));
    both.indices.extend(other.indices.iter().map(|i| i + 8));
    let report = of(both.clone());
    assert!(report.crossing_triangles.n > 0 && report.is_crossing_complete);
    let beside = DMat4::from_translation(v(0.2, 0.3, 0.45));
    let apart = clean(&scene_of(cube(), &[DMat4::IDENTITY, beside]));
    assert_eq!(apart.crossing_triangles.n, 0);
    let options = CleaningOptions {
        crossing_pairs: 1,
        ..CleaningOptions::default()
    };
    let scene = scene_of(both, &[DMat4::IDENTITY]);
    let stopped = cleaning_report(&scene, None, &options).unwrap();
    assert!(!stopped.is_crossing_complete);
    assert!(
        stopped
            .to_string()
            .contains("crossing triangles: lower bound")
    );
}

#[test]
fn concave_and_crossing_polygons_are_counted_from_the_file() {
    let text = b"v 0 0 0\nv 1 .5 0\nv 2 0 0\nv 1 3 0\nv 0 0 1\nv 2 2 1\nv 2 0 1\nv 0 3 1\nf 1 2 3 4\nf 5 6 7 8\n";
    let imported = decode_obj(text, &Default::default()).unwrap();
    let options = CleaningOptions::default();
    let report = cleaning_report(&imported.scene, Some(&imported.report), &options).unwrap();
    assert_eq!(
        (report.concave_polygons.n, report.crossing_polygons.n),
        (1, 1)
    );
}

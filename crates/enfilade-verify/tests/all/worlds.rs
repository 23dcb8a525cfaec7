//! Worlds that keep their promises pass; each promise, broken once, is found broken.

use std::sync::Arc;

use crate::common;

use common::{A, B, DOOR, DOOR_X, OUTDOORS, WINDOW, house, house_with_locator_plane, moved};
use enfilade_cpg::{CellSet, Pvs, World};
use enfilade_geom::{DMat4, DVec3, Triangle};
use enfilade_verify::{FailureKind, VerifyOptions, VerifyReport, verify_world};

fn verify(world: &World) -> VerifyReport {
    verify_world(
        world,
        None,
        &VerifyOptions {
            rays: 40_000,
            ..VerifyOptions::default()
        },
    )
}

fn triangles(world: &World) -> Vec<Triangle> {
    let own = enfilade_verify::structural_triangles(world);
    own.into_iter().map(|t| t.0).collect()
}

fn kinds(report: &VerifyReport) -> Vec<FailureKind> {
    let mut kinds: Vec<FailureKind> = report.failures.iter().map(|f| f.kind).collect();
    kinds.sort();
    kinds.dedup();
    kinds
}

#[test]
fn a_house_by_hand_keeps_its_promises() {
    let report = verify(&house());
    assert!(report.holds(), "{report}");
    let s = report.sealed;
    assert_eq!(s.drawn, 40_000);
    let sum = s.judged + s.blocked + s.grazing + s.solid + s.cell_to_solid + s.on_surface;
    assert_eq!(sum, s.drawn);
    let c = report.complete;
    assert_eq!(
        c.judged + c.escaped + c.grazing + c.on_surface + c.unresolved,
        c.drawn
    );
    // Enough of both to be significant, and nothing skipped without need.
    assert!(
        s.judged > 10_000 && s.crossings > 5_000 && c.judged > 20_000,
        "{report}"
    );
    assert!(
        s.grazing < 400 && c.grazing < 400 && c.unresolved == 0,
        "{report}"
    );
    assert_eq!((s.cell_to_solid, report.unsampled_cells.len()), (0, 0));
}

#[test]
fn turned_and_far_away_rounding_alone_breaks_nothing() {
    for (angle, at) in [(0.3, DVec3::ZERO), (1.1, DVec3::new(300.0, 20.0, -170.0))] {
        let turn = DMat4::from_translation(at)
            * DMat4::from_axis_angle(DVec3::new(0.2, 1.0, 0.1).normalize(), angle);
        let report = verify(&moved(house(), &turn));
        assert!(report.sealed.judged > 10_000 && report.holds(), "{report}");
    }
}

#[test]
fn a_missing_portal_is_seen_where_it_should_be() {
    let mut world = house();
    world.graph.portals.remove(DOOR);
    world.graph.cells[0].portals = vec![enfilade_cpg::PortalId(0)];
    world.graph.cells[1].portals.clear();
    world.graph.cells[2].portals = vec![enfilade_cpg::PortalId(0)];
    let report = verify(&world);
    assert!(report.problems.is_empty(), "{report}");
    assert_eq!(kinds(&report), [FailureKind::MissedPortal], "{report}");
    for failure in &report.failures {
        assert!((failure.at[0] - DOOR_X).abs() < 1e-6, "{report}");
        assert!(failure.clearance > 0.0);
    }
    assert!(report.unsealed > 100 && report.incomplete == 0, "{report}");
    assert!(
        report.complete.unresolved > 0,
        "rays through the doorway have no cell"
    );
}

#[test]
fn a_shifted_portal_is_seen() {
    for shift in [[0.0, 0.0, 0.02], [0.05, 0.0, 0.0]] {
        let mut world = house();
        let door = &mut world.graph.portals[DOOR];
        for p in door
            .outline
            .iter_mut()
            .chain(door.pieces.iter_mut().flatten())
        {
            for k in 0..3 {
                p[k] += shift[k];
            }
        }
        let report = verify(&world);
        assert!(report.unsealed > 10, "{report}");
        assert!(
            kinds(&report).contains(&FailureKind::MissedPortal),
            "{report}"
        );
    }
}

#[test]
fn a_portal_that_faces_the_wrong_way_is_seen() {
    let mut world = house();
    world.graph.portals[DOOR].cells = [B, A];
    assert_eq!(kinds(&verify(&world)), [FailureKind::WrongWay]);
    // With all of it reversed, it would be right again, but its vertices then run the other way.
    let door = &mut world.graph.portals[DOOR];
    door.normal = door.normal.map(|x| -x);
    let report = verify(&world);
    assert!(
        report.failures.is_empty() && !report.problems.is_empty(),
        "{report}"
    );
}

#[test]
fn a_sliver_thinner_than_rounding_may_have_its_portals_in_any_order() {
    // A wedge of B in A right at the door, a micrometer thin: in, out, and in again. Rounding has put the way out
    // before the first way in.
    let mut world = house();
    let door = world.graph.portals[DOOR].clone();
    let shifted = |by: f32| {
        let mut p = door.clone();
        for v in p.outline.iter_mut().chain(p.pieces.iter_mut().flatten()) {
            v[0] += by;
        }
        p
    };
    let mut back = shifted(-1e-6);
    back.cells.reverse();
    for portal in [back, shifted(1e-6)] {
        let id = enfilade_cpg::PortalId(world.graph.portals.len() as u32);
        for c in [A, B] {
            world.graph[c].portals.push(id);
        }
        world.graph.portals.push(portal);
    }
    let report = verify(&world);
    assert!(report.failures.is_empty(), "{report}");
}

#[test]
fn a_portal_between_other_cells_is_seen() {
    let mut world = house();
    world.graph.portals[DOOR].cells = [A, OUTDOORS];
    world.graph.cells[1].portals.clear();
    world.graph.cells[2].portals = [0, 1].map(enfilade_cpg::PortalId).to_vec();
    let found = kinds(&verify(&world));
    assert!(found.contains(&FailureKind::WrongSide), "{found:?}");
    assert!(found.contains(&FailureKind::EndMismatch), "{found:?}");
}

#[test]
fn a_locator_plane_off_its_portal_is_seen() {
    let report = verify(&house_with_locator_plane(DOOR_X + 0.03));
    assert!(report.unsealed > 10, "{report}");
    let off = report
        .failures
        .iter()
        .find(|f| f.kind == FailureKind::MissedPortal);
    assert!(
        off.is_some_and(|f| (f.at[0] - DOOR_X - 0.03).abs() < 1e-6),
        "{report}"
    );
}

#[test]
fn a_locator_that_says_solid_in_the_air_is_seen() {
    let mut world = house();
    // The first half of the doorway becomes solid.
    let leaf = enfilade_cpg::Locator::leaf(None);
    let nodes = Arc::make_mut(&mut world.graph.locator).nodes.iter_mut();
    for node in nodes.filter(|n| n.plane == 11) {
        node.children[0] = leaf;
    }
    assert!(kinds(&verify(&world)).contains(&FailureKind::InSolid));
}

#[test]
fn a_hole_in_a_wall_without_a_portal_is_seen() {
    let mut world = house();
    world.batches[2].primitive.indices.truncate(3);
    let report = verify(&world);
    assert!(
        report
            .failures
            .iter()
            .any(|f| { f.kind == FailureKind::MissedPortal && (f.at[0] - 8.25).abs() < 1e-6 }),
        "{report}"
    );
}

#[test]
fn a_batch_that_lacks_a_cell_is_seen() {
    let mut world = house();
    world.batches[5].cells = vec![A];
    let report = verify(&world);
    assert_eq!(kinds(&report), [FailureKind::Unlisted], "{report}");
    assert!(report.incomplete > 0 && report.unsealed == 0);
    assert!(
        report
            .failures
            .iter()
            .all(|f| f.expected == Some(B.0) && f.triangle.is_some())
    );
}

#[test]
fn a_cell_that_the_worlds_own_set_hides_is_seen() {
    let mut world = house();
    let n = world.graph.cells.len();
    let mut rows = vec![CellSet::all(n); n];
    world.pvs = Some(Pvs::of_rows(&rows));
    assert!(verify(&world).holds());
    let [a, b] = world.graph.portals[0].cells;
    rows[a.idx()].remove(b);
    world.pvs = Some(Pvs::of_rows(&rows));
    let report = verify(&world);
    assert_eq!(kinds(&report), [FailureKind::Hidden], "{report}");
    assert!(report.to_string().contains("conservative"), "{report}");
}

#[test]
fn a_triangle_of_the_source_that_was_lost_is_seen() {
    let world = house();
    let source = triangles(&world);
    let options = VerifyOptions {
        rays: 40_000,
        ..VerifyOptions::default()
    };
    let report = verify_world(&world, Some(&source), &options);
    assert!(report.has_source && report.holds(), "{report}");
    let mut lossy = world;
    lossy.batches[3].primitive.indices.drain(..3);
    let report = verify_world(&lossy, Some(&source), &options);
    assert_eq!(kinds(&report), [FailureKind::MissingTriangle], "{report}");
}

#[test]
fn the_source_blocks_even_where_the_batches_are_cut_finer() {
    let world = house();
    let source = triangles(&world);
    let mut cut = world;
    for batch in &mut cut.batches {
        let p = &mut batch.primitive;
        let old = std::mem::take(&mut p.indices);
        for t in old.chunks_exact(3) {
            // A new vertex off the middle of the longest edge, rounded: both halves share it.
            let mid = |k: usize| {
                (
                    0.37 * p.positions[t[0] as usize][k] + 0.63 * p.positions[t[2] as usize][k],
                    k,
                )
            };
            let m = [0, 1, 2].map(|k| mid(k).0);
            p.positions.push(m);
            let m = p.positions.len() as u32 - 1;
            p.indices.extend([t[0], t[1], m, t[1], t[2], m]);
        }
    }
    for c in &mut cut.graph.cells {
        c.n_triangles *= 2;
    }
    let turn = DMat4::from_axis_angle(DVec3::new(0.2, 1.0, 0.1).normalize(), 0.7);
    let source = triangles(&moved(with_triangles(&cut, &source), &turn));
    let options = VerifyOptions {
        rays: 40_000,
        ..VerifyOptions::default()
    };
    let report = verify_world(&moved(cut, &turn), Some(&source), &options);
    assert!(
        report.holds() && report.complete.judged > 20_000,
        "{report}"
    );
}

/// Returns `world` with all its triangles replaced.
fn with_triangles(world: &World, triangles: &[[DVec3; 3]]) -> World {
    let mut out = world.clone();
    out.batches.truncate(1);
    let p = &mut out.batches[0].primitive;
    p.positions = triangles
        .iter()
        .flatten()
        .map(|p| p.as_vec3().to_array())
        .collect();
    p.indices = (0..p.positions.len() as u32).collect();
    out
}

#[test]
fn broken_outlines_are_named() {
    let broken = |change: &dyn Fn(&mut enfilade_cpg::Portal)| {
        let mut world = house();
        change(&mut world.graph.portals[WINDOW]);
        let report = verify(&world);
        assert!(!report.holds());
        report.problems.join("\n")
    };
    assert!(broken(&|p| p.outline[1][0] += 0.01).contains("leaves the portal's plane"));
    assert!(broken(&|p| p.outline[2] = [0.0, 1.2, 1.7]).contains("not convex"));
    assert!(broken(&|p| p.pieces[0][2][1] += 0.1).contains("reaches out of the outline"));
    assert!(broken(&|p| p.area = 0.9).contains("area is 0.9"));
    assert!(broken(&|p| p.pieces[0].reverse()).contains("clockwise"));
    assert!(broken(&|p| p.outline.truncate(2)).contains("2 vertices"));
    assert!(broken(&|p| p.cells = [A, enfilade_cpg::CellId(9)]).contains("no ray was shot"));
}

#[test]
fn the_report_is_the_same_on_any_number_of_threads() {
    let mut world = house();
    world.graph.portals[DOOR].cells = [A, OUTDOORS];
    let reports = [1, 3].map(|n| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(n)
            .build()
            .unwrap();
        pool.install(|| verify(&world))
    });
    assert!(!reports[0].failures.is_empty());
    assert_eq!(reports[0], reports[1]);
    let other = VerifyOptions {
        rays: 40_000,
        seed: 2,
        ..VerifyOptions::default()
    };
    assert_ne!(verify_world(&world, None, &other).sealed, reports[0].sealed);
}

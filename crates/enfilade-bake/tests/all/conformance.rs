//! One suite over all builders: the world keeps the same guarantees whichever method finds the cells.
//!
//! The oracles (free lines by brute force, volumes by counting points) share no code with a builder.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use enfilade_bake::{BakeConfig, BakeContext, BakeError, BakeOutput, Method, Silent, bake};
use enfilade_cpg::wire::{decode_glb, encode_glb};
use enfilade_cpg::{CellPortalGraph, World};
use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{Aabb, DVec3};
use enfilade_testkit::mixed::{l_corridor, room_within_room, rooms_with_closet};
use enfilade_testkit::oracle::{segment_is_blocked, structural_triangles};
use enfilade_testkit::{
    Generated, Rng, TowerParams, Variant, furnished_house, gjorup_cavern, gjorup_rooms,
    office_tower,
};
use enfilade_verify::{VerifyOptions, verify_world};

type Result = std::result::Result<BakeOutput, BakeError>;

fn watershed(scene: &Scene, context: &BakeContext<'_>) -> Result {
    bake(scene, &BakeConfig::of(Method::Watershed), context)
}

fn bsp(scene: &Scene, context: &BakeContext<'_>) -> Result {
    bake(scene, &BakeConfig::of(Method::Bsp), context)
}

fn delaunay(scene: &Scene, context: &BakeContext<'_>) -> Result {
    bake(scene, &BakeConfig::of(Method::Delaunay), context)
}

type Builder = fn(&Scene, &BakeContext<'_>) -> Result;

fn built(builder: Builder, g: &Generated) -> World {
    let out = builder(&g.scene, &BakeContext::new(&Silent, None));
    out.unwrap_or_else(|e| panic!("{}: {e}", g.truth.scene))
        .world
}

fn keeps_promises(builder: Builder, g: &Generated) {
    let world = built(builder, g);
    let what = &g.truth.scene;
    world
        .graph
        .validate()
        .unwrap_or_else(|e| panic!("{what}: {e:?}"));
    let options = VerifyOptions {
        rays: 20_000,
        ..VerifyOptions::default()
    };
    let report = verify_world(&world, None, &options);
    assert!(report.holds(), "{what}: {report}");
    let bytes = encode_glb(&world).unwrap();
    let back = decode_glb(&bytes).unwrap();
    assert_eq!(encode_glb(&back).unwrap(), bytes, "{what}");
}

/// Only space that fits a sphere of this radius is tested. [Units: wu]
const WIDE: f64 = 0.02;

/// Checks that steps from the middle of each opening to both sides end in the two cells of its portal. Returns the
/// number of openings tested.
fn portals_lie_between_their_cells(graph: &CellPortalGraph, what: &str) -> usize {
    let mut n = 0;
    for (i, portal) in graph.portals.iter().enumerate() {
        let normal = DVec3::from(portal.normal.map(f64::from));
        for piece in &portal.pieces {
            let corners: Vec<DVec3> = piece
                .iter()
                .map(|p| DVec3::from(p.map(f64::from)))
                .collect();
            let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
            let to_edge = (0..corners.len())
                .map(|k| {
                    let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
                    (b - a)
                        .normalize_or_zero()
                        .cross(middle - a)
                        .dot(normal)
                        .abs()
                })
                .fold(f64::INFINITY, f64::min);
            if to_edge < WIDE {
                continue;
            }
            let sides = [-1.0, 1.0].map(|s| graph.locator.locate(middle + normal * s * 1e-3));
            assert_eq!(
                sides,
                portal.cells.map(Some),
                "{what}: portal {i} at {middle}"
            );
            n += 1;
        }
    }
    n
}

/// Checks the recorded volume of each cell against points counted in its box.
fn volumes_are_what_points_say(graph: &CellPortalGraph, what: &str) {
    const N: usize = 4_000;
    for (i, cell) in graph.cells.iter().enumerate().filter(|(_, c)| !c.outdoor) {
        let [low, high] = cell.aabb.map(|p| DVec3::from(p.map(f64::from)));
        let mut rng = Rng::new(i as u64);
        let hits = (0..N)
            .filter(|_| {
                let p = low + (high - low) * DVec3::new(rng.unit(), rng.unit(), rng.unit());
                graph.locator.locate(p).is_some_and(|c| c.0 as usize == i)
            })
            .count();
        let share = hits as f64 / N as f64;
        // Five standard deviations of a count, and one point.
        let slack = 5.0 * (share * (1.0 - share) / N as f64).sqrt() + 1.0 / N as f64;
        let own = f64::from(cell.volume) / (high - low).element_product();
        assert!(
            (own - share).abs() <= slack,
            "{what}: cell {i} says {own:.4} of its box, points say {share:.4} ± {slack:.4}"
        );
    }
}

/// Checks that cells contain all free space: if one end of a free line is in a cell, so is the other.
fn free_lines_end_in_cells(g: &Generated, graph: &CellPortalGraph) {
    let triangles = structural_triangles(&g.scene);
    let bounds = Aabb::of_points(&triangles.concat());
    let mut rng = Rng::new(7);
    let mut point =
        || bounds.min + (bounds.max - bounds.min) * DVec3::new(rng.unit(), rng.unit(), rng.unit());
    let starts = g.truth.rooms.iter().flat_map(|r| &r.sample_points);
    for &from in starts.cycle().take(400) {
        assert!(
            graph.locator.locate(from).is_some(),
            "{}: no cell holds {from}, a point of a room",
            g.truth.scene
        );
        let to = point();
        if !segment_is_blocked(&triangles, from, to) {
            assert!(
                graph.locator.locate(to).is_some(),
                "{}: no cell holds {to}, seen from {from}",
                g.truth.scene
            );
        }
    }
}

fn bytes_on(threads: usize, builder: Builder, g: &Generated) -> Vec<u8> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    let pool = pool.build().unwrap();
    pool.install(|| encode_glb(&built(builder, g)).unwrap())
}

macro_rules! builder_tests {
    ($($builder:ident: $rooms:expr),*) => { $(mod $builder {
        use super::*;

        const BUILDER: Builder = super::$builder;
        /// Rooms of a tower that takes this builder seconds.
        const ROOMS: usize = $rooms;

        // Covers V7.
        #[test]
        fn mixed_scenes_keep_the_promises() {
            for g in enfilade_testkit::mixed::all() {
                keeps_promises(BUILDER, &g);
            }
        }

        #[test]
        fn a_furnished_house_and_a_turned_cavern_keep_the_promises() {
            keeps_promises(BUILDER, &furnished_house());
            keeps_promises(BUILDER, &gjorup_cavern([7.0, 8.0, 9.0]));
        }

        #[test]
        fn a_tower_with_cracks_and_double_walls_keeps_the_promises() {
            for (cracks, double_walls) in [(false, false), (true, false), (false, true)] {
                let plain = TowerParams::with_rooms(ROOMS, 7);
                let params = TowerParams { cracks, double_walls, ..plain };
                keeps_promises(BUILDER, &office_tower(&params));
            }
        }

        // Covers V6.
        #[test]
        fn cells_hold_free_space_and_portals_lie_between_them() {
            let turned = gjorup_rooms(Variant::Distorted, [0.0, 7.0, 0.0]);
            let mut n = 0;
            for g in [l_corridor(), rooms_with_closet(), room_within_room(), turned] {
                let graph = built(BUILDER, &g).graph;
                n += portals_lie_between_their_cells(&graph, &g.truth.scene);
                volumes_are_what_points_say(&graph, &g.truth.scene);
                free_lines_end_in_cells(&g, &graph);
            }
            assert!(n > 10, "{n} openings were wide enough to try");
        }

        #[test]
        fn equal_bytes_on_any_number_of_threads() {
            let g = office_tower(&TowerParams::with_rooms(ROOMS, 5));
            let one = bytes_on(1, BUILDER, &g);
            assert!(one == bytes_on(2, BUILDER, &g), "2 threads");
            assert!(one == bytes_on(16, BUILDER, &g), "16 threads");
        }

        #[test]
        fn no_structure_is_an_error_and_a_wish_to_stop_is_heard() {
            let mut g = rooms_with_closet();
            let stop = Arc::new(AtomicBool::new(true));
            let stopped = BUILDER(&g.scene, &BakeContext::new(&Silent, Some(stop)));
            assert!(matches!(stopped, Err(BakeError::Cancelled)));
            for o in &mut g.scene.objects {
                o.role = Role::Detail;
            }
            let empty = BUILDER(&g.scene, &BakeContext::new(&Silent, None));
            assert!(matches!(empty, Err(BakeError::NothingStructural { .. })));
        }
    })* };
}

builder_tests!(watershed: 16, bsp: 16, delaunay: 4);

//! Guided partitions of scenes without a wall: vessels and caves. Covers B3.

use enfilade_bake::{BakeConfig, BakeContext, Method, Silent, bake};
use enfilade_cpg::World;
use enfilade_geom::DVec3;
use enfilade_testkit::{Generated, Tube, Variant, gjorup_rooms, tubes};
use enfilade_verify::{VerifyOptions, verify_world};

/// A trunk of 12 m with two side tubes.
fn vessel() -> Generated {
    let tube = |a: [f64; 3], b: [f64; 3], radius: f64| Tube {
        ends: [a, b].map(DVec3::from_array),
        radius,
    };
    let all = [
        tube([-6.0, 0.0, 0.0], [6.0, 0.0, 0.0], 1.0),
        tube([-3.0, 0.0, 0.0], [-3.0, 4.4, 0.0], 0.6),
        tube([2.0, 0.0, 0.0], [4.5, 0.0, 4.0], 0.5),
    ];
    tubes(&all, 0.25)
}

fn baked(g: &Generated, config: &BakeConfig) -> World {
    let context = BakeContext::new(&Silent, None);
    let world = bake(&g.scene, config, &context).unwrap().world;
    world.validate().unwrap();
    let options = VerifyOptions {
        rays: 20_000,
        ..VerifyOptions::default()
    };
    let report = verify_world(&world, None, &options);
    assert!(report.holds(), "{report}");
    world
}

fn n_indoors(world: &World) -> usize {
    world.graph.indoor_cells().count()
}

#[test]
fn a_grid_makes_cells_in_a_vessel_whichever_way_it_faces() {
    let mut g = vessel();
    for is_turned in [false, true] {
        let mut config = BakeConfig::of(Method::Bsp);
        let unguided = n_indoors(&baked(&g, &config));
        // Across the trunk at every multiple, and across the side tubes.
        for (grid, least) in [(4.0, 4), (2.5, 6)] {
            config.bsp.guide.grid = Some(grid);
            let world = baked(&g, &config);
            let n = n_indoors(&world);
            // Without a grid at most the side tube that is level shows, as a limb.
            assert!(
                unguided <= 2 && n >= least,
                "{grid} {is_turned}: {n}, {unguided} without"
            );
            let cell = |x: f64| world.graph.locator.locate(DVec3::new(x, 0.1, 0.1));
            assert_ne!(cell(-0.5), cell(0.5), "{grid}");
            assert_ne!(cell(5.5), cell(-5.5), "{grid}");
        }
        for t in g.scene.meshes[0].primitives[0].indices.chunks_exact_mut(3) {
            t.swap(1, 2);
        }
    }
}

#[test]
fn a_grid_leaves_the_rooms_of_a_building_as_they_are() {
    let g = gjorup_rooms(Variant::Optimised, [0.0; 3]);
    let mut config = BakeConfig::of(Method::Bsp);
    let rooms = n_indoors(&baked(&g, &config));
    config.bsp.guide.grid = Some(1.7);
    assert_eq!(n_indoors(&baked(&g, &config)), rooms);
}

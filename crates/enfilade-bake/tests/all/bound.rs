//! An upper bound on the cost of cells: met by cuts, with one cost model, or reported as missed. Covers B7 and P3.

use enfilade_bake::bound::{Reason, keep_bounds};
use enfilade_bake::simplify::{CostModel, SimplifySettings, costs};
use enfilade_bake::{BakeConfig, BakeContext, Method, Silent, bake};
use enfilade_cpg::World;
use enfilade_testkit::{GridParams, Rng, furnished_house, room_grid};
use enfilade_verify::{VerifyOptions, verify_world};

fn holds(world: &World) {
    world.validate().unwrap();
    let options = VerifyOptions {
        rays: 20_000,
        ..VerifyOptions::default()
    };
    let report = verify_world(world, None, &options);
    assert!(report.holds(), "{report}");
}

fn most(world: &World, cost: &CostModel) -> f64 {
    costs(world, cost).into_iter().fold(0.0, f64::max)
}

/// A random cost model: triangles or area, with or without objects, materials cheap or expensive.
fn model(rng: &mut Rng, world: &World) -> CostModel {
    let mut cost = CostModel {
        area: rng.unit(),
        triangle: rng.unit(),
        detail: [0.0, 1.0, 3.0][rng.below(3)],
        ..CostModel::default()
    };
    for m in &world.materials {
        cost.materials.insert(m.name.clone(), 2.0 * rng.unit());
    }
    cost
}

#[test]
fn cells_above_the_bound_are_cut_by_the_model_that_merges_them_or_told_of() {
    let mut rng = Rng::new(17);
    let mut n_cuts = 0;
    for _ in 0..12 {
        let world = room_grid(&GridParams {
            size: [2 + rng.below(3), 1, 2 + rng.below(3)],
            merges: 0.5,
            furniture: 3,
            outdoors: rng.chance(0.5),
            turn: rng.unit(),
            ..GridParams::offices(4, rng.below(1 << 20) as u64)
        });
        let cost = model(&mut rng, &world);
        let bound = most(&world, &cost) * (0.3 + 0.6 * rng.unit());
        let settings = SimplifySettings {
            min_cost: bound * rng.unit() * 0.5,
            max_cost: Some(bound),
            cost: cost.clone(),
            ..SimplifySettings::default()
        };
        let bounded = keep_bounds(&world, &settings);
        n_cuts += bounded.n_cuts;
        for (cell, cost) in costs(&bounded.world, &cost).into_iter().enumerate() {
            let told = bounded.over.iter().find(|o| o.cell.0 as usize == cell);
            assert_eq!(cost > bound, told.is_some(), "{cost} of {bound}: {told:?}");
            assert!(told.is_none_or(|o| (o.cost - cost).abs() < 1e-9));
        }
        assert_eq!(bounded.note().is_some(), !bounded.over.is_empty());
        holds(&bounded.world);
    }
    assert!(n_cuts > 12, "{n_cuts}");
}

#[test]
fn what_costs_nothing_is_not_cut() {
    let world = room_grid(&GridParams {
        furniture: 6,
        outdoors: false,
        ..GridParams::offices(4, 5)
    });
    let walls = CostModel {
        detail: 0.0,
        ..CostModel::default()
    };
    let [with, without] = [CostModel::default(), walls].map(|cost| {
        let bound = most(
            &world,
            &CostModel {
                detail: 0.0,
                ..cost.clone()
            },
        );
        let settings = SimplifySettings {
            max_cost: Some(bound),
            cost,
            ..SimplifySettings::default()
        };
        keep_bounds(&world, &settings).n_cuts
    });
    assert!(with > 0);
    assert_eq!(without, 0);
}

#[test]
fn the_watersheds_outdoors_is_cut_where_asked_and_told_of_where_not() {
    let g = furnished_house();
    let context = BakeContext::new(&Silent, None);
    let world = bake(&g.scene, &BakeConfig::default(), &context)
        .unwrap()
        .world;
    let cost = CostModel::default();
    let outdoors = world.graph.cells.iter().position(|c| c.outdoor).unwrap();
    let bound = 0.6 * costs(&world, &cost)[outdoors];
    let asked = |outdoors| SimplifySettings {
        max_cost: Some(bound),
        outdoors,
        ..SimplifySettings::default()
    };
    let left = keep_bounds(&world, &asked(false));
    assert!(left.over.iter().any(|o| o.reason == Reason::Outdoors));
    assert!(left.note().unwrap().contains("split_outdoors"));
    let cut = keep_bounds(&world, &asked(true));
    assert!(
        cut.over.iter().all(|o| o.reason == Reason::Shared),
        "{:?}",
        cut.over
    );
    let outdoors: Vec<_> = cut.world.graph.cells.iter().filter(|c| c.outdoor).collect();
    assert_eq!(outdoors.len(), 1);
    assert_eq!(outdoors[0].n_triangles, 0, "nothing is beyond the scene");
    assert!(most(&cut.world, &cost) <= bound, "{:?}", cut.over);
    holds(&cut.world);
}

#[test]
fn a_bound_below_what_one_object_costs_is_told_and_does_not_cut_forever() {
    let world = room_grid(&GridParams {
        size: [2, 1, 1],
        outdoors: false,
        ..GridParams::offices(2, 1)
    });
    let settings = SimplifySettings {
        max_cost: Some(0.5),
        ..SimplifySettings::default()
    };
    let bounded = keep_bounds(&world, &settings);
    assert!(!bounded.over.is_empty());
    assert!(bounded.note().unwrap().contains("cost more than 0.5"));
    holds(&bounded.world);
}

#[test]
fn a_cost_of_a_material_that_there_is_not_is_an_error_with_those_that_there_are() {
    let mut scene = furnished_house().scene;
    let name = scene.materials[0].name.clone();
    let mut config = BakeConfig::of(Method::Bsp);
    config.costs.cost.materials.insert("waterr".to_owned(), 3.0);
    let context = BakeContext::new(&Silent, None);
    let bsp = |scene: &_, config: &_| bake(scene, config, &context);
    let told = bsp(&scene, &config).err().unwrap().to_string();
    assert!(
        told.contains("'waterr'") && told.contains(&format!("'{name}'")),
        "{told}"
    );
    scene.materials[0].name = "waterr".to_owned();
    assert!(config.costs.cost.check(&scene.materials).is_ok());
}

//! The simplifier on random worlds: guarantees and bounds hold, and views are not much more expensive. Covers P1.

use enfilade_bake::simplify::{
    CostModel, Metric, SimplifySettings, delete_portal, expected_cost, expected_cost_after,
    least_expected_cost, simplify, simplify_graph,
};
use enfilade_cpg::{CellId, CellSet, Portal, PortalId, Pvs, SightGraph, SightPortal, World};
use enfilade_geom::DVec3;
use enfilade_testkit::{GridParams, Rng, room_grid};
use enfilade_verify::{VerifyOptions, verify_world};

fn grid(rng: &mut Rng) -> World {
    let size = [2 + rng.below(4), 1 + rng.below(2), 2 + rng.below(4)];
    room_grid(&GridParams {
        size,
        doors: 0.5 + 0.5 * rng.unit(),
        merges: 0.2 * rng.unit(),
        outdoors: rng.chance(0.5),
        furniture: 1,
        ..GridParams::offices(4, rng.below(1 << 20) as u64)
    })
}

fn holds(world: &World) {
    world.validate().unwrap();
    let options = VerifyOptions {
        rays: 3000,
        ..VerifyOptions::default()
    };
    let report = verify_world(world, None, &options);
    assert!(report.holds(), "{report:?}");
}

#[test]
fn merged_worlds_keep_their_promises_and_bounds() {
    let mut rng = Rng::new(1);
    for i in 0..40 {
        let world = grid(&mut rng);
        let before = simplify(&world, &SimplifySettings::default());
        // Default settings change nothing.
        assert!(before.world.graph.cells == world.graph.cells);
        assert!(before.world.graph.portals == world.graph.portals);
        let max = before.max_cost * (1.0 + 3.0 * rng.unit());
        let settings = SimplifySettings {
            min_cost: rng.unit() * max,
            max_cost: Some(max),
            max_cells: rng.chance(0.5).then(|| 1 + rng.below(6)),
            max_portals: rng.chance(0.5).then(|| rng.below(12)),
            metric: if i % 2 == 0 {
                Metric::ExpectedTriangles
            } else {
                Metric::VisibleVolume
            },
            join_outdoors: rng.chance(0.5),
            cost: CostModel {
                area: 0.1,
                ..CostModel::default()
            },
            ..SimplifySettings::default()
        };
        let bound = simplify(
            &world,
            &SimplifySettings {
                cost: settings.cost.clone(),
                ..SimplifySettings::default()
            },
        )
        .max_cost
        .max(max);
        let simple = simplify(&world, &settings);
        assert!(
            simple.max_cost <= bound * (1.0 + 1e-12),
            "{} > {bound}",
            simple.max_cost
        );
        assert!(simple.world.graph.cells.len() <= world.graph.cells.len());
        holds(&simple.world);
        // Every triangle is still there, and every point in the cell that its old one became.
        let n = |w: &World| {
            w.batches
                .iter()
                .map(|b| b.primitive.indices.len())
                .sum::<usize>()
        };
        assert_eq!(n(&simple.world), n(&world));
        let b = world.graph.locator.bounds;
        for _ in 0..200 {
            let p =
                b.min + b.size() * enfilade_geom::DVec3::new(rng.unit(), rng.unit(), rng.unit());
            let expected = world
                .graph
                .locator
                .locate(p)
                .map(|c| simple.cell_of[c.0 as usize]);
            assert_eq!(simple.world.graph.locator.locate(p), expected);
        }
    }
}

#[test]
fn a_cell_with_a_name_gives_it_to_the_one_that_it_joins() {
    let without_outdoors = GridParams {
        size: [2, 1, 1],
        doors: 1.0,
        outdoors: false,
        ..GridParams::offices(4, 1)
    };
    let mut world = room_grid(&without_outdoors);
    let [one, other] = world.graph.portals[0].cells;
    for named in [one, other] {
        for cell in [one, other] {
            world.graph.cells[cell.idx()].name = cell.to_string();
        }
        world.graph.cells[named.idx()].name = "Kitchen".into();
        let joined = delete_portal(&world, PortalId(0)).unwrap();
        let cell = joined.cell_of[named.idx()];
        assert_eq!(joined.world.graph[cell].name, "Kitchen");
    }
}

#[test]
fn a_deleted_portal_makes_one_cell_of_two() {
    let mut rng = Rng::new(7);
    let mut n_deleted = 0;
    for _ in 0..20 {
        let mut world = grid(&mut rng);
        // The visibility sets describe other cells, and are dropped.
        let n = world.graph.cells.len();
        world.pvs = Some(Pvs::of_rows(&vec![CellSet::all(n); n]));
        let Some(last) = world.graph.portals.len().checked_sub(1) else {
            continue;
        };
        n_deleted += 1;
        let gone = delete_portal(&world, PortalId(last as u32)).unwrap();
        assert_eq!(gone.world.graph.cells.len() + 1, world.graph.cells.len());
        assert!(gone.world.graph.portals.len() <= last);
        let [a, b] = world.graph.portals[last].cells;
        assert_eq!(gone.cell_of[a.idx()], gone.cell_of[b.idx()]);
        for (id, cell) in gone.world.graph.indoor_cells() {
            assert_eq!(cell.name, id.to_string());
        }
        assert_eq!(gone.world.pvs, None);
        holds(&gone.world);
        assert!(delete_portal(&world, PortalId(last as u32 + 1)).is_none());
    }
    assert!(n_deleted > 10, "{n_deleted} worlds had a portal");
}

#[test]
fn material_weights_count() {
    let world = grid(&mut Rng::new(3));
    let plain = simplify(&world, &SimplifySettings::default()).max_cost;
    let cost = CostModel {
        triangle: 2.0,
        ..CostModel::default()
    };
    let double = simplify(
        &world,
        &SimplifySettings {
            cost: cost.clone(),
            ..SimplifySettings::default()
        },
    );
    assert!((double.max_cost - 2.0 * plain).abs() < 1e-9);
    let views = expected_cost(&world, &CostModel::default(), 64);
    assert!((expected_cost(&world, &cost, 64) - 2.0 * views).abs() < 1e-6 * views);
}

#[test]
fn views_of_fewer_cells_are_never_cheaper_also_where_rooms_join_the_outdoors() {
    let mut rng = Rng::new(5);
    for _ in 0..12 {
        let world = grid(&mut rng);
        let plain = CostModel::default();
        let before = expected_cost(&world, &plain, 64);
        let settings = SimplifySettings {
            max_cells: Some(1 + rng.below(4)),
            join_outdoors: true,
            ..SimplifySettings::default()
        };
        let after = expected_cost_after(&world, &simplify(&world, &settings), &plain, 64);
        assert!(after >= before * (1.0 - 1e-9), "{before} {after}");
    }
}

#[test]
fn small_worlds_are_joined_nearly_as_well_as_can_be() {
    const VIEWS: usize = 256;
    let cost = CostModel::default();
    let mut rng = Rng::new(9);
    let (mut sum, mut n_worlds) = (0.0, 0);
    for i in 0..100 {
        let world = grid(&mut rng);
        let n_portals = world.graph.portals.len();
        let settings = SimplifySettings {
            max_portals: Some(n_portals * (2 + rng.below(5)) / 10),
            // The optimum over all ways may join the outdoors.
            join_outdoors: true,
            ..SimplifySettings::default()
        };
        let most = settings.max_portals.unwrap();
        // Eight cells have 4,140 ways; nine take seconds.
        if world.graph.cells.len() > 8 {
            continue;
        }
        let least = least_expected_cost(&world, most, &cost, VIEWS).unwrap();
        let simple = simplify(&world, &settings);
        let ours = expected_cost_after(&world, &simple, &cost, VIEWS);
        assert!(simple.world.graph.portals.len() <= most, "{i}");
        assert!(ours >= least * (1.0 - 1e-12), "{i}: {ours} {least}");
        // Without merges, the cost is unchanged.
        let all = least_expected_cost(&world, n_portals, &cost, VIEWS).unwrap();
        assert!(
            (all - expected_cost(&world, &cost, VIEWS)).abs() < 1e-9 * all,
            "{i}"
        );
        sum += ours / least;
        n_worlds += 1;
    }
    assert!(n_worlds > 15, "{n_worlds}");
    // Chosen from other eyes, so not always the best.
    assert!(
        sum / f64::from(n_worlds) < 1.01,
        "{} of {n_worlds}",
        sum / f64::from(n_worlds)
    );
}

#[test]
fn graphs_without_surfaces_keep_their_bounds_and_merge_across_what_is_widest() {
    // A row of cells whose openings get wider to the end, and one cell without openings.
    let square = |x: f64, size: f64| {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        corners
            .map(|[y, z]| DVec3::new(x, y * size, z * size))
            .to_vec()
    };
    let graph = SightGraph {
        n_cells: 7,
        portals: (0..5)
            .map(|i| SightPortal {
                cells: [i, i + 1],
                winding: square(f64::from(i), f64::from(i + 1)),
                pieces: Vec::new(),
            })
            .collect(),
    };
    let costs = [1.0; 7];
    let with = |settings: SimplifySettings| simplify_graph(&graph, &costs, &settings);
    let nothing = with(SimplifySettings::default());
    assert_eq!(nothing.cell_of, (0..7).collect::<Vec<_>>());
    assert_eq!((nothing.n_cells, nothing.n_portals), (7, 5));
    let few = with(SimplifySettings {
        max_cells: Some(6),
        ..SimplifySettings::default()
    });
    // The first of the cheapest, which has one neighbor.
    assert_eq!(few.cell_of, [0, 0, 1, 2, 3, 4, 5]);
    let pairs = with(SimplifySettings {
        min_cost: 2.0,
        max_cost: Some(2.0),
        ..SimplifySettings::default()
    });
    assert_eq!(pairs.cell_of, [0, 0, 1, 1, 2, 2, 3]);
    assert_eq!(
        (pairs.min_cost, pairs.max_cost, pairs.n_portals),
        (1.0, 2.0, 2)
    );
    // The cell in the middle of the row merges across the wider opening.
    let mut dear = costs;
    dear[..2].fill(9.0);
    dear[3..].fill(9.0);
    let settings = SimplifySettings {
        min_cost: 2.0,
        ..SimplifySettings::default()
    };
    assert_eq!(
        simplify_graph(&graph, &dear, &settings).cell_of,
        [0, 1, 2, 2, 3, 4, 5]
    );
}

#[test]
fn rooms_and_the_outdoors_stay_apart_and_numbers_are_met_from_above() {
    let mut rng = Rng::new(11);
    let (mut n_worlds, mut n_met, mut n_below) = (0, 0, 0);
    for i in 0..40 {
        let world = grid(&mut rng);
        let graph = &world.graph;
        let is_outdoor = |c: CellId| graph[c].outdoor;
        let leads_out = |p: &&Portal| is_outdoor(p.cells[0]) != is_outdoor(p.cells[1]);
        let n_out = graph.portals.iter().filter(leads_out).count();
        let n = graph.portals.len();
        if n_out == 0 || n_out == n {
            continue;
        }
        n_worlds += 1;
        let with = |most, join_outdoors| SimplifySettings {
            max_portals: Some(most),
            metric: if i % 2 == 0 {
                Metric::ExpectedTriangles
            } else {
                Metric::VisibleVolume
            },
            join_outdoors,
            ..SimplifySettings::default()
        };
        let most = n_out + rng.below(n - n_out);
        let simple = simplify(&world, &with(most, false));
        let after = &simple.world.graph;
        for (c, cell) in (0..).map(CellId).zip(&graph.cells) {
            assert_eq!(after[simple.cell_of[c.idx()]].outdoor, cell.outdoor);
        }
        let left = after.portals.len();
        assert!(left <= most, "{left} {most}");
        n_met += usize::from(left == most);
        // Requests fewer than lead outdoors.
        let most = rng.below(n_out);
        let joined = simplify(&world, &with(most, true));
        let left = joined.world.graph.portals.len();
        assert!(left <= most, "{left} {most}");
        n_below += most - left;
    }
    // Rooms may have several openings between them, none of which can be removed alone.
    assert!(n_worlds > 15, "{n_worlds}");
    assert!(
        3 * n_met > 2 * n_worlds && n_below < 2 * n_worlds,
        "{n_met} {n_below} {n_worlds}"
    );
}

//! `bench bsp` and `bench simplify`: the tables of `docs/benchmarks/bsp.md`.

use std::path::PathBuf;

use enfilade::bake::bsp::{Guide, Heuristic};
use enfilade::bake::simplify::{CostModel, Metric, SimplifySettings, simplify};
use enfilade::bake::{BakeConfig, BakeContext, Method, Silent, bake};
use enfilade::geom::scene::{Role, Scene};
use enfilade::geom::{DVec3, Triangle};
use enfilade::import::{ImportOptions, import};
use enfilade::internals::bake::bsp::{Bsp, BspInput};
use enfilade::internals::bake::simplify::{
    expected_cost, expected_cost_after, least_expected_cost,
};
use enfilade_cli::world::read_world;
use enfilade_testkit::clinic;

use crate::measure::{cpu_seconds, name};
use crate::table::Table;

const HEURISTICS: [(&str, Heuristic); 4] = [
    ("default", Heuristic::Default),
    ("min-cut", Heuristic::MinCut),
    ("max-area", Heuristic::MaxArea),
    ("max-ortho", Heuristic::MaxOrtho),
];

/// Prints one line per scene and heuristic; with a threshold in polygons, bakes each to the end and merges cells up
/// to it.
pub(crate) fn bench_bsp(
    table: &mut Table,
    paths: &[PathBuf],
    clinics: &[usize],
    all: bool,
    min_polygons: Option<f64>,
) -> anyhow::Result<()> {
    table.push(
        "| scene | heuristic | faces | polygons in | BSP s | polygons out | splits | leaves | portals | grouping s | \
         valid | crossing | separators | cells before | cells | fewer | final portals | fewer |",
    );
    table.push("| --- | --- |".to_owned() + &" ---: |".repeat(16));
    let options = ImportOptions::default();
    for path in paths {
        let imported = import(std::slice::from_ref(path), &[], &options)?;
        measure(table, &name(path), &imported.scene, all, min_polygons)?;
    }
    let mut sizes: Vec<(f64, f64)> = Vec::new();
    for &n in clinics {
        sizes.push(measure(table, "clinic", &clinic(n, 1), all, min_polygons)?);
    }
    for w in sizes.windows(2) {
        let [(n, s), (m, t)] = [w[0], w[1]];
        let exponent = (t / s).ln() / (m / n).ln();
        table.push(format!(
            "{n:.0} → {m:.0} polygons: time grows with power {exponent:.2}"
        ));
    }
    Ok(())
}

/// Adds the lines of a scene; returns its polygons and the seconds of the last tree and grouping.
fn measure(
    table: &mut Table,
    name: &str,
    scene: &Scene,
    all: bool,
    min_polygons: Option<f64>,
) -> anyhow::Result<(f64, f64)> {
    let (triangles, objects): (Vec<Triangle>, Vec<u32>) = if scene.solids.is_empty() {
        let sources = scene.triangle_sources(Role::Structural);
        sources.map(|s| (scene.world_triangle(s), s.object)).unzip()
    } else {
        (Vec::new(), Vec::new())
    };
    let entities = scene.entities.iter().filter(|e| e.object.is_none());
    let inside: Vec<DVec3> = entities.filter_map(|e| e.position).collect();
    let input = BspInput {
        triangles: &triangles,
        objects: &objects,
        solids: &scene.solids,
        inside: &inside,
    };
    let mut size = (0.0, 0.0);
    for (heuristic_name, heuristic) in HEURISTICS.into_iter().take(if all { 4 } else { 1 }) {
        let start = cpu_seconds();
        let bsp = Bsp::build(&input, heuristic, &Guide::default());
        let built = cpu_seconds();
        let found = bsp.grouping();
        let grouped = cpu_seconds();
        let c = bsp.counts();
        size = (c.n_polygons as f64, grouped - start);
        let last = if let Some(min_polygons) = min_polygons {
            // The paper counts polygons of the tree: take each as the average number of triangles, and objects as none.
            let min_cost = min_polygons * c.n_triangles as f64 / c.n_polygons.max(1) as f64;
            let mut config = BakeConfig::of(Method::Bsp);
            config.bsp.heuristic = heuristic;
            config.costs = SimplifySettings {
                min_cost,
                cost: CostModel {
                    detail: 0.0,
                    ..CostModel::default()
                },
                ..SimplifySettings::default()
            };
            let world = bake(scene, &config, &BakeContext::new(&Silent, None))?.world;
            let fewer = |n: usize, of: usize| 100.0 * (1.0 - n as f64 / of.max(1) as f64);
            let (cells, portals) = (world.graph.cells.len(), world.graph.portals.len());
            format!(
                "{cells} | {:.1} % | {portals} | {:.1} %",
                fewer(cells, c.n_leaves),
                fewer(portals, c.n_portals)
            )
        } else {
            "- | - | - | -".to_owned()
        };
        table.push(format!(
            "| {name} | {heuristic_name} | {} | {} | {:.2} | {} | {} | {} | {} | {:.2} | {} | {} | {} | {} | {last} |",
            c.n_faces,
            c.n_polygons,
            built - start,
            c.n_pieces,
            c.n_splits,
            c.n_leaves,
            c.n_portals,
            grouped - built,
            found.n_valid,
            found.n_crossing,
            found.n_separators,
            found.n_cells,
        ));
        if let Some(leak) = bsp.leak() {
            table.push(format!(
                "{name} leaks along a path of {} points",
                leak.points.len()
            ));
        }
    }
    Ok(size)
}

/// Prints expected triangles per view before and after, by both metrics, at the same share of portals.
pub(crate) fn bench_simplify(table: &mut Table, worlds: &[PathBuf]) -> anyhow::Result<()> {
    const VIEWS: usize = 1000;
    table.push("| world | cells | portals | metric | cells after | portals after | triangles a view | after |");
    table.push("| --- | ---: | ---: | --- | ---: | ---: | ---: | ---: |");
    for path in worlds {
        let world = read_world(path)?;
        let cost = CostModel::default();
        let before = expected_cost(&world, &cost, VIEWS);
        let n_portals = world.graph.portals.len();
        for share in [0.5, 0.3] {
            for (metric_name, metric) in [
                ("expected triangles", Metric::ExpectedTriangles),
                ("visible volume", Metric::VisibleVolume),
            ] {
                let settings = SimplifySettings {
                    max_portals: Some((share * n_portals as f64) as usize),
                    metric,
                    join_outdoors: true,
                    ..SimplifySettings::default()
                };
                let simple = simplify(&world, &settings);
                table.push(format!(
                    "| {} | {} | {n_portals} | {metric_name} | {} | {} | {before:.0} | {:.2} × |",
                    name(path),
                    world.graph.cells.len(),
                    simple.world.graph.cells.len(),
                    simple.world.graph.portals.len(),
                    expected_cost_after(&world, &simple, &cost, VIEWS) / before,
                ));
            }
            let most = (share * n_portals as f64) as usize;
            if let Some(least) = least_expected_cost(&world, most, &cost, VIEWS) {
                table.push(format!(
                    "| {} | {} | {n_portals} | the best of all ways, touching or not | | ≤ {most} | {before:.0} | {:.2} × |",
                    name(path),
                    world.graph.cells.len(),
                    least / before,
                ));
            }
        }
    }
    Ok(())
}

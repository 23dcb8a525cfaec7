//! `bench builders`: a comparison of the builders on the same scenes.

use std::path::PathBuf;

use enfilade::bake::{BakeConfig, BakeContext, BakeError, BakeOutput, Method, Silent, bake};
use enfilade::cpg::{CellPortalGraph, PortalKind};
use enfilade::geom::scene::Scene;
use enfilade::geom::{Aabb, DVec3};
use enfilade_testkit::Rng;
use enfilade_verify::{VerifyOptions, verify_world};

use crate::measure::{cpu_seconds, imported, name};
use crate::table::Table;

/// Points for the agreement of two graphs.
const POINTS: usize = 20_000;

/// Prints one line per scene and builder, the watershed first.
pub(crate) fn bench_builders(
    table: &mut Table,
    paths: &[PathBuf],
    rays: u64,
) -> anyhow::Result<()> {
    table.push("| scene | triangles | builder | s | cells indoors | portals | cracks | agreement | broken |");
    table.push("| --- | ---: | --- |".to_owned() + &" ---: |".repeat(6));
    for path in paths {
        compare(table, &name(path), &imported(path)?, rays)?;
    }
    Ok(())
}

fn by(method: Method, scene: &Scene, context: &BakeContext<'_>) -> Result<BakeOutput, BakeError> {
    bake(scene, &BakeConfig::of(method), context)
}

type Builder = fn(&Scene, &BakeContext<'_>) -> Result<BakeOutput, BakeError>;

const BUILDERS: [(&str, Builder); 3] = [
    ("watershed", |s, c| by(Method::Watershed, s, c)),
    ("bsp", |s, c| by(Method::Bsp, s, c)),
    ("delaunay", |s, c| by(Method::Delaunay, s, c)),
];

fn compare(table: &mut Table, name: &str, scene: &Scene, rays: u64) -> anyhow::Result<()> {
    let mut first: Option<CellPortalGraph> = None;
    for (builder, build) in BUILDERS {
        let start = cpu_seconds();
        let world = build(scene, &BakeContext::new(&Silent, None))?.world;
        let seconds = cpu_seconds() - start;
        let options = VerifyOptions {
            rays,
            ..VerifyOptions::default()
        };
        let report = verify_world(&world, None, &options);
        let graph = world.graph;
        let broken = report.unsealed + report.incomplete + report.problems.len() as u64;
        let agreed = first.as_ref().map_or(1.0, |f| agreement(f, &graph));
        let cracks = graph.portals.iter().filter(|p| p.kind == PortalKind::Crack);
        table.push(format!(
            "| {name} | {} | {builder} | {seconds:.1} | {} | {} | {} | {agreed:.2} | {broken} |",
            graph
                .statistics
                .counts
                .get("input_triangles")
                .unwrap_or(&0.0),
            graph.cells.iter().filter(|c| !c.outdoor).count(),
            graph.portals.len(),
            cracks.count(),
        ));
        first.get_or_insert(graph);
    }
    Ok(())
}

/// Returns the Matthews correlation of "in one cell" between two graphs, over pairs of random points that lie in both
/// and are not both outdoors: 1 for the same rooms, 0 for unrelated ones.
fn agreement(a: &CellPortalGraph, b: &CellPortalGraph) -> f64 {
    let boxes = a.cells.iter().filter(|c| !c.outdoor).map(|c| c.aabb);
    let bounds = boxes.fold(Aabb::EMPTY, |all, [low, high]| {
        let corner = |p: [f32; 3]| DVec3::from(p.map(f64::from));
        all.including(corner(low)).including(corner(high))
    });
    if bounds.is_empty() {
        return 1.0;
    }
    let mut rng = Rng::new(1);
    let mut counts = vec![vec![0.0_f64; b.cells.len()]; a.cells.len()];
    for _ in 0..POINTS {
        let p = bounds.min + bounds.size() * DVec3::new(rng.unit(), rng.unit(), rng.unit());
        let (Some(i), Some(j)) = (a.locator.locate(p), b.locator.locate(p)) else {
            continue;
        };
        let (i, j) = (i.0 as usize, j.0 as usize);
        if !(a.cells[i].outdoor && b.cells[j].outdoor) {
            counts[i][j] += 1.0;
        }
    }
    correlation(&counts)
}

/// Returns the Matthews correlation of "same row" and "same column" over all pairs of counted points.
fn correlation(counts: &[Vec<f64>]) -> f64 {
    let pairs = |n: f64| n * (n - 1.0) / 2.0;
    let both: f64 = counts.iter().flatten().map(|&n| pairs(n)).sum();
    let rows: f64 = counts.iter().map(|r| pairs(r.iter().sum())).sum();
    let columns: f64 = (0..counts.first().map_or(0, Vec::len))
        .map(|j| pairs(counts.iter().map(|r| r[j]).sum()))
        .sum();
    let all = pairs(counts.iter().flatten().sum());
    let neither = all - rows - columns + both;
    let product = rows * columns * (all - rows) * (all - columns);
    if product <= 0.0 {
        // One of them has only one cell: they agree if the other does, too.
        return f64::from(u8::from(rows == columns));
    }
    (both * neither - (rows - both) * (columns - both)) / product.sqrt()
}

#[cfg(test)]
mod tests {
    use super::correlation;

    #[test]
    fn equal_partitions_correlate_and_unrelated_ones_do_not() {
        assert_eq!(correlation(&[vec![5.0, 0.0], vec![0.0, 9.0]]), 1.0);
        assert_eq!(correlation(&[vec![0.0, 5.0], vec![9.0, 0.0]]), 1.0);
        let unrelated = correlation(&[vec![500.0, 500.0], vec![500.0, 500.0]]);
        assert!(unrelated.abs() < 0.01, "{unrelated}");
        let half = correlation(&[vec![50.0, 50.0, 0.0], vec![0.0, 0.0, 100.0]]);
        assert!(half > 0.5 && half < 0.9, "{half}");
        assert_eq!(correlation(&[vec![7.0]]), 1.0);
        assert_eq!(correlation(&[vec![7.0, 7.0]]), 0.0);
    }
}

//! Visible sets with default settings.

use anyhow::Context;
use enfilade::World;
use enfilade::cpg::{CellPortalGraph, Pvs, SightGraph};
use enfilade::geom::Triangle;
use enfilade::vis::{VisConfig, VisContext, WorldVis, see_all, see_world};
use enfilade_verify::structural_triangles;

/// Returns the context of a search that goes to its end.
pub(crate) fn whole<'a>(
    on_round: &'a mut (impl FnMut(u64, u64) -> bool + Send),
    walls: Option<&'a [Triangle]>,
) -> VisContext<'a> {
    VisContext {
        on_round,
        walls,
        checkpoint: None,
    }
}

/// Finds what is seen from each cell, special portals included.
pub(crate) fn visible(graph: &CellPortalGraph) -> anyhow::Result<WorldVis> {
    let found = see_world(
        graph,
        &VisConfig::default(),
        &mut whole(&mut |_, _| true, None),
    );
    found.context("visibility")
}

/// Finds the cells seen from each cell past the walls in them.
pub(crate) fn visible_past_walls(world: &World) -> anyhow::Result<Pvs> {
    let walls: Vec<Triangle> = structural_triangles(world).iter().map(|t| t.0).collect();
    let graph = SightGraph::of_graph(&world.graph);
    let mut go_on = |_, _| true;
    let mut context = whole(&mut go_on, Some(&walls));
    Ok(see_all(&graph, &VisConfig::default(), &mut context)?.cells)
}

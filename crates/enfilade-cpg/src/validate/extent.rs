//! Checks that boxes lie around the geometry: readers size pictures and grids by them.

use enfilade_geom::{Aabb, DVec3};

use super::error::{Findings, GraphError};
use crate::{CellPortalGraph, World};

/// Most that a box may stick out, and its share of the largest coordinate: vertices are rounded to `f32`, outwards by
/// some builders, and cells that end at the locator's border end within its planes' rounding. [Units: wu]
const SLACK: f64 = 1e-3;
const RELATIVE_SLACK: f64 = 1e-5;

/// Most that the space around a model may extend beyond it: this many times its largest side, plus this many meters.
/// Builders leave meters; a thousand times as much is an error or an attack.
const AROUND: f64 = 10.0;
const AROUND_AT_LEAST: f64 = 100.0;

/// Checks that rooms lie in the locator's box: everything beyond it is outside.
pub(super) fn check_cells_in_locator(graph: &CellPortalGraph, found: &mut Findings) {
    let bounds = graph.locator.bounds;
    if bounds.is_empty() {
        return;
    }
    let reach = bounds.expanded(SLACK + RELATIVE_SLACK * bounds.extent());
    for (i, cell) in graph.cells.iter().enumerate().filter(|c| !c.1.outdoor) {
        let b = box_of(cell.aabb);
        if !holds(&reach, &b) {
            found.push(GraphError::FarBox {
                owner: format!("cell {i}"),
                of: "the locator's box",
                min: b.min.into(),
                max: b.max.into(),
            });
        }
    }
}

/// Checks that the boxes of the locator and the outdoors lie near the model. Passes worlds without triangles.
pub(super) fn check_boxes_around_geometry(world: &World, found: &mut Findings) {
    let graph = &world.graph;
    let model = geometry(world);
    if model.is_empty() {
        return;
    }
    let reach = model.expanded(AROUND * model.size().max_element() + AROUND_AT_LEAST);
    let mut check = |owner: String, b: Aabb| {
        if !b.is_empty() && !holds(&reach, &b) {
            found.push(GraphError::FarBox {
                owner,
                of: "the model",
                min: b.min.into(),
                max: b.max.into(),
            });
        }
    };
    check("the locator".into(), graph.locator.bounds);
    for (i, cell) in graph.cells.iter().enumerate() {
        check(format!("cell {i}"), box_of(cell.aabb));
    }
}

/// Returns the box around structure and portals.
pub(super) fn geometry(world: &World) -> Aabb {
    let corners = world.batches.iter().flat_map(|b| &b.primitive.positions);
    let portals = world.graph.portals.iter().flat_map(|p| &p.outline);
    corners
        .chain(portals)
        .map(|&p| DVec3::from(p.map(f64::from)))
        .filter(|p| p.is_finite())
        .fold(Aabb::EMPTY, Aabb::including)
}

fn holds(outer: &Aabb, inner: &Aabb) -> bool {
    outer.contains(inner.min) && outer.contains(inner.max)
}

fn box_of([min, max]: [[f32; 3]; 2]) -> Aabb {
    Aabb::new(min.map(f64::from).into(), max.map(f64::from).into())
}

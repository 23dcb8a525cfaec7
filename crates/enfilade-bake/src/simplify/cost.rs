//! The cost of drawing a cell (Lefebvre & Hornus 2003, §2): triangles and their area, weighted by material.
//!
//! The single source of costs: for merging cells, cutting cells, and judging views.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_cpg::{CellId, CellPortalGraph, DetailObject, SpecialPortal, World};
use enfilade_geom::scene::{Material, Primitive};
use enfilade_geom::{Aabb, DVec3, shown};

use super::merge::CostGraph;

/// Weights of the cost of drawing a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct CostModel {
    /// Cost of a triangle. [Limit: at least 0]
    pub triangle: f64,
    /// Cost of its area. [Units: 1/wu²] [Limit: at least 0]
    pub area: f64,
    /// Factor on both by material name; 1 for unlisted names. [Limit: at least 0]
    pub materials: BTreeMap<String, f64>,
    /// Factor on the cost of detail objects; 0 counts structure alone. [Limit: at least 0]
    pub detail: f64,
}

impl Default for CostModel {
    fn default() -> Self {
        Self {
            triangle: 1.0,
            area: 0.0,
            materials: BTreeMap::new(),
            detail: 1.0,
        }
    }
}

/// A cost is given for a material that no surface has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the scene has no material named '{}'; it has {}",
    shown(name),
    shown(known)
)]
#[non_exhaustive]
pub struct UnknownMaterial {
    /// Its name.
    pub name: String,
    /// Existing names, as text.
    pub known: String,
}

/// Most names listed in an error.
const TOLD: usize = 20;

impl CostModel {
    /// Checks that each material with a cost is one of `materials`.
    ///
    /// # Errors
    /// The first name that is not among them.
    pub fn check(&self, materials: &[Material]) -> Result<(), UnknownMaterial> {
        let is_known = |name: &str| materials.iter().any(|m| m.name == name);
        let Some(name) = self.materials.keys().find(|name| !is_known(name)) else {
            return Ok(());
        };
        let names = materials.iter().map(|m| m.name.as_str());
        let mut names: Vec<&str> = names.filter(|n| !n.is_empty()).collect();
        names.sort_unstable();
        names.dedup();
        let n_more = names.len().saturating_sub(TOLD);
        names.truncate(TOLD);
        let mut known = names
            .iter()
            .map(|n| format!("'{n}'"))
            .collect::<Vec<_>>()
            .join(", ");
        if known.is_empty() {
            known = "none with a name".to_owned();
        } else if n_more > 0 {
            known += &format!(" and {n_more} more");
        }
        Err(UnknownMaterial {
            name: name.clone(),
            known,
        })
    }
}

/// Returns the cost of each cell of a world. Linear in the world.
#[must_use]
pub fn costs(world: &World, cost: &CostModel) -> Vec<f64> {
    let graph = cost_graph(world, cost);
    (0..world.graph.cells.len() as u32)
        .map(|c| graph.cost(c) + 0.0)
        .collect()
}

/// Returns the cost of one cell.
pub(crate) fn cost_of_cell(world: &World, cell: CellId, cost: &CostModel) -> f64 {
    let prices = Prices { world, cost };
    let sees = |cells: &[CellId]| cells.binary_search(&cell).is_ok();
    let batches = world.batches.iter().filter(|b| sees(&b.cells));
    let details = world.details.iter().filter(|d| sees(&d.cells));
    let batches = batches.map(|b| prices.of_primitive(&b.primitive, 1.0));
    batches.chain(details.map(|d| prices.of_detail(d))).sum()
}

/// A unit of drawing: a structural triangle, or a detail object.
pub(crate) struct Surface {
    /// Three vertices of a triangle, or eight of the box around an object. [Units: wu]
    pub(crate) corners: Vec<DVec3>,
    /// Cost of drawing it.
    pub(crate) cost: f64,
}

/// Returns everything that a cell sees. The costs add up to the cell's cost.
pub(crate) fn surfaces_of(world: &World, cell: CellId, cost: &CostModel) -> Vec<Surface> {
    let prices = Prices { world, cost };
    let sees = |cells: &[CellId]| cells.binary_search(&cell).is_ok();
    let mut out = Vec::new();
    for batch in world.batches.iter().filter(|b| sees(&b.cells)) {
        let p = &batch.primitive;
        out.extend(p.triangles().map(|corners| Surface {
            cost: prices.of_triangles(p.material, 1, double_area(corners), 1.0),
            corners: corners.to_vec(),
        }));
    }
    for d in world.details.iter().filter(|d| sees(&d.cells)) {
        let transform = d.placement();
        let mesh = &world.detail_meshes[d.mesh as usize];
        let points = mesh.primitives.iter().flat_map(|p| &p.positions);
        let b = points.fold(Aabb::EMPTY, |b, p| {
            b.including(DVec3::from(p.map(f64::from)))
        });
        if b.is_empty() {
            continue;
        }
        let corner = |i: usize| {
            let pick = |axis: usize| {
                if i >> axis & 1 == 0 {
                    b.min[axis]
                } else {
                    b.max[axis]
                }
            };
            transform.transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
        };
        out.push(Surface {
            corners: (0..8).map(corner).collect(),
            cost: prices.of_detail(d),
        });
    }
    out
}

fn double_area([a, b, c]: [DVec3; 3]) -> f64 {
    (b - a).cross(c - a).length()
}

/// Computes the costs of a world's surfaces.
struct Prices<'a> {
    world: &'a World,
    cost: &'a CostModel,
}

impl Prices<'_> {
    fn of_triangles(&self, material: Option<u32>, n: usize, double_area: f64, scale: f64) -> f64 {
        let name = material
            .and_then(|m| self.world.materials.get(m as usize))
            .map_or("", |m| &m.name);
        let factor = self.cost.materials.get(name).copied().unwrap_or(1.0);
        factor * (self.cost.triangle * n as f64 + self.cost.area * (0.5 * double_area * scale))
    }

    fn of_primitive(&self, p: &Primitive, scale: f64) -> f64 {
        let double = if self.cost.area == 0.0 {
            0.0
        } else {
            p.triangles().map(double_area).sum()
        };
        self.of_triangles(p.material, p.indices.len() / 3, double, scale)
    }

    fn of_detail(&self, d: &DetailObject) -> f64 {
        let t = d.transform;
        let column = |k: usize| DVec3::new(t[k].into(), t[k + 1].into(), t[k + 2].into());
        let volume = column(0).dot(column(4).cross(column(8))).abs();
        let mesh = &self.world.detail_meshes[d.mesh as usize];
        let scale = volume.powf(2.0 / 3.0);
        let parts = mesh.primitives.iter().map(|p| self.of_primitive(p, scale));
        self.cost.detail * parts.sum::<f64>()
    }
}

/// Returns the cells at doorways with a special side, ascending: merged across one, they would lose it.
fn alone(graph: &CellPortalGraph) -> Vec<u32> {
    let portals = graph.specials.iter().filter_map(SpecialPortal::portal);
    let cells = portals.flat_map(|p| graph[p].cells).map(|c| c.0);
    let cells: BTreeSet<u32> = cells.collect();
    cells.into_iter().collect()
}

/// Returns the cells with their drawing costs; each batch and each detail object is an item.
pub(super) fn cost_graph(world: &World, cost: &CostModel) -> CostGraph {
    let mut graph = CostGraph {
        items: vec![Vec::new(); world.graph.cells.len()],
        pairs: world
            .graph
            .portals
            .iter()
            .map(|p| p.cells.map(|c| c.0))
            .collect(),
        aloof: world.graph.cells.iter().map(|c| c.outdoor).collect(),
        alone: alone(&world.graph),
        ..CostGraph::default()
    };
    let prices = Prices { world, cost };
    let mut add = |cells: &[CellId], weight: f64| {
        let item = graph.weights.len() as u32;
        graph.weights.push(weight);
        cells
            .iter()
            .for_each(|c| graph.items[c.0 as usize].push(item));
    };
    for b in &world.batches {
        add(&b.cells, prices.of_primitive(&b.primitive, 1.0));
    }
    for d in &world.details {
        add(&d.cells, prices.of_detail(d));
    }
    graph
}

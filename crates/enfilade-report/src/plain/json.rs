//! The graph as JSON: cells, portals with their polygons, the locator, and visible cells if computed.

use enfilade_cpg::{CellId, Locator, Portal, World};
use serde::Serialize;

use super::files::SceneFile;
use super::{cell_kind, neighbors, portal_kind};

/// The version of the layout. Members are added without a new version.
const VERSION: u32 = 1;

#[derive(Serialize)]
struct PlainGraph<'a> {
    format: &'static str,
    version: u32,
    cells: Vec<PlainCell<'a>>,
    portals: Vec<PlainPortal<'a>>,
    locator: PlainLocator<'a>,
    /// For each cell, those visible from it, itself included.
    #[serde(skip_serializing_if = "Option::is_none")]
    visible: Option<Vec<Vec<u32>>>,
    /// Scenes beside this file, each with the cells that show it.
    #[serde(skip_serializing_if = "<[SceneFile]>::is_empty")]
    files: &'a [SceneFile],
}

#[derive(Serialize)]
struct PlainCell<'a> {
    id: usize,
    name: &'a str,
    kind: &'static str,
    aabb: [[f32; 3]; 2],
    volume: f32,
    portals: Vec<u32>,
    neighbors: Vec<u32>,
}

#[derive(Serialize)]
struct PlainPortal<'a> {
    id: usize,
    kind: &'static str,
    cells: [u32; 2],
    center: [f32; 3],
    normal: [f32; 3],
    /// Width and height.
    size: [f32; 2],
    area: f32,
    outline: &'a [[f32; 3]],
    pieces: &'a [Vec<[f32; 3]>],
}

#[derive(Serialize)]
struct PlainLocator<'a> {
    bounds: [[f64; 3]; 2],
    outside: Option<u32>,
    root: i32,
    planes: &'a [[f64; 4]],
    /// Plane, child in front, child behind.
    nodes: Vec<[i64; 3]>,
}

impl<'a> PlainPortal<'a> {
    fn of(id: usize, portal: &'a Portal) -> Self {
        Self {
            id,
            kind: portal_kind(portal.kind),
            cells: portal.cells.map(|c| c.0),
            center: portal.center(),
            normal: portal.normal,
            size: portal.size(),
            area: portal.area,
            outline: &portal.outline,
            pieces: &portal.pieces,
        }
    }
}

impl<'a> PlainLocator<'a> {
    fn of(locator: &'a Locator) -> Self {
        let nodes = locator.nodes.iter();
        Self {
            bounds: [locator.bounds.min, locator.bounds.max].map(|p| p.to_array()),
            outside: locator.outside.map(|c| c.0),
            root: locator.root,
            planes: &locator.planes,
            nodes: nodes
                .map(|n| {
                    let [front, back] = n.children.map(i64::from);
                    [i64::from(n.plane), front, back]
                })
                .collect(),
        }
    }
}

/// Returns the graph of a world as JSON, with the `files` that divide its surfaces, if any. `docs/your-engine.md` describes its members.
///
/// # Errors
/// Never in practice: all members have a form in JSON.
pub fn graph_json(world: &World, files: &[SceneFile]) -> Result<String, serde_json::Error> {
    let graph = &world.graph;
    let ids = |cells: &[CellId]| cells.iter().map(|c| c.0).collect::<Vec<u32>>();
    let cells = graph.cells.iter().enumerate().map(|(id, cell)| PlainCell {
        id,
        name: &cell.name,
        kind: cell_kind(cell),
        aabb: cell.aabb,
        volume: cell.volume,
        portals: cell.portals.iter().map(|p| p.0).collect(),
        neighbors: ids(&neighbors(graph, CellId(id as u32))),
    });
    let portals = graph.portals.iter().enumerate();
    let visible = world.pvs.as_ref().map(|pvs| {
        let cells = graph.cell_ids();
        cells
            .map(|c| pvs.visible_from(c).map(|v| v.0).collect())
            .collect()
    });
    serde_json::to_string(&PlainGraph {
        format: "enfilade graph",
        version: VERSION,
        cells: cells.collect(),
        portals: portals.map(|(id, p)| PlainPortal::of(id, p)).collect(),
        locator: PlainLocator::of(&graph.locator),
        visible,
        files,
    })
}

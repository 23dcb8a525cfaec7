//! The objects that a cell sees, by their names in the input.

use std::collections::BTreeSet;
use std::io::Write;

use anyhow::Context;
use enfilade::cpg::{CellId, CellPortalGraph, World};
use serde::Serialize;
use serde_json::value::RawValue;

use crate::screen::print_json;

/// The output of `--json`.
#[derive(Serialize)]
struct Objects<'a> {
    objects: Vec<Object<'a>>,
}

#[derive(Serialize)]
struct Object<'a> {
    source: u32,
    name: &'a str,
    path: String,
    triangles: u32,
    detail: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    extras: Option<&'a RawValue>,
}

/// Writes the objects that the cell of this name or id sees, those with most triangles first.
pub(super) fn write(
    out: &mut impl Write,
    world: &World,
    cell: &str,
    json: bool,
) -> anyhow::Result<()> {
    let cell = cell_of(&world.graph, cell)?;
    let details: BTreeSet<u32> = world.details.iter().filter_map(|d| d.source).collect();
    let mut objects: Vec<Object<'_>> = world
        .sources_in(cell)
        .into_iter()
        .map(|(source, triangles)| {
            let node = &world.sources[source as usize];
            Object {
                source,
                name: &node.name,
                path: world.source_path(source),
                triangles,
                detail: details.contains(&source),
                extras: serde_json::from_str(&node.extras).ok(),
            }
        })
        .collect();
    objects.sort_by(|a, b| (b.triangles, a.source).cmp(&(a.triangles, b.source)));
    if json {
        return print_json(out, &Objects { objects });
    }
    writeln!(out, "triangles  kind       object")?;
    for object in objects {
        let kind = if object.detail { "detail" } else { "structure" };
        writeln!(out, "{:>9}  {kind:9}  {}", object.triangles, object.path)?;
    }
    Ok(())
}

pub(crate) fn cell_of(graph: &CellPortalGraph, text: &str) -> anyhow::Result<CellId> {
    let by_id = || {
        let id = text.parse::<u32>().ok()?;
        ((id as usize) < graph.cells.len()).then_some(CellId(id))
    };
    graph.cell_named(text).or_else(by_id).with_context(|| {
        let n = graph.cells.len();
        format!("no cell is called '{text}'; there are {n}, and `enfilade inspect` lists them by name and id")
    })
}

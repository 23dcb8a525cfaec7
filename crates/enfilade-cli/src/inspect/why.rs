//! Why cells, portals and places of a world are what they are.

use std::io::Write;

use anyhow::Context;
use enfilade::cpg::{CellId, CellPortalGraph, PortalId, Why};
use serde::Serialize;

use super::{cell_kind, cell_of, kind_name};
use crate::screen::{At, print_json};

/// The output of `--json`.
#[derive(Serialize)]
struct Whys {
    whys: Vec<WhyReport>,
}

/// A decision of the bake.
#[derive(Serialize)]
struct WhyReport {
    #[serde(skip_serializing_if = "Option::is_none")]
    cell: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    portal: Option<u32>,
    /// [Units: wu]
    position: [f32; 3],
    margin: f32,
    text: String,
    #[serde(flatten)]
    why: Why,
}

/// A thing that decisions are about.
struct Subject<'a> {
    title: String,
    cell: Option<CellId>,
    portal: Option<PortalId>,
    position: [f32; 3],
    whys: &'a [Why],
}

/// Writes why a cell, a portal (`portal-5`) or, for `all`, each of them and each place is what it is; `all` puts what is most in
/// doubt first.
pub(super) fn write(
    out: &mut impl Write,
    graph: &CellPortalGraph,
    what: &str,
    json: bool,
) -> anyhow::Result<()> {
    let mut subjects: Vec<Subject<'_>> = match portal_of(graph, what)? {
        Some(portal) => vec![of_portal(graph, portal)],
        None if what == "all" => all(graph),
        None => {
            let cell = cell_of(graph, what)?;
            let portals = graph[cell].portals.iter();
            let around = portals.map(|&p| of_portal(graph, p));
            std::iter::once(of_cell(graph, cell))
                .chain(around)
                .collect()
        }
    };
    if what == "all" {
        subjects.sort_by(|a, b| a.margin().total_cmp(&b.margin()));
    }
    if json {
        let whys = subjects.iter().flat_map(Subject::reports).collect();
        return print_json(out, &Whys { whys });
    }
    for subject in &subjects {
        writeln!(out, "{}", subject.title)?;
        if subject.whys.is_empty() {
            writeln!(out, "  no bake decided it: it was made or changed by hand")?;
        }
        for why in subject.whys {
            writeln!(out, "  {why}")?;
        }
    }
    Ok(())
}

/// Returns the portal that a text such as `portal-5` names; `None` if it names none.
fn portal_of(graph: &CellPortalGraph, text: &str) -> anyhow::Result<Option<PortalId>> {
    let Some(number) = text.strip_prefix("portal-") else {
        return Ok(None);
    };
    let n = graph.portals.len();
    let id = number.parse::<u32>().ok().filter(|&id| (id as usize) < n);
    let id = id.with_context(|| {
        format!("there is no '{text}': there are {n} portals, from portal-0 on")
    })?;
    Ok(Some(PortalId(id)))
}

fn all(graph: &CellPortalGraph) -> Vec<Subject<'_>> {
    let cells = graph.cell_ids().map(|c| of_cell(graph, c));
    let portals = graph.portal_ids().map(|p| of_portal(graph, p));
    let places = graph.places.iter().map(|place| Subject {
        title: format!("place at {}", At::of(place.at)),
        cell: None,
        portal: None,
        position: place.at,
        whys: std::slice::from_ref(&place.why),
    });
    cells.chain(portals).chain(places).collect()
}

fn of_cell(graph: &CellPortalGraph, id: CellId) -> Subject<'_> {
    let cell = &graph[id];
    let middle = [0, 1, 2].map(|k| 0.5 * (cell.aabb[0][k] + cell.aabb[1][k]));
    let kind = cell_kind(cell);
    Subject {
        title: format!(
            "{} ({kind}, {:.1} m³, around {})",
            cell.name,
            cell.volume,
            At::of(middle)
        ),
        cell: Some(id),
        portal: None,
        position: middle,
        whys: &cell.why,
    }
}

fn of_portal(graph: &CellPortalGraph, id: PortalId) -> Subject<'_> {
    let portal = &graph[id];
    let [one, other] = portal.cells.map(|c| &graph[c].name);
    let [width, height] = portal.size();
    let (kind, at) = (kind_name(portal.kind), At::of(portal.center()));
    Subject {
        title: format!("{id} ({kind}, {one} – {other}, {width:.2} × {height:.2} m, at {at})"),
        cell: None,
        portal: Some(id),
        position: portal.center(),
        whys: &portal.why,
    }
}

impl Subject<'_> {
    /// Returns the least margin of its decisions.
    fn margin(&self) -> f32 {
        self.whys.iter().map(Why::margin).fold(1.0, f32::min)
    }

    fn reports(&self) -> impl Iterator<Item = WhyReport> {
        self.whys.iter().map(|why| WhyReport {
            cell: self.cell.map(|c| c.0),
            portal: self.portal.map(|p| p.0),
            position: self.position,
            margin: why.margin(),
            text: why.to_string(),
            why: why.clone(),
        })
    }
}

//! The graph for programs that draw and analyze graphs: GraphML and DOT.

use std::fmt::Write;

use enfilade_cpg::{Cell, Portal, World};

use super::{cell_kind, portal_kind};

/// Attributes of nodes and edges: what for, name, type.
const KEYS: [(&str, &str, &str); 10] = [
    ("node", "name", "string"),
    ("node", "kind", "string"),
    ("node", "volume", "double"),
    ("edge", "kind", "string"),
    ("edge", "width", "double"),
    ("edge", "height", "double"),
    ("edge", "area", "double"),
    ("edge", "x", "double"),
    ("edge", "y", "double"),
    ("edge", "z", "double"),
];

fn of_node(cell: &Cell) -> [String; 3] {
    let name = escaped(&cell.name);
    [name, cell_kind(cell).to_owned(), cell.volume.to_string()]
}

fn of_edge(portal: &Portal) -> [String; 7] {
    let ([width, height], [x, y, z]) = (portal.size(), portal.center());
    let kind = portal_kind(portal.kind).to_owned();
    let [width, height, area, x, y, z] =
        [width, height, portal.area, x, y, z].map(|v| v.to_string());
    [kind, width, height, area, x, y, z]
}

/// Returns the graph of a world as GraphML: a node for each cell, an edge for each portal.
#[must_use]
pub fn graph_graphml(world: &World) -> String {
    let mut out = String::from(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<graphml xmlns=\"http://graphml.graphdrawing.org/xmlns\">\n",
    );
    for (of, name, kind) in KEYS {
        let _ = writeln!(
            out,
            "<key id=\"{of}-{name}\" for=\"{of}\" attr.name=\"{name}\" attr.type=\"{kind}\"/>"
        );
    }
    out.push_str("<graph edgedefault=\"undirected\">\n");
    let data = |out: &mut String, of: &str, values: &[String]| {
        let keys = KEYS.iter().filter(|k| k.0 == of);
        for ((_, name, _), value) in keys.zip(values) {
            let _ = write!(out, "<data key=\"{of}-{name}\">{value}</data>");
        }
    };
    for (id, cell) in world.graph.cells.iter().enumerate() {
        let _ = write!(out, "<node id=\"c{id}\">");
        data(&mut out, "node", &of_node(cell));
        out.push_str("</node>\n");
    }
    for (id, portal) in world.graph.portals.iter().enumerate() {
        let [a, b] = portal.cells.map(|c| c.0);
        let _ = write!(out, "<edge id=\"p{id}\" source=\"c{a}\" target=\"c{b}\">");
        data(&mut out, "edge", &of_edge(portal));
        out.push_str("</edge>\n");
    }
    out.push_str("</graph>\n</graphml>\n");
    out
}

/// Returns the graph of a world in the DOT language.
#[must_use]
pub fn graph_dot(world: &World) -> String {
    let mut out = String::from("graph world {\n  node [shape=box];\n");
    for (id, cell) in world.graph.cells.iter().enumerate() {
        let name = quoted(&cell.name);
        let shape = if cell.outdoor { ", shape=ellipse" } else { "" };
        let _ = writeln!(out, "  c{id} [label=\"{name}\"{shape}];");
    }
    for portal in &world.graph.portals {
        let [a, b] = portal.cells.map(|c| c.0);
        let kind = portal_kind(portal.kind);
        let [width, height] = portal.size();
        let _ = writeln!(
            out,
            "  c{a} -- c{b} [label=\"{kind} {width:.2} × {height:.2} m\"];"
        );
    }
    out.push_str("}\n");
    out
}

/// Returns text as XML content. Characters that XML 1.0 does not have become spaces.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\u{fffe}' | '\u{ffff}' => out.push(' '),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

/// Returns text as the content of a quoted string in DOT.
fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

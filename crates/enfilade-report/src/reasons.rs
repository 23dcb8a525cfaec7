//! Why rooms and doorways are there: a table of decisions, what is most in doubt first, in which the page looks up what is pointed at.

use std::fmt::Write;

use enfilade_cpg::{Why, World};

use crate::label::shortened;
use crate::svg::escaped;

/// Most rows of the table: in larger worlds, decisions far from their limits are left out.
const MAX_ROWS: usize = 10_000;

/// A decision about a cell or a portal.
struct Row<'a> {
    margin: f32,
    /// Attribute that says what it is about.
    of: String,
    name: String,
    why: &'a Why,
}

/// Writes the table, if the world tells reasons. Rows of cells carry `data-cell`, rows of portals the cells that they join as `data-ends`.
pub(crate) fn reasons(out: &mut String, world: &World) {
    let graph = &world.graph;
    let mut rows: Vec<Row<'_>> = Vec::new();
    for (i, cell) in graph.cells.iter().enumerate() {
        rows.extend(cell.why.iter().map(|why| Row {
            margin: why.margin(),
            of: format!("data-cell=\"{i}\""),
            name: shortened(&cell.name).into_owned(),
            why,
        }));
    }
    for id in graph.portal_ids() {
        // As the graph has its lines.
        let [a, b] = graph[id].cells;
        let (a, b) = (a.min(b), a.max(b));
        rows.extend(graph[id].why.iter().map(|why| Row {
            margin: why.margin(),
            of: format!("data-ends=\"{} {}\"", a.0, b.0),
            name: format!(
                "{id}, {} – {}",
                shortened(&graph[a].name),
                shortened(&graph[b].name)
            ),
            why,
        }));
    }
    if rows.is_empty() {
        return;
    }
    rows.sort_by(|a, b| a.margin.total_cmp(&b.margin));
    let n = rows.len();
    rows.truncate(MAX_ROWS);
    let note = if n > MAX_ROWS {
        format!(" The {MAX_ROWS} closest of {n}.")
    } else {
        String::new()
    };
    let _ = writeln!(
        out,
        "<section><h2>Reasons</h2><p>Why each room and doorway is there: the decision of the bake, how close it was (margin 0: at the \
         limit), and the facts behind it. What is most in doubt comes first.{note}</p><details><summary>{n} decisions</summary>\
         <div class=\"wide\"><table id=\"reasons\">"
    );
    for row in rows {
        let _ = writeln!(
            out,
            "<tr {}><td>{}</td><td class=\"why\">{}</td></tr>",
            row.of,
            escaped(&row.name),
            escaped(&row.why.to_string())
        );
    }
    out.push_str(
        "</table></div></details><aside id=\"why\" hidden aria-live=\"polite\"></aside></section>\n",
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_cpg::{Cell, CellId, Fact, Portal, PortalKind, Reason};

    #[test]
    fn the_closest_decision_comes_first_and_names_what_it_is_about() {
        let mut world = World::default();
        for name in ["<hall>", "yard"] {
            world.graph.cells.push(Cell {
                name: name.into(),
                why: vec![Why::given(Reason::Unscaled)],
                ..Cell::default()
            });
        }
        world.graph.portals.push(Portal {
            cells: [CellId(0), CellId(1)],
            kind: PortalKind::Open,
            normal: [1.0, 0.0, 0.0],
            outline: Vec::new(),
            pieces: Vec::new(),
            area: 1.0,
            fittings: Vec::new(),
            why: vec![Why::compared(Reason::Narrow, 0.7, &[(Fact::Share, 0.69)])],
        });
        let mut page = String::new();
        reasons(&mut page, &world);
        let at = |text: &str| page.find(text).unwrap_or_else(|| panic!("{text}: {page}"));
        assert!(at("data-ends=\"0 1\"") < at("data-cell=\"0\""));
        assert!(at("portal-0, &lt;hall&gt; – yard") < at("under 0.7"));
    }

    #[test]
    fn a_world_of_an_older_version_has_no_such_table() {
        let mut page = String::new();
        reasons(&mut page, &World::default());
        assert!(page.is_empty());
    }
}

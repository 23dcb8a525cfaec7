//! How often a bake decided for each reason.

use std::collections::BTreeMap;
use std::io::{self, Write};

use enfilade::cpg::{CellPortalGraph, Reason, Why};

/// Greatest margin of a decision that is close.
const CLOSE: f32 = 0.1;

/// Writes a line for each reason: the number of decisions, and of those that are close.
pub(super) fn write_reasons(out: &mut impl Write, graph: &CellPortalGraph) -> io::Result<()> {
    let of_cells = graph.cells.iter().flat_map(|c| &c.why);
    let of_portals = graph.portals.iter().flat_map(|p| &p.why);
    let of_places = graph.places.iter().map(|p| &p.why);
    let mut counts: BTreeMap<Reason, [usize; 2]> = BTreeMap::new();
    for why in of_cells.chain(of_portals).chain(of_places) {
        let [n, n_close] = counts.entry(why.reason).or_default();
        *n += 1;
        *n_close += usize::from(why.margin() < CLOSE);
    }
    for (reason, [n, n_close]) in counts {
        let words = Why::given(reason);
        match n_close {
            0 => writeln!(out, "{n:>6} {words}")?,
            _ => writeln!(
                out,
                "{n:>6} {words}; {n_close} of them close (margin under {CLOSE})"
            )?,
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade::cpg::{Cell, Fact};

    #[test]
    fn each_reason_has_a_line_with_its_number_and_that_of_close_decisions() {
        let mut graph = CellPortalGraph::default();
        for backs in [0.0, 0.59, 0.58] {
            graph.cells.push(Cell {
                why: vec![
                    Why::given(Reason::Unscaled),
                    Why::compared(Reason::Facing, 0.6, &[(Fact::Backs, backs)]),
                ],
                ..Cell::default()
            });
        }
        let mut out = Vec::new();
        write_reasons(&mut out, &graph).unwrap();
        let text = String::from_utf8(out).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 2, "{text}");
        assert!(lines[0].starts_with("     3 a room") && !lines[0].contains("close"));
        assert!(
            lines[1].ends_with("2 of them close (margin under 0.1)"),
            "{text}"
        );
    }
}

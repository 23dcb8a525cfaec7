//! Visibility between rooms, as a square with a row and a column for each room.

use std::fmt::Write;

use enfilade_cpg::{CellId, Pvs, World};

use crate::label::shortened;
use crate::storeys::Storey;
use crate::svg::escaped;

/// Most rooms of a matrix; larger worlds show the largest rooms.
const MAX_ROOMS: usize = 200;
/// Side of a square. [Units: pixels]
const SIDE: usize = 11;
/// Space for the numbers beside and above the squares. [Units: pixels]
const HEAD: usize = 30;

/// The rooms of a matrix, grouped by storey, each only once.
pub(crate) struct Order {
    /// Ascending within a storey.
    pub(crate) cells: Vec<CellId>,
    /// Rows at which another storey begins.
    pub(crate) starts: Vec<usize>,
}

impl Order {
    /// Lists all cells that `visible` covers and `is_shown` accepts, the outdoors last.
    pub(crate) fn new(
        world: &World,
        storeys: &[&Storey],
        visible: &Pvs,
        is_shown: impl Fn(CellId) -> bool,
    ) -> Self {
        let known = visible.n_cells().min(world.graph.cells.len()) as u32;
        let mut largest: Vec<CellId> = (0..known).map(CellId).filter(|&c| is_shown(c)).collect();
        let volume = |c: CellId| world.graph[c].volume;
        largest.sort_by(|&a, &b| volume(b).total_cmp(&volume(a)).then(a.cmp(&b)));
        largest.truncate(MAX_ROOMS);
        let storey = |c: &CellId| {
            let found = storeys.iter().position(|s| s.cells.contains(c));
            found.unwrap_or(storeys.len())
        };
        let mut numbered: Vec<(usize, CellId)> = largest.iter().map(|c| (storey(c), *c)).collect();
        numbered.sort_unstable();
        let starts = (1..numbered.len()).filter(|&i| numbered[i].0 != numbered[i - 1].0);
        Self {
            starts: starts.collect(),
            cells: numbered.into_iter().map(|c| c.1).collect(),
        }
    }
}

/// Draws the matrix as an `svg` element.
pub(crate) fn matrix_svg(world: &World, visible: &Pvs, order: &Order) -> String {
    let n = order.cells.len();
    let (side, size) = (SIDE, n * SIDE);
    let mut out = format!(
        "<svg class=\"matrix\" xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{0}\" viewBox=\"-{HEAD} -{HEAD} {0} {0}\" \
         font-family=\"sans-serif\" font-size=\"11\" role=\"img\" aria-label=\"visibility matrix\" style=\"min-width:{0}px;max-width:{1}px\">\n\
         <rect width=\"{size}\" height=\"{size}\" fill=\"#f1f1ee\"/><path fill=\"#1c3d5a\" d=\"",
        size + HEAD + 4,
        2 * (size + HEAD + 4)
    );
    for (y, &from) in order.cells.iter().enumerate() {
        let sees = |x: usize| visible.sees(from, order.cells[x]);
        let mut x = 0;
        while x < n {
            let start = x;
            while x < n && sees(x) {
                x += 1;
            }
            if x > start {
                let (left, top, wide) = (start * side, y * side, (x - start) * side);
                let _ = write!(out, "M{left} {top}h{wide}v{side}h-{wide}z");
            }
            x += 1;
        }
    }
    out.push_str("\"/>\n<path stroke=\"#fff\" stroke-width=\".5\" d=\"");
    for k in 0..=n {
        let _ = write!(out, "M0 {0}H{size}M{0} 0V{size}", k * side);
    }
    out.push_str("\"/><path stroke=\"#e8590c\" stroke-width=\"1.5\" d=\"");
    for k in &order.starts {
        let _ = write!(out, "M-{HEAD} {0}H{size}M{0} -{HEAD}V{size}", k * side);
    }
    out.push_str("\"/>\n");
    for (k, &cell) in order.cells.iter().enumerate() {
        let label = if world.graph[cell].outdoor {
            "out".to_owned()
        } else {
            cell.0.to_string()
        };
        let name = escaped(&shortened(&world.graph[cell].name));
        let (near, base) = (k * side, k * side + side - 2);
        let _ = writeln!(
            out,
            "<g data-cell=\"{id}\"><rect class=\"band\" x=\"-{HEAD}\" y=\"{near}\" width=\"{}\" height=\"{side}\"/>\
             <text x=\"-3\" y=\"{base}\" text-anchor=\"end\">{label}</text>\
             <text transform=\"translate({base} -3) rotate(-90)\">{label}</text><title>{name}</title></g>",
            size + HEAD,
            id = cell.0,
        );
    }
    out.push_str("</svg>\n");
    out
}

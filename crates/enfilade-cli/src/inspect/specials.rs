//! Mirrors, monitors and links, as `inspect` shows them.

use std::io::{self, Write};

use enfilade::cpg::{CellPortalGraph, SpecialId, Way};
use enfilade::geom::shown;
use serde::Serialize;

use crate::specials::{described, middle};

/// A special portal.
#[derive(Serialize)]
pub(super) struct SpecialReport<'a> {
    id: u32,
    name: &'a str,
    cell: u32,
    /// Absent for a part of a wall.
    #[serde(skip_serializing_if = "Option::is_none")]
    portal: Option<u32>,
    middle: [f64; 3],
    /// Out of the cell.
    normal: [f64; 3],
    area: f64,
    passes: Vec<PassReport>,
}

#[derive(Serialize)]
struct PassReport {
    way: &'static str,
    tint: [f32; 4],
    #[serde(skip_serializing_if = "Option::is_none")]
    to: Option<u32>,
    /// As a glTF matrix.
    #[serde(skip_serializing_if = "Option::is_none")]
    matrix: Option<[f64; 16]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    back: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    camera: Option<CameraReport>,
}

#[derive(Serialize)]
struct CameraReport {
    eye: [f32; 3],
    toward: [f32; 3],
    up: [f32; 3],
    fov_degrees: f32,
}

impl<'a> SpecialReport<'a> {
    pub(super) fn of(graph: &'a CellPortalGraph, special: SpecialId) -> Self {
        let side = &graph.specials[special.idx()];
        let (normal, pieces) = graph.special_opening(special);
        let passes = side.passes.iter().map(|pass| {
            let plain = |way| PassReport {
                way,
                tint: pass.tint,
                to: None,
                matrix: None,
                back: None,
                camera: None,
            };
            match &pass.way {
                Way::Through => plain("through"),
                Way::Mirror => plain("mirror"),
                Way::Lead { to, map, back } => PassReport {
                    to: Some(to.0),
                    matrix: Some(map.matrix().to_cols_array()),
                    back: back.map(|b| b.0),
                    ..plain("lead")
                },
                Way::Monitor(camera) => PassReport {
                    camera: Some(CameraReport {
                        eye: camera.eye,
                        toward: camera.toward,
                        up: camera.up,
                        fov_degrees: camera.fov_y.to_degrees(),
                    }),
                    ..plain("monitor")
                },
            }
        });
        Self {
            id: special.0,
            name: &side.name,
            cell: side.cell.0,
            portal: side.portal().map(|p| p.0),
            middle: middle(graph, special).into(),
            normal: normal.into(),
            area: pieces.iter().map(enfilade::geom::Winding::area).sum(),
            passes: passes.collect(),
        }
    }
}

/// Lists the special portals, if any.
pub(super) fn write(out: &mut impl Write, graph: &CellPortalGraph) -> io::Result<()> {
    if graph.specials.is_empty() {
        return Ok(());
    }
    for id in graph.special_ids() {
        let name = &graph.specials[id.idx()].name;
        let name = if name.is_empty() {
            String::new()
        } else {
            format!(" \"{}\"", shown(name))
        };
        // A string, so that it is padded to the column.
        let number = id.to_string();
        writeln!(out, "{number:>12}{name}  {}", described(graph, id))?;
    }
    writeln!(out)
}

//! Rooms for other trades: their surfaces as arrays, and files.

use enfilade_export::{
    Behind, IfcOptions, SurfaceCover, SurfaceLevel, SurfaceOptions, gbxml, hbjson, ifc_with_spaces,
    indoor_gml, room_surfaces,
};
use numpy::PyArray2;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::arrays::table;
use crate::world::World;

/// Loops, normal, area, what lies behind, its cell, thickness, the surface that answers, the surface around, portal, name of the object.
type SurfaceRow<'py> = (
    Vec<Bound<'py, PyArray2<f64>>>,
    [f64; 3],
    f64,
    &'static str,
    Option<u32>,
    f64,
    [Option<usize>; 2],
    Option<u32>,
    Option<String>,
);

/// Numbers of spaces that were added, replaced and kept, of boundaries, and of surfaces without an element.
type Counts = (usize, usize, usize, usize, usize);

#[pymethods]
impl World {
    /// Returns the surfaces of all rooms, by cell.
    fn surfaces<'py>(
        &self,
        py: Python<'py>,
        is_first: bool,
    ) -> PyResult<Vec<(u32, Vec<SurfaceRow<'py>>)>> {
        let options = SurfaceOptions {
            level: level(is_first),
            ..SurfaceOptions::default()
        };
        let rooms = py.detach(|| room_surfaces(&self.world, &options));
        let graph = &self.world.graph;
        let mut out = Vec::new();
        for room in rooms.iter().filter(|r| graph[r.cell].is_room()) {
            let mut rows = Vec::new();
            for surface in &room.surfaces {
                let loops = surface.loops.iter().map(|ring| table(py, ring.clone()));
                let (behind, cell) = match surface.behind {
                    Behind::Cell(cell) if graph[cell].outdoor => ("outdoors", Some(cell.0)),
                    Behind::Cell(cell) => ("room", Some(cell.0)),
                    Behind::Ground => ("ground", None),
                    Behind::Matter => ("matter", None),
                };
                let object = match surface.cover {
                    SurfaceCover::Object { source, .. } => self.named_above(source),
                    SurfaceCover::Opening(_) | SurfaceCover::Bare => None,
                };
                rows.push((
                    loops.collect::<PyResult<_>>()?,
                    surface.normal,
                    surface.area,
                    behind,
                    cell,
                    surface.thickness,
                    [surface.pair, surface.host],
                    surface.opening().map(|p| p.0),
                    object,
                ));
            }
            out.push((room.cell.0, rows));
        }
        Ok(out)
    }

    /// Returns an IFC file with the rooms as spaces, and what was written.
    fn ifc<'py>(
        &self,
        py: Python<'py>,
        model: &[u8],
        replaces_spaces: bool,
        is_first: bool,
    ) -> PyResult<(Bound<'py, PyBytes>, Counts)> {
        let options = IfcOptions {
            replaces_spaces,
            level: level(is_first),
        };
        let written = py.detach(|| ifc_with_spaces(&self.world, model, &options));
        let written = written.map_err(|e| PyValueError::new_err(format!("the model: {e}")))?;
        let counts = (
            written.n_added,
            written.n_replaced,
            written.n_kept,
            written.n_boundaries,
            written.n_without_element,
        );
        Ok((PyBytes::new(py, &written.bytes), counts))
    }

    /// Returns the rooms as gbXML.
    fn gbxml(&self, py: Python<'_>) -> String {
        py.detach(|| gbxml(&self.world))
    }

    /// Returns the rooms as a Honeybee model.
    fn hbjson(&self, py: Python<'_>) -> String {
        py.detach(|| hbjson(&self.world).text)
    }

    /// Returns the rooms as IndoorGML.
    fn indoor_gml(&self, py: Python<'_>) -> String {
        py.detach(|| indoor_gml(&self.world))
    }
}

impl World {
    /// Returns the name of an object, or of the nearest above it that has one.
    fn named_above(&self, source: Option<u32>) -> Option<String> {
        let mut at = source;
        while let Some(node) = at.and_then(|i| self.world.sources.get(i as usize)) {
            if !node.name.is_empty() {
                return Some(node.name.clone());
            }
            at = node.parent;
        }
        None
    }
}

fn level(is_first: bool) -> SurfaceLevel {
    if is_first {
        SurfaceLevel::First
    } else {
        SurfaceLevel::Second
    }
}

//! Walks from point to point.

use std::sync::Arc;

use enfilade::geom::DVec3;
use enfilade::internals::world::{AskedWalk, WalkWords};
use enfilade::world::{Agent, PartId, Path, WalkMap};
use numpy::PyArray2;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::table;
use crate::errors::NoPathError;
use crate::world::{KeptMap, World};

/// The names of the parameters.
const WORDS: WalkWords<'_> = WalkWords {
    ends: ["start", "end"],
    step: "step",
    height: "height",
    radius: "radius",
    no_objects: "objects=False",
};

/// Length, length in plan, cells, portals, and the points where it bends.
type PathArrays<'py> = (f64, f64, Vec<u32>, Vec<u32>, Bound<'py, PyArray2<f64>>);

impl World {
    /// Returns the floors of a walker: those of the last one again.
    fn map(&self, walker: Agent, objects: bool) -> PyResult<Arc<WalkMap>> {
        let space = self.space()?;
        // A panic while it was held left the last map, which is whole.
        let mut kept = self
            .map
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        let fits = |k: &&KeptMap| k.walker == walker && k.objects == objects;
        if let Some(kept) = kept.as_ref().filter(fits) {
            return Ok(Arc::clone(&kept.map));
        }
        let map = Arc::new(WalkMap::with_objects(space, walker, |_, _| objects));
        *kept = Some(KeptMap {
            walker,
            objects,
            map: Arc::clone(&map),
        });
        Ok(map)
    }
}

#[pymethods]
impl World {
    /// Returns the walk from one point to another.
    fn path<'py>(
        &self,
        py: Python<'py>,
        ends: [[f64; 3]; 2],
        radius: f64,
        height: f64,
        step: f64,
        closed: Vec<i64>,
        objects: bool,
    ) -> PyResult<PathArrays<'py>> {
        for (name, value) in [("radius", radius), ("height", height)] {
            if !(value > 0.0 && value < 100.0) {
                let text = format!("{name} is {value}: a length above 0 and below 100 is needed");
                return Err(PyValueError::new_err(text));
            }
        }
        if !(0.0..100.0).contains(&step) {
            let text = format!("step is {step}: a length of at least 0 is needed");
            return Err(PyValueError::new_err(text));
        }
        let closed = self.portals_of(&closed)?;
        let walker = Agent {
            radius,
            height,
            step,
            ..Agent::default()
        };
        let mut path = Path::default();
        let start = py.detach(|| {
            let map = self.map(walker, objects)?;
            let space = self.space()?;
            let asked = AskedWalk {
                space,
                map: &map,
                walker,
                has_objects: objects,
                ends: ends.map(DVec3::from_array),
                closed: &closed,
                // Programs ask for many walks, and each other walker takes a map of its own.
                has_others: false,
                words: WORDS,
            };
            asked.find(&mut path).map_err(NoPathError::new_err)?;
            let first = path.points[0].at + DVec3::Y * 0.5 * height;
            PyResult::Ok(space.layout(PartId::ROOT).locate(first))
        })?;
        let cells = path.portals.iter().map(|p| p.exit.to);
        let points = path.points.iter().map(|p| p.at.to_array());
        Ok((
            path.length,
            path.length_in_plan,
            start.into_iter().chain(cells).map(|c| c.0).collect(),
            path.portals.iter().map(|p| p.exit.portal.0).collect(),
            table(py, points)?,
        ))
    }
}

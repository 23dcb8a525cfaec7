//! Views: what is seen from an eye.

use enfilade::runtime::{DrawList, SightState, View, Viewer};
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::table;
use crate::world::World;

/// The cell of the eye, cells and portals from near to far, batches, details, draws, and numbers of triangles: of
/// what is seen and of the world.
type SeenArrays<'py> = (
    Option<u32>,
    Bound<'py, PyArray1<i32>>,
    Bound<'py, PyArray1<i32>>,
    Bound<'py, PyArray1<i32>>,
    Bound<'py, PyArray1<i32>>,
    Bound<'py, PyArray2<i64>>,
    [u64; 2],
);

#[pymethods]
impl World {
    /// Returns what a view sees.
    #[pyo3(signature = (eye, toward, up, fov, aspect, far, closed))]
    fn see<'py>(
        &self,
        py: Python<'py>,
        eye: [f32; 3],
        toward: [f32; 3],
        up: [f32; 3],
        fov: f32,
        aspect: f32,
        far: Option<f32>,
        closed: Vec<i64>,
    ) -> PyResult<SeenArrays<'py>> {
        let bad = |e: &dyn std::fmt::Display| PyValueError::new_err(e.to_string());
        let view = View::perspective(eye, toward, up, fov, aspect);
        let mut view = view.map_err(|e| bad(&e))?;
        if let Some(far) = far {
            view = view.with_far(far).map_err(|e| bad(&e))?;
        }
        let closed = self.portals_of(&closed)?;
        let sight = py.detach(|| self.sight())?;
        let mut list = DrawList::new();
        let seen = py.detach(|| {
            let mut state = SightState::new(sight);
            for portal in closed {
                state.close(portal);
            }
            let mut viewer = Viewer::new(sight);
            let seen = viewer.see(sight, &state, &view);
            list.fill(sight, &seen);
            let mut batches: Vec<i32> = (seen.chunks().iter())
                .map(|c| sight.chunks()[c.0 as usize].batch as i32)
                .collect();
            batches.sort_unstable();
            batches.dedup();
            (
                seen.cells().iter().map(|c| c.0 as i32).collect::<Vec<_>>(),
                seen.portals()
                    .iter()
                    .map(|p| p.0 as i32)
                    .collect::<Vec<_>>(),
                batches,
                seen.details()
                    .iter()
                    .map(|d| d.0 as i32)
                    .collect::<Vec<_>>(),
                seen.n_triangles(),
            )
        });
        let (cells, portals, batches, details, n_triangles) = seen;
        let draws = list.draws().iter();
        let draws = draws.map(|d| [d.batch, d.first_index, d.n_indices].map(i64::from));
        Ok((
            sight.locate(eye).map(|c| c.0),
            PyArray1::from_vec(py, cells),
            PyArray1::from_vec(py, portals),
            PyArray1::from_vec(py, batches),
            PyArray1::from_vec(py, details),
            table(py, draws)?,
            [n_triangles, sight.n_triangles()],
        ))
    }
}

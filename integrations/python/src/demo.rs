//! The house of `enfilade demo`, as arrays.

use enfilade::geom::scene::Role;
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::arrays::table;

/// Name, vertices, faces, `true` if it is detail.
type DemoMesh<'py> = (
    String,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<u32>>,
    bool,
);

/// Returns the meshes of the house where they stand.
#[pyfunction]
pub(crate) fn demo_meshes(py: Python<'_>) -> PyResult<Vec<DemoMesh<'_>>> {
    let scene = enfilade_demo::furnished_house().scene;
    let mut meshes = Vec::new();
    for object in &scene.objects {
        for primitive in &scene.meshes[object.mesh as usize].primitives {
            let place = |p: &[f32; 3]| {
                let p = enfilade::geom::DVec3::from_array(p.map(f64::from));
                object.transform.transform_point3(p).to_array()
            };
            meshes.push((
                object.name.clone(),
                table(py, primitive.positions.iter().map(place))?,
                table(py, primitive.triples().iter().copied())?,
                object.role == Role::Detail,
            ));
        }
    }
    Ok(meshes)
}

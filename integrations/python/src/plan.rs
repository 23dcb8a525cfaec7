//! Floor plans, as SVG and as shapes for other means of drawing.

use enfilade_report::{PlanOptions, Plans};
use numpy::PyArray2;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::table;
use crate::world::World;

/// Class, color and opacity of the inside, color and width (cm) of lines, the lines, `true` if they are closed, cell.
type ShapeArrays<'py> = (
    &'static str,
    Option<([u8; 3], f32)>,
    Option<([u8; 3], f64)>,
    Vec<Bound<'py, PyArray2<f64>>>,
    bool,
    Option<u32>,
);
/// Point, height of letters, `true` if read from bottom to top, text, cell.
type Label = ([f64; 2], f64, bool, String, Option<u32>);

#[pymethods]
impl World {
    /// Returns the plans of the storeys with a name, all if none is given, as SVG.
    fn plan_svg(&self, py: Python<'_>, storey: Option<&str>, height: f64) -> PyResult<String> {
        py.detach(|| {
            let plans = self.plans(height)?;
            Ok(plans.sheet(&chosen(&plans, storey)?).to_svg())
        })
    }

    /// Returns the storeys: name, height of the floor, cells.
    fn storeys(&self, py: Python<'_>) -> Vec<(String, f64, Vec<u32>)> {
        let storeys = py.detach(|| enfilade_report::find_storeys(&self.world));
        let storeys = storeys.into_iter();
        storeys
            .map(|s| (s.name, s.floor, s.cells.iter().map(|c| c.0).collect()))
            .collect()
    }

    /// Returns the shapes and labels of the plan of a storey, of the first if none is given.
    fn plan_shapes<'py>(
        &self,
        py: Python<'py>,
        storey: Option<&str>,
        height: f64,
    ) -> PyResult<(Vec<ShapeArrays<'py>>, Vec<Label>)> {
        let sheet = py.detach(|| {
            let plans = self.plans(height)?;
            let which = match storey {
                Some(_) => chosen(&plans, storey)?,
                None => (0..plans.storeys().len()).take(1).collect(),
            };
            PyResult::Ok(plans.sheet(&which))
        })?;
        let mut shapes = Vec::new();
        for shape in sheet.shapes() {
            let lines = shape.lines.into_iter();
            let lines = lines.map(|line| table(py, line));
            shapes.push((
                shape.class,
                shape.fill,
                shape.stroke,
                lines.collect::<PyResult<_>>()?,
                shape.is_closed,
                shape.cell.map(|c| c.0),
            ));
        }
        let labels = sheet.labels();
        let labels = labels.map(|l| (l.at, l.size, l.is_turned, l.text, l.cell.map(|c| c.0)));
        Ok((shapes, labels.collect()))
    }
}

impl World {
    fn plans(&self, height: f64) -> PyResult<Plans<'_>> {
        if !(height > 0.0 && height < 100.0) {
            let text = format!("height is {height}: a length above 0 and below 100 is needed");
            return Err(PyValueError::new_err(text));
        }
        let options = PlanOptions {
            cut_height: height,
            ..PlanOptions::default()
        };
        Ok(Plans::new(&self.world, &options))
    }
}

/// Returns the plans of a storey or room by name; all if none is given.
fn chosen(plans: &Plans<'_>, storey: Option<&str>) -> PyResult<Vec<usize>> {
    let Some(name) = storey else {
        return Ok((0..plans.storeys().len()).collect());
    };
    let found = plans.find(name);
    if found.is_empty() {
        let names: Vec<&str> = plans.storeys().map(|s| s.name.as_str()).collect();
        let text = format!(
            "no storey and no room is called '{name}'; the storeys are {}",
            names.join(", ")
        );
        return Err(PyValueError::new_err(text));
    }
    Ok(found)
}

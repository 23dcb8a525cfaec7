//! Arrays of numpy as lists of rows, checked row by row.
//!
//! The package hands over arrays of three columns in one of the types below; what does not fit is named with its row.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Rows of three numbers.
#[derive(FromPyObject)]
pub(crate) enum Points<'py> {
    Single(PyReadonlyArray2<'py, f32>),
    Double(PyReadonlyArray2<'py, f64>),
}

impl Points<'_> {
    /// Returns the rows, all finite.
    pub(crate) fn rows(&self, name: &str) -> PyResult<Vec<[f64; 3]>> {
        let rows = match self {
            Self::Single(a) => rows(a.shape(), a.as_slice()?, f64::from),
            Self::Double(a) => rows(a.shape(), a.as_slice()?, |c| c),
        };
        let rows = rows.ok_or_else(|| bad_shape(name))?;
        let is_bad = |p: &[f64; 3]| p.iter().any(|c| !c.is_finite());
        if let Some(row) = rows.iter().position(is_bad) {
            let text = format!(
                "{name}[{row}] is {:?}: coordinates must be finite numbers",
                rows[row]
            );
            return Err(PyValueError::new_err(text));
        }
        Ok(rows)
    }
}

/// Rows of three indices.
#[derive(FromPyObject)]
pub(crate) enum Faces<'py> {
    I32(PyReadonlyArray2<'py, i32>),
    U32(PyReadonlyArray2<'py, u32>),
    I64(PyReadonlyArray2<'py, i64>),
    U64(PyReadonlyArray2<'py, u64>),
}

impl Faces<'_> {
    /// Returns the rows, all indices below `n`.
    pub(crate) fn rows(&self, name: &str, n: usize) -> PyResult<Vec<[u32; 3]>> {
        match self {
            Self::I32(a) => indices(name, a.shape(), a.as_slice()?, n),
            Self::U32(a) => indices(name, a.shape(), a.as_slice()?, n),
            Self::I64(a) => indices(name, a.shape(), a.as_slice()?, n),
            Self::U64(a) => indices(name, a.shape(), a.as_slice()?, n),
        }
    }
}

fn indices<T: Copy + TryInto<u32> + std::fmt::Display>(
    name: &str,
    shape: &[usize],
    values: &[T],
    n: usize,
) -> PyResult<Vec<[u32; 3]>> {
    let checked = |c: T| {
        c.try_into()
            .ok()
            .filter(|&i| (i as usize) < n)
            .unwrap_or(u32::MAX)
    };
    let rows = rows(shape, values, checked).ok_or_else(|| bad_shape(name))?;
    if let Some(row) = rows.iter().position(|t: &[u32; 3]| t.contains(&u32::MAX)) {
        let [a, b, c] = [0, 1, 2].map(|k| values[3 * row + k]);
        let text = match n {
            0 => format!("{name}[{row}] is [{a}, {b}, {c}], but there are no vertices"),
            _ => format!(
                "{name}[{row}] is [{a}, {b}, {c}]: indices of vertices must be from 0 to {}",
                n - 1
            ),
        };
        return Err(PyValueError::new_err(text));
    }
    Ok(rows)
}

fn rows<T: Copy, U>(shape: &[usize], values: &[T], of: impl Fn(T) -> U) -> Option<Vec<[U; 3]>> {
    let (rows, []) = values.as_chunks::<3>() else {
        return None;
    };
    (shape.get(1) == Some(&3)).then(|| rows.iter().map(|row| row.map(&of)).collect())
}

fn bad_shape(name: &str) -> PyErr {
    PyValueError::new_err(format!("{name}: expected three columns"))
}

/// Returns rows as one array.
pub(crate) fn table<'py, T: numpy::Element, const N: usize>(
    py: Python<'py>,
    rows: impl IntoIterator<Item = [T; N]>,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let all: Vec<T> = rows.into_iter().flatten().collect();
    let n = all.len() / N;
    PyArray1::from_vec(py, all).reshape([n, N])
}

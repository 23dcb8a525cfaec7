//! A raster of heights, whatever file it comes from.

use crate::SourceError;

/// A raster of heights.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightMap {
    /// Samples from west to east, and from north to south.
    pub dims: [usize; 2],
    /// The samples, `[south][east]`; NaN where there is none.
    pub samples: Vec<f32>,
    /// Greatest gray, where samples are grays; `None` for heights.
    pub white: Option<f64>,
    /// Distance between samples to the east and to the south, if the file tells it. [Units: wu]
    pub cell: Option<[f64; 2]>,
    /// East and north of the first sample, if the file tells them. [Units: wu]
    pub place: Option<[f64; 2]>,
}

pub(super) fn error(place: &str, problem: impl Into<String>) -> SourceError {
    SourceError::new(place, problem)
}

/// Checks the numbers of samples to the east and to the south.
pub(super) fn checked([nx, nz]: [u32; 2], most: u64) -> Result<[usize; 2], SourceError> {
    let n = u64::from(nx) * u64::from(nz);
    if n > most {
        let problem = format!(
            "{nx} × {nz} samples, more than the {most} allowed; cut the map or make it coarser"
        );
        return Err(error("size", problem));
    }
    if nx < 2 || nz < 2 {
        return Err(error(
            "size",
            format!("{nx} × {nz} samples; land needs two by two"),
        ));
    }
    Ok([nx as usize, nz as usize])
}

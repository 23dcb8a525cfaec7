//! Free-form surfaces in JSON; `docs/sources.md` explains it.

use enfilade_geom::{DVec2, DVec3};
use serde_json::{Map, Value};

use super::curves::{FreeformCurve, TrimCurve};
use super::patch::FreeformSurface;
use super::spline::SplineBasis;
use crate::implicit::unit;
use crate::json::{is_json_of, known_keys};
use crate::{SourceError, SourceLimits};

/// A scene of patches. [Units: those of its file]
#[derive(Clone, Debug)]
pub struct FreeformScene {
    /// Patches in the order of the file.
    pub patches: Vec<FreeformPatch>,
    /// Meters per unit, if the file says so.
    pub unit: Option<f64>,
}

/// A patch with its name.
#[derive(Clone, Debug)]
pub struct FreeformPatch {
    /// Patches of one name are one object; empty if it has none.
    pub name: String,
    /// The surface.
    pub surface: FreeformSurface,
}

impl FreeformScene {
    /// Returns `true` if a file looks like a scene of patches.
    #[must_use]
    pub fn is_one(bytes: &[u8]) -> bool {
        is_json_of(bytes, "patches")
    }

    /// Parses a scene.
    ///
    /// # Errors
    ///
    /// If it is not JSON of the format, or exceeds a limit; the error names the place.
    pub fn parse(bytes: &[u8], limits: &SourceLimits) -> Result<Self, SourceError> {
        let value: Value = serde_json::from_slice(bytes).map_err(|e| {
            let place = format!("line {}", e.line());
            SourceError::new(place, format!("not JSON: {e}"))
        })?;
        let scene = object(&value, "scene")?;
        known_keys(scene, "scene", &["enfilade", "unit", "patches"])?;
        let given = list(scene.get("patches"), "patches")?;
        if given.len() as u64 > limits.max_nodes {
            let problem = format!(
                "{} patches; at most {} are read",
                given.len(),
                limits.max_nodes
            );
            return Err(SourceError::new("patches", problem));
        }
        let patches = given.iter().enumerate().map(|(k, v)| patch(v, k + 1));
        Ok(Self {
            patches: patches.collect::<Result<_, _>>()?,
            unit: scene.get("unit").map(unit).transpose()?,
        })
    }
}

fn patch(value: &Value, number: usize) -> Result<FreeformPatch, SourceError> {
    let place = format!("patch {number}");
    let map = object(value, &place)?;
    let keys = ["name", "degrees", "points", "knots", "trim", "holes"];
    known_keys(map, &place, &keys)?;
    let name = map.get("name").and_then(Value::as_str).unwrap_or("");
    let degrees = list(map.get("degrees"), &format!("{place}, degrees"))?;
    let [p, q] = degrees else {
        return Err(SourceError::new(place, "needs two \"degrees\""));
    };
    let [p, q] = [degree(p, &place)?, degree(q, &place)?];
    let rows = list(map.get("points"), &format!("{place}, points"))?;
    let mut controls = Vec::new();
    let mut n_columns = None;
    for (k, row) in rows.iter().enumerate() {
        let place = format!("{place}, row {} of points", k + 1);
        let row = list(Some(row), &place)?;
        if *n_columns.get_or_insert(row.len()) != row.len() {
            return Err(SourceError::new(
                place,
                "has not as many points as the first",
            ));
        }
        for (i, point) in row.iter().enumerate() {
            let place = format!("{place}, point {}", i + 1);
            let ([x, y, z], w) = weighted(point, &place)?;
            controls.push((DVec3::new(x, y, z), w));
        }
    }
    let counts = [n_columns.unwrap_or(0), rows.len()];
    let knots = match map.get("knots") {
        None => [None, None],
        Some(given) => match list(Some(given), &format!("{place}, knots"))? {
            [u, v] => {
                let along =
                    |knots, name: &str| list(Some(knots), &format!("{place}, knots {name}"));
                [Some(along(u, "along u")?), Some(along(v, "along v")?)]
            }
            _ => return Err(SourceError::new(place, "needs two lists of \"knots\"")),
        },
    };
    let basis = |a: usize, degree| basis(degree, counts[a], knots[a], &place);
    let bases = [basis(0, p)?, basis(1, q)?];
    let range = bases.each_ref().map(SplineBasis::range);
    let mut surface = FreeformSurface {
        place: place.clone(),
        bases,
        controls,
        range,
        loops: Vec::new(),
    };
    let kept = loops(map.get("trim"), &format!("{place}, trim"))?;
    let holes = loops(map.get("holes"), &format!("{place}, holes"))?;
    surface.trim(kept, holes);
    Ok(FreeformPatch {
        name: name.to_owned(),
        surface,
    })
}

fn loops(value: Option<&Value>, place: &str) -> Result<Vec<Vec<TrimCurve>>, SourceError> {
    let Some(value) = value else {
        return Ok(Vec::new());
    };
    let mut loops = Vec::new();
    for (k, curves) in list(Some(value), place)?.iter().enumerate() {
        let mut all = Vec::new();
        for (i, value) in list(Some(curves), &format!("{place}, loop {}", k + 1))?
            .iter()
            .enumerate()
        {
            all.push(curve(
                value,
                &format!("{place}, loop {}, curve {}", k + 1, i + 1),
            )?);
        }
        loops.push(all);
    }
    Ok(loops)
}

fn curve(value: &Value, place: &str) -> Result<TrimCurve, SourceError> {
    let map = object(value, place)?;
    known_keys(map, place, &["degree", "points", "knots"])?;
    let degree = match map.get("degree") {
        None => 1,
        Some(value) => degree(value, place)?,
    };
    let mut controls = Vec::new();
    for (k, point) in list(map.get("points"), place)?.iter().enumerate() {
        let ([u, v], w) = weighted(point, &format!("{place}, point {}", k + 1))?;
        controls.push((DVec2::new(u, v), w));
    }
    let knots = match map.get("knots") {
        None => None,
        Some(knots) => Some(list(Some(knots), place)?),
    };
    let basis = basis(degree, controls.len(), knots, place)?;
    Ok(TrimCurve::whole(FreeformCurve { basis, controls }))
}

/// Returns degree and knots that a spline of so many control points may have.
fn basis(
    degree: usize,
    n_controls: usize,
    knots: Option<&[Value]>,
    place: &str,
) -> Result<SplineBasis, SourceError> {
    let basis = match knots {
        None => SplineBasis::clamped(degree, n_controls),
        Some(knots) => {
            let number = |k: &Value| k.as_f64();
            let Some(knots) = knots.iter().map(number).collect::<Option<Vec<f64>>>() else {
                return Err(SourceError::new(place, "knots must be numbers"));
            };
            SplineBasis { degree, knots }
        }
    };
    match n_controls > degree {
        true => basis
            .checked()
            .map_err(|problem| SourceError::new(place, problem)),
        false => {
            let problem = format!(
                "degree {degree} needs {} points or more; there are {n_controls}",
                degree + 1
            );
            Err(SourceError::new(place, problem))
        }
    }
}

fn object<'v>(value: &'v Value, place: &str) -> Result<&'v Map<String, Value>, SourceError> {
    let object = value.as_object();
    object.ok_or_else(|| SourceError::new(place, "must be an object in braces"))
}

fn list<'v>(value: Option<&'v Value>, place: &str) -> Result<&'v [Value], SourceError> {
    let list = value.and_then(Value::as_array);
    list.map(Vec::as_slice)
        .ok_or_else(|| SourceError::new(place, "must be a list in brackets"))
}

fn degree(value: &Value, place: &str) -> Result<usize, SourceError> {
    let degree = value.as_u64().and_then(|d| usize::try_from(d).ok());
    degree
        .filter(|d| (1..=SplineBasis::MAX_DEGREE).contains(d))
        .ok_or_else(|| {
            let problem = format!(
                "degrees are whole numbers from 1 to {}",
                SplineBasis::MAX_DEGREE
            );
            SourceError::new(place, problem)
        })
}

/// Returns the coordinates of a point, and its weight: 1 if it has none.
fn weighted<const N: usize>(value: &Value, place: &str) -> Result<([f64; N], f64), SourceError> {
    let numbers = value.as_array().and_then(|all| {
        let numbers = all.iter().map(Value::as_f64);
        numbers.collect::<Option<Vec<f64>>>()
    });
    match numbers {
        Some(n) if n.len() == N || n.len() == N + 1 => Ok((
            std::array::from_fn(|k| n[k]),
            n.get(N).copied().unwrap_or(1.0),
        )),
        _ => {
            let problem = format!(
                "must be a list of {N} numbers, or {} with its weight",
                N + 1
            );
            Err(SourceError::new(place, problem))
        }
    }
}

//! The language of implicit scenes, in JSON.

use std::sync::Arc;

use enfilade_geom::{Aabb, DMat3, DVec3};
use serde_json::{Map, Value};

use super::shape::Shape;
use crate::{SourceError, SourceLimits, known_keys, shortened};

/// Largest coordinate or length: beyond, numbers are no longer exact to a thousandth.
const MAX_LENGTH: f64 = 1e9;
/// Sides of a scene with the default step; more would exceed the memory of small machines at any step.
const MAX_STEPS: f64 = 65_536.0;

/// A scene as read.
pub(super) struct Read {
    /// Matter inside.
    pub(super) matter: Arc<Shape>,
    pub(super) bounds: Aabb,
    pub(super) step: Option<f64>,
    pub(super) is_outside_matter: bool,
    /// Least length given for any shape.
    pub(super) thinnest: f64,
    pub(super) unit: Option<f64>,
}

pub(super) fn scene(bytes: &[u8], limits: &SourceLimits) -> Result<Read, SourceError> {
    let value: Value = serde_json::from_slice(bytes).map_err(|e| {
        let place = format!("line {}", e.line());
        SourceError::new(place, format!("not JSON: {e}"))
    })?;
    let Some(map) = value.as_object() else {
        return Err(SourceError::new("scene", "must be an object in braces"));
    };
    known_keys(
        map,
        "scene",
        &[
            "enfilade", "unit", "box", "step", "outside", "matter", "air",
        ],
    )?;
    let mut reader = Reader {
        limits,
        n_nodes: 0,
        thinnest: f64::INFINITY,
    };
    let (shape, is_air) = match (map.get("matter"), map.get("air")) {
        (Some(matter), None) => (reader.node(matter, "matter", 0)?, false),
        (None, Some(air)) => (reader.node(air, "air", 0)?, true),
        _ => {
            let problem = "needs either \"matter\" or \"air\", the shape of one of them";
            return Err(SourceError::new("scene", problem));
        }
    };
    let is_outside_matter = match map.get("outside").map(Value::as_str) {
        None => is_air,
        Some(Some("matter")) => true,
        Some(Some("air")) => false,
        Some(_) => {
            let problem = "must be \"matter\" or \"air\"";
            return Err(SourceError::new("outside", problem));
        }
    };
    let bounds = match map.get("box") {
        Some(given) => points_box(given, "box")?,
        None => shape.bounds(),
    };
    if !(bounds.min.is_finite() && bounds.max.is_finite()) {
        let problem = "has no end; give the scene a \"box\": [[x, y, z], [x, y, z]]";
        let place = if is_air { "air" } else { "matter" };
        return Err(SourceError::new(place, problem));
    }
    let size = bounds.size();
    if size.min_element() <= 0.0 {
        return Err(SourceError::new(
            "box",
            "is empty; nothing of the shape is in it",
        ));
    }
    let step = map.get("step").map(|v| length(v, "step")).transpose()?;
    if let Some(step) = step.filter(|s| size.max_element() / s > MAX_STEPS) {
        let problem = format!(
            "{step} is too fine for a scene of {}; give at least {:.3e}",
            size.max_element(),
            size.max_element() / MAX_STEPS
        );
        return Err(SourceError::new("step", problem));
    }
    let matter = if is_air {
        Arc::new(Shape::Not(shape))
    } else {
        shape
    };
    Ok(Read {
        matter,
        bounds,
        step,
        is_outside_matter,
        thinnest: reader.thinnest,
        unit: map.get("unit").map(unit).transpose()?,
    })
}

/// Returns meters per unit.
pub(crate) fn unit(value: &Value) -> Result<f64, SourceError> {
    let found = match value.as_str() {
        Some("m") => Some(1.0),
        Some("cm") => Some(0.01),
        Some("mm") => Some(0.001),
        Some("in") => Some(0.0254),
        Some("ft") => Some(0.3048),
        Some(_) => None,
        None => value.as_f64().filter(|u| (1e-9..=1e9).contains(u)),
    };
    found.ok_or_else(|| {
        let problem = "must be \"m\", \"cm\", \"mm\", \"in\", \"ft\" or a number of meters";
        SourceError::new("unit", problem)
    })
}

struct Reader<'l> {
    limits: &'l SourceLimits,
    n_nodes: u64,
    thinnest: f64,
}

impl Reader<'_> {
    fn node(&mut self, value: &Value, place: &str, depth: u32) -> Result<Arc<Shape>, SourceError> {
        let bad = |problem: String| SourceError::new(place, problem);
        self.n_nodes += 1;
        if self.n_nodes > self.limits.max_nodes {
            let most = self.limits.max_nodes;
            return Err(bad(format!("more than {most} shapes; divide the scene")));
        }
        if depth > self.limits.max_depth {
            let most = self.limits.max_depth;
            return Err(bad(format!("nested more than {most} deep; flatten it")));
        }
        let single = value.as_object().filter(|map| map.len() == 1);
        let Some((name, of)) = single.and_then(|map| map.iter().next()) else {
            return Err(bad(format!(
                "must be an object with one shape, such as {EXAMPLE}"
            )));
        };
        let place = format!("{place}.{}", shortened(name));
        self.shape(name, of, &place, depth).map(Arc::new)
    }

    fn shape(
        &mut self,
        name: &str,
        of: &Value,
        place: &str,
        depth: u32,
    ) -> Result<Shape, SourceError> {
        Ok(match name {
            "union" => Shape::Union(self.nodes(of, place, depth)?),
            "intersection" => Shape::Intersection(self.nodes(of, place, depth)?),
            "difference" => {
                let mut all = self.nodes(of, place, depth)?;
                for other in &mut all[1..] {
                    *other = Arc::new(Shape::Not(other.clone()));
                }
                Shape::Intersection(all)
            }
            "not" => Shape::Not(self.node(of, place, depth + 1)?),
            _ => {
                let Some(map) = of.as_object() else {
                    return Err(SourceError::new(place, "must be an object in braces"));
                };
                let fields = Fields { map, place };
                match name {
                    "smooth_union" => {
                        fields.only(&["of", "by"])?;
                        let by = fields.length("by")?;
                        let all = self.nodes(fields.get("of")?, &fields.at("of"), depth)?;
                        Shape::SmoothUnion(all, by)
                    }
                    "grow" | "shell" | "place" => self.unary(name, &fields, depth)?,
                    _ => self.simple(name, &fields)?,
                }
            }
        })
    }

    fn unary(&mut self, name: &str, fields: &Fields<'_>, depth: u32) -> Result<Shape, SourceError> {
        let of = self.node(fields.get("of")?, &fields.at("of"), depth + 1)?;
        match name {
            "grow" => {
                fields.only(&["of", "by"])?;
                Ok(Shape::Grown(
                    of,
                    number(fields.get("by")?, &fields.at("by"))?,
                ))
            }
            "shell" => {
                fields.only(&["of", "thickness"])?;
                let by = self.size(fields.length("thickness")?);
                Ok(Shape::Shell(of, by))
            }
            _ => {
                fields.only(&["of", "by", "turn", "scale"])?;
                let or_zero = |key: &str| match fields.map.get(key) {
                    Some(v) => point(v, &fields.at(key)),
                    None => Ok(DVec3::ZERO),
                };
                let turn = or_zero("turn")?.to_array().map(f64::to_radians);
                let scale = fields.map.get("scale");
                let scale = scale.map_or(Ok(1.0), |v| length(v, &fields.at("scale")))?;
                Ok(Shape::Placed {
                    of,
                    by: or_zero("by")?,
                    turn: DMat3::from_rotation_z(turn[2])
                        * DMat3::from_rotation_y(turn[1])
                        * DMat3::from_rotation_x(turn[0]),
                    scale,
                })
            }
        }
    }

    fn simple(&mut self, name: &str, fields: &Fields<'_>) -> Result<Shape, SourceError> {
        Ok(match name {
            "ball" => {
                fields.only(&["at", "radius"])?;
                Shape::Ball {
                    at: fields.point("at")?,
                    radius: self.size(fields.length("radius")?),
                }
            }
            "box" => {
                fields.only(&["min", "max"])?;
                let b = Aabb::new(fields.point("min")?, fields.point("max")?);
                if b.size().min_element() <= 0.0 {
                    let problem = "is empty: each number of \"max\" must be above that of \"min\"";
                    return Err(SourceError::new(fields.place, problem));
                }
                self.size(b.size().min_element());
                Shape::cuboid(b)
            }
            "tube" => self.tube(fields)?,
            "torus" => {
                fields.only(&["at", "axis", "radii"])?;
                let radii = fields.get("radii")?;
                let place = fields.at("radii");
                let radii = radii.as_array().filter(|a| a.len() == 2);
                let Some([ring, tube]) = radii.map(Vec::as_slice) else {
                    return Err(SourceError::new(
                        place,
                        "must be two lengths: ring and tube",
                    ));
                };
                let radii = [length(ring, &place)?, length(tube, &place)?];
                self.size(radii[1]);
                Shape::Torus {
                    at: fields.point("at")?,
                    axis: fields.direction("axis")?,
                    radii,
                }
            }
            "plane" => {
                fields.only(&["at", "normal"])?;
                Shape::Plane {
                    at: fields.point("at")?,
                    normal: fields.direction("normal")?,
                }
            }
            "gyroid" => {
                fields.only(&["at", "period"])?;
                let period = fields.length("period")?;
                self.size(period * 0.25);
                let at = fields.map.get("at").map(|v| point(v, &fields.at("at")));
                Shape::Gyroid {
                    at: at.transpose()?.unwrap_or(DVec3::ZERO),
                    period,
                }
            }
            other => {
                let problem = format!(
                    "'{}' is no shape; there are ball, box, tube, torus, plane, gyroid, union, smooth_union, \
                     intersection, difference, not, grow, shell and place",
                    shortened(other)
                );
                return Err(SourceError::new(fields.place, problem));
            }
        })
    }

    fn tube(&mut self, fields: &Fields<'_>) -> Result<Shape, SourceError> {
        fields.only(&["points", "radius"])?;
        let radius = self.size(fields.length("radius")?);
        let place = fields.at("points");
        let given = fields.get("points")?.as_array().filter(|a| a.len() >= 2);
        let Some(given) = given else {
            return Err(SourceError::new(place, "must be two points or more"));
        };
        self.n_nodes += given.len() as u64;
        let at = |(i, v): (usize, &Value)| point(v, &format!("{place}[{i}]"));
        let points: Vec<DVec3> = given.iter().enumerate().map(at).collect::<Result<_, _>>()?;
        let tube = |ends: &[DVec3]| {
            Arc::new(Shape::Tube {
                ends: [ends[0], ends[1]],
                radius,
            })
        };
        Ok(Shape::Union(points.windows(2).map(tube).collect()))
    }

    fn nodes(
        &mut self,
        value: &Value,
        place: &str,
        depth: u32,
    ) -> Result<Vec<Arc<Shape>>, SourceError> {
        let Some(all) = value.as_array().filter(|all| !all.is_empty()) else {
            return Err(SourceError::new(
                place,
                "must be a list of shapes in brackets",
            ));
        };
        let node = |(i, v): (usize, &Value)| self.node(v, &format!("{place}[{i}]"), depth + 1);
        all.iter().enumerate().map(node).collect()
    }

    /// Notes the size of a shape, and returns it.
    fn size(&mut self, length: f64) -> f64 {
        self.thinnest = self.thinnest.min(length);
        length
    }
}

const EXAMPLE: &str = "{\"ball\": {\"at\": [0, 0, 0], \"radius\": 1}}";

/// The named values of a shape.
struct Fields<'v> {
    map: &'v Map<String, Value>,
    place: &'v str,
}

impl Fields<'_> {
    fn at(&self, key: &str) -> String {
        format!("{}.{key}", self.place)
    }

    fn only(&self, keys: &[&str]) -> Result<(), SourceError> {
        known_keys(self.map, self.place, keys)
    }

    fn get(&self, key: &str) -> Result<&Value, SourceError> {
        let missing = || SourceError::new(self.place, format!("\"{key}\" is missing"));
        self.map.get(key).ok_or_else(missing)
    }

    fn length(&self, key: &str) -> Result<f64, SourceError> {
        length(self.get(key)?, &self.at(key))
    }

    fn point(&self, key: &str) -> Result<DVec3, SourceError> {
        point(self.get(key)?, &self.at(key))
    }

    fn direction(&self, key: &str) -> Result<DVec3, SourceError> {
        let place = self.at(key);
        let direction = point(self.get(key)?, &place)?.try_normalize();
        direction.ok_or_else(|| SourceError::new(place, "must not be zero"))
    }
}

fn number(value: &Value, place: &str) -> Result<f64, SourceError> {
    let found = value.as_f64().filter(|x| x.abs() <= MAX_LENGTH);
    found.ok_or_else(|| SourceError::new(place, "must be a number from -1e9 to 1e9"))
}

fn length(value: &Value, place: &str) -> Result<f64, SourceError> {
    let found = value.as_f64().filter(|x| (1e-9..=MAX_LENGTH).contains(x));
    found.ok_or_else(|| SourceError::new(place, "must be a length from 1e-9 to 1e9"))
}

fn point(value: &Value, place: &str) -> Result<DVec3, SourceError> {
    let Some([x, y, z]) = value.as_array().map(Vec::as_slice) else {
        return Err(SourceError::new(place, "must be three numbers: [x, y, z]"));
    };
    Ok(DVec3::new(
        number(x, place)?,
        number(y, place)?,
        number(z, place)?,
    ))
}

fn points_box(value: &Value, place: &str) -> Result<Aabb, SourceError> {
    let Some([min, max]) = value.as_array().map(Vec::as_slice) else {
        return Err(SourceError::new(
            place,
            "must be two points: [[x, y, z], [x, y, z]]",
        ));
    };
    Ok(Aabb::new(point(min, place)?, point(max, place)?))
}

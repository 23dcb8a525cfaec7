//! The parts of an IFC file that spaces depend on: its unit, its storeys, its things by GlobalId.

use std::collections::HashMap;

use enfilade_geom::{DMat4, DVec3};

use super::step::{Statement, StepFile, text_of};
use super::told::IfcError;
use crate::names::global_id;

/// Language of a file, as far as it matters here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Schema {
    Ifc2x3,
    /// And what came after it.
    Ifc4,
}

/// A place for rooms.
pub(super) struct Storey {
    pub(super) id: u64,
    /// Height of its floor in meters; lowest for a building without storeys.
    pub(super) height: f64,
}

/// The parts of a file that spaces depend on.
pub(super) struct Model<'b> {
    pub(super) file: StepFile<'b>,
    pub(super) schema: Schema,
    /// Meters per unit of length.
    pub(super) unit: f64,
    /// Representation context of bodies.
    pub(super) context: u64,
    /// The first owner history.
    pub(super) history: Option<u64>,
    /// From below.
    pub(super) storeys: Vec<Storey>,
    /// GlobalId of the project: other GlobalIds follow from it.
    pub(super) project: &'b str,
    pub(super) by_global_id: HashMap<&'b str, u64>,
}

impl<'b> Model<'b> {
    pub(super) fn read(bytes: &'b [u8]) -> Result<Self, IfcError> {
        let schema = schema_of(bytes)?;
        let file = StepFile::read(bytes)?;
        let project = file.of_class("IFCPROJECT").next();
        let project = project.ok_or(IfcError::Incomplete { what: "IfcProject" })?;
        let attributes = file.attributes(project);
        let at = |i: usize| attributes.get(i).copied().unwrap_or_default();
        let unit = length_unit(&file, at(8)).ok_or(IfcError::Incomplete {
            what: "unit of length",
        })?;
        let context = body_context(&file, at(7)).ok_or(IfcError::Incomplete {
            what: "context for bodies",
        })?;
        let storeys = storeys(&file, unit);
        if storeys.is_empty() {
            return Err(IfcError::Incomplete {
                what: "IfcBuilding",
            });
        }
        let mut by_global_id = HashMap::new();
        for statement in &file.statements {
            let first = file.attributes(statement).first().copied();
            let id = first.and_then(|t| t.strip_prefix('\'')?.strip_suffix('\''));
            if let Some(id) = id.filter(|id| id.len() == 22) {
                by_global_id.entry(id).or_insert(statement.id);
            }
        }
        let history = file.of_class("IFCOWNERHISTORY").next().map(|s| s.id);
        let project = at(0);
        Ok(Self {
            file,
            schema,
            unit,
            context,
            history,
            storeys,
            project,
            by_global_id,
        })
    }

    /// Returns `true` for a name with the GlobalId of a thing in the file.
    pub(super) fn is_object(&self, name: &str) -> bool {
        self.object(name).is_some()
    }

    /// Returns the statement of the thing that a name with a GlobalId names.
    pub(super) fn object(&self, name: &str) -> Option<u64> {
        self.by_global_id.get(global_id(name)?).copied()
    }
}

fn schema_of(bytes: &[u8]) -> Result<Schema, IfcError> {
    // In the header, which is short.
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(65_536)]).to_ascii_uppercase();
    let name = head.split_once("FILE_SCHEMA").map(|(_, rest)| rest);
    let name = name.and_then(|rest| rest.split('\'').nth(1));
    match name {
        None => Err(IfcError::NotIfc),
        Some(name) if name.starts_with("IFC2X3") => Ok(Schema::Ifc2x3),
        Some(name) if name.starts_with("IFC4") => Ok(Schema::Ifc4),
        Some(name) => Err(IfcError::Schema {
            name: name.chars().take(32).collect(),
        }),
    }
}

/// Returns the meters of the unit of length that an assignment has.
fn length_unit(file: &StepFile<'_>, assignment: &str) -> Option<f64> {
    let assignment = file.target(assignment)?;
    let units = file.attributes(assignment).first().copied()?;
    let mut units = StepFile::list(units).into_iter();
    units.find_map(|unit| {
        let unit = file.target(unit)?;
        let is_length = file.attributes(unit).get(1) == Some(&".LENGTHUNIT.");
        is_length.then(|| meters(file, unit, 4))?
    })
}

/// Returns the meters of a unit; one that is converted from another is followed `depth` times.
fn meters(file: &StepFile<'_>, unit: &Statement, depth: usize) -> Option<f64> {
    let attributes = file.attributes(unit);
    if unit.class == "IFCSIUNIT" {
        return Some(match *attributes.get(2)? {
            ".KILO." => 1e3,
            ".DECI." => 0.1,
            ".CENTI." => 1e-2,
            ".MILLI." => 1e-3,
            ".MICRO." => 1e-6,
            _ => 1.0,
        });
    }
    let measure = file.target(attributes.get(3)?)?;
    let parts = file.attributes(measure);
    let value = parts.first()?.split(['(', ')']).find_map(number)?;
    let other = file.target(parts.get(1)?).filter(|_| depth > 0)?;
    Some(value * meters(file, other, depth - 1)?)
}

fn number(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|x: &f64| x.is_finite())
}

/// Returns the context of bodies: the part for bodies of the model's context, or that itself.
fn body_context(file: &StepFile<'_>, contexts: &str) -> Option<u64> {
    let of_project: Vec<u64> = StepFile::list(contexts)
        .into_iter()
        .filter_map(StepFile::reference)
        .collect();
    let text = |s: &Statement, i: usize| file.attributes(s).get(i).and_then(|t| text_of(t));
    let subs = file.of_class("IFCGEOMETRICREPRESENTATIONSUBCONTEXT");
    let bodies = subs.filter(|s| {
        let parent = file
            .attributes(s)
            .get(6)
            .and_then(|t| StepFile::reference(t));
        text(s, 0).as_deref() == Some("Body") && parent.is_some_and(|p| of_project.contains(&p))
    });
    let is_plan = |s: &Statement| text(s, 1).is_some_and(|t| t == "Plan");
    let whole = of_project.iter().filter_map(|&id| file.get(id));
    let mut whole = whole.filter(|s| !is_plan(s));
    let body = { bodies }.next().map(|s| s.id);
    body.or_else(|| whole.next().map(|s| s.id))
}

/// Returns the storeys from below; without any, the buildings.
///
/// Heights are those of placements or, where these do not part the storeys, those that the storeys tell.
fn storeys(file: &StepFile<'_>, unit: f64) -> Vec<Storey> {
    let by = |height: &dyn Fn(&Statement) -> Option<f64>| -> Vec<Storey> {
        let all = file.of_class("IFCBUILDINGSTOREY").map(|storey| Storey {
            id: storey.id,
            height: height(storey).unwrap_or(0.0) * unit,
        });
        let mut all: Vec<Storey> = all.collect();
        all.sort_by(|a, b| a.height.total_cmp(&b.height));
        all
    };
    let attribute = |storey: &Statement, i: usize| file.attributes(storey).get(i).copied();
    let placed = by(&|s| Some(placement(file, attribute(s, 5)?, 64)?.w_axis.z));
    let told = by(&|s| number(attribute(s, 9)?));
    let n_heights = |all: &[Storey]| all.windows(2).filter(|w| w[0].height < w[1].height).count();
    let best = if n_heights(&placed) < n_heights(&told) {
        told
    } else {
        placed
    };
    if !best.is_empty() {
        return best;
    }
    let buildings = file.of_class("IFCBUILDING").map(|building| Storey {
        id: building.id,
        height: f64::MIN,
    });
    buildings.collect()
}

/// Returns the transform of a placement to that of the world, in units of the file; placements above it are followed `depth` times.
fn placement(file: &StepFile<'_>, text: &str, depth: usize) -> Option<DMat4> {
    let local = file
        .target(text)
        .filter(|s| s.class == "IFCLOCALPLACEMENT" && depth > 0)?;
    let attributes = file.attributes(local);
    let own = file.target(attributes.get(1)?)?;
    let parts = file.attributes(own);
    let triple = |i: usize| -> Option<DVec3> {
        let point = file.target(parts.get(i)?)?;
        let numbers = StepFile::list(file.attributes(point).first()?);
        let at = |k: usize| numbers.get(k).and_then(|t| number(t));
        Some(DVec3::new(at(0)?, at(1)?, at(2).unwrap_or(0.0)))
    };
    let z = triple(1).unwrap_or(DVec3::Z).try_normalize()?;
    let x = triple(2).unwrap_or(DVec3::X);
    let x = (x - z * z.dot(x))
        .try_normalize()
        .unwrap_or(z.any_orthonormal_vector());
    let at = triple(0)?;
    let own = DMat4::from_cols(
        x.extend(0.0),
        z.cross(x).extend(0.0),
        z.extend(0.0),
        at.extend(1.0),
    );
    match *attributes.first()? {
        "$" => Some(own),
        above => Some(placement(file, above, depth - 1)? * own),
    }
}

/// Returns `true` for a list of what is drawn in a layer.
pub(super) fn is_layer(statement: &Statement) -> bool {
    statement.class.starts_with("IFCPRESENTATIONLAYER")
}

/// Returns the representations of a space.
pub(super) fn representations(file: &StepFile<'_>, space: &Statement) -> Vec<u64> {
    let shape = file.attributes(space).get(6).and_then(|t| file.target(t));
    let all = shape.and_then(|s| file.attributes(s).get(2).copied());
    let all = StepFile::list(all.unwrap_or_default()).into_iter();
    all.filter_map(StepFile::reference).collect()
}

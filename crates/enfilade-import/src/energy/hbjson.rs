//! HBJSON, the JSON of Honeybee (schema of Ladybug Tools).

use std::collections::HashSet;

use enfilade_geom::DVec3;
use serde::Deserialize;

use super::model::{Class, EnergyModel, Loop, Sheet, Space};
use crate::ImportError;
use crate::builder::Builder;

#[derive(Deserialize)]
struct Model {
    #[serde(default)]
    units: Option<String>,
    #[serde(default)]
    rooms: Vec<Room>,
    #[serde(default)]
    orphaned_faces: Vec<Face>,
    #[serde(default)]
    orphaned_shades: Vec<Piece>,
    #[serde(default)]
    orphaned_apertures: Vec<Piece>,
    #[serde(default)]
    orphaned_doors: Vec<Piece>,
}

#[derive(Deserialize)]
struct Room {
    identifier: String,
    #[serde(default)]
    display_name: Option<String>,
    #[serde(default)]
    faces: Vec<Face>,
}

#[derive(Deserialize)]
struct Face {
    identifier: String,
    #[serde(default)]
    face_type: String,
    geometry: Geometry,
    #[serde(default)]
    boundary_condition: Option<Boundary>,
    #[serde(default)]
    apertures: Vec<Piece>,
    #[serde(default)]
    doors: Vec<Piece>,
}

/// An aperture, a door or a shade.
#[derive(Deserialize)]
struct Piece {
    identifier: String,
    geometry: Geometry,
}

#[derive(Deserialize)]
struct Boundary {
    /// The face on the other side, and the room there.
    #[serde(default)]
    boundary_condition_objects: Vec<String>,
}

#[derive(Deserialize)]
struct Geometry {
    #[serde(default)]
    boundary: Vec<[f64; 3]>,
    #[serde(default)]
    holes: Option<Vec<Vec<[f64; 3]>>>,
}

impl Geometry {
    fn outline(&self) -> Loop {
        points(&self.boundary)
    }

    fn holes(&self) -> Vec<Loop> {
        let holes = self.holes.iter().flatten();
        holes.map(|hole| points(hole)).collect()
    }
}

fn points(line: &[[f64; 3]]) -> Loop {
    line.iter().copied().map(DVec3::from_array).collect()
}

/// Returns the model of a file. Linear.
pub(super) fn read(bytes: &[u8], builder: &mut Builder<'_>) -> Result<EnergyModel, ImportError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let model: Model = serde_json::from_slice(bytes)
        .map_err(|e| builder.malformed(format!("line {}", e.line()), e.to_string()))?;
    let unit = match model.units.as_deref() {
        None | Some("Meters") => 1.0,
        Some("Centimeters") => 0.01,
        Some("Millimeters") => 0.001,
        Some("Feet") => 0.3048,
        Some("Inches") => 0.0254,
        Some(other) => {
            let problem = format!("the unit '{other}' is not known; write Meters or Feet");
            return Err(builder.malformed("units", problem));
        }
    };
    let mut sheets = Vec::new();
    let mut spaces = Vec::new();
    let mut is_there = HashSet::new();
    for room in &model.rooms {
        for face in &room.faces {
            add_face(face, &mut sheets, &mut is_there);
        }
        let name = room.display_name.as_deref().map(str::trim);
        let name = name.filter(|n| !n.is_empty()).unwrap_or(&room.identifier);
        spaces.push(Space {
            id: room.identifier.clone(),
            name: name.to_owned(),
            shell: room.faces.iter().map(|f| f.geometry.outline()).collect(),
        });
    }
    for face in &model.orphaned_faces {
        add_face(face, &mut sheets, &mut is_there);
    }
    let alone = [
        (&model.orphaned_shades, Class::Shade),
        (&model.orphaned_apertures, Class::Window),
        (&model.orphaned_doors, Class::Door),
    ];
    for (pieces, class) in alone {
        sheets.extend(pieces.iter().map(|p| sheet(p, class)));
    }
    Ok(EnergyModel {
        format: "HBJSON",
        unit,
        sheets,
        spaces,
    })
}

fn sheet(piece: &Piece, class: Class) -> Sheet {
    Sheet {
        id: piece.identifier.clone(),
        class,
        outline: piece.geometry.outline(),
        holes: piece.geometry.holes(),
    }
}

/// Adds a face and its openings, unless the same wall is there from its other side.
fn add_face<'m>(face: &'m Face, sheets: &mut Vec<Sheet>, is_there: &mut HashSet<&'m str>) {
    is_there.insert(&face.identifier);
    let behind = face.boundary_condition.as_ref();
    let behind = behind.and_then(|b| b.boundary_condition_objects.first());
    if behind.is_some_and(|other| is_there.contains(other.as_str())) {
        return;
    }
    let openings = [(&face.apertures, Class::Window), (&face.doors, Class::Door)];
    let mut holes = face.geometry.holes();
    for (pieces, class) in openings {
        holes.extend(pieces.iter().map(|p| p.geometry.outline()));
        sheets.extend(pieces.iter().map(|p| sheet(p, class)));
    }
    sheets.push(Sheet {
        id: face.identifier.clone(),
        class: match face.face_type.as_str() {
            "AirBoundary" => Class::Air,
            "Floor" => Class::Slab,
            "RoofCeiling" => Class::Roof,
            _ => Class::Wall,
        },
        outline: face.geometry.outline(),
        holes,
    });
}

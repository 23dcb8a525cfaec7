//! HBJSON, the JSON of Honeybee (schema of Ladybug Tools).

use std::collections::HashMap;

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
    #[serde(default)]
    boundary_condition: Option<Boundary>,
}

#[derive(Deserialize)]
struct Boundary {
    /// The face or opening on the other side, and what it belongs to.
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
    let mut walls = Walls::default();
    let mut spaces = Vec::new();
    let faces = model.rooms.iter().flat_map(|room| &room.faces);
    let faces: Vec<&Face> = faces.chain(&model.orphaned_faces).collect();
    for face in &faces {
        walls.know(&face.identifier, &face.geometry);
        for piece in face.apertures.iter().chain(&face.doors) {
            walls.know(&piece.identifier, &piece.geometry);
        }
    }
    for face in faces {
        walls.add(face);
    }
    let Walls { mut sheets, .. } = walls;
    for room in &model.rooms {
        let name = room.display_name.as_deref().map(str::trim);
        let name = name.filter(|n| !n.is_empty()).unwrap_or(&room.identifier);
        spaces.push(Space {
            id: room.identifier.clone(),
            name: name.to_owned(),
            shell: room.faces.iter().map(|f| f.geometry.outline()).collect(),
            walls: Vec::new(),
        });
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
        holes: piece.geometry.holes(),
        ..Sheet::new(piece.identifier.clone(), class, piece.geometry.outline())
    }
}

/// The other side of a face or an opening.
enum Behind<'m> {
    /// Nothing that the model has.
    None,
    /// The same, seen from there.
    Same,
    /// Another, through a wall as thick as they are apart.
    Apart(&'m Loop),
}

/// Faces as sheets. Where two rooms have a wall, they have a face each, in one place or at both sides of it.
#[derive(Default)]
struct Walls<'m> {
    /// Outlines of faces and openings, by their identifiers.
    outlines: HashMap<&'m str, Loop>,
    sheets: Vec<Sheet>,
}

impl<'m> Walls<'m> {
    fn know(&mut self, id: &'m str, geometry: &Geometry) {
        self.outlines.insert(id, geometry.outline());
    }

    /// Returns what is behind, and `true` for the first of two by their identifiers.
    fn behind(&self, id: &str, boundary: Option<&Boundary>) -> (Behind<'_>, bool) {
        let other = boundary.and_then(|b| b.boundary_condition_objects.first());
        let Some((other, far)) = other.and_then(|o| self.outlines.get_key_value(o.as_str())) else {
            return (Behind::None, true);
        };
        let near = &self.outlines[id];
        let away = |p: &DVec3| nearest(*p, far).map_or(0.0, |q| q.distance(*p));
        let most = near.iter().map(away).fold(0.0, f64::max);
        let size = near.iter().map(|p| p.distance(near[0])).fold(0.0, f64::max);
        let behind = if most > ONE_PLACE * size {
            Behind::Apart(far)
        } else {
            Behind::Same
        };
        (behind, id < *other)
    }

    /// Adds a face and its openings; not those that are there from the other side.
    fn add(&mut self, face: &'m Face) {
        let class = match face.face_type.as_str() {
            "AirBoundary" => Class::Air,
            "Floor" => Class::Slab,
            "RoofCeiling" => Class::Roof,
            _ => Class::Wall,
        };
        let own = face.boundary_condition.as_ref();
        let (behind, is_first) = self.behind(&face.identifier, own);
        if matches!(behind, Behind::Same) && !is_first {
            return;
        }
        let mut made = Vec::new();
        let outline = face.geometry.outline();
        if let (Behind::Apart(far), true, Class::Air) = (&behind, is_first, class) {
            made.extend(reveal(&face.identifier, &outline, far));
        }
        let mut holes = face.geometry.holes();
        for (pieces, class) in [(&face.apertures, Class::Window), (&face.doors, Class::Door)] {
            for piece in pieces {
                let outline = piece.geometry.outline();
                let own = piece.boundary_condition.as_ref();
                let (behind, is_first) = self.behind(&piece.identifier, own);
                if is_first {
                    made.push(sheet(piece, class));
                    if let Behind::Apart(far) = behind {
                        made.extend(reveal(&piece.identifier, &outline, far));
                    }
                }
                holes.push(outline);
            }
        }
        made.push(Sheet {
            holes,
            ..Sheet::new(face.identifier.clone(), class, outline)
        });
        self.sheets.extend(made);
    }
}

/// Greatest distance of the vertices of two outlines in one place, as a share of their size. Tolerances of models are 1 cm and less,
/// walls are thicker.
const ONE_PLACE: f64 = 2e-3;

fn nearest(p: DVec3, outline: &Loop) -> Option<DVec3> {
    let away = |q: &DVec3| q.distance_squared(p);
    let all = outline.iter().copied();
    all.min_by(|a, b| away(a).total_cmp(&away(b)))
}

/// Returns the sides of an opening through a wall, from one face of it to the other.
fn reveal<'l>(id: &'l str, near: &'l Loop, far: &'l Loop) -> impl Iterator<Item = Sheet> + 'l {
    let next = near.iter().cycle().skip(1);
    near.iter()
        .zip(next)
        .enumerate()
        .filter_map(move |(i, (&p, &q))| {
            let outline = vec![p, q, nearest(q, far)?, nearest(p, far)?];
            let id = format!("{id}-reveal-{i}");
            Some(Sheet::new(id, Class::Wall, outline))
        })
}

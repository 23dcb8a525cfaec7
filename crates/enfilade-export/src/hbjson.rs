//! Energy models as Honeybee's JSON, which Ladybug Tools, OpenStudio and EnergyPlus take.
//!
//! After honeybee-schema 2 (`Model`, `Room`, `Face`, `Aperture`, `Door`). Rooms are coarse shells, so that the client finds no error:
//! closed, planar, without small faces. Faces of two rooms that answer each other are equal. Ways without a door are air boundaries
//! where nothing else is between two rooms, and doors in a wall. What has only matter, a void or its own room behind is adiabatic.
//! Z is up: (x, y, z) is written as (x, -z, y).

mod openings;

use enfilade_cpg::{CellId, PortalId, PortalKind, World};
use serde_json::{Value, json};

use crate::coarse::{CoarseRoom, CoarseRooms, coarse_rooms};
use crate::names::Names;
use crate::surfaces::{Behind, BoundarySurface};

use openings::{Openings, SubFace};

/// Tolerance of the model, the client's default. [Units: wu]
const TOLERANCE: f64 = 0.01;
/// Tolerance of angles of the model, the client's default. [Units: degrees]
const ANGLE_TOLERANCE: f64 = 1.0;
/// Vertical component of the normal above which a face is a roof or a ceiling: less than 60 degrees from up, the client's rule.
const ROOF: f64 = 0.5;
/// Vertical component of the normal below which a face is a floor: more than 130 degrees from up.
const FLOOR: f64 = -0.642_787_6;
/// Change of a room's volume, as a share, that is worth a note.
const CHANGED: f64 = 0.03;

/// Most rooms or openings that a note names.
const MOST_NAMED: usize = 5;

/// A model for Honeybee.
#[derive(Clone, Debug)]
pub struct HbjsonModel {
    /// The file.
    pub text: String,
    /// Sentences about what is not as in the world; the file has the same in `user_data`.
    pub notes: Vec<String>,
}

/// Returns the rooms as a Honeybee model. The world must be valid. Time is that of [`room_surfaces`](crate::room_surfaces).
///
/// Rooms are simpler than in the world; `user_data` of each has the volume there, and a note if it is now another by more than 3 %,
/// that of the model the rooms and openings that are left out.
#[must_use]
pub fn hbjson(world: &World) -> HbjsonModel {
    let coarse = coarse_rooms(world);
    let writer = HbjsonWriter {
        world,
        names: Names::new(world),
        openings: Openings::new(world, &coarse),
        coarse: &coarse,
    };
    let rooms: Vec<Value> = (0..coarse.rooms.len()).map(|r| writer.room(r)).collect();
    let left_out: Vec<String> = (world.graph.rooms())
        .filter(|(cell, _)| !writer.has_room(*cell))
        .map(|(_, cell)| cell.name.clone())
        .collect();
    let without: Vec<String> = (writer.openings.left_out.iter())
        .map(|&portal| writer.told(portal))
        .collect();
    let model = json!({
        "type": "Model",
        "identifier": "enfilade",
        "display_name": "enfilade",
        "version": "1.58.0",
        "units": "Meters",
        "tolerance": TOLERANCE,
        "angle_tolerance": ANGLE_TOLERANCE,
        "rooms": rooms,
        "user_data": { "rooms_left_out": left_out, "openings_left_out": without },
        "properties": { "type": "ModelProperties" },
    });
    let changed = coarse.rooms.iter().filter_map(|room| {
        let name = &world.graph[room.shell.cell].name;
        change_of(room).map(|percent| format!("{name} by {percent:+.1} %"))
    });
    let listed = [
        (
            "rooms left out, as too little of them is left between large walls",
            left_out,
        ),
        ("openings left out, as they fit into no face", without),
        (
            "rooms of another volume than in the world",
            changed.collect(),
        ),
    ];
    let listed = listed.iter().filter(|(_, names)| !names.is_empty());
    HbjsonModel {
        text: model.to_string() + "\n",
        notes: listed.map(|(what, names)| note(what, names)).collect(),
    }
}

/// Returns a sentence with the first names of a list.
fn note(what: &str, names: &[String]) -> String {
    let n = names.len();
    let named = names[..n.min(MOST_NAMED)].join(", ");
    let more = match n.saturating_sub(MOST_NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!("{what}: {n}, {named}{more}")
}

struct HbjsonWriter<'w> {
    world: &'w World,
    names: Names,
    openings: Openings,
    coarse: &'w CoarseRooms,
}

impl HbjsonWriter<'_> {
    fn has_room(&self, cell: CellId) -> bool {
        self.coarse.rooms.iter().any(|r| r.shell.cell == cell)
    }

    /// Returns the kind and number of a portal, with the names of its rooms.
    fn told(&self, portal: PortalId) -> String {
        let opening = &self.world.graph[portal];
        let [a, b] = opening.cells.map(|c| &self.world.graph[c].name);
        let kind = match opening.kind {
            PortalKind::Door => "door",
            PortalKind::Window => "window",
            PortalKind::Open | PortalKind::Crack => "way",
        };
        format!("{kind} portal-{} of {a} and {b}", portal.0)
    }

    fn room(&self, number: usize) -> Value {
        let room = &self.coarse.rooms[number];
        let cell = room.shell.cell;
        let faces = 0..room.shell.surfaces.len();
        let faces: Vec<Value> = faces.map(|s| self.face(number, s)).collect();
        let mut out = json!({
            "type": "Room",
            "identifier": self.names.of(cell),
            "display_name": self.world.graph[cell].name,
            "faces": faces,
            "user_data": user_data(room),
            "properties": { "type": "RoomPropertiesAbridged" },
        });
        let mut facts = self.world.room_facts.iter().flatten();
        let own = facts.find(|f| f.cell == cell);
        if let Some(story) = own.and_then(|f| f.storeys.first()) {
            out["story"] = json!(story);
        }
        out
    }

    fn face_id(&self, cell: CellId, surface: usize) -> String {
        format!("{}_f{surface}", self.names.of(cell))
    }

    /// Returns the room and the surface that answer one.
    fn answer(&self, surface: &BoundarySurface) -> Option<(CellId, usize)> {
        match (surface.behind, surface.pair) {
            (Behind::Cell(other), Some(pair)) => Some((other, pair)),
            _ => None,
        }
    }

    fn face(&self, number: usize, s: usize) -> Value {
        let room = &self.coarse.rooms[number].shell;
        let surface = &room.surfaces[s];
        let id = self.face_id(room.cell, s);
        let is_air = self.openings.air.contains(&[number, s]);
        let up = surface.normal[1];
        let face_type = match is_air {
            true => "AirBoundary",
            false if up > ROOF => "RoofCeiling",
            false if up < FLOOR => "Floor",
            false => "Wall",
        };
        let answer = self.answer(surface);
        let objects =
            answer.map(|(other, pair)| json!([self.face_id(other, pair), self.names.of(other)]));
        let mut out = json!({
            "type": "Face",
            "identifier": id,
            "display_name": id,
            "geometry": self.geometry(&surface.loops),
            "face_type": face_type,
            "boundary_condition": self.boundary_condition(surface, objects),
            "properties": { "type": "FacePropertiesAbridged" },
        });
        for sub_face in self.openings.in_face(number, s) {
            let (list, value) = self.sub_face(surface, sub_face, room.cell, s);
            match &mut out[list] {
                Value::Array(others) => others.push(value),
                none => *none = json!([value]),
            }
        }
        out
    }

    /// Returns what is behind a surface or an opening in it; `objects` are those that answer it.
    fn boundary_condition(&self, surface: &BoundarySurface, objects: Option<Value>) -> Value {
        let is_outdoors = |cell: CellId| !self.world.graph[cell].is_indoors();
        match (surface.behind, objects) {
            (_, Some(objects)) => {
                json!({ "type": "Surface", "boundary_condition_objects": objects })
            }
            (Behind::Ground, _) => json!({ "type": "Ground" }),
            (Behind::Cell(cell), _) if is_outdoors(cell) => json!({
                "type": "Outdoors",
                "sun_exposure": true,
                "wind_exposure": true,
                "view_factor": { "type": "Autocalculate" },
            }),
            _ => json!({ "type": "Adiabatic" }),
        }
    }

    /// Returns the list that a door or an aperture belongs to, and itself.
    fn sub_face(
        &self,
        surface: &BoundarySurface,
        sub_face: &SubFace,
        cell: CellId,
        s: usize,
    ) -> (&'static str, Value) {
        let kind = self.world.graph[sub_face.portal].kind;
        let is_door = kind != PortalKind::Window;
        let number = sub_face.portal.0;
        let id = |face: String| format!("{face}_o{number}");
        let objects = self.answer(surface).map(|(other, pair)| {
            let face = self.face_id(other, pair);
            json!([id(face.clone()), face, self.names.of(other)])
        });
        let own = id(self.face_id(cell, s));
        let kind_of = if is_door { "Door" } else { "Aperture" };
        let mut out = json!({
            "type": kind_of,
            "identifier": own,
            "display_name": own,
            "geometry": self.geometry(std::slice::from_ref(&sub_face.outline)),
            "boundary_condition": self.boundary_condition(surface, objects),
            "properties": { "type": format!("{kind_of}PropertiesAbridged") },
        });
        if is_door {
            out["is_glass"] = json!(false);
            ("doors", out)
        } else {
            out["is_operable"] = json!(false);
            ("apertures", out)
        }
    }

    fn geometry(&self, loops: &[Vec<[f64; 3]>]) -> Value {
        let turned = |ring: &Vec<[f64; 3]>| -> Vec<[f64; 3]> {
            let world = ring.iter().map(|&p| self.coarse.frame.to_world(p));
            world.map(|[x, y, z]| [x, -z, y].map(rounded)).collect()
        };
        let mut out = json!({ "type": "Face3D", "boundary": loops.first().map(turned) });
        if loops.len() > 1 {
            out["holes"] = json!(loops[1..].iter().map(turned).collect::<Vec<_>>());
        }
        out
    }
}

/// Rounds to micrometers, without negative zeros.
fn rounded(x: f64) -> f64 {
    (x * 1e6).round() / 1e6 + 0.0
}

/// Returns the change of a room's volume, if it is worth a note. [Units: %]
fn change_of(room: &CoarseRoom) -> Option<f64> {
    let change = room.shell.volume / room.true_volume - 1.0;
    (change.abs() > CHANGED).then_some(100.0 * change)
}

fn user_data(room: &CoarseRoom) -> Value {
    let mut out = json!({ "volume_of_world": rounded(room.true_volume) });
    if let Some(percent) = change_of(room) {
        out["note"] = json!(format!(
            "simpler than in the world: the volume changed by {percent:+.1} %"
        ));
    }
    out
}

//! The result of a bake: bytes, a drawing, and data for the page.

use enfilade_cpg::{Cell, Portal, PortalKind, Reason, World};
use enfilade_import::ImportReport;
use enfilade_report::{InputDoubt, Plans, Verdict};
use serde::Serialize;

/// A finished bake.
pub struct Answer {
    /// The world, one GLB: the bytes that the command writes.
    pub world: Vec<u8>,
    /// The plans of all storeys, as the command draws them.
    pub plan: String,
    /// The rest, as JSON.
    pub facts: String,
}

/// The reason why there is no world.
#[derive(Debug, Serialize)]
pub struct Failure {
    /// Its kind: `settings`, `files`, `refused`, `leak`, `bake`, `memory`, `empty` or `defect`.
    pub kind: &'static str,
    /// The reason and the remedy.
    pub text: String,
    /// Questions to the person, if answers would help.
    pub questions: Vec<Question>,
}

/// A property of the input that only a person knows.
#[derive(Clone, Debug, Serialize)]
pub struct Question {
    /// `unit` or `up`.
    pub about: &'static str,
    /// The evidence, and the option of the command.
    pub text: String,
    /// The value that the evidence speaks for, if there is one: a setting.
    pub proposed: Option<String>,
}

/// The properties that are asked for.
const ABOUT: [&str; 2] = ["unit", "up"];

impl Question {
    fn new(about: &'static str, text: &str) -> Self {
        Self {
            about,
            text: text.to_owned(),
            proposed: proposed(text, about),
        }
    }
}

/// Returns the value that a text proposes for a setting, as an option of the command.
fn proposed(text: &str, about: &str) -> Option<String> {
    let option = format!("--{about} ");
    let (_, rest) = text.split_once(&option)?;
    let value = rest.split_whitespace().next()?;
    let value = value.trim_end_matches(|c: char| !c.is_alphanumeric());
    (!value.is_empty()).then(|| value.to_owned())
}

impl Failure {
    pub(crate) fn new(kind: &'static str, text: impl Into<String>) -> Self {
        Self {
            kind,
            text: text.into(),
            questions: Vec::new(),
        }
    }

    /// Adds the questions about an input; without a report, those whose answers the text proposes.
    pub(crate) fn asking(mut self, report: Option<&ImportReport>) -> Self {
        self.questions = report.map(questions).unwrap_or_default();
        for about in ABOUT {
            let is_asked = self.questions.iter().any(|q| q.about == about);
            if !is_asked && proposed(&self.text, about).is_some() {
                self.questions.push(Question::new(about, &self.text));
            }
        }
        self
    }

    pub(crate) fn settings(text: &str) -> Self {
        Self::new("settings", format!("settings: {text}"))
    }
}

/// Returns what is in doubt about unit and axis.
pub(crate) fn questions(report: &ImportReport) -> Vec<Question> {
    let unit = report.unit_doubt.as_ref().or(report.feet_hint.as_ref());
    let unit = unit.map(|text| Question::new("unit", text));
    let up = report.up_doubt.as_ref();
    let up = up.map(|doubt| Question::new("up", &doubt.text));
    unit.into_iter().chain(up).collect()
}

/// Returns the doubts about the input, as the verdict takes them.
pub(crate) fn input_doubts(report: &ImportReport) -> Vec<InputDoubt> {
    let up = report.up_doubt.as_ref().map(|doubt| &doubt.text);
    let doubt = |text: String| InputDoubt {
        is_about_up: Some(&text) == up,
        text,
    };
    report.doubts().into_iter().map(doubt).collect()
}

/// All facts of a world that a page shows.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Facts<'a> {
    pub(crate) verdict: &'a Verdict,
    /// The verdict as the command prints it.
    pub(crate) text: String,
    pub(crate) warnings: Vec<String>,
    pub(crate) questions: Vec<Question>,
    pub(crate) method: &'static str,
    pub(crate) triangles: usize,
    pub(crate) rooms: Vec<Room>,
    pub(crate) storeys: Vec<Floor>,
    pub(crate) openings: Vec<Opening>,
    /// Seconds of each stage.
    pub(crate) seconds: Vec<(&'static str, f64)>,
}

/// A cell with its facts; those of floors are for rooms alone.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Room {
    cell: u32,
    name: String,
    kind: &'static str,
    storeys: Vec<String>,
    floor_area: f64,
    height: f64,
    volume: f32,
    doors: usize,
    windows: usize,
    aabb: [[f32; 3]; 2],
    /// Why it is a cell, each reason a sentence.
    why: Vec<String>,
}

/// An opening to walk through, or to look through, between two cells.
#[derive(Serialize)]
pub(crate) struct Opening {
    cells: [u32; 2],
    kind: &'static str,
    at: [f32; 3],
    width: f32,
    height: f32,
    /// A person asked for it.
    asked: bool,
}

/// Returns all portals but cracks.
pub(crate) fn openings(world: &World) -> Vec<Opening> {
    let kinds = |kind| match kind {
        PortalKind::Open => Some("open"),
        PortalKind::Door => Some("door"),
        PortalKind::Window => Some("window"),
        PortalKind::Crack => None,
    };
    let opening = |portal: &Portal| {
        let [width, height] = portal.size();
        Some(Opening {
            cells: portal.cells.map(|cell| cell.0),
            kind: kinds(portal.kind)?,
            at: portal.center(),
            width,
            height,
            asked: portal.why.iter().any(|why| why.reason == Reason::Asked),
        })
    };
    world.graph.portals.iter().filter_map(opening).collect()
}

/// A storey.
#[derive(Serialize)]
pub(crate) struct Floor {
    name: String,
    floor: f64,
    top: f64,
    area: f64,
    cells: Vec<u32>,
}

/// Returns all cells but the outdoors.
pub(crate) fn rooms(world: &World, plans: &Plans<'_>) -> Vec<Room> {
    let ids = world.graph.cell_ids();
    let cells = ids.map(|id| (id, &world.graph[id]));
    let mut out = Vec::new();
    for (id, cell) in cells.filter(|(_, cell)| !cell.outdoor) {
        let facts = plans.rooms().find(|facts| facts.cell == id);
        out.push(Room {
            cell: id.0,
            name: cell.name.clone(),
            kind: kind(cell),
            storeys: facts.map_or_else(Vec::new, |f| f.storeys.clone()),
            floor_area: facts.map_or(0.0, |f| f.floor_area),
            height: facts.map_or(0.0, |f| f.height),
            volume: cell.volume,
            doors: facts.map_or(0, |f| f.n_doors),
            windows: facts.map_or(0, |f| f.n_windows),
            aabb: cell.aabb,
            why: cell.why.iter().map(ToString::to_string).collect(),
        });
    }
    out
}

fn kind(cell: &Cell) -> &'static str {
    match cell {
        _ if cell.is_void => "void",
        _ if cell.is_land => "land",
        _ => "room",
    }
}

/// Returns the storeys, from below.
pub(crate) fn storeys(plans: &Plans<'_>) -> Vec<Floor> {
    let floor = |storey: &enfilade_report::Storey| Floor {
        name: storey.name.clone(),
        floor: storey.floor,
        top: storey.top,
        area: storey.area,
        cells: storey.cells.iter().map(|cell| cell.0).collect(),
    };
    plans.storeys().map(floor).collect()
}

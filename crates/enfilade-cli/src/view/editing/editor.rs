//! The editor: a session, the tool in hand, and what the pointer means for it.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use enfilade::edit::{
    EditError, EditOperation, EditSession, EditedSpace, EditedWorld, HandEditError, HandEditKind,
    Resumed,
};
use enfilade::geom::{DVec3, shown};
use enfilade::kit::{End, InstanceId, Kit};
use enfilade::world::Pose;
use enfilade_render::{EYE_HEIGHT, PictureMark};

use super::aim::{
    EditRay, end_at, heading, portal_rectangle, pose_anywhere, pose_at_end, rectangle_in,
};
use super::ghost::{add_ends, add_known, add_piece, add_point, add_polygon, lines_of};
use super::strip::EditShown;
use super::tool::Tool;

/// Time after which the journal is on the disk, whatever becomes of the system.
const SYNC: Duration = Duration::from_secs(1);
/// Distance of a lamp from the surface that it is put on. [Units: wu]
const HANG: f64 = 0.3;
/// Distance of the eye from the doorway that it goes to. [Units: wu]
const BACK: f64 = 1.2;

/// A key or a click, as the editor understands it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EditKey {
    OnOff,
    /// Takes the tool of a number.
    Choose(usize),
    /// Takes a tool of those by hand.
    ByHand(usize),
    /// Takes the next tool, or the one before.
    Step(i32),
    Turn(i32),
    /// Uses the tool; `more` adds a vertex to a polygon.
    Use {
        more: bool,
    },
    /// Ends a polygon.
    Finish,
    Grab,
    TurnThere,
    Delete,
    Undo,
    Redo,
    /// Goes to the next open doorway.
    Next,
    Cancel,
}

/// Consequence of a key.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Outcome {
    /// Nothing that is told; `false` if the key means nothing here.
    Quiet(bool),
    Said(String),
    Refused(String),
    /// The world is another.
    Edited(String),
    /// The eye goes to a place.
    Go {
        eye: DVec3,
        toward: DVec3,
        words: String,
    },
}

/// The meaning of the pointer for the tool in hand.
#[derive(Default)]
struct Aim {
    /// The operation of a click, and its shape.
    operation: Option<EditOperation>,
    /// Why it would be refused, or that there is none.
    refused: Option<String>,
    end: Option<End>,
    piece: Option<(usize, Pose)>,
    polygon: Vec<DVec3>,
    point: Option<DVec3>,
}

/// An editing session in the window.
pub(crate) struct Editor {
    pub(super) session: EditSession,
    save: PathBuf,
    journal: PathBuf,
    tools: Vec<Tool>,
    chosen: usize,
    pub(super) turn: i32,
    /// The instance that is moved.
    pub(super) grabbed: Option<InstanceId>,
    /// Vertices of the polygon that is drawn, and the normal of the surface of the first.
    pub(super) corners: Vec<DVec3>,
    normal: DVec3,
    is_on: bool,
    aim: Aim,
    /// Lines of each piece.
    lines: Vec<Vec<[DVec3; 2]>>,
    /// The open doorway that was gone to last.
    last_end: usize,
    unsynced: Option<Instant>,
    is_saved: bool,
    pub(super) notes: Vec<String>,
    /// The parts of the level as it is shown.
    pub(super) followed: EditedSpace,
}

impl Editor {
    pub(super) fn new(session: EditSession, save: PathBuf, journal: PathBuf) -> Self {
        let kit = session.level().kit();
        Self {
            tools: Tool::all(kit, session.takes_pieces()),
            lines: lines_of(kit),
            session,
            save,
            journal,
            chosen: 0,
            turn: 0,
            grabbed: None,
            corners: Vec::new(),
            normal: DVec3::Y,
            is_on: true,
            aim: Aim::default(),
            last_end: usize::MAX,
            unsynced: None,
            is_saved: true,
            notes: Vec::new(),
            followed: EditedSpace::default(),
        }
    }

    /// Notes what is told first.
    pub(super) fn resumed(&mut self, resumed: &Resumed) {
        let journal = self.journal.display();
        let kept = match resumed.n_entries {
            0 => format!("all that is done is kept in {journal}; F2 saves the world"),
            n => format!("{n} operations of {journal} are made again"),
        };
        self.notes.push(kept);
        if let Some(cut) = &resumed.cut {
            let cut = shown(cut);
            self.notes.push(format!(
                "the last line of {journal} had no end and is cut off: {cut}"
            ));
        }
        self.is_saved = resumed.n_entries == 0;
        let resting = self.session.resting();
        self.notes.extend(self.resting_words(&resting));
    }

    /// Returns what is to be told.
    pub(crate) fn take_notes(&mut self) -> Option<String> {
        let notes = std::mem::take(&mut self.notes);
        (!notes.is_empty()).then(|| notes.join("\n"))
    }

    pub(crate) fn kit(&self) -> &Kit {
        self.session.level().kit()
    }

    /// Returns the numbers of the pieces of the palette, `None` for other tools.
    pub(crate) fn palette(&self) -> Vec<(String, Option<usize>)> {
        let named = self.tools.iter().map(|tool| {
            let piece = match tool {
                Tool::Piece(number) => Some(*number),
                _ => None,
            };
            (tool.name(self.kit()), piece)
        });
        named.collect()
    }

    pub(crate) fn save(&self) -> &Path {
        &self.save
    }

    pub(crate) fn world(&mut self) -> Result<Arc<EditedWorld>, EditError> {
        let edited = self.session.world()?;
        let words = self.resting_words(&edited.resting);
        self.notes.extend(words);
        Ok(edited)
    }

    /// Notes that the world is saved.
    pub(crate) fn saved(&mut self) {
        self.is_saved = true;
    }

    /// Returns what is to be told at the end.
    pub(crate) fn farewell(&self) -> Option<String> {
        (!self.is_saved).then(|| {
            let (save, journal) = (self.save.display(), self.journal.display());
            format!("{save} does not have the last changes, which {journal} keeps; F2 saves them")
        })
    }

    /// Waits for the disk once a second, if something was written.
    ///
    /// # Errors
    ///
    /// If the disk fails.
    pub(crate) fn tick(&mut self) -> Result<(), EditError> {
        if self.unsynced.is_some_and(|since| since.elapsed() > SYNC) {
            self.unsynced = None;
            self.session.sync()?;
        }
        Ok(())
    }

    pub(super) fn resting_words(&self, resting: &[(usize, HandEditError)]) -> Option<String> {
        let (first, why) = resting.first()?;
        let word = self.session.hand_edits()[*first].kind.word();
        let more = match resting.len() {
            1 => String::new(),
            n => format!(", and {} more", n - 1),
        };
        Some(format!("a {word} rests: {why}{more}"))
    }

    pub(super) fn tool(&self) -> Tool {
        self.tools[self.chosen]
    }

    /// Finds what the pointer means.
    pub(crate) fn look(&mut self, ray: &EditRay<'_>) {
        self.aim = Aim::default();
        if !self.is_on {
            return;
        }
        let aim = match self.grabbed {
            Some(id) => self.aim_piece(ray, Some(id)),
            None => match self.tool() {
                Tool::Piece(_) => self.aim_piece(ray, None),
                tool if tool.is_drawn() => self.aim_polygon(ray),
                tool => self.aim_point(ray, tool),
            },
        };
        self.aim = aim;
        if let (None, Some(operation)) = (&self.aim.refused, &self.aim.operation) {
            self.aim.refused = self.session.check(operation).err().map(|e| e.to_string());
        }
    }

    /// Aims a new piece, or one that is moved.
    fn aim_piece(&self, ray: &EditRay<'_>, moved: Option<InstanceId>) -> Aim {
        let level = self.session.level();
        let number = match (moved, self.tool()) {
            (Some(id), _) => level.standing(id).map_or(0, |i| i.piece),
            (None, Tool::Piece(number)) => number,
            _ => return Aim::default(),
        };
        let end = end_at(level, ray, moved);
        let placed = match end {
            Some(end) => pose_at_end(level, number, end, self.turn),
            None => Ok(pose_anywhere(ray, self.turn)),
        };
        match placed {
            Ok(pose) => Aim {
                operation: Some(match moved {
                    Some(id) => EditOperation::Move(id, pose),
                    None => EditOperation::put(level.kit().pieces()[number].name(), None, pose),
                }),
                end,
                piece: Some((number, pose)),
                ..Aim::default()
            },
            Err(why) => Aim {
                refused: Some(why),
                end,
                ..Aim::default()
            },
        }
    }

    /// Aims the next vertex of a polygon.
    fn aim_polygon(&self, ray: &EditRay<'_>) -> Aim {
        let is_mirror = self.tool() == Tool::Mirror;
        let Some([at, _]) = ray.hit else {
            return Aim {
                refused: Some("no surface there".into()),
                ..Aim::default()
            };
        };
        let (Some(first), true) = (self.corners.first(), is_mirror) else {
            return self.with_corner(at, ray);
        };
        match ray.on_plane(*first, self.normal) {
            Some(at) => self.with_corner(at, ray),
            None => Aim {
                refused: Some("the wall of the mirror is not there".into()),
                ..Aim::default()
            },
        }
    }

    fn with_corner(&self, at: DVec3, ray: &EditRay<'_>) -> Aim {
        let mut corners = self.corners.clone();
        corners.push(at);
        let polygon = self.polygon(&corners, ray).unwrap_or(corners);
        Aim {
            polygon,
            point: Some(at),
            ..Aim::default()
        }
    }

    /// Returns the polygon of some vertices: two are the vertices of a rectangle.
    fn polygon(&self, corners: &[DVec3], ray: &EditRay<'_>) -> Result<Vec<DVec3>, String> {
        match (corners, self.tool()) {
            (&[a, b], Tool::Portal) => portal_rectangle([a, b], ray.space),
            (&[a, b], _) => rectangle_in([a, b], self.normal),
            (corners, _) if corners.len() > 2 => Ok(corners.to_vec()),
            _ => Err("a polygon needs two vertices at least".into()),
        }
    }

    /// Aims a lamp, a crate or a door.
    fn aim_point(&self, ray: &EditRay<'_>, tool: Tool) -> Aim {
        let refused = |words: &str| Aim {
            refused: Some(words.to_owned()),
            ..Aim::default()
        };
        let kind = match (tool, ray.hit) {
            (Tool::Door, _) => match ray.portal {
                Some(at) => HandEditKind::Door(at),
                None => return refused("no doorway there"),
            },
            (_, None) => return refused("no surface there"),
            (Tool::Lamp, Some([at, normal])) => HandEditKind::Lamp(at + normal * HANG),
            (_, Some([at, normal])) if normal.y > 0.7 => {
                HandEditKind::Crate(at, heading(self.turn))
            }
            _ => return refused("a crate stands on a floor"),
        };
        let known = self.made_door(&kind).map(EditOperation::Unmake);
        let make = || EditOperation::Make(self.session.hosted(&kind));
        Aim {
            point: Some(kind.at()),
            operation: Some(known.unwrap_or_else(make)),
            ..Aim::default()
        }
    }

    /// Returns the marks that show it: doorways, the ghost of a piece, a polygon.
    pub(crate) fn marks(&self) -> Vec<PictureMark> {
        let mut marks = Vec::new();
        if !self.is_on {
            return marks;
        }
        let fits = self.aim.refused.is_none();
        if self.grabbed.is_some() || matches!(self.tool(), Tool::Piece(_)) {
            add_ends(&mut marks, self.session.level(), self.aim.end);
        }
        let word = self.tool().word();
        for kind in self.placed_edits().filter(|kind| Some(kind.word()) == word) {
            match &kind {
                HandEditKind::Portal(corners) | HandEditKind::Mirror(corners) => {
                    add_known(&mut marks, corners);
                }
                kind => add_known(&mut marks, &cross(kind.at())),
            }
        }
        if let Some((number, pose)) = &self.aim.piece {
            add_piece(&mut marks, &self.lines[*number], pose, fits);
        }
        if !self.aim.polygon.is_empty() {
            add_polygon(&mut marks, &self.aim.polygon, fits);
        }
        if let Some(at) = self.aim.point {
            add_point(&mut marks, at, 0.15, fits);
        }
        marks
    }

    /// Returns the changes by hand where they are.
    fn placed_edits(&self) -> impl Iterator<Item = HandEditKind> {
        let edits = self.session.hand_edits().iter();
        edits.filter_map(|edit| self.session.placed(edit).ok())
    }

    /// Returns what the panel shows.
    pub(crate) fn shown(&self) -> Option<EditShown> {
        self.is_on.then(|| EditShown {
            chosen: self.chosen,
            hint: match self.grabbed {
                Some(_) => "click: move it there; , .: turn it; G: leave it".into(),
                None => self.tool().hint().into(),
            },
            refused: self.aim.refused.clone(),
            n_steps: self.session.n_steps(),
            is_saved: self.is_saved,
        })
    }

    /// Does what a key means.
    pub(crate) fn press(&mut self, key: EditKey, ray: &EditRay<'_>) -> Outcome {
        if key == EditKey::OnOff {
            self.is_on = !self.is_on;
            let now = if self.is_on { "on" } else { "off" };
            return Outcome::Said(format!("editing is {now}"));
        }
        if !self.is_on {
            return Outcome::Quiet(false);
        }
        self.look(ray);
        match key {
            EditKey::OnOff => {}
            EditKey::Choose(at) if at < self.tools.len() => self.choose(at),
            EditKey::Choose(_) => {}
            EditKey::ByHand(at) => self.choose(self.tools.len() - Tool::BY_HAND.len() + at),
            EditKey::Step(by) => {
                let n = self.tools.len() as i32;
                self.choose((self.chosen as i32 + by).rem_euclid(n) as usize);
            }
            EditKey::Turn(by) => self.turn += by,
            EditKey::Use { more } => return self.use_tool(more, ray),
            EditKey::Finish => return self.finish(ray),
            EditKey::Grab => return self.grab(ray),
            EditKey::TurnThere => return self.turn_there(ray),
            EditKey::Delete => return self.delete(ray),
            EditKey::Undo | EditKey::Redo => return self.step(key == EditKey::Undo),
            EditKey::Next => return self.next_end(),
            EditKey::Cancel => {
                let was_busy = self.grabbed.is_some() || !self.corners.is_empty();
                self.choose(self.chosen);
                return Outcome::Quiet(was_busy);
            }
        }
        self.look(ray);
        Outcome::Quiet(true)
    }

    fn choose(&mut self, at: usize) {
        self.chosen = at;
        self.turn = 0;
        self.grabbed = None;
        self.corners.clear();
    }

    fn use_tool(&mut self, more: bool, ray: &EditRay<'_>) -> Outcome {
        if let Some(why) = &self.aim.refused {
            return Outcome::Refused(why.clone());
        }
        if self.grabbed.is_none() && self.tool().is_drawn() {
            let Some(at) = self.aim.point else {
                return Outcome::Quiet(true);
            };
            if self.corners.is_empty() {
                self.normal = ray.hit.map_or(DVec3::Y, |[_, normal]| normal);
            }
            self.corners.push(at);
            return if self.corners.len() == 2 && !more {
                self.finish(ray)
            } else {
                let n = self.corners.len();
                Outcome::Said(format!("vertex {n}; Shift adds more, and Enter ends them"))
            };
        }
        let Some(operation) = self.aim.operation.take() else {
            return Outcome::Quiet(true);
        };
        let words = match &operation {
            EditOperation::Put { .. } => "placed ".to_owned(),
            EditOperation::Move(id, _) => format!("moved {}", self.name(*id)),
            EditOperation::Make(edit) => format!("made: {}", edit.kind.word()),
            EditOperation::Unmake(_) => "it is what it was before".to_owned(),
            _ => String::new(),
        };
        let is_put = matches!(operation, EditOperation::Put { .. });
        let made = self.apply(operation, words);
        self.grabbed = None;
        match made {
            Outcome::Edited(words) if is_put => {
                let last = self.session.level().instances().last();
                let name = last.map_or(String::new(), |(_, i)| shown(&i.name).to_string());
                Outcome::Edited(words + &name)
            }
            made => made,
        }
    }

    /// Makes the polygon that is drawn.
    fn finish(&mut self, ray: &EditRay<'_>) -> Outcome {
        let corners = std::mem::take(&mut self.corners);
        if corners.is_empty() {
            return Outcome::Quiet(false);
        }
        let polygon = match self.polygon(&corners, ray) {
            Ok(polygon) => polygon,
            Err(why) => return Outcome::Refused(why),
        };
        let kind = match self.tool() {
            Tool::Mirror => HandEditKind::Mirror(polygon),
            _ => HandEditKind::Portal(polygon),
        };
        let words = format!("made: {}", kind.word());
        let edit = self.session.hosted(&kind);
        self.apply(EditOperation::Make(edit), words)
    }

    pub(super) fn apply(&mut self, operation: EditOperation, words: String) -> Outcome {
        match self.session.apply(operation) {
            Ok(()) => self.edited(words),
            Err(why) => Outcome::Refused(why.to_string()),
        }
    }

    fn edited(&mut self, words: String) -> Outcome {
        self.unsynced.get_or_insert_with(Instant::now);
        self.is_saved = false;
        Outcome::Edited(words)
    }

    pub(super) fn name(&self, id: InstanceId) -> String {
        let instance = self.session.level().standing(id);
        instance.map_or_else(|_| id.0.to_string(), |i| shown(&i.name).to_string())
    }

    fn step(&mut self, back: bool) -> Outcome {
        self.grabbed = None;
        let done = if back {
            self.session.undo()
        } else {
            self.session.redo()
        };
        let [n_done, n_undone] = self.session.n_steps();
        match (done, back) {
            (Ok(true), true) => self.edited(format!("undone; {n_done} more to undo")),
            (Ok(true), false) => self.edited(format!("made again; {n_undone} more to redo")),
            (Ok(false), true) => Outcome::Said("nothing to undo".into()),
            (Ok(false), false) => Outcome::Said("nothing to redo".into()),
            (Err(why), _) => Outcome::Refused(why.to_string()),
        }
    }

    /// Goes to stand before the next open doorway, inside.
    fn next_end(&mut self) -> Outcome {
        let level = self.session.level();
        let ends: Vec<End> = level.open_ends().collect();
        if ends.is_empty() {
            return Outcome::Said("no doorway is open".into());
        }
        self.last_end = self.last_end.wrapping_add(1) % ends.len();
        let end = ends[self.last_end];
        let pose = level
            .standing(end.instance)
            .map_or(Pose::IDENTITY, |i| i.pose);
        let mouth = &level.piece(end.instance).attachments()[end.attachment].mouth;
        let frame = pose.after(&mouth.frame);
        let out = frame.direction(DVec3::Z);
        let up = DVec3::Y * f64::from(EYE_HEIGHT);
        Outcome::Go {
            eye: frame.at + up - out * BACK,
            toward: out,
            words: format!("before {}", shown(&level.end_name(end))),
        }
    }
}

/// Returns an upright diamond around a point.
fn cross(at: DVec3) -> Vec<DVec3> {
    let around = [DVec3::X, DVec3::Y, -DVec3::X, -DVec3::Y];
    around.map(|axis| at + axis * 0.12).to_vec()
}

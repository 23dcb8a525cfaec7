//! The session: a level, changes by hand, and the history of both.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, OnceLock};

use enfilade_cpg::World;
use enfilade_geom::DVec3;
use enfilade_kit::{
    Assembly, FlattenError, InstanceId, Kit, Link, PlaceError, PlaceOptions, open_air,
};
use enfilade_world::{Pose, SpaceError};

use crate::hand::{HandEdit, HandEditError, HandEditKind, is_portal_at};
use crate::journal::{Entry, Journal, JournalError};
use crate::operation::EditOperation;
use crate::own::{OwnWorlds, kinds_of, own_base};

/// State that a session starts from.
#[derive(Clone, Debug)]
pub enum EditGround {
    /// Nothing.
    Open,
    /// A finished world. Pieces cannot be placed in it.
    World(Arc<World>),
    /// An instance of this piece of the kit, at the origin, named like it. It is not an operation, and not undone.
    Piece(usize),
}

/// Reason why an operation is refused. Nothing changes then.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EditError {
    /// A piece cannot be placed, moved or taken away.
    #[error(transparent)]
    Place(#[from] PlaceError),
    /// A change by hand cannot be made.
    #[error(transparent)]
    Hand(#[from] HandEditError),
    /// There is no such change by hand.
    #[error("there is no change by hand {at}; there are {n}, counted from 0")]
    NoHandEdit {
        /// Its number.
        at: usize,
        /// Their number.
        n: usize,
    },
    /// The session has a finished world, which has no place for pieces.
    #[error("pieces cannot be placed in a world that is edited without a kit")]
    NoKit,
    /// An instance was allowed to overlap others.
    #[error(transparent)]
    Flatten(#[from] FlattenError),
    /// The space of the level cannot be made.
    #[error(transparent)]
    Space(#[from] SpaceError),
    /// The journal cannot be read or written.
    #[error(transparent)]
    Journal(#[from] JournalError),
}

/// A world as edited.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct EditedWorld {
    /// The world.
    pub world: World,
    /// Changes by hand that are not in it, by their number, each with the reason.
    pub resting: Vec<(usize, HandEditError)>,
}

/// Account of a journal that was opened.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Resumed {
    /// Number of operations, undos and redos that were made again.
    pub n_entries: usize,
    /// The last line, which was cut off because it had no end.
    pub cut: Option<String>,
}

/// An operation that was made, with what is needed to take it back.
#[derive(Clone, Debug)]
enum Done {
    Piece,
    /// The last change by hand was made. It is held here while that is taken back.
    Made(Option<HandEdit>),
    Unmade(usize, HandEdit),
}

/// A world that is edited.
#[derive(Debug)]
pub struct EditSession {
    level: Assembly,
    /// The finished world, if pieces cannot be placed.
    base: Option<Arc<World>>,
    /// The finished world, or open air.
    around: Arc<World>,
    edits: Vec<HandEdit>,
    done: Vec<Done>,
    undone: Vec<Done>,
    journal: Option<Journal>,
    /// The world as it is now, if it was asked for.
    latest: OnceLock<Arc<EditedWorld>>,
    own: OwnWorlds,
}

impl EditSession {
    /// Begins a session without a journal.
    ///
    /// # Errors
    ///
    /// If the kit lacks the piece of the ground.
    pub fn new(kit: Arc<Kit>, ground: EditGround) -> Result<Self, EditError> {
        let mut level = Assembly::new(kit);
        let base = match ground {
            EditGround::Open => None,
            EditGround::World(world) => Some(world),
            EditGround::Piece(number) => {
                let piece = level.kit().pieces().get(number);
                let options = PlaceOptions {
                    name: piece.map(|p| p.name().to_owned()),
                    ..PlaceOptions::default()
                };
                level.put(number, Pose::IDENTITY, &options)?;
                None
            }
        };
        Ok(Self {
            level,
            around: base.clone().unwrap_or_else(|| Arc::new(open_air())),
            base,
            edits: Vec::new(),
            done: Vec::new(),
            undone: Vec::new(),
            journal: None,
            latest: OnceLock::new(),
            own: OwnWorlds::default(),
        })
    }

    /// Begins a session with a journal, or goes on with one. `mark` is a word that tells the ground from others, such as the hash of
    /// its file; `tolerance` is that of [`Assembly::set_tolerance`].
    ///
    /// # Errors
    ///
    /// As [`EditSession::new`]; if the journal cannot be read and written, is in use, was begun over another ground, or does not fit
    /// the kit.
    pub fn open(
        path: &Path,
        kit: Arc<Kit>,
        ground: EditGround,
        mark: &str,
        tolerance: f64,
    ) -> Result<(Self, Resumed), EditError> {
        let mut session = Self::new(kit, ground)?;
        session.level.set_tolerance(tolerance);
        let (journal, contents) = Journal::open(path, mark)?;
        let resumed = Resumed {
            n_entries: contents.entries.len(),
            cut: contents.cut,
        };
        for (line, entry) in contents.entries {
            let made = match entry {
                Entry::Operation(operation) => session.replayed(&operation),
                Entry::Undo => session.undo().map(drop),
                Entry::Redo => session.redo().map(drop),
            };
            made.map_err(|why| JournalError::Line {
                line,
                why: why.to_string(),
            })?;
        }
        session.journal = Some(journal);
        Ok((session, resumed))
    }

    /// Returns the level.
    #[must_use]
    pub fn level(&self) -> &Assembly {
        &self.level
    }

    /// Returns the changes by hand, in the order in which they are made.
    #[must_use]
    pub fn hand_edits(&self) -> &[HandEdit] {
        &self.edits
    }

    /// Returns the number of operations that can be undone, and redone.
    #[must_use]
    pub fn n_steps(&self) -> [usize; 2] {
        [self.done.len(), self.undone.len()]
    }

    /// Returns `true` if pieces can be placed.
    #[must_use]
    #[doc(hidden)]
    pub fn takes_pieces(&self) -> bool {
        self.base.is_none()
    }

    /// Checks that an operation that places or moves a piece would be made, as for a preview. Others are taken as they are.
    ///
    /// # Errors
    ///
    /// As [`EditSession::apply`].
    pub fn check(&mut self, operation: &EditOperation) -> Result<(), EditError> {
        match operation {
            EditOperation::Put { piece, pose, .. } => {
                let number = self.piece_named(piece)?;
                Ok(self.level.fits(number, pose, &PlaceOptions::default())?)
            }
            EditOperation::Move(id, pose) => Ok(self.level.fits_moved(*id, pose, false)?),
            _ => Ok(()),
        }
    }

    /// Makes an operation, and writes it to the journal. What was undone cannot be redone after that.
    ///
    /// Pieces take time by what is beside them; a change by hand takes that of the world of its instance, or of a finished world; one that is
    /// in no instance, that of [`EditSession::world`].
    ///
    /// # Errors
    ///
    /// Why it is refused: nothing changes then. That the journal cannot be written: then it is not made either.
    pub fn apply(&mut self, operation: EditOperation) -> Result<(), EditError> {
        if let EditOperation::Make(edit) = &operation {
            let kind = self.placed(edit)?;
            let host = edit.host;
            if host.is_none() && self.base.is_none() {
                // Open air knows nothing of the matter of pieces, which may be there.
                kind.make(&mut World::clone(&self.world()?.world))?;
            }
            let before = kinds_of(&self.edits, host);
            let base = own_base(&self.around, &self.level, host);
            let base = base.ok_or(HandEditError::HostGone)?;
            self.own.make(host, &base, &before, &edit.kind)?;
        }
        self.replayed(&operation)?;
        let written = self.write(&Entry::Operation(operation));
        if written.is_err() {
            self.step_back();
            self.undone.clear();
        }
        written
    }

    /// Makes an operation that was made before.
    fn replayed(&mut self, operation: &EditOperation) -> Result<(), EditError> {
        let done = match operation {
            EditOperation::Put { piece, name, pose } => {
                let number = self.piece_named(piece)?;
                let options = PlaceOptions {
                    name: name.clone(),
                    ..PlaceOptions::default()
                };
                self.level.put(number, *pose, &options)?;
                Done::Piece
            }
            EditOperation::Take(id) => {
                self.level.remove(*id)?;
                Done::Piece
            }
            EditOperation::Move(id, pose) => {
                self.level.move_to(*id, *pose, false)?;
                Done::Piece
            }
            EditOperation::Make(edit) => {
                self.placed(edit)?;
                self.edits.push(edit.clone());
                Done::Made(None)
            }
            EditOperation::Unmake(at) => {
                let n = self.edits.len();
                if *at >= n {
                    return Err(EditError::NoHandEdit { at: *at, n });
                }
                Done::Unmade(*at, self.edits.remove(*at))
            }
        };
        self.undone.clear();
        self.done.push(done);
        self.latest = OnceLock::new();
        Ok(())
    }

    /// Takes back the last operation that was not taken back; returns `false` if there is none.
    ///
    /// # Errors
    ///
    /// If the journal cannot be written. Nothing changes then.
    pub fn undo(&mut self) -> Result<bool, EditError> {
        if self.done.is_empty() {
            return Ok(false);
        }
        self.write(&Entry::Undo)?;
        Ok(self.step_back())
    }

    /// Makes the last operation again that was taken back; returns `false` if there is none.
    ///
    /// # Errors
    ///
    /// As [`EditSession::undo`].
    pub fn redo(&mut self) -> Result<bool, EditError> {
        if self.undone.is_empty() {
            return Ok(false);
        }
        self.write(&Entry::Redo)?;
        let Some(mut step) = self.undone.pop() else {
            return Ok(false);
        };
        match &mut step {
            Done::Piece => {
                self.level.redo();
            }
            Done::Made(held) => self.edits.extend(held.take()),
            Done::Unmade(at, _) => {
                self.edits.remove(*at);
            }
        }
        self.done.push(step);
        self.latest = OnceLock::new();
        Ok(true)
    }

    fn step_back(&mut self) -> bool {
        let Some(mut step) = self.done.pop() else {
            return false;
        };
        match &mut step {
            Done::Piece => {
                self.level.undo();
            }
            Done::Made(held) => *held = self.edits.pop(),
            Done::Unmade(at, edit) => self.edits.insert(*at, edit.clone()),
        }
        self.undone.push(step);
        self.latest = OnceLock::new();
        true
    }

    /// Returns the world as it is now, in one piece, as it is saved. Time: linear in the level, and that of each change by hand; none
    /// if it was asked for already. [`EditedSpace`](crate::EditedSpace) follows a session in less.
    ///
    /// # Errors
    ///
    /// None for levels made by operations; as [`Assembly::flattened`].
    pub fn world(&self) -> Result<Arc<EditedWorld>, EditError> {
        if let Some(latest) = self.latest.get() {
            return Ok(Arc::clone(latest));
        }
        let known = self.base.as_ref();
        let known = known.and_then(|_| self.own.known(None, &self.edits));
        if let Some((world, resting)) = known {
            let made = Arc::new(EditedWorld { world, resting });
            return Ok(Arc::clone(self.latest.get_or_init(|| made)));
        }
        let mut world = match &self.base {
            Some(base) => World::clone(base),
            None => self.level.flattened()?,
        };
        let mut resting = Vec::new();
        for (number, edit) in self.edits.iter().enumerate() {
            let made = self.placed(edit).and_then(|kind| kind.make(&mut world));
            if let Err(why) = made {
                resting.push((number, why));
            }
        }
        let made = Arc::new(EditedWorld { world, resting });
        Ok(Arc::clone(self.latest.get_or_init(|| made)))
    }

    /// Returns the worlds of instances with changes by hand in them, in their own frames; under `None`, those that are in none, in the
    /// finished world or in open air. Each is kept until it changes again. What cannot be made is not in it, such as two cells of
    /// different instances as one.
    pub fn own_worlds(&mut self) -> &OwnWorlds {
        let (around, level) = (&self.around, &self.level);
        (self.own).follow(&self.edits, |host| own_base(around, level, host));
        &self.own
    }

    /// Returns the changes by hand that cannot be made now, by their number, each with the reason: as [`EditSession::world`], without
    /// making the whole.
    #[doc(hidden)]
    pub fn resting(&mut self) -> Vec<(usize, HandEditError)> {
        self.own_worlds();
        let mut resting = Vec::new();
        let mut n_of: BTreeMap<Option<InstanceId>, usize> = BTreeMap::new();
        for (number, edit) in self.edits.iter().enumerate() {
            let at = n_of.entry(edit.host).or_default();
            let why = match self.placed(edit) {
                Err(why) => Some(why),
                Ok(kind) => {
                    let walled = || self.is_walled_up(edit).then(|| kind.unfound());
                    self.own.resting(edit.host, *at).or_else(walled)
                }
            };
            *at += 1;
            resting.extend(why.map(|why| (number, why)));
        }
        resting
    }

    /// Returns `true` if a change by hand is of a doorway in front of a wall.
    fn is_walled_up(&self, edit: &HandEdit) -> bool {
        let (HandEditKind::Door(at) | HandEditKind::NoPortal(at), Some(id)) =
            (&edit.kind, edit.host)
        else {
            return false;
        };
        let Ok(instance) = self.level.standing(id) else {
            return false;
        };
        let piece = self.level.piece(id);
        let mut links = piece.attachments().iter().zip(&instance.links);
        links.any(|(attachment, link)| {
            matches!(link, Link::Blocked(_))
                && is_portal_at(&piece.world().graph, attachment.portal, *at)
        })
    }

    /// Returns the worlds of the last [`EditSession::own_worlds`].
    pub(crate) fn known_own(&self) -> &OwnWorlds {
        &self.own
    }

    /// Returns a change by hand, given in the frame of the world, as one that moves with the instance there.
    #[must_use]
    #[doc(hidden)]
    pub fn hosted(&self, kind: &HandEditKind) -> HandEdit {
        let host = self.level.instance_at(kind.at());
        let pose = host.and_then(|id| self.level.standing(id).ok().map(|i| i.pose));
        let kind = match pose {
            Some(pose) => kind.mapped(|p| pose.point_back(p), -heading(&pose)),
            None => kind.clone(),
        };
        HandEdit { host, kind }
    }

    /// Returns a change by hand with its points in the frame of the world.
    ///
    /// # Errors
    ///
    /// If the instance that it moves with does not stand.
    #[doc(hidden)]
    pub fn placed(&self, edit: &HandEdit) -> Result<HandEditKind, HandEditError> {
        let Some(id) = edit.host else {
            return Ok(edit.kind.clone());
        };
        let host = self.level.standing(id);
        let pose = host.map_err(|_| HandEditError::HostGone)?.pose;
        Ok(edit.kind.mapped(|p| pose.point(p), heading(&pose)))
    }

    /// Waits until the journal is on the disk, so that not even the end of the system loses any of it.
    ///
    /// # Errors
    ///
    /// If the disk fails.
    pub fn sync(&self) -> Result<(), EditError> {
        match &self.journal {
            Some(journal) => Ok(journal.sync()?),
            None => Ok(()),
        }
    }

    fn write(&mut self, entry: &Entry) -> Result<(), EditError> {
        match &mut self.journal {
            Some(journal) => Ok(journal.write(entry)?),
            None => Ok(()),
        }
    }

    fn piece_named(&self, name: &str) -> Result<usize, EditError> {
        if self.base.is_some() {
            return Err(EditError::NoKit);
        }
        let number = self.level.kit().named(name);
        Ok(number.ok_or_else(|| PlaceError::NoPiece(name.to_owned()))?)
    }
}

/// Returns the angle about the vertical by which a pose turns. [Units: rad]
fn heading(pose: &Pose) -> f64 {
    let ahead = pose.direction(DVec3::X);
    (-ahead.z).atan2(ahead.x)
}

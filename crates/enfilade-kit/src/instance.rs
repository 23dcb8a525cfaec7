//! Instances of pieces, and where their attachments lead.

use std::sync::Arc;

use enfilade_world::Pose;

use crate::kit::Kit;
use crate::piece::Piece;

/// Number of an instance in an [`Assembly`](crate::Assembly). Numbers of removed instances are not used again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct InstanceId(pub u32);

impl InstanceId {
    pub(crate) fn idx(self) -> usize {
        self.0 as usize
    }
}

/// An attachment of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct End {
    /// The instance.
    pub instance: InstanceId,
    /// Index into [`Piece::attachments`](crate::Piece::attachments).
    pub attachment: usize,
}

/// Place that an attachment of an instance leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// The outdoors.
    Open,
    /// The cell behind another attachment.
    Joined(End),
    /// The wall of another instance.
    Blocked(InstanceId),
}

/// Settings of one placing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlaceOptions {
    /// Name of the instance; that of its piece and a number if absent.
    pub name: Option<String>,
    /// Turn about the normal of the opening, counter-clockwise seen from the piece placed onto. [Units: rad]
    pub spin: f64,
    /// Allows instances whose vertical is not that of the world.
    pub tilt: bool,
    /// Allows instances that overlap others, and openings that are partly walled up. Such an assembly is a [`Space`](enfilade_world::Space)
    /// in which every doorway leads where it should, but no world in one piece.
    pub overlap: bool,
}

/// A placed piece.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Index of its piece in the kit.
    pub piece: usize,
    /// Name, unique among those that stand.
    pub name: String,
    /// Maps points of the piece to those of the level.
    pub pose: Pose,
    /// Where each of its attachments leads.
    pub links: Vec<Link>,
    /// `true` if it may overlap others.
    pub overlaps: bool,
    pub(crate) is_standing: bool,
}

/// All instances of a level, those that no longer stand included.
#[derive(Clone, Debug)]
pub(crate) struct Instances {
    pub(crate) kit: Arc<Kit>,
    pub(crate) all: Vec<Instance>,
}

impl Instances {
    pub(crate) fn get(&self, id: InstanceId) -> &Instance {
        &self.all[id.idx()]
    }

    pub(crate) fn piece(&self, id: InstanceId) -> &Piece {
        &self.kit.pieces()[self.all[id.idx()].piece]
    }

    /// Returns the name of an attachment: `INSTANCE.ATTACHMENT`.
    pub(crate) fn end_name(&self, end: End) -> String {
        let instance = self.get(end.instance);
        let attachments = self.kit.pieces()[instance.piece].attachments();
        let name = attachments.get(end.attachment).map_or("?", |a| &a.name);
        format!("{}.{name}", instance.name)
    }
}

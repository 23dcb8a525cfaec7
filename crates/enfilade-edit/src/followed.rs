//! A session as a space of parts, which changes by what an operation changes: for what is drawn and asked in every frame.

use std::sync::Arc;

use enfilade_cpg::World;
use enfilade_kit::{InstanceId, LevelParts, open_air};
use enfilade_world::{PartId, Pose, Space};

use crate::session::{EditError, EditSession};

/// The parts of a space that are the instances of a session, with the changes by hand in them.
///
/// The space has the cells, portals and walls of [`EditSession::world`], part by part, with two exceptions. Where a doorway between
/// two instances was deleted, they stay two cells. The effect of a change by hand ends at the doorways of its instance: a crate in
/// a doorway is in one of the two rooms.
#[derive(Debug, Default)]
pub struct EditedSpace {
    parts: LevelParts,
    /// The changes by hand in no instance.
    ground: Option<(PartId, Arc<World>)>,
}

impl EditedSpace {
    /// Makes the space of a session that [takes pieces](EditSession::takes_pieces).
    ///
    /// # Errors
    ///
    /// As [`EditedSpace::follow`].
    pub fn new(session: &mut EditSession) -> Result<(Self, Space), EditError> {
        let mut space = Space::new(open_air())?;
        let mut followed = Self::default();
        followed.follow(&mut space, session)?;
        Ok((followed, space))
    }

    /// Brings the space to what the session is now, however many operations, undos and redos later: instances that came, went,
    /// moved, or were changed by hand. As [`LevelParts::follow`].
    ///
    /// # Errors
    ///
    /// None for sessions of sound worlds; as [`Space::add_part`].
    pub fn follow(
        &mut self,
        space: &mut Space,
        session: &mut EditSession,
    ) -> Result<(), EditError> {
        session.own_worlds();
        let (level, own) = (session.level(), session.known_own());
        (self.parts).follow(space, level, |id| own.get(Some(id)).cloned())?;
        let ground = own.get(None);
        let is_same = match (&self.ground, ground) {
            (Some((_, known)), Some(now)) => Arc::ptr_eq(known, now),
            (known, now) => known.is_none() && now.is_none(),
        };
        if !is_same {
            if let Some((part, _)) = self.ground.take() {
                space.forget(part)?;
            }
            if let Some(now) = ground {
                let part = space.add_part(Arc::clone(now), PartId::ROOT, Pose::IDENTITY)?;
                self.ground = Some((part, Arc::clone(now)));
            }
        }
        Ok(())
    }

    /// Returns the part of an instance, if it stands.
    #[must_use]
    pub fn part_of(&self, id: InstanceId) -> Option<PartId> {
        self.parts.part_of(id)
    }

    /// Returns the instance of a part. O(instances).
    #[must_use]
    pub fn instance_of(&self, part: PartId) -> Option<InstanceId> {
        self.parts.instance_of(part)
    }
}

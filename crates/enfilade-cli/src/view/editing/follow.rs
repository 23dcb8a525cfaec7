//! A level in parts, as it is shown: it changes by what an operation changes.

use std::collections::BTreeMap;

use enfilade::edit::{EditError, EditedSpace};
use enfilade::world::{PartId, Space};

use super::editor::Editor;

impl Editor {
    /// Returns `true` if the world is a level that can be shown part by part.
    pub(crate) fn has_parts(&self) -> bool {
        self.session.takes_pieces()
    }

    /// Makes the space of the level, which [`Editor::follow`] then keeps as it is edited.
    pub(crate) fn new_space(&mut self) -> Result<Space, EditError> {
        let (followed, space) = EditedSpace::new(&mut self.session)?;
        self.followed = followed;
        Ok(space)
    }

    /// Brings the space to what the session is now, and notes which changes by hand rest.
    pub(crate) fn follow(&mut self, space: &mut Space) -> Result<(), EditError> {
        self.followed.follow(space, &mut self.session)?;
        let resting = self.session.resting();
        let words = self.resting_words(&resting);
        self.notes.extend(words);
        Ok(())
    }

    /// Returns the names of the parts.
    pub(crate) fn titles(&self) -> BTreeMap<PartId, String> {
        let all = self.session.level().instances();
        let named = all.filter_map(|(id, i)| Some((self.followed.part_of(id)?, i.name.clone())));
        named.collect()
    }
}

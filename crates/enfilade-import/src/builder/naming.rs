//! Names and extras of the input, counted and checked as they are read.

use enfilade_geom::scene::{Fixture, FixtureKind, Primitive, RoomName, SourceNode};

use super::Builder;
use crate::ImportError;
use crate::origins::is_shallow;

impl Builder<'_> {
    /// Adds a node to the tree of names below `parent`. Returns its number, or `parent` if it has no name and no
    /// extras.
    pub(crate) fn add_source(
        &mut self,
        place: &str,
        parent: Option<u32>,
        name: &str,
        extras: &str,
    ) -> Result<Option<u32>, ImportError> {
        let extras = self.kept_extras(place, extras);
        let n_bytes = size_of::<SourceNode>() + name.len() + extras.len();
        self.charge_memory(place, 1, n_bytes as u64)?;
        Ok(self.origins.add(parent, name, extras))
    }

    /// Adds a light, a camera or a marked place, which may name a room.
    pub(crate) fn add_fixture(&mut self, place: &str, fixture: Fixture) -> Result<(), ImportError> {
        if fixture.kind == FixtureKind::Marker
            && fixture.transform.is_finite()
            && let Some(name) = self.room_of(&fixture.name, &fixture.extras)
        {
            let point = fixture.transform.w_axis.truncate();
            self.charge_memory(place, 1, (size_of::<RoomName>() + name.len()) as u64)?;
            self.push_room(RoomName::at(name, point));
        }
        self.keep_fixture(place, fixture)
    }

    /// Adds a light, a camera or a marked place.
    pub(crate) fn keep_fixture(
        &mut self,
        place: &str,
        mut fixture: Fixture,
    ) -> Result<(), ImportError> {
        fixture.extras = self.kept_extras(place, &fixture.extras).to_owned();
        let n_text = fixture.name.len() + fixture.gltf.len() + fixture.extras.len();
        self.charge_memory(place, 1, (size_of::<Fixture>() + n_text) as u64)?;
        if fixture.transform.is_finite() && is_shallow(&fixture.gltf) {
            self.origins.add_fixture(fixture);
        } else {
            self.note(
                place,
                "a light or camera without a finite transform, or nested too deep; left out",
            );
        }
        Ok(())
    }

    /// Keeps the name of a room.
    pub(crate) fn push_room(&mut self, room: RoomName) {
        self.scene.rooms.push(room);
    }

    pub(crate) fn primitives(&self, mesh: u32) -> &[Primitive] {
        &self.scene.meshes[mesh as usize].primitives
    }

    /// Adds the copyright and extras of the file as a whole.
    pub(crate) fn add_about(&mut self, copyright: &str, extras: &str) {
        let extras = self.kept_extras("scene", extras);
        if self.origins.add_about(copyright, extras) {
            self.note(
                "scene",
                "extras of several scenes; only the first in alphabetical order are kept",
            );
        }
    }

    /// Returns the extras, or nothing if they nest too deep for a world.
    fn kept_extras<'t>(&mut self, place: &str, extras: &'t str) -> &'t str {
        if is_shallow(extras) {
            return extras;
        }
        self.note(place, "extras that nest too deep; left out");
        ""
    }

    /// Returns the input's unit, 1 if none was given. [Units: m]
    pub(crate) fn unit(&self) -> f64 {
        self.options.unit.unwrap_or(1.0)
    }
}

//! Names of places: of cells, and in levels put together, of the instances that they are in.

use std::collections::BTreeMap;

use enfilade::cpg::Cell;
use enfilade::geom::{DVec3, shown};
use enfilade::world::{PartId, Place, Space};
use enfilade_render::Camera;

use super::pointed::FAR;

/// Names of parts that are instances; none for a world in one piece.
#[derive(Default)]
pub(super) struct Titles(pub(super) BTreeMap<PartId, String>);

impl Titles {
    /// Returns the name of a cell, as it is in the world that is saved.
    pub(super) fn of(&self, space: &Space, place: Place) -> String {
        let graph = &space.world(place.part).graph;
        let cell = &graph[place.cell];
        let named = match self.0.get(&place.part) {
            None => return shown(&cell.name).to_string(),
            Some(name) if cell.is_room() && graph.rooms().count() == 1 => name.clone(),
            Some(name) => format!("{name}.{}", cell.name),
        };
        shown(&named).to_string()
    }

    /// Returns the name of a cell, and what it is unless a room or the outdoors.
    fn titled(&self, space: &Space, place: Option<Place>) -> String {
        let Some(place) = place else {
            return "no cell".into();
        };
        let cell = &space.world(place.part).graph[place.cell];
        self.of(space, place) + kind_of(cell)
    }

    /// The name of the cell in the middle of the picture: of the air before the surface there.
    pub(super) fn ahead(&self, space: &Space, camera: &Camera) -> String {
        let [.., forward] = camera.axes().map(|axis| axis.as_dvec3());
        let eye = DVec3::from(camera.eye.map(f64::from));
        let far = f64::from(FAR);
        let wall = space.first_wall(PartId::ROOT, [eye, eye + forward * far]);
        let away = (wall.unwrap_or(1.0) * far - 0.02).max(0.0);
        self.titled(space, space.locate(PartId::ROOT, eye + forward * away))
    }

    /// The name of the cell of the eye.
    pub(super) fn here(&self, space: &Space, camera: &Camera) -> String {
        let eye = DVec3::from(camera.eye.map(f64::from));
        self.titled(space, space.locate(PartId::ROOT, eye))
    }
}

fn kind_of(cell: &Cell) -> &'static str {
    match cell {
        _ if cell.is_void => " (void)",
        _ if cell.is_land => " (land)",
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade::World;
    use enfilade::cpg::CellId;

    #[test]
    fn a_title_is_one_line_whatever_the_name() {
        let mut world = World::default();
        world.graph.cells.push(Cell {
            name: "Ha\nll\u{1b}".into(),
            is_void: true,
            ..Cell::default()
        });
        let space = Space::new(world).unwrap();
        let place = Place {
            part: PartId::ROOT,
            cell: CellId(0),
        };
        let title = Titles::default().titled(&space, Some(place));
        assert_eq!(title, r"Ha\nll\u{1b} (void)");
    }
}

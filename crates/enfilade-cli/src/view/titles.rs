//! Names of places: of cells, and in levels put together, of the instances that they are in.

use std::collections::BTreeMap;

use enfilade::cpg::{Cell, Why};
use enfilade::geom::{DVec3, shown};
use enfilade::world::{PartId, Place, Space};
use enfilade_render::{Camera, portal_looked_at};

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
        self.titled(space, place_ahead(space, camera))
    }

    /// The same with why it is there, or why the portal is that the middle of the picture looks through.
    pub(super) fn why_ahead(&self, space: &Space, camera: &Camera) -> String {
        let place = place_ahead(space, camera);
        let (subject, whys): (_, &[Why]) = match portal_looked_at(space, camera) {
            Some((part, portal, _)) => {
                let whys = &space.world(part).graph[portal].why;
                (portal.to_string(), whys)
            }
            None => {
                let of = |place: Place| &space.world(place.part).graph[place.cell].why[..];
                (self.titled(space, place), place.map_or(&[], of))
            }
        };
        let lines = whys.iter().map(|why| format!("\n{why:#}"));
        std::iter::once(subject).chain(lines).collect()
    }

    /// The name of the cell of the eye.
    pub(super) fn here(&self, space: &Space, camera: &Camera) -> String {
        let eye = DVec3::from(camera.eye.map(f64::from));
        self.titled(space, space.locate(PartId::ROOT, eye))
    }
}

/// Returns the place of the air before the surface in the middle of the picture.
fn place_ahead(space: &Space, camera: &Camera) -> Option<Place> {
    let [.., forward] = camera.axes().map(|axis| axis.as_dvec3());
    let eye = DVec3::from(camera.eye.map(f64::from));
    let far = f64::from(FAR);
    let wall = space.first_wall(PartId::ROOT, [eye, eye + forward * far]);
    let away = (wall.unwrap_or(1.0) * far - 0.02).max(0.0);
    space.locate(PartId::ROOT, eye + forward * away)
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
    use enfilade::cpg::{CellId, Fact, PortalId, Reason};
    use enfilade_testkit::{GridParams, room_grid};

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

    #[test]
    fn the_crosshair_tells_why_of_the_doorway_or_else_of_the_cell() {
        let mut world = room_grid(&GridParams::two_rooms());
        let facts = [(Fact::Share, 0.2), (Fact::Area, 1.5)];
        world.graph.portals[0].why = vec![Why::compared(Reason::Narrow, 0.7, &facts)];
        for cell in &mut world.graph.cells {
            cell.why = vec![Why::given(Reason::Unscaled)];
        }
        let vector = |p: [f32; 3]| DVec3::from(p.map(f64::from));
        let portal = world.graph.portals[0].clone();
        let [low, high] = world.graph[portal.cells[0]].aabb.map(vector);
        let eye = 0.5 * (low + high);
        let space = Space::new(world).unwrap();
        let told = |to: DVec3| {
            let camera = Camera {
                eye: eye.as_vec3().to_array(),
                toward: (to - eye).normalize().as_vec3().to_array(),
                fov_y: 1.0,
            };
            Titles::default().why_ahead(&space, &camera)
        };
        let of_portal = told(vector(portal.center()));
        assert!(
            of_portal.starts_with(&format!("{}\ntwo cells", PortalId(0)))
                && of_portal.ends_with("margin 0.71)"),
            "{of_portal}"
        );
        let of_cell = told(eye + DVec3::Y);
        assert!(of_cell.contains("\na room: "), "{of_cell}");
    }
}

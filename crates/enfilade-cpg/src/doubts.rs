//! Signs in a finished world that it is not the one that was meant: no rooms, no floors, doorways that lie flat.
//!
//! A graph does not record intentions; but buildings have floors and doorways for people, and a scene read on its
//! side, in a wrong unit or with its furniture taken for walls has not. In doubt, nothing is reported.

use enfilade_geom::DVec3;
use enfilade_geom::triangle_area_normal;

use crate::{Cell, CellId, CellPortalGraph, Portal, PortalKind, World};

/// Least share of a room's footprint that a floor covers, or an opening to the sky.
const PART: f32 = 0.25;
/// Least and largest usual height of a door. The leaves of halls and of cupboards are others; so the middle one
/// counts. [Units: wu]
const DOOR: [f32; 2] = [1.4, 3.5];
/// Largest usual height of doorways without leaves: those of levels are about 4 m high. [Units: wu]
const GATE: f32 = 5.0;
/// Doors are at least so many times as high as wide.
const SLIM: f32 = 1.5;
/// Smaller graphs show nothing by their shares.
const FEW: usize = 3;
/// Rooms of levels and halls have fewer openings each than this; furniture taken for walls makes more.
const MANY: usize = 12;

/// A sign that a world is not the one that was meant.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Doubt {
    /// No cell is a room or a void: all air is open to the outdoors.
    NoRooms,
    /// Nobody can stand in any of the spaces, whose number this is.
    OnlyVoids(usize),
    /// So many of the openings to walk through between rooms lie in floors and ceilings, of so many.
    FlatDoorways(usize, usize),
    /// So many rooms have no floor, of so many.
    NoFloors(usize, usize),
    /// The doors are as high as this, in the middle. [Units: wu]
    DoorHeight(f32),
    /// There are more voids than rooms.
    MoreVoids {
        /// Number of voids.
        voids: usize,
        /// Number of rooms.
        rooms: usize,
    },
    /// Several rooms, and so many openings, none of which one can walk through.
    NoDoorways {
        /// Number of rooms.
        rooms: usize,
        /// Number of portals.
        openings: usize,
    },
    /// Far more openings than rooms.
    ManyOpenings {
        /// Number of portals but cracks.
        openings: usize,
        /// Number of cells indoors.
        cells: usize,
    },
    /// So many rooms are open to the sky, of so many.
    OpenToSky(usize, usize),
    /// More gaps of the model than doorways and windows.
    MoreCracks {
        /// Number of cracks.
        cracks: usize,
        /// Number of other portals.
        others: usize,
    },
    /// So many rooms have no doorway, of so many.
    NoDoorway(usize, usize),
}

impl Cell {
    /// Returns `true` if a person fits in its box.
    #[must_use]
    #[doc(hidden)]
    pub fn holds_person(&self) -> bool {
        /// [Units: wu]
        const PERSON: [f32; 3] = [0.6, 1.8, 0.6];
        (0..3).all(|k| self.aabb[1][k] - self.aabb[0][k] >= PERSON[k])
    }

    fn footprint(&self) -> f32 {
        (self.aabb[1][0] - self.aabb[0][0]) * (self.aabb[1][2] - self.aabb[0][2])
    }
}

impl Portal {
    fn is_doorway(&self) -> bool {
        matches!(self.kind, PortalKind::Open | PortalKind::Door)
    }
}

impl World {
    /// Returns the signs that the world is not the one that was meant, the gravest first. Linear time.
    #[must_use]
    pub fn doubts(&self) -> Vec<Doubt> {
        let graph = &self.graph;
        let rooms: Vec<(CellId, &Cell)> = graph.rooms().collect();
        let n_land = graph.cells.iter().filter(|c| c.is_land).count();
        let n_indoors = graph.indoor_cells().count() - n_land;
        if n_indoors == 0 && n_land > 0 {
            return Vec::new(); // land without houses was not meant to have rooms
        }
        if n_indoors == 0 {
            return vec![Doubt::NoRooms];
        }
        if rooms.is_empty() {
            return vec![Doubt::OnlyVoids(n_indoors)];
        }
        let all = [
            flat_doorways(graph),
            self.unfloored(&rooms),
            door_height(graph),
            more_voids(n_indoors - rooms.len(), rooms.len()),
            doorways(graph, &rooms),
            many_openings(graph, n_indoors + n_land),
            open_to_sky(graph, &rooms),
            more_cracks(graph),
        ];
        all.into_iter().flatten().collect()
    }

    /// Finds rooms without level surface in their lower half.
    fn unfloored(&self, rooms: &[(CellId, &Cell)]) -> Option<Doubt> {
        let middle = |c: &Cell| 0.5 * (c.aabb[0][1] + c.aabb[1][1]);
        let mut floor = vec![0.0_f64; self.graph.cells.len()];
        for batch in &self.batches {
            for t in batch.primitive.triangles() {
                let normal = 0.5 * triangle_area_normal(&t);
                let height: f64 = t.iter().map(|p: &DVec3| p.y).sum::<f64>() / 3.0;
                for &cell in &batch.cells {
                    if height < f64::from(middle(&self.graph[cell])) {
                        floor[cell.0 as usize] += normal.y.abs();
                    }
                }
            }
        }
        let has_none = |(id, cell): &&(CellId, &Cell)| {
            floor[id.0 as usize] < f64::from(PART * cell.footprint())
        };
        let n = rooms.iter().filter(has_none).count();
        (2 * n > rooms.len()).then_some(Doubt::NoFloors(n, rooms.len()))
    }
}

fn flat_doorways(graph: &CellPortalGraph) -> Option<Doubt> {
    // Over open rooms, an opening to the sky lies flat, too.
    let is_inside = |p: &&Portal| p.cells.iter().all(|c| graph[*c].is_indoors());
    let doorways = || {
        let inside = graph.portals.iter().filter(is_inside);
        inside.filter(|p| p.is_doorway())
    };
    let (all, flat) = (
        doorways().count(),
        doorways().filter(|p| p.is_level()).count(),
    );
    (all >= FEW && 2 * flat > all).then_some(Doubt::FlatDoorways(flat, all))
}

/// Judges the middle height of the doors; without any, of open doorways between rooms as slim as doors.
fn door_height(graph: &CellPortalGraph) -> Option<Doubt> {
    let upright = || graph.portals.iter().filter(|p| !p.is_level());
    let doors = upright().filter(|p| p.kind == PortalKind::Door);
    let mut heights: Vec<f32> = doors.map(|p| p.size()[1]).collect();
    let mut usual = DOOR;
    if heights.is_empty() {
        let is_inside = |p: &&Portal| p.cells.iter().all(|c| graph[*c].is_indoors());
        let open = upright().filter(|p| p.kind == PortalKind::Open);
        let sizes = open.filter(is_inside).map(Portal::size);
        heights.extend(sizes.filter(|[w, h]| *h > SLIM * w).map(|s| s[1]));
        if heights.len() < FEW {
            return None;
        }
        usual = [0.0, GATE];
    }
    heights.sort_by(f32::total_cmp);
    let height = *heights.get(heights.len() / 2)?;
    let is_usual = (usual[0]..=usual[1]).contains(&height);
    (!is_usual).then_some(Doubt::DoorHeight(height))
}

fn more_voids(voids: usize, rooms: usize) -> Option<Doubt> {
    (voids > rooms).then_some(Doubt::MoreVoids { voids, rooms })
}

fn doorways(graph: &CellPortalGraph, rooms: &[(CellId, &Cell)]) -> Option<Doubt> {
    let has_none = |cell: &&Cell| !cell.portals.iter().any(|p| graph[*p].is_doorway());
    let large = rooms.iter().map(|r| r.1).filter(|c| c.holds_person());
    let (n, of) = (large.clone().filter(has_none).count(), large.count());
    let openings = graph.portals.len();
    if n == 0 || openings == 0 {
        // A closed box is a room, too.
        None
    } else if n == of && of > 1 {
        let rooms = rooms.len();
        Some(Doubt::NoDoorways { rooms, openings })
    } else {
        Some(Doubt::NoDoorway(n, of))
    }
}

fn many_openings(graph: &CellPortalGraph, cells: usize) -> Option<Doubt> {
    let is_opening = |p: &&Portal| p.kind != PortalKind::Crack;
    let openings = graph.portals.iter().filter(is_opening).count();
    (openings > MANY * cells).then_some(Doubt::ManyOpenings { openings, cells })
}

fn open_to_sky(graph: &CellPortalGraph, rooms: &[(CellId, &Cell)]) -> Option<Doubt> {
    let is_open = |(_, cell): &&(CellId, &Cell)| {
        let overhead = cell.portals.iter().map(|p| &graph[*p]).filter(|p| {
            let is_out = p.cells.iter().any(|c| graph[*c].outdoor);
            is_out && p.is_level() && p.kind != PortalKind::Window
        });
        overhead.map(|p| p.area).sum::<f32>() > PART * cell.footprint()
    };
    let n = rooms.iter().filter(is_open).count();
    (n > 0).then_some(Doubt::OpenToSky(n, rooms.len()))
}

fn more_cracks(graph: &CellPortalGraph) -> Option<Doubt> {
    let is_crack = |p: &&Portal| p.kind == PortalKind::Crack;
    let cracks = graph.portals.iter().filter(is_crack).count();
    let others = graph.portals.len() - cracks;
    (cracks > others).then_some(Doubt::MoreCracks { cracks, others })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Batch, PortalId};
    use enfilade_geom::scene::Primitive;

    /// Rooms of 4 × 3 × 4 m in a row with floors, and outdoors as the last cell.
    fn row(n: usize) -> World {
        let mut world = World::default();
        let mut floor = Primitive::default();
        for i in 0..n {
            let x = 4.0 * i as f32;
            world.graph.cells.push(Cell {
                name: format!("cell-{i}"),
                aabb: [[x, 0.0, 0.0], [x + 4.0, 3.0, 4.0]],
                ..Cell::default()
            });
            floor.positions = vec![
                [x, 0.0, 0.0],
                [x, 0.0, 4.0],
                [x + 4.0, 0.0, 4.0],
                [x + 4.0, 0.0, 0.0],
            ];
            floor.indices = vec![0, 1, 2, 0, 2, 3];
            world.batches.push(Batch {
                cells: vec![CellId(i as u32)],
                primitive: floor.clone(),
                ..Batch::default()
            });
        }
        world.graph.cells.push(Cell {
            outdoor: true,
            ..Cell::default()
        });
        world
    }

    /// Adds an opening of a width and height, upright along x.
    fn open(world: &mut World, cells: [u32; 2], kind: PortalKind, [w, h]: [f32; 2]) {
        let id = PortalId(world.graph.portals.len() as u32);
        let outline = vec![[0.0, 0.0, 0.0], [0.0, 0.0, w], [0.0, h, w], [0.0, h, 0.0]];
        world.graph.portals.push(Portal {
            cells: cells.map(CellId),
            kind,
            normal: [1.0, 0.0, 0.0],
            pieces: vec![outline.clone()],
            outline,
            area: w * h,
            fittings: Vec::new(),
            why: Vec::new(),
        });
        for cell in cells {
            world.graph.cells[cell as usize].portals.push(id);
        }
    }

    fn with_doors(n: u32, height: f32) -> World {
        let mut world = row(n as usize);
        for i in 0..n {
            open(&mut world, [i, i + 1], PortalKind::Door, [0.9, height]);
        }
        world
    }

    #[test]
    fn a_row_of_rooms_with_doors_is_not_in_doubt() {
        assert_eq!(with_doors(4, 2.0).doubts(), []);
        // A closed box has no opening at all.
        assert_eq!(row(1).doubts(), []);
    }

    #[test]
    fn a_world_without_rooms_is_in_doubt() {
        assert_eq!(row(0).doubts(), [Doubt::NoRooms]);
        let mut voids = row(2);
        voids
            .graph
            .cells
            .iter_mut()
            .for_each(|c| c.is_void = !c.outdoor);
        assert_eq!(voids.doubts(), [Doubt::OnlyVoids(2)]);
        let mut world = with_doors(4, 2.0);
        world.graph.cells[..3]
            .iter_mut()
            .for_each(|c| c.is_void = true);
        let doubt = Doubt::MoreVoids { voids: 3, rooms: 1 };
        assert!(world.doubts().contains(&doubt), "{:?}", world.doubts());
    }

    #[test]
    fn doors_that_lie_flat_or_are_too_high_are_in_doubt() {
        let mut world = with_doors(4, 2.0);
        for p in &mut world.graph.portals {
            p.normal = [0.0, 1.0, 0.0];
        }
        // The last leads outdoors.
        assert_eq!(world.doubts()[0], Doubt::FlatDoorways(3, 3));
        assert_eq!(with_doors(4, 6.6).doubts(), [Doubt::DoorHeight(6.6)]);
        let mut world = with_doors(4, 6.6);
        world
            .graph
            .portals
            .iter_mut()
            .for_each(|p| p.kind = PortalKind::Open);
        assert_eq!(world.doubts(), [Doubt::DoorHeight(6.6)]);
    }

    #[test]
    fn rooms_without_floors_are_in_doubt() {
        let mut world = with_doors(4, 2.0);
        world.batches.truncate(1);
        assert_eq!(world.doubts(), [Doubt::NoFloors(3, 4)]);
    }

    #[test]
    fn openings_without_doorways_are_in_doubt() {
        let mut world = row(2);
        for _ in 0..5 {
            open(&mut world, [0, 1], PortalKind::Window, [0.9, 1.0]);
        }
        let (rooms, openings) = (2, 5);
        assert_eq!(world.doubts(), [Doubt::NoDoorways { rooms, openings }]);
        for _ in 0..20 {
            open(&mut world, [0, 1], PortalKind::Open, [0.9, 2.0]);
        }
        let doubt = Doubt::ManyOpenings {
            openings: 25,
            cells: 2,
        };
        assert_eq!(world.doubts(), [doubt]);
    }

    #[test]
    fn rooms_open_to_the_sky_and_cracks_are_in_doubt() {
        let mut world = with_doors(2, 2.0);
        open(&mut world, [0, 2], PortalKind::Open, [4.0, 4.0]);
        world.graph.portals[2].normal = [0.0, 1.0, 0.0];
        assert_eq!(world.doubts(), [Doubt::OpenToSky(1, 2)]);
        let mut world = with_doors(2, 2.0);
        for _ in 0..3 {
            open(&mut world, [0, 1], PortalKind::Crack, [0.01, 2.0]);
        }
        let (cracks, others) = (3, 2);
        assert_eq!(world.doubts(), [Doubt::MoreCracks { cracks, others }]);
    }
}

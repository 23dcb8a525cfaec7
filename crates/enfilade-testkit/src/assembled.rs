//! Worlds put together into one at an instant: the truth for rooms that move.

use std::sync::Arc;

use enfilade_cpg::{
    Batch, Cell, CellId, CellPortalGraph, Locator, LocatorNode, Portal, PortalId, PortalKind, World,
};
use enfilade_geom::scene::Primitive;
use enfilade_geom::{Aabb, DMat4, DQuat, DVec3};

/// A world at a pose.
#[derive(Clone, Copy)]
pub struct Standing<'a> {
    /// The world.
    pub world: &'a World,
    /// Its rotation.
    pub turn: DQuat,
    /// Position of its origin. [Units: wu]
    pub at: DVec3,
}

/// End of a door to the surroundings.
#[derive(Clone, Copy, Debug)]
pub enum Beyond {
    /// A cell of the first world.
    Cell(CellId),
    /// The room behind a door of another world.
    Door(usize, PortalId),
}

/// Worlds as one world.
pub struct Assembled {
    /// All cells, portals and triangles, in the frame of the poses, rounded to `f32`.
    pub world: World,
    /// Per input, the number of its first cell.
    pub first_cell: Vec<u32>,
}

/// Puts worlds together as if they had been modeled so: their doors of `doors` become ordinary portals, all others to their
/// surroundings are left out, except those of the first world. Leaves of doors of the others do not move.
///
/// # Panics
///
/// If there is no such world or door.
#[must_use]
pub fn assembled(all: &[Standing<'_>], doors: &[(usize, PortalId, Beyond)]) -> Assembled {
    let (mut world, mut first_cell) = (World::default(), Vec::new());
    let mut n_cells = 0;
    for standing in all {
        first_cell.push(n_cells);
        n_cells += standing.world.graph.cells.len() as u32;
    }
    for (i, standing) in all.iter().enumerate() {
        // The surroundings of a cabin are in the shaft around it.
        let around = doors.iter().find_map(|door| match door.2 {
            Beyond::Cell(cell) if door.0 == i => Some(cell),
            _ => None,
        });
        let around = around.or(all[0].world.graph.locator.outside);
        add(&mut world, standing, first_cell[i], around);
    }
    for (i, standing) in all.iter().enumerate() {
        let graph = &standing.world.graph;
        for (id, portal) in (0..).map(PortalId).zip(&graph.portals) {
            let is_out = portal.cells.iter().any(|c| graph[*c].outdoor);
            let known = doors.iter().find(|d| (d.0, d.1) == (i, id));
            let is_second = doors
                .iter()
                .any(|d| matches!(d.2, Beyond::Door(k, p) if (k, p) == (i, id)));
            if is_second || (is_out && i > 0 && known.is_none()) {
                continue;
            }
            let mut cells = portal.cells.map(|c| CellId(c.0 + first_cell[i]));
            if let Some((_, _, beyond)) = known {
                let outer = portal.cells.iter().position(|c| graph[*c].outdoor);
                cells[outer.expect("a door to the surroundings")] = match beyond {
                    Beyond::Cell(cell) => *cell,
                    Beyond::Door(k, p) => {
                        let graph = &all[*k].world.graph;
                        let inner = graph[*p].cells.iter().find(|c| !graph[**c].outdoor);
                        CellId(inner.expect("a room behind a door").0 + first_cell[*k])
                    }
                };
            }
            let fittings = match known {
                _ if i == 0 => portal.fittings.clone(),
                Some((_, _, Beyond::Door(0, p))) => all[0].world.graph[*p].fittings.clone(),
                _ => Vec::new(),
            };
            let number = PortalId(world.graph.portals.len() as u32);
            for cell in cells {
                world.graph.cells[cell.idx()].portals.push(number);
            }
            let place = |p: &[f32; 3]| placed(standing, p);
            world.graph.portals.push(Portal {
                cells,
                kind: portal.kind,
                normal: (standing.turn * point(&portal.normal)).as_vec3().to_array(),
                outline: portal.outline.iter().map(place).collect(),
                pieces: (portal.pieces.iter())
                    .map(|piece| piece.iter().map(place).collect())
                    .collect(),
                area: portal.area,
                fittings,
                why: Vec::new(),
            });
        }
    }
    world.graph.locator = locator(all, &first_cell).into();
    Assembled { world, first_cell }
}

fn point(p: &[f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

fn placed(standing: &Standing<'_>, p: &[f32; 3]) -> [f32; 3] {
    (standing.turn * point(p) + standing.at)
        .as_vec3()
        .to_array()
}

/// Adds the cells and triangles of a world; `around` is the cell around it.
fn add(all: &mut World, standing: &Standing<'_>, first_cell: u32, around: Option<CellId>) {
    let world = standing.world;
    let moved = |cells: &[CellId]| -> Vec<CellId> {
        let one = |c: &CellId| {
            let is_around = first_cell > 0 && world.graph[*c].outdoor;
            let own = CellId(c.0 + first_cell);
            if is_around {
                around.unwrap_or(own)
            } else {
                own
            }
        };
        let mut cells: Vec<CellId> = cells.iter().map(one).collect();
        cells.sort_unstable();
        cells
    };
    for cell in &world.graph.cells {
        let corners = Aabb::of_points(&cell.aabb.map(|p| point(&p))).corners();
        let bounds = Aabb::of_points(&corners.map(|p| standing.turn * p + standing.at));
        all.graph.cells.push(Cell {
            aabb: [bounds.min, bounds.max].map(|p| p.as_vec3().to_array()),
            portals: Vec::new(),
            // The surroundings of the others are left over, without portals.
            outdoor: cell.outdoor && first_cell == 0,
            ..cell.clone()
        });
    }
    for batch in &world.batches {
        let positions = batch.primitive.positions.iter();
        all.batches.push(Batch {
            cells: moved(&batch.cells),
            primitive: Primitive {
                positions: positions.map(|p| placed(standing, p)).collect(),
                ..batch.primitive.clone()
            },
            ..batch.clone()
        });
    }
    let first_mesh = all.detail_meshes.len() as u32;
    let to_all = DMat4::from_rotation_translation(standing.turn, standing.at);
    for detail in &world.details {
        let mut detail = detail.clone();
        let place = to_all * detail.placement();
        detail.transform = place.to_cols_array().map(|x| x as f32);
        detail.mesh += first_mesh;
        detail.cells = moved(&detail.cells);
        (detail.source, detail.part_of) = (None, None);
        all.details.push(detail);
    }
    all.detail_meshes.extend_from_slice(&world.detail_meshes);
    if first_cell == 0 {
        all.materials.clone_from(&world.materials);
    }
}

/// Returns a tree that asks the last world first: the box around its rooms, then its own tree; where that has no room, the world
/// before it.
fn locator(all: &[Standing<'_>], first_cell: &[u32]) -> Locator {
    let mut tree = Locator {
        bounds: Aabb::EMPTY,
        outside: all[0].world.graph.locator.outside,
        ..Locator::default()
    };
    // The trees in order, so that children come after their parents.
    for (i, standing) in all.iter().enumerate().rev() {
        let own = &standing.world.graph.locator;
        let rooms = standing.world.graph.indoor_cells();
        let mut bounds = rooms.fold(Aabb::EMPTY, |bounds, (_, cell)| {
            bounds.union(Aabb::of_points(&cell.aabb.map(|p| point(&p))))
        });
        if i == 0 {
            bounds = own.bounds;
        }
        let first = tree.nodes.len() as i32;
        let n_box = 6;
        let next = first + n_box + own.nodes.len() as i32;
        let rest = if i == 0 {
            Locator::leaf(tree.outside)
        } else {
            next
        };
        let child = |at: i32| {
            if at >= 0 {
                return at + first + n_box;
            }
            let cell = (at <= -2).then(|| CellId((-2 - at) as u32));
            let is_outdoor = |c: CellId| standing.world.graph[c].outdoor;
            match cell {
                // Walls of a cabin are in the air of its shaft.
                _ if i > 0 && cell.is_none_or(is_outdoor) => rest,
                None => -1,
                Some(cell) => Locator::leaf(Some(CellId(cell.0 + first_cell[i]))),
            }
        };
        let mut add = |normal: DVec3, d: f64, children: [i32; 2]| {
            let normal = standing.turn * normal;
            tree.planes
                .push([normal.x, normal.y, normal.z, d - normal.dot(standing.at)]);
            let plane = tree.planes.len() as u32 - 1;
            tree.nodes.push(LocatorNode { plane, children });
        };
        for k in 0..6 {
            let inside = if k == 5 {
                child(own.root)
            } else {
                first + k + 1
            };
            let axis = DVec3::AXES[k as usize / 2];
            if k % 2 == 0 {
                add(axis, -bounds.min.dot(axis), [inside, rest]);
            } else {
                add(-axis, bounds.max.dot(axis), [inside, rest]);
            }
        }
        for node in &own.nodes {
            let [x, y, z, d] = own.planes[node.plane as usize];
            add(DVec3::new(x, y, z), d, node.children.map(child));
        }
        let corners = bounds.corners().map(|p| standing.turn * p + standing.at);
        tree.bounds = corners.into_iter().fold(tree.bounds, Aabb::including);
    }
    tree.root = 0;
    tree
}

/// Returns a room from the origin to `size`, in the open, with walls without thickness, and a door in the wall of greatest z: from
/// and to x, and its height.
#[must_use]
pub fn chamber(size: DVec3, [from, to]: [f64; 2], height: f64) -> World {
    let corner = |x: f64, y: f64, z: f64| DVec3::new(x, y, z).as_vec3().to_array();
    let [w, h, d] = size.to_array();
    let wall = |x: [f64; 2], y: [f64; 2]| {
        [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[i, k]| corner(x[i], y[k], d))
    };
    let quads = [
        [[0.0, 0.0], [w, 0.0], [w, d], [0.0, d]].map(|[x, z]| corner(x, 0.0, z)),
        [[0.0, 0.0], [w, 0.0], [w, d], [0.0, d]].map(|[x, z]| corner(x, h, z)),
        [[0.0, 0.0], [h, 0.0], [h, d], [0.0, d]].map(|[y, z]| corner(0.0, y, z)),
        [[0.0, 0.0], [h, 0.0], [h, d], [0.0, d]].map(|[y, z]| corner(w, y, z)),
        [[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]].map(|[x, y]| corner(x, y, 0.0)),
        wall([0.0, from], [0.0, h]),
        wall([to, w], [0.0, h]),
        wall([from, to], [height, h]),
    ];
    let positions: Vec<[f32; 3]> = (quads.iter())
        .flat_map(|q| [0, 1, 2, 0, 2, 3].map(|k| q[k]))
        .collect();
    let outline = wall([from, to], [0.0, height]).to_vec();
    let cell = |name: &str, outdoor: bool| Cell {
        name: name.to_owned(),
        aabb: [corner(0.0, 0.0, 0.0), corner(w, h, d)],
        volume: (w * h * d) as f32,
        portals: vec![PortalId(0)],
        outdoor,
        ..Cell::default()
    };
    World {
        graph: CellPortalGraph {
            cells: vec![cell("cell-0", false), cell("outdoors", true)],
            portals: vec![Portal {
                cells: [CellId(0), CellId(1)],
                kind: PortalKind::Open,
                normal: [0.0, 0.0, 1.0],
                pieces: vec![outline.clone()],
                outline,
                area: ((to - from) * height) as f32,
                fittings: Vec::new(),
                why: Vec::new(),
            }],
            locator: Arc::new(Locator {
                bounds: Aabb::new(DVec3::ZERO, size),
                outside: Some(CellId(1)),
                root: Locator::leaf(Some(CellId(0))),
                ..Locator::default()
            }),
            ..CellPortalGraph::default()
        },
        batches: vec![Batch {
            cells: vec![CellId(0), CellId(1)],
            primitive: Primitive {
                indices: (0..positions.len() as u32).collect(),
                positions,
                ..Primitive::default()
            },
            ..Batch::default()
        }],
        ..World::default()
    }
}

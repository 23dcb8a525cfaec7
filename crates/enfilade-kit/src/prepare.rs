//! From a bake to a piece: portals of attachments move to the outer faces of their walls, and the space it takes up is
//! collected.

use std::collections::BTreeSet;

use enfilade_cpg::{Batch, CellId, Locator, LocatorNode, World};
use enfilade_geom::scene::Primitive;
use enfilade_geom::{Aabb, DVec3, Plane, Triangle};
use enfilade_world::Pose;

use crate::body::Body;
use crate::fit::point;
use crate::region::{Region, for_each_leaf};
use crate::shape::{Attachment, PieceShape};
use crate::tree::{Planted, grown};
use crate::tunnel;

/// Shortest way that a portal is worth moving. [Units: wu]
const NEAR: f64 = 1e-5;
/// Distance within which a triangle touches a tunnel. [Units: wu]
const TOUCH: f64 = 1e-4;
/// Depth behind a surface at which its solid is looked for. [Units: wu]
const BEHIND: f64 = 1e-3;

/// Moves the portals of attachments to the ends of their tunnels, and gives the tunnels to the cells inside.
pub(crate) fn move_to_faces(world: &mut World, outdoors: CellId, attachments: &mut [Attachment]) {
    let structure: Vec<Triangle> = structure(world).collect();
    let mut tunnels: Vec<(CellId, Vec<Plane>)> = Vec::new();
    for attachment in attachments {
        let depth = tunnel::depth(&attachment.mouth, &structure);
        if depth < NEAR {
            continue;
        }
        let out = attachment.mouth.frame.direction(DVec3::Z);
        tunnels.push((attachment.cell, sides(attachment, depth)));
        let portal = &mut world.graph.portals[attachment.portal.idx()];
        let corners = portal.pieces.iter_mut().flatten();
        for p in corners.chain(&mut portal.outline) {
            *p = (point(*p) + out * depth).as_vec3().to_array();
        }
        attachment.mouth.frame.at += out * depth;
    }
    if tunnels.is_empty() {
        return;
    }
    world.graph.locator = with_tunnels(world, outdoors, &tunnels).into();
    for (cell, sides) in &tunnels {
        show_tunnel(world, *cell, sides);
    }
}

fn structure(world: &World) -> impl Iterator<Item = Triangle> {
    world.batches.iter().flat_map(|b| b.primitive.triangles())
}

/// Returns the planes around a tunnel, facing inwards.
fn sides(attachment: &Attachment, depth: f64) -> Vec<Plane> {
    let corners = attachment.mouth.corners();
    let out = attachment.mouth.frame.direction(DVec3::Z);
    let mut sides: Vec<Plane> = (0..corners.len())
        .map(|k| {
            let [a, b] = [corners[k], corners[(k + 1) % corners.len()]];
            Plane::through(a, out.cross(b - a).normalize_or_zero())
        })
        .collect();
    sides.push(Plane::through(corners[0], out));
    sides.push(Plane::through(corners[0] + out * depth, -out));
    sides
}

/// Returns the world's locator with tunnels as parts of cells.
fn with_tunnels(world: &World, outdoors: CellId, tunnels: &[(CellId, Vec<Plane>)]) -> Locator {
    let trees: Vec<(Locator, Aabb)> = (tunnels.iter())
        .map(|(cell, sides)| {
            let bounds = bounds_of(sides, &world.graph.locator.bounds);
            (chain(sides, Locator::leaf(Some(*cell)), outdoors), bounds)
        })
        .collect();
    let own: &Locator = &world.graph.locator;
    let is_inner = |cell: CellId| (cell != outdoors).then_some(cell);
    let planted = trees.iter().map(|(tree, bounds)| (tree, *bounds));
    let planted = planted.chain([(own, own.bounds)]);
    let planted: Vec<Planted<'_>> = planted
        .map(|(locator, bounds)| Planted {
            locator,
            pose: Pose::IDENTITY,
            bounds,
            cells: &is_inner,
        })
        .collect();
    let bounds = planted.iter().map(|p| p.bounds);
    grown(bounds.fold(Aabb::EMPTY, Aabb::union), outdoors, &planted)
}

/// Returns the box around the region within planes.
fn bounds_of(sides: &[Plane], within: &Aabb) -> Aabb {
    let mut region = Some(Region::of_box(&within.expanded(1.0)));
    for side in sides {
        region = region.and_then(|r| r.split(side).into_iter().next().flatten());
    }
    region.map_or(Aabb::EMPTY, |r| r.bounds())
}

/// Returns the tree of a convex region: `inside` within all planes, elsewhere the cell `outside`.
fn chain(sides: &[Plane], inside: i32, outside: CellId) -> Locator {
    let n = sides.len() as i32;
    let node = |(i, side): (i32, &Plane)| {
        let next = if i + 1 == n { inside } else { i + 1 };
        let plane = [side.normal.x, side.normal.y, side.normal.z, side.d];
        let children = [next, Locator::leaf(Some(outside))];
        (
            plane,
            LocatorNode {
                plane: i as u32,
                children,
            },
        )
    };
    let (planes, nodes) = (0..).zip(sides).map(node).unzip();
    Locator {
        planes,
        nodes,
        root: 0,
        outside: Some(outside),
        ..Locator::default()
    }
}

/// Lists a cell for all triangles and objects that touch a tunnel of it.
fn show_tunnel(world: &mut World, cell: CellId, sides: &[Plane]) {
    let touches = |t: &Triangle| {
        let is_out = |side: &Plane| t.iter().all(|p| side.signed_distance(*p) < -TOUCH);
        !sides.iter().any(is_out)
    };
    let mut added = Vec::new();
    for batch in &mut world.batches {
        if batch.cells.contains(&cell) {
            continue;
        }
        let is_in: Vec<bool> = batch.primitive.triangles().map(|t| touches(&t)).collect();
        if is_in.contains(&true) {
            let mut part = part_of(batch, |k| is_in[k]);
            part.cells.push(cell);
            part.cells.sort_unstable();
            added.push(part);
            *batch = part_of(batch, |k| !is_in[k]);
        }
    }
    world.batches.append(&mut added);
    world.batches.retain(|b| !b.primitive.indices.is_empty());
    let meshes = &world.detail_meshes;
    for detail in &mut world.details {
        if detail.cells.contains(&cell) {
            continue;
        }
        let placement = detail.placement();
        let primitives = &meshes[detail.mesh as usize].primitives;
        let mut triangles = primitives
            .iter()
            .flat_map(|p| p.placed_triangles(placement));
        if triangles.any(|t| touches(&t)) {
            detail.cells.push(cell);
            detail.cells.sort_unstable();
        }
    }
}

/// Returns the triangles of a batch that are kept, by number, with the vertices of all.
pub(crate) fn part_of(batch: &Batch, is_kept: impl Fn(usize) -> bool) -> Batch {
    let triples = batch.primitive.triples().iter().enumerate();
    let kept = triples.filter(|(k, _)| is_kept(*k));
    let mut part = Batch {
        cells: batch.cells.clone(),
        primitive: Primitive {
            indices: kept.flat_map(|(_, t)| *t).collect(),
            ..batch.primitive.clone()
        },
        is_seal: batch.is_seal,
        ..Batch::default()
    };
    for (k, source) in batch.sources.of_triangles().enumerate() {
        part.sources.push(source, u32::from(is_kept(k)));
    }
    part
}

/// Returns the space that a piece takes up; makes its locator start with the box around it, and measures its cells.
pub(crate) fn shape(world: &mut World, outdoors: CellId) -> PieceShape {
    let mut shape = PieceShape {
        air: Vec::new(),
        matter: Vec::new(),
        air_bounds: Aabb::EMPTY,
        bounds: Aabb::EMPTY,
        hull: Aabb::EMPTY,
    };
    let locator = &world.graph.locator;
    for_each_leaf(
        locator,
        Region::of_box(&locator.bounds),
        &mut |leaf, region| {
            if leaf == Locator::leaf(Some(outdoors)) {
                return;
            }
            let body = Body::of_region(&region);
            shape.bounds = shape.bounds.union(body.bounds);
            if leaf == -1 {
                &mut shape.matter
            } else {
                &mut shape.air
            }
            .push(body);
        },
    );
    shape.matter.extend(sheets(world, outdoors));
    world.graph.locator = boxed(&world.graph.locator, &shape.bounds, outdoors).into();
    let air = shape.air.iter();
    shape.air_bounds = air.fold(Aabb::EMPTY, |bounds, body| bounds.union(body.bounds));
    let bodies = shape.air.iter().chain(&shape.matter);
    shape.hull = bodies.fold(Aabb::EMPTY, |hull, body| hull.union(body.bounds));
    measure(world);
    shape
}

/// Returns a tree that asks first whether a point is in a box, so that it holds everywhere.
fn boxed(locator: &Locator, bounds: &Aabb, outdoors: CellId) -> Locator {
    let mut out = locator.clone();
    if bounds.is_empty() {
        return out;
    }
    let first_plane = out.planes.len() as u32;
    let shifted = |child: i32| if child < 0 { child } else { child + 6 };
    let own = locator.nodes.iter().map(|node| LocatorNode {
        plane: node.plane,
        children: node.children.map(shifted),
    });
    let faces = [[bounds.min, DVec3::ONE], [bounds.max, DVec3::NEG_ONE]];
    out.nodes.clear();
    for k in 0..6_u32 {
        let [corner, sign] = faces[k as usize % 2];
        let side = Plane::through(corner, DVec3::AXES[k as usize / 2] * sign.x);
        out.planes
            .push([side.normal.x, side.normal.y, side.normal.z, side.d]);
        let next = if k == 5 {
            shifted(locator.root)
        } else {
            k as i32 + 1
        };
        out.nodes.push(LocatorNode {
            plane: first_plane + k,
            children: [next, Locator::leaf(Some(outdoors))],
        });
    }
    out.nodes.extend(own);
    out.root = 0;
    out
}

/// Returns what is outdoors without a solid behind it: triangles, and boxes around objects.
fn sheets(world: &World, outdoors: CellId) -> Vec<Body> {
    let locator = &world.graph.locator;
    let is_open = |p: DVec3| locator.locate(p) == Some(outdoors);
    let mut sheets = Vec::new();
    for batch in world.batches.iter().filter(|b| b.cells.contains(&outdoors)) {
        for t in batch.primitive.triangles() {
            let normal = (t[1] - t[0]).cross(t[2] - t[0]).normalize_or_zero() * BEHIND;
            let middle = (t[0] + t[1] + t[2]) / 3.0;
            let is_skin = (0..3).map(|k| t[k].lerp(middle, 0.1)).chain([middle]);
            let is_skin = is_skin
                .into_iter()
                .all(|p| !(is_open(p - normal) && is_open(p + normal)));
            if !is_skin {
                sheets.push(Body::of_polygons(std::iter::once(&t[..])));
            }
        }
    }
    // Leaves and frames of doors may stick out of their walls, and into the next piece.
    let portals = world.graph.portals.iter();
    let fittings: BTreeSet<u32> = portals
        .flat_map(|p| &p.fittings)
        .map(|f| f.detail)
        .collect();
    let numbered = (0..).zip(&world.details);
    for (number, detail) in numbered.filter(|(_, d)| d.cells.contains(&outdoors)) {
        if fittings.contains(&number) {
            continue;
        }
        let placement = detail.placement();
        let primitives = &world.detail_meshes[detail.mesh as usize].primitives;
        let vertices = primitives
            .iter()
            .flat_map(|p| p.placed_triangles(placement))
            .flatten();
        let bounds = vertices.fold(Aabb::EMPTY, Aabb::including);
        if !bounds.is_empty() {
            sheets.push(Body::of_region(&Region::of_box(&bounds)));
        }
    }
    sheets
}

/// Sets boxes, volumes and counts of all cells from the locator and the geometry.
pub(crate) fn measure(world: &mut World) {
    let graph = &mut world.graph;
    let n = graph.cells.len();
    let mut volumes = vec![0.0; n];
    let mut boxes = vec![Aabb::EMPTY; n];
    let bounds = graph.locator.bounds;
    for_each_leaf(
        &graph.locator,
        Region::of_box(&bounds),
        &mut |leaf, region| {
            if let Ok(cell) = usize::try_from(-2 - leaf) {
                volumes[cell] += region.volume();
                boxes[cell] = boxes[cell].union(region.bounds());
            }
        },
    );
    for (i, cell) in graph.cells.iter_mut().enumerate() {
        cell.volume = volumes[i] as f32;
        let own = if cell.outdoor { bounds } else { boxes[i] };
        if !own.is_empty() {
            cell.aabb = [own.min, own.max].map(|p| p.as_vec3().to_array());
        }
        (cell.n_triangles, cell.n_detail_triangles) = (0, 0);
    }
    for batch in world.batches.iter().filter(|b| !b.is_seal) {
        for cell in &batch.cells {
            graph.cells[cell.idx()].n_triangles += (batch.primitive.indices.len() / 3) as u32;
        }
    }
    for detail in &world.details {
        let primitives = &world.detail_meshes[detail.mesh as usize].primitives;
        let n: usize = primitives.iter().map(|p| p.indices.len() / 3).sum();
        for cell in &detail.cells {
            graph.cells[cell.idx()].n_detail_triangles += n as u32;
        }
    }
}

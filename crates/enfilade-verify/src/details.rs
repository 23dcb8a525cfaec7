//! Detail objects list exactly the cells that they touch.
//!
//! Only the locator decides, with room for the rounding of builders: a cell that an object clearly reaches must be
//! listed, and one that it does not come near must not. An object buried in solid matter, as a door frame is in its
//! wall, belongs to the cells around it; only the nearest of those are certain.

use enfilade_cpg::{CellId, DetailObject, Locator, World};
use enfilade_geom::poly::{self, Poly};
use enfilade_geom::{Aabb, DVec3, Plane, Triangle};
use rayon::prelude::*;

use crate::locator_cells::plane_of;

/// Distance of possible contact: within 0.1 mm of a plane, plus the move by a transform in `f32`. [Units: wu]
const NEAR: f64 = 2e-4;
/// Depth of certain contact. [Units: wu]
const CLEARLY: f64 = 5e-4;
/// Largest distance of the cells of a buried object from its box. [Units: wu]
const AROUND: f64 = 0.5;
/// Distance from the box of a buried object that is searched for cells first. [Units: wu]
const NEAREST: f64 = 0.05;

/// Returns problems, a line each.
pub(crate) fn check(world: &World) -> Vec<String> {
    let rounding = 1e-6 * world.graph.locator.bounds.extent().max(0.0);
    let objects = world.details.par_iter().enumerate();
    objects
        .filter_map(|(i, detail)| {
            let what = problem(world, detail, rounding)?;
            Some(format!("detail {i} ({}): {what}", detail.name))
        })
        .collect()
}

fn problem(world: &World, detail: &DetailObject, rounding: f64) -> Option<String> {
    let triangles = triangles_of(world, detail);
    let locator = &world.graph.locator;
    let (mut sure, mut possible) = (Vec::new(), Vec::new());
    for t in &triangles {
        reach(locator, t, CLEARLY + rounding, &mut sure);
        reach(locator, t, -(NEAR + rounding), &mut possible);
    }
    if triangles.is_empty() {
        return None;
    }
    if sure.is_empty() {
        let b = Aabb::of_points(triangles.iter().flatten());
        if possible.is_empty() {
            add_at_corners(locator, &b.expanded(NEAREST), &mut sure);
        }
        if sure.is_empty() && detail.cells.is_empty() {
            add_at_corners(locator, &b.expanded(AROUND), &mut sure);
        }
        add_around(
            locator,
            &b.expanded(AROUND + NEAR + rounding),
            &mut possible,
        );
    }
    let name = |c: &CellId| &world.graph[*c].name;
    let lacks = sure.iter().find(|c| !detail.cells.contains(c));
    let wrong = detail.cells.iter().find(|c| !possible.contains(c));
    match (lacks, wrong) {
        (Some(c), _) => Some(format!("touches {}, which it does not list", name(c))),
        (None, Some(c)) => Some(format!("lists {}, which it does not touch", name(c))),
        (None, None) => None,
    }
}

pub(crate) fn triangles_of(world: &World, detail: &DetailObject) -> Vec<Triangle> {
    let by = detail.placement();
    let primitives = world.detail_meshes[detail.mesh as usize].primitives.iter();
    primitives.flat_map(|p| p.placed_triangles(by)).collect()
}

/// Adds the cells whose leaves the triangle reaches by at least `depth`; if that is negative, leaves near it, too.
fn reach(locator: &Locator, triangle: &Triangle, depth: f64, cells: &mut Vec<CellId>) {
    let bounds = locator.bounds;
    let mut whole: Option<Poly> = Some(triangle.iter().copied().collect());
    let inner = bounds.expanded(-depth);
    if triangle
        .iter()
        .any(|&p| !bounds.expanded(depth).contains(p))
    {
        add(cells, locator.outside);
    }
    if depth > 0.0 {
        // Beyond the box the tree goes on, but without meaning.
        whole = (!inner.is_empty())
            .then(|| poly::clip_to_box(triangle, &inner, 0.0))
            .flatten();
    }
    let mut stack: Vec<(i32, Poly)> = whole.into_iter().map(|p| (locator.root, p)).collect();
    while let Some((at, part)) = stack.pop() {
        if at < 0 {
            add(cells, (at <= -2).then(|| CellId((-2 - at) as u32)));
            continue;
        }
        let plane = plane_of(locator, at as usize);
        let [front, back] = locator.nodes[at as usize].children;
        for (child, plane) in [(front, plane), (back, plane.flipped())] {
            let moved = Plane {
                d: plane.d - depth,
                ..plane
            };
            stack.extend(poly::clip(&part, &moved, 0.0).map(|part| (child, part)));
        }
    }
}

fn add(cells: &mut Vec<CellId>, cell: Option<CellId>) {
    cells.extend(cell.filter(|c| !cells.contains(c)));
}

fn add_at_corners(locator: &Locator, b: &Aabb, cells: &mut Vec<CellId>) {
    for k in 0..8 {
        let pick = |axis: usize| {
            if k >> axis & 1 == 0 {
                b.min[axis]
            } else {
                b.max[axis]
            }
        };
        add(cells, locator.locate(DVec3::new(pick(0), pick(1), pick(2))));
    }
}

/// Adds all cells that may share space with the box.
fn add_around(locator: &Locator, b: &Aabb, cells: &mut Vec<CellId>) {
    if !(locator.bounds.contains(b.min) && locator.bounds.contains(b.max)) {
        add(cells, locator.outside);
    }
    let (middle, half) = (b.center(), b.size() * 0.5);
    let mut stack = vec![locator.root];
    while let Some(at) = stack.pop() {
        if at < 0 {
            add(cells, (at <= -2).then(|| CellId((-2 - at) as u32)));
            continue;
        }
        let plane = plane_of(locator, at as usize);
        let (height, radius) = (plane.signed_distance(middle), plane.normal.abs().dot(half));
        let [front, back] = locator.nodes[at as usize].children;
        stack.extend((height >= -radius).then_some(front));
        stack.extend((height <= radius).then_some(back));
    }
}

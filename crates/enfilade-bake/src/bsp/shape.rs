//! Where each leaf is: its box, its volume and a point well inside.

use std::collections::BTreeMap;

use enfilade_geom::{Aabb, DVec3, Plane};

use crate::complex::poly::{self, Poly, Sides};

use super::Tolerance;
use super::tree::{Tree, leaf_index};

/// A leaf's measures.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    pub(crate) bounds: Aabb,
    /// Mean of its corners.
    pub(crate) middle: DVec3,
    pub(crate) volume: f64,
}

/// A convex region by its faces, each with the plane that looks inwards.
pub(crate) type Region = Vec<(Plane, Poly)>;

/// Measures of all leaves; none for those that rounding has left without a volume.
pub(super) fn shapes(tree: &Tree, tolerance: &Tolerance) -> Vec<Option<Shape>> {
    let mut out = vec![None; tree.contents.len()];
    visit(
        tree,
        tree.root,
        whole(&tree.bounds, tolerance.cut),
        tolerance.cut,
        &mut |leaf, region| {
            out[leaf as usize] = shape_of(&region);
        },
    );
    out
}

/// The leaves for which `is_wanted` says so, with their faces.
pub(super) fn regions(
    tree: &Tree,
    tolerance: &Tolerance,
    is_wanted: &dyn Fn(u32) -> bool,
) -> BTreeMap<u32, Region> {
    let mut out = BTreeMap::new();
    visit(
        tree,
        tree.root,
        whole(&tree.bounds, tolerance.cut),
        tolerance.cut,
        &mut |leaf, region| {
            if is_wanted(leaf) {
                out.insert(leaf, region);
            }
        },
    );
    out
}

/// The least width of each cell along any of `directions`, given the cell of each leaf. [Units: wu]
///
/// Infinite for a cell without a leaf that has a volume. Time: directions times corners of leaves.
pub(super) fn widths(
    tree: &Tree,
    tolerance: &Tolerance,
    of_leaf: &[u32],
    n_cells: usize,
    directions: &[DVec3],
) -> Vec<f64> {
    let n = directions.len();
    let mut ranges = vec![[f64::INFINITY, f64::NEG_INFINITY]; n_cells * n];
    let region = whole(&tree.bounds, tolerance.cut);
    visit(
        tree,
        tree.root,
        region,
        tolerance.cut,
        &mut |leaf, region| {
            let cell = of_leaf[leaf as usize] as usize;
            if cell >= n_cells || shape_of(&region).is_none() {
                return;
            }
            let ranges = &mut ranges[cell * n..(cell + 1) * n];
            for p in region.iter().flat_map(|(_, points)| points) {
                for (range, direction) in ranges.iter_mut().zip(directions) {
                    let at = direction.dot(*p);
                    *range = [range[0].min(at), range[1].max(at)];
                }
            }
        },
    );
    let width = |[low, high]: &[f64; 2]| {
        if low <= high {
            high - low
        } else {
            f64::INFINITY
        }
    };
    (0..n_cells)
        .map(|c| {
            ranges[c * n..(c + 1) * n]
                .iter()
                .map(width)
                .fold(f64::INFINITY, f64::min)
        })
        .collect()
}

/// A box as a region.
pub(crate) fn whole(b: &Aabb, eps: f64) -> Region {
    let mut region = Region::new();
    for n in [DVec3::X, DVec3::Y, DVec3::Z] {
        for plane in [Plane::through(b.min, n), Plane::through(b.max, -n)] {
            if let Some(face) = poly::section_of_box(&plane, &b.expanded(1e-6), eps) {
                region.push((plane, face));
            }
        }
    }
    region
}

fn visit(tree: &Tree, child: i32, region: Region, eps: f64, take: &mut dyn FnMut(u32, Region)) {
    if child < 0 {
        return take(leaf_index(child), region);
    }
    let node = &tree.nodes[child as usize];
    let plane = tree.planes[node.plane as usize];
    for (region, child) in halves(region, &plane, &tree.bounds, eps)
        .into_iter()
        .zip(node.children)
    {
        visit(tree, child, region, eps, take);
    }
}

/// The parts before and behind a plane.
pub(crate) fn halves(region: Region, plane: &Plane, bounds: &Aabb, eps: f64) -> [Region; 2] {
    let mut sides = [Region::new(), Region::new()];
    if let Some(mut cap) = poly::section_of_box(plane, bounds, eps) {
        let is_there = region
            .iter()
            .all(|(face, _)| match poly::clip(&cap, face, eps) {
                Some(rest) => {
                    cap = rest;
                    true
                }
                None => false,
            });
        if is_there {
            sides[0].push((*plane, cap.clone()));
            sides[1].push((plane.flipped(), cap));
        }
    }
    for (face, points) in region {
        match poly::split(&points, plane, eps) {
            Sides::Front => sides[0].push((face, points)),
            Sides::Back => sides[1].push((face, points)),
            Sides::On => {
                let side = usize::from(face.normal.dot(plane.normal) < 0.0);
                sides[side].push((face, points));
            }
            Sides::Both(f, b) => {
                sides[0].push((face, f));
                sides[1].push((face, b));
            }
        }
    }
    sides
}

/// Measures of a region.
pub(crate) fn shape_of(region: &[(Plane, Poly)]) -> Option<Shape> {
    let corners = || region.iter().flat_map(|(_, points)| points.iter().copied());
    let n = corners().count();
    if region.len() < 4 {
        return None;
    }
    let middle = corners().sum::<DVec3>() / n as f64;
    let volume: f64 = region
        .iter()
        .map(|(face, points)| poly::area(points) * face.signed_distance(middle) / 3.0)
        .sum();
    (volume > 0.0).then(|| Shape {
        bounds: corners().fold(Aabb::EMPTY, Aabb::including),
        middle,
        volume,
    })
}

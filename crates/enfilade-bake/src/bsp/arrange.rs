//! Finds openings in the plane of a wall that the tree did not cut along that plane.
//!
//! A tree that has cut out a doorway by the planes of its jambs and lintel has no reason left to cut it by
//! the plane of the wall's face, and misses the separator there. Lefebvre & Hornus 2003 (§3.0.2) note
//! that the arrangement of all planes would contain all separators, and that it is too large. It is not
//! needed: the section of a surface's plane with the open leaves around its surfaces is searched for
//! separators as if it were portals, and only the leaves under valid ones are cut.
//!
//! Time: each plane visits the leaves around its own surfaces, near-linear if they are spread out. Planes
//! with most surface come first, and the number of sections is limited, so that it is near-linear for any scene.

use enfilade_geom::Aabb;
use rayon::prelude::*;

use crate::MergeSettings;
use crate::complex::poly::{self, Poly, Sides};

use super::leaves::Bsp;
use super::portals::{LeafPortal, leaf_portals};
use super::tree::{Node, Tree, leaf_index};
use super::{lattice, separator};

/// Sections tried for each portal and surface of the tree; buildings need 1 to 5.
const TRIALS: usize = 8;
/// Planes tried before their sections are counted.
const AT_ONCE: usize = 64;

/// Cuts the leaves where a surface's plane closes an opening that is narrower than the space beside it.
pub(super) fn refine(bsp: &mut Bsp<'_>, settings: &MergeSettings) {
    let mut around: Vec<(Aabb, f64)> = vec![(Aabb::EMPTY, 0.0); bsp.tree.planes.len()];
    for f in &bsp.surfaces {
        let (b, area) = &mut around[f.plane as usize];
        *b = b.union(Aabb::of_points(&f.points));
        *area += poly::area(&f.points);
    }
    // Planes with much surface first: they are walls. The sections of surfaces that lie close together grow
    // with the square of their number.
    let is_wall = bsp.wall_planes();
    let mut order: Vec<u32> = (0..around.len() as u32)
        .filter(|&p| is_wall[p as usize] && !around[p as usize].0.is_empty())
        .collect();
    order.sort_by(|&a, &b| {
        let area = |p: u32| around[p as usize].1;
        area(b).total_cmp(&area(a)).then(a.cmp(&b))
    });
    let n_portals = bsp.portals.len();
    let budget = TRIALS * (n_portals + bsp.surfaces.len());
    let mut trial: Vec<LeafPortal> = Vec::new();
    for planes in order.chunks(AT_ONCE) {
        let found: Vec<Vec<LeafPortal>> = planes
            .par_iter()
            .map(|&plane| {
                let mut out = Vec::new();
                let bounds = around[plane as usize].0.expanded(settings.surround);
                let plane_at = &bsp.tree.planes[plane as usize];
                if let Some(section) = poly::section_of_box(plane_at, &bounds, bsp.tolerance.cut) {
                    sections(bsp, bsp.tree.root, plane, &section, &mut out);
                }
                out
            })
            .collect();
        trial.extend(found.into_iter().flatten());
        if trial.len() > budget {
            break;
        }
    }
    bsp.portals.extend(trial);
    let cuts: Vec<(u32, Poly)> = separator::find_in_walls(bsp)
        .into_par_iter()
        .filter(|s| s.portals.iter().any(|&p| p as usize >= n_portals))
        .filter(|s| lattice::may_be_pinch(bsp, s, settings))
        .flat_map_iter(|s| {
            let is_trial = move |p: &u32| *p as usize >= n_portals;
            s.portals.into_iter().filter(is_trial)
        })
        .map(|p| {
            let p = &bsp.portals[p as usize];
            (p.plane, p.points.clone())
        })
        .collect();
    bsp.portals.truncate(n_portals);
    if cuts.is_empty() {
        return;
    }
    for (plane, points) in cuts.into_iter().filter(bsp.purse.each(100)) {
        let (root, eps) = (bsp.tree.root, bsp.tolerance.cut);
        bsp.tree.root = cut(&mut bsp.tree, &mut bsp.is_open, root, plane, &points, eps);
    }
    bsp.portals = leaf_portals(&bsp.tree, &bsp.tolerance, bsp.purse);
    bsp.drop_closed_portals();
}

/// Collects the parts of a polygon in `plane` that lie within open leaves and in no node's plane.
fn sections(
    bsp: &Bsp<'_>,
    child: i32,
    plane: u32,
    points: &[enfilade_geom::DVec3],
    out: &mut Vec<LeafPortal>,
) {
    if !bsp.purse.spend(2) {
        return;
    }
    if child < 0 {
        let leaf = leaf_index(child);
        if bsp.is_open[leaf as usize] && poly::width(points) > bsp.tolerance.width {
            out.push(LeafPortal {
                leaves: [leaf; 2],
                plane,
                points: points.into(),
            });
        }
        return;
    }
    let node = &bsp.tree.nodes[child as usize];
    if node.plane == plane {
        // Its portals exist already.
        return;
    }
    match poly::split(
        points,
        &bsp.tree.planes[node.plane as usize],
        bsp.tolerance.plane,
    ) {
        Sides::On => {}
        Sides::Front => sections(bsp, node.children[0], plane, points, out),
        Sides::Back => sections(bsp, node.children[1], plane, points, out),
        Sides::Both(a, b) => {
            sections(bsp, node.children[0], plane, &a, out);
            sections(bsp, node.children[1], plane, &b, out);
        }
    }
}

/// Cuts the leaves that a polygon passes through by its plane; returns the replacement of `child`.
fn cut(
    tree: &mut Tree,
    is_open: &mut Vec<bool>,
    child: i32,
    plane: u32,
    points: &[enfilade_geom::DVec3],
    eps: f64,
) -> i32 {
    if child < 0 {
        let leaf = leaf_index(child) as usize;
        if !is_open[leaf] {
            return child;
        }
        let new = tree.contents.len() as i32;
        tree.contents.push(tree.contents[leaf]);
        is_open.push(true);
        tree.nodes.push(Node {
            plane,
            children: [child, -1 - new],
            on_start: tree.on_plane.len() as u32,
        });
        return tree.nodes.len() as i32 - 1;
    }
    let node = tree.nodes[child as usize];
    if node.plane == plane {
        return child;
    }
    let parts = match poly::split(points, &tree.planes[node.plane as usize], eps) {
        Sides::On => [None, None],
        Sides::Front => [Some(points.into()), None],
        Sides::Back => [None, Some(points.into())],
        Sides::Both(a, b) => [Some(a), Some(b)],
    };
    for (side, part) in parts.into_iter().enumerate() {
        if let Some(part) = part {
            let now = cut(tree, is_open, node.children[side], plane, &part, eps);
            tree.nodes[child as usize].children[side] = now;
        }
    }
    child
}

//! The convex leaves of the locator's tree, cut out of its box one by one.

use enfilade_cpg::{CellId, Locator, World};
use enfilade_geom::poly::{self, Poly, Sides};
use enfilade_geom::{Aabb, DVec3, Plane, Winding};

/// Volume and box of a cell in the locator.
#[derive(Clone, Copy)]
pub(crate) struct Extent {
    pub(crate) volume: f64,
    /// Around all leaves, hairs between nearly coincident planes included, which a builder may assign to either side.
    pub(crate) bounds: Aabb,
    /// Around the leaves that are not hairs.
    pub(crate) thick: Aabb,
}

/// A leaf is a hair if its volume is less than this times its largest face. [Units: wu]
const HAIR: f64 = 1e-3;

/// A convex body as its faces, vertices counter-clockwise seen from outside.
pub(crate) type Body = Vec<Poly>;

/// Returns volume and box of each cell within the locator's box.
///
/// Time: leaves times faces of a leaf.
pub(crate) fn measure(world: &World) -> Vec<Extent> {
    let none = Extent {
        volume: 0.0,
        bounds: Aabb::EMPTY,
        thick: Aabb::EMPTY,
    };
    let mut out = vec![none; world.graph.cells.len()];
    for_each_leaf(&world.graph.locator, |cell, body| {
        let Some(extent) = cell.and_then(|c| out.get_mut(c.idx())) else {
            return;
        };
        let volume = volume(body);
        extent.volume += volume;
        let around = Aabb::of_points(body.iter().flatten());
        extent.bounds = extent.bounds.union(around);
        let face = body.iter().map(|f| poly::area(f)).fold(0.0, f64::max);
        if volume > HAIR * face {
            extent.thick = extent.thick.union(around);
        }
    });
    out
}

/// Calls `visit` with each leaf of a locator's tree as a convex body, and its cell; `None` for solid. A valid locator
/// is a tree, so each leaf is visited once.
pub(crate) fn for_each_leaf(locator: &Locator, mut visit: impl FnMut(Option<CellId>, &Body)) {
    if locator.bounds.is_empty() {
        return;
    }
    let eps = 1e-10 * locator.bounds.extent().max(1.0);
    let mut stack = vec![(locator.root, box_body(&locator.bounds))];
    while let Some((at, body)) = stack.pop() {
        if at < 0 {
            visit((at <= -2).then(|| CellId((-2 - at) as u32)), &body);
            continue;
        }
        let plane = plane_of(locator, at as usize);
        let (front, back) = split(body, &plane, eps);
        let parts = locator.nodes[at as usize].children.into_iter();
        stack.extend(parts.zip([front, back]).filter(|(_, body)| body.len() > 3));
    }
}

/// Returns the plane of a node, with a unit normal.
pub(crate) fn plane_of(locator: &Locator, node: usize) -> Plane {
    let [x, y, z, d] = locator.planes[locator.nodes[node].plane as usize];
    let normal = DVec3::new(x, y, z);
    let length = normal.length();
    Plane {
        normal: normal / length,
        d: d / length,
    }
}

fn box_body(b: &Aabb) -> Body {
    b.faces().map(|face| face.into_iter().collect()).into()
}

/// Returns the parts in front of and behind a plane; a part without faces is empty.
fn split(body: Body, plane: &Plane, eps: f64) -> (Body, Body) {
    let heights = body.iter().flatten().map(|p| plane.signed_distance(*p));
    let (low, high) = heights.fold((f64::MAX, f64::MIN), |(l, h), d| (l.min(d), h.max(d)));
    if low >= -eps {
        return (body, Vec::new());
    }
    if high <= eps {
        return (Vec::new(), body);
    }
    let (mut front, mut back) = (Vec::new(), Vec::new());
    // Faces that only touch the plane bound the section, too: it may run along edges all around.
    let is_near = |p: &DVec3| plane.signed_distance(*p).abs() <= 2.0 * eps;
    let mut rim = Vec::new();
    for face in body {
        match poly::split(&face, plane, eps) {
            Sides::Front => {
                rim.extend(face.iter().copied().filter(is_near));
                front.push(face);
            }
            Sides::Back => back.push(face),
            // Flat in the plane, although the body is on both sides of it: a hair left by rounding.
            Sides::On => {}
            Sides::Both(f, b) => {
                rim.extend(f.iter().copied().filter(is_near));
                front.push(f);
                back.push(b);
            }
        }
    }
    let cap = Winding::hull_in_plane(plane, &rim).points;
    if cap.len() >= 3 {
        back.push(cap.iter().copied().collect());
        front.push(cap.iter().rev().copied().collect());
    }
    (front, back)
}

fn volume(body: &Body) -> f64 {
    let Some(&o) = body.first().and_then(|f| f.first()) else {
        return 0.0;
    };
    let cone = |f: &Poly| (f[0] - o).dot(poly::area_normal(f)) / 6.0;
    body.iter().map(cone).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_along_edges_all_around_halves_a_body() {
        let mut octahedron = Body::new();
        for k in 0..8 {
            let sign = |axis: usize| if k >> axis & 1 == 0 { 1.0 } else { -1.0 };
            let mut face = [DVec3::X * sign(0), DVec3::Y * sign(1), DVec3::Z * sign(2)];
            if sign(0) * sign(1) * sign(2) < 0.0 {
                face.swap(0, 1);
            }
            octahedron.push(face.into_iter().collect());
        }
        let whole = volume(&octahedron);
        assert!((whole - 4.0 / 3.0).abs() < 1e-12, "{whole}");
        let equator = Plane::through(DVec3::ZERO, DVec3::Y);
        let (front, back) = split(octahedron, &equator, 1e-9);
        for half in [front, back] {
            assert!((volume(&half) - 2.0 / 3.0).abs() < 1e-12);
        }
    }
}

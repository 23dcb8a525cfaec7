//! Orients all triangles of a shell alike, and those of solids outwards.
//!
//! Neighbors must traverse their common edge in opposite directions (Gjørup 1999, §2.4.1). The outer side of a closed
//! shell follows from the sign of its volume, the sum of the signed tetrahedra over its triangles.

use std::collections::HashMap;

use enfilade_geom::{Aabb, DVec3, triangle_area_normal};

use super::surface::{Surface, unit};
use crate::shells::Shells;

/// Radius of the smallest room, the same as the watershed's. [Units: wu]
const ROOM: f64 = 0.3;

/// Most shells per object tested as enclosing others: those with the largest boxes.
const ENCLOSING: usize = 64;

/// Changes by orientation.
#[derive(Default)]
pub(super) struct Turned {
    pub(super) n_triangles: u64,
    /// Closed shells with all triangles outwards that had some inwards before.
    pub(super) n_outwards: u64,
    /// Closed shells that face inwards: rooms modeled from within.
    pub(super) n_rooms: u64,
    /// Shells with one side only, left unchanged.
    pub(super) n_one_sided: u64,
}

#[derive(Clone, Copy)]
struct Shell {
    object: u32,
    /// Area of the triangles oriented as the root is, and of those oriented against it.
    area: [f64; 2],
    n: [u64; 2],
    /// Six times the volume, with all triangles oriented as the root is.
    volume: f64,
    bounds: Aabb,
    is_closed: bool,
    is_one_sided: bool,
}

/// Turns triangles until those of each shell agree; `n log n`.
///
/// Open shells keep the side with most area. Closed ones face outwards, with two exceptions that face inwards, as
/// rooms modeled from within or insides of hollow solids: most of their area faces inwards, and either a ball of 0.3
/// m might fit in (three times the volume over the area, at least the radius in any convex body) or they lie inside
/// another shell of their object.
pub(super) fn orient(surface: &mut Surface) -> Turned {
    let mut shells = joined(surface);
    let n = surface.faces.len();
    let roots: Vec<(u32, bool)> = (0..n as u32).map(|f| shells.root(f)).collect();
    let sums = sums(surface, &shells, &roots);
    let boxes = boxes(&sums);
    let mut turned = Turned::default();
    let mut is_wrong = vec![[false; 2]; n];
    for (root, shell) in sums.iter().enumerate() {
        let Some(shell) = shell else { continue };
        if shell.is_one_sided {
            turned.n_one_sided += 1;
            continue;
        }
        // The orientation to keep; 0 is the root's.
        let stays = if shell.is_closed {
            let outwards = usize::from(shell.volume < 0.0);
            let size = 0.5 * shell.volume.abs() / (shell.area[0] + shell.area[1]);
            let faces_in = shell.area[1 - outwards] > shell.area[outwards];
            if faces_in && (size >= ROOM || is_enclosed(shell, &boxes)) {
                turned.n_rooms += 1;
                1 - outwards
            } else {
                turned.n_outwards += u64::from(shell.n[1 - outwards] > 0);
                outwards
            }
        } else {
            usize::from(shell.area[1] > shell.area[0])
        };
        is_wrong[root][1 - stays] = true;
    }
    for (face, &(root, is_turned)) in roots.iter().enumerate() {
        if is_wrong[root as usize][usize::from(is_turned)] {
            turn(surface, face);
            turned.n_triangles += 1;
        }
    }
    turned
}

fn joined(surface: &Surface) -> Shells {
    let mut shells = Shells::new(surface.faces.len());
    for edge in surface
        .uses()
        .chunk_by(|a, b| (a.ends, a.object) == (b.ends, b.object))
    {
        if let [one, other] = edge {
            shells.join(one.face, other.face, one.is_reverse == other.is_reverse);
        } else {
            edge.iter().for_each(|u| shells.mark_unclosed(u.face));
        }
    }
    shells
}

/// Returns the sums over each shell, at its root.
fn sums(surface: &Surface, shells: &Shells, roots: &[(u32, bool)]) -> Vec<Option<Shell>> {
    let mut sums: Vec<Option<Shell>> = vec![None; roots.len()];
    for (face, &(root, is_turned)) in roots.iter().enumerate() {
        let shell = sums[root as usize].get_or_insert(Shell {
            object: surface.object(face),
            area: [0.0; 2],
            n: [0; 2],
            volume: 0.0,
            bounds: Aabb::EMPTY,
            is_closed: true,
            is_one_sided: false,
        });
        let corners = surface.corners(face);
        // Relative to a point of the shell, to keep precision far from the origin.
        let origin = surface.corners(root as usize)[0];
        let [a, b, c] = corners.map(|p| p - origin);
        let sign = if is_turned { -1.0 } else { 1.0 };
        shell.volume += a.dot(b.cross(c)) * sign;
        shell.area[usize::from(is_turned)] += 0.5 * triangle_area_normal(&corners).length();
        shell.n[usize::from(is_turned)] += 1;
        shell.bounds = corners.iter().fold(shell.bounds, |b, &p| b.including(p));
        shell.is_closed &= !shells.is_unclosed[face];
        shell.is_one_sided |= shells.is_one_sided[face];
    }
    sums
}

/// Returns the boxes of the largest closed shells of each object.
fn boxes(sums: &[Option<Shell>]) -> HashMap<u32, Vec<Aabb>> {
    let mut boxes: HashMap<u32, Vec<Aabb>> = HashMap::new();
    for s in sums.iter().flatten().filter(|s| s.is_closed) {
        boxes.entry(s.object).or_default().push(s.bounds);
    }
    for list in boxes.values_mut() {
        list.sort_by(|a, b| b.size().length().total_cmp(&a.size().length()));
        list.truncate(ENCLOSING);
    }
    boxes
}

/// Returns `true` if the box of another closed shell of its object, one of the 64 largest, contains the shell's box.
fn is_enclosed(shell: &Shell, boxes: &HashMap<u32, Vec<Aabb>>) -> bool {
    let held =
        |b: &Aabb| b.min.cmplt(shell.bounds.min).all() && b.max.cmpgt(shell.bounds.max).all();
    boxes.get(&shell.object).is_some_and(|l| l.iter().any(held))
}

/// Turns a face over: it gets vertices of its own, with normals that agree with it.
fn turn(surface: &mut Surface, face: usize) {
    surface.change(face);
    let part = surface.faces[face].part;
    let [a, b, c] = surface.faces[face].corners;
    let points = surface.ends(face);
    let [p, q, r] = surface.corners(face);
    let normal = triangle_area_normal(&[p, r, q]);
    let copies = [(a, points[0]), (c, points[2]), (b, points[1])].map(|(v, point)| {
        let copy = surface.mix(part, [v, v], 0.0, point);
        let vertices = &mut surface.parts[part as usize].vertices;
        if let Some(n) = vertices.normals.last_mut() {
            let old = DVec3::from_array(n.map(f64::from));
            if old.dot(normal) < 0.0 {
                *n = unit(-old);
                if let Some(t) = vertices.tangents.last_mut() {
                    // Keeps the bitangent, `cross(normal, tangent) * w`.
                    t[3] = -t[3];
                }
            }
        }
        copy
    });
    surface.faces[face].corners = copies;
}

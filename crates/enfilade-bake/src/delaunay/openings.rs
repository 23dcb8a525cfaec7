//! Openings in the facet between two tetrahedra: the pieces that no polygon covers.

use enfilade_geom::{DVec3, Plane, Triangle};
use smallvec::{SmallVec, smallvec};

use super::cut::{Knife, TetrahedraCut, less, shared, turned_to};
use crate::complex::poly::{Poly, area_normal, width};

/// An outline smaller than a facet; `None` for the whole facet.
pub(super) type Outline = Option<Poly>;

/// An open piece of a facet, between a part of one tetrahedron and a part of its neighbor.
pub(super) struct OpenPiece {
    /// Parts of the first and of the second tetrahedron.
    pub(super) parts: [u32; 2],
    /// The outline, counter-clockwise seen from the second; `None` for the whole facet.
    pub(super) outline: Outline,
}

/// An unfinished open piece: the parts on both sides, as far as they are known, and its outline.
type Piece = ([u32; 2], Poly);

impl Knife<'_> {
    /// Returns the open pieces of facet `i` of tetrahedron `t` towards its neighbor. `pair` holds the cuts of the two.
    pub(super) fn openings(
        &self,
        t: u32,
        i: usize,
        pair: [&TetrahedraCut; 2],
    ) -> SmallVec<[OpenPiece; 2]> {
        let other_facet = (self.delaunay.tetrahedra[t as usize].neighbors[i] & 3) as usize;
        let is_covered = pair[0].is_covered(i) || pair[1].is_covered(other_facet);
        let is_uncut = pair.iter().all(|c| c.parts.is_none());
        let whole: SmallVec<[OpenPiece; 2]> = smallvec![OpenPiece {
            parts: [0, 0],
            outline: None
        }];
        if !is_covered && is_uncut {
            return whole;
        }
        let f = self.facet(t, i);
        let Some(plane) = Plane::of_triangle(&f) else {
            return whole;
        };
        let (normal, eps) = (plane.normal, self.tolerance.plane);
        let near = self.walls_near(&f);
        let mut open: SmallVec<[Poly; 2]> = smallvec![Poly::from_slice(&f)];
        if is_covered {
            let covers = self.covers(&near, &f, normal, eps);
            open = less(open, &covers, normal, self.tolerance);
            if open.is_empty() {
                return SmallVec::new();
            }
            if is_uncut && !covers.is_empty() && is_all_of(&open, &f) {
                return whole;
            }
        }
        let open = open.into_iter().map(|p| ([0, 0], p)).collect();
        let open = by_part(open, pair[0], i, 0, normal, eps);
        let open = by_part(open, pair[1], other_facet, 1, normal, eps);
        // A wall that ends within the facet may be coplanar with a piece of it, though not with all of it.
        let rest = |(parts, poly): Piece| {
            let covers = self.covers(&near, &poly, normal, 2.0 * eps);
            let open = less(smallvec![poly], &covers, normal, self.tolerance);
            // Pieces between cuts along walls that meet but for rounding are closed like gaps between covers.
            let open = open
                .into_iter()
                .filter(|p| width(p) >= self.tolerance.width);
            open.map(move |poly| OpenPiece {
                parts,
                outline: Some(poly),
            })
        };
        open.into_iter().flat_map(rest).collect()
    }

    /// Returns the walls in whose planes a polygon lies, within a distance of `off`.
    fn covers(&self, near: &[u32], poly: &[DVec3], normal: DVec3, off: f64) -> Vec<Poly> {
        let walls = near.iter().map(|&w| &self.walls[w as usize]);
        let in_plane = |p: Plane| poly.iter().all(|&c| p.signed_distance(c).abs() <= off);
        walls
            .filter(|wall| Plane::of_triangle(wall).is_some_and(in_plane))
            .map(|wall| turned_to(Poly::from_slice(wall), normal))
            .collect()
    }
}

/// Returns `true` if nothing of a facet is missing.
fn is_all_of(open: &[Poly], facet: &Triangle) -> bool {
    open.len() == 1
        && open[0].len() == 3
        && area_normal(&open[0]).length() >= area_normal(facet).length() * (1.0 - 1e-12)
}

/// Divides open pieces of a facet by the parts of one of its two tetrahedra (`side`). An uncut tetrahedron is one part,
/// whose face is the facet.
fn by_part(
    open: SmallVec<[Piece; 4]>,
    cutting: &TetrahedraCut,
    facet: usize,
    side: usize,
    normal: DVec3,
    eps: f64,
) -> SmallVec<[Piece; 4]> {
    let Some(parts) = &cutting.parts else {
        return open;
    };
    let mut faces: Vec<(u32, Poly)> = Vec::new();
    for (k, part) in parts.parts.iter().enumerate() {
        let turned = part.on_facet(facet).map(|p| turned_to(p.clone(), normal));
        faces.extend(turned.map(|p| (k as u32, p)));
    }
    let mut out: SmallVec<[Piece; 4]> = SmallVec::new();
    for (parts, poly) in &open {
        for (k, face) in &faces {
            if let Some(shared) = shared(poly, face, normal, eps) {
                let mut parts = *parts;
                parts[side] = *k;
                out.push((parts, shared));
            }
        }
    }
    out
}

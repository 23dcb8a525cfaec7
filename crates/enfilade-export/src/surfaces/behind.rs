//! The space behind a construction: the first piece of a cell's boundary along the normal.
//!
//! Between a piece and the one behind it is only matter, so the nearest piece that faces the other way answers. The lower envelope
//! of all that overlap is exact: each is a convex polygon projected along the normal, pieces of boundaries do not cross, and so the
//! nearer of two is the same all over their common part. Where both are parallel, the answer is the same from the other side.
//! **Complexity:** O(k²) for k pieces over one another along the normal; they are found by a tree of boxes.

use enfilade_geom::poly::{self, Poly, cut_out};
use enfilade_geom::{Aabb, Bvh, DVec3, Plane};

use super::piece::{Piece, mean};

/// Cosine of the steepest angle at which a piece still counts as behind another: nearly edge-on, it hides nothing.
const FACING: f64 = 0.1;
/// Least width of an overlap in which something lies behind. [Units: wu]
const NARROW: f64 = 1e-3;
/// Parts are cut exactly: an overlap that is left in two of them would open the boundary. [Units: wu]
const EXACT: f64 = 0.0;
/// Vertices this close to an edge are on it. [Units: wu]
const ROUNDING: f64 = 1e-7;

/// A part of a piece with what lies behind it.
pub(crate) struct Backed {
    pub(crate) points: Poly,
    /// The piece behind, as an index; `None` if there is only matter within reach.
    pub(crate) far: Option<u32>,
    /// Distance to it in the middle of the part. [Units: wu]
    pub(crate) depth: f64,
}

/// All pieces with matter behind, by place.
pub(crate) struct Backs<'p> {
    pieces: &'p [Piece],
    bvh: Bvh,
    /// The piece of each triangle of the tree.
    owners: Vec<u32>,
    /// Greatest depth of a construction. [Units: wu]
    reach: f64,
}

impl<'p> Backs<'p> {
    pub(crate) fn new(pieces: &'p [Piece], reach: f64) -> Self {
        let (mut triangles, mut owners) = (Vec::new(), Vec::new());
        for (id, piece) in (0..).zip(pieces) {
            if piece.across.is_some() {
                continue;
            }
            for edge in piece.points[1..].windows(2) {
                triangles.push([piece.points[0], edge[0], edge[1]]);
                owners.push(id);
            }
        }
        Self {
            pieces,
            bvh: Bvh::build(&triangles),
            owners,
            reach,
        }
    }

    /// Divides a piece with matter behind by the pieces behind that.
    pub(crate) fn behind(&self, piece: &Piece) -> Vec<Backed> {
        let mut parts: Vec<(Poly, u32)> = Vec::new();
        let mut covered: Vec<Poly> = vec![piece.points.as_slice().into()];
        for id in self.candidates(piece) {
            let Some(shadow) = self.shadow(piece, id) else {
                continue;
            };
            let mut outside = Vec::new();
            let whole = &piece.points;
            let Some(own) = cut_out(whole, &shadow, piece.normal, ROUNDING, NARROW, &mut outside)
            else {
                continue;
            };
            self.insert(piece, &mut parts, &own, id);
        }
        for (part, _) in &parts {
            let mut outside = Vec::new();
            for rest in covered {
                // The inside is known already.
                let _ = cut_out(&rest, part, piece.normal, ROUNDING, EXACT, &mut outside);
            }
            covered = outside;
        }
        let depth_at = |id: u32, points: &[DVec3]| self.depth(piece, id, mean(points));
        let backed = parts.into_iter().map(|(points, id)| Backed {
            depth: depth_at(id, &points),
            points,
            far: Some(id),
        });
        let bare = covered.into_iter().map(|points| Backed {
            points,
            far: None,
            depth: self.reach,
        });
        backed.chain(bare).collect()
    }

    /// Returns the pieces that may lie behind one, ascending.
    fn candidates(&self, piece: &Piece) -> Vec<u32> {
        let own = Aabb::of_points(&piece.points);
        let moved = piece.points.iter().map(|&p| p + piece.normal * self.reach);
        let query = moved.fold(own, Aabb::including).expanded(ROUNDING);
        let mut ids = Vec::new();
        self.bvh.for_each_in_box(&query, |t| {
            let id = self.owners[t as usize];
            if self.pieces[id as usize].normal.dot(piece.normal) < -FACING {
                ids.push(id);
            }
        });
        ids.sort_unstable();
        ids.dedup();
        ids
    }

    /// Projects a piece within reach onto the plane of another along its normal, counter-clockwise about that.
    fn shadow(&self, piece: &Piece, id: u32) -> Option<Poly> {
        let plane = piece.plane_of();
        let other = &self.pieces[id as usize];
        let mut part: Poly = other.points.as_slice().into();
        let end = Plane {
            normal: -plane.normal,
            d: self.reach - plane.d,
        };
        if !poly::clip_in_place(&mut part, &plane, 0.0)
            || !poly::clip_in_place(&mut part, &end, 0.0)
        {
            return None;
        }
        for p in &mut part {
            *p = plane.project(*p);
        }
        part.reverse();
        Some(part)
    }

    /// Returns the distance from a point of a piece along its normal to the plane of another.
    fn depth(&self, piece: &Piece, id: u32, at: DVec3) -> f64 {
        let plane = self.pieces[id as usize].plane_of();
        plane.signed_distance(at) / -plane.normal.dot(piece.normal)
    }

    /// Adds a shadow to the envelope: where two overlap, the nearer stays.
    fn insert(&self, piece: &Piece, parts: &mut Vec<(Poly, u32)>, own: &[DVec3], id: u32) {
        let cut = |from: &[DVec3], by: &[DVec3], outside: &mut Vec<Poly>| {
            cut_out(from, by, piece.normal, ROUNDING, EXACT, outside)
        };
        let mut rest: Vec<Poly> = vec![own.into()];
        let mut kept = Vec::new();
        for (part, other) in parts.drain(..) {
            let mut outside = Vec::new();
            let Some(common) = cut(&part, own, &mut outside) else {
                kept.push((part, other));
                continue;
            };
            let at = mean(&common);
            if self.depth(piece, id, at) < self.depth(piece, other, at) {
                kept.extend(outside.into_iter().map(|p| (p, other)));
                continue;
            }
            let mut left = Vec::new();
            for own in rest {
                let _ = cut(&own, &part, &mut left);
            }
            rest = left;
            kept.push((part, other));
        }
        kept.extend(rest.into_iter().map(|p| (p, id)));
        *parts = kept;
    }
}

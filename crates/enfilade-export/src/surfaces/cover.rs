//! The portals and triangles that lie in a face.

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, World};
use enfilade_geom::poly::{self, Poly, cut_out};
use enfilade_geom::{Aabb, Bvh, DVec3, Plane, Triangle, triangle_area_normal};

use super::faces::Face;
use super::piece::{Piece, SurfaceCover, mean};

/// Farthest distance of a triangle from the face that it makes: vertices are moved into shared planes. [Units: wu]
const NEAR: f64 = 2e-3;
/// Cosine of the largest angle between a face and a triangle in it.
const ALONG: f64 = 0.9995;
/// Parts that are narrower stay with their neighbor. [Units: wu]
const NARROW: f64 = 1e-3;
/// Vertices this close to an edge are on it. [Units: wu]
const ROUNDING: f64 = 1e-7;

/// The structural triangles of a world, by place.
pub(crate) struct Coverings<'w> {
    world: &'w World,
    bvh: Bvh,
    triangles: Vec<(Triangle, SurfaceCover)>,
}

impl<'w> Coverings<'w> {
    /// Gathers the triangles; without `by_object`, all of the model count as one object.
    pub(crate) fn new(world: &'w World, by_object: bool) -> Self {
        let mut triangles = Vec::new();
        for batch in &world.batches {
            let material = batch.primitive.material.filter(|_| by_object);
            let mut sources = batch.sources.of_triangles();
            for triangle in batch.primitive.triangles() {
                let source = sources.next().filter(|_| by_object);
                let cover = if batch.is_seal {
                    SurfaceCover::Bare
                } else {
                    SurfaceCover::Object { source, material }
                };
                triangles.push((triangle, cover));
            }
        }
        let only: Vec<Triangle> = triangles.iter().map(|t| t.0).collect();
        Self {
            world,
            bvh: Bvh::build(&only),
            triangles,
        }
    }

    /// Divides a face by what covers it, and appends the pieces as seen from both sides.
    pub(crate) fn pieces_of(&self, face: &Face, pieces: &mut Vec<Piece>) {
        let mut rest = vec![face.points.clone()];
        let mut found: Vec<(SurfaceCover, Poly)> = Vec::new();
        if let [Some(a), Some(b)] = face.sides {
            rest = self.take_portals(face, [a, b], rest, &mut found);
        }
        for part in rest {
            self.cover(face, part, &mut found);
        }
        for (cover, points) in found {
            for (k, (side, other)) in [(0, 1), (1, 0)].into_iter().enumerate() {
                let Some(cell) = face.sides[side] else {
                    continue;
                };
                let mut points = points.to_vec();
                // The face is counter-clockwise seen from the front, which is inside for the cell in front.
                if k == 0 {
                    points.reverse();
                }
                pieces.push(Piece {
                    cell,
                    across: face.sides[other],
                    points,
                    normal: if k == 0 { -face.normal } else { face.normal },
                    cover,
                    plane: 0,
                });
            }
        }
    }

    /// Cuts the portals between two cells out of parts of a face; returns what is left.
    fn take_portals(
        &self,
        face: &Face,
        [a, b]: [CellId; 2],
        mut rest: Vec<Poly>,
        found: &mut Vec<(SurfaceCover, Poly)>,
    ) -> Vec<Poly> {
        for id in self.world.graph.portals_between(a, b) {
            for piece in &self.world.graph[id].pieces {
                let points: Vec<DVec3> =
                    (piece.iter().map(|p| DVec3::from(p.map(f64::from)))).collect();
                let Some(window) = in_face(face, &points) else {
                    continue;
                };
                let mut outside = Vec::new();
                for part in rest {
                    let inside =
                        cut_out(&part, &window, face.normal, ROUNDING, NARROW, &mut outside);
                    found.extend(inside.map(|p| (SurfaceCover::Opening(id), p)));
                }
                rest = outside;
            }
        }
        rest
    }

    /// Divides a part of a face by the objects whose triangles lie in it.
    fn cover(&self, face: &Face, part: Poly, found: &mut Vec<(SurfaceCover, Poly)>) {
        let mut by_cover: BTreeMap<SurfaceCover, Vec<Poly>> = BTreeMap::new();
        let query = Aabb::of_points(&part).expanded(NEAR);
        let mut near = Vec::new();
        self.bvh.for_each_in_box(&query, |t| near.push(t));
        near.sort_unstable();
        for t in near {
            let (triangle, cover) = &self.triangles[t as usize];
            if let Some(window) = in_face(face, triangle)
                && overlap(&part, &window, face.normal).is_some()
            {
                by_cover.entry(*cover).or_default().push(window);
            }
        }
        let n_covers = by_cover.len();
        let mut covers = by_cover.into_iter();
        if n_covers <= 1 {
            let cover = covers.next().map_or(SurfaceCover::Bare, |c| c.0);
            return found.push((cover, part));
        }
        let mut rest = vec![part];
        let mut last = SurfaceCover::Bare;
        for (cover, windows) in covers {
            for window in windows {
                let mut outside = Vec::new();
                for part in rest {
                    let inside =
                        cut_out(&part, &window, face.normal, ROUNDING, NARROW, &mut outside);
                    found.extend(inside.map(|p| (cover, p)));
                }
                rest = outside;
            }
            last = cover;
        }
        found.extend(rest.into_iter().map(|p| (last, p)));
    }
}

/// Returns a polygon as a cover of a face, counter-clockwise about the face's normal; `None` if it lies in another plane.
fn in_face(face: &Face, points: &[DVec3]) -> Option<Poly> {
    let normal = match points {
        &[a, b, c] => triangle_area_normal(&[a, b, c]),
        _ => poly::area_normal(points),
    };
    let along = normal.normalize_or_zero().dot(face.normal);
    if along.abs() < ALONG {
        return None;
    }
    // Where the face is, not where the polygon begins.
    let at = mean(&face.points);
    let lift = (at - points[0]).dot(normal.normalize_or_zero());
    if lift.abs() > NEAR {
        return None;
    }
    // Coordinates of portals are less precise than the tree.
    let plane = Plane::through(at, face.normal);
    let mut out: Poly = points.iter().map(|&p| plane.project(p)).collect();
    if along < 0.0 {
        out.reverse();
    }
    Some(out)
}

/// Returns the common part of two polygons of a plane, if it is wide enough to count.
fn overlap(part: &[DVec3], window: &[DVec3], normal: DVec3) -> Option<Poly> {
    cut_out(part, window, normal, ROUNDING, NARROW, &mut Vec::new())
}

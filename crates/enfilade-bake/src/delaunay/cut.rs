//! Cuts tetrahedra by the model's polygons.
//!
//! Gjørup 1999, §4.2.1–4.2.2: a tetrahedron that a polygon crosses is cut along the polygon's plane, and its parts by
//! the next polygon, until every polygon lies on boundaries. An opening is the rest of a boundary that no polygon
//! covers, as convex pieces. He loops over all pairs; here a BVH finds those that intersect.

use enfilade_geom::{Aabb, Allowance, Bvh, DVec3, Plane, Triangle};
use smallvec::{SmallVec, smallvec};

use super::tetrahedra::Delaunay;
use crate::complex::poly::{Poly, Sides, area_normal, clip, cut_out, split, width};

/// Most parts of one tetrahedron; polygons that would cut it further are skipped and counted.
pub(super) const MAX_PARTS: usize = 512;

/// Lengths that count as zero when polygons are cut.
#[derive(Clone, Copy, Debug)]
pub(super) struct CutTolerance {
    /// Points this near to a plane lie in it. [Units: wu]
    pub(super) plane: f64,
    /// Least width of an open piece of a facet between polygons. [Units: wu]
    pub(super) width: f64,
}

/// A face of a part.
struct Face {
    poly: Poly,
    /// Its plane, positive on the part's side.
    plane: Plane,
    on: On,
}

/// The surface on which a face of a part lies.
#[derive(Clone, Copy, PartialEq)]
enum On {
    Facet(u8),
    /// A plane along which the tetrahedron was cut.
    Cut(u32),
}

/// A convex part of a tetrahedron.
pub(super) struct Part {
    faces: Vec<Face>,
    /// A point well inside. [Units: wu]
    pub(super) middle: DVec3,
    /// [Units: wu³]
    pub(super) volume: f64,
}

impl Part {
    fn new(faces: Vec<Face>) -> Self {
        let (mut sum, mut n) = (DVec3::ZERO, 0.0);
        for p in faces.iter().flat_map(|f| &f.poly) {
            sum += *p;
            n += 1.0;
        }
        let middle = sum / n;
        let volume = faces
            .iter()
            .map(|f| (area_normal(&f.poly).dot(f.poly[0] - middle) / 6.0).abs())
            .sum();
        Self {
            faces,
            middle,
            volume,
        }
    }

    /// Returns `true` if a vertex of the tetrahedron is a vertex of the part.
    pub(super) fn has_vertex(&self, p: DVec3) -> bool {
        self.faces.iter().any(|f| f.poly.contains(&p))
    }

    /// Returns the faces of this part that lie on a facet of the tetrahedron.
    pub(super) fn on_facet(&self, i: usize) -> impl Iterator<Item = &Poly> {
        let on = On::Facet(i as u8);
        self.faces
            .iter()
            .filter(move |f| f.on == on)
            .map(|f| &f.poly)
    }
}

/// A tetrahedron that polygons divide.
pub(super) struct CutParts {
    pub(super) parts: Vec<Part>,
    /// Openings between two parts: the parts, and an outline counter-clockwise seen from the second.
    pub(super) inner: Vec<([u32; 2], Poly)>,
    /// Polygons skipped because of [`MAX_PARTS`].
    pub(super) n_passed_over: usize,
}

/// Cuts and covers of a tetrahedron by polygons.
#[derive(Default)]
pub(super) struct TetrahedraCut {
    /// Bit `i`: a polygon covers facet `i`, at least in part.
    covered: u8,
    /// The parts, if there are several.
    pub(super) parts: Option<Box<CutParts>>,
}

impl TetrahedraCut {
    pub(super) fn is_covered(&self, facet: usize) -> bool {
        self.covered >> facet & 1 == 1
    }
}

/// The part of a polygon that lies in a tetrahedron.
struct Cutter {
    poly: Poly,
    plane: Plane,
}

/// Position of a wall relative to a tetrahedron.
enum Lies {
    Beside,
    /// In the plane of these facets (bit `i`: facet `i`), or touching an edge or a vertex at most.
    InFacets(u8),
    Through(Cutter),
}

/// The walls by which tetrahedra are cut, and tolerances.
#[derive(Clone, Copy)]
pub(super) struct Knife<'a> {
    pub(super) delaunay: &'a Delaunay,
    pub(super) walls: &'a [Triangle],
    pub(super) bvh: &'a Bvh,
    pub(super) tolerance: CutTolerance,
    /// Allowance of work for cutting.
    pub(super) allowance: &'a Allowance,
}

impl Knife<'_> {
    /// Cuts a tetrahedron by the walls.
    pub(super) fn cut(&self, t: u32) -> TetrahedraCut {
        let corners = self.delaunay.corners(t);
        let near = self.walls_near(&corners);
        let mut cutting = TetrahedraCut {
            covered: 0,
            parts: None,
        };
        if near.is_empty() {
            return cutting;
        }
        // Facets run counter-clockwise seen from outside; their planes face inwards.
        let facets: [Option<Plane>; 4] =
            std::array::from_fn(|i| Plane::of_triangle(&self.facet(t, i)).map(Plane::flipped));
        let mut cutters: SmallVec<[Cutter; 4]> = SmallVec::new();
        self.allowance.spend(5 * near.len() as u64);
        for w in near {
            match self.lies(&self.walls[w as usize], &corners, &facets) {
                Lies::Beside => {}
                Lies::InFacets(facets) => cutting.covered |= facets,
                Lies::Through(cutter) => cutters.push(cutter),
            }
        }
        if !cutters.is_empty() {
            cutting.parts = self.divided(t, &facets, &cutters).map(Box::new);
        }
        cutting
    }

    /// Returns the walls whose boxes are near the box of some points, in order.
    pub(super) fn walls_near(&self, points: &[DVec3]) -> SmallVec<[u32; 16]> {
        let bounds = Aabb::of_points(points).expanded(self.tolerance.plane);
        let mut near: SmallVec<[u32; 16]> = SmallVec::new();
        self.bvh.for_each_in_box(&bounds, |w| near.push(w));
        near.sort_unstable();
        near
    }

    /// Returns the facet opposite vertex `i`, counter-clockwise seen from outside. [Units: wu]
    pub(super) fn facet(&self, t: u32, i: usize) -> Triangle {
        let tet = &self.delaunay.tetrahedra[t as usize];
        tet.facet(i).map(|v| self.delaunay.vertices[v as usize])
    }

    fn lies(&self, wall: &Triangle, corners: &[DVec3; 4], facets: &[Option<Plane>; 4]) -> Lies {
        let eps = self.tolerance.plane;
        let Some(plane) = Plane::of_triangle(wall) else {
            return Lies::Beside;
        };
        let beyond = |p: &Option<Plane>| {
            p.is_some_and(|p| wall.iter().all(|&q| p.signed_distance(q) < -eps))
        };
        if facets.iter().any(beyond) {
            return Lies::Beside;
        }
        let side = corners.map(|c| plane.signed_distance(c));
        if !(side.iter().any(|&d| d > eps) && side.iter().any(|&d| d < -eps)) {
            let is_in = |i: &usize| (0..4).all(|k| k == *i || side[k].abs() <= eps);
            return Lies::InFacets((0..4).filter(is_in).fold(0, |bits, i| bits | 1 << i));
        }
        // If a facet is too thin to have a plane, there is nothing to cut.
        let inside = facets.iter().try_fold(Poly::from_slice(wall), |poly, f| {
            clip(&poly, f.as_ref()?, eps)
        });
        match inside.filter(|poly| width(poly) > 4.0 * eps) {
            Some(poly) => Lies::Through(Cutter { poly, plane }),
            None => Lies::Beside,
        }
    }

    /// Returns the parts of a tetrahedron; `None` if it stays whole.
    fn divided(&self, t: u32, facets: &[Option<Plane>; 4], cutters: &[Cutter]) -> Option<CutParts> {
        let eps = self.tolerance.plane;
        let mut whole = Vec::with_capacity(4);
        for (i, plane) in facets.iter().enumerate() {
            whole.push(Face {
                poly: Poly::from_slice(&self.facet(t, i)),
                plane: (*plane)?,
                on: On::Facet(i as u8),
            });
        }
        let mut parts: Vec<Vec<Face>> = vec![whole];
        let mut cuts: Vec<Plane> = Vec::new();
        let mut n_passed_over = 0;
        for c in cutters {
            // Each part is clipped.
            if !self.allowance.spend(10 * parts.len() as u64) {
                return None;
            }
            if parts.len() >= MAX_PARTS {
                n_passed_over += 1;
                continue;
            }
            for k in 0..parts.len() {
                // Only parts that the polygon itself crosses are cut.
                let in_part = parts[k]
                    .iter()
                    .try_fold(c.poly.clone(), |poly, f| clip(&poly, &f.plane, eps));
                if in_part.is_none_or(|poly| width(&poly) <= 4.0 * eps) {
                    continue;
                }
                let cut = cuts.len() as u32;
                if let Some((front, back)) = split_part(&parts[k], &c.plane, cut, eps) {
                    cuts.push(c.plane);
                    parts[k] = front;
                    parts.push(back);
                }
            }
        }
        if parts.len() < 2 {
            return None;
        }
        Some(CutParts {
            inner: self.inner_openings(&parts, &cuts, cutters),
            parts: parts.into_iter().map(Part::new).collect(),
            n_passed_over,
        })
    }

    /// Returns the openings that the cutters leave where two parts of a tetrahedron meet.
    fn inner_openings(
        &self,
        parts: &[Vec<Face>],
        cuts: &[Plane],
        cutters: &[Cutter],
    ) -> Vec<([u32; 2], Poly)> {
        let eps = self.tolerance.plane;
        let mut inner = Vec::new();
        for (plane, [fronts, backs]) in cuts.iter().zip(&faces_on_cuts(parts, cuts)) {
            let in_plane = |c: &&Cutter| {
                let off = |&p: &DVec3| plane.signed_distance(p).abs();
                c.poly.iter().map(off).fold(0.0, f64::max) <= 2.0 * eps
            };
            let covers: Vec<Poly> = cutters
                .iter()
                .filter(in_plane)
                .map(|c| turned_to(c.poly.clone(), plane.normal))
                .collect();
            for (b, behind) in backs {
                for (f, before) in fronts {
                    if !self.allowance.spend(5 + covers.len() as u64) {
                        return inner;
                    }
                    let Some(shared) = shared(behind, before, plane.normal, eps) else {
                        continue;
                    };
                    let open = less(smallvec![shared], &covers, plane.normal, self.tolerance);
                    // It runs counter-clockwise seen from the plane's front.
                    inner.extend(open.into_iter().map(|poly| ([*b, *f], poly)));
                }
            }
        }
        inner
    }
}

/// Parts with their faces before a plane, and those behind it, all turned to its normal.
type FacesOnCut = [Vec<(u32, Poly)>; 2];

/// Returns the faces that lie on each cut.
fn faces_on_cuts(parts: &[Vec<Face>], cuts: &[Plane]) -> Vec<FacesOnCut> {
    let mut on_cut: Vec<FacesOnCut> = cuts.iter().map(|_| Default::default()).collect();
    for (k, faces) in parts.iter().enumerate() {
        for f in faces {
            if let On::Cut(c) = f.on {
                let normal = cuts[c as usize].normal;
                let is_back = f.plane.normal.dot(normal) < 0.0;
                let face = (k as u32, turned_to(f.poly.clone(), normal));
                on_cut[c as usize][usize::from(is_back)].push(face);
            }
        }
    }
    on_cut
}

/// Returns the intersection of two convex polygons of one plane.
pub(super) fn shared(a: &Poly, b: &Poly, normal: DVec3, eps: f64) -> Option<Poly> {
    cut_out(a, b, normal, eps, 4.0 * eps, &mut Vec::new())
}

/// Returns the sides of a part before and behind a plane; `None` if one of them has no volume.
fn split_part(faces: &[Face], plane: &Plane, cut: u32, eps: f64) -> Option<(Vec<Face>, Vec<Face>)> {
    let bounds = Aabb::of_points(faces.iter().flat_map(|f| &f.poly));
    let reach = bounds.size().length() + 1.0;
    let square = enfilade_geom::Winding::square(plane, bounds.center(), reach);
    let section = faces
        .iter()
        .try_fold(Poly::from_slice(&square.points), |poly, f| {
            clip(&poly, &f.plane, eps)
        })?;
    let (mut front, mut back) = (Vec::new(), Vec::new());
    for f in faces {
        let with = |poly: Poly| Face {
            poly,
            plane: f.plane,
            on: f.on,
        };
        match split(&f.poly, plane, eps) {
            Sides::On => return None,
            Sides::Front => front.push(with(f.poly.clone())),
            Sides::Back => back.push(with(f.poly.clone())),
            Sides::Both(a, b) => {
                front.push(with(a));
                back.push(with(b));
            }
        }
    }
    if front.len() < 3 || back.len() < 3 {
        return None;
    }
    front.push(Face {
        poly: section.clone(),
        plane: *plane,
        on: On::Cut(cut),
    });
    back.push(Face {
        poly: section,
        plane: plane.flipped(),
        on: On::Cut(cut),
    });
    Some((front, back))
}

/// Returns the polygon, reversed if needed to run counter-clockwise about a normal.
pub(super) fn turned_to(mut poly: Poly, normal: DVec3) -> Poly {
    if area_normal(&poly).dot(normal) < 0.0 {
        poly.reverse();
    }
    poly
}

/// Returns the rest of convex polygons outside the covers, as convex pieces.
pub(super) fn less(
    open: SmallVec<[Poly; 2]>,
    covers: &[Poly],
    normal: DVec3,
    tolerance: CutTolerance,
) -> SmallVec<[Poly; 2]> {
    let mut open = open;
    for cover in covers {
        let mut left = Vec::new();
        for poly in &open {
            cut_out(
                poly,
                cover,
                normal,
                tolerance.plane,
                4.0 * tolerance.plane,
                &mut left,
            );
        }
        open = left
            .into_iter()
            .filter(|p| width(p) >= tolerance.width)
            .collect();
        if open.is_empty() {
            break;
        }
    }
    open
}

#[cfg(test)]
mod tests {
    use enfilade_testkit::Rng;

    use super::super::insert::tetrahedralize;
    use super::*;

    fn random_point(rng: &mut Rng) -> DVec3 {
        DVec3::new(rng.unit(), rng.unit(), rng.unit())
    }

    /// Returns the depth of a point inside a convex polygon of its plane; negative outside.
    fn inset(outline: &[DVec3], p: DVec3) -> f64 {
        let normal = area_normal(outline).normalize();
        let n = outline.len();
        let edges = (0..n).map(|i| (outline[i], outline[(i + 1) % n]));
        let heights = edges.map(|(a, b)| normal.cross(b - a).normalize().dot(p - a));
        heights.fold(f64::INFINITY, f64::min)
    }

    /// Follows random lines from part to part of one tetrahedron: where a line leaves a part, there is an opening
    /// exactly if no polygon is there.
    #[test]
    fn parts_are_open_to_each_other_where_no_polygon_is() {
        let mut rng = Rng::new(3);
        let [mut n_open, mut n_closed] = [0, 0];
        for seed in 0..500 {
            let points: Vec<DVec3> = (0..4).map(|_| random_point(&mut rng)).collect();
            let [a, b, c] = [1, 2, 3].map(|k| points[k] - points[0]);
            if a.cross(b).dot(c).abs() < 0.05 {
                continue;
            }
            let delaunay = tetrahedralize(&points).unwrap();
            let walls: Vec<Triangle> = (0..1 + rng.below(3))
                .map(|_| std::array::from_fn(|_| random_point(&mut rng)))
                .collect();
            let tolerance = CutTolerance {
                plane: 1e-9,
                width: 1e-7,
            };
            let knife = Knife {
                allowance: &Allowance::default(),
                delaunay: &delaunay,
                walls: &walls,
                bvh: &Bvh::build(&walls),
                tolerance,
            };
            let Some(parts) = knife.cut(0).parts else {
                continue;
            };
            let total: f64 = parts.parts.iter().map(|p| p.volume).sum();
            let whole = a.cross(b).dot(c).abs() / 6.0;
            assert!((total - whole).abs() < 1e-9, "{seed}: {total} {whole}");
            for _ in 0..60 {
                // A random convex combination of the vertices.
                let shares = [(); 4].map(|()| rng.unit() + 1e-3);
                let sum: f64 = shares.iter().sum();
                let p: DVec3 = (0..4).map(|k| points[k] * (shares[k] / sum)).sum();
                let toward = random_point(&mut rng) - 0.5;
                let inside = |part: &Part, p: DVec3, by: f64| {
                    let planes = part.faces.iter().map(|f| f.plane);
                    planes.fold(f64::INFINITY, |d, f| d.min(f.signed_distance(p))) > by
                };
                let Some(from) = parts.parts.iter().position(|q| inside(q, p, 1e-6)) else {
                    continue;
                };
                let exits = parts.parts[from].faces.iter().filter_map(|f| {
                    let speed = f.plane.normal.dot(toward);
                    (speed < -1e-3).then(|| (f.plane.signed_distance(p) / -speed, f.on))
                });
                let Some((t, On::Cut(_))) = exits.min_by(|a, b| a.0.total_cmp(&b.0)) else {
                    continue;
                };
                let exit = p + toward * t;
                let beyond = exit + toward * 1e-5;
                let Some(to) = parts.parts.iter().position(|q| inside(q, beyond, 1e-9)) else {
                    continue;
                };
                // The oracle is the polygons themselves; points near an edge may be on either side.
                let depths = walls.iter().map(|w| {
                    let plane = Plane::of_triangle(w).unwrap();
                    let off = plane.signed_distance(exit).abs();
                    if off < 1e-7 { inset(w, exit) } else { -1.0 }
                });
                let depth = depths.fold(-1.0, f64::max);
                if depth.abs() < 1e-5 {
                    continue;
                }
                let is_open = parts.inner.iter().any(|(pair, outline)| {
                    let names = [from as u32, to as u32];
                    (*pair == names || *pair == [names[1], names[0]])
                        && area_normal(outline)
                            .normalize()
                            .dot(exit - outline[0])
                            .abs()
                            < 1e-7
                        && inset(outline, exit) > -1e-7
                });
                assert_eq!(is_open, depth < 0.0, "{seed}: {exit} {depth}");
                n_open += usize::from(is_open);
                n_closed += usize::from(!is_open);
            }
        }
        assert!(n_open > 500 && n_closed > 500, "{n_open} {n_closed}");
    }
}

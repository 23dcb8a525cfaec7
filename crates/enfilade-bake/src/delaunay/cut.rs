//! Tetrahedra cut by the model's polygons, and what a facet leaves open.
//!
//! Gjørup 1999, §4.2.1–4.2.2: a tetrahedron that a polygon runs through is cut along the polygon's
//! plane, its parts again by the next, until every polygon lies on boundaries; an opening is then what
//! the polygons of a boundary leave of it, as convex pieces. His loops over all pairs are questions to a
//! BVH here, so that the cost is that of the pairs that meet.

use enfilade_geom::{Aabb, Bvh, DVec3, Plane, Triangle};
use smallvec::{SmallVec, smallvec};

use super::tetrahedra::Delaunay;
use crate::complex::poly::{Poly, Sides, area_normal, clip, cut_out, split, width};

/// Parts of one tetrahedron at most; what would cut it further is passed over, and counted.
pub(super) const MAX_PARTS: usize = 512;

/// What lengths mean when polygons are cut.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolerance {
    /// Points nearer to a plane lie in it. [Units: wu]
    pub(super) plane: f64,
    /// What polygons leave of a facet is open where it is this wide. [Units: wu]
    pub(super) width: f64,
}

/// A boundary of a part.
struct Face {
    poly: Poly,
    /// Positive on the part's side.
    plane: Plane,
    on: On,
}

/// What a face of a part lies on.
#[derive(Clone, Copy, PartialEq)]
enum On {
    Facet(u8),
    /// A plane that the tetrahedron was cut along.
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

    /// Whether a corner of the tetrahedron is one of the part's own.
    pub(super) fn has_corner(&self, p: DVec3) -> bool {
        self.faces.iter().any(|f| f.poly.contains(&p))
    }

    /// What of this part lies on a facet of the tetrahedron.
    fn on_facet(&self, i: usize) -> impl Iterator<Item = &Poly> {
        let on = On::Facet(i as u8);
        self.faces
            .iter()
            .filter(move |f| f.on == on)
            .map(|f| &f.poly)
    }
}

/// A tetrahedron that polygons run through.
pub(super) struct Parts {
    pub(super) parts: Vec<Part>,
    /// Where two parts meet openly: the parts, and an outline counter-clockwise seen from the second.
    pub(super) inner: Vec<([u32; 2], Poly)>,
    /// Polygons that were passed over, for [`MAX_PARTS`].
    pub(super) n_passed_over: usize,
}

/// What polygons do to a tetrahedron.
pub(super) struct Found {
    /// Bit `i`: a polygon lies in facet `i`, in some of it.
    pub(super) covered: u8,
    /// The parts, if there are several.
    pub(super) parts: Option<Box<Parts>>,
}

/// A polygon in a tetrahedron.
struct Cutter {
    poly: Poly,
    plane: Plane,
}

/// Cuts tetrahedron `t` by the polygons of `walls`.
pub(super) fn cut(
    delaunay: &Delaunay,
    t: u32,
    walls: &[Triangle],
    bvh: &Bvh,
    tolerance: Tolerance,
) -> Found {
    let corners = delaunay.corners(t);
    let eps = tolerance.plane;
    let mut near: SmallVec<[u32; 16]> = SmallVec::new();
    bvh.for_each_in_box(&Aabb::of_points(&corners).expanded(eps), |w| near.push(w));
    let mut found = Found {
        covered: 0,
        parts: None,
    };
    if near.is_empty() {
        return found;
    }
    near.sort_unstable();
    let facets: [Option<Plane>; 4] = std::array::from_fn(|i| {
        let f = facet_corners(delaunay, t, i);
        // Seen from outside they run counter-clockwise.
        Plane::of_triangle(&f).map(Plane::flipped)
    });
    let mut cutters: SmallVec<[Cutter; 4]> = SmallVec::new();
    for w in near {
        let wall = &walls[w as usize];
        let Some(plane) = Plane::of_triangle(wall) else {
            continue;
        };
        let beyond = |p: &Option<Plane>| {
            p.is_some_and(|p| wall.iter().all(|&q| p.signed_distance(q) < -eps))
        };
        if facets.iter().any(beyond) {
            continue;
        }
        let side = corners.map(|c| plane.signed_distance(c));
        let near_plane = side.map(|d| d.abs() <= eps);
        let (mut front, mut back) = (false, false);
        for d in side {
            front |= d > eps;
            back |= d < -eps;
        }
        if !(front && back) {
            for i in 0..4 {
                if (0..4).all(|k| k == i || near_plane[k]) {
                    found.covered |= 1 << i;
                }
            }
            continue;
        }
        // Where facets are too thin to have a plane there is nothing to cut.
        let inside = facets.iter().try_fold(Poly::from_slice(wall), |poly, f| {
            clip(&poly, f.as_ref()?, eps)
        });
        if let Some(poly) = inside.filter(|poly| width(poly) > 4.0 * eps) {
            cutters.push(Cutter { poly, plane });
        }
    }
    if !cutters.is_empty() {
        found.parts = divided(delaunay, t, &facets, &cutters, tolerance).map(Box::new);
    }
    found
}

fn facet_corners(delaunay: &Delaunay, t: u32, i: usize) -> Triangle {
    let tet = &delaunay.tetrahedra[t as usize];
    tet.facet(i).map(|v| delaunay.vertices[v as usize])
}

fn divided(
    delaunay: &Delaunay,
    t: u32,
    facets: &[Option<Plane>; 4],
    cutters: &[Cutter],
    tolerance: Tolerance,
) -> Option<Parts> {
    let eps = tolerance.plane;
    let mut whole = Vec::with_capacity(4);
    for (i, plane) in facets.iter().enumerate() {
        whole.push(Face {
            poly: Poly::from_slice(&facet_corners(delaunay, t, i)),
            plane: (*plane)?,
            on: On::Facet(i as u8),
        });
    }
    let mut parts: Vec<Vec<Face>> = vec![whole];
    let mut cuts: Vec<Plane> = Vec::new();
    let mut n_passed_over = 0;
    for c in cutters {
        if parts.len() >= MAX_PARTS {
            n_passed_over += 1;
            continue;
        }
        for k in 0..parts.len() {
            // Only what the polygon itself runs through is cut.
            let in_part = parts[k]
                .iter()
                .try_fold(c.poly.clone(), |poly, f| clip(&poly, &f.plane, eps));
            if in_part.is_none_or(|poly| width(&poly) <= 4.0 * eps) {
                continue;
            }
            let Some((front, back)) = split_part(&parts[k], &c.plane, cuts.len() as u32, eps)
            else {
                continue;
            };
            cuts.push(c.plane);
            parts[k] = front;
            parts.push(back);
        }
    }
    if parts.len() < 2 {
        return None;
    }
    let mut on_cut: Vec<[Vec<(u32, &Poly)>; 2]> = cuts.iter().map(|_| Default::default()).collect();
    for (k, faces) in parts.iter().enumerate() {
        for f in faces {
            if let On::Cut(c) = f.on {
                let is_back = f.plane.normal.dot(cuts[c as usize].normal) < 0.0;
                on_cut[c as usize][usize::from(is_back)].push((k as u32, &f.poly));
            }
        }
    }
    let mut inner = Vec::new();
    for (plane, [fronts, backs]) in cuts.iter().zip(&on_cut) {
        let in_plane = |c: &&Cutter| {
            let off = |&p: &DVec3| plane.signed_distance(p).abs();
            c.poly.iter().map(off).fold(0.0, f64::max) <= 2.0 * eps
        };
        let covers: Vec<Poly> = cutters
            .iter()
            .filter(in_plane)
            .map(|c| turned_to(c.poly.clone(), plane.normal))
            .collect();
        for &(b, behind) in backs {
            let behind = turned_to(behind.clone(), plane.normal);
            for &(f, before) in fronts {
                let before = turned_to(before.clone(), plane.normal);
                let mut rest = Vec::new();
                let Some(shared) =
                    cut_out(&behind, &before, plane.normal, eps, 4.0 * eps, &mut rest)
                else {
                    continue;
                };
                let open = less(smallvec![shared], &covers, plane.normal, tolerance);
                // It runs counter-clockwise seen from the plane's front.
                inner.extend(open.into_iter().map(|poly| ([b, f], poly)));
            }
        }
    }
    Some(Parts {
        inner,
        parts: parts.into_iter().map(Part::new).collect(),
        n_passed_over,
    })
}

/// The parts of a part before and behind a plane; `None` when one of them has no volume.
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

/// The polygon as it runs counter-clockwise about a normal.
fn turned_to(mut poly: Poly, normal: DVec3) -> Poly {
    if area_normal(&poly).dot(normal) < 0.0 {
        poly.reverse();
    }
    poly
}

/// What of convex polygons no cover lies on, as convex pieces.
fn less(
    open: SmallVec<[Poly; 2]>,
    covers: &[Poly],
    normal: DVec3,
    tolerance: Tolerance,
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

/// An outline that is less than a facet; `None` for the facet.
pub(super) type Outline = Option<Poly>;

/// An opening between a part of one tetrahedron and a part of its neighbor.
pub(super) struct Opening {
    /// Parts of the first and of the second tetrahedron.
    pub(super) parts: [u32; 2],
    /// The outline, counter-clockwise seen from the second; `None` for the whole facet.
    pub(super) outline: Outline,
}

/// What is open of facet `i` of tetrahedron `t` towards its neighbor.
///
/// `found` is what [`cut`] found of the two.
pub(super) fn openings(
    delaunay: &Delaunay,
    (t, i): (u32, usize),
    found: [&Found; 2],
    walls: &[Triangle],
    bvh: &Bvh,
    tolerance: Tolerance,
) -> SmallVec<[Opening; 2]> {
    let tet = &delaunay.tetrahedra[t as usize];
    let other_facet = (tet.neighbors[i] & 3) as usize;
    let is_covered = found[0].covered >> i & 1 == 1 || found[1].covered >> other_facet & 1 == 1;
    let whole: SmallVec<[Opening; 2]> = smallvec![Opening {
        parts: [0, 0],
        outline: None
    }];
    if !is_covered && found.iter().all(|f| f.parts.is_none()) {
        return whole;
    }
    let f = facet_corners(delaunay, t, i);
    let Some(plane) = Plane::of_triangle(&f) else {
        return whole;
    };
    let eps = tolerance.plane;
    let mut near: SmallVec<[u32; 16]> = SmallVec::new();
    bvh.for_each_in_box(&Aabb::of_points(&f).expanded(eps), |w| near.push(w));
    near.sort_unstable();
    let covers_of = |poly: &[DVec3], off: f64| -> Vec<Poly> {
        let walls = near.iter().map(|&w| &walls[w as usize]);
        let in_plane = |p: Plane| poly.iter().all(|&c| p.signed_distance(c).abs() <= off);
        walls
            .filter(|wall| Plane::of_triangle(wall).is_some_and(in_plane))
            .map(|wall| turned_to(Poly::from_slice(wall), plane.normal))
            .collect()
    };
    let mut open: SmallVec<[Poly; 2]> = smallvec![Poly::from_slice(&f)];
    if is_covered {
        let covers = covers_of(&f, eps);
        let n_covers = covers.len();
        open = less(open, &covers, plane.normal, tolerance);
        if open.is_empty() {
            return SmallVec::new();
        }
        let untouched = open.len() == 1 && open[0].len() == 3 && n_covers > 0 && {
            let rest = area_normal(&open[0]).length();
            rest >= area_normal(&f).length() * (1.0 - 1e-12)
        };
        if untouched && found.iter().all(|f| f.parts.is_none()) {
            return whole;
        }
    }
    // A tetrahedron in one part is that part, whose face is the facet.
    let faces = |found: &Found, facet: usize| -> Option<Vec<(u32, Poly)>> {
        let parts = &found.parts.as_ref()?.parts;
        let turned = |p: &Poly| turned_to(p.clone(), plane.normal);
        let of_part = |(k, part): (usize, &Part)| {
            part.on_facet(facet)
                .map(move |p| (k as u32, turned(p)))
                .collect::<Vec<_>>()
        };
        Some(parts.iter().enumerate().flat_map(of_part).collect())
    };
    let within =
        |open: SmallVec<[([u32; 2], Poly); 4]>, faces: Option<Vec<(u32, Poly)>>, side: usize| {
            let Some(faces) = faces else { return open };
            let mut out: SmallVec<[([u32; 2], Poly); 4]> = SmallVec::new();
            let mut rest = Vec::new();
            for (parts, poly) in &open {
                for (k, face) in &faces {
                    rest.clear();
                    let shared = cut_out(poly, face, plane.normal, eps, 4.0 * eps, &mut rest);
                    if let Some(shared) = shared {
                        let mut parts = *parts;
                        parts[side] = *k;
                        out.push((parts, shared));
                    }
                }
            }
            out
        };
    let open = open.into_iter().map(|p| ([0, 0], p)).collect();
    let open = within(open, faces(found[0], i), 0);
    let open = within(open, faces(found[1], other_facet), 1);
    // A wall that ends within the facet may lie in a piece of it though not in all of it.
    let rest = |(parts, poly): ([u32; 2], Poly)| {
        let covers = covers_of(&poly, 2.0 * eps);
        let open = less(smallvec![poly], &covers, plane.normal, tolerance);
        open.into_iter().map(move |poly| Opening {
            parts,
            outline: Some(poly),
        })
    };
    open.into_iter().flat_map(rest).collect()
}

#[cfg(test)]
mod tests {
    use enfilade_testkit::Rng;

    use super::super::insert::tetrahedralize;
    use super::*;

    fn random_point(rng: &mut Rng) -> DVec3 {
        DVec3::new(rng.unit(), rng.unit(), rng.unit())
    }

    /// How far inside the convex polygon a point of its plane lies; negative outside.
    fn inset(outline: &[DVec3], p: DVec3) -> f64 {
        let normal = area_normal(outline).normalize();
        let n = outline.len();
        let edges = (0..n).map(|i| (outline[i], outline[(i + 1) % n]));
        let heights = edges.map(|(a, b)| normal.cross(b - a).normalize().dot(p - a));
        heights.fold(f64::INFINITY, f64::min)
    }

    /// Follows random lines from part to part of one tetrahedron: where they leave a part, there is an opening exactly where
    /// no polygon is.
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
            let tolerance = Tolerance {
                plane: 1e-9,
                width: 1e-7,
            };
            let found = cut(&delaunay, 0, &walls, &Bvh::build(&walls), tolerance);
            let Some(parts) = found.parts else { continue };
            let total: f64 = parts.parts.iter().map(|p| p.volume).sum();
            let whole = a.cross(b).dot(c).abs() / 6.0;
            assert!((total - whole).abs() < 1e-9, "{seed}: {total} {whole}");
            for _ in 0..60 {
                // Any mean of the corners.
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
                // By the polygons themselves; points near an edge may be either.
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

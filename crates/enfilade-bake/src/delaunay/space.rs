//! The air as tetrahedra: which parts of it are connected, and how wide the way between two of them is.
//!
//! Gjørup 1999, §4.2.1–4.2.2. Large triangles give spikes because their few vertices carry little information on the
//! surface (his §4.3.3), so points are added to surfaces first (`refine`), the denser the narrower the air beside them
//! is. A tetrahedron that polygons still cross is cut into parts along them (`cut`), and two parts are linked by the
//! openings that the polygons leave in their common boundary: no opening is missed and no wall passed, however few
//! points there are.
//!
//! The circumsphere of a tetrahedron is a ball of air that touches four surface points, so its center is on the medial
//! axis. The widest ball that passes between two neighbors is as wide as the circle through their common facet, or as
//! the lesser of their balls if the circle is not a bottleneck (Dey, Giesen & Goswami, "Shape segmentation and matching
//! with flow discretization", 2003). A part of a cut tetrahedron is a spike and has no ball.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_geom::{Aabb, Allowance, Bvh, DVec3, Sets, Triangle};
use rayon::prelude::*;
use smallvec::SmallVec;

use super::balls::{circle, circumsphere, of_air};
use super::cut::{CutTolerance, Knife, Part, TetrahedraCut};
use super::limits::Limits;
use super::openings::Outline;
use super::refine::refined;
use super::tetrahedra::{Delaunay, INFINITE};
use crate::complex::poly::{area, area_normal, width};
use crate::error::DelaunayError;

/// Most points added to surfaces.
const MAX_POINTS: usize = 300_000;
/// Costs of a tetrahedron, and of a part of a cut one, from there to rooms, in units of [`Allowance`].
const WORK_A_TETRAHEDRON: u64 = 15;
const WORK_A_PART: u64 = 30;
/// Cost of measuring the ball of a tetrahedron.
const WORK_A_BALL: u64 = 30;
/// Distance between the scene and the box around it, besides a quarter of the scene's size. [Units: narrowest openings]
const MARGIN: f64 = 4.0;
/// Points along each edge of the box around the scene.
const BOX_POINTS: usize = 9;
/// An opening that polygons leave in a facet is a crack if its width is less than this share of the narrowest opening:
/// a way through, but not a place for a candidate portal, since the cell complex finds the exact one.
const CRACK: f64 = 1.0 / 60.0;
/// Balls of air are known down to this share of the narrowest opening, which a ball of half its width passes.
pub const LEAST_BALL: f64 = 1.0 / 3.0;
/// Points lie in a plane if they are nearer to it than this share of the largest coordinate.
const ON_PLANE: f64 = 1e-9;
/// A gap is closed if it is narrower than this many times the distance at which points still lie in a plane.
/// Coordinates are rounded to a grid of `2⁻²⁴` of their size, 60 times that distance, so walls that met before may have
/// gaps as wide.
const CLOSED: f64 = 64.0;

/// The air between surfaces, as tetrahedra and parts of tetrahedra.
pub struct Space {
    /// The tetrahedra. [Units: wu]
    pub delaunay: Delaunay,
    /// Radius down to which balls of air are known: no surface crosses them. More than [`LEAST_BALL`] of the narrowest
    /// opening if points ran out. [Units: wu]
    pub finest: f64,
    /// The tetrahedron of each part: the first part of each tetrahedron in order, then the further parts of those
    /// that are cut.
    pub tetrahedron_of_part: Vec<u32>,
    /// Number of polygons along which nothing was cut, since a tetrahedron had too many parts already.
    pub n_passed_over: usize,
    /// A point well inside each part. [Units: wu]
    pub middles: Vec<DVec3>,
    /// Volume of each part. [Units: wu³]
    pub volumes: Vec<f64>,
    /// Radius of the ball of air to which each part belongs; 0 for spikes, infinite outdoors. [Units: wu]
    pub radii: Vec<f64>,
    /// Ways between parts.
    pub links: Vec<Link>,
    /// Outlines narrower than this are cracks. [Units: wu]
    crack: f64,
    /// Vertices of openings that are not whole facets, one outline after the other. [Units: wu]
    vertices: Vec<DVec3>,
}

/// A way from one part to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// The two parts.
    pub parts: [u32; 2],
    /// The tetrahedron of the first part, which the opening bounds or lies in.
    pub tetrahedron: u32,
    /// Its facet, or 4 if the opening lies inside.
    pub facet: u8,
    /// Number of vertices of the opening's outline; 0 for the whole facet.
    n_vertices: u16,
    /// Start of those vertices.
    first_vertex: u32,
    /// Radius of the widest ball that passes. [Units: wu]
    pub radius: f64,
}

/// Measurements of a part.
#[derive(Clone, Copy)]
struct Measured {
    middle: DVec3,
    volume: f64,
    radius: f64,
    /// Center of the tetrahedron's circumsphere.
    center: DVec3,
}

impl Measured {
    /// Measurements once an allowance is spent.
    const NOTHING: Self = Self {
        middle: DVec3::ZERO,
        volume: 0.0,
        radius: 0.0,
        center: DVec3::ZERO,
    };
}

/// Divides the air around `walls` into tetrahedra.
///
/// `bvh` contains the walls; the points of `closures` (door leaves, panes) narrow the space near them but close
/// nothing. Openings down to `narrowest` are weighed correctly; if that takes more points than memory allows,
/// [`Space::finest`] is the limit.
///
/// # Errors
/// If coordinates are out of limits; the box around the scene always has a volume.
pub fn divide(
    walls: &[Triangle],
    closures: &[Triangle],
    bvh: &Bvh,
    narrowest: f64,
) -> Result<Space, DelaunayError> {
    let limits = Limits {
        n_points: MAX_POINTS,
        allowance: &Allowance::default(),
    };
    divide_within(walls, closures, bvh, narrowest, &limits)
}

/// [`divide`] within limits: once the allowance is spent, the space must not be used.
pub(super) fn divide_within(
    walls: &[Triangle],
    closures: &[Triangle],
    bvh: &Bvh,
    narrowest: f64,
    limits: &Limits<'_>,
) -> Result<Space, DelaunayError> {
    let sampled = sample(walls, closures, narrowest, limits)?;
    let air = Air {
        knife: Knife {
            delaunay: &sampled.delaunay,
            walls,
            bvh,
            tolerance: sampled.tolerance,
            allowance: limits.allowance,
        },
        box_vertices: &sampled.box_vertices,
        narrowest,
    };
    let cuts = air.cut_all();
    let parts = air.measure(&cuts);
    let ways = air.ways(&cuts, &parts);
    let (links, vertices) = with_outlines(ways);
    let of_part = |value: fn(&Measured) -> f64| parts.measured.iter().map(value).collect();
    Ok(Space {
        finest: sampled.finest,
        n_passed_over: parts.n_passed_over,
        middles: parts.measured.iter().map(|m| m.middle).collect(),
        volumes: of_part(|m| m.volume),
        radii: of_part(|m| m.radius),
        tetrahedron_of_part: parts.tetrahedron_of_part,
        links,
        crack: CRACK * narrowest,
        vertices,
        delaunay: sampled.delaunay,
    })
}

/// Tetrahedra of points on the surfaces and on a box around the scene.
struct Sampled {
    delaunay: Delaunay,
    /// See [`Space::finest`]. [Units: wu]
    finest: f64,
    /// Vertices of the box.
    box_vertices: BTreeSet<u32>,
    tolerance: CutTolerance,
}

/// Samples points on the surfaces, as dense as the air needs, and makes their tetrahedra.
fn sample(
    walls: &[Triangle],
    closures: &[Triangle],
    narrowest: f64,
    limits: &Limits<'_>,
) -> Result<Sampled, DelaunayError> {
    let all: Vec<Triangle> = walls.iter().chain(closures).copied().collect();
    let all_bvh = Bvh::build(&all);
    let mut points: Vec<DVec3> = all.iter().flatten().copied().collect();
    let bounds = points.iter().fold(Aabb::EMPTY, |b, &p| b.including(p));
    drop(all);
    let n_surface = points.len();
    let around = bounds.expanded(MARGIN * narrowest + 0.25 * bounds.size().max_element());
    points.extend(box_points(&around));
    let least = narrowest * LEAST_BALL;
    let within = Limits {
        n_points: points.len() + limits.n_points.min(MAX_POINTS),
        ..*limits
    };
    let refined = refined(&points, &all_bvh, &around, least, &within)?;
    let delaunay = refined.delaunay;
    let box_vertices = delaunay.vertex_of_point[n_surface..].iter();
    let reach = around.min.abs().max(around.max.abs()).max_element();
    Ok(Sampled {
        finest: refined.down_to,
        box_vertices: box_vertices.copied().collect(),
        tolerance: CutTolerance {
            plane: ON_PLANE * reach,
            width: CLOSED * ON_PLANE * reach,
        },
        delaunay,
    })
}

/// Tetrahedra for the walls to cut.
struct Air<'a> {
    knife: Knife<'a>,
    /// Vertices of the box around the scene.
    box_vertices: &'a BTreeSet<u32>,
    /// The narrowest opening. [Units: wu]
    narrowest: f64,
}

/// The parts of all tetrahedra.
struct AllParts {
    /// The first part of each tetrahedron, then all further ones.
    measured: Vec<Measured>,
    /// See [`Space::tetrahedron_of_part`].
    tetrahedron_of_part: Vec<u32>,
    /// Start of the further parts of each tetrahedron.
    further: Vec<u32>,
    n_passed_over: usize,
}

impl AllParts {
    /// Returns the id of part `k` of tetrahedron `t`.
    fn id(&self, t: usize, k: u32) -> u32 {
        if k == 0 {
            t as u32
        } else {
            self.further[t] + k - 1
        }
    }

    fn at(&self, part: u32) -> &Measured {
        &self.measured[part as usize]
    }
}

impl Air<'_> {
    /// Cuts each tetrahedron by the walls.
    fn cut_all(&self) -> Vec<TetrahedraCut> {
        let allowance = self.knife.allowance;
        (0..self.knife.delaunay.n_finite as u32)
            .into_par_iter()
            .map(|t| {
                if !allowance.spend(WORK_A_TETRAHEDRON) {
                    return TetrahedraCut::default();
                }
                let cut = self.knife.cut(t);
                let n_parts = cut.parts.as_ref().map_or(0, |p| p.parts.len());
                allowance.spend(WORK_A_PART * n_parts as u64);
                cut
            })
            .collect()
    }

    /// Returns `true` if a tetrahedron reaches the border: it has an infinite neighbor, or all its vertices lie on the
    /// box.
    fn is_outdoors(&self, t: usize) -> bool {
        let tet = &self.knife.delaunay.tetrahedra[t];
        (0..4).any(|i| tet.neighbor(i) as usize >= self.knife.delaunay.n_finite)
            || tet.vertices.iter().all(|v| self.box_vertices.contains(v))
    }

    /// Measures an uncut tetrahedron.
    fn measure_whole(&self, t: usize) -> Measured {
        if !self.knife.allowance.spend(WORK_A_BALL) {
            return Measured::NOTHING;
        }
        let c = self.knife.delaunay.corners(t as u32);
        let middle = c.iter().sum::<DVec3>() / 4.0;
        let (center, radius, volume) = circumsphere(c);
        // A ball on the other side of a wall carries no information on this side.
        let is_own = radius.is_finite() && !self.knife.bvh.any_hit(middle, center, |_| false);
        let radius = if self.is_outdoors(t) {
            f64::INFINITY
        } else if is_own {
            of_air(center, radius, self.knife.bvh)
        } else {
            0.0
        };
        Measured {
            middle,
            volume,
            radius,
            center,
        }
    }

    /// Measures a part of tetrahedron `t`, whose ball is `whole`. A polygon crosses the ball, which therefore carries
    /// no information on the part: the part is a spike. If the tetrahedron reaches the box, some parts may lie in a
    /// wall.
    fn measure_part(&self, t: usize, whole: &Measured, part: &Part) -> Measured {
        let vertices = self.knife.delaunay.tetrahedra[t].vertices.iter();
        let is_outdoors = whole.radius == f64::INFINITY
            && vertices
                .filter(|v| self.box_vertices.contains(v))
                .any(|&v| part.has_vertex(self.knife.delaunay.vertices[v as usize]));
        Measured {
            middle: part.middle,
            volume: part.volume,
            radius: if is_outdoors { f64::INFINITY } else { 0.0 },
            center: part.middle,
        }
    }

    /// Numbers the parts of all tetrahedra, and measures them.
    fn measure(&self, cuts: &[TetrahedraCut]) -> AllParts {
        let n = self.knife.delaunay.n_finite;
        let whole = (0..n).into_par_iter().map(|t| self.measure_whole(t));
        let mut all = AllParts {
            measured: whole.collect(),
            tetrahedron_of_part: (0..n as u32).collect(),
            further: vec![0; n],
            n_passed_over: 0,
        };
        for (t, cut) in cuts.iter().enumerate() {
            let Some(parts) = &cut.parts else { continue };
            all.n_passed_over += parts.n_passed_over;
            all.further[t] = all.measured.len() as u32;
            let whole = all.measured[t];
            for (k, part) in parts.parts.iter().enumerate() {
                let measured = self.measure_part(t, &whole, part);
                if k == 0 {
                    all.measured[t] = measured;
                } else {
                    all.measured.push(measured);
                    all.tetrahedron_of_part.push(t as u32);
                }
            }
        }
        all
    }

    /// Returns all links, each with its outline.
    fn ways(&self, cuts: &[TetrahedraCut], parts: &AllParts) -> Vec<Way> {
        (0..self.knife.delaunay.n_finite)
            .into_par_iter()
            .filter(self.knife.allowance.each(WORK_A_TETRAHEDRON))
            .flat_map_iter(|t| {
                let mut out = Ways::new();
                for i in 0..4 {
                    self.ways_across((t, i), cuts, parts, &mut out);
                }
                ways_within(t, &cuts[t], parts, &mut out);
                out
            })
            .collect()
    }

    /// Collects the links across facet `i` of tetrahedron `t`, unless they are found from the other side.
    fn ways_across(
        &self,
        (t, i): (usize, usize),
        cuts: &[TetrahedraCut],
        parts: &AllParts,
        out: &mut Ways,
    ) {
        let tet = &self.knife.delaunay.tetrahedra[t];
        let other = tet.neighbor(i) as usize;
        if other >= self.knife.delaunay.n_finite || other < t {
            return;
        }
        let f = tet
            .facet(i)
            .map(|v| self.knife.delaunay.vertices[v as usize]);
        let pair = [&cuts[t], &cuts[other]];
        let is_cut = pair.iter().any(|c| c.parts.is_some());
        let facet = (t as u32, i);
        for piece in self.knife.openings(facet.0, facet.1, pair) {
            let ids = [parts.id(t, piece.parts[0]), parts.id(other, piece.parts[1])];
            let [a, b] = ids.map(|p| parts.at(p));
            let whole = passing_radius(f, a, b);
            let radius = match &piece.outline {
                // A polygon that covers part of a facet narrows it; one that cuts beside it does not, except for
                // cracks.
                Some(outline) if !is_cut || width(outline) < CRACK * self.narrowest => {
                    whole.min(by_size(outline))
                }
                _ => whole,
            };
            out.push((Link::new(ids, t, i, radius), piece.outline));
        }
    }
}

/// A link and its outline.
type Way = (Link, Outline);
/// The links that one tetrahedron finds; a few, unless polygons cut it.
type Ways = SmallVec<[Way; 4]>;

/// Collects the links between the parts of one tetrahedron.
fn ways_within(t: usize, cut: &TetrahedraCut, parts: &AllParts, out: &mut Ways) {
    for (pair, outline) in cut.parts.iter().flat_map(|p| &p.inner) {
        let ids = pair.map(|k| parts.id(t, k));
        let are_outdoors = ids.iter().all(|&p| parts.at(p).radius == f64::INFINITY);
        let radius = if are_outdoors {
            f64::INFINITY
        } else {
            by_size(outline)
        };
        out.push((Link::new(ids, t, 4, radius), Some(outline.clone())));
    }
}

/// Returns links that refer to their outlines, and the vertices of all outlines.
fn with_outlines(ways: Vec<Way>) -> (Vec<Link>, Vec<DVec3>) {
    let mut vertices = Vec::new();
    let links = ways
        .into_iter()
        .map(|(mut link, outline)| {
            if let Some(outline) = outline {
                link.first_vertex = vertices.len() as u32;
                link.n_vertices = outline.len() as u16;
                vertices.extend(outline);
            }
            link
        })
        .collect();
    (links, vertices)
}

/// Returns the radius of the ball that passes an outline beside a spike: only the size of the outline is known.
fn by_size(outline: &[DVec3]) -> f64 {
    (area(outline) / std::f64::consts::PI).sqrt()
}

/// Returns a lattice of points on the faces of a box.
pub(super) fn box_points(b: &Aabb) -> Vec<DVec3> {
    let n = BOX_POINTS;
    let step = |i: usize| i as f64 / (n - 1) as f64;
    let mut out = Vec::new();
    for i in 0..n * n * n {
        let at = [i % n, i / n % n, i / (n * n)];
        if at.iter().any(|&k| k == 0 || k == n - 1) {
            let t = DVec3::from_array(at.map(step));
            out.push(b.min + b.size() * t);
        }
    }
    out
}

/// Returns the radius of the widest ball that passes a facet from the center of one part's ball to that of the other's.
fn passing_radius(f: Triangle, a: &Measured, b: &Measured) -> f64 {
    let least = a.radius.min(b.radius);
    let circle = circle(f).map_or(0.0, |c| c.1);
    if least == 0.0 {
        // Beside a spike, only the facet is known; no ball is wider than the space beyond.
        let most = a.radius.max(b.radius);
        return if most > 0.0 { circle.min(most) } else { circle };
    }
    let normal = enfilade_geom::triangle_area_normal(&f);
    let side = |c: DVec3| normal.dot(c - f[2]);
    if least.is_finite() && side(a.center) * side(b.center) > 0.0 {
        return least;
    }
    circle.min(least)
}

impl Link {
    fn new(parts: [u32; 2], tetrahedron: usize, facet: usize, radius: f64) -> Self {
        Self {
            parts,
            tetrahedron: tetrahedron as u32,
            facet: facet as u8,
            n_vertices: 0,
            first_vertex: 0,
            radius,
        }
    }
}

impl Space {
    /// Returns the outline of an opening: convex, counter-clockwise seen from the second part. [Units: wu]
    pub(super) fn outline(&self, link: &Link) -> SmallVec<[DVec3; 6]> {
        if link.n_vertices > 0 {
            let first = link.first_vertex as usize;
            return self.vertices[first..first + usize::from(link.n_vertices)].into();
        }
        let tet = &self.delaunay.tetrahedra[link.tetrahedron as usize];
        let position = |v: u32| {
            debug_assert!(v != INFINITE);
            self.delaunay.vertices[v as usize]
        };
        tet.facet(usize::from(link.facet))
            .map(position)
            .into_iter()
            .collect()
    }

    /// Returns the part that contains a point: in a tetrahedron that is cut, the nearest of its parts that none of the
    /// `walls` separates from it. The search begins at part `hint`: the nearer, the faster.
    pub(super) fn part_at(&self, p: DVec3, hint: u32, walls: &Bvh) -> Option<u32> {
        let n = self.delaunay.n_finite;
        let t = self
            .delaunay
            .locate(p, self.tetrahedron_of_part[hint as usize]);
        if t as usize >= n {
            return None;
        }
        let further = &self.tetrahedron_of_part[n..];
        let first = further.partition_point(|&of| of < t);
        let n_further = further[first..].partition_point(|&of| of == t);
        if n_further == 0 {
            return Some(t);
        }
        let further = (0..n_further).map(|k| (n + first + k) as u32);
        let middle = |part: u32| self.middles[part as usize];
        std::iter::once(t)
            .chain(further)
            .filter(|&part| !walls.any_hit(p, middle(part), |_| false))
            .min_by(|&a, &b| {
                let [a, b] = [a, b].map(|part| middle(part).distance_squared(p));
                a.total_cmp(&b)
            })
    }

    /// Returns `true` if the opening that polygons leave in a facet is too narrow for a portal.
    pub(super) fn is_crack(&self, link: &Link) -> bool {
        link.n_vertices > 0 && width(&self.outline(link)) < self.crack
    }

    /// Returns the area of an opening times its unit normal, which points from the first part to the second.
    /// [Units: wu²]
    #[must_use]
    pub fn area_vector(&self, link: &Link) -> DVec3 {
        area_normal(&self.outline(link)) * 0.5
    }

    /// Returns the vertices of the facet or tetrahedron in which an opening lies: openings that share one touch.
    pub(super) fn vertices_about(&self, link: &Link) -> SmallVec<[u32; 4]> {
        let tet = &self.delaunay.tetrahedra[link.tetrahedron as usize];
        if link.facet == 4 {
            tet.vertices.into()
        } else {
            tet.facet(usize::from(link.facet)).into_iter().collect()
        }
    }

    /// Returns the vertices of the tetrahedron of a part. [Units: wu]
    #[must_use]
    pub fn corners(&self, part: u32) -> [DVec3; 4] {
        self.delaunay
            .corners(self.tetrahedron_of_part[part as usize])
    }
}

/// Returns groups of links whose facets share vertices, each in order.
pub(super) fn connected(space: &Space, links: &[u32]) -> Vec<Vec<u32>> {
    let mut sets = Sets::new(links.len());
    let mut first_at: BTreeMap<u32, u32> = BTreeMap::new();
    for (i, &l) in links.iter().enumerate() {
        for v in space.vertices_about(&space.links[l as usize]) {
            let first = *first_at.entry(v).or_insert(i as u32);
            sets.join(first, i as u32);
        }
    }
    let mut groups: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (i, &l) in links.iter().enumerate() {
        groups.entry(sets.find(i as u32)).or_default().push(l);
    }
    groups.into_values().collect()
}

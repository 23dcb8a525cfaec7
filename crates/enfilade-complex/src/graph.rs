//! The first visit: which leaves are open to each other, how wide those openings are, and the volume of each leaf.

use std::cmp::Reverse;
use std::ops::Range;
use std::sync::OnceLock;

use enfilade_geom::poly::{self, Poly, Sides};
use enfilade_geom::{Aabb, Bvh, DVec3, NearSeries, Purse, Sets};
use rayon::prelude::*;

use smallvec::SmallVec;

use super::facet::{FacetSink, OpenPieces, RawFacet, Visitor};
use super::tree::{Tree, leaf_index};

/// Openings up to this many gaps wide are cracks; for the default gap that is [`CRACK_WIDTH`](super::CRACK_WIDTH).
const CRACK_GAPS: f64 = 5.0;

/// Points farther than this many roundings from matter lie in the air, so their leaves are not solid.
const CLEAR: f64 = 4.0;

/// Cost per area of a border on a candidate: only a tie-breaker.
const CANDIDATE: f64 = 0.01;

/// No candidate.
pub(super) const NO_CANDIDATE: u32 = u32::MAX;

/// An opening between two leaves, on one candidate or on none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OpenFacet {
    /// Leaves on the positive and on the negative side of its plane.
    pub(super) leaves: [u32; 2],
    /// Width of its widest piece.
    pub(super) width: f32,
    /// Area of all its pieces.
    pub(super) area: f32,
    /// Its candidate, or [`NO_CANDIDATE`].
    pub(super) candidate: u32,
    /// No piece of it is wider than a crack.
    pub(super) is_narrow: bool,
    /// No piece of it lets a ball of the smallest hole pass, so it may be sealed.
    pub(super) is_gap: bool,
    /// A point of it lies in the air, farther than [`CLEAR`] roundings from matter.
    pub(super) is_clear: bool,
}

impl OpenFacet {
    /// Returns the cost of a border between two cells here: its area, or next to nothing on a candidate, where a
    /// border belongs. [Units: wu²]
    pub(super) fn cost(&self) -> f64 {
        let share = if self.candidate == NO_CANDIDATE {
            1.0
        } else {
            CANDIDATE
        };
        f64::from(self.area) * share
    }
}

/// Result of the first visit.
pub(super) struct LeafGraph<'a> {
    /// Openings, in the order of the tree.
    pub(super) facets: Vec<OpenFacet>,
    /// Volume of each leaf.
    pub(super) volumes: Vec<f64>,
    /// Area of the largest face of each leaf. Volume divided by it is the leaf's thickness, within a factor of three.
    pub(super) faces: Vec<f32>,
    /// Box of each leaf.
    pub(super) boxes: Vec<Aabb>,
    /// For each leaf, `true` if it touches the border of the box.
    pub(super) at_border: Vec<bool>,
    /// Diameter of the smallest hole: openings through which no such ball passes are narrow. [Units: wu]
    pub(super) hole: f64,
    /// Openings narrower than this may be steps between surfaces that were moved into planes. [Units: wu]
    pub(super) rounding: f64,
    /// Pays for later passes over the graph.
    pub(super) purse: Purse<'a>,
    /// The same for all labels.
    pub(super) known: Known,
}

/// Findings from the openings alone, made when they are needed first.
#[derive(Default)]
pub(super) struct Known {
    components: OnceLock<Vec<u32>>,
    gaps: OnceLock<Vec<u32>>,
}

impl<'a> LeafGraph<'a> {
    /// Visits the whole tree.
    pub(super) fn of(visitor: &Visitor<'_>, clearance: &Clearance<'_>, purse: Purse<'a>) -> Self {
        let tree = visitor.tree;
        let origin = tree.bounds.center();
        let mut sink = LeafSink {
            visitor,
            clearance,
            origin,
            first_leaf: 0,
            facets: Vec::new(),
            volumes: vec![0.0; tree.n_leaves as usize],
            faces: vec![0.0; tree.n_leaves as usize],
            boxes: vec![Aabb::EMPTY; tree.n_leaves as usize],
            series: NearSeries::default(),
        };
        visitor.visit(&mut sink);
        let LeafSink {
            facets,
            mut volumes,
            faces,
            mut boxes,
            ..
        } = sink;
        let mut at_border = vec![false; tree.n_leaves as usize];
        for (face, outward) in box_faces(&tree.bounds) {
            sides_of_border(
                tree,
                tree.root,
                &face,
                visitor.tolerance.cut,
                &mut |leaf, piece| {
                    at_border[leaf as usize] = true;
                    grow(&mut boxes[leaf as usize], piece);
                    volumes[leaf as usize] +=
                        cone_volume(poly::area(piece), piece[0], outward, origin);
                },
            );
        }
        // The volumes of degenerate leaves are noise around zero.
        for v in &mut volumes {
            *v = v.max(0.0);
        }
        let mut graph = Self {
            facets,
            volumes,
            faces,
            boxes,
            at_border,
            hole: clearance.hole,
            rounding: visitor.tolerance.width,
            purse,
            known: Known::default(),
        };
        let mut facets = std::mem::take(&mut graph.facets);
        facets.par_iter_mut().with_min_len(1024).for_each(|f| {
            let width = f64::from(f.width);
            f.is_gap |= graph.is_rim(f.leaves, width, graph.hole);
            f.is_narrow |= f.is_gap || graph.is_rim(f.leaves, width, CRACK_GAPS * graph.hole);
        });
        Self { facets, ..graph }
    }

    /// Returns the least leaf of the component of each leaf: leaves connected without crossing candidates or gaps.
    pub(super) fn components(&self) -> &[u32] {
        self.known
            .components
            .get_or_init(|| self.components_without(|_| false))
    }

    /// Returns the components of leaves connected without crossing candidates, gaps or facets that part.
    pub(super) fn components_without(&self, parts: impl Fn(&OpenFacet) -> bool) -> Vec<u32> {
        self.spend_pass();
        let mut sets = Sets::new(self.volumes.len());
        for f in &self.facets {
            if f.candidate == NO_CANDIDATE && !f.is_gap && !parts(f) {
                sets.join(f.leaves[0], f.leaves[1]);
            }
        }
        sets.into_least()
    }

    /// Returns the gaps, those in the air first, then largest first.
    pub(super) fn gaps(&self) -> impl Iterator<Item = &OpenFacet> {
        let facet = |&i: &u32| &self.facets[i as usize];
        let gaps = self.known.gaps.get_or_init(|| {
            let all = 0..self.facets.len() as u32;
            let mut gaps: Vec<u32> = all.filter(|i| facet(i).is_gap).collect();
            // Areas are not negative, so their bits compare like numbers.
            gaps.par_sort_unstable_by_key(|i| {
                let f = facet(i);
                (Reverse((f.is_clear, f.area.to_bits())), f.leaves)
            });
            gaps
        });
        gaps.iter().map(facet)
    }

    /// Spends the cost of one pass over all leaves and openings; returns `false` once the purse is empty.
    pub(super) fn spend_pass(&self) -> bool {
        let n = self.volumes.len() + self.facets.len();
        self.purse.spend(n as u64 / 4)
    }

    /// Returns `true` if an opening narrower than `limit` is at the rim of a leaf thinner than `limit`, or no wider
    /// than rounding. Nothing passes there: anything that fits passes through the wide faces of the leaf.
    pub(super) fn is_rim(&self, leaves: [u32; 2], width: f64, limit: f64) -> bool {
        let is_thin = |&l: &u32| self.is_thinner(l, limit);
        width < limit && (width < self.rounding || leaves.iter().any(is_thin))
    }

    /// Returns `true` if no ball of the smallest hole fits into a leaf, within a factor of three.
    pub(super) fn is_thin(&self, leaf: u32) -> bool {
        self.is_thinner(leaf, self.hole)
    }

    fn is_thinner(&self, leaf: u32, limit: f64) -> bool {
        self.volumes[leaf as usize] < limit * f64::from(self.faces[leaf as usize])
    }
}

/// Measures the free space around openings.
#[derive(Clone, Copy)]
pub(super) struct Clearance<'a> {
    /// The structural triangles.
    pub(super) bvh: &'a Bvh,
    /// Diameter of the smallest hole. [Units: wu]
    pub(super) hole: f64,
    /// Pays for queries.
    pub(super) purse: Purse<'a>,
}

impl Clearance<'_> {
    /// Returns `true` if an opening, a convex polygon, lets no ball of the smallest hole pass: none of its points is
    /// farther than half the hole's width from solids.
    ///
    /// Samples its middle, and points between it and the vertices and the middles of edges. The polygon's width does
    /// not matter: cuts of the tree make narrow ones in open air, and beside a gap between two nearly parallel planes
    /// there are wide ones. One query of the triangles in the open, at most `4n + 1` in a gap.
    pub(super) fn is_gap(&self, points: &[DVec3]) -> bool {
        let mut series = NearSeries::default();
        let is_gap = self.is_narrower(points, self.hole, true, None, &mut series);
        self.spend(&series);
        is_gap
    }

    /// Returns two flags for an opening: narrow, that is, no wider than a crack; and gap. Of pieces narrower than the
    /// respective diameter, which cuts of the tree make, only the middle is tested.
    fn narrowness(&self, points: &[DVec3], width: f64, series: &mut NearSeries) -> [bool; 2] {
        let crack = CRACK_GAPS * self.hole;
        series.n_looked = 0;
        // Most are in the open and take one query.
        let middle = middle_of(points);
        let in_middle = self.bvh.any_within(middle, 0.5 * crack, series);
        let [mut is_narrow, mut is_gap] = [false; 2];
        if let Some(distance) = in_middle.filter(|_| crack > 0.0) {
            let known = (middle, distance);
            let mut is_narrower = |diameter: f64| {
                self.is_narrower(points, diameter, width >= diameter, Some(known), series)
            };
            is_gap = is_narrower(self.hole);
            is_narrow = is_gap || is_narrower(crack);
        }
        self.spend(series);
        [is_narrow, is_gap]
    }

    /// Returns `true` if a sampled point of an opening is farther than [`CLEAR`] roundings from matter. Costs as much
    /// as [`is_gap`](Self::is_gap).
    fn is_clear(&self, points: &[DVec3], rounding: f64) -> bool {
        let mut series = NearSeries::default();
        let is_near = self.is_narrower(points, 2.0 * CLEAR * rounding, true, None, &mut series);
        self.spend(&series);
        !is_near
    }

    /// Spends the cost of queries.
    fn spend(&self, series: &NearSeries) {
        self.purse.spend(series.n_looked / 4);
    }

    /// Returns `true` if an opening lets no ball of this diameter pass; tests only its middle unless `is_whole`. Some matter
    /// is at the `known` distance from a point.
    fn is_narrower(
        &self,
        points: &[DVec3],
        diameter: f64,
        is_whole: bool,
        known: Option<(DVec3, f64)>,
        series: &mut NearSeries,
    ) -> bool {
        if diameter <= 0.0 {
            return false;
        }
        let reach = 0.5 * diameter;
        let (n, middle) = (points.len(), middle_of(points));
        let between = (0..n).map(|i| points[i].midpoint(points[(i + 1) % n]));
        // Vertices touch solids, so points a tenth of the way to the middle are more telling.
        let inner = points.iter().copied().chain(between);
        let inner = inner.flat_map(|p| [0.1, 0.5].map(|t| p.lerp(middle, t)));
        let inner = inner.filter(|_| is_whole);
        // Distances change no faster than positions, so points near one known to be close need no query.
        let known = known.map(|(p, distance)| (p, reach - distance));
        let mut known: SmallVec<[(DVec3, f64); 8]> = known.into_iter().collect();
        std::iter::once(middle).chain(inner).all(|p| {
            if known.iter().any(|(q, left)| p.distance(*q) <= *left) {
                return true;
            }
            let distance = self.bvh.any_within(p, reach, series);
            known.extend(distance.map(|d| (p, reach - d)));
            distance.is_some()
        })
    }
}

/// Returns the mean of the vertices.
fn middle_of(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len() as f64
}

/// Returns the signed volume of the cone from `origin` over a polygon through `p`; over a closed surface, these add up
/// to its volume.
fn cone_volume(area: f64, p: DVec3, normal: DVec3, origin: DVec3) -> f64 {
    area * normal.dot(p - origin) / 3.0
}

fn grow(b: &mut Aabb, points: &[DVec3]) {
    *b = points.iter().fold(*b, |b, &p| b.including(p));
}

/// Returns the six faces of a box with their outward normals.
pub(super) fn box_faces(b: &Aabb) -> [(Poly, DVec3); 6] {
    std::array::from_fn(|i| {
        let (axis, high) = (i % 3, i >= 3);
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let face = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(pu, pv)| {
            let mut p = if high { b.max } else { b.min };
            p[u] = [b.min[u], b.max[u]][pu];
            p[v] = [b.min[v], b.max[v]][pv];
            p
        });
        let mut normal = DVec3::ZERO;
        normal[axis] = if high { 1.0 } else { -1.0 };
        (Poly::from_slice(&face), normal)
    })
}

/// Pushes a polygon down the tree and passes on its piece in every leaf.
pub(super) fn sides_of_border(
    tree: &Tree,
    child: i32,
    points: &[DVec3],
    eps: f64,
    take: &mut impl FnMut(u32, &[DVec3]),
) {
    if child < 0 {
        return take(leaf_index(child), points);
    }
    let node = &tree.nodes[child as usize];
    match poly::split(points, &tree.planes[node.plane as usize], eps) {
        Sides::Front | Sides::On => sides_of_border(tree, node.children[0], points, eps, take),
        Sides::Back => sides_of_border(tree, node.children[1], points, eps, take),
        Sides::Both(f, b) => {
            sides_of_border(tree, node.children[0], &f, eps, take);
            sides_of_border(tree, node.children[1], &b, eps, take);
        }
    }
}

struct LeafSink<'a> {
    visitor: &'a Visitor<'a>,
    clearance: &'a Clearance<'a>,
    origin: DVec3,
    first_leaf: u32,
    facets: Vec<OpenFacet>,
    /// For the leaves from `first_leaf` on.
    volumes: Vec<f64>,
    /// For the same leaves.
    faces: Vec<f32>,
    /// For the same leaves.
    boxes: Vec<Aabb>,
    /// Pieces come in an order in which the next one is mostly near.
    series: NearSeries,
}

impl FacetSink for LeafSink<'_> {
    fn take(&mut self, facet: &RawFacet<'_>) {
        let normal = self.visitor.tree.planes[facet.plane as usize].normal;
        let area = poly::area(facet.points);
        let cone = cone_volume(area, facet.points[0], normal, self.origin);
        let [front, back] = facet.leaves.map(|l| (l - self.first_leaf) as usize);
        self.volumes[front] -= cone;
        self.volumes[back] += cone;
        for leaf in [front, back] {
            self.faces[leaf] = self.faces[leaf].max(area as f32);
            grow(&mut self.boxes[leaf], facet.points);
        }
        let first = self.facets.len();
        let rounding = self.visitor.tolerance.width;
        for (piece, candidate) in OpenPieces::of(facet, normal, &self.visitor.tolerance).pieces {
            let candidate = candidate.unwrap_or(NO_CANDIDATE);
            let (width, area) = (poly::width(&piece) as f32, poly::area(&piece) as f32);
            let [is_narrow, is_gap] =
                self.clearance
                    .narrowness(&piece, f64::from(width), &mut self.series);
            let is_clear = !is_gap || self.clearance.is_clear(&piece, rounding);
            match self.facets[first..]
                .iter_mut()
                .find(|f| f.candidate == candidate)
            {
                Some(f) => {
                    f.width = f.width.max(width);
                    f.area += area;
                    f.is_narrow &= is_narrow;
                    f.is_gap &= is_gap;
                    f.is_clear |= is_clear;
                }
                None => {
                    self.facets.push(OpenFacet {
                        leaves: facet.leaves,
                        width,
                        area,
                        candidate,
                        is_narrow,
                        is_gap,
                        is_clear,
                    });
                }
            }
        }
    }

    fn fork(&self, leaves: Range<u32>) -> Self {
        Self {
            visitor: self.visitor,
            clearance: self.clearance,
            origin: self.origin,
            first_leaf: leaves.start,
            facets: Vec::new(),
            volumes: vec![0.0; leaves.len()],
            faces: vec![0.0; leaves.len()],
            boxes: vec![Aabb::EMPTY; leaves.len()],
            series: NearSeries::default(),
        }
    }

    fn join(&mut self, front: Self, back: Self) {
        for part in [front, back] {
            if self.facets.is_empty() {
                self.facets = part.facets;
            } else {
                self.facets.extend_from_slice(&part.facets);
            }
            let at = (part.first_leaf - self.first_leaf) as usize;
            for (sum, v) in self.volumes[at..].iter_mut().zip(&part.volumes) {
                *sum += v;
            }
            for (most, v) in self.faces[at..].iter_mut().zip(&part.faces) {
                *most = most.max(*v);
            }
            for (all, b) in self.boxes[at..].iter_mut().zip(&part.boxes) {
                *all = all.union(*b);
            }
        }
    }
}

//! The facets between leaves: every node's plane polygon, pushed down both subtrees.
//!
//! Portals of a BSP are made this way (Lefebvre & Hornus 2003, in the notes on BSP construction that follow §3.0.2:
//! clip the plane by its parents, split it by its children). No polygon outlives its visit: the first visit keeps a
//! few numbers per facet, the second makes the polygons again where two cells meet.

use enfilade_geom::poly::{self, Poly, Side};
use enfilade_geom::{Aabb, DVec3, Plane, Purse, Tab};
use smallvec::SmallVec;

use super::surface::{MIN_AREA, Source, Surface, Tolerance, projected};
use super::tree::{Tree, leaf_index};

/// Larger subtrees, in leaves, are visited in parallel.
const PARALLEL_LEAVES: u32 = 2048;

/// The part of a surface that may cover a facet, in the facet's plane.
pub(super) struct Cover {
    /// The candidate, or `None` for a structural triangle.
    pub(super) candidate: Option<u32>,
    /// Vertices, counter-clockwise about the plane's normal.
    pub(super) points: Poly,
    bounds: Aabb,
    /// Planes through its edges, square to its own; they face inwards.
    edges: SmallVec<[Plane; 3]>,
}

impl Cover {
    /// Makes a cover of a polygon, counter-clockwise about `normal`.
    fn new(candidate: Option<u32>, points: Poly, normal: DVec3) -> Self {
        let edge = |(i, &a): (usize, &DVec3)| {
            let b = points[if i + 1 == points.len() { 0 } else { i + 1 }];
            let inward = normal.cross(b - a).try_normalize()?;
            Some(Plane::through(a, inward))
        };
        Self {
            candidate,
            bounds: Aabb::of_points(&points),
            edges: points.iter().enumerate().filter_map(edge).collect(),
            points,
        }
    }

    /// Returns `true` if a point is nearer than `reach` to the box around it.
    pub(super) fn is_near(&self, p: DVec3, reach: f64) -> bool {
        self.bounds.expanded(reach).contains(p)
    }

    /// Returns `true` if a polygon in its plane, wider than `eps`, is inside, with `eps` to spare.
    fn holds(&self, points: &[DVec3], eps: f64) -> bool {
        let is_inside = |edge: &Plane| points.iter().all(|&p| edge.signed_distance(p) >= -eps);
        self.edges.iter().all(is_inside)
    }

    /// Cuts a polygon in its plane: appends the parts outside to `outside` and returns the part inside. If none is, or
    /// one narrower than `min_width`, appends the whole polygon.
    fn cut_from(
        &self,
        whole: Poly,
        eps: f64,
        min_width: f64,
        outside: &mut Vec<Poly>,
    ) -> Option<Poly> {
        let before = outside.len();
        let is_near = Aabb::of_points(&whole).expanded(eps).overlaps(&self.bounds);
        let mut inside: Option<Poly> = None;
        let is_hit = is_near
            && self.edges.iter().all(|edge| {
                let points = inside.as_ref().unwrap_or(&whole);
                match poly::side(points, edge, eps) {
                    Side::Front => true,
                    Side::Back | Side::On => false,
                    Side::Both => {
                        let (mut front, mut back) = (Poly::new(), Poly::new());
                        poly::add_parts(points, edge, eps, &mut front, &mut back);
                        outside.push(back);
                        inside = Some(front);
                        true
                    }
                }
            });
        let is_wide = |inside: &Poly| min_width <= 0.0 || poly::width(inside) >= min_width;
        if is_hit && is_wide(inside.as_ref().unwrap_or(&whole)) {
            return inside.or(Some(whole));
        }
        // No significant overlap: keep the polygon in one piece instead of the shreds cut so far.
        outside.truncate(before);
        outside.push(whole);
        None
    }
}

/// The polygon between two leaves, with nothing subtracted yet.
pub(super) struct RawFacet<'a> {
    /// The node's plane, an index into [`Tree::planes`].
    pub(super) plane: u32,
    /// Leaves on the positive and on the negative side.
    pub(super) leaves: [u32; 2],
    /// Counter-clockwise seen from the positive side.
    pub(super) points: &'a [DVec3],
    /// Surfaces in the plane that come near the polygon.
    pub(super) covers: Covers<'a>,
}

/// Some of the surfaces in a plane, as a list of indices, so that surfaces are not copied.
#[derive(Clone, Copy)]
pub(super) struct Covers<'a> {
    all: &'a [Cover],
    near: &'a [u32],
}

impl<'a> Covers<'a> {
    /// Iterates over the surfaces.
    pub(super) fn iter(self) -> impl Iterator<Item = &'a Cover> {
        self.near.iter().map(move |&i| &self.all[i as usize])
    }

    /// Returns `true` if there are triangles among them.
    pub(super) fn has_triangles(self) -> bool {
        self.iter().any(|c| c.candidate.is_none())
    }

    /// Returns the indices of the surfaces that come near a part of the facet.
    fn near(self, part: &[DVec3], reach: f64) -> SmallVec<[u32; 16]> {
        if self.near.is_empty() {
            return SmallVec::new();
        }
        let reach = Aabb::of_points(part).expanded(reach);
        let is_near = |i: &u32| self.all[*i as usize].bounds.overlaps(&reach);
        self.near.iter().copied().filter(is_near).collect()
    }
}

/// Receiver of facets. It is forked and joined along the tree, never along threads.
pub(super) trait FacetSink: Send + Sized {
    /// Returns `true` if facets within this subtree matter.
    fn wants_subtree(&self, _child: i32) -> bool {
        true
    }
    /// Returns `true` if facets in the plane of a node matter; called before those facets are.
    fn enter(&mut self, _node: i32) -> bool {
        true
    }
    /// Returns `true` if facets between two subtrees, in the plane of the node entered last, matter.
    fn wants_pair(&self, _front: i32, _back: i32) -> bool {
        true
    }
    /// Returns `true` if facets under these covers matter.
    fn wants_under(&self, _covers: Covers<'_>) -> bool {
        true
    }
    /// Receives a facet.
    fn take(&mut self, facet: &RawFacet<'_>);
    /// Makes a sink for one subtree.
    fn fork(&self, leaves: std::ops::Range<u32>) -> Self;
    /// Merges the results of both subtrees' forks, front then back.
    fn join(&mut self, front: Self, back: Self);
}

/// Input of a visit.
pub(super) struct Visitor<'a> {
    pub(super) tree: &'a Tree,
    pub(super) surfaces: &'a [Surface],
    pub(super) tolerance: Tolerance,
    /// Bounds the work of a visit; once it is spent, facets are skipped.
    pub(super) purse: Purse<'a>,
}

/// One thread's means of a visit.
struct Hand<'a> {
    tab: Tab<'a>,
    /// Those of the last node; its memory serves the next.
    covers: Vec<Cover>,
}

impl<'a> From<Purse<'a>> for Hand<'a> {
    fn from(purse: Purse<'a>) -> Self {
        Self {
            tab: purse.into(),
            covers: Vec::new(),
        }
    }
}

/// A node's region: a box, cut by the oblique planes above the node, which face inwards.
#[derive(Clone)]
pub(super) struct CutBox {
    pub(super) bounds: Aabb,
    pub(super) cuts: Vec<Plane>,
}

impl CutBox {
    pub(super) fn all(bounds: Aabb) -> Self {
        Self {
            bounds,
            cuts: Vec::new(),
        }
    }

    /// Calls `then` with the part on the positive side of a plane, 0, or on the negative side, 1.
    pub(super) fn on_side<T>(
        &mut self,
        plane: &Plane,
        side: usize,
        then: impl FnOnce(&mut Self) -> T,
    ) -> T {
        let before = (self.bounds, self.cuts.len());
        match ((0..3).find(|&a| plane.normal[a] == 1.0), side) {
            (Some(axis), 0) => self.bounds.min[axis] = self.bounds.min[axis].max(-plane.d),
            (Some(axis), _) => self.bounds.max[axis] = self.bounds.max[axis].min(-plane.d),
            (None, 0) => self.cuts.push(*plane),
            (None, _) => self.cuts.push(plane.flipped()),
        }
        let out = then(self);
        self.bounds = before.0;
        self.cuts.truncate(before.1);
        out
    }
}

impl Visitor<'_> {
    /// Passes every facet of the tree to `sink`. Time: the number of facets times the depth.
    pub(super) fn visit<S: FacetSink + Sync>(&self, sink: &mut S) {
        let mut region = CutBox::all(self.tree.bounds);
        let mut hand = self.purse.into();
        self.visit_node(self.tree.root, &mut region, true, &mut hand, sink);
    }

    /// `may_fork` is `false` within small subtrees.
    fn visit_node<S: FacetSink + Sync>(
        &self,
        child: i32,
        region: &mut CutBox,
        may_fork: bool,
        hand: &mut Hand<'_>,
        sink: &mut S,
    ) {
        if child < 0 || !sink.wants_subtree(child) || !hand.tab.spend(1) {
            return;
        }
        let node = self.tree.nodes[child as usize];
        let plane = self.tree.planes[node.plane as usize];
        let forks = may_fork && self.tree.leaf_range(child).len() as u32 > PARALLEL_LEAVES;
        if forks {
            let visit = |side: usize, mut sink: S| {
                region.clone().on_side(&plane, side, |part| {
                    let mut hand = self.purse.into();
                    self.visit_node(node.children[side], part, true, &mut hand, &mut sink);
                });
                sink
            };
            let [f_sink, b_sink] = node.children.map(|c| sink.fork(self.tree.leaf_range(c)));
            let (f_sink, b_sink) = rayon::join(|| visit(0, f_sink), || visit(1, b_sink));
            sink.join(f_sink, b_sink);
        } else {
            for (side, child) in node.children.into_iter().enumerate() {
                region.on_side(&plane, side, |part| {
                    self.visit_node(child, part, false, hand, sink);
                });
            }
        }
        if !sink.enter(child) || !sink.wants_pair(node.children[0], node.children[1]) {
            return;
        }
        let Some(points) = self.section(&plane, region) else {
            return;
        };
        let reach = Aabb::of_points(&points).expanded(self.tolerance.plane);
        let Hand { tab, covers } = hand;
        covers.clear();
        covers.extend(
            self.tree
                .surfaces_on(child as usize)
                .iter()
                .filter_map(|&s| {
                    let surface = &self.surfaces[s as usize];
                    let points = projected(&surface.points, &plane);
                    let candidate = match surface.source {
                        Source::Candidate(id) => Some(id),
                        Source::Triangle(_) | Source::Seam => None,
                    };
                    let is_near = Aabb::of_points(&points).overlaps(&reach);
                    is_near.then(|| Cover::new(candidate, points, plane.normal))
                }),
        );
        let near: SmallVec<[u32; 16]> = (0..covers.len() as u32).collect();
        let covers = Covers {
            all: covers,
            near: &near,
        };
        self.push_down(node.plane, &points, covers, node.children, tab, sink);
    }

    fn section(&self, plane: &Plane, region: &CutBox) -> Option<Poly> {
        let mut points = poly::section_of_box(plane, &region.bounds, self.tolerance.cut)?;
        let eps = self.tolerance.cut;
        let mut cuts = region.cuts.iter();
        let is_left = cuts.all(|cut| poly::clip_in_place(&mut points, cut, eps));
        is_left.then_some(points)
    }

    fn push_down<S: FacetSink>(
        &self,
        plane: u32,
        points: &[DVec3],
        covers: Covers<'_>,
        mut children: [i32; 2],
        tab: &mut Tab<'_>,
        sink: &mut S,
    ) {
        if !sink.wants_under(covers) {
            return;
        }
        loop {
            if !sink.wants_pair(children[0], children[1])
                || !tab.spend(1 + covers.near.len() as u64)
            {
                return;
            }
            let Some(at) = (0..2).find(|&i| children[i] >= 0) else {
                return sink.take(&RawFacet {
                    plane,
                    leaves: children.map(leaf_index),
                    points,
                    covers,
                });
            };
            let node = &self.tree.nodes[children[at] as usize];
            let cut = &self.tree.planes[node.plane as usize];
            let side = match poly::side(points, cut, self.tolerance.cut) {
                Side::Front => 0,
                Side::Back => 1,
                Side::On => {
                    // In the node's plane up to rounding: the sum of the small distances decides.
                    let sum: f64 = points.iter().map(|&p| cut.signed_distance(p)).sum();
                    usize::from(sum < 0.0)
                }
                Side::Both => {
                    let (mut front, mut back) = (Poly::new(), Poly::new());
                    poly::add_parts(points, cut, self.tolerance.cut, &mut front, &mut back);
                    for (child, part) in node.children.into_iter().zip([&front, &back]) {
                        children[at] = child;
                        let near = covers.near(part, self.tolerance.plane);
                        let covers = Covers {
                            near: &near,
                            ..covers
                        };
                        self.push_down(plane, part, covers, children, tab, sink);
                    }
                    return;
                }
            };
            children[at] = node.children[side];
        }
    }
}

/// The open part of a facet.
#[derive(Default)]
pub(super) struct OpenPieces {
    /// Convex pieces, each with the candidate that it lies on.
    pub(super) pieces: Vec<(Poly, Option<u32>)>,
}

impl OpenPieces {
    /// Subtracts the structural covers and divides the rest by the candidates.
    ///
    /// Pieces narrower than the tolerance, or smaller than [`MIN_AREA`], are closed where they lie along triangles: the gap
    /// may come from moving a triangle into its plane. Away from triangles a sliver is as open as any facet, and closing
    /// it would part a cell.
    pub(super) fn of(facet: &RawFacet<'_>, normal: DVec3, tolerance: &Tolerance) -> Self {
        let structural = || facet.covers.iter().filter(|c| c.candidate.is_none());
        let open = |p: &[DVec3]| {
            poly::is_larger(p, MIN_AREA, tolerance.width)
                || poly::is_larger(p, 0.0, 2.0 * tolerance.cut)
                    && !is_along(p, structural(), normal, tolerance.width)
        };
        // Narrower than this, a polygon is open for no cover, so half of it is to spare for rounding.
        let eps = tolerance.cut;
        let is_closed = structural().any(|c| c.holds(facet.points, 0.5 * eps));
        let mut rest: Vec<Poly> = Vec::new();
        if !is_closed && open(facet.points) {
            rest.push(facet.points.into());
        }
        let mut outside = Vec::new();
        for cover in structural() {
            if rest.is_empty() {
                break;
            }
            for p in rest.drain(..) {
                cover.cut_from(p, eps, 0.0, &mut outside);
            }
            outside.retain(|p| open(p));
            std::mem::swap(&mut rest, &mut outside);
        }
        let mut pieces = Vec::new();
        for cover in facet.covers.iter().filter(|c| c.candidate.is_some()) {
            for p in rest.drain(..) {
                let inside = cover.cut_from(p, eps, tolerance.width, &mut outside);
                pieces.extend(inside.filter(|p| open(p)).map(|p| (p, cover.candidate)));
            }
            outside.retain(|p| open(p));
            std::mem::swap(&mut rest, &mut outside);
        }
        pieces.extend(rest.into_iter().map(|p| (p, None)));
        Self { pieces }
    }
}

/// Returns `true` if the whole length of a narrow polygon lies on `covers` or within `reach` of them, in one plane.
///
/// Judges the line between the two vertices farthest from each other. O(covers).
fn is_along<'a>(
    narrow: &[DVec3],
    covers: impl Iterator<Item = &'a Cover>,
    normal: DVec3,
    reach: f64,
) -> bool {
    let pairs = narrow.iter().enumerate();
    let pairs = pairs.flat_map(|(i, &a)| narrow[i + 1..].iter().map(move |&b| (a, b)));
    let Some((a, b)) = pairs.max_by(|p, q| p.0.distance(p.1).total_cmp(&q.0.distance(q.1))) else {
        return false;
    };
    let mut parts: SmallVec<[[f64; 2]; 8]> = covers
        .filter_map(|c| part_within(a, b, c, normal, reach))
        .collect();
    if parts.is_empty() {
        return false;
    }
    parts.sort_by(|p, q| p[0].total_cmp(&q[0]));
    let slack = reach / a.distance(b);
    let end = parts.iter().fold(0.0, |end: f64, part| {
        if part[0] <= end + slack {
            end.max(part[1])
        } else {
            end
        }
    });
    end >= 1.0 - slack
}

/// Returns the part of the segment from `a` (0) to `b` (1) that lies within `reach` of a cover in its plane.
fn part_within(a: DVec3, b: DVec3, cover: &Cover, normal: DVec3, reach: f64) -> Option<[f64; 2]> {
    let points = &cover.points;
    let edges = (0..points.len()).filter_map(|i| {
        let (p, q) = (points[i], points[(i + 1) % points.len()]);
        Some((p, normal.cross(q - p).try_normalize()?))
    });
    // Beside a sharp vertex, the edges moved outwards meet far away.
    let sides = [
        (cover.bounds.min, DVec3::X),
        (cover.bounds.min, DVec3::Y),
        (cover.bounds.min, DVec3::Z),
        (cover.bounds.max, DVec3::NEG_X),
        (cover.bounds.max, DVec3::NEG_Y),
        (cover.bounds.max, DVec3::NEG_Z),
    ];
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for (p, inward) in edges.chain(sides) {
        let [at_a, at_b] = [a, b].map(|e| inward.dot(e - p) + reach);
        match (at_a >= 0.0, at_b >= 0.0) {
            (true, true) => {}
            (false, false) => return None,
            (true, false) => to = to.min(at_a / (at_a - at_b)),
            (false, true) => from = from.max(at_a / (at_a - at_b)),
        }
    }
    (from < to).then_some([from, to])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the number of open pieces of a facet in z = 0, 1 m long and a fourth of the tolerance wide.
    fn pieces_of_sliver(covers: &[Cover]) -> usize {
        pieces_of(1.0, covers)
    }

    /// Returns the number of open pieces of a facet of this length.
    fn pieces_of(length: f64, covers: &[Cover]) -> usize {
        let tolerance = Tolerance::for_extent(10.0);
        let w = 0.25 * tolerance.width;
        let points = [
            DVec3::ZERO,
            DVec3::new(length, 0.0, 0.0),
            DVec3::new(length, w, 0.0),
            DVec3::new(0.0, w, 0.0),
        ];
        let near: Vec<u32> = (0..covers.len() as u32).collect();
        let facet = RawFacet {
            plane: 0,
            leaves: [0, 1],
            points: &points,
            covers: Covers {
                all: covers,
                near: &near,
            },
        };
        OpenPieces::of(&facet, DVec3::Z, &tolerance).pieces.len()
    }

    #[test]
    fn a_sliver_is_open_unless_it_lies_beside_a_triangle() {
        assert_eq!(pieces_of_sliver(&[]), 1);
        assert_eq!(
            pieces_of(1e-6, &[]),
            1,
            "shorter than the tolerance is wide"
        );
        let points = Poly::from_slice(&[DVec3::ZERO, DVec3::NEG_Y, DVec3::X]);
        let beside = |candidate| Cover::new(candidate, points.clone(), DVec3::Z);
        assert_eq!(pieces_of_sliver(&[beside(None)]), 0);
        assert_eq!(pieces_of_sliver(&[beside(Some(0))]), 1);
    }

    /// A sliver that begins at a triangle and leads away from it, and one between two triangles that leaves a gap.
    #[test]
    fn a_sliver_that_leaves_its_triangle_is_open() {
        let cover = |from: f64, to: f64| {
            let points = [
                DVec3::new(from, 0.0, 0.0),
                DVec3::new(from, -1.0, 0.0),
                DVec3::new(to, 0.0, 0.0),
            ];
            Cover::new(None, Poly::from_slice(&points), DVec3::Z)
        };
        assert_eq!(pieces_of_sliver(&[cover(0.0, 0.1)]), 1);
        assert_eq!(pieces_of_sliver(&[cover(0.0, 0.4), cover(0.6, 1.0)]), 1);
        assert_eq!(pieces_of_sliver(&[cover(0.0, 0.6), cover(0.4, 1.0)]), 0);
    }
}

//! Open pieces to portals: grouped by plane and cells, merged where their union is convex.
//!
//! The tree cuts an opening wherever its planes happen to run; merging undoes those arbitrary cuts.
//!
//! Pieces beside a candidate, and gaps, through which no ball of the smallest hole passes, belong to an opening only
//! if they hardly widen its outline: the slit under a wall is not part of the door in it. All other gaps are seals.
//! Cracks, and gaps if nothing is sealed, form one portal for each plane and pair of cells.

use std::collections::BTreeMap;

use enfilade_geom::poly::Poly;
use enfilade_geom::{DVec2, DVec3, Plane, Purse, Sets, Winding};
use rayon::prelude::*;

use super::CRACK_WIDTH;
use super::leaf_cells::SOLID;

/// Pieces in one plane that are this close form one portal. [Units: wu]
const TOGETHER: f64 = 0.01;

/// Vertices this near to a line lie on it; the tree's own cuts are accurate to 1e-9. [Units: wu]
const STRAIGHT: f64 = 1e-7;

/// A convex opening between two leaves of different cells.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    /// The cells on its two sides, ascending.
    pub(super) cells: [u32; 2],
    /// Index of its plane.
    pub(super) plane: u32,
    /// `true` if the plane's normal points to the first cell, not to the second.
    pub(super) is_flipped: bool,
    /// The candidate that it lies on, if any.
    pub(super) candidate: Option<u32>,
    /// `true` for a gap, see [`Clearance`](super::graph::Clearance).
    pub(super) is_gap: bool,
    /// `true` for a gap only because it is at the rim of a thin leaf: several together may be wider than a gap.
    pub(super) is_rim: bool,
    /// Vertices, counter-clockwise about the plane's normal.
    pub(super) points: Poly,
}

/// The pieces of one portal.
pub(super) struct Opening {
    pub(super) cells: [u32; 2],
    pub(super) plane: Plane,
    pub(super) outline: Winding,
    pub(super) pieces: Vec<Winding>,
    pub(super) candidate: Option<u32>,
    pub(super) area: f64,
    pub(super) width: f64,
    /// `true` for a gap that is to be sealed.
    pub(super) is_seal: bool,
}

/// Input of [`group`].
pub(super) struct Rules<'a> {
    pub(super) planes: &'a [Plane],
    /// Diameter of the smallest hole. [Units: wu]
    pub(super) hole: f64,
    /// `true` if seals close gaps.
    pub(super) has_seals: bool,
    /// Candidates from this number on stand for missing triangles.
    pub(super) n_candidates: u32,
    /// Pays for grouping.
    pub(super) purse: Purse<'a>,
}

/// Groups pieces into openings, ordered by cells, then plane, then the order of the tree.
pub(super) fn group(mut pieces: Vec<Piece>, rules: &Rules<'_>) -> Vec<Opening> {
    // A stable sort keeps the order of the tree within a key.
    pieces.sort_by_key(|p| (p.cells, p.plane, p.is_flipped));
    let groups: Vec<&[Piece]> = pieces
        .chunk_by(|a, b| (a.cells, a.plane, a.is_flipped) == (b.cells, b.plane, b.is_flipped))
        .collect();
    groups
        .into_par_iter()
        .flat_map_iter(|g| openings_of(g, rules))
        .collect()
}

/// A convex polygon in its plane's own coordinates, counter-clockwise.
#[derive(Clone)]
struct Flat {
    points: Vec<DVec2>,
    min: DVec2,
    max: DVec2,
    area: f64,
}

impl Flat {
    fn new(points: Vec<DVec2>) -> Self {
        let min = points.iter().fold(DVec2::INFINITY, |m, p| m.min(*p));
        let max = points.iter().fold(DVec2::NEG_INFINITY, |m, p| m.max(*p));
        let area = (1..points.len().saturating_sub(1))
            .map(|i| (points[i] - points[0]).perp_dot(points[i + 1] - points[0]))
            .sum::<f64>()
            * 0.5;
        Self {
            points,
            min,
            max,
            area,
        }
    }

    fn touches(&self, other: &Self, slack: f64) -> bool {
        (self.min - slack).cmple(other.max).all() && other.min.cmple(self.max + slack).all()
    }

    /// Returns `true` if all of `other` is farther than `slack` outside of one of its edges.
    fn has_edge_apart(&self, other: &Self, slack: f64) -> bool {
        (0..self.points.len()).any(|i| {
            let (a, b) = (self.points[i], self.points[(i + 1) % self.points.len()]);
            let Some(outward) = (a - b).perp().try_normalize() else {
                return false;
            };
            other.points.iter().all(|&p| outward.dot(p - a) > slack)
        })
    }

    fn is_near(&self, other: &Self) -> bool {
        self.touches(other, TOGETHER)
            && !self.has_edge_apart(other, TOGETHER)
            && !other.has_edge_apart(self, TOGETHER)
    }

    /// Returns `true` if a point is inside, or at most `slack` outside of each edge.
    fn is_within(&self, p: DVec2, slack: f64) -> bool {
        self.depth(p) >= -slack
    }

    /// Returns the least distance of a point inside to the line of an edge; negative outside.
    fn depth(&self, p: DVec2) -> f64 {
        let n = self.points.len();
        (0..n)
            .filter_map(|i| {
                let (a, b) = (self.points[i], self.points[(i + 1) % n]);
                Some((b - a).perp().try_normalize()?.dot(p - a))
            })
            .fold(f64::INFINITY, f64::min)
    }

    fn width(&self) -> f64 {
        let n = self.points.len();
        (0..n)
            .filter_map(|i| {
                let (a, b) = (self.points[i], self.points[(i + 1) % n]);
                let inward = (b - a).perp().try_normalize()?;
                Some(
                    self.points
                        .iter()
                        .map(|&p| inward.dot(p - a))
                        .fold(0.0, f64::max),
                )
            })
            .fold(f64::INFINITY, f64::min)
            .min(1e9)
    }
}

/// Returns the convex hull, counter-clockwise, without vertices within [`STRAIGHT`] of a side.
fn hull(points: impl Iterator<Item = DVec2>) -> Flat {
    let mut at: Vec<DVec2> = points.collect();
    at.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    at.dedup();
    let mut ring: Vec<DVec2> = Vec::with_capacity(at.len() + 1);
    let mut half = |sequence: &mut dyn Iterator<Item = DVec2>| {
        let base = ring.len();
        for p in sequence {
            while ring.len() >= base + 2 {
                let (a, b) = (ring[ring.len() - 2], ring[ring.len() - 1]);
                if (b - a).perp_dot(p - b) > 0.0 {
                    break;
                }
                ring.pop();
            }
            ring.push(p);
        }
        ring.pop();
    };
    half(&mut at.iter().copied());
    half(&mut at.iter().rev().copied());
    // Drop nearly straight vertices only now, each tested against the neighbors that stay: dropping them while
    // building the ring could let many small turns add up.
    let mut i = 0;
    while ring.len() > 3 && i < ring.len() {
        let n = ring.len();
        let (a, b, c) = (ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]);
        let bulge = (b - a).perp_dot(c - b).abs();
        if bulge <= STRAIGHT * (c - a).length() {
            ring.remove(i);
        } else {
            i += 1;
        }
    }
    Flat::new(ring)
}

/// Returns the union of two disjoint convex polygons if it is convex.
fn convex_union(a: &Flat, b: &Flat) -> Option<Flat> {
    if !a.touches(b, STRAIGHT) {
        return None;
    }
    let union = hull(a.points.iter().chain(&b.points).copied());
    let size = (union.max - union.min).max_element();
    if union.area - a.area - b.area > STRAIGHT * size {
        return None;
    }
    // A notch of a fraction of a millimeter has next to no area, and may be part of another portal.
    let mut vertices = a.points.iter().chain(&b.points);
    vertices
        .all(|&p| union.depth(p) <= 2.0 * STRAIGHT)
        .then_some(union)
}

/// Merges until no two neighbors have a convex union. A sweep proposes pairs, each piece with only the next few, so
/// that a crack in a thousand pieces stays affordable.
fn merge_convex(mut flats: Vec<Flat>, purse: Purse<'_>) -> Vec<Flat> {
    const NEXT: usize = 48;
    loop {
        let before = flats.len();
        for axis in 0..2 {
            flats.sort_by(|a, b| {
                let (p, q) = (a.min, b.min);
                p[axis]
                    .total_cmp(&q[axis])
                    .then(p[1 - axis].total_cmp(&q[1 - axis]))
            });
            let mut gone = vec![false; flats.len()];
            for i in 0..flats.len() {
                if gone[i] || !purse.spend(10) {
                    continue;
                }
                let mut j = i + 1;
                while j < flats.len().min(i + NEXT) {
                    if !gone[j]
                        && let Some(union) = convex_union(&flats[i], &flats[j])
                    {
                        flats[i] = union;
                        gone[j] = true;
                        j = i;
                    }
                    j += 1;
                }
            }
            let mut keep = gone.iter().map(|g| !g);
            flats.retain(|_| keep.next().unwrap_or(true));
        }
        if flats.len() == before {
            return flats;
        }
    }
}

/// Largest growth of an opening's outline by a part beside it, as a multiple of the part's own area.
const WIDENING: f64 = 2.0;

/// Pieces of one plane, one pair of cells and one direction, in the plane's own coordinates.
struct Sheet<'a> {
    rules: &'a Rules<'a>,
    pieces: &'a [Piece],
    flats: Vec<Flat>,
    plane: Plane,
    axes: (DVec3, DVec3),
    origin: DVec3,
}

impl<'a> Sheet<'a> {
    fn new(pieces: &'a [Piece], rules: &'a Rules<'a>) -> Self {
        let own = rules.planes[pieces[0].plane as usize];
        let plane = if pieces[0].is_flipped {
            own.flipped()
        } else {
            own
        };
        let (u, v) = plane.basis();
        let origin = plane.project(pieces[0].points[0]);
        let flat = |p: &DVec3| DVec2::new(u.dot(*p - origin), v.dot(*p - origin));
        Self {
            rules,
            pieces,
            flats: pieces
                .iter()
                .map(|piece| hull(piece.points.iter().map(flat)))
                .collect(),
            plane,
            axes: (u, v),
            origin,
        }
    }

    fn winding(&self, flat: &Flat) -> Winding {
        let (u, v) = self.axes;
        let solid = |p: &DVec2| self.origin + u * p.x + v * p.y;
        Winding::new(flat.points.iter().map(solid).collect())
    }

    fn hull_of(&self, members: &[usize]) -> Flat {
        let points = members.iter().flat_map(|&i| &self.flats[i].points);
        hull(points.copied())
    }

    /// Returns `true` if a piece lies where a triangle is missing.
    fn is_missing(&self, i: usize) -> bool {
        let is_beyond = |candidate| candidate >= self.rules.n_candidates;
        self.pieces[i].candidate.is_some_and(is_beyond)
    }

    /// Returns groups of pieces near each other; those on one candidate are together wherever they are. A hole in a
    /// wall does not join an opening beside it. Ordered by their least members.
    fn clusters(&self, among: &[usize]) -> Vec<Vec<usize>> {
        let mut sets = Sets::new(self.flats.len());
        let mut first_on_candidate = BTreeMap::new();
        for &i in among {
            if let Some(candidate) = self.pieces[i].candidate {
                let first = *first_on_candidate.entry(candidate).or_insert(i);
                sets.join(first as u32, i as u32);
            }
        }
        let mut order = among.to_vec();
        let left = |i: usize| self.flats[i].min.x;
        order.sort_by(|&a, &b| left(a).total_cmp(&left(b)).then(a.cmp(&b)));
        for (k, &i) in order.iter().enumerate() {
            for &j in &order[k + 1..] {
                if !self.rules.purse.spend(1) {
                    break;
                }
                if left(j) > self.flats[i].max.x + TOGETHER {
                    break;
                }
                let is_apart = sets.find(i as u32) != sets.find(j as u32);
                let may_join = is_apart && self.is_missing(i) == self.is_missing(j);
                if may_join && self.flats[i].is_near(&self.flats[j]) {
                    sets.join(i as u32, j as u32);
                }
            }
        }
        let mut members: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for &i in among {
            members.entry(sets.find(i as u32)).or_default().push(i);
        }
        members.into_values().collect()
    }

    /// Adds each part to the opening beside it whose outline it widens least, if by at most `widening` times its own
    /// area or by less than the hole. Returns the parts left.
    fn adopt(
        &self,
        openings: &mut [Vec<usize>],
        mut parts: Vec<Vec<usize>>,
        widening: f64,
    ) -> Vec<Vec<usize>> {
        let mut hulls: Vec<Flat> = openings.iter().map(|o| self.hull_of(o)).collect();
        let area = |part: &[usize]| part.iter().map(|&i| self.flats[i].area).sum::<f64>();
        parts.sort_by(|a, b| area(b).total_cmp(&area(a)).then(a.cmp(b)));
        parts.retain(|part| {
            let purse = self.rules.purse;
            if !purse.spend(10 + openings.len() as u64 / 8) {
                return true;
            }
            let own = self.hull_of(part);
            let is_beside = |o: usize| {
                let is_near =
                    |&i: &usize| part.iter().any(|&j| self.flats[i].is_near(&self.flats[j]));
                let n_pairs = openings[o].len() * part.len();
                hulls[o].touches(&own, TOGETHER)
                    && purse.spend(1 + n_pairs as u64 / 2)
                    && openings[o].iter().any(is_near)
            };
            let wider = (0..openings.len()).filter(|&o| is_beside(o)).map(|o| {
                let points = hulls[o].points.iter().chain(&own.points);
                (o, hull(points.copied()))
            });
            let least = wider.min_by(|a, b| {
                let growth = |(o, hull): &(usize, Flat)| hull.area - hulls[*o].area;
                growth(a).total_cmp(&growth(b)).then(a.0.cmp(&b.0))
            });
            let Some((o, wider)) = least else { return true };
            let is_rim = own
                .points
                .iter()
                .all(|&p| hulls[o].is_within(p, self.rules.hole));
            if is_rim || wider.area - hulls[o].area <= widening * area(part) {
                openings[o].extend(part);
                hulls[o] = wider;
                return false;
            }
            true
        });
        parts
    }

    fn opening(&self, members: &[usize], is_seal: bool) -> Opening {
        let mut on_candidate = BTreeMap::new();
        for &i in members {
            if let Some(candidate) = self.pieces[i].candidate.filter(|_| !self.is_missing(i)) {
                *on_candidate.entry(candidate).or_insert(0.0) += self.flats[i].area;
            }
        }
        let candidate = on_candidate
            .into_iter()
            .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))
            .map(|(candidate, _)| candidate);
        // Rim pieces stay apart, so that no seal is wider than a gap.
        let (apart, together): (Vec<usize>, Vec<usize>) = members
            .iter()
            .partition(|&&i| is_seal && self.pieces[i].is_rim);
        let flats = |of: Vec<usize>| of.into_iter().map(|i| self.flats[i].clone()).collect();
        let mut merged = merge_convex(flats(together), self.rules.purse);
        merged.extend::<Vec<Flat>>(flats(apart));
        merged.sort_by(|a, b| b.area.total_cmp(&a.area));
        Opening {
            cells: self.pieces[0].cells,
            plane: self.plane,
            outline: self.winding(&self.hull_of(members)),
            area: merged.iter().map(|f| f.area).sum(),
            width: merged.iter().map(Flat::width).fold(0.0, f64::max),
            pieces: merged.iter().map(|f| self.winding(f)).collect(),
            candidate,
            is_seal,
        }
    }
}

/// Returns the openings among pieces of one plane, one pair of cells and one direction.
fn openings_of(group: &[Piece], rules: &Rules<'_>) -> Vec<Opening> {
    let sheet = Sheet::new(group, rules);
    let all: Vec<usize> = (0..group.len()).collect();
    // Openings to solids are all to be closed.
    if group[0].cells[1] == SOLID {
        return vec![sheet.opening(&all, true)];
    }
    let (gaps, wide): (Vec<usize>, Vec<usize>) = all.into_iter().partition(|&i| group[i].is_gap);
    // Pieces on candidates or missing triangles make the openings; wide pieces beside them join them or stand alone.
    let (foreseen, beside): (Vec<usize>, Vec<usize>) = wide
        .into_iter()
        .partition(|&i| group[i].candidate.is_some());
    let mut openings = sheet.clusters(&foreseen);
    let beside = sheet.adopt(&mut openings, sheet.clusters(&beside), WIDENING);
    openings.extend(beside);
    let gaps = gaps.into_iter().map(|i| vec![i]).collect();
    // A gap beside a door can be as large as the wall: the sliver between two of its triangles.
    let gaps = sheet.adopt(&mut openings, gaps, 0.0);
    let mut gaps = gaps.concat();
    let (mut out, mut cracks): (Vec<Opening>, Vec<usize>) = Default::default();
    for members in openings {
        let opening = sheet.opening(&members, false);
        if opening.candidate.is_none() && opening.width < CRACK_WIDTH {
            cracks.extend(members);
        } else {
            out.push(opening);
        }
    }
    if !rules.has_seals {
        cracks.append(&mut gaps);
    }
    for (members, is_seal) in [(cracks, false), (gaps, true)] {
        if !members.is_empty() {
            // Slits beside a door, in its plane, stay cracks.
            let candidate = None;
            out.push(Opening {
                candidate,
                ..sheet.opening(&members, is_seal)
            });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rectangle in the plane `z = 0`, given by its minimum and maximum.
    fn piece(candidate: u32, [x0, y0, x1, y1]: [f64; 4]) -> Piece {
        let corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
        Piece {
            cells: [0, 1],
            plane: 0,
            is_flipped: false,
            candidate: Some(candidate),
            is_gap: false,
            is_rim: false,
            points: corners
                .map(|[x, y]| DVec3::new(x, y, 0.0))
                .into_iter()
                .collect(),
        }
    }

    #[test]
    fn what_is_missing_in_a_wall_is_no_part_of_the_window_beside_it() {
        let rules = Rules {
            planes: &[Plane {
                normal: DVec3::Z,
                d: 0.0,
            }],
            hole: 0.01,
            has_seals: true,
            n_candidates: 2,
            purse: Purse::endless(),
        };
        // A window on two candidates, and missing triangles below it.
        let pieces = vec![
            piece(0, [0.0, 0.0, 0.9, 2.0]),
            piece(1, [0.9, 0.0, 1.8, 2.0]),
            piece(2, [1.8, -1.0, 4.8, 0.5]),
            piece(3, [4.8, -1.0, 5.8, 0.5]),
        ];
        let found: Vec<_> = group(pieces, &rules)
            .iter()
            .map(|o| ((o.area * 1e3).round() / 1e3, o.candidate))
            .collect();
        assert_eq!(found, [(3.6, Some(0)), (6.0, None)]);
    }

    /// A door and slits at its jamb in the same plane, on its candidate.
    #[test]
    fn slits_left_open_beside_a_door_are_one_crack() {
        let rules = Rules {
            planes: &[Plane {
                normal: DVec3::Z,
                d: 0.0,
            }],
            hole: 0.01,
            has_seals: false,
            n_candidates: 1,
            purse: Purse::endless(),
        };
        let slit = |[x0, y0, x1, y1]: [f64; 4]| Piece {
            is_gap: true,
            ..piece(0, [x0, y0, x1, y1])
        };
        let pieces = vec![
            piece(0, [0.0, 0.0, 0.9, 2.0]),
            slit([1.2, 0.0, 1.201, 2.0]),
            slit([1.5, 0.0, 1.501, 1.0]),
        ];
        let found: Vec<_> = group(pieces, &rules)
            .iter()
            .map(|o| (o.pieces.len(), o.candidate, o.is_seal))
            .collect();
        assert_eq!(found, [(1, Some(0), false), (2, None, false)]);
    }

    #[test]
    fn a_union_with_a_shallow_notch_is_not_convex() {
        let rectangle = |[x, y, to_x, to_y]: [f64; 4]| {
            hull(
                [[x, y], [to_x, y], [to_x, to_y], [x, to_y]]
                    .map(DVec2::from)
                    .into_iter(),
            )
        };
        let above = rectangle([0.0, 0.0, 2.4, 1.0]);
        assert!(convex_union(&above, &rectangle([0.0, -0.002, 2.4, 0.0])).is_some());
        assert!(convex_union(&above, &rectangle([0.0, -0.002, 2.3998, 0.0])).is_none());
    }
}

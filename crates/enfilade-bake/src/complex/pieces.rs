//! Open pieces to portals: grouped by plane and cells, merged where their union is convex.
//!
//! The tree cuts an opening wherever its planes happen to run; those cuts mean nothing and are
//! taken back here.

use enfilade_geom::{DVec2, DVec3, Plane, Winding};
use rayon::prelude::*;

use super::poly::Poly;

/// Pieces of one plane this near to each other are one portal. [Units: wu]
const TOGETHER: f64 = 0.01;

/// Corners this near to a line lie on it; the tree's own cuts are good to 1e-9. [Units: wu]
const STRAIGHT: f64 = 1e-7;

/// A convex opening between two leaves of different cells.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    /// Ascending.
    pub(super) cells: [u32; 2],
    /// Index of its plane.
    pub(super) plane: u32,
    /// The plane's normal points to the first cell, not to the second.
    pub(super) is_flipped: bool,
    /// The screen that it lies on.
    pub(super) screen: Option<u32>,
    /// Counter-clockwise about the plane's normal.
    pub(super) points: Poly,
}

/// The pieces of one portal.
pub(super) struct Opening {
    pub(super) cells: [u32; 2],
    pub(super) plane: Plane,
    pub(super) outline: Winding,
    pub(super) pieces: Vec<Winding>,
    pub(super) screen: Option<u32>,
    pub(super) area: f64,
    pub(super) width: f64,
}

/// Groups pieces into openings, ordered by cells, then plane, then the order of the tree.
pub(super) fn group(mut pieces: Vec<Piece>, planes: &[Plane]) -> Vec<Opening> {
    // Stable: within a key, the order of the tree stays.
    pieces.sort_by_key(|p| (p.cells, p.plane, p.is_flipped));
    let groups: Vec<&[Piece]> = pieces
        .chunk_by(|a, b| (a.cells, a.plane, a.is_flipped) == (b.cells, b.plane, b.is_flipped))
        .collect();
    groups
        .into_par_iter()
        .flat_map_iter(|g| openings_of(g, planes))
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

    /// Whether an edge of it has all of `other` farther than `slack` outside.
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

/// Convex hull, counter-clockwise; corners within [`STRAIGHT`] of a side are left out.
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
    // Only now the nearly straight corners, each against its neighbors that stay: dropping while
    // the ring is wound could let many small turns add up.
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

/// The union of two disjoint convex polygons where it is convex too.
fn convex_union(a: &Flat, b: &Flat) -> Option<Flat> {
    if !a.touches(b, STRAIGHT) {
        return None;
    }
    let union = hull(a.points.iter().chain(&b.points).copied());
    let size = (union.max - union.min).max_element();
    (union.area - a.area - b.area <= STRAIGHT * size).then_some(union)
}

/// Merges until no two neighbors have a convex union. Candidates come from a sweep, each piece
/// tried with the next few only, so that a crack in a thousand pieces stays affordable.
fn merge_convex(mut flats: Vec<Flat>) -> Vec<Flat> {
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
                if gone[i] {
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

/// The openings among pieces of one plane, one pair of cells and one direction.
fn openings_of(group: &[Piece], planes: &[Plane]) -> Vec<Opening> {
    let own = planes[group[0].plane as usize];
    let plane = if group[0].is_flipped {
        own.flipped()
    } else {
        own
    };
    let (u, v) = plane.basis();
    let origin = plane.project(group[0].points[0]);
    let flat = |p: DVec3| DVec2::new(u.dot(p - origin), v.dot(p - origin));
    let solid = |p: DVec2| origin + u * p.x + v * p.y;
    let flats: Vec<Flat> = group
        .iter()
        .map(|piece| hull(piece.points.iter().map(|&p| flat(p))))
        .collect();

    let mut set: Vec<usize> = (0..flats.len()).collect();
    fn find(set: &mut [usize], mut x: usize) -> usize {
        while set[x] != x {
            set[x] = set[set[x]];
            x = set[x];
        }
        x
    }
    let mut first_on_screen = std::collections::BTreeMap::new();
    for (i, piece) in group.iter().enumerate() {
        if let Some(screen) = piece.screen {
            let first = *first_on_screen.entry(screen).or_insert(i);
            let (a, b) = (find(&mut set, first), find(&mut set, i));
            set[a.max(b)] = a.min(b);
        }
    }
    let mut order: Vec<usize> = (0..flats.len()).collect();
    order.sort_by(|&a, &b| flats[a].min.x.total_cmp(&flats[b].min.x).then(a.cmp(&b)));
    for (k, &i) in order.iter().enumerate() {
        for &j in &order[k + 1..] {
            if flats[j].min.x > flats[i].max.x + TOGETHER {
                break;
            }
            let (a, b) = (find(&mut set, i), find(&mut set, j));
            if a != b && flats[i].is_near(&flats[j]) {
                set[a.max(b)] = a.min(b);
            }
        }
    }
    let mut members: std::collections::BTreeMap<usize, Vec<usize>> = Default::default();
    for i in 0..flats.len() {
        members.entry(find(&mut set, i)).or_default().push(i);
    }
    members
        .into_values()
        .map(|members| {
            let mut on_screen = std::collections::BTreeMap::new();
            for &i in &members {
                if let Some(screen) = group[i].screen {
                    *on_screen.entry(screen).or_insert(0.0) += flats[i].area;
                }
            }
            let screen = on_screen
                .into_iter()
                .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))
                .map(|(screen, _)| screen);
            let outline = hull(
                members
                    .iter()
                    .flat_map(|&i| flats[i].points.iter().copied()),
            );
            let mut merged = merge_convex(members.iter().map(|&i| flats[i].clone()).collect());
            merged.sort_by(|a, b| b.area.total_cmp(&a.area));
            let winding = |f: &Flat| Winding::new(f.points.iter().map(|&p| solid(p)).collect());
            Opening {
                cells: group[0].cells,
                plane,
                outline: winding(&outline),
                area: merged.iter().map(|f| f.area).sum(),
                width: merged.iter().map(Flat::width).fold(0.0, f64::max),
                pieces: merged.iter().map(winding).collect(),
                screen,
            }
        })
        .collect()
}

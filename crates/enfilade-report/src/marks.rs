//! Marks of a plan beside the cells: walls, doorways, and objects.

use std::collections::BTreeSet;

use enfilade_cpg::{CellId, DetailObject, Motion, MotionKind, Portal, PortalId, PortalKind, World};
use enfilade_geom::{Aabb, DMat4, DVec2, DVec3, Plane, Winding};

use crate::clip::clipped;
use crate::drawing::{Class, Item, Path};
use crate::label::shortened;
use crate::relief::{Owned, Relief};
use crate::section::{Section, cell_of};
use crate::storeys::Page;

/// A hole in a floor belongs to the storeys on both sides if it is at most this far from them. [Units: wu]
const FLOOR: f64 = 0.5;

/// A page with its section.
pub(crate) struct View<'a> {
    pub(crate) world: &'a World,
    pub(crate) page: &'a Page,
    pub(crate) section: &'a Section,
    /// Height of each cut. [Units: wu]
    pub(crate) heights: &'a [f64],
}

fn path(class: Class, lines: Vec<Vec<DVec2>>, is_closed: bool, hint: Option<String>) -> Item {
    Item::Path(Path {
        class,
        fill: None,
        lines,
        is_closed,
        cell: None,
        hint,
    })
}

fn point(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// Distance of the lines that hatch voids. [Units: wu]
const HATCHING: f64 = 0.3;

impl View<'_> {
    /// Slanting lines across the voids of the page; `None` without any.
    pub(crate) fn hatching(&self) -> Option<Item> {
        let lines = self.section.hatching(HATCHING);
        (!lines.is_empty()).then(|| path(Class::Void, lines, false, None))
    }

    /// Structural triangles cut at the heights of the page, as one path.
    pub(crate) fn walls(&self) -> Item {
        // In tenths of millimeters, so that the two sides of a thin sheet become one line.
        let mut lines: Vec<[[i64; 2]; 2]> = Vec::new();
        let rounded = |p: DVec2| [p.x, p.y].map(|x| (x * 1e3).round() as i64);
        for batch in &self.world.batches {
            for corners in batch.primitive.triangles() {
                for (k, &y) in self.heights.iter().enumerate() {
                    let Some((a, b)) = cut(&corners, y) else {
                        continue;
                    };
                    for (a, b) in self.shown_parts(k, a, b) {
                        let (a, b) = (rounded(a), rounded(b));
                        if a != b {
                            lines.push([a.min(b), a.max(b)]);
                        }
                    }
                }
            }
        }
        lines.sort_unstable();
        lines.dedup();
        let back = |[x, z]: [i64; 2]| DVec2::new(x as f64, z as f64) / 1e3;
        let lines = lines.into_iter().map(|l| l.map(back).to_vec()).collect();
        path(Class::Wall, lines, false, None)
    }

    /// The parts of a line of cut `k` that lie where the page shows that cut.
    fn shown_parts(&self, k: usize, a: DVec2, b: DVec2) -> Vec<(DVec2, DVec2)> {
        // The part far beyond the page would only cost steps.
        let Some((a, b)) = clipped(a, b, self.section.surroundings()) else {
            return Vec::new();
        };
        let n = (a.distance(b) / self.section.step()).ceil().max(1.0) as usize;
        let at = |i: usize| a + (b - a) * (i as f64 / n as f64);
        let mut out = Vec::new();
        let mut start = None;
        for i in 0..n {
            let is_shown = self.section.is_cut_by(k, (at(i) + at(i + 1)) * 0.5);
            match (start, is_shown) {
                (None, true) => start = Some(i),
                (Some(s), false) => {
                    out.push((at(s), at(i)));
                    start = None;
                }
                _ => {}
            }
        }
        if let Some(s) = start {
            out.push((at(s), b));
        }
        out
    }

    /// A line of true width for an upright portal; an outline for a level one; nothing for one of another storey.
    pub(crate) fn portal(&self, id: PortalId) -> Option<Item> {
        let portal = &self.world.graph[id];
        let outline: Vec<DVec3> = portal.outline.iter().map(|&p| point(p)).collect();
        let low = outline.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
        let high = outline
            .iter()
            .map(|p| p.y)
            .fold(f64::NEG_INFINITY, f64::max);
        let class = match portal.kind {
            PortalKind::Open => Class::Open,
            PortalKind::Door => Class::Door,
            PortalKind::Window => Class::Window,
            PortalKind::Crack => Class::Crack,
        };
        let [one, other] = portal.cells.map(|c| shortened(&self.world.graph[c].name));
        let hint = Some(format!("{id}, {one} and {other}"));
        let flat: Vec<DVec2> = outline.iter().map(|p| DVec2::new(p.x, p.z)).collect();
        if portal.is_level() {
            let is_near = |(floor, top): (f64, f64)| high > floor - FLOOR && low < top + FLOOR;
            // The outline of a level crack would cross the plan without telling where one passes.
            let is_drawn = class != Class::Crack && self.spans(portal).any(is_near);
            return is_drawn.then(|| path(Class::Stair, vec![flat], true, hint));
        }
        let mut segments = self.segments(portal, &flat);
        let mut class = class;
        if segments.is_empty() {
            // Not cut: a portal that is in the storey by at least half of its height (a lintel may hang through a
            // ceiling, a sill stand in the floor) is still drawn at its true width.
            let is_inside =
                |(floor, top): (f64, f64)| high.min(top) - low.max(floor) > 0.5 * (high - low);
            if !self.spans(portal).any(is_inside) {
                return None;
            }
            if matches!(portal.kind, PortalKind::Open | PortalKind::Door) {
                class = Class::Low;
            }
            let across = DVec2::new(-f64::from(portal.normal[2]), f64::from(portal.normal[0]));
            let by = |a: &&DVec2, b: &&DVec2| across.dot(**a).total_cmp(&across.dot(**b));
            let ends = (flat.iter().min_by(by), flat.iter().max_by(by));
            segments.extend(ends.0.copied().zip(ends.1.copied()));
        }
        let lines = joined(&segments).iter().map(|s| vec![s.0, s.1]).collect();
        Some(path(class, lines, false, hint))
    }

    /// Lowest and highest height of the portal's cells on this page, for each cut. [Units: wu]
    fn spans(&self, portal: &Portal) -> impl Iterator<Item = (f64, f64)> {
        let cuts = self.page.cuts.iter();
        let cells = portal.cells;
        cuts.flat_map(move |cut| {
            let top = move |c: CellId| Some((cut.floor, *cut.tops.get(&c)?));
            cells.into_iter().filter_map(top)
        })
    }

    /// Segments where the cuts that show one of its cells cross the portal; those of the main cut if the page shows a
    /// cell of another storey beside it.
    fn segments(&self, portal: &Portal, flat: &[DVec2]) -> Vec<(DVec2, DVec2)> {
        let pieces = |y: f64| -> Vec<(DVec2, DVec2)> {
            let cut = |piece: &Vec<[f32; 3]>| {
                let corners: Vec<DVec3> = piece.iter().map(|&p| point(p)).collect();
                cut(&corners, y)
            };
            portal.pieces.iter().filter_map(cut).collect()
        };
        for (cut, &y) in self.page.cuts.iter().zip(self.heights) {
            if portal.cells.iter().any(|c| cut.tops.contains_key(c)) {
                let found = pieces(y);
                if !found.is_empty() {
                    return found;
                }
            }
        }
        // A cell of another storey is visible beside the portal.
        let middle = flat.iter().sum::<DVec2>() / flat.len().max(1) as f64;
        let normal = DVec2::new(portal.normal[0].into(), portal.normal[2].into());
        let is_seen = [-2.0, 2.0].into_iter().any(|side| {
            let beside = middle + normal.normalize_or_zero() * side * self.section.step();
            let seen = cell_of(self.section.label_at(beside));
            seen.is_some_and(|(cell, is_own)| !is_own && portal.cells.contains(&cell))
        });
        match self.heights.first() {
            Some(&y) if is_seen => pieces(y),
            _ => Vec::new(),
        }
    }

    /// Footprints of the objects that stand in the storey, except door leaves.
    pub(crate) fn details(&self) -> Vec<Item> {
        self.standing().filter_map(|k| self.footprint(k)).collect()
    }

    /// Edges of the surfaces below the cut, and where the floor is free.
    pub(crate) fn relief(&self) -> Relief {
        let structure = self.world.batches.iter().map(|batch| Owned {
            owner: 0,
            triangles: Box::new(batch.primitive.triangles()),
        });
        let objects = self.standing().map(|k| {
            let detail = &self.world.details[k];
            let place = detail.placement();
            let mesh = &self.world.detail_meshes[detail.mesh as usize];
            let parts = mesh.primitives.iter();
            Owned {
                owner: k as u32 + 1,
                triangles: Box::new(parts.flat_map(move |p| p.placed_triangles(place))),
            }
        });
        Relief::new(self.section, self.heights, structure.chain(objects))
    }

    /// The objects inside that stand in the storey, as indices; door leaves are drawn by [`Self::swings`].
    fn standing(&self) -> impl Iterator<Item = usize> {
        let fittings = self.world.graph.portals.iter().flat_map(|p| &p.fittings);
        let leaves: BTreeSet<u32> = fittings
            .filter(|f| f.motion.is_some_and(|m| turns_upright(&m)))
            .map(|f| f.detail)
            .collect();
        (0..self.world.details.len())
            .filter(move |&k| !leaves.contains(&(k as u32)) && self.stands(&self.world.details[k]))
    }

    /// Returns `true` if an object is in a room of the storey, not above the cut and not under the floor.
    fn stands(&self, detail: &DetailObject) -> bool {
        let corners = self.corners(detail, &DMat4::IDENTITY);
        let low = corners.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
        let high = corners
            .iter()
            .map(|p| p.y)
            .fold(f64::NEG_INFINITY, f64::max);
        let cuts = self.page.cuts.iter().zip(self.heights);
        cuts.into_iter().any(|(cut, &y)| {
            let is_shown = |c: &CellId| cut.tops.contains_key(c);
            low < y && high > cut.floor && detail.cells.iter().any(is_shown)
        })
    }

    /// The vertices of the box around an object, moved; none if it is empty.
    fn corners(&self, detail: &DetailObject, motion: &DMat4) -> Vec<DVec3> {
        let place = *motion * detail.placement();
        let mesh = &self.world.detail_meshes[detail.mesh as usize];
        let mut bounds = Aabb::EMPTY;
        for p in mesh.primitives.iter().flat_map(|p| &p.positions) {
            bounds = bounds.including(point(*p));
        }
        if bounds.is_empty() {
            return Vec::new();
        }
        let corner = |k: usize| {
            let pick = |axis: usize| [bounds.min, bounds.max][k >> axis & 1][axis];
            place.transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
        };
        (0..8).map(corner).collect()
    }

    fn footprint(&self, index: usize) -> Option<Item> {
        let detail = &self.world.details[index];
        let flat = hull(&self.corners(detail, &DMat4::IDENTITY));
        if flat.len() < 3 || area(&flat) > self.room_of(&detail.cells) {
            return None;
        }
        let name = shortened(&detail.name).into_owned();
        Some(path(Class::Detail, vec![flat], true, Some(name)))
    }

    /// The leaves of a door, open, and the arcs along which they shut; `None` without any that turn.
    pub(crate) fn swings(&self, id: PortalId) -> Option<Item> {
        let mut lines = Vec::new();
        for fitting in &self.world.graph[id].fittings {
            let Some(motion) = fitting.motion.filter(turns_upright) else {
                continue;
            };
            let MotionKind::Turn { through, .. } = motion.kind else {
                continue;
            };
            let hinge = DVec2::new(through[0].into(), through[2].into());
            let detail = &self.world.details[fitting.detail as usize];
            let far = |p: &DVec3| DVec2::new(p.x, p.z).distance_squared(hinge);
            let corners = self.corners(detail, &DMat4::IDENTITY);
            let Some(&end) = (corners.iter()).max_by(|a, b| far(a).total_cmp(&far(b))) else {
                continue;
            };
            let mut open = hull(&self.corners(detail, &motion.at(1.0)));
            open.extend(open.first().copied());
            lines.push(open);
            let along = |k: u16| {
                let at = motion
                    .at(f32::from(k) / f32::from(ARC))
                    .transform_point3(end);
                DVec2::new(at.x, at.z)
            };
            lines.push((0..=ARC).map(along).collect());
        }
        (!lines.is_empty()).then(|| path(Class::Swing, lines, false, None))
    }

    /// Area of the boxes of some cells. [Units: wu²]
    ///
    /// An object cannot stand in a room smaller than itself, but the box around its scattered parts may be larger.
    fn room_of(&self, cells: &[CellId]) -> f64 {
        let side = |c: &CellId, axis: usize| {
            let [low, high] = self.world.graph[*c].aabb;
            f64::from(high[axis] - low[axis])
        };
        cells.iter().map(|c| side(c, 0) * side(c, 2)).sum()
    }
}

/// Segments of the arc of a door.
const ARC: u16 = 16;

/// Returns `true` for a leaf that turns around an upright hinge.
fn turns_upright(motion: &Motion) -> bool {
    matches!(motion.kind, MotionKind::Turn { axis, .. } if axis[1].abs() > 0.9)
}

/// The convex hull of points, seen from above.
fn hull(points: &[DVec3]) -> Vec<DVec2> {
    let plane = Plane {
        normal: DVec3::Y,
        d: 0.0,
    };
    let level: Vec<DVec3> = points.iter().map(|p| DVec3::new(p.x, 0.0, p.z)).collect();
    let hull = Winding::hull_in_plane(&plane, &level);
    hull.points.iter().map(|p| DVec2::new(p.x, p.z)).collect()
}

/// Area of a convex polygon.
fn area(corners: &[DVec2]) -> f64 {
    let n = corners.len();
    let twice = (0..n).map(|i| corners[i].perp_dot(corners[(i + 1) % n]));
    0.5 * twice.sum::<f64>().abs()
}

/// The segment where a convex polygon crosses the height `y`, seen from above.
fn cut(corners: &[DVec3], y: f64) -> Option<(DVec2, DVec2)> {
    let mut ends = [DVec2::ZERO; 2];
    let mut n = 0;
    for (i, &p) in corners.iter().enumerate() {
        let q = corners[(i + 1) % corners.len()];
        if (p.y < y) != (q.y < y) {
            let at = p + (q - p) * ((y - p.y) / (q.y - p.y));
            if let Some(end) = ends.get_mut(n) {
                *end = DVec2::new(at.x, at.z);
            }
            n += 1;
        }
    }
    (n == 2).then(|| (ends[0], ends[1]))
}

/// Joins touching segments of one line.
fn joined(segments: &[(DVec2, DVec2)]) -> Vec<(DVec2, DVec2)> {
    let Some(longest) = segments.iter().max_by(|a, b| {
        a.0.distance_squared(a.1)
            .total_cmp(&b.0.distance_squared(b.1))
    }) else {
        return Vec::new();
    };
    let along = (longest.1 - longest.0).normalize_or(DVec2::X);
    let mut sorted: Vec<(DVec2, DVec2)> = segments
        .iter()
        .map(|&(a, b)| {
            if along.dot(a) <= along.dot(b) {
                (a, b)
            } else {
                (b, a)
            }
        })
        .collect();
    sorted.sort_by(|a, b| along.dot(a.0).total_cmp(&along.dot(b.0)));
    let mut out: Vec<(DVec2, DVec2)> = Vec::new();
    for (a, b) in sorted {
        match out.last_mut() {
            // A millimeter: the precision of the drawing.
            Some(last) if along.dot(a) <= along.dot(last.1) + 1e-3 => {
                if along.dot(b) > along.dot(last.1) {
                    last.1 = b;
                }
            }
            _ => out.push((a, b)),
        }
    }
    out
}

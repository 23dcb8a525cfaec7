//! The portals left at a step as sheets: their openings in place, and the borders of these.

use std::collections::BTreeMap;

use enfilade::geom::{Aabb, DVec3};
use enfilade::internals::bake::delaunay::{RemainingPortal, Session};
use enfilade_render::{MarkShape, PictureMark};

use super::scale::{PortalClass, WeightScale};

/// The portal of the next step, and the one at the crosshair.
const NEXT: [f32; 4] = [1.0, 1.0, 1.0, 1.0];
const AIMED: [f32; 4] = [1.0, 0.75, 0.0, 1.0];
/// Half the size of the cross at the portal of the next step. [Units: wu]
const CROSS: f64 = 0.12;
/// Openings this close to the place of a portal tell its normal there. [Units: wu]
const AROUND: f64 = 1.5;

/// The openings of a portal.
struct PortalSheet {
    /// Indices of its links, by which it is known again.
    links: Vec<u32>,
    /// Convex polygons. [Units: wu]
    openings: Vec<Vec<DVec3>>,
    /// Edges of one opening only. [Units: wu]
    border: Vec<[DVec3; 2]>,
    bounds: Aabb,
    /// Middle of the largest opening: the middle of all may be in a wall, as between two windows. [Units: wu]
    place: Option<DVec3>,
}

impl PortalSheet {
    fn new(session: &Session, portal: &RemainingPortal) -> Self {
        let openings = session.openings(portal);
        let points = openings.iter().flatten();
        let area = |p: &&Vec<DVec3>| area_normal(p).length();
        let largest = openings.iter().max_by(|a, b| area(a).total_cmp(&area(b)));
        Self {
            place: largest.map(|p| middle(p)),
            links: portal.links.clone(),
            border: border(&openings),
            bounds: points.fold(Aabb::EMPTY, |b, p| b.including(*p)),
            openings,
        }
    }

    /// Returns the distance at which a ray passes an opening, at most `most`. `toward` has unit length.
    fn hit(&self, eye: DVec3, toward: DVec3, most: f64) -> Option<f64> {
        let reach = Aabb::EMPTY.including(eye).including(eye + toward * most);
        let is_near = (reach.min.cmple(self.bounds.max) & reach.max.cmpge(self.bounds.min)).all();
        let openings = is_near.then_some(&self.openings).into_iter().flatten();
        let hits = openings.filter_map(|polygon| passes(polygon, eye, toward));
        hits.filter(|t| *t <= most).min_by(f64::total_cmp)
    }
}

fn middle(polygon: &[DVec3]) -> DVec3 {
    polygon.iter().sum::<DVec3>() / polygon.len() as f64
}

/// Returns twice the area of a polygon, along its normal.
fn area_normal(polygon: &[DVec3]) -> DVec3 {
    let edges = polygon.iter().zip(polygon.iter().cycle().skip(1));
    edges
        .map(|(a, b)| (*a - polygon[0]).cross(*b - polygon[0]))
        .sum()
}

/// Returns the edges that only one of some polygons has.
fn border(openings: &[Vec<DVec3>]) -> Vec<[DVec3; 2]> {
    let key = |p: DVec3| p.to_array().map(f64::to_bits);
    let mut edges: BTreeMap<[[u64; 3]; 2], (usize, [DVec3; 2])> = BTreeMap::new();
    for polygon in openings {
        for (a, b) in polygon.iter().zip(polygon.iter().cycle().skip(1)) {
            let mut ends = [key(*a), key(*b)];
            ends.sort_unstable();
            edges.entry(ends).or_insert((0, [*a, *b])).0 += 1;
        }
    }
    let single = edges.into_values().filter(|(n, _)| *n == 1);
    single.map(|(_, ends)| ends).collect()
}

/// Returns the distance at which a ray passes a convex polygon.
fn passes(polygon: &[DVec3], eye: DVec3, toward: DVec3) -> Option<f64> {
    let edges = || polygon.iter().zip(polygon.iter().cycle().skip(1));
    let normal = area_normal(polygon);
    let t = normal.dot(polygon[0] - eye) / normal.dot(toward);
    if !(t > 0.0 && t.is_finite()) {
        return None;
    }
    let at = eye + toward * t;
    let is_inside = edges().all(|(a, b)| normal.dot((*b - *a).cross(at - *a)) >= 0.0);
    is_inside.then_some(t)
}

/// The portals left at a step, and their marks.
#[derive(Default)]
pub(super) struct Sheets {
    portals: Vec<RemainingPortal>,
    sheets: Vec<PortalSheet>,
    marks: Vec<PictureMark>,
    /// Number of the marks, which are lent at times.
    n_marks: usize,
}

impl Sheets {
    /// Shows the portals of another step, or after a decision. Sheets of portals that stay as they are are not made
    /// again. Returns the number of those that are.
    pub(super) fn show(
        &mut self,
        session: &Session,
        portals: Vec<RemainingPortal>,
        scale: WeightScale,
    ) -> usize {
        // No opening is part of two portals.
        let old = std::mem::take(&mut self.sheets).into_iter();
        let mut old: BTreeMap<Option<u32>, PortalSheet> = old
            .map(|sheet| (sheet.links.first().copied(), sheet))
            .collect();
        let mut n_made = 0;
        let sheets = portals.iter().map(|portal| {
            let known = old.remove(&portal.links.first().copied());
            known
                .filter(|sheet| sheet.links == portal.links)
                .unwrap_or_else(|| {
                    n_made += 1;
                    PortalSheet::new(session, portal)
                })
        });
        self.sheets = sheets.collect();
        self.portals = portals;
        self.marks.clear();
        for (portal, sheet) in self.portals.iter().zip(&self.sheets) {
            add_sheet(&mut self.marks, portal, sheet, scale.class(portal));
        }
        self.n_marks = self.marks.len();
        n_made
    }

    pub(super) fn portals(&self) -> &[RemainingPortal] {
        &self.portals
    }

    /// Returns the place of the portal of the next step, and its normal there.
    pub(super) fn next(&self) -> Option<[DVec3; 2]> {
        let k = self.portals.iter().position(|p| p.is_next)?;
        let at = self.sheets[k].place.unwrap_or(self.portals[k].position);
        let openings = self.sheets[k].openings.iter();
        let near = openings.filter(|polygon| middle(polygon).distance(at) < AROUND);
        // Openings face either way.
        let turned = |sum: DVec3, n: DVec3| if sum.dot(n) < 0.0 { sum - n } else { sum + n };
        let normal = near.map(|p| area_normal(p)).fold(DVec3::ZERO, turned);
        Some([at, normal.normalize_or(DVec3::X)])
    }

    /// Returns the first portal that a ray passes within a distance.
    pub(super) fn at(&self, eye: DVec3, toward: DVec3, most: f64) -> Option<usize> {
        let hits = self.sheets.iter().enumerate();
        let hits = hits.filter_map(|(k, sheet)| Some((sheet.hit(eye, toward, most)?, k)));
        hits.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, k)| k)
    }

    /// Lends the marks to a frame, with those of the portal at the crosshair; [`Sheets::give_back`] takes them.
    pub(super) fn lend(&mut self, aimed: Option<usize>) -> Vec<PictureMark> {
        let mut marks = std::mem::take(&mut self.marks);
        if let Some(k) = aimed {
            add_border(&mut marks, &self.sheets[k], AIMED, 3.0, true);
        }
        marks
    }

    /// Takes back the marks lent, whatever was added to them.
    pub(super) fn give_back(&mut self, mut marks: Vec<PictureMark>) {
        marks.truncate(self.n_marks);
        self.marks = marks;
    }
}

fn single(p: DVec3) -> [f32; 3] {
    p.as_vec3().to_array()
}

fn add_sheet(
    marks: &mut Vec<PictureMark>,
    portal: &RemainingPortal,
    sheet: &PortalSheet,
    class: PortalClass,
) {
    let [r, g, b] = class.linear();
    for polygon in &sheet.openings {
        marks.push(PictureMark {
            shape: MarkShape::Area(polygon.iter().map(|p| single(*p)).collect()),
            color: [r, g, b, 0.4],
            width: 0.0,
            on_top: false,
        });
    }
    add_border(marks, sheet, [r, g, b, 1.0], 2.0, false);
    if portal.is_next {
        add_border(marks, sheet, NEXT, 4.0, true);
        // A portal of cracks alone has no sheet.
        let at = sheet.place.unwrap_or(portal.position);
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let ends = [at - axis * CROSS, at + axis * CROSS];
            marks.push(line(ends, NEXT, 2.5, true));
        }
    }
}

fn line(ends: [DVec3; 2], color: [f32; 4], width: f32, on_top: bool) -> PictureMark {
    PictureMark {
        shape: MarkShape::Line(ends.map(single)),
        color,
        width,
        on_top,
    }
}

fn add_border(
    marks: &mut Vec<PictureMark>,
    sheet: &PortalSheet,
    color: [f32; 4],
    width: f32,
    on_top: bool,
) {
    let lines = sheet.border.iter();
    marks.extend(lines.map(|ends| line(*ends, color, width, on_top)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade::bake::{BakeConfig, BakeContext, Method, Silent};
    use enfilade::internals::bake::delaunay::Review;
    use enfilade_testkit::{Variant, gjorup_rooms};

    // Covers T5.
    #[test]
    fn portals_are_where_the_rooms_meet_and_a_step_makes_only_what_changes_again() {
        let g = gjorup_rooms(Variant::Optimised, [0.0; 3]);
        let config = BakeConfig::of(Method::Delaunay);
        let context = BakeContext::new(&Silent, None);
        let session = Session::begin(&g.scene, &config, &context).unwrap();
        let mut review = Review::new(session, config);
        let scale = WeightScale::of(review.config());
        let mut sheets = Sheets::default();
        let show = |sheets: &mut Sheets, review: &Review| {
            sheets.show(review.session(), review.portals(), scale)
        };
        let n = show(&mut sheets, &review);
        assert_eq!(n, sheets.portals().len());
        assert_eq!(show(&mut sheets, &review), 0, "nothing changed");
        // Each doorway of the plan has the sheet of one portal.
        assert!(!g.truth.openings.is_empty());
        for opening in &g.truth.openings {
            let k = sheets.sheets.iter().position(|sheet| {
                let near = |p: &Vec<DVec3>| middle(p).distance(opening.center) < 1.5;
                !sheet.openings.is_empty() && sheet.openings.iter().all(near)
            });
            let k = k.unwrap_or_else(|| panic!("no sheet in {}", opening.name));
            let sheet = &sheets.sheets[k];
            assert!(sheet.border.len() > 3);
            let middle = middle(&sheet.openings[0]);
            let normal = area_normal(&sheet.openings[0]).normalize();
            for side in [normal, -normal] {
                let eye = middle + side * 0.2;
                assert_eq!(sheets.at(eye, -side, 0.3), Some(k));
                assert_eq!(sheets.at(eye, -side, 0.1), None, "a wall is nearer");
                assert_eq!(sheets.at(eye, side, 0.3), None);
            }
        }
        // The next portal is white, and only as long as it is the next.
        let white = |sheets: &mut Sheets| {
            let marks = sheets.lend(Some(0));
            let n = marks.iter().filter(|m| m.color == NEXT).count();
            let aimed = marks.iter().filter(|m| m.color == AIMED).count();
            sheets.give_back(marks);
            (n, aimed)
        };
        let k = sheets.portals().iter().position(|p| p.is_next).unwrap();
        let n_border = sheets.sheets[k].border.len();
        let n_aimed = sheets.sheets[0].border.len();
        assert_eq!(white(&mut sheets), (n_border + 3, n_aimed));
        assert_eq!(
            white(&mut sheets),
            (n_border + 3, n_aimed),
            "marks that were lent come back"
        );
        let [at, normal] = sheets.next().unwrap();
        assert_eq!(sheets.at(at + normal * 0.2, -normal, 0.3), Some(k));

        let before = sheets.portals().len();
        review.go_by(1);
        let n_made = show(&mut sheets, &review);
        assert!(sheets.portals().len() < before);
        // The two rooms that are one now may have had two portals to a third.
        assert!(
            n_made < sheets.portals().len(),
            "{n_made} of {}",
            sheets.portals().len()
        );
        review.go_by(isize::MAX);
        show(&mut sheets, &review);
        assert_eq!(white_none(&mut sheets), 0);
    }

    fn white_none(sheets: &mut Sheets) -> usize {
        let marks = sheets.lend(None);
        let n = marks.iter().filter(|m| m.color == NEXT).count();
        sheets.give_back(marks);
        n
    }
}

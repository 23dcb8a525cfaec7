//! Checks that a portal is a flat, convex opening between two cells, and that its pieces fit.

use enfilade_geom::{DVec3, Plane, Winding};

use super::error::{Findings, GraphError};
use crate::Portal;

/// Returns the largest distance of a stored vertex from its computed position. [Units: wu]
///
/// Vertices and normal are computed in `f64` and rounded once to `f32`, which moves each coordinate by at most 2⁻²⁴
/// of its size: √3·2⁻²⁴·|vertex| for a vertex, and the normal's own rounding tilts the plane by as much across the
/// polygon. Rounding outlines *outwards* takes the neighboring `f32` instead of the nearest, twice as far. Four times
/// their sum allows for comparing rounded vertices with each other, and is still a tenth of a millimeter at 100 m.
pub(super) fn corner_slack<'a>(corners: impl IntoIterator<Item = &'a [f32; 3]>) -> f64 {
    let largest = corners
        .into_iter()
        .flatten()
        .fold(0.0_f32, |m, c| m.max(c.abs()));
    4.0 * 2.0 * (3.0_f64.sqrt() * 2.0_f64.powi(-24)) * 2.0 * f64::from(largest)
        // For coordinates near zero: a nanometer is negligible.
        + 1e-9
}

/// Twice the relative error of an area that is summed in `f64` and stored as `f32`.
const AREA_ROUNDING: f64 = 2.4e-7;

/// Largest difference from 1 of the length of a normal rounded to `f32`: √3 · 2⁻²⁴, times ten for normals that were
/// normalized in `f32` arithmetic.
pub(super) const UNIT_SLACK: f64 = 1e-6;

pub(super) fn check_portal(portal: u32, p: &Portal, n_cells: usize, found: &mut Findings) {
    let cells = p.cells.map(|c| c.0);
    if cells[0] == cells[1] || cells.iter().any(|&c| c as usize >= n_cells) {
        found.push(GraphError::PortalCells {
            portal,
            cells,
            n_cells,
        });
    }
    let normal = dvec(p.normal);
    if exceeds((normal.length() - 1.0).abs(), UNIT_SLACK) {
        return found.push(GraphError::PortalNormal {
            portal,
            normal: p.normal,
        });
    }
    let corners = || p.outline.iter().chain(p.pieces.iter().flatten());
    if let Some(&at) = corners().find(|c| !c.iter().all(|v| v.is_finite())) {
        return found.push(GraphError::PortalCorner { portal, at });
    }
    let slack = corner_slack(corners());
    if p.outline.len() < 3 {
        let n_corners = p.outline.len();
        return found.push(GraphError::TooFewCorners {
            portal,
            piece: None,
            n_corners,
        });
    }
    let outline: Vec<DVec3> = p.outline.iter().map(|&c| dvec(c)).collect();
    let plane = Plane::through(Winding::new(outline.clone()).mean(), normal.normalize());
    let check = PolygonCheck { plane, slack };
    if let Err(problem) = check.outline(&p.outline) {
        found.push(problem.of_portal(portal, None));
    }
    let mut measured = 0.0;
    for (i, piece) in p.pieces.iter().enumerate() {
        if found.is_full() {
            return;
        }
        match check.piece(piece) {
            Ok(area) => measured += area,
            Err(problem) => found.push(problem.of_portal(portal, Some(i as u32))),
        }
    }
    check.pieces_inside(portal, p, &outline, found);
    let reach: f64 = p.pieces.iter().map(|piece| perimeter(&dvecs(piece))).sum();
    let allowed = measured * AREA_ROUNDING + reach * slack;
    if p.pieces.is_empty() || exceeds((f64::from(p.area) - measured).abs(), allowed) {
        found.push(GraphError::PortalArea {
            portal,
            stored: p.area,
            measured,
        });
    }
}

/// The reason why vertices are not a convex polygon in their plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum PolygonProblem {
    TooFewCorners { n_corners: usize },
    NotPlanar { at: [f32; 3], distance: f64 },
    NotConvex { near: [f32; 3] },
    WrongWay { near: [f32; 3] },
}

impl PolygonProblem {
    fn of_portal(self, portal: u32, piece: Option<u32>) -> GraphError {
        match self {
            Self::TooFewCorners { n_corners } => GraphError::TooFewCorners {
                portal,
                piece,
                n_corners,
            },
            Self::NotPlanar { at, distance } => GraphError::NotPlanar {
                portal,
                piece,
                at,
                distance,
            },
            Self::NotConvex { near } => GraphError::NotConvex {
                portal,
                piece,
                near,
            },
            Self::WrongWay { near } => GraphError::WrongWay {
                portal,
                piece,
                near,
            },
        }
    }
}

/// Checks the polygons of one portal, or of one special portal.
///
/// Tests convexity, and containment of polygons, by convex hulls: a closed curve is convex if and only if it is as
/// long as its hull's and encloses as much, and a set lies in a convex polygon if and only if it adds nothing to its
/// hull. That takes O(n log n) for n vertices and does not depend on how short an edge is (a vertex test across a
/// hair-short edge amplifies rounding without bound). The allowance is exact: the hull of points moved by at most ε
/// has at most ε·perimeter + πε² more area and is at most 2πε longer (Steiner's formula).
pub(super) struct PolygonCheck {
    pub(super) plane: Plane,
    pub(super) slack: f64,
}

impl PolygonCheck {
    fn outline(&self, corners: &[[f32; 3]]) -> Result<f64, PolygonProblem> {
        self.polygon(corners, |_| f64::MIN_POSITIVE)
    }

    /// Checks a piece and returns its area. It may be a sliver that rounding has flattened or flipped; an outline may not.
    pub(super) fn piece(&self, corners: &[[f32; 3]]) -> Result<f64, PolygonProblem> {
        self.polygon(corners, |length| -self.slack * length)
    }

    /// Checks a polygon and returns its area, which is at least `least(perimeter)`, or 0.
    fn polygon(
        &self,
        corners: &[[f32; 3]],
        least: impl Fn(f64) -> f64,
    ) -> Result<f64, PolygonProblem> {
        let Self { plane, slack } = *self;
        let n_corners = corners.len();
        if n_corners < 3 {
            return Err(PolygonProblem::TooFewCorners { n_corners });
        }
        for &at in corners {
            let distance = plane.signed_distance(dvec(at));
            if distance.abs() > slack {
                return Err(PolygonProblem::NotPlanar { at, distance });
            }
        }
        let points = dvecs(corners);
        let length = perimeter(&points);
        let area = Winding::new(points.clone()).area_normal().dot(plane.normal) * 0.5;
        let near = corners[0];
        if area < least(length) {
            return Err(PolygonProblem::WrongWay { near });
        }
        let hull = Winding::hull_in_plane(&plane, &points);
        let hull_length = perimeter(&hull.points);
        let dent = hull.area() - area;
        // Each vertex moved by the slack lengthens two edges by it. A curve that runs around twice is twice as long,
        // regardless of its number of vertices.
        let longer = (4.0 * points.len() as f64 * slack).min(0.25 * hull_length.max(slack));
        if dent > slack * (length + 4.0 * slack) || length > hull_length + longer {
            return Err(PolygonProblem::NotConvex { near });
        }
        Ok(area.max(0.0))
    }

    fn pieces_inside(&self, portal: u32, p: &Portal, outline: &[DVec3], found: &mut Findings) {
        let Self { plane, slack } = *self;
        let own = Winding::hull_in_plane(&plane, outline);
        let mut all = outline.to_vec();
        all.extend(p.pieces.iter().flatten().map(|&c| dvec(c)));
        let both = Winding::hull_in_plane(&plane, &all);
        let length = perimeter(&own.points);
        let tau = std::f64::consts::TAU;
        if both.area() > own.area() + slack * (length + tau * slack)
            || perimeter(&both.points) > length + tau * slack
        {
            let middle = own.mean();
            let far = |c: &&[f32; 3]| dvec(**c).distance_squared(middle);
            let farthest = p
                .pieces
                .iter()
                .flatten()
                .max_by(|a, b| far(a).total_cmp(&far(b)))
                .copied();
            found.push(GraphError::PieceOutside {
                portal,
                at: farthest.unwrap_or_default(),
            });
        }
    }
}

/// Returns `true` if `value` is above `limit` or not a number.
pub(super) fn exceeds(value: f64, limit: f64) -> bool {
    value.is_nan() || value > limit
}

pub(super) fn dvec(p: [f32; 3]) -> DVec3 {
    DVec3::from(p.map(f64::from))
}

fn dvecs(points: &[[f32; 3]]) -> Vec<DVec3> {
    points.iter().map(|&p| dvec(p)).collect()
}

pub(super) fn perimeter(points: &[DVec3]) -> f64 {
    let Some(&last) = points.last() else {
        return 0.0;
    };
    let mut from = last;
    points
        .iter()
        .map(|&p| std::mem::replace(&mut from, p).distance(p))
        .sum()
}

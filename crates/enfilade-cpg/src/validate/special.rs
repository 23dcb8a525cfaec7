//! Checks special portals: that they are sides of doorways or parts of walls, and that what they show exists.
//!
//! Two mirrors back to back in one doorway pass: nobody sees or goes through, but nothing contradicts itself.

use std::collections::HashMap;

use enfilade_geom::{Aabb, DVec3, Plane, Similarity, Winding, world_tolerance};

use super::error::{Findings, GraphError};
use super::portal::{
    PolygonCheck, PolygonProblem, UNIT_SLACK, corner_slack, dvec, exceeds, perimeter,
};
use super::special_error::SpecialProblem;
use crate::holes::size_across;
use crate::{CellId, CellPortalGraph, MonitorCamera, Pass, SpecialId, SpecialPortal};
use crate::{SpecialShape, Way};

/// Farthest that a part of a wall may lie beyond its cell's box: panels may be let into walls. [Units: wu]
const BESIDE: f64 = 0.5;

/// Most by which the two ends of a link may differ in their plane, beyond rounding: doorways of one type are modeled to the
/// millimeter. [Units: wu]
const FIT: f64 = 0.005;

/// In this many directions the outlines of both ends of a link are compared. For a door of 2 m, what is missed between them is
/// below 3 mm.
const N_DIRECTIONS: usize = 64;

/// Least sine of the angle between a camera's directions. Below, upright is undefined within rounding to `f32`.
const LEAST_SINE: f64 = 1e-4;

pub(super) fn check_specials(graph: &CellPortalGraph, found: &mut Findings) {
    let mut check = Check {
        graph,
        first_of_side: HashMap::new(),
        is_shaped: vec![false; graph.specials.len()],
    };
    let each = || graph.special_ids().zip(&graph.specials);
    for (id, special) in each() {
        if found.is_full() {
            return;
        }
        match check.shape(id, special) {
            Ok(()) => check.is_shaped[id.idx()] = true,
            Err(problem) => found.push(check.report(id, problem)),
        }
    }
    for (id, special) in each() {
        if found.is_full() {
            return;
        }
        if let Err(problem) = check.passes(id, special) {
            found.push(check.report(id, problem));
        }
    }
}

struct Check<'a> {
    graph: &'a CellPortalGraph,
    /// The first special portal of each doorway and cell.
    first_of_side: HashMap<(u32, u32), SpecialId>,
    /// `true` for those whose polygon is one.
    is_shaped: Vec<bool>,
}

impl Check<'_> {
    fn report(&self, special: SpecialId, problem: SpecialProblem) -> GraphError {
        let side = &self.graph.specials[special.idx()];
        let mut parts = Vec::new();
        if !side.name.is_empty() {
            parts.push(format!("{:?}", side.name));
        }
        if let Some(cell) = self.graph.cells.get(side.cell.idx()) {
            parts.push(format!("in {}", cell.name));
        }
        if self.is_shaped[special.idx()] {
            let (_, pieces) = self.graph.special_opening(special);
            let at = bounds(&pieces).center();
            parts.push(format!("at {:.2},{:.2},{:.2}", at.x, at.y, at.z));
        }
        GraphError::Special {
            special,
            place: if parts.is_empty() {
                String::new()
            } else {
                format!(" ({})", parts.join(", "))
            },
            problem,
        }
    }

    fn shape(&mut self, id: SpecialId, special: &SpecialPortal) -> Result<(), SpecialProblem> {
        let cell = special.cell;
        let Some(of_cell) = self.graph.cells.get(cell.idx()) else {
            let n_cells = self.graph.cells.len();
            return Err(SpecialProblem::NoCell { cell, n_cells });
        };
        match &special.shape {
            SpecialShape::Portal(portal) => {
                let portal = *portal;
                let found = self.graph.portals.get(portal.idx());
                // A portal that is broken itself is reported as one.
                if found.is_none_or(|p| !p.cells.contains(&cell)) {
                    return Err(SpecialProblem::NotOfCell { portal });
                }
                let first = self.first_of_side.entry((portal.0, cell.0)).or_insert(id);
                if *first != id {
                    let other = *first;
                    return Err(SpecialProblem::SameSide { portal, other });
                }
                Ok(())
            }
            SpecialShape::Surface { normal, pieces } => {
                check_surface(*normal, pieces)?;
                let aabb = of_cell.aabb;
                let reach = Aabb::new(dvec(aabb[0]), dvec(aabb[1])).expanded(BESIDE);
                match pieces.iter().flatten().find(|c| !reach.contains(dvec(**c))) {
                    Some(&at) => Err(SpecialProblem::FarFromCell { at, aabb }),
                    None => Ok(()),
                }
            }
        }
    }

    fn passes(&self, id: SpecialId, special: &SpecialPortal) -> Result<(), SpecialProblem> {
        let share = special.passes.first().ok_or(SpecialProblem::NoPass)?.tint[3];
        let mut way_to_go = None;
        for (pass, Pass { way, tint }) in special.passes.iter().enumerate() {
            if !tint.iter().all(|v| (0.0..=1.0).contains(v)) {
                return Err(SpecialProblem::Tint { pass, tint: *tint });
            }
            if matches!(way, Way::Through | Way::Lead { .. })
                && let Some(first) = way_to_go.replace(pass)
            {
                let second = pass;
                return Err(SpecialProblem::TwoWays { first, second });
            }
            match way {
                Way::Through if special.portal().is_none() => {
                    return Err(SpecialProblem::ThroughWall { pass });
                }
                Way::Through | Way::Mirror => {}
                Way::Lead { to, map, back } => {
                    self.lead(pass, *to, map)?;
                    if let Some(back) = back {
                        self.way_back(id, pass, *to, map, *back)?;
                    }
                }
                Way::Monitor(camera) => {
                    if let Some(problem) = camera_problem(camera) {
                        return Err(SpecialProblem::Camera { pass, problem });
                    }
                }
            }
        }
        if share != 1.0 {
            return Err(SpecialProblem::FirstShare { share });
        }
        Ok(())
    }

    fn lead(&self, pass: usize, to: CellId, map: &Similarity) -> Result<(), SpecialProblem> {
        if !map.is_valid() {
            return Err(SpecialProblem::Map { pass });
        }
        let n_cells = self.graph.cells.len();
        if to.idx() >= n_cells {
            return Err(SpecialProblem::NoTarget { pass, to, n_cells });
        }
        Ok(())
    }

    /// Checks that one comes back where one left. As `back` names `id`, no other special portal can claim it, so that all polygons
    /// are looked at twice at most.
    fn way_back(
        &self,
        id: SpecialId,
        pass: usize,
        to: CellId,
        map: &Similarity,
        back: SpecialId,
    ) -> Result<(), SpecialProblem> {
        let cell = self.graph.specials[id.idx()].cell;
        let no_way = |is| SpecialProblem::NoWayBack {
            pass,
            back,
            to,
            cell,
            is,
        };
        let other = self.graph.specials.get(back.idx());
        let other = other.ok_or_else(|| no_way("does not exist"))?;
        if other.cell != to {
            return Err(no_way("is in another cell"));
        }
        let homeward = other.passes.iter().find_map(|pass| match &pass.way {
            Way::Lead { to, map, back } => Some((*to, map, *back)),
            _ => None,
        });
        let homeward = homeward.ok_or_else(|| no_way("leads nowhere"))?;
        if homeward.0 != cell {
            return Err(no_way("leads to another cell"));
        }
        if homeward.2 != Some(id) {
            return Err(no_way("names another way back"));
        }
        // Broken polygons and maps are reported as such.
        if !(self.is_shaped[id.idx()] && self.is_shaped[back.idx()] && homeward.1.is_valid()) {
            return Ok(());
        }
        let (normal, pieces) = self.graph.special_opening(id);
        let (normal_there, pieces_there) = self.graph.special_opening(back);
        if pieces.is_empty() || pieces_there.is_empty() {
            return Ok(());
        }
        let points = || pieces.iter().flat_map(|p| &p.points).copied();
        let points_there = || pieces_there.iter().flat_map(|p| &p.points).copied();
        let mapped: Vec<DVec3> = points().map(|p| map.point(p)).collect();
        let largest = |points: &mut dyn Iterator<Item = DVec3>| {
            points.fold(0.0_f64, |m, p| m.max(p.abs().max_element()))
        };
        let scale = map.scale.abs();
        let reach = largest(&mut points()) * scale;
        let reach = reach.max(largest(&mut points_there()));
        let slack = 4.0 * world_tolerance(reach.max(map.at.abs().max_element()));

        let round = map.after(homeward.1);
        if !round.is_near(&Similarity::IDENTITY, reach, slack) {
            let off = points_there().map(|p| p.distance(round.point(p)));
            let off = off.fold(0.0, f64::max);
            return Err(SpecialProblem::NotInverse { pass, back, off });
        }
        let inward = map.direction(normal);
        if inward.dot(normal_there) >= 0.0 {
            return Err(SpecialProblem::Facing { pass, back });
        }
        let plane = Plane::through(mean(points_there()), normal_there);
        let off = mapped.iter().map(|&p| plane.signed_distance(p).abs());
        let off = off.fold(0.0, f64::max);
        if exceeds(off, slack) {
            return Err(SpecialProblem::OffPlane { pass, back, off });
        }
        let off = outlines_differ(&plane, &mapped, &points_there().collect::<Vec<_>>());
        if exceeds(off, FIT + slack) {
            let sizes = [
                size_across(normal, &points()),
                size_across(inward, &mapped.iter().copied()),
                size_across(normal_there, &points_there()),
            ];
            return Err(SpecialProblem::Outline {
                pass,
                back,
                sizes,
                off,
            });
        }
        let area = |pieces: &[Winding]| pieces.iter().map(Winding::area).sum::<f64>();
        let around = |pieces: &[Winding]| pieces.iter().map(|p| perimeter(&p.points)).sum::<f64>();
        let areas = [
            area(&pieces),
            area(&pieces) * scale * scale,
            area(&pieces_there),
        ];
        let length = (around(&pieces) * scale).max(around(&pieces_there));
        if exceeds((areas[1] - areas[2]).abs(), (FIT + slack) * length) {
            return Err(SpecialProblem::Bars { pass, back, areas });
        }
        Ok(())
    }
}

fn check_surface(normal: [f32; 3], pieces: &[Vec<[f32; 3]>]) -> Result<(), SpecialProblem> {
    if exceeds((dvec(normal).length() - 1.0).abs(), UNIT_SLACK) {
        return Err(SpecialProblem::Normal { normal });
    }
    let corners = || pieces.iter().flatten();
    if let Some(&at) = corners().find(|c| !c.iter().all(|v| v.is_finite())) {
        return Err(SpecialProblem::Corner { at });
    }
    let slack = corner_slack(corners());
    let plane = Plane::through(mean(corners().map(|&c| dvec(c))), dvec(normal).normalize());
    let check = PolygonCheck { plane, slack };
    let mut area = 0.0;
    for (piece, corners) in (0..).zip(pieces) {
        area += check.piece(corners).map_err(|problem| {
            let problem = said(problem);
            SpecialProblem::Piece { piece, problem }
        })?;
    }
    if area > slack * slack {
        Ok(())
    } else {
        Err(SpecialProblem::NoArea)
    }
}

fn said(problem: PolygonProblem) -> String {
    match problem {
        PolygonProblem::TooFewCorners { n_corners } => {
            format!("it needs at least 3 vertices, not {n_corners}")
        }
        PolygonProblem::NotPlanar { at, distance } => {
            format!("vertex {at:?} is {distance} m off its plane")
        }
        PolygonProblem::NotConvex { near } => format!("it is not convex near {near:?}"),
        PolygonProblem::WrongWay { near } => {
            format!("near {near:?}, it must run counter-clockwise about the normal")
        }
    }
}

fn camera_problem(camera: &MonitorCamera) -> Option<&'static str> {
    let MonitorCamera {
        eye,
        toward,
        up,
        fov_y,
    } = camera;
    let numbers = eye.iter().chain(toward).chain(up).chain([fov_y]);
    if !numbers.clone().all(|v| v.is_finite()) {
        return Some("has a number that is not finite");
    }
    let (toward, up) = (dvec(*toward), dvec(*up));
    if toward == DVec3::ZERO {
        return Some("looks nowhere: its direction is 0");
    }
    if up == DVec3::ZERO {
        return Some("has an upward direction of 0");
    }
    if toward.normalize().cross(up.normalize()).length() < LEAST_SINE {
        return Some("looks along its own upward direction; turn one of the two");
    }
    let is_angle = *fov_y > 0.0 && f64::from(*fov_y) < std::f64::consts::PI;
    (!is_angle).then_some("needs a field of view between 0 and π (180°)")
}

fn mean(points: impl Iterator<Item = DVec3>) -> DVec3 {
    let (sum, n) = points.fold((DVec3::ZERO, 0.0), |(s, n), p| (s + p, n + 1.0));
    sum / f64::max(n, 1.0)
}

fn bounds(pieces: &[Winding]) -> Aabb {
    let points = pieces.iter().flat_map(|p| &p.points).copied();
    points.fold(Aabb::EMPTY, Aabb::including)
}

/// Returns the largest difference of how far two sets of points in a plane reach, over [`N_DIRECTIONS`]: for convex sets, their
/// distance. Linear in the points.
fn outlines_differ(plane: &Plane, one: &[DVec3], other: &[DVec3]) -> f64 {
    let (u, v) = plane.basis();
    let reach = |points: &[DVec3], along: DVec3| {
        points
            .iter()
            .map(|p| p.dot(along))
            .fold(f64::NEG_INFINITY, f64::max)
    };
    let directions = (0..N_DIRECTIONS).map(|k| {
        let angle = std::f64::consts::TAU * k as f64 / N_DIRECTIONS as f64;
        u * angle.cos() + v * angle.sin()
    });
    directions
        .map(|along| (reach(one, along) - reach(other, along)).abs())
        .fold(0.0, f64::max)
}

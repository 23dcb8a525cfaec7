//! Facts of spaces: floor, standing and backs, against those of cells.
//!
//! A fact is that of a space: of cells that open to each other. They have it in common, so one of a cell is compared with the bounds of all
//! cells with the same decision. Voids are joined later still, and so are cells for a bound of cost.

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, CellPortalGraph, Fact, Portal, PortalId, Reason, Why};
use enfilade_geom::{Aabb, Bvh, Triangle};
use rayon::prelude::*;

use super::measure::{Floor, backs_of, floor_of};
use crate::subject::{Subject, to_dvec};

/// Vertical rays that make a floor known.
const LEAST_COLUMNS: usize = 64;
/// Largest relative difference of a floor, besides a margin along its rim. Without that margin, it was 0.3 of 2 m², and 0.12 of others.
const FLOOR_SHARE: f64 = 0.3;
/// Largest difference of a share of a floor: 0.17 where beams hang at the height of a head.
const STANDING_OFF: f64 = 0.3;
/// Largest difference of a share of backs: a bake looks from 32 points, which gives a share to 0.09, in one of three. It was 0.21 at most.
const BACKS_OFF: f64 = 0.4;

/// Largest difference of a height of a doorway: outlines grow by a centimeter. [Units: wu]
const DOORWAY_OFF: f64 = 0.05;
/// An outline that fills less of its box is of several openings in one plane, of which the doorway may be one: 0.23 in models with missing
/// triangles, 0.79 for a round arch.
const FILLED: f64 = 0.7;

/// The measured cells of a decision.
struct Members<'a> {
    why: &'a Why,
    cells: Vec<CellId>,
}

/// Returns problems, a line each.
pub(super) fn check(subject: &Subject, own: &[Triangle], seed: u64) -> Vec<String> {
    let graph = &subject.world.graph;
    let mut same: BTreeMap<String, Members<'_>> = BTreeMap::new();
    for (id, cell) in graph.indoor_cells() {
        for why in &cell.why {
            let of = same.entry(why.to_string()).or_insert_with(|| Members {
                why,
                cells: Vec::new(),
            });
            of.cells.push(id);
        }
    }
    let is_joined = are_joined(graph);
    let bvh = Bvh::build(own);
    let all: Vec<Members<'_>> = same.into_values().collect();
    let problems = all.par_iter().flat_map_iter(|members| {
        let of_floor = floor_problems(subject, members, is_joined);
        let of_doorway = (!is_joined)
            .then(|| doorway_problem(subject, members))
            .flatten();
        of_floor
            .into_iter()
            .chain(of_doorway)
            .chain(backs_problems(subject, members, &bvh, seed))
    });
    problems.collect()
}

/// Returns `true` if cells may have been joined since their spaces were measured.
fn are_joined(graph: &CellPortalGraph) -> bool {
    let bounds = ["min_cost", "max_cost", "max_cells", "max_portals"];
    let is_bound = |name: &&str| {
        let given = graph.provenance.settings.get(&format!("simplify.{name}"));
        given.is_some_and(|v| v != "none" && v != "0")
    };
    let mut places = graph.places.iter();
    bounds.iter().any(is_bound) || places.any(|p| p.why.reason == Reason::Merged)
}

/// Compares floor and standing.
fn floor_problems(subject: &Subject, members: &Members<'_>, is_joined: bool) -> Vec<String> {
    let why = members.why;
    let fact = |fact| why.facts.get(&fact).copied().map(f64::from);
    let (Some(floor), Some(standing)) = (fact(Fact::Floor), fact(Fact::Standing)) else {
        return Vec::new();
    };
    let measured: Vec<(CellId, Floor)> = members
        .cells
        .iter()
        .map(|&c| (c, floor_of(subject, c)))
        .collect();
    let all = measured
        .iter()
        .fold(Floor::default(), |sum, m| sum.and(&m.1));
    if all.n_columns < LEAST_COLUMNS {
        return Vec::new();
    }
    let shares = measured.iter().map(|m| m.1).filter(|m| m.n_columns > 0);
    let least = shares.clone().map(|m| m.least / m.area).fold(1.0, f64::min);
    let most = shares.map(|m| m.most / m.area).fold(0.0, f64::max);
    let is_void = why.reason == Reason::Low;
    let mut out = Vec::new();
    for &(cell, own) in &measured {
        let name = subject.cell_name(cell);
        // Cells joined since have a part of it.
        let too_small = (1.0 - FLOOR_SHARE) * own.area - own.rim;
        if floor > (1.0 + FLOOR_SHARE) * all.area + all.rim
            || !is_void && !is_joined && floor < too_small
        {
            out.push(format!(
                "{name}: decided by a floor of {floor} m², but it has {:.2} m²",
                own.area
            ));
        } else if !is_joined && (standing < least - STANDING_OFF || standing > most + STANDING_OFF)
        {
            out.push(format!(
                "{name}: decided by {standing} of its floor to stand on, but it is {least:.2} to {most:.2}"
            ));
        }
    }
    out
}

/// Compares the share of backs of rooms. A void may be what is left of a space elsewhere.
fn backs_problems(subject: &Subject, members: &Members<'_>, own: &Bvh, seed: u64) -> Vec<String> {
    let graph = &subject.world.graph;
    let Some(&said) = members.why.facts.get(&Fact::Backs) else {
        return Vec::new();
    };
    let rooms = members.cells.iter().filter(|c| !graph[**c].is_void);
    let backs: Vec<f64> = rooms
        .clone()
        .filter_map(|&c| backs_of(subject, own, c, seed))
        .collect();
    if backs.is_empty() {
        return Vec::new();
    }
    let said = f64::from(said);
    let [least, most] = backs
        .iter()
        .fold([1.0_f64, 0.0_f64], |[lo, hi], &b| [lo.min(b), hi.max(b)]);
    if said >= least - BACKS_OFF && said <= most + BACKS_OFF {
        return Vec::new();
    }
    rooms.map(|&c| {
        let name = subject.cell_name(c);
        format!("{name}: decided by {said} of the rays that meet backs, but it is {least:.2} to {most:.2}")
    }).collect()
}

/// Compares the height of the highest doorway with those of the portals of all cells: it is one of them, or a door and the window above
/// it, which were one opening, or one of several openings that are one portal.
fn doorway_problem(subject: &Subject, members: &Members<'_>) -> Option<String> {
    let graph = &subject.world.graph;
    let said = f64::from(*members.why.facts.get(&Fact::Doorway)?);
    let heights = |&p: &PortalId| {
        let outline = graph[p].outline.iter().map(|v| f64::from(v[1]));
        let [low, high] = outline.fold([f64::MAX, f64::MIN], |[lo, hi], y| [lo.min(y), hi.max(y)]);
        (graph[p].cells, low, high)
    };
    let of_cells = members.cells.iter().flat_map(|&c| &graph[c].portals);
    let may_hold = |p: &Portal| {
        let size =
            Aabb::of_points(&p.outline.iter().map(|&v| to_dvec(v)).collect::<Vec<_>>()).size();
        let whole = size.x.hypot(size.z) * size.y;
        size.y >= said - DOORWAY_OFF && f64::from(p.area) < FILLED * whole
    };
    if of_cells.clone().any(|&p| may_hold(&graph[p])) {
        return None;
    }
    let all: Vec<([CellId; 2], f64, f64)> = of_cells.map(heights).collect();
    let is_it = |&(cells, low, _): &([CellId; 2], f64, f64)| {
        let above = all.iter().filter(|other| other.0 == cells);
        let mut heights = above.map(|other| other.2 - low);
        heights.any(|height| (height - said).abs() <= DOORWAY_OFF)
    };
    (said > 0.0 && !all.iter().any(is_it)).then(|| {
        let name = subject.cell_name(members.cells[0]);
        format!("{name}: decided by a doorway of {said} m, but no portal is as high")
    })
}

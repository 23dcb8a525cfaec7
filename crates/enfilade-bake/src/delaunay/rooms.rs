//! Converts cells of tetrahedra to the input of the cell complex: candidates and votes.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_cpg::{Fact, Reason, Why};
use enfilade_geom::{Allowance, Bvh, DVec3, Plane};
use rayon::prelude::*;

use super::cells::OUTDOOR_CELL;
use super::session::Session;
use super::space::Space;
use super::standing::Standing;
use crate::complex::{Label, Vote};
use crate::structure::{Candidate, OUTDOORS, Opening, fit_candidate, is_inside};

/// Tetrahedra this close to the border of two rooms do not vote: a candidate may lie on either side of them.
/// [Units: wu]
const UNSURE: f64 = 0.35;
/// Tetrahedra with their middle this close to a wall do not vote: they may fill the space between two polygons that
/// nearly touch. [Units: wu]
const AT_WALL: f64 = 0.01;
/// Distance between the points sampled on an opening. [Units: wu]
const STEP: f64 = 0.1;
/// Approximate limit of points sampled on an opening.
const MAX_CENTERS: f64 = 4000.0;
/// Distance from an opening's point within which a door leaf or pane closes it there. [Units: wu]
const CLOSE_BY: f64 = 0.15;
/// Costs of placing a point of an opening, and of deciding if a part votes, in units of [`Allowance`].
const WORK_A_CENTER: u64 = 5;
const WORK_A_PART: u64 = 20;
/// Openings smaller than this are left to the complex, which finds them as cracks. [Units: wu²]
const MIN_AREA: f64 = 0.04;
/// Input of the cell complex.
pub(super) struct FoundRooms {
    pub(super) candidates: Vec<Candidate>,
    pub(super) votes: Vec<Vote>,
    /// Label of each part; 0 for those that are not rooms.
    pub(super) label_of_part: Vec<u32>,
}

/// Returns the label of a cell: regions count from [`OUTDOORS`] on.
fn label(cell: u32) -> u32 {
    cell - OUTDOOR_CELL + OUTDOORS
}

/// Returns candidates where rooms meet, and votes within rooms. `room_of_cell` is the result of decimation; `stairs`
/// stand in rooms but are not part of them.
pub(super) fn find_rooms(
    session: &Session,
    room_of_cell: &[u32],
    min_radius: f64,
    allowance: &Allowance,
) -> FoundRooms {
    let Session {
        space,
        cells,
        walls,
        bvh,
        closures,
        stairs,
        hole,
        ..
    } = session;
    let Standing {
        room_of_cell,
        patches,
        hollow,
    } = Standing::of(&session.air(), room_of_cell, min_radius, allowance);
    let room_at = |t: u32| room_of_cell[cells.cell_of_part[t as usize] as usize];
    let leaves = Bvh::build(closures);
    let found: Vec<(Vec<DVec3>, Option<Candidate>)> = patches
        .par_iter()
        .map(|(pair, patch)| {
            let (centers, opening) = opening_of(space, *pair, patch, &room_at, &leaves);
            let work = patch.len() + centers.len();
            if !allowance.spend(WORK_A_CENTER * work as u64) || opening.area < MIN_AREA {
                return (centers, None);
            }
            let winding = fit_candidate(&centers, STEP, &opening, walls, bvh, *hole, allowance);
            let facts = [(Fact::Area, opening.area), (Fact::Closed, opening.closed)];
            let candidate = Candidate {
                winding,
                closed: opening.closed,
                why: Why::given(Reason::Kept).with(&facts),
            };
            (centers, Some(candidate))
        })
        .collect();

    let centers = found.iter().flat_map(|(centers, _)| centers);
    let is_unsure = near_any(&centers.copied().collect::<Vec<_>>());
    let n = space.middles.len();
    let sure: Vec<bool> = (0..n)
        .into_par_iter()
        .map(|t| {
            let p = space.middles[t];
            allowance.spend(WORK_A_PART)
                && !is_unsure(p)
                && bvh.nearest(p, AT_WALL).is_none()
                && !is_inside(stairs, p)
        })
        .collect();
    let vote = |t: u32| Vote {
        point: space.middles[t as usize],
        label: Label::Region(label(room_at(t))),
        weight: space.volumes[t as usize] as f32,
    };
    let mut votes: Vec<Vote> = Vec::new();
    let mut heard: BTreeSet<u32> = BTreeSet::new();
    let mut widest: BTreeMap<u32, u32> = BTreeMap::new();
    for t in 0..n as u32 {
        let room = room_at(t);
        if hollow.contains(&room) {
            continue;
        }
        let best = widest.entry(room).or_insert(t);
        if space.radii[t as usize] > space.radii[*best as usize] {
            *best = t;
        }
        if sure[t as usize] {
            heard.insert(room);
            votes.push(vote(t));
        }
    }
    // A room that is only a doorway votes at its widest place.
    votes.extend(
        widest
            .iter()
            .filter(|(room, _)| !heard.contains(room))
            .map(|(_, &t)| vote(t)),
    );
    let label_of = |t: u32| {
        Some(room_at(t))
            .filter(|r| !hollow.contains(r))
            .map_or(0, label)
    };
    FoundRooms {
        candidates: found.into_iter().filter_map(|f| f.1).collect(),
        votes,
        label_of_part: (0..n as u32).map(label_of).collect(),
    }
}

/// Returns a test if a point is nearer than [`UNSURE`] to any of `centers`.
fn near_any(centers: &[DVec3]) -> impl Fn(DVec3) -> bool + use<> {
    let key = |p: DVec3| (p / UNSURE).floor().to_array().map(|x| x as i64);
    let mut unsure: BTreeMap<[i64; 3], Vec<DVec3>> = BTreeMap::new();
    for &p in centers {
        unsure.entry(key(p)).or_default().push(p);
    }
    move |p: DVec3| {
        let [x, y, z] = key(p);
        (0..27).any(|i| {
            let cell = [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1];
            unsure
                .get(&cell)
                .is_some_and(|list| list.iter().any(|q| q.distance(p) < UNSURE))
        })
    }
}

/// Returns points all over the facets of an opening, and its measures.
fn opening_of(
    space: &Space,
    pair: (u32, u32),
    patch: &[u32],
    room_at: &impl Fn(u32) -> u32,
    leaves: &Bvh,
) -> (Vec<DVec3>, Opening) {
    let mut centers = Vec::new();
    let whole: f64 = patch
        .iter()
        .map(|&l| 2.0 * space.area_vector(&space.links[l as usize]).length())
        .sum();
    // A hillside's front needs no more points than a gate's.
    let step = STEP.max((whole / MAX_CENTERS).sqrt());
    let (mut vector, mut moment, mut total) = (DVec3::ZERO, DVec3::ZERO, 0.0);
    for &l in patch {
        let link = &space.links[l as usize];
        let outline = space.outline(link);
        let forward = room_at(link.parts[0]) == pair.0;
        for k in 2..outline.len() {
            let f = [outline[0], outline[k - 1], outline[k]];
            let normal = enfilade_geom::triangle_area_normal(&f) * 0.5;
            vector += if forward { normal } else { -normal };
            let area = normal.length();
            moment += (f[0] + f[1] + f[2]) / 3.0 * area;
            total += area;
            let longest = (0..3)
                .map(|i| f[i].distance(f[(i + 1) % 3]))
                .fold(0.0, f64::max);
            let n = (longest / step).ceil().clamp(1.0, 64.0) as usize;
            for i in 0..n {
                for j in 0..n - i {
                    let (u, v) = (
                        (i as f64 + 1.0 / 3.0) / n as f64,
                        (j as f64 + 1.0 / 3.0) / n as f64,
                    );
                    centers.push(f[0] + (f[1] - f[0]) * u + (f[2] - f[0]) * v);
                }
            }
        }
    }
    let center = moment / total.max(1e-300);
    let closed = centers
        .iter()
        .filter(|&&p| leaves.nearest(p, CLOSE_BY).is_some())
        .count();
    let opening = Opening {
        plane: Plane::through(center, vector.try_normalize().unwrap_or(DVec3::X)),
        center,
        area: vector.length(),
        closed: closed as f64 / centers.len().max(1) as f64,
    };
    (centers, opening)
}

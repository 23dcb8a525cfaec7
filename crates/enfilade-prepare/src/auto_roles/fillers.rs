//! Door leaves and panes among objects that no rule decides, or that are named as a wall and a door: things that fill a hole in
//! a wall.
//!
//! The test is about the wall, not the leaf: *does the wall continue, in the plane of the thing, on three of
//! its four sides, with air before and behind both?* A lintel has the wall on two sides, a wall between two
//! others and two slabs on none or on two. A leaf as high as the room has a jamb on either side and no lintel: it is told
//! from a piece of wall by its thickness alone. A thing in such a hole is a filler if it is much thinner than the
//! wall, or if a single connected surface surrounds it: walls are built beside each other, and only openings
//! are cut out of one.

use super::units::Unit;
use enfilade_geom::filler::{FillsHole, HELD, HoleFacts};
use enfilade_geom::{
    Bvh, DVec3, Ray, Sets, Triangle, is_rather_level, lies_along, triangle_area_normal,
};

/// Largest reach of a wall before and behind the thing: no wall with an opening is thicker. [Units: wu]
const WALL: f64 = 0.6;
/// Distances beyond the rim at which the wall is searched: as near as mullions are wide, and as far as joints
/// are. [Units: wu]
const STEPS: [f64; 2] = [0.015, 0.05];
/// Samples along each side.
const SAMPLES: usize = 8;
/// Rays along each edge of the thing's face.
const GRID: usize = 5;
/// Depth of the air before and behind it: a thing that hangs on a wall has none behind it. [Units: wu]
const AIR: f64 = 0.2;
/// … over this share of its face: furniture may stand before the rest.
const OPEN: f64 = 0.5;
/// The wall that holds it overlaps it in depth by this share of the thinner of the two: a picture frame lies
/// before its wall.
const OVERLAP: f64 = 0.25;
/// Hits nearer than this along a line are one hit, on an edge that two triangles share. [Units: wu]
const SAME: f64 = 1e-4;
/// Greatest distance of a sheet from the middle of what it holds: vertices are rounded, and moved by welding. A thing before
/// a wall, such as a board, has more. [Units: wu]
const SHEET: f64 = 2e-3;

/// The triangles of the scene, for ray queries.
pub(super) struct Surroundings<'a> {
    pub(super) bvh: &'a Bvh,
    pub(super) triangles: &'a [Triangle],
    /// The unit of each triangle.
    pub(super) unit_of: &'a [u32],
}

/// Matter of another unit in the plane of a thing, beyond its rim.
#[derive(Clone, Copy)]
struct Hold {
    unit: u32,
    /// Length along the thing's thin axis. [Units: wu]
    thickness: f64,
}

/// A thing that may fill an opening.
struct Candidate {
    unit: u32,
    /// Facts of it without its surroundings.
    own: HoleFacts,
    /// Matter that holds it at each sample of each side: left, right, below, above.
    sides: [Vec<Vec<Hold>>; 4],
}

/// Returns units that fill openings, each with the reason.
pub(super) fn fillers(
    units: &[Unit],
    may_fill: &dyn Fn(&Unit) -> bool,
    around: &Surroundings<'_>,
) -> Vec<(u32, String)> {
    let candidates: Vec<Candidate> = (0..units.len() as u32)
        .filter(|&i| may_fill(&units[i as usize]))
        .filter_map(|i| candidate(units, i, around))
        .collect();
    let mut candidate_of = vec![None; units.len()];
    for (i, c) in (0u32..).zip(&candidates) {
        candidate_of[c.unit as usize] = Some(i);
    }
    // Parts of one filler: a leaf and its frame, a door and the light above it.
    let mut sets = Sets::new(candidates.len());
    for (i, c) in (0..).zip(&candidates) {
        for hold in c.sides.iter().flatten().flatten() {
            if let Some(other) = candidate_of[hold.unit as usize] {
                sets.join(i, other);
            }
        }
    }
    let mut groups: Vec<Vec<u32>> = vec![Vec::new(); candidates.len()];
    for i in 0..candidates.len() as u32 {
        groups[sets.find(i) as usize].push(i);
    }
    let is_candidate = |unit: u32| candidate_of[unit as usize].is_some();
    let mut found = Vec::new();
    for group in groups {
        let members: Vec<&Candidate> = group.iter().map(|&i| &candidates[i as usize]).collect();
        let held = held(&members, &is_candidate);
        for c in members {
            let facts = c.own.held_as(&held);
            let why = match facts.kind() {
                Some(FillsHole::Thin) => format!(
                    "the wall around it {:.2} m on {} sides",
                    facts.wall,
                    facts.n_sides()
                ),
                Some(FillsHole::Surrounded) => {
                    format!("one wall goes round it on {} sides", facts.n_by_one)
                }
                None => continue,
            };
            let size = units[c.unit as usize].half * 2.0;
            let text = format!(
                "fills an opening: {:.2} x {:.2} m, {:.2} m thick, {why}",
                size.y, size.z, size.x
            );
            found.push((c.unit, text));
        }
    }
    found
}

/// Returns the sides on which walls hold a group. Samples on another candidate are inside the group.
fn held(members: &[&Candidate], is_candidate: &dyn Fn(u32) -> bool) -> HoleFacts {
    let mut held = HoleFacts {
        ends: [0, 1].map(|k| members.iter().any(|c| c.own.ends[k])),
        wall: f64::INFINITY,
        ..HoleFacts::default()
    };
    let mut n_by: Vec<(u32, usize)> = Vec::new();
    for side in 0..4 {
        let mut n_outer = 0;
        let mut walls = Vec::new();
        let mut holders: Vec<(u32, usize)> = Vec::new();
        for sample in members.iter().flat_map(|c| &c.sides[side]) {
            let walls_here = sample.iter().filter(|h| !is_candidate(h.unit));
            let thickest = walls_here.clone().map(|h| h.thickness).reduce(f64::max);
            if thickest.is_none() && !sample.is_empty() {
                continue;
            }
            n_outer += 1;
            walls.extend(thickest);
            for h in walls_here {
                add_one(&mut holders, h.unit);
            }
        }
        let enough = HELD * n_outer as f64;
        if walls.is_empty() || (walls.len() as f64) < enough {
            continue;
        }
        held.sides[side] = true;
        walls.sort_by(f64::total_cmp);
        held.wall = held.wall.min(walls[walls.len() / 2]);
        for (unit, n) in holders {
            if n as f64 >= enough {
                add_one(&mut n_by, unit);
            }
        }
    }
    held.n_by_one = n_by.iter().map(|h| h.1).max().unwrap_or(0);
    held
}

fn add_one(counts: &mut Vec<(u32, usize)>, key: u32) {
    match counts.iter_mut().find(|c| c.0 == key) {
        Some(c) => c.1 += 1,
        None => counts.push((key, 1)),
    }
}

/// Returns the measures of a unit that may be a filler; `None` if it cannot be one.
fn candidate(units: &[Unit], index: u32, around: &Surroundings<'_>) -> Option<Candidate> {
    let unit = &units[index as usize];
    let half = unit.half;
    if unit.is_small() || half.x >= half.y.min(half.z) {
        return None;
    }
    let sides = [0, 1, 2, 3].map(|side| holds(unit, index, side, around));
    let (thickness, leaf) = thickness_between_air(unit, index, around)?;
    let own = HoleFacts {
        is_upright: !is_rather_level(unit.axes[0]),
        thickness,
        leaf,
        ends: [-1.0, 1.0].map(|sign| is_at_end(unit, index, sign, around)),
        ..HoleFacts::default()
    };
    let unit = index;
    let candidate = Candidate { unit, own, sides };
    // Anything may hold it here; holders that are candidates themselves are left out once all are known, and one wall may
    // then hold one side more.
    let mut facts = own.held_as(&held(&[&candidate], &|_| false));
    facts.n_by_one += 1;
    facts.kind().map(|_| candidate)
}

/// Returns the matter that holds a side, at each of its samples.
fn holds(unit: &Unit, index: u32, side: usize, around: &Surroundings<'_>) -> Vec<Vec<Hold>> {
    let (k, other) = if side < 2 { (1, 2) } else { (2, 1) };
    let sign = if side.is_multiple_of(2) { -1.0 } else { 1.0 };
    (0..SAMPLES)
        .map(|i| {
            let at = (i as f64 + 0.5) / SAMPLES as f64 * 2.0 - 1.0;
            let mut found: Vec<Hold> = Vec::new();
            for step in STEPS {
                let p = unit.center
                    + unit.axes[other] * (at * unit.half[other])
                    + unit.axes[k] * (sign * (unit.half[k] + step));
                for hold in matter_across(unit, index, p, around) {
                    if !found.iter().any(|h| h.unit == hold.unit) {
                        found.push(hold);
                    }
                }
            }
            found
        })
        .collect()
}

/// Returns `true` if anything bounds the unit on the left (`sign` -1) or right (1).
fn is_at_end(unit: &Unit, index: u32, sign: f64, around: &Surroundings<'_>) -> bool {
    let out = unit.axes[1] * sign;
    let end = unit.center + out * unit.half.y;
    let n_met = (0..SAMPLES)
        .filter(|&i| {
            let at = (i as f64 + 0.5) / SAMPLES as f64 * 2.0 - 1.0;
            let p = end + unit.axes[2] * (at * unit.half.z);
            around
                .bvh
                .any_hit(p - out * STEPS[1], p + out * STEPS[1], |t| {
                    around.unit_of[t as usize] == index
                })
        })
        .count();
    n_met as f64 >= HELD * SAMPLES as f64
}

/// A crossing of a surface and a line across a unit's plane.
#[derive(Clone, Copy)]
struct Crossing {
    unit: u32,
    /// Distance from the unit's middle plane. [Units: wu]
    at: f64,
    /// The surface faces across the unit, if only as the bevel of a jamb does.
    is_facing: bool,
}

/// Matter of another unit along such a line.
struct Matter {
    unit: u32,
    from: f64,
    to: f64,
}

/// Returns all crossings of the line through a point along the thin axis, by unit and in order.
fn crossings(unit: &Unit, p: DVec3, around: &Surroundings<'_>) -> Vec<Crossing> {
    let reach = unit.half.x + WALL;
    let across = unit.axes[0];
    let ray = Ray::segment(p - across * reach, p + across * reach);
    let mut found: Vec<Crossing> = Vec::new();
    around.bvh.for_each_hit(&ray, |h| {
        let n = triangle_area_normal(&around.triangles[h.triangle as usize]);
        found.push(Crossing {
            unit: around.unit_of[h.triangle as usize],
            at: (2.0 * h.t - 1.0) * reach,
            is_facing: !lies_along(n, across),
        });
    });
    found.sort_by(|a, b| a.unit.cmp(&b.unit).then(a.at.total_cmp(&b.at)));
    found.dedup_by(|b, a| a.unit == b.unit && b.at - a.at < SAME);
    found
}

/// Returns the matter of all units but one, between surfaces that the line goes through.
fn matter(crossings: &[Crossing], but: u32) -> Vec<Matter> {
    let facing: Vec<Crossing> = crossings
        .iter()
        .filter(|c| c.unit != but && c.is_facing)
        .copied()
        .collect();
    let mut found = Vec::new();
    for own in facing.chunk_by(|a, b| a.unit == b.unit) {
        // Front or back faces alike: the gap between two walls does not count as air, either.
        for pair in own.windows(2) {
            found.push(Matter {
                unit: own[0].unit,
                from: pair[0].at,
                to: pair[1].at,
            });
        }
    }
    found
}

/// Returns the matter of other units through a point that overlaps the unit's depth; for a sheet that stands, the sheets in its
/// plane, too. One that lies is rather a floor of its own material than a skylight.
fn matter_across(unit: &Unit, index: u32, p: DVec3, around: &Surroundings<'_>) -> Vec<Hold> {
    let half = unit.half.x;
    let met = crossings(unit, p, around);
    let stands = !is_rather_level(unit.axes[0]);
    let alone = met.chunk_by(|a, b| a.unit == b.unit).filter(|own| {
        let is_other = own[0].unit != index && own.len() == 1;
        is_other && stands && own[0].is_facing && half.max(own[0].at.abs()) <= SHEET
    });
    let sheets = alone.map(|own| Hold {
        unit: own[0].unit,
        thickness: 0.0,
    });
    let thick = matter(&met, index)
        .into_iter()
        .map(|m| (m.to.min(half) - m.from.max(-half), m))
        // A picture frame only touches its wall.
        .filter(|(overlap, m)| *overlap > OVERLAP * (m.to - m.from).min(2.0 * half))
        .map(|(_, m)| Hold {
            unit: m.unit,
            thickness: m.to - m.from,
        });
    thick.chain(sheets).collect()
}

/// Returns the unit's own matter along its thin axis, averaged over its face and in the thinnest quarter.
/// `None` without air before and behind it.
fn thickness_between_air(unit: &Unit, index: u32, around: &Surroundings<'_>) -> Option<(f64, f64)> {
    let mut own_matter = Vec::new();
    let mut n_free = [0, 0];
    for i in 0..GRID * GRID {
        let at = |k: usize| (k as f64 + 0.5) / GRID as f64 * 2.0 - 1.0;
        let p = unit.center
            + unit.axes[1] * (at(i % GRID) * unit.half.y)
            + unit.axes[2] * (at(i / GRID) * unit.half.z);
        let met = crossings(unit, p, around);
        let others = matter(&met, index);
        for (n, sign) in n_free.iter_mut().zip([-1.0, 1.0]) {
            let (near, far) = (unit.half.x + STEPS[0], unit.half.x + AIR);
            let is_met = met
                .iter()
                .any(|c| c.unit != index && (near..far).contains(&(sign * c.at)));
            // Inside a wall there are no hits, either.
            let is_inside = others
                .iter()
                .any(|m| m.from < sign * near && sign * near < m.to);
            *n += usize::from(!is_met && !is_inside);
        }
        let own = || met.iter().filter(|c| c.unit == index).map(|c| c.at);
        if let (Some(first), Some(last)) = (own().next(), own().next_back()) {
            own_matter.push(last - first);
        }
    }
    let n = (GRID * GRID) as f64;
    if n_free.iter().any(|&free| (free as f64) < OPEN * n) {
        return None;
    }
    own_matter.sort_by(f64::total_cmp);
    let is_frame = 2 * own_matter.len() < GRID * GRID;
    let leaf = if is_frame {
        0.0
    } else {
        own_matter[own_matter.len() / 4]
    };
    Some((own_matter.iter().sum::<f64>() / n, leaf))
}

//! Finds the storeys of a building by its floors.

use enfilade_cpg::World;
use enfilade_geom::{DVec3, Triangle};

/// Floors nearer than this in height are one storey: steps and split levels, not ceilings.
/// [Units: wu]
const LEAST_STOREY: f64 = 1.5;
/// Half the height of the window in which floor areas add up to one level. [Units: wu]
const LEVEL: f64 = 0.1;
/// A floor with less than this share of the largest storey's is a landing or a sill.
const LEAST_SHARE: f64 = 0.05;
/// Spacing of the points at which a floor is asked whether a room stands on it. [Units: wu]
const SPACING: f64 = 0.5;
/// How far above a floor rooms must be: just above it, and at the height of the usual cut, so that
/// the top of a suspended ceiling or of a wall under the roof is no floor. [Units: wu]
const ABOVE: [f64; 2] = [0.1, 1.2];

/// A storey: what stands on one floor level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Storey {
    /// Height of its floor. [Units: wu]
    pub floor: f64,
    /// Height of the next floor, or the top of the highest indoor cell. [Units: wu]
    pub top: f64,
    /// Area of floor found at that height. [Units: wu²]
    pub area: f64,
}

/// The storeys, lowest first; one at least where there is an indoor cell.
///
/// Level triangles with indoor cells above them, headroom included, vote for their height by area; heights are taken
/// by votes, those within 1.5 m of one taken before join it. O(floor area + triangles).
#[must_use]
pub fn find_storeys(world: &World) -> Vec<Storey> {
    let mut votes = floor_votes(world);
    let indoor = || world.graph.indoor_cells().map(|(_, c)| c);
    if votes.is_empty() {
        // No floors, as in a shell without one: where the cells begin.
        votes = indoor()
            .map(|c| (f64::from(c.aabb[0][1]), f64::from(c.volume).max(1e-3)))
            .collect();
    }
    votes.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let top = indoor()
        .map(|c| f64::from(c.aabb[1][1]))
        .fold(f64::NEG_INFINITY, f64::max);

    let mut storeys: Vec<Storey> = Vec::new();
    let mut is_taken = vec![false; votes.len()];
    while let Some((first, last)) = heaviest_level(&votes, &is_taken) {
        let area: f64 = votes[first..last].iter().map(|v| v.1).sum();
        let floor = votes[first..last].iter().map(|v| v.0 * v.1).sum::<f64>() / area;
        if storeys.first().is_some_and(|s| area < LEAST_SHARE * s.area) {
            break;
        }
        for (taken, vote) in is_taken.iter_mut().zip(&votes) {
            *taken |= (vote.0 - floor).abs() < LEAST_STOREY;
        }
        storeys.push(Storey { floor, top, area });
    }
    storeys.sort_by(|a, b| a.floor.total_cmp(&b.floor));
    for k in 1..storeys.len() {
        storeys[k - 1].top = storeys[k].floor;
    }
    storeys
}

/// The run of votes (sorted by height, none taken) within one level with the greatest sum.
fn heaviest_level(votes: &[(f64, f64)], is_taken: &[bool]) -> Option<(usize, usize)> {
    let mut best: Option<(f64, usize, usize)> = None;
    let (mut first, mut sum) = (0, 0.0);
    for last in 0..votes.len() {
        if is_taken[last] {
            (first, sum) = (last + 1, 0.0);
            continue;
        }
        sum += votes[last].1;
        while votes[last].0 - votes[first].0 > 2.0 * LEVEL {
            sum -= votes[first].1;
            first += 1;
        }
        if best.is_none_or(|b| sum > b.0) {
            best = Some((sum, first, last + 1));
        }
    }
    best.map(|(_, first, last)| (first, last))
}

/// Heights and areas of level surfaces that an indoor cell stands on.
fn floor_votes(world: &World) -> Vec<(f64, f64)> {
    let mut votes = Vec::new();
    for batch in &world.batches {
        let is_indoor = |c: &enfilade_cpg::CellId| !world.graph[*c].outdoor;
        if !batch.cells.iter().any(is_indoor) {
            continue;
        }
        let p = &batch.primitive;
        for t in p.indices.chunks_exact(3) {
            let t: Triangle =
                [0, 1, 2].map(|k| DVec3::from_array(p.positions[t[k] as usize].map(f64::from)));
            let n = (t[1] - t[0]).cross(t[2] - t[0]);
            // Within 8° of level, whichever way it faces: models turn floors upside down.
            if n.y.abs() > 0.99 * n.length() && n.y != 0.0 {
                vote(world, &t, 0.5 * n.length(), &mut votes);
            }
        }
    }
    votes
}

/// Asks points spread over the triangle; those with an indoor cell above them vote.
fn vote(world: &World, t: &Triangle, area: f64, votes: &mut Vec<(f64, f64)>) {
    let longest = t[0]
        .distance(t[1])
        .max(t[1].distance(t[2]))
        .max(t[2].distance(t[0]));
    // 64 rows, 4096 points: enough for any hall, and bounded.
    let n = ((longest / SPACING).ceil() as usize).clamp(1, 64);
    let each = area / (n * n) as f64;
    for i in 0..n {
        for j in 0..2 * (n - i) - 1 {
            // Centroids of the n² small triangles, upright and inverted in turn.
            let (row, column, third) =
                (i as f64, (j / 2) as f64, if j % 2 == 0 { 1.0 } else { 2.0 });
            let (u, v) = (
                (row + third / 3.0) / n as f64,
                (column + third / 3.0) / n as f64,
            );
            let p = t[0] + (t[1] - t[0]) * u + (t[2] - t[0]) * v;
            let is_indoor = |up: f64| {
                let cell = world.graph.locator.locate(p + DVec3::Y * up);
                cell.is_some_and(|c| !world.graph[c].outdoor)
            };
            if ABOVE.into_iter().all(is_indoor) {
                votes.push((p.y, each));
            }
        }
    }
}

//! From cells of tetrahedra to what the cell complex needs: screens, and votes.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_geom::{Aabb, Bvh, DVec3, Plane, Ray};
use rayon::prelude::*;

use super::cells::{Cells, OUTDOOR_CELL};
use super::session::{DelaunayConfig, Session};
use super::space::{Space, connected};
use crate::complex::Vote;
use crate::watershed::{OUTDOORS, Opening, Screen, fit_screen_at};

/// Tetrahedra this close to where two rooms meet do not vote: a screen may lie on either side of
/// them. [Units: wu]
const UNSURE: f64 = 0.35;
/// Tetrahedra with their middle this close to a wall do not vote: what is there may be the space
/// between two polygons that nearly touch. [Units: wu]
const AT_WALL: f64 = 0.01;
/// Distance between the points that stand for an opening. [Units: wu]
const STEP: f64 = 0.1;
/// About as many points stand for an opening at most.
const MAX_CENTERS: f64 = 4000.0;
/// How far from an opening's point a door leaf or pane may be to close it there. [Units: wu]
const CLOSE_BY: f64 = 0.15;
/// Openings smaller than this are left to the complex, which finds them as cracks. [Units: wu²]
const MIN_AREA: f64 = 0.04;
/// Points of a region that ask around whether it is a room.
const POINTS: usize = 32;
/// Regions in which no ball of this radius fits are dropped when most rays see backs. [Units: wu]
const NARROW: f64 = 0.5;

/// What the complex makes a world of.
pub(super) struct Rooms {
    pub(super) screens: Vec<Screen>,
    pub(super) votes: Vec<Vote>,
}

/// The label of a cell: regions count from [`OUTDOORS`] on.
fn label(cell: u32) -> u32 {
    cell - OUTDOOR_CELL + OUTDOORS
}

/// The rooms that decimation left, and what of it is none.
struct Standing {
    /// Room of each cell, the void in the outdoors.
    room_of_cell: Vec<u32>,
    /// Openings between two rooms: links that touch.
    patches: Vec<((u32, u32), Vec<u32>)>,
    /// Rooms that are the insides of walls and solids.
    hollow: BTreeSet<u32>,
}

impl Standing {
    fn of(space: &Space, cells: &Cells, room_of_cell: &[u32], bvh: &Bvh, min_radius: f64) -> Self {
        let room_of_cell = void_joined(space, cells, room_of_cell, bvh);
        let mut between: BTreeMap<(u32, u32), Vec<u32>> = BTreeMap::new();
        for (&(a, b), portal) in &cells.portals {
            let (a, b) = (room_of_cell[a as usize], room_of_cell[b as usize]);
            if a != b {
                // Pieces of an opening that tetrahedra cut off are missed by nobody.
                let wide = |l: &&u32| !space.is_crack(&space.links[**l as usize]);
                between
                    .entry((a.min(b), a.max(b)))
                    .or_default()
                    .extend(portal.links.iter().filter(wide));
            }
        }
        let patches: Vec<((u32, u32), Vec<u32>)> = between
            .into_iter()
            .flat_map(|(pair, links)| {
                connected(space, &links)
                    .into_iter()
                    .map(move |patch| (pair, patch))
            })
            .collect();
        let hollow = hollow_rooms(space, cells, &room_of_cell, &patches, bvh, min_radius);
        Self {
            room_of_cell,
            patches,
            hollow,
        }
    }
}

impl Session {
    /// How many rooms are left after the first `n_steps`, which is how many cells indoors [`bake_session`](super::bake_session) makes of them,
    /// and how many cells besides: crevices, and the insides of walls, which are dropped.
    ///
    /// `O(n log n)` in the parts of the space; a fraction of a second.
    #[must_use]
    pub fn count_rooms(&self, n_steps: usize, config: &DelaunayConfig) -> [usize; 2] {
        let standing = Standing::of(
            &self.space,
            &self.cells,
            &self.decimation.after(n_steps),
            &self.bvh,
            config.common.merge.min_radius,
        );
        let mut all: BTreeSet<u32> = standing.room_of_cell.into_iter().collect();
        all.remove(&OUTDOOR_CELL);
        let n_hollow = all.intersection(&standing.hollow).count();
        [all.len() - n_hollow, n_hollow]
    }
}

/// Screens where rooms meet and votes where they are. `room_of_cell` is what decimation left; `stairs` stand in
/// rooms and are no part of them.
pub(super) fn find_rooms(session: &Session, room_of_cell: &[u32], min_radius: f64) -> Rooms {
    let Session {
        space,
        cells,
        walls,
        bvh,
        closures,
        stairs,
        ..
    } = session;
    let Standing {
        room_of_cell,
        patches,
        hollow,
    } = Standing::of(space, cells, room_of_cell, bvh, min_radius);
    let room_at = |t: u32| room_of_cell[cells.cell_of_part[t as usize] as usize];
    let leaves = Bvh::build(closures);
    let found: Vec<(Vec<DVec3>, Option<Screen>)> = patches
        .par_iter()
        .map(|(pair, patch)| {
            let (centers, opening) = opening_of(space, *pair, patch, &room_at, &leaves);
            if opening.area < MIN_AREA {
                return (centers, None);
            }
            let near = |bounds: &Aabb| {
                let mut found = Vec::new();
                bvh.for_each_in_box(bounds, |t| found.push(t));
                found.sort_unstable();
                found
            };
            let regions = [label(pair.0), label(pair.1)];
            let screen = fit_screen_at(&centers, STEP, &opening, regions, walls, &near);
            (centers, Some(screen))
        })
        .collect();

    let key = |p: DVec3| (p / UNSURE).floor().to_array().map(|x| x as i64);
    let mut unsure: BTreeMap<[i64; 3], Vec<DVec3>> = BTreeMap::new();
    for (centers, _) in &found {
        for &p in centers {
            unsure.entry(key(p)).or_default().push(p);
        }
    }
    let is_unsure = |p: DVec3| {
        let [x, y, z] = key(p);
        (0..27).any(|i| {
            let cell = [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1];
            unsure
                .get(&cell)
                .is_some_and(|list| list.iter().any(|q| q.distance(p) < UNSURE))
        })
    };
    let n = space.middles.len();
    let sure: Vec<bool> = (0..n)
        .into_par_iter()
        .map(|t| {
            let p = space.middles[t];
            !is_unsure(p) && bvh.nearest(p, AT_WALL).is_none() && !is_inside(stairs, p)
        })
        .collect();
    let vote = |t: u32| Vote {
        point: space.middles[t as usize],
        label: label(room_at(t)),
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
    // A room that is all doorway speaks from its widest place.
    votes.extend(
        widest
            .iter()
            .filter(|(room, _)| !heard.contains(room))
            .map(|(_, &t)| vote(t)),
    );
    Rooms {
        screens: found.into_iter().filter_map(|f| f.1).collect(),
        votes,
    }
}

/// Rooms with the void joined to the outdoors. Where the outdoors sees backs, the model has insides
/// only, and whatever else sees backs is part of the same void.
fn void_joined(space: &Space, cells: &Cells, room_of_cell: &[u32], bvh: &Bvh) -> Vec<u32> {
    let mut members: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (t, &c) in cells.cell_of_part.iter().enumerate() {
        members
            .entry(room_of_cell[c as usize])
            .or_default()
            .push(t as u32);
    }
    let void: BTreeSet<u32> = members
        .into_par_iter()
        .filter_map(|(room, mut tets)| {
            (share_of_backs(space, bvh, &mut tets) > 0.6).then_some(room)
        })
        .collect();
    let room = |&r: &u32| {
        if void.contains(&OUTDOOR_CELL) && void.contains(&r) {
            OUTDOOR_CELL
        } else {
            r
        }
    };
    room_of_cell.iter().map(room).collect()
}

/// Points all over the facets of an opening, and its measures.
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
        faces: Vec::new(),
    };
    (centers, opening)
}

/// Rooms that are none: the insides of walls and solids, which nothing can get into and from which
/// one sees the backs of surfaces. The rule is the watershed's (`watershed/hollow.rs`).
fn hollow_rooms(
    space: &Space,
    cells: &Cells,
    room_of_cell: &[u32],
    patches: &[((u32, u32), Vec<u32>)],
    bvh: &Bvh,
    min_radius: f64,
) -> BTreeSet<u32> {
    let mut group: BTreeMap<u32, u32> = room_of_cell.iter().map(|&r| (r, r)).collect();
    fn root(group: &BTreeMap<u32, u32>, mut r: u32) -> u32 {
        while group[&r] != r {
            r = group[&r];
        }
        r
    }
    for ((a, b), _) in patches {
        let (a, b) = (root(&group, *a), root(&group, *b));
        group.insert(a.max(b), a.min(b));
    }
    let group_of: BTreeMap<u32, u32> = group.keys().map(|&r| (r, root(&group, r))).collect();
    let group_at = |t: usize| group_of[&room_of_cell[cells.cell_of_part[t] as usize]];
    let mut members: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let mut radius: BTreeMap<u32, f64> = BTreeMap::new();
    for t in 0..space.middles.len() {
        let g = group_at(t);
        members.entry(g).or_default().push(t as u32);
        let r = radius.entry(g).or_insert(0.0);
        *r = r.max(space.radii[t]);
    }
    let share = |tets: &mut Vec<u32>| share_of_backs(space, bvh, tets);
    let (mut hollow, mut doubtful) = (BTreeSet::new(), Vec::new());
    let outdoor_group = group_of[&OUTDOOR_CELL];
    let mut outdoors = members.remove(&outdoor_group).unwrap_or_default();
    let trusted = share(&mut outdoors) < 0.1;
    let mut any_room = group_of
        .iter()
        .any(|(&r, &g)| g == outdoor_group && r != OUTDOOR_CELL);
    for (g, mut tets) in members {
        let widest = radius[&g];
        let back = share(&mut tets);
        if widest < min_radius || (back > 0.6 && widest < NARROW) {
            hollow.insert(g);
        } else if back > 0.9 && trusted {
            doubtful.push(g);
        } else {
            any_room = true;
        }
    }
    // A closed shell of a building, with nothing modelled inside, is a building and not a boulder.
    if any_room {
        hollow.extend(doubtful);
    }
    group_of
        .into_iter()
        .filter(|(_, g)| hollow.contains(g))
        .map(|(r, _)| r)
        .collect()
}

/// Whether whatever way one looks from `p`, one sees the backs of some surfaces.
fn is_inside(surfaces: &Bvh, p: DVec3) -> bool {
    surfaces.bounds().contains(p)
        && (0..6).all(|i| {
            surfaces
                .closest_hit(&ray(p, i), |_| false)
                .is_some_and(|hit| !hit.front)
        })
}

/// One of rays all around: six along the axes, then eight along the diagonals.
fn ray(origin: DVec3, i: usize) -> Ray {
    let bit = |k: usize| if i >> k & 1 == 0 { 1.0 } else { -1.0 };
    let direction = if i < 6 {
        DVec3::AXES[i / 2] * bit(0)
    } else {
        DVec3::new(bit(0), bit(1), bit(2))
    };
    Ray {
        origin,
        // Off the axes a little, so that rays do not run along edges.
        direction: direction + DVec3::new(0.013, 0.007, -0.011),
        t_max: f64::INFINITY,
    }
}

/// Of the rays from the largest of some tetrahedra, the share that meets backs.
fn share_of_backs(space: &Space, bvh: &Bvh, tets: &mut [u32]) -> f64 {
    // The largest speak for a region: those at its surface are many and see little.
    tets.sort_by(|&a, &b| {
        space.volumes[b as usize]
            .total_cmp(&space.volumes[a as usize])
            .then(a.cmp(&b))
    });
    let (mut back, mut all) = (0.0, 0.0);
    for &t in tets.iter().take(POINTS) {
        for i in 0..14 {
            let ray = ray(space.middles[t as usize], i);
            if let Some(hit) = bvh.closest_hit(&ray, |_| false) {
                all += 1.0;
                back += f64::from(u8::from(!hit.front));
            }
        }
    }
    if all == 0.0 { 0.0 } else { back / all }
}

//! Open land as cells: valleys, streets, squares and courtyards, by a watershed of the plan (Haumont, Debeir and Sillion
//! 2003, §7).
//!
//! The outdoors has no minima in space: it widens upwards. Seen from above it has. A height map of all that is structural tells
//! low ground from what parts it (`rise`), by one quantity for valleys and for streets; the watershed and the rules of rooms
//! divide the low ground, and a flood by height all the rest (`areas`). Each area becomes a cell between the ground and a sky
//! limit (`lids`): candidate portals stand on its borders (`borders`) and lie in the limit, and votes say which side
//! is which, so all that follows a proposal is the same as for rooms. The outdoors is what remains: the sky, and everything beyond
//! the land. Houses are matter here. Rooms in them, and their votes, stay as they are.
//!
//! Cost: linear in the squares of the map, up to a million, times the widths of streets that are tried (some 30), and `n log n`
//! for the flood. Numerically harmless: squares choose the places of portals; what is open is decided by the complex.

mod areas;
mod borders;
mod lids;
mod relief;
mod rise;

use enfilade_cpg::{Reason, Why};
use enfilade_geom::{Aabb, DVec3, Plane, Winding};

use crate::complex::{Label, Vote};
use crate::proposal::Proposal;
use crate::structure::{Candidate, Frame, OUTDOORS, Structure};
use crate::{BakeConfig, BakeContext, BakeError, Outdoors, Stage};
use areas::{Areas, areas, areas_from};
use borders::{Owners, Segment};
use lids::{Lid, lids};
use relief::{NOTHING, Relief};
use rise::low_ground;

/// Squares along the edge of the surface that are left to the outdoors: the surface may end anywhere in them.
const EDGE: usize = 2;
/// Squares this close to a border do not vote.
const UNSURE: usize = 2;
/// Squares by which candidates reach into the walls beside low ground.
const WALLS: usize = 2;
/// Distance by which candidates reach below the ground, and beyond the borders of a sky limit. [Units: wu]
const BELOW: f64 = 0.5;
const BEYOND: f64 = 0.05;
/// Shares of the height from the ground to the sky limit at which votes are cast.
const HEIGHTS: [f64; 3] = [0.2, 0.5, 0.8];
/// Approximate upper limit on the number of votes.
const MAX_VOTES: usize = 400_000;

/// Divides the outdoors of a proposal into areas of open land, if that is wanted and there are at least two.
///
/// # Errors
/// If a minimum lies beside the land, or the caller cancels.
pub(crate) fn split(
    structure: &Structure<'_>,
    config: &BakeConfig,
    context: &BakeContext<'_>,
    proposal: &mut Proposal,
) -> Result<(), BakeError> {
    let Outdoors::Split { minima } = &config.outdoors else {
        return Ok(());
    };
    context.begin(Stage::Land)?;
    let allowance = context.allowance();
    let all = [&structure.walls[..], &structure.stairs].concat();
    let relief = Relief::of(&all, &structure.bounds(), allowance);
    drop(all);
    let frame = &structure.frame;
    let seeds = seeds(&relief, frame, minima)?;
    let is_indoors = indoors(&relief, frame, proposal);
    let mut is_low = low_ground(&relief, allowance);
    for (low, &indoors) in is_low.iter_mut().zip(&is_indoors) {
        *low &= !indoors;
    }
    let mut areas = if seeds.is_empty() {
        areas(&relief, &is_low, config.noise, &config.merge, allowance)
    } else {
        areas_from(&relief, &is_low, &seeds, allowance)
    };
    context.check()?;
    proposal
        .settings
        .insert("outdoors".to_owned(), "split".to_owned());
    proposal.counts.push(("land_areas", areas.n as f64));
    if areas.n < 2 {
        let note = "the open land is one area: the outdoors stays one cell";
        proposal.notes.push(note.to_owned());
        return Ok(());
    }
    trim(&relief, &mut areas);
    let land = Land {
        lids: lids(&relief, &areas, &is_low),
        first: proposal.n_regions(),
        relief,
        areas,
        is_low,
        is_indoors,
        frame: *frame,
    };
    land.move_votes(proposal);
    land.add_votes(proposal);
    land.add_candidates(proposal);
    proposal.land = land.first + 1..land.first + 1 + land.areas.n as u32;
    Ok(())
}

/// Returns the squares of minima that a user places.
fn seeds(relief: &Relief, frame: &Frame, minima: &[[f64; 2]]) -> Result<Vec<usize>, BakeError> {
    let seed = |&[x, z]: &[f64; 2]| {
        let at = frame.to_grid(DVec3::new(x, 0.0, z));
        let square = relief.square_at([at.x, at.z]);
        let found = square.filter(|&i| relief.top[i] != NOTHING);
        found.ok_or_else(|| BakeError::Setting {
            name: "minimum",
            value: format!("{x},{z}"),
            limit: "a point x,z with a surface above or below it",
        })
    };
    minima.iter().map(seed).collect()
}

/// Returns the squares in which a room is open to the sky: above the highest surface.
fn indoors(relief: &Relief, frame: &Frame, proposal: &Proposal) -> Vec<bool> {
    let mut found = vec![false; relief.len()];
    for vote in &proposal.votes {
        let p = frame.to_grid(vote.point);
        if let Some(region) = vote.label.region()
            && region > OUTDOORS
            && let Some(i) = relief.square_at([p.x, p.z])
            && p.y > f64::from(relief.top[i])
        {
            found[i] = true;
        }
    }
    found
}

/// Leaves squares near the edge of the surface to the outdoors.
fn trim(relief: &Relief, areas: &mut Areas) {
    for _ in 0..EDGE {
        let is_inner = |i: usize| {
            let [x, z] = relief.at(i);
            let [nx, nz] = relief.dims;
            let is_middle = x > 0 && z > 0 && x + 1 < nx && z + 1 < nz;
            is_middle
                && [
                    i - nx - 1,
                    i - nx,
                    i - nx + 1,
                    i - 1,
                    i + 1,
                    i + nx - 1,
                    i + nx,
                    i + nx + 1,
                ]
                .into_iter()
                .all(|j| areas.of_square[j] != 0)
        };
        let inner: Vec<bool> = (0..relief.len()).map(is_inner).collect();
        for (area, is_inner) in areas.of_square.iter_mut().zip(inner) {
            *area = if is_inner { *area } else { 0 };
        }
    }
}

/// The divided land, in frame coordinates.
struct Land {
    relief: Relief,
    areas: Areas,
    is_low: Vec<bool>,
    is_indoors: Vec<bool>,
    lids: Vec<Lid>,
    /// Region before that of area 1.
    first: u32,
    frame: Frame,
}

impl Land {
    /// Returns the area and the lid over a square.
    fn over(&self, square: usize) -> Option<(u32, &Lid)> {
        let area = self.areas.of_square[square];
        let lid = (area as usize).checked_sub(1)?;
        Some((area, &self.lids[lid]))
    }

    /// Gives votes for the outdoors above the ground and below the sky limit to the areas that they are in.
    fn move_votes(&self, proposal: &mut Proposal) {
        let region = |point: DVec3| {
            let p = self.frame.to_grid(point);
            let i = self.relief.square_at([p.x, p.z])?;
            let (area, lid) = self.over(i)?;
            let is_in = f64::from(self.relief.ground[i]) < p.y && p.y < lid.height([p.x, p.z]);
            is_in.then(|| self.first + area)
        };
        for vote in &mut proposal.votes {
            if vote.label == Label::Region(OUTDOORS)
                && let Some(region) = region(vote.point)
            {
                vote.label = Label::Region(region);
            }
        }
        for (point, of) in &mut proposal.voids {
            if *of == OUTDOORS
                && let Some(region) = region(*point)
            {
                *of = region;
            }
        }
    }

    /// Adds votes in the middle of areas, and for the outdoors above them and around them.
    fn add_votes(&self, proposal: &mut Proposal) {
        let relief = &self.relief;
        let mut stride = 1;
        while relief.len() * (HEIGHTS.len() + 1) / (stride * stride) > MAX_VOTES {
            stride += 1;
        }
        let area = (relief.square * stride as f64).powi(2);
        let is_near = self.near_borders();
        let mut has_voted = vec![false; self.areas.n + 1];
        // Narrow areas vote wherever they are.
        for narrow in [false, true] {
            for (i, &is_near) in is_near.iter().enumerate() {
                let [x, z] = relief.at(i);
                let of = self.areas.of_square[i] as usize;
                let is_due = if narrow {
                    !has_voted[of]
                } else {
                    (x + z * 7) % stride == 0 && z % stride == 0 && !is_near
                };
                if is_due && relief.top[i] != NOTHING && !self.is_indoors[i] {
                    self.vote(i, area, &mut has_voted, &mut proposal.votes);
                }
            }
        }
    }

    /// Adds votes in the column over a square.
    fn vote(&self, i: usize, area: f64, has_voted: &mut [bool], votes: &mut Vec<Vote>) {
        let [x, z] = self.relief.middle(self.relief.at(i));
        let ground = f64::from(self.relief.top[i]);
        let mut add = |y: f64, region: u32, height: f64| {
            votes.push(Vote {
                point: self.frame.to_scene(DVec3::new(x, y, z)),
                label: Label::Region(region),
                weight: (area * height) as f32,
            });
        };
        let Some((of, lid)) = self.over(i) else {
            has_voted[0] = true;
            return add(ground + 1.0, OUTDOORS, 1.0);
        };
        let top = lid.height([x, z]);
        let height = top - ground;
        if height > 2.0 * BELOW {
            has_voted[of as usize] = true;
            for share in HEIGHTS {
                add(
                    ground + share * height,
                    self.first + of,
                    height / HEIGHTS.len() as f64,
                );
            }
        }
        add(top.max(ground) + 1.0, OUTDOORS, 1.0);
    }

    /// Returns the squares near a border.
    fn near_borders(&self) -> Vec<bool> {
        let (relief, of_square) = (&self.relief, &self.areas.of_square);
        let meets = |i: usize| relief.beside(i).any(|j| of_square[j] != of_square[i]);
        grown(relief, (0..relief.len()).map(meets).collect(), UNSURE)
    }

    /// Adds upright candidates on the borders, and one in the sky limit of each area.
    fn add_candidates(&self, proposal: &mut Proposal) {
        let is_low = grown(&self.relief, self.is_low.clone(), WALLS);
        let owners = Owners {
            relief: &self.relief,
            is_low: &is_low,
            of_square: &self.areas.of_square,
        };
        let mut outlines: Vec<Vec<DVec3>> = vec![Vec::new(); self.areas.n];
        let mut windings: Vec<Winding> = Vec::new();
        for segment in owners.borders() {
            for area in segment.areas.into_iter().filter(|a| *a != 0) {
                let k = area as usize - 1;
                let ends = segment.ends.map(|joint| self.place(joint));
                let points = ends.map(|[x, z]| DVec3::new(x, self.lids[k].height([x, z]), z));
                outlines[k].extend(points);
            }
            windings.extend(self.upright(&owners, &segment));
        }
        for mut outline in outlines {
            let Some(normal) = plane_through(&outline) else {
                continue;
            };
            let plane = Plane::through(outline[0], normal);
            let center = outline.iter().sum::<DVec3>() / outline.len() as f64;
            for p in &mut outline {
                *p += (*p - center).normalize_or_zero() * BEYOND;
            }
            let hull = Winding::hull_in_plane(&plane, &outline);
            if hull.points.len() > 2 {
                windings.push(hull);
            }
        }
        let mut bounds = Aabb::EMPTY;
        for winding in windings {
            let winding = self.frame.winding_to_scene(&winding);
            bounds = bounds.union(winding.aabb());
            proposal.candidates.push(Candidate {
                why: Why::given(Reason::Border),
                winding,
                closed: 0.0,
            });
        }
        proposal.bounds = proposal.bounds.union(bounds.expanded(1.0));
    }

    /// Returns the x and z of a joint. [Units: wu]
    fn place(&self, joint: [i32; 2]) -> [f64; 2] {
        [0, 1].map(|k| self.relief.origin[k] + f64::from(joint[k]) * self.relief.square)
    }

    /// Returns the candidate on a part of a border: from below the ground to the higher sky limit of its sides; `None` if all of
    /// it lies below a surface.
    fn upright(&self, owners: &Owners<'_>, segment: &Segment) -> Option<Winding> {
        let [a, b] = segment.ends;
        let lids = segment.areas.into_iter().filter(|area| *area != 0);
        let lids: Vec<&Lid> = lids.map(|area| &self.lids[area as usize - 1]).collect();
        let highest = |at: [f64; 2]| lids.iter().map(|l| l.height(at)).fold(f64::MIN, f64::max);
        let (mut ground, mut is_open) = (f64::INFINITY, false);
        for square in owners.along(a, b) {
            let around = square
                .into_iter()
                .flat_map(|i| self.relief.beside(i).chain([i]));
            for i in around.filter(|&i| self.relief.top[i] != NOTHING) {
                ground = ground.min(self.relief.ground[i].into());
                let top = highest(self.relief.middle(self.relief.at(i)));
                is_open |= f64::from(self.relief.top[i]) < top + BEYOND;
            }
        }
        if !is_open {
            return None;
        }
        let low = ground - BELOW;
        let ends = [self.place(a), self.place(b)];
        let [first, last] = ends.map(|end| (end, highest(end).max(low + BELOW) + BEYOND));
        let point = |[x, z]: [f64; 2], y: f64| DVec3::new(x, y, z);
        Some(Winding::new(vec![
            point(first.0, low),
            point(last.0, low),
            point(last.0, last.1),
            point(first.0, first.1),
        ]))
    }
}

/// Returns the squares that are up to so many edges from one of these.
fn grown(relief: &Relief, mut squares: Vec<bool>, n: usize) -> Vec<bool> {
    for _ in 0..n {
        let is_near = |i: usize| squares[i] || relief.beside(i).any(|j| squares[j]);
        squares = (0..relief.len()).map(is_near).collect();
    }
    squares
}

/// Returns the normal of the plane that points lie in, upwards, if they are not on a line.
fn plane_through(points: &[DVec3]) -> Option<DVec3> {
    let first = *points.first()?;
    let farthest = |of: &dyn Fn(DVec3) -> f64| {
        let by = |a: &&DVec3, b: &&DVec3| of(**a).total_cmp(&of(**b));
        points.iter().max_by(by).copied()
    };
    let second = farthest(&|p| p.distance_squared(first))?;
    let normal = |p: DVec3| (second - first).cross(p - first);
    let third = farthest(&|p| normal(p).length_squared())?;
    let n = normal(third).try_normalize()?;
    Some(if n.y < 0.0 { -n } else { n })
}

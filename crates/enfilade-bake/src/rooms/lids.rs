//! Lids and floors: surfaces that close a building without a roof, or without a floor.
//!
//! Worlds for robots, doll's houses and half-finished models have walls and no ceiling. As a volume,
//! such a room is a bay of the outdoors: the farther up, the wider. Yet any viewer
//! sees rooms. So where walls end at one height all around, and there is nothing above but sky, a
//! lid is laid just below the tops of the walls. The flood treats it like a door leaf (see
//! `closures`), and it becomes an open portal between the room and the outdoors.
//!
//! Bare walls, as in extruded floor plans, end at the foot as they do at the top: a floor is
//! laid there by the same rule, upside down, and also becomes an open portal.
//!
//! Courtyards, roof terraces and gardens stay outdoors: a group of walls gets a lid only if next to
//! nothing that it encloses has a roof.
//!
//! The walls must stand upright along +Y. Cost: linear in voxels for the heights of columns, then
//! linear in the plan's columns for each height at which walls end.

use enfilade_cpg::{Reason, Why};
use enfilade_geom::{Allowance, DVec3, Plane, Winding};

use crate::judge::NARROW;
use crate::voxel::{BitVolume, Grid, SparseVolume};

use crate::structure::Candidate;

/// A column is a wall if it is filled for this height below its top. [Units: wu]
const MIN_WALL: f64 = 1.8;
/// Least length of walls that end at one height. [Units: wu]
const MIN_LENGTH: f64 = 4.0;
/// Gaps between walls up to twice this do not let the outdoors in. [Units: wu]
const MAX_GAP: f64 = 0.6;
/// A group of walls gets no lid if a larger share of its enclosed area is under a roof,
const MAX_ROOFED: f64 = 0.05;
/// … or if a larger share is filled to less than [`MIN_WALL`] below the lid (a terrace, a flat roof).
const MAX_SHALLOW: f64 = 0.25;
/// Columns this near to a wall may be the hollow of a wall of two sheets, not a roof: it is thinner than a person. [Units: wu]
const MAX_HOLLOW: f64 = NARROW;
/// Least area of a lid. [Units: wu²]
const MIN_AREA: f64 = 1.0;

/// Lids and floors, one voxel thick, each at its height; `None` if there are none.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lids {
    /// Below the tops of walls.
    pub(crate) lids: Option<SparseVolume>,
    /// Above the feet of walls.
    pub(crate) floors: Option<SparseVolume>,
}

impl Lids {
    /// Returns the candidate portal of an opening that lies mostly in a lid or floor: level, around its faces.
    #[must_use]
    pub(crate) fn candidate_of(&self, grid: &Grid, faces: &[u64]) -> Option<Candidate> {
        // A third into the voxel from outside: below all tops that end in the row above, above all
        // feet that end in the row below.
        let sheets = [(&self.lids, 1.0), (&self.floors, -1.0)];
        sheets.into_iter().find_map(|(voxels, side)| {
            let row = row_of(voxels.as_ref()?, grid, faces)?;
            let height = grid.center(0, row, 0).y + side * grid.voxel / 6.0;
            Some(level_candidate(grid, faces, row, height))
        })
    }

    /// Describes the lids and floors.
    #[must_use]
    pub(crate) fn notes(&self, grid: &Grid) -> Vec<String> {
        let note = |what: &str, ends: &str, voxels: &SparseVolume| {
            let area = voxels.count() as f64 * grid.voxel * grid.voxel;
            format!(
                "{what} of {area:.0} m² are missing, where walls end at {ends} with nothing {}: open portals stand in for them",
                if ends == "the top" { "above" } else { "below" }
            )
        };
        let lids = self.lids.as_ref().map(|v| note("ceilings", "the top", v));
        let floors = self.floors.as_ref().map(|v| note("floors", "the foot", v));
        lids.into_iter().chain(floors).collect()
    }
}

/// Returns the row of the lid or floor that contains nearly all of the faces, if any.
fn row_of(voxels: &SparseVolume, grid: &Grid, faces: &[u64]) -> Option<usize> {
    let mut rows: Vec<usize> = Vec::new();
    for &face in faces {
        let [x, y, z] = grid.coords((face / 4) as usize);
        if face % 4 == 1 {
            // The face lies between rows y and y + 1, the lid in either.
            rows.extend((y..=y + 1).filter(|&r| voxels.get(x, r, z)));
        }
    }
    rows.sort_unstable();
    let most = rows.chunk_by(|a, b| a == b).max_by_key(|run| run.len())?;
    (most.len() * 10 >= faces.len() * 8).then_some(most[0])
}

fn level_candidate(grid: &Grid, faces: &[u64], row: usize, height: f64) -> Candidate {
    let plane = Plane {
        normal: DVec3::Y,
        d: -height,
    };
    let reach = 1.5 * grid.voxel;
    let corners: Vec<_> = faces
        .iter()
        .flat_map(|&f| {
            let [x, _, z] = grid.coords((f / 4) as usize);
            let c = grid.center(x, row, z);
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(dx, dz)| c + DVec3::new(dx * reach, 0.0, dz * reach))
        })
        .collect();
    let winding = Winding::hull_in_plane(&plane, &corners);
    Candidate {
        winding,
        closed: 0.0,
        why: Why::given(Reason::Lid),
    }
}

/// Lays the lids and floors of a scene whose structure fills `occupied`.
#[must_use]
pub(crate) fn find_lids(grid: &Grid, occupied: &SparseVolume, allowance: &Allowance) -> Lids {
    let floors = lids_of(grid, &occupied.upside_down(), allowance);
    Lids {
        lids: lids_of(grid, occupied, allowance),
        floors: floors.map(|v| v.upside_down()),
    }
}

fn lids_of(grid: &Grid, occupied: &SparseVolume, allowance: &Allowance) -> Option<SparseVolume> {
    let columns = Columns::of(grid, occupied);
    let mut lids: Option<BitVolume> = None;
    let mut is_lidded = vec![false; columns.top.len()];
    let work_a_row = 1 + columns.top.len() as u64 / 2;
    let rows = columns.wall_ends(grid).into_iter();
    for row in rows.filter(allowance.each(work_a_row)) {
        for column in columns.enclosed(grid, occupied, row) {
            if !std::mem::replace(&mut is_lidded[column], true) {
                let (x, z) = (column % grid.dims[0], column / grid.dims[0]);
                lids.get_or_insert_with(|| BitVolume::new(grid.dims))
                    .set(x, row - 1, z, true);
            }
        }
    }
    lids.as_ref().map(SparseVolume::of)
}

/// The scene seen from above, by column `x + nx * z`.
struct Columns {
    /// Row of the highest filled voxel, plus one; 0 for none.
    top: Vec<u32>,
    /// The column is filled for [`MIN_WALL`] below its top.
    is_wall: Vec<bool>,
}

impl Columns {
    fn of(grid: &Grid, occupied: &SparseVolume) -> Self {
        let [nx, ny, nz] = grid.dims;
        let mut top = vec![0_u32; nx * nz];
        let mut run = vec![0_u32; nx * nz];
        for z in 0..nz {
            for y in (0..ny).rev() {
                for (w, &word) in occupied.row(y + ny * z).iter().enumerate() {
                    let mut rest = word;
                    while rest != 0 {
                        let column = z * nx + w * 64 + rest.trailing_zeros() as usize;
                        rest &= rest - 1;
                        if top[column] == 0 {
                            top[column] = y as u32 + 1;
                        }
                        // Counts on only while the column is filled without a gap.
                        if run[column] + y as u32 + 1 == top[column] {
                            run[column] += 1;
                        }
                    }
                }
            }
        }
        let enough = (MIN_WALL / grid.voxel).round() as u32;
        Self {
            is_wall: run.iter().map(|&r| r >= enough).collect(),
            top,
        }
    }

    /// Returns the rows in which walls end along [`MIN_LENGTH`] or more, the highest first.
    fn wall_ends(&self, grid: &Grid) -> Vec<usize> {
        let mut count = vec![0_usize; grid.dims[1] + 2];
        for (&top, _) in self.top.iter().zip(&self.is_wall).filter(|c| *c.1) {
            count[top as usize] += 1;
        }
        let enough = ((MIN_LENGTH / grid.voxel) as usize).max(1);
        let mut rows = Vec::new();
        for t in (2..=grid.dims[1]).rev() {
            // One voxel up or down is the same height, rounded.
            let (above, below) = (count[t + 1], count[t - 1]);
            if count[t] + above + below >= enough && count[t] >= above && count[t] > below {
                // Below the lowest tops among them.
                rows.push(if below * 10 >= count[t] { t - 2 } else { t - 1 });
            }
        }
        rows.retain(|&r| r > 0);
        rows
    }

    /// Returns the columns that need a lid at the height of `row`.
    fn enclosed(&self, grid: &Grid, occupied: &SparseVolume, row: usize) -> Vec<usize> {
        let [nx, ny, nz] = grid.dims;
        let n = nx * nz;
        // Just below the lid: the tops themselves may be rounded away.
        let mut is_free = vec![true; n];
        for z in 0..nz {
            for (x, free) in is_free[z * nx..][..nx].iter_mut().enumerate() {
                *free = !occupied.get(x, row - 1, z);
            }
        }
        debug_assert!(row < ny);
        let (is_inside, steps) = inside(grid, &is_free);
        let clear = (MAX_HOLLOW / grid.voxel).ceil() as u32;
        // Walls and the area they enclose, group by group.
        let mut seen = vec![false; n];
        let mut out = Vec::new();
        let enough = (MIN_AREA / (grid.voxel * grid.voxel)) as usize;
        let depth = (MIN_WALL / grid.voxel).round() as u32;
        for start in 0..n {
            if seen[start] || !is_inside[start] {
                continue;
            }
            let group = spread(nx, nz, start, &mut seen, |c| is_inside[c] || !is_free[c]);
            let (mut open, mut roofed, mut shallow) = (Vec::new(), 0_u32, 0_u32);
            for c in group.into_iter().filter(|&c| is_inside[c]) {
                let top = self.top[c];
                if top > row as u32 {
                    roofed += u32::from(steps[c] > clear);
                } else if top + depth > row as u32 {
                    shallow += 1;
                    open.push(c);
                } else {
                    open.push(c);
                }
            }
            let total = open.len() as f64 + f64::from(roofed);
            if open.len() >= enough
                && f64::from(roofed) <= MAX_ROOFED * total
                && f64::from(shallow) <= MAX_SHALLOW * total
            {
                out.append(&mut open);
            }
        }
        out
    }
}

/// Returns which free columns lie inside: those that the border does not reach through gaps wider than
/// twice [`MAX_GAP`]; each side gets half of a gap. Also returns every column's steps to the
/// nearest wall, `u32::MAX` if farther than [`MAX_GAP`].
fn inside(grid: &Grid, is_free: &[bool]) -> (Vec<bool>, Vec<u32>) {
    const NONE: u32 = u32::MAX;
    let [nx, _, nz] = grid.dims;
    let n = nx * nz;
    let reach = (MAX_GAP / grid.voxel).round() as u32;
    // Steps to the nearest wall, counted over eight neighbors up to `reach`.
    let mut steps: Vec<u32> = is_free.iter().map(|&f| if f { NONE } else { 0 }).collect();
    let mut front: Vec<usize> = (0..n).filter(|&c| !is_free[c]).collect();
    for step in 1..=reach {
        let mut next = Vec::new();
        for &c in &front {
            for_neighbors(nx, nz, c, true, |d| {
                if steps[d] == NONE {
                    steps[d] = step;
                    next.push(d);
                }
            });
        }
        front = next;
    }
    let mut is_outside = vec![false; n];
    let border = (0..n).filter(|c| c % nx == 0 || c % nx + 1 == nx || *c < nx || *c >= n - nx);
    for start in border {
        if !is_outside[start] && steps[start] == NONE {
            spread(nx, nz, start, &mut is_outside, |c| steps[c] == NONE);
        }
    }
    // Both sides grow into the remaining columns at the same pace.
    let mut side: Vec<u8> = (0..n)
        .map(|c| match (steps[c] == NONE, is_outside[c]) {
            (true, true) => 1,
            (true, false) => 2,
            _ => 0,
        })
        .collect();
    let mut front: Vec<usize> = (0..n).filter(|&c| side[c] != 0).collect();
    while !front.is_empty() {
        let mut next = Vec::new();
        for &c in &front {
            for_neighbors(nx, nz, c, false, |d| {
                if side[d] == 0 && is_free[d] {
                    side[d] = side[c];
                    next.push(d);
                }
            });
        }
        front = next;
    }
    // Columns that nothing reached are narrow and enclosed by walls.
    ((0..n).map(|c| is_free[c] && side[c] != 1).collect(), steps)
}

/// Returns all columns connected to `start` by shared sides where `may` holds; marks them as seen.
fn spread(
    nx: usize,
    nz: usize,
    start: usize,
    seen: &mut [bool],
    may: impl Fn(usize) -> bool,
) -> Vec<usize> {
    let mut out = vec![start];
    seen[start] = true;
    let mut at = 0;
    while at < out.len() {
        for_neighbors(nx, nz, out[at], false, |d| {
            if !seen[d] && may(d) {
                seen[d] = true;
                out.push(d);
            }
        });
        at += 1;
    }
    out
}

fn for_neighbors(nx: usize, nz: usize, c: usize, diagonal: bool, mut visit: impl FnMut(usize)) {
    let (x, z) = (c % nx, c / nx);
    for (dx, dz) in [
        (0, 1),
        (2, 1),
        (1, 0),
        (1, 2),
        (0, 0),
        (2, 0),
        (0, 2),
        (2, 2),
    ]
    .into_iter()
    .take(if diagonal { 8 } else { 4 })
    {
        let (x, z) = (x + dx, z + dz);
        if (1..=nx).contains(&x) && (1..=nz).contains(&z) {
            visit((z - 1) * nx + x - 1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: [usize; 3] = [120, 50, 100];

    fn grid() -> Grid {
        Grid {
            origin: DVec3::ZERO,
            voxel: 0.1,
            dims: N,
        }
    }

    /// Fills the box from `lo` to one before `hi`.
    fn fill(volume: &mut BitVolume, lo: [usize; 3], hi: [usize; 3]) {
        for z in lo[2]..hi[2] {
            for y in lo[1]..hi[1] {
                for x in lo[0]..hi[0] {
                    volume.set(x, y, z, true);
                }
            }
        }
    }

    /// A floor and walls 2.5 m high around 10 m × 8 m, with a wall between two rooms.
    fn roofless() -> BitVolume {
        let mut v = BitVolume::new(N);
        fill(&mut v, [10, 10, 10], [110, 11, 90]);
        for (lo, hi) in [
            ([10, 10], [110, 12]),
            ([10, 88], [110, 90]),
            ([10, 10], [12, 90]),
            ([108, 10], [110, 90]),
            ([60, 10], [62, 90]),
        ] {
            fill(&mut v, [lo[0], 11, lo[1]], [hi[0], 36, hi[1]]);
        }
        v
    }

    fn lids_in(volume: &BitVolume) -> Lids {
        find_lids(&grid(), &SparseVolume::of(volume), &Allowance::default())
    }

    fn lidded(volume: &BitVolume) -> usize {
        lids_in(volume).lids.map_or(0, |v| v.count())
    }

    #[test]
    fn walls_alone_get_floors_at_their_feet_and_a_crawl_space_none() {
        let mut walls = roofless();
        for z in 0..N[2] {
            for x in 0..N[0] {
                if !walls.get(x, 20, z) {
                    walls.set(x, 10, z, false);
                }
            }
        }
        let both = lids_in(&walls);
        let (lids, floors) = (both.lids.unwrap(), both.floors.unwrap());
        assert_eq!((lids.count(), floors.count()), (94 * 76, 94 * 76));
        assert!(floors.dense().iter_set().all(|i| grid().coords(i)[1] == 11));
        // A floor 1.2 m above the feet of the walls: the space below belongs to the land.
        fill(&mut walls, [10, 22, 10], [110, 23, 90]);
        assert!(lids_in(&walls).floors.is_none());
        assert!(lids_in(&roofless()).floors.is_none());
    }

    #[test]
    fn rooms_without_a_roof_get_lids_below_the_tops_of_their_walls() {
        let mut v = roofless();
        // A gap for a door from floor to wall top, 0.9 m wide, lets nothing in.
        for z in 40..49 {
            for y in 11..36 {
                v.set(10, y, z, false);
                v.set(11, y, z, false);
            }
        }
        let lids = lids_in(&v).lids.unwrap();
        let inner = (48 + 46) * 76;
        // Half of the gap (2 × 9 columns) may count as inside.
        assert!((inner..=inner + 18).contains(&lids.count()));
        let rows: Vec<usize> = lids
            .dense()
            .iter_set()
            .map(|i| grid().coords(i)[1])
            .collect();
        assert!(rows.iter().all(|&y| y == 34));
    }

    #[test]
    fn hollow_walls_are_no_roof_until_a_person_fits_into_them() {
        // Kits have walls of two sheets and a cap.
        let hollow = |thick: usize| {
            let mut v = BitVolume::new(N);
            let ring = |v: &mut BitVolume, at: usize, rows: [usize; 2]| {
                let (low, high) = (10 + at, [110 - at, 90 - at]);
                fill(v, [low, rows[0], low], [high[0], rows[1], low + 1]);
                fill(v, [low, rows[0], high[1] - 1], [high[0], rows[1], high[1]]);
                fill(v, [low, rows[0], low], [low + 1, rows[1], high[1]]);
                fill(v, [high[0] - 1, rows[0], low], [high[0], rows[1], high[1]]);
            };
            fill(&mut v, [10, 10, 10], [110, 11, 90]);
            ring(&mut v, 0, [11, 36]);
            ring(&mut v, thick - 1, [11, 36]);
            (1..thick).for_each(|k| ring(&mut v, k, [35, 36]));
            lidded(&v)
        };
        assert_eq!(hollow(10), 80 * 60);
        assert_eq!(hollow(14), 0);
    }

    #[test]
    fn a_roof_over_one_of_two_rooms_leaves_the_other_a_courtyard() {
        let mut v = roofless();
        fill(&mut v, [10, 36, 10], [62, 37, 90]);
        assert_eq!(lidded(&v), 0);
    }

    #[test]
    fn a_terrace_behind_a_parapet_has_no_lid() {
        let mut v = BitVolume::new(N);
        fill(&mut v, [10, 10, 10], [110, 26, 90]);
        for (lo, hi) in [
            ([10, 10], [110, 12]),
            ([10, 88], [110, 90]),
            ([10, 10], [12, 90]),
            ([108, 10], [110, 90]),
        ] {
            fill(&mut v, [lo[0], 26, lo[1]], [hi[0], 36, hi[1]]);
        }
        assert_eq!(lidded(&v), 0);
    }

    #[test]
    fn walls_open_on_one_side_have_no_lid() {
        let mut v = roofless();
        for z in 12..88 {
            for y in 11..36 {
                for x in [10, 11, 60, 61, 108, 109] {
                    v.set(x, y, z, false);
                }
            }
        }
        assert_eq!(lidded(&v), 0);
    }
}

//! Cross-sections beside an opening: the share of the space on either side that an opening leaves
//! open.

use enfilade_geom::{DVec3, is_rather_level};

use super::flooded::Flooded;
use super::fronts::{Front, face_center};
use crate::MergeSettings;
use crate::judge::{FRAMED, OpeningSection};
use crate::structure::{Jambs, OUTDOORS, Opening, rim_share};
use crate::voxel::{Grid, Reader};

/// Least share of a front that leaves hold if it stands between them.
const LEAVES: f64 = 0.2;
/// An opening lies away from the flood's front if it is narrower there by this factor.
const PINCHED: f64 = 0.9;

/// Lattice steps around an opening's rim within which most pinches show: a pass over the full surround costs ten
/// times as much around a small opening.
const CLOSE: f64 = 3.0;

/// Measures the opening of `front`, between the cells of `pair`, as far as needed to tell if it parts them. `cell_of` returns the cell of a
/// basin.
pub(super) fn section_of(
    flooded: Flooded<'_>,
    settings: &MergeSettings,
    front: &Front,
    pair: [u32; 2],
    cell_of: &(impl Fn(u32) -> u32 + Sync),
) -> OpeningSection {
    let step = lattice_step(flooded.grid);
    // The same lattice: a section that is large enough there is no smaller in the full surround.
    let rest = ((settings.surround / step).floor() - CLOSE).max(0.0);
    if rest > 0.0 && front.opening.closed < LEAVES {
        let close = settings.surround - rest * step;
        let slices = Slices::beside(flooded, close, front, cell_of);
        let section = measured(
            &slices,
            settings,
            &front.opening,
            pair,
            WantedSections::Enough,
        );
        if section.ratio < settings.threshold {
            return section;
        }
    }
    let slices = Slices::beside(flooded, settings.surround, front, cell_of);
    measured(
        &slices,
        settings,
        &front.opening,
        pair,
        WantedSections::Enough,
    )
}

/// Measures the opening of `front` as [`section_of`], with the largest sections beside it.
pub(super) fn whole_section_of(
    flooded: Flooded<'_>,
    settings: &MergeSettings,
    front: &Front,
    pair: [u32; 2],
    cell_of: &(impl Fn(u32) -> u32 + Sync),
) -> OpeningSection {
    let slices = Slices::beside(flooded, settings.surround, front, cell_of);
    measured(
        &slices,
        settings,
        &front.opening,
        pair,
        WantedSections::Whole,
    )
}

/// WantedSections to which sections are looked for.
#[derive(Clone, Copy, PartialEq)]
enum WantedSections {
    /// Up to sections so large that the opening is narrow.
    Enough,
    /// All of them.
    Whole,
}

fn measured(
    slices: &Slices<'_, impl Fn(u32) -> u32 + Sync>,
    settings: &MergeSettings,
    opening: &Opening,
    [a, b]: [u32; 2],
    extent: WantedSections,
) -> OpeningSection {
    let unit = slices.step * slices.step;
    let reach = (settings.reach / slices.step).round() as i64;

    // The flood's front may stand beyond the doorway, between the leaves of an open door, say: the
    // opening is where the two cells together are narrowest.
    let (mut n_open, mut at) = (opening.area / unit, 0);
    let has_leaves = opening.closed >= LEAVES;
    if has_leaves {
        let mut flood = SliceFlood::of(slices);
        for s in (1..=reach).flat_map(|s| [s, -s]) {
            flood.begin(slices, s);
            let n = flood.count(slices, |cell| cell == a || cell == b, |_| ());
            if n > 0 && (n as f64) < PINCHED * n_open {
                (n_open, at) = (n as f64, s);
            }
        }
    }

    // Once both are this large, the opening is a pinch in any case.
    let enough = n_open / settings.threshold;
    let mut sides = [Side::of(slices), Side::of(slices)];
    let is_level = is_rather_level(opening.plane.normal);
    let frame = |jambs: Jambs| {
        if is_level || has_leaves {
            1.0
        } else {
            jambs.frame()
        }
    };
    // Jambs are those before unless more space is beside them.
    let mut n_beside = usize::MAX;
    // From the opening outward, as far sections are the large ones.
    for s in 0..=reach + at.abs() {
        let [before, after] = &mut sides;
        let look = |side: &mut Side, own: usize, s: i64| side.look(slices, s, [a, b], own);
        if slices.seeds.len() < ALONE {
            look(before, 0, at - s);
            look(after, 1, at + s);
        } else {
            rayon::join(|| look(before, 0, at - s), || look(after, 1, at + s));
        }
        let n = smaller(&sides, a) as f64;
        let n_before = n_beside;
        if extent == WantedSections::Enough && n > enough {
            n_beside = sides[0].n_beside + sides[1].n_beside;
        }
        if n_beside != n_before {
            let frame = frame(slices.jambs(&sides));
            if frame >= FRAMED {
                return OpeningSection {
                    ratio: n_open / n,
                    wall: 0.0,
                    frame,
                };
            }
        }
    }
    let jambs = slices.jambs(&sides);
    let is_wall = |k: usize| sides.iter().all(|side| side.beside[k]);
    // A beam across the whole room does not make a wall, and neither do pilasters.
    let has_wall = is_level || jambs.both() >= FRAMED;
    OpeningSection {
        ratio: match smaller(&sides, a) {
            0 => 1.0,
            n => n_open / n as f64,
        },
        wall: if has_wall {
            rim_share(&slices.seeds, slices.side, is_wall)
        } else {
            0.0
        },
        frame: frame(jambs),
    }
}

/// Slices with fewer points than this are visited on one thread.
const ALONE: usize = 500;

/// Returns the smaller of the largest sections of two cells, the first of them `a`. The outdoors is unlimited.
fn smaller([before, after]: &[Side; 2], a: u32) -> usize {
    let [of_a, of_b] = [0, 1].map(|c| before.largest[c].max(after.largest[c]));
    if a == OUTDOORS { of_b } else { of_a.min(of_b) }
}

/// The sections on one side of an opening.
struct Side {
    /// Number of points of the largest section of either cell.
    largest: [usize; 2],
    /// Points that the section of the cell on this side contains in any slice.
    beside: Vec<bool>,
    n_beside: usize,
    flood: SliceFlood,
}

impl Side {
    fn of(slices: &Slices<'_, impl Fn(u32) -> u32 + Sync>) -> Self {
        Self {
            largest: [0; 2],
            beside: vec![false; slices.seeds.len()],
            n_beside: 0,
            flood: SliceFlood::of(slices),
        }
    }

    /// Measures the slice `s` steps along the normal; the cell `own` of the two is the one on this side.
    fn look(
        &mut self,
        slices: &Slices<'_, impl Fn(u32) -> u32 + Sync>,
        s: i64,
        cells: [u32; 2],
        own: usize,
    ) {
        self.flood.begin(slices, s);
        for (c, of) in cells.into_iter().enumerate() {
            let mut n = 0;
            let mark = |k: usize| {
                if c == own && !self.beside[k] {
                    self.beside[k] = true;
                    self.n_beside += 1;
                }
                n += usize::from(!slices.above[k]);
            };
            self.flood.count(slices, |cell| cell == of, mark);
            self.largest[c] = self.largest[c].max(n);
        }
    }
}

/// A flood of one slice from the opening outward, which reads no point that it does not reach: in a cave or a wide hall, the space
/// around an opening is mostly of others.
struct SliceFlood {
    /// Cell of each point read, [`UNREAD`] or [`COUNTED`].
    cells: Vec<u32>,
    /// Points that are not [`UNREAD`].
    read: Vec<u32>,
    /// Columns and rows of points whose neighbors are not looked at.
    stack: Vec<[u32; 2]>,
    /// First point of the slice. [Units: vx]
    base: DVec3,
    /// The allowance is used up.
    is_over: bool,
}

/// A point that was not looked at.
const UNREAD: u32 = u32::MAX;
/// A point that was counted.
const COUNTED: u32 = u32::MAX - 1;

impl SliceFlood {
    fn of(slices: &Slices<'_, impl Fn(u32) -> u32 + Sync>) -> Self {
        Self {
            cells: vec![UNREAD; slices.seeds.len()],
            read: Vec::new(),
            stack: Vec::new(),
            base: slices.base,
            is_over: false,
        }
    }

    /// Turns to the slice `s` steps along the normal.
    fn begin(&mut self, slices: &Slices<'_, impl Fn(u32) -> u32 + Sync>, s: i64) {
        for k in self.read.drain(..) {
            self.cells[k as usize] = UNREAD;
        }
        self.base = slices.base + slices.along[2] * s as f64;
        let work = 1 + slices.seeds.len() as u64 / 8;
        self.is_over = !slices.flooded.allowance.spend(work);
    }

    /// Returns the number of points connected to the opening within cells, and calls `mark` for each. Each counts once in a slice. Points
    /// behind a wall beside the opening do not belong to the section at the opening.
    fn count<F: Fn(u32) -> u32>(
        &mut self,
        slices: &Slices<'_, F>,
        is_own: impl Fn(u32) -> bool,
        mut mark: impl FnMut(usize),
    ) -> usize {
        if self.is_over {
            return 0;
        }
        let Self {
            cells,
            read,
            stack,
            base,
            ..
        } = self;
        let mut reader = slices.reader(*base);
        let [width, height] = slices.side.map(|n| n as u32);
        let mut take = |i: u32, j: u32, stack: &mut Vec<[u32; 2]>| {
            let k = i + j * width;
            let cell = &mut cells[k as usize];
            if *cell == UNREAD {
                *cell = reader.cell_at(i, j);
                read.push(k);
            }
            if *cell != COUNTED && is_own(*cell) {
                *cell = COUNTED;
                stack.push([i, j]);
            }
        };
        let mut n = 0;
        for &seed in &slices.opening {
            take(seed % width, seed / width, stack);
            while let Some([i, j]) = stack.pop() {
                n += 1;
                mark((i + j * width) as usize);
                if i > 0 {
                    take(i - 1, j, stack);
                }
                if i + 1 < width {
                    take(i + 1, j, stack);
                }
                if j > 0 {
                    take(i, j - 1, stack);
                }
                if j + 1 < height {
                    take(i, j + 1, stack);
                }
            }
        }
        n
    }
}

/// Returns the distance between lattice points, and between slices. [Units: wu]
fn lattice_step(grid: &Grid) -> f64 {
    grid.voxel.max(0.1)
}

/// Planes parallel to an opening, as lattices of points.
struct Slices<'a, F> {
    flooded: Flooded<'a>,
    cell_of: &'a F,
    /// Distance between points, and between slices. [Units: wu]
    step: f64,
    /// First point of the slice in the opening, then the steps along the rows, the columns, and to
    /// the next slice. [Units: vx]
    base: DVec3,
    along: [DVec3; 3],
    /// Number of points along both sides.
    side: [usize; 2],
    /// Points that lie in the opening.
    seeds: Vec<bool>,
    /// … as a list.
    opening: Vec<u32>,
    /// Points above the head of an upright opening: people are below it, so a beam or a lower ceiling alone makes no opening narrow.
    above: Vec<bool>,
}

impl<'a, F: Fn(u32) -> u32> Slices<'a, F> {
    fn beside(flooded: Flooded<'a>, surround: f64, front: &Front, cell_of: &'a F) -> Self {
        let (grid, opening) = (flooded.grid, &front.opening);
        let (u, v) = opening.plane.basis();
        let in_plane = |f: u64| {
            let p = face_center(grid, f) - opening.center;
            [u.dot(p), v.dot(p)]
        };
        let (mut lo, mut hi) = ([f64::MAX; 2], [f64::MIN; 2]);
        for &f in &front.faces {
            for (k, t) in in_plane(f).into_iter().enumerate() {
                lo[k] = lo[k].min(t);
                hi[k] = hi[k].max(t);
            }
        }
        flooded.allowance.spend(front.faces.len() as u64 / 4);
        let step = lattice_step(grid);
        let start = lo.map(|t| t - surround);
        let side =
            [0, 1].map(|k| (((hi[k] - lo[k] + 2.0 * surround) / step).ceil() as usize).max(1) + 1);
        let mut seeds = vec![false; side[0] * side[1]];
        for &f in &front.faces {
            let [x, y] = in_plane(f);
            let at = [x - start[0], y - start[1]].map(|t| (t / step).round() as usize);
            seeds[at[0].min(side[0] - 1) + at[1].min(side[1] - 1) * side[0]] = true;
        }
        let up = |i: usize| u.y * (i % side[0]) as f64 + v.y * (i / side[0]) as f64;
        let is_level = is_rather_level(opening.plane.normal);
        let head = (0..seeds.len()).filter(|&i| is_level || seeds[i]).map(up);
        let head = head.fold(f64::NEG_INFINITY, f64::max) + 0.5;
        let above = (0..seeds.len()).map(|i| up(i) > head).collect();
        Self {
            above,
            flooded,
            cell_of,
            step,
            base: grid.to_voxel(opening.center + u * start[0] + v * start[1]),
            along: [u, v, opening.plane.normal].map(|d| d * (step / grid.voxel)),
            side,
            opening: (0..seeds.len() as u32)
                .filter(|&k| seeds[k as usize])
                .collect(),
            seeds,
        }
    }

    fn jambs(&self, sides: &[Side; 2]) -> Jambs {
        let up = DVec3::from(self.along.map(|d| d.y)) * (self.flooded.grid.voxel / self.step);
        let is_beside = |k: usize| sides.iter().any(|side| side.beside[k]);
        Jambs::of(&self.seeds, self.side, [up.x, up.y], is_beside)
    }

    /// Returns a reader of the slice with this first point. [Units: vx]
    fn reader(&self, base: DVec3) -> SliceReader<'_, F> {
        let Flooded { grid, labels, .. } = self.flooded;
        SliceReader {
            reader: labels.reader(),
            cell_of: self.cell_of,
            base,
            along: [self.along[0], self.along[1]],
            end: DVec3::from(grid.dims.map(|n| n as f64)),
            last: (0, 0),
        }
    }
}

/// Reads the cells of points of one slice.
struct SliceReader<'a, F> {
    reader: Reader<'a>,
    cell_of: &'a F,
    base: DVec3,
    along: [DVec3; 2],
    end: DVec3,
    /// The basin read last, and its cell.
    last: (u32, u32),
}

impl<F: Fn(u32) -> u32> SliceReader<'_, F> {
    /// Returns the cell of a point; 0 in matter and beyond the grid.
    fn cell_at(&mut self, i: u32, j: u32) -> u32 {
        // In voxel coordinates, so that a lattice point costs two additions and a look-up.
        let p = self.base + self.along[1] * f64::from(j) + self.along[0] * f64::from(i);
        if !(p.cmpge(DVec3::ZERO).all() && p.cmplt(self.end).all()) {
            return 0;
        }
        // Positive, so the cast rounds down; and 32 bits are half the work of 64.
        let label = self.reader.at([p.x, p.y, p.z].map(|c| c as i32 as usize));
        if label != self.last.0 {
            self.last = (label, if label == 0 { 0 } else { (self.cell_of)(label) });
        }
        self.last.1
    }
}

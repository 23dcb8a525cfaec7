//! The search for deadlines, a step at a time.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use enfilade_cpg::{CellId, Pvs};

use super::ways::{Box3, Ways, gap};
use crate::Catalog;

/// Number of ways out of a cell above which they are bounded by straight lines from the eye alone, once, and not from each
/// portal that the cell is entered by: the square of the windows of a facade would be too much.
const MANY_WAYS: usize = 64;

/// Number of ways that get lengths in one step.
const WAYS_AT_ONCE: usize = 32;

/// Costs of steps in units of about a nanosecond, from `bench stream`.
const COST_OF_WAY: u32 = 12;
const COST_OF_CELL: u32 = 30;
const COST_OF_PIECE: u32 = 4;
const COST_OF_STEP: u32 = 25;

/// A cell with its deadline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Planned {
    pub(crate) cell: CellId,
    /// Least length of a way to a place from which it may be seen. [Units: wu]
    pub(crate) due: f32,
}

/// Cells in the order in which they are due, found as far as they are needed; a Dijkstra search over crossings. Those due at the
/// same time come by the distance of their boxes from the eye.
///
#[derive(Debug)]
pub(crate) struct Search {
    ways: Ways,
    pvs: Option<Pvs>,
    eye: Option<(CellId, [f32; 3])>,
    /// Number of the current search.
    pub(crate) stamp: u32,
    /// Cells found so far, in order.
    pub(crate) order: Vec<Planned>,
    is_over: bool,
    /// Bits of the cells that are in `order`, `group` or passed over.
    found: Vec<u64>,
    /// Bits of the cells that were entered.
    entered: Vec<u64>,
    /// For each crossing, the search in which `1` is its least length so far.
    least: Vec<(u32, f32)>,
    /// Crossings to pass, by length.
    waiting: BinaryHeap<Reverse<(u32, u32)>>,
    /// Cells due at the same time, by distance.
    group: BinaryHeap<Reverse<(u32, u32)>>,
    row: Row,
    entry: Entry,
    /// For each piece, the search in which `1` is its deadline.
    due: Vec<(u32, f32)>,
}

/// The part of the potentially visible set of a cell that is not yet looked at.
#[derive(Clone, Copy, Debug, Default)]
struct Row {
    /// The cell entered; one past the last for all cells that no way leads to.
    cell: u32,
    run: usize,
    /// First cell of the run that is not looked at; 0 for its start.
    next: u32,
    due: f32,
    is_open: bool,
    /// The cell last looked at, and the first of its pieces that has no deadline yet.
    marking: Option<(CellId, usize)>,
}

/// The entry of a cell, with the ways out of it that have no lengths yet.
#[derive(Clone, Debug, Default)]
struct Entry {
    ways: std::ops::Range<usize>,
    has_many: bool,
    by: Box3,
    length: f32,
}

impl Search {
    pub(crate) fn new(ways: Ways, pvs: Option<Pvs>, catalog: &Catalog) -> Self {
        let n_cells = ways.cells.len();
        let words = n_cells.div_ceil(64);
        Self {
            pvs,
            eye: None,
            stamp: 0,
            order: Vec::with_capacity(n_cells),
            is_over: true,
            found: vec![0; words],
            entered: vec![0; words],
            least: vec![(0, 0.0); ways.crossings.len()],
            waiting: BinaryHeap::with_capacity(ways.crossings.len()),
            group: BinaryHeap::with_capacity(n_cells),
            row: Row::default(),
            entry: Entry::default(),
            due: vec![(0, 0.0); catalog.pieces().len()],
            ways,
        }
    }

    /// Returns `true` if `order` holds all cells, or there is no eye.
    pub(crate) fn is_over(&self) -> bool {
        self.is_over
    }

    /// Returns the least way to a place from which a piece may be seen; `None` if no cell found so far needs it: it is due
    /// later than these. [Units: wu]
    pub(crate) fn due_of(&self, piece: usize) -> Option<f32> {
        let (stamp, due) = self.due[piece];
        (stamp == self.stamp && self.eye.is_some()).then_some(due)
    }

    /// Follows the eye. Returns `true` if the search starts anew: in another cell, or more than a step from the last start if
    /// `is_free`, and more than a few steps in any case. O(cells / 64).
    pub(crate) fn follow(
        &mut self,
        cell: Option<CellId>,
        at: [f32; 3],
        step: f32,
        is_free: bool,
    ) -> bool {
        let known = |c: &CellId| c.idx() < self.ways.cells.len();
        let Some(cell) = cell.filter(known) else {
            return false;
        };
        if !at.iter().all(|x| x.is_finite()) {
            return false;
        }
        if let Some((old, start)) = self.eye {
            let moved = gap(&[start, start], &[at, at]);
            let step = if is_free { step } else { 4.0 * step };
            if old == cell && moved <= step {
                return false;
            }
        }
        self.eye = Some((cell, at));
        self.stamp = self.stamp.wrapping_add(1);
        self.is_over = false;
        self.order.clear();
        self.found.fill(0);
        self.entered.fill(0);
        self.waiting.clear();
        self.group.clear();
        self.enter(cell, [at, at], 0.0);
        true
    }

    /// Finds further cells, as long as `work` lasts or until `order` grows.
    pub(crate) fn find(&mut self, catalog: &Catalog, work: &mut u32) {
        let before = self.order.len();
        while *work > 0 && self.order.len() == before && !self.is_over {
            if self.row.is_open {
                self.read_row(catalog, work);
            } else if let Some(Reverse((_, cell))) = self.group.pop() {
                *work = work.saturating_sub(COST_OF_STEP);
                self.order.push(Planned {
                    cell: CellId(cell),
                    due: self.row.due,
                });
            } else if !self.entry.ways.is_empty() {
                self.lead_out(work);
            } else if let Some(Reverse((length, crossing))) = self.waiting.pop() {
                *work = work.saturating_sub(COST_OF_STEP);
                self.pass(crossing as usize, f32::from_bits(length));
            } else if self.order.len() < self.ways.cells.len() {
                self.row = Row {
                    cell: self.ways.cells.len() as u32,
                    due: f32::INFINITY,
                    is_open: true,
                    ..Row::default()
                };
            } else {
                self.is_over = true;
            }
        }
    }

    /// Passes a crossing after the least way to it.
    fn pass(&mut self, crossing: usize, length: f32) {
        if self.least[crossing] == (self.stamp, length) {
            let way = self.ways.crossings[crossing];
            self.enter(CellId(way.to), way.into, length);
        } // else a shorter way to it was passed
    }

    /// Enters a cell by an opening: the ways out of it get lengths, and what may be seen from it becomes due.
    fn enter(&mut self, cell: CellId, by: Box3, length: f32) {
        let ways = self.ways.out_of(cell);
        let is_first = insert(&mut self.entered, cell.0);
        let has_many = ways.len() > MANY_WAYS;
        self.entry = Entry {
            ways: if is_first || !has_many { ways } else { 0..0 },
            has_many,
            by,
            length,
        };
        if is_first {
            self.row = Row {
                cell: cell.0,
                due: if self.pvs.is_some() { length } else { 0.0 },
                is_open: true,
                ..Row::default()
            };
        }
    }

    /// Gives lengths to some of the ways out of the cell entered.
    fn lead_out(&mut self, work: &mut u32) {
        let Some((_, eye)) = self.eye else { return };
        let Entry {
            has_many,
            by,
            length,
            ..
        } = self.entry;
        for i in self.entry.ways.by_ref().take(WAYS_AT_ONCE) {
            *work = work.saturating_sub(COST_OF_WAY);
            let out = &self.ways.crossings[i].out;
            let mut through = length;
            if !has_many {
                through += gap(&by, out);
            }
            if !self.ways.has_leads {
                through = through.max(gap(&[eye, eye], out));
            }
            let (stamp, least) = self.least[i];
            if stamp != self.stamp || through < least {
                self.least[i] = (self.stamp, through);
                self.waiting.push(Reverse((through.to_bits(), i as u32)));
            }
        }
    }

    /// Reads cells of the open row, one at a time, and its pieces as far as the work allows.
    fn read_row(&mut self, catalog: &Catalog, work: &mut u32) {
        if let Some((cell, first)) = self.row.marking {
            let rest = catalog.pieces_of(cell).get(first..).unwrap_or_default();
            let n = rest.len().min((*work / COST_OF_PIECE) as usize + 1);
            *work = work.saturating_sub(COST_OF_PIECE * n as u32);
            for piece in &rest[..n] {
                let due = &mut self.due[piece.idx()];
                if due.0 != self.stamp {
                    *due = (self.stamp, self.row.due);
                }
            }
            self.row.marking = (n < rest.len()).then_some((cell, first + n));
            return;
        }
        let n_cells = self.ways.cells.len() as u32;
        let own = [[self.row.cell, self.row.cell + 1]];
        let all = [[0, n_cells]];
        let runs = if self.row.cell == n_cells {
            &all[..]
        } else {
            match &self.pvs {
                Some(pvs) => pvs.runs_from(CellId(self.row.cell)),
                None => &own[..],
            }
        };
        let Some(&[first, end]) = runs.get(self.row.run) else {
            self.row.is_open = false;
            return;
        };
        let from = first.max(self.row.next);
        let word = from / 64;
        let stop = end.min((word + 1) * 64);
        let upto = |n: u32| if n >= 64 { u64::MAX } else { (1 << n) - 1 };
        let mask = upto(stop - word * 64) & !upto(from - word * 64);
        let new = mask & !self.found[word as usize];
        *work = work.saturating_sub(2);
        let Some((_, eye)) = self.eye else { return };
        if new != 0 {
            let bit = new.trailing_zeros();
            let cell = word * 64 + bit;
            self.found[word as usize] |= 1 << bit;
            let distance = gap(&[eye, eye], &self.ways.cells[cell as usize]);
            // A box may be empty: at an infinite distance.
            let key = if distance.is_nan() {
                f32::INFINITY
            } else {
                distance
            };
            self.group.push(Reverse((key.to_bits(), cell)));
            *work = work.saturating_sub(COST_OF_CELL);
            self.row.marking = Some((CellId(cell), 0));
            self.row.next = cell + 1;
            if new & (new - 1) != 0 {
                return;
            }
        }
        if stop == end {
            (self.row.run, self.row.next) = (self.row.run + 1, 0);
        } else {
            self.row.next = stop;
        }
    }
}

/// Sets a bit. Returns `true` if it was not set.
fn insert(bits: &mut [u64], i: u32) -> bool {
    let word = &mut bits[i as usize / 64];
    let bit = 1 << (i % 64);
    let is_new = *word & bit == 0;
    *word |= bit;
    is_new
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_cpg::{CellSet, World};
    use enfilade_geom::DVec3;
    use enfilade_testkit::{GridParams, Rng, room_grid, window_tower};

    /// Cells behind one portal count as visible.
    fn neighbors(world: &World) -> Pvs {
        let graph = &world.graph;
        let row = |cell| {
            let mut set = CellSet::new(graph.cells.len());
            set.insert(cell);
            for exit in graph.exits(cell) {
                set.insert(exit.to);
            }
            set
        };
        Pvs::of_rows(&graph.cell_ids().map(row).collect::<Vec<_>>())
    }

    fn search_of(world: &World, pvs: Option<Pvs>) -> Search {
        let rows = vec![Vec::new(); world.graph.cells.len()];
        Search::new(
            Ways::of(&world.graph, true),
            pvs,
            &Catalog::new(Vec::new(), &rows),
        )
    }

    /// Returns the deadline of each cell.
    fn dues(search: &mut Search, cell: CellId, at: [f32; 3]) -> Vec<f32> {
        search.follow(Some(cell), at, 0.0, true);
        let catalog = Catalog::new(Vec::new(), &vec![Vec::new(); search.ways.cells.len()]);
        while !search.is_over() {
            let mut work = 100;
            search.find(&catalog, &mut work);
        }
        assert!(search.order.windows(2).all(|w| w[0].due <= w[1].due));
        let mut dues = vec![f32::NAN; search.ways.cells.len()];
        for planned in &search.order {
            assert!(dues[planned.cell.idx()].is_nan(), "once each");
            dues[planned.cell.idx()] = planned.due;
        }
        assert!(dues.iter().all(|d| !d.is_nan()), "all cells");
        dues
    }

    // Covers W1.
    #[test]
    fn no_walk_gets_to_see_a_cell_before_its_deadline() {
        let mut n_late = 0;
        for seed in 0..20 {
            let world = match seed % 3 {
                // A facade and a core with more ways than are told apart.
                0 => window_tower(10, 4, false),
                _ => room_grid(&GridParams {
                    merges: 0.3,
                    ..GridParams::offices(40, seed)
                }),
            };
            let graph = &world.graph;
            let pvs = neighbors(&world);
            let mut search = search_of(&world, Some(pvs.clone()));
            let mut rng = Rng::new(seed);
            let point = |p: [f32; 3]| DVec3::from_array(p.map(f64::from));
            for _ in 0..20 {
                let mut cell = CellId(rng.below(graph.cells.len()) as u32);
                let [low, high] = graph[cell].aabb.map(point);
                let mut at = low + (high - low) * DVec3::new(rng.unit(), rng.unit(), rng.unit());
                let dues = dues(&mut search, cell, at.as_vec3().to_array());
                // From portal to portal, anywhere in each, straight through walls: no walk is shorter.
                let mut length = 0.0;
                for _ in 0..12 {
                    for seen in pvs.visible_from(cell) {
                        let due = f64::from(dues[seen.idx()]);
                        assert!(due <= length + 1e-3, "{seen} at {length}, due {due}");
                        n_late += usize::from(due > 0.0);
                    }
                    let exits: Vec<_> = graph.exits(cell).collect();
                    let exit = exits[rng.below(exits.len())];
                    let ring = &exit.portal.outline;
                    let (a, b) = (rng.below(ring.len()), rng.below(ring.len()));
                    let to = point(ring[a]).lerp(point(ring[b]), rng.unit());
                    length += at.distance(to);
                    (cell, at) = (exit.to, to);
                }
            }
        }
        assert!(n_late > 1000, "deadlines that are not now: {n_late}");
    }

    #[test]
    fn what_is_visible_now_is_due_now_and_the_rest_when_a_doorway_is_reached() {
        // Three rooms in a row: the third is seen from the second.
        let world = room_grid(&GridParams {
            size: [3, 1, 1],
            ..GridParams::two_rooms()
        });
        let mut search = search_of(&world, Some(neighbors(&world)));
        let doorway = world.graph.portals[0].center();
        let at = [doorway[0] - 2.0, doorway[1], doorway[2]];
        let found = dues(&mut search, CellId(0), at);
        assert_eq!(found[..2], [0.0, 0.0]);
        assert!((found[2] - 2.0).abs() < 1e-5, "{found:?}");
        // Without a potentially visible set, all are due now, nearest first.
        let mut search = search_of(&world, None);
        assert_eq!(dues(&mut search, CellId(2), at), [0.0; 3]);
        let order = search.order.iter().map(|p| p.cell.0);
        assert_eq!(order.collect::<Vec<_>>(), [2, 1, 0]);
    }

    #[test]
    fn a_search_starts_anew_where_the_eye_has_moved() {
        let world = room_grid(&GridParams::two_rooms());
        let mut search = search_of(&world, None);
        assert!(!search.follow(None, [0.0; 3], 1.0, true));
        assert!(!search.follow(Some(CellId(9)), [0.0; 3], 1.0, true));
        assert!(!search.follow(Some(CellId(0)), [f32::NAN; 3], 1.0, true));
        assert!(search.follow(Some(CellId(0)), [0.0; 3], 1.0, true));
        assert!(!search.follow(Some(CellId(0)), [0.9, 0.0, 0.0], 1.0, true));
        assert!(!search.follow(Some(CellId(0)), [3.9, 0.0, 0.0], 1.0, false));
        assert!(search.follow(Some(CellId(0)), [1.1, 0.0, 0.0], 1.0, true));
        assert!(search.follow(Some(CellId(1)), [1.1, 0.0, 0.0], 1.0, false));
        assert!(search.follow(Some(CellId(1)), [5.2, 0.0, 0.0], 1.0, false));
    }
}

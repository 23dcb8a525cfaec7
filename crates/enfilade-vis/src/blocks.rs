//! The search of a block of cells: in the part of the graph that lines from them might reach.
//!
//! Floods (`windows`) from the exits of the block's cells find that part, and bound what might be seen from each of
//! its openings. From there on it is searched like a graph of its own. A part with too many openings is avoided by
//! searching half of the block at a time; if a single cell sees that much, all that its floods reach counts as seen.

use std::ops::Range;
use std::sync::Mutex;

use enfilade_geom::{Bvh, DVec3, Triangle};
use rayon::prelude::*;

use crate::bits::{self, BitTable};
use crate::config::{VisContext, VisError, VisMode};
use crate::dirs::Dirs;
use crate::output::VisOutput;
use crate::plan::VisPlan;
use crate::rays::Blocker;
use crate::rows::{BlockRows, CellRow, Runs, runs_of, united};
use crate::search::{Rest, Scope, Search};
use crate::sheets::Sheets;
use crate::windows::Windows;

/// Floods whose results are put together before the size of a part is looked at again, at first and at most.
const FIRST_ROUND: usize = 16;
const ROUND: usize = 512;

/// Most directions in a part for each exit of its cells, and exits that count at least: a flood is needed for each.
const MOST_FOR_EXIT: usize = 8;
const LEAST_EXITS: usize = 64;

/// Progress that each block counts as.
const STEPS: u64 = 1000;

/// Triangles that block sight, prepared.
pub(crate) struct Walls<'a> {
    pub(crate) bvh: &'a Bvh,
    pub(crate) sheets: Sheets<'a>,
}

impl Walls<'_> {
    /// Returns the test whether a wall lies between two points.
    fn blocker(&self) -> impl Fn(DVec3, DVec3) -> bool + Sync + '_ {
        |a, b| self.bvh.any_hit(a, b, |_| false)
    }
}

/// The part of the graph in which a block is searched: for some directions, those that they might see.
struct Region {
    /// Directions, ascending, and their rows, ascending, of directions that are here.
    directions: Vec<u32>,
    rows: Vec<Vec<u32>>,
    /// Exits of the block's cells, ascending: their rows have all that they might see. Those of others leave out what
    /// no line from the block's cells crosses.
    sources: Vec<u32>,
}

impl VisPlan<'_> {
    /// Searches some blocks one after the other, and hands out each block's number, its bytes, and whether its search
    /// was complete. Returns `true` if all were.
    ///
    /// Once [`VisContext::on_round`] has stopped it, bytes are larger than necessary and not to be kept under the block's
    /// key; [`VisPlan::finish`] takes them, though. Complete ones are the same for any number of threads, which come
    /// from the current rayon pool.
    pub fn search(
        &self,
        blocks: &[usize],
        context: &mut VisContext<'_>,
        done: &mut dyn FnMut(usize, Vec<u8>, bool),
    ) -> bool {
        let triangles: Option<&[Triangle]> = context.walls;
        let bvh = triangles.map(Bvh::build);
        let walls = triangles.zip(bvh.as_ref()).map(|(triangles, bvh)| Walls {
            bvh,
            sheets: Sheets::new(triangles, bvh),
        });
        let mut is_complete = true;
        for (n_done, &block) in (0..).zip(blocks) {
            let total = STEPS * blocks.len() as u64;
            let on_round = &mut *context.on_round;
            let mut on_round = |done: u64, all: u64| {
                let share = u128::from(STEPS) * u128::from(done) / u128::from(all.max(1));
                on_round(STEPS * n_done + (share as u64).min(STEPS), total)
            };
            let (rows, is_done) = self.search_block(block, walls.as_ref(), &mut on_round);
            is_complete &= is_done;
            done(block, rows.encode(self.key(block)), is_done);
        }
        is_complete
    }

    /// Puts the answer together from the bytes of all blocks, in any order. It has no witnesses and no evidence, only
    /// the number of lines that prove pairs.
    ///
    /// # Errors
    ///
    /// Bytes that are damaged or no block's of this plan, and a block that is missing.
    pub fn finish(&self, blocks: &[Vec<u8>]) -> Result<VisOutput, VisError> {
        let refuse = |problem| VisError::Checkpoint { problem };
        let n_cells = self.graph.n_cells;
        let mut found: Vec<Option<BlockRows>> = vec![None; self.n_blocks()];
        let number = |bytes: &Vec<u8>| {
            let key = bytes.get(8..16)?;
            (0..self.n_blocks()).find(|&block| self.key(block).to_le_bytes() == key)
        };
        for bytes in blocks {
            let block = number(bytes).ok_or_else(|| refuse("a block is not of this search"))?;
            let rows = BlockRows::decode(bytes, self.key(block), &self.names(block), n_cells);
            found[block] = Some(rows.ok_or_else(|| refuse("a block is damaged"))?);
        }
        let found: Vec<BlockRows> = found
            .into_iter()
            .collect::<Option<_>>()
            .ok_or_else(|| refuse("a block is missing"))?;
        let mut rows: Vec<&CellRow> = found.iter().flat_map(|block| &block.rows).collect();
        rows.sort_unstable_by_key(|row| row.cell);
        let of = |runs: fn(&CellRow) -> &Runs| -> Vec<(u32, &Runs)> {
            rows.iter().map(|row| (row.cell, runs(row))).collect()
        };
        let sum = |count: fn(&BlockRows) -> u64| found.iter().map(count).sum::<u64>();
        Ok(VisOutput {
            cells: united(&of(|row| &row.seen), n_cells, true),
            undecided: united(&of(|row| &row.undecided), n_cells, false),
            witnesses: Vec::new(),
            n_lines: sum(|block| block.n_lines),
            is_complete: true,
            n_base: sum(|block| block.n_base) + self.dirs.n_alone(),
            n_steps: sum(|block| block.n_steps),
            evidence: None,
        })
    }

    /// Returns `true` if bytes are those of a block, undamaged.
    #[must_use]
    pub fn is_block(&self, block: usize, bytes: &[u8]) -> bool {
        let (names, n_cells) = (self.names(block), self.graph.n_cells);
        BlockRows::decode(bytes, self.key(block), &names, n_cells).is_some()
    }

    fn search_block(
        &self,
        block: usize,
        walls: Option<&Walls<'_>>,
        on_round: &mut (dyn FnMut(u64, u64) -> bool + Send),
    ) -> (BlockRows, bool) {
        let mut out = BlockRows::default();
        if self.is_whole {
            let is_complete = self.search_whole(walls, on_round, &mut out);
            return (out, is_complete);
        }
        let mut is_complete = true;
        let all = self.range(block);
        let mut left = vec![all.clone()];
        while let Some(ranks) = left.pop() {
            let mut on_round = |done: u64, total: u64| {
                let before = (ranks.start - all.start) as u64;
                let share = u128::from(done) * ranks.len() as u128 / u128::from(total.max(1));
                on_round(before + share as u64, all.len() as u64)
            };
            if let Some(part) = self.part(&ranks) {
                is_complete &= self.search_part(&ranks, &part, walls, &mut on_round, &mut out);
            } else if let Some([low, high]) = self.halves(&ranks) {
                left.extend([high, low]);
            } else {
                self.bound(&ranks, &mut out);
            }
        }
        out.rows.sort_unstable_by_key(|row| row.cell);
        (out, is_complete)
    }

    /// Returns the part of the graph that lines from some cells might reach; `None` if it is too large.
    fn part(&self, ranks: &Range<usize>) -> Option<Region> {
        let dirs = &self.dirs;
        let exits = self.cells(ranks.clone()).iter();
        let mut sources: Vec<u32> = exits
            .flat_map(|&c| dirs.exits(c))
            .map(|d| d as u32)
            .collect();
        sources.sort_unstable();
        let mut is_here = vec![0; dirs.len().div_ceil(64)];
        sources
            .iter()
            .for_each(|&d| bits::set(&mut is_here, d as usize));
        let most = MOST_FOR_EXIT * sources.len().max(LEAST_EXITS);
        let most = self.most_directions.min(most);
        let mut rows = self.rows(&sources, &mut is_here, true, most)?;
        let others: Vec<u32> = bits::ones(&is_here)
            .map(|d| d as u32)
            .filter(|d| sources.binary_search(d).is_err())
            .collect();
        let others_rows = self.rows(&others, &mut is_here, false, most)?;
        let mut all: Vec<(u32, Vec<u32>)> = sources.iter().copied().zip(rows.drain(..)).collect();
        all.extend(others.into_iter().zip(others_rows));
        all.sort_unstable_by_key(|row| row.0);
        let (directions, rows) = all.into_iter().unzip();
        Some(Region {
            directions,
            rows,
            sources,
        })
    }

    /// Returns what each of some directions might see; `None` if that is too much. Directions that are seen are added
    /// to `is_here`, up to `most`, if it `grows`; if not, only those in it count.
    fn rows(
        &self,
        sources: &[u32],
        is_here: &mut [u64],
        grows: bool,
        most: usize,
    ) -> Option<Vec<Vec<u32>>> {
        let dirs = &self.dirs;
        let ground = self.ground();
        // Rows take no more memory than a table of the directions.
        let most_entries = self.most_directions * self.most_directions / 32;
        let mut n_entries = 0;
        let spare: Mutex<Vec<Windows>> = Mutex::new(Vec::new());
        let mut rows = Vec::with_capacity(sources.len());
        let mut n_round = FIRST_ROUND;
        let mut left = sources;
        while !left.is_empty() {
            let (round, rest) = left.split_at(n_round.min(left.len()));
            left = rest;
            n_round = (2 * n_round).min(ROUND);
            let here = &*is_here;
            let flood = |windows: &mut Windows, source: u32| {
                let allows = |d: usize| grows || bits::get(here, d);
                windows.flood(&ground, source as usize, most, allows)
            };
            let found: Option<Vec<Vec<Vec<u32>>>> = round
                .par_chunks(16)
                .map(|sources| {
                    // Buffers are as large as the graph.
                    let kept = spare.lock().ok().and_then(|mut spare| spare.pop());
                    let mut windows = kept.unwrap_or_else(|| Windows::new(dirs));
                    let rows = sources.iter().map(|&source| flood(&mut windows, source));
                    let rows = rows.collect();
                    if let Ok(mut spare) = spare.lock() {
                        spare.push(windows);
                    }
                    rows
                })
                .collect();
            let found: Vec<Vec<u32>> = found?.into_iter().flatten().collect();
            for &d in found.iter().flatten() {
                bits::set(is_here, d as usize);
            }
            n_entries += found.iter().map(Vec::len).sum::<usize>();
            if bits::count(is_here) > most || n_entries > most_entries {
                return None;
            }
            rows.extend(found);
        }
        Some(rows)
    }

    /// Searches the part of the graph around some cells, and adds their rows.
    fn search_part(
        &self,
        ranks: &Range<usize>,
        part: &Region,
        walls: Option<&Walls<'_>>,
        on_round: &mut (dyn FnMut(u64, u64) -> bool + Send),
        out: &mut BlockRows,
    ) -> bool {
        let config = self.config;
        let id = |&d: &u32| self.dirs.all[d as usize].id / 2;
        let mut portals: Vec<u32> = part.directions.iter().map(id).collect();
        portals.sort_unstable();
        portals.dedup();
        let dirs = Dirs::of_some(self.graph, portals, self.dirs.scale);
        let might = part.table(&self.dirs, &dirs);
        let scope = self.scope(ranks, &dirs);
        let is_blocked = walls.map(Walls::blocker);
        let blocker = is_blocked.as_ref().map(|f| f as Blocker<'_>);
        let clearance = self.ground().tolerance.clearance;
        let table = (might, Some(scope));
        let search = Search::within(&dirs, table.0, table.1, clearance, config.far, blocker);
        out.n_base += search.n_pairs();
        self.finish_search(search, walls, on_round, out)
    }

    /// Searches a graph that is a single block, as [`see_all`](crate::see_all) does, and adds its rows.
    fn search_whole(
        &self,
        walls: Option<&Walls<'_>>,
        on_round: &mut (dyn FnMut(u64, u64) -> bool + Send),
        out: &mut BlockRows,
    ) -> bool {
        let is_blocked = walls.map(Walls::blocker);
        let blocker = is_blocked.as_ref().map(|f| f as Blocker<'_>);
        let clearance = self.ground().tolerance.clearance;
        let mut search = Search::new(&self.dirs, clearance, self.config.far, blocker);
        out.n_base += search.n_pairs();
        search.narrow();
        self.finish_search(search, walls, on_round, out)
    }

    /// Runs the stages of a search from lines on, and adds its rows.
    fn finish_search(
        &self,
        mut search: Search<'_>,
        walls: Option<&Walls<'_>>,
        on_round: &mut (dyn FnMut(u64, u64) -> bool + Send),
        out: &mut BlockRows,
    ) -> bool {
        let (config, dirs) = (self.config, search.dirs);
        search.cast(config.n_rays);
        search.grow();
        let is_complete = config.mode == VisMode::Fast || {
            let rest = search.all_openings();
            let on_round = |_: &Search<'_>, rest: &Rest| on_round(rest.done, rest.total);
            search.run(config.max_pieces, rest, on_round)
        };
        if config.mode == VisMode::Exact
            && is_complete
            && let Some(walls) = walls
        {
            search.settle_inside(&walls.sheets, self.clearance, on_round);
        }
        out.n_steps += search.effort.steps;
        out.n_lines += search.lines.len() as u64;
        let visible = search.visible();
        for a in (0..dirs.n_cells).filter(|&a| search.is_source(a)) {
            let name = |b: usize| dirs.cells[b];
            let is_undecided = |&b: &usize| !search.seen.get(a, b) || search.undecided.get(a, b);
            let seen = || bits::ones(visible.row(a));
            out.rows.push(CellRow {
                cell: name(a),
                seen: runs_of(seen().map(name)),
                undecided: runs_of(seen().filter(is_undecided).map(name)),
            });
        }
        is_complete
    }

    /// Returns what a search from some cells is asked for; `dirs` are those of their part of the graph.
    fn scope(&self, ranks: &Range<usize>, dirs: &Dirs) -> Scope {
        let n = dirs.n_cells;
        let mut scope = Scope {
            sources: vec![0; n.div_ceil(64)],
            targets: vec![0; n.div_ceil(64)],
        };
        // Both lists ascend.
        let cells = &self.dirs.cells;
        for (a, &name) in dirs.cells.iter().enumerate() {
            let cell = cells.partition_point(|&c| c < name) as u32;
            if self.is_in(ranks, cell) {
                bits::set(&mut scope.sources, a);
            }
            if self.owns(ranks, cell) {
                bits::set(&mut scope.targets, a);
            }
        }
        scope
    }

    /// Adds the row of a single cell that sees too much: all that the floods reach.
    fn bound(&self, ranks: &Range<usize>, out: &mut BlockRows) {
        let dirs = &self.dirs;
        let ground = self.ground();
        let cell = self.cells(ranks.clone())[0];
        let exits: Vec<usize> = dirs.exits(cell).collect();
        let n_words = dirs.n_cells.div_ceil(64);
        let mut cells = vec![0u64; n_words];
        bits::set(&mut cells, cell as usize);
        for round in exits.chunks(ROUND) {
            let reached = round
                .par_iter()
                .with_min_len(16)
                .fold(
                    || (Windows::new(dirs), vec![0u64; n_words]),
                    |(mut windows, mut cells), &exit| {
                        bits::set(&mut cells, dirs.all[exit].to as usize);
                        let all = windows.flood(&ground, exit, usize::MAX, |_| true);
                        for d in all.into_iter().flatten() {
                            bits::set(&mut cells, dirs.all[d as usize].to as usize);
                        }
                        (windows, cells)
                    },
                )
                .map(|(_, cells)| cells)
                .reduce(
                    || vec![0; n_words],
                    |mut a, b| {
                        bits::unite(&mut a, &b);
                        a
                    },
                );
            bits::unite(&mut cells, &reached);
        }
        let owned = |&b: &usize| self.owns(ranks, b as u32);
        let name = |b: usize| dirs.cells[b];
        let seen = || bits::ones(&cells).filter(owned);
        out.n_base += 2 * seen().count() as u64 - 1;
        out.rows.push(CellRow {
            cell: name(cell as usize),
            seen: runs_of(seen().map(name)),
            undecided: runs_of(seen().filter(|&b| b != cell as usize).map(name)),
        });
    }
}

impl Region {
    /// Returns the rows as a table of the directions of a part of the graph. Those of directions without a row are what
    /// others say of the way back.
    fn table(&self, whole: &Dirs, dirs: &Dirs) -> BitTable {
        // Directions of both are in the same order, so those of the part are numbered by rank.
        let mut kept: Vec<u32> = (self.directions.iter())
            .flat_map(|&d| [d, whole.reverse[d as usize]])
            .collect();
        kept.sort_unstable();
        kept.dedup();
        let place = |d: u32| kept.partition_point(|&k| k < d);
        let whole_row = |d: u32| {
            self.sources.binary_search(&d).ok()?;
            self.directions.binary_search(&d).ok()
        };
        let n = dirs.len();
        let mut table = BitTable::new(n, n);
        for (&from, row) in self.directions.iter().zip(&self.rows) {
            let (a, back) = (place(from), whole.reverse[from as usize]);
            for &to in row {
                let opposite = whole.reverse[to as usize];
                let says = whole_row(opposite).map(|i| self.rows[i].binary_search(&back).is_ok());
                let (b, c) = (place(to), place(opposite));
                if says != Some(false) {
                    table.set(a, b);
                    table.set(c, dirs.reverse[a] as usize);
                }
            }
        }
        table
    }
}

#[cfg(test)]
mod tests;

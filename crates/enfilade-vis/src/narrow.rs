//! Bounds of what might be seen through two consecutive openings.
//!
//! This step comes between the flood over sides of planes and the search. It is cheap and saves the search most of
//! its work: the planes that separate an opening from each of its next ones bound everything behind both. (The Quake
//! tools go straight to the search.)

use fearless_simd::{Level, Simd, dispatch};
use rayon::prelude::*;

use crate::bits::{self, BitTable};
use crate::clip::Arena;
use crate::dirs::{Dirs, Next};
use crate::flow::{back_of, facing, front_of};
use crate::planes::{FacedOutline, Four, admits, pack, separators};
use crate::search::Search;
use crate::tolerance::Tolerance;

/// Openings per round; see [`crate::search`].
const ROUND: usize = 128;

/// Clears from `might` everything that no line through two consecutive openings can reach.
///
/// Starts with the openings that might see least; the others use the results. Time: openings times their next ones
/// times the openings that those might see.
pub(crate) fn narrow_might(
    dirs: &Dirs,
    might: &mut BitTable,
    settled: &mut BitTable,
    tolerance: &Tolerance,
) {
    let mut order: Vec<(usize, usize)> = (0..dirs.len())
        .map(|d| (bits::count(might.row(d)), d))
        .collect();
    order.sort_unstable();
    let mut next = Next::new(dirs, might);
    for round in order.chunks(ROUND) {
        let rows: Vec<Vec<u64>> = round
            .par_iter()
            .with_max_len(4)
            .map_init(Work::default, |work, &(_, source)| {
                work.narrow(dirs, might, &next, tolerance, source)
            })
            .collect();
        for (&(_, source), row) in round.iter().zip(rows) {
            let both = might.row(source).iter().zip(&row);
            let gone: Vec<u64> = both.map(|(&might, &left)| might & !left).collect();
            next.hide(dirs, might, source, &gone);
            bits::unite(settled.row_mut(source), &gone);
        }
    }
}

impl Search<'_> {
    /// Does [`narrow_might`] for the search's own tables.
    pub(crate) fn narrow(&mut self) {
        narrow_might(
            self.dirs,
            &mut self.might,
            &mut self.settled,
            &self.tolerance,
        );
    }
}

#[derive(Default)]
struct Work {
    arena: Arena,
    planes: Vec<Four>,
    allowed: Vec<u64>,
    reached: Vec<u64>,
    stack: Vec<u32>,
}

impl Work {
    fn narrow(
        &mut self,
        dirs: &Dirs,
        might: &BitTable,
        ahead: &Next,
        tolerance: &Tolerance,
        source: usize,
    ) -> Vec<u64> {
        let mut row = vec![0; might.n_words()];
        let back = dirs.reverse[source] as usize;
        for pass in dirs.after(source) {
            if pass == back || !might.get(source, pass) {
                continue;
            }
            self.arena.release(0);
            let first = self.arena.push(dirs.winding(source), source as u32);
            let second = self.arena.push(dirs.winding(pass), pass as u32);
            let (turn, next_turn) = (dirs.all[source].turn, dirs.all[pass].turn);
            let front = front_of(dirs, source as u32);
            let Some(second) = self.arena.clip(second, front, next_turn, tolerance) else {
                continue;
            };
            let behind = back_of(dirs, pass);
            let Some(first) = self.arena.clip(first, behind, turn, tolerance) else {
                continue;
            };
            self.planes.clear();
            separators(
                FacedOutline::new(self.arena.get(first), facing(dirs, source as u32)),
                FacedOutline::new(self.arena.get(second), facing(dirs, pass as u32)),
                tolerance,
                &mut self.planes,
            );
            pack(&mut self.planes, tolerance);
            self.flood(dirs, might, ahead, tolerance, (source, pass));
            bits::unite(&mut row, &self.reached);
        }
        row
    }

    /// Collects the openings behind `pass` that lie in front of all planes.
    fn flood(
        &mut self,
        dirs: &Dirs,
        might: &BitTable,
        ahead: &Next,
        tolerance: &Tolerance,
        ends: (usize, usize),
    ) {
        dispatch!(Level::new(), simd => self.flood_by(simd, dirs,might, ahead, tolerance, ends));
    }

    #[inline(always)]
    fn flood_by<S: Simd>(
        &mut self,
        simd: S,
        dirs: &Dirs,
        might: &BitTable,
        ahead: &Next,
        tolerance: &Tolerance,
        (source, pass): (usize, usize),
    ) {
        self.reached.clear();
        self.reached.resize(might.n_words(), 0);
        bits::set(&mut self.reached, pass);
        self.stack.push(pass as u32);
        self.allowed.clear();
        let rows = might.row(source).iter().zip(might.row(pass));
        self.allowed.extend(rows.map(|(a, b)| a & b));
        while let Some(at) = self.stack.pop() {
            let at = at as usize;
            let exits = dirs.after(at);
            for start in exits.clone().step_by(64) {
                let window =
                    ahead.window(might, at, &exits, start) & bits::window(&self.allowed, start);
                bits::clear_window(&mut self.allowed, start, window);
                // A loop, as a closure would not be compiled for the processor that `simd` stands for.
                let mut rest = window;
                while rest != 0 {
                    let q = start + rest.trailing_zeros() as usize;
                    rest &= rest - 1;
                    if admits(simd, &self.planes, dirs, q, tolerance) {
                        bits::set(&mut self.reached, q);
                        self.stack.push(q as u32);
                    }
                }
            }
        }
    }
}

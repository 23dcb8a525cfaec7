//! Floors as few rectangles, for programs that take meshes.

use std::collections::BTreeMap;

use enfilade_cpg::CellId;
use enfilade_geom::DVec3;

use super::floors::Floors;
use super::walk_map::WalkMap;
use crate::space::PartId;

/// Heights this close are one level: thinner than any threshold. [Units: wu]
const LEVEL: f64 = 1e-3;

/// A level rectangle on which the middle of a walker may stand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkPatch {
    /// The cell in which that walker is.
    pub cell: CellId,
    /// Least vertex, in the frame of the part. [Units: wu]
    pub low: DVec3,
    /// Greatest vertex, of the same height. [Units: wu]
    pub high: DVec3,
}

impl WalkMap {
    /// Returns the floors of a part as level rectangles, by cell and from below; they do not overlap. Stairs are steps, and a ramp is
    /// one of each square's width. O(n log n) for n floors.
    ///
    /// # Panics
    ///
    /// If there is no such part.
    #[must_use]
    pub fn patches(&self, part: PartId) -> Vec<WalkPatch> {
        self.parts[part.idx()].floors.patches()
    }
}

impl Floors {
    fn patches(&self) -> Vec<WalkPatch> {
        let squares = self.squares();
        // Numbers of squares, row by row, of each level of each cell.
        let mut levels: BTreeMap<(CellId, i64), Vec<u32>> = BTreeMap::new();
        for floor in self.floors.iter().filter(|f| !f.is_edge) {
            let level = (f64::from(floor.y) / LEVEL).round() as i64;
            let own = levels.entry((floor.cell, level)).or_default();
            own.push(floor.square);
        }
        let mut patches = Vec::new();
        for ((cell, level), mut own) in levels {
            own.sort_unstable();
            let at = |[x, z]: [u32; 2]| {
                let [x, z] = [x, z].map(f64::from);
                let [ox, oz] = squares.origin;
                DVec3::new(
                    ox + x * squares.side,
                    level as f64 * LEVEL,
                    oz + z * squares.side,
                )
            };
            patches.extend(
                rectangles(&own, squares.n[0] as u32).map(|[low, high]| WalkPatch {
                    cell,
                    low: at(low),
                    high: at(high),
                }),
            );
        }
        patches
    }
}

/// Returns rectangles of squares: runs of a row, continued through the rows after it that have the same. `squares` ascend. The first
/// square, and the one after the last, as x and z.
fn rectangles(squares: &[u32], n_x: u32) -> impl Iterator<Item = [[u32; 2]; 2]> {
    let is_run = |a: &u32, b: &u32| b - a == 1 && !b.is_multiple_of(n_x);
    // Rows that reach down to here, the first and the one after the last, by their first x and the one after the last.
    let mut growing: BTreeMap<[u32; 2], [u32; 2]> = BTreeMap::new();
    let mut found = Vec::new();
    for run in squares.chunk_by(is_run) {
        let (x, z) = (run[0] % n_x, run[0] / n_x);
        let key = [x, x + run.len() as u32];
        if let Some(rows) = growing.get_mut(&key)
            && rows[1] == z
        {
            rows[1] += 1;
        } else if let Some([from, to]) = growing.insert(key, [z, z + 1]) {
            found.push([[key[0], from], [key[1], to]]);
        }
    }
    found.extend(
        growing
            .into_iter()
            .map(|([x, end], [from, to])| [[x, from], [end, to]]),
    );
    found.into_iter()
}

#[cfg(test)]
mod tests {
    use super::rectangles;

    #[test]
    fn rectangles_cover_each_square_once() {
        // Rows of eight: an L, a lone square, and a row that ends where the next begins.
        let squares = [0, 1, 2, 8, 9, 10, 16, 17, 21, 39, 40];
        let mut covered = Vec::new();
        let found: Vec<_> = rectangles(&squares, 8).collect();
        for [[x0, z0], [x1, z1]] in &found {
            for z in *z0..*z1 {
                covered.extend((*x0..*x1).map(|x| z * 8 + x));
            }
        }
        covered.sort_unstable();
        assert_eq!(covered, squares);
        // Three columns of two rows, two squares below, and three alone.
        assert_eq!(found.len(), 5);
    }
}

//! Parts of each cell that may be seen from each other cell: convex volumes, triangles and objects.
//!
//! After Dirkse 2002, section 7.4 (source and destination clipped along the sequence of portals) and 7.6.2 (objects
//! by cell). We differ in the index: results are kept by pair of cells, so that a reader needs only the eye's cell
//! and the cell it looks into.
//!
//! There is one row for each pair, in the order of [`Pvs::pairs`](crate::Pvs::pairs).

/// Numbering of a world's parts: the triangles of all batches in order, then the detail objects.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PartNumbers {
    /// For each batch the number of its first triangle, then the number of all triangles.
    pub(crate) first: Vec<u32>,
    pub(crate) n_details: u32,
}

impl PartNumbers {
    /// Returns the numbers of a batch's triangles.
    ///
    /// # Panics
    ///
    /// If the batch does not exist.
    #[must_use]
    pub fn of_batch(&self, batch: usize) -> std::ops::Range<u32> {
        self.first[batch]..self.first[batch + 1]
    }

    /// Returns the number of a detail object.
    #[must_use]
    pub fn of_detail(&self, detail: u32) -> u32 {
        self.n_triangles() + detail
    }

    /// Returns the number of triangles of all batches, which is also the number of the first detail object.
    #[must_use]
    pub fn n_triangles(&self) -> u32 {
        self.first.last().copied().unwrap_or(0)
    }

    /// Returns the number of all parts.
    #[must_use]
    pub fn n_parts(&self) -> u32 {
        self.n_triangles().saturating_add(self.n_details)
    }
}

/// For each pair of cells, the parts of the second ([`PartNumbers`]) that may be seen from somewhere in the first
/// with all portals open. A superset of the truth.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct VisibleParts {
    /// For each pair, the end of its runs in `runs`.
    pub(crate) ends: Vec<u32>,
    /// First part and one past the last; in each row ascending, with gaps between runs.
    pub(crate) runs: Vec<[u32; 2]>,
}

impl VisibleParts {
    /// Makes the table from rows of parts, each ascending without duplicates. Takes no more memory than the resulting
    /// runs.
    #[doc(hidden)]
    pub fn of_ascending<R: IntoIterator<Item = u32>>(rows: impl IntoIterator<Item = R>) -> Self {
        let mut out = Self::default();
        for row in rows {
            let first = out.runs.len();
            for part in row {
                match out.runs[first..].last_mut() {
                    Some(run) if run[1] == part => run[1] += 1,
                    _ => out.runs.push([part, part + 1]),
                }
            }
            out.ends.push(out.runs.len() as u32);
        }
        out
    }

    /// Makes the table from rows of runs as [`VisibleParts::runs_of`] has them; `ends` holds the end of each row in `runs`.
    /// `None` if a run is empty or touches the one before it in its row, or a part is not below `n_parts`.
    #[must_use]
    #[doc(hidden)]
    pub fn of_runs(ends: Vec<u32>, runs: Vec<[u32; 2]>, n_parts: u32) -> Option<Self> {
        let (n_pairs, out) = (ends.len(), Self { ends, runs });
        out.problem(n_pairs, n_parts).is_none().then_some(out)
    }

    /// Returns the number of rows.
    #[must_use]
    pub fn n_pairs(&self) -> usize {
        self.ends.len()
    }

    /// Returns the parts that a pair sees as runs, end excluded; ascending, with gaps between runs. Empty for a pair
    /// that does not exist.
    #[must_use]
    pub fn runs_of(&self, pair: usize) -> &[[u32; 2]] {
        row(&self.ends, &self.runs, pair)
    }

    /// Returns the number of batch triangles and of detail objects that a pair sees. O(runs).
    #[must_use]
    pub fn count(&self, pair: usize, numbers: &PartNumbers) -> [usize; 2] {
        let split = numbers.n_triangles();
        let runs = self.runs_of(pair).iter();
        runs.fold([0, 0], |[triangles, details], &[a, b]| {
            let below = b.min(split).saturating_sub(a) as usize;
            [triangles + below, details + (b - a) as usize - below]
        })
    }

    /// Returns the first pair whose row breaks an invariant, and the problem. Linear.
    pub(crate) fn problem(&self, n_pairs: usize, n_parts: u32) -> Option<(usize, &'static str)> {
        if let Some(found) = ends_problem(&self.ends, n_pairs, self.runs.len()) {
            return Some(found);
        }
        (0..n_pairs).find_map(|pair| {
            let row = self.runs_of(pair);
            let is_run = |run: &[u32; 2]| run[0] < run[1] && run[1] <= n_parts;
            let is_good = row.iter().all(is_run) && row.windows(2).all(|w| w[0][1] < w[1][0]);
            (!is_good).then_some((
                pair,
                "its runs must hold existing parts, ascending, with gaps between runs",
            ))
        })
    }
}

/// For each pair of cells, the *potentially visible volume*: nothing of the second outside of it is seen from
/// anywhere in the first with all portals open. A union of convex pieces, each bounded by planes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VisibleVolumes {
    /// For each pair, the end of its pieces in `piece_ends`.
    pub(crate) ends: Vec<u32>,
    /// For each piece, the end of its planes in `planes`.
    pub(crate) piece_ends: Vec<u32>,
    /// Unit normal and offset: each point of the piece has `n·p + d >= 0` for all its planes.
    pub(crate) planes: Vec<[f64; 4]>,
}

impl VisibleVolumes {
    /// Most pieces of a pair.
    pub const MAX_PIECES: usize = 64;
    /// Most planes of a piece.
    pub const MAX_PLANES: usize = 1024;

    /// Makes the table from the volumes of pairs in order, each a list of pieces, each a list of planes.
    #[must_use]
    #[doc(hidden)]
    pub fn of_pairs(pairs: impl IntoIterator<Item = Vec<Vec<[f64; 4]>>>) -> Self {
        let mut out = Self::default();
        for pair in pairs {
            for piece in pair {
                out.planes.extend(piece);
                out.piece_ends.push(out.planes.len() as u32);
            }
            out.ends.push(out.piece_ends.len() as u32);
        }
        out
    }

    /// Returns the number of pairs.
    #[must_use]
    pub fn n_pairs(&self) -> usize {
        self.ends.len()
    }

    /// Returns the number of pieces of all pairs.
    #[must_use]
    pub fn n_pieces(&self) -> usize {
        self.piece_ends.len()
    }

    /// Returns the pieces of a pair, each as planes `[nx, ny, nz, d]`: inside, `n·p + d >= 0`. A piece without planes
    /// is the whole cell. Empty for a pair that does not exist.
    pub fn pieces_of(&self, pair: usize) -> impl Iterator<Item = &[[f64; 4]]> + Clone + '_ {
        let end = self.ends.get(pair).map_or(0, |&e| e as usize);
        let start = pair.checked_sub(1).and_then(|p| self.ends.get(p));
        let start = start.map_or(0, |&e| e as usize).min(end);
        (start..end).map(|piece| row(&self.piece_ends, &self.planes, piece))
    }

    /// Returns the first pair whose pieces break an invariant, and the problem. Linear.
    pub(crate) fn problem(&self, n_pairs: usize) -> Option<(usize, &'static str)> {
        if let Some(found) = ends_problem(&self.ends, n_pairs, self.piece_ends.len()) {
            return Some(found);
        }
        let n_pieces = self.piece_ends.len();
        if let Some((_, problem)) = ends_problem(&self.piece_ends, n_pieces, self.planes.len()) {
            return Some((n_pairs, problem));
        }
        let is_plane = |p: &[f64; 4]| {
            let length = p[0].hypot(p[1]).hypot(p[2]);
            p[3].is_finite() && (length - 1.0).abs() < 1e-6
        };
        (0..n_pairs).find_map(|pair| {
            if self.pieces_of(pair).count() > Self::MAX_PIECES {
                return Some((pair, "it has more pieces than the limit"));
            }
            let is_good =
                |piece: &[[f64; 4]]| piece.len() <= Self::MAX_PLANES && piece.iter().all(is_plane);
            let is_broken = !self.pieces_of(pair).all(is_good);
            is_broken.then_some((
                pair,
                "its planes must have unit normals and stay within the limit",
            ))
        })
    }
}

/// Returns a row of a table of rows; empty for one that does not exist.
fn row<'a, T>(ends: &[u32], items: &'a [T], i: usize) -> &'a [T] {
    let Some(&end) = ends.get(i) else {
        return &[];
    };
    let first = i.checked_sub(1).map_or(0, |before| ends[before]);
    items.get(first as usize..end as usize).unwrap_or_default()
}

/// Returns the first row that does not lie behind the one before it within the list, and the problem.
fn ends_problem(ends: &[u32], n_rows: usize, n_items: usize) -> Option<(usize, &'static str)> {
    if ends.len() != n_rows {
        return Some((
            0,
            "there must be a row for each pair of cells that see each other",
        ));
    }
    let mut first = 0;
    for (i, &end) in ends.iter().enumerate() {
        if end < first || end as usize > n_items {
            return Some((i, "its row must lie within the list"));
        }
        first = end;
    }
    (first as usize != n_items).then_some((n_rows, "some items belong to no row"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_come_back_pair_by_pair() {
        let parts = VisibleParts::of_ascending([vec![0, 1, 4, 6], vec![], vec![2, 3, 5]]);
        assert_eq!(parts.problem(3, 7), None);
        assert_eq!(parts.runs_of(0), [[0, 2], [4, 5], [6, 7]]);
        assert!(parts.runs_of(1).is_empty() && parts.runs_of(9).is_empty());
        assert_eq!(parts.runs_of(2), [[2, 4], [5, 6]]);
        let numbers = PartNumbers {
            first: vec![0, 3, 5],
            n_details: 2,
        };
        assert_eq!(numbers.of_batch(1), 3..5);
        assert_eq!((numbers.of_detail(1), numbers.n_parts()), (6, 7));
        assert_eq!(
            [0, 1, 2].map(|p| parts.count(p, &numbers)),
            [[3, 1], [0, 0], [2, 1]]
        );
    }

    #[test]
    fn broken_parts_are_found() {
        let good = VisibleParts::of_ascending([vec![0, 2], vec![1]]);
        let broken = |change: &dyn Fn(&mut VisibleParts)| {
            let mut parts = good.clone();
            change(&mut parts);
            parts.problem(2, 3).map(|p| p.0)
        };
        assert_eq!(broken(&|_| {}), None);
        let runs = |n| VisibleParts::of_runs(good.ends.clone(), good.runs.clone(), n);
        assert_eq!((runs(3), runs(2)), (Some(good.clone()), None));
        assert_eq!(good.problem(3, 3).map(|p| p.0), Some(0));
        assert_eq!(good.problem(2, 2).map(|p| p.0), Some(0));
        assert_eq!(broken(&|p| p.ends[0] = 9), Some(0));
        assert_eq!(broken(&|p| p.ends[1] = 1), Some(1));
        assert_eq!(broken(&|p| p.runs[1] = [1, 3]), Some(0));
        assert_eq!(broken(&|p| p.runs[2] = [2, 2]), Some(1));
        assert_eq!(broken(&|p| p.runs.push([0, 1])), Some(2));
    }

    #[test]
    fn volumes_come_back_piece_by_piece_and_broken_ones_are_found() {
        let (x, y) = ([1.0, 0.0, 0.0, 2.0], [0.0, 1.0, 0.0, -1.0]);
        let good = VisibleVolumes::of_pairs([vec![vec![]], vec![vec![x, y], vec![y]]]);
        assert_eq!(good.problem(2), None);
        assert_eq!((good.n_pairs(), good.n_pieces()), (2, 3));
        assert!(good.pieces_of(0).eq([&[] as &[[f64; 4]]]));
        assert!(good.pieces_of(1).eq([&[x, y][..], &[y]]));
        assert_eq!(good.pieces_of(2).count(), 0);
        let broken = |change: &dyn Fn(&mut VisibleVolumes)| {
            let mut volumes = good.clone();
            change(&mut volumes);
            volumes.problem(2).map(|p| p.0)
        };
        assert_eq!(broken(&|v| v.planes[0][0] = 0.5), Some(1));
        assert_eq!(broken(&|v| v.planes[2][3] = f64::NAN), Some(1));
        assert_eq!(broken(&|v| v.piece_ends[0] = 7), Some(2));
        assert_eq!(broken(&|v| v.ends[0] = 4), Some(0));
        assert_eq!(broken(&|v| v.planes.push(x)), Some(2));
    }
}

//! Connected components of set voxels, and flooding from seeds.
//!
//! Runs of set voxels along x are the nodes; a union-find joins each with the runs that it touches in
//! the rows before it (He, Chao and Suzuki, "A Run-Based Two-Scan Labeling Algorithm", 2008, in three
//! dimensions). The least run of a component is its root, so labels come out in scan order.

use std::ops::Range;

use enfilade_geom::Sets;
use rayon::prelude::*;

use super::grid::{BitVolume, for_runs, set_bits};
use super::labels::Labels;

/// Adjacency of voxels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Connectivity {
    /// Voxels that share a face.
    Faces6,
    /// Voxels that share a face, an edge or a vertex.
    Corners26,
}

/// Connected components as dense labels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Components {
    /// Label of each voxel: 0 if clear, otherwise `1..=n_components`, numbered by each component's first
    /// voxel in index order.
    pub labels: Vec<u32>,
    /// Number of components.
    pub n_components: u32,
}

/// A maximal run `from..to` of set voxels of one row.
#[derive(Clone, Copy)]
struct Run {
    from: u32,
    to: u32,
}

/// All runs, and the component of each as the index of its least run.
struct Runs {
    runs: Vec<Run>,
    /// First run of each row, and the number of runs at the end.
    rows: Vec<u32>,
    root: Vec<u32>,
}

/// Labels the connected components of the set voxels.
///
/// Linear in voxels (for the labels) plus runs. Takes 4 bytes per voxel for the labels, 12 bytes per run
/// and 4 bytes per row.
///
/// # Panics
/// If there are 2³² runs or more.
#[must_use]
pub fn components(set: &BitVolume, connectivity: Connectivity) -> Components {
    let [nx, ..] = set.dims();
    let mut labels = vec![0u32; set.n_voxels()];
    if labels.is_empty() {
        return Components {
            labels,
            n_components: 0,
        };
    }
    let Runs {
        runs,
        rows,
        mut root,
    } = connected_runs(set, connectivity);
    let mut n_components = 0;
    for run in 0..root.len() {
        root[run] = if root[run] as usize == run {
            n_components += 1;
            n_components
        } else {
            // The root is a lesser run, so it already has its label.
            root[root[run] as usize]
        };
    }
    labels
        .par_chunks_mut(nx)
        .enumerate()
        .with_min_len(64)
        .for_each(|(row, labels)| {
            for at in rows[row] as usize..rows[row + 1] as usize {
                labels[runs[at].from as usize..runs[at].to as usize].fill(root[at]);
            }
        });
    Components {
        labels,
        n_components,
    }
}

/// Returns the voxels of `set` connected by a path of set voxels to one in `seeds`.
///
/// Ignores seeds that are not set. Linear in runs and rows; takes one bit per voxel for the answer and the
/// scratch memory of [`components`].
///
/// # Panics
/// If the boxes differ in size, or there are 2³² runs or more.
#[must_use]
pub fn flood(set: &BitVolume, seeds: &BitVolume, connectivity: Connectivity) -> BitVolume {
    assert_eq!(set.dims(), seeds.dims(), "boxes of one size");
    let mut out = BitVolume::new(set.dims());
    if out.words().is_empty() {
        return out;
    }
    let Runs { runs, rows, root } = connected_runs(set, connectivity);
    let mut wet = vec![false; runs.len()];
    for row in 0..rows.len() - 1 {
        let bits = seeds.row(row);
        for at in rows[row] as usize..rows[row + 1] as usize {
            let root = root[at] as usize;
            wet[root] = wet[root] || any_bit(bits, runs[at]);
        }
    }
    let per_row = out.row_words();
    out.words_mut()
        .par_chunks_mut(per_row)
        .enumerate()
        .with_min_len(64)
        .for_each(|(row, words)| {
            for at in rows[row] as usize..rows[row + 1] as usize {
                if wet[root[at] as usize] {
                    set_bits(words, runs[at].from as usize, runs[at].to as usize);
                }
            }
        });
    out
}

/// Divides the voxels whose label is not 0 into connected sets of labels that are `alike`, an equivalence, and labels each set by
/// `name(label)` of the least label in it, which is called once for each set, in the order of their first voxels.
///
/// Linear in runs of labels along x, which take 20 bytes each.
///
/// # Panics
/// If there are 2³² runs or more.
#[must_use]
pub fn connected_labels(
    labels: &Labels,
    alike: impl Fn(u32, u32) -> bool,
    mut name: impl FnMut(u32) -> u32,
) -> Labels {
    let [nx, ny, nz] = labels.dims();
    let (mut runs, mut of_run, mut rows) = (Vec::new(), Vec::new(), vec![0]);
    for row in 0..ny * nz {
        labels.for_runs(row * nx..(row + 1) * nx, |run, label| {
            if label != 0 {
                let [from, to] = [run.start, run.end].map(|v| (v - row * nx) as u32);
                runs.push(Run { from, to });
                of_run.push(label);
            }
        });
        rows.push(u32::try_from(runs.len()).expect("fewer than 2^32 runs"));
    }
    let mut sets = Sets::new(runs.len());
    let is_alike = |a: usize, b: usize| alike(of_run[a], of_run[b]);
    let span = |row: usize| rows[row] as usize..rows[row + 1] as usize;
    for row in 0..ny * nz {
        for at in span(row).skip(1) {
            if runs[at - 1].to == runs[at].from && is_alike(at - 1, at) {
                sets.join(at as u32 - 1, at as u32);
            }
        }
        for (is_there, before) in [(row % ny.max(1) > 0, 1), (row >= ny, ny)] {
            if is_there {
                join(
                    &runs,
                    &mut sets,
                    (span(row - before), span(row)),
                    0,
                    is_alike,
                );
            }
        }
    }
    let root = sets.into_least();
    let mut least = of_run.clone();
    for (&root, &label) in root.iter().zip(&of_run) {
        let least = &mut least[root as usize];
        *least = label.min(*least);
    }
    for run in 0..root.len() {
        of_run[run] = match root[run] as usize {
            root if root == run => name(least[run]),
            // A lesser run, so it has its name.
            root => of_run[root],
        };
    }
    Labels::filled(labels.dims(), |z, layers| {
        for (row, labels) in (z * ny..).zip(layers.chunks_mut(nx)) {
            for at in span(row) {
                labels[runs[at].from as usize..runs[at].to as usize].fill(of_run[at]);
            }
        }
    })
}

fn any_bit(row: &[u64], run: Run) -> bool {
    let (from, last) = (run.from as usize, run.to as usize - 1);
    let (head, tail) = (!0u64 << (from % 64), !0u64 >> (63 - last % 64));
    (from / 64..=last / 64).any(|w| {
        let mut mask = !0;
        if w == from / 64 {
            mask &= head;
        }
        if w == last / 64 {
            mask &= tail;
        }
        row[w] & mask != 0
    })
}

fn connected_runs(set: &BitVolume, connectivity: Connectivity) -> Runs {
    let [_, ny, nz] = set.dims();
    let mut runs = Vec::new();
    let mut rows = Vec::with_capacity(ny * nz + 1);
    rows.push(0);
    for row in 0..ny * nz {
        for_runs(set.row(row), |from, to| runs.push(Run { from, to }));
        rows.push(u32::try_from(runs.len()).expect("fewer than 2^32 runs"));
    }
    let mut sets = Sets::new(runs.len());
    let all = |_: usize, _: usize| true;
    let span = |row: usize| rows[row] as usize..rows[row + 1] as usize;
    for row in 0..ny * nz {
        let y = row % ny;
        match connectivity {
            Connectivity::Faces6 => {
                if y > 0 {
                    join(&runs, &mut sets, (span(row - 1), span(row)), 0, all);
                }
                if row >= ny {
                    join(&runs, &mut sets, (span(row - ny), span(row)), 0, all);
                }
            }
            Connectivity::Corners26 => {
                if y > 0 {
                    join(&runs, &mut sets, (span(row - 1), span(row)), 1, all);
                }
                if row >= ny {
                    let below = row - ny;
                    for other in below - usize::from(y > 0)..=below + usize::from(y + 1 < ny) {
                        join(&runs, &mut sets, (span(other), span(row)), 1, all);
                    }
                }
            }
        }
    }
    Runs {
        runs,
        rows,
        root: sets.into_least(),
    }
}

/// Joins the runs of two rows that overlap if each is widened by `reach`, and that are alike.
fn join(
    runs: &[Run],
    sets: &mut Sets,
    (before, here): (Range<usize>, Range<usize>),
    reach: u32,
    is_alike: impl Fn(usize, usize) -> bool,
) {
    let (mut a, mut b) = (before.start, here.start);
    while a < before.end && b < here.end {
        let (p, q) = (runs[a], runs[b]);
        if p.to + reach <= q.from {
            a += 1;
        } else if q.to + reach <= p.from {
            b += 1;
        } else {
            if is_alike(a, b) {
                sets.join(a as u32, b as u32);
            }
            // The run that ends first touches nothing further on: the next run of the other row
            // leaves a gap of at least a voxel, or begins where it ends.
            if p.to < q.to {
                a += 1;
            } else {
                b += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Depth-first search, voxel by voxel.
    fn oracle(set: &BitVolume, corners: bool) -> (Vec<u32>, u32) {
        let dims = set.dims().map(|n| n as isize);
        let at = |x: isize, y: isize, z: isize| (x + dims[0] * (y + dims[1] * z)) as usize;
        let mut labels = vec![0; set.n_voxels()];
        let mut n = 0;
        for start in set.iter_set() {
            if labels[start] != 0 {
                continue;
            }
            n += 1;
            let mut open = vec![start];
            labels[start] = n;
            while let Some(v) = open.pop() {
                let v = v as isize;
                let p = [v % dims[0], v / dims[0] % dims[1], v / dims[0] / dims[1]];
                for d in 0..27 {
                    let d = [d % 3 - 1, d / 3 % 3 - 1, d / 9 - 1];
                    let steps = d.iter().filter(|&&c| c != 0).count();
                    let q = [p[0] + d[0], p[1] + d[1], p[2] + d[2]];
                    if steps == 0
                        || (!corners && steps > 1)
                        || (0..3).any(|a| q[a] < 0 || q[a] >= dims[a])
                    {
                        continue;
                    }
                    let i = at(q[0], q[1], q[2]);
                    if set.get_index(i) && labels[i] == 0 {
                        labels[i] = n;
                        open.push(i);
                    }
                }
            }
        }
        (labels, n)
    }

    fn noise(dims: [usize; 3], seed: u64, density: u64) -> BitVolume {
        BitVolume::from_fn(dims, |i| {
            let mut s = (i as u64 ^ seed).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            s ^= s >> 32;
            s.wrapping_mul(0xD6E8_FEB8_6659_FD93) >> 60 < density
        })
    }

    proptest! {
        #[test]
        fn labels_that_are_alike_connect(
            dims in [1..9_usize, 1..7, 1..7],
            seed in proptest::collection::vec(0..4_u32, 9 * 7 * 7),
        ) {
            let n: usize = dims.iter().product();
            let labels = &seed[..n];
            let mut leasts = Vec::new();
            let name = |least| {
                leasts.push(least);
                leasts.len() as u32
            };
            let of = Labels::of(dims, labels);
            let connected = connected_labels(&of, |a, b| a == b || a.max(b) < 3, name);
            let oracles = [1..=2, 3..=3].map(|class| {
                let set = BitVolume::from_fn(dims, |i| class.contains(&labels[i]));
                oracle(&set, false).0
            });
            let mut known: Vec<[u32; 2]> = Vec::new();
            let expected: Vec<u32> = (0..n).map(|i| {
                let set = [oracles[0][i], oracles[1][i]];
                if set == [0; 2] {
                    return 0;
                }
                let at = known.iter().position(|&k| k == set);
                at.unwrap_or_else(|| {
                    known.push(set);
                    known.len() - 1
                }) as u32 + 1
            }).collect();
            prop_assert_eq!(connected.iter().collect::<Vec<_>>(), expected.clone());
            for (set, least) in (1..).zip(leasts) {
                let within = labels.iter().zip(&expected).filter(|l| *l.1 == set);
                prop_assert_eq!(within.map(|l| *l.0).min(), Some(least));
            }
        }

        #[test]
        fn labels_are_those_of_a_depth_first_search(
            nx in 1usize..75, ny in 1usize..8, nz in 1usize..8, seed in any::<u64>(), density in 1u64..15,
        ) {
            let set = noise([nx, ny, nz], seed, density);
            for (connectivity, corners) in [(Connectivity::Faces6, false), (Connectivity::Corners26, true)] {
                let (labels, n) = oracle(&set, corners);
                let ours = components(&set, connectivity);
                prop_assert_eq!(ours.n_components, n);
                prop_assert_eq!(&ours.labels, &labels);

                let seeds = noise([nx, ny, nz], seed ^ 77, 1);
                let wet: std::collections::BTreeSet<u32> =
                    seeds.iter_set().map(|i| labels[i]).filter(|&l| l > 0).collect();
                let expected = BitVolume::from_fn([nx, ny, nz], |i| wet.contains(&labels[i]));
                prop_assert_eq!(flood(&set, &seeds, connectivity), expected);
            }
        }
    }

    #[test]
    fn empty_boxes_have_no_components() {
        let empty = BitVolume::new([0, 4, 4]);
        assert_eq!(components(&empty, Connectivity::Faces6).n_components, 0);
        assert_eq!(flood(&empty, &empty, Connectivity::Faces6), empty);
    }
}

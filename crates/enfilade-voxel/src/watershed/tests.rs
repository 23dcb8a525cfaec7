use std::collections::BTreeMap;

use super::*;
use crate::distance_squared;
use proptest::prelude::*;

fn plain_neighbors(dims: [usize; 3], v: usize) -> impl Iterator<Item = usize> {
    let p = [v % dims[0], v / dims[0] % dims[1], v / dims[0] / dims[1]];
    let stride = [1, dims[0], dims[0] * dims[1]];
    (0..3).flat_map(move |a| {
        let down = (p[a] > 0).then(|| v - stride[a]);
        let up = (p[a] + 1 < dims[a]).then(|| v + stride[a]);
        down.into_iter().chain(up)
    })
}

fn level(squared: u16) -> u32 {
    (f64::from(squared).sqrt() * 64.0).floor() as u32
}

/// Greatest level at which a path from `from` to each voxel can stay, relaxed to a fixpoint.
fn widest_paths(dims: [usize; 3], levels: &[u32], from: usize) -> Vec<u32> {
    let mut best = vec![0; levels.len()];
    best[from] = levels[from];
    loop {
        let mut changed = false;
        for v in 0..levels.len() {
            for q in plain_neighbors(dims, v) {
                let through = best[q].min(levels[v]);
                if through > best[v] {
                    best[v] = through;
                    changed = true;
                }
            }
        }
        if !changed {
            return best;
        }
    }
}

/// The same between basins, along recorded saddles.
fn widest_between(n: usize, saddles: &[Saddle], from: u32) -> Vec<f64> {
    let mut best = vec![0.0; n + 1];
    best[from as usize] = f64::INFINITY;
    for _ in 0..n {
        for s in saddles {
            let (a, b) = (s.a as usize, s.b as usize);
            best[b] = f64::max(best[b], s.distance.min(best[a]));
            best[a] = f64::max(best[a], s.distance.min(best[b]));
        }
    }
    best
}

/// Checks all invariants of a watershed, for any field.
fn check(dims: [usize; 3], squared: &[u16], h: f64, outdoors: Option<&BitVolume>) -> Watershed {
    let w = watershed(
        dims,
        squared.to_vec(),
        &WatershedOptions {
            h,
            outdoors: outdoors.cloned(),
        },
        &Allowance::default(),
    );
    let levels: Vec<u32> = squared.iter().map(|&d| level(d)).collect();
    let labels: Vec<u32> = w.labels.iter().collect();
    let n = w.basins.len();

    // Labels: 0 exactly where occupied, every basin used, sizes right, outdoors kept.
    let mut sizes = vec![0u64; n + 1];
    for v in 0..labels.len() {
        assert_eq!(labels[v] == 0, squared[v] == 0, "voxel {v}");
        sizes[labels[v] as usize] += 1;
        if outdoors.is_some_and(|o| o.get_index(v)) && squared[v] != 0 {
            assert_eq!(labels[v], 1);
        }
    }
    let real = usize::from(outdoors.is_some());
    for (i, b) in w.basins.iter().enumerate() {
        assert_eq!(b.n_voxels, sizes[i + 1]);
        if i < real {
            assert_eq!(b.peak, f64::INFINITY);
            continue;
        }
        // Peaks: the deepest voxel of the basin, deepest basin first.
        let deepest = (0..labels.len())
            .filter(|&v| labels[v] == i as u32 + 1)
            .map(|v| levels[v])
            .max();
        assert_eq!(Some((b.peak * 64.0) as u32), deepest);
        assert_eq!(labels[b.peak_voxel], i as u32 + 1);
        assert_eq!(levels[b.peak_voxel], (b.peak * 64.0) as u32);
        if i > real {
            let before = &w.basins[i - 1];
            assert!(
                before.peak > b.peak || (before.peak == b.peak && before.peak_voxel < b.peak_voxel)
            );
        }
        // Connected by an ascending path: every voxel is reached from the peak inside the basin.
        let mut seen = vec![false; labels.len()];
        let mut open = vec![b.peak_voxel];
        seen[b.peak_voxel] = true;
        let mut reached = 0;
        while let Some(v) = open.pop() {
            reached += 1;
            for q in plain_neighbors(dims, v) {
                if !seen[q] && labels[q] == i as u32 + 1 {
                    seen[q] = true;
                    open.push(q);
                }
            }
        }
        assert_eq!(reached, b.n_voxels, "basin {} is in pieces", i + 1);
    }

    // Saddles: exactly the touching pairs, with their highest contact and their faces.
    let mut touching: BTreeMap<(u32, u32), (u32, u64)> = BTreeMap::new();
    for v in 0..labels.len() {
        for q in plain_neighbors(dims, v).filter(|&q| q > v) {
            if labels[v] != 0 && labels[q] != 0 && labels[v] != labels[q] {
                let pair = (labels[v].min(labels[q]), labels[v].max(labels[q]));
                let e = touching.entry(pair).or_default();
                e.0 = e.0.max(levels[v].min(levels[q]));
                e.1 += 1;
            }
        }
    }
    assert_eq!(w.saddles.len(), touching.len());
    for s in &w.saddles {
        let (top, faces) = touching[&(s.a, s.b)];
        assert_eq!(
            ((s.distance * 64.0) as u32, s.n_faces),
            (top, faces),
            "{s:?}"
        );
        assert_eq!(levels[s.voxel], top);
        let sides = [labels[s.voxel]]
            .into_iter()
            .chain(plain_neighbors(dims, s.voxel).map(|q| labels[q]));
        let sides: Vec<u32> = sides.collect();
        assert!(
            (sides[0] == s.a && sides.contains(&s.b)) || (sides[0] == s.b && sides.contains(&s.a))
        );
    }
    for pair in w.saddles.windows(2) {
        assert!(pair[0].distance >= pair[1].distance);
    }

    // The saddles keep the field's passes: between any two peaks, the widest path along saddles is
    // as wide as the widest path through voxels; and no basin is shallower than h.
    if outdoors.is_none() {
        for (i, b) in w.basins.iter().enumerate() {
            let wide = widest_paths(dims, &levels, b.peak_voxel);
            let along = widest_between(n, &w.saddles, i as u32 + 1);
            for (j, c) in w.basins.iter().enumerate().filter(|&(j, _)| j != i) {
                assert_eq!(
                    f64::from(wide[c.peak_voxel]) / 64.0,
                    along[j + 1],
                    "{i} to {j}"
                );
                let lower = b.peak.min(c.peak);
                assert!(along[j + 1] == 0.0 || lower - along[j + 1] >= h);
            }
        }
    }

    // Dams: one side of every contact.
    let dams = mark_dams(dims, &w.labels);
    for v in 0..labels.len() {
        let expected = labels[v] != 0
            && plain_neighbors(dims, v).any(|q| labels[q] != 0 && labels[q] < labels[v]);
        assert_eq!(dams.get_index(v), expected);
    }
    w
}

/// Voxels that must have a basin by the definition of dynamics: every path to a higher voxel, or to an
/// equally high one earlier in the scan, descends by `h` or more, and by one level at least.
fn significant_peaks(dims: [usize; 3], squared: &[u16], h: f64) -> Vec<usize> {
    let levels: Vec<u32> = squared.iter().map(|&d| level(d)).collect();
    let mut order: Vec<usize> = (0..levels.len()).filter(|&v| levels[v] > 0).collect();
    order.sort_by_key(|&v| (std::cmp::Reverse(levels[v]), v));
    let deserves = |&(at, &v): &(usize, &usize)| {
        let wide = widest_paths(dims, &levels, v);
        order[..at].iter().all(|&u| {
            let down = levels[v] - wide[u];
            wide[u] == 0 || (down > 0 && f64::from(down) / 64.0 >= h)
        })
    };
    order
        .iter()
        .enumerate()
        .filter(deserves)
        .map(|(_, &v)| v)
        .collect()
}

fn noise(n: usize, seed: u64, values: u64) -> impl Iterator<Item = u64> {
    let mut s = seed | 1;
    (0..n).map(move |_| {
        s ^= s << 13;
        s ^= s >> 7;
        s ^= s << 17;
        (s >> 33) % values
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]
    // Covers V3 and V9.
    /// `base` brings levels close together: above 1,000 they differ by 1 and 2, above 60,000 most
    /// neighbors are level.
    #[test]
    fn any_field_is_flooded_soundly(
        nx in 1usize..8, ny in 1usize..6, nz in 1usize..6,
        seed in any::<u64>(), values in 2u64..40, base in prop_oneof![Just(0), Just(1_000), Just(60_000)],
        h in prop_oneof![Just(0.0), 0.0..1.0, Just(1e9)], inside in any::<bool>(),
    ) {
        let dims = [nx, ny, nz];
        let squared: Vec<u16> = noise(nx * ny * nz, seed, values)
            .map(|v| if v == 0 { 0 } else { base + v as u16 })
            .collect();
        let h = h * if base == 0 { 4.0 } else { 0.3 };
        let outdoors = BitVolume::from_fn(dims, |v| v % nx == 0);
        check(dims, &squared, h, inside.then_some(&outdoors));
        let w = check(dims, &squared, h, None);
        let peaks: Vec<usize> = w.basins.iter().map(|b| b.peak_voxel).collect();
        prop_assert_eq!(peaks, significant_peaks(dims, &squared, h));
    }
}

proptest! {
    // The oracles take cubic time.
    #![proptest_config(ProptestConfig::with_cases(96))]
    #[test]
    fn distance_fields_are_flooded_soundly(
        nx in 1usize..16, ny in 1usize..8, nz in 1usize..8, seed in any::<u64>(), h in 0.0..1.5,
    ) {
        let dims = [nx, ny, nz];
        let occupied: Vec<bool> = noise(nx * ny * nz, seed, 40).map(|v| v == 0).collect();
        let squared = distance_squared(&BitVolume::from_fn(dims, |v| occupied[v]), &Allowance::default());
        check(dims, &squared, h, None);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    /// Wide plateaus, which slabs cut.
    #[test]
    fn slabs_of_any_thickness_give_the_same(
        nx in 1usize..12, ny in 1usize..6, nz in 1usize..30, seed in any::<u64>(), values in 2u64..6,
        h in 0.0..1.0, inside in any::<bool>(),
    ) {
        let dims = [nx, ny, nz];
        let squared: Vec<u16> = noise(nx * ny * nz, seed, values).map(|v| v as u16).collect();
        let outdoors = inside.then(|| BitVolume::from_fn(dims, |v| v % nx == 0));
        let options = WatershedOptions { h, outdoors };
        let by = |thick| watershed_by(thick, dims, squared.clone(), &options, &Allowance::default());
        let edge = crate::labels::EDGE;
        let whole = by(nz.next_multiple_of(edge));
        for thick in (edge..nz).step_by(edge) {
            prop_assert_eq!(&by(thick), &whole, "slabs of {} layers", thick);
        }
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let (dims, occupied) = two_rooms();
    let run = |n| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(n)
            .build()
            .unwrap();
        pool.install(|| {
            let w = watershed(
                dims,
                distance_squared(&occupied, &Allowance::default()),
                &WatershedOptions::default(),
                &Allowance::default(),
            );
            let dams = mark_dams(dims, &w.labels);
            (w, dams)
        })
    };
    assert_eq!(run(1), run(5));
}

/// Two rooms of different height, joined by a doorway, in a wall all around.
fn two_rooms() -> ([usize; 3], BitVolume) {
    let dims = [41, 21, 17];
    let occupied = BitVolume::from_fn(dims, |v| {
        let [x, y, z] = [v % 41, v / 41 % 21, v / 41 / 21];
        let west = (1..20).contains(&x) && (1..20).contains(&y) && (1..16).contains(&z);
        let east = (23..40).contains(&x) && (1..20).contains(&y) && (1..12).contains(&z);
        let door = (20..23).contains(&x) && (8..13).contains(&y) && (1..9).contains(&z);
        !(west || east || door)
    });
    (dims, occupied)
}

#[test]
fn a_doorway_separates_two_rooms() {
    let (dims, occupied) = two_rooms();
    let w = check(
        dims,
        &distance_squared(&occupied, &Allowance::default()),
        1.0,
        None,
    );
    let peaks: Vec<f64> = w.basins.iter().map(|b| b.peak).collect();
    assert_eq!(peaks, [8.0, 6.0]);
    assert_eq!((w.saddles.len(), w.saddles[0].distance), (1, 3.0));
    // The doorway is 5 x 8 voxels; the dam stands in it.
    assert_eq!(w.saddles[0].n_faces, 40);
    assert!((20..23).contains(&(w.saddles[0].voxel % 41)));
    // The shallow room's dynamics are 3: above that threshold both rooms are one.
    assert_eq!(
        check(
            dims,
            &distance_squared(&occupied, &Allowance::default()),
            3.0,
            None
        )
        .basins
        .len(),
        2
    );
    assert_eq!(
        check(
            dims,
            &distance_squared(&occupied, &Allowance::default()),
            3.01,
            None
        )
        .basins
        .len(),
        1
    );
}

#[test]
fn outdoors_takes_the_space_around_it() {
    let (dims, occupied) = two_rooms();
    let mut outdoors = BitVolume::new(dims);
    outdoors.set(31, 10, 6, true);
    let w = check(
        dims,
        &distance_squared(&occupied, &Allowance::default()),
        1.0,
        Some(&outdoors),
    );
    assert_eq!(w.basins.len(), 2);
    assert_eq!(
        (w.basins[0].peak, w.basins[0].peak_voxel),
        (f64::INFINITY, 31 + 41 * (10 + 21 * 6))
    );
    // The east room is part of outdoors, the west room is a basin.
    assert_eq!(w.labels.get(25 + 41 * (3 + 21 * 2)), 1);
    assert_eq!((w.basins[1].peak, w.saddles[0].distance), (8.0, 3.0));
    // Seeded on its slope, outdoors does not take a basin deeper by h; with a greater h it does.
    let mut slope = BitVolume::new(dims);
    slope.set(38, 10, 6, true);
    assert_eq!(
        check(
            dims,
            &distance_squared(&occupied, &Allowance::default()),
            1.0,
            Some(&slope)
        )
        .basins
        .len(),
        3
    );
    assert_eq!(
        check(
            dims,
            &distance_squared(&occupied, &Allowance::default()),
            4.5,
            Some(&slope)
        )
        .basins
        .len(),
        2
    );
}

#[test]
fn empty_and_full_boxes_have_no_basins() {
    for dims in [[0, 4, 4], [4, 0, 4], [4, 4, 0]] {
        let empty = SparseVolume::of(&BitVolume::new(dims));
        let field = DistanceField::of(&empty, &empty, &Allowance::default());
        let flood = field.watershed(1.0, &Allowance::default());
        assert_eq!(flood, Watershed::unflooded(dims));
    }
    for (dims, value, n) in [([0, 3, 3], 0, 0), ([3, 4, 5], 0, 0), ([3, 4, 5], 65535, 1)] {
        let w = check(dims, &vec![value; dims.iter().product()], 1.0, None);
        assert_eq!((w.basins.len(), w.saddles.len()), (n, 0));
    }
}

/// A checkerboard of single free voxels at 1 and 2, each a basin or joined, more than 14 bits of them.
fn many_basins(dims: [usize; 3], h: f64) -> Watershed {
    let squared: Vec<u16> = (0..dims.iter().product::<usize>())
        .map(|v| {
            if (v % dims[0] + v / dims[0] % dims[1] + v / dims[0] / dims[1]).is_multiple_of(2) {
                4
            } else {
                1
            }
        })
        .collect();
    watershed(
        dims,
        squared,
        &WatershedOptions { h, outdoors: None },
        &Allowance::default(),
    )
}

#[test]
fn numbers_run_out_and_are_found_again() {
    let dims = [60, 40, 20];
    // All 24,000 maxima stay.
    let all = many_basins(dims, 1.0);
    assert_eq!(all.basins.len(), 24_000);
    assert_eq!(all.basins.iter().map(|b| b.n_voxels).sum::<u64>(), 48_000);
    // Only one stays.
    let one = many_basins(dims, 1.5);
    assert_eq!(one.basins.len(), 1);
    assert_eq!(one.basins[0].n_voxels, 48_000);
    // More basins than words of 16 bits can number.
    let wide = many_basins([80, 60, 30], 1.0);
    assert_eq!(wide.basins.len(), 72_000);
}

/// Hills of decreasing height, each merging into the one before on contact: 20,000 numbers are used up over
/// many levels with few alive, so they are reused.
#[test]
fn renumbering_changes_nothing() {
    let dims = [40_000, 1, 1];
    let hills: Vec<u16> = (0..dims[0])
        .map(|x| 45_000 - (x / 2) as u16 - 40 * (x % 2) as u16)
        .collect();
    let w = watershed(
        dims,
        hills.clone(),
        &WatershedOptions {
            h: 0.5,
            outdoors: None,
        },
        &Allowance::default(),
    );
    assert_eq!((w.basins.len(), w.basins[0].n_voxels), (1, 40_000));
    let w = watershed(
        dims,
        hills,
        &WatershedOptions {
            h: 0.0,
            outdoors: None,
        },
        &Allowance::default(),
    );
    assert_eq!((w.basins.len(), w.saddles.len()), (20_000, 19_999));
}

#[test]
fn the_widest_place_of_each_block_is_that_of_its_voxels() {
    let dims = [7, 5, 9];
    let blocked = BitVolume::from_fn(dims, |v| v % 11 == 0);
    let allowance = Allowance::default();
    let squared = distance_squared(&blocked, &allowance);
    let field = DistanceField::of(
        &SparseVolume::of(&blocked),
        &SparseVolume::of(&BitVolume::new(dims)),
        &allowance,
    );
    let mut widest = field.widest_of_blocks();
    for edge in [2, 4] {
        assert_eq!(widest.dims, dims.map(|n| n.div_ceil(edge)));
        let mut most = vec![0.0_f64; widest.dims.iter().product()];
        for (v, &d) in squared.iter().enumerate() {
            let at = [v % 7, v / 7 % 5, v / 35].map(|c| c / edge);
            let of = &mut most[at[0] + widest.dims[0] * (at[1] + widest.dims[1] * at[2])];
            *of = of.max(f64::from(level(d)) / 64.0);
        }
        for (block, most) in most.into_iter().enumerate() {
            assert_eq!(widest.distance(block), most, "{block}");
        }
        widest = widest.coarser();
    }
}

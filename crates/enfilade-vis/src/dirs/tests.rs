use enfilade_cpg::SightPortal;

use super::*;
use crate::rng::Rng;

/// A chain of cells joined by random triangles, or as many cells around one. Some triangles lie in one plane,
/// some a hair from another's.
fn random_dirs(seed: u64, n_portals: usize, is_star: bool) -> Dirs {
    let mut rng = Rng::new(seed);
    let mut portals = Vec::new();
    for cell in 0..n_portals {
        let mut point = || DVec3::new(rng.unit(), rng.unit(), rng.unit()) * 8.0;
        let mut winding = vec![point(), point(), point()];
        if cell % 3 == 0 {
            winding.iter_mut().for_each(|p| p.z = p.z.round());
        }
        if cell % 4 == 1 {
            let last: &SightPortal = &portals[cell - 1];
            let shift = [0.0, 1e-8, 1e-7, -1e-7][rng.below(4)];
            winding = last.winding.iter().map(|&p| p + DVec3::Z * shift).collect();
        }
        portals.push(SightPortal {
            cells: [if is_star { 0 } else { cell as u32 }, cell as u32 + 1],
            winding,
            pieces: Vec::new(),
        });
    }
    Dirs::new(&SightGraph {
        n_cells: n_portals as u32 + 1,
        portals,
    })
}

#[test]
fn balls_say_of_sides_what_corners_say() {
    for seed in 0..50 {
        let dirs = random_dirs(seed, 40, false);
        let mut of_id = vec![0u32; dirs.len()];
        for (d, dir) in dirs.all.iter().enumerate() {
            of_id[dir.id as usize] = d as u32;
        }
        for d in 0..dirs.len() {
            let turn = dirs.all[d].turn;
            let heights: Vec<[f64; 2]> = (0..dirs.len() / 2)
                .map(|i| dirs.extent(of_id[2 * i] as usize, turn))
                .collect();
            let clearance = 1e-7;
            assert_eq!(
                dirs.past_row_alone(d, &of_id, clearance),
                dirs.past_row(d, &heights, &of_id, clearance),
                "{seed} {d}"
            );
        }
    }
}

#[test]
fn exits_at_hand_are_those_of_the_table() {
    for seed in 0..20 {
        // Every other time, use more exits than a mask holds.
        let dirs = random_dirs(seed, 80, seed % 2 == 0);
        let n = dirs.len();
        let mut rng = Rng::new(seed + 100);
        let mut might = BitTable::new(n, n);
        for a in 0..n {
            for b in 0..n {
                if rng.unit() < 0.7 {
                    might.set(a, b);
                }
            }
        }
        let mut next = Next::new(&dirs, &might);
        for source in 0..n {
            let mut hidden = vec![0; might.n_words()];
            for _ in 0..n / 4 {
                bits::set(&mut hidden, rng.below(n));
            }
            let mut expected = might.clone();
            for t in bits::ones(&hidden) {
                expected.clear(source, t);
                expected.clear(dirs.reverse[t] as usize, dirs.reverse[source] as usize);
            }
            next.hide(&dirs, &mut might, source, &hidden);
            assert!(might == expected, "{seed} {source}");
        }
        for d in 0..n {
            let exits = dirs.after(d);
            let windows = exits.clone().step_by(64);
            let at_hand = windows
                .flat_map(|start| bits::ones_from(start, next.window(&might, d, &exits, start)));
            let of_table = exits.clone().filter(|&q| might.get(d, q));
            assert!(at_hand.eq(of_table), "{seed} {d}");
        }
    }
}

//! Tests of searches in blocks, against searches in one piece and against lines followed by the generator's own means.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use enfilade_cpg::{CellId, Pvs, SightGraph, World};
use enfilade_testkit::{GridParams, Rng, Town, room_grid, town};

use super::*;
use crate::config::{VisBlocks, VisCheckpoint, VisConfig};
use crate::{see_all, see_world};

fn whole(graph: &SightGraph, config: &VisConfig, walls: Option<&[Triangle]>) -> VisOutput {
    let mut context = VisContext {
        on_round: &mut |_, _| true,
        walls,
        checkpoint: None,
    };
    see_all(graph, config, &mut context).unwrap()
}

/// Returns the bytes of all blocks, in a given order of their numbers.
fn searched(plan: &VisPlan<'_>, blocks: &[usize], walls: Option<&[Triangle]>) -> Vec<Vec<u8>> {
    let mut context = VisContext {
        on_round: &mut |_, _| true,
        walls,
        checkpoint: None,
    };
    let mut found = Vec::new();
    let is_complete = plan.search(blocks, &mut context, &mut |_, bytes, _| found.push(bytes));
    assert!(is_complete);
    found
}

fn in_blocks(
    graph: &SightGraph,
    config: &VisConfig,
    walls: Option<&[Triangle]>,
    most_own: usize,
) -> VisOutput {
    let plan = VisPlan::of_size(graph, config, 0, most_own).unwrap();
    assert!(plan.n_blocks() > 3);
    let all: Vec<usize> = (0..plan.n_blocks()).collect();
    plan.finish(&searched(&plan, &all, walls)).unwrap()
}

/// Asserts that neither answer lacks what the other one proves, and that an answer has few pairs that the other lacks.
fn agree(one: &VisOutput, many: &VisOutput) {
    for (a, b) in [(one, many), (many, one)] {
        for (x, y) in a.cells.pairs() {
            assert!(b.cells.sees(x, y) || a.undecided.sees(x, y), "{x} {y}");
        }
        assert!(a.undecided.pairs().all(|(x, y)| a.cells.sees(x, y)));
    }
    let (n, m) = (one.cells.n_pairs() as f64, many.cells.n_pairs() as f64);
    assert!((n - m).abs() <= 0.02 * n, "{n} {m}");
}

fn is_symmetric(pvs: &Pvs) -> bool {
    pvs.pairs().all(|(a, b)| pvs.sees(b, a))
}

/// Calls `found` with a cell and another that a random line from it enters.
fn follow(town: &Town, n_lines: usize, mut found: impl FnMut(CellId, CellId)) {
    let mut rng = Rng::new(5);
    for _ in 0..n_lines {
        let cell = rng.below(town.cells.len()) as u32;
        let from = rng.point_in(&town.cells[cell as usize]);
        let direction = rng.turn() * DVec3::X;
        let direction = DVec3::new(direction.x, direction.y * 0.1, direction.z);
        town.follow(cell, from, direction, |to| found(CellId(cell), CellId(to)));
    }
}

fn walls_of(world: &World) -> Vec<Triangle> {
    let batches = world.batches.iter();
    batches.flat_map(|b| b.primitive.triangles()).collect()
}

#[test]
fn blocks_of_a_town_find_what_one_piece_finds() {
    let town = town(600, 1);
    for far in [None, Some(20.0)] {
        let config = VisConfig {
            far,
            ..VisConfig::default()
        };
        let one = whole(&town.graph, &config, None);
        let many = in_blocks(&town.graph, &config, None, 700);
        agree(&one, &many);
        // How far apart cells are is judged by balls around openings, by which some pairs stay undecided.
        let is_same = many.cells == one.cells && many.undecided == one.undecided;
        assert!(is_same || far.is_some());
        assert!(many.is_complete && many.n_lines > 0 && many.n_steps > 0);
        assert!(many.n_base >= many.cells.n_pairs() as u64);
    }
}

#[test]
fn blocks_of_turned_offices_with_walls_find_what_one_piece_finds() {
    let params = GridParams {
        turn: 0.7,
        merges: 0.2,
        ..GridParams::offices(120, 3)
    };
    let world = room_grid(&params);
    let graph = SightGraph::of_graph(&world.graph);
    let walls = walls_of(&world);
    for walls in [None, Some(&walls[..])] {
        let one = whole(&graph, &VisConfig::default(), walls);
        let many = in_blocks(&graph, &VisConfig::default(), walls, 100);
        agree(&one, &many);
        assert!(is_symmetric(&many.cells) && is_symmetric(&many.undecided));
    }
}

#[test]
fn a_small_graph_is_one_block_with_the_answer_of_one_piece() {
    let world = room_grid(&GridParams::offices(60, 3));
    let graph = SightGraph::of_graph(&world.graph);
    let walls = walls_of(&world);
    for mode in [VisMode::Fast, VisMode::Exact] {
        let config = VisConfig {
            mode,
            ..VisConfig::default()
        };
        let plan = VisPlan::new(&graph, &config, 0).unwrap();
        assert_eq!(plan.n_blocks(), 1);
        let block = plan.finish(&searched(&plan, &[0], Some(&walls))).unwrap();
        let one = whole(&graph, &config, Some(&walls));
        assert_eq!(block.n_lines, one.witnesses.len() as u64);
        let witnesses = one.witnesses.clone();
        let known = VisOutput { witnesses, ..block };
        assert!(known == one);
        // Kept bytes are as good as a search.
        let mut kept = Kept::default();
        let bytes = searched(&plan, &[0], Some(&walls)).remove(0);
        kept.all.insert(plan.key(0), bytes);
        let mut context = VisContext {
            on_round: &mut |_, _| false,
            walls: Some(&walls),
            checkpoint: Some(VisCheckpoint {
                blocks: Some(&mut kept),
                resume: None,
                salt: 0,
                every: Duration::MAX,
                save: &mut |_| {},
            }),
        };
        let again = see_all(&graph, &config, &mut context).unwrap();
        assert!(again.is_complete && again.cells == one.cells);
    }
}

#[test]
fn the_fast_mode_has_all_that_lines_reach() {
    let town = town(600, 2);
    let config = VisConfig {
        mode: VisMode::Fast,
        ..VisConfig::default()
    };
    let fast = in_blocks(&town.graph, &config, None, 700);
    let exact = whole(&town.graph, &VisConfig::default(), None);
    assert!(exact.cells.pairs().all(|(a, b)| fast.cells.sees(a, b)));
}

#[test]
fn less_memory_makes_a_larger_answer_that_has_all_that_lines_reach() {
    let town = town(1300, 2);
    let mut before = 0;
    // All tables, those of parts of blocks, none.
    for max_memory in [
        1 << 30,
        4_500_000,
        512 * 2 * town.graph.portals.len() as u64,
    ] {
        let config = VisConfig {
            max_memory,
            ..VisConfig::default()
        };
        let vis = whole(&town.graph, &config, None);
        let mut n_found = 0;
        follow(&town, 200_000, |a, b| {
            assert!(
                vis.cells.sees(a, b) && vis.cells.sees(b, a),
                "{max_memory} {a} {b}"
            );
            n_found += 1;
        });
        assert!(n_found > 10_000, "{n_found}");
        assert!(is_symmetric(&vis.cells));
        assert!(vis.cells.n_pairs() >= before);
        before = vis.cells.n_pairs();
    }
    // The floods alone are good bounds.
    let exact = whole(&town.graph, &VisConfig::default(), None)
        .cells
        .n_pairs();
    assert!(
        (exact + 1..exact + exact / 4).contains(&before),
        "{exact} {before}"
    );
}

#[test]
fn order_and_threads_and_repetition_do_not_matter() {
    let town = town(600, 3);
    let config = VisConfig::default();
    let plan = VisPlan::of_size(&town.graph, &config, 0, 700).unwrap();
    let n = plan.n_blocks();
    let forward: Vec<usize> = (0..n).collect();
    let backward: Vec<usize> = (0..n).rev().collect();
    let run = |threads: usize, blocks: &[usize]| {
        let pool = rayon::ThreadPoolBuilder::new();
        let pool = pool.num_threads(threads).build().unwrap();
        pool.install(|| searched(&plan, blocks, None))
    };
    let one = run(1, &forward);
    let mut other = run(3, &backward);
    let answer = plan.finish(&one).unwrap();
    other.push(other[1].clone());
    assert_eq!(plan.finish(&other).unwrap(), answer);
    other.truncate(n);
    other.reverse();
    assert_eq!(one, other);
    let keys: BTreeSet<u64> = (0..n).map(|block| plan.key(block)).collect();
    assert_eq!(keys.len(), n);
}

#[test]
fn blocks_that_are_damaged_or_missing_or_of_another_search_are_refused() {
    let town = town(300, 3);
    let config = VisConfig::default();
    let plan = VisPlan::of_size(&town.graph, &config, 0, 400).unwrap();
    let all: Vec<usize> = (0..plan.n_blocks()).collect();
    let good = searched(&plan, &all, None);
    assert!(plan.is_block(1, &good[1]) && !plan.is_block(0, &good[1]));
    let refused = |blocks: &[Vec<u8>]| plan.finish(blocks).unwrap_err().to_string();
    assert!(refused(&good[1..]).contains("missing"));
    for (n_steps, salt, word) in [(12, 0, "not of this"), (13, 1, "not of this")] {
        let config = VisConfig {
            n_rays: n_steps,
            ..VisConfig::default()
        };
        let other = VisPlan::of_size(&town.graph, &config, salt, 400).unwrap();
        let mut blocks = good.clone();
        blocks[1] = searched(&other, &[1], None).remove(0);
        if n_steps != 12 {
            assert!(refused(&blocks).contains(word));
        } else {
            plan.finish(&blocks).unwrap();
        }
    }
    // A block that is called another.
    let mut blocks = good.clone();
    blocks[1].splice(8..16, plan.key(0).to_le_bytes());
    blocks[0].splice(8..16, plan.key(1).to_le_bytes());
    assert!(refused(&blocks).contains("damaged"));
    let mut rng = Rng::new(1);
    for _ in 0..300 {
        let mut blocks = good.clone();
        let bytes = &mut blocks[1];
        match rng.below(3) {
            0 => bytes.truncate(rng.below(bytes.len())),
            1 => bytes.push(0),
            _ => {
                let at = rng.below(bytes.len());
                bytes[at] ^= 1 << rng.below(8);
            }
        }
        let error = refused(&blocks);
        assert!(
            ["damaged", "not of"].iter().any(|w| error.contains(w)),
            "{error}"
        );
    }
}

/// Blocks in memory, with counts of those taken and put.
#[derive(Default)]
struct Kept {
    all: BTreeMap<u64, Vec<u8>>,
    n_taken: usize,
    n_put: usize,
}

impl VisBlocks for Kept {
    fn get(&mut self, key: u64) -> Option<Vec<u8>> {
        let found = self.all.get(&key).cloned();
        self.n_taken += usize::from(found.is_some());
        found
    }

    fn put(&mut self, key: u64, bytes: &[u8]) {
        self.n_put += 1;
        assert!(self.all.insert(key, bytes.to_vec()).is_none());
    }
}

#[test]
fn a_search_that_was_stopped_goes_on_from_its_blocks() {
    let town = town(1300, 2);
    let config = VisConfig {
        max_memory: 4_500_000,
        ..VisConfig::default()
    };
    let n = VisPlan::new(&town.graph, &config, 7).unwrap().n_blocks();
    let see = |kept: &mut Kept, n_rounds: usize| {
        let mut left = n_rounds;
        let mut context = VisContext {
            on_round: &mut |_, _| {
                left = left.saturating_sub(1);
                left > 0
            },
            walls: None,
            checkpoint: Some(VisCheckpoint {
                blocks: Some(kept),
                resume: None,
                salt: 7,
                every: Duration::MAX,
                save: &mut |_| {},
            }),
        };
        see_all(&town.graph, &config, &mut context).unwrap()
    };
    let one = see(&mut Kept::default(), usize::MAX);
    let mut kept = Kept::default();
    let part = see(&mut kept, 12);
    let n_first = kept.n_put;
    assert!(
        !part.is_complete && n_first > 0 && n_first < n,
        "{n_first} of {n}"
    );
    assert!(one.cells.pairs().all(|(a, b)| part.cells.sees(a, b)));
    // One that is damaged is made again.
    let last = *kept.all.keys().next_back().unwrap();
    kept.all.get_mut(&last).unwrap().pop();
    let damaged = kept.all.remove(&last).unwrap();
    assert!(!damaged.is_empty());
    assert_eq!(see(&mut kept, usize::MAX), one);
    assert_eq!((kept.n_taken, kept.n_put), (n_first - 1, n + 1));
    assert_eq!(see(&mut kept, 0), one);
}

#[test]
fn special_portals_are_searched_on_top_of_blocks() {
    let params = GridParams::offices(60, 4);
    let world = enfilade_testkit::with_specials(room_grid(&params), 4, 9);
    let see = |max_memory: u64| {
        let config = VisConfig {
            max_memory,
            ..VisConfig::default()
        };
        let mut context = VisContext {
            on_round: &mut |_, _| true,
            walls: None,
            checkpoint: None,
        };
        see_world(&world.graph, &config, &mut context).unwrap()
    };
    let n = 2 * world.graph.portals.len() as u64;
    let (one, many) = (see(1 << 30), see(n * 512 + n * n / 8));
    assert!(
        one.vis
            .cells
            .pairs()
            .all(|(a, b)| many.vis.cells.sees(a, b) || one.vis.undecided.sees(a, b))
    );
}

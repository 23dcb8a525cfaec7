//! Distances and next portals against Dijkstra's algorithm on all cells (W10).
//!
//! Covers W10.

use enfilade_cpg::{Cell, CellId, CellPortalGraph, Portal, PortalId, PortalKind, World};
use enfilade_testkit::oracle::least_lengths;
use enfilade_testkit::{GridParams, Rng, room_grid};
use enfilade_world::{Hop, Hops, Layout, LayoutExit, PartId, Place, Space};

const ROOT: PartId = PartId::ROOT;

fn space_of(params: &GridParams) -> Space {
    Space::new(room_grid(params)).unwrap()
}

/// Randomly joined cells: trees, rings, chains, cells joined twice, isolated cells.
fn graph_by_chance(n: usize, n_links: usize, seed: u64) -> Space {
    let mut rng = Rng::new(seed);
    let mut cells: Vec<Cell> = (0..n).map(|_| Cell::default()).collect();
    let mut portals = Vec::new();
    for i in 0..n_links {
        let a = rng.below(n);
        // Mostly near ones, so that there are chains.
        let reach = if rng.chance(0.7) { 3.min(n - 1) } else { n - 1 };
        let b = (a + 1 + rng.below(reach)) % n;
        let z = i as f32;
        let outline = vec![[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
        portals.push(Portal {
            cells: [a, b].map(|c| CellId(c as u32)),
            kind: PortalKind::Open,
            normal: [0.0, 0.0, 1.0],
            pieces: vec![outline.clone()],
            outline,
            area: 0.5,
            fittings: Vec::new(),
            why: Vec::new(),
        });
        for c in [a, b] {
            cells[c].portals.push(PortalId(i as u32));
        }
    }
    Space::new(World {
        graph: CellPortalGraph {
            cells,
            portals,
            ..CellPortalGraph::default()
        },
        ..World::default()
    })
    .unwrap()
}

/// Least lengths from a cell, in tenths of a millimeter.
fn dijkstra(
    layout: &Layout,
    from: CellId,
    step: impl Fn(LayoutExit) -> Option<u64>,
) -> Vec<Option<u64>> {
    least_lengths(layout.n_cells(), from.0, |cell| {
        let exits = layout.exits(CellId(cell)).iter();
        exits.filter_map(|&e| Some((e.to.0, step(e)?)))
    })
}

/// Flips random portals and compares all pairs.
fn check(space: &Space, seed: u64, n_flips: usize) {
    let layout = space.layout(ROOT);
    let mut rng = Rng::new(seed);
    let steps: Vec<Option<f64>> = (0..layout.n_portals())
        .map(|_| rng.chance(0.9).then(|| rng.range(0.0, 20.0)))
        .collect();
    let mut hops = Hops::new(space, |_, p| steps[p.idx()]);
    let place = |cell| Place { part: ROOT, cell };
    let mut is_open = vec![true; layout.n_portals()];
    for flip in 0..=n_flips {
        let step = |e: LayoutExit| {
            let length = steps[e.portal.idx()].filter(|_| is_open[e.portal.idx()])?;
            Some((length * 1e4).round() as u64)
        };
        for from in (0..layout.n_cells() as u32).map(CellId) {
            let expected = dijkstra(layout, from, step);
            for to in (0..layout.n_cells() as u32).map(CellId) {
                let least = expected[to.idx()];
                let own = hops.distance(space, place(from), place(to));
                let own = own.map(|d| (d * 1e4).round() as u64);
                assert_eq!(own, least, "seed {seed} flip {flip}: {from} to {to}");
                let next = hops.next(space, place(from), place(to));
                assert_eq!(next.is_some(), from != to && least.is_some());
                // The rest of the path has the remaining length, so following it ends at the cell.
                if let Some(Hop {
                    portal, to: there, ..
                }) = next
                {
                    let exit = LayoutExit {
                        portal,
                        to: there.cell,
                    };
                    assert!(layout.exits(from).contains(&exit));
                    let left = hops.distance(space, there, place(to));
                    let left = left.map(|d| (d * 1e4).round() as u64);
                    assert_eq!(left.zip(step(exit)).map(|(a, b)| a + b), least);
                }
            }
        }
        let p = PortalId(rng.below(layout.n_portals()) as u32);
        is_open[p.idx()] ^= true;
        hops.set_open(ROOT, p, is_open[p.idx()]);
        assert_eq!(hops.is_open(ROOT, p), is_open[p.idx()]);
    }
}

/// W10: on random graphs with random doors flipped, every distance and next portal equals that of a search of all cells.
#[test]
fn distances_are_those_of_a_search_of_all_cells() {
    for seed in 0..60 {
        let n = 3 + seed as usize % 20;
        let space = graph_by_chance(n, n * (1 + seed as usize % 3) / 2 + 1, seed);
        check(&space, seed, 25);
    }
}

/// W10: the same for rooms on a grid.
#[test]
fn distances_in_rooms_are_those_of_a_search_of_all_cells() {
    check(&space_of(&GridParams::offices(60, 5)), 5, 10);
}

/// W10: chains and dead ends leave the table; a ring keeps one cell.
#[test]
fn two_portal_cells_and_dead_ends_leave_the_table() {
    let ring = GridParams {
        size: [2, 1, 2],
        doors: 1.0,
        ..GridParams::two_rooms()
    };
    let row = GridParams {
        size: [30, 1, 1],
        ..GridParams::two_rooms()
    };
    for params in [ring, row] {
        let hops = Hops::new(&space_of(&params), |_, _| Some(1.0));
        assert_eq!(hops.n_junctions(ROOT), 1);
    }
}

/// W10: a flip and a query allocate nothing once the buffers have grown.
#[test]
fn a_flip_allocates_nothing() {
    let space = space_of(&GridParams::offices(100, 2));
    let layout = space.layout(ROOT);
    let mut hops = Hops::new(&space, |_, _| Some(1.0));
    let place = |cell| Place {
        part: ROOT,
        cell: CellId(cell),
    };
    let mut flip_all = || {
        for is_open in [false, true] {
            for p in (0..layout.n_portals() as u32).map(PortalId) {
                hops.set_open(ROOT, p, is_open);
                let _ = hops.next(&space, place(0), place(99));
            }
        }
    };
    flip_all();
    assert_eq!(allocation_counter::measure(flip_all).count_total, 0);
}

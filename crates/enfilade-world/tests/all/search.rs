//! The length search against plain oracles (W10).
//!
//! Covers W10.

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::DVec3;
use enfilade_testkit::{GridParams, Rng, room_grid};
use enfilade_world::{Arrival, Layout, LayoutExit, LengthSearch, Sampling, Ways};

fn layout(seed: u64) -> Layout {
    Layout::new(&room_grid(&GridParams::offices(40, seed)))
}

fn point_in(layout: &Layout, rng: &mut Rng) -> (CellId, DVec3) {
    loop {
        let cell = CellId(rng.below(layout.n_cells()) as u32);
        let bounds = layout.cell(cell).bounds;
        let share = DVec3::new(rng.unit(), rng.unit(), rng.unit());
        let p = bounds.min + bounds.size() * share;
        if layout.locate(p) == Some(cell) && !layout.cell(cell).is_outdoor {
            return (cell, p);
        }
    }
}

/// Bellman–Ford over all pairs of points of one cell: slow and plain.
fn lengths_by_sweeps(
    layout: &Layout,
    ways: &Ways,
    cell: CellId,
    from: DVec3,
    pass: impl Fn(LayoutExit) -> Option<f64>,
) -> Vec<[Vec<f64>; 2]> {
    let all = || (0..layout.n_portals() as u32).map(PortalId);
    let mut lengths: Vec<[Vec<f64>; 2]> = all()
        .map(|p| [(); 2].map(|()| vec![f64::INFINITY; ways.points(p).len()]))
        .collect();
    loop {
        let mut is_changed = false;
        for p in all() {
            for (side, to) in layout.opening(p).cells().into_iter().enumerate() {
                let Some(cost) = pass(LayoutExit { portal: p, to }) else {
                    continue;
                };
                let back = layout.opening(p).cells()[1 - side];
                for (k, &at) in ways.points(p).iter().enumerate() {
                    let mut least = lengths[p.idx()][side][k];
                    if back == cell {
                        least = least.min(from.distance(at) + cost);
                    }
                    for e in layout.exits(back).iter().filter(|e| e.portal != p) {
                        let s = usize::from(layout.opening(e.portal).cells()[1] == back);
                        for (j, &q) in ways.points(e.portal).iter().enumerate() {
                            let before = lengths[e.portal.idx()][s][j];
                            least = least.min(before + q.distance(at) + cost);
                        }
                    }
                    is_changed |= least < lengths[p.idx()][side][k];
                    lengths[p.idx()][side][k] = least;
                }
            }
        }
        if !is_changed {
            return lengths;
        }
    }
}

/// W10: the search settles every portal at the length found by plain sweeps over all pairs, with closed portals and costs.
#[test]
fn lengths_are_those_of_sweeps_over_all_pairs() {
    let mut search = LengthSearch::new();
    for seed in 0..4 {
        let (layout, mut rng) = (layout(seed), Rng::new(seed));
        let ways = Ways::new(
            &layout,
            Sampling {
                spacing: 2.0,
                most: 12,
            },
        );
        let start = point_in(&layout, &mut rng);
        let costs: Vec<Option<f64>> = (0..2 * layout.n_portals())
            .map(|_| rng.chance(0.8).then(|| rng.range(-0.5, 1.0)))
            .collect();
        let cost = |e: LayoutExit| {
            let side = usize::from(layout.opening(e.portal).cells()[1] == e.to);
            costs[2 * e.portal.idx() + side]
        };
        search.run(&ways, start.0, start.1, f64::INFINITY, cost);
        let expected = lengths_by_sweeps(&layout, &ways, start.0, start.1, |e| {
            cost(e).map(|c| c.max(0.0))
        });
        let mut n_reached = 0;
        for p in (0..layout.n_portals() as u32).map(PortalId) {
            for (side, to) in layout.opening(p).cells().into_iter().enumerate() {
                let least = expected[p.idx()][side]
                    .iter()
                    .fold(f64::INFINITY, |a, &b| a.min(b));
                let exit = LayoutExit { portal: p, to };
                let own = search.reached().iter().find(|r| r.exit == exit);
                assert_eq!(own.is_some(), least < f64::INFINITY, "{exit:?}");
                n_reached += usize::from(own.is_some());
                assert!(
                    own.is_none_or(|r| (r.length - least).abs() < 1e-9),
                    "{exit:?}"
                );
            }
        }
        assert_eq!(search.reached().len(), n_reached);
        assert!(search.reached().is_sorted_by(|a, b| a.length <= b.length));
    }
}

/// W10: a path read back is a walk from the start to the end through open portals, of the reported length.
#[test]
fn a_way_read_back_is_as_long_as_was_said() {
    let (layout, mut rng) = (layout(7), Rng::new(7));
    let ways = Ways::new(&layout, Sampling::default());
    let (mut search, mut arrivals, mut crossings) = (LengthSearch::new(), Vec::new(), Vec::new());
    let mut n_many = 0;
    for _ in 0..40 {
        let (start, from) = point_in(&layout, &mut rng);
        search.run(&ways, start, from, f64::INFINITY, |_| Some(0.0));
        let (end, to) = point_in(&layout, &mut rng);
        search.arrivals(&ways, end, to, 1.2, 5, &mut arrivals);
        assert!(arrivals.is_sorted_by(|a, b| a.length <= b.length));
        n_many += usize::from(arrivals.len() > 1);
        let mut known: Vec<Vec<LayoutExit>> = Vec::new();
        for arrival in &arrivals {
            search.crossings(&ways, arrival, &mut crossings);
            let (mut cell, mut at, mut length) = (start, from, 0.0);
            for &(exit, p) in &crossings {
                assert!(layout.exits(cell).contains(&exit));
                length += at.distance(p);
                (cell, at) = (exit.to, p);
            }
            assert_eq!(cell, end);
            assert!((length + at.distance(to) - arrival.length).abs() < 1e-9);
            assert!(arrival.length <= 1.2 * arrivals[0].length);
            assert_eq!(arrival.is_direct(), crossings.is_empty());
            let sequence: Vec<LayoutExit> = crossings.iter().map(|c| c.0).collect();
            assert!(!known.contains(&sequence));
            known.push(sequence);
        }
    }
    assert!(n_many > 10, "alternatives are found");
}

/// W10: a radius excludes everything farther, and leaves all other lengths unchanged.
#[test]
fn a_radius_ends_the_search() {
    let params = GridParams {
        outdoors: false,
        ..GridParams::offices(200, 9)
    };
    let (layout, mut rng) = (Layout::new(&room_grid(&params)), Rng::new(9));
    let ways = Ways::new(&layout, Sampling::MIDDLES);
    let (mut near, mut all) = (LengthSearch::new(), LengthSearch::new());
    let (cell, from) = point_in(&layout, &mut rng);
    all.run(&ways, cell, from, f64::INFINITY, |_| Some(0.0));
    near.run(&ways, cell, from, 20.0, |_| Some(0.0));
    let n = all.reached().iter().filter(|r| r.length <= 20.0).count();
    assert!(n > 3 && n < all.reached().len());
    assert_eq!(near.reached(), &all.reached()[..n]);
    let n = all.cells().iter().filter(|c| c.1 <= 20.0).count();
    assert_eq!(near.cells(), &all.cells()[..n]);
    assert_eq!(near.cells()[0], (cell, 0.0));
}

/// W10: more points per opening make lengths shorter, by at most the bound.
#[test]
fn finer_samples_come_closer_to_the_shortest() {
    let (layout, mut rng) = (layout(11), Rng::new(11));
    let at = |spacing| {
        Ways::new(
            &layout,
            Sampling {
                spacing,
                most: 1000,
            },
        )
    };
    let ways = [at(f64::INFINITY), at(1.0), at(0.25)];
    let mut search = LengthSearch::new();
    let mut arrivals: Vec<Arrival> = Vec::new();
    let mut sums = [0.0; 3];
    for _ in 0..10 {
        let ((start, from), (end, to)) = (point_in(&layout, &mut rng), point_in(&layout, &mut rng));
        for (ways, sum) in ways.iter().zip(&mut sums) {
            search.run(ways, start, from, f64::INFINITY, |_| Some(0.0));
            search.arrivals(ways, end, to, 1.0, 1, &mut arrivals);
            *sum += arrivals.first().map_or(0.0, |a| a.length);
        }
    }
    assert!(sums[0] > sums[1] && sums[1] > sums[2], "{sums:?}");
    assert!(sums[1] < 1.01 * sums[2], "{sums:?}");
}

/// W10: nothing is allocated once the buffers have grown.
#[test]
fn a_second_search_allocates_nothing() {
    let (layout, mut rng) = (layout(3), Rng::new(3));
    let ways = Ways::new(&layout, Sampling::default());
    let (mut search, mut arrivals, mut crossings) = (LengthSearch::new(), Vec::new(), Vec::new());
    let ends = [(); 2].map(|()| point_in(&layout, &mut rng));
    let mut ask = || {
        for (cell, from) in ends {
            search.run(&ways, cell, from, f64::INFINITY, |_| Some(0.0));
            search.arrivals(&ways, ends[1].0, ends[1].1, 1.1, 4, &mut arrivals);
            search.crossings(&ways, &arrivals[0], &mut crossings);
        }
    };
    ask();
    let counted = allocation_counter::measure(ask);
    assert_eq!(counted.count_total, 0);
}

//! Everything that rays from a cell hit is among its parts and in its volumes, in worlds exact by construction.

use enfilade_cpg::{CellId, PartNumbers, Pvs, SightGraph, World};
use enfilade_geom::{Aabb, Bvh, DMat4, DVec3, Ray, Triangle};
use enfilade_testkit::{GridParams, Rng, room_grid};
use enfilade_vis::{Hourglasses, VisConfig, VisContext, piece_faces, see_all, see_parts};
use proptest::prelude::*;

fn point(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// All triangles, each with the number of its part.
fn triangles(world: &World) -> Vec<(Triangle, u32)> {
    let numbers = PartNumbers::new(world);
    let mut out = Vec::new();
    for (i, batch) in world.batches.iter().enumerate() {
        out.extend(batch.primitive.triangles().zip(numbers.of_batch(i)));
    }
    for (i, object) in (0..).zip(&world.details) {
        let m = DMat4::from_cols_array(&object.transform.map(f64::from));
        for p in &world.detail_meshes[object.mesh as usize].primitives {
            out.extend(p.placed_triangles(m).map(|t| (t, numbers.of_detail(i))));
        }
    }
    out
}

/// The world with the results for each cell: cells, parts, volumes.
fn with_sight(mut world: World) -> World {
    let walls: Vec<Triangle> = triangles(&World {
        details: Vec::new(),
        ..world.clone()
    })
    .into_iter()
    .map(|t| t.0)
    .collect();
    let mut context = VisContext {
        on_round: &mut |_, _| true,
        walls: Some(&walls),
        checkpoint: None,
    };
    let graph = SightGraph::of_graph(&world.graph);
    let mut pvs = see_all(&graph, &VisConfig::default(), &mut context)
        .unwrap()
        .cells;
    let (volumes, parts) = see_parts(&world, &pvs).unwrap();
    pvs.parts = Some(parts);
    pvs.volumes = Some(volumes);
    world.pvs = Some(pvs);
    world.validate().unwrap();
    world
}

fn pair(pvs: &Pvs, from: CellId, to: CellId) -> Option<usize> {
    pvs.pairs().position(|p| p == (from, to))
}

/// Returns `true` if a point lies in a piece of the volume of a pair of cells.
fn is_in_volume(pvs: &Pvs, pair: usize, p: DVec3) -> bool {
    let is_in = |piece: &[[f64; 4]]| {
        let height = |q: &[f64; 4]| DVec3::new(q[0], q[1], q[2]).dot(p) + q[3];
        piece.iter().all(|q| height(q) >= -1e-6)
    };
    pvs.volumes.as_ref().unwrap().pieces_of(pair).any(is_in)
}

/// Casts rays from random points of all cells; returns how many hit something.
fn cast(world: &World, rng: &mut Rng, n: usize) -> usize {
    let pvs = world.pvs.as_ref().unwrap();
    let parts = pvs.parts.as_ref().unwrap();
    let all = triangles(world);
    let bvh = Bvh::build(&all.iter().map(|t| t.0).collect::<Vec<_>>());
    let numbers = PartNumbers::new(world);
    let mut cells_of = vec![Vec::new(); numbers.n_parts() as usize];
    for (i, batch) in world.batches.iter().enumerate() {
        for part in numbers.of_batch(i) {
            cells_of[part as usize].clone_from(&batch.cells);
        }
    }
    for (i, object) in (0..).zip(&world.details) {
        cells_of[numbers.of_detail(i) as usize].clone_from(&object.cells);
    }
    let mut n_hits = 0;
    for _ in 0..n {
        let cell = CellId(rng.below(world.graph.cells.len()) as u32);
        let [low, high] = world.graph.cells[cell.idx()].aabb;
        let eye = [0, 1, 2].map(|k| low[k] + (high[k] - low[k]) * rng.unit() as f32);
        if world.graph.locate(eye) != Some(cell) {
            continue;
        }
        let mut way = || rng.range(-1.0, 1.0);
        let ray = Ray {
            origin: point(eye),
            direction: DVec3::new(way(), way() * 0.5, way()),
            t_max: f64::INFINITY,
        };
        let Some(hit) = bvh.closest_hit(&ray, |_| false) else {
            continue;
        };
        n_hits += 1;
        let part = all[hit.triangle as usize].1;
        let is_listed = cells_of[part as usize].iter().any(|&to| {
            let Some(pair) = pair(pvs, cell, to) else {
                return false;
            };
            let runs = parts.runs_of(pair).iter();
            runs.clone().any(|r| (r[0]..r[1]).contains(&part))
                && is_in_volume(pvs, pair, ray.at(hit.t))
        });
        assert!(is_listed, "part {part} is hit from {cell} at {eye:?}");
    }
    n_hits
}

/// Counts, over all pairs of cells, the parts of the second, and those of them that count as seen.
fn counts(world: &World) -> [usize; 2] {
    let pvs = world.pvs.as_ref().unwrap();
    let parts = pvs.parts.as_ref().unwrap();
    let of_cell = |cell: CellId| {
        let batches = world.batches.iter().filter(|b| b.cells.contains(&cell));
        let walls: usize = batches.map(|b| b.primitive.indices.len() / 3).sum();
        walls
            + world
                .details
                .iter()
                .filter(|d| d.cells.contains(&cell))
                .count()
    };
    let numbers = PartNumbers::new(world);
    let mut sums = [0, 0];
    for (pair, (_, to)) in pvs.pairs().enumerate() {
        sums[0] += of_cell(to);
        sums[1] += parts.count(pair, &numbers).iter().sum::<usize>();
    }
    sums
}

// Covers Q2 and Q5.
#[test]
fn rays_from_a_cell_hit_what_counts_as_seen_and_much_counts_as_hidden() {
    let world = with_sight(room_grid(&GridParams::offices(40, 3)));
    let mut rng = Rng::new(1);
    assert!(cast(&world, &mut rng, 30_000) > 10_000);
    let [all, seen] = counts(&world);
    assert!(seen * 2 < all, "{seen} of {all}");
}

// Covers Q2.
#[test]
fn pieces_are_drawn_as_faces_in_their_box() {
    let bounds = Aabb::new(DVec3::ZERO, DVec3::ONE);
    let area = |faces: Vec<Vec<DVec3>>| {
        let area = |f: &Vec<DVec3>| enfilade_geom::poly::area(f);
        faces.iter().map(area).sum::<f64>()
    };
    assert!((area(piece_faces(&[], &bounds)) - 6.0).abs() < 1e-9);
    let half = [1.0, 0.0, 0.0, -0.5];
    assert!((area(piece_faces(&[half, half], &bounds)) - 4.0).abs() < 1e-6);
    let none = [-1.0, 0.0, 0.0, 0.25];
    assert!(piece_faces(&[half, none], &bounds).is_empty());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    // Covers Q2 and Q5.
    #[test]
    fn nothing_that_a_ray_hits_counts_as_hidden(seed in 0_u64..1000, n_rooms in 4_usize..24) {
        let world = with_sight(room_grid(&GridParams::offices(n_rooms, seed)));
        prop_assert!(cast(&world, &mut Rng::new(seed), 2_000) > 100);
    }

    // Covers Q3.
    #[test]
    fn a_line_through_portals_stays_in_their_hourglass(seed in 0_u64..1000) {
        let world = room_grid(&GridParams::offices(12, seed));
        let graph = SightGraph::of_graph(&world.graph);
        let glasses = Hourglasses::new(&graph).unwrap();
        let mut rng = Rng::new(seed);
        let n = graph.portals.len();
        let mut on = |portal: usize| {
            let winding = &graph.portals[portal].winding;
            let weights: Vec<f64> = winding.iter().map(|_| rng.range(0.01, 1.0)).collect();
            let sum: f64 = weights.iter().sum();
            winding.iter().zip(&weights).map(|(&p, w)| p * (w / sum)).sum::<DVec3>()
        };
        let direction = |portal: usize, from: u32| {
            (2 * portal + usize::from(graph.portals[portal].cells[0] != from)) as u32
        };
        let (mut n_passed, mut n_stopped) = (0, 0);
        for a in 0..n {
            for b in 0..n {
                let shared = graph.portals[a].cells.into_iter()
                    .find(|c| graph.portals[b].cells.contains(c));
                let Some(middle) = shared.filter(|_| a != b) else { continue };
                let first = direction(a, graph.portals[a].cells.into_iter().find(|&c| c != middle).unwrap());
                let second = direction(b, middle);
                let one = glasses.of_portal(first).unwrap();
                let both = glasses.push(&one, second);
                // The line through a point of each.
                let (p, q) = (on(a), on(b));
                let normal = |d: u32| {
                    let n = enfilade_geom::poly::area_normal(&graph.portals[d as usize / 2].winding).normalize();
                    if d.is_multiple_of(2) { n } else { -n }
                };
                let crosses = [first, second].iter().all(|&d| normal(d).dot(q - p) > 1e-6);
                if !crosses {
                    continue;
                }
                let Some(both) = both else {
                    prop_assert!(false, "a line passes {} and {}", first, second);
                    continue;
                };
                n_passed += 1;
                prop_assert_eq!(both.sequence(), &[first, second][..]);
                let beyond = q + (q - p) * 3.0;
                prop_assert!(both.reaches(beyond, 1e-6));
                prop_assert!(both.planes().len() > 1);
                // A point beside the waist, far behind the last portal's edge, is out of reach.
                let side = both.last()[0] + (both.last()[0] - both.last()[both.last().len() / 2]) * 1e3;
                n_stopped += usize::from(!both.reaches(side + normal(second) * 1e-3, 1e-6));
            }
        }
        prop_assert!(n_passed == 0 || n_stopped > 0);
        // Portals that do not follow each other.
        let one = glasses.of_portal(0).unwrap();
        prop_assert!(glasses.push(&one, 1).is_none());
        prop_assert!(glasses.push(&one, 2 * n as u32).is_none());
        prop_assert!(glasses.of_portal(2 * n as u32).is_none());
    }
}

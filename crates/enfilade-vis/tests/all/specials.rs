//! Visibility through special portals, compared with the same places built without any, and with rays traced by
//! matrices.

use std::collections::HashSet;
use std::sync::Arc;

use enfilade_cpg::{
    Cell, CellId, CellPortalGraph, MonitorCamera, PartNumbers, Pass, Portal, PortalId, PortalKind,
    Pvs, SightGraph, SpecialId, SpecialPortal, SpecialShape, Way, World,
};
use enfilade_geom::{Bvh, DMat3, DQuat, DVec3, Ray, Similarity, Triangle};
use enfilade_testkit::{GridParams, Rng, linked_copies, room_grid, with_specials};
use enfilade_vis::{
    VisConfig, VisContext, VisError, VisMode, WorldVis, see_all, see_parts, see_parts_through,
    see_world,
};

fn point(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

fn see_by(graph: &CellPortalGraph, walls: Option<&[Triangle]>, config: &VisConfig) -> WorldVis {
    let mut context = VisContext {
        on_round: &mut |_, _| true,
        walls,
        checkpoint: None,
    };
    see_world(graph, config, &mut context).unwrap()
}

fn see(graph: &CellPortalGraph) -> WorldVis {
    see_by(graph, None, &VisConfig::default())
}

fn walls_of(world: &World) -> Vec<Triangle> {
    let batches = world.batches.iter();
    batches.flat_map(|b| b.primitive.triangles()).collect()
}

/// The cells seen from a cell, each as its remainder by `n`.
fn row(pvs: &Pvs, cell: u32, n: u32) -> Vec<u32> {
    let mut row: Vec<u32> = pvs.visible_from(CellId(cell)).map(|c| c.0 % n).collect();
    row.sort_unstable();
    row.dedup();
    row
}

// Covers Q8.
#[test]
fn a_doorway_that_leads_into_a_copy_shows_what_the_world_itself_does() {
    let mut rng = Rng::new(7);
    let (mut n_rows, mut n_through) = (0, 0);
    for seed in 0..24 {
        let world = room_grid(&GridParams {
            // Copies have no surroundings.
            outdoors: false,
            doors: 1.0,
            windows: 0.3,
            merges: 0.3,
            furniture: 0,
            ..GridParams::offices(6 + seed as usize % 7, seed)
        });
        if world.graph.portals.is_empty() {
            continue;
        }
        let portal = PortalId(rng.below(world.graph.portals.len()) as u32);
        let axis = DVec3::from_array([0, 1, 2].map(|_| rng.range(-1.0, 1.0)));
        let map = Similarity {
            turn: DQuat::from_axis_angle(axis.normalize(), rng.range(-3.0, 3.0)),
            at: DVec3::new(40.0, 3.0, 0.0),
            scale: [1.0, 1.0, 0.5, 2.0][seed as usize % 4],
        };
        let linked = linked_copies(&world, portal, &map).graph;
        let (plain, vis) = (see(&world.graph).vis.cells, see(&linked));
        assert_eq!(vis.n_cut, 0, "seed {seed}");
        let n = world.graph.cells.len() as u32;
        for cell in 0..2 * n {
            let expected = row(&plain, cell % n, n);
            assert_eq!(
                row(&vis.vis.cells, cell, n),
                expected,
                "seed {seed}, cell {cell}"
            );
            n_rows += 1;
            n_through += vis.through.n_visible_from(CellId(cell));
        }
    }
    assert!(n_rows > 100 && n_through > 200, "{n_rows} {n_through}");
}

/// Rooms in a row, of one unit each, with a window in each wall across: `windows[i]` before room `i`, and one behind
/// the last.
fn row_of_rooms(windows: &[[f32; 4]]) -> CellPortalGraph {
    let n = windows.len() - 1;
    let cell = |i: usize| Cell {
        aabb: [[i as f32, 0.0, 0.0], [i as f32 + 1.0, 1.0, 1.0]],
        ..Cell::default()
    };
    let portal = |i: usize| Portal {
        cells: [CellId(i as u32 - 1), CellId(i as u32)],
        kind: PortalKind::Open,
        normal: [1.0, 0.0, 0.0],
        outline: window(windows[i], i as f32),
        pieces: vec![window(windows[i], i as f32)],
        area: 0.0,
        fittings: Vec::new(),
        why: Vec::new(),
    };
    CellPortalGraph {
        cells: (0..n).map(cell).collect(),
        portals: (1..n).map(portal).collect(),
        ..CellPortalGraph::default()
    }
}

fn window([a, b, c, d]: [f32; 4], x: f32) -> Vec<[f32; 3]> {
    vec![[x, c, a], [x, d, a], [x, d, b], [x, c, b]]
}

/// The same, with the windows in the outer walls leading into each other.
fn ring_of_rooms(windows: &[[f32; 4]]) -> CellPortalGraph {
    let mut graph = row_of_rooms(windows);
    let n = graph.cells.len();
    let lead = |cell: usize, to: usize, is_turned: bool, back| {
        let length = if is_turned { n as f64 } else { -(n as f64) };
        let mut piece = window(windows[0], if is_turned { 0.0 } else { n as f32 });
        if is_turned {
            piece.reverse();
        }
        SpecialPortal {
            name: String::new(),
            cell: CellId(cell as u32),
            shape: SpecialShape::Surface {
                normal: [if is_turned { -1.0 } else { 1.0 }, 0.0, 0.0],
                pieces: vec![piece],
            },
            passes: vec![Pass::new(Way::Lead {
                to: CellId(to as u32),
                map: Similarity::rigid(DQuat::IDENTITY, DVec3::X * length),
                back: Some(SpecialId(back)),
            })],
        }
    };
    graph.specials = vec![lead(n - 1, 0, false, 1), lead(0, n - 1, true, 0)];
    graph
}

#[test]
fn rooms_whose_ends_lead_into_each_other_are_rooms_without_end() {
    const DEPTH: usize = 5;
    let mut rng = Rng::new(3);
    let (mut n_compared, mut n_deep, mut n_cut) = (0, 0, 0);
    for _ in 0..60 {
        let n = 1 + rng.below(4);
        let mut windows: Vec<[f32; 4]> = (0..n)
            .map(|_| {
                let mut span = || {
                    let a = rng.range(0.05, 0.55);
                    [a, a + rng.range(0.15, 0.4)].map(|x| x as f32)
                };
                let ([a, b], [c, d]) = (span(), span());
                [a, b, c, d]
            })
            .collect();
        windows.push(windows[0]);
        let config = VisConfig {
            max_specials: DEPTH as u32,
            ..VisConfig::default()
        };
        let vis = see_by(&ring_of_rooms(&windows), None, &config);
        let n_copies = 2 * DEPTH + 1;
        let mut unrolled: Vec<[f32; 4]> = windows[..n].repeat(n_copies);
        unrolled.push(windows[0]);
        let plain = see(&row_of_rooms(&unrolled)).vis.cells;
        for cell in 0..n as u32 {
            let middle = cell + (DEPTH * n) as u32;
            let expected = row(&plain, middle, n as u32);
            let found = row(&vis.vis.cells, cell, n as u32);
            if vis.n_cut == 0 {
                assert_eq!(found, expected, "{windows:?}");
                n_compared += 1;
                n_deep += usize::from(vis.n_chains > 3);
            } else {
                assert!(expected.iter().all(|c| found.contains(c)));
                n_cut += 1;
            }
        }
    }
    assert!(
        n_compared > 20 && n_deep > 0 && n_cut > 5,
        "{n_compared} {n_deep} {n_cut}"
    );
}

#[test]
fn chains_cut_at_a_bound_show_everything_that_they_might_lead_to() {
    // No line passes three windows.
    let places = [[0.1, 0.2, 0.1, 0.2], [0.8, 0.9, 0.8, 0.9]];
    let windows: Vec<[f32; 4]> = (0..7).map(|i| places[i % 2]).collect();
    let graph = ring_of_rooms(&windows);
    let deep = see(&graph);
    assert_eq!(deep.n_cut, 0);
    for (max_specials, max_chains) in [(0, 256), (4, 1), (4, 0)] {
        let config = VisConfig {
            max_specials,
            max_chains,
            ..VisConfig::default()
        };
        let cut = see_by(&graph, None, &config);
        assert!(cut.n_cut > 0 && cut.vis.is_complete);
        let is_superset = (deep.vis.cells.pairs()).all(|(a, b)| cut.vis.cells.sees(a, b));
        assert!(is_superset, "{max_specials} {max_chains}");
        assert!(cut.vis.cells.n_pairs() > deep.vis.cells.n_pairs());
    }
    let mut context = VisContext {
        on_round: &mut |_, _| false,
        walls: None,
        checkpoint: None,
    };
    let stopped = see_world(&graph, &VisConfig::default(), &mut context).unwrap();
    assert!(!stopped.vis.is_complete);
    let is_superset = (deep.vis.cells.pairs()).all(|(a, b)| stopped.vis.cells.sees(a, b));
    assert!(is_superset);
    let fast = VisConfig {
        mode: VisMode::Fast,
        ..VisConfig::default()
    };
    let fast = see_by(&graph, None, &fast);
    assert!((deep.vis.cells.pairs()).all(|(a, b)| fast.vis.cells.sees(a, b)));
}

#[test]
fn a_doorway_is_not_looked_through_from_a_side_that_does_not_let_through() {
    let mut graph = row_of_rooms(&[[0.2, 0.8, 0.2, 0.8]; 4]);
    let mirror = |passes| SpecialPortal {
        name: String::new(),
        cell: CellId(0),
        shape: SpecialShape::Portal(PortalId(0)),
        passes,
    };
    graph.specials = vec![mirror(vec![Pass::new(Way::Mirror)])];
    let vis = see(&graph).vis.cells;
    let rows = |vis: &Pvs| [0, 1, 2].map(|c| row(vis, c, 3));
    // The second room looks into the first from behind the mirror.
    assert_eq!(rows(&vis), [vec![0], vec![0, 1, 2], vec![0, 1, 2]]);
    graph.specials = vec![mirror(vec![
        Pass::new(Way::Through),
        Pass::new(Way::Mirror),
    ])];
    let vis = see(&graph).vis.cells;
    assert_eq!(rows(&vis), [vec![0, 1, 2], vec![0, 1, 2], vec![0, 1, 2]]);
    // A closed side on each: nobody looks through.
    let mut other = mirror(vec![Pass::new(Way::Mirror)]);
    graph.specials = vec![other.clone()];
    other.cell = CellId(1);
    graph.specials.push(other);
    let vis = see(&graph).vis.cells;
    assert_eq!(rows(&vis), [vec![0], vec![1, 2], vec![1, 2]]);
}

#[test]
fn a_mirror_shows_what_is_around_a_corner() {
    // Two windows that no straight line passes both, and a mirror across the first room.
    let mut graph = row_of_rooms(&[[0.0, 1.0, 0.0, 1.0]; 4]);
    let corner = |z: f32, x: f32| {
        [
            [x, 0.0, z],
            [x + 0.2, 0.0, z],
            [x + 0.2, 1.0, z],
            [x, 1.0, z],
        ]
    };
    graph.portals.clear();
    // Rooms 1 and 2 are beside room 0, behind one wall of it, so neither sees the other but by the wall across.
    for (cell, x) in [(1, 0.1), (2, 0.7)] {
        let outline = corner(0.0, x).to_vec();
        graph.portals.push(Portal {
            cells: [CellId(cell), CellId(0)],
            kind: PortalKind::Open,
            normal: [0.0, 0.0, 1.0],
            outline: outline.clone(),
            pieces: vec![outline],
            area: 0.0,
            fittings: Vec::new(),
            why: Vec::new(),
        });
    }
    assert_eq!(row(&see(&graph).vis.cells, 1, 3), [0, 1]);
    graph.specials = vec![SpecialPortal {
        name: String::new(),
        cell: CellId(0),
        shape: SpecialShape::Surface {
            normal: [0.0, 0.0, 1.0],
            pieces: vec![vec![
                [0.0, 0.0, 1.0],
                [1.0, 0.0, 1.0],
                [1.0, 1.0, 1.0],
                [0.0, 1.0, 1.0],
            ]],
        },
        passes: vec![Pass::new(Way::Mirror)],
    }];
    let vis = see(&graph);
    assert_eq!(row(&vis.vis.cells, 1, 3), [0, 1, 2]);
    assert!(vis.vis.undecided.n_pairs() == 0 && vis.n_cut == 0 && vis.n_chains == 1);
}

#[test]
fn a_monitor_shows_all_that_its_camera_sees() {
    let mut graph = room_grid(&GridParams::two_rooms()).graph;
    let see_row = |graph: &CellPortalGraph, c| row(&see(graph).vis.cells, c, 1 << 20);
    let rooms: Vec<CellId> = graph.indoor_cells().map(|(id, _)| id).collect();
    graph.portals.clear();
    graph.cells.iter_mut().for_each(|c| c.portals.clear());
    let [low, high] = graph[rooms[1]].aabb;
    let middle = |k: usize| (low[k] + high[k]) / 2.0;
    let monitor = |cell: CellId, eye| SpecialPortal {
        name: String::new(),
        cell,
        shape: SpecialShape::Surface {
            normal: [1.0, 0.0, 0.0],
            pieces: vec![vec![
                [0.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, 1.0, 1.0],
                [0.0, 0.0, 1.0],
            ]],
        },
        passes: vec![Pass::new(Way::Monitor(MonitorCamera {
            eye,
            toward: [1.0, 0.0, 0.0],
            up: [0.0, 1.0, 0.0],
            fov_y: 1.0,
        }))],
    };
    let own = rooms[0].0;
    assert_eq!(see_row(&graph, own), [own]);
    graph.specials = vec![monitor(rooms[0], [middle(0), middle(1), middle(2)])];
    assert_eq!(see_row(&graph, own), [own, rooms[1].0]);
    assert_eq!(see_row(&graph, rooms[1].0), [rooms[1].0]);
}

/// Rooms without a doorway, each of which leads on into the next; the last shows what a camera in the first sees.
#[test]
fn what_is_beyond_a_bound_may_lead_on() {
    let mut graph = row_of_rooms(&[[0.2, 0.8, 0.2, 0.8]; 5]);
    graph.portals.clear();
    let special = |cell: u32, way| SpecialPortal {
        name: String::new(),
        cell: CellId(cell),
        shape: SpecialShape::Surface {
            normal: [1.0, 0.0, 0.0],
            pieces: vec![window([0.2, 0.8, 0.2, 0.8], cell as f32 + 1.0)],
        },
        passes: vec![Pass::new(way)],
    };
    let lead = |to| Way::Lead {
        to: CellId(to),
        map: Similarity::IDENTITY,
        back: None,
    };
    // As every cell is found by its box.
    graph.locator = room_grid(&GridParams::two_rooms()).graph.locator;
    let camera = MonitorCamera {
        eye: [1e6, 0.0, 0.0],
        toward: [1.0, 0.0, 0.0],
        up: [0.0, 1.0, 0.0],
        fov_y: 1.0,
    };
    graph.specials = (0..3).map(|c| special(c, lead(c + 1))).collect();
    let rows = |max_specials, graph: &CellPortalGraph| {
        let config = VisConfig {
            max_specials,
            ..VisConfig::default()
        };
        let vis = see_by(graph, None, &config);
        let cells = vis.vis.cells;
        ([0, 1, 2, 3].map(|c| row(&cells, c, 4)), vis.n_cut)
    };
    let all = [vec![0, 1, 2, 3], vec![1, 2, 3], vec![2, 3], vec![3]];
    assert_eq!(rows(4, &graph), (all.clone(), 0));
    assert_eq!(rows(0, &graph), (all.clone(), 3));
    // The surroundings of the locator are the cell of an eye far away.
    Arc::make_mut(&mut graph.locator).outside = Some(CellId(0));
    graph.specials.push(special(3, Way::Monitor(camera)));
    let everything = vec![0, 1, 2, 3];
    for depth in [0, 4] {
        assert_eq!(
            rows(depth, &graph).0,
            [0; 4].map(|_| everything.clone()),
            "{depth}"
        );
    }
}

#[test]
fn without_special_portals_nothing_changes_and_with_them_no_evidence_is_written() {
    let world = room_grid(&GridParams::offices(8, 2));
    let config = VisConfig {
        has_evidence: true,
        ..VisConfig::default()
    };
    let mut on_round = |_, _| true;
    let mut context = VisContext {
        on_round: &mut on_round,
        walls: None,
        checkpoint: None,
    };
    let plain = see_all(&SightGraph::of_graph(&world.graph), &config, &mut context).unwrap();
    let vis = see_world(&world.graph, &config, &mut context).unwrap();
    assert_eq!(vis.vis, plain);
    assert_eq!(vis.through.n_pairs(), 0);
    let special = with_specials(world, 1, 1);
    let refused = see_world(&special.graph, &config, &mut context);
    assert_eq!(refused.unwrap_err(), VisError::SpecialEvidence);
}

/// Whole-world tracing of rays: matrices in place of similarities.
struct Tracer {
    structure: Bvh,
    specials: Vec<(Vec<DVec3>, DVec3, DMat3, DVec3)>,
}

impl Tracer {
    fn new(world: &World) -> Self {
        let specials = world.graph.special_ids().map(|id| {
            let (normal, pieces) = world.graph.special_opening(id);
            let polygon = pieces[0].points.clone();
            let (linear, offset) = match &world.graph.specials[id.idx()].passes[0].way {
                Way::Mirror => {
                    let n =
                        DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
                    let linear = DMat3::IDENTITY - n * 2.0;
                    (linear, polygon[0] - linear * polygon[0])
                }
                Way::Lead { map, .. } => (DMat3::from_quat(map.turn) * map.scale, map.at),
                Way::Through | Way::Monitor(_) => panic!("not in this world"),
            };
            (polygon, normal, linear, offset)
        });
        Self {
            specials: specials.collect(),
            structure: Bvh::build(&walls_of(world)),
        }
    }

    /// Calls `visit` with the ends of each free piece of a ray, and the number of special portals before it.
    fn trace(&self, mut ray: Ray, depth: usize, visit: &mut dyn FnMut(DVec3, DVec3, usize)) {
        for n_passed in 0..=depth {
            ray.t_max = f64::INFINITY;
            let wall = self.structure.closest_hit(&ray, |_| false);
            let mut end = wall.map_or(0.0, |hit| hit.t);
            let mut passed = None;
            for (i, (polygon, normal, ..)) in self.specials.iter().enumerate() {
                let along = normal.dot(ray.direction);
                let t = normal.dot(polygon[0] - ray.origin) / along;
                if along <= 0.0 || t <= 1e-9 || t >= end {
                    continue;
                }
                let p = ray.origin + ray.direction * t;
                let is_in = (0..polygon.len()).all(|k| {
                    let (a, b) = (polygon[k], polygon[(k + 1) % polygon.len()]);
                    normal.cross(b - a).dot(p - a) > 0.0
                });
                if is_in {
                    (end, passed) = (t, Some(i));
                }
            }
            let on = ray.origin + ray.direction * end;
            visit(ray.origin, on, n_passed);
            let Some(i) = passed else { return };
            let (_, _, linear, offset) = &self.specials[i];
            ray.origin = *linear * on + *offset;
            ray.direction = (*linear * ray.direction).normalize();
        }
    }
}

#[test]
fn no_cell_that_rays_reach_through_special_portals_is_missing() {
    let (mut n_hits, mut n_deep, mut n_pairs, mut n_found) = (0, 0, 0, 0);
    for seed in 0..10 {
        let params = GridParams {
            outdoors: seed % 2 == 0,
            windows: 0.2,
            furniture: 0,
            ..GridParams::offices(4 + seed as usize * 2, seed)
        };
        let world = with_specials(room_grid(&params), 1 + seed as usize / 2, seed);
        let walls = walls_of(&world);
        let vis = see_by(&world.graph, Some(&walls), &VisConfig::default());
        let (pvs, tracer, mut rng) = (&vis.vis.cells, Tracer::new(&world), Rng::new(seed));
        let mut found = HashSet::new();
        for _ in 0..40_000 {
            let cell = &world.graph.cells[rng.below(world.graph.cells.len())];
            let [low, high] = cell.aabb.map(point);
            let share = DVec3::from_array([0, 1, 2].map(|_| rng.range(0.01, 0.99)));
            let eye = low + (high - low) * share;
            let Some(from) = world.graph.locator.locate(eye) else {
                continue;
            };
            let mut direction = DVec3::from_array([0, 1, 2].map(|_| rng.range(-1.0, 1.0)));
            let here: Vec<SpecialId> = (world.graph.special_ids())
                .filter(|s| world.graph.specials[s.idx()].cell == from)
                .collect();
            if !here.is_empty() && rng.chance(0.5) {
                let aim = &tracer.specials[here[rng.below(here.len())].idx()].0;
                direction = aim[0].lerp(aim[2], rng.range(0.01, 0.99)) - eye;
            }
            let ray = Ray {
                origin: eye,
                direction: direction.normalize(),
                t_max: f64::INFINITY,
            };
            tracer.trace(ray, 8, &mut |a, b, n_passed| {
                for share in [0.01, 0.2, 0.5, 0.8, 0.99] {
                    let p = a.lerp(b, share);
                    if tracer.structure.nearest(p, 1e-3).is_some() {
                        continue;
                    }
                    let Some(to) = world.graph.locator.locate(p) else {
                        continue;
                    };
                    assert!(
                        pvs.sees(from, to),
                        "seed {seed}: {from} {to} by {n_passed} from {eye}"
                    );
                    found.insert((from, to));
                    n_hits += 1;
                    n_deep += usize::from(n_passed > 1);
                }
            });
        }
        n_pairs += pvs.n_pairs();
        n_found += found.len();
    }
    // Tightness: random rays miss much of what can be seen.
    assert!(2 * n_found > n_pairs, "{n_found} of {n_pairs} pairs");
    assert!(n_hits > 500_000 && n_deep > 5_000, "{n_hits} {n_deep}");
}

#[test]
fn everything_in_a_cell_seen_through_a_special_portal_is_among_its_parts() {
    for seed in 0..4 {
        let world = with_specials(room_grid(&GridParams::offices(6, seed)), 2, seed);
        let vis = see(&world.graph);
        let pvs = &vis.vis.cells;
        let (volumes, parts) = see_parts_through(&world, pvs, &vis.through).unwrap();
        let coarse = see_parts(&world, pvs).unwrap();
        let numbers = PartNumbers::new(&world);
        let mut n = 0;
        for (pair, (from, to)) in pvs.pairs().enumerate() {
            if !vis.through.sees(from, to) {
                continue;
            }
            for (i, batch) in world.batches.iter().enumerate() {
                for part in numbers.of_batch(i).filter(|_| batch.cells.contains(&to)) {
                    for parts in [&parts, &coarse.1] {
                        let is_in = |run: &[u32; 2]| (run[0]..run[1]).contains(&part);
                        assert!(parts.runs_of(pair).iter().any(is_in), "{seed}: {from} {to}");
                    }
                    n += 1;
                }
            }
            assert_eq!(volumes.pieces_of(pair).count(), 1);
        }
        assert!(n > 0);
    }
}

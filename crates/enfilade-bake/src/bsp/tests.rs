use std::collections::BTreeSet;

use enfilade_geom::scene::{Entity, Mesh, Object, Primitive, Role, Scene};
use enfilade_geom::{Aabb, ConvexSolid, DMat4, DVec3, Plane, Winding};
use enfilade_testkit::{Rng, clinic};

use super::cells;
use super::input::BspInput;
use super::*;
use crate::complex::poly;
use crate::{BakeConfig, BakeContext, Method, Silent, bake};

fn boxed(min: [f64; 3], max: [f64; 3]) -> ConvexSolid {
    let mut planes = Vec::new();
    for (axis, n) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
        planes.push(Plane {
            normal: n,
            d: -max[axis],
        });
        planes.push(Plane {
            normal: -n,
            d: min[axis],
        });
    }
    ConvexSolid::from_planes(&planes, 1e4, 1e-6).unwrap()
}

/// Rooms of 4 × 3 × 4 m in a row, walls half a meter thick, a doorway of 1 × 2 m between neighbors.
fn row(n: usize) -> Vec<ConvexSolid> {
    let length = 4.5 * n as f64;
    let mut out = vec![
        boxed([-0.5, -0.5, -0.5], [length, 0.0, 4.5]),
        boxed([-0.5, 3.0, -0.5], [length, 3.5, 4.5]),
        boxed([-0.5, 0.0, -0.5], [length, 3.0, 0.0]),
        boxed([-0.5, 0.0, 4.0], [length, 3.0, 4.5]),
        boxed([-0.5, 0.0, 0.0], [0.0, 3.0, 4.0]),
    ];
    for i in 0..n {
        let x = 4.5 * i as f64 + 4.0;
        if i + 1 == n {
            out.push(boxed([x, 0.0, 0.0], [x + 0.5, 3.0, 4.0]));
        } else {
            out.push(boxed([x, 0.0, 0.0], [x + 0.5, 3.0, 1.0]));
            out.push(boxed([x, 0.0, 2.0], [x + 0.5, 3.0, 4.0]));
            out.push(boxed([x, 2.0, 1.0], [x + 0.5, 3.0, 2.0]));
        }
    }
    out
}

fn bsp_of(
    solids: &[ConvexSolid],
    inside: &[DVec3],
    heuristic: Heuristic,
    guide: &Guide,
) -> Bsp<'static> {
    Bsp::build(
        &BspInput {
            triangles: &[],
            objects: &[],
            solids,
            inside,
        },
        heuristic,
        guide,
    )
}

const INSIDE: DVec3 = DVec3::new(2.0, 1.0, 2.0);

/// Random boxes in a closed hall, on a lattice so that planes coincide often.
fn hall(rng: &mut Rng, n: usize) -> Vec<ConvexSolid> {
    let mut out = row(1);
    // Wider: 16 × 6 × 16.
    out.clear();
    let (lo, hi) = ([-1.0, -1.0, -1.0], [17.0, 7.0, 17.0]);
    for axis in 0..3 {
        let (mut a, mut b) = (hi, lo);
        a[axis] = lo[axis] + 1.0;
        b[axis] = hi[axis] - 1.0;
        out.push(boxed(lo, a));
        out.push(boxed(b, hi));
    }
    for _ in 0..n {
        let min = [rng.below(15) as f64, 0.0, rng.below(15) as f64];
        let size = [
            1.0 + rng.below(8) as f64,
            1.0 + rng.below(6) as f64,
            1.0 + rng.below(8) as f64,
        ];
        let max = [0, 1, 2].map(|k| (min[k] + size[k]).min(hi[k] - 0.5));
        out.push(boxed(min, max));
    }
    out
}

/// Returns the tree of a random hall, for tests of other modules.
pub(super) fn random_hall(seed: u64) -> Bsp<'static> {
    let solids = hall(&mut Rng::new(seed), 9);
    bsp_of(&solids, &[], Heuristic::Default, &Guide::default())
}

// Covers B1 and B2.
#[test]
fn leaves_fill_what_the_solids_leave_free() {
    let mut rng = Rng::new(3);
    for _ in 0..30 {
        let solids = hall(&mut rng, 6);
        let eye = (0..1000)
            .map(|_| DVec3::new(rng.unit() * 16.0, rng.unit() * 6.0, rng.unit() * 16.0))
            .find(|&p| !solids.iter().any(|s| s.contains(p, -1e-3)))
            .unwrap();
        for heuristic in [
            Heuristic::Default,
            Heuristic::MinCut,
            Heuristic::MaxArea,
            Heuristic::MaxOrtho,
        ] {
            let bsp = bsp_of(&solids, &[], heuristic, &Guide::default());
            // The oracle is the solids themselves.
            for _ in 0..300 {
                let p = DVec3::new(
                    rng.unit() * 18.0 - 1.0,
                    rng.unit() * 8.0 - 1.0,
                    rng.unit() * 18.0 - 1.0,
                );
                let near = solids.iter().any(|s| s.contains(p, -1e-3));
                let deep = solids.iter().any(|s| s.contains(p, 1e-3));
                let leaf = bsp.tree.leaf_of(p) as usize;
                let is_open = bsp.is_open[leaf];
                let shape = shape::shapes(&bsp.tree, &bsp.tolerance, bsp.purse)[leaf];
                assert!(
                    if deep { !is_open } else { near || is_open },
                    "{p} {heuristic:?} deep {deep} {:?} {shape:?}",
                    bsp.tree.contents[leaf]
                );
            }
            let inner = bsp_of(&solids, &[eye], heuristic, &Guide::default());
            assert!(inner.leak().is_none());
            assert!(inner.counts().n_leaves < bsp.counts().n_leaves);
        }
    }
}

/// Returns `true` if `p` is in or on a solid.
fn is_on_solid(solids: &[ConvexSolid], p: DVec3, eps: f64) -> bool {
    solids.iter().any(|s| s.contains(p, -eps))
}

#[test]
fn rims_of_separators_are_on_solids_or_on_their_own_portals() {
    let mut rng = Rng::new(11);
    let mut n_found = 0;
    for _ in 0..40 {
        let solids = hall(&mut rng, 9);
        let bsp = bsp_of(&solids, &[], Heuristic::Default, &Guide::default());
        let found = separator::find(&bsp);
        for s in &found {
            for &p in &s.portals {
                let points = &bsp.portals[p as usize].points;
                for i in 0..points.len() {
                    let (a, b) = (points[i], points[(i + 1) % points.len()]);
                    for k in 0..=20 {
                        let at = a.lerp(b, f64::from(k) / 20.0);
                        let on_own = s.portals.iter().filter(|&&o| o != p).any(|&o| {
                            Winding::new(bsp.portals[o as usize].points.to_vec())
                                .contains_in_plane(at, 1e-4)
                        });
                        assert!(on_own || is_on_solid(&solids, at, 1e-3), "{at}");
                    }
                }
            }
        }
        let parted = cells::part(&bsp, found);
        n_found += parted.separators.len();
        // Without any one of them, two cells merge.
        for i in 0..parted.separators.len() {
            let mut others = parted.separators.clone();
            others.remove(i);
            assert_eq!(
                cells::components(&bsp, &others).1 + 1,
                parted.n_cells.max(1),
                "{i}"
            );
        }
    }
    assert!(n_found > 20, "{n_found}");
}

#[test]
fn a_row_of_rooms_has_a_cell_a_room_and_a_cell_a_doorway() {
    for n in [1, 2, 5] {
        let bsp = bsp_of(&row(n), &[INSIDE], Heuristic::Default, &Guide::default());
        let g = bsp.grouping();
        assert_eq!((g.n_cells, g.n_separators), (2 * n - 1, 2 * (n - 1)), "{n}");
    }
}

#[test]
fn guides_cut_first_and_change_no_space() {
    let guide = Guide {
        grid: Some(1.3),
        tetrahedra: Some(2.0),
        planes: vec![Plane::through(
            INSIDE,
            DVec3::new(1.0, 2.0, 3.0).normalize(),
        )],
        boxes: vec![Aabb::new(DVec3::ONE, DVec3::splat(2.5))],
    };
    let plain = bsp_of(&row(2), &[INSIDE], Heuristic::Default, &Guide::default());
    let guided = bsp_of(&row(2), &[INSIDE], Heuristic::Default, &guide);
    assert!(guided.counts().n_leaves > 5 * plain.counts().n_leaves);
    let volume = |b: &Bsp<'_>| -> f64 {
        let shapes = shape::shapes(&b.tree, &b.tolerance, b.purse);
        shapes
            .iter()
            .zip(&b.is_open)
            .filter(|s| *s.1)
            .filter_map(|s| s.0.map(|s| s.volume))
            .sum()
    };
    // Two rooms of 48 m³ and a doorway of half a meter by 1 × 2 m.
    for b in [&plain, &guided] {
        assert!((volume(b) - 97.0).abs() < 1e-3, "{}", volume(b));
    }
    // Every grid plane through the rooms is a plane of portals.
    let planes: BTreeSet<u32> = guided.portals.iter().map(|p| p.plane).collect();
    assert!(planes.len() > 20);
}

#[test]
fn a_gap_is_a_leak_and_the_way_out_is_open() {
    let mut solids = row(2);
    assert!(
        bsp_of(&solids, &[INSIDE], Heuristic::Default, &Guide::default())
            .leak()
            .is_none()
    );
    // The ceiling of the first room ends early.
    solids[1] = boxed([0.5, 3.0, -0.5], [9.0, 3.5, 4.5]);
    let bsp = bsp_of(&solids, &[INSIDE], Heuristic::Default, &Guide::default());
    let leak = bsp.leak().expect("it leaks");
    assert_eq!(leak.points[0], INSIDE);
    assert!(leak.points.last().unwrap().y > 3.0 || leak.points.len() > 2);
    for way in leak.points.windows(2) {
        for k in 0..=50 {
            let p = way[0].lerp(way[1], f64::from(k) / 50.0);
            assert!(
                !solids.iter().any(|s| s.contains(p, 1e-4)),
                "{p} is in matter"
            );
        }
    }
    // The tree can still be baked.
    assert!(bsp.counts().n_leaves > 0);
}

#[test]
fn the_pieces_of_a_tree_have_the_area_of_what_went_in() {
    let mut rng = Rng::new(5);
    let solids = hall(&mut rng, 12);
    let bsp = bsp_of(&solids, &[], Heuristic::MaxArea, &Guide::default());
    let area = |f: &[tree::Fragment]| f.iter().map(|f| poly::area(&f.points)).sum::<f64>();
    let (before, after) = (area(&bsp.surfaces), area(&bsp.tree.on_plane));
    assert!((before - after).abs() < 1e-6 * before, "{before} {after}");
    assert!(bsp.counts().n_splits > 0);
}

#[test]
fn the_clinic_is_cut_as_much_as_that_of_the_paper() {
    // Lefebvre & Hornus 2003, table 1: 11,597 polygons in, 27,241 out.
    let scene = clinic(11_597, 1);
    let lights: Vec<DVec3> = scene.entities.iter().filter_map(|e| e.position).collect();
    let bsp = bsp_of(
        &scene.solids,
        &lights,
        Heuristic::Default,
        &Guide::default(),
    );
    assert!(bsp.leak().is_none());
    let c = bsp.counts();
    let (size, growth) = (
        c.n_faces as f64 / 11_597.0,
        c.n_pieces as f64 / c.n_faces as f64,
    );
    assert!((0.95..1.05).contains(&size), "{} faces", c.n_faces);
    assert!(
        (2.2..2.5).contains(&growth),
        "{growth} times as many pieces"
    );
    assert!(c.n_faces < c.n_polygons && c.n_splits > 0);
}

/// Returns the solids as a scene, like that of the map importer.
fn scene_of(solids: &[ConvexSolid], inside: &[DVec3]) -> Scene {
    let mut primitive = Primitive::default();
    for w in solids.iter().flat_map(|s| &s.faces) {
        let first = primitive.positions.len() as u32;
        primitive
            .positions
            .extend(w.points.iter().map(|p| p.as_vec3().to_array()));
        let n = w.points.len() as u32;
        primitive
            .indices
            .extend((1..n - 1).flat_map(|k| [first, first + k, first + k + 1]));
    }
    Scene {
        meshes: vec![Mesh {
            name: String::new(),
            primitives: vec![primitive],
        }],
        objects: vec![Object {
            name: "world".into(),
            mesh: 0,
            transform: DMat4::IDENTITY,
            role: Role::Structural,
            reason: "map: brushes of worldspawn".into(),
            filling: None,
            node: None,
        }],
        solids: solids.to_vec(),
        entities: inside
            .iter()
            .map(|&p| Entity {
                class: "light".into(),
                position: Some(p),
                ..Entity::default()
            })
            .collect(),
        ..Scene::default()
    }
}

fn baked(scene: &Scene, config: &BakeConfig) -> enfilade_cpg::World {
    let out = bake(scene, config, &BakeContext::new(&Silent, None)).unwrap();
    out.world.validate().unwrap();
    out.world
}

#[test]
fn worlds_keep_their_promises_whatever_the_settings() {
    use enfilade_verify::{VerifyOptions, verify_world};
    let mut rng = Rng::new(23);
    let mut with_void = BakeConfig::of(Method::Bsp);
    with_void.costs.min_cost = 30.0;
    let mut small = BakeConfig::of(Method::Bsp);
    small.costs.max_cost = Some(20.0);
    let mut guided = BakeConfig::of(Method::Bsp);
    guided.bsp.guide.tetrahedra = Some(5.0);
    for (i, config) in [BakeConfig::of(Method::Bsp), with_void, small, guided]
        .iter()
        .enumerate()
    {
        for solids in [row(3), hall(&mut rng, 7)] {
            for inside in [vec![], vec![INSIDE]] {
                let mut scene = scene_of(&solids, &inside);
                if i == 1 {
                    // As triangles not known to be solids.
                    scene.solids.clear();
                }
                let world = baked(&scene, config);
                let options = VerifyOptions {
                    rays: 4000,
                    ..VerifyOptions::default()
                };
                let report = verify_world(&world, None, &options);
                assert!(report.holds(), "{i}: {report:?}");
            }
        }
    }
}

#[test]
fn rooms_of_a_row_are_found_and_large_ones_are_cut() {
    let scene = scene_of(&row(3), &[INSIDE]);
    let count = |config: &BakeConfig| {
        let g = baked(&scene, config).graph;
        (g.cells.len(), g.portals.len())
    };
    // Every separator: both faces of each wall, with the doorway between them as a cell.
    assert_eq!(count(&BakeConfig::of(Method::Bsp)), (5, 4));
    // With shape, a doorway is part of a room.
    let mut by_shape = BakeConfig::of(Method::Bsp);
    by_shape.bsp.rooms = Rooms::Always;
    assert_eq!(count(&by_shape), (3, 2));
    let mut config = BakeConfig::of(Method::Bsp);
    config.costs.max_cost = Some(8.0);
    assert!(count(&config).0 > 5);
}

// Covers B8.
#[test]
fn a_building_of_overlapping_walls_has_a_cell_a_room_however_it_is_turned() {
    // Walls that run into each other and into the slabs, as triangles not known to be solids.
    let mut solids = row(3);
    solids.push(boxed([-0.3, -0.3, -0.4], [13.4, 3.2, 0.0]));
    solids.push(boxed([4.1, -0.2, 3.0], [4.3, 3.3, 4.4]));
    for turn in [0.0, 0.3, 1.1_f64] {
        let mut scene = scene_of(&solids, &[]);
        scene.solids.clear();
        scene.objects[0].transform = DMat4::from_rotation_y(turn);
        let g = baked(&scene, &BakeConfig::of(Method::Bsp)).graph;
        let rooms: Vec<f64> = g
            .cells
            .iter()
            .filter(|c| !c.outdoor)
            .map(|c| c.volume.into())
            .collect();
        assert_eq!(rooms.len(), 3, "{turn}: {rooms:?}");
        // 4 × 3 × 4 m each, and two doorways of 1 m³ that are part of a room beside them.
        assert!(
            rooms.iter().all(|v| (47.9..50.1).contains(v)),
            "{turn}: {rooms:?}"
        );
        assert_eq!(g.portals.len(), 2, "{turn}");
    }
}

#[test]
fn the_hollow_behind_a_lining_is_no_room_but_a_deeper_closet_is() {
    for (depth, n) in [(0.4, 2), (0.7, 3)] {
        for turn in [0.0, 0.3_f64] {
            let mut solids = row(2);
            // A panel of 5 cm in front of a wall, with a hatch of half a meter.
            let (a, b) = (4.0 - depth - 0.05, 4.0 - depth);
            solids.push(boxed([0.0, 0.0, a], [3.4, 3.0, b]));
            solids.push(boxed([3.9, 0.0, a], [4.0, 3.0, b]));
            solids.push(boxed([3.4, 0.0, a], [3.9, 0.2, b]));
            solids.push(boxed([3.4, 0.7, a], [3.9, 3.0, b]));
            let mut scene = scene_of(&solids, &[]);
            scene.solids.clear();
            scene.objects[0].transform = DMat4::from_rotation_y(turn);
            let g = baked(&scene, &BakeConfig::of(Method::Bsp)).graph;
            let rooms = g.cells.iter().filter(|c| !c.outdoor);
            let volumes: Vec<f32> = rooms.map(|c| c.volume).collect();
            assert_eq!(volumes.len(), n, "{depth} {turn}: {volumes:?}");
            // The hollow is still air, and part of the room into which it leaks.
            let sum: f32 = volumes.iter().sum();
            assert!((95.0..97.5).contains(&sum), "{depth} {turn}: {volumes:?}");
        }
    }
}

// Covers B5.
#[test]
fn a_doorway_that_the_tree_cuts_by_its_jambs_is_found_all_the_same() {
    // Guides along the jambs and the lintel leave no cut in the planes of the walls.
    let guide = Guide {
        boxes: vec![Aabb::new(
            DVec3::new(-0.1, 0.0, 1.0),
            DVec3::new(8.6, 2.0, 2.0),
        )],
        ..Guide::default()
    };
    let mut bsp = bsp_of(&row(2), &[INSIDE], Heuristic::Default, &guide);
    let faces = |bsp: &Bsp<'_>| {
        let at = |s: &separator::Separator, x: f64| {
            let plane = &bsp.tree.planes[s.plane as usize];
            plane.normal.x.abs() == 1.0
                && plane.signed_distance(DVec3::new(x, 0.0, 0.0)).abs() < 1e-3
        };
        let found = separator::find(bsp);
        [4.0, 4.5].map(|x| {
            found
                .iter()
                .any(|s| at(s, x) && (s.area - 2.0).abs() < 1e-6)
        })
    };
    assert_eq!(faces(&bsp), [false; 2], "the guide hides them");
    arrange::refine(&mut bsp, &crate::MergeSettings::default());
    assert_eq!(faces(&bsp), [true; 2]);
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let mut rng = Rng::new(31);
    let scene = scene_of(&hall(&mut rng, 12), &[]);
    let mut config = BakeConfig::of(Method::Bsp);
    config.costs.min_cost = 40.0;
    let bytes = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(n)
            .build()
            .unwrap();
        pool.install(|| enfilade_cpg::wire::encode_glb(&baked(&scene, &config)).unwrap())
    };
    assert!(bytes(1) == bytes(4));
}

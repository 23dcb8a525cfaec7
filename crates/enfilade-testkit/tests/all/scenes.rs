//! Guarantees of all generated scenes: closed solids, a consistent truth, open openings, separate rooms.

use enfilade_geom::scene::Role;
use enfilade_geom::{Aabb, DVec3, Triangle};
use enfilade_testkit::oracle::{
    FloodGrid, n_open_edges, segment_is_blocked, structural_triangles, winding_number,
};
use enfilade_testkit::{
    Convex, Fault, Generated, OpeningKind, Rng, Side, TowerParams, Variant, cave, dirkse_maze,
    furnished_house, gjorup_cavern, gjorup_rooms, mixed, office_tower, rotated, scaled, shuffled,
};

/// Returns the triangles whose box is near `bounds`, to keep the brute-force rays short.
fn near(triangles: &[Triangle], bounds: Aabb) -> Vec<Triangle> {
    triangles
        .iter()
        .filter(|t| Aabb::of_points(*t).overlaps(&bounds))
        .copied()
        .collect()
}

fn check_solids_are_closed(g: &Generated) {
    let mut per_object = vec![Vec::new(); g.scene.objects.len()];
    for role in [Role::Structural, Role::Detail] {
        for s in g.scene.triangle_sources(role) {
            per_object[s.object as usize].push(g.scene.world_triangle(s));
        }
    }
    for (o, triangles) in g.scene.objects.iter().zip(&per_object) {
        assert!(!triangles.is_empty(), "{} is empty", o.name);
        assert_eq!(n_open_edges(triangles), 0, "{} is open", o.name);
    }
}

fn check_truth_is_in_order(g: &Generated) {
    assert_eq!(g.truth.faults(), Vec::<String>::new());
    let triangles = structural_triangles(&g.scene);
    for room in &g.truth.rooms {
        for &p in &room.sample_points {
            assert!(
                room.contains(p, 0.0),
                "{}: {p} is not in the room",
                room.name
            );
            let w = winding_number(&triangles, p);
            // Rooms and caves without thickness are enclosed by surfaces that face them.
            let hollow = ["gjorup", "cave"]
                .iter()
                .any(|n| g.truth.scene.starts_with(n));
            let solid = if hollow { w != -1 } else { w > 0 };
            assert!(!solid, "{}: {p} lies in a solid", room.name);
        }
    }
}

/// At least the fraction `share` of 49 rays along the normal pass each opening, counted like
/// `clear_fraction` in the shared scenes.
fn check_openings_are_open(g: &Generated, share: f64) {
    let triangles = structural_triangles(&g.scene);
    for o in &g.truth.openings {
        let reach = o.normal * (o.thickness * 0.5 + 0.02);
        let mut bounds = Aabb::of_points(&o.corners);
        for c in o.corners {
            bounds = bounds.including(c + reach).including(c - reach);
        }
        let close = near(&triangles, bounds.expanded(0.01));
        let mut clear = 0;
        for i in 0..49 {
            let (u, v) = (
                (f64::from(i % 7) + 0.5) / 7.0,
                (f64::from(i / 7) + 0.5) / 7.0,
            );
            let low = o.corners[0].lerp(o.corners[1], u);
            let p = low.lerp(o.corners[3].lerp(o.corners[2], u), v);
            clear += i32::from(!segment_is_blocked(&close, p - reach, p + reach));
        }
        assert!(
            f64::from(clear) >= share * 49.0,
            "{}: {clear} of 49 rays",
            o.name
        );
    }
}

/// Just outside the rim of each opening there is wall, on at least two sides.
fn check_openings_fill_their_holes(g: &Generated) {
    let triangles = structural_triangles(&g.scene);
    for o in g
        .truth
        .openings
        .iter()
        .filter(|o| o.kind != OpeningKind::Virtual)
    {
        let reach = o.normal * (o.thickness * 0.5 + 0.02);
        let close = near(
            &triangles,
            Aabb::of_points(&o.corners).expanded(o.thickness + 0.1),
        );
        let mut stopped = 0;
        for i in 0..4 {
            let edge = o.corners[i].midpoint(o.corners[(i + 1) % 4]);
            // 2 cm, since mullions are 5 cm wide.
            let p = edge + (edge - o.center).normalize() * 0.02;
            stopped += i32::from(segment_is_blocked(&close, p - reach, p + reach));
        }
        assert!(stopped >= 2, "{}: a wall on {stopped} sides", o.name);
    }
}

/// With all openings plugged, voxel regions and rooms coincide. Plugs are openings scaled by `plug`.
fn check_rooms_are_apart(g: &Generated, voxel: f64, plug: f64) {
    let mut triangles = structural_triangles(&g.scene);
    let mut bounds = Aabb::EMPTY;
    for room in &g.truth.rooms {
        bounds = bounds.union(room.aabb());
    }
    let bounds = bounds.expanded(1.0);
    for o in g
        .truth
        .openings
        .iter()
        .filter(|o| o.kind != OpeningKind::Virtual)
    {
        let [a, b, c, d] = o.corners.map(|c| o.center + (c - o.center) * plug);
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    let grid = FloodGrid::new(&triangles, bounds, voxel);
    let outside = grid.region_at(bounds.max - 0.01);
    assert!(outside.is_some());
    let mut group: Vec<usize> = (0..g.truth.rooms.len()).collect();
    for o in g
        .truth
        .openings
        .iter()
        .filter(|o| o.kind == OpeningKind::Virtual)
    {
        if let [Side::Room(a), Side::Room(b)] = o.rooms {
            let (from, to) = (group[a], group[b]);
            group
                .iter_mut()
                .filter(|x| **x == from)
                .for_each(|x| *x = to);
        }
    }
    let mut regions: Vec<Option<u32>> = vec![None; g.truth.rooms.len()];
    for (i, room) in g.truth.rooms.iter().enumerate() {
        for &p in &room.sample_points {
            let Some(region) = grid.region_at(p) else {
                continue;
            };
            let first = regions[group[i]].get_or_insert(region);
            assert_eq!(*first, region, "{} falls apart at {p}", room.name);
        }
        assert!(regions[group[i]].is_some(), "{} is all solid", room.name);
        assert_ne!(regions[group[i]], outside, "{} leaks out", room.name);
    }
    let mut seen: Vec<u32> = (0..regions.len())
        .filter(|&i| group[i] == i)
        .filter_map(|i| regions[i])
        .collect();
    let n = seen.len();
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(
        seen.len(),
        n,
        "two rooms of {} are one region",
        g.truth.scene
    );
}

/// Compares a Monte Carlo estimate of each room's air with the truth.
fn check_volumes(g: &Generated) {
    let triangles = structural_triangles(&g.scene);
    let mut rng = Rng::new(5);
    for room in &g.truth.rooms {
        let b = room.aabb();
        let mut air = 0;
        // Stairs are a few percent of their room, which takes a finer estimate to see.
        let empty: f64 = room.parts.iter().map(Convex::volume).sum();
        let n = if room.volume < empty { 20_000 } else { 300 };
        for _ in 0..n {
            let p = b.min + b.size() * DVec3::new(rng.unit(), rng.unit(), rng.unit());
            air += i32::from(room.contains(p, 0.0) && winding_number(&triangles, p) <= 0);
        }
        let share = f64::from(air) / f64::from(n);
        let estimate = share * b.volume();
        // Five standard deviations of the estimate.
        let slack = 5.0 * (share * (1.0 - share) / f64::from(n)).sqrt() * b.volume() + 1e-6;
        let off = (estimate - room.volume).abs();
        assert!(
            off <= slack,
            "{}: {estimate} against {}",
            room.name,
            room.volume
        );
    }
}

fn check(g: &Generated, voxel: f64) {
    check_solids_are_closed(g);
    check_truth_is_in_order(g);
    check_openings_are_open(g, 0.8);
    check_openings_fill_their_holes(g);
    check_rooms_are_apart(g, voxel, 1.0);
}

#[test]
fn the_house_is_sound() {
    let g = furnished_house();
    check(&g, 0.1);
    check_volumes(&g);
}

#[test]
fn a_turned_house_is_sound() {
    let g = rotated(furnished_house(), 33.0);
    check_solids_are_closed(&g);
    check_truth_is_in_order(&g);
    check_openings_are_open(&g, 0.8);
    check_rooms_are_apart(&g, 0.08, 1.0);
}

#[test]
fn towers_of_all_kinds_are_sound() {
    let small = TowerParams {
        storeys: 2,
        rooms_per_storey: 8,
        ..TowerParams::default()
    };
    let g = office_tower(&small);
    check(&g, 0.1);
    check_volumes(&g);
    for seed in 0..3 {
        let params = TowerParams {
            storeys: 3,
            rooms_per_storey: 4 + 3 * seed as usize,
            seed,
            cracks: true,
            double_walls: true,
            leaves: true,
            ..TowerParams::default()
        };
        check(&office_tower(&params), 0.1);
    }
    let wide = TowerParams {
        storeys: 1,
        rooms_per_storey: 50,
        stairwell: false,
        ..small
    };
    check(&office_tower(&wide), 0.1);
}

#[test]
fn small_buildings_are_sound() {
    for g in mixed::all() {
        if g.truth.scene == "zero-thickness-rooms" {
            check_truth_is_in_order(&g);
            check_openings_are_open(&g, 1.0);
            check_rooms_are_apart(&g, 0.1, 1.0);
            continue;
        }
        // Stairs stand in stair holes.
        let share = if g.truth.scene == "stair-hall" {
            0.7
        } else {
            1.0
        };
        check_solids_are_closed(&g);
        check_truth_is_in_order(&g);
        check_openings_are_open(&g, share);
        check_openings_fill_their_holes(&g);
        check_rooms_are_apart(&g, 0.08, 1.0);
        check_volumes(&g);
    }
}

#[test]
fn buildings_with_faults_have_no_others() {
    for fault in Fault::ALL {
        let g = fault.build();
        assert_eq!(g.truth.scene, fault.name());
        check_solids_are_closed(&g);
        check_truth_is_in_order(&g);
        // A bay of a curtain wall is one window, with transoms across it.
        let share = if fault == Fault::CurtainWall {
            0.8
        } else {
            1.0
        };
        check_openings_are_open(&g, share);
        check_openings_fill_their_holes(&g);
        // Without floors and ceilings all rooms are one with the sky; a city has none.
        if fault != Fault::WallsAlone && !g.truth.rooms.is_empty() {
            check_rooms_are_apart(&g, 0.08, 1.0);
        }
        check_volumes(&g);
        let triangles = structural_triangles(&g.scene);
        for &p in &g.truth.matter {
            assert!(winding_number(&triangles, p) > 0, "{p} lies in no solid");
        }
    }
}

#[test]
fn the_models_of_the_theses_are_sound() {
    for degrees in [[0.0; 3], [7.0, 8.0, 9.0]] {
        for variant in [Variant::Optimised, Variant::Tessellated, Variant::Distorted] {
            let g = gjorup_rooms(variant, degrees);
            // The two ends of a distorted corridor are rotated against each other.
            let share = if variant == Variant::Distorted {
                0.6
            } else {
                1.0
            };
            check_truth_is_in_order(&g);
            check_openings_are_open(&g, share);
            check_rooms_are_apart(&g, 0.08, 1.0);
        }
        let g = gjorup_cavern(degrees);
        check_solids_are_closed(&g);
        check_truth_is_in_order(&g);
        check_openings_are_open(&g, 1.0);
        check_rooms_are_apart(&g, 0.1, 1.0);
    }
    let g = dirkse_maze(1);
    check_solids_are_closed(&g);
    assert_eq!(g.truth.faults(), Vec::<String>::new());
    check_openings_are_open(&g, 1.0);
    check_rooms_are_apart(&g, 0.12, 1.0);
}

#[test]
fn caves_are_sound() {
    for seed in 0..3 {
        let g = cave(seed);
        check_solids_are_closed(&g);
        check_truth_is_in_order(&g);
        // The square extends beyond the round, rough tunnel; half is the fraction from which
        // the shared scenes call an opening usable.
        check_openings_are_open(&g, 0.5);
        check_rooms_are_apart(&g, 0.15, 1.8);
        let triangles = structural_triangles(&g.scene);
        let bounds = g
            .truth
            .rooms
            .iter()
            .fold(Aabb::EMPTY, |b, r| b.union(r.aabb()));
        let grid = FloodGrid::new(&triangles, bounds.expanded(2.0), 0.15);
        let regions: Vec<_> = g
            .truth
            .rooms
            .iter()
            .map(|r| grid.region_at(r.sample_points[0]))
            .collect();
        assert!(regions[0].is_some() && regions.iter().all(|r| *r == regions[0]));
    }
}

fn bits(g: &Generated) -> Vec<u64> {
    let mut bits = Vec::new();
    for role in [Role::Structural, Role::Detail] {
        for s in g.scene.triangle_sources(role) {
            let corners = g.scene.world_triangle(s);
            bits.extend(corners.iter().flat_map(DVec3::to_array).map(f64::to_bits));
        }
    }
    bits
}

#[test]
fn the_same_seed_gives_the_same_scene_and_another_gives_another() {
    let tower = |seed| {
        office_tower(&TowerParams {
            cracks: true,
            ..TowerParams::with_rooms(30, seed)
        })
    };
    for make in [tower, cave, dirkse_maze] {
        let (a, b, c) = (make(1), make(1), make(2));
        assert!(bits(&a) == bits(&b) && a.truth_json() == b.truth_json());
        assert!(bits(&a) != bits(&c) && a.truth_json() != c.truth_json());
    }
}

#[test]
fn towers_have_the_requested_rooms() {
    for rooms in [4, 16, 64, 256, 1024, 4096] {
        let params = TowerParams::with_rooms(rooms, 1);
        let g = office_tower(&params);
        assert_eq!(g.truth.rooms.len(), rooms);
        assert_eq!(g.truth.faults(), Vec::<String>::new());
        let per_room = g.n_triangles(Role::Structural) / rooms;
        assert!(
            (80..300).contains(&per_room),
            "{per_room} triangles a room at {rooms} rooms"
        );
        if rooms >= 16 {
            // Constant density: between 40 and 80 m3 of air per room, whatever the size.
            let air = g.truth.rooms.iter().map(|r| r.volume).sum::<f64>() / rooms as f64;
            assert!(
                (40.0..80.0).contains(&air),
                "{air} m3 a room at {rooms} rooms"
            );
        }
    }
    for (storeys, rooms_per_storey) in [(1, 4), (7, 5), (2, 41), (3, 83)] {
        let g = office_tower(&TowerParams {
            storeys,
            rooms_per_storey,
            ..TowerParams::default()
        });
        assert_eq!(g.truth.rooms.len(), storeys * rooms_per_storey);
    }
}

#[test]
fn moving_a_scene_moves_its_truth_along() {
    let (plain, turned) = (
        mixed::stair_hall(),
        scaled(rotated(mixed::stair_hall(), 25.0), 2.0),
    );
    let back = DVec3::new(0.5, 0.5, 0.5);
    for (a, b) in plain.truth.openings.iter().zip(&turned.truth.openings) {
        let (sin, cos) = 25.0_f64.to_radians().sin_cos();
        let c = a.center;
        let want = DVec3::new(c.x * cos + c.z * sin, c.y, c.z * cos - c.x * sin);
        assert!((b.center * back).distance(want) < 1e-12);
        assert!((b.area() - 4.0 * a.area()).abs() < 1e-9);
        assert!((b.thickness - 2.0 * a.thickness).abs() < 1e-12);
    }
    for (a, b) in plain.truth.rooms.iter().zip(&turned.truth.rooms) {
        assert!((b.volume - 8.0 * a.volume).abs() < 1e-9);
        assert!(b.sample_points.iter().all(|&p| b.contains(p, 0.0)));
    }
    check_openings_are_open(&turned, 0.7);
}

#[test]
fn shuffling_keeps_every_triangle_and_moves_most() {
    let (plain, mixed_up) = (furnished_house(), shuffled(furnished_house(), 3));
    let triangles = |g: &Generated| {
        let mut all: Vec<[[u64; 3]; 3]> = bits(g)
            .chunks_exact(9)
            .map(|t| {
                let corner = |i: usize| [t[i * 3], t[i * 3 + 1], t[i * 3 + 2]];
                let mut t = [corner(0), corner(1), corner(2)];
                let first = (0..3).min_by_key(|&i| t[i]).unwrap_or(0);
                t.rotate_left(first);
                t
            })
            .collect();
        let in_order = all.clone();
        all.sort_unstable();
        (in_order, all)
    };
    // Two rooms are one object: there only the order within it can change.
    let one = [mixed::two_rooms(), shuffled(mixed::two_rooms(), 3)];
    for [x, y] in [[&plain, &mixed_up], [&one[0], &one[1]]] {
        let ((a, a_sorted), (b, b_sorted)) = (triangles(x), triangles(y));
        assert!(a_sorted == b_sorted);
        let same = a.iter().zip(&b).filter(|(x, y)| x == y).count();
        assert!(same * 20 < a.len(), "{same} of {} stayed", a.len());
    }
    assert_eq!(plain.truth, mixed_up.truth);
    check_solids_are_closed(&mixed_up);
}

#[test]
fn truth_json_is_json_of_the_agreed_shape() {
    let g = furnished_house();
    let json: serde_json::Value = serde_json::from_str(&g.truth_json()).expect("JSON");
    assert_eq!(json["schema_version"], 1);
    assert_eq!(
        json["counts"]["occluder_triangles"],
        g.n_triangles(Role::Structural)
    );
    let rooms = json["rooms"].as_array().expect("rooms");
    let ids: Vec<&str> = rooms.iter().filter_map(|r| r["id"].as_str()).collect();
    assert_eq!(ids.len(), 12);
    assert!(
        rooms
            .iter()
            .all(|r| r["sample_points"].as_array().is_some_and(|p| p.len() == 30))
    );
    for o in json["openings"].as_array().expect("openings") {
        assert!(["door", "window", "opening"].contains(&o["kind"].as_str().expect("a kind")));
        assert_eq!(o["corners"].as_array().map(Vec::len), Some(4));
        assert!(o["thickness"].as_f64().is_some_and(|t| t > 0.05));
        for side in o["rooms"].as_array().expect("two sides") {
            let side = side.as_str().expect("a name");
            assert!(side == "outside" || ids.contains(&side), "{side}");
        }
    }
}

#[test]
fn roles_are_found_again_by_name() {
    let maze = dirkse_maze(2);
    let tower = office_tower(&TowerParams {
        leaves: true,
        ..TowerParams::with_rooms(16, 2)
    });
    for g in [furnished_house(), tower, maze, mixed::glass_facade_office()] {
        let folder = std::env::temp_dir();
        let path = folder.join(format!("{}-{}.glb", g.truth.scene, std::process::id()));
        std::fs::write(&path, enfilade_import::export_glb(&g.scene)).expect("a writable folder");
        let read = enfilade_import::import(std::slice::from_ref(&path), &[], &Default::default());
        std::fs::remove_file(&path).expect("just written");
        let read = read.expect("our own file").scene;
        let tally = |objects: &[enfilade_geom::scene::Object]| {
            let mut names: Vec<(String, Role)> =
                objects.iter().map(|o| (o.name.clone(), o.role)).collect();
            names.sort();
            names.dedup();
            names
        };
        assert_eq!(tally(&read.objects), tally(&g.scene.objects));
    }
}

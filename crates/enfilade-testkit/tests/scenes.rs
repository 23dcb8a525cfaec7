//! What every generated scene owes: closed solids, a truth in order, open openings, rooms apart.

use enfilade_geom::scene::Role;
use enfilade_geom::{Aabb, DVec3, Triangle};
use enfilade_testkit::oracle::{
    FloodGrid, n_open_edges, segment_is_blocked, structural_triangles, winding_number,
};
use enfilade_testkit::{
    Generated, OpeningKind, Rng, Side, TowerParams, furnished_house, office_tower, rotated,
};

/// Triangles whose box comes near `bounds`, to keep the brute-force rays short.
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
            assert!(w <= 0, "{}: {p} lies in a solid", room.name);
        }
    }
}

/// At least `share` of 49 rays along the normal pass each opening, as `clear_fraction` in the
/// shared scenes is counted.
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
        // A hand's breadth outside its rim there is wall.
        if o.kind != OpeningKind::Virtual {
            let mut stopped = 0;
            for i in 0..4 {
                let edge = o.corners[i].midpoint(o.corners[(i + 1) % 4]);
                let p = edge + (edge - o.center).normalize() * 0.05;
                stopped += i32::from(segment_is_blocked(&close, p - reach, p + reach));
            }
            assert!(stopped >= 2, "{}: a wall on {stopped} sides", o.name);
        }
    }
}

/// With all openings plugged, voxel regions and rooms are the same thing.
fn check_rooms_are_apart(g: &Generated, voxel: f64) {
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
        let [a, b, c, d] = o.corners;
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

/// Monte Carlo estimate of each room's air against what the truth says.
fn check_volumes(g: &Generated) {
    const N: i32 = 1500;
    let triangles = structural_triangles(&g.scene);
    let mut rng = Rng::new(5);
    for room in &g.truth.rooms {
        let b = room.aabb();
        let mut air = 0;
        for _ in 0..N {
            let p = b.min + b.size() * DVec3::new(rng.unit(), rng.unit(), rng.unit());
            air += i32::from(room.contains(p, 0.0) && winding_number(&triangles, p) <= 0);
        }
        let share = f64::from(air) / f64::from(N);
        let estimate = share * b.volume();
        // Five standard deviations of the estimate.
        let slack = 5.0 * (share * (1.0 - share) / f64::from(N)).sqrt() * b.volume() + 1e-6;
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
    check_rooms_are_apart(g, voxel);
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
    check_rooms_are_apart(&g, 0.05);
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

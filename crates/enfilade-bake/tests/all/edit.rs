//! Portals added to finished worlds: guarantees hold and the rest stays, or an error has the position. Covers P4.

use enfilade_bake::edit::{AddPortalError, Added, add_portal};
use enfilade_bake::simplify::delete_portal;
use enfilade_bake::{BakeConfig, BakeContext, Silent, bake};
use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::{DVec3, Plane, Winding};
use enfilade_testkit::mixed::{l_corridor, stair_hall};
use enfilade_testkit::{Generated, GridParams, Rng, room_grid};
use enfilade_verify::{VerifyOptions, verify_world};

fn holds(world: &World) {
    world.validate().unwrap();
    let options = VerifyOptions {
        rays: 4000,
        ..VerifyOptions::default()
    };
    let report = verify_world(world, None, &options);
    assert!(report.holds(), "{report:?}");
}

fn grid(rng: &mut Rng) -> World {
    let size = [1 + rng.below(3), 1 + rng.below(2), 1 + rng.below(3)];
    room_grid(&GridParams {
        size,
        doors: 0.8,
        holes: 0.3,
        merges: 0.4,
        outdoors: rng.chance(0.5),
        furniture: 1,
        turn: if rng.chance(0.5) { rng.unit() } else { 0.0 },
        ..GridParams::offices(4, rng.below(1 << 20) as u64)
    })
}

fn direction(rng: &mut Rng) -> DVec3 {
    loop {
        let d = DVec3::new(rng.unit(), rng.unit(), rng.unit()) * 2.0 - 1.0;
        if d.length() > 0.1 && d.length() < 1.0 {
            return d.normalize();
        }
    }
}

fn point_in(rng: &mut Rng, world: &World) -> DVec3 {
    let b = world.graph.locator.bounds;
    b.min + b.size() * DVec3::new(rng.unit(), rng.unit(), rng.unit())
}

/// Checks that an edit of one cell leaves all others unchanged, and that its parts add up to the whole.
fn only_the_cell_changed(before: &World, added: &Added, rng: &mut Rng) {
    let (old, new) = (&before.graph, &added.world.graph);
    let parts = [added.cell, added.new_cell];
    assert_eq!(new.cells.len(), old.cells.len() + 1);
    assert_eq!(added.new_cell.0 as usize, old.cells.len());
    for (i, (a, b)) in old.cells.iter().zip(&new.cells).enumerate() {
        if i != added.cell.0 as usize {
            let own = |c: &enfilade_cpg::Cell| (c.name.clone(), c.aabb, c.n_triangles, c.volume);
            assert_eq!(own(a), own(b));
        }
    }
    let is_halved = |i: usize| added.halved.iter().any(|h| h.0.0 as usize == i);
    for (i, (a, b)) in old.portals.iter().zip(&new.portals).enumerate() {
        for (p, q) in a.cells.iter().zip(b.cells) {
            assert!(*p == q || (*p == added.cell && q == added.new_cell));
        }
        if !is_halved(i) {
            assert_eq!((&a.pieces, &a.outline), (&b.pieces, &b.outline));
        }
    }
    for &(a, b) in &added.halved {
        let area = |w: &World, p: PortalId| f64::from(w.graph[p].area);
        let (whole, sum) = (
            area(before, a),
            area(&added.world, a) + area(&added.world, b),
        );
        // Areas are `f32`, and the vertices of their pieces rounded once more.
        assert!((whole - sum).abs() < 1e-3 * whole + 1e-4, "{whole} {sum}");
    }
    for p in &added.portals {
        let mut cells = new.portals[p.0 as usize].cells;
        cells.sort_unstable();
        let mut expected = parts;
        expected.sort_unstable();
        assert_eq!(cells, expected);
    }
    for _ in 0..500 {
        let p = point_in(rng, before);
        let (a, b) = (old.locator.locate(p), new.locator.locate(p));
        let same = a == b || (a == Some(added.cell) && b == Some(added.new_cell));
        assert!(same, "{p}: {a:?} {b:?}");
    }
    let n = |w: &World| -> usize { w.batches.iter().map(|b| b.primitive.indices.len()).sum() };
    assert_eq!(n(before), n(&added.world));
}

#[test]
fn a_polygon_across_a_cell_parts_it_and_keeps_every_promise() {
    let mut rng = Rng::new(7);
    let (mut n_added, mut n_halved) = (0, 0);
    for i in 0..60 {
        let before = grid(&mut rng);
        let center = loop {
            let p = point_in(&mut rng, &before);
            if before.graph.locator.locate(p).is_some() {
                break p;
            }
        };
        let normal = if i % 3 == 0 {
            DVec3::X
        } else {
            direction(&mut rng)
        };
        let reach = if i % 2 == 0 {
            200.0
        } else {
            1.0 + 3.0 * rng.unit()
        };
        let polygon = Winding::square(&Plane::through(center, normal), center, reach);
        match add_portal(&before, &polygon.points) {
            Ok(added) => {
                n_added += 1;
                n_halved += added.halved.len();
                only_the_cell_changed(&before, &added, &mut rng);
                holds(&added.world);
                // After removing it, every point is in its old cell.
                let back = delete_portal(&added.world, added.portals[0]).unwrap().world;
                for _ in 0..200 {
                    let p = point_in(&mut rng, &before);
                    let found = [&back, &before].map(|w| w.graph.locator.locate(p));
                    assert_eq!(found[0], found[1]);
                }
                assert_eq!(
                    back.graph.portals.len(),
                    before.graph.portals.len() + added.halved.len()
                );
            }
            Err(AddPortalError::DoesNotPart { cell, at }) => {
                assert_eq!(before.graph.locator.locate(at), Some(cell), "{at}");
                let plane = Plane::through(center, normal);
                // Vertices move into shared planes by up to their rounding.
                assert!(plane.signed_distance(at).abs() < 1e-4);
                assert!(!polygon.contains_in_plane(at, -1e-4), "{at} is on it");
            }
            Err(AddPortalError::Endless { cell, .. }) => {
                assert!(before.graph[cell].outdoor);
            }
            Err(other) => panic!("{other}"),
        }
    }
    assert!(n_added > 20 && n_halved > 5, "{n_added} {n_halved}");
}

fn baked(scene: &Generated) -> World {
    bake(
        &scene.scene,
        &BakeConfig::default(),
        &BakeContext::new(&Silent, None),
    )
    .unwrap()
    .world
}

#[test]
fn baked_worlds_take_portals_across_each_of_their_rooms() {
    for scene in [l_corridor(), stair_hall()] {
        let mut world = baked(&scene);
        let n = world.graph.cells.len();
        let mut n_added = 0;
        for i in 0..n {
            let cell = &world.graph.cells[i];
            if cell.outdoor {
                continue;
            }
            let [low, high] = cell.aabb.map(|c| DVec3::from(c.map(f64::from)));
            let middle = low.lerp(high, 0.5) + DVec3::new(0.11, 0.0, 0.07);
            if world.graph.locator.locate(middle) != Some(CellId(i as u32)) {
                continue;
            }
            let polygon = Winding::square(&Plane::through(middle, DVec3::X), middle, 50.0);
            let added = add_portal(&world, &polygon.points).unwrap();
            holds(&added.world);
            let volume = |w: &World, c: CellId| f64::from(w.graph[c].volume);
            let whole = volume(&world, added.cell);
            let sum = volume(&added.world, added.cell) + volume(&added.world, added.new_cell);
            // Volumes are `f32`, and slivers at walls may be matter now.
            assert!((whole - sum).abs() < 1e-3 * whole, "{whole} {sum}");
            world = added.world;
            n_added += 1;
        }
        assert!(n_added > 0);
    }
}

/// One empty room of about 4 by 4 by 3 meters.
fn hall() -> (World, DVec3) {
    let world = room_grid(&GridParams {
        size: [1, 1, 1],
        furniture: 0,
        outdoors: false,
        ..GridParams::offices(1, 3)
    });
    let cell = &world.graph.cells[0];
    let [low, high] = cell.aabb.map(|c| DVec3::from(c.map(f64::from)));
    (world, low.lerp(high, 0.5))
}

#[test]
fn a_polygon_that_is_none_is_refused_with_the_corner() {
    let (world, middle) = hall();
    let square = Winding::square(&Plane::through(middle, DVec3::X), middle, 20.0).points;
    assert!(add_portal(&world, &square).is_ok());
    assert_eq!(
        add_portal(&world, &square[..2]).unwrap_err(),
        AddPortalError::TooFewCorners { n: 2 }
    );
    let with = |i: usize, p: DVec3| {
        let mut points = square.clone();
        points[i] = p;
        add_portal(&world, &points).unwrap_err()
    };
    assert_eq!(with(2, DVec3::NAN), AddPortalError::NotFinite { corner: 2 });
    assert!(matches!(
        with(1, square[1] + DVec3::X),
        AddPortalError::NotPlanar { off, .. } if off > 0.2 && off < 1.0
    ));
    assert!(matches!(
        with(3, middle.lerp(square[1], 0.5)),
        AddPortalError::NotConvex { corner: 3, .. }
    ));
    let line = [0.0, 1.0, 2.0].map(|t| middle + DVec3::Y * t);
    assert_eq!(
        add_portal(&world, &line).unwrap_err(),
        AddPortalError::NoArea
    );
    let twice: Vec<DVec3> = [0, 2, 4, 1, 3]
        .map(|k| f64::from(k) * std::f64::consts::TAU / 5.0)
        .map(|a| middle + DVec3::new(0.0, a.cos(), a.sin()) * 20.0)
        .into();
    assert!(matches!(
        add_portal(&world, &twice).unwrap_err(),
        AddPortalError::NotConvex { .. }
    ));
}

#[test]
fn a_polygon_that_parts_nothing_is_refused_with_the_place() {
    let (world, middle) = hall();
    let [low, high] = world.graph.cells[0]
        .aabb
        .map(|c| DVec3::from(c.map(f64::from)));
    // 10 cm below the ceiling.
    let x = middle.x;
    let corner = |y: f64, z: f64| DVec3::new(x, y, z);
    let top = high.y - 0.1;
    let short = [
        corner(low.y - 1.0, low.z - 1.0),
        corner(top, low.z - 1.0),
        corner(top, high.z + 1.0),
        corner(low.y - 1.0, high.z + 1.0),
    ];
    match add_portal(&world, &short).unwrap_err() {
        AddPortalError::DoesNotPart { cell, at } => {
            assert_eq!(cell, CellId(0));
            assert!(
                (at.x - x).abs() < 1e-6 && at.y > top && at.y < high.y,
                "{at}"
            );
        }
        other => panic!("{other}"),
    }
    // Beyond the room there is only matter.
    let outside = short.map(|p| p + DVec3::X * 100.0);
    assert!(matches!(
        add_portal(&world, &outside).unwrap_err(),
        AddPortalError::InSolid { .. }
    ));
    // In the wall's own plane it has the room on one side only.
    let in_wall = short.map(|p| DVec3::new(low.x, p.y, p.z));
    assert!(matches!(
        add_portal(&world, &in_wall).unwrap_err(),
        AddPortalError::Aside { .. } | AddPortalError::InSolid { .. }
    ));
    // The same twice: the second lies on the first.
    let whole = short.map(|p| if p.y == top { p + DVec3::Y } else { p });
    let parted = add_portal(&world, &whole).unwrap().world;
    assert!(matches!(
        add_portal(&parted, &whole).unwrap_err(),
        AddPortalError::Aside { .. }
    ));
}

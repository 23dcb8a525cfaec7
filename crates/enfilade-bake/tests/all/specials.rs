//! Special portals made by edits are valid or refused with the reason, and later edits keep them.

use enfilade_bake::edit::special::{
    LinkOptions, SpecialError, SpecialSpot, link, mirror, monitor, plain, reflect, tint,
};
use enfilade_bake::edit::{AddPortalError, add_portal};
use enfilade_bake::simplify::{SimplifySettings, delete_portal, simplify};
use enfilade_cpg::{
    CellId, GraphError, MonitorCamera, PortalId, SpecialId, SpecialPortal, SpecialProblem,
    SpecialShape, Way, World,
};
use enfilade_geom::{DQuat, DVec3, Plane, Similarity, Winding};
use enfilade_testkit::{GridParams, Rng, room_grid};

fn grid(seed: u64) -> World {
    room_grid(&GridParams {
        size: [3, 1, 2],
        outdoors: seed.is_multiple_of(2),
        turn: if seed.is_multiple_of(3) { 0.4 } else { 0.0 },
        doors: 1.0,
        ..GridParams::offices(4, seed)
    })
}

fn side(portal: u32, cell: CellId) -> SpecialSpot {
    SpecialSpot::Doorway {
        portal: PortalId(portal),
        cell: Some(cell),
    }
}

/// The side of a portal in its first cell.
fn first_side(world: &World, portal: u32) -> SpecialSpot {
    side(portal, world.graph.portals[portal as usize].cells[0])
}

/// A square on the ceiling of a cell, around a point below it.
fn on_ceiling(world: &World, cell: CellId, below: DVec3, reach: f64) -> SpecialSpot {
    let top = f64::from(world.graph[cell].aabb[1][1]);
    let at = DVec3::new(below.x, top, below.z);
    SpecialSpot::Wall(Winding::square(&Plane::through(at, DVec3::Y), at, reach).points)
}

fn middle(world: &World, cell: CellId) -> DVec3 {
    let [min, max] = world.graph[cell]
        .aabb
        .map(|c| DVec3::from(c.map(f64::from)));
    (min + max) / 2.0
}

/// Checks that each special portal is before its cell, and each way leads before the cell entered.
fn all_in_place(world: &World) {
    world.validate().unwrap();
    let graph = &world.graph;
    for id in graph.special_ids() {
        let (normal, pieces) = graph.special_opening(id);
        let at = pieces[0].centroid();
        let special = &graph.specials[id.idx()];
        assert_eq!(
            graph.locator.locate(at - normal * 0.01),
            Some(special.cell),
            "{id}"
        );
        if let Some((to, map)) = special.leads_to() {
            let there = map.point(at) + map.direction(normal) * 0.01;
            assert_eq!(graph.locator.locate(there), Some(to), "{id}");
        }
    }
}

#[test]
fn a_mirror_covers_a_doorway_or_a_wall_and_not_both_sides() {
    let mut world = grid(1);
    let before = world.clone();
    let [a, b] = world.graph.portals[0].cells;
    assert_eq!(mirror(&mut world, &side(0, a)), Ok(SpecialId(0)));
    let both = mirror(&mut world, &side(0, b)).unwrap_err();
    assert_eq!(
        both,
        SpecialError::BothMirrors {
            portal: PortalId(0)
        }
    );
    assert!(both.to_string().contains("cover a wall instead"), "{both}");
    // A side that is special already stays as it is.
    let again = mirror(&mut world, &side(0, a)).unwrap_err();
    let is_same = |p: &SpecialProblem| matches!(p, SpecialProblem::SameSide { .. });
    assert!(
        matches!(&again, SpecialError::Invalid(GraphError::Special { problem, .. }) if is_same(problem)),
        "{again}"
    );
    let below = middle(&world, b);
    let spot = on_ceiling(&world, b, below, 0.5);
    assert_eq!(mirror(&mut world, &spot), Ok(SpecialId(1)));
    assert_eq!(world.graph.specials[1].cell, b);
    all_in_place(&world);
    // Made plain, the world is as before.
    plain(&mut world, SpecialId(0)).unwrap();
    plain(&mut world, SpecialId(0)).unwrap();
    assert_eq!(world.graph.specials, before.graph.specials);
    assert_eq!(
        plain(&mut world, SpecialId(0)),
        Err(SpecialError::NoSpecial {
            special: SpecialId(0),
            n: 0
        })
    );
}

#[test]
fn a_place_is_a_side_of_a_portal_or_a_polygon_at_a_cell() {
    let mut world = grid(1);
    let n = world.graph.portals.len();
    let at = |portal, cell| SpecialSpot::Doorway {
        portal: PortalId(portal),
        cell,
    };
    let error = |spot| mirror(&mut world.clone(), &spot).unwrap_err();
    let none = error(at(n as u32, None));
    assert!(matches!(none, SpecialError::NoPortal { .. }), "{none}");
    let which = error(at(0, None));
    assert!(which.to_string().contains("give 0:cell-"), "{which}");
    let cells = world.graph.portals[0].cells;
    let other = world.graph.cell_ids().find(|c| !cells.contains(c));
    let not = error(at(0, other));
    assert!(matches!(not, SpecialError::NotAtCell { .. }), "{not}");
    let line = error(SpecialSpot::Wall(vec![
        DVec3::ZERO,
        DVec3::X,
        DVec3::X * 2.0,
    ]));
    assert_eq!(line, SpecialError::Polygon(AddPortalError::NoArea));
    let far = Plane::through(DVec3::splat(1e3), DVec3::X);
    let far = error(SpecialSpot::Wall(
        Winding::square(&far, DVec3::splat(1e3), 1.0).points,
    ));
    assert!(matches!(far, SpecialError::InSolid { .. }), "{far}");
    // In mid-air, a polygon faces those for whom it runs counter-clockwise.
    let cell = cells[0];
    let plane = Plane::through(middle(&world, cell), DVec3::X);
    let square = Winding::square(&plane, middle(&world, cell), 0.3);
    for (points, facing) in [(square.flipped().points, -1.0), (square.points, 1.0)] {
        let made = mirror(&mut world, &SpecialSpot::Wall(points)).unwrap();
        let (normal, _) = world.graph.special_opening(made);
        assert!(normal.distance(DVec3::X * -facing) < 1e-6, "{normal}");
    }
    all_in_place(&world);
}

#[test]
fn openings_of_one_size_link_and_others_are_refused_with_their_sizes() {
    let (mut n_linked, mut n_refused) = (0, 0);
    for seed in 0..4 {
        let world = grid(seed);
        let n = world.graph.portals.len() as u32;
        for (a, b) in (0..n).flat_map(|a| (0..n).map(move |b| (a, b))) {
            for is_one_way in [false, true] {
                let mut linked = world.clone();
                let spots = [first_side(&world, a), first_side(&world, b)];
                let options = LinkOptions {
                    is_one_way,
                    ..LinkOptions::default()
                };
                let [p, q] = [a, b].map(|i| &world.graph.portals[i as usize]);
                // Rectangles, in a building that stands upright.
                let is_upright = !seed.is_multiple_of(3);
                let fits = is_upright
                    && match [p, q].map(|x| x.normal[1].abs() < 0.1) {
                        [true, true] => (0..2).all(|k| (p.size()[k] - q.size()[k]).abs() < 0.004),
                        _ => a == b,
                    };
                match link(&mut linked, &spots[0], &spots[1], &options) {
                    Ok((one, other)) => {
                        n_linked += 1;
                        assert_eq!(other.is_none(), is_one_way || a == b);
                        let (to, map) = linked.graph.specials[one.idx()].leads_to().unwrap();
                        assert_eq!((to, map.scale), (q.cells[0], 1.0));
                        let [from, into] = [p, q].map(|x| DVec3::from(x.center().map(f64::from)));
                        assert!(map.point(from).distance(into) < 0.01);
                        if is_upright && p.normal[1].abs() < 0.1 && q.normal[1].abs() < 0.1 {
                            assert!(map.direction(DVec3::Y).distance(DVec3::Y) < 1e-6);
                        }
                        all_in_place(&linked);
                    }
                    Err(error) => {
                        n_refused += 1;
                        assert!(!fits, "{a} {b}: {error}");
                        let said = error.to_string();
                        assert!(
                            said.contains("link openings of one shape and size"),
                            "{said}"
                        );
                        let [w, h] = q.size();
                        assert!(said.contains(&format!("{w:.3} × {h:.3} m")), "{said}");
                        assert_eq!(linked.graph, world.graph);
                    }
                }
            }
        }
    }
    assert!(n_linked > 50 && n_refused > 50, "{n_linked} {n_refused}");
}

#[test]
fn an_opening_leads_to_itself_magnified_or_through_any_map_that_fits() {
    let mut world = grid(1);
    let [a, b] = [
        world.graph.portals[0].cells[0],
        world.graph.portals[1].cells[0],
    ];
    // A wall's polygon twice as large as another.
    let small = on_ceiling(&world, a, middle(&world, a), 0.25);
    let large = on_ceiling(&world, b, middle(&world, b), 0.5);
    let refused = link(&mut world, &small, &large, &LinkOptions::default());
    assert!(refused.is_err());
    let options = LinkOptions {
        is_scaled: true,
        ..LinkOptions::default()
    };
    link(&mut world, &small, &large, &options).unwrap();
    let (_, map) = world.graph.specials[0].leads_to().unwrap();
    assert!((map.scale - 2.0).abs() < 1e-6, "{map:?}");
    all_in_place(&world);
    // One way by a given map: out of the middle of the other room.
    let spot = first_side(&world, 0);
    let (normal, pieces) = {
        let mut with = world.clone();
        let made = mirror(&mut with, &spot).unwrap();
        with.graph.special_opening(made)
    };
    let lift = |to: DVec3| Similarity {
        turn: DQuat::IDENTITY,
        at: to - 0.5 * pieces[0].centroid(),
        scale: 0.5,
    };
    let options = |map| LinkOptions {
        is_one_way: true,
        map: Some(map),
        ..LinkOptions::default()
    };
    let far = link(
        &mut world,
        &spot,
        &large,
        &options(lift(DVec3::splat(500.0))),
    );
    let far = far.unwrap_err();
    assert!(matches!(far, SpecialError::LandsElsewhere { .. }), "{far}");
    let by = options(lift(middle(&world, b) - normal * 0.01));
    link(&mut world, &spot, &large, &by).unwrap();
    all_in_place(&world);
}

#[test]
fn a_pane_is_tinted_and_reflects_and_a_mirror_hides_what_is_behind() {
    let mut world = grid(1);
    let spot = first_side(&world, 0);
    assert_eq!(
        tint(&mut world, &spot, [0.0, 0.5, 1.0], 0.5),
        Ok(SpecialId(0))
    );
    assert_eq!(reflect(&mut world, &spot, 0.25), Ok(SpecialId(0)));
    assert_eq!(reflect(&mut world, &spot, 0.1), Ok(SpecialId(0)));
    let passes = &world.graph.specials[0].passes;
    assert_eq!(passes.len(), 2);
    assert_eq!(
        (&passes[0].way, passes[0].tint),
        (&Way::Through, [0.5, 0.75, 1.0, 1.0])
    );
    assert_eq!((&passes[1].way, passes[1].tint[3]), (&Way::Mirror, 0.1));
    assert!(tint(&mut world, &spot, [0.0, 0.5, 3.0], 1.0).is_err());
    assert!(reflect(&mut world, &spot, f32::NAN).is_err());
    let spot = first_side(&world, 1);
    let only = mirror(&mut world, &spot).unwrap();
    let error = reflect(&mut world, &spot, 0.5).unwrap_err();
    assert_eq!(error, SpecialError::OnlyMirror { special: only });
    let camera = MonitorCamera {
        eye: [0.0, 2.0, 0.0],
        toward: [1.0, 0.0, 0.0],
        up: [0.0, 1.0, 0.0],
        fov_y: 1.0,
    };
    let spot = first_side(&world, 2);
    let blind = MonitorCamera {
        toward: [0.0; 3],
        ..camera
    };
    assert!(monitor(&mut world, &spot, blind).is_err());
    monitor(&mut world, &spot, camera).unwrap();
    all_in_place(&world);
}

#[test]
fn what_was_seen_is_dropped_with_the_change() {
    let mut world = grid(1);
    let all = vec![enfilade_cpg::CellSet::all(world.graph.cells.len()); world.graph.cells.len()];
    world.pvs = Some(enfilade_cpg::Pvs::of_rows(&all));
    let spot = first_side(&world, 0);
    assert!(tint(&mut world, &spot, [2.0; 3], 1.0).is_err());
    assert!(world.pvs.is_some());
    mirror(&mut world, &spot).unwrap();
    assert!(world.pvs.is_none());
}

/// Mirrors on ceilings, and links of doorways, as many as fit.
fn furnished(world: &World, rng: &mut Rng) -> World {
    let mut world = world.clone();
    let n = world.graph.portals.len();
    for cell in world
        .graph
        .cell_ids()
        .filter(|c| !world.graph[*c].outdoor)
        .collect::<Vec<_>>()
    {
        let reach = rng.range(0.05, 0.5);
        let spot = on_ceiling(&world, cell, middle(&world, cell), reach);
        let _ = mirror(&mut world, &spot);
    }
    for _ in 0..2 {
        let spot = first_side(&world, rng.below(n) as u32);
        let _ = tint(&mut world, &spot, [0.5; 3], 1.0);
    }
    for _ in 0..4 {
        let spots = [rng.below(n), rng.below(n)].map(|p| first_side(&world, p as u32));
        let options = LinkOptions {
            is_one_way: rng.chance(0.5),
            ..LinkOptions::default()
        };
        let _ = link(&mut world, &spots[0], &spots[1], &options);
    }
    world
}

/// Polygons and number of passes of a special portal.
fn shape(world: &World, special: &SpecialPortal) -> (Vec<Vec<[f32; 3]>>, usize) {
    let pieces = match &special.shape {
        SpecialShape::Portal(portal) => world.graph[*portal].pieces.clone(),
        SpecialShape::Surface { pieces, .. } => pieces.clone(),
    };
    (pieces, special.passes.len())
}

#[test]
fn other_edits_keep_special_portals_in_place() {
    let mut rng = Rng::new(5);
    let (mut n_cut, mut n_refused, mut n_dropped) = (0, 0, 0);
    for seed in 0..40 {
        let before = furnished(&grid(seed % 7), &mut rng);
        all_in_place(&before);
        let shapes =
            |w: &World| -> Vec<_> { w.graph.specials.iter().map(|s| shape(w, s)).collect() };
        // A cut across a room.
        let cells: Vec<CellId> = before.graph.cell_ids().collect();
        let at = middle(&before, cells[rng.below(cells.len())]);
        let at = at + DVec3::new(rng.range(-1.0, 1.0), 0.0, rng.range(-1.0, 1.0));
        let plane = Plane::through(at, if rng.chance(0.5) { DVec3::X } else { DVec3::Z });
        match add_portal(&before, &Winding::square(&plane, at, 100.0).points) {
            Ok(added) => {
                n_cut += 1;
                all_in_place(&added.world);
                assert_eq!(shapes(&added.world), shapes(&before));
            }
            Err(AddPortalError::CutsSpecial { special, .. }) => {
                n_refused += 1;
                assert!(special.idx() < before.graph.specials.len());
            }
            Err(_) => {}
        }
        // A portal less: its sides go, and all others stay.
        let gone = PortalId(rng.below(before.graph.portals.len()) as u32);
        let after = delete_portal(&before, gone).unwrap().world;
        all_in_place(&after);
        let pair = before.graph[gone].cells;
        let is_gone = |s: &&SpecialPortal| {
            s.portal()
                .is_some_and(|p| before.graph[p].cells.iter().all(|c| pair.contains(c)))
        };
        let n_gone = before.graph.specials.iter().filter(is_gone).count();
        n_dropped += n_gone;
        assert_eq!(
            after.graph.specials.len() + n_gone,
            before.graph.specials.len()
        );
        // Merging as much as possible merges none across a special side.
        let settings = SimplifySettings {
            max_cells: Some(1),
            join_outdoors: true,
            ..SimplifySettings::default()
        };
        let merged = simplify(&before, &settings).world;
        all_in_place(&merged);
        assert_eq!(shapes(&merged), shapes(&before));
    }
    assert!(
        n_cut > 5 && n_refused > 1 && n_dropped > 3,
        "{n_cut} {n_refused} {n_dropped}"
    );
}

//! Lamps list everything that they light, through portals and moving rooms, and nothing behind walls. Covers W3.

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::DVec3;
use enfilade_runtime::{Sightlines, View};
use enfilade_testkit::{GridParams, Rng, cabin, room_grid};
use enfilade_world::{Lamp, LampError, LampId, Lights, PartId, Place, Pose, Space, SpaceViewer};

fn offices(seed: u64) -> World {
    let mut world = room_grid(&GridParams {
        merges: 0.2,
        turn: 0.3,
        holes: 0.2,
        ..GridParams::offices(60, seed)
    });
    world.details.clear();
    world
}

fn random_indoors(space: &Space, rng: &mut Rng) -> (CellId, DVec3) {
    let layout = space.layout(PartId::ROOT);
    loop {
        let cell = CellId(rng.below(layout.n_cells()) as u32);
        let b = layout.cell(cell).bounds;
        let p = DVec3::from_array([0, 1, 2].map(|k| rng.range(b.min[k], b.max[k])));
        if let Some(found) = layout.locate(p).filter(|c| !layout.cell(*c).is_outdoor) {
            return (found, p);
        }
    }
}

fn root(cell: CellId) -> Place {
    let part = PartId::ROOT;
    Place { part, cell }
}

#[test]
fn a_point_in_reach_of_a_lamp_is_lit_and_the_lamp_matters_to_its_viewers() {
    let world = offices(1);
    let mut space = Space::new(world.clone()).unwrap();
    for portal in world.graph.portal_ids().step_by(3) {
        space.close(PartId::ROOT, portal);
    }
    let lines = Sightlines::build(&world);
    let mut rng = Rng::new(2);
    let mut lights = Lights::new(&space);
    let lamps: Vec<Lamp> = (0..60)
        .map(|_| Lamp {
            frame: PartId::ROOT,
            at: random_indoors(&space, &mut rng).1.as_vec3().to_array(),
            range: rng.range(1.0, 12.0) as f32,
        })
        .collect();
    for lamp in &lamps {
        lights.add(&space, *lamp).unwrap();
    }
    let state = space.state(PartId::ROOT);
    let (mut n_lit, mut n_dark) = (0, 0);
    let mut viewer = SpaceViewer::new(&space);
    for _ in 0..30_000 {
        let (cell, p) = random_indoors(&space, &mut rng);
        let k = rng.below(lamps.len());
        let (lamp, id) = (&lamps[k], LampId(k as u32));
        let at = DVec3::from_array(lamp.at.map(f64::from));
        let is_lit = at.distance(p) < f64::from(lamp.range)
            && lines.is_clear(state, lamp.at, p.as_vec3().to_array());
        let may = lights.may_light(&space, id, root(cell), p);
        assert!(may || !is_lit, "{id:?} at {at} lights {p} in {cell}");
        n_lit += usize::from(is_lit);
        n_dark += usize::from(!may);
        if is_lit && n_lit % 4 == 0 {
            // An eye that sees the lit point.
            let (_, eye) = random_indoors(&space, &mut rng);
            let [eye, p] = [eye, p].map(|q| q.as_vec3());
            if lines.is_clear(state, eye.to_array(), p.to_array()) {
                let toward = (p - eye).to_array();
                let view =
                    View::perspective(eye.to_array(), toward, [0.0, 1.0, 0.0], 0.1, 1.0).unwrap();
                let seen = viewer.see(&space, PartId::ROOT, &view);
                assert!(lights.that_matter(&space, &seen).contains(&id));
            }
        }
    }
    assert!(n_lit > 300 && n_dark > 15_000, "{n_lit} {n_dark}");
}

#[test]
fn closing_doors_and_arriving_rooms_change_the_lit_cells() {
    let world = room_grid(&GridParams::two_rooms());
    let mut space = Space::new(world.clone()).unwrap();
    let mut lights = Lights::new(&space);
    let middle = space.layout(PartId::ROOT).opening(PortalId(0)).center();
    let normal = space.layout(PartId::ROOT).opening(PortalId(0)).normal();
    let lamp = Lamp {
        frame: PartId::ROOT,
        at: (middle - normal * 0.5).as_vec3().to_array(),
        range: 5.0,
    };
    let id = lights.add(&space, lamp).unwrap();
    let lit = |lights: &mut Lights, space: &Space| {
        let mut cells: Vec<Place> = lights.lit_by(space, id).collect();
        cells.sort_unstable();
        cells.dedup();
        cells
    };
    assert_eq!(lit(&mut lights, &space), [0, 1].map(|c| root(CellId(c))));
    space.close(PartId::ROOT, PortalId(0));
    assert_eq!(lit(&mut lights, &space), [root(CellId(0))]);
    // A cabin with windows comes to stand in the room that is lit.
    let cabin = room_grid(&GridParams {
        size: [1, 1, 1],
        windows: 1.0,
        ..GridParams::offices(1, 1)
    });
    let cabin = enfilade_testkit::scaled_world(cabin, 0.2);
    let far = Pose::from_translation(DVec3::X * 500.0);
    let part = space.add_part(cabin.clone(), PartId::ROOT, far).unwrap();
    assert_eq!(lit(&mut lights, &space).len(), 1);
    let beside = Pose::from_translation(middle - normal * 2.0 - DVec3::Y * 0.3);
    space.set_pose(part, beside).unwrap();
    let inside = Place {
        part,
        cell: CellId(0),
    };
    assert!(lit(&mut lights, &space).contains(&inside));
    space.set_pose(part, far).unwrap();
    assert!(!lit(&mut lights, &space).contains(&inside));
}

/// Cabins in solid matter, each without surroundings to shine into: a lamp in one lights the other once their doors meet, though
/// nobody tells the lamps.
#[test]
fn a_lamp_lights_a_cabin_that_docks() {
    let root = room_grid(&GridParams {
        outdoors: false,
        ..GridParams::two_rooms()
    });
    let mut space = Space::new(root).unwrap();
    let world = std::sync::Arc::new(cabin(1, 1.0, 2));
    let far = Pose::from_translation(DVec3::X * 100.0);
    let [a, b] = [0, 1].map(|_| {
        let part = space.add_part(world.clone(), PartId::ROOT, far);
        part.unwrap()
    });
    let window = space.layout(a).opening(PortalId(0));
    let turned = Pose::about(window.center(), DVec3::Y, std::f64::consts::PI);
    let mut cells = window.cells().into_iter();
    let inner = cells.find(|c| !space.layout(a).cell(*c).is_outdoor);
    let bounds = space.layout(a).cell(inner.unwrap()).bounds;
    let at = window.center().lerp(bounds.center(), 0.2);
    let apart = far.after(&Pose::from_translation(DVec3::X * 50.0));
    space.set_pose(b, apart).unwrap();
    assert!(space.leads_to(a, PortalId(0)).is_empty());
    let mut lights = Lights::new(&space);
    let lamp = Lamp {
        frame: a,
        at: at.as_vec3().to_array(),
        range: 9.0,
    };
    let id = lights.add(&space, lamp).unwrap();
    let lights_b =
        |lights: &mut Lights, space: &Space| lights.lit_by(space, id).any(|p| p.part == b);
    assert!(!lights_b(&mut lights, &space));
    space.set_pose(b, far.after(&turned)).unwrap();
    assert!(lights_b(&mut lights, &space));
    // A window that shuts on the far side, too.
    let [(_, portal)] = *space.meets(a, PortalId(0)) else {
        panic!("they do not meet");
    };
    space.close(b, portal);
    assert!(!lights_b(&mut lights, &space));
    space.open(b, portal);
    assert!(lights_b(&mut lights, &space));
    space.set_pose(b, apart).unwrap();
    assert!(!lights_b(&mut lights, &space));
}

#[test]
fn lamps_that_are_none_are_refused() {
    let space = Space::new(offices(2)).unwrap();
    let mut lights = Lights::new(&space);
    let lamp = Lamp {
        frame: PartId::ROOT,
        at: [0.0; 3],
        range: 1.0,
    };
    let with = |range: f32, x: f32| Lamp {
        at: [x, 0.0, 0.0],
        range,
        ..lamp
    };
    for bad in [
        with(0.0, 0.0),
        with(f32::NAN, 0.0),
        with(f32::INFINITY, 0.0),
        with(1.0, f32::NAN),
    ] {
        assert_eq!(lights.add(&space, bad), Err(LampError::NotPositive));
    }
    let elsewhere = Lamp {
        frame: PartId(3),
        ..lamp
    };
    assert_eq!(lights.add(&space, elsewhere), Err(LampError::NoPart));
    assert_eq!(lights.set(&space, LampId(0), lamp), Err(LampError::NoLamp));
}

//! Special portals: every rule is broken once, random links of doorways pass, and the file keeps all of it.

use crate::common;

use common::{doorway, two_rooms, two_rooms_with_specials};
use enfilade_cpg::wire::{EXTENSION, decode_glb, encode_glb};
use enfilade_cpg::{
    CellId, CellPortalGraph, GraphError, MonitorCamera, Pass, PortalId, SpecialId, SpecialPortal,
    SpecialProblem, SpecialShape, Way, World,
};
use enfilade_geom::{DQuat, DVec3, Similarity};
use proptest::prelude::*;
use serde_json::Value;

fn extension(bytes: &[u8]) -> Value {
    let len = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let mut root: Value = serde_json::from_slice(&bytes[20..20 + len]).unwrap();
    root["extensions"][EXTENSION].take()
}

#[test]
fn special_portals_come_back_as_they_were() {
    let world = two_rooms_with_specials();
    assert_eq!(world.validate(), Ok(()));
    let bytes = encode_glb(&world).unwrap();
    let back = decode_glb(&bytes).unwrap();
    assert_eq!(back.graph, world.graph);
    assert!(encode_glb(&back).unwrap() == bytes);
    assert_eq!(extension(&bytes)["version"], 2);
}

#[test]
fn a_world_without_special_portals_is_of_version_1_and_names_none() {
    let bytes = encode_glb(&two_rooms()).unwrap();
    assert_eq!(extension(&bytes)["version"], 1);
    assert!(!extension(&bytes).to_string().contains("special"));
    // When the last one is taken away, every byte is as before.
    let mut world = decode_glb(&encode_glb(&two_rooms_with_specials()).unwrap()).unwrap();
    world.graph.specials.clear();
    assert!(encode_glb(&world).unwrap() == bytes);
}

fn pass(graph: &mut CellPortalGraph, special: usize) -> &mut Pass {
    &mut graph.specials[special].passes[0]
}

/// The map of a lead.
fn map(graph: &mut CellPortalGraph, special: usize) -> &mut Similarity {
    match &mut pass(graph, special).way {
        Way::Lead { map, .. } => map,
        other => panic!("{other:?}"),
    }
}

fn lead(graph: &mut CellPortalGraph, special: usize) -> (&mut CellId, &mut Option<SpecialId>) {
    match &mut pass(graph, special).way {
        Way::Lead { to, back, .. } => (to, back),
        other => panic!("{other:?}"),
    }
}

fn camera(graph: &mut CellPortalGraph) -> &mut MonitorCamera {
    match &mut pass(graph, 4).way {
        Way::Monitor(camera) => camera,
        other => panic!("{other:?}"),
    }
}

fn surface(
    graph: &mut CellPortalGraph,
    special: usize,
) -> (&mut [f32; 3], &mut Vec<Vec<[f32; 3]>>) {
    match &mut graph.specials[special].shape {
        SpecialShape::Surface { normal, pieces } => (normal, pieces),
        other => panic!("{other:?}"),
    }
}

macro_rules! breaks {
    ($($name:ident: $special:literal, $change:expr => $problem:pat,)*) => {$(
        #[test]
        fn $name() {
            let mut world = two_rooms_with_specials();
            let change: fn(&mut CellPortalGraph) = $change;
            change(&mut world.graph);
            let errors = world.graph.validate().unwrap_err();
            let [GraphError::Special { special, problem, .. }] = &errors[..] else {
                panic!("{errors:?}");
            };
            assert_eq!(special.0, $special, "{errors:?}");
            assert!(matches!(problem, $problem), "{errors:?}");
            assert!(encode_glb(&world).is_err());
        }
    )*};
}

use SpecialProblem as P;
breaks! {
    its_cell_exists: 0, |g| g.specials[0].cell = CellId(3)
        => P::NoCell { n_cells: 3, .. },
    its_doorway_exists: 3, |g| g.specials[3].shape = SpecialShape::Portal(PortalId(2))
        => P::NotOfCell { portal: PortalId(2) },
    its_doorway_is_one_of_its_cell: 3, |g| g.specials[3].cell = CellId(0)
        => P::NotOfCell { portal: PortalId(1) },
    a_side_is_special_once: 6, |g| g.specials.push(g.specials[3].clone())
        => P::SameSide { other: SpecialId(3), .. },
    a_normal_is_of_unit_length: 0, |g| surface(g, 0).0[0] = -1.01
        => P::Normal { .. },
    a_normal_is_a_number: 0, |g| surface(g, 0).0[1] = f32::NAN
        => P::Normal { .. },
    a_vertex_is_finite: 4, |g| surface(g, 4).1[0][1][0] = f32::INFINITY
        => P::Corner { .. },
    a_surface_has_pieces: 4, |g| surface(g, 4).1.clear()
        => P::NoArea,
    a_surface_has_area: 4, |g| surface(g, 4).1[0].iter_mut().for_each(|c| c[0] = 5.0)
        => P::NoArea,
    a_piece_has_three_vertices: 0, |g| surface(g, 0).1[1].truncate(2)
        => P::Piece { piece: 1, .. },
    a_piece_is_planar: 0, |g| surface(g, 0).1[1][0][0] += 0.01
        => P::Piece { .. },
    a_piece_is_convex: 0, |g| surface(g, 0).1[1].insert(1, [0.0, 0.6, 2.7])
        => P::Piece { piece: 1, .. },
    a_piece_runs_about_the_normal: 0, |g| surface(g, 0).1[1].reverse()
        => P::Piece { piece: 1, .. },
    a_surface_is_at_its_cell: 0, |g| surface(g, 0).1[0].iter_mut().for_each(|c| c[1] += 3.0)
        => P::FarFromCell { .. },
    it_shows_something: 0, |g| g.specials[0].passes.clear()
        => P::NoPass,
    a_tint_is_at_most_1: 3, |g| g.specials[3].passes[1].tint[2] = 1.01
        => P::Tint { pass: 1, .. },
    a_tint_is_at_least_0: 0, |g| pass(g, 0).tint[0] = -0.01
        => P::Tint { pass: 0, .. },
    a_tint_is_a_number: 0, |g| pass(g, 0).tint[1] = f32::NAN
        => P::Tint { pass: 0, .. },
    the_first_pass_covers_all: 0, |g| pass(g, 0).tint[3] = 0.5
        => P::FirstShare { share: 0.5 },
    only_doorways_are_seen_through: 0, |g| pass(g, 0).way = Way::Through
        => P::ThroughWall { pass: 0 },
    a_body_goes_one_way: 1, |g| g.specials[1].passes.push(Pass::new(Way::Through))
        => P::TwoWays { first: 0, second: 1 },
    a_map_is_finite: 5, |g| map(g, 5).at.x = f64::INFINITY
        => P::Map { pass: 0 },
    a_maps_rotation_is_of_unit_length: 5, |g| map(g, 5).turn = DQuat::from_xyzw(0.0, 1.0, 0.0, 0.1)
        => P::Map { pass: 0 },
    a_map_does_not_flatten: 5, |g| map(g, 5).scale = 0.0
        => P::Map { pass: 0 },
    a_map_is_of_a_sensible_scale: 5, |g| map(g, 5).scale = 1e7
        => P::Map { pass: 0 },
    a_lead_leads_to_a_cell: 5, |g| *lead(g, 5).0 = CellId(3)
        => P::NoTarget { to: CellId(3), n_cells: 3, .. },
    a_monitor_has_an_eye: 4, |g| camera(g).eye[0] = f32::NAN
        => P::Camera { .. },
    a_monitor_looks_somewhere: 4, |g| camera(g).toward = [0.0; 3]
        => P::Camera { .. },
    a_monitor_has_an_up: 4, |g| camera(g).up = [0.0; 3]
        => P::Camera { .. },
    a_monitor_does_not_look_up: 4, |g| camera(g).toward = [0.0, -3.0, 0.0]
        => P::Camera { .. },
    a_monitors_view_has_an_angle: 4, |g| camera(g).fov_y = 0.0
        => P::Camera { .. },
    a_monitors_angle_is_below_180_degrees: 4, |g| camera(g).fov_y = 3.15
        => P::Camera { .. },
}

/// Breaks one end of the link of doorway and wardrobe; both may complain.
fn link_problems(change: fn(&mut CellPortalGraph)) -> Vec<SpecialProblem> {
    let mut world = two_rooms_with_specials();
    change(&mut world.graph);
    let errors = world.graph.validate().unwrap_err();
    let problem = |e: GraphError| match e {
        GraphError::Special { problem, .. } => problem,
        other => panic!("{other}"),
    };
    errors.into_iter().map(problem).collect()
}

macro_rules! unlinks {
    ($($name:ident: $change:expr => $problem:pat,)*) => {$(
        #[test]
        fn $name() {
            let problems = link_problems($change);
            assert!(problems.iter().all(|p| matches!(p, $problem)), "{problems:?}");
        }
    )*};
}

unlinks! {
    a_way_back_exists: |g| *lead(g, 1).1 = Some(SpecialId(6))
        => P::NoWayBack { is: "does not exist" | "names another way back", .. },
    a_way_back_is_in_the_cell_entered: |g| *lead(g, 1).0 = CellId(0)
        => P::NoWayBack { is: "is in another cell" | "leads to another cell", .. },
    a_way_back_leads_somewhere: |g| pass(g, 2).way = Way::Mirror
        => P::NoWayBack { is: "leads nowhere", .. },
    a_way_back_leads_here: |g| *lead(g, 1).1 = Some(SpecialId(0))
        => P::NoWayBack { is: "is in another cell" | "names another way back", .. },
    one_comes_back_where_one_left: |g| map(g, 2).at.x += 0.001
        => P::NotInverse { .. } | P::OffPlane { .. },
    one_comes_back_as_large: |g| map(g, 2).scale = 1.001
        => P::NotInverse { .. } | P::OffPlane { .. },
    one_comes_in_by_the_front: |g| {
        let half = Similarity::rigid(DQuat::from_rotation_y(std::f64::consts::PI), DVec3::new(11.0, 0.0, 0.0));
        let turned = half.after(map(g, 1));
        *map(g, 1) = turned;
        *map(g, 2) = turned.inverse();
    } => P::Facing { .. },
    one_comes_in_at_the_wall: |g| {
        map(g, 1).at.z += 0.001;
        let inverse = map(g, 1).inverse();
        *map(g, 2) = inverse;
    } => P::OffPlane { .. },
    one_comes_in_by_the_opening: |g| {
        map(g, 1).at.x += 0.01;
        let inverse = map(g, 1).inverse();
        *map(g, 2) = inverse;
    } => P::Outline { .. },
    both_ends_are_of_one_size: |g| surface(g, 2).1[0].iter_mut().for_each(|c| c[1] *= 0.9)
        => P::Outline { .. },
    both_ends_have_the_same_bars: |g| {
        let piece = |x: [f32; 2]| vec![[x[0], 2.1, 0.0], [x[1], 2.1, 0.0], [x[1], 0.0, 0.0], [x[0], 0.0, 0.0]];
        *surface(g, 2).1 = vec![piece([5.0, 5.4]), piece([5.6, 6.0])];
    } => P::Bars { .. },
}

#[test]
fn sizes_that_differ_are_named_and_what_to_do() {
    let mut world = two_rooms_with_specials();
    surface(&mut world.graph, 2).1[0]
        .iter_mut()
        .for_each(|c| c[1] *= 0.9);
    let errors = world.validate().unwrap_err();
    let said = errors[0].to_string();
    for part in [
        "special-1 (in cell-0, at 4.00,1.05,2.50)",
        "1.000 × 2.100",
        "special-2 is 1.000 × 1.890",
        "link one way only",
    ] {
        assert!(said.contains(part), "{said}");
    }
    // Names are of strangers.
    camera(&mut world.graph).fov_y = 9.0;
    let all: Vec<String> = (world.validate().unwrap_err().iter())
        .map(ToString::to_string)
        .collect();
    assert!(all.iter().any(|e| e.contains("screen")) && !all.concat().contains('\u{1b}'));
}

#[test]
fn millimeters_between_two_doorways_are_no_difference() {
    let mut world = two_rooms_with_specials();
    surface(&mut world.graph, 2).1[0]
        .iter_mut()
        .for_each(|c| c[1] = if c[1] > 0.0 { 2.103 } else { 0.0 });
    assert_eq!(world.validate(), Ok(()));
}

#[test]
fn two_mirrors_back_to_back_are_no_contradiction() {
    let mut world = two_rooms();
    let mirror = |cell| SpecialPortal {
        name: String::new(),
        cell: CellId(cell),
        shape: SpecialShape::Portal(PortalId(0)),
        passes: vec![Pass::new(Way::Mirror)],
    };
    world.graph.specials = vec![mirror(0), mirror(1)];
    assert_eq!(world.validate(), Ok(()));
}

#[test]
fn an_opening_may_lead_to_itself() {
    let mut world = two_rooms();
    // One leaves by the doorway and comes in by it.
    let at = DVec3::new(4.0, 0.0, 2.5);
    let half = DQuat::from_rotation_y(std::f64::consts::PI);
    let map = Similarity::rigid(half, at - half * at);
    world.graph.specials = vec![SpecialPortal {
        name: String::new(),
        cell: CellId(0),
        shape: SpecialShape::Portal(PortalId(0)),
        passes: vec![Pass::new(Way::Lead {
            to: CellId(0),
            map,
            back: Some(SpecialId(0)),
        })],
    }];
    assert_eq!(world.validate(), Ok(()));
}

proptest! {
    /// Two doorways anywhere, turned, scaled and reflected into each other, link; moved by more than the tolerance, they do not.
    #[test]
    fn links_of_any_doorways_pass_and_spoilt_ones_do_not(
        turn in prop::array::uniform4(-1.0_f64..1.0),
        at in prop::array::uniform3(-300.0_f64..300.0),
        scale in 0.05_f64..20.0,
        is_reflection in any::<bool>(),
        spoil in prop::array::uniform3(-1.0_f64..1.0),
        spoilt in 0..4,
    ) {
        prop_assume!(turn.iter().any(|x| x.abs() > 0.1));
        let spoil = DVec3::from(spoil);
        prop_assume!(spoil.abs().min_element() > 0.1);
        let scale = if is_reflection { -scale } else { scale };
        let map = Similarity { turn: DQuat::from_array(turn).normalize(), at: at.into(), scale };
        let mut graph = two_rooms().graph;
        // The image of the doorway as a doorway of the first room, seen from there.
        let door = graph.portals[0].clone();
        let image = |p: &[f32; 3]| map.point(DVec3::from(p.map(f64::from))).as_vec3().to_array();
        let mut mapped: Vec<[f32; 3]> = door.outline.iter().map(image).collect();
        // Outward there is the image of inward here.
        let inward = map.direction(DVec3::X);
        if !is_reflection {
            mapped.reverse();
        }
        let area = f64::from(door.area) * scale * scale;
        graph.portals[0] = enfilade_cpg::Portal {
            normal: (-inward).as_vec3().to_array(),
            outline: mapped.clone(),
            pieces: vec![mapped],
            area: area as f32,
            ..doorway(4.0, 2.0, 3.0, 2.1, [1, 0])
        };
        graph.portals.push(doorway(4.0, 2.0, 3.0, 2.1, [0, 1]));
        graph.cells[0].portals.push(PortalId(2));
        graph.cells[1].portals.push(PortalId(2));
        let side = |portal, map, back| SpecialPortal {
            name: String::new(),
            cell: CellId(u32::from(portal == 0)),
            shape: SpecialShape::Portal(PortalId(portal)),
            passes: vec![Pass::new(Way::Lead { to: CellId(u32::from(portal != 0)), map, back: Some(SpecialId(back)) })],
        };
        graph.specials = vec![side(2, map, 1), side(0, map.inverse(), 0)];
        prop_assert_eq!(graph.validate(), Ok(()));

        let mut bad = map;
        match spoilt {
            0 => bad.at += spoil * (0.2 * scale.abs()).max(0.2),
            1 => bad.turn = (DQuat::from_scaled_axis(spoil * 0.2) * bad.turn).normalize(),
            2 => bad.scale *= 1.0 + 0.2 * spoil.x,
            _ => bad.scale *= -1.0,
        }
        let mut one = graph.clone();
        one.specials[0].passes[0].way = Way::Lead { to: CellId(1), map: bad, back: Some(SpecialId(1)) };
        prop_assert!(one.validate().is_err());
        one.specials[1].passes[0].way = Way::Lead { to: CellId(0), map: bad.inverse(), back: Some(SpecialId(0)) };
        // A small door is reflected into itself by a point far away only if it lies there.
        prop_assert!(one.validate().is_err(), "{spoilt}");

        let world = World { graph, ..two_rooms() };
        let bytes = encode_glb(&world).unwrap();
        let back = decode_glb(&bytes).unwrap();
        prop_assert_eq!(&back.graph, &world.graph);
        prop_assert!(encode_glb(&back).unwrap() == bytes);
    }
}

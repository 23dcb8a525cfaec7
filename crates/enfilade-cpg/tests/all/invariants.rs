//! Breaks every invariant once, and validates portals as a builder makes them, which must pass.

use std::sync::Arc;

use crate::common;

use common::{room_facts, two_rooms};
use enfilade_cpg::{
    Cell, CellId, FittingPart, GraphError, Locator, LocatorNode, MotionKind, PortalId, PortalKind,
    World,
};
use enfilade_geom::{DVec3, Plane, Winding};
use proptest::prelude::*;

/// Returns the first error of the two rooms after `change`.
fn first(change: impl FnOnce(&mut World)) -> GraphError {
    let mut world = two_rooms();
    world.validate().unwrap();
    change(&mut world);
    world.validate().unwrap_err().remove(0)
}

/// The hinge of the door between the rooms.
fn hinge(w: &mut World) -> &mut [f32; 3] {
    let motion = w.graph.portals[0].fittings[0].motion.as_mut().unwrap();
    match &mut motion.kind {
        MotionKind::Turn { through, .. } => through,
        MotionKind::Slide { along } => along,
    }
}

macro_rules! breaks {
    ($($name:ident: $change:expr => $error:pat,)*) => {$(
        #[test]
        fn $name() {
            let change: fn(&mut World) = $change;
            let error = first(change);
            assert!(matches!(error, $error), "{error:?}");
        }
    )*};
}

breaks! {
    names_are_unique: |w| w.graph.cells[1].name = "cell-0".into()
        => GraphError::DuplicateName { first: 0, second: 1, .. },
    there_is_one_outdoors: |w| w.graph.cells[0].outdoor = true
        => GraphError::TwoOutdoors { first: 0, second: 2 },
    the_outdoors_is_no_void: |w| w.graph.cells[2].is_void = true
        => GraphError::OutdoorVoid { cell: 2 },
    a_box_is_not_inside_out: |w| w.graph.cells[1].aabb.swap(0, 1)
        => GraphError::CellExtent { cell: 1, .. },
    a_box_is_finite: |w| w.graph.cells[1].aabb[1][2] = f32::INFINITY
        => GraphError::CellExtent { cell: 1, .. },
    a_volume_is_a_number: |w| w.graph.cells[0].volume = f32::NAN
        => GraphError::CellExtent { cell: 0, .. },
    a_portal_names_existing_cells: |w| w.graph.portals[0].cells[1] = CellId(3)
        => GraphError::CellPortals { cell: 1, .. },
    a_portal_joins_two_cells: |w| {
        w.graph.portals[0].cells = [CellId(0), CellId(0)];
        w.graph.cells[1].portals = vec![PortalId(1)];
    } => GraphError::PortalCells { portal: 0, cells: [0, 0], n_cells: 3 },
    a_cell_lists_all_its_portals: |w| w.graph.cells[1].portals.truncate(1)
        => GraphError::CellPortals { cell: 1, .. },
    a_cell_lists_its_portals_ascending: |w| w.graph.cells[1].portals.reverse()
        => GraphError::CellPortals { cell: 1, .. },
    facts_are_those_of_all_rooms: |w| w.room_facts = Some(room_facts(w)[1..].to_vec())
        => GraphError::RoomFacts { cell: 0, .. },
    facts_are_in_the_order_of_rooms: |w| {
        let mut facts = room_facts(w);
        facts.swap(0, 1);
        w.room_facts = Some(facts);
    } => GraphError::RoomFacts { cell: 0, .. },
    a_part_of_a_floor_is_no_larger: |w| {
        let mut facts = room_facts(w);
        facts[1].area_above_2_3 = 18.0;
        w.room_facts = Some(facts);
    } => GraphError::RoomFacts { cell: 1, .. },
    a_floor_is_a_number: |w| {
        let mut facts = room_facts(w);
        facts[1].floor_area = f64::NAN;
        w.room_facts = Some(facts);
    } => GraphError::RoomFacts { cell: 1, .. },
    a_room_is_no_higher_than_its_box: |w| {
        let mut facts = room_facts(w);
        facts[1].height = 30.0;
        w.room_facts = Some(facts);
    } => GraphError::RoomFacts { cell: 1, .. },
    facts_count_the_doors_of_the_graph: |w| {
        let mut facts = room_facts(w);
        facts[0].n_doors += 1;
        w.room_facts = Some(facts);
    } => GraphError::RoomFacts { cell: 0, .. },
    a_leak_path_is_a_line: |w| w.leak_path = vec![[0.0; 3]]
        => GraphError::LeakPath,
    a_leak_path_is_finite: |w| w.leak_path = vec![[0.0; 3], [f32::NAN, 0.0, 0.0]]
        => GraphError::LeakPath,
    a_normal_is_of_unit_length: |w| w.graph.portals[1].normal = [1.0, 0.01, 0.0]
        => GraphError::PortalNormal { portal: 1, .. },
    a_normal_is_a_number: |w| w.graph.portals[1].normal = [f32::NAN; 3]
        => GraphError::PortalNormal { portal: 1, .. },
    a_corner_is_finite: |w| w.graph.portals[1].pieces[1][0][1] = f32::INFINITY
        => GraphError::PortalCorner { portal: 1, .. },
    an_outline_has_three_corners: |w| w.graph.portals[0].outline.truncate(2)
        => GraphError::TooFewCorners { portal: 0, piece: None, n_corners: 2 },
    a_piece_has_three_corners: |w| w.graph.portals[1].pieces[1].clear()
        => GraphError::TooFewCorners { portal: 1, piece: Some(1), n_corners: 0 },
    an_outline_is_planar: |w| w.graph.portals[0].outline[2][0] += 0.001
        => GraphError::NotPlanar { portal: 0, piece: None, .. },
    a_piece_is_planar: |w| w.graph.portals[1].pieces[0][2][0] += 0.001
        => GraphError::NotPlanar { portal: 1, piece: Some(0), .. },
    an_outline_is_convex: |w| w.graph.portals[0].outline.insert(1, [4.0, 1.0, 2.001])
        => GraphError::NotConvex { portal: 0, piece: None, .. },
    an_outline_runs_around_once: |w| {
        let twice = w.graph.portals[0].outline.repeat(2);
        w.graph.portals[0].outline = twice;
    } => GraphError::NotConvex { portal: 0, piece: None, .. },
    an_outline_does_not_cross_itself: |w| w.graph.portals[0].outline = [0.0, 144.0, 288.0, 72.0, 216.0]
        .map(|a: f32| [4.0, 1.0 + a.to_radians().cos(), 2.5 - a.to_radians().sin()]).to_vec()
        => GraphError::NotConvex { portal: 0, piece: None, .. } | GraphError::WrongWay { .. },
    an_outline_is_seen_from_the_second_cell: |w| w.graph.portals[0].outline.reverse()
        => GraphError::WrongWay { portal: 0, piece: None, .. },
    a_piece_is_seen_from_the_second_cell: |w| w.graph.portals[1].pieces[0].reverse()
        => GraphError::WrongWay { portal: 1, piece: Some(0), .. },
    an_outline_has_area: |w| w.graph.portals[0].outline.iter_mut().for_each(|c| c[2] = 2.0)
        => GraphError::WrongWay { portal: 0, piece: None, .. },
    pieces_lie_in_the_outline: |w| w.graph.portals[1].pieces[1].iter_mut().for_each(|c| c[2] += 0.001)
        => GraphError::PieceOutside { portal: 1, .. },
    an_area_is_the_sum_of_the_pieces: |w| w.graph.portals[1].area = 4.0
        => GraphError::PortalArea { portal: 1, .. },
    an_area_is_a_number: |w| w.graph.portals[1].area = f32::NAN
        => GraphError::PortalArea { portal: 1, .. },
    a_portal_has_pieces: |w| { w.graph.portals[1].pieces.clear(); w.graph.portals[1].area = 0.0; }
        => GraphError::PortalArea { portal: 1, .. },
    the_locators_box_is_finite: |w| Arc::make_mut(&mut w.graph.locator).bounds.max.x = f64::INFINITY
        => GraphError::LocatorBounds { .. },
    the_locators_box_is_ordered: |w| Arc::make_mut(&mut w.graph.locator).bounds.max.x = -1.0
        => GraphError::LocatorBounds { .. },
    the_locators_planes_are_finite: |w| Arc::make_mut(&mut w.graph.locator).planes[1][3] = f64::NAN
        => GraphError::LocatorPlane { plane: 1, .. },
    the_locators_nodes_have_planes: |w| Arc::make_mut(&mut w.graph.locator).nodes[1].plane = 2
        => GraphError::LocatorNode { node: 1, plane: 2, n_planes: 2 },
    children_come_after_their_parent: |w| Arc::make_mut(&mut w.graph.locator).nodes[1].children[0] = 1
        => GraphError::LocatorChild { node: Some(1), child: 1 },
    children_exist: |w| Arc::make_mut(&mut w.graph.locator).nodes[1].children[0] = 2
        => GraphError::LocatorChild { node: Some(1), child: 2 },
    leaves_are_cells: |w| Arc::make_mut(&mut w.graph.locator).nodes[1].children[1] = -5
        => GraphError::LocatorChild { node: Some(1), child: -5 },
    the_least_leaf_is_no_cell: |w| Arc::make_mut(&mut w.graph.locator).root = i32::MIN
        => GraphError::LocatorChild { node: None, child: i32::MIN },
    the_root_exists: |w| Arc::make_mut(&mut w.graph.locator).root = 2
        => GraphError::LocatorChild { node: None, child: 2 },
    the_outside_is_a_cell: |w| Arc::make_mut(&mut w.graph.locator).outside = Some(CellId(3))
        => GraphError::LocatorOutside { cell: 3, n_cells: 3 },
    the_outside_is_the_outdoors: |w| Arc::make_mut(&mut w.graph.locator).outside = Some(CellId(1))
        => GraphError::OutsideOutdoors { outside: Some(1), outdoors: Some(2) },
    the_outdoors_is_outside: |w| Arc::make_mut(&mut w.graph.locator).outside = None
        => GraphError::OutsideOutdoors { outside: None, outdoors: Some(2) },
    a_room_lies_in_the_locators_box: |w| w.graph.cells[0].aabb[1][1] += 2.0
        => GraphError::FarBox { .. },
    the_outdoors_lies_around_the_model: |w| w.graph.cells[2].aabb[1][1] = 1e30
        => GraphError::FarBox { .. },
    the_locator_lies_around_the_model: |w| Arc::make_mut(&mut w.graph.locator).bounds.max.x = 1e30
        => GraphError::FarBox { .. },
    a_count_is_finite: |w| w.graph.statistics.counts = [("n".to_owned(), f64::NAN)].into()
        => GraphError::Statistic { .. },
    a_batchs_cells_ascend: |w| w.batches[2].cells.reverse()
        => GraphError::CellList { cell: 0, .. },
    a_batchs_cells_are_named_once: |w| w.batches[2].cells[1] = CellId(0)
        => GraphError::CellList { cell: 0, .. },
    a_details_cells_exist: |w| w.details[1].cells[1] = CellId(3)
        => GraphError::CellList { cell: 3, .. },
    what_fills_an_opening_exists: |w| w.graph.portals[0].fittings[0].detail = 3
        => GraphError::Fitting { .. },
    what_fills_an_opening_is_named_once: |w| w.graph.portals[1].fittings[1].detail = 1
        => GraphError::Fitting { .. },
    a_leaf_moves_by_a_number: |w| {
        let motion = w.graph.portals[0].fittings[0].motion.as_mut();
        motion.unwrap().open = f32::NAN;
    } => GraphError::Fitting { .. },
    a_leaf_moves: |w| w.graph.portals[0].fittings[0].motion = None
        => GraphError::Fitting { .. },
    a_frame_stays: |w| w.graph.portals[0].fittings[0].part = FittingPart::Frame
        => GraphError::Fitting { .. },
    a_leaf_moves_in_one_way: |w| {
        // Also a leaf of the window, but hung on its other side.
        let mut leaf = w.graph.portals[0].fittings[0].clone();
        leaf.motion.as_mut().unwrap().open = 1.5;
        w.graph.portals[1].fittings.insert(0, leaf);
    } => GraphError::Fitting { .. },
    a_leaf_is_not_what_stays_elsewhere: |w| w.graph.portals[1].fittings[0].detail = 0
        => GraphError::Fitting { .. },
    a_hinge_is_at_the_model: |w| hinge(w)[0] = 1e6
        => GraphError::Fitting { .. },
    a_hinge_is_no_huge_number: |w| hinge(w)[1] = 1e38
        => GraphError::Fitting { .. },
    a_leaf_slides_within_the_model: |w| {
        let motion = w.graph.portals[1].fittings[1].motion.as_mut();
        motion.unwrap().open = 1000.0;
    } => GraphError::Fitting { .. },
    seals_have_no_sources: |w| w.batches[0].is_seal = true
        => GraphError::Source { .. },
    a_part_is_of_another: |w| w.details[1].part_of = Some(1)
        => GraphError::Fitting { .. },
    a_part_is_of_a_whole: |w| w.details[0].part_of = Some(1)
        => GraphError::Fitting { .. },
    a_details_mesh_exists: |w| w.details[1].mesh = 1
        => GraphError::Detail { detail: 1, .. },
    a_details_transform_is_affine: |w| w.details[1].transform[3] = 0.5
        => GraphError::Detail { detail: 1, .. },
    a_details_transform_is_finite: |w| w.details[1].transform[12] = f32::NAN
        => GraphError::Detail { detail: 1, .. },
    an_index_names_a_position: |w| w.batches[0].primitive.indices[5] = 4
        => GraphError::Primitive { .. },
    indices_come_in_threes: |w| w.batches[0].primitive.indices.truncate(5)
        => GraphError::Primitive { .. },
    a_position_is_finite: |w| w.detail_meshes[0].primitives[0].positions[2][0] = f32::NAN
        => GraphError::Primitive { .. },
    there_are_as_many_normals: |w| w.batches[0].primitive.normals.truncate(3)
        => GraphError::Primitive { .. },
    there_are_as_many_texture_coordinates: |w| w.batches[0].primitive.uvs[0].truncate(3)
        => GraphError::Primitive { .. },
    a_material_exists: |w| w.batches[0].primitive.material = Some(2)
        => GraphError::Primitive { .. },
    a_material_is_json: |w| w.materials[0].gltf = "{".into()
        => GraphError::Look { .. },
    a_material_is_an_object: |w| w.materials[0].gltf = "[]".into()
        => GraphError::Look { .. },
    a_materials_textures_exist: |w| w.textures.clear()
        => GraphError::Look { .. },
    a_textures_picture_exists: |w| w.images.clear()
        => GraphError::Look { .. },
    a_sampler_is_json: |w| w.textures[0].sampler = "no".into()
        => GraphError::Look { .. },
}

#[test]
fn a_world_broken_everywhere_reports_a_bounded_number() {
    let mut world = two_rooms();
    let broken = Cell {
        volume: -1.0,
        ..Cell::default()
    };
    world.graph.cells.extend(vec![broken; 1000]);
    assert_eq!(
        world.validate().unwrap_err().len(),
        enfilade_cpg::MAX_REPORTED
    );
}

/// Makes two rooms whose locator is a chain of `n` nodes.
fn chain(n: i32) -> World {
    let mut world = two_rooms();
    let node = |i: i32| LocatorNode {
        plane: 0,
        children: [i + 1, -1],
    };
    Arc::make_mut(&mut world.graph.locator).nodes = (0..n).map(node).collect();
    Arc::make_mut(&mut world.graph.locator).nodes[n as usize - 1].children[0] = -3;
    world
}

#[test]
fn a_locator_is_as_deep_as_it_may_be_and_no_deeper() {
    let most = Locator::MAX_DEPTH as i32;
    let deep = chain(most);
    deep.validate().unwrap();
    assert_eq!(
        deep.graph.locator.locate(DVec3::new(5.0, 1.0, 1.0)),
        Some(CellId(1))
    );
    let said = chain(1_000_000).validate().unwrap_err();
    let node = Locator::MAX_DEPTH;
    assert_eq!(said, [GraphError::LocatorDepth { node }]);
}

/// ATTACKS F10: in 200 kilobytes, a locator with more leaves than atoms in the world.
#[test]
fn a_locator_whose_nodes_are_children_twice_is_refused() {
    for n in [2, 10_000] {
        let mut world = chain(n);
        for (i, node) in (1..).zip(&mut Arc::make_mut(&mut world.graph.locator).nodes) {
            node.children = [if i < n { i } else { -3 }; 2];
        }
        let said = world.validate().unwrap_err();
        let node = 1;
        assert_eq!(said[0], GraphError::LocatorShared { node }, "{n}");
    }
    // A node must not be the child of two others either.
    let mut world = chain(3);
    Arc::make_mut(&mut world.graph.locator).nodes[0].children[1] = 2;
    let said = world.validate().unwrap_err();
    assert_eq!(said, [GraphError::LocatorShared { node: 2 }]);
}

fn f32s(points: &[DVec3]) -> Vec<[f32; 3]> {
    points.iter().map(|p| p.as_vec3().to_array()).collect()
}

proptest! {
    /// Works like a builder: hull and clip in `f64`, anywhere within some hundred meters and at any angle, down to
    /// cracks of millimeters, then round to `f32`.
    #[test]
    fn rounded_portals_pass(
        direction in prop::array::uniform3(-1.0_f64..1.0),
        middle in prop::array::uniform3(-300.0_f64..300.0),
        corners in prop::collection::vec((-1.0_f64..1.0, -1.0_f64..1.0), 3..24),
        size in (0.002_f64..20.0, 0.002_f64..20.0),
        cut in (-1.0_f64..1.0, 0.0_f64..std::f64::consts::TAU),
    ) {
        let direction = DVec3::from(direction);
        prop_assume!(direction.length() > 0.1);
        let plane = Plane::through(DVec3::from(middle), direction.normalize());
        let (u, v) = plane.basis();
        let at = |&(a, b): &(f64, f64)| DVec3::from(middle) + u * (a * size.0) + v * (b * size.1);
        let outline = Winding::hull_in_plane(&plane, &corners.iter().map(at).collect::<Vec<_>>());
        // A builder would not keep a portal that rounds to a line.
        prop_assume!(outline.area() > 1e-4);
        let (sin, cos) = cut.1.sin_cos();
        let knife = Plane::through(at(&(cut.0, cut.0)), u * cos + v * sin);
        let (front, back) = outline.split(&knife, 1e-9);
        let pieces: Vec<Winding> = front.into_iter().chain(back).collect();
        let mut world = two_rooms();
        let portal = &mut world.graph.portals[0];
        portal.kind = PortalKind::Crack;
        portal.normal = plane.normal.as_vec3().to_array();
        portal.outline = f32s(&outline.points);
        portal.pieces = pieces.iter().map(|p| f32s(&p.points)).collect();
        portal.area = pieces.iter().map(Winding::area).sum::<f64>() as f32;
        prop_assert_eq!(world.validate(), Ok(()));
    }
}

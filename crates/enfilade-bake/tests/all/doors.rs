//! Portals know their fittings: leaves, frames and panes, and how leaves move. FEATURES: W5.

use enfilade_bake::edit::add_portal;
use enfilade_bake::{BakeConfig, BakeContext, Silent, bake};
use enfilade_cpg::wire::{decode_glb, encode_glb};
use enfilade_cpg::{Fitting, FittingPart, MotionKind, Portal, PortalKind, World};
use enfilade_geom::scene::{Mesh, Object, Primitive, Role, Scene};
use enfilade_geom::{Aabb, DMat4, DVec3};
use enfilade_testkit::furnished_house;
use enfilade_verify::{VerifyOptions, verify_world};

fn baked(scene: &Scene) -> World {
    let context = BakeContext::new(&Silent, None);
    bake(scene, &BakeConfig::default(), &context).unwrap().world
}

fn leaves(portal: &Portal) -> impl Iterator<Item = &Fitting> {
    portal
        .fittings
        .iter()
        .filter(|f| f.part == FittingPart::Leaf)
}

fn vector(p: [f32; 3]) -> DVec3 {
    DVec3::from(p.map(f64::from))
}

fn transform(world: &World, detail: u32) -> DMat4 {
    DMat4::from_cols_array(&world.details[detail as usize].transform.map(f64::from))
}

/// All leaves of the house are hung open. Each has a mesh of its own, with the hinge as origin, along x.
#[test]
fn each_leaf_of_a_house_turns_around_its_hinge() {
    let world = baked(&furnished_house().scene);
    let mut n_leaves = 0;
    for (i, detail) in (0..).zip(&world.details) {
        let found: Vec<(&Portal, &Fitting)> = (world.graph.portals.iter())
            .flat_map(|p| leaves(p).map(move |f| (p, f)))
            .filter(|(_, f)| f.detail == i)
            .collect();
        if detail.name != "door leaf" {
            assert!(
                found.iter().all(|(p, _)| p.kind == PortalKind::Door),
                "{} shuts no door",
                detail.name
            );
            continue;
        }
        n_leaves += 1;
        let [(portal, fitting)] = found[..] else {
            panic!("leaf {i} is in {} portals", found.len());
        };
        assert_eq!(portal.kind, PortalKind::Door);
        let motion = fitting.motion.expect("leaves move");
        let MotionKind::Turn { through, axis } = motion.kind else {
            panic!("leaf {i} slides");
        };
        assert_eq!(axis, [0.0, 1.0, 0.0]);
        let own = transform(&world, i);
        let hinge = own.w_axis.truncate();
        let off = (vector(through) - hinge).with_y(0.0).length();
        // Half the thickness of the leaf, and the gap beside it.
        assert!(off < 0.03, "leaf {i} turns {off} m off its hinge");
        let shut = (motion.at(0.0) * own).transform_vector3(DVec3::X);
        let aslant = shut.dot(vector(portal.normal)).abs();
        assert!(
            aslant < 0.01,
            "leaf {i} is not shut where it should be: {aslant}"
        );
        let way = (motion.open - motion.shut).to_degrees().abs();
        assert!(
            (60.0..=130.0).contains(&way),
            "leaf {i} turns by {way} degrees"
        );
        let share = motion.share_of_model();
        assert!(
            (0.0..=1.0).contains(&share),
            "leaf {i} stands at {share}: {motion:?}"
        );
    }
    assert_eq!(n_leaves, 10);
}

#[test]
fn panes_and_frames_are_told_from_leaves() {
    let world = baked(&furnished_house().scene);
    let named = |f: &Fitting| world.details[f.detail as usize].name.clone();
    for portal in &world.graph.portals {
        if portal.kind != PortalKind::Window {
            continue;
        }
        let parts: Vec<_> = portal.fittings.iter().map(|f| (named(f), f.part)).collect();
        assert!(
            parts.contains(&("window glass".into(), FittingPart::Pane))
                && parts.contains(&("window frame".into(), FittingPart::Frame)),
            "{parts:?}"
        );
        assert!(portal.fittings.iter().all(|f| f.motion.is_none()));
    }
}

fn add_boxes(scene: &mut Scene, name: &str, role: Role, boxes: &[([f64; 3], [f64; 3])]) {
    let triangles = boxes.iter().flat_map(|(low, high)| {
        let b = Aabb::new((*low).into(), (*high).into());
        b.triangles()
    });
    let corners = triangles.flatten().map(|p| p.as_vec3().to_array());
    let positions: Vec<[f32; 3]> = corners.collect();
    scene.meshes.push(Mesh {
        primitives: vec![Primitive {
            indices: (0..positions.len() as u32).collect(),
            positions,
            ..Primitive::default()
        }],
        ..Mesh::default()
    });
    scene.objects.push(Object {
        name: name.into(),
        mesh: scene.meshes.len() as u32 - 1,
        transform: DMat4::IDENTITY,
        role,
        reason: String::new(),
        filling: None,
        node: None,
    });
}

/// Two rooms of 4 × 3 m with a wall of 0.2 m between them, and a doorway of 1 × 2.1 m in it, filled by `door`, in
/// coordinates along the wall, up, and through it.
fn two_rooms(door: &[([f64; 3], [f64; 3])]) -> Scene {
    let mut scene = Scene::default();
    let (w, h) = (0.2, 2.6);
    let walls = [
        // Floor and ceiling, and the four outer walls.
        ([-0.2, -0.2, -0.2], [8.4, 0.0, 3.2]),
        ([-0.2, h, -0.2], [8.4, h + 0.2, 3.2]),
        ([-0.2, 0.0, -0.2], [8.4, h, 0.0]),
        ([-0.2, 0.0, 3.0], [8.4, h, 3.2]),
        ([-0.2, 0.0, 0.0], [0.0, h, 3.0]),
        ([8.2, 0.0, 0.0], [8.4, h, 3.0]),
        // The wall between, around the doorway.
        ([4.0, 0.0, 0.0], [4.0 + w, h, 1.0]),
        ([4.0, 0.0, 2.0], [4.0 + w, h, 3.0]),
        ([4.0, 2.1, 1.0], [4.0 + w, h, 2.0]),
    ];
    add_boxes(&mut scene, "walls", Role::Structural, &walls);
    let turned: Vec<_> = (door.iter())
        .map(|([a, b, c], [d, e, f])| ([c + 4.0, *b, a + 1.0], [f + 4.0, *e, d + 1.0]))
        .collect();
    add_boxes(&mut scene, "door", Role::Detail, &turned);
    scene
}

/// Posts and head, and a leaf between them with a handle at its high end.
const FRAMED: [([f64; 3], [f64; 3]); 5] = [
    ([0.0, 0.0, 0.0], [0.05, 2.1, 0.1]),
    ([0.95, 0.0, 0.0], [1.0, 2.1, 0.1]),
    ([0.05, 2.05, 0.0], [0.95, 2.1, 0.1]),
    ([0.05, 0.0, 0.0], [0.95, 2.05, 0.04]),
    ([0.85, 1.0, -0.06], [0.89, 1.04, 0.1]),
];

fn the_door(world: &World) -> &Portal {
    let doors: Vec<&Portal> = (world.graph.portals.iter())
        .filter(|p| p.kind == PortalKind::Door)
        .collect();
    let [door] = doors[..] else {
        panic!("{} doors", doors.len());
    };
    door
}

#[test]
fn a_leaf_in_one_piece_with_its_frame_becomes_an_object() {
    let scene = two_rooms(&FRAMED);
    let world = baked(&scene);
    let door = the_door(&world);
    let parts: Vec<_> = door.fittings.iter().map(|f| (f.detail, f.part)).collect();
    assert_eq!(parts, [(0, FittingPart::Frame), (1, FittingPart::Leaf)]);
    assert_eq!(world.details[1].part_of, Some(0));
    assert_eq!(world.details[1].name, "door leaf");
    let n = |d: usize| {
        let mesh = &world.detail_meshes[world.details[d].mesh as usize];
        mesh.primitives
            .iter()
            .map(|p| p.indices.len() / 3)
            .sum::<usize>()
    };
    // The handle goes with the leaf.
    assert_eq!([n(0), n(1)], [36, 24]);
    assert_eq!(world.detail_meshes.len(), 2);
    let motion = leaves(door).next().unwrap().motion.unwrap();
    let MotionKind::Turn { through, .. } = motion.kind else {
        panic!("it slides");
    };
    // Opposite the handle, and on the side where leaf and frame are flush.
    assert!((through[2] - 1.05).abs() < 0.01, "{through:?}");
    assert!((through[0] - 4.0).abs() < 0.01, "{through:?}");
    let open = motion.at(1.0).transform_point3(DVec3::new(4.02, 1.0, 1.9));
    assert!(
        (open.x - 3.15).abs() < 0.05,
        "it opens to the other side: {open}"
    );
    assert_eq!(motion.share_of_model(), 0.0);
    // Each counts in the cell where it is.
    for (id, cell) in (0..).zip(&world.graph.cells) {
        let own = world.details.iter().enumerate();
        let own = own.filter(|(_, d)| d.cells.iter().any(|c| c.0 == id));
        assert_eq!(
            cell.n_detail_triangles as usize,
            own.map(|(d, _)| n(d)).sum::<usize>()
        );
    }
    let bytes = encode_glb(&world).unwrap();
    let read = decode_glb(&bytes).unwrap();
    assert_eq!(read.graph, world.graph);
    assert_eq!(read.details[1].part_of, Some(0));
}

#[test]
fn a_leaf_opens_to_the_side_where_it_has_room() {
    // In the middle of the wall, without a handle or a frame: only the wardrobe decides.
    for (wardrobe, opens_to) in [([3.2, 3.8], 1.0), ([4.4, 5.0], -1.0)] {
        let mut scene = two_rooms(&[([0.0, 0.0, 0.08], [1.0, 2.1, 0.12])]);
        let block = ([wardrobe[0], 0.0, 0.8], [wardrobe[1], 2.0, 2.2]);
        add_boxes(&mut scene, "wardrobe", Role::Detail, &[block]);
        let world = baked(&scene);
        let motion = leaves(the_door(&world)).next().unwrap().motion.unwrap();
        let middle = motion.at(1.0).transform_point3(DVec3::new(4.1, 1.0, 1.5));
        let off = (middle.x - 4.1) * opens_to;
        assert!(off > 0.3, "{wardrobe:?}: it opens to {middle}");
    }
}

#[test]
fn two_leaves_part_in_the_middle() {
    let leaves_of_two = [
        ([0.0, 0.0, 0.05], [0.5, 2.1, 0.09]),
        ([0.5, 0.0, 0.05], [1.0, 2.1, 0.09]),
    ];
    let world = baked(&two_rooms(&leaves_of_two));
    let mut hinges: Vec<f32> = leaves(the_door(&world))
        .map(|f| match f.motion.unwrap().kind {
            MotionKind::Turn { through, .. } => through[2],
            MotionKind::Slide { .. } => f32::NAN,
        })
        .collect();
    hinges.sort_by(f32::total_cmp);
    assert!(
        hinges.len() == 2 && (hinges[0] - 1.0).abs() < 0.01 && (hinges[1] - 2.0).abs() < 0.01,
        "{hinges:?}"
    );
}

#[test]
fn what_stands_beside_a_doorway_is_no_leaf_of_it() {
    // A cupboard door, a picture on the wall, a table in front of the doorway.
    for (what, block) in [
        ("cupboard", ([-0.9, 0.0, -0.5], [-0.05, 2.0, -0.46])),
        ("picture", ([1.1, 1.2, -0.03], [1.7, 1.8, -0.01])),
        ("table", ([0.1, 0.0, -1.2], [0.9, 0.75, -0.4])),
    ] {
        let world = baked(&two_rooms(&[block]));
        let fitted = world
            .graph
            .portals
            .iter()
            .filter(|p| !p.fittings.is_empty());
        assert_eq!(fitted.count(), 0, "a {what} fills an opening");
    }
}

#[test]
fn the_larger_half_of_a_door_that_is_cut_keeps_its_leaves_and_neither_its_frame() {
    let world = baked(&two_rooms(&FRAMED));
    let door = the_door(&world).clone();
    // Through the doorway, beside its middle, across the first room.
    let polygon = [
        [-0.1, -0.1, 1.4],
        [4.1, -0.1, 1.4],
        [4.1, 2.7, 1.4],
        [-0.1, 2.7, 1.4],
    ];
    let added = add_portal(&world, &polygon.map(DVec3::from)).unwrap();
    assert_eq!(added.halved.len(), 1, "{:?}", added.halved);
    let (a, b) = added.halved[0];
    let leaves: Vec<_> = (door.fittings.iter())
        .filter(|f| f.motion.is_some())
        .cloned()
        .collect();
    assert!(!leaves.is_empty() && leaves.len() < door.fittings.len());
    let [larger, smaller] = [a, b].map(|half| &added.world.graph[half]);
    assert!(larger.area > smaller.area);
    assert_eq!(larger.fittings, leaves);
    assert_eq!(smaller.fittings, []);
    let report = verify_world(&added.world, None, &VerifyOptions::default());
    assert!(report.holds(), "{report}");
}

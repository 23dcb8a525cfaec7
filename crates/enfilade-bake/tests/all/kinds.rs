//! Kinds of portals: what fills an opening decides, then its shape and the floor beside it. FEATURES: V4.

use enfilade_bake::{BakeConfig, BakeContext, Method, Silent, bake};
use enfilade_cpg::{PortalKind, World};
use enfilade_geom::scene::{Filling, Mesh, Object, Primitive, Role, Scene};
use enfilade_geom::{Aabb, DMat4};

type Block = ([f64; 3], [f64; 3]);

fn add_boxes(scene: &mut Scene, role: Role, filling: Option<Filling>, boxes: &[Block]) {
    let triangles = boxes
        .iter()
        .flat_map(|(low, high)| Aabb::new((*low).into(), (*high).into()).triangles());
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
        name: String::new(),
        mesh: scene.meshes.len() as u32 - 1,
        transform: DMat4::IDENTITY,
        role,
        reason: String::new(),
        filling,
        node: None,
    });
}

/// A hole in the front of a room, and what fills it.
struct Hole {
    /// Its foot over the floor, its width and its height. [Units: wu]
    foot: f64,
    size: [f64; 2],
    /// A pane or leaf, with what it says it is.
    filled: Option<Option<Filling>>,
}

/// Two rooms of 6 × 4 m with a wall of 0.2 m between them at z = 0, `hole` in it around x = 3, and no ground outside. With
/// `is_front`, the second room lacks: the hole leads outdoors.
fn rooms(hole: &Hole, is_front: bool) -> Scene {
    let mut scene = Scene::default();
    let (h, end) = (2.8, if is_front { 0.0 } else { 4.2 });
    let [x0, x1] = [3.0 - hole.size[0] / 2.0, 3.0 + hole.size[0] / 2.0];
    let [y0, y1] = [hole.foot, hole.foot + hole.size[1]];
    let mut walls: Vec<Block> = vec![
        ([-0.2, -0.2, -4.4], [6.2, 0.0, end]),
        ([-0.2, h, -4.4], [6.2, h + 0.2, end]),
        ([-0.2, 0.0, -4.4], [6.2, h, -4.2]),
        ([-0.2, 0.0, -4.2], [0.0, h, end]),
        ([6.0, 0.0, -4.2], [6.2, h, end]),
        ([0.0, 0.0, -0.2], [x0, h, 0.0]),
        ([x1, 0.0, -0.2], [6.0, h, 0.0]),
        ([x0, y1, -0.2], [x1, h, 0.0]),
    ];
    if y0 > 0.0 {
        walls.push(([x0, 0.0, -0.2], [x1, y0, 0.0]));
    }
    if !is_front {
        walls.push(([-0.2, 0.0, end - 0.2], [6.2, h, end]));
    }
    add_boxes(&mut scene, Role::Structural, None, &walls);
    if let Some(filling) = hole.filled {
        let leaf = ([x0, y0, -0.12], [x1, y1, -0.08]);
        add_boxes(&mut scene, Role::Detail, filling, &[leaf]);
    }
    scene
}

fn baked(scene: &Scene, method: Option<Method>) -> World {
    let config = BakeConfig {
        method,
        ..BakeConfig::default()
    };
    let context = BakeContext::new(&Silent, None);
    bake(scene, &config, &context).unwrap().world
}

fn kinds(hole: &Hole, is_front: bool) -> Vec<PortalKind> {
    let world = baked(&rooms(hole, is_front), None);
    world.graph.portals.iter().map(|p| p.kind).collect()
}

const DOOR: [f64; 2] = [1.0, 2.1];

#[test]
fn what_says_that_it_is_a_window_or_a_door_is_one() {
    let named = |foot, size, filling| Hole {
        foot,
        size,
        filled: Some(Some(filling)),
    };
    // Down to the floor, with floors on both sides.
    let french = named(0.0, [1.0, 2.1], Filling::Window);
    assert_eq!(kinds(&french, true), [PortalKind::Window]);
    assert_eq!(kinds(&french, false), [PortalKind::Window]);
    // Above a step, and lower than people.
    let raised = named(0.5, [1.0, 2.0], Filling::Door);
    assert_eq!(kinds(&raised, true), [PortalKind::Door]);
    let hatch = named(0.0, [1.0, 1.3], Filling::Door);
    assert_eq!(kinds(&hatch, false), [PortalKind::Door]);
}

#[test]
fn without_names_a_threshold_makes_a_door_and_a_curb_a_window() {
    let at = |foot| Hole {
        foot,
        size: DOOR,
        filled: Some(None),
    };
    for (foot, kind) in [
        (0.0, PortalKind::Door),
        (0.05, PortalKind::Door),
        (0.1, PortalKind::Window),
        (0.3, PortalKind::Window),
    ] {
        assert_eq!(kinds(&at(foot), true), [kind], "{foot} m above the floor");
    }
    // Between rooms, floors of two levels are usual, and glass down to a curb is not.
    assert_eq!(kinds(&at(0.1), false), [PortalKind::Door]);
}

#[test]
fn all_builders_judge_by_one_rule() {
    let french = Hole {
        foot: 0.0,
        size: DOOR,
        filled: Some(Some(Filling::Window)),
    };
    let unnamed = Hole {
        filled: Some(None),
        ..french
    };
    for method in [Method::Watershed, Method::Bsp, Method::Delaunay] {
        for (hole, kind) in [(&french, PortalKind::Window), (&unnamed, PortalKind::Door)] {
            let world = baked(&rooms(hole, false), Some(method));
            let all: Vec<PortalKind> = world.graph.portals.iter().map(|p| p.kind).collect();
            assert_eq!(all, [kind], "{method:?}");
        }
    }
}

#[test]
fn a_slit_is_a_gap_and_no_window() {
    let slit = |size, filled| Hole {
        foot: 1.2,
        size,
        filled,
    };
    for is_front in [true, false] {
        assert_eq!(
            kinds(&slit([2.0, 0.15], None), is_front),
            [PortalKind::Crack]
        );
        assert_eq!(
            kinds(&slit([2.0, 0.6], None), is_front),
            [PortalKind::Window]
        );
        let named = Some(Some(Filling::Window));
        assert_eq!(
            kinds(&slit([2.0, 0.15], named), is_front),
            [PortalKind::Window]
        );
    }
}

/// Two halls of 10 × 8 m and 4 m height with a doorway 4 m wide and nearly as high as they are, through a wall of 1.4 m, and a gate in it as
/// thick as `gate`. The widest ball in a hall passes the doorway, so that only the gate parts them.
#[test]
fn a_gate_as_thick_as_a_wall_is_one_door() {
    for (gate, n_doors) in [(0.3, 1), (1.0, 1), (1.3, 0)] {
        let mut scene = Scene::default();
        let walls = [
            ([-0.2, -0.2, -8.2], [10.2, 0.0, 9.6]),
            ([-0.2, 4.0, -8.2], [10.2, 4.2, 9.6]),
            ([-0.2, 0.0, -8.2], [10.2, 4.0, -8.0]),
            ([-0.2, 0.0, 9.4], [10.2, 4.0, 9.6]),
            ([-0.2, 0.0, -8.0], [0.0, 4.0, 9.4]),
            ([10.0, 0.0, -8.0], [10.2, 4.0, 9.4]),
            ([0.0, 0.0, 0.0], [3.0, 4.0, 1.4]),
            ([7.0, 0.0, 0.0], [10.0, 4.0, 1.4]),
            ([3.0, 3.9, 0.0], [7.0, 4.0, 1.4]),
        ];
        add_boxes(&mut scene, Role::Structural, None, &walls);
        let leaf = ([3.0, 0.0, 0.7 - gate / 2.0], [7.0, 3.9, 0.7 + gate / 2.0]);
        add_boxes(&mut scene, Role::Detail, Some(Filling::Door), &[leaf]);
        let world = baked(&scene, None);
        let doors = world.graph.portals.iter();
        let doors = doors.filter(|p| p.kind == PortalKind::Door).count();
        assert_eq!(doors, n_doors, "{gate} m");
        if n_doors == 1 {
            assert_eq!(world.graph.indoor_cells().count(), 2, "{gate} m");
        }
    }
}

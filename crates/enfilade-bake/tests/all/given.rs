//! Openings that a designer marked become portals where they are marked, or are told with the reason.

use enfilade_bake::{BakeConfig, BakeContext, BakeOutput, Method, bake};
use enfilade_geom::scene::{GivenPortal, Mesh, Object, Primitive, Role, Scene};
use enfilade_geom::{Aabb, DMat4, DVec3};
use enfilade_verify::{VerifyOptions, verify_world};

/// Adds a block from `min` to `max`.
fn block(scene: &mut Scene, min: [f64; 3], max: [f64; 3]) {
    let triangles = Aabb::new(DVec3::from(min), DVec3::from(max)).triangles();
    let points: Vec<[f32; 3]> = triangles
        .as_flattened()
        .iter()
        .map(|p| p.as_vec3().to_array())
        .collect();
    let primitive = Primitive {
        indices: (0..points.len() as u32).collect(),
        positions: points,
        ..Primitive::default()
    };
    scene.meshes.push(Mesh {
        name: String::new(),
        primitives: vec![primitive],
    });
    scene.objects.push(Object {
        name: "wall".into(),
        mesh: scene.meshes.len() as u32 - 1,
        transform: DMat4::IDENTITY,
        role: Role::Structural,
        reason: String::new(),
        filling: None,
        node: None,
    });
}

/// A house of 8 x 3 x 5 m, with a wall from x = 3.75 to 4.25, and a doorway between two z in it, 2.1 m high.
pub(crate) fn house(doorway: [f64; 2]) -> Scene {
    let mut scene = Scene::default();
    let walls = [
        ([-0.3, -0.3, -0.3], [8.3, 0.0, 5.3]),
        ([-0.3, 3.0, -0.3], [8.3, 3.3, 5.3]),
        ([-0.3, 0.0, -0.3], [0.0, 3.0, 5.3]),
        ([8.0, 0.0, -0.3], [8.3, 3.0, 5.3]),
        ([0.0, 0.0, -0.3], [8.0, 3.0, 0.0]),
        ([0.0, 0.0, 5.0], [8.0, 3.0, 5.3]),
        ([3.75, 0.0, 0.0], [4.25, 3.0, doorway[0]]),
        ([3.75, 0.0, doorway[1]], [4.25, 3.0, 5.0]),
        ([3.75, 2.1, doorway[0]], [4.25, 3.0, doorway[1]]),
    ];
    for (min, max) in walls {
        if (0..3).all(|k| min[k] < max[k]) {
            block(&mut scene, min, max);
        }
    }
    scene
}

/// A mark across x, from floor to above head, between two z.
fn mark(name: &str, x: f64, [z0, z1]: [f64; 2]) -> GivenPortal {
    GivenPortal {
        name: name.to_owned(),
        outline: [[0.0, z0], [0.0, z1], [3.2, z1], [3.2, z0]]
            .map(|[y, z]| DVec3::new(x, y, z))
            .to_vec(),
        normal: DVec3::X,
        thickness: 0.0,
    }
}

fn kept(mut scene: Scene, marks: Vec<GivenPortal>, method: Method) -> (BakeOutput, String) {
    scene.given_portals = marks;
    let config = BakeConfig {
        keeps_given: true,
        ..BakeConfig::of(method)
    };
    let baked = bake(&scene, &config, &BakeContext::default()).unwrap();
    baked.world.validate().unwrap();
    let options = VerifyOptions {
        rays: 20_000,
        ..VerifyOptions::default()
    };
    let report = verify_world(&baked.world, None, &options);
    assert!(report.holds(), "{report:?}");
    let notes = baked.notes.join("\n");
    (baked, notes)
}

/// The places along x of all portals but those outdoors, in centimeters.
fn places(baked: &BakeOutput) -> Vec<i64> {
    let portals = baked.world.graph.portals.iter();
    let mut all: Vec<i64> = portals
        .map(|p| (f64::from(p.outline[0][0]) * 100.0).round() as i64)
        .collect();
    all.sort_unstable();
    all
}

const DOORWAY: [f64; 2] = [2.0, 3.0];

#[test]
fn a_portal_found_beside_a_mark_moves_into_it() {
    for method in [Method::Watershed, Method::Bsp, Method::Delaunay] {
        let (without, _) = kept(house(DOORWAY), Vec::new(), method);
        let [found] = places(&without)[..] else {
            panic!("{method:?}: {:?}", places(&without))
        };
        for x in [3.75, 3.92, 4.1, 4.25] {
            let (baked, notes) = kept(
                house(DOORWAY),
                vec![mark("visportal 1", x, [1.5, 3.5])],
                method,
            );
            assert_eq!(
                baked.world.graph.rooms().count(),
                2,
                "{method:?} {x}: {notes}"
            );
            let at = (x * 100.0).round() as i64;
            let is_same = (at - found).abs() <= 5;
            assert_eq!(
                places(&baked),
                [if is_same { found } else { at }],
                "{method:?}: {notes}"
            );
            let says = format!(
                "moved into the mark by {:.2} m",
                (x - found as f64 / 100.0).abs()
            );
            assert!(
                notes.contains("visportal 1 is portal-0, between"),
                "{notes}"
            );
            assert_eq!(notes.contains(&says), !is_same, "{notes}");
        }
    }
}

#[test]
fn a_mark_without_an_opening_parts_a_room_alone_or_with_another() {
    // A doorway from wall to wall and to the ceiling is none.
    let open = [0.0, 5.0];
    let hall = house(open);
    let (whole, _) = kept(
        Scene {
            objects: hall.objects[..6].to_vec(),
            ..hall.clone()
        },
        Vec::new(),
        Method::Watershed,
    );
    assert_eq!(whole.world.graph.rooms().count(), 1);
    let bare = || Scene {
        objects: hall.objects[..6].to_vec(),
        ..hall.clone()
    };
    let (baked, notes) = kept(
        bare(),
        vec![mark("hint 1", 4.0, [-0.1, 5.1])],
        Method::Watershed,
    );
    assert_eq!(baked.world.graph.rooms().count(), 2, "{notes}");
    assert!(notes.contains("hint 1 is portal-0, between"), "{notes}");
    assert!(notes.contains("they were one cell without it\n"), "{notes}");
    // A block in the middle of the hall: there are two ways around it.
    let mut ring = bare();
    block(&mut ring, [3.0, 0.0, 2.0], [5.0, 3.0, 3.0]);
    let pair = vec![mark("a", 4.0, [-0.1, 2.1]), mark("b", 4.0, [2.9, 5.1])];
    let (baked, notes) = kept(ring.clone(), pair.clone(), Method::Watershed);
    assert_eq!(baked.world.graph.rooms().count(), 2, "{notes}");
    assert!(notes.contains("without it and b"), "{notes}");
    let (baked, notes) = kept(ring, pair[..1].to_vec(), Method::Watershed);
    assert_eq!(baked.world.graph.rooms().count(), 1, "{notes}");
    assert!(
        notes.contains("a parts nothing: ") && notes.contains("a way leads around it at 4.00,"),
        "{notes}"
    );
}

#[test]
fn a_mark_in_a_wall_parts_nothing() {
    let (baked, notes) = kept(
        house(DOORWAY),
        vec![mark("portal", 4.0, [0.2, 1.2])],
        Method::Watershed,
    );
    assert_eq!(baked.world.graph.portals.len(), 1);
    assert!(
        notes.contains("portal parts nothing: ") && notes.contains("solid matter"),
        "{notes}"
    );
    assert!(notes.contains("0 of 1 given portals are kept"), "{notes}");
}

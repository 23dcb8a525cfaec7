//! The widest way out of buildings with a hole goes through the hole.

use enfilade_bake::leak::{LeakTrail, NoTrail, find_leak_trail};
use enfilade_bake::{BakeConfig, BakeContext};
use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{Aabb, Bvh, DVec3, Triangle};
use enfilade_testkit::solid::{MeshBuilder, aabb};
use enfilade_testkit::{Generated, OpeningKind, Side, Site, furnished_house, rotated};

/// Edge of a voxel by default. [Units: wu]
const VOXEL: f64 = 0.1;

/// Rooms of 4 × 2.6 × 5 m and 3 × 2.6 × 5 m side by side along x, with a doorway of 0.9 × 2.1 m between them and walls
/// 0.2 m thick, minus `hole`.
fn two_rooms(hole: Aabb) -> Generated {
    let mut site = Site::new("two rooms");
    let plaster = site.material("plaster", [0.8; 3]);
    let mut house = MeshBuilder::new(plaster);
    house.carved(
        &[aabb([-0.2, -0.2, -0.2], [7.4, 2.8, 5.2])],
        &[
            aabb([0.0, 0.0, 0.0], [4.0, 2.6, 5.0]),
            aabb([4.2, 0.0, 0.0], [7.2, 2.6, 5.0]),
            aabb([4.0, 0.0, 2.0], [4.2, 2.1, 2.9]),
            hole,
        ],
    );
    site.structure("house", house);
    site.finish()
}

/// The west wall between floor, ceiling and the other walls.
fn west_wall() -> Aabb {
    aabb([-0.2, 0.0, 0.0], [0.0, 2.6, 5.0])
}

fn trail(scene: &Scene, from: Option<DVec3>) -> LeakTrail {
    let found = find_leak_trail(scene, &BakeConfig::default(), from, &BakeContext::default());
    let trail = found.unwrap_or_else(|e| panic!("{e}"));
    assert!(trail.points.contains(&trail.narrowest) && trail.points.contains(&trail.exit));
    let structure: Vec<Triangle> = scene
        .triangle_sources(Role::Structural)
        .map(|s| scene.world_triangle(s))
        .collect();
    let bvh = Bvh::build(&structure);
    for s in trail.points.windows(2) {
        assert!(!bvh.any_hit(s[0], s[1], |_| false), "{s:?} is in the way");
        // Nowhere narrower than the narrowest place, up to voxel rounding.
        for t in 0..=20 {
            let p = s[0].lerp(s[1], f64::from(t) / 20.0);
            let width = 2.0 * bvh.nearest(p, f64::INFINITY).unwrap().distance;
            assert!(width > trail.width - 4.0 * VOXEL, "{width} at {p}");
        }
    }
    let last = trail.points[trail.points.len() - 1];
    assert!(bvh.nearest(last, f64::INFINITY).unwrap().distance > 8.0 * VOXEL);
    trail
}

fn lies_in(p: DVec3, hole: &Aabb) -> bool {
    Aabb::new(hole.min - VOXEL, hole.max + VOXEL).contains(p)
}

#[test]
fn the_way_out_goes_through_the_hole() {
    for (what, hole, width) in [
        ("a missing wall", west_wall(), 2.6),
        (
            "a hole in a wall",
            aabb([-0.2, 0.6, 1.0], [0.0, 2.0, 3.0]),
            1.4,
        ),
        (
            "a piece of roof",
            aabb([1.0, 2.6, 3.4], [2.2, 2.8, 4.6]),
            1.2,
        ),
        (
            "a missing floor",
            aabb([0.0, -0.2, 0.0], [4.0, 0.0, 5.0]),
            4.0,
        ),
    ] {
        let g = two_rooms(hole);
        for degrees in [0.0, 30.0] {
            let found = trail(&rotated(g.clone(), degrees).scene, None);
            let back = |p| {
                enfilade_geom::DMat4::from_rotation_y(-f64::to_radians(degrees)).transform_point3(p)
            };
            let (narrowest, exit) = (back(found.narrowest), back(found.exit));
            assert!(lies_in(narrowest, &hole), "{what}: {narrowest}");
            assert!(lies_in(exit, &hole), "{what}: {exit}");
            // The room may be narrower than its hole.
            let seen = found.width;
            assert!(
                seen < width + 0.02 && seen > width.min(2.6) - 2.0 * VOXEL,
                "{what}: {seen}"
            );
            assert_eq!(found.is_wide_open(), width > 2.5, "{what}");
        }
    }
}

#[test]
fn from_a_point_the_way_begins_in_its_room() {
    let g = two_rooms(west_wall());
    // Where two walls of the room meet, which is closed except for its doorway.
    let found = trail(&g.scene, Some(DVec3::new(7.0, 0.3, 0.2)));
    assert!(lies_in(
        found.points[0],
        &aabb([4.3, 0.5, 0.5], [7.1, 2.5, 4.5])
    ));
    let doorway = aabb([4.0, 0.0, 2.0], [4.2, 2.1, 2.9]);
    assert!(lies_in(found.narrowest, &doorway), "{}", found.narrowest);
    assert!((found.width - 0.9).abs() < 0.11, "{}", found.width);
    assert!(!found.is_wide_open());
    // It comes out where the wall is missing.
    assert!(lies_in(found.exit, &west_wall()), "{}", found.exit);
    assert!(
        found.length() > 6.0 && found.length() < 9.0,
        "{}",
        found.length()
    );
}

#[test]
fn panes_and_leaves_close_a_house_and_a_missing_pane_opens_it() {
    let mut g = furnished_house();
    let rooms = &g.truth.rooms;
    let living = rooms
        .iter()
        .position(|r| r.name.contains("living"))
        .unwrap();
    let inside = rooms[living].sample_points[0];
    let config = BakeConfig::default();
    let closed =
        find_leak_trail(&g.scene, &config, Some(inside), &BakeContext::default()).unwrap_err();
    assert!(matches!(closed, NoTrail::Closed { .. }), "{closed}");
    let window = g
        .truth
        .openings
        .iter()
        .filter(|o| o.kind == OpeningKind::Window && o.rooms.contains(&Side::Room(living)))
        .max_by(|a, b| a.width.min(a.height).total_cmp(&b.width.min(b.height)))
        .unwrap()
        .clone();
    let scene = &mut g.scene;
    let centers: Vec<DVec3> = scene
        .objects
        .iter()
        .map(|o| {
            let mesh = &scene.meshes[o.mesh as usize];
            let points = mesh.primitives.iter().flat_map(|p| &p.positions);
            let bounds = points.fold(Aabb::EMPTY, |b, p| {
                b.including(o.transform.transform_point3(DVec3::from(p.map(f64::from))))
            });
            bounds.center()
        })
        .collect();
    let mut at = centers.iter();
    scene.objects.retain(|o| {
        let is_near = at.next().unwrap().distance(window.center) < 0.3;
        !(is_near && o.name.contains("window"))
    });
    let found = trail(&g.scene, Some(inside));
    let hole = window
        .corners
        .iter()
        .fold(Aabb::EMPTY, |b, p| b.including(*p));
    let hole = Aabb::new(hole.min - window.thickness, hole.max + window.thickness);
    assert!(
        lies_in(found.narrowest, &hole),
        "{found:?} {hole:?} {window:?}"
    );
}

#[test]
fn where_there_is_nothing_to_tell_it_is_said_why() {
    let config = BakeConfig::default();
    let scene = two_rooms(west_wall()).scene;
    let answer = |scene: &Scene, from: Option<[f64; 3]>| {
        find_leak_trail(
            scene,
            &config,
            from.map(DVec3::from_array),
            &BakeContext::default(),
        )
        .unwrap_err()
    };
    let beyond = answer(&scene, Some([100.0, 1.0, 1.0]));
    assert!(matches!(beyond, NoTrail::Outside { .. }), "{beyond}");
    let empty = answer(&Scene::default(), None);
    assert!(matches!(empty, NoTrail::Bake(_)), "{empty}");
    let mut site = Site::new("block");
    let mut block = MeshBuilder::new(0);
    block.cuboid(aabb([0.0, 0.0, 0.0], [6.0, 0.3, 6.0]));
    site.structure("block", block);
    let block = site.finish().scene;
    let floor = answer(&block, None);
    assert!(matches!(floor, NoTrail::NothingEnclosed), "{floor}");
    let closed = answer(
        &two_rooms(aabb([0.0; 3], [0.1; 3])).scene,
        Some([1.0, 1.0, 1.0]),
    );
    assert!(matches!(closed, NoTrail::Closed { .. }), "{closed}");
    // Half of the voxels within reach are air, but on both sides of a slab.
    let near = find_leak_trail(
        &block,
        &config,
        Some(DVec3::new(3.0, 0.31, 3.0)),
        &BakeContext::default(),
    );
    assert!(near.is_ok(), "{near:?}");
    let solid = Scene {
        meshes: {
            let mut many = MeshBuilder::new(0);
            for k in 0..11 {
                let y = f64::from(k) * 0.09;
                many.cuboid(aabb([0.0, y, 0.0], [3.0, y + 0.08, 3.0]));
            }
            vec![many.build("layers", &[])]
        },
        objects: block.objects.clone(),
        ..block.clone()
    };
    let inside = answer(&solid, Some([1.5, 0.5, 1.5]));
    assert!(matches!(inside, NoTrail::InMatter { .. }), "{inside}");
}

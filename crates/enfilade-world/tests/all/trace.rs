//! Rays through mirrors and links against plain lists of triangles, moved by matrices. FEATURES: W7, W9, R6.

use enfilade_cpg::{
    CellId, MonitorCamera, Pass, PortalId, SpecialId, SpecialPortal, SpecialShape, Way, World,
};
use enfilade_geom::{DMat4, DQuat, DVec3, Triangle};
use enfilade_runtime::Target;
use enfilade_testkit::{GridParams, Rng, room_grid, with_specials};
use enfilade_world::{PartId, SightRay, Space, TraceEnd};

/// Distance within which rounding decides. [Units: wu]
const NEAR: f64 = 2e-3;

fn point(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// The share of a segment before it meets a triangle, by solving for weights of its vertices.
fn share_before(from: DVec3, by: DVec3, [a, b, c]: Triangle) -> Option<f64> {
    let (u, v) = (b - a, c - a);
    let across = by.cross(v);
    let volume = u.dot(across);
    if volume.abs() < 1e-14 {
        return None;
    }
    let w1 = (from - a).dot(across) / volume;
    let turned = (from - a).cross(u);
    let w2 = by.dot(turned) / volume;
    let t = v.dot(turned) / volume;
    (w1 >= 0.0 && w2 >= 0.0 && w1 + w2 <= 1.0 && t >= 0.0).then_some(t)
}

/// The world as it looks through a chain of special portals: everything moved by a matrix.
struct Plain {
    /// Batch, number in it, and vertices.
    walls: Vec<(u32, u32, Triangle)>,
    /// The matrix of each special portal, its normal, and its polygon.
    sides: Vec<(DMat4, DVec3, Vec<DVec3>)>,
}

impl Plain {
    fn new(world: &World) -> Self {
        let mut walls = Vec::new();
        for (b, batch) in (0..).zip(&world.batches) {
            let p = &batch.primitive;
            for (t, ijk) in (0..).zip(p.indices.chunks_exact(3)) {
                let corner = |k: usize| point(p.positions[ijk[k] as usize]);
                walls.push((b, t, [corner(0), corner(1), corner(2)]));
            }
        }
        let side = |special: &SpecialPortal| {
            let SpecialShape::Surface { normal, pieces } = &special.shape else {
                panic!("on a wall");
            };
            let n = point(*normal).normalize();
            let polygon: Vec<DVec3> = pieces[0].iter().map(|p| point(*p)).collect();
            let map = match &special.passes[0].way {
                Way::Mirror => {
                    let column = |e: DVec3| (e - n * 2.0 * n.dot(e)).extend(0.0);
                    let off = n * 2.0 * n.dot(polygon[0]);
                    DMat4::from_cols(
                        column(DVec3::X),
                        column(DVec3::Y),
                        column(DVec3::Z),
                        off.extend(1.0),
                    )
                }
                Way::Lead { map, .. } => {
                    DMat4::from_translation(map.at)
                        * DMat4::from_quat(map.turn)
                        * DMat4::from_scale(DVec3::splat(map.scale))
                }
                way => panic!("{way:?}"),
            };
            (map, n, polygon)
        };
        let sides = world.graph.specials.iter().map(side).collect();
        Self { walls, sides }
    }

    /// The walls that a segment meets where they seem to be, nearest first: the share before each, and its number.
    fn met(&self, seem: &DMat4, from: DVec3, by: DVec3) -> Vec<(f64, usize)> {
        let moved = |t: Triangle| t.map(|p| seem.transform_point3(p));
        let all = self.walls.iter().enumerate();
        let mut met: Vec<(f64, usize)> = all
            .filter_map(|(i, w)| Some((share_before(from, by, moved(w.2))?, i)))
            .collect();
        met.sort_by(|a, b| a.0.total_cmp(&b.0));
        met
    }

    /// The share of a segment before it goes through a special portal, where that seems to be, from its front; and the way from the
    /// nearest edge of its polygon.
    fn crossed(&self, seem: &DMat4, i: usize, from: DVec3, by: DVec3) -> Option<f64> {
        let home = seem.inverse();
        let (from, by) = (home.transform_point3(from), home.transform_vector3(by));
        let (_, n, polygon) = &self.sides[i];
        if n.dot(by) <= 0.0 {
            return None;
        }
        let fan = (2..polygon.len()).map(|k| [polygon[0], polygon[k - 1], polygon[k]]);
        fan.filter_map(|t| share_before(from, by, t)).next()
    }
}

#[test]
fn rays_hit_what_straight_lines_hit_in_the_moved_world() {
    let [mut n_by_depth, mut n_sure] = [[0_u32; 8], [0; 8]];
    for seed in 0..12 {
        let params = GridParams {
            size: [3, 1, 2],
            doors: 1.0,
            furniture: 0,
            ..GridParams::offices(4, seed)
        };
        let world = with_specials(room_grid(&params), 5, seed);
        let plain = Plain::new(&world);
        let space = Space::new(world.clone()).unwrap();
        let mut rng = Rng::new(seed);
        let mut passed = Vec::new();
        let rooms: Vec<CellId> = world.graph.indoor_cells().map(|(id, _)| id).collect();
        for _ in 0..1500 {
            let [low, high] = world.graph[rooms[rng.below(rooms.len())]].aabb.map(point);
            let mut unit = || rng.range(0.05, 0.95);
            let from = low + (high - low) * DVec3::new(unit(), unit(), unit());
            let mut way = || rng.range(-1.0, 1.0);
            let by = DVec3::new(way(), way() * 0.4, way()).normalize() * 60.0;
            // Vertices as the world's files round them.
            let from = point(from.as_vec3().to_array());
            let ray = SightRay {
                most: 7,
                ..SightRay::new(PartId::ROOT, from, by)
            };
            let traced = space.pick(&ray, &mut passed).unwrap();
            assert_eq!(traced.n_passed, passed.len());
            n_by_depth[passed.len()] += 1;
            let mut seem = DMat4::IDENTITY;
            let mut begin = 0.0;
            let mut is_sure = true;
            let ends = traced.length / 60.0;
            for &(_, SpecialId(special)) in &passed {
                let t = plain.crossed(&seem, special as usize, from, by);
                let t = t.unwrap_or_else(|| {
                    is_sure = false;
                    begin
                });
                let walls = plain.met(&seem, from, by);
                let before = walls.iter().find(|w| (w.0 - begin) * 60.0 > NEAR);
                assert!(
                    before.is_none_or(|w| (w.0 - t) * 60.0 > -NEAR),
                    "seed {seed} {ray:?}"
                );
                begin = t;
                seem *= plain.sides[special as usize].0.inverse();
            }
            if !is_sure || !is_clearly_beside(&plain, &seem, (from, by), [begin, ends]) {
                continue;
            }
            // The composed map is that of the matrices.
            assert!(
                traced.seems_at().distance(from + by * ends)
                    < 1e-6 * (1.0 + traced.map.scale.abs().recip()) * 100.0
            );
            let TraceEnd::Surface(hit) = traced.end else {
                continue;
            };
            let walls = plain.met(&seem, from, by);
            let nearest = walls
                .iter()
                .find(|w| (w.0 - begin) * 60.0 > NEAR)
                .expect("a wall");
            assert!(
                (nearest.0 - ends).abs() * 60.0 < NEAR,
                "seed {seed} {ray:?}: {nearest:?} {ends}"
            );
            let Target::Wall { batch, triangle } = hit.1.target else {
                panic!("{hit:?}");
            };
            let same = walls
                .iter()
                .filter(|w| (w.0 - nearest.0).abs() * 60.0 < NEAR);
            let names: Vec<_> = same
                .map(|w| (plain.walls[w.1].0, plain.walls[w.1].1))
                .collect();
            assert!(names.contains(&(batch, triangle)), "{names:?} {hit:?}");
            n_sure[passed.len()] += 1;
        }
    }
    assert!(
        n_sure[0] > 2000 && n_sure[1] > 500 && n_sure[2] > 50 && n_sure[3] > 5,
        "{n_by_depth:?} {n_sure:?}"
    );
}

/// Returns `true` if no special portal lies on the last stretch, where rays would be turned again.
fn is_clearly_beside(
    plain: &Plain,
    seem: &DMat4,
    (from, by): (DVec3, DVec3),
    [begin, end]: [f64; 2],
) -> bool {
    let mut is_beside = true;
    for i in 0..plain.sides.len() {
        let Some(t) = plain.crossed(seem, i, from, by) else {
            continue;
        };
        let is_on_way = (t - begin) * 60.0 > NEAR && (end - t) * 60.0 > NEAR;
        assert!(
            !is_on_way,
            "a ray goes through special portal {i} and is not turned"
        );
        is_beside &= (t - end).abs() * 60.0 > NEAR || (t - begin).abs() * 60.0 <= NEAR;
    }
    is_beside
}

/// A room of 4 x 3 x 4 m or so, and its box.
fn room() -> (World, [DVec3; 2]) {
    let params = GridParams {
        size: [2, 1, 1],
        doors: 1.0,
        windows: 0.0,
        furniture: 0,
        ..GridParams::offices(1, 1)
    };
    let world = room_grid(&params);
    let aabb = world.graph.cells[0].aabb.map(point);
    (world, aabb)
}

/// A rectangle that fills a side of a box along z, seen from inside.
fn across(world: &mut World, at: f64, toward: f64, aabb: [DVec3; 2], passes: Vec<Pass>) {
    let [low, high] = aabb.map(|p| p.as_vec3());
    let z = at as f32;
    let mut piece = vec![
        [low.x, low.y, z],
        [high.x, low.y, z],
        [high.x, high.y, z],
        [low.x, high.y, z],
    ];
    if toward < 0.0 {
        piece.reverse();
    }
    world.graph.specials.push(SpecialPortal {
        name: String::new(),
        cell: CellId(0),
        shape: SpecialShape::Surface {
            normal: [0.0, 0.0, toward as f32],
            pieces: vec![piece],
        },
        passes,
    });
}

#[test]
fn facing_mirrors_end_a_ray_after_as_many_as_it_may_pass() {
    let (mut world, aabb) = room();
    let [low, high] = aabb;
    across(&mut world, low.z, -1.0, aabb, vec![Pass::new(Way::Mirror)]);
    across(&mut world, high.z, 1.0, aabb, vec![Pass::new(Way::Mirror)]);
    let space = Space::new(world).unwrap();
    let from = (low + high) * 0.5;
    let depth = high.z - low.z;
    let mut passed = Vec::new();
    for most in [0, 1, 3, SightRay::USUAL_MOST, 500] {
        let ray = SightRay {
            most,
            ..SightRay::new(PartId::ROOT, from, DVec3::Z * 1e4)
        };
        let traced = space.pick(&ray, &mut passed).unwrap();
        assert_eq!(traced.n_passed, most);
        let next = SpecialId(1 - most as u32 % 2);
        assert_eq!(traced.end, TraceEnd::Capped(PartId::ROOT, next));
        let length = depth * (most as f64 + 0.5);
        assert!((traced.length - length).abs() < 1e-6 * length, "{traced:?}");
        assert!(traced.seems_at().distance(from + DVec3::Z * length) < 1e-6 * length);
        assert_eq!(traced.map.is_reflection(), most % 2 == 1);
        let order: Vec<u32> = passed.iter().map(|p| p.1.0).collect();
        assert!(
            order
                .iter()
                .enumerate()
                .all(|(i, s)| *s == 1 - i as u32 % 2)
        );
    }
    // A ray that is too short for the next mirror ends in the air.
    let ray = SightRay::new(PartId::ROOT, from, DVec3::Z * depth * 1.75);
    let traced = space.pick(&ray, &mut passed).unwrap();
    assert_eq!((traced.end, traced.n_passed), (TraceEnd::Open, 2));
    assert!(
        traced.at.distance(from + DVec3::Z * depth * -0.25) < 1e-6,
        "{traced:?}"
    );
    let bad = SightRay::new(PartId::ROOT, from, DVec3::NAN);
    assert!(space.pick(&bad, &mut passed).is_err());
    let nothing = space.trace(&bad, &mut passed, |_, _, _| Some((0.0, ())));
    assert_eq!(nothing.end, TraceEnd::Open);
}

#[test]
fn monitors_stop_rays_panes_do_not_and_links_scale_lengths() {
    let (mut world, aabb) = room();
    let [low, high] = aabb;
    let from = (low + high) * 0.5;
    let camera = MonitorCamera {
        eye: from.as_vec3().to_array(),
        toward: [1.0, 0.0, 0.0],
        up: [0.0, 1.0, 0.0],
        fov_y: 1.0,
    };
    across(
        &mut world,
        low.z,
        -1.0,
        aabb,
        vec![Pass::new(Way::Monitor(camera))],
    );
    // Out of the middle of the room again, twice as large, turned to x.
    let turn = DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2);
    let entry = DVec3::new(from.x, from.y, high.z);
    let map = enfilade_geom::Similarity {
        turn,
        scale: 2.0,
        at: from - turn * entry * 2.0,
    };
    let lead = Way::Lead {
        to: CellId(0),
        map,
        back: None,
    };
    across(&mut world, high.z, 1.0, aabb, vec![Pass::new(lead)]);
    // A pane in the doorway to the next room.
    let portal = world.graph.portals[0].clone();
    let side = portal.cells[0];
    let pane = Pass {
        way: Way::Mirror,
        tint: [1.0, 1.0, 1.0, 0.3],
    };
    world.graph.specials.push(SpecialPortal {
        name: String::new(),
        cell: side,
        shape: SpecialShape::Portal(PortalId(0)),
        passes: vec![Pass::new(Way::Through), pane],
    });
    let mut space = Space::new(world.clone()).unwrap();
    let mut passed = Vec::new();
    let ray = SightRay::new(PartId::ROOT, from, DVec3::NEG_Z * 50.0);
    let seen = space.pick(&ray, &mut passed).unwrap();
    assert_eq!(seen.end, TraceEnd::Monitor(PartId::ROOT, SpecialId(0)));
    assert!((seen.length - (from.z - low.z)).abs() < 1e-6 && passed.is_empty());

    let ray = SightRay::new(PartId::ROOT, from, DVec3::Z * 50.0);
    let seen = space.pick(&ray, &mut passed).unwrap();
    assert_eq!(passed, [(PartId::ROOT, SpecialId(1))]);
    let (_, hit) = seen.surface().expect("a wall");
    let off = hit.position[0] as f64 - from.x;
    assert!(
        off > 0.1 && (point(hit.position) - from).dot(DVec3::Z).abs() < 1e-6,
        "{hit:?}"
    );
    // Walls that are twice as large there seem half as far.
    assert!(
        (seen.length - (high.z - from.z) - off / 2.0).abs() < 1e-5,
        "{seen:?}"
    );

    let middle = world.graph.portals[0].pieces[0]
        .iter()
        .map(|p| point(*p))
        .sum::<DVec3>()
        / 4.0;
    let normal = point(portal.normal);
    let ray = SightRay::new(PartId::ROOT, middle - normal * 0.5, normal * 2.0);
    let seen = space.pick(&ray, &mut passed).unwrap();
    assert!(seen.length > 0.6 && passed.is_empty(), "{seen:?}");
    // Shut, the doorway is what is hit.
    space.close(PartId::ROOT, PortalId(0));
    let seen = space.pick(&ray, &mut passed).unwrap();
    assert_eq!(
        seen.surface().unwrap().1.target,
        Target::Portal(PortalId(0))
    );
}

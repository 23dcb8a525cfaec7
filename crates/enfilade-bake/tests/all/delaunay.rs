//! The thesis's cases through the Delaunay builder: with the default stop, the remaining portals are
//! exactly the separations of the rooms.

use enfilade_bake::delaunay::{JOINED, Session};
use enfilade_bake::{BakeConfig, BakeContext, Method, Silent, bake, bake_session};
use enfilade_cpg::{PortalKind, World};
use enfilade_geom::{Aabb, DVec3};
use enfilade_testkit::mixed::{pitched_roof_attic, room_within_room, stair_hall, two_rooms_crack};
use enfilade_testkit::{
    Generated, OpeningKind, Site, Variant, gjorup_cavern, gjorup_rooms, scaled, solid,
};
use enfilade_verify::{VerifyOptions, verify_world};

fn baked(g: &Generated) -> World {
    let context = BakeContext::new(&Silent, None);
    let out = bake(&g.scene, &BakeConfig::of(Method::Delaunay), &context).unwrap();
    out.world
}

/// Returns complaints unless exactly the openings separate the rooms.
fn problems(g: &Generated, what: &str) -> Vec<String> {
    let world = baked(g);
    let mut out = Vec::new();
    let indoor = world.graph.indoor_cells().count();
    if indoor != g.truth.rooms.len() {
        out.push(format!(
            "{what}: {indoor} rooms, not {}",
            g.truth.rooms.len()
        ));
    }
    // Hairline gaps where distorted walls meet are faults of the model, and kept separate as such.
    let open = |p: &&enfilade_cpg::Portal| p.kind != PortalKind::Crack;
    let openings: Vec<_> = world.graph.portals.iter().filter(open).collect();
    if openings.len() != g.truth.openings.len() {
        let n = g.truth.openings.len();
        out.push(format!("{what}: {} portals, not {n}", openings.len()));
    }
    for o in &g.truth.openings {
        let center = o.center.as_vec3();
        let near = openings.iter().any(|p| {
            let n = p.outline.len() as f32;
            let middle: [f32; 3] =
                [0, 1, 2].map(|k| p.outline.iter().map(|q| q[k]).sum::<f32>() / n);
            let d = DVec3::from_array(middle.map(f64::from)).as_vec3() - center;
            f64::from(d.length()) < 0.3 + o.thickness * 0.5
        });
        if !near {
            out.push(format!("{what}: no portal at {}", o.name));
        }
    }
    let options = VerifyOptions {
        rays: 4_000,
        ..VerifyOptions::default()
    };
    let report = verify_world(&world, None, &options);
    if !report.holds() {
        out.push(format!("{what}: {report}"));
    }
    out
}

// Covers T3 and Z4.
#[test]
fn rooms_of_the_thesis_are_parted_by_exactly_their_openings() {
    let mut all = Vec::new();
    for variant in [Variant::Optimised, Variant::Tessellated, Variant::Distorted] {
        all.extend(problems(
            &gjorup_rooms(variant, [0.0; 3]),
            &format!("{variant:?}"),
        ));
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}

#[test]
fn the_cavern_is_parted_at_its_necks_however_it_is_turned() {
    let mut all = Vec::new();
    for degrees in [[0.0; 3], [7.0, 0.0, 0.0], [0.0, 8.0, 0.0], [7.0, 8.0, 9.0]] {
        all.extend(problems(
            &gjorup_cavern(degrees),
            &format!("cavern {degrees:?}"),
        ));
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}

/// The stairs stand in the hall, whose door leads outdoors; walls and roofs have insides. A gap is not a portal.
// Covers T2.
#[test]
fn no_room_is_lost_to_the_outdoors_and_no_solid_is_a_cell() {
    let mut all = Vec::new();
    let buildings = [
        stair_hall(),
        room_within_room(),
        pitched_roof_attic(),
        two_rooms_crack(0.005),
    ];
    for g in buildings {
        all.extend(problems(&g, &g.truth.scene));
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}

/// All along the top of the wall between two rooms: too narrow for the smallest known ball, and nearly as open as
/// their door.
#[test]
fn a_slit_between_rooms_is_weighed_by_its_width() {
    for width in [0.05, 0.15, 0.25, 0.35] {
        let g = two_rooms_crack(width);
        let context = BakeContext::new(&Silent, None);
        let config = BakeConfig::of(Method::Delaunay);
        let session = Session::begin(&g.scene, &config, &context).unwrap();
        let ahead = &session.decimation.steps[session.decimation.stop..];
        let weights: Vec<f64> = ahead.iter().map(|s| s.weight).collect();
        // One step joins them, through the door: balls 1.35 in radius, and 0.45 for the widest that passes.
        assert_eq!(weights.len(), 1, "{width}: {weights:?}");
        assert!((2.7..3.2).contains(&weights[0]), "{width}: {weights:?}");
    }
}

/// Moves every vertex by up to `reach` along each axis, equal vertices alike.
fn with_noise(mut g: Generated, reach: f32) -> Generated {
    for p in g
        .scene
        .meshes
        .iter_mut()
        .flat_map(|m| &mut m.primitives)
        .flat_map(|p| &mut p.positions)
    {
        let mut h = p.iter().fold(0x9e37_79b9_u32, |h, x| {
            // +0 and -0 are one vertex.
            (h ^ (x + 0.0).to_bits())
                .wrapping_mul(0x85eb_ca6b)
                .rotate_left(13)
        });
        *p = p.map(|x| {
            h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
            x + ((h >> 8) as f32 / (1 << 23) as f32 - 1.0) * reach
        });
    }
    g
}

/// Adds boxes to the walls of a scene, with their faces outwards.
fn with_boxes(mut g: Generated, boxes: &[[[f32; 3]; 2]]) -> Generated {
    let primitive = &mut g.scene.meshes[0].primitives[0];
    primitive.normals.clear();
    for [lo, hi] in boxes {
        let first = primitive.positions.len() as u32;
        for i in 0..8 {
            let pick = |k: usize| if i >> k & 1 == 0 { lo[k] } else { hi[k] };
            primitive.positions.push([pick(0), pick(1), pick(2)]);
        }
        for [a, b, c, d] in Aabb::FACES {
            let indices = [a, b, c, a, c, d].map(|i| first + i as u32);
            primitive.indices.extend(indices);
        }
    }
    g
}

/// A table with a chair: a top or seat, and four legs each; the chair has a back.
fn table_and_chair() -> Vec<[[f32; 3]; 2]> {
    let mut boxes = Vec::new();
    for (x, z, wide, deep, high) in [(1.2, 1.4, 1.2, 0.8, 0.72), (1.5, 2.4, 0.45, 0.45, 0.45)] {
        boxes.push([[x, high, z], [x + wide, high + 0.04, z + deep]]);
        for (dx, dz) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let (x, z) = (x + dx * (wide - 0.06), z + dz * (deep - 0.06));
            boxes.push([[x, 0.06, z], [x + 0.06, high, z + 0.06]]);
        }
    }
    boxes.push([[1.5, 0.5, 2.81], [1.95, 0.95, 2.85]]);
    boxes
}

#[test]
fn noise_and_furniture_change_nothing() {
    let mut all = Vec::new();
    let rooms = || gjorup_rooms(Variant::Tessellated, [0.0; 3]);
    all.extend(problems(&with_noise(rooms(), 0.04), "noisy rooms"));
    let cavern = with_noise(gjorup_cavern([0.0; 3]), 0.15);
    all.extend(problems(&cavern, "noisy cavern"));
    let furnished = with_boxes(with_noise(rooms(), 0.04), &table_and_chair());
    all.extend(problems(&furnished, "table and chair"));
    assert!(all.is_empty(), "{}", all.join("\n"));
}

/// A hall of 150 × 100 m and 12 m high, divided by a wall half a meter thick with one door of 0.8 m by 2 m: its
/// surfaces have forty thousand times the door's area.
#[test]
fn a_small_door_of_a_large_hall_is_found() {
    let boxed = |lo: [f64; 3], hi: [f64; 3]| solid::aabb(lo, hi);
    let mut site = Site::new("hall");
    let plaster = site.material("plaster", [0.8, 0.8, 0.8]);
    let storey = site.storey("ground floor", 0.0);
    let halls = [
        boxed([0.0; 3], [80.0, 12.0, 100.0]),
        boxed([80.5, 0.0, 0.0], [150.0, 12.0, 100.0]),
    ];
    let west = site.room("west", storey, halls[0]);
    let east = site.room("east", storey, halls[1]);
    let door = boxed([80.0, 0.0, 31.3], [80.5, 2.0, 32.1]);
    site.opening(OpeningKind::Door, door, 0, [west, east]);
    let mut mesh = solid::MeshBuilder::new(plaster);
    let outer = boxed([-0.5; 3], [150.5, 12.5, 100.5]);
    mesh.carved(&[outer], &[halls[0], halls[1], door]);
    site.structure("hall", mesh);
    let all = problems(&site.finish(), "hall");
    assert!(all.is_empty(), "{}", all.join("\n"));
}

/// Returns the session's room count after `n` steps, which must equal that of the bake.
fn rooms_left(g: &Generated, session: &Session, n: usize, config: &BakeConfig) -> usize {
    let context = BakeContext::new(&Silent, None);
    let out = bake_session(&g.scene, session, n, config, &context).unwrap();
    let cells = &out.world.graph.cells;
    let n_indoor = cells.iter().filter(|c| !c.outdoor).count();
    let [n_rooms, _] = session.count_rooms(n, config);
    assert_eq!(n_rooms, n_indoor, "{}, {n} steps", g.truth.scene);
    n_rooms
}

// Covers T5.
#[test]
fn a_person_s_choices_hold_and_steps_go_back() {
    let g = gjorup_rooms(Variant::Optimised, [0.0; 3]);
    let context = BakeContext::new(&Silent, None);
    let mut config = BakeConfig::of(Method::Delaunay);
    let mut session = Session::begin(&g.scene, &config, &context).unwrap();
    let stop = session.decimation.stop;
    // A step forwards joins two of the rooms; a step back makes them four again.
    assert_eq!(rooms_left(&g, &session, stop + 1, &config), 3);
    assert_eq!(rooms_left(&g, &session, stop, &config), 4);
    // The same as a permanent choice.
    let door = session.decimation.steps[stop].position;
    config.delaunay.choices.join.push(door);
    session.decimate(&config);
    let stop = session.decimation.stop;
    assert_eq!(rooms_left(&g, &session, stop, &config), 3);
    // The reverse: keeps a portal that would be removed.
    config.delaunay.choices.join.clear();
    config.delaunay.choices.keep.push(door);
    config.delaunay.stop = Some(4.0);
    session.decimate(&config);
    let stop = session.decimation.stop;
    let steps = &session.decimation.steps[..stop];
    assert!(steps.iter().all(|s| s.position.distance(door) > 0.5));
    assert!(rooms_left(&g, &session, stop, &config) > 1);
}

/// Holds however far ahead a portal is, and although much of the walls and stairs around it is not a room.
#[test]
fn each_portal_ahead_can_be_joined_and_the_walk_s_count_is_the_bake_s() {
    let g = stair_hall();
    let context = BakeContext::new(&Silent, None);
    let mut config = BakeConfig::of(Method::Delaunay);
    let mut session = Session::begin(&g.scene, &config, &context).unwrap();
    let stop = session.decimation.stop;
    let n = rooms_left(&g, &session, stop, &config);
    assert_eq!(n, g.truth.rooms.len());
    let ahead = session.decimation.steps[stop..].to_vec();
    assert_eq!(ahead.len(), n);
    for (i, step) in ahead.iter().enumerate() {
        config.delaunay.choices.join = vec![step.position];
        session.decimate(&config);
        let joined = session.decimation.stop;
        let last = &session.decimation.steps[joined - 1];
        assert_eq!(last.position, step.position);
        let left = if i < 2 {
            rooms_left(&g, &session, joined, &config)
        } else {
            session.count_rooms(joined, &config)[0]
        };
        assert_eq!(left, n - 1, "{step:?}");
    }
}

/// In rooms of a few centimeters, all doors are within a handbreadth.
#[test]
fn a_choice_is_about_one_portal_whatever_the_scale() {
    let g = gjorup_rooms(Variant::Optimised, [0.0; 3]);
    for scale in [0.01, 1.0, 30.0] {
        let g = scaled(g.clone(), scale);
        let mut config = BakeConfig::of(Method::Delaunay);
        config.min_opening *= scale;
        config.merge.min_radius *= scale;
        let context = BakeContext::new(&Silent, None);
        let mut session = Session::begin(&g.scene, &config, &context).unwrap();
        let stop = session.decimation.stop;
        let ahead = session.decimation.steps[stop..].to_vec();
        let joins = |session: &Session| {
            let steps = &session.decimation.steps[..session.decimation.stop];
            steps.iter().filter(|s| s.weight == JOINED).count()
        };
        // Openings are 0.45 in radius: half of that aside still selects the same one, more than that selects none.
        for (aside, n) in [(0.0, 1), (0.2, 1), (0.6, 0)] {
            config.delaunay.choices.join = vec![ahead[0].position + DVec3::Y * (aside * scale)];
            session.decimate(&config);
            assert_eq!(joins(&session), n, "{scale} {aside}");
            assert_eq!(session.decimation.stop, stop + n, "{scale} {aside}");
        }
    }
}

// Covers T4.
#[test]
fn the_weight_has_no_scale() {
    // The same rooms eight times as large, with `min_opening` eight times as wide.
    let g = gjorup_rooms(Variant::Tessellated, [0.0; 3]);
    let mut large = g.clone();
    for m in &mut large.scene.meshes {
        for x in m
            .primitives
            .iter_mut()
            .flat_map(|p| &mut p.positions)
            .flatten()
        {
            *x *= 8.0;
        }
    }
    let last = |scene: &enfilade_geom::scene::Scene, scale: f64| -> Vec<f64> {
        let mut config = BakeConfig::of(Method::Delaunay);
        config.min_opening *= scale;
        config.merge.min_radius *= scale;
        let context = BakeContext::new(&Silent, None);
        let d = Session::begin(scene, &config, &context).unwrap().decimation;
        d.steps[d.stop..].iter().map(|s| s.weight).collect()
    };
    let (small, large) = (last(&g.scene, 1.0), last(&large.scene, 8.0));
    // Only the box around the scene, which has a margin in meters, may add steps of the void.
    let doors = |w: &[f64]| w.iter().filter(|&&w| w > 2.0 && w < 4.0).count();
    assert_eq!(doors(&small), doors(&large), "{small:?} {large:?}");
}

#[test]
fn equal_on_any_number_of_threads() {
    let g = gjorup_rooms(Variant::Distorted, [0.0; 3]);
    let bytes = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| enfilade_cpg::wire::encode_glb(&baked(&g)).unwrap())
    };
    assert_eq!(bytes(1), bytes(3));
}

//! Covers W14: a space that follows a session operation by operation is the one made anew, and answers as the world that is saved.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, OnceLock};

use enfilade_bake::{BakeConfig, BakeContext, bake};
use enfilade_cpg::CellId;
use enfilade_cpg::wire::encode_glb;
use enfilade_edit::random::random_operation;
use enfilade_edit::{EditGround, EditOperation, EditSession, EditedSpace, HandEditKind};
use enfilade_geom::{Aabb, DVec3};
use enfilade_kit::{Choice, InstanceId, Kit, Piece};
use enfilade_runtime::Sightlines;
use enfilade_testkit::{Rng, dungeon_kit};
use enfilade_world::{PartId, Place, Pose, Space};

fn kit() -> Arc<Kit> {
    static KIT: OnceLock<Arc<Kit>> = OnceLock::new();
    let made = KIT.get_or_init(|| {
        let pieces = dungeon_kit().into_iter().map(|piece| {
            let (config, context) = (BakeConfig::default(), BakeContext::default());
            let world = bake(&piece.scene, &config, &context).unwrap().world;
            Piece::new(piece.name, world, &Choice::Doorways).unwrap()
        });
        Arc::new(Kit::new(pieces.collect()).unwrap())
    });
    Arc::clone(made)
}

fn step(session: &mut EditSession, rng: &mut Rng) {
    match rng.below(100) {
        0..20 => {
            session.undo().unwrap();
        }
        20..35 => {
            session.redo().unwrap();
        }
        kind => {
            let mut random = || random_operation(session, &mut |n| rng.below(n));
            let is_wanted = |o: &EditOperation| kind < 80 || matches!(o, EditOperation::Make(_));
            let some = (0..200).map(|_| random()).find(is_wanted);
            let _ = some.map(|operation| session.apply(operation));
        }
    }
}

/// Everything of a space, by instance: poses, worlds, doors, what they lead to, and where each part stands.
fn state(
    space: &Space,
    parts: &EditedSpace,
    session: &EditSession,
) -> BTreeMap<InstanceId, String> {
    let of = |part: PartId| parts.instance_of(part);
    let all = session.level().instances();
    let told = all.map(|(id, _)| {
        let part = parts.part_of(id).expect("a part that stands");
        let world = encode_glb(space.world(part)).unwrap();
        let mut doors = String::new();
        for portal in space.world(part).graph.portal_ids() {
            let mut meets: Vec<_> = space
                .meets(part, portal)
                .iter()
                .map(|m| (of(m.0), m.1))
                .collect();
            meets.sort();
            let leads: BTreeSet<_> = (space.leads_to(part, portal).iter())
                .map(|p| (of(p.part), p.cell))
                .collect();
            let is_open = space.state(part).is_open(portal);
            doors += &format!("{portal} {is_open} {meets:?} {leads:?}\n");
        }
        let stands = space.is_present(part);
        let told = format!("{stands} {:?} {} {doors}", space.pose(part), fnv(&world));
        (id, told)
    });
    told.collect()
}

fn fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| {
        (h ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// The instances that stand in the open air.
fn guests(space: &Space, parts: &EditedSpace) -> BTreeSet<Option<InstanceId>> {
    let air = Place {
        part: PartId::ROOT,
        cell: CellId(0),
    };
    let guests = space.guests(air).iter();
    guests.map(|part| parts.instance_of(*part)).collect()
}

#[test]
fn a_space_that_follows_random_operations_is_the_one_made_anew() {
    for seed in 0..4 {
        let mut session = EditSession::new(kit(), EditGround::Open).unwrap();
        let (mut parts, mut space) = EditedSpace::new(&mut session).unwrap();
        let mut rng = Rng::new(seed);
        let (mut n_edits, mut n_most) = (0, 0);
        for n in 1..=600 {
            step(&mut session, &mut rng);
            // One operation, or several at once.
            if n % 3 != 0 || n % 20 == 0 {
                parts.follow(&mut space, &mut session).unwrap();
            }
            n_edits = n_edits.max(session.hand_edits().len());
            n_most = n_most.max(session.level().len());
            if n % 20 != 0 {
                continue;
            }
            // Worlds of instances are made anew, too.
            let mut rng = Rng::new(seed);
            let mut again = EditSession::new(kit(), EditGround::Open).unwrap();
            for _ in 0..n {
                step(&mut again, &mut rng);
            }
            let (fresh_parts, fresh) = EditedSpace::new(&mut again).unwrap();
            let now = state(&space, &parts, &session);
            let anew = state(&fresh, &fresh_parts, &again);
            assert!(now.keys().eq(anew.keys()));
            for (id, now) in now {
                assert_eq!(now, anew[&id], "seed {seed}, step {n}, {id:?}");
            }
            let now = guests(&space, &parts);
            assert_eq!(now, guests(&fresh, &fresh_parts), "seed {seed}, step {n}");
        }
        assert!(n_edits > 3 && n_most > 5, "{n_edits} {n_most}");
        assert!(space.n_parts() < 200, "{}", space.n_parts());
    }
}

#[test]
fn points_and_lines_meet_the_same_cells_and_walls_as_in_the_world_that_is_saved() {
    let mut n_checked = [0; 3];
    for seed in 10..16 {
        let mut session = EditSession::new(kit(), EditGround::Open).unwrap();
        let (mut parts, mut space) = EditedSpace::new(&mut session).unwrap();
        let mut rng = Rng::new(seed);
        for n in 1..=300 {
            step(&mut session, &mut rng);
            parts.follow(&mut space, &mut session).unwrap();
            if n % 50 != 0 || session.level().is_empty() {
                continue;
            }
            let edited = session.world().unwrap();
            let world = &edited.world;
            // Deleted doorways between instances part cells in the space only.
            let is_merged = (session.hand_edits().iter())
                .any(|edit| matches!(edit.kind, HandEditKind::NoPortal(_)));
            let bounds = world.graph.locator.bounds;
            let mut whole: BTreeMap<Place, CellId> = BTreeMap::new();
            let mut part: BTreeMap<CellId, Place> = BTreeMap::new();
            let lines = Sightlines::build(world);
            let rooms: Vec<Aabb> = (world.graph.rooms())
                .map(|(_, c)| Aabb::of_points(&c.aabb.map(|p| DVec3::from(p.map(f64::from)))))
                .collect();
            for _ in 0..2_000 * usize::from(!rooms.is_empty()) {
                let room = rooms[rng.below(rooms.len())];
                let p = rng.point_in(&room);
                let (own, cell) = (space.locate(PartId::ROOT, p), world.graph.locator.locate(p));
                let Some((own, cell)) = own.zip(cell) else {
                    assert!(own.is_none_or(|own| own.part == PartId::ROOT) || cell.is_some());
                    continue;
                };
                if world.graph[cell].outdoor {
                    assert_eq!(own.part, PartId::ROOT, "{p}");
                    continue;
                }
                assert_eq!(*whole.entry(own).or_insert(cell), cell, "{p}");
                if !is_merged {
                    assert_eq!(*part.entry(cell).or_insert(own), own, "{p}");
                }
                n_checked[0] += 1;
                let q = rng.point_in(&bounds);
                let ends = [p, q].map(|p| p.as_vec3().to_array());
                let hit = lines.first_hit(ends[0], ends[1]).map(|h| h.t);
                let met = space.first_wall(PartId::ROOT, [p, q]);
                let (hit, met) = (hit.unwrap_or(1.0), met.unwrap_or(1.0));
                n_checked[1] += 1;
                // A line through the seam of two walls may pass on one side of the rounding only.
                n_checked[2] += usize::from((hit - met).abs() * p.distance(q) > 1e-3);
            }
        }
    }
    let [n_points, n_lines, n_other] = n_checked;
    assert!(
        n_points > 20_000 && n_other * 1_000 <= n_lines,
        "{n_checked:?}"
    );
}

#[test]
fn a_number_that_an_undo_frees_does_not_bring_back_the_old_world() {
    let mut session = EditSession::new(kit(), EditGround::Open).unwrap();
    let (mut parts, mut space) = EditedSpace::new(&mut session).unwrap();
    let lamp = HandEditKind::Lamp(DVec3::new(0.0, 2.0, 0.0));
    for piece in ["chamber", "hall"] {
        let put = EditOperation::put(piece, None, Pose::IDENTITY);
        session.apply(put).unwrap();
        let edit = session.hosted(&lamp);
        session.apply(EditOperation::Make(edit)).unwrap();
        parts.follow(&mut space, &mut session).unwrap();
        let part = parts.part_of(InstanceId(0)).unwrap();
        assert_eq!(space.world(part).fixtures.len(), 1);
        let number = kit().named(piece).unwrap();
        let own = kit().pieces()[number].world().graph.cells[1].aabb;
        assert_eq!(space.world(part).graph.cells[1].aabb, own, "{piece}");
        // The next session of this number begins without the space being asked.
        assert!(session.undo().unwrap() && session.undo().unwrap());
    }
}

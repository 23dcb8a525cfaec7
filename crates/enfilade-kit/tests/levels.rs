//! Covers W14: levels put together from pieces keep all promises, and what does not fit is refused with reason and place.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use enfilade_bake::{BakeConfig, BakeContext, bake};
use enfilade_cpg::wire::encode_glb;
use enfilade_cpg::{CellId, World};
use enfilade_geom::{DQuat, DVec3};
use enfilade_kit::{
    Assembly, Choice, Chosen, End, InstanceId, Kit, KitFault, Link, Piece, PieceError, PlaceError,
    PlaceOptions, Spot,
};
use enfilade_runtime::{Sight, SightState, View, Viewer};
use enfilade_testkit::{PieceScene, Rng, dungeon_kit, office_kit};
use enfilade_verify::{VerifyOptions, verify_world};
use enfilade_world::{PartId, Pose, SpaceViewer};

fn baked(piece: &PieceScene) -> World {
    let baked = bake(
        &piece.scene,
        &BakeConfig::default(),
        &BakeContext::default(),
    );
    baked.unwrap().world
}

fn kit_of(pieces: &[PieceScene]) -> Kit {
    let pieces = pieces.iter();
    let pieces = pieces.map(|p| Piece::new(p.name, baked(p), &Choice::Doorways).unwrap());
    Kit::new(pieces.collect()).unwrap()
}

fn dungeon() -> Arc<Kit> {
    static KIT: OnceLock<Arc<Kit>> = OnceLock::new();
    let made = KIT.get_or_init(|| Arc::new(kit_of(&dungeon_kit())));
    Arc::clone(made)
}

fn piece(level: &Assembly, name: &str) -> usize {
    level.kit().named(name).unwrap()
}

fn end(level: &Assembly, instance: InstanceId, name: &str) -> End {
    let attachment = level.piece(instance).attachment_named(name).unwrap();
    End {
        instance,
        attachment,
    }
}

/// Places a piece by its names.
fn place(
    level: &mut Assembly,
    [name, attachment]: [&str; 2],
    onto: (InstanceId, &str),
) -> Result<InstanceId, PlaceError> {
    let number = piece(level, name);
    let own = level.kit().pieces()[number]
        .attachment_named(attachment)
        .unwrap();
    let onto = end(level, onto.0, onto.1);
    level.place(number, own, onto, &PlaceOptions::default())
}

fn start(level: &mut Assembly, name: &str, pose: Pose) -> InstanceId {
    let number = piece(level, name);
    level.put(number, pose, &PlaceOptions::default()).unwrap()
}

/// Adds instances at random until `n` stand.
fn grow(level: &mut Assembly, rng: &mut Rng, n: usize) {
    for _ in 0..20 * n {
        if level.len() >= n {
            break;
        }
        let ends: Vec<End> = level.open_ends().collect();
        let onto = ends[rng.below(ends.len())];
        // Without the last two, which end it.
        let number = rng.below(level.kit().pieces().len() - 2);
        let attachment = rng.below(level.kit().pieces()[number].attachments().len());
        let _ = level.place(number, attachment, onto, &PlaceOptions::default());
    }
}

/// A level of 30 instances, the first of them turned by an odd angle.
fn grown(seed: u64) -> Assembly {
    let mut level = Assembly::new(dungeon());
    let turn = DQuat::from_rotation_y(0.3);
    let at = DVec3::new(40.0, 1.0, -25.0);
    start(&mut level, "hall", Pose { turn, at });
    grow(&mut level, &mut Rng::new(seed), 30);
    assert_eq!(level.len(), 30);
    level
}

#[test]
fn a_level_of_turned_pieces_keeps_all_promises() {
    let level = grown(5);
    let world = level.flattened().unwrap();
    let options = VerifyOptions {
        rays: 200_000,
        ..VerifyOptions::default()
    };
    let report = verify_world(&world, None, &options);
    assert!(
        report.holds(),
        "{:?} {:?}",
        report.problems,
        report.failures
    );
    assert!(report.sealed.crossings > 10_000);
    let n_joined = level.instances().flat_map(|(_, i)| &i.links);
    let n_joined = n_joined.filter(|l| matches!(l, Link::Joined(_))).count() / 2;
    let indoors = world
        .graph
        .portals
        .iter()
        .filter(|p| !p.cells.contains(&CellId(0)));
    assert_eq!(indoors.count(), n_joined);
    assert!(n_joined >= 29);
}

#[test]
fn points_are_in_the_same_cells_as_in_their_pieces_and_as_in_the_space() {
    let level = grown(6);
    let world = level.flattened().unwrap();
    let space = level.space().unwrap();
    let mut rng = Rng::new(1);
    let bounds = world.graph.locator.bounds;
    let mut n_indoors = 0;
    for _ in 0..20_000 {
        let p = rng.point_in(&bounds);
        let found = world.graph.locator.locate(p).map(|c| &world.graph[c].name);
        let own = level.instances().find_map(|(id, instance)| {
            let graph = &level.piece(id).world().graph;
            let cell = graph.locator.locate(instance.pose.point_back(p))?;
            (!graph[cell].outdoor).then_some((id, instance, cell))
        });
        if let Some((id, instance, cell)) = own {
            n_indoors += 1;
            let name = found.expect("a room, not solid");
            assert!(
                name.starts_with(&instance.name),
                "{p}: {name}, not {}",
                instance.name
            );
            let place = space.space.locate(PartId::ROOT, p).unwrap();
            assert_eq!(
                (place.part, place.cell),
                (space.parts.part_of(id).unwrap(), cell)
            );
        } else {
            assert!(
                found.is_none_or(|name| name == "outdoors"),
                "{p}: {found:?}"
            );
        }
    }
    assert!(n_indoors > 500, "{n_indoors}");
}

#[test]
fn joined_openings_lead_from_part_to_part_in_the_space() {
    let level = grown(7);
    let space = level.space().unwrap();
    for (id, instance) in level.instances() {
        for (attachment, link) in level.piece(id).attachments().iter().zip(&instance.links) {
            let met = space
                .space
                .meets(space.parts.part_of(id).unwrap(), attachment.portal);
            let expected: Vec<_> = match link {
                Link::Joined(other) => {
                    let its = &level.piece(other.instance).attachments()[other.attachment];
                    vec![(space.parts.part_of(other.instance).unwrap(), its.portal)]
                }
                _ => Vec::new(),
            };
            assert_eq!(met, expected, "{}.{}", instance.name, attachment.name);
        }
    }
}

#[test]
fn undoing_everything_gives_the_same_bytes_and_redoing_too() {
    let mut level = Assembly::new(dungeon());
    start(&mut level, "chamber", Pose::IDENTITY);
    let mut rng = Rng::new(11);
    let bytes = |level: &Assembly| {
        let links: Vec<Vec<Link>> = level.instances().map(|i| i.1.links.clone()).collect();
        (links, encode_glb(&level.flattened().unwrap()).unwrap())
    };
    let mut past = vec![bytes(&level)];
    let mut n_moved = 0;
    for _ in 0..80 {
        let standing: Vec<InstanceId> = level.instances().map(|i| i.0).collect();
        if rng.chance(0.3) && standing.len() > 3 {
            let id = standing[1 + rng.below(standing.len() - 1)];
            let ends: Vec<End> = level.open_ends().filter(|e| e.instance != id).collect();
            let piece = level.standing(id).unwrap().piece;
            let own = rng.below(level.piece(id).attachments().len());
            let onto = ends[rng.below(ends.len())];
            // Or turned in place, where others' doorways meet it again.
            let now = level.standing(id).unwrap().pose;
            let turn = Pose::about(now.at, DVec3::Y, std::f64::consts::FRAC_PI_2);
            let pose = match level.pose_onto(piece, own, onto, 0.0) {
                Ok(pose) if rng.chance(0.5) => pose,
                _ => turn.after(&now),
            };
            let before = bytes(&level);
            let fits = level.fits_moved(id, &pose, false);
            assert!(bytes(&level) == before);
            assert_eq!(level.move_to(id, pose, false), fits);
            if fits.is_err() {
                assert!(bytes(&level) == before);
                continue;
            }
            n_moved += 1;
        } else if rng.chance(0.3) && standing.len() > 3 {
            level
                .remove(standing[1 + rng.below(standing.len() - 1)])
                .unwrap();
        } else {
            let n = level.len() + 1;
            grow(&mut level, &mut rng, n);
        }
        past.push(bytes(&level));
    }
    assert!(n_moved > 5, "{n_moved}");
    let present = past.pop().unwrap();
    for earlier in past.iter().rev() {
        assert!(level.undo());
        assert!(bytes(&level) == *earlier);
    }
    level.undo();
    assert!(level.is_empty() && !level.undo());
    while level.redo() {}
    assert!(bytes(&level) == present);
}

#[test]
fn a_piece_that_the_kit_does_not_have_is_refused() {
    let mut level = Assembly::new(dungeon());
    let n = level.kit().pieces().len();
    let options = PlaceOptions::default();
    let refused = level.put(n, Pose::IDENTITY, &options);
    assert_eq!(refused, Err(PlaceError::NoPiece(n.to_string())));
    assert_eq!(level.fits(n, &Pose::IDENTITY, &options), refused.map(drop));
}

#[test]
fn a_doorway_behind_two_walls_is_walled_up_until_both_are_gone() {
    let mut level = Assembly::new(dungeon());
    let hall = start(&mut level, "hall", Pose::IDENTITY);
    let plug = piece(&level, "plug");
    let east = end(&level, hall, "east");
    let mouth = &level.piece(hall).attachments()[east.attachment].mouth;
    let pose = mouth.frame;
    let walls = [0, 1].map(|_| level.put(plug, pose, &PlaceOptions::default()).unwrap());
    let link = |level: &Assembly| level.standing(hall).unwrap().links[east.attachment];
    assert_eq!(link(&level), Link::Blocked(walls[0]));
    level.remove(walls[0]).unwrap();
    assert_eq!(link(&level), Link::Blocked(walls[1]));
    level.remove(walls[1]).unwrap();
    assert_eq!(link(&level), Link::Open);
    assert!(level.undo() && level.undo());
    assert_eq!(link(&level), Link::Blocked(walls[0]));
}

/// Four corridors around a square, and the chambers at its vertices.
#[test]
fn a_loop_that_meets_is_joined_and_one_that_does_not_is_refused_with_its_gap() {
    let mut level = Assembly::new(dungeon());
    let mut at = start(&mut level, "chamber", Pose::IDENTITY);
    let first = at;
    for side in ["east", "south", "west"] {
        let back = match side {
            "east" => "west",
            "south" => "north",
            _ => "east",
        };
        let way = place(&mut level, ["corridor", "north"], (at, side)).unwrap();
        at = place(&mut level, ["chamber", back], (way, "south")).unwrap();
    }
    let [last, gap] = [end(&level, at, "north"), end(&level, first, "south")];
    let refused = level.close(last, gap).unwrap_err();
    assert!(
        matches!(refused, PlaceError::StaysOpen { gap, .. } if (gap - 6.0).abs() < 1e-3),
        "{refused}"
    );
    let way = place(&mut level, ["corridor", "north"], (at, "north")).unwrap();
    let met = end(&level, way, "south");
    assert_eq!(
        level.standing(first).unwrap().links[gap.attachment],
        Link::Joined(met)
    );
    assert_eq!(level.close(met, gap), Ok(()));
    assert_eq!(
        level.flattened().unwrap().graph.portals.len(),
        4 * 4 - 8 + 8
    );
}

#[test]
fn what_is_in_the_way_is_named_with_place_and_depth() {
    let mut level = Assembly::new(dungeon());
    let hall = start(&mut level, "hall", Pose::IDENTITY);
    let before = encode_glb(&level.flattened().unwrap()).unwrap();
    let number = piece(&level, "chamber");
    // The chamber's air reaches 2.8 m from its middle, the hall's matter 6 m.
    let beside = Pose::from_translation(DVec3::new(8.5, 0.0, 0.0));
    let refused = level
        .put(number, beside, &PlaceOptions::default())
        .unwrap_err();
    let PlaceError::Overlaps { with, by, at } = &refused else {
        panic!("{refused}");
    };
    assert_eq!(with, "hall-1");
    assert!(
        (by - 0.3).abs() < 1e-3 && (at[0] - 5.7).abs() < 0.3,
        "{refused}"
    );
    // Through a doorway, it would be the other's.
    assert!(place(&mut level, ["corridor", "north"], (hall, "east")).is_ok());
    let refused = place(&mut level, ["corridor", "north"], (hall, "east")).unwrap_err();
    assert!(matches!(refused, PlaceError::Used { .. }), "{refused}");
    level.undo();
    assert!(encode_glb(&level.flattened().unwrap()).unwrap() == before);
    let options = PlaceOptions {
        overlap: true,
        ..PlaceOptions::default()
    };
    level.put(number, beside, &options).unwrap();
    assert!(level.space().is_ok());
    assert!(
        level
            .flattened()
            .unwrap_err()
            .to_string()
            .contains("chamber-2")
    );
}

#[test]
fn openings_are_walled_up_as_a_whole_or_not_at_all() {
    let mut level = Assembly::new(dungeon());
    let chamber = start(&mut level, "chamber", Pose::IDENTITY);
    // Each has a wall in front of the other's doorway.
    let number = piece(&level, "hall");
    let hall = Pose::from_translation(DVec3::new(9.0, 0.0, 1.8));
    let hall = level.put(number, hall, &PlaceOptions::default()).unwrap();
    let east = end(&level, chamber, "east");
    assert_eq!(
        level.standing(chamber).unwrap().links[east.attachment],
        Link::Blocked(hall)
    );
    let world = level.flattened().unwrap();
    assert_eq!(world.graph.portals.len(), 8 - 2);
    let options = VerifyOptions {
        rays: 50_000,
        ..VerifyOptions::default()
    };
    assert!(verify_world(&world, None, &options).holds());
    level.undo();
    assert_eq!(
        level.standing(chamber).unwrap().links[east.attachment],
        Link::Open
    );
    // A part of the hall's doorway would be beside the chamber.
    let hall = Pose::from_translation(DVec3::new(9.0, 0.0, 2.5));
    let refused = level
        .put(number, hall, &PlaceOptions::default())
        .unwrap_err();
    assert!(
        matches!(refused, PlaceError::PartlyBlocked { .. }),
        "{refused}"
    );
}

#[test]
fn openings_that_differ_are_refused_with_both_measures() {
    let chamber = || baked(&dungeon_kit()[0]);
    let mut wide = chamber();
    for portal in &mut wide.graph.portals {
        let across = usize::from(portal.normal[0].abs() > 0.5) * 2;
        let pieces = portal.pieces.iter_mut().flatten();
        for p in pieces.chain(&mut portal.outline) {
            p[across] += 0.05 * p[across].signum();
        }
        portal.area = 1.3 * 2.1;
    }
    let piece = |name: &str, world| Piece::new(name, world, &Choice::Doorways).unwrap();
    let kit = Kit::new(vec![piece("chamber", chamber()), piece("wide", wide)]).unwrap();
    assert_eq!(kit.groups(1e-3).len(), 2);
    let mut level = Assembly::new(kit);
    let first = start(&mut level, "chamber", Pose::IDENTITY);
    let refused = place(&mut level, ["wide", "north"], (first, "south")).unwrap_err();
    let PlaceError::DoesNotFit {
        size,
        onto_size,
        by,
        ..
    } = refused
    else {
        panic!("{refused}");
    };
    assert!((by - 0.05).abs() < 1e-4, "{by}");
    assert!((size[0] - onto_size[0] - 0.1).abs() < 1e-4);
    level.set_tolerance(0.06);
    assert!(
        level
            .pose_onto(1, 0, end(&level, first, "south"), 0.0)
            .is_ok()
    );
}

/// Covers W14: a piece without rooms closes a doorway (Gjørup 1999, figure 3.9).
#[test]
fn a_wall_closes_the_doorway_in_front_of_which_it_is_put() {
    let mut level = Assembly::new(dungeon());
    let chamber = start(&mut level, "chamber", Pose::IDENTITY);
    let east = end(&level, chamber, "east");
    let frame = level.piece(chamber).attachments()[east.attachment]
        .mouth
        .frame;
    let plug = start(&mut level, "plug", frame);
    let link = level.standing(chamber).unwrap().links[east.attachment];
    assert_eq!(link, Link::Blocked(plug));
    assert_eq!(level.flattened().unwrap().graph.portals.len(), 3);
    level.remove(plug).unwrap();
    assert_eq!(level.open_ends().count(), 4);
}

#[test]
fn walls_that_lie_in_the_walls_of_others_are_seen_from_both_rooms() {
    let mut level = Assembly::new(dungeon());
    start(&mut level, "corridor", Pose::IDENTITY);
    // The outer walls between them, 0.2 m thick, are in one place.
    let beside = DVec3::new(1.8, 0.0, 1.0);
    start(&mut level, "corridor", Pose::from_translation(beside));
    let world = level.flattened().unwrap();
    let room = world.graph.cell_named("corridor-2").unwrap();
    let mut n_seen = 0;
    for batch in &world.batches {
        for t in batch.primitive.triangles() {
            // The first corridor's outer face, whose wall reaches below the floor.
            let is_in_plane = t.iter().all(|p| (p.x - 1.0).abs() < 1e-5);
            if is_in_plane && t.iter().any(|p| p.y < -0.1) {
                n_seen += 1;
                assert!(batch.cells.contains(&room), "{t:?}");
            }
        }
    }
    assert_eq!(n_seen, 2);
}

#[test]
fn pieces_stay_upright_unless_they_may_tilt() {
    let mut level = Assembly::new(dungeon());
    let number = piece(&level, "chamber");
    let turn = DQuat::from_rotation_x(0.2);
    let pose = Pose {
        turn,
        at: DVec3::ZERO,
    };
    let refused = level
        .put(number, pose, &PlaceOptions::default())
        .unwrap_err();
    assert!(matches!(refused, PlaceError::Tilted { .. }), "{refused}");
    let options = PlaceOptions {
        tilt: true,
        ..PlaceOptions::default()
    };
    level.put(number, pose, &options).unwrap();
    let options = VerifyOptions {
        rays: 20_000,
        ..VerifyOptions::default()
    };
    assert!(verify_world(&level.flattened().unwrap(), None, &options).holds());
}

#[test]
fn bad_kits_and_names_are_refused_with_reason() {
    let chamber = || baked(&dungeon_kit()[0]);
    let chosen = |name: &str, portal| Chosen {
        name: name.into(),
        spot: Spot::Portal(enfilade_cpg::PortalId(portal)),
    };
    let twice = Choice::Only(vec![chosen("a", 0), chosen("a", 1)]);
    let refused = Piece::new("p", chamber(), &twice).unwrap_err();
    assert_eq!(refused, PieceError::NamedTwice("a".into()));
    let none = Choice::Only(vec![chosen("a", 9)]);
    let refused = Piece::new("p", chamber(), &none).unwrap_err();
    assert!(refused.to_string().contains("portal-9") && refused.to_string().contains("portal-3"));
    let only = Choice::Only(vec![Chosen {
        name: "gate".into(),
        spot: Spot::Near(DVec3::new(9.0, 1.0, 0.0)),
    }]);
    let gate = Piece::new("gate", chamber(), &only).unwrap();
    assert!((gate.attachments()[0].mouth.frame.at.x - 3.0).abs() < 1e-5);
    let mut closed = chamber();
    for cell in &mut closed.graph.cells {
        cell.outdoor = false;
    }
    Arc::make_mut(&mut closed.graph.locator).outside = None;
    assert_eq!(
        Piece::new("p", closed, &Choice::Doorways).unwrap_err(),
        PieceError::NoOutdoors
    );
    let same = || Piece::new("same", chamber(), &Choice::Doorways).unwrap();
    assert!(Kit::new(vec![same(), same()]).is_err());
    let sealed = Piece::new("sealed", chamber(), &Choice::Only(Vec::new())).unwrap();
    let kit = Kit::new(vec![gate, sealed]).unwrap();
    let faults = kit.faults(1e-3);
    assert!(matches!(&faults[0], KitFault::FitsNone { piece, .. } if piece == "gate"));
    assert!(matches!(&faults[1], KitFault::Detached { piece } if piece == "sealed"));
    let mut level = Assembly::new(kit);
    let named = PlaceOptions {
        name: Some("a".into()),
        ..PlaceOptions::default()
    };
    level.put(0, Pose::IDENTITY, &named).unwrap();
    let far = Pose::from_translation(DVec3::X * 50.0);
    assert_eq!(
        level.put(0, far, &named),
        Err(PlaceError::NamedTwice("a".into()))
    );
    let lost = Pose::from_translation(DVec3::X * f64::NAN);
    assert_eq!(
        level.put(0, lost, &PlaceOptions::default()),
        Err(PlaceError::NotRigid)
    );
}

#[test]
fn all_doorways_of_the_kits_fit_each_other() {
    for kit in [dungeon_kit(), office_kit()] {
        let kit = kit_of(&kit);
        assert_eq!(kit.faults(1e-3), Vec::new());
        assert_eq!(kit.groups(1e-3).len(), 1);
    }
}

/// Covers W14: instances that are joined see each other, and no more of the level than in one world.
#[test]
fn views_of_the_space_see_the_instances_that_views_of_the_world_see() {
    let level = grown(8);
    let world = level.flattened().unwrap();
    let space = level.space().unwrap();
    let sight = Sight::build(&world).unwrap();
    let state = SightState::new(&sight);
    let mut viewer = Viewer::new(&sight);
    let mut space_viewer = SpaceViewer::new(&space.space);
    let part_of: BTreeMap<&str, PartId> = (level.instances())
        .map(|(id, instance)| (&*instance.name, space.parts.part_of(id).unwrap()))
        .collect();
    let mut rng = Rng::new(2);
    let (mut n, mut n_parts, mut n_outside) = (0, 0, 0);
    while n < 400 {
        let eye = rng.point_in(&world.graph.locator.bounds);
        if world
            .graph
            .locator
            .locate(eye)
            .is_none_or(|c| world.graph[c].outdoor)
        {
            continue;
        }
        n += 1;
        let look = (rng.turn() * DVec3::X).as_vec3().to_array();
        let eye = eye.as_vec3().to_array();
        let view = View::perspective(eye, look, [0.0, 1.0, 0.0], 1.2, 1.5).unwrap();
        let seen = viewer.see(&sight, &state, &view);
        let is_outside = seen.cells().iter().any(|c| world.graph[*c].outdoor);
        let names = seen.cells().iter().map(|c| &*world.graph[*c].name);
        let mut expected: Vec<PartId> = names
            .filter_map(|name| part_of.get(name).copied())
            .collect();
        expected.sort_unstable();
        let parts = space_viewer.see(&space.space, PartId::ROOT, &view);
        let parts: Vec<PartId> = parts.parts().map(|p| p.0).collect();
        assert!(
            expected.iter().all(|p| parts.contains(p)),
            "{expected:?} {parts:?}"
        );
        if is_outside {
            n_outside += 1;
        } else {
            assert_eq!(parts, expected);
        }
        n_parts += parts.len();
    }
    assert!(n_outside < n / 2 && n_parts > n, "{n_outside} {n_parts}");
}

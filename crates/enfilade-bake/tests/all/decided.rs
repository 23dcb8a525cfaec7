//! Decisions of people about rooms win over those of the bake, and nothing else changes.

use enfilade_bake::rebake::{RebakeError, WholeBecause, rebake};
use enfilade_bake::{BakeConfig, BakeContext, BakeOutput, Method, RoomAnswer, RoomDecision, bake};
use enfilade_cpg::{PortalKind, Reason};
use enfilade_geom::DVec3;
use enfilade_geom::scene::Scene;
use enfilade_verify::{VerifyOptions, verify_world};

use crate::given::house;

const METHODS: [Method; 3] = [Method::Watershed, Method::Bsp, Method::Delaunay];

/// A doorway of 1 m.
const DOORWAY: [f64; 2] = [2.0, 3.0];

fn config(method: Method, decisions: &[(f64, RoomAnswer)]) -> BakeConfig {
    let decided = |&(x, is): &(f64, RoomAnswer)| RoomDecision {
        at: DVec3::new(x, 1.0, 2.4),
        is,
    };
    BakeConfig {
        decisions: decisions.iter().map(decided).collect(),
        ..BakeConfig::of(method)
    }
}

fn baked(scene: &Scene, method: Method, decisions: &[(f64, RoomAnswer)]) -> BakeOutput {
    let out = bake(scene, &config(method, decisions), &BakeContext::default()).unwrap();
    out.world.validate().unwrap();
    let options = VerifyOptions {
        rays: 20_000,
        ..VerifyOptions::default()
    };
    let report = verify_world(&out.world, None, &options);
    assert!(report.holds(), "{method:?}: {report:?}");
    out
}

fn n_rooms(out: &BakeOutput) -> usize {
    out.world.graph.rooms().count()
}

#[test]
fn two_rooms_are_one_if_a_person_says_so() {
    for method in METHODS {
        let scene = house(DOORWAY);
        assert_eq!(n_rooms(&baked(&scene, method, &[])), 2, "{method:?}");
        let out = baked(&scene, method, &[(4.0, RoomAnswer::OneRoom)]);
        assert_eq!(n_rooms(&out), 1, "{method:?}");
        assert!(
            !out.notes.iter().any(|n| n.contains("decision")),
            "{:?}",
            out.notes
        );
        let settings = &out.world.graph.provenance.settings;
        assert_eq!(settings["decisions"], "one room at 4.00,1.00,2.40");
    }
}

#[test]
fn one_room_is_two_where_its_air_is_narrowest() {
    for method in METHODS {
        // At the opening, and before and behind it.
        for x in [3.6, 4.0, 4.5] {
            let out = baked(&house([0.01, 4.99]), method, &[(x, RoomAnswer::TwoRooms)]);
            assert_eq!(n_rooms(&out), 2, "{method:?}, {x}: {:?}", out.notes);
            let [portal] = &out.world.graph.portals[..] else {
                panic!("{method:?}, {x}: {} portals", out.world.graph.portals.len());
            };
            assert_eq!(portal.why[0].reason, Reason::Asked);
            let place = portal.center()[0];
            assert!(
                (3.74..=4.26).contains(&place),
                "{method:?}, {x}: at {place}"
            );
            assert!((portal.area - 4.98 * 2.1).abs() < 0.05, "{}", portal.area);
        }
    }
}

#[test]
fn the_last_word_on_a_place_counts() {
    let scene = house(DOORWAY);
    for method in METHODS {
        let before = baked(&scene, method, &[]);
        let revised = [(4.0, RoomAnswer::OneRoom), (4.1, RoomAnswer::TwoRooms)];
        let out = baked(&scene, method, &revised);
        let [a, b] = [&before, &out].map(|out| &out.world.graph.portals);
        assert_eq!(a.len(), b.len(), "{method:?}");
        assert_eq!(a[0].pieces, b[0].pieces, "{method:?}");
        assert_eq!(b[0].why[0].reason, Reason::Asked);
        let revised = [(4.0, RoomAnswer::TwoRooms), (4.0, RoomAnswer::OneRoom)];
        assert_eq!(n_rooms(&baked(&scene, method, &revised)), 1, "{method:?}");
    }
}

#[test]
fn an_empty_room_is_parted_where_a_person_points() {
    let out = baked(
        &house([0.0, 5.0]),
        Method::Watershed,
        &[(2.0, RoomAnswer::TwoRooms)],
    );
    assert_eq!(n_rooms(&out), 2, "{:?}", out.notes);
    let place = out.world.graph.portals[0].center()[0];
    assert!((1.7..=2.3).contains(&place), "at {place}");
}

#[test]
fn what_a_person_decides_is_in_doubt_no_more() {
    let mut n_doubted = [0, 0];
    for a in [0.3, 0.4, 0.5, 0.6, 0.7, 0.8] {
        let scene = house([a, 5.0 - a]);
        let before = baked(&scene, Method::Watershed, &[]);
        let is_doubted = !before.world.graph.room_doubt().close.is_empty();
        n_doubted[n_rooms(&before) - 1] += usize::from(is_doubted);
        for (n, is) in [(1, RoomAnswer::OneRoom), (2, RoomAnswer::TwoRooms)] {
            let out = baked(&scene, Method::Watershed, &[(4.0, is)]);
            assert_eq!(n_rooms(&out), n, "{a}: {:?}", out.notes);
            let doubt = out.world.graph.room_doubt();
            assert!(doubt.close.is_empty(), "{a}: {doubt:?}");
        }
    }
    assert!(n_doubted.iter().all(|n| *n > 0), "{n_doubted:?}");
}

#[test]
fn an_opening_is_a_door_if_a_person_says_so() {
    for opening in [DOORWAY, [0.01, 4.99]] {
        let out = baked(
            &house(opening),
            Method::Watershed,
            &[(4.0, RoomAnswer::Door)],
        );
        let [portal] = &out.world.graph.portals[..] else {
            panic!("{:?}", out.notes);
        };
        assert_eq!(portal.kind, PortalKind::Door);
    }
}

#[test]
fn a_decision_that_changes_nothing_says_why() {
    for (x, is, why) in [
        (8.1, RoomAnswer::TwoRooms, "it lies in a wall"),
        (12.0, RoomAnswer::TwoRooms, "it lies outdoors"),
        (1.5, RoomAnswer::OneRoom, "no portal between two cells"),
    ] {
        let out = baked(&house(DOORWAY), Method::Watershed, &[(x, is)]);
        assert_eq!(n_rooms(&out), 2);
        let notes = out.notes.join("\n");
        let place = format!(
            "the decision '{} at {x:.2},1.00,2.40' changes nothing",
            is.name()
        );
        assert!(notes.contains(&place) && notes.contains(why), "{notes}");
    }
}

#[test]
fn a_rebake_keeps_decisions_and_refuses_others() {
    let scene = house(DOORWAY);
    let decisions = [(4.0, RoomAnswer::OneRoom)];
    let old = baked(&scene, Method::Watershed, &decisions).world;
    let context = BakeContext::default();
    let again = |decisions| {
        rebake(
            &old,
            &scene,
            &config(Method::Watershed, decisions),
            &context,
        )
    };
    let same = again(&decisions).unwrap();
    assert_eq!(same.whole, Some(WholeBecause::Decisions));
    assert_eq!(same.world.graph.rooms().count(), 1);
    let other = again(&[]).err();
    assert!(
        matches!(&other, Some(RebakeError::Setting { name, .. }) if name == "decisions"),
        "{other:?}"
    );
}

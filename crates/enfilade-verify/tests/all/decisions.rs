//! Why cells and portals are there: what is false is found by what the file and the geometry say, and nothing else is.

use crate::houses;

use enfilade_bake::{BakeConfig, BakeContext, Outdoors, bake};
use enfilade_cpg::{Fact, Reason, Why, World};
use enfilade_testkit::{hamlets, tamper::tamperings};
use houses::{HOUSE, SLITS, verify};

/// Returns what verification says about decisions.
fn said(world: &World) -> Vec<String> {
    let words = ["decision", "decided", "tells why"];
    let problems = verify(world, 0).problems.into_iter();
    problems
        .filter(|p| words.iter().any(|w| p.contains(w)))
        .collect()
}

#[test]
fn false_decisions_are_found_as_such() {
    let of_decisions = [
        "decision", "doorway", "floor", "area of", "backs", "matter", "a void",
    ];
    let mut n = 0;
    for tampering in tamperings().filter(|t| of_decisions.iter().any(|w| t.name.contains(w))) {
        let worlds = [&*HOUSE, &*SLITS].into_iter();
        let Some(changed) = worlds.filter_map(|w| tampering.apply(w, 1)).next() else {
            continue;
        };
        assert!(!said(&changed).is_empty(), "{}", tampering.name);
        n += 1;
    }
    assert!(n >= 14, "{n}");
    assert_eq!(
        [&*HOUSE, &*SLITS].map(said),
        [Vec::new(), Vec::new()] as [Vec<String>; 2]
    );
}

#[test]
fn a_doorway_may_be_one_of_several_openings_that_are_one_portal() {
    let mut world = HOUSE.clone();
    let graph = &mut world.graph;
    let doorway = |why: &Why| {
        why.facts
            .get(&Fact::Doorway)
            .is_some_and(|&height| height > 0.0)
    };
    let cell = graph
        .cells
        .iter()
        .find(|c| c.is_room() && c.why.iter().any(doorway));
    let portals = cell.unwrap().portals.clone();
    for p in &portals {
        // One vertex of each goes up, as if there were a gap above.
        let outline = &mut graph.portals[p.idx()].outline;
        let top = outline.iter_mut().max_by(|a, b| a[1].total_cmp(&b[1]));
        top.unwrap()[1] += 3.0;
    }
    let n_found = |world: &World| said(world).iter().filter(|p| p.contains("doorway")).count();
    assert_eq!(n_found(&world), 0);
    for p in portals {
        world.graph.portals[p.idx()].area = 100.0;
    }
    assert!(n_found(&world) > 0);
}

#[test]
fn a_room_that_is_told_as_a_void_with_all_that_belongs_to_it_is_found() {
    let mut world = HOUSE.clone();
    let rooms = world.graph.cells.iter_mut().filter(|c| c.is_room());
    let hall = rooms.max_by(|a, b| a.volume.total_cmp(&b.volume)).unwrap();
    hall.is_void = true;
    let why = hall
        .why
        .iter_mut()
        .find(|why| why.reason == Reason::Standing)
        .unwrap();
    why.reason = Reason::Low;
    why.facts.insert(Fact::Standing, 0.0);
    assert!(why.holds());
    let problems = said(&world);
    assert!(
        problems.len() == 1 && problems[0].contains("of its floor to stand on"),
        "{problems:?}"
    );
}

#[test]
fn land_is_told_as_land_and_nothing_else() {
    let config = BakeConfig {
        outdoors: Outdoors::Split { minima: Vec::new() },
        ..BakeConfig::default()
    };
    let done = bake(&hamlets().scene, &config, &BakeContext::default());
    let mut world = done.unwrap().world;
    assert_eq!(said(&world), Vec::<String>::new());
    let land = world.graph.cells.iter_mut().find(|c| c.is_land).unwrap();
    land.why = vec![Why::given(Reason::Outside)];
    assert_eq!(said(&world).len(), 1);
}

#[test]
fn facts_of_a_world_that_was_changed_since_are_not_compared() {
    let mut world = HOUSE.clone();
    let cell = world.graph.cells.iter_mut().find(|c| c.is_room()).unwrap();
    let why = cell
        .why
        .iter_mut()
        .find(|why| why.reason == Reason::Standing)
        .unwrap();
    *why.facts.get_mut(&Fact::Floor).unwrap() *= 3.0;
    world.graph.portals[0].why.clear();
    assert_eq!(said(&world).len(), 2);
    world.graph.statistics.counts.insert("edits".into(), 1.0);
    assert_eq!(said(&world).len(), 0);
}

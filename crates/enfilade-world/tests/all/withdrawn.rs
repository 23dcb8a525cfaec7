//! Parts that are taken out of a space, and come back.

use enfilade_cpg::World;
use enfilade_geom::DVec3;
use enfilade_testkit::cabin;
use enfilade_world::{PartId, Pose, SightRay, Space, SpaceError, SpaceViewer};

fn middle(world: &World) -> DVec3 {
    let (_, cell) = world.graph.indoor_cells().next().unwrap();
    let [low, high] = cell.aabb.map(|p| DVec3::from(p.map(f64::from)));
    (low + high) * 0.5
}

/// Everything that is asked of the room: who is at its middle, what a ray from there meets, what is seen, who stands in the host.
fn told(space: &Space, at: DVec3) -> String {
    let place = space.locate(PartId::ROOT, at);
    let ray = SightRay::new(PartId::ROOT, at, DVec3::X * 50.0);
    let hit = space.pick(&ray, &mut Vec::new()).unwrap();
    let wall = space.first_wall(PartId::ROOT, [at, at + DVec3::X * 50.0]);
    let [eye, look] = [at, DVec3::X].map(|p| p.as_vec3().to_array());
    let view = enfilade_runtime::View::perspective(eye, look, [0.0, 1.0, 0.0], 1.0, 1.0).unwrap();
    let mut viewer = SpaceViewer::new(space);
    let seen = viewer.see(space, PartId::ROOT, &view);
    let parts: Vec<PartId> = seen.parts().map(|p| p.0).collect();
    let along: Vec<PartId> = space
        .parts_along(PartId::ROOT, [at, at + DVec3::X])
        .collect();
    let met: Vec<_> = (1..space.n_parts() as u32)
        .map(PartId)
        .map(|part| {
            let doors = space.world(part).graph.portal_ids();
            doors
                .map(|d| space.meets(part, d).to_vec())
                .collect::<Vec<_>>()
        })
        .collect();
    let guests = place.map(|place| space.guests(place).to_vec());
    format!("{place:?} {hit:?} {wall:?} {parts:?} {along:?} {met:?} {guests:?}")
}

#[test]
fn a_part_that_is_withdrawn_is_not_there_until_it_is_placed_again() {
    let (host, room) = (cabin(1, 3.0, 0), cabin(7, 0.6, 0));
    let pose = Pose::from_translation(middle(&host) - middle(&room));
    let at = middle(&host);
    let mut space = Space::new(host.clone()).unwrap();
    let without = told(&space, at);
    let part = space.add_part(room.clone(), PartId::ROOT, pose).unwrap();
    let within = told(&space, at);
    assert!(within.contains("part: PartId(1)") && within != without);
    for _ in 0..2 {
        space.withdraw(part).unwrap();
        assert!(!space.is_present(part));
        let rest = |told: &str| told.split(" [").take(3).collect::<String>();
        assert_eq!(rest(&told(&space, at)), rest(&without));
        space.set_pose(part, pose).unwrap();
        assert!(space.is_present(part));
        assert_eq!(told(&space, at), within);
    }
    // A copy does as well once the first is dropped for good.
    let copy = space.add_copy(part, PartId::ROOT, pose).unwrap();
    space.forget(part).unwrap();
    assert_eq!(
        space.n_cells(),
        host.graph.cells.len() + room.graph.cells.len()
    );
    let other = told(&space, at);
    assert!(other.contains("part: PartId(2)"), "{other}");
    assert!(space.meets(part, enfilade_cpg::PortalId(0)).is_empty());
    space.withdraw(copy).unwrap();
    assert!(told(&space, at).contains("part: PartId(0)"));
}

#[test]
fn the_root_and_parts_that_others_stand_in_stay() {
    let room = cabin(1, 1.0, 0);
    let mut space = Space::new(room.clone()).unwrap();
    let outer = space
        .add_part(room.clone(), PartId::ROOT, Pose::IDENTITY)
        .unwrap();
    let inner = space.add_part(room, outer, Pose::IDENTITY).unwrap();
    assert_eq!(space.withdraw(PartId::ROOT), Err(SpaceError::RootMoved));
    let why = space.withdraw(outer).unwrap_err();
    assert_eq!(
        why.to_string(),
        "part 2 stands in part 1; it must be taken out first"
    );
    space.withdraw(inner).unwrap();
    space.withdraw(outer).unwrap();
    assert!(matches!(
        space.withdraw(PartId(9)),
        Err(SpaceError::NoPart { .. })
    ));
}

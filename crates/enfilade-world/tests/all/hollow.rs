//! Spaces of hollow worlds: places are those of the whole world, and what is there stops bodies.

use enfilade_geom::DVec3;
use enfilade_runtime::{Sight, SightSkeleton, Target};
use enfilade_testkit::{GridParams, Rng, cabin, room_grid, with_doors};
use enfilade_world::{Body, Cast, Caster, PartId, Pose, Space};

const ROOT: PartId = PartId::ROOT;

#[test]
fn places_are_those_of_the_whole_world_and_shut_doors_stop_bodies_where_walls_are_absent() {
    let grid = room_grid(&GridParams::offices(12, 4));
    let world = with_doors(grid, |p| p % 2 == 0);
    let hollow = SightSkeleton::hollow(&world);
    hollow.validate().unwrap();
    let skeleton = Sight::build(&world).unwrap().skeleton().clone();
    let sight = Sight::build_hollow(&hollow, skeleton).unwrap();
    let mut spaces = [
        Space::new(world.clone()).unwrap(),
        Space::with_sight(hollow, sight),
    ];
    for space in &mut spaces {
        for portal in world.graph.portal_ids() {
            space.set_leaves(ROOT, portal, 0.0);
        }
        // A part in it, to which the host's hull says nothing.
        let at = Pose::from_translation(DVec3::new(5.0, 0.5, 5.0));
        space.add_part(cabin(1, 0.3, 0), ROOT, at).unwrap();
    }
    let mut rng = Rng::new(2);
    let (mut n_through, mut n_stopped) = (0, 0);
    for _ in 0..6000 {
        let mut p = |low: f64, high: f64| [0, 1, 2].map(|_| rng.range(low, high));
        let (from, by) = (DVec3::from(p(0.0, 12.0)), DVec3::from(p(-3.0, 3.0)));
        let [a, b] = spaces.each_ref().map(|s| s.locate(ROOT, from));
        assert_eq!(a, b);
        let Some(place) = a.filter(|p| p.part == ROOT) else {
            continue;
        };
        let body = Body::Sphere { radius: 0.1 };
        let mut caster = Caster::new();
        let [whole, hollow] = spaces.each_ref().map(|space| {
            let cast = Cast {
                body: &body,
                frame: ROOT,
                from,
                by,
                place,
            };
            caster.cast(space, &cast)
        });
        match (whole, hollow) {
            (Some(a), Some(b)) => assert!(a.t <= b.t),
            (None, Some(b)) => panic!("only the hollow world has {b:?}"),
            (Some(_), None) => n_through += 1,
            (None, None) => {}
        }
        if let Some(hit) = hollow.filter(|h| h.place.part == ROOT) {
            n_stopped += 1;
            let is_door = match hit.target {
                Target::Portal(_) => true,
                Target::Detail { detail, .. } => {
                    let sight = spaces[1].sight(ROOT);
                    sight.portals_of(detail).next().is_some()
                }
                Target::Wall { .. } => false,
            };
            assert!(is_door, "{hit:?}");
        }
    }
    assert!(n_through > 100 && n_stopped > 50, "{n_through} {n_stopped}");
}

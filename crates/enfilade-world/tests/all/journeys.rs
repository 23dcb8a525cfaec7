//! Paths that lead from part to part, against the same rooms put together as one world (W10, W5).

use std::sync::Arc;

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::DVec3;
use enfilade_testkit::{Beyond, Rng, Standing, assembled, chamber};
use enfilade_world::{
    Agent, Hops, NoPath, PartId, Path, PathFollower, PathSearch, Place, Pose, Space, WalkMap,
    WalkProgress, Walker,
};

const ROOT: PartId = PartId::ROOT;

/// A part, and its door.
const DOOR: PortalId = PortalId(0);

/// Two rooms whose doors face each other, the second at a gap from the first and turned, as parts of a world of nothing, far
/// from its origin; and both as one world, in the frame of the first.
struct Docked {
    space: Space,
    parts: [PartId; 2],
    truth: World,
}

/// Where the second room stands, in the frame of the first.
fn docked_at(size: [DVec3; 2], gap: f64, turn: f64) -> Pose {
    let shift = DVec3::new(
        size[0].x * 0.5 + size[1].x * 0.5,
        0.0,
        size[0].z + size[1].z + gap,
    );
    let facing = Pose::about(DVec3::ZERO, DVec3::Y, std::f64::consts::PI);
    let there = Pose::from_translation(shift).after(&facing);
    Pose::about(DVec3::new(0.5 * size[0].x, 0.0, size[0].z), DVec3::Y, turn).after(&there)
}

fn docked(gap: f64, turn: f64) -> Docked {
    docked_by(gap, turn, [1.0, 2.1])
}

/// The same through doors of a width and height.
fn docked_by(gap: f64, turn: f64, [width, height]: [f64; 2]) -> Docked {
    let sizes = [DVec3::new(4.0, 2.5, 3.0), DVec3::new(3.0, 2.5, 4.0)];
    let rooms = sizes.map(|size| {
        let middle = 0.5 * size.x;
        Arc::new(chamber(
            size,
            [middle - 0.5 * width, middle + 0.5 * width],
            height,
        ))
    });
    let far = Pose::about(DVec3::new(40.0, 2.0, -70.0), DVec3::Y, 0.7)
        .after(&Pose::from_translation(DVec3::new(900.0, -3.0, 500.0)));
    let between = docked_at(sizes, gap, turn);
    let mut space = Space::new(World::default()).unwrap();
    let a = space.add_part(rooms[0].clone(), ROOT, far).unwrap();
    let b = space
        .add_part(rooms[1].clone(), ROOT, far.after(&between))
        .unwrap();
    let poses = [Pose::IDENTITY, between];
    let standing = [0, 1].map(|k| Standing {
        world: &rooms[k],
        turn: poses[k].turn,
        at: poses[k].at,
    });
    let truth = assembled(&standing, &[(0, DOOR, Beyond::Door(1, DOOR))]).world;
    Docked {
        space,
        parts: [a, b],
        truth,
    }
}

/// A walker that passes a door of a meter with some room.
fn agent() -> Agent {
    Agent::default()
}

fn point_in(rng: &mut Rng, size: DVec3) -> DVec3 {
    DVec3::new(
        rng.range(0.3, size.x - 0.3),
        0.0,
        rng.range(0.3, size.z - 0.3),
    )
}

/// W10: a path through doors that dock is as long as in one world with an ordinary portal there, from 1 cm apart to 1 cm into each
/// other, and turned by a degree; the doors passed are those of both parts.
#[test]
fn a_path_through_docked_doors_is_that_of_one_world() {
    for (gap, degrees) in [
        (0.01, 0.0),
        (0.0, 0.0),
        (-0.01, 0.0),
        (0.0, 0.99),
        (0.004, -0.6),
    ] {
        let Docked {
            space,
            parts,
            truth,
        } = docked(gap, f64::to_radians(degrees));
        assert_eq!(
            space.meets(parts[0], DOOR),
            &[(parts[1], DOOR)],
            "{gap} {degrees}"
        );
        let (map, mut search, mut path) = (
            WalkMap::new(&space, agent()),
            PathSearch::new(),
            Path::default(),
        );
        let one = Space::new(truth).unwrap();
        let (one_map, mut one_search, mut one_path) = (
            WalkMap::new(&one, agent()),
            PathSearch::new(),
            Path::default(),
        );
        let mut rng = Rng::new(3);
        let side = map.floors(parts[0]).side();
        let mut sum = 0.0;
        for _ in 0..40 {
            let from = point_in(&mut rng, DVec3::new(4.0, 2.5, 3.0));
            let to = point_in(&mut rng, DVec3::new(3.0, 2.5, 4.0));
            let mut ends = [(parts[0], from), (parts[1], to)];
            let mut truth = [from, space.between(parts[1], parts[0]).point(to)].map(|p| (ROOT, p));
            if rng.chance(0.5) {
                ends.reverse();
                truth.reverse();
            }
            one_search
                .find(&one_map, &one, truth, |_, _| true, &mut one_path)
                .unwrap();
            search
                .find(&map, &space, ends, |_, _| true, &mut path)
                .unwrap();
            // Both bend at the ends of walls where squares of their own do, up to 0.7 squares nearer than the radius.
            let off = path.length - one_path.length;
            sum += off;
            assert!(
                off.abs() < 2.0 * side,
                "{} {}",
                path.length,
                one_path.length
            );
            let passed: Vec<PartId> = path.portals.iter().map(|p| p.part).collect();
            let order = [ends[0].0, ends[1].0];
            assert_eq!(passed, order);
            for p in &path.portals {
                let opening = space.layout(p.part).opening(p.exit.portal);
                let off = opening.bounds().distance_squared(p.at).sqrt();
                assert!(off < 0.05, "{off}");
            }
            let within = search
                .cells_within(&map, &space, ends[0].0, ends[0].1, 50.0, |_, _| true)
                .unwrap();
            assert_eq!(within.len(), 2);
            let far = search.distance(&map, &space, ends[1].0, ends[1].1).unwrap();
            assert!(
                far > path.length - side && far < 1.08 * path.length + side,
                "{far}"
            );
            // A door that must not be passed is not.
            let shut = |part, _| part != parts[1];
            let found = search.find(&map, &space, ends, shut, &mut path);
            assert_eq!(found, Err(NoPath::NoWay));
        }
        assert!((sum / 40.0).abs() < 0.5 * side, "{sum}");
    }
}

/// W10: doors that part lead nowhere, and anywhere else once they meet again, without a new map.
#[test]
fn a_path_leads_through_doors_only_while_they_meet() {
    let Docked {
        mut space, parts, ..
    } = docked(0.0, 0.0);
    let map = WalkMap::new(&space, agent());
    let (mut search, mut path) = (PathSearch::new(), Path::default());
    let ends = [
        (parts[0], DVec3::new(1.0, 0.0, 1.0)),
        (parts[1], DVec3::new(1.0, 0.0, 1.0)),
    ];
    let home = *space.local_pose(parts[1]);
    for (up, is_way) in [
        (0.0, true),
        (1.5, false),
        (0.0, true),
        (0.2, true),
        (0.5, false),
    ] {
        let lifted = Pose::from_translation(DVec3::Y * up).after(&home);
        space.set_pose(parts[1], lifted).unwrap();
        let found = search.find(&map, &space, ends, |_, _| true, &mut path);
        assert_eq!(found.is_ok(), is_way, "{up}: {found:?}");
    }
    // Both move together.
    let Docked {
        mut space, parts, ..
    } = docked(0.0, 0.0);
    search
        .find(&map, &space, ends, |_, _| true, &mut path)
        .unwrap();
    let length = path.length;
    let by = Pose::about(DVec3::new(3.0, 1.0, 2.0), DVec3::Y, 1.1);
    for part in parts {
        let there = by.after(space.local_pose(part));
        space.set_pose(part, there).unwrap();
    }
    search
        .find(&map, &space, ends, |_, _| true, &mut path)
        .unwrap();
    assert!((path.length - length).abs() < 1e-9);
}

/// W10: a walker fits through docked doors only where its body does, and keeps away from the drop at a door that leads nowhere.
#[test]
fn a_walker_needs_room_in_docked_doors() {
    let inside = [DVec3::new(1.0, 0.0, 1.0), DVec3::new(2.0, 0.0, 1.0)];
    for (size, is_way) in [
        ([1.0, 2.1], true),
        ([0.49, 2.1], false),
        ([1.0, 1.7], false),
    ] {
        let Docked { space, parts, .. } = docked_by(0.0, 0.0, size);
        let map = WalkMap::new(&space, agent());
        let ends = [(parts[0], inside[0]), (parts[1], inside[1])];
        let (mut search, mut path) = (PathSearch::new(), Path::default());
        let found = search.find(&map, &space, ends, |_, _| true, &mut path);
        assert_eq!(found.is_ok(), is_way, "{size:?}: {found:?}");
        let ends = [
            (parts[0], DVec3::new(2.0, 0.0, 2.97)),
            (parts[0], inside[0]),
        ];
        search
            .find(&map, &space, ends, |_, _| true, &mut path)
            .unwrap();
        // To a square.
        assert!(path.points[0].at.z < 2.85, "{}", path.points[0].at);
    }
}

/// W10, W12: a walker follows a path from part to part, and waits where the next part has left.
#[test]
fn a_walker_follows_a_path_from_part_to_part() {
    let Docked {
        mut space, parts, ..
    } = docked(0.005, 0.01);
    let map = WalkMap::new(&space, agent());
    let (mut search, mut path) = (PathSearch::new(), Path::default());
    let ends = [
        (parts[0], DVec3::new(0.5, 0.0, 0.5)),
        (parts[1], DVec3::new(2.5, 0.0, 0.5)),
    ];
    search
        .find(&map, &space, ends, |_, _| true, &mut path)
        .unwrap();
    let home = *space.local_pose(parts[1]);
    for leaves in [false, true] {
        space.set_pose(parts[1], home).unwrap();
        let start = path.points[0];
        let mut walker = Walker::new(agent(), start.part, start.at + DVec3::Y * agent().eye);
        let mut follower = PathFollower::new(&space, path.clone(), 1.4);
        let mut progress = WalkProgress::Walking;
        for i in 0..1000 {
            if leaves && i == 10 {
                let away = Pose::from_translation(DVec3::Y * 3.0).after(&home);
                space.set_pose(parts[1], away).unwrap();
            }
            progress = follower.step(&mut walker, &mut space, 1.0 / 60.0);
            if progress != WalkProgress::Walking {
                break;
            }
        }
        if leaves {
            assert_eq!((progress, walker.frame), (WalkProgress::Stuck, parts[0]));
            assert!(
                walker.feet().y.abs() < 0.01 && walker.feet().z < 3.0,
                "{}",
                walker.feet()
            );
        } else {
            assert_eq!((progress, walker.frame), (WalkProgress::Arrived, parts[1]));
        }
    }
}

/// W10: a second path from part to part allocates nothing.
#[test]
fn a_second_path_from_part_to_part_allocates_nothing() {
    let Docked { space, parts, .. } = docked(0.0, 0.0);
    let map = WalkMap::new(&space, agent());
    let (mut search, mut path) = (PathSearch::new(), Path::default());
    let ends = [
        (parts[0], DVec3::new(0.5, 0.0, 0.5)),
        (parts[1], DVec3::new(2.5, 0.0, 0.5)),
    ];
    let mut ask = || {
        let _ = search.find(&map, &space, ends, |_, _| true, &mut path);
        let _ = search.cells_within(&map, &space, ends[0].0, ends[0].1, 20.0, |_, _| true);
        let _ = search.distance(&map, &space, ends[1].0, ends[1].1);
    };
    (0..4).for_each(|_| ask());
    assert_eq!(allocation_counter::measure(ask).count_total, 0);
}

/// W10: the next step leads through the doors that meet, and back; not through shut ones, nor while they have parted.
#[test]
fn hops_lead_from_part_to_part() {
    let Docked {
        mut space, parts, ..
    } = docked(0.0, 0.0);
    let mut hops = Hops::new(&space, |part, _| {
        Some(if part == parts[0] { 2.0 } else { 3.0 })
    });
    let rooms = parts.map(|part| Place {
        part,
        cell: CellId(0),
    });
    for [from, to] in [rooms, [rooms[1], rooms[0]]] {
        assert_eq!(hops.distance(&space, from, to), Some(5.0));
        let hop = hops.next(&space, from, to).unwrap();
        assert_eq!((hop.part, hop.portal, hop.to), (from.part, DOOR, to));
    }
    for part in parts {
        hops.set_open(part, DOOR, false);
        assert_eq!(hops.distance(&space, rooms[0], rooms[1]), None);
        assert_eq!(hops.next(&space, rooms[0], rooms[1]), None);
        hops.set_open(part, DOOR, true);
    }
    let home = *space.local_pose(parts[1]);
    let away = Pose::from_translation(DVec3::Y * 3.0).after(&home);
    space.set_pose(parts[1], away).unwrap();
    assert_eq!(hops.distance(&space, rooms[0], rooms[1]), None);
    space.set_pose(parts[1], home).unwrap();
    assert_eq!(hops.distance(&space, rooms[0], rooms[1]), Some(5.0));
}

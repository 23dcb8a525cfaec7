//! Sound through the doors of parts that stand together, against the same rooms as one world. Covers W11, W12.

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::{DQuat, DVec3};
use enfilade_testkit::{Beyond, Rng, Standing, assembled, chamber};
use enfilade_world::{
    Acoustics, DecayLaw, DiffuseFields, Heard, Listener, PartId, Place, Pose, Reverb, Space,
    Transmission,
};

const DOOR: PortalId = PortalId(0);

/// A building and a cabin, in the open, anywhere; the cabin's door before the building's.
struct Site {
    space: Space,
    /// Building and cabin.
    parts: [PartId; 2],
    middle: Pose,
    /// The cabin's pose in the building's frame.
    home: Pose,
}

fn site(gap: f64) -> Site {
    let mut space = Space::new(chamber(DVec3::new(600.0, 100.0, 600.0), [1.0, 2.0], 2.0)).unwrap();
    let middle = Pose {
        turn: DQuat::from_rotation_y(0.5),
        at: DVec3::new(300.0, 50.0, 300.0),
    };
    let home = Pose {
        turn: DQuat::from_rotation_y(std::f64::consts::PI),
        at: DVec3::new(4.0, 0.0, 8.0 + gap),
    };
    let building = chamber(DVec3::new(6.0, 3.0, 5.0), [2.0, 3.0], 2.1);
    let cabin = chamber(DVec3::new(3.0, 2.6, 3.0), [1.0, 2.0], 2.1);
    let mut add = |world, pose| space.add_part(world, PartId::ROOT, pose).unwrap();
    let parts = [add(building, middle), add(cabin, middle.after(&home))];
    Site {
        space,
        parts,
        middle,
        home,
    }
}

impl Site {
    /// The same as one world, in the building's frame.
    fn as_one(&self) -> Space {
        let poses = [Pose::IDENTITY, self.home];
        let standing = [0, 1].map(|k| Standing {
            world: self.space.world(self.parts[k]),
            turn: poses[k].turn,
            at: poses[k].at,
        });
        let doors = [(1, DOOR, Beyond::Door(0, DOOR))];
        Space::new(assembled(&standing, &doors).world).unwrap()
    }

    /// A point in the room of one of the two, there and in the world of both.
    fn place(&self, k: usize, rng: &mut Rng) -> [(Place, DVec3); 2] {
        let bounds = self.space.layout(self.parts[k]).cell(CellId(0)).bounds;
        let at = rng.point_in(&bounds.expanded(-0.2));
        let one = [at, self.home.point(at)][k];
        let cells = [(self.parts[k], 0), (PartId::ROOT, 2 * k as u32)];
        let [own, other] = cells.map(|(part, cell)| Place {
            part,
            cell: CellId(cell),
        });
        [(own, at), (other, one)]
    }
}

fn hear(
    space: &Space,
    acoustics: &Acoustics,
    [ears, source]: [(Place, DVec3); 2],
) -> Option<Heard> {
    let mut listener = Listener::new();
    listener.listen(acoustics, space, ears.0, ears.1);
    listener.hear(acoustics, 0, source.0, source.1)
}

fn decibels(a: &Heard, b: &Heard) -> f64 {
    (20.0 * (a.gain / b.gain).log10()).abs()
}

/// Doors that meet are one gate, whichever is shut.
#[test]
fn sound_passes_doors_that_meet_as_one_opening() {
    let mut rng = Rng::new(3);
    for gap in [0.0, 0.01, -0.01] {
        let mut site = site(gap);
        let mut one = site.as_one();
        let acoustics = Acoustics::new(&site.space, &Transmission::default());
        let of_one = Acoustics::new(&one, &Transmission::default());
        // A centimeter of way changes levels by 1 dB at most.
        let [most, longest] = if gap == 0.0 {
            [1e-3, 1e-5]
        } else {
            [1.0, 0.0101]
        };
        for shut in [None, Some(0), Some(1)] {
            for k in 0..2 {
                site.space.open(site.parts[k], DOOR);
                if shut == Some(k) {
                    site.space.close(site.parts[k], DOOR);
                }
            }
            let door = PortalId(one.layout(PartId::ROOT).n_portals() as u32 - 1);
            match shut {
                None => one.open(PartId::ROOT, door),
                Some(_) => one.close(PartId::ROOT, door),
            }
            for i in 0..40 {
                let [ears, source] = [i % 2, 1 - i % 2].map(|k| site.place(k, &mut rng));
                let found = hear(&site.space, &acoustics, [ears[0], source[0]]).unwrap();
                let known = hear(&one, &of_one, [ears[1], source[1]]).unwrap();
                let what = format!("{gap} {shut:?} {ears:?} {source:?}: {found:?} not {known:?}");
                assert!(decibels(&found, &known) < most, "{what}");
                assert!((found.length - known.length).abs() < longest, "{what}");
                // In the frame of the listener's part.
                let turn = [Pose::IDENTITY, site.home][i % 2].turn;
                let apart = (turn * found.direction).distance(known.direction);
                assert!(apart < 2.0 * longest, "{what}");
            }
        }
    }
}

/// A listener who stays hears what a new one hears while the cabin leaves, and louder at the door than away from it.
#[test]
fn a_kept_listener_follows_parts_that_move() {
    let mut site = site(0.0);
    let acoustics = Acoustics::new(&site.space, &Transmission::default());
    let mut kept = Listener::new();
    let mut rng = Rng::new(5);
    let [ears, source] = [0, 1].map(|k| site.place(k, &mut rng)[0]);
    // In the open, which the building's door leads to once the cabin is gone.
    let open = Place {
        part: PartId::ROOT,
        cell: CellId(0),
    };
    let outside = (open, site.middle.point(DVec3::new(-2.0, 1.0, 8.0)));
    let mut levels = Vec::new();
    for k in 0..40 {
        let away = Pose::from_translation(DVec3::Z * 0.05 * f64::from(k));
        let pose = site.middle.after(&away).after(&site.home);
        site.space.set_pose(site.parts[1], pose).unwrap();
        kept.listen(&acoustics, &site.space, ears.0, ears.1);
        let heard = kept.hear(&acoustics, 1, outside.0, outside.1);
        let fresh = hear(&site.space, &acoustics, [ears, outside]);
        assert_eq!(
            heard.is_some(),
            fresh.is_some(),
            "{k}: {heard:?} not {fresh:?}"
        );
        assert_eq!(heard.is_some(), k > 0, "{k}: {heard:?}");
        let heard = kept.hear(&acoustics, 0, source.0, source.1).unwrap();
        let fresh = hear(&site.space, &acoustics, [ears, source]).unwrap();
        assert!(
            decibels(&heard, &fresh) < 1e-6,
            "{k}: {heard:?} not {fresh:?}"
        );
        levels.push(heard.length);
    }
    assert!(
        levels.is_sorted() && levels[39] > levels[0] + 1.5,
        "{levels:?}"
    );
}

/// The door of a cabin in a room leads to that room.
#[test]
fn a_cabin_hears_the_room_it_stands_in() {
    let hall = chamber(DVec3::new(12.0, 4.0, 12.0), [1.0, 2.0], 2.0);
    let cabin = chamber(DVec3::new(3.0, 2.6, 3.0), [1.0, 2.0], 2.1);
    let mut space = Space::new(hall).unwrap();
    let pose = Pose {
        turn: DQuat::from_rotation_y(0.3),
        at: DVec3::new(3.0, 0.1, 2.0),
    };
    let part = space.add_part(cabin, PartId::ROOT, pose).unwrap();
    let mut acoustics = Acoustics::new(&space, &Transmission::default());
    let inside = DVec3::new(1.5, 1.2, 1.5);
    let before = pose.point(DVec3::new(1.5, 1.2, 5.0));
    let [ears, source] = [(part, inside), (PartId::ROOT, before)].map(|(part, at)| {
        let cell = CellId(0);
        (Place { part, cell }, at)
    });
    for _ in 0..2 {
        let heard = hear(&space, &acoustics, [ears, source]).unwrap();
        assert!((heard.length - 3.5).abs() < 1e-9, "{heard:?}");
        assert!(heard.direction.distance(DVec3::Z) < 1e-6, "{heard:?}");
        let back = hear(&space, &acoustics, [source, ears]).unwrap();
        assert!(decibels(&heard, &back) < 0.1, "{heard:?} {back:?}");
        // The same from where it stood when the acoustics were made.
        space.set_pose(part, Pose::IDENTITY).unwrap();
        acoustics = Acoustics::new(&space, &Transmission::default());
        space.set_pose(part, pose).unwrap();
    }
}

/// Rooms of different parts are coupled through doors that meet, and not when they are apart.
#[test]
fn fields_are_coupled_through_doors_that_meet() {
    let mut site = site(0.0);
    let one = site.as_one();
    let [own, other] =
        [&site.space, &one].map(|space| Reverb::new(space, DecayLaw::Kuttruff, |_, _| [0.2; 6]));
    let mut rng = Rng::new(5);
    let places = [0, 1].map(|k| site.place(k, &mut rng).map(|p| p.0));
    let (mut fields, mut known) = (DiffuseFields::new(), DiffuseFields::new());
    for share in [1.0, 0.3] {
        fields.solve(&own, &site.space, places[0][0], |part, _| {
            if part == site.parts[0] { share } else { 1.0 }
        });
        known.solve(&other, &one, places[0][1], |_, _| share);
        for [here, there] in places {
            // Walls are measured by lines, others for a room of another frame: off by a percent each.
            let ratio = fields.gain(here) / known.gain(there);
            assert!((ratio - 1.0).abs() < 0.03, "{share} {here:?}: {ratio}");
            let ratio = fields.rt60(here) / known.rt60(there);
            assert!((ratio - 1.0).abs() < 0.03, "{share} {here:?}: {ratio}");
        }
    }
    let away = Pose::from_translation(DVec3::Z * 30.0);
    let pose = site.middle.after(&away).after(&site.home);
    site.space.set_pose(site.parts[1], pose).unwrap();
    let coupled = fields.gain(places[1][0]);
    fields.solve(&own, &site.space, places[0][0], |_, _| 1.0);
    assert!(fields.gain(places[1][0]) < 0.1 * coupled);
}

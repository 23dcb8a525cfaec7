//! A living world that is saved and restored plays on to the bit like the one that was not. Covers W4, W5, W13.

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::DVec3;
use enfilade_testkit::{GridParams, cabin, room_grid, with_doors};
use enfilade_world::{
    ActorEvent, Actors, Chance, PartId, PlanDraft, Pose, SavedActors, SavedError, SavedSpace,
    SavedThings, Shape, Space, ThingId, Things, Tie, WayPoint,
};
use serde::{Serialize, de::DeserializeOwned};

fn worlds() -> [World; 2] {
    let offices = with_doors(room_grid(&GridParams::offices(12, 3)), |_| false);
    [offices, cabin(1, 0.5, 0)]
}

fn space() -> Space {
    let [root, cabin] = worlds();
    let mut space = Space::new(root).unwrap();
    let pose = Pose::from_translation(DVec3::new(3.0, 0.2, 4.0));
    space.add_part(cabin, PartId::ROOT, pose).unwrap();
    space
}

/// Back and forth between cells, by chance alone.
fn plan(event: &ActorEvent, chance: &mut Chance, plan: &mut PlanDraft<'_>) {
    for _ in 0..chance.below(4) {
        let cell = CellId(chance.below(12));
        let by = [0; 3].map(|_| chance.range([-5.0, 5.0]));
        let at = event.at + DVec3::from_array(by);
        plan.walk(WayPoint { at, cell }, chance.range([0.5, 2.0]));
    }
    plan.wait(if chance.unit() < 0.05 {
        f64::INFINITY
    } else {
        chance.range([0.0, 20.0])
    });
}

struct Life {
    space: Space,
    things: Things,
    actors: Actors,
    ball: ThingId,
}

impl Life {
    fn new() -> Self {
        let space = space();
        let mut things = Things::new();
        let at = space.layout(PartId::ROOT).cell(CellId(0)).bounds.center();
        let ball = || Shape::sphere(0.3).unwrap();
        let add = |things: &mut Things, tie: Tie, by: f64| {
            let pose = Pose::about(at, DVec3::Y, by).after(&Pose::from_translation(at * by));
            things.add(&space, ball(), PartId::ROOT, pose, tie).unwrap()
        };
        let gone = add(&mut things, Tie::Free, 0.1);
        let parent = add(&mut things, Tie::Carried, 0.2);
        add(&mut things, Tie::Child(parent), 0.3);
        add(&mut things, Tie::Global, 0.4);
        things.remove(gone).unwrap();
        let mut actors = Actors::new(space.layout(PartId::ROOT).n_cells(), 9);
        for i in 0..40 {
            let id = actors.add(at, CellId(i % 12), plan);
            if i % 9 == 0 {
                actors.remove(id);
            } else if i % 5 == 0 {
                actors.tell(id, f64::from(i), 7);
            }
        }
        Self {
            ball: parent,
            space,
            things,
            actors,
        }
    }

    /// Plays from one second to another.
    fn play(&mut self, from: u32, to: u32) {
        for s in from..to {
            let t = f64::from(s);
            self.actors.advance(t, plan);
            let pose = Pose::about(DVec3::new(3.0, 0.0, 4.0), DVec3::Y, 0.01 * t);
            self.space.set_pose(PartId(1), pose).unwrap();
            let n = self.space.layout(PartId::ROOT).n_portals() as u32;
            let portal = PortalId(s * 7 % n);
            match s % 4 {
                0 => self.space.set_leaves(PartId::ROOT, portal, 0.0),
                1 => self.space.set_leaves(PartId::ROOT, portal, 0.3),
                2 => self.space.close(PartId::ROOT, portal),
                _ => self
                    .space
                    .narrow(PartId::ROOT, portal, [0.0, 1.0, 0.0], [0.0; 3]),
            }
            self.space.lock(PartId::ROOT, CellId(s % 12), s % 3 == 0);
            let (frame, pose) = self.things.pose(&self.space, self.ball).unwrap();
            let pose = Pose::from_translation(DVec3::X * 0.01).after(&pose);
            self.things
                .set_pose(&self.space, self.ball, frame, pose)
                .unwrap();
        }
    }

    fn text(&mut self) -> [String; 3] {
        [
            serde_json::to_string(&self.space.saved()).unwrap(),
            serde_json::to_string(&self.things.saved(&self.space)).unwrap(),
            serde_json::to_string(&self.actors.saved()).unwrap(),
        ]
    }
}

fn read<T: DeserializeOwned + Serialize>(text: &str) -> T {
    serde_json::from_str(text).unwrap()
}

#[test]
fn a_restored_world_plays_on_to_the_bit() {
    let mut life = Life::new();
    life.play(0, 60);
    let text = life.text();
    let mut other = Life::new();
    other.space.restore(&read::<SavedSpace>(&text[0])).unwrap();
    other.things = Things::restored(&other.space, &read::<SavedThings>(&text[1])).unwrap();
    let n_cells = other.space.layout(PartId::ROOT).n_cells();
    other.actors = Actors::restored(n_cells, &read::<SavedActors>(&text[2])).unwrap();
    assert_eq!(other.text(), text);
    for life in [&mut life, &mut other] {
        life.play(60, 200);
    }
    assert!(life.text() != text, "something happens");
    assert_eq!(other.text(), life.text());
    for portal in life.space.world(PartId::ROOT).graph.portal_ids() {
        let [a, b] = [&life, &other].map(|l| l.space.state(PartId::ROOT).is_open(portal));
        assert_eq!(a, b, "{portal}");
    }
}

#[test]
fn states_that_do_not_fit_are_refused() {
    let mut life = Life::new();
    let mut saved = life.space.saved();
    saved.parts[0].1.shares.push(None);
    let refused = life.space.restore(&saved);
    assert!(matches!(refused, Err(SavedError::Doors { part: 0, .. })));
    saved.parts.pop();
    let refused = life.space.restore(&saved);
    assert_eq!(refused, Err(SavedError::Parts { saved: 1, own: 2 }));
    let mut saved = life.things.saved(&life.space);
    saved
        .slots
        .iter_mut()
        .flat_map(|s| &mut s.1)
        .for_each(|t| t.frame = 9);
    let refused = Things::restored(&life.space, &saved);
    assert!(matches!(
        refused,
        Err(SavedError::NoSuch { what: "thing", .. })
    ));
    let mut saved = life.actors.saved();
    saved.members[3].plan[0].1 = 1_000;
    let refused = Actors::restored(12, &saved);
    assert!(matches!(
        refused,
        Err(SavedError::NoSuch {
            what: "actor",
            index: 3
        })
    ));
}

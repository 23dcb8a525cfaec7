//! No question of a settled frame allocates.

use enfilade_cpg::CellId;
use enfilade_geom::DVec3;
use enfilade_runtime::View;
use enfilade_testkit::{GridParams, Rng, room_grid};
use enfilade_world::{PartId, Pose, Shape, Space, SpaceViewer, Things, Tie};

/// A frame: a lift moves, things move, and an eye looks.
struct Frame {
    space: Space,
    things: Things,
    viewer: SpaceViewer,
    ids: Vec<enfilade_world::ThingId>,
}

impl Frame {
    fn run(&mut self, rounds: u64) -> usize {
        let mut n = 0;
        let mut rng = Rng::new(3);
        for i in 0..rounds {
            let lift = PartId(1);
            let at = Pose::from_translation(DVec3::new(4.0, (i % 10) as f64, 5.0));
            self.space.set_pose(lift, at).unwrap();
            for &id in &self.ids {
                let (frame, pose) = self.things.pose(&self.space, id).unwrap();
                let step = DVec3::from_array([0, 1, 2].map(|_| rng.range(-0.2, 0.2)));
                let to = Pose::from_translation(pose.at + step);
                let moved = self.things.set_pose(&self.space, id, frame, to).unwrap();
                n += usize::from(moved.from != moved.to);
            }
            let eye = DVec3::new(rng.range(1.0, 9.0), 1.5, rng.range(1.0, 9.0));
            let toward = [rng.unit() as f32 - 0.5, 0.1, rng.unit() as f32 - 0.5];
            let eye = eye.as_vec3().to_array();
            let view = View::perspective(eye, toward, [0.0, 1.0, 0.0], 1.2, 1.5).unwrap();
            let seen = self.viewer.see(&self.space, PartId::ROOT, &view);
            n += self.things.see(&self.space, &seen).len();
        }
        n
    }
}

#[test]
fn nothing_is_allocated_once_warm() {
    let root = room_grid(&GridParams {
        merges: 0.2,
        ..GridParams::offices(300, 1)
    });
    let cabin = room_grid(&GridParams {
        size: [1, 1, 1],
        windows: 1.0,
        ..GridParams::offices(1, 1)
    });
    let mut space = Space::new(root.clone()).unwrap();
    let lift = space.add_part(cabin.clone(), PartId::ROOT, Pose::IDENTITY);
    assert_eq!(lift, Ok(PartId(1)));
    let mut things = Things::new();
    let mut ids = Vec::new();
    for cell in (0..60).map(CellId) {
        let at = space.layout(PartId::ROOT).cell(cell).bounds.center();
        let shape = Shape::sphere(0.6).unwrap();
        let pose = Pose::from_translation(at);
        let tie = if cell.0 % 2 == 0 {
            Tie::Free
        } else {
            Tie::Carried
        };
        ids.push(things.add(&space, shape, PartId::ROOT, pose, tie).unwrap());
    }
    let viewer = SpaceViewer::new(&space);
    let mut frame = Frame {
        space,
        things,
        viewer,
        ids,
    };
    // The same frames twice; between them all that moves goes back to where it was.
    let start: Vec<_> = frame
        .ids
        .iter()
        .map(|id| frame.things.pose(&frame.space, *id).unwrap())
        .collect();
    let warm = frame.run(40);
    for (&id, &(part, pose)) in frame.ids.iter().zip(&start) {
        frame.things.set_pose(&frame.space, id, part, pose).unwrap();
    }
    let mut again = 0;
    let counted = allocation_counter::measure(|| again = frame.run(40));
    assert_eq!(counted.count_total, 0);
    assert!(warm > 20 && again > 20, "{warm} {again}");
}

//! Queries allocate nothing once their buffers have grown.

use enfilade_runtime::{
    DrawList, Follower, Narrowing, SeeOptions, Sight, SightState, Sightlines, View, Viewer,
};
use enfilade_testkit::{GridParams, Rng, courtyard, room_grid};

#[test]
fn nothing_is_allocated_once_warm() {
    let worlds = [
        room_grid(&GridParams {
            merges: 0.2,
            ..GridParams::offices(300, 1)
        }),
        courtyard(16, false),
    ];
    for world in worlds {
        let sight = Sight::build(&world).unwrap();
        let lines = Sightlines::build(&world);
        let state = SightState::new(&sight);
        for narrowing in [Narrowing::Rectangle, Narrowing::Polygon] {
            let options = SeeOptions {
                narrowing,
                ..SeeOptions::default()
            };
            let mut viewer = Viewer::with_options(&sight, options);
            let mut rng = Rng::new(7);
            let views: Vec<View> = (0..200)
                .map(|i| {
                    let eye = [0, 1, 2].map(|k| {
                        let b = &world.graph.cells[i % world.graph.cells.len()].aabb;
                        b[0][k] + (b[1][k] - b[0][k]) * rng.unit() as f32
                    });
                    let toward = [rng.unit() as f32 - 0.5, 0.1, rng.unit() as f32 - 0.5];
                    let fov = if i % 20 == 0 { 4.0 } else { 1.2 };
                    View::perspective(eye, toward, [0.0, 1.0, 0.0], fov, 1.5).unwrap()
                })
                .collect();
            let mut follower = Follower::new(&sight, views[0].eye());
            let mut list = DrawList::new();
            let mut ask = || {
                let mut n = 0;
                for view in &views {
                    let seen = viewer.see(&sight, &state, view);
                    list.fill(&sight, &seen);
                    n += seen.chunks().len() + list.draws().len();
                    n += usize::from(lines.is_clear(&state, view.eye(), views[0].eye()));
                    let hit = lines.pick(&state, view.eye(), views[0].eye());
                    n += usize::from(hit.is_ok_and(|h| h.is_some()));
                    follower.step(&sight, view.eye());
                }
                n
            };
            let first = ask();
            let mut second = 0;
            let counted = allocation_counter::measure(|| second = ask());
            assert_eq!(counted.count_total, 0, "{narrowing:?}");
            assert_eq!(first, second);
        }
    }
}

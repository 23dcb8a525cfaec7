//! The work of a game in each frame: `cargo run --release -p enfilade --example game_loop [WORLD.glb]`.
//!
//! A camera walks from doorway to doorway; each frame is a short list of draws. Without a world, uses a storey of offices.

#![allow(clippy::print_stdout)]

use std::error::Error;

use enfilade::{DrawList, Follower, Sight, SightState, Step, View, Viewer, World};
use enfilade_testkit::{GridParams, room_grid};

const FRAMES_A_STRETCH: usize = 30;

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args_os()
        .nth(1)
        .filter(|p| p.to_string_lossy().ends_with(".glb"));
    let world = match path {
        Some(path) => enfilade::open(path)?,
        None => room_grid(&GridParams::offices(60, 7)),
    };

    // Once. An engine would upload positions and `sight.indices(batch)` of each batch here.
    let sight = Sight::build(&world)?;
    let state = SightState::new(&sight);
    let (mut viewer, mut list) = (Viewer::new(&sight), DrawList::new());

    let stops = walk(&world, 8);
    let mut camera = Follower::new(&sight, *stops.first().ok_or("the world has no room")?);
    let (mut n_frames, mut n_draws, mut n_triangles) = (0_u64, 0, 0);
    for stretch in stops.windows(2) {
        let [from, to] = [stretch[0], stretch[1]];
        let toward = [0, 1, 2].map(|k| to[k] - from[k]);
        for i in 1..=FRAMES_A_STRETCH {
            let t = i as f32 / FRAMES_A_STRETCH as f32;
            let eye = [0, 1, 2].map(|k| from[k] + toward[k] * t);
            // Its room, for sound and streaming.
            if camera.step(&sight, eye) == Step::Crossed
                && let Some(cell) = camera.cell()
            {
                println!(
                    "through {} to {}",
                    camera.crossed()[0],
                    world.graph[cell].name
                );
            }
            let view = View::perspective(eye, toward, [0.0, 1.0, 0.0], 1.0, 16.0 / 9.0)?;
            let seen = viewer.see(&sight, &state, &view);
            list.fill(&sight, &seen);
            for draw in &list {
                // An engine: bind the batch's buffers, draw_indexed(first_index, n_indices).
                n_triangles += u64::from(draw.n_indices / 3);
            }
            for &detail in seen.details() {
                // An engine: draw the mesh of `world[detail]` with its transform.
                n_triangles += u64::from(sight.detail_triangles(detail.0));
            }
            n_draws += list.draws().len() + seen.details().len();
            n_frames += 1;
        }
    }
    let mean = n_triangles / n_frames.max(1);
    println!(
        "{n_frames} frames: {mean} of {} triangles drawn on average, in {} draws",
        sight.n_triangles(),
        n_draws / n_frames.max(1) as usize
    );
    assert!(mean > 0 && mean < sight.n_triangles());
    Ok(())
}

/// Points on a path through `n` doorways, always to the room visited least.
fn walk(world: &World, n: usize) -> Vec<[f32; 3]> {
    let graph = &world.graph;
    let middle = |[low, high]: [[f32; 3]; 2]| [0, 1, 2].map(|k| low[k].midpoint(high[k]));
    let Some((mut cell, first)) = graph.indoor_cells().next() else {
        return Vec::new();
    };
    let mut stops = vec![middle(first.aabb)];
    let mut visits = vec![0; graph.cells.len()];
    for _ in 0..n {
        visits[cell.idx()] += 1;
        let indoors = graph.exits(cell).filter(|e| !graph[e.to].outdoor);
        let Some(exit) = indoors.min_by_key(|e| visits[e.to.idx()]) else {
            break;
        };
        cell = exit.to;
        stops.extend([exit.portal.center(), middle(graph[cell].aabb)]);
    }
    stops
}

//! The program of the README: `cargo run --release -p enfilade --example first_walk` in a folder with a `world.glb`, such as
//! that of `enfilade demo`.

#![allow(clippy::print_stdout)]

use enfilade::{DrawList, Sight, SightState, Sightlines, Target, View, Viewer};

pub(crate) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let world = enfilade::open("world.glb")?; // checked once, so queries cannot fail
    let (sight, lines) = (Sight::build(&world)?, Sightlines::build(&world));
    let mut state = SightState::new(&sight); // the state of doors; all are open
    let (mut viewer, mut list) = (Viewer::new(&sight), DrawList::new());

    let (mut eye, ahead) = ([5.5, 1.6, 7.75], [1.0, -0.3, 0.0]);
    for frame in 0..120 {
        let view = View::perspective(eye, ahead, [0.0, 1.0, 0.0], 1.0, 16.0 / 9.0)?;
        let seen = viewer.see(&sight, &state, &view);
        list.fill(&sight, &seen);
        for draw in &list {
            // Positions, normals and material; the visible triangles among them.
            let (_vertices, _indices) = (&draw.batch(&world).primitive, draw.indices(&sight));
        }
        for &detail in seen.details() {
            let _furniture = (world[detail].mesh, world[detail].transform);
            let _moved = state.pose(detail); // a door leaf: its current pose
        }
        let end = [0, 1, 2].map(|k| eye[k] + 50.0 * ahead[k]);
        if let Some(hit) = lines.pick(&state, eye, end)? {
            match hit.target {
                Target::Wall { .. } => println!("{frame}: a wall at {:?}", hit.position),
                Target::Detail { detail, .. } => match sight.portals_of(detail).next() {
                    Some(door) => {
                        println!("{frame}: a leaf of {door}, which opens");
                        state.open(door);
                    }
                    None => println!("{frame}: {}", world[detail].name),
                },
                Target::Portal(door) => state.open(door), // a closed portal without a leaf
            }
        }
        if frame == 60
            && let Some(&door) = seen.portals().first()
        {
            state.close(door); // from the next frame on, it hides the rooms behind
        }
        eye[0] += 0.02;
    }
    Ok(())
}

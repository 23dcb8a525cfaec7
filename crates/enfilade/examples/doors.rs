//! Closes, slides, turns and picks doors: `cargo run --release -p enfilade --example doors`.

#![allow(clippy::print_stdout)]

use std::error::Error;

use enfilade::{PortalId, Sight, SightState, Sightlines, Target, View, Viewer, World};
use enfilade_testkit::{GridParams, room_grid, with_doors};

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    // Two rooms in a row, with one doorway.
    let world = room_grid(&GridParams::two_rooms());
    let sight = Sight::build(&world)?;
    let lines = Sightlines::build(&world);
    let mut state = SightState::new(&sight);
    let mut viewer = Viewer::new(&sight);

    // Stand a meter in front of the middle of the doorway and look through it, to a meter behind.
    let door = PortalId(0);
    let portal = &world.graph[door];
    let middle = portal.center();
    let at = |along: f32| [0, 1, 2].map(|k| middle[k] + along * portal.normal[k]);
    let (eye, target) = (at(-1.0), at(1.0));
    let view = View::perspective(eye, portal.normal, [0.0, 1.0, 0.0], 1.0, 1.5)?;
    let here = sight.locate(eye).ok_or("the eye is in a wall")?;
    let behind = portal.beyond(here);

    println!(
        "{door} joins {} and {}",
        world.graph[here].name, world.graph[behind].name
    );
    assert!(viewer.see(&sight, &state, &view).cells().contains(&behind));
    assert!(lines.is_clear(&state, eye, target));

    // Close it: the room behind is not drawn, and a click hits the door.
    state.close(door);
    assert!(!viewer.see(&sight, &state, &view).cells().contains(&behind));
    let hit = lines.pick(&state, eye, target)?.ok_or("nothing was hit")?;
    assert_eq!(hit.target, Target::Portal(door));
    println!("shut: the click hits the door at {:?}", hit.position);

    // Slide it open by a quarter: open on one side of a plane across the opening. The middle is still shut.
    let [x, _, z] = portal.normal;
    let side = [z, 0.0, -x];
    let reach = portal
        .outline
        .iter()
        .map(|p| (0..3).map(|k| side[k] * (p[k] - middle[k])).sum());
    let half_width = reach.fold(0.0, f32::max);
    state.open(door);
    state.narrow(
        door,
        side,
        [0, 1, 2].map(|k| middle[k] + side[k] * 0.5 * half_width),
    );
    let through = |share: f32| {
        let p = [0, 1, 2].map(|k| middle[k] + side[k] * share * half_width);
        let end = |along: f32| [0, 1, 2].map(|k| p[k] + along * portal.normal[k]);
        lines.is_clear(&state, end(-0.5), end(0.5))
    };
    assert!(!through(0.0) && through(0.75));
    assert!(viewer.see(&sight, &state, &view).cells().contains(&behind));
    println!("a quarter open: one looks past the leaf, not through it");

    // Beside the doorway is the wall.
    let aside = [0, 1, 2].map(|k| target[k] + side[k] * 4.0 * half_width);
    let hit = lines.pick(&state, eye, aside)?.ok_or("nothing was hit")?;
    assert!(matches!(hit.target, Target::Wall { .. }) && hit.cell == Some(here));
    println!(
        "beside it: a wall of {}, at {:?}",
        world.graph[here].name, hit.position
    );
    turn(&with_doors(world, |_| false), door)
}

/// Turns a leaf in the same doorway, as a bake finds them.
fn turn(world: &World, door: PortalId) -> Result<(), Box<dyn Error>> {
    let sight = Sight::build(world)?;
    let lines = Sightlines::build(world);
    let mut state = SightState::new(&sight);
    let portal = &world.graph[door];
    let middle = portal.center();
    let at = |along: f32| [0, 1, 2].map(|k| middle[k] + along * portal.normal[k]);
    let leaf = sight.leaves(door)[0].detail;
    state.set_leaves(door, 0.0);
    let hit = lines.pick(&state, at(-1.0), at(1.0))?;
    let met = hit.ok_or("nothing was hit")?.target;
    assert!(matches!(met, Target::Detail { detail, .. } if detail == leaf));
    println!("shut: the click hits {}", world[leaf].name);
    // A game does this frame by frame, and draws the leaf with its own transform followed by this one.
    state.set_leaves(door, 1.0);
    let moved = state.pose(leaf).ok_or("it has not moved")?;
    assert_eq!(lines.pick(&state, at(-1.0), at(1.0))?, None);
    println!("open: {} is turned by {moved}", world[leaf].name);
    Ok(())
}

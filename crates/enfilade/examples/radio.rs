//! A radio behind a door, as one hears it when the door opens: `cargo run --release -p enfilade --example radio`.

#![allow(clippy::print_stdout)]

use std::error::Error;

use enfilade::PortalId;
use enfilade::geom::DVec3;
use enfilade::world::{Acoustics, Listener, PartId, Space, Transmission};
use enfilade_testkit::{GridParams, room_grid, with_doors};

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    // Two rooms and a door; in a program of yours, `enfilade::open(path)?`.
    let world = with_doors(room_grid(&GridParams::two_rooms()), |_| false);
    let mut space = Space::new(world)?;
    let (root, door) = (PartId::ROOT, PortalId(0));
    let acoustics = Acoustics::new(&space, &Transmission::default());

    // The radio stands in the second room, the listener in the first, beside the doorway.
    let opening = space.layout(root).opening(door);
    let (middle, ahead) = (opening.center(), opening.normal());
    let ears = middle - ahead * 1.5 + DVec3::Z * 0.5;
    let radio = middle + ahead * 2.0;
    let [here, there] = [ears, radio].map(|p| space.locate(root, p));
    let (here, there) = (
        here.ok_or("ears in a wall")?,
        there.ok_or("radio in a wall")?,
    );

    let mut listener = Listener::new();
    let mut levels = Vec::new();
    for percent in (0..=100).step_by(20) {
        space.set_leaves(root, door, percent as f32 / 100.0);
        listener.listen(&acoustics, &space, here, ears);
        let heard = listener
            .hear(&acoustics, 0, there, radio)
            .ok_or("nothing is heard")?;
        let level = 20.0 * heard.gain.log10();
        println!(
            "door open by {percent:>3} %: {level:6.1} dB, {:.2} m, from {:.2}",
            heard.length, heard.direction
        );
        levels.push(level);
    }
    assert!(levels.is_sorted(), "a door that opens makes it louder");
    assert!(levels[levels.len() - 1] > levels[0] + 10.0);
    Ok(())
}

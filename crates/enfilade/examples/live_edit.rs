//! Changes a building while it is in use: `cargo run --release -p enfilade --example live_edit`.
//!
//! A thread bakes what changed; the program goes on with the old world until the new one is there.

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread;

use enfilade::bake::rebake::rebake;
use enfilade::bake::{BakeConfig, BakeContext, Silent, bake};
use enfilade_testkit::{Edit, Rng, TowerParams, edited, office_tower};

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let scene = office_tower(&TowerParams::with_rooms(16, 1)).scene;
    let config = BakeConfig::default();
    let world = Arc::new(bake(&scene, &config, &BakeContext::default())?.world);

    // Somebody cuts a door.
    let (scene, _) = edited(&scene, Edit::DoorCut, &mut Rng::new(1)).ok_or("no wall")?;
    // Set it to stop the thread, for instance because there is another change.
    let cancel = Arc::new(AtomicBool::new(false));
    let (old, stop) = (Arc::clone(&world), Arc::clone(&cancel));
    let job = thread::spawn(move || {
        let context = BakeContext::new(&Silent, Some(stop));
        rebake(&old, &scene, &BakeConfig::default(), &context)
    });
    println!("{} cells, in use", world.graph.cells.len());

    // A game would look at `job.is_finished()` once a frame.
    let rebaked = job.join().map_err(|_| "the thread panicked")??;
    let graph = &rebaked.world.graph;
    for &cell in &rebaked.changed {
        println!(
            "{}: {} portals",
            graph[cell].name,
            graph[cell].portals.len()
        );
    }
    // All others are what they were, under the same numbers unless cells are gone.
    let kept = rebaked.cell_of.iter().flatten();
    println!("{} of {} cells kept", kept.count(), rebaked.cell_of.len());
    Ok(())
}

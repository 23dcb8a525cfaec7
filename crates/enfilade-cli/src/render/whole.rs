//! Worlds that are loaded whole, and their light.

use std::io::Write;
use std::path::Path;

use anyhow::Context;
use enfilade::cpg::World;
use enfilade::world::PartId;
use enfilade_render::{AdapterChoice, Studio, lamp_lights};

use crate::screen::Warned;
use enfilade_cli::input::name_of;
use enfilade_cli::world::read_world;

/// Reads a world and loads it on an adapter.
pub(crate) fn open(path: &Path, adapter: &AdapterChoice) -> anyhow::Result<(World, Studio)> {
    let world = read_world(path)?;
    let studio = Studio::new(enfilade_cli::adapter::open(adapter)?, &world)
        .with_context(|| name_of(path))?;
    tell_of_pictures(&studio)?;
    Ok((world, studio))
}

/// Warns about texture pictures that are not drawn.
pub(crate) fn tell_of_pictures(studio: &Studio) -> anyhow::Result<()> {
    for (n, why) in [
        (studio.world.n_missing_pictures(), "missing or damaged"),
        (
            studio.world.n_large_pictures(),
            "larger than 8192x8192, or in total than 512 MiB and 128 times their files",
        ),
    ] {
        if n > 0 {
            writeln!(
                Warned,
                "enfilade: {n} texture pictures are {why}; drawn without them"
            )?;
        }
    }
    Ok(())
}

/// Computes the light of each place; if the adapter cannot hold it, warns, and all places are lit alike.
pub(crate) fn light(studio: &mut Studio, world: &World) -> anyhow::Result<()> {
    if let Err(error) = studio.add_light(world) {
        writeln!(Warned, "enfilade: all rooms are lit alike: {error}")?;
    }
    Ok(())
}

/// Lights the lamps of a world; if the adapter cannot hold their maps, warns, and they stay dark.
pub(crate) fn light_lamps(studio: &mut Studio, world: &World) -> anyhow::Result<()> {
    let lamps = lamp_lights(world, PartId::ROOT);
    if let Err(error) = studio.set_lamps(lamps) {
        writeln!(Warned, "enfilade: the lamps stay dark: {error}")?;
    }
    Ok(())
}

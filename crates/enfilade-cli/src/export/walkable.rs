//! `enfilade export --walkable`: the floors as a mesh.

use std::fmt::Write;

use anyhow::bail;
use enfilade::cpg::World;
use enfilade::world::{Agent, PartId, Space, WalkMap};

/// Returns the floors of a default walker as OBJ, a group for each cell.
pub(super) fn obj(world: &World) -> anyhow::Result<String> {
    let space = Space::new(world.clone())?;
    let patches = WalkMap::new(&space, Agent::default()).patches(PartId::ROOT);
    if patches.is_empty() {
        bail!(
            "nobody can stand anywhere in this world: no floor has room for a person of {} m",
            Agent::default().height
        );
    }
    let mut out =
        String::from("# where the middle of a person may stand; meters, +Y up, right-handed\n");
    for own in patches.chunk_by(|a, b| a.cell == b.cell) {
        // Blanks part the names of groups.
        let name = &world.graph[own[0].cell].name;
        let name = name.replace(|c: char| c.is_whitespace() || c.is_control(), "_");
        let _ = writeln!(out, "g {name}");
        for patch in own {
            let (low, high) = (patch.low, patch.high);
            for [x, z] in [
                [low.x, low.z],
                [low.x, high.z],
                [high.x, high.z],
                [high.x, low.z],
            ] {
                let _ = writeln!(out, "v {x:.4} {:.4} {z:.4}", low.y);
            }
            out += "f -4 -3 -2 -1\n";
        }
    }
    Ok(out)
}

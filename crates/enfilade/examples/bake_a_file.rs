//! Bakes a scene into a world: `cargo run --release -p enfilade --example bake_a_file [SCENE [WORLD.glb]]`.
//!
//! Without a scene, bakes a furnished house from the test kit.

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::path::PathBuf;

use enfilade::bake::{BakeConfig, BakeContext, bake};
use enfilade::import::{ImportOptions, export_glb, import};

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::temp_dir();
    let mut args = std::env::args_os().skip(1).map(PathBuf::from);
    let given = args.next().filter(|p| p.is_file());
    let world_path = given
        .as_ref()
        .and_then(|_| args.next())
        .unwrap_or_else(|| folder.join("enfilade-example-world.glb"));
    let scene_path = match given {
        Some(path) => path,
        None => {
            let path = folder.join("enfilade-example-house.glb");
            std::fs::write(
                &path,
                export_glb(&enfilade_testkit::furnished_house().scene),
            )?;
            path
        }
    };

    // The options convert to meters and +Y up; roles (wall or furniture) are found automatically.
    let imported = import(&[scene_path], &[], &ImportOptions::default())?;
    let output = bake(
        &imported.scene,
        &BakeConfig::default(),
        &BakeContext::default(),
    )?;
    for note in &output.notes {
        println!("note: {note}");
    }
    enfilade::save(&world_path, &output.world)?;

    let world = enfilade::open(&world_path)?;
    println!("{}:", world_path.display());
    for (id, cell) in world.graph.indoor_cells() {
        let to = world.graph.exits(id).map(|e| &world.graph[e.to].name[..]);
        let to: Vec<&str> = to.collect();
        println!(
            "{}: {:.1} m³, opens to {}",
            cell.name,
            cell.volume,
            to.join(", ")
        );
    }
    Ok(())
}

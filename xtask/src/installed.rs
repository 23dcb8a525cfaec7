//! The library as who adds it to a program gets it: from the packages, in an empty folder, with the program of the README.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, ensure};

use crate::{cargo, output_of, root, run_to_end, target_dir};

/// Words that the program of the README prints in the world of the demo.
const SAYS: &str = "a leaf of portal-";

/// Unpacks all packages, which `cargo package` left in the folder of builds, and runs the README's program with them on a world.
pub(crate) fn run(world: &Path) -> anyhow::Result<()> {
    let dir = target_dir().join("installed");
    let crates = dir.join("crates");
    for old in [&crates, &dir.join("src")] {
        // Files of an earlier version.
        let _ = std::fs::remove_dir_all(old);
    }
    std::fs::create_dir_all(&crates)?;
    std::fs::create_dir_all(dir.join("src"))?;
    let version = env!("CARGO_PKG_VERSION");
    let mut manifest = format!(
        "[package]\nname = \"newcomer\"\nedition = \"2024\"\n[workspace]\n[dependencies]\nenfilade = \"{version}\"\n\
         [profile.dev]\ndebug = false\n[patch.crates-io]\n"
    );
    for entry in std::fs::read_dir(target_dir().join("package"))? {
        let path = entry?.path();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let Some(name) = stem.strip_suffix(&format!("-{version}")) else {
            continue;
        };
        let mut unpack = Command::new("tar");
        run_to_end(unpack.arg("-xzf").arg(&path).arg("-C").arg(&crates))?;
        writeln!(manifest, "{name} = {{ path = \"crates/{stem}\" }}")?;
    }
    std::fs::write(dir.join("Cargo.toml"), manifest)?;
    std::fs::copy(root().join("Cargo.lock"), dir.join("Cargo.lock"))?;
    let readme = std::fs::read_to_string(root().join("README.md"))?;
    let program = readme.split_once("```rust,no_run\n");
    let program = program.and_then(|(_, rest)| rest.split_once("```"));
    let (program, _) = program.context("README.md has no program")?;
    std::fs::write(dir.join("src/main.rs"), program)?;
    std::fs::copy(world, dir.join("world.glb"))?;
    let mut run = cargo(&["run", "--quiet"]);
    run.current_dir(&dir)
        .env("CARGO_TARGET_DIR", dir.join("target"));
    let said = output_of(&mut run)?;
    ensure!(said.contains(SAYS), "it printed no '{SAYS}':\n{said}");
    Ok(())
}

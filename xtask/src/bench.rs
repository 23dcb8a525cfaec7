//! `cargo xtask bench`: how time and memory of a bake grow with the building.

use std::fmt::Write as _;
use std::process::Command;
use std::time::Instant;

use anyhow::Context;
use serde_json::Value;

use crate::{bake_command, binary, cargo, output_of, root, run_to_end, target_dir};

const SIZES: [usize; 4] = [16, 64, 256, 1024];

pub(crate) fn run(args: &[String]) -> anyhow::Result<()> {
    let write = args.iter().any(|a| a == "--write");
    run_to_end(&mut cargo(&["build", "--release", "-p", "enfilade-cli"]))?;
    let example = [
        "build",
        "--release",
        "-p",
        "enfilade-testkit",
        "--example",
        "generate",
    ];
    run_to_end(&mut cargo(&example))?;
    let mut out = String::from(
        "| rooms | triangles | voxels | occupied | seconds | exponent | peak MB | bytes a voxel |\n\
         | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    let mut before: Option<(f64, f64)> = None;
    let mut stages = String::new();
    for rooms in SIZES {
        let dir = target_dir().join(format!("tower-{rooms}"));
        let mut generate = Command::new(target_dir().join("release/examples/generate"));
        output_of(
            generate
                .args(["tower", "--rooms", &rooms.to_string(), "-o"])
                .arg(&dir),
            None,
        )?;
        let world = dir.join("world.glb");
        let start = Instant::now();
        let (said, peak) = with_peak(bake_command(&dir, &world).arg("-v"))?;
        let seconds = start.elapsed().as_secs_f64();
        let graph: Value = serde_json::from_str(&output_of(
            Command::new(binary("enfilade"))
                .arg("inspect")
                .arg(&world)
                .arg("--json"),
            None,
        )?)?;
        let count = |name: &str| graph["stats"]["counts"][name].as_f64().unwrap_or(f64::NAN);
        let (voxels, occupied) = (count("voxels"), count("occupied_voxels"));
        let exponent = before.map_or_else(
            || "–".to_owned(),
            |(s, o)| format!("{:.2}", (seconds / s).ln() / (occupied / o).ln()),
        );
        before = Some((seconds, occupied));
        let _ = writeln!(
            out,
            "| {rooms} | {} | {voxels} | {occupied} | {seconds:.1} | {exponent} | {:.0} | {:.2} |",
            count("input_triangles"),
            peak / 1e6,
            peak / voxels
        );
        let lines: Vec<&str> = said
            .lines()
            .filter(|l| l.ends_with(" s"))
            .map(str::trim)
            .collect();
        let _ = writeln!(stages, "- {rooms} rooms: {}", lines.join(", "));
    }
    println!("{out}\n{stages}");
    if write {
        let path = root().join("docs/benchmarks/growth.md");
        let text = format!(
            "# Growth of a bake\n\nOffice towers of the test kit, whole `bake`, default settings, two \
             cores. Made by `cargo xtask bench --write`.\n\n{out}\nThe exponent is that of wall time in \
             occupied voxels, from the row above. Stage times:\n\n{stages}"
        );
        std::fs::write(&path, text).with_context(|| path.display().to_string())?;
    }
    Ok(())
}

/// Runs under `time -v`, and gives standard error and the peak of resident memory in bytes.
fn with_peak(command: &mut Command) -> anyhow::Result<(String, f64)> {
    let mut timed = Command::new("/usr/bin/time");
    timed
        .arg("-v")
        .arg(command.get_program())
        .args(command.get_args());
    let done = timed
        .output()
        .context("needs GNU time as /usr/bin/time (`apt-get install time`)")?;
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    let peak = said
        .lines()
        .find_map(|l| {
            l.trim()
                .strip_prefix("Maximum resident set size (kbytes): ")
        })
        .and_then(|n| n.parse::<f64>().ok())
        .context("time printed no peak")?;
    Ok((said, peak * 1024.0))
}

//! Growth of time and memory of a bake with the building, and the voxel kernels beside other implementations.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, bail};
use serde_json::Value;

use crate::process::{bake_command, binary, output_of, root, target_dir, write_between_marks};
use crate::rooms::score::inspect;
use crate::table::Table;

/// Rooms of the towers, a factor of 4 apart.
const SIZES: [usize; 4] = [16, 64, 256, 1024];

/// Prints the table of growth, and writes it to `docs/benchmarks/growth.md` if `is_written`. With `peers`, the folder
/// of the scripts that generate the kernels' inputs, also prints the kernels' table.
pub(crate) fn bench_growth(
    table: &mut Table,
    peers: Option<&Path>,
    is_written: bool,
) -> anyhow::Result<()> {
    if let Some(peers) = peers {
        kernels(peers)?;
    }
    let text = growth()?;
    table.push_text(&text);
    if is_written {
        write_between_marks("growth.md", &text)?;
    }
    Ok(())
}

fn kernels(peers: &Path) -> anyhow::Result<()> {
    let data = target_dir().join("kernel-bench");
    std::fs::create_dir_all(&data)?;
    let mut python = Command::new("python3");
    python
        .arg(root().join("scripts/bench_kernels.py"))
        .arg("--bench")
        .arg(binary("examples/kernel_bench"))
        .arg("--data")
        .arg(data)
        .arg("--peers")
        .arg(peers);
    let status = python.status().context("cannot start python3")?;
    anyhow::ensure!(status.success(), "{python:?} failed: {status}");
    Ok(())
}

/// Returns the tables of growth and of the stages' times.
fn growth() -> anyhow::Result<String> {
    let mut table = String::from(
        "| rooms | cells | triangles | M voxels | M occupied | wall s | user s | exponent | peak MiB | bytes a voxel |\n\
         | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    let mut stages: Vec<(String, Vec<String>)> = Vec::new();
    let mut before: Option<(f64, f64)> = None;
    let mut sizes = Vec::new();
    for rooms in SIZES {
        let row = bake_tower(rooms)?;
        let exponent = before.map_or_else(
            || "–".to_owned(),
            |(seconds, occupied)| {
                format!(
                    "{:.2}",
                    (row.used.user / seconds).ln() / (row.occupied / occupied).ln()
                )
            },
        );
        sizes.push(row.n_rooms.to_string());
        before = Some((row.used.user, row.occupied));
        let _ = writeln!(
            table,
            "| {} | {} | {} | {:.1} | {:.2} | {:.1} | {:.1} | {exponent} | {:.0} | {:.2} |",
            row.n_rooms,
            row.n_cells,
            row.triangles,
            row.voxels / 1e6,
            row.occupied / 1e6,
            row.used.wall,
            row.used.user,
            row.used.peak / f64::from(1 << 20),
            row.used.peak / row.voxels
        );
        for (i, (name, seconds)) in row.stages.into_iter().enumerate() {
            if stages.len() <= i {
                stages.push((name, Vec::new()));
            }
            stages[i].1.push(seconds);
        }
    }
    let mut stage_table = format!(
        "| stage, s | {} |\n| --- | ---: | ---: | ---: | ---: |\n",
        sizes.join(" | ")
    );
    for (name, seconds) in stages {
        let _ = writeln!(stage_table, "| {name} | {} |", seconds.join(" | "));
    }
    Ok(format!("{table}\n{stage_table}"))
}

/// The bake of a tower.
pub(crate) struct Tower {
    /// From the generator's truth; it makes whole storeys.
    pub(crate) n_rooms: usize,
    /// Cells indoors.
    n_cells: usize,
    triangles: f64,
    voxels: f64,
    pub(crate) occupied: f64,
    pub(crate) used: Used,
    /// Name and seconds, in order.
    stages: Vec<(String, String)>,
}

pub(crate) fn bake_tower(rooms: usize) -> anyhow::Result<Tower> {
    let dir = target_dir().join(format!("tower-{rooms}"));
    let mut generate = Command::new(binary("examples/generate"));
    output_of(
        generate
            .args(["tower", "--rooms", &rooms.to_string(), "-o"])
            .arg(&dir),
        None,
    )?;
    let truth: Value = serde_json::from_str(&std::fs::read_to_string(dir.join("truth.json"))?)?;
    let world = dir.join("world.glb");
    let used = used_by(bake_command(&dir, &world).arg("-v"))?;
    let graph = inspect(&world)?;
    let count = |name: &str| {
        graph["stats"]["counts"][name]
            .as_f64()
            .with_context(|| format!("inspect gives no count of {name}"))
    };
    Ok(Tower {
        n_rooms: truth["rooms"].as_array().map_or(0, Vec::len),
        n_cells: graph["cells"].as_array().map_or(0, |cells| {
            cells.iter().filter(|c| c["outdoor"] != true).count()
        }),
        triangles: graph["stats"]["input_triangles"]
            .as_f64()
            .map_or_else(|| count("input_triangles"), Ok)?,
        voxels: count("voxels")?,
        occupied: count("occupied_voxels")?,
        stages: stage_times(&used.said),
        used,
    })
}

/// Returns name and seconds of the lines `NAME  1.23 s  4.5 M of work` of `bake -v`.
fn stage_times(said: &str) -> Vec<(String, String)> {
    said.lines()
        .filter_map(|line| {
            let (time, _) = line.strip_suffix(" of work")?.split_once(" s ")?;
            let (name, seconds) = time.trim().rsplit_once(' ')?;
            seconds.parse::<f64>().ok()?;
            Some((name.trim().to_owned(), seconds.to_owned()))
        })
        .collect()
}

/// Resources used by a command.
pub(crate) struct Used {
    /// Standard error.
    said: String,
    /// Wall time. [Units: s]
    pub(crate) wall: f64,
    /// User time of all threads. [Units: s]
    pub(crate) user: f64,
    /// Largest resident memory. [Units: bytes]
    pub(crate) peak: f64,
}

/// Runs a command under GNU time.
pub(crate) fn used_by(command: &Command) -> anyhow::Result<Used> {
    let mut timed = Command::new("/usr/bin/time");
    timed
        .arg("-v")
        .arg(command.get_program())
        .args(command.get_args());
    let start = Instant::now();
    let done = timed
        .output()
        .context("needs GNU time as /usr/bin/time (`apt-get install time`)")?;
    let wall = start.elapsed().as_secs_f64();
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    if !done.status.success() {
        bail!("{command:?}: {}\n{said}", done.status);
    }
    let figure = |name: &str| {
        said.lines()
            .find_map(|l| l.trim().strip_prefix(name)?.parse::<f64>().ok())
            .with_context(|| format!("time printed no line '{name}'"))
    };
    Ok(Used {
        wall,
        user: figure("User time (seconds): ")?,
        peak: figure("Maximum resident set size (kbytes): ")? * 1024.0,
        said,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stage_times_are_told_from_other_lines() {
        let said = "read a.glb: 12 triangles\n  fit screens     0.25 s     1.2 M of work\n\
                    flood  1.50 s  3 of work\n about s\nannounced 2 s of work\n";
        let pair = |a: &str, b: &str| (a.to_owned(), b.to_owned());
        assert_eq!(
            stage_times(said),
            [pair("fit screens", "0.25"), pair("flood", "1.50")]
        );
    }
}

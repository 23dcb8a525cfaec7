//! Budgets and outputs: files with huge demands, small scenes that are hard, large ones.

use super::figures::{Figures, Ran, holds};
use super::nasty::{cuboid, obj, scenes};

/// Files of a few bytes that would need gigabytes, and outputs that would be lost.
pub(super) fn cases(rows: &mut Figures<'_>) -> anyhow::Result<()> {
    for n in [100_000, 1_048_576] {
        rows.write("clusters.prt", &format!("PRT1\n{n}\n0\n"))?;
        let ran = rows.enfilade(&["pvs", "clusters.prt", "-o", "clusters.pvs"], 60)?;
        let scene = format!("{n} clusters");
        rows.is("case prt", &scene, ran.code == Some(0));
        rows.at_most("case prt s", &scene, ran.seconds, 2.0, "");
        rows.at_most("case prt GiB", &scene, ran.gigabytes, 0.5, "");
    }
    rows.write("room.obj", &obj(&cuboid([0.0; 3], [4.0, 3.0, 5.0])))?;
    for (row, args) in [
        ("case --voxel 0.00001", ["--voxel", "0.00001"]),
        ("case --max-memory 64K", ["--max-memory", "64K"]),
        ("case --max-time 0", ["--max-time", "0"]),
    ] {
        rows.write("room.glb", "old")?;
        let args = [&["bake", "room.obj", "-o", "room.glb"][..], &args].concat();
        let ran = rows.enfilade(&args, 60)?;
        let is_kept = holds(&rows.path("room.glb"), b"old");
        let is_told = ran.said.contains("--max-") || ran.said.contains("--voxel");
        let ok = is_told && (ran.code == Some(0) && !is_kept || ran.code == Some(1) && is_kept);
        rows.is(row, "room", ok);
        rows.at_most(&format!("{row} s"), "room", ran.seconds, 20.0, "");
        rows.at_most(&format!("{row} GiB"), "room", ran.gigabytes, 1.0, "");
    }
    Ok(())
}

/// Small scenes of unusual shapes, with each method: baked, or rejected with a remedy, in bounded time and memory.
pub(super) fn nasty(rows: &mut Figures<'_>) -> anyhow::Result<()> {
    for (scene, text) in scenes() {
        rows.write("nasty.obj", &text)?;
        for method in ["watershed", "bsp", "delaunay"] {
            let args = ["bake", "nasty.obj", "--method", method, "-o", "nasty.glb"];
            let ran = rows.enfilade(&args, 120)?;
            let scene = format!("{scene} {method}");
            let is_refused = ran.code == Some(1) && ran.said.contains("--");
            rows.is("nasty ends", &scene, ran.code == Some(0) || is_refused);
            rows.at_most("nasty s", &scene, ran.seconds, 20.0, "");
            rows.at_most("nasty GiB", &scene, ran.gigabytes, 1.0, "");
        }
    }
    Ok(())
}

/// Large scenes, if available.
pub(super) fn large(rows: &mut Figures<'_>) -> anyhow::Result<()> {
    for (name, file, most) in [
        ("recast-dungeon", "recast-dungeon/scene.glb", 15.0),
        ("monastery", "samurai_monastry.obj", 30.0),
    ] {
        let dirs = crate::process::scenes();
        let folders = dirs.iter().filter_map(|dir| dir.parent());
        let found = folders.map(|dir| dir.join(file)).find(|path| path.exists());
        let bar = format!("<= {most}");
        let Some(path) = found else {
            rows.print("large s", name, None, &bar, None, "");
            continue;
        };
        let path = path.canonicalize()?;
        let path = path.to_string_lossy();
        let ran = rows.enfilade(&["bake", &path, "-o", "large.glb"], 600)?;
        rows.is("large ends", name, ran.code == Some(0));
        rows.at_most("large s", name, ran.seconds, most, "");
    }
    Ok(())
}

/// Seconds and memory allowed for each command on each nasty scene, and the most that it may use of them by its
/// promise.
const TIME: f64 = 4.0;
const MOST_TIME: f64 = 1.5 * TIME + 1.0;
const MEMORY: &str = "300M";
const MOST_MEMORY: f64 = 1.2 * 300.0 / 1024.0 + 100e6 / (1u64 << 30) as f64;

/// Nasty scenes in commands that build worlds, within time and memory limits: built, or rejected with a remedy.
pub(super) fn bounds(rows: &mut Figures<'_>) -> anyhow::Result<()> {
    let methods = ["watershed", "bsp", "delaunay"];
    for (scene, text) in scenes() {
        rows.write("nasty.obj", &text)?;
        for method in methods {
            let bake = ["bake", "nasty.obj", "--method", method, "-o", "nasty.glb"];
            bound(rows, &format!("{scene} {method}"), &bake)?;
        }
        bound(
            rows,
            &format!("{scene} decimate"),
            &["decimate", "nasty.obj"],
        )?;
    }
    Ok(())
}

fn bound(rows: &mut Figures<'_>, name: &str, args: &[&str]) -> anyhow::Result<()> {
    let ends = |ran: &Ran| matches!(ran.code, Some(0 | 1));
    let time = TIME.to_string();
    let ran = rows.enfilade(&[args, &["--max-time", &time]].concat(), 120)?;
    rows.is("bound time ends", name, ends(&ran));
    rows.at_most("bound time s", name, ran.seconds, MOST_TIME, "");
    let ran = rows.enfilade(&[args, &["--max-memory", MEMORY]].concat(), 120)?;
    rows.is("bound memory ends", name, ends(&ran));
    rows.at_most("bound memory GiB", name, ran.gigabytes, MOST_MEMORY, "");
    Ok(())
}

/// Estimates of a bake compared with its use, and the time per unit of work of its stages.
pub(super) fn estimates(rows: &mut Figures<'_>) -> anyhow::Result<()> {
    let dirs = crate::process::scenes();
    let files = dirs.iter().map(|dir| dir.join("scene.glb"));
    for path in files.filter(|path| path.exists()) {
        let path = path.canonicalize()?;
        let scene = path.parent().and_then(|dir| dir.file_name());
        let scene = scene.unwrap_or_default().to_string_lossy().into_owned();
        let path = path.to_string_lossy();
        for method in ["watershed", "bsp", "delaunay"] {
            let args = [
                "bake",
                &path,
                "--method",
                method,
                "-v",
                "-o",
                "estimate.glb",
            ];
            let ran = rows.enfilade(&args, 600)?;
            let scene = format!("{scene} {method}");
            // The last of several.
            let said = ran.said.lines().rev().find_map(|line| {
                let (_, rest) = line.split_once("about ")?;
                rest.split_once(" MB")?.0.parse::<f64>().ok()
            });
            let ratio = said.map(|mb| mb * 1e6 / (ran.gigabytes * (1u64 << 30) as f64));
            let ok = ratio.map(|r| (0.5..=2.0).contains(&r));
            rows.print("estimate / peak", &scene, ratio, "0.5 to 2", ok, "");
            if let Some(worst) = dearest_unit(&ran.said) {
                rows.at_most("charge ns a unit", &scene, worst, 1000.0, "");
            }
        }
    }
    Ok(())
}

/// Returns the longest time per unit of work among stages that took a while, from `bake -v`. [Units: ns]
fn dearest_unit(said: &str) -> Option<f64> {
    let of_line = |line: &str| {
        let words: Vec<&str> = line
            .strip_suffix(" M of work")?
            .split_whitespace()
            .collect();
        let [.., seconds, "s", work] = words[..] else {
            return None;
        };
        let (seconds, work) = (seconds.parse::<f64>().ok()?, work.parse::<f64>().ok()?);
        (seconds > 0.2).then(|| 1e3 * seconds / work.max(1e-9))
    };
    said.lines().filter_map(of_line).max_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_dearest_unit_is_of_the_stages_that_took_a_while() {
        let said = "  structure 0.100 s 0.0 M of work\n  merge basins 2.000 s 40.0 M of work\n  tree 1.0 s 4.0 M of work\n";
        assert_eq!(dearest_unit(said), Some(250.0));
        assert_eq!(dearest_unit("wrote a world"), None);
    }
}

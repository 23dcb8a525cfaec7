//! Budgets and outputs: files that ask for much, small scenes that are hard, large ones.

use std::f64::consts::PI;
use std::fmt::Write as _;

use super::random::Random;
use super::{Figures, holds};

/// Files of a few bytes that would take gigabytes, and outputs that would be lost.
pub(super) fn cases(rows: &mut Figures) -> anyhow::Result<()> {
    for n in [100_000, 1_048_576] {
        rows.write("clusters.prt", &format!("PRT1\n{n}\n0\n"))?;
        let ran = rows.enfilade(&["pvs", "clusters.prt", "-o", "clusters.pvs"], 60)?;
        let scene = format!("{n} clusters");
        rows.is("case prt", &scene, ran.code == Some(0));
        rows.at_most("case prt s", &scene, ran.seconds, 2.0);
        rows.at_most("case prt GiB", &scene, ran.gigabytes, 0.5);
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
        rows.at_most(&format!("{row} s"), "room", ran.seconds, 20.0);
        rows.at_most(&format!("{row} GiB"), "room", ran.gigabytes, 1.0);
    }
    Ok(())
}

/// Small scenes of shapes that no building has, by each method: done or refused with a way out, in bounded time and memory.
pub(super) fn nasty(rows: &mut Figures) -> anyhow::Result<()> {
    for (scene, text) in scenes() {
        rows.write("nasty.obj", &text)?;
        for method in ["watershed", "bsp", "delaunay"] {
            let args = ["bake", "nasty.obj", "--method", method, "-o", "nasty.glb"];
            let ran = rows.enfilade(&args, 120)?;
            let scene = format!("{scene} {method}");
            let is_refused = ran.code == Some(1) && ran.said.contains("--");
            rows.is("nasty ends", &scene, ran.code == Some(0) || is_refused);
            rows.at_most("nasty s", &scene, ran.seconds, 20.0);
            rows.at_most("nasty GiB", &scene, ran.gigabytes, 1.0);
        }
    }
    Ok(())
}

/// Large scenes, where they are at hand.
pub(super) fn large(rows: &mut Figures) -> anyhow::Result<()> {
    for (name, file, most) in [
        ("recast-dungeon", "recast-dungeon/scene.glb", 15.0),
        ("monastery", "samurai_monastry.obj", 30.0),
    ] {
        let dirs = crate::scenes();
        let folders = dirs.iter().filter_map(|dir| dir.parent());
        let found = folders.map(|dir| dir.join(file)).find(|path| path.exists());
        let bar = format!("<= {most}");
        let Some(path) = found else {
            rows.print("large s", name, None, &bar, None);
            continue;
        };
        let path = path.canonicalize()?;
        let path = path.to_string_lossy();
        let ran = rows.enfilade(&["bake", &path, "-o", "large.glb"], 600)?;
        rows.is("large ends", name, ran.code == Some(0));
        rows.at_most("large s", name, ran.seconds, most);
    }
    Ok(())
}

pub(super) type Triangle = [[f64; 3]; 3];

/// Scenes of at most 2,000 triangles, but for one with copies.
pub(super) fn scenes() -> Vec<(&'static str, String)> {
    let mut random = Random(7);
    let mut all = Vec::new();
    for (name, n) in [
        ("random 100", 100),
        ("random 400", 400),
        ("random 800", 800),
        ("random 2000", 2000),
    ] {
        let triangles: Vec<Triangle> = (0..n).map(|_| [0; 3].map(|_| random.point(10.0))).collect();
        all.push((name, obj(&triangles)));
    }
    let confetti: Vec<Triangle> = (0..2000)
        .map(|_| {
            let at = random.point(10.0);
            [0; 3].map(|_| {
                let by = random.point(1.0);
                [0, 1, 2].map(|k| at[k] + by[k] - 0.5)
            })
        })
        .collect();
    all.push(("confetti 2000", obj(&confetti)));
    let fan = (0..1000).flat_map(|i| {
        let (s, c) = (PI * f64::from(i) / 1000.0).sin_cos();
        let (x, z) = (5.0 * c, 5.0 * s);
        quad([[-x, 0.0, -z], [x, 0.0, z], [x, 3.0, z], [-x, 3.0, -z]])
    });
    all.push(("fan 2000", obj(&fan.collect::<Vec<_>>())));
    let sheets = (0..1000).flat_map(|i| {
        let (y, lift) = (f64::from(i) * 0.01, random.next() * 0.1 - 0.05);
        quad([
            [0.0, y, 0.0],
            [10.0, y + lift, 0.0],
            [10.0, y, 10.0],
            [0.0, y, 10.0],
        ])
    });
    all.push(("sheets 2000", obj(&sheets.collect::<Vec<_>>())));
    let slivers: Vec<Triangle> = (0..2000)
        .map(|_| {
            let (a, b) = (10.0 * random.next(), 10.0 * random.next());
            [random.point(10.0), [a, 0.0, 0.0], [b, 0.001, 0.001]]
        })
        .collect();
    all.push(("slivers 2000", obj(&slivers)));
    let mut far = cuboid([0.0; 3], [4.0, 3.0, 5.0]);
    far.extend(cuboid([1000.0, 0.0, 1000.0], [1004.0, 3.0, 1005.0]));
    all.push(("rooms in a kilometer", obj(&far)));
    let mut wide = cuboid([0.0; 3], [1000.0, 3.0, 1000.0]);
    wide.extend(cuboid([0.0; 3], [4.0, 3.0, 5.0]));
    all.push(("hall of a kilometer", obj(&wide)));
    let copies = quad([
        [0.0, 0.0, 0.0],
        [4.0, 0.3, 0.0],
        [4.0, 2.3, 4.0],
        [0.0, 2.0, 4.0],
    ]);
    all.push(("20,000 copies of a quad", obj(&copies.repeat(20_000))));
    all
}

fn quad([a, b, c, d]: [[f64; 3]; 4]) -> [Triangle; 2] {
    [[a, b, c], [a, c, d]]
}

pub(super) fn cuboid(low: [f64; 3], high: [f64; 3]) -> Vec<Triangle> {
    let corner = |c: usize| [0, 1, 2].map(|k| if c >> k & 1 == 1 { high[k] } else { low[k] });
    let faces = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    faces.iter().flat_map(|f| quad(f.map(corner))).collect()
}

pub(super) fn obj(triangles: &[Triangle]) -> String {
    let mut text = String::new();
    for triangle in triangles {
        for [x, y, z] in triangle {
            let _ = writeln!(text, "v {x} {y} {z}");
        }
        text.push_str("f -3 -2 -1\n");
    }
    text
}

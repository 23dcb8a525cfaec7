//! Budgets of all commands but `bake`: nasty input, with limits on time and memory.

use flate2::Compression;

use super::figures::{Figures, Ran};
use super::formats::png;
use super::nasty::{Triangle, cuboid, obj, scenes};

/// Limits given to each command. [Units: s, MiB]
const TIME: f64 = 4.0;
const MEMORY: f64 = 300.0;
/// Promised bounds: 1.5 times the time plus a second; 1.2 times the memory plus 100 MB. [Units: s, GiB]
const MOST_TIME: f64 = 1.5 * TIME + 1.0;
const MOST_MEMORY: f64 = (1.2 * MEMORY + 100.0) / 1024.0;

/// Commands on a world, `w.glb`.
const COMMANDS: [&str; 16] = [
    "inspect w.glb",
    "inspect w.glb --objects 0",
    "locate w.glb --object a*b*c*d*",
    "path w.glb --from 1,1,1 --to 9,1,9",
    "path w.glb --from 1,1,1 --to 9,1,9 --radius 1e-9",
    "plan w.glb -o out.svg",
    "plan w.glb -o out.pdf",
    "pvs w.glb -o out.pvs",
    "see w.glb --eye 1,1.5,1 --look 9,1.5,9",
    "simplify w.glb -o out.glb --max-cells 2",
    "simplify w.glb -o out.glb --max-cost 40 --split-outdoors",
    "sound w.glb --listener 1,1,1;2000,1,1 --source 2,1,2 -o out.wav",
    "report w.glb -o out.html",
    "render w.glb -o out.png --size 4096x4096 --eye 1,1.5,1 --look 9,1.5,9 --adapter software",
    "verify w.glb --views 2 --adapter software",
    "verify w.glb --source w.obj",
];

/// Arguments that demand far too much of a small world; each is rejected at once.
const REFUSED: [&str; 6] = [
    "sound w.glb --listener 1,1,1;1e6,1,1 --source 2,1,2",
    "sound w.glb --listener 1,1,1;1e30,1,1 --source 2,1,2 -o out.wav",
    "sound w.glb --listener 1,1,1;1e38,1,1 --source 2,1,2 -o out.wav",
    "report w.glb -o out.html --views 99999999",
    "render w.glb -o out.png --walk 99999999",
    "render w.glb -o out.png --size 16384x16384 --eye 1,1.5,1 --look 2,1.5,2 --adapter software",
];

pub(super) fn run(rows: &mut Figures<'_>) -> anyhow::Result<()> {
    for (scene, text, more) in inputs() {
        rows.write("w.obj", &text)?;
        for (name, bytes) in more {
            std::fs::write(rows.path(name), bytes)?;
        }
        let bake = "bake w.obj -o w.glb --max-time 60 --allow-empty --up y --unit m";
        let bake: Vec<&str> = bake.split(' ').collect();
        if rows.enfilade(&bake, 200)?.code != Some(0) {
            // There is no world to query.
            rows.print("commands", &scene, None, "a world", None, "");
            continue;
        }
        for line in COMMANDS {
            let ran = bounded(rows, line)?;
            // Limits and rejections are reported; broken promises of `verify` and paths that do not exist are answers.
            let ok = matches!(ran.code, Some(0 | 1)) && !ran.said.contains("panicked");
            let case = format!("{scene}: {line}");
            rows.is("commands ends", &case, ok);
            rows.at_most("commands s", &case, ran.seconds, MOST_TIME, "");
            rows.at_most("commands GiB", &case, ran.gigabytes, MOST_MEMORY, "");
        }
    }
    rows.write("w.obj", &obj(&rooms()))?;
    rows.enfilade(&["bake", "w.obj", "-o", "w.glb"], 200)?;
    for line in REFUSED {
        let ran = rows.enfilade(&line.split(' ').collect::<Vec<_>>(), 60)?;
        rows.is("commands refused", line, matches!(ran.code, Some(1 | 2)));
        rows.at_most("commands refused s", line, ran.seconds, 2.0, "");
        rows.at_most("commands refused GiB", line, ran.gigabytes, 0.5, "");
    }
    Ok(())
}

fn bounded(rows: &Figures<'_>, line: &str) -> anyhow::Result<Ran> {
    let (time, memory) = (TIME.to_string(), format!("{MEMORY}M"));
    let mut args: Vec<&str> = line.split(' ').collect();
    args.extend(["--max-time", &time, "--max-memory", &memory]);
    rows.enfilade(&args, 120)
}

/// A name, the scene as OBJ, and the files to which it refers.
type NastyInput = (String, String, Vec<(&'static str, Vec<u8>)>);

/// Returns the scenes of the bakes, and rooms that are nasty for readers of worlds: long names, large images.
fn inputs() -> Vec<NastyInput> {
    let mut all: Vec<NastyInput> = scenes()
        .into_iter()
        .map(|(name, text)| (name.to_owned(), text, Vec::new()))
        .collect();
    let named = format!("o {}\n{}", "long ".repeat(40_000), obj(&rooms()));
    all.push(("names of 200,000 letters".into(), named, Vec::new()));
    let mut text = "mtllib w.mtl\n".to_owned();
    let mut materials = String::new();
    for i in 0..8 {
        materials += &format!("newmtl m{i}\nmap_Kd bomb.png\n");
        text += &format!("usemtl m{i}\nvt 0 0\n");
        let x = f64::from(i) * 0.5;
        let block = obj(&cuboid([x, 0.0, 1.0], [x + 0.3, 0.3, 1.3]));
        text += &block.replace("f -3 -2 -1", "f -3/1 -2/1 -1/1");
    }
    text += &obj(&rooms());
    let files = vec![
        ("w.mtl", materials.into_bytes()),
        ("bomb.png", black(16_000)),
    ];
    all.push(("pictures of 16,000 squared".into(), text, files));
    all
}

/// Returns a room of 10 m and one beside it, with a doorway between.
fn rooms() -> Vec<Triangle> {
    let mut out = cuboid([0.0; 3], [10.0, 3.0, 10.0]);
    for (low, high) in [
        ([5.0, 0.0, 0.0], [5.2, 3.0, 4.0]),
        ([5.0, 0.0, 5.0], [5.2, 3.0, 10.0]),
        ([5.0, 2.1, 4.0], [5.2, 3.0, 5.0]),
    ] {
        out.extend(cuboid(low, high));
    }
    out
}

/// Returns a black image of this size a side, as PNG of a few hundred kilobytes.
fn black(side: u32) -> Vec<u8> {
    let row = vec![0; 1 + 3 * side as usize];
    let rows = (0..side).map(|_| row.as_slice());
    // Eight bits of red, green and blue.
    png([side; 2], [8, 2], Compression::best(), rows)
}

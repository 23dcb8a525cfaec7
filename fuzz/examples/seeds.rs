//! Writes the seeds that are made by code into `fuzz/corpus`, and copies those of `fuzz/seeds` beside them.

use std::fs;
use std::path::Path;

const PRT: &str = "PRT1\n4\n4\n4 0 1 (64 8 8 ) (64 40 8 ) (64 40 40 ) (64 8 40 )\n\
    4 0 2 (8 64 8 ) (8 64 40 ) (40 64 40 ) (40 64 8 )\n4 1 3 (72 64 8 ) (72 64 40 ) (104 64 40 ) (104 64 8 )\n\
    4 2 3 (64 72 8 ) (64 104 8 ) (64 104 40 ) (64 72 40 )\n";
const SETTINGS: &str = "min_opening = 0.5\nsmallest_hole = 0.01\nunit = \"mm\"\nup = \"z\"\norigin = [1.0, 0, -2]\n\
    max_voxels = 100000\ndetail_names = [\"chair*\"]\nrepair = 0.001\nrepair_holes = 0.1\n[merge]\nthreshold = 0.7\n\
    [bsp]\nheuristic = \"min-cut\"\ngrid = 2.0\nplanes = [[2.0, 0.0, 0.0, 1.0, 0.0, 0.0]]\n\
    boxes = [[0, 0, 0, 1, 1, 1]]\nmax_cost = 100\nmin_cost = 5\nmaterial_costs = { wall = 2.0 }\n";
const CHOICES: &str = "keep = [[4.1, 1.05, 2.5]]\njoin = [[1.0, 1e-7, -2]]\n";
const NAMES: [&str; 8] = [
    "a.bin",
    "sub/a.bin",
    "../a.bin",
    "link.bin",
    "up/a.bin",
    "%2e%2e/a.bin",
    "a.mtl",
    "data:;base64,AAAA",
];

fn main() -> std::io::Result<()> {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR"));
    let corpus = fuzz.join("corpus");
    let write = |target: &str, name: &str, bytes: &[u8]| {
        fs::create_dir_all(corpus.join(target))?;
        fs::write(corpus.join(target).join(name), bytes)
    };
    for target in fs::read_dir(fuzz.join("seeds"))? {
        let target = target?;
        for seed in fs::read_dir(target.path())? {
            let seed = seed?;
            let [to, name] =
                [target.file_name(), seed.file_name()].map(|n| n.to_string_lossy().into_owned());
            let bytes = fs::read(seed.path())?;
            write(&to, &name, &bytes)?;
            if to == "world" {
                write("report", &name, &bytes)?;
                write("run_time", &name, &[&[0; 96][..], &bytes].concat())?;
            }
        }
    }
    // Rooms with doors that turn, and what is seen from each.
    let doors = enfilade_fuzz::world::with_doors();
    for (to, head) in [("world", 0), ("report", 0), ("run_time", 96)] {
        write(to, "doors", &[&vec![0; head][..], &doors].concat())?;
    }
    let [evidence, checkpoint] = enfilade_fuzz::sight::seeds();
    write("evidence", "good", &evidence)?;
    write("checkpoint", "good", &checkpoint)?;
    write("pvs", "four", PRT.as_bytes())?;
    write("prt", "four", PRT.as_bytes())?;
    write(
        "prt",
        "answer",
        b"PVS1 3\n# kind test\n0: 0-2\n1: 0-1\n2: 0 2\n",
    )?;
    write("settings", "all", SETTINGS.as_bytes())?;
    write("choices", "both", CHOICES.as_bytes())?;
    for (i, name) in NAMES.iter().enumerate() {
        write("files", &i.to_string(), name.as_bytes())?;
    }
    for (i, seed) in enfilade_fuzz::bake::seeds().iter().enumerate() {
        write("bake", &i.to_string(), seed)?;
    }
    Ok(())
}

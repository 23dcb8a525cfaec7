//! Two rooms in every input format, and the commands that read them.

use std::path::Path;

use anyhow::Context;
use enfilade_testkit::glb;
use serde_json::json;

use super::formats::{Corners, binary_ply, gltf, map, obj, ply, prt, stl, wav};

/// A file to damage, the commands that read it (words; `@` is the file, the word after `<` is standard input), and
/// how often it is chosen.
pub(super) struct Input {
    pub(super) file: &'static str,
    pub(super) commands: &'static [&'static str],
    pub(super) weight: usize,
}

impl Input {
    const fn new(file: &'static str, weight: usize, commands: &'static [&'static str]) -> Self {
        Self {
            file,
            commands,
            weight,
        }
    }
}

const SCENE: &[&str] = &[
    "bake @ -o out.glb",
    "bake @ -o out.glb --method watershed",
    "bake @ -o out.glb --method bsp",
    "bake @ -o out.glb --method delaunay",
    "bake @ -o out.glb --repair --repair-holes 2 --leak-path",
    "bake @ -o out.glb --max-cost 40 --split-outdoors --smallest-hole 0",
    "bake two.obj -o out.glb --detail @ --unit ft --up z",
    "decimate @ -o out.glb",
    "verify world.glb --source @ --rays 200 --sight 5",
];

/// All but the last: without names the chair is structure, and a map has other units, but the world was baked from
/// `two.obj`.
const BARE: &[&str] = SCENE.split_at(SCENE.len() - 1).0;

/// [`BARE`], and the last with a world of the same materials.
const GLTF: &[&str] = &{
    let mut all = [""; SCENE.len()];
    all.copy_from_slice(SCENE);
    all[SCENE.len() - 1] = "verify gltf.glb --source @ --rays 200 --sight 5";
    all
};

const BAKE: &[&str] = &[
    "bake two.gltf -o out.glb",
    "bake two.gltf -o out.glb --method bsp",
];

/// For what is not triangles: a surface is made first.
const SURFACE: &[&str] = &[
    "bake @ -o out.glb --allow-empty",
    "bake @ -o out.glb --allow-empty --method delaunay",
];

/// The same, for points without the place of their scanner.
const STATION: &[&str] = &["bake @ -o out.glb --allow-empty --station 2,1.5,2"];

macro_rules! seed {
    ($folder:literal, $file:literal) => {
        (
            $file,
            include_bytes!(concat!("../../../../fuzz/seeds/", $folder, "/", $file)),
        )
    };
}

/// The seeds of fuzzing for these.
const SEEDS: [(&str, &[u8]); 9] = [
    seed!("e57", "room.e57"),
    seed!("las", "room.las"),
    seed!("las", "room.laz"),
    seed!("volume", "ball.nii"),
    seed!("volume", "ball.nii.gz"),
    seed!("volume", "ball.nrrd"),
    seed!("implicit", "house.json"),
    seed!("heights", "geotiff.tif"),
    seed!("patches", "vault.json"),
];

pub(super) const INPUTS: [Input; 32] = [
    Input::new("two.obj", 8, SCENE),
    Input::new("two.glb", 10, GLTF),
    Input::new("two.gltf", 8, GLTF),
    Input::new("two.ply", 5, BARE),
    Input::new("binary.ply", 5, BARE),
    Input::new("two.stl", 5, BARE),
    Input::new("two.map", 8, BARE),
    Input::new("two.bin", 3, BAKE),
    Input::new("picture.png", 1, BAKE),
    Input::new("two.mtl", 1, &["bake two.obj -o out.glb"]),
    Input::new(
        "world.glb",
        32,
        &[
            "inspect @",
            "inspect @ --json",
            "inspect @ --objects 0",
            "plan @ -o out.svg",
            "plan @ -o out.pdf",
            "plan @ -o out.png --width 300",
            "pvs @ -o out.pvs --mode fast",
            "pvs @ -o out.pvs --into out.glb --statistics out.json --mutual out.txt --evidence out.ev",
            "pvs @ -o out.pvs --into out.glb --parts --volumes",
            "locate @ < points.txt",
            "locate @ --object *west*",
            "path @ --from 1,1,2 --to 7,1,2",
            "sound @ --listener 1,1.5,2;3,1.5,2 --source 6,1.5,3 -o out.wav",
            "see @ --eye 1,1.5,2 --look 7,1.5,2",
            "simplify @ -o out.glb --max-cells 2",
            "simplify @ -o out.glb --max-cost 40 --split-outdoors",
            "edit @ -o out.glb --delete-portal 0",
            "edit @ -o out.glb --add-portal 2,-1,-1;2,-1,6;2,4,6;2,4,-1",
            "report @ -o out.html --no-pictures --views 5",
            "verify @ --rays 500 --sight 20",
            "verify @ --source two.obj --rays 500 --sight 0",
            "verify @ --evidence world.ev",
            "bake @ -o out.glb",
            "decimate @",
        ],
    ),
    Input::new(
        "world.glb",
        1,
        &[
            "render @ -o out.png --size 32x32 --eye 1,1.5,2 --look 7,1.5,2 --lod 1 --adapter software",
        ],
    ),
    Input::new(
        "grid.prt",
        6,
        &[
            "pvs @ -o out.pvs",
            "pvs @ -o out.pvs --mode fast --evidence out.ev",
            "simplify @ -o out.prt --max-cells 3",
            "verify @ --evidence grid.ev",
        ],
    ),
    Input::new("grid.ev", 4, &["verify grid.prt --evidence @"]),
    Input::new("world.ev", 3, &["verify world.glb --evidence @"]),
    Input::new(
        "grid.search",
        5,
        &["pvs grid.prt -o out.pvs --checkpoint @"],
    ),
    Input::new(
        "settings.toml",
        6,
        &[
            "bake two.obj -o out.glb --config @ --method watershed",
            "bake two.obj -o out.glb --config @ --method bsp",
            "decimate two.obj --config @",
            "verify world.glb --source two.obj --config @ --rays 200 --sight 0",
        ],
    ),
    Input::new(
        "choices.toml",
        2,
        &[
            "bake two.obj -o out.glb --method delaunay --choices @",
            "decimate two.obj --choices @",
        ],
    ),
    Input::new(
        "tone.wav",
        1,
        &["sound world.glb --listener 1,1.5,2 --source 6,1.5,3 -o out.wav --wav @"],
    ),
    Input::new("points.txt", 1, &["locate world.glb < @"]),
    Input::new(
        "walk.txt",
        1,
        &["render world.glb -o out.png --size 8x8 --adapter software --path @"],
    ),
    Input::new("steps.txt", 1, &["decimate two.obj --steps < @"]),
    Input::new("room.e57", 3, SURFACE),
    Input::new("room.las", 4, STATION),
    Input::new("room.laz", 4, STATION),
    Input::new("ball.nii", 4, SURFACE),
    Input::new("ball.nii.gz", 2, SURFACE),
    Input::new("ball.nrrd", 4, SURFACE),
    Input::new("house.json", 4, SURFACE),
    Input::new("geotiff.tif", 4, SURFACE),
    Input::new("vault.json", 4, SURFACE),
    Input::new(
        "living.json",
        1,
        &[
            "render world.glb -o out.png --size 8x8 --eye 1,1.5,2 --look 7,1.5,2 --adapter software --living @ --time 2",
        ],
    ),
];

/// Commands that make further inputs from these, in order.
pub(super) const MADE: [&str; 5] = [
    "bake two.obj -o world.glb --method watershed",
    "bake two.gltf -o gltf.glb",
    "pvs world.glb -o out.pvs --into world.glb --parts --volumes --evidence world.ev",
    "pvs grid.prt -o out.pvs --evidence grid.ev",
    "pvs grid.prt -o out.pvs --checkpoint grid.search --budget 0",
];

/// Writes the files that no command makes.
pub(super) fn write(folder: &Path) -> anyhow::Result<()> {
    let boxes = boxes();
    let (json, bin) = gltf(&boxes);
    let with_buffer = |buffer: serde_json::Value| {
        let mut json = json.clone();
        json["buffers"] = json!([buffer]);
        json.to_string()
    };
    let n = bin.len();
    let inline = with_buffer(json!({"byteLength": n}));
    let outside = with_buffer(json!({"byteLength": n, "uri": "two.bin"}));
    let files: [(&str, Vec<u8>); 17] = [
        ("two.obj", obj(&boxes).into()),
        (
            "two.mtl",
            "newmtl wall\nKd 0.8 0.7 0.6\nmap_Kd picture.png\nnewmtl glass\nKd 0 0 1\nd 0.3\n"
                .into(),
        ),
        ("two.glb", glb(&inline, &bin)),
        ("two.gltf", outside.into()),
        ("two.bin", bin),
        ("picture.png", PICTURE.into()),
        ("two.ply", ply(&boxes).into()),
        ("binary.ply", binary_ply(&boxes)),
        ("tone.wav", wav()),
        ("two.stl", stl(&boxes)),
        ("two.map", map(&boxes).into()),
        ("grid.prt", prt().into()),
        ("settings.toml", SETTINGS.into()),
        (
            "choices.toml",
            "keep = [[4.1, 1.05, 2.5]]\njoin = [[1.0, 1.5, 2.0]]\n".into(),
        ),
        ("points.txt", "1 1.5 2\n7 1.5 2\n".into()),
        ("living.json", LIVING.into()),
        ("walk.txt", "1 1.5 2 7 1.5 2\n".into()),
    ];
    let steps = (
        "steps.txt",
        b"b 3\nl\nkeep\nn\njoin\nundo\nbake out.glb\nsave out.toml\ng 0\nq\n".to_vec(),
    );
    let seeds = SEEDS.map(|(name, bytes)| (name, bytes.to_vec()));
    for (name, bytes) in files.into_iter().chain([steps]).chain(seeds) {
        std::fs::write(folder.join(name), bytes).with_context(|| name.to_owned())?;
    }
    Ok(())
}

const LIVING: &str = r#"{"version": 1, "lamps": [{"at": [1, 2, 2], "color": [1.6, 1.3, 1], "range": 7}],
    "people": {"count": 2, "seed": 1, "places": [[1, 0, 2], [7, 0, 2]], "stay": [4, 30]},
    "sounds": [{"name": "radio", "at": [2, 1, 2]}]}"#;

const SETTINGS: &str = "\
min_opening = 0.5
smallest_hole = 0.01
unit = \"m\"
up = \"y\"
origin = [0.0, 0.0, 0.0]
max_voxels = 100000
detail_names = [\"chair*\"]
repair = 0.001
[merge]
threshold = 0.7
[bsp]
heuristic = \"min-cut\"
grid = 2.0
planes = [[2.0, 0.0, 0.0, 1.0, 0.0, 0.0]]
boxes = [[0.0, 0.0, 0.0, 1.0, 1.0, 1.0]]
max_cost = 100
material_costs = { wall = 2.0 }
";

/// A gray pixel.
const PICTURE: &[u8] = b"\x89PNG\x0d\x0a\x1a\x0a\x00\x00\x00\x0dIHDR\x00\x00\x00\x01\x00\x00\x00\x01\x08\x00\x00\x00\x00:~\x9bU\x00\x00\x00\x0aIDATx\x9cch\x00\x00\x00\x82\x00\x81w\xcdr\xb6\x00\x00\x00\x00IEND\xaeB`\x82";

/// Returns name and extent of each box: two rooms with a doorway between them and a window to the outdoors, and a
/// chair.
fn boxes() -> Vec<(&'static str, Corners)> {
    vec![
        ("floor", [[-0.2, -0.2, -0.2], [8.4, 0.0, 5.2]]),
        ("roof", [[-0.2, 3.0, -0.2], [8.4, 3.2, 5.2]]),
        ("west", [[-0.2, 0.0, -0.2], [0.0, 3.0, 5.2]]),
        ("east-low", [[8.2, 0.0, 0.0], [8.4, 1.0, 5.0]]),
        ("east-high", [[8.2, 2.0, 0.0], [8.4, 3.0, 5.0]]),
        ("east-left", [[8.2, 1.0, 0.0], [8.4, 2.0, 2.0]]),
        ("east-right", [[8.2, 1.0, 3.0], [8.4, 2.0, 5.0]]),
        ("south", [[0.0, 0.0, -0.2], [8.4, 3.0, 0.0]]),
        ("north", [[0.0, 0.0, 5.0], [8.4, 3.0, 5.2]]),
        ("middle-left", [[4.0, 0.0, 0.0], [4.2, 3.0, 2.0]]),
        ("middle-right", [[4.0, 0.0, 3.0], [4.2, 3.0, 5.0]]),
        ("middle-high", [[4.0, 2.1, 2.0], [4.2, 3.0, 3.0]]),
        ("chair", [[1.0, 0.0, 1.0], [1.5, 0.5, 1.5]]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_glb_says_how_long_it_is() {
        let (json, bin) = gltf(&boxes());
        let bytes = glb(&json.to_string(), &bin);
        assert_eq!(bytes[8..12], (bytes.len() as u32).to_le_bytes());
        assert!(bytes.ends_with(&bin));
    }
}

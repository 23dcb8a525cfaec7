//! Bad worlds, bad cameras and missing textures: an error message, or a complete picture.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use enfilade_cpg::World;
use enfilade_cpg::wire::encode_glb;
use enfilade_geom::scene::{Image, Material, Texture};
use enfilade_testkit::{GridParams, room_grid};

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("bad-pictures-{name}"));
        let _ = fs::remove_dir_all(&dir);
        fs::create_dir_all(&dir).unwrap();
        Self(dir)
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.0.join(name), bytes).unwrap();
    }

    fn run(&self, args: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_enfilade"))
            .args(args)
            .current_dir(&self.0)
            .output()
            .unwrap()
    }

    /// Runs a command: must fail with 1, print `words` and leave nothing behind.
    fn refused(&self, args: &[&str], words: &str) {
        let n_files = || fs::read_dir(&self.0).unwrap().count();
        let before = n_files();
        let done = self.run(args);
        let said = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(1), "{args:?}: {said}");
        assert!(said.contains(words), "{args:?}: {said}");
        assert!(!said.contains("panicked"), "{args:?}: {said}");
        assert_eq!(n_files(), before, "{args:?} left something");
    }

    /// Draws `out.png` of 64 × 36 pixels; returns its bytes and the messages.
    fn drawn(&self, args: &[&str]) -> (Vec<u8>, String) {
        let out = self.0.join("out.png");
        let _ = fs::remove_file(&out);
        let mut all = vec![
            "render",
            "world.glb",
            "-o",
            "out.png",
            "--adapter",
            "software",
        ];
        all.extend(["--size", "64x36", "--plain"]);
        all.extend(args);
        let done = self.run(&all);
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(0), "{args:?}: {said}");
        (fs::read(&out).unwrap(), said)
    }
}

fn grid() -> World {
    room_grid(&GridParams::offices(12, 1))
}

/// The same file with `from` in its JSON replaced by `to`, of equal length.
fn with_json(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let mut out = bytes.to_vec();
    let mut n = 0;
    for at in 0..=bytes.len() - from.len() {
        if bytes[at..].starts_with(from.as_bytes()) {
            out[at..at + to.len()].copy_from_slice(to.as_bytes());
            n += 1;
        }
    }
    assert!(n > 0, "no {from}");
    out
}

#[test]
fn broken_worlds_and_those_of_other_versions_are_refused_by_all_that_draws() {
    let folder = Folder::new("worlds");
    let whole = encode_glb(&grid()).unwrap();
    let length = u32::from_le_bytes(whole[12..16].try_into().unwrap()) as usize;
    folder.write("half.glb", &whole[..whole.len() / 2]);
    folder.write("head.glb", &whole[..20 + length / 2]);
    folder.write("empty.glb", b"");
    folder.write("text.glb", b"no world");
    // The version in the extension.
    folder.write(
        "newer.glb",
        &with_json(&whole, "\"version\":1", "\"version\":9"),
    );
    let strange = with_json(
        &whole,
        "ENFILADE_cell_portal_graph",
        "SOMEBODY_elses_portal_graf",
    );
    folder.write("other.glb", &strange);
    for (file, words) in [
        ("half.glb", "cut off or damaged"),
        ("head.glb", "cut off or damaged"),
        ("empty.glb", "empty.glb"),
        ("text.glb", "text.glb"),
        ("newer.glb", "version"),
        ("other.glb", "other.glb"),
        ("missing.glb", "missing.glb"),
    ] {
        folder.refused(
            &["render", file, "-o", "out.png", "--adapter", "software"],
            words,
        );
        folder.refused(&["report", file, "-o", "out.html", "--no-pictures"], words);
        folder.refused(&["view", file, "--adapter", "software"], words);
    }
}

#[test]
fn worlds_without_rooms_or_walls_are_drawn_as_they_are() {
    let folder = Folder::new("empty");
    folder.write("world.glb", &encode_glb(&World::default()).unwrap());
    let looking = ["--eye", "0,0,0", "--look", "1,0,0"];
    let (sky, _) = folder.drawn(&looking);
    // The same with everything drawn: there is nothing.
    let all = [&looking[..], &["--mode", "everything"]].concat();
    assert_eq!(folder.drawn(&all).0, sky);
    // Without a camera, too: the command finds one.
    folder.drawn(&[]);
    folder.drawn(&["--above"]);
    folder.refused(
        &[
            "render",
            "world.glb",
            "-o",
            "walk.png",
            "--walk",
            "3",
            "--adapter",
            "software",
        ],
        "no room to walk in",
    );
    // Surfaces without cells: everything in the view is drawn.
    let mut world = grid();
    world.graph = enfilade_cpg::CellPortalGraph::default();
    for batch in &mut world.batches {
        batch.cells.clear();
    }
    for detail in &mut world.details {
        detail.cells.clear();
    }
    folder.write("world.glb", &encode_glb(&world).unwrap());
    let into = ["--eye", "-8,12,-8", "--look", "10,1,10"];
    let by_portals = folder.drawn(&into).0;
    assert_eq!(
        by_portals,
        folder
            .drawn(&[&into[..], &["--mode", "everything"]].concat())
            .0
    );
    folder.write("empty.glb", &encode_glb(&World::default()).unwrap());
    assert_ne!(by_portals, sky);
}

#[test]
fn eyes_in_walls_outside_and_far_away_see_what_everything_shows() {
    let folder = Folder::new("eyes");
    let world = grid();
    folder.write("world.glb", &encode_glb(&world).unwrap());
    let sight = enfilade::runtime::Sight::build(&world).unwrap();
    let [low, high] = world.graph.cells[0].aabb;
    let middle = [0, 1, 2].map(|k| (low[k] + high[k]) * 0.5);
    // Through the floor in steps of a millimeter: some points are in no cell.
    let in_floor = (0..400)
        .map(|i| [middle[0], low[1] - i as f32 * 1e-3, middle[2]])
        .find(|&p| sight.locate(p).is_none());
    let mut eyes = vec![[-30.0, 20.0, -30.0], [1e6, 1e6, 1e6], middle];
    eyes.extend(in_floor);
    for eye in eyes {
        let [eye, look] =
            [eye, [high[0], middle[1], high[2]]].map(|p| p.map(|x| x.to_string()).join(","));
        let camera = ["--eye", &eye, "--look", &look];
        let by_portals = folder.drawn(&camera).0;
        let all = folder
            .drawn(&[&camera[..], &["--mode", "everything"]].concat())
            .0;
        assert_eq!(by_portals, all, "{eye}");
    }
}

#[test]
fn textures_that_are_missing_or_damaged_are_said_and_drawn_without() {
    let folder = Folder::new("textures");
    let mut world = grid();
    world.images.push(Image {
        bytes: b"\x89PNG\r\n\x1a\n and no more".to_vec(),
        mime: "image/png".into(),
        ..Image::default()
    });
    world.textures.push(Texture {
        image: Some(0),
        ..Texture::default()
    });
    world.materials = vec![Material {
        gltf: r#"{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}"#.into(),
        base_color: [0.9, 0.1, 0.1, 1.0],
        ..Material::default()
    }];
    for batch in &mut world.batches {
        batch.primitive.material = Some(0);
        batch.primitive.uvs = vec![vec![[0.0; 2]; batch.primitive.positions.len()]];
    }
    folder.write("world.glb", &encode_glb(&world).unwrap());
    let (_, said) = folder.drawn(&[]);
    assert!(said.contains("missing or damaged"), "{said}");
}

#[test]
fn pictures_of_more_pixels_than_are_drawn_are_refused_with_the_largest_that_are() {
    let folder = Folder::new("pixels");
    folder.write("world.glb", &encode_glb(&grid()).unwrap());
    let draw = [
        "render",
        "world.glb",
        "-o",
        "out.png",
        "--adapter",
        "software",
        "--plain",
    ];
    let camera = ["--eye", "1,1.6,1", "--look", "3,1.6,3"];
    for (size, most) in [
        ("16384x16384", "8192x8192"),
        ("16384x8192", "11585x5792"),
        ("4294967295x4294967295", "8192x8192"),
    ] {
        let args = [&draw[..], &camera, &["--size", size]].concat();
        folder.refused(&args, most);
    }
}

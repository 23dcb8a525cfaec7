//! Broken, hostile and mistaken input through the built command.
//!
//! Each case must end with the right exit code and a message that names the file, the place and the remedy, and must
//! leave nothing behind: no output, no temporary file. On Linux every run has an address space of 3 GiB only, so that
//! one that requests unbounded memory is aborted, and fails here.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use enfilade_geom::DVec3;
use enfilade_geom::scene::{Role, Scene};
use enfilade_testkit::{furnished_house, glb, mixed};

/// A folder for one test, removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("bad-input-{name}"));
        let _ = fs::remove_dir_all(&dir);
        fs::create_dir_all(&dir).unwrap();
        Self(dir)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.join(name);
        fs::write(&path, bytes).unwrap();
        path
    }

    /// Names of all its files.
    fn files(&self) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(&self.0)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    /// Runs `enfilade bake ARGS` in the folder.
    fn bake(&self, args: &[&str]) -> Output {
        let binary = env!("CARGO_BIN_EXE_enfilade");
        let mut command = if cfg!(target_os = "linux") {
            let mut limited = Command::new("sh");
            limited
                .args(["-c", "ulimit -v 3145728 && exec \"$0\" \"$@\""])
                .arg(binary);
            limited
        } else {
            Command::new(binary)
        };
        command.arg("bake").args(args).current_dir(&self.0);
        command.output().unwrap()
    }

    /// Bakes `args`: must end with `code`, print all of `words` and leave the folder as it was.
    fn refused(&self, code: i32, args: &[&str], words: &[&str]) {
        let before = self.files();
        let done = self.bake(args);
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(code), "{args:?}: {said}");
        for word in words {
            assert!(said.contains(word), "{args:?}: {word:?} is not in: {said}");
        }
        assert!(!said.contains("panicked"), "{args:?}: {said}");
        assert!(said.len() < 2000, "{args:?}: {} bytes of error", said.len());
        assert_eq!(self.files(), before, "{args:?} left files behind");
    }

    /// Runs `bake FILE -o out.glb`: must end with 1, name the file and print all of `words`.
    fn refused_file(&self, name: &str, bytes: impl AsRef<[u8]>, words: &[&str]) {
        self.write(name, bytes);
        let mut all = vec![name];
        all.extend(words);
        self.refused(1, &[name, "-o", "out.glb"], &all);
        fs::remove_file(self.0.join(name)).unwrap();
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The parts of a small glTF document that cases vary.
struct Document {
    nodes: String,
    accessors: String,
    primitives: String,
    bin: Vec<u8>,
}

/// A tetrahedron with edges of about `size`.
fn tetrahedron(size: f32) -> Document {
    let mut bin = Vec::new();
    for p in [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0f32],
    ] {
        for c in p {
            bin.extend((c * size).to_le_bytes());
        }
    }
    for i in [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3u16] {
        bin.extend(i.to_le_bytes());
    }
    Document {
        nodes: r#"{"mesh":0,"name":"Thing"}"#.into(),
        accessors: r#"{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},
            {"bufferView":1,"componentType":5123,"count":12,"type":"SCALAR"}"#
            .into(),
        primitives: r#"{"attributes":{"POSITION":0},"indices":1}"#.into(),
        bin,
    }
}

impl Document {
    fn glb(&self) -> Vec<u8> {
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
            "nodes":[{}],"meshes":[{{"primitives":[{}]}}],"accessors":[{}],
            "bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":48}},
            {{"buffer":0,"byteOffset":48,"byteLength":24}}],"buffers":[{{"byteLength":{}}}]}}"#,
            self.nodes,
            self.primitives,
            self.accessors,
            self.bin.len()
        );
        glb(&json, &self.bin)
    }
}

fn exported(scene: &Scene) -> Vec<u8> {
    enfilade::import::export_glb(scene)
}

fn scaled_house(factor: f64) -> Scene {
    let mut scene = mixed::two_rooms().scene;
    for o in &mut scene.objects {
        o.transform = enfilade_geom::DMat4::from_scale(DVec3::splat(factor)) * o.transform;
    }
    scene
}

#[test]
fn a_cut_off_glb_is_told_apart_from_a_whole_one() {
    let folder = Folder::new("cut");
    let whole = exported(&furnished_house().scene);
    folder.refused_file("empty.glb", [], &["the file is empty"]);
    for share in [
        1,
        3,
        5,
        7,
        11,
        12,
        19,
        20,
        300,
        5_000,
        whole.len() / 2,
        whole.len() - 1,
    ] {
        folder.refused_file("cut.glb", &whole[..share], &[]);
    }
    folder.refused_file(
        "cut.glb",
        &whole[..whole.len() / 2],
        &["cut off", "GLB header"],
    );
    let mut version_1 = whole.clone();
    version_1[4] = 1;
    folder.refused_file(
        "old.glb",
        &version_1,
        &["version 1", "export it as glTF 2.0"],
    );
    let mut garbled = whole;
    garbled[30..60].fill(b'}');
    folder.refused_file("garbled.glb", &garbled, &["JSON", "line 1 column"]);
}

#[test]
fn a_small_file_cannot_ask_for_a_lot_of_memory() {
    let folder = Folder::new("bomb");
    let numbers = |n: u64, sparse: &str| {
        let mut d = tetrahedron(4.0);
        d.accessors = format!(r#"{{"componentType":5126,"count":{n},"type":"VEC3"{sparse}}}"#);
        d.primitives = r#"{"attributes":{"POSITION":0}}"#.into();
        d
    };
    let damaged = ["needs", "damaged", "mesh 0"];
    folder.refused_file("zeros.glb", numbers(99_000_000, "").glb(), &damaged);
    let sparse = r#","sparse":{"count":1,"indices":{"bufferView":1,"componentType":5123},
        "values":{"bufferView":0}}"#;
    folder.refused_file("sparse.glb", numbers(99_000_000, sparse).glb(), &damaged);
    folder.refused_file(
        "u32.glb",
        numbers(4_000_000_000, "").glb(),
        &["more than the limit"],
    );
    folder.refused_file("u64.glb", numbers(u64::MAX, "").glb(), &["accessor 0"]);

    let mut d = numbers(1_000_000, "");
    d.primitives = vec![r#"{"attributes":{"POSITION":0,"NORMAL":0}}"#; 90].join(",");
    folder.refused_file("again.glb", d.glb(), &["needs", "primitive"]);

    let mut d = tetrahedron(4.0);
    d.accessors += r#",{"componentType":5125,"count":290000000,"type":"SCALAR"}"#;
    d.primitives = r#"{"attributes":{"POSITION":0},"indices":2}"#.into();
    folder.refused_file("indices.glb", d.glb(), &damaged);

    let mut d = tetrahedron(4.0);
    d.accessors += r#",{"componentType":5126,"count":1900000,"type":"VEC3"}"#;
    d.nodes = r#"{"mesh":0,"name":"Thing","extensions":{"EXT_mesh_gpu_instancing":
        {"attributes":{"TRANSLATION":2}}}}"#
        .into();
    folder.refused_file("instances.glb", d.glb(), &["needs", "node 0 'Thing'"]);
    // The same, each with a long name.
    d.accessors = d.accessors.replace("1900000", "100000");
    d.nodes = d.nodes.replace("Thing", &"Thing".repeat(1000));
    folder.refused(1, &["none.glb", "-o", "out.glb"], &["none.glb"]);
    folder.write("names.glb", d.glb());
    let done = folder.bake(&["names.glb", "-o", "out.glb"]);
    assert_eq!(done.status.code(), Some(1));

    let buffer = r#"{"asset":{"version":"2.0"},"buffers":[{"byteLength":1e15}]}"#;
    folder.refused_file("buffer.glb", glb(buffer, &[]), &["JSON"]);
    let buffer = r#"{"asset":{"version":"2.0"},"buffers":[{"byteLength":1000000000000000}]}"#;
    folder.refused_file(
        "buffer.glb",
        glb(buffer, &[0; 4]),
        &["buffer 0", "has 4 bytes of"],
    );
    folder.refused_file("deep.gltf", "[".repeat(1_000_000), &[]);
    let deep = format!(r#"{{"asset":{}"#, r#"{"a":"#.repeat(1_000_000));
    folder.refused_file("deep.gltf", deep, &["JSON"]);
    folder.refused_file(
        "count.ply",
        "ply\nformat binary_little_endian 1.0\nelement vertex 99000000\nproperty float x\n\
         property float y\nproperty float z\nend_header\n",
        &["element vertex"],
    );
    let mut stl = vec![b' '; 80];
    stl.extend(99_000_000u32.to_le_bytes());
    folder.refused_file("count.stl", stl, &[]);
}

#[test]
fn broken_numbers_and_references_are_named_with_their_place() {
    let folder = Folder::new("references");
    for (name, bad) in [("nan", f32::NAN), ("inf", f32::INFINITY)] {
        let mut d = tetrahedron(4.0);
        for at in (0..48).step_by(12) {
            d.bin[at..at + 4].copy_from_slice(&bad.to_le_bytes());
        }
        let words = ["no triangles", "not finite"];
        folder.refused_file(&format!("{name}.glb"), d.glb(), &words);
    }
    let mut d = tetrahedron(4.0);
    d.bin[70..72].copy_from_slice(&60_000u16.to_le_bytes());
    folder.refused_file(
        "index.glb",
        d.glb(),
        &["mesh 0", "index 60000 is out of range"],
    );

    let with_nodes = |nodes: &str| {
        let mut d = tetrahedron(4.0);
        d.nodes = nodes.into();
        d.glb()
    };
    let own = r#"{"mesh":0,"children":[0]}"#;
    folder.refused_file("own-child.glb", with_nodes(own), &["node 0", "cycle"]);
    let ring = r#"{"children":[1]},{"children":[2]},{"mesh":0,"children":[0]}"#;
    folder.refused_file("ring.glb", with_nodes(ring), &["node 0", "cycle"]);
    // Thirty levels, each twice below the one above: a billion paths down.
    let level = |i: usize| format!(r#"{{"children":[{0},{0}]}}"#, i + 1);
    let levels: Vec<String> = (0..30).map(level).collect();
    let diamond = format!("{},{{}}", levels.join(","));
    folder.refused_file(
        "diamond.glb",
        with_nodes(&diamond),
        &["node 0", "another parent"],
    );
    let level = |i: usize| format!(r#"{{"children":[{}]}}"#, i + 1);
    let levels: Vec<String> = (0..5_000).map(level).collect();
    let deep = format!("{},{{\"mesh\":0}}", levels.join(","));
    folder.refused_file("deep.glb", with_nodes(&deep), &["levels of nodes", "1024"]);
    let huge = r#"{"mesh":0,"scale":[1e300,1e300,1e300]}"#;
    folder.refused_file("huge.glb", with_nodes(huge), &[]);
    folder.refused_file(
        "mesh.glb",
        with_nodes(r#"{"mesh":7}"#),
        &["node 0", "no mesh 7"],
    );
}

#[test]
fn what_is_no_readable_file_is_said() {
    let folder = Folder::new("unreadable");
    let to = ["-o", "out.glb"];
    folder.refused(
        1,
        &["nowhere.glb", to[0], to[1]],
        &["cannot read nowhere.glb"],
    );
    fs::create_dir(folder.0.join("house.glb")).unwrap();
    let words = ["cannot read house.glb", "not a regular file"];
    folder.refused(1, &["house.glb", to[0], to[1]], &words);
    folder.write("good.glb", exported(&scaled_house(1.0)));
    let words = ["cannot read lost.glb"];
    folder.refused(
        1,
        &["good.glb", "--detail", "lost.glb", to[0], to[1]],
        &words,
    );
    let gltf = r#"{"asset":{"version":"2.0"},"buffers":[{"byteLength":4,"uri":"lost.bin"}]}"#;
    folder.refused_file("parts.gltf", gltf, &["lost.bin"]);
    folder.refused_file(
        "text.glb",
        "hello, this is no scene at all",
        &["convert it to GLB"],
    );
}

#[test]
fn scenes_without_walls_are_refused() {
    let folder = Folder::new("nothing");
    let empty = r#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[]}],"scene":0}"#;
    folder.refused_file("empty.glb", glb(empty, &[]), &["no triangles"]);
    let mut d = tetrahedron(4.0);
    d.primitives = r#"{"attributes":{"POSITION":0},"mode":0}"#.into();
    folder.refused_file("points.glb", d.glb(), &["no triangles", "points or lines"]);
    // No larger than a chair: anything as large as a room may be one, whatever its name.
    let mut d = tetrahedron(1.8);
    d.nodes = r#"{"mesh":0,"name":"Chair"}"#.into();
    folder.write("chair.glb", d.glb());
    let words = ["no structural triangles", "1 objects", "structural"];
    folder.refused(1, &["chair.glb", "-o", "out.glb"], &words);
    let mut d = tetrahedron(0.0);
    d.nodes = r#"{"mesh":0,"scale":[0,0,0]}"#.into();
    folder.write("point.glb", d.glb());
    folder.refused(
        1,
        &["point.glb", "-o", "out.glb"],
        &["one point", "export it again"],
    );
}

#[test]
fn a_slip_of_the_unit_is_noticed() {
    let folder = Folder::new("unit");
    // The two rooms are some 8 m wide.
    folder.write("wide.glb", exported(&scaled_house(500.0)));
    let words = ["larger than 2000 m", "--unit 0.00", "m,"];
    folder.refused(1, &["wide.glb", "-o", "out.glb"], &words);
    folder.write("tiny.glb", exported(&scaled_house(0.0005)));
    let words = ["smaller than 0.1 m", "--unit 1000"];
    folder.refused(1, &["tiny.glb", "-o", "out.glb"], &words);
    let mut far = scaled_house(1.0);
    for o in &mut far.objects {
        let offset = DVec3::new(500_000.0, 0.0, -200_000.0);
        o.transform = enfilade_geom::DMat4::from_translation(offset) * o.transform;
    }
    folder.write("far.glb", exported(&far));
    folder.refused(
        1,
        &["far.glb", "-o", "out.glb"],
        &["--origin 500005,1,-199998"],
    );
    // The advice in the messages works.
    for args in [
        ["wide.glb", "--unit", "0.002"],
        ["tiny.glb", "--unit", "2000"],
        ["far.glb", "--origin", "500005,1,-199998"],
    ] {
        let done = folder.bake(&[&args[..], &["-o", "out.glb"]].concat());
        let said = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(0), "{args:?}: {said}");
        let summary = String::from_utf8_lossy(&done.stdout);
        assert!(
            summary.contains("cells indoors            2"),
            "{args:?}: {summary}"
        );
    }
}

#[test]
fn outputs_that_cannot_be_are_noticed_before_the_work() {
    let folder = Folder::new("output");
    let bytes = exported(&scaled_house(1.0));
    let input = folder.write("in.glb", &bytes);
    let words = ["in.glb", "is the input", "choose another name"];
    folder.refused(1, &["in.glb", "-o", "in.glb"], &words);
    folder.refused(1, &["in.glb", "-o", "./../bad-input-output/in.glb"], &words);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&input, folder.0.join("link.glb")).unwrap();
        folder.refused(1, &["in.glb", "-o", "link.glb"], &words);
    }
    folder.write("detail.glb", &bytes);
    let words = ["detail.glb", "is the input"];
    folder.refused(
        1,
        &["in.glb", "--detail", "detail.glb", "-o", "detail.glb"],
        &words,
    );
    folder.write("e.toml", "voxel = 0.2");
    let words = ["e.toml", "is the input"];
    folder.refused(1, &["in.glb", "--config", "e.toml", "-o", "e.toml"], &words);
    assert_eq!(fs::read(&input).unwrap(), bytes);
    // The input does not exist in these cases: the output is checked first.
    let words = ["there is no folder", "lost", "-o"];
    folder.refused(1, &["none.glb", "-o", "lost/out.glb"], &words);
    fs::create_dir(folder.0.join("dir")).unwrap();
    folder.refused(
        1,
        &["none.glb", "-o", "dir"],
        &["cannot write", "it is a folder", "-o"],
    );
    folder.refused(
        1,
        &["none.glb", "-o", "in.glb/out.glb"],
        &["cannot write", "-o"],
    );
    folder.refused(1, &["none.glb", "-o", ".."], &["cannot write", "-o"]);
}

#[test]
fn a_scene_reads_files_outside_its_folder_on_request_only() {
    let folder = Folder::new("outside");
    let obj = format!("mtllib ../secret.mtl\n{}", obj_cube(&[]));
    fs::create_dir(folder.0.join("scene")).unwrap();
    folder.write("secret.mtl", "newmtl secret");
    folder.write("scene/a.obj", obj);
    let said = |more: &[&str]| {
        let args = ["scene/a.obj", "-v", "-o", "out.glb"];
        let done = folder.bake(&[&args, more].concat());
        String::from_utf8_lossy(&done.stderr).into_owned()
    };
    let note = "use --allow-outside";
    assert!(said(&[]).contains(note), "{}", said(&[]));
    assert!(!said(&["--allow-outside"]).contains(note));
}

#[test]
fn an_old_output_survives_a_bake_that_fails() {
    let folder = Folder::new("old");
    let old = folder.write("out.glb", "the world of yesterday");
    folder.refused_file("bad.glb", "glTF", &[]);
    assert_eq!(fs::read(&old).unwrap(), b"the world of yesterday");
}

#[test]
fn settings_out_of_range_are_wrong_usage() {
    let folder = Folder::new("usage");
    folder.write("in.glb", exported(&scaled_house(1.0)));
    let wrong = |option: &[&str], words: &[&str]| {
        folder.refused(2, &[&["in.glb", "-o", "out.glb"], option].concat(), words);
    };
    for voxel in ["0", "-1", "NaN", "inf", "1e30", "-inf", "wide", ""] {
        wrong(&["--voxel", voxel], &["--voxel", "meters"]);
        wrong(&["--min-opening", voxel], &["--min-opening", "meters"]);
    }
    for unit in ["feet", "0", "-1", "NaN", "1e300"] {
        wrong(&[&format!("--unit={unit}")], &["--unit", "mm"]);
    }
    wrong(&["--up", "w"], &["--up", "possible values: y, z"]);
    wrong(&["--origin", "1,2"], &["--origin", "three numbers"]);
    wrong(&["--origin", "-1,NaN,2"], &["--origin", "three numbers"]);
    wrong(&["--threads", "0"], &["--threads", "1..=1024"]);
    wrong(&["--threads", "99999999"], &["--threads"]);
    wrong(&["--method", "magic"], &["--method", "watershed"]);
    wrong(&["--colour"], &["--colour"]);
    folder.refused(2, &["in.glb"], &["--output"]);
    folder.refused(2, &["-o", "out.glb"], &["<IN>"]);
    // The widest allowed voxel finds nothing, and does no harm.
    let done = folder.bake(&["in.glb", "-o", "out.glb", "--voxel", "10", "--allow-empty"]);
    assert_eq!(done.status.code(), Some(0), "{done:?}");
}

#[test]
fn a_settings_file_is_understood_or_its_line_is_shown() {
    let folder = Folder::new("settings");
    folder.write("in.glb", exported(&scaled_house(1.0)));
    let wrong = |text: &str, words: &[&str]| {
        folder.write("e.toml", text);
        let args = ["in.glb", "-o", "out.glb", "--config", "e.toml"];
        folder.refused(1, &args, &[&["e.toml"], words].concat());
    };
    wrong(
        "voxel = 0.1\nvoxle = 0.2\n",
        &["line 2", "voxle", "min_opening"],
    );
    wrong("voxel = 0\n", &["line 1", "above 0"]);
    wrong(
        "[merge]\nthreshhold = 1\n",
        &["line 2", "threshhold", "wall_rim"],
    );
    wrong("voxel = \"wide\"", &["line 1", "expected f64"]);
    wrong("voxel = ", &["line 1"]);
    wrong("max_voxels = 10", &["line 1", "at least 1000"]);
    wrong("max_voxels = -10", &["line 1"]);
    // Too few voxels for a door.
    folder.write("e.toml", "max_voxels = 10000");
    let args = ["in.glb", "-o", "out.glb", "--config", "e.toml"];
    folder.refused(
        1,
        &args,
        &["--unit", "--voxel", "--max-memory and max_voxels"],
    );
    folder.write("e.toml", [0xff, 0xfe, 0x00]);
    let args = ["in.glb", "-o", "out.glb", "--config", "e.toml"];
    folder.refused(1, &args, &["cannot read settings e.toml"]);
    let args = ["in.glb", "-o", "out.glb", "--config", "none.toml"];
    folder.refused(1, &args, &["cannot read settings none.toml"]);
}

/// A cube of 4 m, two triangles per side, without the faces `skip`; as OBJ text.
fn obj_cube(skip: &[usize]) -> String {
    let mut text = String::from("o Shell\n");
    for i in 0..8 {
        let c = |bit: usize| if i >> bit & 1 == 1 { 4 } else { 0 };
        text += &format!("v {} {} {}\n", c(0), c(1), c(2));
    }
    let faces = [
        [1, 3, 4, 2],
        [5, 6, 8, 7],
        [1, 2, 6, 5],
        [3, 7, 8, 4],
        [1, 5, 7, 3],
        [2, 4, 8, 6],
    ];
    for (i, f) in faces.iter().enumerate() {
        if !skip.contains(&i) {
            text += &format!("f {} {} {} {}\n", f[0], f[1], f[2], f[3]);
        }
    }
    text
}

#[test]
fn broken_obj_ply_and_stl_are_refused_with_the_line() {
    let folder = Folder::new("text");
    let cube = obj_cube(&[]);
    for name in ["empty.obj", "empty.ply", "empty.stl"] {
        folder.refused_file(name, [], &[]);
    }
    // Without its faces.
    let cut = &cube[..cube.find("f ").unwrap()];
    folder.refused_file("cut.obj", cut, &["no triangles"]);
    folder.refused_file("index.obj", cube.clone() + "f 1 2 99\n", &["line 16", "99"]);
    folder.refused_file("zero.obj", cube.clone() + "f 0 1 2\n", &["line 16"]);
    folder.refused_file("word.obj", cube.clone() + "v 1 two 3\n", &["line 16"]);
    folder.refused_file(
        "nan.obj",
        cube.replace("v 4", "v nan").replace("v 0", "v nan"),
        &[],
    );
    folder.refused_file("binary.obj", [0u8, 1, 2, 255, 254, 10, 13].repeat(100), &[]);

    let ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n\
        0 0 0\n4 0 0\n4 4 0\n0 4 0\n3 0 1 2\n3 0 2 3\n";
    folder.refused_file("cut.ply", &ply[..ply.len() - 8], &["face"]);
    folder.refused_file("header.ply", &ply[..60], &["header"]);
    folder.refused_file(
        "index.ply",
        ply.replace("3 0 2 3", "3 0 2 9"),
        &["face", "9"],
    );
    folder.refused_file("format.ply", ply.replace("ascii", "morse"), &["format"]);
    folder.refused_file("word.ply", ply.replace("4 4 0", "4 x 0"), &["vertex"]);

    let mut stl = vec![b' '; 80];
    stl.extend(2u32.to_le_bytes());
    stl.extend([0; 60]);
    folder.refused_file("cut.stl", &stl, &["cut off"]);
    let text = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 4 0 0\nvertex 0 q 0\n\
        endloop\nendfacet\nendsolid a\n";
    folder.refused_file("word.stl", text, &["line 6"]);
    folder.refused_file("short.stl", &text[..60], &[]);
}

/// The numbers after the first `at` of each leak line, as x y z.
fn leak_places(said: &str) -> Vec<[f64; 3]> {
    said.lines()
        .filter_map(|l| l.trim().strip_prefix("at "))
        .filter_map(|l| {
            let numbers: Vec<f64> = l
                .split(':')
                .next()?
                .split(' ')
                .map(|n| n.parse().unwrap())
                .collect();
            numbers.try_into().ok()
        })
        .collect()
}

#[test]
fn a_scene_with_holes_builds_and_says_where_it_leaks() {
    let folder = Folder::new("holes");
    let g = mixed::two_rooms_crack(0.03);
    assert!(g.scene.objects.iter().any(|o| o.role == Role::Structural));
    folder.write("in.glb", exported(&g.scene));
    let done = folder.bake(&["in.glb", "-o", "out.glb"]);
    let said = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(0), "{said}");
    assert!(said.contains("let light through"), "{said}");
    let places = leak_places(&said);
    // The crack runs along the top of the wall between 5.0 and 5.2 m.
    let is_crack = |p: &[f64; 3]| (4.9..5.3).contains(&p[0]) && (2.6..2.8).contains(&p[1]);
    assert!(places.iter().any(is_crack), "{said}");
    assert_eq!(folder.files(), ["in.glb", "out.glb"]);

    // Half a room is not a room, and the bake still succeeds.
    folder.write("open.obj", obj_cube(&[3]));
    let done = folder.bake(&["open.obj", "-o", "out.glb"]);
    assert_eq!(done.status.code(), Some(0), "{done:?}");
}

#[test]
fn a_room_with_a_piece_of_wall_missing_builds_and_says_where() {
    let folder = Folder::new("missing-piece");
    // A box of 5 x 2.6 x 4 m. A triangle is missing in the wall x = 0, a square in the ceiling, and the wall z = 4
    // has a window.
    let (mut obj, mut n) = (String::new(), 0);
    let mut face = |corners: &[[f64; 3]]| {
        for [x, y, z] in corners {
            obj += &format!("v {x} {y} {z}\n");
        }
        let ids: Vec<String> = (1..=corners.len()).map(|i| (n + i).to_string()).collect();
        n += corners.len();
        obj += &format!("f {}\n", ids.join(" "));
    };
    let x0 = |c: &[[f64; 2]]| c.iter().map(|&[y, z]| [0.0, y, z]).collect::<Vec<_>>();
    face(&x0(&[[0.0, 0.0], [1.0, 0.0], [1.0, 4.0], [0.0, 4.0]]));
    face(&x0(&[[1.8, 0.0], [2.6, 0.0], [2.6, 4.0], [1.8, 4.0]]));
    face(&x0(&[[1.0, 0.0], [1.8, 0.0], [1.8, 1.5], [1.0, 1.0]]));
    face(&x0(&[[1.0, 2.0], [1.8, 1.5], [1.8, 4.0], [1.0, 4.0]]));
    // Frames around a square hole: the ceiling and the wall with the window.
    let ceiling = |u: f64, v: f64| [u, 2.6, v];
    let window = |u: f64, v: f64| [u, v, 4.0];
    type At<'a> = &'a dyn Fn(f64, f64) -> [f64; 3];
    let frames: [(At<'_>, f64, [f64; 4]); 2] = [
        (&ceiling, 4.0, [3.0, 1.0, 4.0, 2.0]),
        (&window, 2.6, [2.0, 0.9, 3.2, 2.1]),
    ];
    for (at, end, [u0, v0, u1, v1]) in frames {
        for [a, b, c, d] in [
            [0.0, 0.0, 5.0, v0],
            [0.0, v1, 5.0, end],
            [0.0, v0, u0, v1],
            [u1, v0, 5.0, v1],
        ] {
            face(&[at(a, b), at(c, b), at(c, d), at(a, d)]);
        }
    }
    face(&[[0.0; 3], [5.0, 0.0, 0.0], [5.0, 0.0, 4.0], [0.0, 0.0, 4.0]]);
    face(&[[0.0; 3], [5.0, 0.0, 0.0], [5.0, 2.6, 0.0], [0.0, 2.6, 0.0]]);
    face(&[
        [5.0, 0.0, 0.0],
        [5.0, 2.6, 0.0],
        [5.0, 2.6, 4.0],
        [5.0, 0.0, 4.0],
    ]);
    folder.write("in.obj", obj);
    let done = folder.bake(&["in.obj", "-o", "out.glb"]);
    let said = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(0), "{said}");
    assert!(
        said.contains("2 openings to outdoors may be holes"),
        "{said}"
    );
    let inspected = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(["inspect", "out.glb"])
        .current_dir(&folder.0)
        .output()
        .unwrap();
    for said in [said, String::from_utf8_lossy(&inspected.stdout)] {
        let near = |at: [f64; 3], why: &str| {
            said.lines().filter(|l| l.ends_with(why)).any(|l| {
                leak_places(l)
                    .iter()
                    .any(|p| (0..3).all(|k| (p[k] - at[k]).abs() < 0.2))
            })
        };
        assert!(near([3.5, 2.6, 1.5], "without a pane"), "{said}");
        assert!(near([0.0, 1.27, 1.5], "no regular shape"), "{said}");
    }
}

#[test]
fn the_house_of_the_tests_is_no_bad_input() {
    let folder = Folder::new("good");
    folder.write("in.obj", obj_cube(&[]));
    folder.write("in.glb", tetrahedron(4.0).glb());
    for name in ["in.obj", "in.glb"] {
        let done = folder.bake(&[name, "-o", "out.glb", "--allow-empty"]);
        assert_eq!(done.status.code(), Some(0), "{name}: {done:?}");
        assert!(Path::new(&folder.0.join("out.glb")).is_file());
    }
}

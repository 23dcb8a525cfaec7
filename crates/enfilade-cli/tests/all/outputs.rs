//! No command overwrites its input, or writes two outputs to one file.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use enfilade_testkit::{GridParams, room_grid};

const INPUTS: [&str; 4] = ["w.glb", "s.obj", "c.toml", "p.txt"];

/// A folder with a world, a scene, settings and a path of cameras; returns it with the contents of these files.
fn folder(name: &str) -> (PathBuf, Vec<Vec<u8>>) {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("outputs-{name}"));
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(dir.join("sub")).unwrap();
    enfilade::save(dir.join("w.glb"), &room_grid(&GridParams::offices(3, 1))).unwrap();
    fs::write(dir.join("s.obj"), "v 0 0 0\nv 4 0 0\nv 0 3 0\nf 1 2 3\n").unwrap();
    fs::write(dir.join("c.toml"), "voxel = 0.2\n").unwrap();
    fs::write(dir.join("p.txt"), "1 1 1 2 1 2\n").unwrap();
    let bytes = INPUTS.map(|f| fs::read(dir.join(f)).unwrap()).to_vec();
    (dir, bytes)
}

#[test]
fn no_command_writes_over_an_input_or_twice() {
    let (dir, before) = folder("table");
    let is_input = "is the input";
    let twice = "is to be written by";
    let mut cases = vec![
        ("bake s.obj -o s.obj", is_input),
        ("bake s.obj -o ./sub/../s.obj", is_input),
        ("bake s.obj --detail w.glb -o w.glb", is_input),
        ("bake s.obj --config c.toml -o c.toml", is_input),
        ("bake s.obj --choices c.toml -o c.toml", is_input),
        ("bake s.obj -o out.glb --leak s.obj", is_input),
        ("bake s.obj -o out.glb --leak sub/../out.glb", twice),
        ("decimate s.obj -o s.obj", is_input),
        ("decimate s.obj --choices c.toml -o c.toml", is_input),
        ("edit w.glb --delete-portal 0 -o w.glb", is_input),
        ("name w.glb --cell 0 Hall -o w.glb", is_input),
        ("rebake w.glb --source s.obj -o w.glb", is_input),
        ("rebake w.glb --source s.obj -o s.obj", is_input),
        ("simplify w.glb --max-cells 2 -o w.glb", is_input),
        ("plan w.glb -o w.glb", is_input),
        ("report w.glb --no-pictures -o w.glb", is_input),
        ("render w.glb -o w.glb", is_input),
        ("render w.glb -o a.png --record w.glb", is_input),
        ("render w.glb -o a --record a", twice),
        (
            "render w.glb -o a.png --path p.txt --record p.txt",
            is_input,
        ),
        ("portals w.glb -o w.glb", is_input),
        ("pvs w.glb -o w.glb", is_input),
        ("pvs w.glb --evidence w.glb", is_input),
        ("pvs w.glb --statistics w.glb", is_input),
        ("pvs w.glb --mutual w.glb", is_input),
        ("pvs w.glb --checkpoint w.glb", is_input),
        ("pvs w.glb --evidence w.pvs", twice),
        ("pvs w.glb -o a --statistics b --mutual ./b", twice),
        ("pvs w.glb -o a --into sub/../a", twice),
    ];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("w.glb", dir.join("link.glb")).unwrap();
        std::os::unix::fs::symlink(".", dir.join("here")).unwrap();
        cases.push(("plan w.glb -o link.glb", is_input));
        cases.push(("plan w.glb -o here/w.glb", is_input));
        cases.push(("plan link.glb -o w.glb", is_input));
        cases.push(("pvs w.glb -o a --mutual here/a", twice));
        // Links to files that do not exist yet, one of them through another link.
        std::os::unix::fs::symlink("new", dir.join("to-new")).unwrap();
        std::os::unix::fs::symlink("here/to-new", dir.join("to-link")).unwrap();
        cases.push(("pvs w.glb -o a --evidence new --mutual to-new", twice));
        cases.push(("pvs w.glb -o a --evidence to-link --mutual new", twice));
        cases.push(("render w.glb -o to-new --record to-link", twice));
    }
    let files = || fs::read_dir(&dir).unwrap().count();
    let n_files = files();
    for (line, says) in cases {
        let done = Command::new(env!("CARGO_BIN_EXE_enfilade"))
            .args(line.split(' '))
            .current_dir(&dir)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(1), "{line}: {said}");
        assert!(said.contains(says), "{line}: {said}");
        assert!(
            said.contains("choose another name with -"),
            "{line}: {said}"
        );
        let after = INPUTS.map(|f| fs::read(dir.join(f)).unwrap()).to_vec();
        assert!(after == before, "{line}");
        assert_eq!(files(), n_files, "{line}");
    }
    fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn the_next_run_removes_what_a_killed_one_left() {
    let (dir, _) = folder("left");
    fs::write(dir.join(".plan.svg.4000000-1.tmp"), "<svg").unwrap();
    let done = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(["plan", "w.glb", "-o", "plan.svg"])
        .current_dir(&dir)
        .output()
        .unwrap();
    assert!(done.status.success(), "{done:?}");
    assert!(dir.join("plan.svg").exists());
    assert!(!dir.join(".plan.svg.4000000-1.tmp").exists());
    fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn what_a_scene_refers_to_is_an_input() {
    let (dir, _) = folder("refers");
    let corners: Vec<u8> = [0.0f32, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 3.0, 0.0]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    fs::write(dir.join("a.bin"), &corners).unwrap();
    let scene = r#"{"asset":{"version":"2.0"},"buffers":[{"uri":"a.bin","byteLength":36}],
        "bufferViews":[{"buffer":0,"byteLength":36}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[4,3,0]}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"nodes":[{"mesh":0}],"scenes":[{"nodes":[0]}]}"#;
    fs::write(dir.join("a.gltf"), scene).unwrap();
    let bake = |output: &str| {
        Command::new(env!("CARGO_BIN_EXE_enfilade"))
            .args(["bake", "a.gltf", "--allow-empty", "-o", output])
            .current_dir(&dir)
            .output()
            .unwrap()
    };
    let decimate = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(["decimate", "a.gltf", "-o", "a.bin"])
        .current_dir(&dir)
        .output()
        .unwrap();
    let baked = ["a.bin", "sub/../a.bin"].map(bake);
    for done in baked.into_iter().chain([decimate]) {
        let said = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(1), "{said}");
        assert!(said.contains("the scene refers to"), "{said}");
        assert!(said.contains("choose another name with -o"), "{said}");
        assert_eq!(fs::read(dir.join("a.bin")).unwrap(), corners);
    }
    assert!(bake("b.glb").status.success());
    fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn a_bake_that_nobody_listens_to_writes_its_world() {
    let (dir, _) = folder("deaf");
    let mut child = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args(["bake", "w.glb", "-v", "-o", "out.glb"])
        .current_dir(&dir)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop((child.stdout.take(), child.stderr.take()));
    assert!(child.wait().unwrap().success());
    enfilade::open(dir.join("out.glb")).unwrap();
    fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn an_extension_that_contradicts_is_refused_before_the_work() {
    let (dir, before) = folder("extensions");
    fs::write(dir.join("g.prt"), "PRT1\n2\n0\n").unwrap();
    let files = || fs::read_dir(&dir).unwrap().count();
    let n_files = files();
    for (line, fits) in [
        (
            "bake s.obj -o x.obj",
            "-o writes a world, one GLB, which .obj contradicts; .glb fits",
        ),
        (
            "bake s.obj -o x.glb --leak x.toml",
            ".pts or .lin or .txt fits",
        ),
        ("decimate s.obj -o x.gltf", ".glb fits"),
        ("edit w.glb --delete-portal 0 -o x.svg", ".glb fits"),
        ("simplify w.glb --max-cells 2 -o x.prt", ".glb fits"),
        ("simplify g.prt --max-cells 1 -o x.glb", ".prt fits"),
        ("plan w.glb -o x.jpg", ".svg or .png or .pdf fits"),
        ("report w.glb --no-pictures -o x.pdf", ".html or .htm fits"),
        ("report w.glb --no-pictures -o x.mp3", ".html or .htm fits"),
        (
            "sound w.glb --listener 2,1,2 --source 3,1,2 -o x.mp3",
            ".wav fits",
        ),
        (
            "sound w.glb --listener 2,1,2 --source 3,1,2 -o x.ogg",
            ".wav fits",
        ),
        ("pvs w.glb -o x.mp3", ".pvs or .txt fits"),
        ("render w.glb -o x.jpg", ".png fits"),
        ("render w.glb --walk 3 -o x.jpg", ".png fits"),
        (
            "render w.glb -o x.png --record x.json",
            ".txt or .path fits",
        ),
        ("pvs w.glb -o x.glb", ".pvs or .txt fits"),
        ("pvs w.glb -o x --into x.pvs", ".glb fits"),
        ("pvs w.glb -o x --evidence x.json", ".ev or .evidence fits"),
        ("pvs w.glb -o x --statistics x.csv", ".json fits"),
        ("pvs w.glb -o x --mutual x.json", ".txt fits"),
        (
            "pvs w.glb -o x --checkpoint x.txt",
            ".search or .checkpoint fits",
        ),
    ] {
        let done = Command::new(env!("CARGO_BIN_EXE_enfilade"))
            .args(line.split(' '))
            .current_dir(&dir)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(1), "{line}: {said}");
        assert!(said.trim_end().ends_with(fits), "{line}: {said}");
        assert_eq!(files(), n_files, "{line}");
    }
    assert!(INPUTS.map(|f| fs::read(dir.join(f)).unwrap()).to_vec() == before);
    fs::remove_dir_all(&dir).unwrap();
}

#[cfg(feature = "view")]
#[test]
fn a_walk_in_a_window_writes_pictures_and_paths_alone() {
    let (dir, _) = folder("view");
    for (line, says) in [
        ("view w.glb --record x.png", ".txt or .path fits"),
        ("view w.glb --screenshot x.gif", ".png fits"),
        ("view w.glb --record -", "another name than '-'"),
        ("view - --path -", "once only"),
    ] {
        let done = Command::new(env!("CARGO_BIN_EXE_enfilade"))
            .args(line.split(' '))
            .current_dir(&dir)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(1), "{line}: {said}");
        assert!(said.contains(says), "{line}: {said}");
    }
    fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn files_that_nobody_named_are_not_written_over() {
    let (dir, _) = folder("unnamed");
    let run = |line: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
        let done = command.args(line.split(' ')).current_dir(&dir).output();
        let done = done.unwrap();
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        (done.status.code(), said)
    };
    let n_pages = if cfg!(feature = "view") { 30 } else { 29 };
    for (line, file, n_files) in [
        ("demo -o d", "house.glb", 3),
        ("demo -o d", "world.glb", 3),
        ("demo -o d", "plan.svg", 3),
        ("man d", "enfilade.1", n_pages),
        ("man d", "enfilade-sound.1", n_pages),
    ] {
        let target = dir.join("d").join(file);
        let others = || fs::read_dir(dir.join("d")).unwrap().count() - 1;
        fs::create_dir(dir.join("d")).unwrap();
        fs::write(&target, "mine").unwrap();
        let (code, said) = run(line);
        assert_eq!(code, Some(1), "{line}: {said}");
        assert!(said.contains(&format!("d/{file} is there")), "{said}");
        assert!(said.contains("or choose another folder with"), "{said}");
        assert_eq!(fs::read(&target).unwrap(), b"mine");
        assert_eq!(others(), 0, "nothing is written before all can be");
        #[cfg(unix)]
        {
            // The target of a link is not the demo's to write, whether it exists or not.
            for other in ["w.glb", "none"] {
                let before = fs::read(dir.join(other)).ok();
                fs::remove_file(&target).unwrap();
                std::os::unix::fs::symlink(dir.join(other), &target).unwrap();
                let (code, said) = run(line);
                assert_eq!(code, Some(1), "{line}: {said}");
                assert!(said.contains(&format!("d/{file} is a link")), "{said}");
                assert!(fs::read(dir.join(other)).ok() == before, "{line}");
                assert_eq!(others(), 0);
            }
        }
        fs::remove_file(&target).unwrap();
        // Twice, and once more over a page of another version.
        assert_eq!([run(line).0, run(line).0], [Some(0); 2]);
        let written = fs::read(&target).unwrap();
        if line.starts_with("man") {
            let text = String::from_utf8(written.clone()).unwrap();
            fs::write(&target, text.replace("NAME", "NAMES")).unwrap();
            assert_eq!(run(line).0, Some(0));
            assert!(fs::read(&target).unwrap() == written);
        }
        assert_eq!(others() + 1, n_files, "{line}");
        fs::remove_dir_all(dir.join("d")).unwrap();
    }
    fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn two_reports_on_a_world_are_the_same() {
    let (dir, _) = folder("same");
    let page = |threads: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
        let command = command.env("RAYON_NUM_THREADS", threads);
        let line = "report w.glb --no-pictures --views 20 -o -";
        let done = command.args(line.split(' ')).current_dir(&dir).output();
        done.unwrap().stdout
    };
    let pages = [page("1"), page("1"), page("3")];
    assert!(pages[0].len() > 10_000);
    assert!(pages[0] == pages[1] && pages[0] == pages[2]);
    fs::remove_dir_all(&dir).unwrap();
}

//! References to other files: only files in the scene's own folder are read, unless the caller allows more.

use crate::common;

use std::fs;
use std::path::PathBuf;

use common::{triangle_bin, triangle_json};
use enfilade_import::{ImportError, ImportOptions, Imported, import};

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";

/// A folder `secret` beside a folder `scene`, removed at the end.
struct Disk(PathBuf);

impl Disk {
    fn new(name: &str) -> Self {
        let root = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("references-{name}"));
        let _ = fs::remove_dir_all(&root);
        for folder in ["secret", "scene/t"] {
            fs::create_dir_all(root.join(folder)).unwrap();
        }
        let disk = Self(root);
        for folder in ["secret", "scene"] {
            disk.write(&format!("{folder}/s.bin"), &triangle_bin());
            disk.write(&format!("{folder}/s.png"), PNG);
        }
        disk.write(
            "secret/s.mtl",
            b"newmtl secret\nKd 1 0 0\nmap_Kd ../secret/s.png\n",
        );
        disk
    }

    fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.join(name);
        fs::write(&path, bytes).unwrap();
        path
    }

    fn read(&self, name: &str, text: &str, allow_outside: bool) -> Result<Imported, ImportError> {
        let options = ImportOptions {
            allow_outside,
            ..ImportOptions::default()
        };
        import(&[self.write(name, text.as_bytes())], &[], &options)
    }

    /// Paths to a file of the folder `secret` from the folder `scene`.
    fn ways_out(&self, name: &str) -> Vec<String> {
        let root = self.0.to_str().unwrap();
        let mut ways = vec![
            format!("../secret/{name}"),
            format!("%2e%2e%2fsecret%2F{name}"),
            format!("..\\\\secret\\\\{name}"),
            format!("t/../../secret/{name}"),
            format!("{root}/secret/{name}"),
            format!("file://{root}/secret/{name}"),
        ];
        #[cfg(unix)]
        {
            let link = self.0.join("scene").join(format!("link-{name}"));
            let _ = fs::remove_file(&link);
            std::os::unix::fs::symlink(self.0.join("secret").join(name), link).unwrap();
            let folder = self.0.join("scene/link");
            let _ = fs::remove_file(&folder);
            std::os::unix::fs::symlink(self.0.join("secret"), folder).unwrap();
            ways.push(format!("link-{name}"));
            ways.push(format!("link/{name}"));
        }
        ways
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// A triangle with its buffer and a picture in files.
fn document(buffer: &str, picture: &str) -> String {
    let members = format!(
        r#""scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],"images":[{{"uri":"{picture}"}}],
           "textures":[{{"source":0}}],
           "materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}]"#
    );
    triangle_json(&members)
        .replace(r#""indices":1"#, r#""indices":1,"material":0"#)
        .replace(
            r#"{"byteLength":44}"#,
            &format!(r#"{{"byteLength":44,"uri":"{buffer}"}}"#),
        )
}

#[test]
fn a_buffer_outside_the_folder_is_an_error_with_what_to_do() {
    let disk = Disk::new("buffer");
    for way in disk.ways_out("s.bin") {
        let text = document(&way, "s.png");
        let error = disk.read("scene/a.gltf", &text, false).unwrap_err();
        let said = error.to_string();
        for word in ["a.gltf", "buffer 0", "--allow-outside", "beside the scene"] {
            assert!(said.contains(word), "{way}: {said}");
        }
        let all = disk.read("scene/a.gltf", &text, true);
        let scene = all.unwrap_or_else(|e| panic!("{way}: {e}")).scene;
        assert_eq!((scene.objects.len(), scene.images.len()), (1, 1), "{way}");
    }
}

#[test]
fn a_picture_outside_the_folder_is_noted_and_left_out() {
    let disk = Disk::new("picture");
    for way in disk.ways_out("s.png") {
        let text = document("s.bin", &way);
        let read = disk.read("scene/a.gltf", &text, false).unwrap();
        assert!(read.scene.images.is_empty(), "{way}");
        let notes = read.report.to_string();
        assert!(notes.contains("--allow-outside"), "{way}: {notes}");
        let read = disk.read("scene/a.gltf", &text, true).unwrap();
        assert_eq!(read.scene.images[0].bytes, PNG, "{way}");
    }
}

#[test]
fn a_material_library_and_its_pictures_stay_in_the_folder() {
    let disk = Disk::new("library");
    let read = |text: &str, allow| disk.read("scene/a.obj", text, allow).unwrap();
    let face = "v 0 0 0\nv 4 0 0\nv 0 3 0\nvt 0 0\nusemtl secret\nf 1/1 2/1 3/1\n";
    for way in disk.ways_out("s.mtl") {
        let way = way.replace("\\\\", "\\");
        let text = format!("mtllib {way}\n{face}");
        let inside = read(&text, false);
        let notes = inside.report.to_string();
        assert!(notes.contains("--allow-outside"), "{way}: {notes}");
        assert!(
            !inside
                .scene
                .materials
                .iter()
                .any(|m| m.name == "secret" && m.gltf.contains("baseColor"))
        );
        let all = read(&text, true);
        assert_eq!(all.scene.images.len(), 1, "{way}: {}", all.report);
    }
    // A library in the folder that names a picture outside. Exporters write paths of the author's disk, so a picture
    // of the same name in the folder is used, if there is one.
    disk.write("secret/only.png", PNG);
    disk.write("scene/m.mtl", b"newmtl secret\nmap_Kd ../secret/only.png\n");
    let text = format!("mtllib m.mtl\n{face}");
    let inside = read(&text, false);
    assert!(inside.scene.images.is_empty());
    assert!(inside.report.to_string().contains("--allow-outside"));
    assert_eq!(read(&text, true).scene.images.len(), 1);
}

#[test]
fn what_lies_in_the_folder_is_read_however_it_is_named() {
    let disk = Disk::new("inside");
    disk.write("scene/t/b c.bin", &triangle_bin());
    disk.write("scene/50%25.png", PNG);
    for (buffer, picture) in [
        ("t/b%20c.bin", "s.png"),
        ("t\\\\b c.bin", "./t/../s.png"),
        ("../scene/s.bin", "50%25.png"),
    ] {
        let read = disk.read("scene/a.gltf", &document(buffer, picture), false);
        let read = read.unwrap_or_else(|e| panic!("{buffer}: {e}"));
        assert_eq!(read.scene.images.len(), 1, "{picture}: {}", read.report);
    }
    // The error does not reveal whether a file outside exists.
    let said = |way: &str| {
        let error = disk.read("scene/a.gltf", &document(way, "s.png"), false);
        error.unwrap_err().to_string().replace(way, "")
    };
    assert_eq!(said("../secret/s.bin"), said("../secret/none.bin"));
    let missing = said("none.bin");
    assert!(missing.contains("put the file there"), "{missing}");
}

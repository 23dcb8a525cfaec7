//! IFC through programs of this test, which return a GLB made here. Covers S1.
#![cfg(unix)]

use crate::common;

use std::path::{Path, PathBuf};
use std::time::Duration;

use common::{glb, triangle_bin, triangle_json};
use enfilade_geom::scene::Role;
use enfilade_import::{
    ConvertedIfc, HeldFiles, IfcConverter, ImportError, ImportOptions, Imported, import,
    import_held,
};

const IFC: &str = "ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('IFC4'));\nENDSEC;\nDATA;\n\
    #7=IFCWALLSTANDARDCASE('0iEHWY1$XA8eQeeULq4jE6',#2,'north',$);\n\
    #8=IFCDOOR('1iEHWY1$XA8eQeeULq4jE6',#2,'leaf',$);\nENDSEC;\nEND-ISO-10303-21;\n";

/// A folder for one test, with an IFC file and this script as converter.
fn house(name: &str, script: &str) -> (PathBuf, IfcConverter) {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(folder.join("temporary")).unwrap();
    std::fs::write(folder.join("-house.ifc"), IFC).unwrap();
    let nodes = r#""nodes":[{"mesh":0,"name":"0iEHWY1$XA8eQeeULq4jE6"},
        {"mesh":0,"name":"product-1iEHWY1$XA8eQeeULq4jE6-body"},{"mesh":0,"name":"else"}]"#;
    std::fs::write(
        folder.join("made.glb"),
        glb(&triangle_json(nodes), &triangle_bin()),
    )
    .unwrap();
    let program = folder.join("convert.sh");
    let text = format!("#!/bin/sh\nset -e\ncd \"$(dirname \"$0\")\"\n{script}\n");
    std::fs::write(folder.join("text"), text).unwrap();
    // Copied by another process: a program that this one has open for writing, or that a child of another test has inherited
    // open, cannot be run.
    let copied = std::process::Command::new("install")
        .args(["-m", "755"])
        .args([&folder.join("text"), &program])
        .status();
    assert!(copied.unwrap().success());
    let converter = IfcConverter::new(program, folder.join("temporary"));
    (folder, converter)
}

fn read(folder: &Path, ifc: Option<IfcConverter>) -> Result<Imported, ImportError> {
    let options = ImportOptions {
        ifc,
        ..ImportOptions::default()
    };
    let read = import(&[folder.join("-house.ifc")], &[], &options);
    let left = std::fs::read_dir(folder.join("temporary")).unwrap().count();
    assert_eq!(left, 0, "temporary files are removed");
    read
}

#[test]
fn products_have_their_class_and_global_id_as_name() {
    let script = "[ \"$1 $2\" = '--use-element-guids --yes' ] && grep -q IFCDOOR \"$3\" && cp made.glb \"$4\"";
    let (folder, converter) = house("ifc-names", script);
    let imported = read(&folder, Some(converter)).unwrap();
    let objects = imported.scene.objects.iter();
    let told: Vec<_> = objects
        .map(|o| (o.name.as_str(), o.role, o.reason.as_str()))
        .collect();
    assert_eq!(
        told[..2],
        [
            (
                "IfcDoor/1iEHWY1$XA8eQeeULq4jE6",
                Role::Detail,
                "IFC class IfcDoor"
            ),
            (
                "IfcWallStandardCase/0iEHWY1$XA8eQeeULq4jE6",
                Role::Structural,
                "IFC class IfcWallStandardCase"
            ),
        ]
    );
    assert_eq!(told[2].0, "else");
    assert_eq!(imported.report.files[0].format, "IFC");
}

#[test]
fn a_converter_that_fails_is_quoted_and_leaves_nothing_behind() {
    for (name, script, text) in [
        (
            "ifc-fails",
            "echo half > \"$4\"; echo 'no such schema' >&2; exit 3",
            "no such schema",
        ),
        ("ifc-silent", "exit 0", "made no GLB"),
        ("ifc-nonsense", "echo half > \"$4\"", "JSON"),
    ] {
        let (folder, converter) = house(name, script);
        let error = read(&folder, Some(converter)).unwrap_err().to_string();
        assert!(
            error.contains(text) && error.contains("-house.ifc"),
            "{error}"
        );
    }
    let (folder, mut converter) = house("ifc-missing", "");
    converter.programs = vec![folder.join("nowhere")];
    let error = read(&folder, Some(converter)).unwrap_err().to_string();
    assert!(error.contains("cannot be run"), "{error}");
    let error = read(&folder, None).unwrap_err().to_string();
    assert!(error.contains("--ifc-convert"), "{error}");
}

#[test]
fn a_converter_is_ended_that_takes_too_long_too_much_or_writes_too_much() {
    let second = Duration::from_secs(1);
    for (name, script, text) in [
        // It would end by itself after an hour.
        ("ifc-endless", "exec sleep 3600", "--max-time"),
        (
            "ifc-greedy",
            "ulimit -v 4000000; exec sh -c 'x=aaaaaaaaaaaaaaaa; while :; do x=$x$x; done'",
            "--max-memory",
        ),
        (
            "ifc-talks",
            "dd if=/dev/zero bs=1000000 count=80 >&2; exec sleep 3600",
            "wrote more than",
        ),
    ] {
        let (folder, mut converter) = house(name, script);
        let is_slow = name == "ifc-endless";
        converter.max_time = if is_slow { second } else { 300 * second };
        converter.max_memory = Some(50_000_000);
        let error = read(&folder, Some(converter)).unwrap_err().to_string();
        assert!(error.contains(text) && error.contains("stopped"), "{error}");
    }
}

#[cfg(target_os = "linux")]
/// Returns `true` once a process is there no more, or `false` after ten seconds.
fn is_gone(process: &str) -> bool {
    (0..200).any(|_| {
        std::thread::sleep(Duration::from_millis(50));
        // A zombie is of whoever should wait for it.
        let state = std::fs::read_to_string(format!("/proc/{}/stat", process.trim()));
        state.is_ok_and(|s| s.contains(") Z ")) || !Path::new("/proc").join(process.trim()).exists()
    })
}

#[cfg(target_os = "linux")]
#[test]
fn what_a_converter_has_started_ends_with_it() {
    for (name, script, is_read) in [
        (
            "ifc-stays",
            "trap '' TERM INT; sleep 3600 & echo $! > child; sleep 3600",
            false,
        ),
        (
            "ifc-forks",
            "sleep 3600 & echo $! > child; cp made.glb \"$4\"",
            true,
        ),
    ] {
        let (folder, mut converter) = house(name, script);
        converter.max_time = Duration::from_secs(2);
        assert_eq!(read(&folder, Some(converter)).is_ok(), is_read);
        let child = std::fs::read_to_string(folder.join("child")).unwrap();
        assert!(is_gone(&child), "{name}");
    }
}

#[test]
fn a_link_in_the_place_of_what_is_made_is_not_followed() {
    let (folder, converter) = house("ifc-link", "ln -s \"$PWD/made.glb\" \"$4\"");
    let error = read(&folder, Some(converter)).unwrap_err().to_string();
    assert!(error.contains("made no GLB"), "{error}");
}

#[test]
fn folders_of_killed_runs_go_and_those_in_use_stay() {
    let (folder, converter) = house("ifc-left", "cp made.glb \"$4\"");
    let temporary = folder.join("temporary");
    let [left, used, young] = ["1-0", "2-0", "3-0"].map(|n| {
        let path = temporary.join(format!("enfilade-ifc-{n}"));
        std::fs::create_dir(&path).unwrap();
        path
    });
    std::fs::write(left.join("lock"), "").unwrap();
    std::fs::write(left.join("out.glb"), "half").unwrap();
    let lock = std::fs::File::create(used.join("lock")).unwrap();
    lock.lock().unwrap();
    let options = ImportOptions {
        ifc: Some(converter),
        ..ImportOptions::default()
    };
    import(&[folder.join("-house.ifc")], &[], &options).unwrap();
    assert!(!left.exists() && used.exists() && young.exists());
    assert_eq!(std::fs::read_dir(&temporary).unwrap().count(), 2);
}

#[test]
fn a_file_in_memory_is_what_the_reader_of_its_program_made() {
    let nodes = r#""nodes":[{"mesh":0,"name":"IfcWall/0iEHWY1$XA8eQeeULq4jE6"}]"#;
    let converted = ConvertedIfc {
        glb: glb(&triangle_json(nodes), &triangle_bin()),
        notes: vec!["a stair: left out".into()],
    };
    let held = |ifc: &str, has_it: bool| {
        let mut files = HeldFiles::default();
        files.add("a/house.ifc".into(), ifc.into(), false);
        if has_it {
            files.add_converted("a/house.ifc".into(), converted.clone());
        }
        import_held(&files, &ImportOptions::default())
    };
    let imported = held(IFC, true).unwrap();
    let objects = &imported.scene.objects;
    assert_eq!(objects[0].name, "IfcWall/0iEHWY1$XA8eQeeULq4jE6");
    assert_eq!(objects[0].role, Role::Structural);
    assert_eq!(imported.report.files[0].format, "IFC");
    let notes = &imported.report.notes;
    assert!(notes.iter().any(|n| n.place == "web-ifc"), "{notes:?}");
    // Without one, and cut off.
    let missing = held(IFC, false).unwrap_err().to_string();
    assert!(missing.contains("IFC without a package"), "{missing}");
    let cut = held(&IFC[..100], true).unwrap_err().to_string();
    assert!(cut.contains("cut off"), "{cut}");
}

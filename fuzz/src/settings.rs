//! Settings and choices, parsed by the command's own code.

use std::cell::LazyCell;
use std::path::{Path, PathBuf};

use clap::Parser;
use enfilade::geom::scene::Scene;

// The command is not a library: its modules are compiled again.
#[allow(dead_code)]
#[path = "../../crates/enfilade-cli/src/bake/settings.rs"]
mod command;
#[path = "../../crates/enfilade-cli/src/bake/delaunay.rs"]
mod delaunay;

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    options: command::BakeOptions,
}

thread_local! {
    static FILE: LazyCell<PathBuf> = LazyCell::new(|| crate::files::folder().join("settings.toml"));
}

/// The settings file: accepted, or rejected with the name of the file.
pub fn settings(data: &[u8]) {
    with_file(data, |path| {
        let line = Line::try_parse_from([Path::new("bake"), Path::new("--config"), path]);
        let resolved = command::resolve(&line.expect("a good line").options);
        match resolved {
            Ok(resolved) => drop(resolved.bake.config_for(&Scene::default())),
            Err(error) => assert!(format!("{error:#}").contains("settings"), "{error:#}"),
        }
    });
}

/// The file of choices: decoded and encoded alike.
pub fn choices(data: &[u8]) {
    let read = |path: &Path| {
        let line = Line::try_parse_from([Path::new("bake"), Path::new("--choices"), path]);
        line.expect("a good line")
            .options
            .delaunay
            .resolve()
            .map(|config| config.choices)
    };
    with_file(data, |path| match read(path) {
        Ok(choices) => {
            let text = delaunay::choices_text(&choices);
            std::fs::write(path, &text).expect("a file");
            let again = read(path).expect("what is written can be read");
            assert_eq!(delaunay::choices_text(&again), text);
        }
        Err(error) => assert!(format!("{error:#}").contains("choices"), "{error:#}"),
    });
}

fn with_file(data: &[u8], work: impl FnOnce(&Path)) {
    FILE.with(|path| {
        std::fs::write(&**path, data).expect("a file");
        work(path);
    });
}

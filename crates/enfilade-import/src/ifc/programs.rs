//! Programs that read IFC, and where they are.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use crate::options::IfcConverter;

/// Exit code of the scripts if the package is missing; also of shells if there is no such program.
pub(super) const NOT_INSTALLED: i32 = 127;

const PYTHON_SCRIPT: &str = include_str!("read_ifc.py");
const NODE_SCRIPT: &str = include_str!("read_ifc.mjs");
/// The part of the script of node that pages use, too, and its name.
const NODE_MODEL: (&str, &str) = ("ifc_model.mjs", include_str!("ifc_model.mjs"));

/// Kind of a program, by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum IfcProgram {
    /// Python, with the package ifcopenshell.
    Python,
    /// node, with the package web-ifc.
    Node,
    /// IfcConvert, or a program that is called in the same way.
    IfcConvert,
}

impl IfcProgram {
    pub(super) fn of(program: &Path) -> Self {
        let name = program.file_name().unwrap_or_default();
        let name = name.to_string_lossy().to_ascii_lowercase();
        if name.starts_with("py") {
            Self::Python
        } else if name.starts_with("node") {
            Self::Node
        } else {
            Self::IfcConvert
        }
    }

    /// Name of the package, or of the program without one.
    pub(super) fn package(self) -> &'static str {
        match self {
            Self::Python => "ifcopenshell",
            Self::Node => "web-ifc",
            Self::IfcConvert => "IfcConvert",
        }
    }

    /// Returns the arguments before input and output; writes the scripts into the folder.
    pub(super) fn arguments(self, folder: &Path) -> std::io::Result<Vec<OsString>> {
        let (name, script) = match self {
            Self::Python => ("read_ifc.py", PYTHON_SCRIPT),
            Self::Node => ("read_ifc.mjs", NODE_SCRIPT),
            Self::IfcConvert => return Ok(["--use-element-guids", "--yes"].map(Into::into).into()),
        };
        let path = folder.join(name);
        std::fs::write(&path, script)?;
        if self == Self::Node {
            std::fs::write(folder.join(NODE_MODEL.0), NODE_MODEL.1)?;
        }
        // The folder of the script is where Python looks for modules first: the current one, which may be anybody's,
        // is not searched.
        Ok(vec![path.into()])
    }
}

impl IfcConverter {
    /// Returns the programs of this machine: the Python of the active virtual environment (`VIRTUAL_ENV`), then `python3`,
    /// `python`, `node` and `IfcConvert` on the `PATH`. Whether they have their packages is seen when they run.
    #[must_use]
    pub fn installed(folder: impl Into<PathBuf>) -> Self {
        let mut found = Self::new("", folder);
        found.programs = programs(|name| std::env::var_os(name), Path::is_file);
        found
    }
}

/// As [`IfcConverter::installed`], of an environment and a disk.
fn programs(
    variable: impl Fn(&str) -> Option<OsString>,
    is_file: impl Fn(&Path) -> bool,
) -> Vec<PathBuf> {
    let in_environment = if cfg!(windows) { "Scripts" } else { "bin" };
    let environment = variable("VIRTUAL_ENV").filter(|e| !e.is_empty());
    let environment = environment.map(|e| Path::new(&e).join(in_environment));
    let path = variable("PATH").unwrap_or_default();
    // An empty entry would be the current folder, which may be anybody's.
    let on_path: Vec<PathBuf> = std::env::split_paths(&path)
        .filter(|folder| !folder.as_os_str().is_empty())
        .collect();
    let first = |folders: &[PathBuf], name: &str| {
        let name = format!("{name}{}", std::env::consts::EXE_SUFFIX);
        let mut all = folders.iter().map(|folder| folder.join(&name));
        all.find(|program| is_file(program))
    };
    let own = environment.and_then(|folder| first(&[folder], "python"));
    let names = ["python3", "python", "node", "IfcConvert"];
    let mut found: Vec<PathBuf> = own.into_iter().collect();
    for program in names.iter().filter_map(|name| first(&on_path, name)) {
        if !found.contains(&program) {
            found.push(program);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_a_program_tells_its_kind() {
        for (name, kind) in [
            ("python3.12", IfcProgram::Python),
            ("/opt/venv/bin/python", IfcProgram::Python),
            ("Python.exe", IfcProgram::Python),
            ("/usr/bin/node", IfcProgram::Node),
            ("nodejs", IfcProgram::Node),
            ("IfcConvert", IfcProgram::IfcConvert),
            ("/python/convert.sh", IfcProgram::IfcConvert),
        ] {
            assert_eq!(IfcProgram::of(Path::new(name)), kind, "{name}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn the_active_environment_comes_first_and_the_current_folder_is_not_searched() {
        let variable = |name: &str| {
            let value = match name {
                "VIRTUAL_ENV" => "/opt/venv",
                "PATH" => ":/opt/venv/bin:/usr/bin:/opt",
                _ => return None,
            };
            Some(OsString::from(value))
        };
        let disk = [
            "/opt/venv/bin/python",
            "/usr/bin/python3",
            "/opt/python3",
            "/opt/IfcConvert",
            "node",
        ];
        let found = programs(variable, |p| disk.iter().any(|d| Path::new(d) == p));
        let found: Vec<_> = found.iter().filter_map(|p| p.to_str()).collect();
        let expected = [disk[0], disk[1], disk[3]];
        assert_eq!(found, expected);
        assert!(programs(|_| None, |_| true).is_empty());
    }
}

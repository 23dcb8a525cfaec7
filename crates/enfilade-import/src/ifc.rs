//! IFC, by means of another program: ifcopenshell (a package of Python), web-ifc (one of node), or IfcOpenShell's IfcConvert.
//!
//! Each writes a GLB whose nodes are called by class and global id, as in `IfcWall/0iEHWY1$XA8eQeeULq4jE6`: scripts in this
//! binary drive the packages and add what the model says of its products, and bodies of its spaces; IfcConvert writes the
//! ids, and the classes are read from the IFC file itself. Classes decide the roles.

mod classes;
mod folder;
mod group;
mod programs;

use std::collections::HashMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crate::builder::Builder;
use crate::held::ConvertedIfc;
use crate::options::IfcConverter;
use crate::{ImportError, files, gltf};
pub(crate) use classes::is_guid;
use folder::Folder;
use group::{Group, lead};
use programs::IfcProgram;

/// Most of the program's output that goes into an error. [Units: bytes]
const SAID_BYTES: u64 = 2000;
/// Most output that the program may write. [Units: bytes]
const MAX_SAID: u64 = 1 << 26;
/// Time between two checks of the program.
const PAUSE: Duration = Duration::from_millis(5);
/// Start of a line of a script that is shown to the user.
const NOTE: &str = "note: ";

/// Returns `true` for a STEP file of some IFC schema.
pub(crate) fn is_ifc(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(1 << 16)];
    let head = String::from_utf8_lossy(head).to_ascii_uppercase();
    head.trim_start().starts_with("ISO-10303-21") && head.contains("IFC")
}

/// Returns `true` if the file has the last line of a STEP file, whatever follows within a few kilobytes.
fn is_whole(bytes: &[u8]) -> bool {
    const LAST: &[u8] = b"END-ISO-10303-21";
    let tail = &bytes[bytes.len().saturating_sub(1 << 12)..];
    tail.windows(LAST.len())
        .any(|w| w.eq_ignore_ascii_case(LAST))
}

/// Returns the file with the schema IFC2X3 if it has that of a draft, which has the same entities, and which the packages do not know.
fn with_known_schema(bytes: &[u8]) -> Option<Vec<u8>> {
    const DRAFT: &[u8] = b"'IFC2X_FINAL'";
    const HEAD: usize = 1 << 16;
    let head = &bytes[..bytes.len().min(HEAD)];
    let at = head
        .windows(DRAFT.len())
        .position(|w| w.eq_ignore_ascii_case(DRAFT))?;
    Some([&bytes[..at], b"'IFC2X3'", &bytes[at + DRAFT.len()..]].concat())
}

/// Converts the file and reads the result.
pub(crate) fn read(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    // The packages read what there is of a cut file, and say nothing.
    if !is_whole(bytes) {
        let problem = "the file is cut off: its last line should be END-ISO-10303-21; copy or export it again";
        return Err(builder.malformed("end", problem));
    }
    if let Some(ConvertedIfc { glb, notes }) = builder.beside.converted(&builder.path) {
        let notes = notes.iter().map(String::as_str);
        return add(glb, notes, IfcProgram::Node, None, builder);
    }
    let Some(converter) = &builder.options.ifc else {
        return Err(unsupported(builder, &[]));
    };
    let folder = Folder::new(&converter.folder).map_err(|reason| ImportError::Read {
        path: converter.folder.clone(),
        reason,
    })?;
    let mut input = builder.path.clone();
    if let Some(known) = with_known_schema(bytes) {
        input = folder.path.join("in.ifc");
        fs::write(&input, known).map_err(|e| builder.malformed("schema", e.to_string()))?;
    }
    for program in &converter.programs {
        let kind = IfcProgram::of(program);
        let run = Run {
            program,
            kind,
            converter,
            folder: &folder.path,
            most: builder.limits().max_file_bytes,
        };
        let ran = run.convert(&input);
        let ran = ran.map_err(|what| builder.malformed(program.display().to_string(), what))?;
        let Ran::Made(glb) = ran else { continue };
        let glb = files::read_file(&glb, run.most)?;
        let said = tail(&run.said()).unwrap_or_default();
        drop(folder);
        let notes = said.lines().filter_map(|line| line.strip_prefix(NOTE));
        let classes = (kind == IfcProgram::IfcConvert).then(|| classes::classes(bytes));
        return add(&glb, notes, kind, classes.as_ref(), builder);
    }
    Err(unsupported(builder, &converter.programs))
}

/// Reads the GLB that a program made; classes are those of the IFC file where the GLB lacks them.
fn add<'n>(
    glb: &[u8],
    notes: impl Iterator<Item = &'n str>,
    kind: IfcProgram,
    classes: Option<&HashMap<String, String>>,
    builder: &mut Builder<'_>,
) -> Result<(), ImportError> {
    builder.add_read_bytes(glb.len() as u64);
    for note in notes {
        builder.note(kind.package(), note);
    }
    match classes {
        Some(classes) => {
            gltf::read_renamed(glb, builder, &|name| classes::renamed(name, classes))?;
        }
        None => gltf::read(glb, builder)?,
    }
    builder.set_format("IFC");
    Ok(())
}

/// Returns the error where no program has what it needs.
fn unsupported(builder: &Builder<'_>, programs: &[PathBuf]) -> ImportError {
    let has = |kind| programs.iter().any(|p| IfcProgram::of(p) == kind);
    let install = if has(IfcProgram::Python) {
        "run `pip install ifcopenshell`"
    } else if has(IfcProgram::Node) {
        "run `npm install web-ifc`"
    } else {
        "install Python and run `pip install ifcopenshell`, or node and `npm install web-ifc`"
    };
    ImportError::Unsupported {
        path: builder.path.clone(),
        feature: "IFC without a package that reads it".into(),
        advice: format!(
            "{install}; or name IfcConvert, or a Python or node that has the package, with --ifc-convert PATH"
        ),
    }
}

/// A run of one program.
struct Run<'c> {
    program: &'c Path,
    kind: IfcProgram,
    converter: &'c IfcConverter,
    folder: &'c Path,
    /// Largest size of the GLB. [Units: bytes]
    most: u64,
}

/// Result of a [`Run`].
enum Ran {
    /// The GLB.
    Made(PathBuf),
    /// The program lacks its package.
    Lacks,
}

impl Run<'_> {
    /// Path of the program's output.
    fn said(&self) -> PathBuf {
        self.folder.join("said.txt")
    }

    /// Returns the GLB, or the program's messages as an error.
    fn convert(&self, input: &Path) -> Result<Ran, String> {
        let (output, said) = (self.folder.join("out.glb"), self.said());
        let text = |e: std::io::Error| e.to_string();
        let stderr = File::create(&said).map_err(text)?;
        // An absolute path, so that a name that begins with a dash is not an option.
        let input = fs::canonicalize(input).map_err(text)?;
        let arguments = self.kind.arguments(self.folder).map_err(text)?;
        let mut command = Command::new(self.program);
        let mut child = lead(&mut command)
            .args(arguments)
            .args([&input, &output])
            // Python writes names in the encoding of the system otherwise.
            .env("PYTHONUTF8", "1")
            .stdin(Stdio::null())
            .stdout(stderr.try_clone().map_err(text)?)
            .stderr(stderr)
            .spawn()
            .map_err(|e| format!("cannot be run: {e}; name another with --ifc-convert PATH"))?;
        let sizes = [(output.as_path(), self.most), (said.as_path(), MAX_SAID)];
        // Ended with all that it has started, whatever happens from here on.
        let _group = Group::of(&child);
        let status = match wait(&mut child, self.converter, sizes) {
            Ok(status) => status,
            Err(why) => {
                // It may have ended meanwhile.
                let _ = child.kill();
                let _ = child.wait();
                return Err(why);
            }
        };
        if self.kind != IfcProgram::IfcConvert && status.code() == Some(programs::NOT_INSTALLED) {
            return Ok(Ran::Lacks);
        }
        // A link could name any file of the disk.
        let is_file = fs::symlink_metadata(&output).is_ok_and(|m| m.is_file());
        if status.success() && is_file {
            return Ok(Ran::Made(output));
        }
        let said = tail(&said).unwrap_or_default();
        // One line, as errors are one line each.
        let said: Vec<&str> = said
            .lines()
            .map(str::trim)
            .filter(|l| !l.is_empty())
            .collect();
        Err(format!("made no GLB ({status}): {}", said.join(" | ")))
    }
}

/// Waits for the converter as long as it stays within its limits, and its files within theirs.
fn wait(
    child: &mut Child,
    converter: &IfcConverter,
    sizes: [(&Path, u64); 2],
) -> Result<ExitStatus, String> {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().map_err(|e| e.to_string())? {
            return Ok(status);
        }
        if start.elapsed() >= converter.max_time {
            return Err(format!(
                "did not finish within {} s and was stopped; allow more with --max-time",
                converter.max_time.as_secs_f64()
            ));
        }
        let most = converter.max_memory.unwrap_or(u64::MAX);
        if most < u64::MAX && memory(child.id()).is_some_and(|taken| taken > most) {
            return Err(format!(
                "took more than {most} bytes of memory and was stopped; allow more with --max-memory"
            ));
        }
        for (path, most) in sizes {
            if fs::symlink_metadata(path).is_ok_and(|m| m.len() > most) {
                return Err(format!(
                    "wrote more than {most} bytes to {} and was stopped",
                    path.display()
                ));
            }
        }
        std::thread::sleep(PAUSE);
    }
}

/// Returns the resident memory of a process, on systems with `/proc`. [Units: bytes]
fn memory(process: u32) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes * 1024)
}

/// Returns the last bytes of a file as text.
fn tail(path: &Path) -> std::io::Result<String> {
    use std::io::{Read, Seek, SeekFrom};
    let mut file = File::open(path)?;
    let n = file.metadata()?.len();
    file.seek(SeekFrom::Start(n.saturating_sub(SAID_BYTES)))?;
    let mut bytes = Vec::new();
    file.take(SAID_BYTES).read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_another_schema_are_no_ifc() {
        assert!(is_ifc(b"ISO-10303-21;HEADER;FILE_SCHEMA(('IFC4'));"));
        assert!(!is_ifc(b"ISO-10303-21; AP214"));
    }

    #[test]
    fn the_schema_of_a_draft_is_read_as_the_one_that_followed() {
        let draft = b"ISO-10303-21;HEADER;FILE_SCHEMA(('IFC2X_FINAL'));DATA;";
        let known = b"ISO-10303-21;HEADER;FILE_SCHEMA(('IFC2X3'));DATA;";
        assert_eq!(with_known_schema(draft).as_deref(), Some(&known[..]));
        assert_eq!(with_known_schema(known), None);
    }

    #[test]
    fn a_file_without_its_last_line_is_cut_off() {
        assert!(is_whole(b"...\nEND-ISO-10303-21;\n\n"));
        assert!(!is_whole(b"ISO-10303-21;\n") && !is_whole(b""));
    }
}

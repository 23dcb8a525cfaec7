//! IFC, by means of IfcOpenShell's converter.
//!
//! IfcConvert writes a GLB whose nodes are named by the products' global ids. The classes are read from the IFC file
//! itself, so that objects are called `IfcWall/0iEHWY1$XA8eQeeULq4jE6` and classes decide the roles.

use std::collections::HashMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crate::builder::Builder;
use crate::options::IfcConverter;
use crate::{ImportError, files, gltf};

/// Characters of a global id.
const GUID_LENGTH: usize = 22;
/// Most of the converter's output that goes into an error. [Units: bytes]
const SAID_BYTES: u64 = 2000;
/// Most output that the converter may write. [Units: bytes]
const MAX_SAID: u64 = 1 << 26;
/// Time between two checks of the converter.
const PAUSE: Duration = Duration::from_millis(5);

/// Returns `true` for a STEP file of some IFC schema.
pub(crate) fn is_ifc(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(1 << 16)];
    let head = String::from_utf8_lossy(head).to_ascii_uppercase();
    head.trim_start().starts_with("ISO-10303-21") && head.contains("IFC")
}

/// Converts the file and reads the result.
pub(crate) fn read(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    let Some(converter) = &builder.options.ifc else {
        return Err(ImportError::Unsupported {
            path: builder.path.clone(),
            feature: "IFC without its converter".into(),
            advice: "install IfcConvert of IfcOpenShell (https://ifcopenshell.org) on the PATH, or name it with --ifc-convert PATH"
                .into(),
        });
    };
    let folder = Folder::new(&converter.folder).map_err(|reason| ImportError::Read {
        path: converter.folder.clone(),
        reason,
    })?;
    let most = builder.limits().max_file_bytes;
    let glb = convert(converter, &builder.path, &folder.path, most)
        .map_err(|problem| builder.malformed(converter.program.display().to_string(), problem))?;
    let glb = files::read_file(&glb, most)?;
    drop(folder);
    builder.add_read_bytes(glb.len() as u64);
    let classes = classes(bytes);
    gltf::read_renamed(&glb, builder, &|name| {
        // Some versions write `product-GUID-body`.
        let guid = name.strip_prefix("product-").unwrap_or(name);
        let guid = guid.get(..GUID_LENGTH)?;
        Some(format!("{}/{guid}", classes.get(guid)?))
    })?;
    builder.set_format("IFC");
    Ok(())
}

/// Returns the converter's GLB, or its messages as an error.
fn convert(
    converter: &IfcConverter,
    input: &Path,
    folder: &Path,
    most: u64,
) -> Result<PathBuf, String> {
    let (output, said) = (folder.join("out.glb"), folder.join("said.txt"));
    let text = |e: std::io::Error| e.to_string();
    let stderr = File::create(&said).map_err(text)?;
    // An absolute path, so that a name that begins with a dash is not an option.
    let input = fs::canonicalize(input).map_err(text)?;
    let mut child = Command::new(&converter.program)
        .args(["--use-element-guids", "--yes"])
        .args([&input, &output])
        .stdin(Stdio::null())
        .stdout(stderr.try_clone().map_err(text)?)
        .stderr(stderr)
        .spawn()
        .map_err(|e| format!("cannot be run: {e}; name IfcConvert with --ifc-convert PATH"))?;
    let sizes = [(output.as_path(), most), (said.as_path(), MAX_SAID)];
    let status = match wait(&mut child, converter, sizes) {
        Ok(status) => status,
        Err(why) => {
            // It may have ended meanwhile.
            let _ = child.kill();
            let _ = child.wait();
            return Err(why);
        }
    };
    // A link could name any file of the disk.
    let is_file = fs::symlink_metadata(&output).is_ok_and(|m| m.is_file());
    if status.success() && is_file {
        return Ok(output);
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

/// Returns the class, as `IFCWALL`, of each instance by global id: `#12=IFCWALL('...',`. Linear.
fn classes(bytes: &[u8]) -> HashMap<String, String> {
    let text = String::from_utf8_lossy(bytes);
    let mut classes = HashMap::new();
    for instance in text.split(';') {
        let Some((_, rest)) = instance.split_once('=') else {
            continue;
        };
        let Some((class, rest)) = rest.split_once('(') else {
            continue;
        };
        let class = class.trim();
        let guid = rest.trim_start().strip_prefix('\'');
        let guid = guid.and_then(|g| g.split_once('\'')).map(|g| g.0);
        if let Some(guid) = guid.filter(|g| g.len() == GUID_LENGTH)
            && let Some(kind) = class.to_ascii_uppercase().strip_prefix("IFC")
        {
            classes.insert(guid.to_owned(), format!("Ifc{}", capitalized(kind)));
        }
    }
    classes
}

/// Words in the names of classes that have a shape.
const WORDS: [&str; 59] = [
    "Air",
    "Annotation",
    "Assembly",
    "Beam",
    "Building",
    "Built",
    "Case",
    "Chimney",
    "Civil",
    "Column",
    "Controller",
    "Conversion",
    "Covering",
    "Curtain",
    "Device",
    "Discrete",
    "Distribution",
    "Door",
    "Electric",
    "Element",
    "Elemented",
    "Energy",
    "Equipment",
    "Feature",
    "Fitting",
    "Fixture",
    "Flight",
    "Flow",
    "Footing",
    "Furnishing",
    "Furniture",
    "Geographic",
    "Grid",
    "Lamp",
    "Light",
    "Member",
    "Opening",
    "Outlet",
    "Pile",
    "Plate",
    "Proxy",
    "Railing",
    "Ramp",
    "Roof",
    "Sanitary",
    "Segment",
    "Shading",
    "Site",
    "Slab",
    "Space",
    "Stair",
    "Standard",
    "Switching",
    "System",
    "Terminal",
    "Transport",
    "Virtual",
    "Wall",
    "Window",
];

/// Returns `WALLSTANDARDCASE` in the schema's spelling; STEP files have capitals only. Unknown words stay one word.
fn capitalized(kind: &str) -> String {
    let mut out = String::new();
    let mut rest = kind;
    while !rest.is_empty() {
        let is_next = |w: &&&str| {
            rest.get(..w.len())
                .is_some_and(|r| r.eq_ignore_ascii_case(w))
        };
        let found = WORDS.iter().filter(is_next).max_by_key(|w| w.len());
        let n = found.map_or(rest.len(), |w| w.len());
        let (first, tail) = rest[..n].split_at_checked(1).unwrap_or((rest, ""));
        out += first;
        out += &tail.to_ascii_lowercase();
        rest = &rest[n..];
    }
    out
}

/// A temporary folder, removed with its contents.
///
/// A file in it stays locked while this process lives; the folder of a killed run has a lock without an owner.
struct Folder {
    path: PathBuf,
    /// `None` once released.
    lock: Option<File>,
}

/// Prefix of the names of such folders.
const PREFIX: &str = "enfilade-ifc-";
const LOCK: &str = "lock";

impl Folder {
    fn new(parent: &Path) -> std::io::Result<Self> {
        remove_left(parent);
        let mut n = 0_u32;
        loop {
            let path = parent.join(format!("{PREFIX}{}-{n}", std::process::id()));
            match fs::create_dir(&path) {
                Ok(()) => {}
                Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists && n < 1000 => {
                    n += 1;
                    continue;
                }
                Err(e) => return Err(e),
            }
            let lock = File::create(path.join(LOCK))?;
            // File systems without locks get none; there, no folder counts as left behind either.
            let is_taken = matches!(lock.try_lock(), Err(fs::TryLockError::WouldBlock));
            // Before it was locked, another run may have removed it as left behind.
            if !is_taken && path.join(LOCK).exists() {
                let lock = Some(lock);
                return Ok(Self { path, lock });
            }
            n += 1;
        }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Some systems cannot remove an open file.
        drop(self.lock.take());
        // A folder that cannot be removed is left to the system.
        let _ = fs::remove_dir_all(&self.path);
    }
}

/// Removes the folders of killed runs. Linear in the parent folder.
fn remove_left(parent: &Path) {
    for entry in fs::read_dir(parent).into_iter().flatten().flatten() {
        let is_ours = entry
            .file_name()
            .to_str()
            .is_some_and(|n| n.starts_with(PREFIX));
        if !is_ours || !entry.file_type().is_ok_and(|t| t.is_dir()) {
            continue;
        }
        // A folder without a lock is just being made.
        if let Ok(lock) = File::open(entry.path().join(LOCK))
            && lock.try_lock().is_ok()
        {
            drop(lock);
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_are_read_by_global_id() {
        let text = b"ISO-10303-21;HEADER;FILE_SCHEMA(('IFC4'));ENDSEC;DATA;\n\
            #1= IFCWALLSTANDARDCASE('0iEHWY1$XA8eQeeULq4jE6',#2,'a;b');\n\
            #2=IFCCARTESIANPOINT((0.,0.));#3=IFCDOOR ( '1iEHWY1$XA8eQeeULq4jE6' ,$);#4=IFC('2iEHWY1$XA8eQeeULq4jE6');";
        assert!(is_ifc(text) && !is_ifc(b"ISO-10303-21; AP214"));
        let classes = classes(text);
        assert_eq!(classes["0iEHWY1$XA8eQeeULq4jE6"], "IfcWallStandardCase");
        assert_eq!(classes["1iEHWY1$XA8eQeeULq4jE6"], "IfcDoor");
        assert_eq!(classes["2iEHWY1$XA8eQeeULq4jE6"], "Ifc");
        assert_eq!(classes.len(), 3);
    }

    #[test]
    fn classes_that_roles_know_are_written_as_they_know_them() {
        for class in enfilade_prepare::ifc_classes() {
            let upper = class["Ifc".len()..].to_ascii_uppercase();
            assert_eq!(format!("Ifc{}", capitalized(&upper)), class);
        }
        assert_eq!(capitalized("CURTAINWALL"), "CurtainWall");
        assert_eq!(capitalized("ODDTHING"), "Oddthing");
    }
}

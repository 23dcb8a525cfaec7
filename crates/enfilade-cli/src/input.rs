//! Inputs of commands: files, and standard input for `-`.

use std::fs::File;
use std::io::{self, Read, StdinLock};
use std::path::{Path, PathBuf};

use anyhow::Context;
use enfilade::geom::shown;
use enfilade::import::{ImportError, ImportOptions, Imported, Limits, SceneSource, import_sources};
#[cfg(feature = "pack")]
use enfilade::stream::{PackError, PackedFiles, PackedPlace};

/// Returns `true` if a path stands for standard input or output. A file of that name is `./-`.
#[must_use]
pub fn is_stream(path: &Path) -> bool {
    path == Path::new("-")
}

/// Returns `true` if a path is the address of a world on a server.
#[must_use]
pub fn is_address(path: &Path) -> bool {
    let text = path.to_string_lossy().to_ascii_lowercase();
    text.starts_with("http://") || text.starts_with("https://")
}

/// The name of an input in messages.
#[must_use]
pub fn name_of(path: &Path) -> String {
    if is_stream(path) {
        "standard input".into()
    } else {
        path.display().to_string()
    }
}

/// The names of the files of a scene in messages: of many, the first.
#[must_use]
pub fn names_of(scene: &[PathBuf]) -> String {
    match scene {
        [] => "the scene".into(),
        [one] => shown(name_of(one)).to_string(),
        [one, others @ ..] => format!("{} and {} more", shown(name_of(one)), others.len()),
    }
}

/// Reads a world, a portal file or evidence from a file or standard input, up to the size allowed for scenes
/// ([`Limits::max_file_bytes`]).
///
/// A GLB states its length in its head: beyond that, at most one byte is read. An input in none of the three formats
/// is read only at its beginning. A packed world is put together, from disk or from a server.
///
/// # Errors
///
/// If the input cannot be read or is longer; the error names it.
pub fn read(path: &Path) -> anyhow::Result<Vec<u8>> {
    let length = |head: &[u8]| {
        let is_known = head.trim_ascii_start().is_empty()
            || head.trim_ascii_start().starts_with(b"PRT")
            || head.starts_with(b"ENFEVID");
        glb_length(head).unwrap_or(if is_known { u64::MAX } else { BEGINNING })
    };
    read_world_like(path, length)
}

/// Like [`read`], for a GLB only: for any other input, only the head is read.
///
/// # Errors
///
/// As [`read`]; not if the input is not a GLB, which a decoder reports in more detail.
pub fn read_glb(path: &Path) -> anyhow::Result<Vec<u8>> {
    read_world_like(path, |head| glb_length(head).unwrap_or(0))
}

/// Reads a short text written by a person. `what` names it in errors, as in "cannot read settings a.toml".
///
/// # Errors
///
/// If the input cannot be read, is not UTF-8, or is longer than 64 MiB; the error names it.
pub fn read_text(what: &str, path: &Path) -> anyhow::Result<String> {
    let read = || {
        let bytes = read_headed(path, |_| u64::MAX, MAX_TEXT)?;
        String::from_utf8(bytes).map_err(io::Error::other)
    };
    read().with_context(|| format!("cannot read {what} {}", name_of(path)))
}

/// Reads scenes as [`import`](enfilade::import::import) does; one of them may be standard input.
///
/// # Errors
///
/// As [`import`](enfilade::import::import).
pub fn import_scene(
    paths: &[PathBuf],
    detail_paths: &[PathBuf],
    options: &ImportOptions,
) -> Result<Imported, ImportError> {
    let mut stdin: Option<StdinLock<'_>> = None;
    let all = || paths.iter().chain(detail_paths);
    if all().any(|p| is_stream(p)) {
        stdin = Some(io::stdin().lock());
    }
    let mut sources: Vec<SceneSource<'_>> = all().map(|p| SceneSource::file(p)).collect();
    for (i, (source, path)) in sources.iter_mut().zip(all()).enumerate() {
        source.is_detail = i >= paths.len();
        if is_stream(path)
            && let Some(stdin) = stdin.take()
        {
            source.stream = Some(Box::new(stdin));
            source.path = name_of(path).into();
        }
    }
    import_sources(sources, options)
}

const HEAD: u64 = 12;
/// Bytes of an unknown format to read: as much as an error quotes.
const BEGINNING: u64 = 4096;
/// Settings and paths of cameras are never longer. [Units: bytes]
const MAX_TEXT: u64 = 64 << 20;

fn read_world_like(path: &Path, length: impl Fn(&[u8]) -> u64) -> anyhow::Result<Vec<u8>> {
    if let Some(bytes) = read_packed(path, false).with_context(|| cannot_read(path))? {
        return Ok(bytes);
    }
    read_headed(path, length, Limits::default().max_file_bytes).with_context(|| cannot_read(path))
}

/// Puts a packed world together, from disk or from a server; `None` for other paths. Compares its head with its pieces if asked to.
#[cfg(feature = "pack")]
pub(crate) fn read_packed(path: &Path, is_checked: bool) -> Result<Option<Vec<u8>>, PackError> {
    if !is_address(path) && !PackedFiles::is_packed(path) {
        return Ok(None);
    }
    let packed = PackedPlace::read_all(path)?;
    let file = packed.unpack()?;
    if is_checked {
        packed.check(&file)?;
    }
    Ok(Some(file))
}

/// Refuses folders and addresses: this build reads no packed worlds.
#[cfg(not(feature = "pack"))]
pub(crate) fn read_packed(path: &Path, _: bool) -> anyhow::Result<Option<Vec<u8>>> {
    anyhow::ensure!(
        !path.is_dir() && !is_address(path),
        "this build reads no packed worlds: build it with the features `pack` and `http`"
    );
    Ok(None)
}

/// The length that a GLB states.
fn glb_length(head: &[u8]) -> Option<u64> {
    let length = head.strip_prefix(b"glTF")?.get(4..8)?;
    Some(u32::from_le_bytes(length.try_into().ok()?).into())
}

fn cannot_read(path: &Path) -> String {
    format!("cannot read {}", name_of(path))
}

fn read_headed(path: &Path, length: impl Fn(&[u8]) -> u64, limit: u64) -> io::Result<Vec<u8>> {
    let mut from: Box<dyn Read> = if is_stream(path) {
        Box::new(io::stdin().lock())
    } else {
        Box::new(File::open(path)?)
    };
    let mut bytes = Vec::new();
    from.by_ref().take(HEAD).read_to_end(&mut bytes)?;
    // One byte more, so that the decoder notices the excess.
    let most = length(&bytes).min(limit).saturating_add(1);
    from.take(most.saturating_sub(HEAD))
        .read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        let text = format!("more than {limit} bytes, the most that is read");
        return Err(io::Error::other(text));
    }
    Ok(bytes)
}

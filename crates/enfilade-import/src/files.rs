//! Files on disk, read with a size limit, and detection of picture formats.

use crate::ImportError;
use crate::held::{ConvertedIfc, HeldFiles};
use std::fs::File;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

/// Reads a whole regular file of at most `limit` bytes.
pub(crate) fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, ImportError> {
    read_up_to(open_file(path, limit)?, path, limit)
}

/// Opens a regular file of at most `limit` bytes.
pub(crate) fn open_file(path: &Path, limit: u64) -> Result<File, ImportError> {
    let read_error = |reason| ImportError::Read {
        path: path.to_path_buf(),
        reason,
    };
    // Checked before opening: opening a pipe would wait for a writer, and a device never ends.
    let meta = std::fs::metadata(path).map_err(read_error)?;
    if !meta.is_file() {
        return Err(read_error(std::io::Error::other("not a regular file")));
    }
    if meta.len() > limit {
        return Err(too_large(path, meta.len(), limit));
    }
    File::open(path).map_err(read_error)
}

/// Bytes needed to detect a format.
const HEAD: u64 = 1 << 16;

/// Reads an input of at most `limit` bytes, head first. `length` gets the head and whether it is the whole input, and
/// returns the most bytes that the input can have; one byte more is read of a longer input.
pub(crate) fn read_headed(
    mut from: impl Read,
    path: &Path,
    limit: u64,
    length: impl Fn(&[u8], bool) -> Result<u64, ImportError>,
) -> Result<Vec<u8>, ImportError> {
    let mut bytes = read_up_to(from.by_ref().take(HEAD.min(limit)), path, limit)?;
    let n = bytes.len() as u64;
    let most = length(&bytes, n < HEAD)?;
    if n == HEAD.min(limit) {
        let rest = most.min(limit).saturating_add(1).saturating_sub(n);
        bytes.extend(read_up_to(from.take(rest), path, limit)?);
    }
    if bytes.len() as u64 > limit {
        return Err(too_large(path, bytes.len() as u64, limit));
    }
    Ok(bytes)
}

/// Reads a whole input of at most `limit` bytes; `path` is its name in messages.
pub(crate) fn read_up_to(from: impl Read, path: &Path, limit: u64) -> Result<Vec<u8>, ImportError> {
    let mut bytes = Vec::new();
    from.take(limit.saturating_add(1))
        .read_to_end(&mut bytes)
        .map_err(|reason| ImportError::Read {
            path: path.to_path_buf(),
            reason,
        })?;
    if bytes.len() as u64 > limit {
        return Err(too_large(path, bytes.len() as u64, limit));
    }
    Ok(bytes)
}

fn too_large(path: &Path, n: u64, limit: u64) -> ImportError {
    ImportError::TooMuch {
        path: path.to_path_buf(),
        place: "file".into(),
        what: "bytes",
        n,
        limit,
    }
}

/// Decodes a `data:` URI. `None` if it is another URI, an error text if it is malformed.
pub(crate) fn decode_data_uri(uri: &str) -> Option<Result<(String, Vec<u8>), String>> {
    use base64::Engine;
    let rest = uri
        .get(..5)
        .filter(|scheme| scheme.eq_ignore_ascii_case("data:"))
        .map(|_| &uri[5..])?;
    let Some((head, body)) = rest.split_once(',') else {
        return Some(Err("data URI without a comma".into()));
    };
    let mime = head.split(';').next().unwrap_or("").to_ascii_lowercase();
    let is_base64 = head
        .rsplit(';')
        .next()
        .is_some_and(|last| last.eq_ignore_ascii_case("base64"));
    let bytes = if is_base64 {
        let engine = base64::engine::GeneralPurpose::new(
            &base64::alphabet::STANDARD,
            base64::engine::GeneralPurposeConfig::new()
                .with_decode_padding_mode(base64::engine::DecodePaddingMode::Indifferent),
        );
        engine
            .decode(body)
            .map_err(|e| format!("data URI is not base64: {e}"))
    } else {
        Ok(percent_encoding::percent_decode_str(body).collect())
    };
    Some(bytes.map(|bytes| (mime, bytes)))
}

/// The files to which a scene may refer.
pub(crate) enum Beside<'a> {
    /// None: it was read from a stream.
    Nothing,
    /// Those of a folder.
    Folder(PathBuf),
    /// Those in memory.
    Held(&'a HeldFiles),
}

impl<'a> Beside<'a> {
    /// Returns what a reader made of an IFC file in memory.
    pub(crate) fn converted(&self, scene: &Path) -> Option<&'a ConvertedIfc> {
        match self {
            Self::Held(held) => held.converted(scene),
            Self::Nothing | Self::Folder(_) => None,
        }
    }

    /// Reads a file of at most `limit` bytes to which a scene refers. Returns its path and bytes, or the reason for refusal.
    pub(crate) fn read(
        &self,
        scene: &Path,
        reference: &str,
        may_leave: bool,
        limit: u64,
    ) -> Result<(PathBuf, Vec<u8>), String> {
        match self {
            Self::Nothing => read_reference(None, reference, may_leave, limit),
            Self::Folder(folder) => read_reference(Some(folder), reference, may_leave, limit),
            Self::Held(held) => held.reference(scene, reference, limit),
        }
    }
}

/// Reads a file of at most `limit` bytes that a scene in `folder` refers to. Returns its path and
/// bytes, or the reason for refusal.
///
/// All such files are read here: the author of the scene chooses the reference, but the disk is the reader's. So the
/// file must lie in the scene's folder or below, even after following links, unless `may_leave` is set.
fn read_reference(
    folder: Option<&Path>,
    reference: &str,
    may_leave: bool,
    limit: u64,
) -> Result<(PathBuf, Vec<u8>), String> {
    let path = resolve(folder, reference, may_leave)?;
    let bytes = read_file(&path, limit).map_err(|e| match e {
        ImportError::Read { .. } => format!("{e}; put the file there"),
        _ => e.to_string(),
    })?;
    Ok((path, bytes))
}

/// Returns the path of the file that a reference names.
fn resolve(folder: Option<&Path>, reference: &str, may_leave: bool) -> Result<PathBuf, String> {
    let Some(folder) = folder else {
        return Err(format!(
            "refers to the file '{reference}', but was read from memory or a stream; give the scene's file"
        ));
    };
    let here = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let root = here
        .canonicalize()
        .map_err(|e| format!("cannot find the folder {}: {e}", here.display()))?;
    let decoded = percent_encoding::percent_decode_str(reference).decode_utf8_lossy();
    let named = named(&root, &decoded.replace('\\', "/"), reference, may_leave)?;
    // A name may contain an unescaped percent sign.
    let path = if decoded == reference || named.exists() {
        named
    } else {
        self::named(&root, reference, reference, may_leave)
            .ok()
            .filter(|p| p.exists())
            .unwrap_or(named)
    };
    // A missing file is an error only when it is read.
    let path = path.canonicalize().unwrap_or(path);
    if may_leave || path.starts_with(&root) {
        Ok(path)
    } else {
        Err(outside(reference, "by a link "))
    }
}

/// Returns the path that a decoded reference names, before links. `..` removes a name, as in every URI.
///
/// Rejects without looking at the disk, so that errors do not reveal its contents.
fn named(root: &Path, decoded: &str, reference: &str, may_leave: bool) -> Result<PathBuf, String> {
    let is_absolute = |path: &str| path.starts_with('/') || path.as_bytes().get(1) == Some(&b':');
    let path = match decoded.split_once("://") {
        Some((scheme, path)) if scheme.eq_ignore_ascii_case("file") && may_leave => {
            // `file:///C:/a` and `file:///a`; a host is not followed.
            path.strip_prefix('/')
                .filter(|rest| is_absolute(rest))
                .unwrap_or(path)
        }
        Some((scheme, _)) if !scheme.eq_ignore_ascii_case("file") => {
            return Err(format!("refers to '{reference}'; only files are read"));
        }
        Some(_) => return Err(outside(reference, "")),
        None => decoded,
    };
    if path.is_empty() || path.contains('\0') {
        return Err(format!("refers to '{reference}', which is not a file name"));
    }
    let is_absolute = is_absolute(path);
    if is_absolute && may_leave {
        return Ok(PathBuf::from(path));
    }
    let mut named = root.to_path_buf();
    for part in Path::new(path).components() {
        match part {
            Component::Normal(name) => named.push(name),
            Component::ParentDir => {
                named.pop();
            }
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return Err(outside(reference, "")),
        }
    }
    if may_leave || (!is_absolute && named.starts_with(root)) {
        Ok(named)
    } else {
        Err(outside(reference, ""))
    }
}

fn outside(reference: &str, how: &str) -> String {
    format!(
        "refers to '{reference}', {how}outside the folder of the scene; keep it beside the scene, or use --allow-outside \
         (ImportOptions::allow_outside)"
    )
}

/// Detects the MIME type of a picture from its first bytes.
pub(crate) fn sniff_image(bytes: &[u8]) -> Option<&'static str> {
    const KTX2: &[u8] = b"\xABKTX 20\xBB";
    Some(match bytes {
        b if b.starts_with(b"\x89PNG\r\n\x1a\n") => "image/png",
        b if b.starts_with(b"\xFF\xD8\xFF") => "image/jpeg",
        b if b.starts_with(b"RIFF") && b.get(8..12) == Some(b"WEBP") => "image/webp",
        b if b.starts_with(KTX2) => "image/ktx2",
        b if b.starts_with(b"DDS ") => "image/vnd-ms.dds",
        b if b.starts_with(b"BM") => "image/bmp",
        b if b.starts_with(b"GIF8") => "image/gif",
        b if b.get(4..12) == Some(b"ftypavif") => "image/avif",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_uris_decode_or_say_why_not() {
        assert_eq!(decode_data_uri("a.bin"), None);
        assert_eq!(decode_data_uri("data"), None);
        assert_eq!(decode_data_uri("dat\u{e9}:"), None);
        let decoded = decode_data_uri("data:image/PNG;base64,AAEC")
            .unwrap()
            .unwrap();
        assert_eq!(decoded, ("image/png".into(), vec![0, 1, 2]));
        let plain = decode_data_uri("data:,a%20b").unwrap().unwrap();
        assert_eq!(plain.1, b"a b");
        assert!(decode_data_uri("data:;base64,****").unwrap().is_err());
        assert!(decode_data_uri("data:;base64").unwrap().is_err());
    }

    #[test]
    fn references_stay_in_the_folder_unless_they_may_leave() {
        let root = std::env::temp_dir().canonicalize().unwrap();
        let here = Some(root.as_path());
        let found = |reference| resolve(here, reference, false);
        assert!(resolve(None, "a.bin", true).is_err());
        for bad in [
            "/etc/passwd",
            "file:///etc/passwd",
            "C:/a.png",
            "C:\\a.png",
            "../a.bin",
            "..\\a.bin",
            "%2e%2e%2fa.bin",
            "%2E%2E/a.bin",
            "t/../../a.bin",
        ] {
            let problem = found(bad).unwrap_err();
            assert!(problem.contains("--allow-outside"), "{bad}: {problem}");
            resolve(here, bad, true).unwrap();
        }
        for bad in ["http://host/a", "", "a\0b", "a%00b"] {
            assert!(found(bad).is_err(), "{bad}");
            assert!(resolve(here, bad, true).is_err(), "{bad}");
        }
        for (reference, path) in [
            ("no%20such.bin", "no such.bin"),
            ("t\\no-such.png", "t/no-such.png"),
            ("./t/../no-such.png", "no-such.png"),
        ] {
            assert_eq!(found(reference).unwrap(), root.join(path));
        }
        let own = format!("../{}/a.bin", root.file_name().unwrap().to_string_lossy());
        assert_eq!(found(&own).unwrap(), root.join("a.bin"));
    }

    #[test]
    fn a_folder_and_a_device_are_no_files() {
        for path in ["/", "/dev/zero"].map(Path::new) {
            if path.exists() {
                let error = read_file(path, 10).unwrap_err().to_string();
                assert!(error.contains("not a regular file"), "{error}");
            }
        }
    }
}

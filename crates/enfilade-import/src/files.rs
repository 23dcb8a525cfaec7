//! Files on disk, read with a limit, and the pictures among them.

use crate::ImportError;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Reads a whole regular file of at most `limit` bytes.
pub(crate) fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, ImportError> {
    let read_error = |reason| ImportError::Read {
        path: path.to_path_buf(),
        reason,
    };
    let too_large = |n| ImportError::TooMuch {
        path: path.to_path_buf(),
        place: "file".into(),
        what: "bytes",
        n,
        limit,
    };
    // Asked before opening: opening a pipe would wait for a writer, and a device never ends.
    let meta = std::fs::metadata(path).map_err(read_error)?;
    if !meta.is_file() {
        return Err(read_error(std::io::Error::other("not a regular file")));
    }
    if meta.len() > limit {
        return Err(too_large(meta.len()));
    }
    let file = File::open(path).map_err(read_error)?;
    let mut bytes = Vec::new();
    file.take(limit.saturating_add(1))
        .read_to_end(&mut bytes)
        .map_err(read_error)?;
    if bytes.len() as u64 > limit {
        return Err(too_large(bytes.len() as u64));
    }
    Ok(bytes)
}

/// Decodes a `data:` URI; `None` if it is none, an error text if it is a bad one.
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
            .map_err(|e| format!("data URI is no base64: {e}"))
    } else {
        Ok(percent_encoding::percent_decode_str(body).collect())
    };
    Some(bytes.map(|bytes| (mime, bytes)))
}

/// The file that a relative reference means, or why it is refused.
///
/// `..` is allowed, as exporters write it; an absolute path or a URL is not.
pub(crate) fn resolve(folder: Option<&Path>, reference: &str) -> Result<PathBuf, String> {
    let Some(folder) = folder else {
        return Err(format!(
            "refers to the file '{reference}', but was read from memory"
        ));
    };
    let decoded = percent_encoding::percent_decode_str(reference).decode_utf8_lossy();
    let decoded = decoded.replace('\\', "/");
    let is_drive = decoded.as_bytes().get(1) == Some(&b':');
    if decoded.is_empty()
        || decoded.contains('\0')
        || decoded.contains("://")
        || is_drive
        || decoded.starts_with('/')
    {
        return Err(format!(
            "refers to '{reference}'; only paths relative to the file are followed"
        ));
    }
    let path = folder.join(&decoded);
    // A name may hold a literal percent sign that nobody escaped.
    if !path.exists() && folder.join(reference).exists() {
        return Ok(folder.join(reference));
    }
    Ok(path)
}

/// MIME type by the first bytes.
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
    fn references_out_of_reach_are_refused() {
        let here = Some(Path::new("/scene"));
        assert!(resolve(None, "a.bin").is_err());
        for bad in [
            "/etc/passwd",
            "http://host/a",
            "C:/a.png",
            "C:\\a.png",
            "",
            "a\0b",
        ] {
            assert!(resolve(here, bad).is_err(), "{bad}");
        }
        assert_eq!(
            resolve(here, "a%20b.bin").unwrap(),
            Path::new("/scene/a b.bin")
        );
        assert_eq!(
            resolve(here, "t\\a.png").unwrap(),
            Path::new("/scene/t/a.png")
        );
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

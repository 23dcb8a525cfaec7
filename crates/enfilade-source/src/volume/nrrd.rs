//! NRRD, with samples in the file or beside it, as bytes, gzip or text.

use enfilade_geom::{DMat3, DMat4, DVec3};

use super::gunzip::{check_ratio, gunzip_within};
use super::samples::{SampleKind, Stored, read};
use super::{Beside, Volume};
use crate::{SourceError, SourceLimits};

/// Longest head. [Units: bytes]
const MAX_HEAD: usize = 1 << 20;

pub(super) fn is_nrrd(bytes: &[u8]) -> bool {
    bytes.starts_with(b"NRRD000")
}

/// The fields of a head that matter here.
#[derive(Default)]
struct NrrdHead {
    kind: Option<SampleKind>,
    is_big: bool,
    sizes: Vec<usize>,
    encoding: String,
    directions: Vec<Option<DVec3>>,
    spacings: Vec<f64>,
    origin: DVec3,
    space: String,
    units: Vec<String>,
    file: Option<String>,
    n_skipped: usize,
    n_lines_skipped: usize,
}

fn bad(place: impl Into<String>, problem: impl Into<String>) -> SourceError {
    SourceError::new(place, problem)
}

pub(super) fn parse(
    bytes: &[u8],
    beside: &mut Beside<'_>,
    limits: &SourceLimits,
) -> Result<Volume, SourceError> {
    let (head, at) = read_head(bytes)?;
    let other;
    let mut data = match &head.file {
        None => bytes.get(at..).unwrap_or_default(),
        Some(name) => {
            other = beside(name).map_err(|e| bad("data file", e))?;
            &other
        }
    };
    for _ in 0..head.n_lines_skipped {
        let end = data.iter().position(|&b| b == b'\n');
        data = end.map_or(&[], |end| &data[end + 1..]);
    }
    let (size, axes) = axes(&head)?;
    let n = Volume::check_size(size, limits)?;
    let kind = head
        .kind
        .ok_or_else(|| bad("header", "\"type\" is missing"))?;
    let stored = Stored {
        kind,
        is_big: head.is_big,
        scale: [1.0, 0.0],
    };
    let n_bytes = n as u64 * kind.size() as u64;
    let values = match head.encoding.as_str() {
        "raw" => read(
            data.get(head.n_skipped..).unwrap_or_default(),
            n,
            stored,
            limits,
        )?,
        "gzip" | "gz" => {
            check_ratio(data, n, limits)?;
            let most = n_bytes.saturating_add(head.n_skipped as u64);
            let plain = gunzip_within(data, most, limits)?;
            let plain = plain.ok_or_else(|| bad("samples", "are damaged: not gzip"))?;
            read(
                plain.get(head.n_skipped..).unwrap_or_default(),
                n,
                stored,
                limits,
            )?
        }
        "ascii" | "text" | "txt" => text_values(data, n, limits)?,
        other => {
            let problem = format!("'{}'; save it as raw or gzip", crate::shortened(other));
            return Err(bad("encoding", problem));
        }
    };
    Ok(Volume {
        size,
        values,
        placement: placement(&head, axes)?,
        unit: match head.units.first().map(String::as_str) {
            Some("mm") => Some(1e-3),
            Some("cm") => Some(1e-2),
            Some("um" | "micron") => Some(1e-6),
            Some("m") => Some(1.0),
            // Anatomical spaces are in millimeters.
            _ if !anatomical(&head.space).is_empty() => Some(1e-3),
            _ => None,
        },
        is_z_up: !anatomical(&head.space).is_empty(),
    })
}

fn read_head(bytes: &[u8]) -> Result<(NrrdHead, usize), SourceError> {
    let mut head = NrrdHead {
        encoding: "raw".into(),
        ..NrrdHead::default()
    };
    let mut at = 0;
    for number in 1.. {
        let Some(n) = bytes[at..].iter().take(MAX_HEAD).position(|&b| b == b'\n') else {
            if at == bytes.len() && head.file.is_some() {
                break;
            }
            return Err(bad(
                format!("line {number}"),
                "the head is cut off, or its empty line is missing",
            ));
        };
        let line = String::from_utf8_lossy(&bytes[at..at + n]);
        let line = line.trim_end_matches('\r');
        at += n + 1;
        if line.is_empty() {
            break;
        }
        if number == 1 || line.starts_with('#') || line.contains(":=") {
            continue;
        }
        let Some((key, value)) = line.split_once(": ") else {
            return Err(bad(format!("line {number}"), "is not `field: value`"));
        };
        field(&mut head, key.trim(), value.trim())
            .map_err(|problem| bad(format!("line {number}: {}", crate::shortened(key)), problem))?;
        if at > MAX_HEAD {
            return Err(bad(
                format!("line {number}"),
                "the head is longer than 1 MiB",
            ));
        }
    }
    Ok((head, at))
}

fn field(head: &mut NrrdHead, key: &str, value: &str) -> Result<(), String> {
    let words = || value.split_ascii_whitespace();
    let not = || format!("'{}' is not understood", crate::shortened(value));
    match key {
        "type" => {
            head.kind = Some(SampleKind::of_name(value).ok_or_else(|| {
                format!(
                    "'{}'; save it with integers or real numbers",
                    crate::shortened(value)
                )
            })?);
        }
        "sizes" => {
            let all: Result<_, _> = words().map(str::parse).collect();
            head.sizes = all.map_err(|_| not())?;
        }
        "encoding" => head.encoding = value.to_ascii_lowercase(),
        "endian" => head.is_big = value == "big",
        "spacings" => {
            head.spacings = words()
                .map(str::parse)
                .collect::<Result<_, _>>()
                .map_err(|_| not())?;
        }
        "space" => head.space = value.to_ascii_lowercase(),
        "space origin" => head.origin = vector(value).ok_or_else(not)?,
        "space directions" => {
            let one = |w: &str| {
                if w == "none" {
                    Some(None)
                } else {
                    vector(w).map(Some)
                }
            };
            let all: Option<Vec<_>> = split_vectors(value).iter().map(|w| one(w)).collect();
            head.directions = all.ok_or_else(not)?;
        }
        "space units" | "units" => {
            let texts = words().map(|w| w.trim_matches('"').to_owned());
            head.units = texts.filter(|w| !w.is_empty()).collect();
        }
        "data file" | "datafile" => {
            if value.starts_with("LIST") || value.contains('%') {
                return Err("many files; save the samples in one".into());
            }
            head.file = Some(value.into());
        }
        "byte skip" | "byteskip" => head.n_skipped = value.parse().map_err(|_| not())?,
        "line skip" | "lineskip" => {
            head.n_lines_skipped = value
                .parse()
                .ok()
                .filter(|n| *n <= MAX_HEAD)
                .ok_or_else(not)?;
        }
        _ => {}
    }
    Ok(())
}

/// Splits vectors at blanks that are not in parentheses.
fn split_vectors(text: &str) -> Vec<String> {
    let (mut all, mut last, mut depth) = (Vec::new(), String::new(), 0);
    for c in text.chars() {
        depth += i32::from(c == '(') - i32::from(c == ')');
        if c.is_whitespace() && depth <= 0 {
            all.push(std::mem::take(&mut last));
        } else if !c.is_whitespace() {
            last.push(c);
        }
    }
    all.push(last);
    all.retain(|w| !w.is_empty());
    all
}

fn vector(text: &str) -> Option<DVec3> {
    let inner = text.trim().strip_prefix('(')?.strip_suffix(')')?;
    let all: Result<Vec<f64>, _> = inner.split(',').map(|w| w.trim().parse()).collect();
    match all.ok()?.as_slice() {
        [x, y, z] => Some(DVec3::new(*x, *y, *z)),
        _ => None,
    }
}

/// Returns the sizes of the three axes, and which axes of the file they are.
fn axes(head: &NrrdHead) -> Result<([usize; 3], [usize; 3]), SourceError> {
    // Series and colors of one entry do not count.
    let used: Vec<usize> = (0..head.sizes.len())
        .filter(|&a| head.sizes[a] > 1)
        .collect();
    let [x, y, z] = used.as_slice() else {
        let problem = format!(
            "{:?}: a volume has three axes of several samples",
            head.sizes
        );
        return Err(bad("sizes", problem));
    };
    let axes = [*x, *y, *z];
    Ok((axes.map(|a| head.sizes[a]), axes))
}

/// Returns the signs that turn a space into one from left to right, from back to front, from feet to head.
fn anatomical(space: &str) -> &'static [f64] {
    match space {
        "right-anterior-superior" | "ras" => &[1.0, 1.0, 1.0],
        "left-anterior-superior" | "las" => &[-1.0, 1.0, 1.0],
        "left-posterior-superior" | "lps" => &[-1.0, -1.0, 1.0],
        _ => &[],
    }
}

fn placement(head: &NrrdHead, axes: [usize; 3]) -> Result<DMat4, SourceError> {
    let along = axes.map(|a| {
        let direction = head.directions.get(a).copied().flatten();
        let spacing = head.spacings.get(a).copied().filter(|s| s.is_finite());
        (direction, spacing.unwrap_or(1.0).abs())
    });
    let mut columns = [DVec3::ZERO; 3];
    for (i, (direction, spacing)) in along.into_iter().enumerate() {
        columns[i] = direction.unwrap_or(DVec3::AXES[i] * spacing);
    }
    let [x, y, z] = columns;
    let signs = anatomical(&head.space);
    let signs = if signs.is_empty() {
        DVec3::ONE
    } else {
        DVec3::from_slice(signs)
    };
    let matrix = DMat3::from_diagonal(signs) * DMat3::from_cols(x, y, z);
    super::checked(DMat4::from_translation(head.origin * signs) * DMat4::from_mat3(matrix))
}

fn text_values(data: &[u8], n: usize, limits: &SourceLimits) -> Result<Vec<f32>, SourceError> {
    let words = data
        .split(|b| b.is_ascii_whitespace() || *b == b',')
        .filter(|w| !w.is_empty());
    let mut values = Vec::new();
    for (i, word) in words.take(n).enumerate() {
        limits.spend(1)?;
        let value = std::str::from_utf8(word)
            .ok()
            .and_then(|w| w.parse::<f32>().ok());
        let value = value.ok_or_else(|| bad(format!("sample {i}"), "is not a number"))?;
        values.push(value.clamp(f32::MIN, f32::MAX));
    }
    if values.len() < n {
        let problem = format!(
            "the file is cut off: it has {} samples, and the head promises {n}",
            values.len()
        );
        return Err(bad("samples", problem));
    }
    Ok(values)
}

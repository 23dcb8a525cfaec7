//! NIfTI-1 and NIfTI-2, in one file or two, compressed or not.

use enfilade_geom::{DMat3, DMat4, DQuat, DVec3, DVec4};

use super::gunzip::{check_ratio, gunzip_within};
use super::samples::{SampleKind, Stored, read};
use super::{Beside, Volume, gunzip, is_gzip};
use crate::{SourceError, SourceLimits};

const HEAD_1: usize = 348;
const HEAD_2: usize = 540;

pub(super) fn is_nifti(bytes: &[u8]) -> bool {
    let magic_1 = bytes.get(344..347);
    let magic_2 = bytes.get(4..7);
    [magic_1, magic_2]
        .iter()
        .any(|m| matches!(m, Some(b"n+1" | b"ni1" | b"n+2" | b"ni2")))
}

/// A head of either version.
struct NiftiHead<'b> {
    bytes: &'b [u8],
    is_big: bool,
    is_second: bool,
}

impl NiftiHead<'_> {
    fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut b = [0; N];
        if let Some(found) = self.bytes.get(at..at + N) {
            b.copy_from_slice(found);
        }
        if self.is_big {
            b.reverse();
        }
        b
    }

    fn short(&self, at: usize) -> i64 {
        i16::from_le_bytes(self.bytes(at)).into()
    }

    /// Returns an integer of the version's width: 16 or 64 bits in dimensions, 32 in codes of version 2.
    fn dimension(&self, i: usize) -> i64 {
        if self.is_second {
            i64::from_le_bytes(self.bytes(16 + 8 * i))
        } else {
            self.short(40 + 2 * i)
        }
    }

    fn code(&self, first: usize, second: usize) -> i64 {
        if self.is_second {
            i32::from_le_bytes(self.bytes(second)).into()
        } else {
            self.short(first)
        }
    }

    fn number(&self, first: usize, second: usize, i: usize) -> f64 {
        if self.is_second {
            f64::from_le_bytes(self.bytes(second + 8 * i))
        } else {
            f32::from_le_bytes(self.bytes(first + 4 * i)).into()
        }
    }
}

pub(super) fn parse(
    bytes: &[u8],
    beside: &mut Beside<'_>,
    limits: &SourceLimits,
) -> Result<Volume, SourceError> {
    let bad = |place: &str, problem: String| SourceError::new(place, problem);
    let file = bytes;
    let plain;
    let bytes = if is_gzip(file) {
        plain = gunzip(file, HEAD_2 as u64).ok_or_else(|| bad("file", "is no gzip".into()))?;
        &plain
    } else {
        file
    };
    let Some(size) = bytes.first_chunk::<4>() else {
        return Err(bad("header", "the file is cut off".into()));
    };
    let (little, big) = (
        u32::from_le_bytes(*size) as usize,
        u32::from_be_bytes(*size) as usize,
    );
    let is_second = [little, big].contains(&HEAD_2);
    if !is_second && ![little, big].contains(&HEAD_1) {
        return Err(bad(
            "header",
            format!("its length is {little}, not {HEAD_1} or {HEAD_2}"),
        ));
    }
    let n_head = if is_second { HEAD_2 } else { HEAD_1 };
    if bytes.len() < n_head {
        return Err(bad("header", "the file is cut off".into()));
    }
    let head = NiftiHead {
        bytes: &bytes[..n_head],
        is_big: big == n_head,
        is_second,
    };
    let size = dimensions(&head)?;
    let n = Volume::check_size(size, limits)?;
    let stored = stored(&head)?;
    let is_apart = matches!(
        bytes.get(if is_second { 4..7 } else { 344..347 }),
        Some(b"ni1" | b"ni2")
    );
    let offset = head.number(108, 168, 0);
    // An offset is an integer in version 2.
    let offset = if is_second {
        i64::from_le_bytes(head.bytes(168)) as f64
    } else {
        offset
    };
    let n_after = offset.clamp(0.0, 1e15) as usize;
    let values = if is_apart {
        let other = beside(".img").map_err(|e| bad("samples", e))?;
        read(other.get(n_after..).unwrap_or_default(), n, stored, limits)?
    } else {
        if n_after < n_head {
            return Err(bad(
                "header.vox_offset",
                format!("{offset} lies within the header"),
            ));
        }
        let unpacked;
        let bytes = if is_gzip(file) {
            check_ratio(file, n, limits)?;
            // No more than the header promises.
            let most = (n_after as u64).saturating_add((n * stored.kind.size()) as u64);
            unpacked = gunzip_within(file, most, limits)?.unwrap_or_default();
            &unpacked
        } else {
            file
        };
        read(bytes.get(n_after..).unwrap_or_default(), n, stored, limits)?
    };
    Ok(Volume {
        size,
        values,
        placement: placement(&head)?,
        unit: match head.code(123, 500) & 7 {
            _ if is_second => unit(i32::from_le_bytes(head.bytes(500)).into()),
            _ => unit(i64::from(head.bytes[123])),
        },
        is_z_up: head.code(254, 348) > 0 || head.code(252, 344) > 0,
    })
}

fn unit(code: i64) -> Option<f64> {
    match code & 7 {
        1 => Some(1.0),
        2 => Some(1e-3),
        3 => Some(1e-6),
        _ => None,
    }
}

fn dimensions(head: &NiftiHead<'_>) -> Result<[usize; 3], SourceError> {
    let n = head.dimension(0);
    let bad = |problem: String| Err(SourceError::new("header.dim", problem));
    if !(1..=7).contains(&n) {
        return bad(format!("{n} dimensions; a volume has three"));
    }
    let all: Vec<i64> = (1..=7)
        .map(|i| {
            if i <= n as usize {
                head.dimension(i)
            } else {
                1
            }
        })
        .collect();
    if all[3..].iter().any(|&n| n > 1) {
        return bad(format!(
            "{n} dimensions; give one volume of the series, or one channel"
        ));
    }
    if all.iter().any(|&n| n < 1) {
        return bad(format!("{all:?} samples"));
    }
    Ok([0, 1, 2].map(|i| all[i] as usize))
}

fn stored(head: &NiftiHead<'_>) -> Result<Stored, SourceError> {
    let code = head.code(70, 12);
    let code = if head.is_second {
        i64::from(i16::from_le_bytes(head.bytes(12)))
    } else {
        code
    };
    let kind = match code {
        2 => SampleKind::U8,
        4 => SampleKind::I16,
        8 => SampleKind::I32,
        16 => SampleKind::F32,
        64 => SampleKind::F64,
        256 => SampleKind::I8,
        512 => SampleKind::U16,
        768 => SampleKind::U32,
        1024 => SampleKind::I64,
        1280 => SampleKind::U64,
        _ => {
            let problem =
                format!("type {code}; save it with integers or real numbers, one a voxel");
            return Err(SourceError::new("header.datatype", problem));
        }
    };
    let (slope, intercept) = (head.number(112, 176, 0), head.number(116, 184, 0));
    let is_scaled = slope != 0.0 && slope.is_finite() && intercept.is_finite();
    Ok(Stored {
        kind,
        is_big: head.is_big,
        scale: if is_scaled {
            [slope, intercept]
        } else {
            [1.0, 0.0]
        },
    })
}

/// Returns indices to space, by the header's matrix, else its rotation, else its distances.
fn placement(head: &NiftiHead<'_>) -> Result<DMat4, SourceError> {
    let row = |r: usize| {
        let at = |i: usize| head.number(280 + 16 * r, 400 + 32 * r, i);
        DVec4::new(at(0), at(1), at(2), at(3))
    };
    let distances = DVec3::from_array([1, 2, 3].map(|i| head.number(76, 104, i).abs()));
    let made = if head.code(254, 348) > 0 {
        DMat4::from_cols(row(0), row(1), row(2), DVec4::W).transpose()
    } else if head.code(252, 344) > 0 {
        let at = |i: usize| head.number(256, 352, i);
        let (b, c, d) = (at(0), at(1), at(2));
        let a = (1.0 - b * b - c * c - d * d).max(0.0).sqrt();
        let turn = DMat3::from_quat(DQuat::from_xyzw(b, c, d, a).normalize());
        let side = if head.number(76, 104, 0) < 0.0 {
            -1.0
        } else {
            1.0
        };
        let scale = DMat3::from_diagonal(distances * DVec3::new(1.0, 1.0, side));
        let by = DVec3::new(at(3), at(4), at(5));
        DMat4::from_translation(by) * DMat4::from_mat3(turn * scale)
    } else {
        DMat4::from_scale(distances)
    };
    super::checked(made)
}

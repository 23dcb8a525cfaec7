//! Samples of all types as single precision numbers.

use crate::{SourceError, SourceLimits};

/// Type of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleKind {
    /// 8 bits, with sign.
    I8,
    /// 8 bits.
    U8,
    /// 16 bits, with sign.
    I16,
    /// 16 bits.
    U16,
    /// 32 bits, with sign.
    I32,
    /// 32 bits.
    U32,
    /// 64 bits, with sign.
    I64,
    /// 64 bits.
    U64,
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

impl SampleKind {
    /// Returns the type by the names that NRRD and others use.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Some(match name {
            "signed char" | "int8" | "int8_t" => Self::I8,
            "uchar" | "unsigned char" | "uint8" | "uint8_t" => Self::U8,
            "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => {
                Self::I16
            }
            "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Self::U16,
            "int" | "signed int" | "int32" | "int32_t" => Self::I32,
            "uint" | "unsigned int" | "uint32" | "uint32_t" => Self::U32,
            "longlong" | "long long" | "long long int" | "signed long long" | "int64"
            | "int64_t" => Self::I64,
            "ulonglong" | "unsigned long long" | "uint64" | "uint64_t" => Self::U64,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Returns its size. [Units: bytes]
    #[must_use]
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    fn read(self, b: [u8; 8]) -> f64 {
        match self {
            Self::I8 => f64::from(b[0] as i8),
            Self::U8 => b[0].into(),
            Self::I16 => i16::from_le_bytes([b[0], b[1]]).into(),
            Self::U16 => u16::from_le_bytes([b[0], b[1]]).into(),
            Self::I32 => i32::from_le_bytes([b[0], b[1], b[2], b[3]]).into(),
            Self::U32 => u32::from_le_bytes([b[0], b[1], b[2], b[3]]).into(),
            Self::I64 => i64::from_le_bytes(b) as f64,
            Self::U64 => u64::from_le_bytes(b) as f64,
            Self::F32 => f32::from_le_bytes([b[0], b[1], b[2], b[3]]).into(),
            Self::F64 => f64::from_le_bytes(b),
        }
    }
}

/// How samples are stored.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stored {
    pub(super) kind: SampleKind,
    pub(super) is_big: bool,
    /// Factor and addend that turn a stored number into a value.
    pub(super) scale: [f64; 2],
}

/// Samples between two looks at the limits.
const PART: usize = 1 << 16;

/// Reads `n` samples. Infinite values become the largest number.
pub(super) fn read(
    bytes: &[u8],
    n: usize,
    stored: Stored,
    limits: &SourceLimits,
) -> Result<Vec<f32>, SourceError> {
    let size = stored.kind.size();
    if bytes.len() / size < n {
        let problem = format!(
            "the file is cut off: it has {} samples of {size} bytes, and the header promises {n}",
            bytes.len() / size
        );
        return Err(SourceError::new("samples", problem));
    }
    let [factor, addend] = stored.scale;
    let value = |chunk: &[u8]| {
        let mut b = [0; 8];
        b[..size].copy_from_slice(chunk);
        if stored.is_big {
            b[..size].reverse();
        }
        let v = (stored.kind.read(b) * factor + addend) as f32;
        // Keeps NaN.
        v.clamp(f32::MIN, f32::MAX)
    };
    let mut values = Vec::with_capacity(n);
    for part in bytes[..n * size].chunks(size * PART) {
        limits.spend(PART as u64 / 16)?;
        values.extend(part.chunks_exact(size).map(value));
    }
    Ok(values)
}

//! Accessors: typed reads from buffers, every offset and count checked before it is used.

use super::json::{Accessor, BufferView, Root};
use std::borrow::Cow;

/// A glTF document with its buffers; missing buffers are `None`.
pub(super) struct Document<'a> {
    pub(super) root: Root,
    pub(super) buffers: Vec<Option<Cow<'a, [u8]>>>,
    /// Decompressed bytes of each compressed buffer view.
    pub(super) plain_views: Vec<Option<Vec<u8>>>,
}

/// Storage type of a component.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn new(code: u32) -> Result<Self, String> {
        Ok(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return Err(format!("unknown component type {code}")),
        })
    }

    pub(super) fn size(self) -> u64 {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// Reads one component, mapping integers as glTF 2.0 §3.6.2.2 (accessor data types).
    fn read(self, bytes: &[u8], normalized: bool) -> f32 {
        let (value, most) = match self {
            Self::I8 => (f32::from(bytes[0] as i8), 127.0),
            Self::U8 => (f32::from(bytes[0]), 255.0),
            Self::I16 => (f32::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32767.0),
            Self::U16 => (f32::from(u16::from_le_bytes([bytes[0], bytes[1]])), 65535.0),
            Self::U32 => (read_u32(bytes) as f32, 4_294_967_295.0),
            Self::F32 => return f32::from_bits(read_u32(bytes)),
        };
        if normalized {
            (value / most).max(-1.0)
        } else {
            value
        }
    }

    /// Returns the distance of neighboring values; 0 for floats: rounding each by its own value keeps equal ones
    /// equal.
    fn step(self, normalized: bool) -> f32 {
        match self {
            Self::F32 => 0.0,
            _ if !normalized => 1.0,
            Self::I8 => 1.0 / 127.0,
            Self::U8 => 1.0 / 255.0,
            Self::I16 => 1.0 / 32767.0,
            Self::U16 => 1.0 / 65535.0,
            Self::U32 => 0.0,
        }
    }

    fn read_index(self, bytes: &[u8]) -> u32 {
        match self {
            Self::U8 | Self::I8 => bytes[0].into(),
            Self::U16 | Self::I16 => u16::from_le_bytes([bytes[0], bytes[1]]).into(),
            Self::U32 | Self::F32 => read_u32(bytes),
        }
    }
}

fn read_u32(bytes: &[u8]) -> u32 {
    u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
}

/// A checked accessor: all of its elements lie inside its bytes.
pub(super) struct Elements<'d> {
    /// Number of elements; never more than the bytes hold, unless there are no bytes (then all are zero).
    pub(super) count: u64,
    pub(super) component: Component,
    n_components: usize,
    normalized: bool,
    bytes: Option<(&'d [u8], usize)>,
    /// Strictly increasing, each below `count`.
    sparse_indices: Vec<u32>,
    sparse_values: &'d [u8],
    /// Width of the grid that the values were rounded to; 0 if they were not rounded.
    pub(super) step: f32,
}

impl<'a> Document<'a> {
    /// Returns the bytes and the definition of a buffer view.
    pub(super) fn view(&self, index: u32) -> Result<(&[u8], &BufferView), String> {
        let view = self
            .root
            .buffer_views
            .get(index as usize)
            .ok_or_else(|| format!("no buffer view {index}"))?;
        if let Some(Some(plain)) = self.plain_views.get(index as usize) {
            return Ok((plain, view));
        }
        let missing = || format!("buffer {} of buffer view {index} has no data", view.buffer);
        let buffer = self
            .buffers
            .get(view.buffer as usize)
            .ok_or_else(|| format!("buffer view {index}: no buffer {}", view.buffer))?;
        let buffer = buffer.as_ref().ok_or_else(missing)?;
        let end = view.byte_offset.checked_add(view.byte_length);
        end.and_then(|end| {
            buffer.get(usize::try_from(view.byte_offset).ok()?..usize::try_from(end).ok()?)
        })
        .map(|bytes| (bytes, view))
        .ok_or_else(|| {
            format!(
                "buffer view {index} needs bytes {}+{} of buffer {}, which has {}",
                view.byte_offset,
                view.byte_length,
                view.buffer,
                buffer.len()
            )
        })
    }

    /// Checks an accessor, which must have one of the `shapes`.
    pub(super) fn elements(&self, index: u32, shapes: &[&str]) -> Result<Elements<'_>, String> {
        let at = |problem: String| format!("accessor {index}: {problem}");
        let accessor = self
            .root
            .accessors
            .get(index as usize)
            .ok_or_else(|| format!("no accessor {index}"))?;
        if !shapes.contains(&accessor.shape.as_str()) {
            return Err(at(format!(
                "is {}, not {}",
                accessor.shape,
                shapes.join(" or ")
            )));
        }
        let n_components: usize = match accessor.shape.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            other => return Err(at(format!("is {other}"))),
        };
        let component = Component::new(accessor.component_type).map_err(at)?;
        if accessor.count > u64::from(u32::MAX) {
            return Err(at(format!("{} elements", accessor.count)));
        }
        let size = component.size() * n_components as u64;
        let bytes = match accessor.buffer_view {
            None => None,
            Some(view) => {
                let (bytes, view) = self.view(view).map_err(at)?;
                let stride = view.byte_stride.unwrap_or(size);
                if stride < size {
                    return Err(at(format!(
                        "stride {stride} is less than an element's {size}"
                    )));
                }
                let bytes =
                    span(bytes, accessor.byte_offset, accessor.count, stride, size).map_err(at)?;
                Some((bytes, stride as usize))
            }
        };
        let mut elements = Elements {
            count: accessor.count,
            component,
            n_components,
            normalized: accessor.normalized,
            bytes,
            sparse_indices: Vec::new(),
            sparse_values: &[],
            step: component.step(accessor.normalized),
        };
        self.read_sparse(accessor, size, &mut elements)
            .map_err(|problem| at(format!("sparse: {problem}")))?;
        Ok(elements)
    }

    fn read_sparse<'d>(
        &'d self,
        accessor: &Accessor,
        size: u64,
        elements: &mut Elements<'d>,
    ) -> Result<(), String> {
        let Some(sparse) = &accessor.sparse else {
            return Ok(());
        };
        if sparse.count > accessor.count {
            return Err(format!("{} of {} elements", sparse.count, accessor.count));
        }
        let component = Component::new(sparse.indices.component_type)?;
        if !matches!(component, Component::U8 | Component::U16 | Component::U32) {
            return Err(format!("indices are {component:?}"));
        }
        let width = component.size();
        let (bytes, _) = self.view(sparse.indices.buffer_view)?;
        let bytes = span(
            bytes,
            sparse.indices.byte_offset,
            sparse.count,
            width,
            width,
        )?;
        let indices: Vec<u32> = bytes
            .chunks_exact(width as usize)
            .map(|b| component.read_index(b))
            .collect();
        if indices.windows(2).any(|pair| pair[0] >= pair[1])
            || indices
                .last()
                .is_some_and(|&i| u64::from(i) >= accessor.count)
        {
            return Err("indices do not increase or are out of range".into());
        }
        let (bytes, _) = self.view(sparse.values.buffer_view)?;
        elements.sparse_values = span(bytes, sparse.values.byte_offset, sparse.count, size, size)?;
        elements.sparse_indices = indices;
        Ok(())
    }
}

/// Returns the bytes of `count` elements from `offset`, `stride` apart, the last one `size` long.
fn span(bytes: &[u8], offset: u64, count: u64, stride: u64, size: u64) -> Result<&[u8], String> {
    if count == 0 {
        return Ok(&[]);
    }
    let length = stride
        .checked_mul(count - 1)
        .and_then(|n| n.checked_add(size));
    let end = length.and_then(|n| n.checked_add(offset));
    end.and_then(|end| bytes.get(usize::try_from(offset).ok()?..usize::try_from(end).ok()?))
        .ok_or_else(|| {
            format!(
                "{count} elements of {size} bytes, {stride} apart from byte {offset}, \
                 do not fit its {} bytes",
                bytes.len()
            )
        })
}

impl<'d> Elements<'d> {
    /// Returns elements without gaps.
    pub(super) fn of_bytes(
        bytes: &'d [u8],
        component: Component,
        n_components: usize,
        normalized: bool,
        step: f32,
    ) -> Self {
        let size = component.size() as usize * n_components;
        Self {
            count: (bytes.len() / size.max(1)) as u64,
            component,
            n_components,
            normalized,
            bytes: Some((bytes, size)),
            sparse_indices: Vec::new(),
            sparse_values: &[],
            step,
        }
    }

    /// Returns the bytes of element `i`; `None` where it is zero by definition.
    fn element(&self, i: u32) -> Option<&[u8]> {
        let size = self.component.size() as usize * self.n_components;
        if let Ok(k) = self.sparse_indices.binary_search(&i) {
            return self.sparse_values.get(k * size..(k + 1) * size);
        }
        let (bytes, stride) = self.bytes?;
        bytes.get(i as usize * stride..i as usize * stride + size)
    }

    /// Returns element `i`, with `fill` for components that the accessor lacks.
    fn get<const N: usize>(&self, i: u32, fill: f32) -> [f32; N] {
        let mut value = [fill; N];
        let n = N.min(self.n_components);
        let Some(bytes) = self.element(i) else {
            value[..n].fill(0.0);
            return value;
        };
        let size = self.component.size() as usize;
        for (k, v) in value[..n].iter_mut().enumerate() {
            *v = self.component.read(&bytes[k * size..], self.normalized);
        }
        value
    }

    /// Returns all elements, or those picked; picked numbers must be below `count`.
    pub(super) fn read<const N: usize>(&self, pick: Option<&[u32]>, fill: f32) -> Vec<[f32; N]> {
        match pick {
            Some(pick) => pick.iter().map(|&i| self.get(i, fill)).collect(),
            None => (0..self.count as u32).map(|i| self.get(i, fill)).collect(),
        }
    }

    /// Returns all elements as indices.
    pub(super) fn read_indices(&self) -> Result<Vec<u32>, String> {
        if !matches!(
            self.component,
            Component::U8 | Component::U16 | Component::U32
        ) {
            return Err(format!("indices are {:?}", self.component));
        }
        Ok((0..self.count as u32)
            .map(|i| self.element(i).map_or(0, |b| self.component.read_index(b)))
            .collect())
    }
}

//! Arrays of numbers in a buffer: what accessors and buffer views mean.

use std::ops::Range;

use enfilade_geom::scene::Primitive;

use super::json::{self, FLOAT, U8, U16, U32};
use super::rows::{Row, four};
use super::{WireError, broken};

/// Reads arrays from a buffer. Nothing is allocated from an unchecked count.
pub(super) struct Arrays<'a> {
    accessors: &'a [json::Accessor],
    views: &'a [json::BufferView],
    bin: &'a [u8],
    /// Number of bytes that may still be decoded.
    budget: u64,
}

impl<'a> Arrays<'a> {
    pub(super) fn new(
        accessors: &'a [json::Accessor],
        views: &'a [json::BufferView],
        bin: &'a [u8],
    ) -> Self {
        Self {
            accessors,
            views,
            bin,
            budget: 4 * bin.len() as u64,
        }
    }

    pub(super) fn primitive(&mut self, p: &json::Primitive) -> Result<Primitive, WireError> {
        let named = |name: &str| p.attributes.get(name).copied();
        let position =
            named("POSITION").ok_or_else(|| broken("a primitive", "has no positions"))?;
        let mut uvs = Vec::new();
        while let Some(accessor) = named(&format!("TEXCOORD_{}", uvs.len())) {
            uvs.push(self.rows(accessor)?);
        }
        let indices = p
            .indices
            .ok_or_else(|| broken("a primitive", "has no indices"))?;
        Ok(Primitive {
            positions: self.rows(position)?,
            normals: self.optional_rows(named("NORMAL"))?,
            tangents: self.optional_rows(named("TANGENT"))?,
            uvs,
            colors: self.optional_rows(named("COLOR_0"))?,
            indices: self.indices(indices)?,
            material: p.material,
        })
    }

    fn optional_rows<R: Row>(&mut self, accessor: Option<u32>) -> Result<Vec<R>, WireError> {
        accessor.map_or(Ok(Vec::new()), |a| self.rows(a))
    }

    pub(super) fn rows<R: Row>(&mut self, accessor: u32) -> Result<Vec<R>, WireError> {
        let (bytes, stride, component_type, kind) = self.accessor(accessor, |_| R::SIZE)?;
        if component_type != FLOAT || kind != R::KIND {
            let want = R::KIND;
            return Err(broken(
                format!("accessor {accessor}"),
                format!("is not a {want} of floats"),
            ));
        }
        Ok(bytes.chunks(stride).map(|row| R::of_bytes(row)).collect())
    }

    fn indices(&mut self, accessor: u32) -> Result<Vec<u32>, WireError> {
        let size = |component_type| match component_type {
            U8 => 1,
            U16 => 2,
            _ => 4,
        };
        let (bytes, stride, component_type, kind) = self.accessor(accessor, size)?;
        if !matches!(component_type, U8 | U16 | U32) || kind != "SCALAR" {
            return Err(broken(format!("accessor {accessor}"), "holds no indices"));
        }
        let rows = bytes.chunks(stride);
        Ok(match component_type {
            U8 => rows.map(|b| b[0].into()).collect(),
            U16 => rows
                .map(|b| u16::from_le_bytes([b[0], b[1]]).into())
                .collect(),
            _ => rows.map(|b| u32::from_le_bytes(four(b, 0))).collect(),
        })
    }

    /// Returns bytes, stride, component type and kind of an accessor whose rows take `size` bytes, by component type.
    /// The bytes end with the last row, so their chunks of `stride` bytes are the rows.
    fn accessor(
        &mut self,
        accessor: u32,
        size: impl Fn(u32) -> usize,
    ) -> Result<(&'a [u8], usize, u32, &'a str), WireError> {
        let at = || format!("accessor {accessor}");
        let a =
            (self.accessors.get(accessor as usize)).ok_or_else(|| broken(at(), "is missing"))?;
        let size = size(a.component_type);
        let (range, stride) = self.extent(accessor, size)?;
        let bytes = self.bin.get(range);
        let bytes = bytes.ok_or_else(|| broken(at(), "extends beyond its buffer view"))?;
        // Memory that decoding allocates: rows of their own size, indices as four bytes.
        self.spend(a.count * size.max(4) as u64)?;
        Ok((bytes, stride, a.component_type, &a.kind))
    }

    /// Returns the range of an accessor's bytes in the buffer, from its first row to the end of its last, and the stride.
    pub(super) fn extent(
        &self,
        accessor: u32,
        size: usize,
    ) -> Result<(Range<usize>, usize), WireError> {
        let at = || format!("accessor {accessor}");
        let a =
            (self.accessors.get(accessor as usize)).ok_or_else(|| broken(at(), "is missing"))?;
        let view = a
            .buffer_view
            .ok_or_else(|| broken(at(), "has no buffer view"))?;
        let whole = self.range(view, at)?;
        let stride = match self.views[view as usize].byte_stride {
            None => size,
            Some(stride) if stride >= size as u64 && stride <= 252 => stride as usize,
            Some(stride) => return Err(broken(at(), format!("invalid stride {stride}"))),
        };
        let beyond = || broken(at(), "extends beyond its buffer view");
        let start = usize::try_from(a.byte_offset).map_err(|_| beyond())?;
        let n = match a.count.checked_sub(1) {
            None => Some(0),
            Some(last) => last
                .checked_mul(stride as u64)
                .and_then(|n| n.checked_add(size as u64)),
        };
        let n = n.and_then(|n| usize::try_from(n).ok());
        let end = n.and_then(|n| start.checked_add(n));
        let end = end.filter(|end| *end <= whole.len()).ok_or_else(beyond)?;
        Ok((whole.start + start..whole.start + end, stride))
    }

    pub(super) fn optional_view(&self, view: Option<u32>, of: &str) -> Result<&'a [u8], WireError> {
        view.map_or(Ok(&[]), |view| self.view(view, || of.to_owned()))
    }

    pub(super) fn view(&self, view: u32, of: impl Fn() -> String) -> Result<&'a [u8], WireError> {
        Ok(&self.bin[self.range(view, of)?])
    }

    /// Returns the range of a buffer view in the buffer, which holds it.
    pub(super) fn range(
        &self,
        view: u32,
        of: impl Fn() -> String,
    ) -> Result<Range<usize>, WireError> {
        let missing = || broken(of(), format!("no buffer view {view}"));
        let v = self.views.get(view as usize).ok_or_else(missing)?;
        let beyond = || broken(of(), format!("buffer view {view} extends beyond the file"));
        if v.buffer != 0 {
            return Err(broken(
                of(),
                "its buffer is in another file; a world is a single GLB",
            ));
        }
        let start = usize::try_from(v.byte_offset).map_err(|_| beyond())?;
        let len = usize::try_from(v.byte_length).map_err(|_| beyond())?;
        let end = start.checked_add(len).filter(|end| *end <= self.bin.len());
        Ok(start..end.ok_or_else(beyond)?)
    }

    /// Counts decoded bytes. Our files use every byte once (indices may grow from one byte to four); a file that has
    /// megabytes decoded a thousand times is an attack.
    pub(super) fn spend(&mut self, bytes: u64) -> Result<(), WireError> {
        let left = self.budget.checked_sub(bytes);
        self.budget =
            left.ok_or_else(|| broken("the file", "decodes to far more than it holds"))?;
        Ok(())
    }
}

//! Skeletons as bytes: little-endian, columns of equal numbers behind one another so that they compress.
//!
//! A mark and a version, counts, chunks, objects, polygons that hide, visibility by cell, and a checksum of all before it.
//! Decoding takes memory in proportion to the bytes.

use enfilade_cpg::VisibleParts;
use enfilade_geom::{Aabb, DVec3};

use super::drawn::Detail;
use super::skeleton::SightSkeleton;
use crate::chunks::Chunk;
use crate::occluder::{MAX_CORNERS, Occluder, Occluders};
use crate::options::SightOptions;

const MARK: [u8; 8] = *b"enfsight";
const VERSION: u32 = 1;

/// Reason why bytes are not a skeleton of sight.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SkeletonError {
    /// They start otherwise.
    #[error("these bytes are not a skeleton of sight; pack the world again")]
    OtherFormat,
    /// They are of a version that this program does not read.
    #[error(
        "the skeleton of sight has version {found}, this program reads {VERSION}; pack the world again"
    )]
    OtherVersion {
        /// The version.
        found: u32,
    },
    /// They have changed or are cut off, or were not written by this library.
    #[error("the skeleton of sight is damaged: {what}; fetch it again, or pack the world again")]
    Damaged {
        /// The damage.
        what: &'static str,
    },
}

fn damaged(what: &'static str) -> SkeletonError {
    SkeletonError::Damaged { what }
}

impl SightSkeleton {
    /// Returns it as bytes for [`SightSkeleton::decode`]; equal skeletons give equal bytes.
    #[must_use]
    #[doc(hidden)]
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Writer(MARK.to_vec());
        out.words([VERSION]);
        let o = &self.options;
        out.words([o.chunk_triangles, o.occluders, o.portal_group].map(word));
        out.floats([o.occluder_area]);
        out.doubles([self.extent]);
        out.longs(self.sizes);
        let (n_batches, n_details) = (self.areas.len(), self.details.len());
        out.words([self.n_cells, n_batches, n_details].map(word));
        self.write_chunks(&mut out);
        for k in 0..3 {
            out.doubles(self.details.iter().map(|d| d.bounds.min[k]));
            out.doubles(self.details.iter().map(|d| d.bounds.max[k]));
        }
        out.words(self.details.iter().map(|d| d.n_triangles));
        self.write_occluders(&mut out);
        out.words([u32::from(self.seen_from.is_some())]);
        if let Some(seen) = &self.seen_from {
            let rows = || (0..self.n_cells).map(|c| seen.runs_of(c));
            out.words(rows().map(|r| word(r.len())));
            out.words(rows().flatten().map(|r| r[0]));
            out.words(rows().flatten().map(|r| r[1]));
        }
        let sum = checksum(&out.0);
        out.0.extend(sum.to_le_bytes());
        out.0
    }

    fn write_chunks(&self, out: &mut Writer) {
        let mut counts = vec![0; self.areas.len()];
        for chunk in &self.chunks {
            counts[chunk.batch as usize] += 1;
        }
        out.words(counts);
        out.floats(self.areas.iter().copied());
        out.words(self.chunks.iter().map(Chunk::n_triangles));
        for side in 0..2 {
            for k in 0..3 {
                out.floats(self.chunks.iter().map(|c| c.aabb[side][k]));
            }
        }
    }

    fn write_occluders(&self, out: &mut Writer) {
        let Occluders { first, all } = &self.occluders;
        out.words(first.windows(2).map(|w| w[1] - w[0]));
        out.words(
            all.iter()
                .map(|o| word(o.n_corners) | (TWO_SIDED * u32::from(o.is_two_sided))),
        );
        for o in all {
            out.doubles([o.area]);
            for p in [o.normal, o.middle].iter().chain(&o.corners[..o.n_corners]) {
                out.doubles(p.to_array());
            }
        }
    }

    /// Reads what [`SightSkeleton::encode`] wrote. O(n) in time and memory.
    ///
    /// # Errors
    ///
    /// If the bytes are of another format or version, or damaged.
    #[doc(hidden)]
    pub fn decode(bytes: &[u8]) -> Result<Self, SkeletonError> {
        let rest = bytes
            .strip_prefix(&MARK)
            .ok_or(SkeletonError::OtherFormat)?;
        let found = Reader(rest).word()?;
        if found != VERSION {
            return Err(SkeletonError::OtherVersion { found });
        }
        let (body, sum) = bytes.split_last_chunk().ok_or(damaged(CUT))?;
        if checksum(body) != u64::from_le_bytes(*sum) {
            return Err(damaged("its checksum differs"));
        }
        let mut input = Reader(body.get(MARK.len() + 4..).ok_or(damaged(CUT))?);
        let numbers = [input.word()?, input.word()?, input.word()?].map(|n| n as usize);
        let options = SightOptions {
            chunk_triangles: numbers[0],
            occluders: numbers[1],
            portal_group: numbers[2],
            occluder_area: input.float()?,
        };
        let extent = input.double()?;
        if !extent.is_finite() || extent < 1.0 {
            return Err(damaged("its extent is no length"));
        }
        let sizes = [input.long()?, input.long()?];
        let [n_cells, n_batches, n_details] =
            [input.word()?, input.word()?, input.word()?].map(|n| n as usize);
        let (areas, chunks) = read_chunks(&mut input, n_batches)?;
        let details = read_details(&mut input, n_details)?;
        let n_items = chunks.len() + details.len();
        let n_items = u32::try_from(n_items).map_err(|_| damaged("it has too many parts"))?;
        let out = Self {
            options,
            n_cells,
            areas,
            chunks,
            details,
            occluders: read_occluders(&mut input, n_cells)?,
            seen_from: read_seen(&mut input, n_cells, n_items)?,
            sizes,
            extent,
        };
        input
            .0
            .is_empty()
            .then_some(out)
            .ok_or(damaged("bytes are left over"))
    }
}

fn read_chunks(
    input: &mut Reader<'_>,
    n_batches: usize,
) -> Result<(Vec<f32>, Vec<Chunk>), SkeletonError> {
    let counts = input.words(n_batches)?;
    let areas = input.floats(n_batches)?;
    if !areas.iter().all(|a| a.is_finite() && *a >= 0.0) {
        return Err(damaged("an area is negative or not finite"));
    }
    let n_chunks = sum(&counts)?;
    let sizes = input.words(n_chunks)?;
    let mut columns = Vec::new();
    for _ in 0..6 {
        columns.push(input.floats(n_chunks)?);
    }
    let mut chunks = Vec::with_capacity(n_chunks);
    for (batch, &count) in (0..).zip(&counts) {
        let mut first_index = 0_u32;
        for _ in 0..count {
            let i = chunks.len();
            let aabb = [0, 3].map(|side| [0, 1, 2].map(|k| columns[side + k][i]));
            let is_box =
                (0..3).all(|k| aabb[0][k] <= aabb[1][k] && aabb[1][k] - aabb[0][k] < f32::INFINITY);
            let n_indices = sizes[i].checked_mul(3).filter(|n| *n > 0);
            let n_indices = n_indices.ok_or(damaged("a chunk has no triangles"))?;
            if !is_box || !aabb.as_flattened().iter().all(|x| x.is_finite()) {
                return Err(damaged("a chunk has no box"));
            }
            chunks.push(Chunk {
                batch,
                first_index,
                n_indices,
                aabb,
            });
            let end = first_index.checked_add(n_indices);
            first_index = end.ok_or(damaged("a batch has too many triangles"))?;
        }
    }
    Ok((areas, chunks))
}

fn read_details(input: &mut Reader<'_>, n: usize) -> Result<Vec<Detail>, SkeletonError> {
    let mut columns = Vec::new();
    for _ in 0..6 {
        columns.push(input.doubles(n)?);
    }
    let sizes = input.words(n)?;
    let detail = |(i, &n_triangles): (usize, &u32)| {
        let [min, max] = [0, 1].map(|side| DVec3::from([0, 2, 4].map(|k| columns[side + k][i])));
        let bounds = Aabb::new(min, max);
        let is_box = min.is_finite() && max.is_finite() && min.cmple(max).all();
        let is_good = is_box || bounds == Aabb::EMPTY;
        is_good.then_some(Detail {
            bounds,
            n_triangles,
        })
    };
    let details: Option<Vec<Detail>> = sizes.iter().enumerate().map(detail).collect();
    details.ok_or(damaged("an object has no box"))
}

fn read_occluders(input: &mut Reader<'_>, n_cells: usize) -> Result<Occluders, SkeletonError> {
    let counts = input.words(n_cells)?;
    let kinds = input.words(sum(&counts)?)?;
    let mut first = vec![0];
    for n in counts {
        first.push(first[first.len() - 1] + n);
    }
    let mut all = Vec::new();
    for kind in kinds {
        let n_corners = (kind & !TWO_SIDED) as usize;
        if !(3..=MAX_CORNERS).contains(&n_corners) {
            return Err(damaged("a polygon has too few or too many vertices"));
        }
        let area = input.double()?;
        let mut points = [DVec3::ZERO; 2 + MAX_CORNERS];
        for p in &mut points[..2 + n_corners] {
            *p = DVec3::new(input.double()?, input.double()?, input.double()?);
        }
        if !area.is_finite() || !points.iter().all(|p| p.is_finite()) {
            return Err(damaged("a polygon is not finite"));
        }
        let [normal, middle, corners @ ..] = points;
        all.push(Occluder {
            normal,
            corners,
            n_corners,
            middle,
            area,
            is_two_sided: kind & TWO_SIDED != 0,
        });
    }
    Ok(Occluders { first, all })
}

fn read_seen(
    input: &mut Reader<'_>,
    n_cells: usize,
    n_items: u32,
) -> Result<Option<VisibleParts>, SkeletonError> {
    match input.word()? {
        0 => return Ok(None),
        1 => {}
        _ => return Err(damaged("its visibility is neither there nor absent")),
    }
    let counts = input.words(n_cells)?;
    let n_runs = sum(&counts)?;
    let (firsts, lasts) = (input.words(n_runs)?, input.words(n_runs)?);
    let runs = firsts.into_iter().zip(lasts).map(|(a, b)| [a, b]);
    let mut end = 0;
    let ends = counts.into_iter().map(|n| {
        end += n;
        end
    });
    let seen = VisibleParts::of_runs(ends.collect(), runs.collect(), n_items);
    seen.map(Some)
        .ok_or(damaged("its visibility is out of order"))
}

/// Marks a polygon that hides on both sides.
const TWO_SIDED: u32 = 1 << 8;

const CUT: &str = "it is cut off";

/// Returns the sum of counts, which must be a number of items that `u32` can index.
fn sum(counts: &[u32]) -> Result<usize, SkeletonError> {
    let n = counts.iter().try_fold(0_u32, |n, c| n.checked_add(*c));
    n.map(|n| n as usize).ok_or(damaged(CUT))
}

fn word(n: usize) -> u32 {
    u32::try_from(n).unwrap_or(u32::MAX)
}

/// Returns the checksum of bytes, 64-bit FNV-1a: it notices every change of a single byte.
fn checksum(bytes: &[u8]) -> u64 {
    let step = |sum: u64, byte: &u8| (sum ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, step)
}

struct Writer(Vec<u8>);

impl Writer {
    fn words(&mut self, words: impl IntoIterator<Item = u32>) {
        (self.0).extend(words.into_iter().flat_map(u32::to_le_bytes));
    }

    fn longs(&mut self, longs: impl IntoIterator<Item = u64>) {
        (self.0).extend(longs.into_iter().flat_map(u64::to_le_bytes));
    }

    fn floats(&mut self, floats: impl IntoIterator<Item = f32>) {
        (self.0).extend(floats.into_iter().flat_map(f32::to_le_bytes));
    }

    fn doubles(&mut self, doubles: impl IntoIterator<Item = f64>) {
        (self.0).extend(doubles.into_iter().flat_map(f64::to_le_bytes));
    }
}

struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    /// Takes `n` groups of bytes. Nothing is allocated that the bytes do not hold.
    fn take<const N: usize>(&mut self, n: usize) -> Result<&'a [[u8; N]], SkeletonError> {
        let size = n.checked_mul(N).ok_or(damaged(CUT))?;
        let (taken, rest) = self.0.split_at_checked(size).ok_or(damaged(CUT))?;
        self.0 = rest;
        Ok(taken.as_chunks().0)
    }

    fn words(&mut self, n: usize) -> Result<Vec<u32>, SkeletonError> {
        Ok((self.take(n)?.iter())
            .map(|b| u32::from_le_bytes(*b))
            .collect())
    }

    fn floats(&mut self, n: usize) -> Result<Vec<f32>, SkeletonError> {
        Ok((self.take(n)?.iter())
            .map(|b| f32::from_le_bytes(*b))
            .collect())
    }

    fn doubles(&mut self, n: usize) -> Result<Vec<f64>, SkeletonError> {
        Ok((self.take(n)?.iter())
            .map(|b| f64::from_le_bytes(*b))
            .collect())
    }

    fn word(&mut self) -> Result<u32, SkeletonError> {
        Ok(u32::from_le_bytes(self.take(1)?[0]))
    }

    fn long(&mut self) -> Result<u64, SkeletonError> {
        Ok(u64::from_le_bytes(self.take(1)?[0]))
    }

    fn float(&mut self) -> Result<f32, SkeletonError> {
        Ok(f32::from_le_bytes(self.take(1)?[0]))
    }

    fn double(&mut self) -> Result<f64, SkeletonError> {
        Ok(f64::from_le_bytes(self.take(1)?[0]))
    }
}

//! Structural batches cut into small groups of neighboring triangles.

use enfilade_geom::scene::Primitive;
use enfilade_geom::{Aabb, DVec3, triangle_area_normal};

use crate::point::point;

/// A group of triangles of one batch, culled and drawn as a unit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Chunk {
    /// Index into `World::batches`.
    pub batch: u32,
    /// First index (three per triangle) in [`Sight::indices`](crate::Sight::indices) of the batch.
    pub first_index: u32,
    /// Number of indices.
    pub n_indices: u32,
    /// Minimum and maximum of the bounding box. [Units: wu]
    pub aabb: [[f32; 3]; 2],
}

impl Chunk {
    /// Number of triangles.
    #[must_use]
    pub fn n_triangles(&self) -> u32 {
        self.n_indices / 3
    }

    pub(crate) fn bounds(&self) -> Aabb {
        Aabb::new(point(self.aabb[0]), point(self.aabb[1]))
    }
}

/// A triangle to be grouped.
struct Entry {
    corners: [u32; 3],
    /// Index in the batch.
    number: u32,
    center: DVec3,
    /// Direction that it faces: octant of the sphere and main axis.
    facing: u8,
}

/// A batch's triangles, sorted so that chunks are ranges.
#[derive(Default)]
pub(crate) struct Sorted {
    /// Index triples.
    pub(crate) indices: Vec<u32>,
    /// Index of each triangle in the batch, in sorted order.
    pub(crate) numbers: Vec<u32>,
}

/// Adds the chunks of one batch to `chunks`; returns the sorted triangles of the batch.
///
/// Splits at the median of the longest axis until groups are small. Deterministic.
pub(crate) fn chunks_of(
    batch: u32,
    primitive: &Primitive,
    size: usize,
    chunks: &mut Vec<Chunk>,
) -> Sorted {
    let triples = primitive.triples().iter().zip(primitive.triangles());
    let mut entries: Vec<Entry> = (0..)
        .zip(triples)
        .map(|(number, (&corners, p))| {
            let normal = triangle_area_normal(&p);
            let a = normal.abs();
            let axis = if a.x >= a.y && a.x >= a.z {
                0
            } else if a.y >= a.z {
                1
            } else {
                2
            };
            Entry {
                corners,
                number,
                center: Aabb::of_points(&p).center(),
                facing: axis * 2 + u8::from(normal[usize::from(axis)] < 0.0),
            }
        })
        .collect();
    let mut out = Sorted {
        indices: Vec::with_capacity(primitive.indices.len()),
        numbers: Vec::with_capacity(entries.len()),
    };
    split(batch, primitive, size, &mut entries, chunks, &mut out);
    out
}

fn split(
    batch: u32,
    primitive: &Primitive,
    size: usize,
    entries: &mut [Entry],
    chunks: &mut Vec<Chunk>,
    out: &mut Sorted,
) {
    if entries.is_empty() {
        return;
    }
    let centers = entries
        .iter()
        .fold(Aabb::EMPTY, |b, e| b.including(e.center));
    if entries.len() > size {
        let extent = centers.size();
        let axis = if extent.x >= extent.y && extent.x >= extent.z {
            0
        } else if extent.y >= extent.z {
            1
        } else {
            2
        };
        // A few triangles are the walls of a room; facing separates their boxes best.
        let by_facing =
            entries.len() <= 4 * size && entries.iter().any(|e| e.facing != entries[0].facing);
        entries.sort_by(|a, b| {
            let side = if by_facing {
                a.facing.cmp(&b.facing)
            } else {
                std::cmp::Ordering::Equal
            };
            side.then(a.center[axis].total_cmp(&b.center[axis]))
        });
        let middle = entries.len() / 2;
        // Do not split within a wall if another split lies near the middle.
        let at = if by_facing {
            (1..entries.len())
                .filter(|&i| entries[i].facing != entries[i - 1].facing)
                .min_by_key(|i| i.abs_diff(middle))
                .unwrap_or(middle)
        } else {
            middle
        };
        let (low, high) = entries.split_at_mut(at);
        split(batch, primitive, size, low, chunks, out);
        split(batch, primitive, size, high, chunks, out);
        return;
    }
    let first_index = out.indices.len() as u32;
    let mut aabb = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for e in entries.iter() {
        out.indices.extend(e.corners);
        out.numbers.push(e.number);
        for i in e.corners {
            let p = primitive.positions[i as usize];
            for axis in 0..3 {
                aabb[0][axis] = aabb[0][axis].min(p[axis]);
                aabb[1][axis] = aabb[1][axis].max(p[axis]);
            }
        }
    }
    chunks.push(Chunk {
        batch,
        first_index,
        n_indices: out.indices.len() as u32 - first_index,
        aabb,
    });
}

//! Indices: triangles coded by recent edges and vertices, and plain sequences.
//!
//! `EXT_meshopt_compression`, appendix A, "Mode 1: triangles" and "Mode 2: indices".

use super::{CUT_OFF, Input, unzigzag, version_of};

/// The last sixteen items; positions count back from the newest.
struct Fifo<T> {
    items: [T; 16],
    next: usize,
}

impl<T: Copy> Fifo<T> {
    fn new(empty: T) -> Self {
        Self {
            items: [empty; 16],
            next: 0,
        }
    }

    fn push(&mut self, item: T) {
        self.items[self.next] = item;
        self.next = (self.next + 1) % 16;
    }

    /// Returns an item; 0 is the newest.
    fn get(&self, back: u8) -> T {
        self.items[(self.next + 15 - usize::from(back)) % 16]
    }
}

struct Triangles<'b> {
    edges: Fifo<[u32; 2]>,
    vertices: Fifo<u32>,
    /// The lowest unused index.
    next: u32,
    /// The last index stored as a difference.
    last: u32,
    data: Input<'b>,
    /// Pairs of vertex codes for one-byte references.
    table: &'b [u8],
    /// Edge triangles with a vertex code of at least this store an index.
    n_recent: u8,
}

/// Decodes `n` indices of triangles.
pub(super) fn decode_triangles(packed: &[u8], n: usize) -> Result<Vec<u32>, String> {
    if !n.is_multiple_of(3) {
        return Err(format!("{n} indices do not make triangles"));
    }
    let (version, body) = version_of(packed, 0xE0)?;
    // One byte per triangle, then the data, then the table: the input's size bounds the memory.
    let (codes, rest) = body.split_at_checked(n / 3).ok_or(CUT_OFF)?;
    let n_data = rest.len().checked_sub(16).ok_or(CUT_OFF)?;
    let (data, table) = rest.split_at(n_data);
    let mut triangles = Triangles {
        edges: Fifo::new([u32::MAX; 2]),
        vertices: Fifo::new(u32::MAX),
        next: 0,
        last: 0,
        data: Input(data),
        table,
        n_recent: if version == 0 { 15 } else { 13 },
    };
    let mut out = Vec::with_capacity(n);
    for &code in codes {
        let triangle = if code < 0xF0 {
            triangles.at_edge(code)?
        } else {
            triangles.alone(code)?
        };
        out.extend(triangle);
    }
    triangles.data.end()?;
    Ok(out)
}

impl Triangles<'_> {
    fn fresh(&mut self) -> u32 {
        let index = self.next;
        self.next = self.next.wrapping_add(1);
        index
    }

    fn stored(&mut self) -> Result<u32, String> {
        self.last = self.last.wrapping_add(unzigzag(self.data.var_int()?));
        Ok(self.last)
    }

    /// Decodes a triangle from a recent edge and a third vertex.
    fn at_edge(&mut self, code: u8) -> Result<[u32; 3], String> {
        let [a, b] = self.edges.get(code >> 4);
        let third = code & 15;
        let c = if third == 0 {
            let c = self.fresh();
            self.vertices.push(c);
            c
        } else if third < self.n_recent {
            // Counts the vertex that comes next.
            self.vertices.get(third)
        } else {
            let c = match third {
                15 => self.stored()?,
                13 => self.last.wrapping_sub(1),
                _ => self.last.wrapping_add(1),
            };
            self.last = c;
            self.vertices.push(c);
            c
        };
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        Ok([a, b, c])
    }

    /// Decodes a triangle from its three vertices.
    fn alone(&mut self, code: u8) -> Result<[u32; 3], String> {
        let pair = match code {
            0xFE | 0xFF => self.data.byte()?,
            _ => self.table[usize::from(code & 15)],
        };
        let is_of_table = code < 0xFE;
        if !is_of_table && pair == 0 {
            self.next = 0;
        }
        let codes = [if code == 0xFF { 15 } else { 0 }, pair >> 4, pair & 15];
        // Number all new vertices, and look up old ones, before pushing the first.
        let mut triangle = [0; 3];
        for (index, &code) in triangle.iter_mut().zip(&codes) {
            *index = match code {
                0 => self.fresh(),
                15 if !is_of_table => 0,
                back => self.vertices.get(back - 1),
            };
        }
        for (index, &code) in triangle.iter_mut().zip(&codes) {
            if code == 15 && !is_of_table {
                *index = self.stored()?;
            }
        }
        for (k, (&index, &code)) in triangle.iter().zip(&codes).enumerate() {
            if k == 0 || code == 0 || (code == 15 && !is_of_table) {
                self.vertices.push(index);
            }
        }
        let [a, b, c] = triangle;
        self.edges.push([b, a]);
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        Ok(triangle)
    }
}

/// Decodes `n` indices of any kind.
pub(super) fn decode_sequence(packed: &[u8], n: usize) -> Result<Vec<u32>, String> {
    let (_, body) = version_of(packed, 0xD0)?;
    let n_data = body.len().checked_sub(4).ok_or(CUT_OFF)?;
    if n > n_data {
        return Err(CUT_OFF.into());
    }
    let mut data = Input(&body[..n_data]);
    let mut last = [0u32; 2];
    let mut out = Vec::with_capacity(n);
    for _ in 0..n {
        let value = data.var_int()?;
        let baseline = &mut last[(value & 1) as usize];
        *baseline = baseline.wrapping_add(unzigzag(value >> 1));
        out.push(*baseline);
    }
    data.end()?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Two triangles for each square of a grid `n` wide, the best case for edge codes.
    fn grid(n: u32) -> Vec<u32> {
        let squares = (0..n * n).map(|i| (i / n * (n + 1)) + i % n);
        let corners = |a: u32| [a, a + 1, a + n + 1, a + n + 1, a + 1, a + n + 2];
        squares.flat_map(corners).collect()
    }

    fn check(indices: &[u32]) {
        let n_vertices = indices.iter().max().map_or(0, |&m| m as usize + 1);
        let bytes = meshopt::encode_index_buffer(indices, n_vertices).unwrap();
        // The encoder rotates triangles; its own decoder gives the expected result.
        let theirs: Vec<u32> = meshopt::decode_index_buffer(&bytes, indices.len()).unwrap();
        assert!(decode_triangles(&bytes, indices.len()).unwrap() == theirs);
        let bytes = meshopt::encode_index_sequence(indices, n_vertices).unwrap();
        assert!(decode_sequence(&bytes, indices.len()).unwrap() == indices);
    }

    #[test]
    fn grids_and_far_jumps_come_back() {
        check(&grid(40));
        // Strips of vertices that were never next: each third one is one off the last stored.
        let strip = |step: i32| -> Vec<u32> {
            let at = |i: i32| (900 + step * i) as u32;
            let triangle = |i: i32| {
                let [a, b] = if i % 2 == 0 { [i, i + 1] } else { [i + 1, i] };
                [at(a), at(b), at(i + 2)]
            };
            (0..50).flat_map(triangle).collect()
        };
        check(&strip(-1));
        check(&strip(1));
        check(&[0, 1, 2]);
        check(&[
            4_000_000, 5, 4_000_001, 9, 8, 7, 0, 1, 2, 4_000_002, 3, 70_000,
        ]);
    }

    proptest! {
        #[test]
        fn any_indices_come_back(
            triangles in prop::collection::vec(prop::array::uniform3(0u32..300), 1..200),
        ) {
            check(&triangles.concat());
        }

        #[test]
        fn damaged_bytes_end_in_an_error_or_in_indices(
            at in any::<prop::sample::Index>(),
            with in any::<u8>(),
            cut in any::<prop::sample::Index>(),
        ) {
            let indices = grid(12);
            for decode in [decode_triangles, decode_sequence] {
                let mut bytes = meshopt::encode_index_buffer(&indices, 169).unwrap();
                if decode(&bytes, indices.len()).is_err() {
                    bytes = meshopt::encode_index_sequence(&indices, 169).unwrap();
                }
                let place = at.index(bytes.len());
                prop_assert!(decode(&bytes[..cut.index(bytes.len())], indices.len()).is_err());
                bytes[place] = with;
                let _ = decode(&bytes, indices.len());
            }
        }
    }

    #[test]
    fn counts_beyond_the_data_are_refused() {
        let bytes = meshopt::encode_index_buffer(&[0, 1, 2], 3).unwrap();
        assert!(decode_triangles(&bytes, usize::MAX / 3 * 3).is_err());
        assert!(decode_triangles(&bytes, 4).is_err());
        let bytes = meshopt::encode_index_sequence(&[0, 1, 2], 3).unwrap();
        assert!(decode_sequence(&bytes, usize::MAX).is_err());
        assert!(decode_sequence(&bytes, 2).is_err());
    }
}

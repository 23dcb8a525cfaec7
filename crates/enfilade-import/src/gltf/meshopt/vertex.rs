//! Attributes: blocks of vertices, byte by byte, as differences from the vertex before.
//!
//! `EXT_meshopt_compression`, appendix A, "Mode 0: attributes" (version 0), and `KHR_meshopt_compression` (version 1, which
//! adds control bytes, and differences of 16-bit and rotated 32-bit words).

use super::{Input, version_of};

/// Bytes that share one bit width.
const GROUP: usize = 16;
/// Most vertices in a block.
const MAX_BLOCK: usize = 256;
/// Largest decompressed size of a block. [Units: bytes]
const BLOCK_BYTES: usize = 8192;

/// Decodes `n` vertices of `stride` bytes.
pub(super) fn decode(packed: &[u8], n: usize, stride: usize) -> Result<Vec<u8>, String> {
    if stride == 0 || stride > 256 || !stride.is_multiple_of(4) {
        return Err(format!(
            "vertices of {stride} bytes; the size must be a multiple of 4 up to 256"
        ));
    }
    let (version, body) = version_of(packed, 0xA0)?;
    // The padded tail holds the vertex before the first and the kind of each channel.
    let n_channels = if version == 0 { 0 } else { stride / 4 };
    let n_tail = stride + n_channels;
    let n_padded = n_tail.max(if version == 0 { 32 } else { 24 });
    let n_body = body.len().checked_sub(n_padded).ok_or(super::CUT_OFF)?;
    let (body, tail) = body.split_at(n_body);
    let tail = &tail[n_padded - n_tail..];
    let block = (BLOCK_BYTES / stride / GROUP * GROUP).min(MAX_BLOCK);
    // Each block takes at least one byte per four bytes of a vertex: the input's size bounds the memory.
    if n.div_ceil(block).saturating_mul(stride / 4) > body.len() {
        return Err(super::CUT_OFF.into());
    }
    let mut decoder = Decoder {
        version,
        channels: &tail[stride..],
        input: Input(body),
        last: tail[..stride].to_vec(),
    };
    let mut out = vec![0; n * stride];
    for vertices in out.chunks_mut(block * stride) {
        decoder.block(vertices)?;
    }
    decoder.input.end()?;
    Ok(out)
}

struct Decoder<'b> {
    version: u8,
    /// Kind of each four bytes of a vertex; empty in version 0.
    channels: &'b [u8],
    input: Input<'b>,
    /// The last vertex of the previous block.
    last: Vec<u8>,
}

impl Decoder<'_> {
    fn block(&mut self, vertices: &mut [u8]) -> Result<(), String> {
        let stride = self.last.len();
        let n = vertices.len() / stride;
        let control = self.input.take(self.channels.len())?;
        for k in (0..stride).step_by(4) {
            let control = control.get(k / 4).copied().unwrap_or(0);
            let mut rows = [[0; MAX_BLOCK]; 4];
            for (j, row) in rows.iter_mut().enumerate() {
                self.row(
                    &mut row[..n.next_multiple_of(GROUP)],
                    n,
                    control >> (2 * j) & 3,
                )?;
            }
            let last: [u8; 4] = std::array::from_fn(|j| self.last[k + j]);
            let channel = self.channels.get(k / 4).copied().unwrap_or(0);
            let words = vertices.chunks_exact_mut(stride).map(|v| &mut v[k..k + 4]);
            add_up(&rows, last, channel, words)?;
        }
        let from = vertices.len() - stride;
        self.last.copy_from_slice(&vertices[from..]);
        Ok(())
    }

    /// Decodes one byte of each of `n` vertices, as differences; `row` has room for whole groups.
    fn row(&mut self, row: &mut [u8], n: usize, control: u8) -> Result<(), String> {
        let widths = match (self.version, control) {
            (0, _) => [0, 2, 4, 8],
            (_, 0) => [0, 1, 2, 4],
            (_, 1) => [1, 2, 4, 8],
            (_, 2) => return Ok(()),
            _ => {
                row[..n].copy_from_slice(self.input.take(n)?);
                return Ok(());
            }
        };
        let header = self.input.take((row.len() / GROUP).div_ceil(4))?;
        for (g, group) in row.chunks_exact_mut(GROUP).enumerate() {
            let width = widths[usize::from(header[g / 4] >> (2 * (g % 4)) & 3)];
            self.group(group, width)?;
        }
        Ok(())
    }

    /// Decodes sixteen values of `width` bits each; all ones stand for a whole byte that follows.
    fn group(&mut self, group: &mut [u8], width: usize) -> Result<(), String> {
        match width {
            0 => {}
            8 => group.copy_from_slice(self.input.take(GROUP)?),
            _ => {
                let bits = self.input.take(GROUP * width / 8)?;
                let escape = (1 << width) - 1;
                let a_byte = 8 / width;
                for (i, value) in group.iter_mut().enumerate() {
                    // Single bits are stored from the lowest, pairs and fours from the highest.
                    let slot = i % a_byte;
                    let slot = if width == 1 { slot } else { a_byte - 1 - slot };
                    *value = bits[i / a_byte] >> (slot * width) & escape;
                    if *value == escape {
                        *value = self.input.byte()?;
                    }
                }
            }
        }
        Ok(())
    }
}

/// Sums the differences for four bytes of each vertex.
fn add_up<'v>(
    rows: &[[u8; MAX_BLOCK]; 4],
    mut last: [u8; 4],
    channel: u8,
    words: impl Iterator<Item = &'v mut [u8]>,
) -> Result<(), String> {
    let unzigzag8 = |v: u8| (v >> 1) ^ (v & 1).wrapping_neg();
    let unzigzag16 = |v: u16| (v >> 1) ^ (v & 1).wrapping_neg();
    // The rotation is stored as one to the left; undo it.
    let turn = u32::from(channel >> 4);
    if channel & 3 == 3 {
        return Err(format!("unknown channel {channel:#04x}"));
    }
    for (i, word) in words.enumerate() {
        let d: [u8; 4] = std::array::from_fn(|j| rows[j][i]);
        last = match channel & 3 {
            0 => std::array::from_fn(|j| last[j].wrapping_add(unzigzag8(d[j]))),
            1 => {
                let half = |j: usize| {
                    let before = u16::from_le_bytes([last[j], last[j + 1]]);
                    let difference = u16::from_le_bytes([d[j], d[j + 1]]);
                    before.wrapping_add(unzigzag16(difference)).to_le_bytes()
                };
                let (low, high) = (half(0), half(2));
                [low[0], low[1], high[0], high[1]]
            }
            _ => {
                let difference = u32::from_le_bytes(d).rotate_right(turn);
                (u32::from_le_bytes(last) ^ difference).to_le_bytes()
            }
        };
        word.copy_from_slice(&last);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Encodes vertices of `4 * N` bytes with the C++ library.
    fn packed<const N: usize>(vertices: &[[u32; N]], version: i32) -> Vec<u8> {
        meshopt::encode_vertex_buffer_level(vertices, 3, Some(version)).unwrap()
    }

    fn check<const N: usize>(vertices: &[[u32; N]]) {
        let plain: Vec<u8> = vertices
            .iter()
            .flatten()
            .flat_map(|w| w.to_le_bytes())
            .collect();
        for version in [0, 1] {
            let bytes = packed(vertices, version);
            let ours = decode(&bytes, vertices.len(), 4 * N).unwrap();
            assert!(ours == plain, "version {version}, {} words", vertices.len());
        }
    }

    #[test]
    fn smooth_random_and_constant_vertices_come_back() {
        // Smooth vertices use all widths of groups and 16-bit channels, floats the rotated ones.
        let smooth: Vec<[u32; 3]> = (0..1000u32).map(|i| [i * 3, (i * i) & 0xFFFF, 7]).collect();
        check(&smooth);
        let floats: Vec<[u32; 4]> = (0..777u32)
            .map(|i| [0, 1, 2, 3].map(|k| ((i * (k + 1)) as f32 * 0.37).sin().to_bits()))
            .collect();
        check(&floats);
        check(&[[1u32]]);
        check(&[[9u32; 64]; 300]);
    }

    proptest! {
        #[test]
        fn any_vertices_come_back(
            words in prop::collection::vec(prop::array::uniform2(any::<u32>()), 1..600),
            mask in prop::sample::select(vec![0u32, 0x0101_0101, 0x00FF_00FF, 0x0F0F_0000, u32::MAX]),
        ) {
            check(&words.iter().map(|w| w.map(|w| w & mask)).collect::<Vec<_>>());
        }

        #[test]
        fn damaged_bytes_end_in_an_error_or_in_vertices(
            at in any::<prop::sample::Index>(),
            with in any::<u8>(),
            cut in any::<prop::sample::Index>(),
            version in 0..2,
        ) {
            let vertices: Vec<[u32; 3]> = (0..300u32).map(|i| [i, i / 7, i * 99]).collect();
            let mut bytes = packed(&vertices, version);
            let (place, cut) = (at.index(bytes.len()), cut.index(bytes.len()));
            prop_assert!(decode(&bytes[..cut], 300, 12).is_err());
            // A changed width may ask for just the bytes that the cut leaves: no error is owed then.
            bytes[place] = with;
            let _ = decode(&bytes[..cut], 300, 12);
            let _ = decode(&bytes, 300, 12);
        }
    }

    #[test]
    fn counts_and_strides_beyond_the_data_are_refused() {
        let bytes = packed(&[[1u32, 2]; 20], 0);
        assert!(decode(&bytes, usize::MAX / 8, 8).is_err());
        for stride in [0, 3, 260] {
            assert!(decode(&bytes, 20, stride).is_err());
        }
        let mut long = bytes.clone();
        long.insert(1, 0);
        assert!(decode(&long, 20, 8).is_err());
    }
}

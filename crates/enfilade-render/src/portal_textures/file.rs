//! Files of portal textures that were made ahead.
//!
//! All numbers are little-endian:
//!
//! - `ENFPTX`, version (`u16`), side (`u32`);
//! - viewpoints: kind (`u8`), then its lengths and angles (`f64`), with the number (`u32`) of spans before them;
//! - hashes of the world and of its light (`u64` each);
//! - style (`u8`), height of the cut (`f32`), share of the day (`f32`);
//! - number of leaves (`u32`) and their positions (`f32`, -1 for none); number of shut portals (`u32`) and their ids (`u32`);
//! - number of textures (`u32`); for each its portal, the cell behind it (`u32` each), viewpoint (5 `i32`), exposure (`f32`),
//!   triangles (`u64`), number of cells in view and the cells (`u32`), number of bytes (`u32`), and [texels](super::texels);
//! - FNV-1a of all bytes before (`u64`).

use enfilade_cpg::{CellId, PortalId};

use super::conditions::{Fnv, TextureConditions, TextureLook};
use super::viewpoints::{DoorwayId, ViewpointIndex};
use crate::portal_texture_file::PortalTextureFileError;
use crate::portal_texture_options::Viewpoints;

const MAGIC: &[u8; 6] = b"ENFPTX";
const VERSION: u16 = 1;

/// Bytes of the hash at the end.
const SEAL: usize = 8;

/// The head of a file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PtxHead {
    pub(crate) side: u32,
    pub(crate) viewpoints: Viewpoints,
    /// Hash of the world.
    pub(crate) world: u64,
    /// Hash of lamps and daylight.
    pub(crate) light: u64,
    pub(crate) conditions: TextureConditions,
}

/// A texture in a file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PtxEntry {
    pub(crate) id: DoorwayId,
    pub(crate) index: ViewpointIndex,
    pub(crate) exposure: f32,
    /// Triangles drawn for it.
    pub(crate) n_triangles: u64,
    /// Cells in view of it, ascending.
    pub(crate) cells: Box<[CellId]>,
    /// [Packed](super::texels::pack) texels.
    pub(crate) packed: Vec<u8>,
}

/// A file under way.
pub(crate) struct PtxWriter {
    out: Vec<u8>,
    /// Position of the number of textures.
    count_at: usize,
    n: u32,
    max_bytes: u64,
}

impl PtxWriter {
    /// Begins a file of at most `max_bytes`.
    pub(crate) fn new(head: &PtxHead, max_bytes: u64) -> Result<Self, PortalTextureFileError> {
        let mut out = MAGIC.to_vec();
        out.extend(VERSION.to_le_bytes());
        out.extend(head.side.to_le_bytes());
        put_viewpoints(&mut out, &head.viewpoints);
        out.extend(head.world.to_le_bytes());
        out.extend(head.light.to_le_bytes());
        let TextureConditions { shares, shut, look } = &head.conditions;
        out.push(look.flags);
        out.extend(look.cut_above.to_le_bytes());
        out.extend(look.day.to_le_bytes());
        put_count(&mut out, shares.len());
        for share in shares {
            out.extend(share.unwrap_or(-1.0).to_le_bytes());
        }
        put_count(&mut out, shut.len());
        for portal in shut {
            out.extend(portal.0.to_le_bytes());
        }
        let count_at = out.len();
        put_count(&mut out, 0);
        let needed = (out.len() + SEAL) as u64;
        let no_room = PortalTextureFileError::NoRoom {
            budget: max_bytes,
            needed,
        };
        (needed <= max_bytes)
            .then_some(Self {
                out,
                count_at,
                n: 0,
                max_bytes,
            })
            .ok_or(no_room)
    }

    /// Adds a texture. Returns `false` if it does not fit.
    pub(crate) fn add(&mut self, entry: &PtxEntry) -> bool {
        // Portal, cell, viewpoint, exposure, triangles, two counts.
        let own = 8 + 20 + 4 + 8 + 8 + 4 * entry.cells.len() + entry.packed.len();
        if (self.out.len() + own + SEAL) as u64 > self.max_bytes || self.n == u32::MAX {
            return false;
        }
        let out = &mut self.out;
        out.extend(entry.id.0.0.to_le_bytes());
        out.extend(entry.id.1.0.to_le_bytes());
        out.extend(entry.index.iter().flat_map(|i| i.to_le_bytes()));
        out.extend(entry.exposure.to_le_bytes());
        out.extend(entry.n_triangles.to_le_bytes());
        put_count(out, entry.cells.len());
        out.extend(entry.cells.iter().flat_map(|c| c.0.to_le_bytes()));
        put_count(out, entry.packed.len());
        out.extend(&entry.packed);
        self.n += 1;
        true
    }

    pub(crate) fn n_bytes(&self) -> u64 {
        (self.out.len() + SEAL) as u64
    }

    /// Ends the file, and returns its bytes.
    pub(crate) fn finish(mut self) -> Vec<u8> {
        self.out[self.count_at..self.count_at + 4].copy_from_slice(&self.n.to_le_bytes());
        let mut sum = Fnv::default();
        sum.add(&self.out);
        self.out.extend(sum.0.to_le_bytes());
        self.out
    }
}

fn put_count(out: &mut Vec<u8>, n: usize) {
    out.extend((n as u32).to_le_bytes());
}

fn put_viewpoints(out: &mut Vec<u8>, own: &Viewpoints) {
    let (kind, lengths) = match own {
        Viewpoints::Warped { spacing } => (0, vec![*spacing]),
        Viewpoints::Semicircle {
            radius,
            height,
            step,
            ..
        } => (1, vec![*radius, *height, *step]),
        Viewpoints::Grid { spacing } => (2, vec![*spacing]),
        Viewpoints::Single { radius, height } => (3, vec![*radius, *height]),
    };
    out.push(kind);
    out.extend(lengths.iter().flat_map(|x| x.to_le_bytes()));
    if let Viewpoints::Semicircle { spans, .. } = own {
        put_count(out, spans.len());
        out.extend(spans.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
    }
}

/// Reads a file. Takes memory in proportion to its size.
pub(crate) fn decode_ptx(bytes: &[u8]) -> Result<(PtxHead, Vec<PtxEntry>), PortalTextureFileError> {
    let mut from = PtxReader { bytes, at: 0 };
    if bytes.len() < MAGIC.len() || from.take(MAGIC.len())? != MAGIC {
        return Err(PortalTextureFileError::Foreign);
    }
    let found = u16::from_le_bytes(from.array()?);
    if found != VERSION {
        return Err(PortalTextureFileError::Version {
            found,
            known: VERSION,
        });
    }
    let head = PtxHead {
        side: from.u32()?,
        viewpoints: from.viewpoints()?,
        world: from.u64()?,
        light: from.u64()?,
        conditions: from.conditions()?,
    };
    let mut entries = Vec::new();
    for _ in 0..from.u32()? {
        entries.push(from.entry()?);
    }
    let mut sum = Fnv::default();
    sum.add(&bytes[..from.at]);
    let is_sealed = from.u64()? == sum.0;
    if from.at != bytes.len() {
        return Err(from.damaged("more bytes follow than there should be"));
    }
    if !is_sealed {
        return Err(from.damaged("the hash at its end belongs to other bytes"));
    }
    Ok((head, entries))
}

/// The rest of a file.
struct PtxReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> PtxReader<'a> {
    fn damaged(&self, what: &'static str) -> PortalTextureFileError {
        let at = self.at as u64;
        PortalTextureFileError::Damaged { at, what }
    }

    fn take(&mut self, n: usize) -> Result<&'a [u8], PortalTextureFileError> {
        let rest = &self.bytes[self.at..];
        let Some(own) = rest.get(..n) else {
            return Err(self.damaged("it ends early"));
        };
        self.at += n;
        Ok(own)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], PortalTextureFileError> {
        let mut out = [0; N];
        out.copy_from_slice(self.take(N)?);
        Ok(out)
    }

    fn u32(&mut self) -> Result<u32, PortalTextureFileError> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    fn u64(&mut self) -> Result<u64, PortalTextureFileError> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    fn f32(&mut self) -> Result<f32, PortalTextureFileError> {
        Ok(f32::from_le_bytes(self.array()?))
    }

    fn f64(&mut self) -> Result<f64, PortalTextureFileError> {
        Ok(f64::from_le_bytes(self.array()?))
    }

    /// Returns a list of numbers, with their count before them.
    fn list(&mut self) -> Result<impl Iterator<Item = [u8; 4]> + 'a, PortalTextureFileError> {
        let n = self.u32()? as usize;
        // A count beyond what is left is found before anything is allocated.
        let own = self.take(n.saturating_mul(4))?;
        Ok(own.chunks_exact(4).map(|b| [b[0], b[1], b[2], b[3]]))
    }

    fn viewpoints(&mut self) -> Result<Viewpoints, PortalTextureFileError> {
        let [kind] = self.array()?;
        Ok(match kind {
            0 => Viewpoints::Warped {
                spacing: self.f64()?,
            },
            1 => {
                let (radius, height, step) = (self.f64()?, self.f64()?, self.f64()?);
                let mut spans = Vec::new();
                for _ in 0..self.u32()? {
                    spans.push([self.f64()?, self.f64()?]);
                }
                Viewpoints::Semicircle {
                    radius,
                    height,
                    step,
                    spans,
                }
            }
            2 => Viewpoints::Grid {
                spacing: self.f64()?,
            },
            3 => Viewpoints::Single {
                radius: self.f64()?,
                height: self.f64()?,
            },
            _ => return Err(self.damaged("there are no such viewpoints")),
        })
    }

    fn conditions(&mut self) -> Result<TextureConditions, PortalTextureFileError> {
        let [flags] = self.array()?;
        let (cut_above, day) = (self.f32()?, self.f32()?);
        let share = |b| Some(f32::from_le_bytes(b)).filter(|s| *s >= 0.0);
        let shares = self.list()?.map(share).collect();
        let shut = self.list()?.map(|b| PortalId(u32::from_le_bytes(b)));
        Ok(TextureConditions {
            shares,
            shut: shut.collect(),
            look: TextureLook {
                flags,
                cut_above,
                day,
            },
        })
    }

    fn entry(&mut self) -> Result<PtxEntry, PortalTextureFileError> {
        let id = (PortalId(self.u32()?), CellId(self.u32()?));
        let mut index = [0; 5];
        for i in &mut index {
            *i = i32::from_le_bytes(self.array()?);
        }
        let exposure = self.f32()?;
        if !(exposure > 0.0 && exposure.is_finite()) {
            return Err(self.damaged("an exposure is not a positive number"));
        }
        let n_triangles = self.u64()?;
        let cells: Box<[CellId]> = self
            .list()?
            .map(|b| CellId(u32::from_le_bytes(b)))
            .collect();
        if !cells.is_sorted() {
            return Err(self.damaged("the cells of a texture are out of order"));
        }
        let n = self.u32()? as usize;
        Ok(PtxEntry {
            id,
            index,
            exposure,
            n_triangles,
            cells,
            packed: self.take(n)?.to_vec(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head(viewpoints: Viewpoints) -> PtxHead {
        PtxHead {
            side: 64,
            viewpoints,
            world: 7,
            light: 8,
            conditions: TextureConditions {
                shares: vec![None, Some(0.25)],
                shut: vec![PortalId(3)],
                look: TextureLook {
                    flags: 5,
                    cut_above: f32::INFINITY,
                    day: 1.0,
                },
            },
        }
    }

    fn entry(n: u8) -> PtxEntry {
        PtxEntry {
            id: (PortalId(u32::from(n)), CellId(2)),
            index: [-1, 0, 2, 1, 1600],
            exposure: 1.5,
            n_triangles: 100,
            cells: [CellId(1), CellId(2)].into(),
            packed: vec![n; 10],
        }
    }

    fn file(own: &PtxHead, entries: &[PtxEntry]) -> Vec<u8> {
        let mut out = PtxWriter::new(own, u64::MAX).unwrap();
        assert!(entries.iter().all(|e| out.add(e)));
        out.finish()
    }

    #[test]
    fn files_come_back_with_all_kinds_of_viewpoints() {
        for viewpoints in [
            Viewpoints::Warped { spacing: 0.1 },
            Viewpoints::semicircle(10.0),
            Viewpoints::Grid { spacing: 0.5 },
            Viewpoints::Single {
                radius: 2.0,
                height: 1.5,
            },
        ] {
            let (own, entries) = (head(viewpoints), [entry(1), entry(2)]);
            let (head, read) = decode_ptx(&file(&own, &entries)).unwrap();
            assert_eq!((head, &read[..]), (own, &entries[..]));
        }
    }

    #[test]
    fn files_cut_off_or_changed_anywhere_are_refused() {
        let own = head(Viewpoints::semicircle(10.0));
        let good = file(&own, &[entry(1), entry(2)]);
        for end in 0..good.len() {
            let refused = decode_ptx(&good[..end]).unwrap_err();
            let is_damage = matches!(refused, PortalTextureFileError::Damaged { .. });
            assert!(is_damage || end < MAGIC.len(), "{end}: {refused}");
        }
        for i in 0..good.len() {
            for flip in [0x01, 0x80, 0xff] {
                let mut bad = good.clone();
                bad[i] ^= flip;
                assert!(decode_ptx(&bad).is_err(), "byte {i}");
            }
        }
        let longer = [&good[..], &[0]].concat();
        assert!(decode_ptx(&longer).is_err());
        let mut old = good.clone();
        old[6] = 9;
        let refused = decode_ptx(&old);
        assert!(
            matches!(
                refused,
                Err(PortalTextureFileError::Version { found: 9, .. })
            ),
            "{refused:?}"
        );
    }

    #[test]
    fn files_stay_within_their_budget() {
        let own = head(Viewpoints::Warped { spacing: 0.1 });
        let [none, one] = [&[][..], &[entry(1)]].map(|e| file(&own, e).len() as u64);
        for budget in [0, none - 1] {
            let refused = PtxWriter::new(&own, budget).err();
            let needed = none;
            let no_room = PortalTextureFileError::NoRoom { budget, needed };
            assert_eq!(refused, Some(no_room));
        }
        for budget in [none, one - 1, one] {
            let mut out = PtxWriter::new(&own, budget).unwrap();
            assert_eq!(out.add(&entry(1)), budget == one);
            assert!(out.n_bytes() <= budget && out.finish().len() as u64 <= budget);
        }
    }
}

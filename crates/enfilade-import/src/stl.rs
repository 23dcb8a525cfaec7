//! STL (3D Systems, *StereoLithography Interface Specification*, 1989), ASCII and binary.
//!
//! This reader replaces `stl_io`, which loses the names of solids, the lines of errors and the shape of ASCII files
//! far from the origin (`docs/dependencies.md`). Vertices with equal bits become one; facet normals follow from the
//! vertices and are dropped.

use crate::builder::Builder;
use crate::soup::shortened;
use crate::{ImportError, soup};
use enfilade_geom::DVec3;
use enfilade_geom::scene::{Mesh, Primitive};
use std::collections::HashMap;

const HEADER: usize = 84;
const FACET: usize = 50;

fn n_facets(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(80..HEADER)?;
    Some(u32::from_le_bytes([count[0], count[1], count[2], count[3]]).into())
}

/// Returns the length of a binary file according to its header.
fn binary_length(bytes: &[u8]) -> Option<u64> {
    Some(HEADER as u64 + n_facets(bytes)? * FACET as u64)
}

fn is_binary(bytes: &[u8]) -> bool {
    // Some binary headers start with "solid", so the length decides first.
    binary_length(bytes) == Some(bytes.len() as u64)
}

fn is_ascii(bytes: &[u8]) -> bool {
    let start = bytes.trim_ascii_start();
    start
        .get(..5)
        .is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
}

/// Returns `true` if the bytes look like STL.
pub(crate) fn is_stl(bytes: &[u8]) -> bool {
    is_ascii(bytes) || is_binary(bytes)
}

/// Returns `true` if the bytes may begin a binary file of at most `most` bytes.
pub(crate) fn may_go_on(head: &[u8], most: u64) -> bool {
    binary_length(head).is_some_and(|length| length > head.len() as u64 && length <= most)
}

/// Returns the length of a file according to its head; `None` for ASCII.
pub(crate) fn length(head: &[u8]) -> Option<u64> {
    binary_length(head).filter(|_| !is_ascii(head))
}

/// Reads one file into the builder.
pub(crate) fn read(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    builder.set_format("STL");
    if !is_binary(bytes) && is_ascii(bytes) {
        return read_ascii(bytes, builder);
    }
    let n = n_facets(bytes)
        .ok_or_else(|| builder.malformed("header", "neither ASCII nor binary STL"))?;
    let body = &bytes[HEADER..];
    if body.len() as u64 / (FACET as u64) < n {
        return Err(builder.malformed(
            "header",
            format!(
                "it promises {n} facets and the file holds {}; it is cut off",
                body.len() / FACET
            ),
        ));
    }
    if body.len() as u64 > n * FACET as u64 {
        builder.note("end", "bytes after the last facet; left out");
    }
    builder.check_triangles("header", n)?;
    let mut solid = Solid::default();
    for facet in body.chunks_exact(FACET).take(n as usize) {
        for corner in facet[12..48].chunks_exact(12) {
            let c = |k: usize| {
                f32::from_le_bytes([corner[k], corner[k + 1], corner[k + 2], corner[k + 3]])
            };
            solid.push([c(0), c(4), c(8)], "facets", builder)?;
        }
    }
    solid.finish(String::new(), DVec3::ZERO, builder)
}

/// One solid; equal vertices become one.
#[derive(Default)]
struct Solid {
    primitive: Primitive,
    numbers: HashMap<[u32; 3], u32>,
}

impl Solid {
    fn push(
        &mut self,
        p: [f32; 3],
        place: &str,
        builder: &mut Builder<'_>,
    ) -> Result<(), ImportError> {
        // Turns -0 into 0, which is the same place.
        let key = p.map(|c| (c + 0.0).to_bits());
        let next = self.primitive.positions.len() as u32;
        let vertex = *self.numbers.entry(key).or_insert(next);
        if vertex == next {
            builder.charge_vertices(place, 1)?;
            self.primitive.positions.push(p);
        }
        self.primitive.indices.push(vertex);
        Ok(())
    }

    fn finish(
        mut self,
        name: String,
        offset: DVec3,
        builder: &mut Builder<'_>,
    ) -> Result<(), ImportError> {
        let name = if name.is_empty() {
            soup::stem(builder)
        } else {
            name
        };
        let place = format!("solid '{}'", shortened(&name));
        builder.drop_nonfinite(&place, &mut self.primitive);
        let mesh = Mesh {
            name: name.clone(),
            primitives: vec![self.primitive],
        };
        soup::place(builder, mesh, [&name, ""], offset, &place)
    }
}

/// Vertices of one ASCII solid, not yet rounded.
#[derive(Default)]
struct SolidDraft {
    name: String,
    corners: Vec<[f64; 3]>,
}

fn read_ascii(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    let mut drafts: Vec<SolidDraft> = Vec::new();
    let mut n_in_loop = 0;
    let mut is_open = false;
    let mut n_lines = 0;
    for (i, line) in bytes.split(|&b| b == b'\n').enumerate() {
        n_lines = i + 1;
        let line = String::from_utf8_lossy(line.trim_ascii());
        let mut words = line.split_ascii_whitespace();
        let Some(word) = words.next() else {
            continue;
        };
        let word = word.to_ascii_lowercase();
        let place = || format!("line {}", i + 1);
        match word.as_str() {
            "solid" => {
                let name = words.collect::<Vec<_>>().join(" ");
                drafts.push(SolidDraft {
                    name,
                    corners: Vec::new(),
                });
                if drafts.len() as u64 > builder.limits().max_objects {
                    return Err(builder.malformed(place(), "too many solids"));
                }
                is_open = true;
            }
            "outer" => n_in_loop = 0,
            "vertex" => {
                let mut p = [0.0; 3];
                for slot in &mut p {
                    *slot = words.next().and_then(|w| w.parse().ok()).ok_or_else(|| {
                        builder.malformed(place(), "a vertex needs three numbers")
                    })?;
                }
                n_in_loop += 1;
                let Some(draft) = drafts.last_mut() else {
                    return Err(builder.malformed(place(), "a vertex before any solid"));
                };
                draft.corners.push(p);
            }
            "endloop" if n_in_loop != 3 => {
                return Err(builder.malformed(
                    place(),
                    format!("a facet with {n_in_loop} vertices; STL facets have three"),
                ));
            }
            "endsolid" => is_open = false,
            "facet" | "endfacet" | "endloop" => {}
            _ => {
                let problem = format!("'{}' is not a word of STL", shortened(&word));
                return Err(builder.malformed(place(), problem));
            }
        }
    }
    if is_open || drafts.iter().any(|d| d.corners.len() % 3 != 0) {
        return Err(builder.malformed(format!("line {n_lines}"), "the file is cut off"));
    }
    for mut draft in drafts {
        let offset = soup::recenter(&mut draft.corners);
        let mut solid = Solid::default();
        builder.check_triangles("solid", draft.corners.len() as u64 / 3)?;
        for p in &draft.corners {
            solid.push(p.map(|c| c as f32), "solid", builder)?;
        }
        solid.finish(draft.name, offset, builder)?;
    }
    Ok(())
}

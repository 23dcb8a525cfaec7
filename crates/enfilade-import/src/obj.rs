//! Wavefront OBJ (Wavefront, *Advanced Visualizer Manual*, appendix B1): polygons, free-form surfaces, groups,
//! materials.
//!
//! This reader replaces `tobj`, which does not join lines that end in `\`, makes a new object of a group that is
//! named again, and reports errors without line numbers (`docs/dependencies.md`).

mod freeform;

use crate::ImportError;
use crate::builder::Builder;
use crate::polygon::Splitter;
use crate::soup::{resolve, shortened};
use crate::{SurfaceReport, mtl, soup, sources};
use enfilade_geom::DVec3;
use enfilade_geom::scene::{Mesh, Primitive};
use enfilade_source::{FreeformSurface, tessellate};
use freeform::{Controls, Ended, FreeformReader};
use std::collections::HashMap;

/// Returns `true` if the text looks like OBJ: its first directive is one of OBJ's.
pub(crate) fn is_obj(bytes: &[u8]) -> bool {
    const DIRECTIVES: [&[u8]; 12] = [
        b"v", b"vt", b"vn", b"f", b"o", b"g", b"usemtl", b"mtllib", b"s", b"vp", b"cstype", b"deg",
    ];
    let head = &bytes[..bytes.len().min(1 << 16)];
    let mut lines = head.split(|&b| b == b'\n').map(<[u8]>::trim_ascii);
    lines
        .find(|line| !line.is_empty() && !line.starts_with(b"#"))
        .and_then(|line| line.split(u8::is_ascii_whitespace).next())
        .is_some_and(|word| DIRECTIVES.contains(&word))
}

/// Reads one file into the builder.
pub(crate) fn read(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    builder.set_format("OBJ");
    let mut reader = ObjReader {
        builder,
        positions: Vec::new(),
        weights: Vec::new(),
        colors: Vec::new(),
        uvs: Vec::new(),
        normals: Vec::new(),
        library: HashMap::new(),
        object: String::new(),
        group: String::new(),
        is_group_latest: false,
        material: None,
        parts: Vec::new(),
        meshes: Vec::new(),
        by_name: HashMap::new(),
        current: None,
        freeform: FreeformReader::new(),
        patches: Vec::new(),
        patch_parts: Vec::new(),
    };
    let mut joined = String::new();
    for (i, line) in bytes.split(|&b| b == b'\n').enumerate() {
        let line = String::from_utf8_lossy(line.trim_ascii());
        // A backslash at the end joins the next line.
        if let Some(start) = line.strip_suffix('\\') {
            joined.push_str(start);
            joined.push(' ');
            continue;
        }
        if joined.is_empty() {
            reader.read_line(&line, i + 1)?;
        } else {
            joined.push_str(&line);
            reader.read_line(&std::mem::take(&mut joined), i + 1)?;
        }
    }
    reader.read_line(&joined, 0)?;
    reader.finish()
}

/// A vertex of a face: indices of position, texture coordinate and normal, from 0.
type Corner = (u32, Option<u32>, Option<u32>);

struct ObjFace {
    first: usize,
    n: usize,
    line: usize,
}

/// Faces of one mesh and one material.
struct ObjPart {
    material: Option<u32>,
    corners: Vec<Corner>,
    faces: Vec<ObjFace>,
}

struct MeshDraft {
    names: [String; 2],
    /// Indices into [`ObjReader::parts`].
    parts: Vec<usize>,
}

struct ObjReader<'r, 'a> {
    builder: &'r mut Builder<'a>,
    positions: Vec<[f64; 3]>,
    /// Weights of the first positions as control points; 1 for the rest.
    weights: Vec<f64>,
    /// Colors of the first positions; empty if the file has none.
    colors: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    library: HashMap<String, u32>,
    object: String,
    group: String,
    is_group_latest: bool,
    material: Option<u32>,
    parts: Vec<ObjPart>,
    meshes: Vec<MeshDraft>,
    by_name: HashMap<[String; 2], usize>,
    /// The part that the next face joins, until a name or material changes.
    current: Option<usize>,
    freeform: FreeformReader,
    patches: Vec<FreeformSurface>,
    /// The part that each patch belongs to.
    patch_parts: Vec<usize>,
}

impl ObjReader<'_, '_> {
    fn read_line(&mut self, line: &str, number: usize) -> Result<(), ImportError> {
        let line = line.split('#').next().unwrap_or("").trim();
        let (word, rest) = line
            .split_once(|c: char| c.is_whitespace())
            .map_or((line, ""), |(word, rest)| (word, rest.trim()));
        self.builder.spend("lines", 2)?;
        match word {
            "v" => {
                let numbers = self.numbers::<7>(rest, number, 3)?;
                self.positions
                    .push([numbers.0[0], numbers.0[1], numbers.0[2]]);
                if matches!(numbers.1, 4 | 7) {
                    self.weights.resize(self.positions.len() - 1, 1.0);
                    self.weights.push(numbers.0[3]);
                }
                if numbers.1 >= 6 {
                    // White for earlier vertices without a color.
                    self.colors.resize(self.positions.len() - 1, [1.0; 3]);
                    let first = numbers.1 - 3;
                    self.colors.push([0, 1, 2].map(|k| {
                        soup::srgb_to_linear((numbers.0[first + k] as f32).clamp(0.0, 1.0))
                    }));
                }
            }
            "vt" => {
                let numbers = self.numbers::<3>(rest, number, 1)?.0;
                // OBJ counts from the bottom of the picture, glTF from the top.
                self.uvs
                    .push([finite(numbers[0]), finite(1.0 - numbers[1])]);
            }
            "vn" => {
                let numbers = self.numbers::<3>(rest, number, 3)?.0;
                self.normals.push(numbers.map(finite));
            }
            "f" | "fo" => self.read_face(rest, number)?,
            "o" => {
                rest.clone_into(&mut self.object);
                self.group.clear();
                self.is_group_latest = false;
                self.current = None;
            }
            "g" => {
                // Some exporters write `default` or `off` for no group.
                let name = if matches!(rest, "default" | "off" | "(null)") {
                    ""
                } else {
                    rest
                };
                name.clone_into(&mut self.group);
                self.is_group_latest = true;
                self.current = None;
            }
            "usemtl" => {
                self.material = self.find_material(rest, number);
                self.current = None;
            }
            "mtllib" => mtl::read_library(rest, number, self.builder, &mut self.library)?,
            "l" | "p" => {
                self.builder
                    .note(format!("line {number}"), "points or lines; left out");
            }
            "vp" | "cstype" | "deg" | "surf" | "curv" | "curv2" | "parm" | "trim" | "hole"
            | "end" => self.read_freeform(word, rest, number)?,
            _ => {}
        }
        Ok(())
    }

    fn read_freeform(&mut self, word: &str, rest: &str, number: usize) -> Result<(), ImportError> {
        let vertices = Controls {
            positions: &self.positions,
            weights: &self.weights,
        };
        let place = format!("line {number}");
        match self.freeform.read(word, rest, number, &vertices) {
            Ok(Ended::Nothing) => {}
            Ok(Ended::Surface(surface)) => {
                let part = match self.current {
                    Some(part) => part,
                    None => self.open_part(number)?,
                };
                self.patches.push(surface);
                self.patch_parts.push(part);
            }
            Ok(Ended::LeftOut) => self.builder.note(
                place,
                "free-form curves in space, or surfaces that are neither bezier nor bspline; left out, export them as bspline \
                 or as polygons",
            ),
            Err(problem) => return Err(self.builder.malformed(place, problem)),
        }
        Ok(())
    }

    /// Turns patches into faces of their parts.
    fn divide_patches(&mut self) -> Result<(), ImportError> {
        if let Some(line) = self.freeform.unfinished() {
            let problem = "the surface or curve has no 'end'; is the file cut off?";
            return Err(self.builder.malformed(format!("line {line}"), problem));
        }
        if self.patches.is_empty() {
            return Ok(());
        }
        let tolerance = sources::patch_tolerance(self.builder);
        let unit = soup::unit(self.builder);
        let limits = sources::limits(self.builder);
        let mesh = tessellate(&self.patches, tolerance / unit, &limits)
            .map_err(|e| self.builder.failed(e))?;
        // Triangles are as many as it takes, whatever the length of the file.
        let n: usize = mesh.triangles.iter().map(Vec::len).sum();
        self.builder.add_read_bytes((n * 36) as u64);
        let first = self.positions.len() as u32;
        let positions = mesh.positions.iter().map(DVec3::to_array);
        self.positions.extend(positions);
        for (&part, triangles) in self.patch_parts.iter().zip(&mesh.triangles) {
            let part = &mut self.parts[part];
            for triangle in triangles {
                part.faces.push(ObjFace {
                    first: part.corners.len(),
                    n: 3,
                    line: 0,
                });
                let corners = triangle.map(|v| (first + v, None, None));
                part.corners.extend(corners);
            }
        }
        if let Some(file) = self.builder.report.files.last_mut() {
            file.surface = Some(SurfaceReport {
                step: None,
                distance: mesh.distance * unit,
                n_samples: mesh.n_samples,
                enlarged: None,
                text: sources::told_of_patches(self.patches.len()),
            });
        }
        Ok(())
    }

    /// Returns up to `N` numbers, at least `n_min`, and their count.
    fn numbers<const N: usize>(
        &self,
        rest: &str,
        number: usize,
        n_min: usize,
    ) -> Result<([f64; N], usize), ImportError> {
        let mut values = [0.0; N];
        let mut n = 0;
        for (slot, word) in values.iter_mut().zip(rest.split_ascii_whitespace()) {
            *slot = word.parse().map_err(|_| {
                self.builder.malformed(
                    format!("line {number}"),
                    format!("'{}' is not a number", shortened(word)),
                )
            })?;
            n += 1;
        }
        if n < n_min {
            return Err(self.builder.malformed(
                format!("line {number}"),
                format!("{n} numbers where {n_min} are needed; is the file cut off?"),
            ));
        }
        Ok((values, n))
    }

    fn find_material(&mut self, name: &str, number: usize) -> Option<u32> {
        if name.is_empty() || matches!(name, "(null)" | "off") {
            return None;
        }
        if let Some(&material) = self.library.get(name) {
            return Some(material);
        }
        self.builder.note(
            format!("line {number}"),
            format!(
                "no material '{}' in any library; a plain one is used",
                shortened(name)
            ),
        );
        let material = self.builder.push_material(mtl::plain(name));
        self.library.insert(name.to_owned(), material);
        Some(material)
    }

    fn read_face(&mut self, rest: &str, number: usize) -> Result<(), ImportError> {
        let part = match self.current {
            Some(part) => part,
            None => self.open_part(number)?,
        };
        let first = self.parts[part].corners.len();
        for word in rest.split_ascii_whitespace() {
            let mut fields = word.split('/');
            let counts = [self.positions.len(), self.uvs.len(), self.normals.len()];
            let mut found = [None; 3];
            for (slot, n) in found.iter_mut().zip(counts) {
                *slot = match fields.next() {
                    None | Some("") => None,
                    Some(field) => Some(resolve(field, n).ok_or_else(|| {
                        self.builder.malformed(
                            format!("line {number}"),
                            format!(
                                "'{}' points at nothing: {} positions, {} texture coordinates \
                                 and {} normals are known so far",
                                shortened(word),
                                counts[0],
                                counts[1],
                                counts[2]
                            ),
                        )
                    })?),
                };
            }
            let Some(position) = found[0] else {
                return Err(self.builder.malformed(
                    format!("line {number}"),
                    format!("'{}' has no position", shortened(word)),
                ));
            };
            self.parts[part]
                .corners
                .push((position, found[1], found[2]));
        }
        let n = self.parts[part].corners.len() - first;
        if n < 3 {
            self.parts[part].corners.truncate(first);
            self.builder.note(
                format!("line {number}"),
                "a face with fewer than three vertices; left out",
            );
            return Ok(());
        }
        self.parts[part].faces.push(ObjFace {
            first,
            n,
            line: number,
        });
        Ok(())
    }

    fn open_part(&mut self, number: usize) -> Result<usize, ImportError> {
        let names = if self.is_group_latest && !self.group.is_empty() {
            [self.group.clone(), self.object.clone()]
        } else {
            [self.object.clone(), self.group.clone()]
        };
        let n = self.meshes.len();
        let mesh = *self.by_name.entry(names.clone()).or_insert(n);
        if mesh == n {
            let limit = self.builder.limits().max_objects;
            if n as u64 >= limit {
                return Err(ImportError::TooMuch {
                    path: self.builder.path.clone(),
                    place: format!("line {number}"),
                    what: "objects",
                    n: n as u64 + 1,
                    limit,
                });
            }
            self.meshes.push(MeshDraft {
                names,
                parts: Vec::new(),
            });
        }
        let parts = &mut self.meshes[mesh].parts;
        let material = self.material;
        let known = parts
            .iter()
            .copied()
            .find(|&p| self.parts[p].material == material);
        let part = known.unwrap_or_else(|| {
            self.parts.push(ObjPart {
                material,
                corners: Vec::new(),
                faces: Vec::new(),
            });
            parts.push(self.parts.len() - 1);
            self.parts.len() - 1
        });
        self.current = Some(part);
        Ok(part)
    }

    fn finish(mut self) -> Result<(), ImportError> {
        self.divide_patches()?;
        let offset = soup::recenter(&mut self.positions);
        if !self.colors.is_empty() {
            self.colors.resize(self.positions.len(), [1.0; 3]);
        }
        let stem = soup::stem(self.builder);
        let mut splitter = Splitter::new();
        for draft in std::mem::take(&mut self.meshes) {
            let [first, second] = &draft.names;
            let first = if first.is_empty() && second.is_empty() {
                &stem
            } else {
                first
            };
            let name = if first.is_empty() { second } else { first };
            let place = format!("object '{}'", shortened(name));
            let mut mesh = Mesh {
                name: name.clone(),
                primitives: Vec::new(),
            };
            for p in draft.parts {
                let mut primitive = self.build(p, &mut splitter, offset, &place)?;
                self.builder.drop_nonfinite(&place, &mut primitive);
                if !primitive.indices.is_empty() {
                    mesh.primitives.push(primitive);
                }
            }
            soup::place(self.builder, mesh, [first, second], offset, &place)?;
        }
        Ok(())
    }

    fn build(
        &mut self,
        part: usize,
        splitter: &mut Splitter,
        offset: DVec3,
        place: &str,
    ) -> Result<Primitive, ImportError> {
        let unit = soup::unit(self.builder);
        let corners = std::mem::take(&mut self.parts[part].corners);
        let faces = std::mem::take(&mut self.parts[part].faces);
        let n_triangles: usize = faces.iter().map(|f| f.n - 2).sum();
        self.builder.check_triangles(place, n_triangles as u64)?;
        // glTF forbids a picture without coordinates; missing ones are 0 and show a single color.
        let material = self.parts[part]
            .material
            .and_then(|m| self.builder.material(m));
        let has_picture = material.is_some_and(|m| m.gltf.contains("Texture\""));
        let has_uvs = has_picture || corners.iter().any(|c| c.1.is_some());
        let has_normals = corners.iter().all(|c| c.2.is_some());
        if !has_normals && corners.iter().any(|c| c.2.is_some()) {
            self.builder
                .note(place, "normals at some vertices only; left out");
        }
        let mut primitive = Primitive {
            material: self.parts[part].material,
            ..Primitive::default()
        };
        let mut uvs = Vec::new();
        let mut numbers: HashMap<Corner, u32> = HashMap::new();
        let mut shape: Vec<DVec3> = Vec::new();
        let mut vertices: Vec<u32> = Vec::new();
        for face in &faces {
            shape.clear();
            vertices.clear();
            for &corner in &corners[face.first..face.first + face.n] {
                let position = self.positions[corner.0 as usize];
                shape.push(DVec3::from_array(position));
                let corner = (corner.0, corner.1, corner.2.filter(|_| has_normals));
                let next = primitive.positions.len() as u32;
                let vertex = *numbers.entry(corner).or_insert(next);
                if vertex == next {
                    self.builder.charge_vertices(place, 1)?;
                    primitive.positions.push(position.map(|c| c as f32));
                    if has_uvs {
                        uvs.push(corner.1.map_or([0.0; 2], |i| self.uvs[i as usize]));
                    }
                    if let Some(normal) = corner.2 {
                        primitive
                            .normals
                            .push(unit_normal(self.normals[normal as usize]));
                    }
                    if let Some(c) = self.colors.get(corner.0 as usize) {
                        primitive.colors.push([c[0], c[1], c[2], 1.0]);
                    }
                }
                vertices.push(vertex);
            }
            if face.n == 3 {
                primitive.indices.extend(&vertices);
                continue;
            }
            let line = face.line;
            // The offset would be missing from the reported position otherwise.
            if offset != DVec3::ZERO {
                shape.iter_mut().for_each(|p| *p += offset);
            }
            let split = splitter.split(&shape, unit, self.builder, || format!("line {line}"))?;
            primitive
                .indices
                .extend(split.iter().map(|&i| vertices[i as usize]));
        }
        if has_uvs {
            primitive.uvs.push(uvs);
        }
        Ok(primitive)
    }
}

/// Returns a normal of length 1, as the scene requires; `+Y` for a zero vector.
fn unit_normal(n: [f32; 3]) -> [f32; 3] {
    let n = DVec3::from_array(n.map(f64::from))
        .try_normalize()
        .unwrap_or(DVec3::Y);
    n.to_array().map(|c| c as f32)
}

fn finite(c: f64) -> f32 {
    let c = c as f32;
    if c.is_finite() { c } else { 0.0 }
}

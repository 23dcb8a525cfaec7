//! Primitives and instances.

use super::accessor::{Document, Elements};
use super::compose;
use super::draco::{self, DracoMesh};
use super::json::{Instancing, PrimitiveDef};
use super::morph::{self, Rest};
use crate::ImportError;
use crate::builder::Builder;
use enfilade_geom::scene::Primitive;
use enfilade_geom::{DMat4, DVec3};
use std::collections::BTreeMap;

/// Most texture coordinate sets kept.
const MAX_UV_SETS: usize = 8;

/// Reads one primitive, with morph targets fixed at `weights`, and returns it with the width of the grid that its
/// positions were rounded to (0 if not); `None` if it has no triangles.
pub(super) fn read_primitive(
    document: &Document<'_>,
    def: &PrimitiveDef,
    weights: &[f64],
    materials: &[u32],
    place: &str,
    builder: &mut Builder<'_>,
) -> Result<Option<(Primitive, f32)>, ImportError> {
    let draco = match def.extensions.as_ref().and_then(|e| e.draco.as_ref()) {
        Some(packed) => Some(draco::decode(document, packed, place, builder)?),
        None => None,
    };
    let mut reader = PrimitiveReader {
        document,
        def,
        draco: draco.as_ref(),
        place,
        builder,
    };
    let Some(mode) = reader.mode()? else {
        return Ok(None);
    };
    let Some(positions) = reader.positions()? else {
        return Ok(None);
    };
    let n_vertices = positions.count;
    let mut indices = reader.triangles(mode, n_vertices)?;
    if indices.is_empty() {
        return Ok(None);
    }
    let used = reader.take_used(&mut indices, n_vertices)?;
    let material = reader.material(materials)?;
    let used = used.as_deref();
    let n_used = used.map_or(n_vertices, |u| u.len() as u64);
    let builder = &mut *reader.builder;
    builder.charge_memory(place, n_used, bytes_a_vertex(&def.attributes))?;
    let mut primitive = Primitive {
        positions: positions.read(used, 0.0),
        indices,
        material,
        ..Primitive::default()
    };
    reader.read_attributes(&mut primitive, used, n_vertices)?;
    if !def.targets.is_empty() {
        let rest = Rest {
            weights,
            used,
            n_vertices,
        };
        let builder = &mut *reader.builder;
        morph::apply(document, &def.targets, rest, place, &mut primitive, builder)?;
    }
    reader.builder.drop_nonfinite(place, &mut primitive);
    Ok(Some((primitive, positions.step)))
}

/// Layout of triangles in a list of indices.
#[derive(Clone, Copy, PartialEq)]
enum Mode {
    List,
    Strip,
    Fan,
}

/// One primitive while it is read.
struct PrimitiveReader<'r, 'a, 'b> {
    document: &'r Document<'b>,
    def: &'r PrimitiveDef,
    /// The decoded geometry, if it is compressed as a whole.
    draco: Option<&'r DracoMesh>,
    place: &'r str,
    builder: &'r mut Builder<'a>,
}

impl<'r> PrimitiveReader<'r, '_, '_> {
    /// Returns the layout; `None` if the primitive has no triangles.
    fn mode(&mut self) -> Result<Option<Mode>, ImportError> {
        match self.def.mode.unwrap_or(4) {
            4 => Ok(Some(Mode::List)),
            5 => Ok(Some(Mode::Strip)),
            6 => Ok(Some(Mode::Fan)),
            0..=3 => {
                self.builder.note(self.place, "points or lines; left out");
                Ok(None)
            }
            mode => Err(self
                .builder
                .malformed(self.place, format!("unknown mode {mode}"))),
        }
    }

    fn positions(&mut self) -> Result<Option<Elements<'r>>, ImportError> {
        let Some(&position) = self.def.attributes.get("POSITION") else {
            self.builder.note(self.place, "no POSITION; left out");
            return Ok(None);
        };
        let positions = self
            .elements("POSITION", position, &["VEC3"])
            .map_err(|problem| self.data_error("POSITION", &problem))?;
        Ok(Some(positions))
    }

    /// Returns index triples, from strips and fans, too; an index out of range is an error.
    fn triangles(&mut self, mode: Mode, n_vertices: u64) -> Result<Vec<u32>, ImportError> {
        let indices = self.indices(mode, n_vertices)?;
        if let Some(&bad) = indices.iter().find(|&&i| u64::from(i) >= n_vertices) {
            return Err(self.builder.malformed(
                self.place,
                format!("index {bad} is out of range: there are {n_vertices} vertices"),
            ));
        }
        let mut indices = match mode {
            Mode::List => indices,
            Mode::Strip => unroll_strip(&indices),
            Mode::Fan => unroll_fan(&indices),
        };
        let n_over = indices.len() % 3;
        if n_over != 0 {
            self.builder.note(
                self.place,
                "one or two indices after the last triangle; left out",
            );
            indices.truncate(indices.len() - n_over);
        }
        Ok(indices)
    }

    /// Returns an attribute of the compressed mesh, or of an accessor.
    fn elements(&self, name: &str, index: u32, shapes: &[&str]) -> Result<Elements<'r>, String> {
        let Some(attribute) = self.draco.and_then(|d| d.attributes.get(name)) else {
            return self.document.elements(index, shapes);
        };
        let shape = ["", "SCALAR", "VEC2", "VEC3", "VEC4"].get(attribute.n_components);
        if !shape.is_some_and(|shape| shapes.contains(shape)) {
            return Err(format!("has {} components", attribute.n_components));
        }
        let accessor = self.document.root.accessors.get(index as usize);
        Ok(Elements::of_bytes(
            &attribute.bytes,
            attribute.component,
            attribute.n_components,
            accessor.is_some_and(|a| a.normalized),
            attribute.step,
        ))
    }

    fn indices(&mut self, mode: Mode, n_vertices: u64) -> Result<Vec<u32>, ImportError> {
        if let Some(draco) = self.draco {
            self.builder
                .check_triangles(self.place, draco.indices.len() as u64 / 3)?;
            return Ok(draco.indices.clone());
        }
        let Some(index) = self.def.indices else {
            self.builder.charge_vertices(self.place, n_vertices)?;
            self.builder.charge_memory(self.place, n_vertices, 4)?;
            return Ok((0..n_vertices as u32).collect());
        };
        let elements = self
            .document
            .elements(index, &["SCALAR"])
            .map_err(|problem| self.data_error("indices", &problem))?;
        self.builder
            .check_triangles(self.place, elements.count / 3)?;
        // A strip or fan grows to three times its length.
        let n_bytes = if mode == Mode::List { 4 } else { 12 };
        self.builder
            .charge_memory(self.place, elements.count, n_bytes)?;
        elements
            .read_indices()
            .map_err(|problem| self.builder.malformed(self.place, problem))
    }

    /// Returns the used vertices, increasing, and renumbers `indices` to match; `None` if all are used.
    ///
    /// Exporters let many primitives share one long vertex list. Unless only the used vertices are kept, a small file
    /// could require memory for (primitives x vertices).
    fn take_used(
        &mut self,
        indices: &mut [u32],
        n_vertices: u64,
    ) -> Result<Option<Vec<u32>>, ImportError> {
        if self.def.indices.is_none() && self.draco.is_none() {
            return Ok(None);
        }
        let distinct = distinct(indices, n_vertices);
        self.builder
            .charge_vertices(self.place, distinct.len() as u64)?;
        if distinct.len() as u64 == n_vertices {
            return Ok(None);
        }
        for i in indices {
            // Always found, as `distinct` holds every index.
            *i = distinct.binary_search(i).unwrap_or(0) as u32;
        }
        Ok(Some(distinct))
    }

    fn material(&self, materials: &[u32]) -> Result<Option<u32>, ImportError> {
        let Some(m) = self.def.material else {
            return Ok(None);
        };
        let material = materials.get(m as usize).copied();
        let none = || {
            self.builder
                .malformed(self.place, format!("no material {m}"))
        };
        material.map(Some).ok_or_else(none)
    }

    fn attribute(
        &self,
        name: &str,
        shapes: &[&str],
        n_vertices: u64,
    ) -> Result<Option<Elements<'r>>, ImportError> {
        let Some(&index) = self.def.attributes.get(name) else {
            return Ok(None);
        };
        let elements = self
            .elements(name, index, shapes)
            .map_err(|problem| self.data_error(name, &problem))?;
        if elements.count != n_vertices {
            return Err(self.builder.malformed(
                self.place,
                format!(
                    "{name} has {} elements and POSITION {n_vertices}",
                    elements.count
                ),
            ));
        }
        Ok(Some(elements))
    }

    /// Reads normals, tangents, colors and texture coordinates of the used vertices.
    fn read_attributes(
        &mut self,
        primitive: &mut Primitive,
        used: Option<&[u32]>,
        n_vertices: u64,
    ) -> Result<(), ImportError> {
        let attribute = |name: &str, shapes: &[&str]| self.attribute(name, shapes, n_vertices);
        let normals = attribute("NORMAL", &["VEC3"])?;
        let tangents = attribute("TANGENT", &["VEC4"])?;
        let colors = attribute("COLOR_0", &["VEC3", "VEC4"])?;
        let mut uvs: Vec<Elements<'_>> = Vec::new();
        while uvs.len() < MAX_UV_SETS {
            match attribute(&format!("TEXCOORD_{}", uvs.len()), &["VEC2"])? {
                Some(set) => uvs.push(set),
                None => break,
            }
        }
        let n_kept = 1 + uvs.len() + [&normals, &tangents, &colors].into_iter().flatten().count();
        if n_kept < self.def.attributes.len() {
            self.builder.note(
                self.place,
                "attributes other than position, normal, tangent, texture coordinates and \
                 the first color; left out",
            );
        }
        let mut n_repaired = 0;
        primitive.normals = cleaned(normals.map(|e| e.read(used, 0.0)), &mut n_repaired);
        primitive.tangents = cleaned(tangents.map(|e| e.read(used, 1.0)), &mut n_repaired);
        primitive.colors = cleaned(colors.map(|e| e.read(used, 1.0)), &mut n_repaired);
        for set in uvs {
            primitive
                .uvs
                .push(cleaned(Some(set.read(used, 0.0)), &mut n_repaired));
        }
        if n_repaired > 0 {
            self.builder.note(
                self.place,
                "normals, tangents, colors or texture coordinates that are not finite; set to 0",
            );
        }
        Ok(())
    }

    fn data_error(&self, what: &str, problem: &str) -> ImportError {
        self.builder
            .malformed(self.place, format!("{what}: {problem}"))
    }
}

/// Returns the bytes per vertex that the attributes take here.
fn bytes_a_vertex(attributes: &BTreeMap<String, u32>) -> u64 {
    let bytes = |name: &String| match name.as_str() {
        "POSITION" | "NORMAL" => 12,
        "TANGENT" | "COLOR_0" => 16,
        _ if name.starts_with("TEXCOORD_") => 8,
        _ => 0,
    };
    attributes.keys().map(bytes).sum()
}

/// Returns the used indices, increasing.
fn distinct(indices: &[u32], n_vertices: u64) -> Vec<u32> {
    // Marking is several times faster, but its time grows with all vertices, used or not.
    if n_vertices <= 16 * indices.len() as u64 {
        let mut is_used = vec![false; n_vertices as usize];
        indices.iter().for_each(|&i| is_used[i as usize] = true);
        return (0..n_vertices as u32)
            .filter(|&i| is_used[i as usize])
            .collect();
    }
    let mut sorted = indices.to_vec();
    sorted.sort_unstable();
    sorted.dedup();
    sorted
}

/// Returns the values with zero for each that is not finite.
fn cleaned<const N: usize>(values: Option<Vec<[f32; N]>>, n_repaired: &mut u64) -> Vec<[f32; N]> {
    let mut values = values.unwrap_or_default();
    for c in values.iter_mut().flatten() {
        if !c.is_finite() {
            *c = 0.0;
            *n_repaired += 1;
        }
    }
    values
}

/// Returns the triangles of a strip; those with two equal indices only join its pieces.
fn unroll_strip(strip: &[u32]) -> Vec<u32> {
    strip
        .windows(3)
        .enumerate()
        .filter(|(_, t)| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
        .flat_map(|(i, t)| {
            if i % 2 == 0 {
                [t[0], t[1], t[2]]
            } else {
                [t[1], t[0], t[2]]
            }
        })
        .collect()
}

fn unroll_fan(fan: &[u32]) -> Vec<u32> {
    let Some((&hub, rim)) = fan.split_first() else {
        return Vec::new();
    };
    rim.windows(2)
        .flat_map(|pair| [hub, pair[0], pair[1]])
        .collect()
}

/// Returns the transforms of `EXT_mesh_gpu_instancing`.
pub(super) fn read_instances(
    document: &Document<'_>,
    instancing: &Instancing,
    place: &str,
    builder: &mut Builder<'_>,
) -> Result<Vec<DMat4>, ImportError> {
    let mut count: Option<u64> = None;
    let mut attribute = |name: &str, shape: &str| -> Result<Option<Elements<'_>>, String> {
        let Some(&index) = instancing.attributes.get(name) else {
            return Ok(None);
        };
        let elements = document.elements(index, &[shape])?;
        if count.is_some_and(|n| n != elements.count) {
            return Err("instance attributes differ in length".into());
        }
        count = Some(elements.count);
        Ok(Some(elements))
    };
    let mut attribute =
        |name, shape| attribute(name, shape).map_err(|problem| builder.malformed(place, problem));
    let translations = attribute("TRANSLATION", "VEC3")?;
    let rotations = attribute("ROTATION", "VEC4")?;
    let scales = attribute("SCALE", "VEC3")?;
    let Some(n) = count else {
        // Without any known placing attribute: one instance, at the node.
        return Ok(vec![DMat4::IDENTITY]);
    };
    builder.check_objects(place, n)?;
    builder.charge_memory(place, n, 2 * size_of::<DMat4>() as u64 + 40)?;
    let translations: Option<Vec<[f32; 3]>> = translations.map(|e| e.read(None, 0.0));
    let rotations: Option<Vec<[f32; 4]>> = rotations.map(|e| e.read(None, 0.0));
    let scales: Option<Vec<[f32; 3]>> = scales.map(|e| e.read(None, 0.0));
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    Ok((0..n as usize)
        .map(|i| {
            compose(
                translations.as_ref().map_or(DVec3::ZERO, |t| vector(t[i])),
                rotations
                    .as_ref()
                    .map_or([0.0, 0.0, 0.0, 1.0], |r| r[i].map(f64::from)),
                scales.as_ref().map_or(DVec3::ONE, |s| vector(s[i])),
            )
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_the_winding() {
        assert_eq!(unroll_strip(&[0, 1, 2, 3]), [0, 1, 2, 2, 1, 3]);
        assert_eq!(unroll_strip(&[0, 1, 2, 2, 3, 3, 4, 5]), [0, 1, 2, 4, 3, 5]);
        assert_eq!(unroll_fan(&[7, 1, 2, 3]), [7, 1, 2, 7, 2, 3]);
        assert!(unroll_fan(&[]).is_empty());
        assert!(unroll_strip(&[1, 2]).is_empty());
    }
}

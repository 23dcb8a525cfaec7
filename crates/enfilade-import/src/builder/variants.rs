//! Variants of meshes: mirrored ones, and their opaque or see-through parts.

use enfilade_geom::scene::{Mesh, Primitive};
use enfilade_geom::{DMat4, DVec3};

use super::{Builder, MeshPart, Placement};
use crate::ImportError;
use crate::mesh::{bytes_of, mirror};

impl Builder<'_> {
    /// Returns the transform with a positive determinant, and `true` if it needs the mirrored mesh.
    pub(super) fn unmirrored(
        &mut self,
        placement: &Placement<'_>,
        transform: DMat4,
    ) -> Result<(DMat4, bool), ImportError> {
        if !transform.is_finite() {
            return Err(self.malformed(
                placement.place,
                "its transform overflows; look for a huge scale on it or above it",
            ));
        }
        let determinant = transform.determinant();
        if determinant == 0.0 {
            self.note(placement.place, "a transform that flattens the object");
        }
        if determinant < 0.0 {
            let mirror = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
            return Ok((transform * mirror, true));
        }
        Ok((transform, false))
    }

    /// Returns the mesh, mirrored or reduced to a part on request; each variant is made once.
    pub(super) fn variant(
        &mut self,
        placement: &Placement<'_>,
        is_mirrored: bool,
        part: MeshPart,
    ) -> Result<u32, ImportError> {
        let source = placement.mesh;
        if !is_mirrored && part == MeshPart::All {
            return Ok(source);
        }
        if let Some(&mesh) = self.variants.get(&(source, is_mirrored, part)) {
            return Ok(mesh);
        }
        let original = &self.scene.meshes[source as usize];
        let steps = self.steps.get(&source).map_or(&[][..], Vec::as_slice);
        let is_kept = |p: &&Primitive| match part {
            MeshPart::All => true,
            MeshPart::Opaque => !self.is_see_through(p),
            MeshPart::SeeThrough => self.is_see_through(p),
        };
        let n_vertices: u64 = original
            .primitives
            .iter()
            .filter(is_kept)
            .map(|p| p.positions.len() as u64)
            .sum();
        let mut mesh = Mesh {
            name: original.name.clone(),
            primitives: original
                .primitives
                .iter()
                .filter(is_kept)
                .cloned()
                .collect(),
        };
        let kept_steps = original.primitives.iter().zip(steps);
        let kept_steps = kept_steps.filter(|(p, _)| is_kept(p)).map(|(_, s)| *s);
        let kept_steps = kept_steps.collect();
        self.charge_vertices(placement.place, n_vertices)?;
        self.charge_memory(placement.place, bytes_of(&mesh), 1)?;
        if is_mirrored {
            mesh.primitives.iter_mut().for_each(mirror);
            self.note(
                placement.place,
                "mirrored placement; its mesh is mirrored and its winding reversed",
            );
        }
        if part == MeshPart::SeeThrough {
            self.note(
                placement.place,
                "an object with opaque and see-through parts; split in two",
            );
        }
        let made = self.push_quantized_mesh(mesh, kept_steps);
        self.variants.insert((source, is_mirrored, part), made);
        Ok(made)
    }
}

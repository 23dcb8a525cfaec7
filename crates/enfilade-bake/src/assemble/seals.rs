//! Geometry of seals: batches of their own, with the material of the nearest surface.

use std::collections::BTreeMap;

use enfilade_cpg::{Batch, CellId};
use enfilade_geom::scene::Primitive;
use enfilade_geom::{DVec3, Winding};

use super::Cut;
use crate::complex::Seal;
use crate::structure::{SceneStructure, grown};

/// Returns the seals, one batch for each set of cells that see them and material of the nearest surface.
///
/// Each seal is grown, so that rounding leaves no slit at its rim. `O(log n)` per seal.
pub(super) fn batches(cut: &Cut<'_>) -> Vec<Batch> {
    let n_cells = cut.partition.volumes.len();
    let seals = &cut.partition.seals;
    let parts = seals
        .iter()
        .map(|seal| SealPart::of(seal, n_cells, cut.outward));
    batches_of(parts, cut.structure)
}

/// A polygon that closes a gap, or part of one.
pub(crate) struct SealPart {
    /// The cells that see it, ascending.
    pub(crate) cells: Vec<CellId>,
    /// Convex.
    pub(crate) outline: Winding,
}

impl SealPart {
    /// Makes the part that is all of a seal, grown by `outward`.
    pub(crate) fn of(seal: &Seal, n_cells: usize, outward: f64) -> Self {
        let is_cell = |c: &&u32| (**c as usize) < n_cells;
        let cells = seal.cells.iter().filter(is_cell).map(|&c| CellId(c));
        let mut cells: Vec<CellId> = cells.collect();
        // Both sides may be the same cell if a void became part of a room.
        cells.sort_unstable();
        cells.dedup();
        Self {
            cells,
            outline: grown(&seal.outline, &seal.plane, outward),
        }
    }
}

/// Returns seals, one batch for each set of cells that see them and material of the nearest surface. `O(log n)` per seal.
pub(crate) fn batches_of(
    seals: impl Iterator<Item = SealPart>,
    structure: &SceneStructure<'_>,
) -> Vec<Batch> {
    let mut by_look: BTreeMap<(Vec<CellId>, Option<u32>), Primitive> = BTreeMap::new();
    for SealPart { cells, outline } in seals {
        let material = material_near(structure, &outline);
        let to = by_look.entry((cells, material)).or_default();
        to.material = material;
        add_fan(to, &outline);
    }
    by_look
        .into_iter()
        .map(|((cells, _), primitive)| Batch {
            cells,
            primitive,
            is_seal: true,
            sources: enfilade_cpg::SourceRuns::default(),
        })
        .collect()
}

fn material_near(structure: &SceneStructure<'_>, outline: &Winding) -> Option<u32> {
    let n = outline.points.len();
    let middle = outline.points.iter().sum::<DVec3>() / n as f64;
    let nearest = structure.bvh.nearest(middle, f64::INFINITY)?;
    let source = structure.sources[nearest.triangle as usize];
    let mesh = structure.scene.objects[source.object as usize].mesh;
    structure.scene.meshes[mesh as usize].primitives[source.primitive as usize].material
}

fn add_fan(to: &mut Primitive, outline: &Winding) {
    let first = to.positions.len() as u32;
    let corners = outline.points.iter().map(|p| p.as_vec3().to_array());
    to.positions.extend(corners);
    for i in 1..outline.points.len().saturating_sub(1) as u32 {
        to.indices.extend([first, first + i, first + i + 1]);
    }
}

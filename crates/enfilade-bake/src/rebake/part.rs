//! A bake of a part of a scene, on the grid of the whole scene.
//!
//! The part is a box that cuts rooms. Where it does, its faces are candidate portals for the complex, so that what is beyond joins
//! nothing; and air at its border that was outdoors is outdoors.

use enfilade_cpg::{DecidedPlace, Locator, Portal, Reason, Why, World};
use enfilade_geom::{Aabb, DVec3, Triangle, Winding};

use super::block::Block;
use super::ground::Ground;
use super::tree::cell_of;
use crate::assemble::{Cut, SealPart, portals_of};
use crate::complex::{ComplexInput, Label, Partition, TriangleCells, Vote, build_complex_within};
use crate::proposal::Proposal;
use crate::realize::{Divided, part, places_of};
use crate::rooms::{self, Basins, VoxelRange};
use crate::structure::{Candidate, OUTDOORS, Structure};
use crate::voxel::{BitVolume, DistanceField, Grid};
use crate::{BakeConfig, BakeContext, BakeError, Stage};

/// Distance of a part's faces from the border of its voxels, so that they do not lie in walls. [Units: vx]
const INSET: f64 = 0.37;

/// A baked part. Its cells have numbers of their own.
pub(super) struct BakedPart {
    pub(super) locator: Locator,
    pub(super) volumes: Vec<f64>,
    pub(super) aabbs: Vec<Aabb>,
    pub(super) is_void: Vec<bool>,
    pub(super) whys: Vec<Vec<Why>>,
    /// Close decisions about places in the part that are not cells.
    pub(super) places: Vec<DecidedPlace>,
    /// Cells that are matter, or not in the part.
    pub(super) is_beyond: Vec<bool>,
    pub(super) portals: Vec<Portal>,
    pub(super) seals: Vec<SealPart>,
    /// The cells that see each triangle, by its place in `numbers`.
    pub(super) triangle_cells: TriangleCells,
    /// Numbers of its triangles in the scene, ascending.
    pub(super) numbers: Vec<u32>,
}

/// Bakes the part in a range of voxels.
///
/// # Errors
/// If the caller cancels.
pub(super) fn bake_part(
    ground: &Ground<'_>,
    old: &World,
    range: &VoxelRange,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<BakedPart, BakeError> {
    let allowance = context.allowance();
    context.begin(Stage::Distance)?;
    let (air, distances) = ground.air.part(range, allowance);
    context.begin(Stage::Flood)?;
    let outdoors = outdoors_at_border(&air.grid, &distances, ground, old);
    let field = DistanceField::of_squared(air.grid.dims, distances, &outdoors);
    let basins = Basins::flooded(&air, &field, config, allowance);
    drop(field);
    context.check()?;
    let grid = air.grid;
    let of_part = structure_in(ground, &grid.aabb().expanded(config.merge.surround));
    let mut proposal = rooms::propose(&of_part, air, basins, config, context)?;
    drop(of_part);

    context.begin(Stage::Complex)?;
    close_off(&mut proposal, ground, &grid);
    let is_near = |t: &u32| ground.boxes[*t as usize].overlaps(&grid.aabb());
    let numbers: Vec<u32> = (0..ground.boxes.len() as u32).filter(is_near).collect();
    let (divided, outward) = cut_by(&proposal, ground, &numbers, &grid, context)?;
    let Divided {
        mut partition,
        whys,
    } = divided;
    // The cell at the border of the whole box is beyond the part.
    partition.outside = outdoors_of(&partition);
    context.begin(Stage::Geometry)?;
    let labels = (0..).zip(&partition.label_of_cell);
    let is_void: Vec<bool> = labels
        .map(|(c, label)| partition.outside != Some(c) && matches!(label, Label::Void(_)))
        .collect();
    let cut = Cut {
        structure: &ground.scene,
        partition,
        whys: &whys,
        candidates: &proposal.candidates,
        outward,
        closed_share: config.merge.closed_share,
        land: proposal.land.clone(),
        allowance,
    };
    let portals = portals_of(&cut, &|c| is_void[c as usize]);
    context.check()?;
    let Partition {
        mut locator,
        volumes,
        aabbs,
        seals,
        triangle_cells,
        label_of_cell,
        ..
    } = cut.partition;
    // Matter that the faces cut joins the space beyond: nothing else is open to it.
    let is_beyond: Vec<bool> = label_of_cell
        .iter()
        .map(|label| *label == Label::Beyond)
        .collect();
    for node in &mut locator.nodes {
        node.children = node.children.map(|c| match cell_of(c) {
            Some(cell) if is_beyond[cell.0 as usize] => Locator::leaf(None),
            _ => c,
        });
    }
    let seals = seals.iter();
    Ok(BakedPart {
        seals: seals
            .map(|s| SealPart::of(s, volumes.len(), outward))
            .collect(),
        locator,
        volumes,
        aabbs,
        is_void,
        places: places_of(&proposal),
        whys,
        is_beyond,
        portals,
        triangle_cells,
        numbers,
    })
}

/// Separates a proposal for the voxels of a part from the space beyond: by a candidate on each face, and votes of its own there.
fn close_off(proposal: &mut Proposal, ground: &Ground<'_>, grid: &Grid) {
    let frame = ground.structure.frame;
    let inset = grid.aabb().expanded(-INSET * grid.voxel);
    let block = Block::new(inset, frame, &ground.bounds);
    for face in inset.faces() {
        // Each reaches beyond its edges, so that they meet.
        let middle = face.iter().sum::<DVec3>() / 4.0;
        let reach = 0.2 * grid.voxel;
        let to = face.map(|p| frame.to_scene(p + (p - middle).normalize() * reach));
        proposal.candidates.push(Candidate {
            why: Why::given(Reason::Gap),
            winding: Winding::new(to.to_vec()),
            closed: 0.0,
        });
    }
    proposal.votes.retain(|v| block.contains([&v.point], 0.0));
    proposal.voids.retain(|(p, _)| block.contains([p], 0.0));
    let beyond = ground.bounds.expanded(-0.5 * grid.voxel).corners();
    let weight = ground.bounds.volume() as f32;
    let beyond = beyond.iter().filter(|p| !block.contains([*p], 0.0));
    proposal.votes.extend(beyond.map(|&point| Vote {
        point,
        label: Label::Beyond,
        weight,
    }));
}

/// Makes a proposal for a part exact, within the box of the whole scene; returns also how far outlines grow.
fn cut_by(
    proposal: &Proposal,
    ground: &Ground<'_>,
    numbers: &[u32],
    grid: &Grid,
    context: &BakeContext<'_>,
) -> Result<(Divided, f64), BakeError> {
    let triangles = numbers.iter().map(|&t| ground.scene.triangles[t as usize]);
    let triangles: Vec<Triangle> = triangles.collect();
    let candidates = proposal.candidates.iter();
    let windings: Vec<Winding> = candidates.map(|c| c.winding.clone()).collect();
    let around = ground.structure.frame.aabb_to_scene(&grid.aabb());
    let missing = ground.scene.missing.iter();
    let missing: Vec<Triangle> = missing
        .filter(|t| around.overlaps(&Aabb::of_points(*t)))
        .copied()
        .collect();
    let hole = ground.structure.hole;
    let input = ComplexInput {
        triangles: &triangles,
        candidates: &windings,
        missing: &missing,
        bounds: ground.bounds,
        gap: hole.gap(),
        has_seals: hole.has_seals(),
    };
    let complex = build_complex_within(&input, context.allowance());
    context.begin(Stage::Partition)?;
    let divided = part(&complex, proposal, context.allowance());
    Ok((divided, complex.opening_tolerance()))
}

/// Returns the air at the border of a part that was outdoors.
fn outdoors_at_border(
    grid: &Grid,
    distances: &[u16],
    ground: &Ground<'_>,
    old: &World,
) -> BitVolume {
    let [nx, ny, nz] = grid.dims;
    let mut out = BitVolume::new(grid.dims);
    let outdoors = old.graph.outdoors();
    let frame = ground.structure.frame;
    for z in 0..nz {
        for y in 0..ny {
            let is_face = z == 0 || z + 1 == nz || y == 0 || y + 1 == ny;
            let step = if is_face { 1 } else { nx.max(2) - 1 };
            for x in (0..nx).step_by(step) {
                if distances[grid.index(x, y, z)] == 0 {
                    continue;
                }
                let p = frame.to_scene(grid.center(x, y, z));
                if old.graph.locator.locate(p) == outdoors {
                    out.set(x, y, z, true);
                }
            }
        }
    }
    out
}

/// Returns the structure near a box in frame coordinates. Rays still meet all of it.
fn structure_in<'a>(ground: &'a Ground<'_>, within: &Aabb) -> Structure<'a> {
    let whole = &ground.structure;
    let is_near = |t: &Triangle| Aabb::of_points(t).overlaps(within);
    let near = |from: &[Triangle]| from.iter().filter(|t| is_near(t)).copied().collect();
    let walls = whole.wall_numbers.iter().zip(&whole.walls);
    Structure {
        scene: whole.scene,
        sources: Vec::new(),
        triangles: Vec::new(),
        frame: whole.frame,
        walls: near(&whole.walls),
        wall_numbers: walls.filter(|w| is_near(w.1)).map(|w| *w.0).collect(),
        stairs: near(&whole.stairs),
        bvh: whole.bvh.clone(),
        rims: crate::structure::Rims::of(&[]),
        missing: near(&whole.missing),
        hole: whole.hole,
        allowance: whole.allowance,
    }
}

/// Returns the largest cell outdoors.
fn outdoors_of(partition: &Partition) -> Option<u32> {
    let labels = (0..).zip(&partition.label_of_cell);
    let outdoors = labels.filter(|(_, label)| **label == Label::Region(OUTDOORS));
    let volume = |c: &u32| partition.volumes[*c as usize];
    outdoors
        .map(|(c, _)| c)
        .max_by(|a, b| volume(a).total_cmp(&volume(b)).then(b.cmp(a)))
}

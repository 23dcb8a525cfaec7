//! Bakes again what a change of the scene reaches, and keeps the rest of a world.
//!
//! A wall is broken, a door is cut, a cupboard moves: all but a few rooms stay as they are. [`rebake`] compares the new scene with
//! the triangles of the world, bakes the part around the changes on the grid of the whole scene, and puts it into the world:
//!
//! 1. *Ground* (`ground`): what the whole scene decides, such as the grid and where storeys end. If any of it changed, so may every
//!    room, and the scene is baked whole.
//! 2. *Changes* (`diff`): triangles that are new or gone.
//! 3. *BakedPart* (`part`): a bake of a box around the changes, by the stages of every bake.
//! 4. *Seam* (`seam`): a smaller box, the block, is to be replaced. On its faces, the part must agree with the old world: on air and
//!    matter, on cells that go on, on portals that cross. Where it does not, the block grows by what disagrees, and the part with it;
//!    in the end, the scene is baked whole. So this is only a faster way to the same graph.
//! 5. *LocatorSplice* (`splice`, `tree`): locator, cells, portals, seals, and the cells that see each triangle are those of the part in the
//!    block, and the old ones beyond it. Batches, details and fittings are made as in every bake.
//!
//! Cells keep their numbers and names. Those that are new take the numbers of those that are gone; if more are gone, the last cells
//! move into the gaps, and [`Rebaked::cell_of`] tells where.
//!
//! **Which way it errs:** decisions that reach farther than the part are not seen unless they show at the seam.

mod block;
mod diff;
mod ground;
mod joint;
mod numbers;
mod outcome;
mod part;
mod seam;
mod splice;
mod tree;
mod whole;

use std::collections::BTreeSet;

use enfilade_cpg::{CellId, World};
use enfilade_geom::scene::Scene;
use enfilade_geom::{Aabb, DVec3};

use crate::budget::n_structural;
use crate::config::PADDING;
use crate::names::name_cells;
use crate::{BakeConfig, BakeContext, BakeError, Method};

pub use outcome::{RebakeError, Rebaked, WholeBecause};

use block::Block;
use ground::Ground;
use seam::Seam;
use tree::PlaneTree;

/// Distance from a change within which everything may differ: as far as openings are measured, and a doorway. [Units: wu]
const REACH: f64 = 1.5;
/// Width of the part around the block, in which rooms are found again only to be compared. [Units: wu]
const AROUND: f64 = 1.5;
/// … and its height above and below the block where that ends in slabs. [Units: wu]
const BEYOND_SLAB: f64 = 0.5;
/// Greatest distance of a change from a slab at which its block ends. [Units: wu]
const STOREY: f64 = 4.5;
/// Distance of the block's end from the middle of a slab: floors without thickness are in the block. [Units: wu]
const OFF_SLAB: f64 = 0.013;
/// Distance from a change within which cells are touched. [Units: wu]
const TOUCH: f64 = 0.1;
/// Largest share of the scene's voxels that is baked as a part: at 0.27 a part takes 0.4 of the time of a bake, and may not fit.
const MOST: f64 = 0.2;
/// Most times that a block grows.
const TRIES: usize = 4;

/// Bakes what changed between the scene of a world and a new scene.
///
/// The result is that of [`bake`](crate::bake()) with the same settings, up to the numbers of cells and portals. Visible sets are
/// dropped, as by every edit. Ends within about a second after the context's `cancel` becomes true; `old` is unchanged then.
///
/// # Errors
/// As [`bake`](crate::bake()); if the old world was baked from something else or by other settings, or was edited.
pub fn rebake(
    old: &World,
    scene: &Scene,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<Rebaked, RebakeError> {
    ground::check(old, config)?;
    config
        .costs
        .cost
        .check(&scene.materials)
        .map_err(BakeError::from)?;
    let why = match ground::why_whole(old, scene, config) {
        Some(why) => why,
        None => match rebake_part(old, scene, config, context)? {
            Ok(rebaked) => return Ok(rebaked),
            Err(why) => why,
        },
    };
    whole::bake_whole(old, scene, config, context, why)
}

/// Bakes a part, if that is enough.
fn rebake_part(
    old: &World,
    scene: &Scene,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<Result<Rebaked, WholeBecause>, RebakeError> {
    let context = &context.within(&config.budget, n_structural(scene));
    context.begin_method(Method::Watershed, "as for the old world")?;
    let ground = match Ground::of(old, scene, config, context)? {
        Ok(ground) => ground,
        Err(why) => return Ok(Err(why)),
    };
    let changes = ground.diff.boxes.iter().map(|b| ground.to_frame(b));
    let changes = changes.fold(Aabb::EMPTY, Aabb::union);
    if changes.is_empty() {
        let world = splice::unchanged(old, &ground, context);
        return Ok(Ok(finished(world, old, scene, context)));
    }
    // Beyond all structure there is nothing but air, and a part ends where the grid does.
    let padding = PADDING as f64 * ground.air.grid.voxel / 2.0;
    let most = ground.structure.bounds().expanded(padding);
    let aside = DVec3::new(REACH, 0.0, REACH);
    let mut wanted = Aabb::new(changes.min - aside, changes.max + aside);
    let touched = touched_cells(old, &ground.diff.boxes);
    let old_tree = PlaneTree::of(&old.graph.locator);
    let mut tried = None;
    for _ in 0..TRIES {
        let air = &ground.air;
        let (block, of_part) = in_storeys(&wanted, &air.slabs);
        let block = block.intersection(most);
        let range = air.range(&of_part);
        let n: usize = range.dims().iter().product();
        if n as f64 > MOST * air.grid.n_voxels() as f64 {
            return Ok(Err(WholeBecause::Extent));
        }
        // The same part again would fit no better.
        if tried.replace((block, range)) == Some((block, range)) {
            return Ok(Err(WholeBecause::Seam));
        }
        let part = part::bake_part(&ground, old, &range, config, context)?;
        let block = Block::new(block, ground.structure.frame, &old.graph.locator.bounds);
        let part_tree = PlaneTree::of(&part.locator);
        match Seam::of(old, &part, &block, [&old_tree, &part_tree], &touched) {
            Ok(seam) => {
                let joint = joint::Joint {
                    old,
                    ground: &ground,
                    part: &part,
                    seam: &seam,
                    block: &block,
                    trees: [&old_tree, &part_tree],
                    touched: &touched,
                };
                let spliced = joint.spliced(context);
                context.check()?;
                return Ok(Ok(finished(spliced, old, scene, context)));
            }
            Err(misfit) => {
                let before = wanted;
                for b in misfit.boxes {
                    let mut b = ground.to_frame(&b);
                    b = Aabb::new(b.min - aside / 2.0, b.max + aside / 2.0);
                    wanted = wanted.union(b.intersection(most));
                }
                if wanted == before {
                    return Ok(Err(WholeBecause::Seam));
                }
            }
        }
    }
    Ok(Err(WholeBecause::Seam))
}

/// Returns the boxes of a block and of its part: up and down they end in the slabs of the storeys that they touch, as rooms do, or
/// as far away as to the sides.
fn in_storeys(wanted: &Aabb, slabs: &[f64]) -> (Aabb, Aabb) {
    let (mut block, mut part) = (*wanted, *wanted);
    let aside = DVec3::new(AROUND, 0.0, AROUND);
    (part.min, part.max) = (part.min - aside, part.max + aside);
    let mut below = slabs.iter().rev().map(|h| h - OFF_SLAB);
    let below = below.find(|&h| h <= wanted.min.y);
    let mut above = slabs.iter().map(|h| h + OFF_SLAB);
    let above = above.find(|&h| h >= wanted.max.y);
    let ends = |slab: Option<f64>, from: f64, out: f64| match slab {
        Some(slab) if (slab - from).abs() <= STOREY => (slab, slab + out * BEYOND_SLAB),
        _ => (from + out * REACH, from + out * (REACH + AROUND)),
    };
    (block.min.y, part.min.y) = ends(below, wanted.min.y, -1.0);
    (block.max.y, part.max.y) = ends(above, wanted.max.y, 1.0);
    (block, part)
}

/// Returns the cells at the boxes.
fn touched_cells(old: &World, boxes: &[Aabb]) -> BTreeSet<CellId> {
    let mut cells = Vec::new();
    for b in boxes {
        old.graph
            .locator
            .cells_near(&b.corners(), TOUCH, &mut cells);
    }
    cells.into_iter().collect()
}

/// Names the cells of a spliced world.
fn finished(
    mut spliced: splice::Spliced,
    old: &World,
    scene: &Scene,
    context: &BakeContext<'_>,
) -> Rebaked {
    let mut notes = Vec::new();
    name_cells(&mut spliced.world, &mut notes, &scene.rooms);
    if old.pvs.is_some() {
        notes.push("the visible sets of the old world are dropped: compute them again".to_owned());
    }
    context.end_stage();
    Rebaked {
        world: spliced.world,
        cell_of: spliced.cell_of,
        changed: spliced.changed,
        block: spliced.block,
        whole: None,
        notes,
        times: context.times(),
    }
}

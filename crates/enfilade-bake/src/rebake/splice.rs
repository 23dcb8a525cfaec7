//! Puts a baked part into a world.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_cpg::{Batch, Cell, CellId, CellPortalGraph, Locator, Portal, Provenance, World};
use enfilade_geom::scene::Role;
use enfilade_geom::{Aabb, DVec3, Winding, plane_tolerance, triangle_area_normal};

use super::block::Block;
use super::diff::NEW;
use super::ground::Ground;
use super::joint::{Joint, Share};
use super::numbers::Numbers;
use super::seam::{Place, box_of_portal, in_one_plane};
use super::tree::{LocatorSplice, PlaneTree, cell_of};
use crate::BakeContext;
use crate::assemble::{SealPart, batches_of, dressed};
use crate::names::is_number_of_other;
use crate::realize::input_hash;

/// Largest difference of the volumes of one cell in the block. [Units: wu³]
const SAME_VOLUME: f64 = 1e-6;
/// Largest distance of the boxes of one portal, and difference of its areas. [Units: wu], [Units: wu²]
const SAME_PORTAL: f64 = 1e-4;

/// Distance within which an object that is buried in matter finds cells. [Units: wu]
const BURIED: f64 = 0.6;

/// A world with a part put in.
pub(super) struct Spliced {
    pub(super) world: World,
    pub(super) cell_of: Vec<Option<CellId>>,
    pub(super) changed: Vec<CellId>,
    pub(super) block: Aabb,
}

/// Returns the world of a scene in which nothing changed that rooms depend on.
pub(super) fn unchanged(old: &World, ground: &Ground<'_>, context: &BakeContext<'_>) -> Spliced {
    let graph = CellPortalGraph {
        cells: old.graph.cells.iter().map(bare).collect(),
        portals: old.graph.portals.iter().map(unfitted).collect(),
        ..old.graph.clone()
    };
    let seals = old.batches.iter().filter(|b| b.is_seal).cloned().collect();
    let tree = PlaneTree::of(&old.graph.locator);
    let eps = plane_tolerance(old.graph.locator.bounds.extent());
    let list_of = |t: usize| match ground.diff.batch_of[t] {
        // A surface in other triangles.
        NEW => {
            let mut cells = BTreeSet::new();
            tree.beside(&ground.scene.triangles[t], eps, &mut cells);
            cells.iter().map(|c| c.0).collect()
        }
        batch => numbers_of(&old.batches[batch as usize].cells),
    };
    let touched_by = |i: usize| {
        let detail = &old.details[ground.diff.detail_of[i]? as usize];
        Some(detail.cells.clone())
    };
    let world = made(ground, graph, &list_of, &touched_by, seals, context);
    Spliced {
        world,
        cell_of: old.graph.cell_ids().map(Some).collect(),
        changed: Vec::new(),
        block: Aabb::EMPTY,
    }
}

/// Returns a cell without what is counted again.
fn bare(cell: &Cell) -> Cell {
    Cell {
        n_triangles: 0,
        n_detail_triangles: 0,
        portals: Vec::new(),
        ..cell.clone()
    }
}

fn unfitted(portal: &Portal) -> Portal {
    Portal {
        fittings: Vec::new(),
        ..portal.clone()
    }
}

fn numbers_of(cells: &[CellId]) -> Vec<u32> {
    cells.iter().map(|c| c.0).collect()
}

/// Makes the world of a graph.
fn made(
    ground: &Ground<'_>,
    mut graph: CellPortalGraph,
    list_of: &dyn Fn(usize) -> Vec<u32>,
    touched_by: &(dyn Fn(usize) -> Option<Vec<CellId>> + Sync),
    seals: Vec<Batch>,
    context: &BakeContext<'_>,
) -> World {
    let scene = &ground.scene;
    let n_detail = scene.scene.triangle_sources(Role::Detail).count();
    let sealing = || seals.iter().flat_map(|b| b.primitive.triangles());
    let counts = &mut graph.statistics.counts;
    for (name, count) in [
        ("input_triangles", (scene.sources.len() + n_detail) as f64),
        ("structural_triangles", scene.sources.len() as f64),
        (
            "seal_area",
            sealing()
                .map(|t| 0.5 * triangle_area_normal(&t).length())
                .sum(),
        ),
    ] {
        counts.insert(name.to_owned(), count);
    }
    *counts.entry("rebakes".to_owned()).or_default() += 1.0;
    graph.provenance = Provenance {
        generator: concat!("enfilade ", env!("CARGO_PKG_VERSION")).to_owned(),
        input_hash: input_hash(&scene.triangles, &graph.provenance.settings),
        ..graph.provenance
    };
    dressed(
        scene,
        graph,
        list_of,
        touched_by,
        seals,
        context.allowance(),
    )
}

impl Joint<'_> {
    /// Puts the part in.
    pub(super) fn spliced(&self, context: &BakeContext<'_>) -> Spliced {
        let Self {
            old, part, block, ..
        } = *self;
        let [old_tree, part_tree] = self.trees;
        let n_old = old.graph.cells.len();
        let mut before = vec![Share::default(); n_old];
        add_shares(old_tree, block, &mut before);
        let mut after = vec![Share::default(); part.volumes.len()];
        add_shares(part_tree, block, &mut after);
        let splice = LocatorSplice::around(old_tree, block, n_old);
        let numbers = Numbers::of(self, &splice.is_beyond, &after);
        let leaf_of = |leaf: i32| {
            let n = cell_of(leaf).and_then(|c| numbers.of_part(c.0));
            Locator::leaf(n.map(CellId))
        };
        let mut locator = splice.filled(part_tree, &leaf_of);
        numbers.renumber_locator(&mut locator);

        let cells = self.cells(&numbers, [&before, &after], &locator);
        let (portals, mut changed) = self.portals(&numbers);
        let graph = CellPortalGraph {
            specials: Vec::new(),
            cells,
            portals,
            locator: locator.into(),
            provenance: old.graph.provenance.clone(),
            statistics: old.graph.statistics.clone(),
            places: self.places(),
        };
        let seals = self.seals(&numbers);
        let eps = plane_tolerance(old.graph.locator.bounds.extent());
        let list_of = |t: usize| self.cells_of_triangle(t, &numbers, eps);
        changed.extend(numbers.fresh());
        changed.extend(self.touched.iter().filter_map(|c| numbers.of_old(*c)));
        let touched_by = |i: usize| self.cells_of_object(i, &numbers);
        let world = made(self.ground, graph, &list_of, &touched_by, seals, context);
        Spliced {
            world,
            cell_of: old.graph.cell_ids().map(|c| numbers.of_old(c)).collect(),
            changed: changed.into_iter().collect(),
            block: block.around,
        }
    }

    /// Returns the cells, by their new numbers.
    fn cells(
        &self,
        numbers: &Numbers,
        [before, after]: [&[Share]; 2],
        locator: &Locator,
    ) -> Vec<Cell> {
        let mut cells = vec![Cell::default(); numbers.len()];
        let mut shares: BTreeMap<u32, Share> = BTreeMap::new();
        for (n, share) in (0..).zip(after) {
            if let Some(id) = numbers.of_part(n) {
                let id = numbers.last(id);
                let sum = shares.entry(id).or_default();
                sum.volume += share.volume;
                sum.aabb = sum.aabb.union(share.aabb);
            }
        }
        for (o, cell) in self.old.graph.cells.iter().enumerate() {
            let Some(id) = numbers.of_old(CellId(o as u32)) else {
                continue;
            };
            let mut cell = bare(cell);
            let share = shares.remove(&id.0).unwrap_or_default();
            let gained = share.volume - before[o].volume;
            let is_other = gained.abs() > SAME_VOLUME;
            if is_other && cell.outdoor {
                cell.volume = (f64::from(cell.volume) + gained) as f32;
            } else if is_other || self.touched.contains(&CellId(o as u32)) {
                measure(&mut cell, locator, id);
            }
            cells[id.0 as usize] = cell;
        }
        for (n, &is_void) in (0..).zip(&self.part.is_void) {
            let Some(id) = numbers.of_part(n).map(|id| numbers.last(id)) else {
                continue;
            };
            if self.seam.old_of.contains_key(&n) {
                continue;
            }
            let cell = &mut cells[id as usize];
            cell.is_void = is_void;
            cell.why = self.part.whys[n as usize].clone();
            cell.volume = self.part.volumes[n as usize] as f32;
            let b = self.part.aabbs[n as usize];
            cell.aabb = [b.min, b.max].map(|p| p.as_vec3().to_array());
        }
        name_by_number(&mut cells);
        cells
    }

    /// Returns the close decisions: those of the part in the block, the old ones beyond it.
    fn places(&self) -> Vec<enfilade_cpg::DecidedPlace> {
        let is_in = |place: &&enfilade_cpg::DecidedPlace| {
            let p = DVec3::from_array(place.at.map(f64::from));
            self.block.contains([&p], 0.0)
        };
        let old = self.old.graph.places.iter().filter(|p| !is_in(p));
        let new = self.part.places.iter().filter(is_in);
        old.chain(new).cloned().collect()
    }

    /// Returns the portals, without fittings, and the cells of those that are new or gone.
    fn portals(&self, numbers: &Numbers) -> (Vec<Portal>, BTreeSet<CellId>) {
        let mut changed = BTreeSet::new();
        let old = &self.old.graph.portals;
        let mut slots: Vec<Option<Portal>> = (old.iter().zip(&self.seam.old_portals))
            .map(|(p, place)| (*place != Place::Inside).then(|| unfitted(p)))
            .collect();
        let mut gone: Vec<usize> = (0..old.len()).filter(|&i| slots[i].is_none()).collect();
        let mut new: Vec<Portal> = Vec::new();
        for (p, place) in self.part.portals.iter().zip(&self.seam.portals) {
            let cells = p.cells.map(|c| numbers.of_part(c.0));
            let ([Some(a), Some(b)], Place::Inside) = (cells, place) else {
                continue;
            };
            if a == b {
                continue;
            }
            let mut portal = p.clone();
            portal.cells = [CellId(a), CellId(b)];
            // A portal as before keeps its number, and its last bit.
            let is_same = |&&i: &&usize| is_same(&old[i], &portal);
            match gone.iter().position(|i| is_same(&i)) {
                Some(at) => {
                    let i = gone.remove(at);
                    let mut kept = unfitted(&old[i]);
                    kept.kind = portal.kind;
                    slots[i] = Some(kept);
                }
                None => new.push(portal),
            }
        }
        changed.extend(
            gone.iter()
                .flat_map(|&i| old[i].cells)
                .filter_map(|c| numbers.of_old(c)),
        );
        let mut gone = gone.into_iter();
        for portal in new {
            changed.extend(portal.cells.map(|c| CellId(numbers.last(c.0))));
            match gone.next() {
                Some(i) => slots[i] = Some(portal),
                None => slots.push(Some(portal)),
            }
        }
        // The last ones move into the gaps that are left.
        while let Some(gap) = slots.iter().position(Option::is_none) {
            slots.swap_remove(gap);
        }
        let mut portals: Vec<Portal> = slots.into_iter().flatten().collect();
        for portal in &mut portals {
            portal.cells = portal.cells.map(|c| CellId(numbers.last(c.0)));
        }
        (portals, changed)
    }

    /// Returns the seals beyond the block, and those of the part in it.
    fn seals(&self, numbers: &Numbers) -> Vec<Batch> {
        let mut seals: Vec<SealPart> = Vec::new();
        let named = |ids: &mut dyn Iterator<Item = u32>| {
            let mut cells: Vec<CellId> = ids.map(|id| CellId(numbers.last(id))).collect();
            cells.sort_unstable();
            cells.dedup();
            cells
        };
        for batch in self.old.batches.iter().filter(|b| b.is_seal) {
            let cells = named(&mut batch.cells.iter().map(|c| c.0));
            for triangle in batch.primitive.triangles() {
                self.block.outside(&triangle, &mut |part| {
                    seals.push(SealPart {
                        cells: cells.clone(),
                        outline: Winding::new(part.to_vec()),
                    });
                });
            }
        }
        for seal in &self.part.seals {
            let cells = seal.cells.iter().filter_map(|c| numbers.of_part(c.0));
            let cells = named(&mut cells.collect::<Vec<_>>().into_iter());
            if let Some(inside) = self.block.inside(&seal.outline.points) {
                seals.push(SealPart {
                    cells,
                    outline: Winding::new(inside.to_vec()),
                });
            }
        }
        batches_of(seals.into_iter(), &self.ground.scene)
    }

    /// Returns the cells that see a triangle, ascending.
    fn cells_of_triangle(&self, t: usize, numbers: &Numbers, eps: f64) -> Vec<u32> {
        let triangle = &self.ground.scene.triangles[t];
        let was = match self.ground.diff.batch_of[t] {
            NEW => None,
            batch => Some(&self.old.batches[batch as usize].cells),
        };
        let is_far = !Aabb::of_points(triangle).overlaps(&self.block.around);
        let mut beyond: BTreeSet<CellId> = BTreeSet::new();
        let mut seen: Vec<u32> = Vec::new();
        if let (true, Some(was)) = (is_far, was) {
            beyond.extend(was);
        } else {
            // Beyond the block, cells of the part are cut off.
            let mut within = BTreeSet::new();
            if let Some(inside) = self.block.inside(triangle) {
                self.trees[1].beside(&inside, eps, &mut within);
            }
            if let Ok(k) = self.part.numbers.binary_search(&(t as u32)) {
                let of_part = self.part.triangle_cells.both(k).into_iter();
                let of_part = of_part.filter(|n| within.contains(&CellId(*n)));
                let of_part = of_part.filter_map(|n| numbers.of_part(n));
                seen.extend(of_part.map(|id| numbers.last(id)));
            }
            if !self.block.contains(triangle, 0.0) {
                self.block.outside(triangle, &mut |part| {
                    self.trees[0].beside(part, eps, &mut beyond);
                });
            }
            // Where the tree only comes near, what was seen before decides.
            if let Some(was) = was {
                beyond.retain(|c| was.binary_search(c).is_ok());
            }
        }
        seen.extend(
            beyond
                .iter()
                .filter_map(|c| numbers.of_old(*c))
                .map(|c| c.0),
        );
        seen.sort_unstable();
        seen.dedup();
        seen
    }
}

impl Joint<'_> {
    /// Returns the cells that a detail touches, if it is the same as before and all of it is away from the block.
    fn cells_of_object(&self, i: usize, numbers: &Numbers) -> Option<Vec<CellId>> {
        let detail = &self.old.details[self.ground.diff.detail_of[i]? as usize];
        let bounds = self.ground.scene.scene.object_aabb(i).expanded(BURIED);
        if bounds.overlaps(&self.block.around) {
            return None;
        }
        let cells = detail.cells.iter().map(|&c| numbers.of_old(c));
        let mut cells: Vec<CellId> = cells.collect::<Option<_>>()?;
        cells.sort_unstable();
        Some(cells)
    }
}

/// Adds volume and box of each cell of a tree in the block.
fn add_shares(tree: &PlaneTree<'_>, block: &Block, shares: &mut [Share]) {
    tree.parts(
        block.region.clone(),
        &|leaf| leaf <= -2,
        &mut |leaf, shape, aabb| {
            if let Some(cell) = cell_of(leaf) {
                let share = &mut shares[cell.0 as usize];
                share.volume += shape.volume;
                share.aabb = share.aabb.union(aabb);
            }
        },
    );
}

/// Measures a cell anew.
fn measure(cell: &mut Cell, locator: &Locator, id: CellId) {
    let tree = PlaneTree::of(locator);
    let wanted = Locator::leaf(Some(id));
    let mut share = Share::default();
    let region = crate::complex::region::whole(&locator.bounds, super::block::CUT);
    tree.parts(region, &|leaf| leaf == wanted, &mut |_, shape, aabb| {
        share.volume += shape.volume;
        share.aabb = share.aabb.union(aabb);
    });
    cell.volume = share.volume as f32;
    if !cell.outdoor && !share.aabb.is_empty() {
        cell.aabb = [share.aabb.min, share.aabb.max].map(|p| p.as_vec3().to_array());
    }
}

/// Names the cells that have no name, or the number of another cell, by their own numbers.
fn name_by_number(cells: &mut [Cell]) {
    for (id, cell) in (0..).map(CellId).zip(cells) {
        if cell.name.is_empty() || is_number_of_other(&cell.name, id) {
            cell.name = format!("cell-{}", id.0);
        }
    }
}

/// Returns `true` if two portals are the same opening between the same cells.
fn is_same(a: &Portal, b: &Portal) -> bool {
    let is_between = a.cells.iter().all(|c| b.cells.contains(c));
    if !is_between || !in_one_plane(a, b) || (a.area - b.area).abs() > SAME_PORTAL as f32 {
        return false;
    }
    let [p, q] = [a, b].map(box_of_portal);
    let off = |p: DVec3, q: DVec3| (p - q).abs().max_element();
    off(p.min, q.min) < SAME_PORTAL && off(p.max, q.max) < SAME_PORTAL
}

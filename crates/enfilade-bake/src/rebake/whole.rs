//! The whole scene baked anew, with the numbers of the old world.

use std::collections::BTreeMap;
use std::sync::Arc;

use enfilade_cpg::{CellId, Locator, PortalId, World};
use enfilade_geom::scene::Scene;
use enfilade_geom::{Aabb, DVec3};

use super::outcome::{RebakeError, Rebaked, WholeBecause};
use super::tree::cell_of;
use crate::bake;
use crate::{BakeConfig, BakeContext};

/// Points along each axis of a cell's box at which it is compared with old cells.
const POINTS: usize = 8;

/// Bakes a scene whole, and gives cells the numbers and names that they had.
pub(super) fn bake_whole(
    old: &World,
    scene: &Scene,
    config: &BakeConfig,
    context: &BakeContext<'_>,
    why: WholeBecause,
) -> Result<Rebaked, RebakeError> {
    let mut baked = bake(scene, config, context)?;
    let cell_of = matched(old, &baked.world);
    let (number, cell_of) = numbers(&cell_of, baked.world.graph.cells.len());
    renumber(&mut baked.world, &number);
    for (name, value) in &old.graph.provenance.settings {
        let settings = &mut baked.world.graph.provenance.settings;
        settings
            .entry(name.clone())
            .or_insert_with(|| value.clone());
    }
    let mut notes = baked.notes;
    notes.push(format!("the whole scene was baked: {why}"));
    let bounds = &baked.world.graph.locator.bounds;
    Ok(Rebaked {
        block: *bounds,
        changed: baked.world.graph.cell_ids().collect(),
        world: baked.world,
        cell_of,
        whole: Some(why),
        notes,
        times: baked.times,
    })
}

/// Returns for each old cell the new cell in which most of it is, unless most of that one is another old cell.
fn matched(old: &World, new: &World) -> Vec<Option<u32>> {
    let mut common: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    for (id, cell) in old.graph.indoor_cells() {
        let [low, high] = cell.aabb.map(|p| DVec3::from(p.map(f64::from)));
        let bounds = Aabb::new(low, high);
        for k in 0..POINTS.pow(3) {
            let at = [k % POINTS, k / POINTS % POINTS, k / POINTS / POINTS];
            let share = DVec3::from_array(at.map(|i| (i as f64 + 0.5) / POINTS as f64));
            let p = bounds.min + bounds.size() * share;
            if old.graph.locator.locate(p) == Some(id)
                && let Some(now) = new.graph.locator.locate(p)
                && !new.graph[now].outdoor
            {
                *common.entry((id.0, now.0)).or_default() += 1;
            }
        }
    }
    let mut claims: Vec<_> = common.into_iter().collect();
    claims.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
    let mut out = vec![None; old.graph.cells.len()];
    let mut is_taken = vec![false; new.graph.cells.len()];
    if let Some((a, b)) = old.graph.outdoors().zip(new.graph.outdoors()) {
        out[a.0 as usize] = Some(b.0);
        is_taken[b.0 as usize] = true;
    }
    for ((o, n), _) in claims {
        if out[o as usize].is_none() && !is_taken[n as usize] {
            out[o as usize] = Some(n);
            is_taken[n as usize] = true;
        }
    }
    out
}

/// Returns the number of each new cell, and of each old one: old cells keep theirs as far as there are as many.
fn numbers(now_of: &[Option<u32>], n: usize) -> (Vec<u32>, Vec<Option<CellId>>) {
    let mut number = vec![u32::MAX; n];
    let mut is_taken = vec![false; n];
    for (o, now) in now_of.iter().enumerate() {
        if let Some(now) = *now
            && o < n
        {
            number[now as usize] = o as u32;
            is_taken[o] = true;
        }
    }
    let mut free = (0..n as u32).filter(|&id| !is_taken[id as usize]);
    for id in number.iter_mut().filter(|id| **id == u32::MAX) {
        *id = free.next().unwrap_or_default();
    }
    let cell_of = now_of
        .iter()
        .map(|now| now.map(|c| CellId(number[c as usize])));
    let cell_of = cell_of.collect();
    (number, cell_of)
}

/// Gives the cells of a world their numbers. Names that are numbers stay with the numbers.
fn renumber(world: &mut World, number: &[u32]) {
    let of = |c: CellId| CellId(number[c.0 as usize]);
    let list = |cells: &mut Vec<CellId>| {
        cells.iter_mut().for_each(|c| *c = of(*c));
        cells.sort_unstable();
    };
    let graph = &mut world.graph;
    let mut cells = std::mem::take(&mut graph.cells);
    for (i, cell) in cells.iter_mut().enumerate() {
        if cell.name == format!("cell-{i}") {
            cell.name = format!("cell-{}", number[i]);
        }
    }
    let mut places: Vec<usize> = (0..cells.len()).collect();
    places.sort_by_key(|&i| number[i]);
    graph.cells = places
        .into_iter()
        .map(|i| std::mem::take(&mut cells[i]))
        .collect();
    for portal in &mut graph.portals {
        portal.cells = portal.cells.map(of);
    }
    graph.specials = crate::specials::renumbered(&graph.specials, of, Some::<PortalId>);
    let leaf = |at: &mut i32| {
        if let Some(cell) = cell_of(*at) {
            *at = Locator::leaf(Some(of(cell)));
        }
    };
    let locator = Arc::make_mut(&mut graph.locator);
    leaf(&mut locator.root);
    locator.outside = locator.outside.map(of);
    for node in &mut locator.nodes {
        node.children.iter_mut().for_each(leaf);
    }
    world.batches.iter_mut().for_each(|b| list(&mut b.cells));
    world.details.iter_mut().for_each(|d| list(&mut d.cells));
}

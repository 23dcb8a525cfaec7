//! Visibility before run-time of buildings with a doorway that leads into a copy of the building: nobody can tell the
//! result from the building, so its cells see what those of the building see.

use std::f64::consts::FRAC_PI_2;

use anyhow::ensure;
use enfilade::cpg::Pvs;
use enfilade::geom::{DQuat, DVec3, Similarity};
use enfilade::{CellId, PortalId, World};
use enfilade_testkit::linked_copies;

use super::visible::visible;
use crate::rows::Figure;

/// Doorways of a building, one after the other: those at these shares of the list of doorways indoors.
const DOORWAYS: usize = 3;

/// Grid on which vertices of doorways are put, so that those of a copy are exact in `f32`, too. Otherwise a copy's doorways of one wall
/// are not in one plane as those of the building are, and see each other. [Units: wu]
const GRID: f32 = 1.0 / 16384.0;

/// Counts rows of cells that differ from those of the building itself, of the copies of three doorways each.
pub(super) fn pvs(world: &World) -> anyhow::Result<Figure> {
    // A copy has no surroundings, so the building has none either.
    let mut world = world.clone();
    for portal in &mut world.graph.portals {
        let points = portal
            .outline
            .iter_mut()
            .chain(portal.pieces.iter_mut().flatten());
        points
            .flatten()
            .for_each(|x| *x = (*x / GRID).round() * GRID);
    }
    let is_out: Vec<bool> = world.graph.cells.iter().map(|c| c.outdoor).collect();
    let leads_out = |cells: [CellId; 2]| cells.iter().any(|c| is_out[c.idx()]);
    world.graph.portals.retain(|p| !leads_out(p.cells));
    for cell in &mut world.graph.cells {
        cell.portals.clear();
    }
    let ids: Vec<PortalId> = world.graph.portal_ids().collect();
    for &id in &ids {
        for cell in world.graph[id].cells {
            world.graph.cells[cell.idx()].portals.push(id);
        }
    }
    ensure!(ids.len() >= DOORWAYS, "too few doorways");
    let start = std::time::Instant::now();
    let plain = visible(&world.graph)?.vis.cells;
    let plain_s = start.elapsed().as_secs_f64();
    let n = world.graph.cells.len() as u32;
    let (mut n_rows, mut n_wrong, mut n_lost, mut n_chains, mut n_cut) = (0, 0, 0, 0, 0);
    let mut seconds = 0.0;
    for k in 0..DOORWAYS {
        let portal = ids[(2 * k + 1) * ids.len() / (2 * DOORWAYS)];
        let turn = DQuat::from_rotation_y(FRAC_PI_2 * (k + 1) as f64);
        let map = Similarity::rigid(turn, DVec3::new(256.0, 32.0, 0.0));
        let linked = linked_copies(&world, portal, &map).graph;
        let start = std::time::Instant::now();
        let found = visible(&linked)?;
        seconds += start.elapsed().as_secs_f64();
        n_chains += found.n_chains;
        n_cut += found.n_cut;
        for cell in 0..2 * n {
            let [expected, found] = [row(&plain, cell % n, n), row(&found.vis.cells, cell, n)];
            n_rows += 1;
            n_wrong += usize::from(found != expected);
            n_lost += expected.iter().filter(|c| !found.contains(c)).count();
        }
    }
    let note = format!(
        "rows of {n_rows} that differ ({n_lost} pairs lost); {n_chains} chains, {n_cut} cut; {:.2} s per doorway, \
             {plain_s:.2} s without",
        seconds / DOORWAYS as f64
    );
    Ok(Figure::new(n_wrong as f64, 0.0, note))
}

/// The cells seen from a cell, those of copies as their originals.
fn row(pvs: &Pvs, cell: u32, n: u32) -> Vec<u32> {
    let mut row: Vec<u32> = pvs.visible_from(CellId(cell)).map(|c| c.0 % n).collect();
    row.sort_unstable();
    row.dedup();
    row
}

//! Doorways in a graph of cells: openings much narrower than the rooms that they join, which no default may take.
//!
//! A level's cells are known by their boxes and volumes alone, without voxels. So the space beside an opening is the mean
//! section of a cell along the opening's normal, its volume ÷ its depth. This underrates rooms of several arms, whose
//! openings then part nothing, as before.

use std::collections::BTreeMap;

use enfilade_cpg::{Cell, CellPortalGraph};

use super::apply::absorb;

/// Rooms, and the openings between them, while cells are merged.
#[derive(Clone, Debug)]
pub(super) struct Doorways {
    /// All cells; those merged into others are stale.
    cells: Vec<Cell>,
    /// Between two cells, the lower first: the area of all openings times each component of their normals, without signs.
    /// [Units: wu²]
    areas: BTreeMap<[u32; 2], [f32; 3]>,
    /// The share of the space beside it from which an opening parts nothing.
    threshold: f32,
}

impl Doorways {
    pub(super) fn of(graph: &CellPortalGraph, threshold: f64) -> Self {
        let mut areas: BTreeMap<[u32; 2], [f32; 3]> = BTreeMap::new();
        for portal in &graph.portals {
            let mut pair = portal.cells.map(|c| c.0);
            pair.sort_unstable();
            let sum = areas.entry(pair).or_default();
            (0..3).for_each(|k| sum[k] += portal.area * portal.normal[k].abs());
        }
        Self {
            cells: graph.cells.clone(),
            areas,
            threshold: threshold as f32,
        }
    }

    /// Returns `true` if people can stand in both cells and the openings between them are narrower than both by the measure of
    /// all methods: their share of the space beside them.
    pub(super) fn part(&self, a: u32, b: u32) -> bool {
        let cells = [a, b].map(|c| &self.cells[c as usize]);
        let Some(areas) = self.areas.get(&[a.min(b), a.max(b)]) else {
            return false;
        };
        let [x, y, z] = *areas;
        let area = x.hypot(y).hypot(z);
        let section = |cell: &Cell| {
            let [min, max] = cell.aabb;
            let depth: f32 = (0..3).map(|k| (max[k] - min[k]) * areas[k]).sum();
            cell.volume * area / depth.max(f32::MIN_POSITIVE)
        };
        let is_room = |cell: &&Cell| cell.is_room() && cell.holds_person();
        cells.iter().all(is_room) && cells.iter().all(|c| area < self.threshold * section(c))
    }

    /// Notes that `gone` is now part of `kept`.
    pub(super) fn merged(&mut self, kept: u32, gone: u32) {
        let from = self.cells[gone as usize].clone();
        absorb(&mut self.cells[kept as usize], &from);
        let mut areas = BTreeMap::new();
        for (pair, area) in std::mem::take(&mut self.areas) {
            let mut pair = pair.map(|c| if c == gone { kept } else { c });
            pair.sort_unstable();
            if pair[0] != pair[1] {
                let sum: &mut [f32; 3] = areas.entry(pair).or_default();
                (0..3).for_each(|k| sum[k] += area[k]);
            }
        }
        self.areas = areas;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_cpg::{CellId, Portal, PortalKind};

    /// Returns two rooms of 8 × 4 × 8 m and the space between them, 0.5 m deep and as wide as the doorway at either end.
    fn row(width: f32) -> Doorways {
        let cell = |from: f32, to: f32, width: f32, height: f32| Cell {
            aabb: [[from, 0.0, -0.5 * width], [to, height, 0.5 * width]],
            volume: (to - from) * width * height,
            ..Cell::default()
        };
        let portal = |a: u32| Portal {
            cells: [CellId(a), CellId(a + 1)],
            kind: PortalKind::Open,
            normal: [1.0, 0.0, 0.0],
            outline: Vec::new(),
            pieces: Vec::new(),
            area: 3.0 * width,
            fittings: Vec::new(),
            why: Vec::new(),
        };
        let graph = CellPortalGraph {
            cells: vec![
                cell(0.0, 8.0, 8.0, 4.0),
                cell(8.0, 8.5, width, 3.0),
                cell(8.5, 16.5, 8.0, 4.0),
            ],
            portals: vec![portal(0), portal(1)],
            ..CellPortalGraph::default()
        };
        Doorways::of(&graph, 0.7)
    }

    #[test]
    fn a_doorway_parts_rooms_and_the_space_in_it_is_none() {
        let mut doorways = row(2.0);
        assert!(!doorways.part(0, 1) && !doorways.part(1, 2));
        doorways.merged(0, 1);
        assert!(doorways.part(0, 2) && doorways.part(2, 0));
    }

    #[test]
    fn an_opening_as_wide_as_the_rooms_parts_nothing() {
        let mut doorways = row(7.9);
        doorways.merged(0, 1);
        assert!(!doorways.part(0, 2));
    }
}

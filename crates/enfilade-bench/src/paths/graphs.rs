//! Graphs of many cells, without a bake: corridors and rooms of a tower, streets of a city.

use std::collections::BTreeMap;

use anyhow::bail;
use enfilade::cpg::{Cell, CellId, CellPortalGraph, Portal, PortalId, PortalKind, World};
use enfilade::geom::DVec3;
use enfilade::world::Space;
use enfilade_testkit::{OpeningKind, Rng, Side, TowerParams, office_tower};

/// Returns the named graph: the centers of its cells, and the space.
pub(super) fn graph(name: &str) -> anyhow::Result<(Vec<DVec3>, Space)> {
    match name {
        "tower-1500" => tower(),
        "city-1500" => city(1500, 200, 7),
        "lattice-1500" => lattice(1500),
        _ => bail!("no such graph"),
    }
}

/// Returns the graph from which a tower of 1,500 rooms is generated: rooms along corridors, stairwells, doors,
/// openings.
fn tower() -> anyhow::Result<(Vec<DVec3>, Space)> {
    let params = TowerParams {
        furniture: false,
        storeys: 12,
        rooms_per_storey: 125,
        ..TowerParams::default()
    };
    let truth = office_tower(&params).truth;
    let middles = truth.rooms.iter().map(|room| {
        let corners = room.parts.iter().flat_map(|p| &p.corners);
        let n = room.parts.iter().map(|p| p.corners.len()).sum::<usize>();
        corners.sum::<DVec3>() / n.max(1) as f64
    });
    let walked = truth
        .openings
        .iter()
        .filter(|o| o.kind != OpeningKind::Window);
    let portals = walked.filter_map(|o| match o.rooms {
        [Side::Room(a), Side::Room(b)] if a != b => Some(([a, b], o.center)),
        _ => None,
    });
    space(middles.collect(), &portals.collect::<Vec<_>>())
}

/// Returns streets after the city of Gjørup 1999, §3.3.4: crossings joined by streets of several segments, each a cell;
/// `n_cells` in all.
fn city(n_cells: usize, n_crossings: usize, seed: u64) -> anyhow::Result<(Vec<DVec3>, Space)> {
    let mut rng = Rng::new(seed);
    let along = (n_crossings as f64).sqrt().round() as usize;
    let mut middles = Vec::new();
    for i in 0..along * (n_crossings / along) {
        let jitter = DVec3::new(rng.range(-20.0, 20.0), 0.0, rng.range(-20.0, 20.0));
        middles.push(DVec3::new((i % along) as f64, 0.0, (i / along) as f64) * 100.0 + jitter);
    }
    let n_nodes = middles.len();
    let mut streets = Vec::new();
    for i in 0..n_nodes {
        let right = (i % along + 1 < along).then_some(i + 1);
        let down = Some(i + along).filter(|&j| j < n_nodes);
        // Some blocks are merged.
        streets.extend(
            [right, down]
                .into_iter()
                .flatten()
                .filter(|_| rng.chance(0.85))
                .map(|j| (i, j)),
        );
    }
    let mut portals: Vec<([usize; 2], DVec3)> = Vec::new();
    let n_segments = n_cells - n_nodes;
    for (s, &(a, b)) in streets.iter().enumerate() {
        let n = (s + 1) * n_segments / streets.len() - s * n_segments / streets.len();
        let (from, to) = (middles[a], middles[b]);
        let mut before = a;
        for k in 0..=n {
            let cell = if k == n { b } else { middles.len() };
            if k < n {
                middles.push(from.lerp(to, (k + 1) as f64 / (n + 1) as f64));
            }
            portals.push(([before, cell], (middles[before] + middles[cell]) * 0.5));
            before = cell;
        }
    }
    space(middles, &portals)
}

/// Returns rooms side by side, most with doors to all sides: no part of it is a chain.
fn lattice(n_cells: usize) -> anyhow::Result<(Vec<DVec3>, Space)> {
    let mut rng = Rng::new(3);
    let along = (n_cells as f64).sqrt().ceil() as usize;
    let at = |i: usize| DVec3::new((i % along) as f64, 0.0, (i / along) as f64) * 5.0;
    let middles: Vec<DVec3> = (0..n_cells).map(at).collect();
    let mut portals = Vec::new();
    for i in 0..n_cells {
        let right = (i % along + 1 < along).then_some(i + 1);
        for j in [right, Some(i + along)].into_iter().flatten() {
            if j < n_cells && rng.chance(0.8) {
                let off = DVec3::new(rng.range(-1.5, 1.5), 0.0, rng.range(-1.5, 1.5));
                portals.push(([i, j], (at(i) + at(j)) * 0.5 + off));
            }
        }
    }
    space(middles, &portals)
}

/// Returns a layout of cells without walls: portals of 1 m².
fn space(
    middles: Vec<DVec3>,
    portals: &[([usize; 2], DVec3)],
) -> anyhow::Result<(Vec<DVec3>, Space)> {
    let mut of_cell: BTreeMap<usize, Vec<PortalId>> = BTreeMap::new();
    let mut made = Vec::new();
    for (i, &(cells, center)) in portals.iter().enumerate() {
        let normal = (middles[cells[1]] - middles[cells[0]]).normalize_or(DVec3::X);
        let (u, v) = normal.any_orthonormal_pair();
        let corners = [-u - v, u - v, u + v, v - u].map(|d| center + d * 0.5);
        let outline: Vec<[f32; 3]> = corners.iter().map(|p| p.as_vec3().to_array()).collect();
        for c in cells {
            of_cell.entry(c).or_default().push(PortalId(i as u32));
        }
        made.push(Portal {
            cells: cells.map(|c| CellId(c as u32)),
            kind: PortalKind::Door,
            normal: normal.as_vec3().to_array(),
            pieces: vec![outline.clone()],
            outline,
            area: 1.0,
            fittings: Vec::new(),
            why: Vec::new(),
        });
    }
    let cells = (0..middles.len()).map(|i| Cell {
        portals: of_cell.remove(&i).unwrap_or_default(),
        aabb: [middles[i].as_vec3().to_array(); 2],
        ..Cell::default()
    });
    let graph = CellPortalGraph {
        cells: cells.collect(),
        portals: made,
        ..CellPortalGraph::default()
    };
    let world = World {
        graph,
        ..World::default()
    };
    Ok((middles, Space::new(world)?))
}

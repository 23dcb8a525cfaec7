//! A graph unfolded at its special portals: what is seen through one lies behind its polygon, as it appears from the
//! side of those who look, so that lines of sight are straight again.
//!
//! The unfolded graph is made of layers. The first holds the cells where they are. Each way through a special portal
//! in a layer leads into one more, which holds the cells seen there under the composed map; layers form a tree, and
//! their number is that of the chains of special portals that are looked into, not of the cells. A doorway that is
//! open from one side only leads into a layer too, by the identity, because the search takes openings to be passable
//! both ways.
//!
//! Maps are composed in `f64` from the root, one product for each special portal of a chain, so that errors stay at
//! about 1e-15 of the coordinates times the length of the chain.

use std::collections::{BTreeSet, HashMap};

use enfilade_cpg::{CellId, CellPortalGraph, PortalId, SightGraph, SightPortal, SpecialId, Way};
use enfilade_geom::{DVec3, Similarity};

/// Greatest coordinate and least scale of a layer: those of one that goes beyond would be lost in rounding.
const MAX_REACH: f64 = SightGraph::MAX_COORDINATE * 0.1;
const MIN_SCALE: f64 = 1e-3;

/// Distance within which a camera counts as in a cell. [Units: wu]
const EYE_MARGIN: f64 = 1e-4;

/// A cell in a layer.
pub(crate) type Node = (u32, u32);

/// View of an opening that can only be looked through from one side.
pub(crate) enum Goal {
    Cell(u32),
    /// The picture of a camera in one of these cells.
    Cameras(Vec<u32>),
}

/// An opening that can only be looked through from one side.
pub(crate) struct UnfoldedGate {
    pub(crate) cell: u32,
    pub(crate) goal: Goal,
    /// Special portal and doorway of which it is a side.
    special: Option<SpecialId>,
    doorway: Option<PortalId>,
    /// Its polygons; their normals point out of the cell.
    openings: Vec<SightPortal>,
    /// Map from the side of those who look to the side that is seen.
    map: Similarity,
    /// Special portal and doorway in its plane, as seen from behind it. A line crosses a plane once.
    back: (Option<SpecialId>, Option<PortalId>),
    /// `true` if it counts as a special portal of a chain.
    counts: bool,
}

/// The cells as seen through a chain of special portals.
pub(crate) struct Layer {
    /// The gate by which it is entered; `None` for the first.
    pub(crate) gate: Option<u32>,
    /// Map from the cells to where they appear.
    map: Similarity,
    /// Number of special portals of the chain.
    depth: u32,
    /// `true` if the cells beyond the one that is entered are in the graph.
    pub(crate) is_open: bool,
}

pub(crate) struct Unfolded {
    /// Doorways that are open from both sides, and their numbers.
    plain: Vec<(PortalId, SightPortal)>,
    /// For each cell, its `plain` of which it is the first cell.
    plain_of: Vec<Vec<u32>>,
    pub(crate) gates: Vec<UnfoldedGate>,
    /// For each cell, its gates.
    pub(crate) gates_of: Vec<Vec<u32>>,
    pub(crate) layers: Vec<Layer>,
    children: HashMap<(u32, u32), u32>,
    /// Largest coordinate of the world.
    reach: f64,
}

impl Unfolded {
    /// Makes the first layer of a world's graph.
    pub(crate) fn new(graph: &CellPortalGraph) -> Self {
        let all = SightGraph::of_graph(graph);
        let is_open = |portal: PortalId, cell| {
            let side = graph.special_side(portal, cell);
            side.is_none_or(|s| graph.specials[s.idx()].is_through())
        };
        let mut plain = Vec::new();
        let mut gates = Vec::new();
        for (portal, opening) in graph.portal_ids().zip(&all.portals) {
            let cells = graph[portal].cells;
            let sides = cells.map(|cell| is_open(portal, cell));
            if sides == [true; 2] {
                plain.push((portal, opening.clone()));
            } else if sides != [false; 2] {
                let from = usize::from(sides[1]);
                gates.push(UnfoldedGate {
                    cell: cells[from].0,
                    goal: Goal::Cell(cells[1 - from].0),
                    special: None,
                    doorway: Some(portal),
                    openings: vec![turned(opening, from == 1)],
                    map: Similarity::IDENTITY,
                    back: (None, Some(portal)),
                    counts: false,
                });
            }
        }
        for special in graph.special_ids() {
            add_gates(graph, &all, special, &mut gates);
        }
        let mut gates_of = vec![Vec::new(); graph.cells.len()];
        for (i, gate) in (0..).zip(&gates) {
            gates_of[gate.cell as usize].push(i);
        }
        let mut plain_of = vec![Vec::new(); graph.cells.len()];
        for (i, (portal, _)) in (0..).zip(&plain) {
            plain_of[graph[*portal].cells[0].idx()].push(i);
        }
        let corners = all.portals.iter().flat_map(|p| &p.winding);
        let corners = corners.chain(
            (gates.iter())
                .flat_map(|g| &g.openings)
                .flat_map(|o| &o.winding),
        );
        let reach = corners.map(|p| p.abs().max_element()).fold(0.0, f64::max);
        let root = Layer {
            gate: None,
            map: Similarity::IDENTITY,
            depth: 0,
            is_open: true,
        };
        Self {
            plain,
            plain_of,
            gates,
            gates_of,
            layers: vec![root],
            children: HashMap::new(),
            reach,
        }
    }

    /// Returns the graph of the doorways that are open from both sides, and for each its number in the world.
    pub(crate) fn plain_graph(&self) -> (SightGraph, Vec<u32>) {
        let graph = SightGraph {
            n_cells: self.gates_of.len() as u32,
            portals: self.plain.iter().map(|(_, p)| p.clone()).collect(),
        };
        (graph, self.plain.iter().map(|(id, _)| id.0).collect())
    }

    /// Returns `true` if a layer may be opened, for chains of at most `max_depth` special portals.
    pub(crate) fn can_open(&self, layer: u32, max_depth: u32) -> bool {
        let layer = &self.layers[layer as usize];
        let scale = layer.map.scale.abs();
        let is_in_reach = scale >= MIN_SCALE
            && layer.map.at.abs().max_element() + 2.0 * scale * self.reach <= MAX_REACH;
        layer.depth <= max_depth && is_in_reach
    }

    /// Returns the least scale of all layers, at most 1.
    pub(crate) fn least_scale(&self) -> f64 {
        let open = self.layers.iter().filter(|l| l.is_open);
        open.map(|l| l.map.scale.abs()).fold(1.0, f64::min)
    }

    fn is_skipped(
        &self,
        layer: u32,
        special: Option<SpecialId>,
        doorway: Option<PortalId>,
    ) -> bool {
        let Some(gate) = self.layers[layer as usize].gate else {
            return false;
        };
        let back = self.gates[gate as usize].back;
        special.is_some() && special == back.0 || doorway.is_some() && doorway == back.1
    }

    /// Adds cells of a layer, and the first cells of those behind their gates, to `nodes`.
    pub(crate) fn open(
        &mut self,
        layer: u32,
        cells: impl Iterator<Item = u32>,
        nodes: &mut BTreeSet<Node>,
    ) {
        self.layers[layer as usize].is_open = true;
        for cell in cells {
            nodes.insert((layer, cell));
            for at in 0..self.gates_of[cell as usize].len() {
                let gate = self.gates_of[cell as usize][at];
                if let Some(child) = self.enter(layer, gate) {
                    nodes.insert((child, self.first_cell(child)));
                }
            }
        }
    }

    /// Returns the layer behind a gate.
    fn enter(&mut self, layer: u32, gate_idx: u32) -> Option<u32> {
        let gate = &self.gates[gate_idx as usize];
        if self.is_skipped(layer, gate.special, gate.doorway) {
            return None;
        }
        let parent = &self.layers[layer as usize];
        let next = self.layers.len() as u32;
        let child = *self.children.entry((layer, gate_idx)).or_insert(next);
        if child == next {
            let behind = Layer {
                gate: Some(gate_idx),
                map: parent.map.after(&gate.map.inverse()),
                depth: parent.depth + u32::from(gate.counts),
                is_open: false,
            };
            self.layers.push(behind);
        }
        Some(child)
    }

    /// Returns what a layer shows; `None` for the first.
    pub(crate) fn goal(&self, layer: u32) -> Option<&Goal> {
        let gate = self.layers[layer as usize].gate?;
        Some(&self.gates[gate as usize].goal)
    }

    /// Returns the number of open layers behind special portals.
    pub(crate) fn n_open_specials(&self) -> u64 {
        let counts = |gate: u32| self.gates[gate as usize].counts;
        let open = self.layers.iter().filter(|l| l.is_open);
        open.filter(|l| l.gate.is_some_and(counts)).count() as u64
    }

    /// Returns the cell that one looks into from a layer's gate; for a monitor, the cell that it hangs in.
    pub(crate) fn first_cell(&self, layer: u32) -> u32 {
        let gate = self.layers[layer as usize].gate;
        let gate = &self.gates[gate.expect("only the first layer has none") as usize];
        match gate.goal {
            Goal::Cell(cell) => cell,
            Goal::Cameras(_) => gate.cell,
        }
    }

    /// Returns the graph of some nodes, numbered in their order.
    pub(crate) fn graph(&self, nodes: &[Node]) -> SightGraph {
        let place = |node: Node| nodes.binary_search(&node).ok().map(|at| at as u32);
        let mut portals = Vec::new();
        for (from, &(layer, cell)) in (0..).zip(nodes) {
            if !self.layers[layer as usize].is_open {
                continue;
            }
            let map = &self.layers[layer as usize].map;
            for &at in &self.plain_of[cell as usize] {
                let (portal, opening) = &self.plain[at as usize];
                let to = place((layer, opening.cells[1]));
                if let Some(to) = to.filter(|_| !self.is_skipped(layer, None, Some(*portal))) {
                    portals.push(mapped(opening, map, [from, to]));
                }
            }
            for &gate in &self.gates_of[cell as usize] {
                let child = self.children.get(&(layer, gate));
                let to = child.and_then(|&child| place((child, self.first_cell(child))));
                if let Some(to) = to {
                    let openings = self.gates[gate as usize].openings.iter();
                    portals.extend(openings.map(|opening| mapped(opening, map, [from, to])));
                }
            }
        }
        SightGraph {
            n_cells: nodes.len() as u32,
            portals,
        }
    }
}

/// Adds what is seen in a special portal other than the cell behind it.
fn add_gates(
    graph: &CellPortalGraph,
    all: &SightGraph,
    special: SpecialId,
    gates: &mut Vec<UnfoldedGate>,
) {
    let side = &graph.specials[special.idx()];
    let openings: Vec<SightPortal> = match side.portal() {
        Some(portal) => {
            let is_turned = graph[portal].cells[0] != side.cell;
            vec![turned(&all.portals[portal.idx()], is_turned)]
        }
        None => (graph.special_opening(special).1.into_iter())
            .map(|piece| SightPortal {
                cells: [0; 2],
                winding: piece.points,
                pieces: Vec::new(),
            })
            .collect(),
    };
    let doorway_of = |s: SpecialId| graph.specials[s.idx()].portal();
    for (pass, way) in side.passes.iter().map(|p| &p.way).enumerate() {
        let (goal, back) = match way {
            Way::Through => continue,
            Way::Mirror => (Goal::Cell(side.cell.0), Some(special)),
            Way::Lead { to, back, .. } => (Goal::Cell(to.0), *back),
            Way::Monitor(camera) => {
                let eye = DVec3::from_array(camera.eye.map(f64::from));
                (Goal::Cameras(cells_at(graph, eye)), None)
            }
        };
        gates.push(UnfoldedGate {
            cell: side.cell.0,
            goal,
            special: Some(special),
            doorway: side.portal(),
            openings: openings.clone(),
            map: graph.map_of_pass(special, pass).unwrap_or_default(),
            back: (back, back.and_then(doorway_of)),
            counts: true,
        });
    }
}

/// Returns the cells that a point is in, or may be by rounding; all if it is in none.
fn cells_at(graph: &CellPortalGraph, p: DVec3) -> Vec<u32> {
    let mut cells = Vec::new();
    graph.locator.cells_near(&[p], EYE_MARGIN, &mut cells);
    if cells.is_empty() {
        cells.extend((0..graph.cells.len() as u32).map(CellId));
    }
    cells.into_iter().map(|c| c.0).collect()
}

/// Returns an opening seen from the other side.
fn turned(opening: &SightPortal, is_turned: bool) -> SightPortal {
    let mut opening = opening.clone();
    if is_turned {
        opening.cells.reverse();
        opening.winding.reverse();
        opening.pieces.iter_mut().for_each(|piece| piece.reverse());
    }
    opening
}

/// Returns an opening where it appears. Vertices run the other way in a mirror.
fn mapped(opening: &SightPortal, map: &Similarity, cells: [u32; 2]) -> SightPortal {
    let image = |points: &Vec<DVec3>| points.iter().map(|&p| map.point(p)).collect();
    let mapped = SightPortal {
        cells,
        winding: image(&opening.winding),
        pieces: opening.pieces.iter().map(image).collect(),
    };
    SightPortal {
        cells,
        ..turned(&mapped, map.is_reflection())
    }
}

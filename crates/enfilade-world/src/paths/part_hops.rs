//! Distance and next portal from any cell of a part to any other.
//!
//! After Gjørup ("Cell and portal based visibility", 1999, §3.3.4), who keeps a table of distances and next portals between all
//! pairs of cells, except those with exactly two portals, which offer no choice. Here dead ends are left out, too: a subgraph
//! that one portal attaches to the rest is a tree, and has one way out. There remain *junctions*, joined by *chains* of
//! two-portal cells; their table is maintained while doors open and close ([`AllPairs`]). A door in a tree, or in a chain with
//! another shut door, changes no more than its tree or chain.
//!
//! The caller defines the length of a step from cell to cell; steps are rounded to tenths of a millimeter, so that sums are exact
//! and answers equal those of a search through all cells. Paths longer than 400 km count as none.

use enfilade_cpg::{CellId, PortalId};

use crate::layout::{Layout, LayoutExit};
use crate::paths::all_pairs::{AllPairs, Edge, FAR, NONE, sum};
use crate::paths::trees::number_trees;

/// Integer units of length per meter.
pub(super) const UNITS: f64 = 1e4;

/// Distances and next portals between all cells.
#[derive(Clone, Debug)]
pub(super) struct PartHops {
    /// Per portal.
    steps: Vec<Step>,
    /// Per cell.
    nodes: Vec<Node>,
    /// Per cell its branches: the cells that hang on it, by their indices in the trees.
    first_branch: Vec<u32>,
    branches: Vec<CellId>,
    /// Cells by their index in the trees, in which all descendants of a cell follow it.
    by_number: Vec<CellId>,
    chains: Vec<Chain>,
    /// Cells of chains, chain by chain.
    stops: Vec<Stop>,
    /// Portals of chains, one more per chain than its cells.
    rails: Vec<PortalId>,
    junctions: AllPairs,
    cell_of_junction: Vec<CellId>,
}

#[derive(Clone, Copy, Debug)]
struct Step {
    length: u32,
    cells: [CellId; 2],
    is_open: bool,
    role: Role,
}

/// Role of a portal in the table.
#[derive(Clone, Copy, Debug)]
enum Role {
    /// Never passed.
    Wall,
    /// The way out of a cell of a tree.
    Branch(CellId),
    /// A portal of a chain, at a position.
    Rail(u32, u32),
}

#[derive(Clone, Copy, Debug)]
struct Node {
    /// Towards the root: the portal, and the cell behind it. The root itself at the root.
    up: LayoutExit,
    root: CellId,
    /// The highest cell reached through open portals.
    top: CellId,
    /// Distance to the root with all portals open.
    height: u32,
    /// Index in its tree, and the first one after its descendants.
    below: [u32; 2],
    place: RootPlace,
}

/// Position of a root.
#[derive(Clone, Copy, Debug)]
enum RootPlace {
    Tree,
    Junction(u32),
    /// A chain, and the position in it.
    Chain(u32, u32),
}

#[derive(Clone, Copy, Debug)]
struct Chain {
    /// Junctions at its ends.
    ends: [u32; 2],
    /// Index among all stops.
    first_stop: u32,
    n_stops: u32,
    /// Index among all rails.
    first_rail: u32,
    length: u32,
}

#[derive(Clone, Copy, Debug)]
struct Stop {
    cell: CellId,
    /// Distance from the chain's first end.
    offset: u32,
    /// Number of shut portals between it and the first end.
    n_shut: u32,
}

/// A way out of a core cell: its junction and its length.
#[derive(Clone, Copy)]
struct Out {
    junction: u32,
    length: u32,
    /// The next portal on the way there; `None` at the junction itself.
    through: Option<LayoutExit>,
}

impl PartHops {
    /// Makes the table for a layout. `step` returns the length of a step through a portal, from the middle of one of its cells
    /// to that of the other, or `None` if it is never passed. All portals are open at first. [Units: wu]
    ///
    /// O(cells) and, for `n` junctions with `l` chains, `O(n · l · log n)` time and 6 · n² bytes. A length that is not finite or
    /// below 0 counts as `None`. Panics if a junction has more than 65,535 chains.
    pub(super) fn new(layout: &Layout, mut step: impl FnMut(PortalId) -> Option<f64>) -> Self {
        let steps = (0..layout.n_portals() as u32).map(PortalId).map(|p| {
            let length = step(p).filter(|l| (0.0..4e5).contains(l));
            Step {
                length: length.map_or(FAR, |l| (l * UNITS).round() as u32),
                cells: layout.opening(p).cells(),
                is_open: true,
                role: Role::Wall,
            }
        });
        Core::new(layout, steps.collect()).into_hops()
    }

    /// Returns the number of junctions; the table has its square.
    pub(super) fn n_junctions(&self) -> usize {
        self.junctions.n()
    }

    /// Returns `true` if a portal is open; all are at first.
    ///
    /// # Panics
    ///
    /// If there is no such portal.
    pub(super) fn is_open(&self, portal: PortalId) -> bool {
        self.steps[portal.idx()].is_open
    }

    /// Opens or closes a portal. O(size of its tree or chain), and in the table the pairs of junctions whose path changes.
    ///
    /// # Panics
    ///
    /// If there is no such portal.
    pub(super) fn set_open(&mut self, portal: PortalId, is_open: bool) {
        let step = &mut self.steps[portal.idx()];
        if step.is_open == is_open {
            return;
        }
        step.is_open = is_open;
        match step.role {
            Role::Wall => {}
            Role::Branch(cell) => self.set_tops(cell),
            Role::Rail(chain, place) => {
                let Chain {
                    first_stop,
                    n_stops,
                    first_rail,
                    ..
                } = self.chains[chain as usize];
                for i in place..n_stops {
                    let n_shut = &mut self.stops[(first_stop + i) as usize].n_shut;
                    *n_shut = if is_open { *n_shut - 1 } else { *n_shut + 1 };
                }
                let rails = &self.rails[first_rail as usize..][..n_stops as usize + 1];
                let all_open = rails.iter().all(|p| self.steps[p.idx()].is_open);
                self.junctions.set_open(chain, all_open);
            }
        }
    }

    /// Updates the highest cells reached from the cells of a branch.
    fn set_tops(&mut self, cell: CellId) {
        let [first, end] = self.nodes[cell.idx()].below;
        for number in first..end {
            let cell = self.by_number[number as usize];
            let Node { up, .. } = self.nodes[cell.idx()];
            let is_open = self.steps[up.portal.idx()].is_open;
            // The parent comes first.
            self.nodes[cell.idx()].top = if is_open {
                self.nodes[up.to.idx()].top
            } else {
                cell
            };
        }
    }

    /// Returns the least length from the middle of a cell to that of another, through open portals, in units; [`FAR`] if there is
    /// no path. O(1), plus the depth of a dead end if both are in it.
    pub(super) fn length(&self, from: CellId, to: CellId) -> u32 {
        let [a, b] = [from, to].map(|c| &self.nodes[c.idx()]);
        if a.root == b.root {
            if a.top != b.top {
                return FAR;
            }
            let mut above = from;
            while !self.is_below(to, above) {
                above = self.nodes[above.idx()].up.to;
            }
            return a.height + b.height - 2 * self.nodes[above.idx()].height;
        }
        if a.top != a.root || b.top != b.root {
            return FAR;
        }
        sum(a.height + b.height, self.core_way(a.root, b.root).0)
    }

    /// Returns the first portal on the shortest path from a cell to another; `None` in the cell itself, and if there is no path.
    /// O(1), plus a binary search among the dead ends at the cell.
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    pub(super) fn next(&self, from: CellId, to: CellId) -> Option<LayoutExit> {
        let [a, b] = [from, to].map(|c| &self.nodes[c.idx()]);
        if from == to {
            return None;
        }
        if a.root == b.root {
            if a.top != b.top {
                return None;
            }
            return Some(if self.is_below(to, from) {
                self.down(from, to)
            } else {
                a.up
            });
        }
        if a.top != a.root || b.top != b.root {
            return None;
        }
        if let [RootPlace::Junction(x), RootPlace::Junction(y)] =
            [a, b].map(|n| self.nodes[n.root.idx()].place)
        {
            // The common case in a world without chains: no length is needed.
            let link = self.junctions.first_link(x, y);
            return (link != NONE).then(|| {
                if from == a.root {
                    self.onto_from(link, x)
                } else {
                    a.up
                }
            });
        }
        let (length, exit) = self.core_way(a.root, b.root);
        if length == FAR {
            return None;
        }
        if from == a.root { exit } else { Some(a.up) }
    }

    fn is_below(&self, cell: CellId, above: CellId) -> bool {
        let [first, end] = self.nodes[above.idx()].below;
        let node = &self.nodes[cell.idx()];
        (first..end).contains(&node.below[0])
    }

    /// Returns the first step from a cell to one of its descendants.
    fn down(&self, from: CellId, to: CellId) -> LayoutExit {
        let range =
            self.first_branch[from.idx()] as usize..self.first_branch[from.idx() + 1] as usize;
        let number = self.nodes[to.idx()].below[0];
        let branches = &self.branches[range];
        let i = branches.partition_point(|c| self.nodes[c.idx()].below[0] <= number);
        let branch = branches[i - 1];
        LayoutExit {
            portal: self.nodes[branch.idx()].up.portal,
            to: branch,
        }
    }

    /// Returns the length of the shortest way between the core cells on which two trees of cells hang, and the portal to take first.
    fn core_way(&self, from: CellId, to: CellId) -> (u32, Option<LayoutExit>) {
        let (outs, ins) = (self.outs(from), self.outs(to));
        let mut best = self.along_chain(from, to);
        for out in outs.into_iter().flatten() {
            for into in ins.into_iter().flatten() {
                let between = self.junctions.length(out.junction, into.junction);
                let length = sum(sum(out.length, between), into.length);
                if length < best.0 {
                    let exit = out.through.or_else(|| {
                        let link = self.junctions.first_link(out.junction, into.junction);
                        if link != NONE {
                            return Some(self.onto_from(link, out.junction));
                        }
                        // The junction is an end of the other's chain.
                        self.back_in(to, into)
                    });
                    best = (length, exit);
                }
            }
        }
        best
    }

    /// Returns the ways from a root to junctions: to itself, or to the ends of its chain that are open.
    fn outs(&self, root: CellId) -> [Option<Out>; 2] {
        match self.nodes[root.idx()].place {
            RootPlace::Junction(junction) => {
                let here = Out {
                    junction,
                    length: 0,
                    through: None,
                };
                [Some(here), None]
            }
            RootPlace::Chain(chain, place) => [0, 1].map(|end| self.out(chain, place, end)),
            RootPlace::Tree => [None, None],
        }
    }

    fn out(&self, chain: u32, place: u32, end: usize) -> Option<Out> {
        let c = &self.chains[chain as usize];
        let stops = &self.stops[c.first_stop as usize..][..c.n_stops as usize];
        let stop = &stops[place as usize];
        let (is_open, length) = if end == 0 {
            (stop.n_shut == 0, stop.offset)
        } else {
            // No stop behind the last portal counts it.
            let last = self.rails[(c.first_rail + c.n_stops) as usize];
            let n_shut = stops[stops.len() - 1].n_shut;
            let is_open = n_shut == stop.n_shut && self.steps[last.idx()].is_open;
            (is_open, c.length - stop.offset)
        };
        is_open.then(|| Out {
            junction: c.ends[end],
            length,
            through: Some(self.along(chain, place, end)),
        })
    }

    /// Returns the next portal from a stop of a chain towards an end.
    fn along(&self, chain: u32, place: u32, end: usize) -> LayoutExit {
        let c = &self.chains[chain as usize];
        let place = place as usize;
        let stops = &self.stops[c.first_stop as usize..][..c.n_stops as usize];
        let next = if end == 0 {
            place.checked_sub(1).map(|i| stops[i].cell)
        } else {
            stops.get(place + 1).map(|s| s.cell)
        };
        LayoutExit {
            portal: self.rails[c.first_rail as usize + place + end],
            to: next.unwrap_or(self.cell_of_junction[c.ends[end] as usize]),
        }
    }

    /// Returns the first portal of a chain from the junction at one of its ends.
    fn onto(&self, chain: u32, end: usize) -> LayoutExit {
        let c = &self.chains[chain as usize];
        let stops = &self.stops[c.first_stop as usize..][..c.n_stops as usize];
        let (first, rail) = match end {
            0 => (stops.first(), 0),
            _ => (stops.last(), c.n_stops),
        };
        let other = self.cell_of_junction[c.ends[1 - end] as usize];
        LayoutExit {
            portal: self.rails[(c.first_rail + rail) as usize],
            to: first.map_or(other, |s| s.cell),
        }
    }

    fn onto_from(&self, chain: u32, junction: u32) -> LayoutExit {
        let ends = self.chains[chain as usize].ends;
        self.onto(chain, usize::from(ends[0] != junction))
    }

    /// Returns the portal from a junction into the chain of a root, given the root's way out to that junction.
    fn back_in(&self, root: CellId, out: Out) -> Option<LayoutExit> {
        let RootPlace::Chain(chain, place) = self.nodes[root.idx()].place else {
            return None;
        };
        let end = usize::from(out.through != Some(self.along(chain, place, 0)));
        Some(self.onto(chain, end))
    }

    /// Returns the path between two stops of one chain, without leaving it.
    fn along_chain(&self, from: CellId, to: CellId) -> (u32, Option<LayoutExit>) {
        let places = [from, to].map(|c| self.nodes[c.idx()].place);
        if let [RootPlace::Chain(chain, i), RootPlace::Chain(other, j)] = places
            && chain == other
        {
            let first = self.chains[chain as usize].first_stop;
            let [a, b] = [i, j].map(|i| &self.stops[(first + i) as usize]);
            if a.n_shut == b.n_shut {
                let exit = self.along(chain, i, usize::from(i < j));
                return (a.offset.abs_diff(b.offset), Some(exit));
            }
        }
        (FAR, None)
    }
}

/// The graph without its dead ends.
struct Core<'a> {
    layout: &'a Layout,
    steps: Vec<Step>,
    nodes: Vec<Node>,
    /// Number of portals left per cell.
    degree: Vec<u32>,
    /// Cells of trees, descendants first.
    peeled: Vec<CellId>,
}

impl<'a> Core<'a> {
    fn new(layout: &'a Layout, steps: Vec<Step>) -> Self {
        let all = || (0..layout.n_cells() as u32).map(CellId);
        let mut degree = vec![0; layout.n_cells()];
        for step in steps.iter().filter(|s| s.length != FAR) {
            for c in step.cells {
                degree[c.idx()] += 1;
            }
        }
        let nodes = all().map(|cell| Node {
            up: LayoutExit {
                portal: PortalId(NONE),
                to: cell,
            },
            root: cell,
            top: cell,
            height: 0,
            below: [0, 1],
            place: RootPlace::Junction(NONE),
        });
        let mut core = Self {
            layout,
            nodes: nodes.collect(),
            steps,
            degree,
            peeled: Vec::new(),
        };
        let mut ends: Vec<CellId> = all().filter(|c| core.degree[c.idx()] == 1).collect();
        while let Some(cell) = ends.pop() {
            // The last cell of a tree has lost its only portal to the one before.
            if core.degree[cell.idx()] == 1 {
                ends.extend(core.peel(cell));
            }
        }
        core
    }

    /// Removes a dead end; returns the cell behind it if that is one now.
    fn peel(&mut self, cell: CellId) -> Option<CellId> {
        let up = self.first_left(cell)?;
        self.steps[up.portal.idx()].role = Role::Branch(cell);
        let node = &mut self.nodes[cell.idx()];
        (node.up, node.place) = (up, RootPlace::Tree);
        self.degree[cell.idx()] = 0;
        let degree = &mut self.degree[up.to.idx()];
        *degree -= 1;
        self.peeled.push(cell);
        (*degree == 1).then_some(up.to)
    }

    /// Returns the first portal of a cell that belongs to no tree and no chain.
    fn first_left(&self, cell: CellId) -> Option<LayoutExit> {
        let is_left = |e: &&LayoutExit| {
            let step = &self.steps[e.portal.idx()];
            step.length != FAR && matches!(step.role, Role::Wall)
        };
        self.layout.exits(cell).iter().find(is_left).copied()
    }

    fn into_hops(mut self) -> PartHops {
        let (first_branch, branches, by_number) = self.number_trees();
        let mut hops = PartHops {
            steps: Vec::new(),
            nodes: Vec::new(),
            first_branch,
            branches,
            by_number,
            chains: Vec::new(),
            stops: Vec::new(),
            rails: Vec::new(),
            junctions: AllPairs::new(0, Vec::new()),
            cell_of_junction: Vec::new(),
        };
        let all = (0..self.nodes.len() as u32).map(CellId);
        let is_root = |c: &CellId| !matches!(self.nodes[c.idx()].place, RootPlace::Tree);
        let roots: Vec<CellId> = all.filter(is_root).collect();
        for &cell in &roots {
            if self.degree[cell.idx()] != 2 {
                self.add_junction(&mut hops, cell);
            }
        }
        for i in 0..hops.cell_of_junction.len() {
            self.follow_chains(&mut hops, i as u32);
        }
        // Only rings of two-portal cells are left: make one cell of each a junction.
        for &cell in &roots {
            if matches!(self.nodes[cell.idx()].place, RootPlace::Junction(NONE)) {
                let junction = self.add_junction(&mut hops, cell);
                self.follow_chains(&mut hops, junction);
            }
        }
        let links = hops.chains.iter().map(|c| Edge {
            ends: c.ends,
            length: c.length,
            is_open: true,
        });
        hops.junctions = AllPairs::new(hops.cell_of_junction.len(), links.collect());
        hops.steps = self.steps;
        hops.nodes = self.nodes;
        hops
    }

    fn add_junction(&mut self, hops: &mut PartHops, cell: CellId) -> u32 {
        let junction = hops.cell_of_junction.len() as u32;
        hops.cell_of_junction.push(cell);
        self.nodes[cell.idx()].place = RootPlace::Junction(junction);
        junction
    }

    fn follow_chains(&mut self, hops: &mut PartHops, junction: u32) {
        let cell = hops.cell_of_junction[junction as usize];
        while let Some(first) = self.first_left(cell) {
            let chain = hops.chains.len() as u32;
            let (first_stop, first_rail) = (hops.stops.len() as u32, hops.rails.len() as u32);
            let (mut at, mut length, mut n_stops) = (first, 0, 0);
            loop {
                let step = &mut self.steps[at.portal.idx()];
                step.role = Role::Rail(chain, n_stops);
                length = sum(length, step.length);
                hops.rails.push(at.portal);
                let is_stop = matches!(self.nodes[at.to.idx()].place, RootPlace::Junction(NONE));
                let Some(next) = self.first_left(at.to).filter(|_| is_stop) else {
                    break;
                };
                self.nodes[at.to.idx()].place = RootPlace::Chain(chain, n_stops);
                hops.stops.push(Stop {
                    cell: at.to,
                    offset: length,
                    n_shut: 0,
                });
                n_stops += 1;
                at = next;
            }
            let RootPlace::Junction(end) = self.nodes[at.to.idx()].place else {
                unreachable!("a chain ends at a junction");
            };
            hops.chains.push(Chain {
                ends: [junction, end],
                first_stop,
                n_stops,
                first_rail,
                length,
            });
        }
    }

    /// Numbers the cells so that all descendants of a cell follow it. Returns the first branches per cell, the branches, the
    /// cells by number.
    fn number_trees(&mut self) -> (Vec<u32>, Vec<CellId>, Vec<CellId>) {
        let n = self.nodes.len();
        let ups: Vec<[usize; 2]> = (self.peeled.iter())
            .map(|cell| [cell.idx(), self.nodes[cell.idx()].up.to.idx()])
            .collect();
        for (node, below) in self.nodes.iter_mut().zip(number_trees(n, &ups)) {
            node.below = below;
        }
        for &cell in self.peeled.iter().rev() {
            let LayoutExit { portal, to } = self.nodes[cell.idx()].up;
            let above = self.nodes[to.idx()];
            let node = &mut self.nodes[cell.idx()];
            (node.root, node.top) = (above.root, above.root);
            node.height = sum(above.height, self.steps[portal.idx()].length);
        }
        let mut by_number = vec![CellId(0); n];
        for (i, node) in (0..).zip(&self.nodes) {
            by_number[node.below[0] as usize] = CellId(i);
        }
        let up = |c: &CellId| self.nodes[c.idx()].up.to;
        let hangs = |c: &CellId| matches!(self.nodes[c.idx()].place, RootPlace::Tree);
        let mut branches: Vec<CellId> = by_number.iter().copied().filter(hangs).collect();
        branches.sort_by_key(up);
        let first = (0..=n as u32).map(|c| branches.partition_point(|b| up(b).0 < c) as u32);
        (first.collect(), branches, by_number)
    }
}

//! Applies merges to a world: renumbers every reference to a cell.

use std::collections::BTreeMap;

use enfilade_cpg::{
    Batch, Cell, CellId, CellPortalGraph, DecidedPlace, Fact, Locator, Portal, PortalId, Reason,
    SourceRuns, Why, World,
};
use enfilade_geom::scene::Primitive;

use crate::layout::{Layout, layout_of};
use crate::specials::renumbered as renumbered_specials;

/// Returns the world with each cell merged into `into[cell]`, and the new number of each old cell.
///
/// `into` holds the same cell for all cells of a group. Names such as `cell-3` follow the new numbers; of
/// others, that of the outdoors stays, else the first of its group.
/// Linear in the world.
pub(super) fn merged(world: &World, into: &[u32]) -> (World, Vec<CellId>) {
    let old = &world.graph;
    let mut number = vec![u32::MAX; into.len()];
    let mut cells: Vec<Cell> = Vec::new();
    let mut cell_of: Vec<CellId> = Vec::with_capacity(into.len());
    for (c, &to) in into.iter().enumerate() {
        let from = &old.cells[c];
        let slot = &mut number[to as usize];
        if *slot == u32::MAX {
            *slot = cells.len() as u32;
            cells.push(Cell {
                portals: Vec::new(),
                n_triangles: 0,
                n_detail_triangles: 0,
                ..from.clone()
            });
        } else {
            absorb(&mut cells[*slot as usize], from);
        }
        cell_of.push(CellId(*slot));
    }
    for (i, cell) in (0..).zip(&mut cells) {
        if is_numbered(&cell.name) {
            cell.name = CellId(i).to_string();
        }
    }
    let renumbered = |list: &[CellId]| {
        let mut out: Vec<CellId> = list.iter().map(|c| cell_of[c.0 as usize]).collect();
        out.sort_unstable();
        out.dedup();
        out
    };
    let places = [old.places.clone(), merged_rooms(old, &cell_of)].concat();
    let mut portals = Vec::new();
    let mut portal_of = Vec::with_capacity(old.portals.len());
    for p in &old.portals {
        let joined = p.cells.map(|c| cell_of[c.0 as usize]);
        let stays = joined[0] != joined[1];
        portal_of.push(stays.then_some(PortalId(portals.len() as u32)));
        if stays {
            for c in joined {
                cells[c.0 as usize]
                    .portals
                    .push(PortalId(portals.len() as u32));
            }
            portals.push(Portal {
                cells: joined,
                ..p.clone()
            });
        }
    }
    let mut batches = Batches::default();
    for b in &world.batches {
        batches.add(renumbered(&b.cells), &b.primitive, &b.sources, b.is_seal);
    }
    let batches = batches.finish();
    for b in batches.iter().filter(|b| !b.is_seal) {
        for c in &b.cells {
            cells[c.0 as usize].n_triangles += (b.primitive.indices.len() / 3) as u32;
        }
    }
    let mut details = world.details.clone();
    for d in &mut details {
        d.cells = renumbered(&d.cells);
        let mesh = &world.detail_meshes[d.mesh as usize];
        let n: usize = mesh.primitives.iter().map(|p| p.indices.len() / 3).sum();
        for c in &d.cells {
            cells[c.0 as usize].n_detail_triangles += n as u32;
        }
    }
    let mut out = world.clone();
    out.pvs = None;
    out.room_facts = None;
    out.graph.locator = locator(&old.locator, &cell_of).into();
    out.graph.cells = cells;
    out.graph.portals = portals;
    out.graph.places = places;
    out.graph.specials =
        renumbered_specials(&old.specials, |c| cell_of[c.idx()], |p| portal_of[p.idx()]);
    out.batches = batches;
    out.details = details;
    (out, cell_of)
}

/// Adds a cell to another of its group, all but its lists and counts.
pub(super) fn absorb(cell: &mut Cell, from: &Cell) {
    for k in 0..3 {
        cell.aabb[0][k] = cell.aabb[0][k].min(from.aabb[0][k]);
        cell.aabb[1][k] = cell.aabb[1][k].max(from.aabb[1][k]);
    }
    cell.volume += from.volume;
    cell.why = why_of_both(cell, from);
    cell.is_void &= from.is_void;
    let is_first_name = is_numbered(&cell.name) && !is_numbered(&from.name);
    if (from.outdoor || is_first_name) && !cell.outdoor {
        cell.name.clone_from(&from.name);
    }
    cell.outdoor |= from.outdoor;
}

/// Returns why two cells together are what they are: the reason for the outdoors or a room is that of both, by the floor of both.
fn why_of_both(cell: &Cell, from: &Cell) -> Vec<Why> {
    let takes = from.outdoor && !cell.outdoor || cell.is_void && !from.is_void;
    let (lead, rest) = if takes { (from, cell) } else { (cell, from) };
    let floor_of = |why: &Why| {
        let fact = |fact: Fact| why.facts.get(&fact).copied().map(f64::from);
        Some([
            fact(Fact::Floor)?,
            fact(Fact::Standing)?,
            fact(Fact::Doorway)?,
        ])
    };
    let Some([floor, standing, doorway]) = rest.why.iter().find_map(floor_of) else {
        return lead.why.clone();
    };
    let of_both = |why: &Why| {
        let Some([own_floor, own_standing, own_doorway]) = floor_of(why) else {
            return why.clone();
        };
        let both = own_floor + floor;
        let share = (own_floor * own_standing + floor * standing) / both.max(f64::MIN_POSITIVE);
        let facts = [
            (Fact::Floor, both),
            (Fact::Standing, share),
            (Fact::Doorway, own_doorway.max(doorway)),
        ];
        let mut joined = why.clone().with(&facts);
        if !joined.holds() {
            // A small room beside a large void is still a room, though not by the floor of both.
            joined = why.clone();
            joined.facts.remove(&Fact::Floor);
        }
        joined
    };
    lead.why.iter().map(of_both).collect()
}

/// Returns the decisions by which rooms are parts of others: one for each room but the largest of its cell, at the widest of its
/// portals that are gone. `cell_of` has the new cell of each.
fn merged_rooms(old: &CellPortalGraph, cell_of: &[CellId]) -> Vec<DecidedPlace> {
    let to = |c: CellId| cell_of[c.idx()];
    let is_room = |c: &CellId| old[*c].is_room() && old[*c].holds_person();
    let mut largest: BTreeMap<CellId, CellId> = BTreeMap::new();
    for c in old.cell_ids().filter(is_room) {
        let best = largest.entry(to(c)).or_insert(c);
        if old[c].volume > old[*best].volume {
            *best = c;
        }
    }
    let lost = old
        .cell_ids()
        .filter(|c| is_room(c) && largest[&to(*c)] != *c);
    let merged_at = |c: CellId| {
        let portals = old[c].portals.iter().map(|&p| &old[p]);
        let gone = portals.filter(|p| to(p.cells[0]) == to(p.cells[1]));
        let portal = gone.max_by(|a, b| a.area.total_cmp(&b.area))?;
        let facts = [(Fact::Area, portal.area), (Fact::Volume, old[c].volume)];
        let facts = facts.map(|(fact, value)| (fact, f64::from(value)));
        Some(DecidedPlace {
            at: portal.center(),
            why: Why::given(Reason::Merged).with(&facts),
        })
    };
    lost.filter_map(merged_at).collect()
}

/// Returns `true` if a builder gave this name by number.
fn is_numbered(name: &str) -> bool {
    let number = name.strip_prefix("cell-");
    number.is_some_and(|n| n.parse::<u32>().is_ok())
}

/// Batches under construction: one for each list of cells, material and set of attributes, with seals separate.
#[derive(Default)]
pub(crate) struct Batches(BTreeMap<BatchKey, (Primitive, SourceRuns)>);

impl Batches {
    /// Adds triangles that the ascending `cells` see. A batch with a triangle of unknown source has no sources.
    pub(crate) fn add(
        &mut self,
        cells: Vec<CellId>,
        primitive: &Primitive,
        sources: &SourceRuns,
        is_seal: bool,
    ) {
        let key = (is_seal, cells, primitive.material, layout_of(primitive));
        let (to, known) = self.0.entry(key).or_default();
        append(to, primitive);
        known.extend(sources);
    }

    /// Returns the batches in order of cells, material and attributes, seals last.
    pub(crate) fn finish(self) -> Vec<Batch> {
        let batches = self.0.into_iter();
        let batch =
            |((is_seal, cells, ..), (primitive, sources)): (BatchKey, (Primitive, SourceRuns))| {
                Batch {
                    cells,
                    sources: sources.of_all(primitive.indices.len() / 3),
                    primitive,
                    is_seal,
                }
            };
        batches.map(batch).collect()
    }
}

type BatchKey = (bool, Vec<CellId>, Option<u32>, Layout);

fn append(to: &mut Primitive, from: &Primitive) {
    let first = to.positions.len() as u32;
    to.material = from.material;
    to.positions.extend_from_slice(&from.positions);
    to.normals.extend_from_slice(&from.normals);
    to.tangents.extend_from_slice(&from.tangents);
    to.colors.extend_from_slice(&from.colors);
    to.uvs.resize(from.uvs.len(), Vec::new());
    for (to, from) in to.uvs.iter_mut().zip(&from.uvs) {
        to.extend_from_slice(from);
    }
    to.indices.extend(from.indices.iter().map(|i| i + first));
}

/// Returns the locator with new numbers, without nodes that no longer separate cells.
fn locator(old: &Locator, cell_of: &[CellId]) -> Locator {
    let renumbered = |child: i32| match child {
        c if c <= -2 => Locator::leaf(Some(cell_of[(-2 - c) as usize])),
        c => c,
    };
    // The replacement of each node: children come after their parents.
    let mut becomes: Vec<i32> = vec![0; old.nodes.len()];
    let resolve = |becomes: &[i32], child: i32| {
        if child >= 0 {
            becomes[child as usize]
        } else {
            renumbered(child)
        }
    };
    for i in (0..old.nodes.len()).rev() {
        let [f, b] = old.nodes[i].children.map(|c| resolve(&becomes, c));
        becomes[i] = if f == b && f < 0 { f } else { i as i32 };
    }
    let mut out = Locator {
        bounds: old.bounds,
        outside: old.outside.map(|c| cell_of[c.0 as usize]),
        planes: old.planes.clone(),
        ..Locator::default()
    };
    let mut new_index = vec![-1_i32; old.nodes.len()];
    // In the old order, so that children still come after their parents.
    let mut is_used = vec![false; old.nodes.len()];
    let root = resolve(&becomes, old.root);
    if root >= 0 {
        is_used[root as usize] = true;
    }
    for i in 0..old.nodes.len() {
        if is_used[i] {
            new_index[i] = out.nodes.len() as i32;
            out.nodes.push(old.nodes[i]);
            for child in old.nodes[i].children.map(|c| resolve(&becomes, c)) {
                if child >= 0 {
                    is_used[child as usize] = true;
                }
            }
        }
    }
    let settled = |child: i32| {
        if child >= 0 {
            new_index[child as usize]
        } else {
            child
        }
    };
    for node in &mut out.nodes {
        node.children = node.children.map(|c| settled(resolve(&becomes, c)));
    }
    out.root = settled(root);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_cpg::PortalKind;

    #[test]
    fn rooms_that_a_doorway_between_them_joins_are_told() {
        // A row: a hall, a doorway half a meter thick, a room, and a shaft too narrow for a person.
        let cell = |from: f32, to: f32, portals: &[u32]| Cell {
            aabb: [[from, 0.0, 0.0], [to, 3.0, 4.0]],
            volume: (to - from) * 12.0,
            portals: portals.iter().map(|&p| PortalId(p)).collect(),
            ..Cell::default()
        };
        let portal = |a: u32, area: f32| Portal {
            cells: [CellId(a), CellId(a + 1)],
            kind: PortalKind::Open,
            normal: [1.0, 0.0, 0.0],
            area,
            outline: Vec::new(),
            pieces: Vec::new(),
            why: Vec::new(),
            fittings: Vec::new(),
        };
        let mut world = World::default();
        world.graph.cells = vec![
            cell(0.0, 9.0, &[0]),
            cell(9.0, 9.5, &[0, 1]),
            cell(9.5, 14.0, &[1, 2]),
            cell(14.0, 14.2, &[2]),
        ];
        world.graph.portals = vec![portal(0, 6.0), portal(1, 6.5), portal(2, 1.0)];
        let lost = |into: &[u32]| -> Vec<Why> {
            let places = merged(&world, into).0.graph.places;
            places.into_iter().map(|place| place.why).collect()
        };
        assert!(lost(&[0, 0, 2, 2]).is_empty());
        let [why] = &lost(&[0; 4])[..] else {
            panic!("one room is lost")
        };
        assert_eq!(why.reason, Reason::Merged);
        let facts = [(Fact::Area, 6.5), (Fact::Volume, 54.0)];
        assert_eq!(why.facts, facts.into());
    }
}

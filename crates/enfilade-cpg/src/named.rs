//! Names from before the bake, and the cells that see each named source.

use std::collections::{BTreeMap, BTreeSet};

use crate::{Batch, CellId, World};

impl World {
    /// Returns the names of a source and its ancestors, from the top, joined by `/`; skips nodes without a name.
    #[must_use]
    pub fn source_path(&self, source: u32) -> String {
        let mut names = Vec::new();
        let mut at = Some(source);
        while let Some(node) = at.and_then(|i| self.sources.get(i as usize)) {
            if !node.name.is_empty() {
                names.push(node.name.as_str());
            }
            at = node.parent;
        }
        names.reverse();
        names.join("/")
    }

    /// Returns the sources that a cell sees without passing a portal, each with its number of triangles: for
    /// structure, those that list the cell; for details, all. O(batches + runs + details).
    #[must_use]
    pub fn sources_in(&self, cell: CellId) -> BTreeMap<u32, u32> {
        let mut found = BTreeMap::new();
        for batch in self.batches_of(cell) {
            for &[source, n] in batch.sources.runs() {
                *found.entry(source).or_default() += n;
            }
        }
        let is_in = |cells: &[CellId]| cells.binary_search(&cell).is_ok();
        for detail in self.details.iter().filter(|d| is_in(&d.cells)) {
            let mesh = &self.detail_meshes[detail.mesh as usize];
            let n: usize = mesh.primitives.iter().map(|p| p.indices.len() / 3).sum();
            if let Some(source) = detail.source {
                *found.entry(source).or_default() += n as u32;
            }
        }
        found
    }

    /// Returns the cells that see a source without passing a portal, ascending. O(batches + runs + details).
    #[must_use]
    pub fn cells_of_source(&self, source: u32) -> Vec<CellId> {
        self.cells_of_sources(|s| s == source)
    }

    /// Returns the cells that see any of the sources for which `is_one` is `true` without passing a portal,
    /// ascending. O(batches + runs + details).
    #[must_use]
    #[doc(hidden)]
    pub fn cells_of_sources(&self, is_one: impl Fn(u32) -> bool) -> Vec<CellId> {
        let holds = |b: &&Batch| b.sources.runs().iter().any(|r| is_one(r[0]));
        let batches = self.batches.iter().filter(holds);
        let details = self
            .details
            .iter()
            .filter(|d| d.source.is_some_and(&is_one));
        let mut cells: BTreeSet<CellId> = batches.flat_map(|b| b.cells.iter().copied()).collect();
        cells.extend(details.flat_map(|d| d.cells.iter().copied()));
        cells.into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::scene::SourceNode;

    #[test]
    fn a_path_leads_from_the_top_to_the_source() {
        let node = |name: &str, parent| SourceNode {
            name: name.into(),
            parent,
            extras: String::new(),
        };
        let world = World {
            sources: vec![
                node("house", None),
                node("", Some(0)),
                node("door", Some(1)),
            ],
            ..World::default()
        };
        assert_eq!(world.source_path(2), "house/door");
        assert_eq!(world.source_path(9), "");
    }
}

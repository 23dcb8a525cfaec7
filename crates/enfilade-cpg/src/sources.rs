//! What things were called before the bake: which of the input's objects each triangle comes from.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_geom::scene::FixtureKind;

use crate::{Batch, CellId, World};

/// Which source each of a list of triangles comes from, as runs of triangles of one source.
///
/// Triangles of one object mostly follow each other, so that this is far shorter than a number a triangle.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SourceRuns {
    /// Index into [`World::sources`], and how many triangles: at least one.
    runs: Vec<[u32; 2]>,
}

impl SourceRuns {
    /// The runs as they are, e.g. from a file; [`World::validate`] judges them.
    #[must_use]
    pub fn from_runs(runs: Vec<[u32; 2]>) -> Self {
        Self { runs }
    }

    /// Source and number of triangles of each run, in the order of the triangles.
    #[must_use]
    pub fn runs(&self) -> &[[u32; 2]] {
        &self.runs
    }

    /// Whether no triangle has a source.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.runs.is_empty()
    }

    /// Says that the next `n` triangles come from `source`.
    pub fn push(&mut self, source: u32, n: u32) {
        match self.runs.last_mut() {
            _ if n == 0 => {}
            Some([last, count]) if *last == source => *count += n,
            _ => self.runs.push([source, n]),
        }
    }

    /// Puts the runs of other triangles behind these.
    pub fn extend(&mut self, other: &Self) {
        for &[source, n] in &other.runs {
            self.push(source, n);
        }
    }

    /// The source of each triangle, in their order.
    pub fn of_triangles(&self) -> impl Iterator<Item = u32> {
        let run = |&[source, n]: &[u32; 2]| std::iter::repeat_n(source, n as usize);
        self.runs.iter().flat_map(run)
    }

    /// The source of one triangle. O(runs).
    #[must_use]
    pub fn of(&self, triangle: u32) -> Option<u32> {
        let mut end = 0_u64;
        let holds = |&&[_, n]: &&[u32; 2]| {
            end += u64::from(n);
            u64::from(triangle) < end
        };
        self.runs.iter().find(holds).map(|&[source, _]| source)
    }

    /// What is wrong with them, if they are to be the sources of `n_triangles`.
    fn problem(&self, n_triangles: usize, n_sources: usize) -> Option<String> {
        if let Some([source, _]) = self.runs.iter().find(|r| r[0] as usize >= n_sources) {
            return Some(format!("source {source} of {n_sources}"));
        }
        if self.runs.iter().any(|r| r[1] == 0) {
            return Some("a run of no triangles".into());
        }
        let n: u64 = self.runs.iter().map(|r| u64::from(r[1])).sum();
        (n != 0 && n != n_triangles as u64)
            .then(|| format!("sources of {n} triangles, but {n_triangles} triangles"))
    }
}

impl World {
    /// Names of a source and of all above it, from the top, with `/` between; nodes without a name are left out.
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

    /// The sources that a cell sees without passing a portal, with how many of their triangles: structure by the triangles that
    /// list the cell, details by all of theirs. O(batches + runs + details).
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

    /// The cells from which a source is seen without passing a portal, ascending. O(batches + runs + details).
    #[must_use]
    pub fn cells_of_source(&self, source: u32) -> Vec<CellId> {
        let holds = |b: &&Batch| b.sources.runs().iter().any(|r| r[0] == source);
        let batches = self.batches.iter().filter(holds);
        let details = self.details.iter().filter(|d| d.source == Some(source));
        let mut cells: BTreeSet<CellId> = batches.flat_map(|b| b.cells.iter().copied()).collect();
        cells.extend(details.flat_map(|d| d.cells.iter().copied()));
        cells.into_iter().collect()
    }
}

/// Checks the tree of sources and all that refers to it.
pub(crate) fn check(world: &World, broken: &mut dyn FnMut(String, String)) {
    let n = world.sources.len();
    for (i, node) in world.sources.iter().enumerate() {
        if let Some(parent) = node.parent.filter(|&p| p as usize >= i) {
            broken(
                format!("source {i} ({})", node.name),
                format!("its parent {parent} does not come before it"),
            );
        }
        if let Err(why) = check_json(&node.extras) {
            broken(
                format!("source {i} ({})", node.name),
                format!("extras: {why}"),
            );
        }
    }
    for (i, batch) in world.batches.iter().enumerate() {
        let n_triangles = batch.primitive.indices.len() / 3;
        if let Some(problem) = batch.sources.problem(n_triangles, n) {
            broken(format!("batch {i}"), problem);
        }
    }
    for (i, detail) in world.details.iter().enumerate() {
        if let Some(source) = detail.source.filter(|&s| s as usize >= n) {
            broken(
                format!("detail {i} ({})", detail.name),
                format!("source {source} of {n}"),
            );
        }
    }
    if let Err(why) = check_json(&world.about.extras) {
        broken("the scene".into(), format!("extras: {why}"));
    }
    for (i, fixture) in world.fixtures.iter().enumerate() {
        let owner = || format!("fixture {i} ({})", fixture.name);
        if !fixture.transform.is_finite() {
            broken(owner(), "its transform is not finite".into());
        }
        let is_object = fixture.gltf.trim_start().starts_with('{');
        let is_marker = fixture.kind == FixtureKind::Marker;
        let fits = if is_marker {
            fixture.gltf.is_empty()
        } else {
            is_object
        };
        if !fits {
            broken(owner(), "is no JSON object, or a marker that is one".into());
        }
        for text in [&fixture.gltf, &fixture.extras] {
            if let Err(why) = check_json(text) {
                broken(owner(), why);
            }
        }
    }
}

/// Brackets around a value in the file, at most: a reader must not find more than it takes.
const NESTING: usize = 8;

/// Whether the text is a JSON value, or empty, that fits into the JSON of a file.
fn check_json(text: &str) -> Result<(), String> {
    if text.is_empty() {
        return Ok(());
    }
    let nested = format!("{}{text}{}", "[".repeat(NESTING), "]".repeat(NESTING));
    let read: Result<serde_json::Value, _> = serde_json::from_str(&nested);
    read.map(|_| ()).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::scene::SourceNode;

    #[test]
    fn each_triangle_finds_its_source() {
        let mut sources = SourceRuns::default();
        for (source, n) in [(3, 2), (3, 1), (0, 0), (1, 2)] {
            sources.push(source, n);
        }
        assert_eq!(sources.runs(), [[3, 3], [1, 2]]);
        let all: Vec<u32> = sources.of_triangles().collect();
        assert_eq!(all, [3, 3, 3, 1, 1]);
        let one_by_one: Vec<_> = (0..6).map(|t| sources.of(t)).collect();
        assert_eq!(
            one_by_one,
            [Some(3), Some(3), Some(3), Some(1), Some(1), None]
        );
    }

    #[test]
    fn runs_that_fit_no_triangles_are_found() {
        let problem = |runs: &[[u32; 2]]| SourceRuns::from_runs(runs.to_vec()).problem(5, 2);
        assert_eq!(problem(&[]), None);
        assert_eq!(problem(&[[1, 2], [0, 3]]), None);
        assert!(problem(&[[1, 2]]).is_some());
        assert!(problem(&[[2, 5]]).is_some());
        assert!(problem(&[[1, 5], [0, 0]]).is_some());
        assert!(problem(&[[1, u32::MAX], [0, 6]]).is_some());
    }

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

    #[test]
    fn json_that_a_reader_would_refuse_is_not_written() {
        let deep = |n: usize| "[".repeat(n) + &"]".repeat(n);
        assert!(check_json(&deep(100)).is_ok());
        assert!(check_json(&deep(125)).is_err());
        assert!(check_json("{} {}").is_err());
        assert!(check_json("").is_ok());
    }
}

//! Consistency of sources within a file: names, runs of triangles and parts fit together.
//!
//! A wall's name before the bake is only in the source ([`crate::compare_scene`]).

use std::collections::{BTreeMap, BTreeSet};

use enfilade_cpg::{Batch, World};

/// Returns problems, a line each.
pub(crate) fn check(world: &World) -> Vec<String> {
    let mut out = Vec::new();
    check_vertices(world, &mut out);
    check_use(world, &mut out);
    check_names(world, &mut out);
    out
}

/// Checks that a vertex has one source: shifted runs of triangles would tear objects apart.
fn check_vertices(world: &World, out: &mut Vec<String>) {
    for (i, batch) in world.batches.iter().enumerate() {
        if let Some([a, b]) = torn(batch) {
            let [a, b] = [a, b].map(|s| world.source_path(s));
            out.push(format!(
                "batch {i}: triangles of {a:?} and of {b:?} share a vertex"
            ));
        }
    }
}

/// Returns two sources that share a vertex of a batch.
fn torn(batch: &Batch) -> Option<[u32; 2]> {
    let p = &batch.primitive;
    let mut source_of = vec![None; p.positions.len()];
    for (source, t) in batch.sources.of_triangles().zip(p.triples()) {
        for &v in t {
            let known = source_of[v as usize].get_or_insert(source);
            if *known != source {
                return Some([*known, source]);
            }
        }
    }
    None
}

/// Checks that each source has an object, or is above one that has.
fn check_use(world: &World, out: &mut Vec<String>) {
    let mut is_used = vec![false; world.sources.len()];
    let runs = world.batches.iter().flat_map(|b| b.sources.runs());
    let details = world.details.iter().filter_map(|d| d.source);
    for source in runs.map(|r| r[0]).chain(details) {
        is_used[source as usize] = true;
    }
    for (i, source) in world.sources.iter().enumerate().rev() {
        if let Some(parent) = source.parent.filter(|_| is_used[i]) {
            is_used[parent as usize] = true;
        }
    }
    // A batch without sources for its triangles may contain those of any source.
    let knows = |b: &&Batch| b.is_seal || b.primitive.indices.is_empty() || !b.sources.is_empty();
    if world.batches.iter().filter(|b| !knows(b)).count() > 0 {
        return;
    }
    let unused = (0..).zip(&is_used).filter(|(_, used)| !**used);
    for (source, _) in unused.take(3) {
        let path = world.source_path(source);
        out.push(format!(
            "source {source} ({path}): no object or triangle comes from it"
        ));
    }
}

/// Checks that a detail is named as its source, or, if it has no name of its own and comes from the group around it,
/// as its mesh.
fn check_names(world: &World, out: &mut Vec<String>) {
    let named: BTreeSet<&str> = world.sources.iter().map(|s| s.name.as_str()).collect();
    // Sources that have a detail of their name.
    let mut owners: BTreeMap<u32, bool> = BTreeMap::new();
    for detail in world.details.iter().filter(|d| d.part_of.is_none()) {
        if let Some(source) = detail.source {
            let name = &world.sources[source as usize].name;
            *owners.entry(source).or_default() |= *name == detail.name;
        }
    }
    for (i, detail) in world.details.iter().enumerate() {
        if let Some(whole) = detail.part_of {
            let whole = &world.details[whole as usize];
            let is_named = detail.name.starts_with(whole.name.trim_start());
            if detail.source != whole.source || !is_named {
                let (own, of) = (&detail.name, &whole.name);
                out.push(format!(
                    "detail {i} ({own}): is part of {of:?}, but not of its name and source"
                ));
            }
            continue;
        }
        let Some(source) = detail.source else {
            continue;
        };
        let name = &world.sources[source as usize].name;
        let is_elsewhere = named.contains(detail.name.as_str()) && !detail.name.is_empty();
        let is_of_another = owners[&source];
        if *name != detail.name && (is_elsewhere || is_of_another) {
            let own = &detail.name;
            out.push(format!(
                "detail {i} ({own}): comes from source {source}, which is named {name:?}"
            ));
        }
    }
}

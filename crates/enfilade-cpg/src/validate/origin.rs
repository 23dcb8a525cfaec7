//! Checks the input's information about itself: names, lights, cameras, marked places.

use enfilade_geom::scene::FixtureKind;

use crate::World;

/// Most levels of sources: importers read at most 1,024 nested nodes, and paths of names are as long.
const MAX_DEPTH: u32 = 4096;

/// Checks the tree of sources and all references to it.
pub(crate) fn check(world: &World, broken: &mut dyn FnMut(String, String)) {
    let n = world.sources.len();
    let mut depths: Vec<u32> = Vec::with_capacity(n);
    for (i, node) in world.sources.iter().enumerate() {
        if let Some(parent) = node.parent.filter(|&p| p as usize >= i) {
            broken(
                format!("source {i} ({})", node.name),
                format!("its parent {parent} must come before it"),
            );
        }
        let above = node.parent.and_then(|p| depths.get(p as usize));
        let depth = above.map_or(0, |d| d + 1);
        if depth == MAX_DEPTH {
            broken(
                format!("source {i} ({})", node.name),
                format!("the tree of sources is deeper than {MAX_DEPTH}"),
            );
        }
        depths.push(depth);
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
        if batch.is_seal && !batch.sources.is_empty() {
            let problem = "has sources, but consists of seals, which the input does not have";
            broken(format!("batch {i}"), problem.into());
        }
    }
    for (i, detail) in world.details.iter().enumerate() {
        if let Some(source) = detail.source.filter(|&s| s as usize >= n) {
            broken(
                format!("detail {i} ({})", detail.name),
                format!("refers to source {source}, but there are {n}"),
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
            broken(
                owner(),
                "a light or camera must be a JSON object, and a marker must be empty".into(),
            );
        }
        for text in [&fixture.gltf, &fixture.extras] {
            if let Err(why) = check_json(text) {
                broken(owner(), why);
            }
        }
    }
}

/// Levels of brackets around a value in the file: a reader must not meet more than it accepts.
const NESTING: usize = 8;

/// Checks that a text is empty, or a JSON value that fits into the JSON of a file.
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
    use super::check_json;

    #[test]
    fn json_that_a_reader_would_refuse_is_not_written() {
        let deep = |n: usize| "[".repeat(n) + &"]".repeat(n);
        assert!(check_json(&deep(100)).is_ok());
        assert!(check_json(&deep(125)).is_err());
        assert!(check_json("{} {}").is_err());
        assert!(check_json("").is_ok());
    }
}

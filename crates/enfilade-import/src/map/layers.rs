//! Layers and groups of TrenchBroom: entities that name themselves by `_tb_id`, and members that name them.

use std::collections::{BTreeMap, BTreeSet};

use crate::ImportError;
use crate::builder::Builder;

use super::parse::RawEntity;

/// Key of a layer that the editor leaves out of the maps that it exports for compilers.
const OMITTED: &str = "_tb_layer_omit_from_export";

/// Removes the contents of layers that are omitted from export, and reports the layers by name. Hidden layers are compiled.
pub(super) fn leave_out_omitted(entities: &mut Vec<RawEntity<'_>>, builder: &mut Builder<'_>) {
    let is_world = |e: &RawEntity<'_>| e.get("classname") == Some("worldspawn");
    let is_omitted = |e: &RawEntity<'_>| e.get(OMITTED) == Some("1");
    // The world's own brushes are those of the default layer.
    let is_default_omitted = entities.iter().any(|e| is_world(e) && is_omitted(e));
    let mut gone: BTreeSet<String> = BTreeSet::new();
    let is_gone = |e: &RawEntity<'_>, gone: &BTreeSet<String>| {
        let above = ["_tb_group", "_tb_layer"].map(|key| e.get(key));
        let is_layer = e.get("_tb_type") == Some("_tb_layer");
        let is_below = above.into_iter().flatten().any(|id| gone.contains(id));
        let is_of_default = above == [None; 2] && !is_layer && !is_world(e);
        !is_world(e) && is_omitted(e) || is_below || is_default_omitted && is_of_default
    };
    // Groups may lie in groups, in any order.
    loop {
        let n = gone.len();
        let all = entities.iter().filter(|e| is_gone(e, &gone));
        let ids: Vec<String> = all
            .filter_map(|e| e.get("_tb_id").map(str::to_owned))
            .collect();
        gone.extend(ids);
        if gone.len() == n {
            break;
        }
    }
    for e in entities.iter_mut().filter(|e| is_omitted(e)) {
        let name = e.get("_tb_name").unwrap_or("Default Layer").to_owned();
        let reason = "a layer that its map omits from export";
        builder.report.leave_out(reason, &name, 1);
        if is_world(e) {
            e.brushes.clear();
            e.patches.clear();
        }
    }
    entities.retain(|e| !is_gone(e, &gone));
}

/// Keys by which members name their group or layer, the nearest first.
const ABOVE: [&str; 2] = ["_tb_group", "_tb_layer"];
/// Groups in groups, in groups: deeper ones are not named.
const MAX_DEPTH: usize = 32;

/// The groups and layers of a map.
pub(super) struct Groups<'t> {
    /// Identity to name, and the entity that is the group.
    by_id: BTreeMap<&'t str, (&'t str, usize)>,
}

impl<'t> Groups<'t> {
    /// Collects the groups and layers among the entities.
    pub(super) fn of(entities: &[RawEntity<'t>]) -> Self {
        let named = entities.iter().enumerate().filter_map(|(i, e)| {
            e.get("_tb_type")?;
            Some((e.get("_tb_id")?, (e.get("_tb_name")?, i)))
        });
        Self {
            by_id: named.collect(),
        }
    }

    /// Returns the names of the groups and layers around the brushes of an entity, the nearest first.
    pub(super) fn around(&self, entities: &[RawEntity<'t>], entity: usize) -> Vec<&'t str> {
        let own = &entities[entity];
        let is_group = own.get("_tb_type").is_some();
        let mut names: Vec<&str> = own
            .get("_tb_name")
            .filter(|_| is_group)
            .into_iter()
            .collect();
        let mut at = own;
        while names.len() < MAX_DEPTH {
            let above = ABOVE.iter().find_map(|key| self.by_id.get(at.get(key)?));
            let Some(&(name, next)) = above else { break };
            names.push(name);
            at = &entities[next];
        }
        names
    }
}

/// Numbers of nodes of groups, by the names around them, the nearest first.
pub(super) type GroupNodes<'t> = BTreeMap<Vec<&'t str>, Option<u32>>;

/// Returns the node of the group or layer with these names around it, the nearest first; `None` outside of all.
pub(super) fn node_of<'t>(
    around: &[&'t str],
    nodes: &mut GroupNodes<'t>,
    builder: &mut Builder<'_>,
) -> Result<Option<u32>, ImportError> {
    let Some((own, above)) = around.split_first() else {
        return Ok(None);
    };
    if let Some(node) = nodes.get(around) {
        return Ok(*node);
    }
    let parent = node_of(above, nodes, builder)?;
    let node = builder.add_source("groups", parent, own, "")?;
    nodes.insert(around.to_vec(), node);
    Ok(node)
}

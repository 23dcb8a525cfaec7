//! Layers and groups of TrenchBroom: entities that name themselves by `_tb_id`, and members that name them.

use std::collections::BTreeSet;

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

//! Names of rooms as identifiers, and of the objects of the model.

use std::collections::BTreeSet;

use enfilade_cpg::{CellId, World};

/// Most bytes of an identifier: clients allow 100, and faces append to it.
const LONGEST: usize = 60;

/// Unique identifiers for the cells of a world: letters, digits, `-` and `_`.
pub(crate) struct Names {
    by_cell: Vec<String>,
}

impl Names {
    pub(crate) fn new(world: &World) -> Self {
        let mut taken = BTreeSet::new();
        let by_cell = world.graph.cells.iter().map(|cell| {
            let mut name = identifier(&cell.name);
            let stem = name.clone();
            let mut n = 1;
            while !taken.insert(name.clone()) {
                n += 1;
                name = format!("{stem}-{n}");
            }
            name
        });
        Self {
            by_cell: by_cell.collect(),
        }
    }

    pub(crate) fn of(&self, cell: CellId) -> &str {
        &self.by_cell[cell.idx()]
    }
}

fn identifier(name: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    let plain: String = name
        .chars()
        .map(|c| if is_plain(c) { c } else { '_' })
        .take(LONGEST)
        .collect();
    // An XML name begins with a letter.
    match plain.chars().next() {
        Some(c) if c.is_ascii_alphabetic() => plain,
        _ => format!("r{plain}"),
    }
}

/// Returns the name of the object that a triangle comes from: that of its node or, without one, of the nearest named above it.
pub(crate) fn source_name(world: &World, source: Option<u32>) -> Option<&str> {
    let mut at = source;
    while let Some(node) = at.and_then(|i| world.sources.get(i as usize)) {
        if !node.name.is_empty() {
            return Some(&node.name);
        }
        at = node.parent;
    }
    None
}

/// Returns the GlobalId in the name of an object from IFC, which is `IfcWall/GlobalId`; `None` in others.
pub(crate) fn global_id(name: &str) -> Option<&str> {
    let (_, id) = name.strip_prefix("Ifc").and_then(|n| n.split_once('/'))?;
    let id = id.get(..22)?;
    let is_digit = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '$';
    id.chars().all(is_digit).then_some(id)
}

/// Returns a text as XML has it, without characters that XML forbids.
pub(crate) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_plain_and_begin_with_a_letter() {
        assert_eq!(identifier("Küche 2"), "K_che_2");
        assert_eq!(identifier("2.OG"), "r2_OG");
        assert_eq!(identifier(""), "r");
    }

    #[test]
    fn global_ids_are_those_of_ifc() {
        let id = "0knNIAVBPBFvBy_m5QVHsU";
        assert_eq!(global_id(&format!("IfcWall/{id}")), Some(id));
        assert_eq!(global_id(&format!("IfcWall/{id} (2)")), Some(id));
        assert_eq!(global_id("IfcWall/short"), None);
        assert_eq!(global_id("wall/0knNIAVBPBFvBy_m5QVHsU"), None);
    }
}

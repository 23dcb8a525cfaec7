//! Fillings of openings, doors and windows, by class and name.
//!
//! Only the shape tells whether an object fills an opening at all, so a wrong answer here does no harm elsewhere.

use enfilade_geom::scene::Filling;

use crate::roles::{RoleFacts, decide_words, ends_in_opening_word, has_word, ifc_class};
use crate::words::words;

/// Words for doors and for windows.
const WORDS: [(Filling, &[&str]); 2] = [
    (Filling::Door, &["door", "gate"]),
    (Filling::Window, &["window", "windowpane", "skylight"]),
];

impl RoleFacts<'_> {
    /// Returns the opening that an object fills, according to its IFC class, its names, its groups or its materials, in
    /// this order; `None` if they do not tell.
    #[must_use]
    pub fn filling(&self) -> Option<Filling> {
        let names = || self.names.iter().copied().filter(|n| !n.is_empty());
        if let Some(class) = names().find_map(ifc_class) {
            return by_class(class);
        }
        // A window's curtain is a curtain, and a door's wall is a wall.
        let is_other = |n: &str| decide_words(n).is_some() && !ends_in_opening_word(n);
        if names().any(is_other) {
            return None;
        }
        let groups = self.ancestors.iter().copied();
        names()
            .chain(groups)
            .find_map(by_name)
            .or_else(|| self.materials.iter().copied().find_map(by_name))
    }
}

fn by_class(class: &str) -> Option<Filling> {
    if class.starts_with("IfcDoor") {
        Some(Filling::Door)
    } else if class.starts_with("IfcWindow") {
        Some(Filling::Window)
    } else {
        None
    }
}

/// Returns the meaning of a name's words, if they have only one: a group of doors and windows does not tell.
fn by_name(name: &str) -> Option<Filling> {
    if let Some(class) = ifc_class(name) {
        return by_class(class);
    }
    let words = words(name);
    let has = |list: &[&str]| words.iter().any(|w| has_word(list, w));
    match WORDS.map(|(_, list)| has(list)) {
        [true, false] => Some(WORDS[0].0),
        [false, true] => Some(WORDS[1].0),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filling(names: [&str; 2], ancestors: &[&str], materials: &[&str]) -> Option<Filling> {
        let facts = RoleFacts {
            names,
            ancestors,
            materials,
            is_see_through: false,
            moves: None,
            is_detail_file: false,
            thickness_if_plain: None,
        };
        facts.filling()
    }

    #[test]
    fn class_name_group_and_material_tell_in_this_order() {
        let (door, window) = (Some(Filling::Door), Some(Filling::Window));
        let of = |name: &str| filling([name, ""], &[], &["Oak"]);
        for name in [
            "IfcDoor/0a$",
            "IfcDoorStandardCase/0a$",
            "Door.003",
            "garage_doors",
            "wall_door",
        ] {
            assert_eq!(of(name), door, "{name}");
        }
        for name in ["IfcWindow/0a$", "Window 12", "skylights"] {
            assert_eq!(of(name), window, "{name}");
        }
        // Another class, other things, and nothing at all.
        for name in [
            "IfcPlate/window",
            "window curtain",
            "door_wall",
            "object-7",
            "",
        ] {
            assert_eq!(of(name), None, "{name}");
        }
        assert_eq!(filling(["frame", "Window"], &["Doors"], &["Oak"]), window);
        assert_eq!(filling(["frame", ""], &["Doors", "Windows"], &[]), door);
        assert_eq!(filling(["frame", ""], &["IfcWindow/0"], &["Door"]), window);
        assert_eq!(
            filling(["frame", ""], &["House"], &["Oak", "window"]),
            window
        );
    }
}

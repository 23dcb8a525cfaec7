//! Decides between structure and detail by file, name and material.
//!
//! A wrong "detail" opens a hole in a wall, a wrong "structural" makes a wall of a chair; both cost quality, not
//! correctness. Only see-through surfaces *must* be detail: a cell seen through glass may not count as hidden. The
//! first rule that matches decides; `docs/import.md` lists them.

use crate::auto_roles::DEFAULT;
use crate::glob::is_match;
use crate::helpers::{self, OPENING_WORDS};
use crate::tools::{TextureMatter, texture_matter};
use crate::words::words;
use enfilade_geom::scene::Role;
use std::collections::BTreeMap;

/// The user's own rules, which come before all others.
#[derive(Clone, Debug, PartialEq)]
pub struct RoleRules {
    /// Globs (`*`, `?`, case-insensitive) of object, mesh or material names that are structural; these win over
    /// `detail`. A material name matches only if all of an object's materials match.
    pub structural: Vec<String>,
    /// Globs of object, mesh or material names that are detail.
    pub detail: Vec<String>,
    /// Use only the user's rules and detail files; see-through surfaces stay detail.
    pub is_manual: bool,
    /// Decide by size and occlusion where no rule matches, unless `is_manual`.
    pub is_automatic: bool,
    /// The matter of surfaces, by globs of their textures or materials, before the tables of games ([`texture_matter`]).
    pub textures: BTreeMap<String, TextureMatter>,
}

impl Default for RoleRules {
    fn default() -> Self {
        Self {
            structural: Vec::new(),
            detail: Vec::new(),
            is_manual: false,
            is_automatic: true,
            textures: BTreeMap::new(),
        }
    }
}

/// Properties of an object that decide its role.
pub struct RoleFacts<'n> {
    /// Names of the node and of the mesh.
    pub names: [&'n str; 2],
    /// Names of ancestors, nearest first.
    pub ancestors: &'n [&'n str],
    /// Name of each primitive's material.
    pub materials: &'n [&'n str],
    /// All of it is see-through.
    pub is_see_through: bool,
    /// The reason why it moves.
    pub moves: Option<&'static str>,
    /// Its file was given as one of detail.
    pub is_detail_file: bool,
    /// Its least extent along its own axes, metres, if it has no more triangles than a box.
    pub thickness_if_plain: Option<f64>,
}

/// The role of an object, or its removal.
#[derive(Clone, Debug, PartialEq)]
pub enum RoleVerdict {
    /// Kept with this role, for this reason.
    Keep(Role, String),
    /// Left out, as a helper of some engine; with the reason.
    Ignore(String),
    /// Left out, as a mark of an opening; with the reason.
    Mark(String),
    /// Left out, as its format gives it no matter; with the reason.
    Void(String),
}

/// Meaning of a name's ending, after Godot's "Node type customization using name suffixes".
enum Suffix {
    /// Helper geometry that is never drawn.
    Helper,
    /// Moves on its own.
    Moves,
    /// Blocks sight, according to its author.
    Occluder,
    /// Irrelevant to the role.
    Neutral,
}

/// Longer endings come first where one ends with another.
const SUFFIXES: [(&str, Suffix); 15] = [
    ("noimp", Suffix::Helper),
    ("convcolonly", Suffix::Helper),
    ("colonly", Suffix::Helper),
    ("navmesh", Suffix::Helper),
    ("occonly", Suffix::Helper),
    ("convcol", Suffix::Neutral),
    ("col", Suffix::Neutral),
    ("occ", Suffix::Occluder),
    ("rigidonly", Suffix::Helper),
    ("rigid", Suffix::Moves),
    ("vehicle", Suffix::Moves),
    ("wheel", Suffix::Moves),
    ("loop", Suffix::Neutral),
    ("cycle", Suffix::Neutral),
    ("alpha", Suffix::Neutral),
];

/// Prefixes of collision hulls for Unreal Engine's importer.
const HULL_PREFIXES: [&str; 4] = ["UCX_", "UBX_", "USP_", "UCP_"];

/// IFC classes of things that stand in rooms or fill openings.
#[rustfmt::skip]
const IFC_DETAIL: [&str; 21] = [
    "IfcAnnotation", "IfcDistribution", "IfcDoor", "IfcElectric",
    "IfcEnergyConversionDevice", "IfcFlow", "IfcFurnishingElement", "IfcFurniture",
    "IfcGeographicElement", "IfcGrid", "IfcLamp", "IfcLightFixture", "IfcRailing",
    "IfcSanitaryTerminal", "IfcShadingDevice", "IfcSite", "IfcSystemFurnitureElement",
    "IfcTransportElement", "IfcOutlet", "IfcWindow", "IfcSwitchingDevice",
];

/// IFC classes without physical matter.
const IFC_VOID: [&str; 5] = [
    "IfcOpeningElement",
    "IfcOpeningStandardCase",
    "IfcSpace",
    "IfcSpatialZone",
    "IfcVirtualElement",
];

/// Returns the IFC classes that decide a role.
pub fn ifc_classes() -> impl Iterator<Item = &'static str> {
    IFC_DETAIL.into_iter().chain(IFC_VOID)
}

/// Words for bounds of rooms.
#[rustfmt::skip]
const STRUCTURAL_WORDS: [&str; 19] = [
    "wall", "floor", "ceiling", "roof", "slab", "column", "pillar", "beam", "foundation",
    "facade", "partition", "building", "house", "stair", "staircase", "stairs", "ground",
    "corridor", "chimney",
];

/// Words for things that stand in rooms.
#[rustfmt::skip]
const DETAIL_WORDS: [&str; 106] = [
    "appliance", "armchair", "banister", "barrel", "basin", "basket", "bathtub", "bed", "bench",
    "blanket", "blind", "book", "bookcase", "bookshelf", "bookshelves", "bottle", "bowl", "box",
    "bush", "cabinet", "candle", "carpet", "cart", "chair", "chandelier", "clock", "closet",
    "clutter", "computer", "cooker", "couch", "crate", "cup", "cupboard", "curtain", "cushion",
    "decal", "deco", "decoration", "desk", "dishwasher", "drawer", "dresser", "faucet", "flower",
    "foliage", "fridge", "furnishing", "furniture", "grass", "handrail", "hedge", "instrument",
    "keyboard", "lamp", "laptop", "light", "locker", "mattress", "microwave", "mirror", "monitor",
    "mug", "nightstand", "ottoman", "oven", "painting", "person", "picture", "pillow", "plant",
    "plate", "poster", "pot", "printer", "prop", "radiator", "railing", "refrigerator", "rug",
    "seat", "shelf", "shelves", "shower", "shrub", "sideboard", "sink", "sofa", "stool", "stove",
    "table", "tap", "television", "toilet", "towel", "toy", "trash", "tree", "tv", "vase",
    "vegetation", "wardrobe", "washbasin", "washer", "whiteboard", "wreath",
];

/// Words in names of materials that let light through or are full of holes.
const CLEAR_MATERIAL_WORDS: [&str; 8] = [
    "glass",
    "glazing",
    "foliage",
    "leaves",
    "curtain",
    "windowpane",
    "plexiglass",
    "grille",
];

/// Returns the reason why a node is dropped with its descendants, if its name implies it.
pub fn drops_subtree(name: &str) -> Option<String> {
    if ifc_class(name).is_some() {
        return None;
    }
    matches!(suffix(name), Some(("noimp", _))).then(|| "name ends in -noimp".to_owned())
}

impl RoleRules {
    /// Returns `true` if a material of this name lets light through, whatever its settings.
    #[doc(hidden)]
    pub fn is_clear_material(&self, name: &str) -> bool {
        !self.is_manual
            && words(name)
                .iter()
                .any(|w| has_word(&CLEAR_MATERIAL_WORDS, w))
    }

    /// Returns the role that the caller's rules give an object of this name, before the format's own.
    #[doc(hidden)]
    pub fn forced(&self, name: &str) -> Option<(Role, String)> {
        let fits = |globs: &[String]| globs.iter().find(|g| is_match(g, name)).cloned();
        let structural =
            fits(&self.structural).map(|g| (Role::Structural, format!("rule: structural '{g}'")));
        structural
            .or_else(|| fits(&self.detail).map(|g| (Role::Detail, format!("rule: detail '{g}'"))))
    }

    /// Returns the object's role; the first rule that matches decides.
    #[doc(hidden)]
    pub fn decide(&self, facts: &RoleFacts<'_>) -> RoleVerdict {
        let structural = |reason: String| RoleVerdict::Keep(Role::Structural, reason);
        let detail = |reason: String| RoleVerdict::Keep(Role::Detail, reason);
        if let Some(glob) = matching(&self.structural, facts) {
            return structural(format!("rule: structural '{glob}'"));
        }
        if let Some(glob) = matching(&self.detail, facts) {
            return detail(format!("rule: detail '{glob}'"));
        }
        if facts.is_detail_file {
            return detail("from a detail file".into());
        }
        if facts.is_see_through {
            return detail("material: see-through".into());
        }
        if self.is_manual {
            return structural("default".into());
        }
        if let Some(verdict) = facts.names.iter().find_map(|name| decide_ifc(name)) {
            return verdict;
        }
        if let Some(verdict) = facts.names.iter().find_map(|name| decide_suffix(name)) {
            return verdict;
        }
        let is_nothing = |m: &&str| {
            let matter = texture_matter(&self.textures, m);
            matter.is_some_and(TextureMatter::is_nothing)
        };
        if !facts.materials.is_empty() && facts.materials.iter().all(is_nothing) {
            let texture = facts.materials[0];
            let reason = format!("nothing but the tool texture '{texture}'");
            return match texture_matter(&self.textures, texture) {
                Some(TextureMatter::Portal) => RoleVerdict::Mark(reason),
                _ => RoleVerdict::Ignore(reason),
            };
        }
        let mut names = (facts.names.iter()).filter(|n| marked_portal(n).is_none());
        if let Some(helper) =
            names.find_map(|name| helpers::of_name(name, facts.thickness_if_plain))
        {
            let reason = format!("{helper}, by its name");
            return match helper {
                helpers::OPENING => RoleVerdict::Mark(reason),
                _ => RoleVerdict::Ignore(reason),
            };
        }
        if let Some(why) = facts.moves {
            return detail(format!("moves: {why}"));
        }
        if let Some(name) = facts.names.iter().find(|n| marked_portal(n).is_some()) {
            return detail(format!("name: '{name}'"));
        }
        for name in facts.names {
            match decide_words(name) {
                Some((Role::Structural, word)) => return structural(format!("name: '{word}'")),
                Some((Role::Detail, word)) => return detail(format!("name: '{word}'")),
                None => {}
            }
        }
        for name in facts.ancestors {
            if let Some(word) = group_word(name) {
                return detail(format!("below '{name}': '{word}'"));
            }
        }
        structural(DEFAULT.into())
    }
}

/// Returns NAME of `portal:NAME`, the name of an end of a link.
#[must_use]
pub fn marked_portal(name: &str) -> Option<&str> {
    let (kind, name) = name.split_once(':')?;
    kind.trim()
        .eq_ignore_ascii_case("portal")
        .then_some(name.trim())
}

fn decide_ifc(name: &str) -> Option<RoleVerdict> {
    let class = ifc_class(name)?;
    let starts = |list: &[&str]| list.iter().any(|c| class.starts_with(c));
    Some(if starts(&IFC_VOID) {
        RoleVerdict::Void(format!("{class} has no physical matter"))
    } else if starts(&IFC_DETAIL) {
        RoleVerdict::Keep(Role::Detail, format!("IFC class {class}"))
    } else {
        RoleVerdict::Keep(Role::Structural, format!("IFC class {class}"))
    })
}

/// Returns `IfcWall` for `IfcWall/0aBc$`. Comes before the endings, as an IFC id may end in anything.
pub(crate) fn ifc_class(name: &str) -> Option<&str> {
    let n = name.bytes().take_while(u8::is_ascii_alphabetic).count();
    let class = &name[..n];
    let tail = class.strip_prefix("Ifc")?;
    tail.starts_with(|c: char| c.is_ascii_uppercase())
        .then_some(class)
}

fn decide_suffix(name: &str) -> Option<RoleVerdict> {
    if let Some(prefix) = HULL_PREFIXES.iter().find(|p| name.starts_with(**p)) {
        return Some(RoleVerdict::Ignore(format!(
            "name starts with {prefix}: a collision hull"
        )));
    }
    match suffix(name)? {
        (ending, Suffix::Helper) => Some(RoleVerdict::Ignore(format!("name ends in -{ending}"))),
        (ending, Suffix::Moves) => Some(RoleVerdict::Keep(
            Role::Detail,
            format!("moves: name ends in -{ending}"),
        )),
        (ending, Suffix::Occluder) => Some(RoleVerdict::Keep(
            Role::Structural,
            format!("name ends in -{ending}"),
        )),
        (_, Suffix::Neutral) => None,
    }
}

/// Returns the ending of a name, behind `-`, `$` or `_` and before the `.001` that modelers append.
fn suffix(name: &str) -> Option<(&'static str, &'static Suffix)> {
    let name = name.trim_end_matches(|c: char| c.is_ascii_digit() || c == '.' || c == ' ');
    let at = name.rfind(['-', '$', '_'])?;
    let ending = &name[at + 1..];
    SUFFIXES
        .iter()
        .find(|(word, _)| ending.eq_ignore_ascii_case(word))
        .map(|(word, meaning)| (*word, meaning))
}

/// Returns `true` if the last word of a name that tells anything is one for things that fill an opening: `wall_door` may be a
/// wall with a hole or its leaf, which only the shape tells.
pub(crate) fn ends_in_opening_word(name: &str) -> bool {
    let tells = |w: &&String| {
        let lists: [&[&str]; 3] = [&STRUCTURAL_WORDS, &DETAIL_WORDS, &OPENING_WORDS];
        lists.iter().any(|list| has_word(list, w))
    };
    let words = words(name);
    let last = words.iter().rev().find(tells);
    last.is_some_and(|w| has_word(&OPENING_WORDS, w))
}

/// Decides between furniture and structure: the last word of either kind names the thing (a floor lamp is a lamp, the
/// plant room's wall a wall).
pub(crate) fn decide_words(name: &str) -> Option<(Role, String)> {
    let words = words(name);
    let mut opening = None;
    let mut found = None;
    for word in words {
        if has_word(&STRUCTURAL_WORDS, &word) {
            found = Some((Role::Structural, word));
        } else if has_word(&DETAIL_WORDS, &word) {
            found = Some((Role::Detail, word));
        } else if has_word(&OPENING_WORDS, &word) {
            opening = Some((Role::Detail, word));
        }
    }
    found.or(opening)
}

/// Returns the first word of a group's name if every word of it means detail: `Furniture`,
/// not `House with furniture`.
fn group_word(name: &str) -> Option<String> {
    let words = words(name);
    let all = words
        .iter()
        .all(|w| has_word(&DETAIL_WORDS, w) || has_word(&OPENING_WORDS, w));
    if all { words.into_iter().next() } else { None }
}

pub(crate) fn has_word(list: &[&str], word: &str) -> bool {
    list.contains(&word)
        || word
            .strip_suffix('s')
            .is_some_and(|one| list.contains(&one))
        || word
            .strip_suffix("es")
            .is_some_and(|one| list.contains(&one))
}

/// Returns the first glob that matches the object's names, its groups' names or all of its materials.
fn matching<'g>(globs: &'g [String], facts: &RoleFacts<'_>) -> Option<&'g str> {
    globs.iter().map(String::as_str).find(|glob| {
        facts
            .names
            .iter()
            .chain(facts.ancestors)
            .any(|n| !n.is_empty() && is_match(glob, n))
            || !facts.materials.is_empty()
                && facts
                    .materials
                    .iter()
                    .all(|m| !m.is_empty() && is_match(glob, m))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decide(name: &str) -> RoleVerdict {
        decide_with(&RoleRules::default(), name, |_| {})
    }

    fn decide_with(
        rules: &RoleRules,
        name: &str,
        change: impl Fn(&mut RoleFacts<'_>),
    ) -> RoleVerdict {
        let mut facts = RoleFacts {
            names: [name, ""],
            ancestors: &[],
            materials: &["Plaster"],
            is_see_through: false,
            moves: None,
            is_detail_file: false,
            thickness_if_plain: None,
        };
        change(&mut facts);
        rules.decide(&facts)
    }

    #[test]
    fn ends_of_links_stand_in_rooms_whatever_they_are_called() {
        for name in ["portal:a", "Portal: hall wall.001"] {
            assert_eq!(role(name), Some(Role::Detail), "{name}");
        }
        assert_eq!(role("portal"), Some(Role::Structural));
        assert_eq!(marked_portal("portal: a b"), Some("a b"));
        assert_eq!(marked_portal("portals:a"), None);
    }

    fn role(name: &str) -> Option<Role> {
        match decide(name) {
            RoleVerdict::Keep(role, _) => Some(role),
            _ => None,
        }
    }

    #[test]
    fn names_of_things_that_bound_rooms_are_structural() {
        for name in [
            "",
            "Cube.001",
            "Wall_03",
            "wall_door",
            "WallWindowSmall",
            "HouseWallB_01#0",
            "PlantRoom_Wall",
            "stable",
            "chimney",
            "Floor.002",
            "IfcWall/1NlPq2Qy5FNPHd4Z_0$col",
            "IfcWallStandardCase/x-noimp",
            "IfcSlab/table",
            "Wall-col",
            "thing-occ",
            "doorway",
        ] {
            assert_eq!(role(name), Some(Role::Structural), "{name}");
        }
    }

    // Covers S4.
    #[test]
    fn names_of_things_that_stand_in_rooms_are_detail() {
        for name in [
            "Table",
            "DINING_TABLES.003",
            "KitchenChair12",
            "floor_lamp",
            "WallShelf",
            "Door-Leaf",
            "window",
            "IfcDoor/0aB",
            "IfcFurnishingElement/7",
            "IfcFlowTerminal/1",
            "IfcWindowStandardCase/1",
            "IfcRailing/1",
            "Crate-rigid",
            "Car_Vehicle.001",
            "Bookshelves",
            "IfcSite/2",
        ] {
            assert_eq!(role(name), Some(Role::Detail), "{name}");
        }
    }

    #[test]
    fn helpers_that_are_never_drawn_are_left_out() {
        for name in [
            "Wall-colonly",
            "a$NAVMESH",
            "b_occonly.001",
            "c-convcolonly",
            "UCX_Wall",
            "IfcSpace/1",
            "IfcSpatialZone/1",
            "IfcOpeningElement/1",
            "d-noimp",
        ] {
            assert_eq!(role(name), None, "{name}");
        }
        assert!(drops_subtree("Group-noimp").is_some());
        assert!(drops_subtree("IfcWall/0-noimp").is_none());
        assert!(drops_subtree("Group-colonly").is_none());
    }

    #[test]
    fn helper_volumes_and_tool_textures_are_left_out_unless_a_rule_keeps_them() {
        let portal = |thickness: Option<f64>| {
            decide_with(&RoleRules::default(), "Portal", |f| {
                f.thickness_if_plain = thickness;
            })
        };
        assert!(matches!(portal(Some(0.1)), RoleVerdict::Mark(_)));
        assert!(matches!(portal(None), RoleVerdict::Keep(..)));
        let skip = decide_with(&RoleRules::default(), "x", |f| {
            f.materials = &["skip", "clip"];
        });
        assert!(matches!(skip, RoleVerdict::Ignore(_)));
        let wall = decide_with(&RoleRules::default(), "x", |f| {
            f.materials = &["skip", "a"];
        });
        assert!(matches!(wall, RoleVerdict::Keep(Role::Structural, _)));
        let rules = RoleRules {
            structural: vec!["Trigger*".into()],
            textures: BTreeMap::from([("skip".to_owned(), TextureMatter::Wall)]),
            ..RoleRules::default()
        };
        let kept = decide_with(&rules, "TriggerVolume", |_| {});
        assert!(matches!(kept, RoleVerdict::Keep(Role::Structural, _)));
        let skip = decide_with(&rules, "x", |f| {
            f.materials = &["skip"];
        });
        assert!(matches!(skip, RoleVerdict::Keep(..)));
    }

    #[test]
    fn the_first_rule_that_fits_decides() {
        let rules = RoleRules {
            structural: vec!["*keep*".into()],
            detail: vec!["Wall*".into(), "Plaster".into()],
            is_manual: false,
            ..RoleRules::default()
        };
        let reason = |verdict| match verdict {
            RoleVerdict::Keep(role, reason) => (role, reason),
            other => panic!("{other:?}"),
        };
        let of = |name: &str| reason(decide_with(&rules, name, |_| {})).0;
        assert_eq!(of("wall KEEP"), Role::Structural);
        assert_eq!(of("wall 1"), Role::Detail);
        assert_eq!(of("by its material"), Role::Detail);
        let file = decide_with(&RoleRules::default(), "Wall", |f| f.is_detail_file = true);
        assert_eq!(reason(file), (Role::Detail, "from a detail file".into()));
        let glass = decide_with(&RoleRules::default(), "Wall", |f| f.is_see_through = true);
        assert_eq!(
            reason(glass),
            (Role::Detail, "material: see-through".into())
        );
        let moves = decide_with(&RoleRules::default(), "Wall", |f| {
            f.moves = Some("animated");
        });
        assert_eq!(reason(moves), (Role::Detail, "moves: animated".into()));
        let group = decide_with(&RoleRules::default(), "x", |f| {
            f.ancestors = &["a", "Chairs"];
        });
        assert_eq!(reason(group).0, Role::Detail);
        let house = decide_with(&RoleRules::default(), "x", |f| {
            f.ancestors = &["House with chairs"];
        });
        assert_eq!(reason(house).0, Role::Structural);
        let manual = RoleRules {
            is_manual: true,
            ..RoleRules::default()
        };
        assert_eq!(
            reason(decide_with(&manual, "Table", |_| {})).0,
            Role::Structural
        );
    }
}

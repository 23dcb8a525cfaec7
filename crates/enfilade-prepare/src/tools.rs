//! Textures that control editors, compilers and games, and what a surface with each is made of: one table per family of
//! games.

use std::collections::BTreeMap;

use crate::glob::is_match;

/// Matter of a surface, by its texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextureMatter {
    /// Bounds rooms, though it may not be drawn.
    Wall,
    /// Nothing: it acts on players, monsters or compilers. One such side makes a brush nothing.
    Air,
    /// Not drawn: nothing if no side of a brush is drawn, else a side of whatever the others are.
    Undrawn,
    /// A liquid: detail, see-through.
    Water,
    /// The sky, which closes the world even as detail.
    Sky,
    /// Nothing: an opening between areas that the designer marks.
    Portal,
    /// Nothing: a plane where the compiler should divide space.
    Hint,
}

/// Names of [`TextureMatter`] in settings.
const MATTERS: [(&str, TextureMatter); 7] = [
    ("wall", TextureMatter::Wall),
    ("air", TextureMatter::Air),
    ("undrawn", TextureMatter::Undrawn),
    ("water", TextureMatter::Water),
    ("sky", TextureMatter::Sky),
    ("portal", TextureMatter::Portal),
    ("hint", TextureMatter::Hint),
];

impl TextureMatter {
    /// Returns the matter of a name in settings.
    ///
    /// # Errors
    /// The known names, if it is none of them.
    #[doc(hidden)]
    pub fn of_name(name: &str) -> Result<Self, String> {
        let found = MATTERS.iter().find(|(known, _)| *known == name);
        found.map(|(_, matter)| *matter).ok_or_else(|| {
            let known: Vec<&str> = MATTERS.iter().map(|(name, _)| *name).collect();
            format!("'{name}' is no matter; one of {}", known.join(", "))
        })
    }

    /// Returns `true` for what bounds nothing and is not drawn.
    #[must_use]
    #[doc(hidden)]
    pub fn is_nothing(self) -> bool {
        matches!(self, Self::Air | Self::Undrawn | Self::Portal | Self::Hint)
    }
}

use TextureMatter::{Air, Hint, Portal, Sky, Undrawn, Wall, Water};

/// A pattern of a texture's name, and what it is made of.
type Pattern = (&'static str, TextureMatter);

/// Source.
const SOURCE: [Pattern; 7] = [
    ("tools/toolsnodraw*", Wall),
    ("tools/toolsblack*", Wall),
    ("tools/toolssky*", Sky),
    ("tools/toolsareaportal*", Portal),
    ("tools/toolshint*", Hint),
    ("tools/toolsskip*", Undrawn),
    ("tools/tools*", Air),
];

/// Doom 3, Quake 4, The Dark Mod.
const DOOM_3: [Pattern; 8] = [
    ("editor/visportal*", Portal),
    ("editor/aas*", Air),
    ("editor/location_separator*", Air),
    ("common/shadow*", Undrawn),
    ("common/collision*", Air),
    ("common/trig*", Air),
    ("common/*_clip*", Air),
    ("portal_sky*", Sky),
];

/// Quake 3 and games on its engine.
const QUAKE_3: [Pattern; 11] = [
    ("common/caulk*", Wall),
    ("common/nodraw*", Undrawn),
    ("common/antiportal", Air),
    ("common/cushion", Air),
    ("common/nodrop", Air),
    ("areaportal", Portal),
    ("clusterportal", Hint),
    ("donotenter", Air),
    ("lightgrid", Air),
    ("liquids/*", Water),
    ("skies/*", Sky),
];

/// Half-Life.
const HALF_LIFE: [Pattern; 10] = [
    ("null", Wall),
    ("aaatrigger", Air),
    ("clipbevel*", Air),
    ("bevel", Air),
    ("boundingbox", Air),
    ("contentempty", Air),
    ("contentsky", Sky),
    ("contentwater", Water),
    ("solidhint", Hint),
    ("!*", Water),
];

/// Quake and Quake 2; a star at the start of their liquids is a letter.
const QUAKE: [Pattern; 3] = [("sky*", Sky), ("\\**", Water), ("#*", Water)];

/// The tags of TrenchBroom for all games.
const TRENCHBROOM: [Pattern; 9] = [
    ("hint", Hint),
    ("hintskip", Air),
    ("skip", Undrawn),
    ("waterskip", Water),
    ("lavaskip", Water),
    ("slimeskip", Water),
    ("trigger", Air),
    ("origin", Air),
    ("*clip", Air),
];

/// All tables, the more special ones first. A pattern with a `/` is compared with the end of a path, any other with its last
/// name. A backslash makes a star a letter. `docs/import.md` repeats them.
const FAMILIES: [&[Pattern]; 6] = [&SOURCE, &DOOM_3, &QUAKE_3, &HALF_LIFE, &QUAKE, &TRENCHBROOM];

/// Returns what a texture says of a surface: by `own` patterns, then by the tables of games; `None` if it says nothing.
#[must_use]
pub fn texture_matter(
    own: &BTreeMap<String, TextureMatter>,
    texture: &str,
) -> Option<TextureMatter> {
    let fits = |glob: &str| is_end(glob, texture);
    let own = own.iter().find(|(glob, _)| fits(glob)).map(|(_, m)| *m);
    own.or_else(|| {
        let mut all = FAMILIES.into_iter().flatten();
        all.find(|(glob, _)| fits(glob)).map(|(_, matter)| *matter)
    })
}

/// Returns `true` if the last names of a path match a pattern, as many as it has.
fn is_end(glob: &str, path: &str) -> bool {
    let n = glob.matches('/').count();
    let start = path.rmatch_indices('/').nth(n).map_or(0, |(at, _)| at + 1);
    let end = &path[start..];
    match glob.strip_prefix("\\*") {
        Some(rest) => end.strip_prefix('*').is_some_and(|end| is_match(rest, end)),
        None => is_match(glob, end),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(texture: &str) -> Option<TextureMatter> {
        texture_matter(&BTreeMap::new(), texture)
    }

    #[test]
    fn each_family_has_its_walls_and_its_air() {
        for (texture, matter) in [
            ("wall", None),
            ("textures/base_wall/a", None),
            ("clipboard", None),
            ("tools_old/wood", None),
            ("e1u1/skip_rope", None),
            ("skip", Some(Undrawn)),
            ("e1u1/TRIGGER", Some(Air)),
            ("e1u1/clip", Some(Air)),
            ("common/weapclip", Some(Air)),
            ("AAATRIGGER", Some(Air)),
            ("null", Some(Wall)),
            ("textures/common/caulk", Some(Wall)),
            ("common/nodraw", Some(Undrawn)),
            ("common/areaportal", Some(Portal)),
            ("textures/editor/visportal", Some(Portal)),
            ("textures/editor/aassolid", Some(Air)),
            ("TOOLS/TOOLSTRIGGER", Some(Air)),
            ("tools/toolsnodraw", Some(Wall)),
            ("tools/toolsskybox2d", Some(Sky)),
            ("sky4", Some(Sky)),
            ("*water0", Some(Water)),
            ("liquids/lava", Some(Water)),
            ("a/liquids/lava", Some(Water)),
            ("!toxic", Some(Water)),
            ("origin", Some(Air)),
            ("hint", Some(Hint)),
        ] {
            assert_eq!(of(texture), matter, "{texture}");
        }
    }

    #[test]
    fn the_page_has_every_pattern() {
        const DOCS: &str = include_str!("../../../docs/import.md");
        for (glob, _) in FAMILIES.into_iter().flatten() {
            let name = format!("`{}`", glob.trim_start_matches('\\'));
            assert!(DOCS.contains(&name), "{name} is not in docs/import.md");
        }
    }

    #[test]
    fn own_patterns_come_first() {
        let own = BTreeMap::from([("null".to_owned(), Air), ("dev/*".to_owned(), Hint)]);
        assert_eq!(texture_matter(&own, "null"), Some(Air));
        assert_eq!(texture_matter(&own, "a/dev/grid"), Some(Hint));
        assert_eq!(texture_matter(&own, "a/grid"), None);
        assert!(
            TextureMatter::of_name("stone")
                .unwrap_err()
                .contains("portal")
        );
        assert_eq!(TextureMatter::of_name("sky"), Ok(Sky));
    }
}

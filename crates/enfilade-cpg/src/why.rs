//! Why a world is as it is: the decisions of a bake, each with its reason and the facts that it read.
//!
//! A decision compares one fact with the number of a rule. How near the two are is its [`Why::margin`]: a decision with a small
//! margin would have come out otherwise in a model that hardly differs.

use std::collections::BTreeMap;
use std::fmt;

use serde::de::IntoDeserializer;
use serde::de::value::Error as ValueError;
use serde::{Deserialize, Deserializer, Serialize};

/// A decision about a cell, a portal or a place: its reason, and the facts behind it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Why {
    /// The decision and its reason.
    pub reason: Reason,
    /// The rule's number, with which [`Reason::fact`] was compared; `None` where nothing was weighed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limit: Option<f32>,
    /// All that was measured, rounded to four digits.
    #[serde(
        default,
        skip_serializing_if = "BTreeMap::is_empty",
        deserialize_with = "known_facts"
    )]
    pub facts: BTreeMap<Fact, f32>,
}

/// A decision and the reason for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
#[non_exhaustive]
pub enum Reason {
    /// Two cells: a leaf or pane shuts the opening between them.
    Shut,
    /// Two cells: the opening is narrower than the space on both sides.
    Narrow,
    /// Two cells: balls that pass the opening are smaller than those on both sides.
    Neck,
    /// Two cells: a corridor or a tube opens to a wider space.
    Mouth,
    /// Two cells: the portal outweighs those that a decimation removed.
    Kept,
    /// Two cells: a plane of the model divides them.
    Plane,
    /// Two cells: a gap of the model, found by the exact cut alone.
    Gap,
    /// Two cells: a lid replaces a missing ceiling, roof or floor.
    Lid,
    /// Two cells: one of them is a void or matter that nothing enters.
    Sealed,
    /// Two cells, though the opening is as wide as the space beside it: what it was weighed for has changed since.
    Unjoined,
    /// Two cells: the border of open land.
    Border,
    /// Two cells: a person asked for the portal.
    Asked,
    /// One cell: the opening is as wide as the space beside it.
    Wide,
    /// One cell: the opening has neither two jambs nor a lintel and a jamb.
    Unframed,
    /// One cell, though an opening parts it: to keep a bound of cost, or as asked for.
    Merged,
    /// A room: people can stand in it.
    Standing,
    /// A room, though low: people can walk into it.
    Entered,
    /// A room of a model that is not on the scale of people, where headroom tells nothing.
    Unscaled,
    /// A void: nobody can stand in it, and no doorway leads into it.
    Low,
    /// The outdoors: air that connects to the border of the scene.
    Outside,
    /// Open land.
    Land,
    /// A room without openings, told from the inside of a solid by the surfaces around it.
    Enclosed,
    /// A room open to the outdoors, whose surfaces face it.
    Facing,
    /// A room open to the outdoors, though the surfaces around it show their backs, as those around the inside of a solid do.
    Turned,
    /// A room: closed shells without openings are all that the scene has.
    Shell,
    /// No cell: the inside of a solid.
    Solid,
    /// No cell: too narrow for a room.
    Crevice,
    /// A part of the outdoors, in doubt: it has a floor, a ceiling and walls on nearly all sides.
    Sheltered,
}

/// A measured quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
#[non_exhaustive]
pub enum Fact {
    /// Area of an opening ÷ that of the space beside it.
    Share,
    /// Radius of the largest ball that passes an opening ÷ that of the smaller of the two largest beside it.
    Balls,
    /// Share of the rim of an opening that is wall.
    Wall,
    /// Share of the lesser jamb of an opening that is there, or of a jamb and its lintel, whichever is more.
    Frame,
    /// Share of an opening that leaves and panes fill.
    Closed,
    /// Area of an opening. [Units: wu²]
    Area,
    /// Length of a corridor ÷ its width.
    Length,
    /// Share of a space's floor on which somebody can stand.
    Standing,
    /// Area of a space's floor. [Units: wu²]
    Floor,
    /// Height of the highest doorway into a space. [Units: wu]
    Doorway,
    /// Share of the rays from a space that meet the backs of surfaces.
    Backs,
    /// Evidence that a space is the inside of a solid, by what rays from it meet: above 1, it is.
    Inside,
    /// Share of the rays from a space that meet a second surface right behind the first, as at a wall.
    Walled,
    /// Share of the level ways out of a closed space, through its sheets, that lead to another space than most do.
    Between,
    /// Share of the level rays from a space that meet something.
    Shelter,
    /// Radius of the largest ball in a space. [Units: wu]
    Radius,
    /// Volume of a space. [Units: wu³]
    Volume,
}

/// A place, neither a cell nor a portal, and a decision about it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DecidedPlace {
    /// A point of it. [Units: wu]
    pub at: [f32; 3],
    /// The decision.
    pub why: Why,
}

impl Why {
    /// Makes a decision for which nothing was weighed.
    #[must_use]
    #[doc(hidden)]
    pub fn given(reason: Reason) -> Self {
        Self {
            reason,
            limit: None,
            facts: BTreeMap::new(),
        }
    }

    /// Makes a decision by comparing the fact of a reason with a limit.
    #[must_use]
    #[doc(hidden)]
    pub fn compared(reason: Reason, limit: f64, facts: &[(Fact, f64)]) -> Self {
        Self {
            limit: Some(rounded(limit)),
            ..Self::given(reason).with(facts)
        }
    }

    /// Adds facts.
    #[must_use]
    #[doc(hidden)]
    pub fn with(mut self, facts: &[(Fact, f64)]) -> Self {
        let known = facts.iter().filter(|(_, value)| value.is_finite());
        self.facts
            .extend(known.map(|&(fact, v)| (fact, rounded(v))));
        self
    }

    /// Returns the fact that decided, and the number with which it was compared.
    #[must_use]
    pub fn comparison(&self) -> Option<(Fact, f32, f32)> {
        let fact = self.reason.fact()?;
        Some((fact, *self.facts.get(&fact)?, self.limit?))
    }

    /// Returns how far the deciding fact is from its limit: 0 at the limit, 1 far from it and where nothing was weighed. Below the
    /// limit, a share of the limit; above it, a share of what is left up to 1 if the fact is a share, else of the fact.
    #[must_use]
    pub fn margin(&self) -> f32 {
        if matches!(
            self.reason,
            Reason::Unjoined | Reason::Turned | Reason::Sheltered
        ) {
            return 0.0;
        }
        self.comparison().map_or(1.0, |(fact, value, limit)| {
            let most = match self.reason.side() {
                Side::Below => limit,
                Side::Above if fact.is_share() && limit < 1.0 => 1.0 - limit,
                Side::Above => value,
            };
            ((value - limit).abs() / most.max(f32::MIN_POSITIVE)).min(1.0)
        })
    }

    /// Returns `true` if the deciding fact is on the side of its limit that the reason says.
    #[must_use]
    #[doc(hidden)]
    pub fn holds(&self) -> bool {
        self.comparison().is_none_or(|(_, value, limit)| {
            // Both are rounded.
            let off = 1e-3 * limit.abs().max(value.abs());
            match self.reason.side() {
                Side::Below => value <= limit + off,
                Side::Above => value >= limit - off,
            }
        })
    }
}

/// Reads the facts that this version knows; others may have added more.
fn known_facts<'de, D: Deserializer<'de>>(from: D) -> Result<BTreeMap<Fact, f32>, D::Error> {
    let all = BTreeMap::<String, serde_json::Value>::deserialize(from)?;
    let known = all.into_iter().filter_map(|(name, value)| {
        let fact = Fact::deserialize(name.into_deserializer()).map_err(|_: ValueError| ());
        Some((fact.ok()?, value.as_f64()? as f32))
    });
    Ok(known.collect())
}

/// Rounds to four significant digits, so that files stay short.
fn rounded(value: f64) -> f32 {
    if value == 0.0 {
        return 0.0;
    }
    // Not by powers and logarithms: their last bit depends on the system.
    let text = format!("{value:e}");
    let exponent = text.split_once('e').and_then(|(_, e)| e.parse().ok());
    let exponent: i32 = exponent.unwrap_or_default();
    let unit: f64 = format!("1e{}", exponent - 3).parse().unwrap_or(1.0);
    ((value / unit).round() * unit) as f32
}

/// Side of its limit on which a fact lies.
enum Side {
    Below,
    Above,
}

impl Reason {
    /// Returns the fact that a decision for this reason compares with a number; `None` if it weighs nothing.
    #[must_use]
    #[doc(hidden)]
    pub fn fact(self) -> Option<Fact> {
        match self {
            Self::Shut => Some(Fact::Closed),
            Self::Narrow | Self::Wide | Self::Unjoined => Some(Fact::Share),
            Self::Neck => Some(Fact::Balls),
            Self::Mouth => Some(Fact::Length),
            Self::Unframed => Some(Fact::Frame),
            Self::Standing | Self::Low => Some(Fact::Standing),
            Self::Entered => Some(Fact::Doorway),
            Self::Enclosed | Self::Solid => Some(Fact::Inside),
            Self::Facing | Self::Turned => Some(Fact::Backs),
            Self::Crevice => Some(Fact::Radius),
            Self::Sheltered => Some(Fact::Shelter),
            Self::Plane
            | Self::Gap
            | Self::Kept
            | Self::Lid
            | Self::Merged
            | Self::Sealed
            | Self::Border
            | Self::Asked
            | Self::Unscaled
            | Self::Shell
            | Self::Outside
            | Self::Land => None,
        }
    }

    fn side(self) -> Side {
        match self {
            Self::Narrow
            | Self::Neck
            | Self::Unframed
            | Self::Low
            | Self::Enclosed
            | Self::Facing
            | Self::Crevice => Side::Below,
            _ => Side::Above,
        }
    }

    /// Returns the name that files and tables use.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Shut => "shut",
            Self::Narrow => "narrow",
            Self::Neck => "neck",
            Self::Mouth => "mouth",
            Self::Kept => "kept",
            Self::Plane => "plane",
            Self::Gap => "gap",
            Self::Lid => "lid",
            Self::Sealed => "sealed",
            Self::Unjoined => "unjoined",
            Self::Border => "border",
            Self::Asked => "asked",
            Self::Wide => "wide",
            Self::Unframed => "unframed",
            Self::Merged => "merged",
            Self::Standing => "standing",
            Self::Entered => "entered",
            Self::Unscaled => "unscaled",
            Self::Low => "low",
            Self::Outside => "outside",
            Self::Land => "land",
            Self::Enclosed => "enclosed",
            Self::Facing => "facing",
            Self::Turned => "turned",
            Self::Shell => "shell",
            Self::Solid => "solid",
            Self::Crevice => "crevice",
            Self::Sheltered => "sheltered",
        }
    }

    /// Returns the decision in words.
    fn words(self) -> &'static str {
        match self {
            Self::Shut => "two cells: a leaf or pane shuts the opening",
            Self::Narrow => "two cells: the opening is narrower than the space on both sides",
            Self::Neck => "two cells: balls that pass are smaller than those on both sides",
            Self::Mouth => "two cells: a corridor or tube opens to a wider space",
            Self::Kept => "two cells: the portal outweighs those that were removed",
            Self::Plane => "two cells: a plane of the model divides them",
            Self::Gap => {
                "two cells: a gap of the model, found by the exact cut; nothing weighed it"
            }
            Self::Lid => "two cells: a lid replaces a missing ceiling, roof or floor",
            Self::Sealed => "two cells: one of them is no room",
            Self::Unjoined => "two cells, in doubt: the opening is as wide as the space beside it",
            Self::Border => "two cells: the border of open land",
            Self::Asked => "two cells: as asked for",
            Self::Wide => "one cell: the opening is as wide as the space beside it",
            Self::Unframed => "one cell: the opening has neither two jambs nor a lintel and a jamb",
            Self::Merged => {
                "one cell, though an opening parts it: to keep a bound of cost, or as asked for"
            }
            Self::Standing => "a room: people can stand in it",
            Self::Entered => "a room: low, but people can walk into it",
            Self::Unscaled => {
                "a room: the model is not on the scale of people, so headroom tells nothing"
            }
            Self::Low => "a void: nobody can stand in it, and no doorway leads into it",
            Self::Outside => "the outdoors: air that connects to the border of the scene",
            Self::Land => "open land",
            Self::Facing => "a room: open to the outdoors, and the surfaces around it face it",
            Self::Turned => {
                "a room, in doubt: open to the outdoors, but the surfaces around it show their backs"
            }
            Self::Enclosed => "a room: closed on all sides, and the surfaces around it face inward",
            Self::Shell => "a room: closed shells without openings are the whole scene",
            Self::Solid => "no cell: the inside of a solid, by the backs of the surfaces around it",
            Self::Crevice => "no cell: too narrow for a room",
            Self::Sheltered => {
                "outdoors, in doubt: a space with a floor, a ceiling and walls on nearly all sides"
            }
        }
    }
}

impl Fact {
    /// Returns `true` if it is a share of something, 1 at most or hardly more.
    fn is_share(self) -> bool {
        matches!(
            self,
            Self::Share
                | Self::Wall
                | Self::Frame
                | Self::Closed
                | Self::Standing
                | Self::Backs
                | Self::Walled
                | Self::Between
        )
    }

    /// Returns the name that files and tables use.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Share => "share",
            Self::Balls => "balls",
            Self::Wall => "wall",
            Self::Frame => "frame",
            Self::Closed => "closed",
            Self::Area => "area",
            Self::Length => "length",
            Self::Standing => "standing",
            Self::Floor => "floor",
            Self::Doorway => "doorway",
            Self::Backs => "backs",
            Self::Inside => "inside",
            Self::Walled => "walled",
            Self::Between => "between",
            Self::Shelter => "shelter",
            Self::Radius => "radius",
            Self::Volume => "volume",
        }
    }

    /// Returns the quantity in words, and its unit.
    #[must_use]
    #[doc(hidden)]
    pub fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Share => ("share of the space beside it that is open", ""),
            Self::Balls => ("radius that passes, as a share of that beside it", ""),
            Self::Wall => ("share of its rim that is wall", ""),
            Self::Frame => (
                "share of both jambs, or of a jamb and its lintel, that is there",
                "",
            ),
            Self::Closed => ("share that leaves and panes fill", ""),
            Self::Area => ("area", " m²"),
            Self::Length => ("length of the corridor in widths", ""),
            Self::Standing => ("share of the floor to stand on", ""),
            Self::Floor => ("floor", " m²"),
            Self::Doorway => ("highest doorway", " m"),
            Self::Backs => ("share of rays that meet backs", ""),
            Self::Inside => ("evidence for the inside of a solid", ""),
            Self::Walled => ("share of rays that meet a wall of two faces", ""),
            Self::Between => (
                "share of the ways out through its sheets that lead elsewhere than most",
                "",
            ),
            Self::Shelter => ("share of level rays that meet something", ""),
            Self::Radius => ("largest ball", " m"),
            Self::Volume => ("volume", " m³"),
        }
    }
}

/// Writes the decision, what was compared, and all other facts; with `{:#}` not the latter.
impl fmt::Display for Why {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.reason.words())?;
        let decided = self.comparison();
        if let Some((fact, value, limit)) = decided {
            let (words, unit) = fact.words();
            let side = match self.reason.side() {
                Side::Below => "under",
                Side::Above => "from",
            };
            write!(
                f,
                " ({words} {value}{unit}, {side} {limit}{unit}; margin {:.2})",
                self.margin()
            )?;
        }
        if f.alternate() {
            return Ok(());
        }
        let decided = decided.map(|d| d.0);
        let mut is_first = true;
        for (&fact, value) in self
            .facts
            .iter()
            .filter(|(fact, _)| Some(**fact) != decided)
        {
            let (words, unit) = fact.words();
            f.write_str(if is_first { "; " } else { ", " })?;
            write!(f, "{words} {value}{unit}")?;
            is_first = false;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_margin_is_small_near_the_limit_and_one_where_nothing_was_weighed() {
        let margin = |share| Why::compared(Reason::Narrow, 0.7, &[(Fact::Share, share)]).margin();
        assert!(margin(0.35) > 0.49 && margin(0.69) < 0.02 && margin(0.0) > 0.99);
        assert!((Why::given(Reason::Outside).margin() - 1.0).abs() < 1e-6);
        assert!(Why::compared(Reason::Unjoined, 0.7, &[(Fact::Share, 1.0)]).margin() < 1e-6);
    }

    #[test]
    fn a_fact_on_the_wrong_side_of_its_limit_does_not_hold() {
        let narrow = |share| Why::compared(Reason::Narrow, 0.7, &[(Fact::Share, share)]).holds();
        assert!(narrow(0.5) && !narrow(0.8));
        let wide = |share| Why::compared(Reason::Wide, 0.7, &[(Fact::Share, share)]).holds();
        assert!(wide(0.8) && !wide(0.5));
    }

    #[test]
    fn words_name_the_decision_the_fact_and_the_limit() {
        let facts = [(Fact::Share, 0.851_23), (Fact::Area, 2.0)];
        let said = Why::compared(Reason::Wide, 0.7, &facts).to_string();
        for part in ["one cell", "0.8512", "from 0.7", "area 2 m²", "margin 0.50"] {
            assert!(said.contains(part), "{said}");
        }
        let short = format!("{:#}", Why::compared(Reason::Wide, 0.7, &facts));
        assert!(
            said.starts_with(&short) && !short.contains("area"),
            "{short}"
        );
    }

    #[test]
    fn numbers_have_four_digits() {
        assert_eq!(
            [0.0, 0.123_456, 1234.56, -98_765.4].map(rounded),
            [0.0, 0.1235, 1235.0, -98_770.0]
        );
    }

    #[test]
    fn names_are_those_in_files() {
        let text = serde_json::to_string(&Reason::Unframed).unwrap();
        assert_eq!(text, format!("\"{}\"", Reason::Unframed.name()));
        let text = serde_json::to_string(&Fact::Doorway).unwrap();
        assert_eq!(text, format!("\"{}\"", Fact::Doorway.name()));
    }
}

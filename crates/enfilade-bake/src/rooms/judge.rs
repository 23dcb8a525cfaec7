//! The rule: which openings part rooms, by their measurements. Nothing here reads the model.

use super::sections::OpeningSection;
use crate::MergeSettings;

/// Measurements of an opening between two cells, besides its [`OpeningSection`].
#[derive(Clone, Copy, Debug)]
pub(super) struct OpeningFacts {
    /// It lies in a slab, and storeys are merged apart.
    pub(super) is_between_storeys: bool,
    /// Share that door leaves and panes fill.
    pub(super) closed: f64,
    /// One of the two cells is the outdoors.
    pub(super) is_to_outdoors: bool,
    /// Openness by the balls that pass and those beside: an upper bound.
    pub(super) by_balls: f64,
}

/// Reasons for which an opening parts rooms or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OpeningKind {
    /// A storey ends in it.
    Slab,
    /// A leaf or a pane closes it.
    Shut,
    /// Narrower than the space on both sides, in a wall or across it: a doorway.
    Pinch,
    /// Hardly narrower than the space on one side.
    Wide,
    /// Without a lintel or two jambs: a bend, an alcove, an arm of a room.
    Unframed,
}

/// Decides on an opening: why, and its openness, from 1 on of one room. `section` measures it, if that matters.
pub(super) fn judge(
    settings: &MergeSettings,
    facts: &OpeningFacts,
    section: impl FnOnce() -> OpeningSection,
) -> (OpeningKind, f64) {
    if facts.is_between_storeys {
        return (OpeningKind::Slab, 0.0);
    }
    if facts.closed >= settings.closed_share {
        return (OpeningKind::Shut, 0.0);
    }
    let OpeningSection {
        ratio,
        wall,
        is_framed,
    } = section();
    let gain = if facts.is_to_outdoors {
        settings.outdoor_gain
    } else {
        1.0
    };
    let openness = settings.openness(ratio * gain, wall).min(facts.by_balls);
    if openness >= 1.0 {
        (OpeningKind::Wide, openness)
    } else if is_framed || facts.is_to_outdoors {
        (OpeningKind::Pinch, openness)
    } else {
        (OpeningKind::Unframed, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Change = fn(&mut OpeningFacts, &mut OpeningSection);

    // Covers V12.
    #[test]
    fn each_rule_for_openings_has_a_case_on_either_side() {
        use OpeningKind::{Pinch, Shut, Slab, Unframed, Wide};
        let rows: &[(&str, Change, OpeningKind)] = &[
            ("a doorway", |_, _| {}, Pinch),
            ("a stair hole", |f, _| f.is_between_storeys = true, Slab),
            (
                "a wide stair hole",
                |f, s| (f.is_between_storeys, s.ratio) = (true, 1.0),
                Slab,
            ),
            (
                "a closet as deep as its door is wide",
                |f, s| (f.closed, s.ratio) = (0.6, 1.0),
                Shut,
            ),
            ("a leaf ajar", |f, s| (f.closed, s.ratio) = (0.5, 1.0), Wide),
            ("two thirds", |_, s| s.ratio = 0.65, Pinch),
            ("three quarters", |_, s| s.ratio = 0.75, Wide),
            (
                "three quarters, in a wall",
                |_, s| (s.ratio, s.wall) = (0.75, 0.3),
                Pinch,
            ),
            (
                "nine tenths, in a wall",
                |_, s| (s.ratio, s.wall) = (0.92, 0.3),
                Wide,
            ),
            (
                "a neck that balls show",
                |f, s| (f.by_balls, s.ratio) = (0.9, 1.0),
                Pinch,
            ),
            ("a niche", |_, s| s.is_framed = false, Unframed),
            (
                "a niche outdoors",
                |f, s| (f.is_to_outdoors, s.is_framed) = (true, false),
                Pinch,
            ),
            (
                "a porch",
                |f, s| (f.is_to_outdoors, s.ratio) = (true, 0.85),
                Pinch,
            ),
            (
                "open to the garden",
                |f, s| (f.is_to_outdoors, s.ratio) = (true, 0.9),
                Wide,
            ),
        ];
        for (what, change, expected) in rows {
            let mut facts = OpeningFacts {
                is_between_storeys: false,
                closed: 0.0,
                is_to_outdoors: false,
                by_balls: 1.6,
            };
            let mut section = OpeningSection {
                ratio: 0.3,
                wall: 0.0,
                is_framed: true,
            };
            change(&mut facts, &mut section);
            let (kind, openness) = judge(&MergeSettings::default(), &facts, || section);
            assert_eq!(kind, *expected, "{what}");
            assert_eq!(openness >= 1.0, matches!(kind, Wide | Unframed), "{what}");
        }
    }
}

//! The rule for openings: which ones part rooms.

use enfilade_cpg::{Fact, Reason, Why};

use crate::MergeSettings;

/// Measurements of an opening between two cells, besides its [`OpeningSection`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct OpeningFacts {
    /// It lies in a slab, and storeys are merged apart.
    pub(crate) is_between_storeys: bool,
    /// Share that door leaves and panes fill.
    pub(crate) closed: f64,
    /// One of the two cells is the outdoors.
    pub(crate) is_to_outdoors: bool,
    /// Radius of the largest ball that passes ÷ that of the smaller of the two largest beside it; infinite if unknown.
    pub(crate) balls: f64,
}

/// Measures of an opening and the space beside it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OpeningSection {
    /// Area of the opening ÷ the smaller of the largest cross-sections of its two cells, up to the height of its head. Below the threshold of the
    /// settings, the first sections found to be large enough are taken.
    pub(crate) ratio: f64,
    /// Share of the rim that is wall. 0 below the threshold.
    pub(crate) wall: f64,
    /// Share of the lesser of its two jambs that is there, or of its lintel and a jamb; 1 where it is not upright or leaves hang in it.
    pub(crate) frame: f64,
}

/// Reasons for which an opening parts rooms or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OpeningKind {
    /// A storey ends in it.
    Slab,
    /// A leaf or a pane closes it.
    Shut,
    /// Narrower than the space on both sides, in a wall or across it: a doorway.
    Narrow,
    /// Smaller balls pass it than fit on both sides.
    Neck,
    /// Hardly narrower than the space on one side.
    Wide,
    /// Without two jambs, or a jamb and a lintel: a bend, an alcove, an arm of a room, a room below a beam.
    Unframed,
}

/// A decision on an opening.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OpeningVerdict {
    pub(crate) kind: OpeningKind,
    /// From 1 on, the two cells are one room.
    pub(crate) openness: f64,
    facts: OpeningFacts,
    section: Option<OpeningSection>,
}

impl MergeSettings {
    /// Returns the share of the space beside it from which an opening parts nothing; `wall` is the share of its rim that is wall.
    fn most_share(&self, wall: f64) -> f64 {
        let wall = (wall / self.wall_rim).min(1.0);
        self.threshold + (self.wall_threshold - self.threshold) * wall
    }

    /// Returns the weight of an opening, which is less to the outdoors.
    fn gain(&self, is_to_outdoors: bool) -> f64 {
        if is_to_outdoors {
            self.outdoor_gain
        } else {
            1.0
        }
    }

    /// Returns the openness of an opening by [`OpeningFacts::balls`] alone: an upper bound.
    pub(crate) fn by_balls(&self, balls: f64, is_to_outdoors: bool) -> f64 {
        self.radius_gain * balls * self.gain(is_to_outdoors) / self.threshold
    }
}

/// Decides on an opening. `section` measures it, if that matters.
pub(crate) fn judge(
    settings: &MergeSettings,
    facts: OpeningFacts,
    section: impl FnOnce() -> OpeningSection,
) -> OpeningVerdict {
    let verdict = |kind, openness, section| OpeningVerdict {
        kind,
        openness,
        facts,
        section,
    };
    if facts.is_between_storeys {
        return verdict(OpeningKind::Slab, 0.0, None);
    }
    if facts.closed >= settings.closed_share {
        return verdict(OpeningKind::Shut, 0.0, None);
    }
    let by_balls = settings.by_balls(facts.balls, facts.is_to_outdoors);
    if by_balls < 1.0 {
        return verdict(OpeningKind::Neck, by_balls, None);
    }
    let section = section();
    let openness =
        section.ratio * settings.gain(facts.is_to_outdoors) / settings.most_share(section.wall);
    let (kind, openness) = if openness >= 1.0 {
        (OpeningKind::Wide, openness.min(by_balls))
    } else if section.frame >= FRAMED || facts.is_to_outdoors {
        (OpeningKind::Narrow, openness)
    } else {
        (OpeningKind::Unframed, 1.0)
    };
    verdict(kind, openness, Some(section))
}

/// Returns why an opening parts two cells: of the reasons that each do alone, the one with the greatest margin; `None` if it parts
/// nothing by itself.
pub(crate) fn why_parted(
    settings: &MergeSettings,
    facts: OpeningFacts,
    section: OpeningSection,
) -> Option<Why> {
    let verdict = |kind| OpeningVerdict {
        kind,
        openness: 0.0,
        facts,
        section: Some(section),
    };
    let openness =
        section.ratio * settings.gain(facts.is_to_outdoors) / settings.most_share(section.wall);
    let is_framed = section.frame >= FRAMED || facts.is_to_outdoors;
    let kinds = [
        (OpeningKind::Shut, facts.closed >= settings.closed_share),
        (OpeningKind::Narrow, openness < 1.0 && is_framed),
        (
            OpeningKind::Neck,
            settings.by_balls(facts.balls, facts.is_to_outdoors) < 1.0,
        ),
    ];
    let whys = kinds
        .into_iter()
        .filter(|k| k.1)
        .map(|(kind, _)| verdict(kind).why(settings, true));
    // The first of equals.
    whys.rev().max_by(|a, b| a.margin().total_cmp(&b.margin()))
}

/// Returns the doubt that two cells are apart though their opening parts nothing by itself.
pub(crate) fn why_unjoined(
    settings: &MergeSettings,
    facts: OpeningFacts,
    section: OpeningSection,
) -> Why {
    let verdict = judge(settings, facts, || section);
    verdict.why(settings, true)
}

impl OpeningVerdict {
    /// Returns the verdict with its facts, as a world tells it. A portal `is_parting` two cells, whatever the verdict.
    pub(crate) fn why(&self, settings: &MergeSettings, is_parting: bool) -> Why {
        let mut known = vec![(Fact::Closed, self.facts.closed)];
        known.push((Fact::Balls, self.facts.balls));
        let gain = settings.gain(self.facts.is_to_outdoors);
        let mut limit = None;
        if let Some(section) = self.section {
            known.push((Fact::Share, section.ratio));
            known.push((Fact::Wall, section.wall));
            known.push((Fact::Frame, section.frame));
            limit = Some(settings.most_share(section.wall) / gain);
        }
        let (reason, limit) = match self.kind {
            OpeningKind::Slab => (Reason::Plane, None),
            OpeningKind::Shut => (Reason::Shut, Some(settings.closed_share)),
            OpeningKind::Neck => {
                let most = settings.threshold / (settings.radius_gain * gain);
                (Reason::Neck, Some(most))
            }
            OpeningKind::Narrow => (Reason::Narrow, limit),
            OpeningKind::Wide if is_parting => (Reason::Unjoined, limit),
            // Its frame was weighed, not the share that the reason compares.
            OpeningKind::Unframed if is_parting => (Reason::Unjoined, None),
            OpeningKind::Wide => (Reason::Wide, limit),
            OpeningKind::Unframed => (Reason::Unframed, Some(FRAMED)),
        };
        match limit {
            Some(limit) => Why::compared(reason, limit, &known),
            None => Why::given(reason).with(&known),
        }
    }
}

/// Least share of one side of an opening's rim at which the space beside it must reach farther, for a lintel or jamb to be there.
pub(crate) const FRAMED: f64 = 0.5;

#[cfg(test)]
mod tests {
    use super::*;

    type Change = fn(&mut OpeningFacts, &mut OpeningSection);

    // Covers V12.
    #[test]
    fn each_rule_for_openings_has_a_case_on_either_side() {
        use OpeningKind::{Narrow, Neck, Shut, Slab, Unframed, Wide};
        let rows: &[(&str, Change, OpeningKind)] = &[
            ("a doorway", |_, _| {}, Narrow),
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
            ("two thirds", |_, s| s.ratio = 0.65, Narrow),
            ("three quarters", |_, s| s.ratio = 0.75, Wide),
            (
                "less than four fifths, in a wall",
                |_, s| (s.ratio, s.wall) = (0.78, 0.3),
                Narrow,
            ),
            (
                "more than four fifths, in a wall",
                |_, s| (s.ratio, s.wall) = (0.82, 0.3),
                Wide,
            ),
            (
                "a neck that balls show",
                |f, s| (f.balls, s.ratio) = (0.5, 1.0),
                Neck,
            ),
            ("a niche", |_, s| s.frame = 0.4, Unframed),
            (
                "a niche outdoors",
                |f, s| (f.is_to_outdoors, s.frame) = (true, 0.4),
                Narrow,
            ),
            (
                "a porch",
                |f, s| (f.is_to_outdoors, s.ratio) = (true, 0.85),
                Narrow,
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
                balls: 1.0,
            };
            let mut section = OpeningSection {
                ratio: 0.3,
                wall: 0.0,
                frame: 1.0,
            };
            change(&mut facts, &mut section);
            let settings = MergeSettings::default();
            let verdict = judge(&settings, facts, || section);
            assert_eq!(verdict.kind, *expected, "{what}");
            let is_one = matches!(verdict.kind, Wide | Unframed);
            assert_eq!(verdict.openness >= 1.0, is_one, "{what}");
            for is_parting in [!is_one, true] {
                assert!(verdict.why(&settings, is_parting).holds(), "{what}");
            }
        }
    }
}

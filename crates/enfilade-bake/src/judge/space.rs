//! The rules for spaces: room or void, room or matter.

use enfilade_cpg::{Fact, Reason, Why};

/// A space with a smaller share of its floor to stand on is a void: a pocket between beams makes no room of it.
const LEAST_SHARE: f64 = 0.05;
/// Least height of a doorway, to be entered bent over. [Units: wu]
pub(crate) const DOORWAY: f64 = 1.2;

/// Measures of a space that tell if people can be in it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SpaceFacts {
    /// Area of its floor. [Units: wu²]
    pub(crate) floor: f64,
    /// The part of it on which somebody can stand. [Units: wu²]
    pub(crate) standing: f64,
    /// Height of the highest doorway into it from a space that is not a void, 0 without any. [Units: wu]
    pub(crate) doorway: f64,
}

impl SpaceFacts {
    /// Returns the measures of two parts of a space together.
    pub(crate) fn and(self, other: &Self) -> Self {
        Self {
            floor: self.floor + other.floor,
            standing: self.standing + other.standing,
            doorway: self.doorway.max(other.doorway),
        }
    }

    /// Returns `true` if nobody can stand in it.
    pub(crate) fn is_low(&self) -> bool {
        self.standing <= LEAST_SHARE * self.floor
    }

    pub(crate) fn is_void(&self) -> bool {
        self.is_low() && self.doorway < DOORWAY
    }

    /// Returns why it is a room or a void.
    pub(crate) fn why(&self) -> Why {
        let facts = [
            (Fact::Floor, self.floor),
            (
                Fact::Standing,
                self.standing / self.floor.max(f64::MIN_POSITIVE),
            ),
            (Fact::Doorway, self.doorway),
        ];
        if !self.is_low() {
            Why::compared(Reason::Standing, LEAST_SHARE, &facts)
        } else if self.is_void() {
            Why::compared(Reason::Low, LEAST_SHARE, &facts)
        } else {
            Why::compared(Reason::Entered, DOORWAY, &facts)
        }
    }
}

/// Least share of the rays from inside matter that leave it: all but those that slip through a crack or
/// along an edge.
const LEAVING: f64 = 0.9;
/// Inside matter, more than this share of the rays that hit anything hit a back face first.
pub(crate) const BACKS: f64 = 0.6;
/// Surfaces are trusted if known air sees at most this share of backs, and turned if it sees at
/// most this share of fronts: half the share seen of randomly oriented surfaces.
const ASTRAY: f64 = 0.25;
/// Least share of rays that meet a wall of two faces, not a single sheet, from a room among surfaces that face anyhow.
const WALLED: f64 = 0.5;
/// Least share of the level ways out of a closed room among surfaces that face anyhow, through its sheets, that lead to another
/// space than most do. All around a thing that stands in a hall is the hall. Higher, and suites beside one corridor are solid
/// (bristol-house); lower, and a column that touches a second room is a room.
pub(crate) const BETWEEN: f64 = 0.1;
/// A space that fits no ball of this radius is matter if most rays hit back faces and faces can be trusted, or are all that is known:
/// it is thinner than a person. [Units: wu]
pub(crate) const NARROW: f64 = 0.5;

/// Least share of level rays that meet something in a room: one of eight may leave by its door.
pub(crate) const LEAST_SHELTER: f64 = 0.875;

/// The facing of the surfaces of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Facing {
    /// Away from matter.
    Outward,
    /// Into matter.
    Inward,
    /// Inconsistent.
    Anyhow,
}

/// Shares of the rays from a closed space, by the surfaces that they meet; 0 where none meet anything.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct EnclosedFacts {
    /// Radius of the largest ball in it. [Units: wu]
    pub(crate) radius: f64,
    /// Rays that meet a back first, of all.
    pub(crate) backs: f64,
    /// … and a second surface right behind the first.
    pub(crate) walled: f64,
    /// Rays that meet a back first, of those that do not go down.
    pub(crate) backs_aside: f64,
    /// … and leave one solid more than they enter, if surfaces face outward, and if inward.
    pub(crate) leaving: [f64; 2],
    /// Level ways out through its sheets that lead to another space than most do, of those that lead to air.
    pub(crate) between: f64,
}

impl Facing {
    /// Decides by the backs that known air meets: indoors if any of it is open to the outdoors, else outdoors. Sheets
    /// modelled from inside show the outdoors nothing but backs.
    pub(crate) fn of(indoors: Option<f64>, outdoors: f64) -> Self {
        match indoors {
            Some(backs) if backs <= ASTRAY => Self::Outward,
            Some(backs) if backs >= 1.0 - ASTRAY => Self::Inward,
            None if outdoors <= ASTRAY => Self::Outward,
            _ => Self::Anyhow,
        }
    }
}

/// Returns `true` if a closed-off space of which no more is known than its size and the share of `backs` seen from it is too narrow
/// for a room. `widest` is the radius of the largest ball that fits, `min_radius` that of the smallest room.
pub(crate) fn is_crevice(widest: f64, min_radius: f64, backs: f64) -> bool {
    widest < min_radius || backs > BACKS && widest < NARROW
}

/// Returns `true` if a space is the inside of a piece of wall, with an end or without: surfaces `facing` outward turn their backs to
/// it, and it is thinner than a person.
pub(crate) fn is_hollow_piece(facing: Facing, widest: f64, backs: f64) -> bool {
    facing == Facing::Outward && backs > BACKS && widest < NARROW
}

/// Returns why a space that is open to the outdoors is a room, given the share of rays from it that meet backs: air in any case, but in
/// doubt if it looks like the inside of a solid.
pub(crate) fn why_open(backs: f64) -> Why {
    let reason = if backs > BACKS {
        Reason::Turned
    } else {
        Reason::Facing
    };
    Why::compared(reason, BACKS, &[(Fact::Backs, backs)])
}

impl EnclosedFacts {
    /// Returns the evidence that a closed space is the inside of a solid; above 1, it is.
    fn evidence(&self, facing: Facing) -> f64 {
        let of = |leaving: f64, backs: f64| (leaving / LEAVING).min(backs / BACKS);
        match facing {
            Facing::Outward => of(self.leaving[0], self.backs_aside),
            // A ray that meets nothing shows no front.
            Facing::Inward if self.leaving[1] == 0.0 => 0.0,
            Facing::Inward => of(self.leaving[1], 1.0 - self.backs_aside),
            Facing::Anyhow => (self.backs / ASTRAY)
                .min((1.0 - self.walled) / (1.0 - WALLED))
                .min(BETWEEN / self.between),
        }
    }

    /// Decides if a closed space is a room, and why. A shaft among sheets that face anyhow is one, if a person fits into it and it lies
    /// between others.
    pub(crate) fn why(&self, facing: Facing, min_radius: f64) -> Why {
        let inside = self.evidence(facing);
        let facts = [
            (Fact::Radius, self.radius),
            (Fact::Backs, self.backs),
            (Fact::Walled, self.walled),
            (Fact::Between, self.between),
            (Fact::Inside, inside),
        ];
        let least = if is_hollow_piece(facing, self.radius, self.backs) {
            NARROW.max(min_radius)
        } else {
            min_radius
        };
        if self.radius < least {
            Why::compared(Reason::Crevice, least, &facts)
        } else if inside > 1.0 {
            Why::compared(Reason::Solid, 1.0, &facts)
        } else {
            Why::compared(Reason::Enclosed, 1.0, &facts)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Covers V9.
    #[test]
    fn a_void_has_nowhere_to_stand_and_no_doorway() {
        let facts = |floor, standing, doorway| SpaceFacts {
            floor,
            standing,
            doorway,
        };
        for (what, facts, is_void) in [
            ("room", facts(20.0, 19.0, 2.1), false),
            ("closed shaft", facts(4.0, 4.0, 0.0), false),
            ("attic high at its ridge", facts(40.0, 5.0, 0.8), false),
            ("cellar with a door", facts(20.0, 0.0, 1.6), false),
            ("space above a ceiling", facts(200.0, 0.0, 0.0), true),
            ("the same, with a pocket", facts(200.0, 2.0, 0.0), true),
            ("crawl space with a hatch", facts(20.0, 0.0, 0.6), true),
            ("hollow wall", facts(0.5, 0.0, 0.0), true),
        ] {
            assert_eq!(facts.is_void(), is_void, "{what}");
            let why = facts.why();
            assert_eq!(why.reason == Reason::Low, is_void, "{what}");
            assert!(why.holds(), "{what}: {why}");
        }
    }

    #[test]
    fn each_rule_for_closed_spaces_has_a_case_on_either_side() {
        let room = EnclosedFacts {
            radius: 1.2,
            backs: 0.0,
            walled: 0.9,
            backs_aside: 0.0,
            leaving: [0.0; 2],
            between: 0.0,
        };
        let inside = EnclosedFacts {
            radius: 1.2,
            backs: 1.0,
            walled: 0.1,
            backs_aside: 1.0,
            leaving: [1.0, 0.0],
            between: 0.0,
        };
        use Facing::{Anyhow, Inward, Outward};
        let turned = EnclosedFacts {
            leaving: [0.0, 1.0],
            backs_aside: 0.0,
            ..room
        };
        for (what, facing, facts, reason) in [
            ("a sealed room", Outward, room, Reason::Enclosed),
            ("a block", Outward, inside, Reason::Solid),
            (
                "a block with a gap",
                Outward,
                EnclosedFacts {
                    leaving: [0.85, 0.0],
                    ..inside
                },
                Reason::Enclosed,
            ),
            (
                "half its surfaces turned",
                Outward,
                EnclosedFacts {
                    backs_aside: 0.5,
                    ..inside
                },
                Reason::Enclosed,
            ),
            ("a block, surfaces turned", Inward, turned, Reason::Solid),
            ("a room, surfaces turned", Inward, inside, Reason::Enclosed),
            (
                "a single sheet",
                Anyhow,
                EnclosedFacts {
                    backs: 0.5,
                    walled: 0.2,
                    ..room
                },
                Reason::Solid,
            ),
            (
                "a suite between others",
                Anyhow,
                EnclosedFacts {
                    backs: 0.5,
                    walled: 0.2,
                    between: 0.11,
                    ..room
                },
                Reason::Enclosed,
            ),
            (
                "a column that touches a second room",
                Anyhow,
                EnclosedFacts {
                    backs: 0.5,
                    walled: 0.2,
                    between: 0.09,
                    ..room
                },
                Reason::Solid,
            ),
            (
                "a shaft between others",
                Anyhow,
                EnclosedFacts {
                    radius: 0.45,
                    backs: 0.5,
                    walled: 0.2,
                    between: 0.5,
                    ..room
                },
                Reason::Enclosed,
            ),
            (
                "walls of two faces",
                Anyhow,
                EnclosedFacts {
                    backs: 0.5,
                    walled: 0.6,
                    ..room
                },
                Reason::Enclosed,
            ),
            (
                "fronts all around",
                Anyhow,
                EnclosedFacts {
                    backs: 0.2,
                    walled: 0.2,
                    ..room
                },
                Reason::Enclosed,
            ),
            (
                "a gap in the construction",
                Outward,
                EnclosedFacts {
                    radius: 0.2,
                    ..room
                },
                Reason::Crevice,
            ),
            (
                "a closet",
                Outward,
                EnclosedFacts {
                    radius: 0.4,
                    ..room
                },
                Reason::Enclosed,
            ),
            (
                "a hollow wall",
                Outward,
                EnclosedFacts {
                    radius: 0.4,
                    ..inside
                },
                Reason::Crevice,
            ),
        ] {
            let why = facts.why(facing, 0.3);
            assert_eq!(why.reason, reason, "{what}: {why}");
            assert!(why.holds(), "{what}: {why}");
        }
    }

    #[test]
    fn a_piece_of_wall_without_an_end_is_thin_and_shows_its_backs() {
        use Facing::{Anyhow, Outward};
        assert!(is_hollow_piece(Outward, 0.45, 0.9));
        assert!(!is_hollow_piece(Outward, 0.55, 0.9));
        assert!(!is_hollow_piece(Outward, 0.45, 0.5));
        assert!(!is_hollow_piece(Anyhow, 0.45, 0.9));
    }

    #[test]
    fn surfaces_are_trusted_turned_or_neither() {
        assert_eq!(Facing::of(Some(0.1), 0.9), Facing::Outward);
        assert_eq!(Facing::of(Some(0.9), 0.1), Facing::Inward);
        assert_eq!(Facing::of(Some(0.5), 0.1), Facing::Anyhow);
        assert_eq!(Facing::of(None, 0.1), Facing::Outward);
        assert_eq!(Facing::of(None, 0.9), Facing::Anyhow);
    }
}

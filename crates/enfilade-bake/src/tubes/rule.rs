//! The rule for forks: classifies a place and its arms by their measurements.
//!
//! Nothing here reads the model. The bounds lie between measurements: vessels and generated tubes on one side, corridors, halls
//! and cave walls of a dozen scenes on the other. None depends on the unit.

/// Least ratio of the trunk's largest ball near the mouth to the branch's largest ball well inside. Tubes of nearly one
/// width continue each other. A higher value gives fewer branches.
pub(crate) const NARROWS: f64 = 1.5;
/// Least depth of a branch, from its mouth to its far end, in diameters of the mouth. Alcoves are about as deep as
/// wide. A higher value gives fewer branches.
pub(crate) const DEEP: f64 = 2.0;
/// Radii of the balls removed where tubes may meet, ascending, in radii of the ball there. Arms at a right angle are
/// separate from 1.42 on, at 40° from 2.75. A larger last one separates arms at smaller angles, but needs longer arms.
pub(crate) const REMOVED: [f64; 4] = [1.5, 2.0, 2.5, 3.0];
/// Greatest width of balls beside the one in the middle of a fork, as a multiple of its width: balls of one tube differ
/// by that much. A higher value tests more places that are not a middle.
pub(crate) const WIDEST: f64 = 1.1;
/// Distance from a tested place within which places are skipped. A lower value finds the middle of a fork better, and
/// takes longer. [Units: radii]
pub(crate) const STRIDE: f64 = 0.5;
/// Least squareness of a corridor: 1 between four walls, 0.5 under a barrel vault, 0 in a round tube. A higher value
/// gives more branches.
const SQUARE: f64 = 0.5;
/// Least share of the rays about an arm's axis that meet a wall: fewer walls carry no information. A higher value gives
/// fewer branches.
const ENCLOSED: f64 = 0.5;

/// Meaning of the pieces that remain around a removed ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Meeting {
    /// A tube, a bend or a hall; a larger ball would leave no more pieces.
    None,
    /// A tube, or a fork with arms that are not separate yet: a larger ball may decide.
    Unclear,
    /// Perhaps a fork.
    Fork,
}

/// Classifies a place by the number of pieces that continue for [`DEEP`] diameters from a removed ball.
pub(crate) fn meeting(n_pieces: usize) -> Meeting {
    match n_pieces {
        0 | 1 => Meeting::None,
        2 => Meeting::Unclear,
        _ => Meeting::Fork,
    }
}

/// Measurements of a piece around a fork.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ArmFacts {
    /// Distance from its start to the far side of its farthest ball. [Units: wu]
    pub(crate) depth: f64,
    /// Radius of the ball in the middle of the fork. [Units: wu]
    pub(crate) radius: f64,
    /// Share of the rays about its axis that meet a wall.
    pub(crate) enclosed: f64,
    /// Length of the mean of `exp(4iθ)` over those walls, with θ the direction of a wall's normal about the axis.
    pub(crate) squareness: f64,
}

/// Kinds of arms of a fork.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Arm {
    /// No deeper than an alcove: the removed ball may lie off the fork's middle.
    Stub,
    /// Four walls at right angles: where corridors of a building cross, an architect sees one room.
    Corridor,
    /// Round in some way: a circle, an ellipse, a regular polygon other than a square.
    Tube,
}

/// Classifies an arm of a fork.
pub(crate) fn classify_arm(arm: &ArmFacts) -> Arm {
    if arm.depth < 2.0 * DEEP * arm.radius {
        Arm::Stub
    } else if arm.enclosed >= ENCLOSED && arm.squareness < SQUARE {
        Arm::Tube
    } else {
        Arm::Corridor
    }
}

/// Returns `true` if tubes meet at the given arms, sorted widest first and without stubs: three or more, of which one
/// that is not the widest is a tube.
pub(crate) fn is_fork(arms: &[Arm]) -> bool {
    arms.len() >= 3 && arms[1..].contains(&Arm::Tube)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_rule_for_arms_has_a_case_on_either_side() {
        let arm = |depth: f64, enclosed: f64, squareness: f64| {
            classify_arm(&ArmFacts {
                depth,
                radius: 1.0,
                enclosed,
                squareness,
            })
        };
        for (what, found, expected) in [
            ("a round tube", arm(5.0, 1.0, 0.0), Arm::Tube),
            ("1.9 diameters", arm(3.8, 1.0, 0.0), Arm::Stub),
            ("2 diameters", arm(4.0, 1.0, 0.0), Arm::Tube),
            ("four walls", arm(5.0, 1.0, 1.0), Arm::Corridor),
            ("a barrel vault", arm(5.0, 1.0, 0.5), Arm::Corridor),
            ("a rough cave", arm(5.0, 1.0, 0.4), Arm::Tube),
            ("open to the sky", arm(5.0, 0.4, 0.0), Arm::Corridor),
            ("half open", arm(5.0, 0.5, 0.0), Arm::Tube),
        ] {
            assert_eq!(found, expected, "{what}");
        }
    }

    #[test]
    fn three_pieces_and_a_tube_beside_the_widest_are_a_fork() {
        let expected = [
            Meeting::None,
            Meeting::None,
            Meeting::Unclear,
            Meeting::Fork,
        ];
        assert_eq!([0, 1, 2, 3].map(meeting), expected);
        use Arm::{Corridor, Tube};
        for (arms, expected) in [
            (&[Tube, Tube, Tube][..], true),
            (&[Tube, Tube], false),
            (&[Corridor, Corridor, Tube], true),
            (&[Tube, Corridor, Corridor], false),
            (&[Corridor, Corridor, Corridor, Corridor], false),
        ] {
            assert_eq!(is_fork(arms), expected, "{arms:?}");
        }
    }
}

//! The rule: classifies limbs and arms by their measurements.
//!
//! Nothing here reads the model. A limb that is not a branch is merged across its largest mouth, so each bound errs
//! either to more rooms or to fewer; its comment says which. The bounds lie between measurements: vessels and generated
//! tubes on one side; eaves, niches, beds, window reveals and cave walls of a dozen scenes on the other. None depends
//! on the unit.

use std::f64::consts::PI;

use super::super::labels::BranchMouth;
use crate::tubes::{DEEP, NARROWS};

/// Greatest root mean square distance of a mouth from its center, in radii of its ball: a disk has 0.7, a rectangle of
/// 1 : 2 has 1.3, the gap around a bed 2.5 and more. A lower value gives fewer branches.
const SPREAD: f64 = 1.5;
/// The mouth moves to where balls of this many times the branch's own no longer pass. Balls of one tube differ by as
/// much, depending on where points are. A higher value puts the mouth farther into the trunk.
pub(super) const FLARES: f64 = 1.05;

/// Weight of the mouth of a fork's arm: that of a branch half as wide as its trunk. It matters only to users who
/// decimate further.
pub(super) const ARM_WEIGHS: f64 = 2.0;

/// Measurements of a mouth: a connected set of facets where a limb meets another region of its room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MouthFacts {
    /// Radius of the widest ball that passes. [Units: wu]
    pub(super) radius: f64,
    /// Projected area: the length of the sum of the facets' area vectors. [Units: wu²]
    pub(super) area: f64,
    /// Root mean square distance of the facets from their center. [Units: wu]
    pub(super) spread: f64,
}

impl MouthFacts {
    /// Returns `true` if it is much longer than wide: under a bed, along a wall or where two walls meet.
    fn is_slit(&self) -> bool {
        self.spread > SPREAD * self.radius
    }

    /// Returns the radius of the widest disk that can pass: less than the ball's if most of the mouth's rim leads
    /// elsewhere. [Units: wu]
    fn disk(&self) -> f64 {
        self.radius.min((self.area / PI).sqrt())
    }

    /// Returns `true` if it is much narrower than another, and so not a second mouth.
    fn is_chink_beside(&self, other: &Self) -> bool {
        self.disk() * NARROWS < other.radius
    }
}

/// Returns the number of main mouths of a limb, given widest first: one, but outdoors all that are nearly as wide as
/// the first, since a tunnel is open at both ends.
pub(super) fn n_main_mouths(radii: &[f64], is_outdoors: bool) -> usize {
    match radii.first() {
        Some(first) if is_outdoors => radii.partition_point(|r| r * NARROWS >= *first),
        first => usize::from(first.is_some()),
    }
}

/// Measurements of a limb.
#[derive(Clone, Debug)]
pub(super) struct LimbFacts {
    /// It lies in the room around the scene.
    pub(super) is_outdoors: bool,
    /// Mouths, widest first. Those of branches that leave the limb itself do not count.
    pub(super) mouths: Vec<MouthFacts>,
    /// Radius of its largest ball that is a diameter or more away from each main mouth; `None` if no ball that large is
    /// known. [Units: wu]
    pub(super) body: Option<f64>,
    /// Radius of the trunk's largest ball near the widest mouth, within twice [`DEEP`] radii. A taper narrows farther
    /// away, too. [Units: wu]
    pub(super) trunk: f64,
    /// Distance from the center of the widest mouth to the far side of the farthest ball not [`NARROWS`] times narrower
    /// than the mouth: narrower ones lie where walls meet. [Units: wu]
    pub(super) depth: f64,
    /// [Units: wu³]
    pub(super) volume: f64,
    /// Area of all openings to rooms with a ball wider than the widest mouth. Area counts, not the balls that pass,
    /// since a door leaf or a pane in an opening lets none pass. [Units: wu²]
    pub(super) exits: f64,
    /// Radius of the smallest known ball of air. [Units: wu]
    pub(super) finest: f64,
}

/// Kinds of limbs. All but branches are merged across their widest mouths, if they have any.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LimbKind {
    /// Nothing else is left of its room.
    Whole,
    /// It is less deep than its mouth is wide.
    Bulge,
    /// It has a second mouth, or leads on to a room wider than its mouth: a passage between chambers, or a ring.
    Neck,
    /// Its mouth is a slit.
    Crevice,
    /// It is less than [`DEEP`].
    Alcove,
    /// It is hardly narrower than its trunk.
    Continuation,
    /// A tube that leaves its trunk: a room.
    Branch(BranchMouth),
}

/// Classifies a limb. A tube outdoors may have several mouths and doors to rooms; its volume decides if it is deep.
pub(super) fn classify(limb: &LimbFacts) -> LimbKind {
    let Some((widest, others)) = limb.mouths.split_first() else {
        return LimbKind::Whole;
    };
    let Some(body) = limb.body else {
        return LimbKind::Bulge;
    };
    let has_two_mouths = others.iter().any(|m| !m.is_chink_beside(widest));
    // Less than the disk of the smallest known ball is a crack.
    let leads_on = limb.exits > PI * limb.finest.powi(2);
    if !limb.is_outdoors && (has_two_mouths || leads_on) {
        return LimbKind::Neck;
    }
    let radii: Vec<f64> = limb.mouths.iter().map(|m| m.radius).collect();
    let main = &limb.mouths[..n_main_mouths(&radii, limb.is_outdoors)];
    if main.iter().any(MouthFacts::is_slit) {
        return LimbKind::Crevice;
    }
    let is_deep = if limb.is_outdoors {
        let needs = |m: &MouthFacts| 2.0 * DEEP * m.radius * m.area;
        limb.volume >= limb.mouths.iter().map(needs).sum()
    } else {
        limb.depth >= 2.0 * DEEP * widest.radius
    };
    if !is_deep {
        return LimbKind::Alcove;
    }
    let weight = limb.trunk / body;
    if weight < NARROWS {
        return LimbKind::Continuation;
    }
    LimbKind::Branch(BranchMouth {
        weight,
        radius: body,
        is_limb: false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A round mouth.
    fn mouth(radius: f64) -> MouthFacts {
        MouthFacts {
            radius,
            area: PI * radius * radius,
            spread: 0.7 * radius,
        }
    }

    /// A tube of radius 1 and a depth of 3 diameters, on a trunk of radius 2.
    fn tube() -> LimbFacts {
        LimbFacts {
            is_outdoors: false,
            mouths: vec![mouth(1.0)],
            body: Some(1.0),
            trunk: 2.0,
            depth: 6.0,
            volume: 6.0 * PI,
            exits: 0.0,
            finest: 0.1,
        }
    }

    const BRANCH: LimbKind = LimbKind::Branch(BranchMouth {
        weight: 2.0,
        radius: 1.0,
        is_limb: false,
    });

    type Change = fn(&mut LimbFacts);

    /// Changes a tube, row by row, and compares the kind that results.
    fn check(rows: &[(&str, Change, LimbKind)]) {
        for (what, change, expected) in rows {
            let mut limb = tube();
            change(&mut limb);
            assert_eq!(classify(&limb), *expected, "{what}");
        }
    }

    /// A mouth that is a slit.
    fn slit(radius: f64) -> MouthFacts {
        MouthFacts {
            spread: 2.5,
            ..mouth(radius)
        }
    }

    /// A mouth most of whose rim leads elsewhere.
    fn rim(radius: f64) -> MouthFacts {
        MouthFacts {
            area: 1.0,
            ..mouth(radius)
        }
    }

    #[test]
    fn each_rule_for_limbs_has_a_case_on_either_side() {
        let just_narrow = LimbKind::Branch(BranchMouth {
            weight: 1.5,
            radius: 1.0,
            is_limb: false,
        });
        check(&[
            ("a tube", |_| {}, BRANCH),
            ("no way out", |l| l.mouths.clear(), LimbKind::Whole),
            ("no ball inside", |l| l.body = None, LimbKind::Bulge),
            // One mouth.
            ("a ring", |l| l.mouths.push(mouth(0.9)), LimbKind::Neck),
            (
                "a narrow ring",
                |l| l.mouths.push(mouth(0.7)),
                LimbKind::Neck,
            ),
            ("a chink beside", |l| l.mouths.push(mouth(0.6)), BRANCH),
            ("a rim beside", |l| l.mouths.push(rim(0.9)), BRANCH),
            // A dead end.
            ("a door to a hall", |l| l.exits = 2.0, LimbKind::Neck),
            ("a crack to a hall", |l| l.exits = 0.03, BRANCH),
            // Not a slit.
            (
                "under a bed",
                |l| l.mouths[0] = slit(1.0),
                LimbKind::Crevice,
            ),
            ("1 : 2", |l| l.mouths[0].spread = 1.3, BRANCH),
            ("a slit beside", |l| l.mouths.push(slit(0.1)), BRANCH),
            // Deep.
            ("1.9 diameters", |l| l.depth = 3.8, LimbKind::Alcove),
            ("2.1 diameters", |l| l.depth = 4.2, BRANCH),
            // Narrow.
            ("a taper", |l| l.trunk = 1.4, LimbKind::Continuation),
            ("just narrow", |l| l.trunk = 1.5, just_narrow),
            (
                "wide inside",
                |l| l.body = Some(1.5),
                LimbKind::Continuation,
            ),
        ]);
    }

    #[test]
    fn outdoors_a_limb_may_have_several_mouths_but_must_hold_enough() {
        check(&[
            ("a dead end", |l| l.is_outdoors = true, BRANCH),
            (
                "a door to a hall",
                |l| (l.is_outdoors, l.exits) = (true, 2.0),
                BRANCH,
            ),
            (
                "a long tunnel",
                |l| {
                    (l.is_outdoors, l.volume) = (true, 9.0 * PI);
                    l.mouths.push(mouth(1.0));
                },
                BRANCH,
            ),
            (
                "a short tunnel",
                |l| {
                    l.is_outdoors = true;
                    l.mouths.push(mouth(1.0));
                },
                LimbKind::Alcove,
            ),
            (
                "a tunnel with a slit as wide at one end",
                |l| {
                    (l.is_outdoors, l.volume) = (true, 9.0 * PI);
                    l.mouths.push(slit(0.9));
                },
                LimbKind::Crevice,
            ),
            (
                "a tunnel with a narrow slit",
                |l| {
                    (l.is_outdoors, l.volume) = (true, 9.0 * PI);
                    l.mouths.push(slit(0.5));
                },
                BRANCH,
            ),
            (
                "deep, but holding little",
                |l| (l.is_outdoors, l.volume) = (true, PI),
                LimbKind::Alcove,
            ),
        ]);
    }
}

//! Which way a surface, a plane or an opening lies: level like a floor, upright like a wall, or neither.
//!
//! The one test for it, in two strengths: *nearly*, for what is meant to be level or upright, and *rather*, for what must be
//! taken for one of the two. Normals may have any length; their sign does not matter.

use crate::DVec3;

/// Largest sine of the angle by which something meant to be level or upright is off: 5.7 degrees. Vertices that are off
/// by centimeters tilt a wall by less, and ramps are steeper.
const NEARLY: f64 = 0.1;
/// Least cosine of the angle between directions that rather agree: 45 degrees, which count themselves.
const RATHER: f64 = 0.707;

/// How a surface lies, up to a few degrees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Attitude {
    /// As a floor.
    Level,
    /// As a wall.
    Upright,
    /// As a ramp or a pitched roof; also what has no area.
    Oblique,
}

impl Attitude {
    /// Returns the attitude of what has this normal.
    #[must_use]
    pub fn of(normal: DVec3) -> Self {
        let most = NEARLY * normal.length();
        if normal.y.abs() < most {
            Self::Upright
        } else if normal.x.hypot(normal.z) < most {
            Self::Level
        } else {
            Self::Oblique
        }
    }
}

/// Returns `true` for what is nearer to level than to upright, given its normal.
#[must_use]
pub fn is_rather_level(normal: DVec3) -> bool {
    faces(normal, DVec3::Y)
}

/// Returns `true` for a surface nearer to one across a direction than to one along it: it faces that way, or the other.
/// The direction has unit length.
#[must_use]
pub fn faces(normal: DVec3, direction: DVec3) -> bool {
    normal.dot(direction).abs() > RATHER * normal.length()
}

/// Returns `true` for a surface meant to be along a direction, of unit length, given its normal.
#[must_use]
pub fn lies_along(normal: DVec3, direction: DVec3) -> bool {
    normal.dot(direction).abs() < NEARLY * normal.length()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The normal of a surface that is off the level by an angle. [Units: degrees]
    fn tilted(by: f64) -> DVec3 {
        let (sin, cos) = by.to_radians().sin_cos();
        DVec3::new(sin * 3.0, -cos * 3.0, 0.0)
    }

    #[test]
    fn a_few_degrees_are_level_or_upright_and_45_part_the_rest() {
        use Attitude::{Level, Oblique, Upright};
        let known = [
            (0.0, Level, true),
            (5.7, Level, true),
            (5.8, Oblique, true),
            (45.0, Oblique, true),
            (45.1, Oblique, false),
            (84.2, Oblique, false),
            (84.3, Upright, false),
            (90.0, Upright, false),
        ];
        for (degrees, attitude, is_level) in known {
            let normal = tilted(degrees);
            assert_eq!(Attitude::of(normal), attitude, "{degrees}");
            assert_eq!(is_rather_level(normal), is_level, "{degrees}");
            assert_eq!(lies_along(normal, DVec3::Y), attitude == Upright);
        }
        assert_eq!(Attitude::of(DVec3::ZERO), Oblique);
        assert!(!is_rather_level(DVec3::ZERO));
    }
}

//! Levels and delays at the two ears of a head.

use enfilade_geom::DVec3;

use crate::sound::reverb::SPEED_OF_SOUND;

/// Returns the level and the delay at the left and the right ear, for sound from the direction `toward`.
///
/// A head of radius 8.75 cm: times by Woodworth's formula (Blauert, "Spatial Hearing", §2.4), levels by equal power. Delays in
/// seconds after the nearer ear. `ahead` and `up` are the listener's.
#[must_use]
pub fn at_ears(toward: DVec3, ahead: DVec3, up: DVec3) -> [(f64, f64); 2] {
    const HEAD: f64 = 0.0875;
    let right = ahead.cross(up).normalize_or_zero();
    let side = right.dot(toward).clamp(-1.0, 1.0);
    let angle = side.abs().asin();
    let late = HEAD / SPEED_OF_SOUND * (angle + angle.sin());
    // Between full left and full right, as a fraction of a quarter turn; the far ear still hears.
    let pan = std::f64::consts::FRAC_PI_4 * (1.0 + 0.7 * side);
    let (left, right) = (pan.cos(), pan.sin());
    if side > 0.0 {
        [(left, late), (right, 0.0)]
    } else {
        [(left, 0.0), (right, late)]
    }
}

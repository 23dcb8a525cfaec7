//! Walks at walking speed along given points.

use enfilade::geom::DVec3;
use enfilade_render::{Camera, FOV};

/// StrollWay of a frame: 1.4 m a second at 60 frames. [Units: wu]
const STEP: f64 = 1.4 / 60.0;
/// Turn of a frame: 120 degrees a second. [Units: rad]
const TURN: f64 = 120.0 / 60.0 / 180.0 * std::f64::consts::PI;
/// Distance ahead of the point looked at. [Units: wu]
const AHEAD: f64 = 1.0;

/// Returns the cameras of a walk, frame by frame: level, looking ahead on the way, turning like a person.
pub(super) fn stroll(eyes: &[[f32; 3]]) -> Vec<Camera> {
    let way = StrollWay::new(eyes);
    let n = (way.length() / STEP) as usize;
    let mut heading = None;
    let cameras = (0..=n).filter_map(|i| {
        let at = way.point(i as f64 * STEP)?;
        let ahead = way.point((i as f64 * STEP + AHEAD).min(way.length()))? - at;
        let before = heading.unwrap_or_else(|| ahead.z.atan2(ahead.x));
        let mut by = 0.0;
        if ahead.x.hypot(ahead.z) > 0.01 {
            let half = std::f64::consts::PI;
            by = (ahead.z.atan2(ahead.x) - before + half).rem_euclid(2.0 * half) - half;
        }
        let now = before + by.clamp(-TURN, TURN);
        heading = Some(now);
        Some(Camera {
            eye: at.as_vec3().to_array(),
            toward: [now.cos() as f32, 0.0, now.sin() as f32],
            fov_y: FOV,
        })
    });
    cameras.collect()
}

/// Returns `n` successive cameras around the middle of a walk, or all.
pub(super) fn middle(cameras: &[Camera], n: usize) -> Vec<Camera> {
    let first = cameras.len().saturating_sub(n) / 2;
    cameras[first..].iter().copied().take(n).collect()
}

/// A polyline by the distance along it.
struct StrollWay {
    points: Vec<DVec3>,
    /// Distance from the start of each point.
    at: Vec<f64>,
}

impl StrollWay {
    fn new(points: &[[f32; 3]]) -> Self {
        let mut points: Vec<DVec3> = (points.iter())
            .map(|p| DVec3::from(p.map(f64::from)))
            .collect();
        points.dedup();
        let mut length = 0.0;
        let mut at: Vec<f64> = points.iter().take(1).map(|_| 0.0).collect();
        for pair in points.windows(2) {
            length += pair[0].distance(pair[1]);
            at.push(length);
        }
        Self { points, at }
    }

    fn length(&self) -> f64 {
        self.at.last().copied().unwrap_or(0.0)
    }

    fn point(&self, distance: f64) -> Option<DVec3> {
        let next = self.at.partition_point(|d| *d < distance);
        let (Some(to), Some(i)) = (self.points.get(next), next.checked_sub(1)) else {
            return (self.points.get(next)).or(self.points.last()).copied();
        };
        let share = (distance - self.at[i]) / (self.at[next] - self.at[i]);
        Some(self.points[i].lerp(*to, share))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_walk_keeps_its_speed_and_turns_slowly() {
        let cameras = stroll(&[[0.0, 1.6, 0.0], [4.0, 1.6, 0.0], [4.0, 1.6, -4.0]]);
        // 8 m at 1.4 m/s and 60 frames a second.
        assert_eq!(cameras.len(), 343);
        for pair in cameras.windows(2) {
            let [a, b] = [&pair[0], &pair[1]].map(|c| c.eye.map(f64::from));
            // Across the bend the distance is shorter.
            let step = DVec3::from(a).distance(DVec3::from(b));
            assert!(step < STEP + 1e-6 && step > 0.7 * STEP, "{step}");
            let [a, b] = [&pair[0], &pair[1]].map(|c| c.toward);
            assert!(a[0] * b[0] + a[2] * b[2] > 0.9993);
        }
        let last = cameras.last().map(|c| c.toward);
        assert!(last.is_some_and(|t| t[2] < -0.999));
        assert!(stroll(&[]).is_empty());
        assert_eq!(middle(&cameras, 100).len(), 100);
    }
}

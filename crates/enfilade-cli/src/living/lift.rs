//! Lifts that go up and down between their stops by the clock.

use enfilade::geom::DVec3;
use enfilade::world::PartId;

use super::file::LiftEntry;

/// Time from shut to open, and as long before the lift leaves. [Units: s]
const DOORS: f64 = 1.0;

/// A lift. Where it is depends on the time alone.
pub(super) struct Lift {
    pub(super) part: PartId,
    pub(super) stops: Vec<DVec3>,
    speed: f64,
    wait: f64,
}

/// Where a lift is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LiftPlace {
    pub(super) at: DVec3,
    /// The stop at which its door is, and how far the door is open there, 0 to 1.
    pub(super) stop: Option<(usize, f64)>,
}

impl Lift {
    pub(super) fn new(part: PartId, entry: &LiftEntry) -> Self {
        Self {
            part,
            stops: entry.stops.iter().map(|s| DVec3::from_array(*s)).collect(),
            speed: entry.speed,
            wait: entry.wait,
        }
    }

    /// Returns its place at a time: it waits at each stop, and goes from the first to the last and back, smoothly. [Units: s]
    pub(super) fn place(&self, time: f64) -> LiftPlace {
        let n = self.stops.len();
        // Up and down: 0, 1, .., n - 1, n - 2, .., 1.
        let stop = |i: usize| if i < n { i } else { 2 * n - 2 - i };
        let n_legs = 2 * n - 2;
        let ride = |i: usize| {
            let [a, b] = [stop(i), stop((i + 1) % n_legs)].map(|k| self.stops[k]);
            // At its greatest, the speed of a smooth ride is 1.5 times the mean.
            1.5 * a.distance(b) / self.speed
        };
        let period: f64 = (0..n_legs).map(|i| self.wait + ride(i)).sum();
        let mut left = time.rem_euclid(period);
        for i in 0..n_legs {
            let (from, to) = (stop(i), stop((i + 1) % n_legs));
            if left < self.wait {
                let open = left.min(self.wait - left) / DOORS;
                return LiftPlace {
                    at: self.stops[from],
                    stop: Some((from, open.min(1.0))),
                };
            }
            left -= self.wait;
            let ride = ride(i);
            if left < ride {
                let t = left / ride;
                let share = t * t * (3.0 - 2.0 * t);
                return LiftPlace {
                    at: self.stops[from].lerp(self.stops[to], share),
                    stop: None,
                };
            }
            left -= ride;
        }
        LiftPlace {
            at: self.stops[0],
            stop: Some((0, 0.0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lift_waits_rides_smoothly_and_opens_at_stops_only() {
        let entry = LiftEntry {
            world: String::new(),
            stops: vec![[0.0; 3], [0.0, 3.0, 0.0], [0.0, 6.5, 0.0]],
            speed: 1.5,
            wait: 5.0,
        };
        let lift = Lift::new(PartId(1), &entry);
        let mut last = lift.place(0.0).at;
        let mut visited = Vec::new();
        for i in 1..20_000 {
            let place = lift.place(f64::from(i) * 0.01);
            assert!(place.at.distance(last) < 0.0151, "at most its speed");
            if let Some((stop, open)) = place.stop {
                assert_eq!(place.at, lift.stops[stop]);
                assert!((0.0..=1.0).contains(&open));
                if visited.last() != Some(&stop) {
                    visited.push(stop);
                }
            }
            last = place.at;
        }
        assert_eq!(visited[..6], [0, 1, 2, 1, 0, 1]);
    }
}

//! Plans that go somewhere, stay a while, and go on. O(points of the path).

use crate::actors::chance::Chance;
use crate::actors::plan::{PlanDraft, WayPoint};

/// Errands from room to room: speed and length of stay.
#[derive(Clone, Debug)]
pub struct Errands {
    /// Minimum and maximum speed; each errand has its own. [Units: wu/s] [Limit: above 0]
    pub speed: [f64; 2],
    /// Minimum and maximum stay at the end of a path. [Units: s] [Limit: >= 0]
    pub stay: [f64; 2],
    way: Vec<WayPoint>,
}

impl Default for Errands {
    /// People in an office: 1 to 1.6 m/s, 20 s to 3 minutes.
    fn default() -> Self {
        Self {
            speed: [1.0, 1.6],
            stay: [20.0, 180.0],
            way: Vec::new(),
        }
    }
}

impl Errands {
    /// Plans one errand to one of `n_places`. `way` finds the path and adds it to an empty list: the points after the start,
    /// each with the cell on the way to it. If it adds none, the actor stays. Allocates nothing once the list has grown.
    ///
    /// `way` must be deterministic, or the actor's behavior depends on the times of queries.
    pub fn plan(
        &mut self,
        chance: &mut Chance,
        plan: &mut PlanDraft<'_>,
        n_places: u32,
        way: impl FnOnce(u32, &mut Vec<WayPoint>),
    ) {
        let place = chance.below(n_places);
        let speed = chance.range(self.speed);
        let stay = chance.range(self.stay);
        self.way.clear();
        way(place, &mut self.way);
        for point in &self.way {
            plan.walk(*point, speed);
        }
        plan.wait(stay);
    }
}

//! Plans of those who go somewhere, stay a while, and go on. O(points of the way).

use crate::actors::chance::Chance;
use crate::actors::plan::{PlanDraft, WayPoint};

/// Going from room to room: how fast, and how long one stays.
#[derive(Clone, Debug)]
pub struct Errands {
    /// Least and greatest speed; each errand has its own. [Units: wu/s] [Limit: above 0]
    pub speed: [f64; 2],
    /// Least and greatest stay at the end of a way. [Units: s] [Limit: >= 0]
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
    /// Plans one errand: to one of `n_places`, by the way that `way` finds, which it adds to an empty list: the points after the
    /// start, each with the cell on the way to it. Where it adds none, the actor stays. Nothing is allocated once the list has
    /// grown.
    ///
    /// `way` must say the same whenever it is asked the same, or what an actor does depends on when it was asked.
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

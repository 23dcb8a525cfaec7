//! A place to begin a walk.

use enfilade_cpg::{CellId, PortalKind, World};

use crate::follow::{Follower, Step};
use crate::sight::Sight;
use crate::state::SightState;

/// Height of an eye above the floor. [Units: wu]
const EYE: f32 = 1.6;
/// Free way ahead that is enough. [Units: wu]
const ENOUGH: f32 = 3.0;
/// Longest way ahead that is looked for. [Units: wu]
const FARTHEST: f32 = 20.0;
/// Step of a way ahead. [Units: wu]
const STEP: f32 = 0.5;
/// Directions that are tried.
const HEADINGS: u16 = 32;
/// Places that are tried in a room.
const PLACES: u32 = 4000;
/// Rooms that are tried: each costs some thousand queries of the locator.
const ROOMS: usize = 8;

/// An eye to begin a walk with, and the direction in which the way is free farthest.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Start {
    /// The eye, 1.6 m above the floor. [Units: wu]
    pub eye: [f32; 3],
    /// Direction of the view: 0 along -z, counter-clockwise seen from above. [Units: rad]
    pub yaw: f32,
}

impl Start {
    /// Finds a place near the middle of a room with many ways out, from where the way ahead is free for 3 m; if none of the
    /// first rooms has one, that with the longest way. Without rooms, takes the first cell; `None` for a world without cells.
    #[must_use]
    pub fn find(world: &World, sight: &Sight, state: &SightState) -> Option<Self> {
        let mut rooms: Vec<CellId> = world.graph.rooms().map(|(id, _)| id).collect();
        if rooms.is_empty() {
            rooms.extend(world.graph.cell_ids().next());
        }
        Self::among(world, sight, state, &rooms, None)
    }

    /// Finds a place as [`Start::find`] does in one of these cells, on a floor at this height if there is one. Cells that do
    /// not exist are ignored.
    #[must_use]
    #[doc(hidden)]
    pub fn among(
        world: &World,
        sight: &Sight,
        state: &SightState,
        cells: &[CellId],
        floor: Option<f32>,
    ) -> Option<Self> {
        let seeker = Seeker {
            world,
            sight,
            state,
        };
        let mut best: Option<(f32, Self)> = None;
        for cell in seeker.best_of(cells) {
            let eye = seeker.place_in(cell, floor);
            let (far, yaw) = seeker.widest(eye);
            if best.is_none_or(|(most, _)| far > most) {
                best = Some((far, Self { eye, yaw }));
            }
            if far >= ENOUGH {
                break;
            }
        }
        best.map(|(_, start)| start)
    }
}

struct Seeker<'a> {
    world: &'a World,
    sight: &'a Sight,
    state: &'a SightState,
}

impl Seeker<'_> {
    /// Lists the cells with the most ways out, the largest of equals first.
    fn best_of(&self, cells: &[CellId]) -> impl Iterator<Item = CellId> {
        let graph = &self.world.graph;
        let ways = |cell: CellId| {
            let exits = graph.exits(cell).map(|exit| exit.portal);
            exits.filter(|portal| is_way(portal.kind)).count()
        };
        let known = cells.iter().filter(|id| id.idx() < graph.cells.len());
        let mut ranked: Vec<_> = known.map(|&id| (ways(id), graph[id].volume, id)).collect();
        ranked.sort_by(|a, b| b.0.cmp(&a.0).then(b.1.total_cmp(&a.1)));
        ranked.into_iter().map(|(.., id)| id).take(ROOMS)
    }

    /// Returns an eye near the middle of a cell, above its floor.
    fn place_in(&self, cell: CellId, floor: Option<f32>) -> [f32; 3] {
        let [low, high] = self.world.graph[cell].aabb;
        let height = floor.unwrap_or(low[1]) + EYE;
        let middle = [0, 1, 2].map(|k| (low[k] + high[k]) / 2.0);
        // A low-discrepancy sequence (Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018): the same
        // places each time.
        let along = |k: usize, i: u32, share: f64| {
            let part = (f64::from(i) * share).fract();
            (f64::from(low[k]) + part * f64::from(high[k] - low[k])) as f32
        };
        let places = (0..PLACES).map(|i| {
            let (x, z) = (along(0, i, 0.754_877_666_2), along(2, i, 0.569_840_291));
            [x, height, z]
        });
        let away = |p: &[f32; 3]| (p[0] - middle[0]).hypot(p[2] - middle[2]);
        let mut eye = places
            .filter(|&p| self.sight.locate(p) == Some(cell))
            .min_by(|a, b| away(a).total_cmp(&away(b)))
            .unwrap_or(middle);
        if let Some(floor) = self.floor_below(eye) {
            let down = [eye[0], floor + EYE, eye[2]];
            if self.passes(eye, down) {
                eye = down;
            }
        }
        eye
    }

    /// Finds the floor below a point, to the accuracy of what a foot notices.
    fn floor_below(&self, p: [f32; 3]) -> Option<f32> {
        (1..=90).find_map(|i| {
            let at = [p[0], p[1] - 0.05 * i as f32, p[2]];
            let mut follower = Follower::new(self.sight, p);
            let step = follower.step(self.sight, at);
            matches!(step, Step::Relocated | Step::Lost).then_some(at[1] + 0.025)
        })
    }

    /// Returns the longest free way ahead of an eye, and its direction.
    fn widest(&self, eye: [f32; 3]) -> (f32, f32) {
        let mut best = (0.0, 0.0);
        for i in 0..HEADINGS {
            let yaw = f32::from(i) * std::f32::consts::TAU / f32::from(HEADINGS);
            let at = |far: f32| [eye[0] - far * yaw.sin(), eye[1], eye[2] - far * yaw.cos()];
            let mut far = 0.0;
            while far < FARTHEST && self.passes(at(far), at(far + STEP)) {
                far += STEP;
            }
            if far > best.0 {
                best = (far, yaw);
            }
        }
        best
    }

    /// Returns `true` if a body passes from one point to another.
    fn passes(&self, from: [f32; 3], to: [f32; 3]) -> bool {
        let mut follower = Follower::new(self.sight, from);
        let step = follower.step(self.sight, to);
        let is_passed =
            |&portal| self.state.is_open(portal) && is_way(self.world.graph[portal].kind);
        !matches!(step, Step::Relocated | Step::Lost) && follower.crossed().iter().all(is_passed)
    }
}

/// Returns `true` for portals that people walk through.
fn is_way(kind: PortalKind) -> bool {
    matches!(kind, PortalKind::Open | PortalKind::Door)
}

#[cfg(test)]
mod tests {
    use enfilade_testkit::{GridParams, room_grid};

    use super::*;

    #[test]
    fn a_walk_begins_in_a_room_at_eye_height_with_a_free_way_ahead() {
        let world = room_grid(&GridParams::offices(12, 1));
        let sight = Sight::build(&world).unwrap();
        let state = SightState::as_modeled(&sight);
        let start = Start::find(&world, &sight, &state).unwrap();
        let cell = sight.locate(start.eye).unwrap();
        let (_, room) = world.graph.rooms().find(|(id, _)| *id == cell).unwrap();
        assert!(
            (start.eye[1] - room.aabb[0][1] - EYE).abs() < 0.1,
            "{start:?}"
        );
        let seeker = Seeker {
            world: &world,
            sight: &sight,
            state: &state,
        };
        let at = |far: f32| {
            let [x, y, z] = start.eye;
            [x - far * start.yaw.sin(), y, z - far * start.yaw.cos()]
        };
        assert!(
            (0..6_u16).all(|i| seeker.passes(at(f32::from(i) * STEP), at(f32::from(i + 1) * STEP)))
        );
        assert!(seeker.widest(start.eye).0 >= ENOUGH);
    }

    #[test]
    fn an_empty_world_has_no_place_to_begin() {
        let world = World::default();
        let sight = Sight::build(&world).unwrap();
        assert_eq!(Start::find(&world, &sight, &SightState::new(&sight)), None);
    }
}

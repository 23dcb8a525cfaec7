//! Keys and frames of a review in the window.

use enfilade::geom::DVec3;
use enfilade::world::{PartId, Space};
use enfilade_render::{Camera, FOV, PictureMark};

use super::app::App;
use super::open::Open;
use super::pointed::{FAR, Pointed};
use super::reviewing::{ReviewKey, ReviewOutcome, Reviewer};

/// Distance of the eye from the portal that it goes before, where there is room. [Units: wu]
const BEFORE: f64 = 2.5;
/// Share of the way to a wall that the eye goes at most.
const AWAY: f64 = 0.8;

impl App<'_> {
    /// Lets the reviewer have a key; returns `false` if nothing is reviewed.
    pub(super) fn review(&mut self, key: ReviewKey) -> anyhow::Result<bool> {
        let (Some(reviewer), Some(open)) = (&mut self.reviewer, &mut self.open) else {
            return Ok(false);
        };
        match reviewer.press(key) {
            ReviewOutcome::Said(words) => open.say(words),
            ReviewOutcome::Refused(why) => open.warn(why),
            ReviewOutcome::Visit(position, normal) => {
                let [eye, toward] = before(&open.lived.space, position, normal);
                open.go(eye, toward);
            }
            ReviewOutcome::Show(world, words) => {
                self.world = world;
                open.show_world(&self.world)?;
                open.has_asked_for_light = reviewer.shows_scene();
                open.say(words);
            }
            ReviewOutcome::Bake(words) => {
                open.say(words);
                // The next frame shows these words, and the one after it bakes.
                self.baking = Some(2);
            }
        }
        Ok(true)
    }

    /// Looks at the portals of a review, and lends their marks to the frame.
    pub(super) fn look_at_review(&mut self) -> anyhow::Result<Vec<PictureMark>> {
        let (Some(reviewer), Some(open)) = (&mut self.reviewer, &mut self.open) else {
            return Ok(Vec::new());
        };
        self.baking = self.baking.map(|n| n - 1);
        if self.baking == Some(0) {
            self.baking = None;
            match reviewer.bake() {
                Ok((world, words)) => {
                    self.world = world;
                    open.show_world(&self.world)?;
                    open.say(words);
                }
                Err(why) => open.warn(format!("not baked: {why:#}")),
            }
        }
        look(reviewer, open);
        open.shown.review = Some(reviewer.shown());
        Ok(reviewer.lend_marks())
    }

    /// Returns the camera with which a review begins: before the portal of the next step.
    pub(super) fn review_camera(&self, space: &Space) -> Option<Camera> {
        let [position, normal] = self.reviewer.as_ref()?.next_place()?;
        let [eye, toward] = before(space, position, normal);
        Some(Camera {
            eye: eye.as_vec3().to_array(),
            toward: toward.as_vec3().to_array(),
            fov_y: FOV,
        })
    }
}

/// Finds the portal at the crosshair, or else names the cell there.
fn look(reviewer: &mut Reviewer<'_>, open: &mut Open) {
    let vector = |p: [f32; 3]| DVec3::from(p.map(f64::from));
    let ray = open.pointer();
    let pointed = Pointed::at(&open.lived.space, &ray, FAR);
    let eye = vector(ray.eye);
    let wall = pointed.hit.map(|hit| hit.at.distance(eye));
    reviewer.look(eye, vector(ray.toward).normalize_or(DVec3::X), wall);
    open.shown.ahead = match reviewer.aimed_words() {
        Some(words) => words,
        None if reviewer.shows_scene() => String::new(),
        None => open.titles.ahead(&open.lived.space, &pointed.ray),
    };
}

/// Returns the eye and the direction from which a portal is seen: from the side with more room.
fn before(space: &Space, position: DVec3, normal: DVec3) -> [DVec3; 2] {
    let free = |side: DVec3| {
        let ends = [position, position + side * BEFORE / AWAY];
        space.first_wall(PartId::ROOT, ends).unwrap_or(1.0) * BEFORE
    };
    let [ahead, back] = [free(normal), free(-normal)];
    let (side, way) = if ahead >= back {
        (normal, ahead)
    } else {
        (-normal, back)
    };
    [position + side * way, -side]
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::{GridParams, room_grid};

    #[test]
    fn the_eye_goes_to_the_side_with_more_room_and_not_into_a_wall() {
        let world = room_grid(&GridParams {
            size: [1, 1, 1],
            doors: 0.0,
            windows: 0.0,
            furniture: 0,
            ..GridParams::offices(1, 1)
        });
        let vector = |p: [f32; 3]| DVec3::from(p.map(f64::from));
        let [low, high] = world.graph.cells[0].aabb.map(vector);
        let space = Space::new(world).unwrap();
        let at = DVec3::new(low.x + 0.5, (low.y + high.y) * 0.5, (low.z + high.z) * 0.5);
        for normal in [DVec3::X, DVec3::NEG_X] {
            let [eye, toward] = before(&space, at, normal);
            assert_eq!(toward, DVec3::NEG_X);
            assert!(eye.x > at.x + 1.0 && eye.x < high.x - 0.1, "{eye}");
        }
    }
}

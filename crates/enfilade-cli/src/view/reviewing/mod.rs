//! Reviewing a decimation in the window: the portals left at a step, by weight, and decisions about them.

mod keys;
mod legend;
mod reviewer;
mod scale;
mod scene;
mod sheets;

pub(super) use keys::{REVIEW_HELP, review_key};
pub(super) use legend::{ReviewShown, draw_review};
pub(super) use reviewer::{ReviewKey, ReviewOutcome, Reviewer};
pub(super) use scene::scene_world;

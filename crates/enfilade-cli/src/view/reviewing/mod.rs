//! Reviewing a decimation in the window: the portals left at a step, by weight, and decisions about them.

mod acting;
mod keys;
mod legend;
mod options;
mod reviewer;
mod scale;
mod scene;
mod sheets;

pub(crate) use self::options::{ReviewOptions, open_review};
pub(super) use acting::review_camera;
pub(super) use keys::{REVIEW_HELP, review_key};
pub(super) use legend::{ReviewShown, draw_review};
pub(super) use reviewer::Reviewer;

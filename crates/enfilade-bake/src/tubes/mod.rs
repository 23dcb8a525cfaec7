//! Tubes of nearly one width that meet, with no pinch where one ends: by one rule for all builders.
//!
//! | file | contents |
//! | --- | --- |
//! | `rule` | what is a fork, by measurements: all bounds, and nothing else |
//! | `balls` | the air as balls, whether of tetrahedra or of voxels |
//! | `forks` | the search for forks among balls of air |
//! | `arms` | measurements of what leaves a fork |

mod arms;
mod balls;
mod forks;
mod rule;

pub(crate) use arms::Walls;
pub(crate) use balls::Balls;
pub(crate) use forks::{Fork, find_forks, reach};
pub(crate) use rule::{Arm, DEEP, NARROWS, REMOVED, STRIDE, WIDEST};

//! Editing in the window: pieces of a kit, and changes by hand.

mod aim;
mod begin;
mod editor;
mod follow;
mod ghost;
mod keys;
mod strip;
mod there;
mod tool;

pub(super) use aim::EditRay;
pub(super) use begin::begin;
pub(super) use editor::{EditKey, Editor, Outcome};
pub(super) use keys::{EDIT_HELP, edit_key};
pub(super) use strip::{EditShown, Strip};

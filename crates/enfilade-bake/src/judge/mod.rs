//! Decides what is a room and where rooms end, from facts alone: pure functions, each from the facts of one thing to a verdict.
//!
//! Nothing here reads the model; what measures lies in `rooms`, `void` and `structure`. A verdict becomes a [`Why`] of the
//! world, so that each cell and portal can say why it is there, and how nearly it is not.
//!
//! [`Why`]: enfilade_cpg::Why

mod opening;
mod space;

pub(crate) use opening::{
    FRAMED, OpeningFacts, OpeningSection, OpeningVerdict, judge, why_parted, why_unjoined,
};
pub(crate) use space::{
    BACKS, BETWEEN, DOORWAY, EnclosedFacts, Facing, LEAST_SHELTER, NARROW, SpaceFacts, is_crevice,
    is_hollow_piece, why_open,
};

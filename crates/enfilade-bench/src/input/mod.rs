//! Input: hostile and huge, and sources that are not triangles.

mod budgets;
mod commands;
mod figures;
mod formats;
mod gate;
mod habits;
mod inputs;
mod leftovers;
mod mutate;
mod mutated;
mod nasty;
mod order;
mod random;
pub(crate) mod sources;
mod states;
pub(crate) mod tampered;
mod tight;

use crate::rows::Row;

pub(crate) use figures::Trust;

/// Hostile and huge input.
pub(crate) const HOSTILE: &[Row<Trust>] = &[
    Row::part("bound", budgets::bounds),
    Row::part("case", budgets::cases),
    Row::part("commands", commands::run),
    Row::part("estimate", budgets::estimates),
    Row::part("gate", gate::run),
    Row::part("habits", habits::run),
    Row::part("large", budgets::large),
    Row::part("leftovers", leftovers::run),
    Row::part("mutated", mutated::run),
    Row::part("nasty", budgets::nasty),
    Row::part("order", order::run),
    Row::part("states", states::run),
    Row::part("tampered", tampered::run),
    Row::part("tight", tight::run),
];

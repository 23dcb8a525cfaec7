//! Ways to falsify a finished world, each at three places: whoever checks worlds must find them.
//!
//! Where a change touches what is counted (triangles of a cell, lists of portals), the counts are made to agree again, so
//! that it is found for what it does and not for a number that was forgotten.

mod decisions;
mod fittings;
mod geometry;
mod graph;
mod origins;
mod sight;

use enfilade_cpg::{CellId, PortalId, World};

/// The evidence that a world was falsified.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShownBy {
    /// The file alone.
    File,
    /// Only the scene that it was baked from: nothing else in the file knows what was changed.
    Source,
}

/// A way to falsify a world.
pub struct Tampering {
    /// The claim that is false then.
    pub name: &'static str,
    /// The evidence against it.
    pub shown_by: ShownBy,
    change: Change,
    is_recounted: bool,
}

/// Changes a world at one of three places; `None` where it has no such place.
type Change = fn(&mut World, usize) -> Option<()>;

impl Tampering {
    const fn new(name: &'static str, change: Change) -> Self {
        Self {
            name,
            shown_by: ShownBy::File,
            change,
            is_recounted: true,
        }
    }

    /// For what is about counts themselves.
    const fn uncounted(name: &'static str, change: Change) -> Self {
        Self {
            is_recounted: false,
            ..Self::new(name, change)
        }
    }

    const fn by_source(name: &'static str, change: Change) -> Self {
        Self {
            shown_by: ShownBy::Source,
            ..Self::new(name, change)
        }
    }

    /// The world falsified at place 0, 1 or 2; `None` where it has nothing to falsify so.
    #[must_use]
    pub fn apply(&self, world: &World, place: usize) -> Option<World> {
        let mut world = world.clone();
        (self.change)(&mut world, place)?;
        Some(if self.is_recounted {
            recounted(world)
        } else {
            world
        })
    }
}

/// All ways, in the order of what they are about.
pub fn tamperings() -> impl Iterator<Item = &'static Tampering> {
    [
        graph::ALL,
        decisions::ALL,
        geometry::ALL,
        fittings::ALL,
        origins::ALL,
        sight::ALL,
    ]
    .into_iter()
    .flatten()
}

/// Makes all that is counted and listed agree with the rest again.
#[must_use]
pub fn recounted(mut world: World) -> World {
    for (i, cell) in world.graph.cells.iter_mut().enumerate() {
        let id = CellId(i as u32);
        let batches = world.batches.iter().filter(|b| !b.is_seal);
        let batches = batches.filter(|b| b.cells.contains(&id));
        cell.n_triangles = batches.map(|b| b.primitive.indices.len() as u32 / 3).sum();
        let details = world.details.iter().filter(|d| d.cells.contains(&id));
        let n = |mesh: u32| -> usize {
            let primitives = &world.detail_meshes[mesh as usize].primitives;
            primitives.iter().map(|p| p.indices.len() / 3).sum()
        };
        cell.n_detail_triangles = details.map(|d| n(d.mesh) as u32).sum();
        let portals = (0..).map(PortalId).zip(&world.graph.portals);
        let own = portals.filter(|(_, p)| p.cells.contains(&id));
        cell.portals = own.map(|p| p.0).collect();
    }
    world
}

/// The numbers of `0..n` that `is_fit`, thinned to the one at `place` of three; `None` where there is none.
fn pick(n: usize, place: usize, is_fit: impl Fn(usize) -> bool) -> Option<usize> {
    let fit: Vec<usize> = (0..n).filter(|&i| is_fit(i)).collect();
    let last = fit.len().checked_sub(1)?;
    Some(fit[place * last / 2])
}

fn room(w: &World, place: usize) -> Option<usize> {
    pick(w.graph.cells.len(), place, |i| !w.graph.cells[i].outdoor)
}

/// A detail that stands in a single room.
fn detail(w: &World, place: usize) -> Option<usize> {
    let in_room = |i: usize| matches!(w.details[i].cells[..], [c] if !w.graph[c].outdoor);
    pick(w.details.len(), place, in_room)
}

/// A cell that is not in the list.
fn stranger(w: &World, cells: &[CellId]) -> Option<CellId> {
    let ids = (0..w.graph.cells.len() as u32).map(CellId);
    ids.rev().find(|c| !cells.contains(c))
}

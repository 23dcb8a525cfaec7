//! How far the rooms of a world are in doubt, by the margins of the decisions that made them.

use crate::{Cell, CellId, CellPortalGraph, PortalId, Reason, Why};

/// Margin from which a decision is safe: noise of a model changes measures by less. At the limit itself, either side is as likely;
/// between the two, the chance falls evenly.
const SAFE: f32 = 0.2;

/// The rooms of a world that may be others.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct RoomDoubt {
    /// Share of the rooms that are expected to be wrong, by the margins of all decisions. [Limit: 0 to 1]
    pub share: f32,
    /// Close decisions, the closest first.
    pub close: Vec<CloseDecision>,
}

/// A decision that was close.
#[derive(Clone, Debug)]
pub struct CloseDecision {
    /// [Units: wu]
    pub at: [f32; 3],
    /// Chance that it is wrong. [Limit: 0 to 0.5]
    pub chance: f32,
    /// The decision.
    pub why: Why,
}

impl Why {
    /// Returns the chance that the decision is wrong: one half at the limit, none from a safe margin on.
    #[must_use]
    pub fn chance(&self) -> f32 {
        0.5 * (1.0 - self.margin() / SAFE).max(0.0)
    }

    /// Returns `true` if a space as large as a room was given to something else, or two rooms were made one.
    #[must_use]
    #[doc(hidden)]
    pub fn takes_room(&self) -> bool {
        matches!(
            self.reason,
            Reason::Solid | Reason::Crevice | Reason::Sheltered | Reason::Merged
        )
    }
}

/// Returns the middle of the box of a cell.
fn middle(cell: &Cell) -> [f32; 3] {
    [0, 1, 2].map(|k| 0.5 * (cell.aabb[0][k] + cell.aabb[1][k]))
}

impl CellPortalGraph {
    /// Weighs the decisions about all rooms. A room is in doubt by those about itself and about its portals, each by itself. Linear
    /// time.
    #[must_use]
    pub fn room_doubt(&self) -> RoomDoubt {
        let mut close: Vec<CloseDecision> = Vec::new();
        let mut keep = |at: [f32; 3], whys: &[Why]| -> f32 {
            let whys = whys.iter().filter(|w| w.chance() > 0.0);
            let right: f32 = whys.clone().map(|w| 1.0 - w.chance()).product();
            close.extend(whys.map(|why| CloseDecision {
                at,
                chance: why.chance(),
                why: why.clone(),
            }));
            1.0 - right
        };
        let of_portal: Vec<f32> = (self.portals.iter())
            .map(|p| keep(p.center(), &p.why))
            .collect();
        let mut of_cell = |cell: CellId| {
            let own = keep(middle(&self[cell]), &self[cell].why);
            let portals = self[cell]
                .portals
                .iter()
                .map(|&PortalId(p)| of_portal[p as usize]);
            1.0 - portals.fold(1.0 - own, |right, p| right * (1.0 - p))
        };
        let rooms: Vec<f32> = self.rooms().map(|(id, _)| of_cell(id)).collect();
        let lost: f32 = (self.places.iter())
            .map(|place| keep(place.at, std::slice::from_ref(&place.why)))
            .sum();
        close.sort_by(|a, b| b.chance.total_cmp(&a.chance));
        let n = rooms.len() as f32 + lost;
        RoomDoubt {
            share: (rooms.iter().sum::<f32>() + lost) / n.max(1.0),
            close,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DecidedPlace, Fact, Portal, PortalKind};

    fn narrow(share: f64) -> Why {
        Why::compared(Reason::Narrow, 0.7, &[(Fact::Share, share)])
    }

    /// Rooms in a row, with an opening of the given share between each two.
    fn row(shares: &[f64]) -> CellPortalGraph {
        let mut graph = CellPortalGraph::default();
        for i in 0..=shares.len() {
            let portals = [i.checked_sub(1), (i < shares.len()).then_some(i)];
            graph.cells.push(Cell {
                portals: portals
                    .into_iter()
                    .flatten()
                    .map(|p| PortalId(p as u32))
                    .collect(),
                ..Cell::default()
            });
        }
        for (i, &share) in (0..).zip(shares) {
            graph.portals.push(Portal {
                cells: [CellId(i), CellId(i + 1)],
                kind: PortalKind::Open,
                normal: [1.0, 0.0, 0.0],
                outline: vec![[i as f32, 0.0, 0.0]; 3],
                pieces: Vec::new(),
                area: 1.0,
                fittings: Vec::new(),
                why: vec![narrow(share)],
            });
        }
        graph
    }

    #[test]
    fn rooms_beside_a_close_decision_are_in_doubt() {
        assert!(row(&[0.3, 0.2]).room_doubt().share < 1e-6);
        let doubt = row(&[0.7, 0.2]).room_doubt();
        // Two of three, each as likely as not.
        assert!((doubt.share - 1.0 / 3.0).abs() < 1e-3, "{}", doubt.share);
        assert_eq!(doubt.close.len(), 1);
    }

    #[test]
    fn a_room_that_was_lost_counts_with_those_that_are_there() {
        let mut graph = row(&[0.3]);
        graph.places.push(DecidedPlace {
            at: [0.0; 3],
            why: Why::compared(Reason::Wide, 0.7, &[(Fact::Share, 0.7)]),
        });
        let doubt = graph.room_doubt();
        assert!((doubt.share - 0.5 / 2.5).abs() < 1e-3, "{}", doubt.share);
    }
}

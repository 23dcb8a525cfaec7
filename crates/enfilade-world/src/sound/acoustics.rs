//! Acoustic data of a space, and gates: the portals as sound passes them.

use std::sync::Arc;

use enfilade_cpg::{FittingPart, PortalId, PortalKind};
use enfilade_geom::DVec3;

use crate::sound::bands::N_BANDS;
use crate::sound::edge::EdgeLosses;
use crate::sound::graph::SoundGraph;
use crate::sound::part::PartSound;
use crate::space::{PartId, Space};

/// Transmission loss of shut openings. [Units: dB] [Limit: ≥ 0]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmission {
    /// Leaves of doors.
    pub door: f64,
    /// Panes and shut windows.
    pub window: f64,
    /// Closures of other openings.
    pub other: f64,
}

impl Default for Transmission {
    /// A light door leaf, single glass: weighted reductions of 25 and 30 dB (EN 12354-1).
    fn default() -> Self {
        Self {
            door: 25.0,
            window: 30.0,
            other: 30.0,
        }
    }
}

/// Acoustic data of a space's parts. Made once, read by all listeners; motion does not change it.
#[derive(Clone, Debug)]
pub struct Acoustics {
    pub(super) parts: Vec<PartSound>,
    /// Per portal of all parts, the energy that passes it while shut.
    pub(super) shut: Vec<f64>,
    pub(super) has_pane: Vec<bool>,
    /// Per part the number of portals before its own.
    pub(super) first_portal: Vec<u32>,
    /// All parts as they stood when it was made.
    pub(super) graph: Arc<SoundGraph>,
    pub(super) edge_losses: EdgeLosses,
}

/// Area of a first Fresnel zone of 500 Hz, divided by π, where both ends are a meter and a half away. [Units: wu²]
const MID_ZONE: f64 = 0.5;

impl Acoustics {
    /// Prepares all parts of a space; those that are added later are silent. Lengths around the walls of concave cells take a
    /// second or two for a large building.
    #[must_use]
    pub fn new(space: &Space, transmission: &Transmission) -> Self {
        let (mut parts, mut first_portal) = (Vec::new(), Vec::new());
        let (mut shut, mut has_pane) = (Vec::new(), Vec::new());
        for part in (0..space.n_parts() as u32).map(PartId) {
            parts.push(PartSound::new(space, part));
            first_portal.push(shut.len() as u32);
            for portal in &space.world(part).graph.portals {
                let loss = match portal.kind {
                    PortalKind::Door => transmission.door,
                    PortalKind::Window => transmission.window,
                    PortalKind::Open | PortalKind::Crack => transmission.other,
                };
                shut.push(10f64.powf(-0.1 * loss));
                has_pane.push(portal.fittings.iter().any(|f| f.part == FittingPart::Pane));
            }
        }
        Self {
            graph: Arc::new(SoundGraph::new(space, &parts)),
            parts,
            shut,
            has_pane,
            first_portal,
            edge_losses: EdgeLosses::new(),
        }
    }

    /// Returns the fraction of a portal's opening that lets sound pass freely, 0 to 1, from the pose of its leaves; 0 behind a
    /// pane.
    ///
    /// # Panics
    ///
    /// If there is no such portal, or the part was added later.
    #[must_use]
    pub(crate) fn open_share(&self, space: &Space, part: PartId, portal: PortalId) -> f64 {
        let state = space.state(part);
        if self.has_pane[self.index(part, portal)] || !state.is_open(portal) {
            return 0.0;
        }
        f64::from(state.leaves(portal).unwrap_or(1.0))
    }

    /// Returns the fraction of energy that a portal lets through, above 0.
    ///
    /// # Panics
    ///
    /// If there is no such portal, or the part was added later.
    #[must_use]
    pub fn transmitted(&self, space: &Space, part: PartId, portal: PortalId) -> f64 {
        let open = self.open_share(space, part, portal);
        open + (1.0 - open) * self.shut[self.index(part, portal)]
    }

    pub(super) fn index(&self, part: PartId, portal: PortalId) -> usize {
        self.first_portal[part.idx()] as usize + portal.idx()
    }
}

/// Returns the length that a gate adds when sequences are compared, a meter for each decibel of the loss through its clear area
/// and its leaf at mid frequencies. [Units: wu]
pub(super) fn toll(area: f64, (open, leaf): (f64, f64)) -> f64 {
    let (shut, area) = (leaf.max(1e-12), open * area);
    let free = area * area / (area * area + MID_ZONE * MID_ZONE);
    -10.0 * (free + (1.0 - free) * shut).log10()
}

/// Returns how much louder a gate may let through what it did before, when its clear share or its leaf changes. [Units: dB]
pub(super) fn rise((before, leaf_before): (f64, f64), (open, leaf): (f64, f64)) -> f64 {
    if open <= before && leaf <= leaf_before {
        return 0.0;
    }
    let most = -10.0 * leaf.min(leaf_before).max(1e-30).log10();
    // Through a small hole, energy is as the square of its area.
    let clear = if open <= before {
        0.0
    } else {
        20.0 * (open / before).log10()
    };
    let through = if leaf <= leaf_before {
        0.0
    } else {
        10.0 * (leaf / leaf_before).log10()
    };
    clear.max(through).min(most)
}

/// A source as heard.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Heard {
    /// Length of the shortest path. [Units: wu]
    pub length: f64,
    /// Unit vector towards the last bend of the shortest path; zero if the source is at the listener.
    pub nearest: DVec3,
    /// Unit vector towards the sound, averaged over all paths by energy, and over the first half wave of each at 500 Hz.
    pub direction: DVec3,
    /// Amplitude relative to that at one meter in the open, without the room's reverberation: the mean over the bands by energy.
    pub gain: f64,
    /// The same in each [octave band](crate::OCTAVES).
    pub bands: [f64; N_BANDS],
    /// Number of paths counted.
    pub n_ways: u32,
}

impl Acoustics {
    /// Returns the clear share of a gate, and the energy that the rest lets through: of two doors that meet, for both together.
    pub(super) fn gate(&self, space: &Space, graph: &SoundGraph, portal: PortalId) -> (f64, f64) {
        let of = |portal: PortalId| {
            let (part, own) = graph.joined.of_portal(portal);
            (self.open_share(space, part, own), self.shut[portal.idx()])
        };
        let (open, shut) = of(portal);
        match graph.joined.docked[portal.idx()] {
            None => (open, shut),
            Some(_) if graph.is_spare(portal) => (1.0, 1.0),
            // Where the other is clear, the own leaf; behind the other's leaf, what passes here.
            Some(other) => {
                let (clear, leaf) = of(other);
                let behind = leaf * (open + (1.0 - open) * shut);
                (open * clear, clear * shut + (1.0 - clear) * behind)
            }
        }
    }
}

//! Sound of sources as a listener hears it: direction, distance and level of the paths through openings.
//!
//! Two [length searches](LengthSearch) from the listener serve all sources: one for the shortest way, whatever is shut, and one that
//! counts shut doors as longer, for what is heard. From these come the best few sequences of portals for each source, any number
//! deep, [pulled taut](TautString). Along a string each portal reduces the level, in six octave bands, by
//!
//! - diffraction at its edge: Maekawa ("Noise reduction by screens", 1968) in the closed form of Kurze & Anderson ("Sound
//!   attenuation by barriers", 1971), by the Fresnel number of the detour over the edge; on the bright side, by that of the
//!   distance of the string from the edge, below 0: 5 dB at grazing, fading to none in the clear. In the opening itself there is
//!   nothing to go around: the loss counts by the share of directions that the wall around the opening takes there;
//! - its limited area: the share of the first Fresnel zone that its clear area takes (Born & Wolf, "Principles of Optics", §8.2);
//! - the transmission loss of a leaf or pane, by [kind](Transmission), for the rest.
//!
//! Distances count as 1 / r beyond a meter. Sequences add up by energy, and fade out towards the longest that counts, or the
//! first that is not counted, and towards the faintest that counts. Each of these is a continuous function of both places, so
//! levels need no smoothing, and the answer does not depend on earlier ones. O(portals of a sequence) per source and band.
//!
//! Detours are differences of lengths: they round at 1e-15 of these, against wavelengths of 0.09 m and more. Within a concave
//! cell strings are straight, too short where a wall of the cell is in between.

mod auralize;
mod blocks;
mod ears;
mod edge;
mod graph;
mod listener;
mod materials;
mod pieces;
mod reverb;
mod route;
mod taut;

use std::sync::Arc;

use enfilade_cpg::{FittingPart, PortalId, PortalKind};
use enfilade_geom::{DVec3, Winding};

use crate::layout::Layout;
use crate::paths::{Geodesics, Sampling, Ways};
use crate::sound::edge::EdgeLosses;
use crate::sound::graph::SoundGraph;
use crate::space::{PartId, Space};

pub use auralize::{AUDIO_BLOCK, AudioBlock, Auralizer, test_sound};
pub use ears::at_ears;
pub use listener::Listener;
pub use materials::Assumed;
pub use reverb::{DecayLaw, DiffuseFields, Reverb, SPEED_OF_SOUND};
pub use taut::TautString;

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
    parts: Vec<PartSound>,
    /// Per portal of all parts, the energy that passes it while shut.
    shut: Vec<f64>,
    has_pane: Vec<bool>,
    /// Per part the number of portals before its own.
    first_portal: Vec<u32>,
    /// All parts as they stood when it was made.
    graph: Arc<SoundGraph>,
    edge_losses: EdgeLosses,
}

/// Acoustic data of a part, in its frame.
#[derive(Clone, Debug)]
struct PartSound {
    ways: Ways,
    geodesics: Geodesics,
    /// Per portal, edges with wall beside them, and the number of all.
    first_rim: Vec<u32>,
    rims: Vec<[DVec3; 2]>,
}

/// Area of a first Fresnel zone of 500 Hz, divided by π, where both ends are a meter and a half away. [Units: wu²]
const MID_ZONE: f64 = 0.5;
/// Number of octave bands.
const N_BANDS: usize = 6;
/// Centers of the octave bands, those in which materials are measured (ISO 354). [Units: Hz]
pub const OCTAVES: [f64; N_BANDS] = [125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0];
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
    pub fn open_share(&self, space: &Space, part: PartId, portal: PortalId) -> f64 {
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
    /// As [`Acoustics::open_share`].
    #[must_use]
    pub fn transmitted(&self, space: &Space, part: PartId, portal: PortalId) -> f64 {
        let open = self.open_share(space, part, portal);
        open + (1.0 - open) * self.shut[self.index(part, portal)]
    }

    fn index(&self, part: PartId, portal: PortalId) -> usize {
        self.first_portal[part.idx()] as usize + portal.idx()
    }
}

/// Returns the length that a gate adds when sequences are compared, a meter for each decibel of the loss through its clear area
/// and its leaf at mid frequencies. [Units: wu]
fn toll(area: f64, (open, leaf): (f64, f64)) -> f64 {
    let (shut, area) = (leaf.max(1e-12), open * area);
    let free = area * area / (area * area + MID_ZONE * MID_ZONE);
    -10.0 * (free + (1.0 - free) * shut).log10()
}

/// Returns how much louder a gate may let through what it did before, when its clear share or its leaf changes. [Units: dB]
fn rise((before, leaf_before): (f64, f64), (open, leaf): (f64, f64)) -> f64 {
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

impl PartSound {
    fn new(space: &Space, part: PartId) -> Self {
        let layout = space.layout(part);
        let mut ways = Ways::new(layout, Sampling::default());
        let geodesics = Geodesics::new(space, part, &mut ways);
        let (mut first_rim, mut rims) = (vec![0], Vec::new());
        for portal in (0..layout.n_portals() as u32).map(PortalId) {
            add_rims(layout, portal, &mut rims);
            first_rim.push(rims.len() as u32);
        }
        Self {
            ways,
            geodesics,
            first_rim,
            rims,
        }
    }

    fn rims(&self, portal: PortalId) -> &[[DVec3; 2]] {
        let first = &self.first_rim[portal.idx()..];
        &self.rims[first[0] as usize..first[1] as usize]
    }
}

/// Adds the edges of an opening's pieces with no other piece behind them.
fn add_rims(layout: &Layout, portal: PortalId, rims: &mut Vec<[DVec3; 2]>) {
    let opening = layout.opening(portal);
    let hulls: Vec<Winding> = opening.pieces().map(|p| Winding::new(p.to_vec())).collect();
    for (i, piece) in opening.pieces().enumerate() {
        for (k, &a) in piece.iter().enumerate() {
            let b = piece[(k + 1) % piece.len()];
            let out = (b - a).cross(opening.normal()).normalize_or_zero();
            let beside = a.midpoint(b) + out * 1e-3;
            let mut others = hulls.iter().enumerate().filter(|(j, _)| *j != i);
            if !others.any(|(_, hull)| hull.contains_in_plane(beside, 0.0)) {
                rims.push([a, b]);
            }
        }
    }
}

/// A source as heard.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Heard {
    /// Length of the shortest path. [Units: wu]
    pub length: f64,
    /// Unit vector towards the last bend of the shortest path; zero if the source is at the listener.
    pub nearest: DVec3,
    /// Unit vector towards the sound, averaged over all paths by energy, and over the first half wave of each at 500 Hz.
    pub direction: DVec3,
    /// Amplitude relative to that at one meter in the open, without the room's reverberation: the mean over the bands by energy.
    pub gain: f64,
    /// The same in each [octave band](OCTAVES).
    pub bands: [f64; N_BANDS],
    /// Number of paths counted.
    pub n_ways: u32,
}

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
mod listener;
mod materials;
mod pieces;
mod reverb;
mod route;
mod taut;

use enfilade_cpg::{FittingPart, PortalId, PortalKind, World};
use enfilade_geom::{Aabb, DVec3, Winding};
use enfilade_runtime::SightState;

use crate::layout::Layout;
use crate::paths::{Geodesics, Sampling, Ways};
use crate::sound::edge::EdgeLosses;

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

/// Acoustic data of a world. Made once, read by all listeners.
#[derive(Clone, Debug)]
pub struct Acoustics {
    ways: Ways,
    geodesics: Geodesics,
    /// Per portal, edges with wall beside them, and the number of all.
    first_rim: Vec<u32>,
    rims: Vec<[DVec3; 2]>,
    /// Per portal, the energy that passes it while shut.
    shut: Vec<f64>,
    has_pane: Vec<bool>,
    /// Per portal, the area of its opening, and the box around it. [Units: wu², wu]
    area: Vec<f64>,
    bounds: Vec<Aabb>,
    edge_losses: EdgeLosses,
}

/// Area of a first Fresnel zone of 500 Hz, divided by π, where both ends are a meter and a half away. [Units: wu²]
const MID_ZONE: f64 = 0.5;
/// Number of octave bands.
const N_BANDS: usize = 6;
/// Centers of the octave bands, those in which materials are measured (ISO 354). [Units: Hz]
pub const OCTAVES: [f64; N_BANDS] = [125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0];
impl Acoustics {
    /// Prepares a world. Lengths around the walls of concave cells take a second or two for a large building.
    #[must_use]
    pub fn new(layout: &Layout, world: &World, transmission: &Transmission) -> Self {
        let mut ways = Ways::new(layout, Sampling::default());
        let geodesics = Geodesics::new(layout, world, &mut ways);
        let (mut first_rim, mut rims) = (vec![0], Vec::new());
        let (mut shut, mut has_pane) = (Vec::new(), Vec::new());
        for (i, portal) in world.graph.portals.iter().enumerate() {
            add_rims(layout, PortalId(i as u32), &mut rims);
            first_rim.push(rims.len() as u32);
            let loss = match portal.kind {
                PortalKind::Door => transmission.door,
                PortalKind::Window => transmission.window,
                PortalKind::Open | PortalKind::Crack => transmission.other,
            };
            shut.push(10f64.powf(-0.1 * loss));
            has_pane.push(portal.fittings.iter().any(|f| f.part == FittingPart::Pane));
        }
        let portals = (0..layout.n_portals() as u32).map(PortalId);
        Self {
            area: portals.clone().map(|p| layout.opening(p).area()).collect(),
            bounds: portals.map(|p| *layout.opening(p).bounds()).collect(),
            ways,
            geodesics,
            first_rim,
            rims,
            shut,
            has_pane,
            edge_losses: EdgeLosses::new(),
        }
    }

    /// Returns the fraction of a portal's opening that lets sound pass freely, 0 to 1, from the pose of its leaves; 0 behind a
    /// pane.
    ///
    /// # Panics
    ///
    /// If there is no such portal.
    #[must_use]
    pub fn open_share(&self, state: &SightState, portal: PortalId) -> f64 {
        if self.has_pane[portal.idx()] || !state.is_open(portal) {
            return 0.0;
        }
        f64::from(state.leaves(portal).unwrap_or(1.0))
    }

    /// Returns the fraction of energy that a portal lets through, above 0.
    ///
    /// # Panics
    ///
    /// If there is no such portal.
    #[must_use]
    pub fn transmitted(&self, state: &SightState, portal: PortalId) -> f64 {
        let open = self.open_share(state, portal);
        open + (1.0 - open) * self.shut[portal.idx()]
    }

    /// Returns the length that a portal adds when sequences are compared, a meter for each decibel of the loss through its clear
    /// area and its leaf at mid frequencies. [Units: wu]
    fn toll(&self, state: &SightState, portal: PortalId) -> f64 {
        let (open, shut) = (
            self.open_share(state, portal),
            self.shut[portal.idx()].max(1e-12),
        );
        let area = open * self.area[portal.idx()];
        let free = area * area / (area * area + MID_ZONE * MID_ZONE);
        -10.0 * (free + (1.0 - free) * shut).log10()
    }

    /// Returns how much louder a portal may let through what it did before, when its clear share changes. [Units: dB]
    fn rise(&self, portal: PortalId, before: f64, open: f64) -> f64 {
        if open <= before {
            return 0.0;
        }
        let most = -10.0 * self.shut[portal.idx()].max(1e-30).log10();
        // Through a small hole, energy is as the square of its area.
        (20.0 * (open / before).log10()).min(most)
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

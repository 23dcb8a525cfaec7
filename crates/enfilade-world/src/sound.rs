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

mod acoustics;
mod auralize;
mod bands;
mod blocks;
mod ears;
mod edge;
mod equalizer;
mod graph;
mod listener;
mod materials;
mod part;
mod pieces;
mod reverb;
mod route;
mod starts;
mod taut;
mod walls;

pub use acoustics::{Acoustics, Heard, Transmission};
pub use auralize::{AUDIO_BLOCK, AudioBlock, Auralizer, test_sound};
pub use bands::OCTAVES;
pub use ears::at_ears;
pub use listener::Listener;
pub use materials::Assumed;
pub use reverb::{DecayLaw, DiffuseFields, Reverb, SPEED_OF_SOUND};
pub use taut::TautString;

//! Conditions under which textures stay true.

use enfilade_cpg::{CellId, PortalId};
use enfilade_runtime::SightState;

use crate::frame::Style;
use crate::lamps::LampLight;
use crate::scene::GpuWorld;

/// The look of textures: style and time of day.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TextureLook {
    /// Ambient occlusion, shadows, daylight: bits from the lowest.
    pub(crate) flags: u8,
    pub(crate) cut_above: f32,
    pub(crate) day: f32,
}

/// Conditions of textures: doors and look.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TextureConditions {
    /// Positions of the leaves: [`SightState::shares`].
    pub(crate) shares: Vec<Option<f32>>,
    /// Portals that let nothing through, ascending.
    pub(crate) shut: Vec<PortalId>,
    pub(crate) look: TextureLook,
}

impl TextureConditions {
    /// Returns those of a frame.
    pub(crate) fn now(state: &SightState, style: &Style, day: f32) -> Self {
        let flags = [style.dark_corners, style.shadows, style.daylight];
        let bits = (0..).zip(flags).map(|(i, on)| u8::from(on) << i);
        Self {
            shares: state.shares().to_vec(),
            shut: state.shut_portals().collect(),
            look: TextureLook {
                flags: bits.sum(),
                cut_above: style.cut_above,
                day,
            },
        }
    }

    /// Returns the cells at the doors that differ; `None` if everything looks different.
    pub(crate) fn changed_cells(&self, world: &GpuWorld, now: &Self) -> Option<Vec<CellId>> {
        if self.look != now.look || self.shares.len() != now.shares.len() {
            return None;
        }
        let mut changed: Vec<CellId> = Vec::new();
        for (leaf, (a, b)) in self.shares.iter().zip(&now.shares).enumerate() {
            if a != b {
                changed.extend(world.cells_of_leaf(leaf));
            }
        }
        let differs = |p: &&PortalId| self.shut.contains(p) != now.shut.contains(p);
        for portal in self.shut.iter().chain(&now.shut).filter(differs) {
            let cells = world.portal_cells.get(portal.idx());
            changed.extend(cells.into_iter().flatten());
        }
        Some(changed)
    }
}

/// Returns a number that tells worlds apart, by what portal textures depend on.
pub(crate) fn textured_world(world: &GpuWorld) -> u64 {
    let mut sum = Fnv::default();
    sum.add(&world.n_triangles().to_le_bytes());
    sum.add(&(world.outlines.len() as u64).to_le_bytes());
    for x in world.bounds().as_flattened() {
        sum.add(&x.to_le_bytes());
    }
    for (outline, cells) in world.outlines.iter().zip(&world.portal_cells) {
        sum.add(&(outline.len() as u64).to_le_bytes());
        for x in outline.as_flattened() {
            sum.add(&x.to_le_bytes());
        }
        for cell in cells {
            sum.add(&cell.0.to_le_bytes());
        }
    }
    sum.0
}

/// Returns a number that tells the lamps and the daylight of studios apart.
pub(crate) fn textured_light(has_daylight: bool, lamps: &[LampLight]) -> u64 {
    let mut sum = Fnv::default();
    sum.add(format!("{has_daylight} {lamps:?}").as_bytes());
    sum.0
}

/// FNV-1a with 64 bits: tells contents apart, but does not withstand forgery.
#[derive(Clone, Copy)]
pub(super) struct Fnv(pub(super) u64);

impl Default for Fnv {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fnv {
    pub(super) fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}

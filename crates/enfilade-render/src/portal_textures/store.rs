//! Textures that were made, and the layers that they take.

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, PortalId};
use enfilade_runtime::{SightState, Stops};

use super::arrays::TextureArrays;
use super::doorway::{Doorway, DoorwayPlace};
use super::draw::Component;
use super::viewpoints::ViewpointIndex;
use crate::frame::Style;
use crate::portal_texture_options::PortalTextureOptions;
use crate::scene::GpuWorld;

/// A portal with the cell behind it.
pub(crate) type DoorwayId = (PortalId, CellId);

/// A texture's doorway and viewpoint; `None` for the one of a transition.
pub(crate) type TextureKey = (DoorwayId, Option<ViewpointIndex>);

/// A texture on the adapter.
#[derive(Clone, Debug)]
pub(crate) struct HeldTexture {
    pub(crate) layer: usize,
    pub(crate) from: DoorwayPlace,
    pub(crate) exposure: f32,
    /// Cells in view of it, ascending.
    pub(crate) cells: Box<[CellId]>,
}

/// A doorway from frame to frame.
#[derive(Clone, Debug)]
pub(crate) struct DoorwayState {
    /// `None` for a portal that cannot have textures: without area.
    pub(crate) doorway: Option<Doorway>,
    /// Frame in which it was last in view.
    pub(crate) frame: u64,
    /// Steps from texture to geometry, 0 for texture.
    pub(crate) turn: u32,
    /// Height at which a walker's eye sees it: [`Viewpoints::of`](super::Viewpoints). [Units: mm]
    pub(crate) anchor: i32,
    /// True if a special portal is in view behind it, which textures do not show.
    pub(crate) is_special: bool,
    /// Triangles of the last texture.
    pub(crate) n_behind: u64,
}

/// Conditions under which textures stay true.
#[derive(Clone, Debug, PartialEq)]
struct Conditions {
    shares: Vec<Option<f32>>,
    shut: Vec<PortalId>,
    look: String,
}

/// Textures of the portals of one world, and what of them is in a frame.
pub(crate) struct PortalTextures {
    pub(crate) options: PortalTextureOptions,
    pub(crate) arrays: TextureArrays,
    pub(crate) doorways: BTreeMap<DoorwayId, DoorwayState>,
    pub(crate) held: BTreeMap<TextureKey, HeldTexture>,
    /// For each layer, its texture, and the frame that last needed it.
    layers: Vec<(Option<TextureKey>, u64)>,
    pub(crate) frame: u64,
    /// The stops of the frame.
    pub(crate) stops: Stops,
    /// The doorways that textures fill in the frame.
    pub(crate) shown: BTreeMap<DoorwayId, Vec<Component>>,
    /// Triangles drawn for textures in the frame.
    pub(crate) n_made_triangles: u64,
    /// True from the plan of a space's frame to its draw.
    pub(crate) is_planned: bool,
    conditions: Option<Conditions>,
    /// Eye of the last frame, in the root. [Units: wu]
    pub(crate) last_eye: Option<glam::DVec3>,
}

impl PortalTextures {
    pub(crate) fn new(options: PortalTextureOptions, arrays: TextureArrays) -> Self {
        Self {
            layers: vec![(None, 0); arrays.len()],
            options,
            arrays,
            doorways: BTreeMap::new(),
            held: BTreeMap::new(),
            // So that new doorways were not shown in the frame before the first.
            frame: 1,
            stops: Stops::default(),
            shown: BTreeMap::new(),
            n_made_triangles: 0,
            is_planned: false,
            conditions: None,
            last_eye: None,
        }
    }

    /// Begins a frame: drops textures that are no longer true.
    pub(crate) fn begin(&mut self, world: &GpuWorld, state: &SightState, style: &Style, day: f32) {
        self.frame += 1;
        self.shown.clear();
        let now = Conditions {
            shares: state.shares().to_vec(),
            shut: state.shut_portals().collect(),
            look: format!("{style:?} {day}"),
        };
        let Some(before) = self.conditions.replace(now) else {
            return;
        };
        let Some(now) = &self.conditions else { return };
        if before == *now {
            return;
        }
        if before.look != now.look || before.shares.len() != now.shares.len() {
            self.clear();
            return;
        }
        let mut changed: Vec<CellId> = Vec::new();
        for (leaf, (a, b)) in before.shares.iter().zip(&now.shares).enumerate() {
            if a != b {
                changed.extend(world.cells_of_leaf(leaf));
            }
        }
        let differs = |p: &&PortalId| before.shut.contains(p) != now.shut.contains(p);
        for portal in before.shut.iter().chain(&now.shut).filter(differs) {
            changed.extend(world.portal_cells[portal.idx()]);
        }
        self.drop_in(&changed);
    }

    /// Drops the textures that show one of some cells.
    pub(crate) fn drop_in(&mut self, cells: &[CellId]) {
        if cells.is_empty() {
            return;
        }
        let layers = &mut self.layers;
        self.held.retain(|_, held| {
            let is_true = !cells.iter().any(|c| held.cells.binary_search(c).is_ok());
            if !is_true {
                layers[held.layer].0 = None;
            }
            is_true
        });
    }

    /// Drops all textures.
    pub(crate) fn clear(&mut self) {
        self.held.clear();
        self.layers.fill((None, 0));
        self.doorways.clear();
    }

    /// Returns the state of a doorway.
    pub(crate) fn doorway(&mut self, world: &GpuWorld, id: DoorwayId) -> &mut DoorwayState {
        self.doorways.entry(id).or_insert_with(|| DoorwayState {
            doorway: Doorway::of(world, id.0, id.1),
            frame: 0,
            turn: 0,
            anchor: 0,
            is_special: false,
            n_behind: 0,
        })
    }

    /// Returns a texture, which the frame needs.
    pub(crate) fn want(&mut self, key: TextureKey) -> Option<&HeldTexture> {
        let held = self.held.get(&key)?;
        self.layers[held.layer].1 = self.frame;
        Some(held)
    }

    /// Returns the layer of the texture that has not been needed for longest; `None` if the frame needs all.
    pub(crate) fn free_layer(&mut self) -> Option<usize> {
        let oldest = (0..self.layers.len()).min_by_key(|i| {
            let (key, frame) = &self.layers[*i];
            (key.is_some(), *frame)
        })?;
        let (key, frame) = self.layers[oldest];
        if key.is_some() && frame == self.frame {
            return None;
        }
        if let Some(key) = key {
            self.held.remove(&key);
        }
        self.layers[oldest] = (None, self.frame);
        Some(oldest)
    }

    /// Adds a texture that was drawn to a [free layer](Self::free_layer).
    pub(crate) fn put(&mut self, key: TextureKey, held: HeldTexture) {
        if let Some(old) = self.held.remove(&key) {
            self.layers[old.layer].0 = None;
        }
        self.layers[held.layer] = (Some(key), self.frame);
        self.held.insert(key, held);
    }

    /// Returns the textures of a doorway.
    pub(crate) fn of_doorway(&self, id: DoorwayId) -> impl Iterator<Item = &HeldTexture> {
        let own = self.held.range((id, None)..);
        own.take_while(move |(key, _)| key.0 == id)
            .map(|(_, held)| held)
    }

    /// Returns the memory of the textures held. [Units: byte]
    pub(crate) fn n_bytes(&self) -> u64 {
        self.held.len() as u64 * self.options.bytes_each()
    }

    /// Returns `true` if a transition, which draws a texture and so the geometry behind, is within the bound on triangles.
    pub(crate) fn may_turn(&self, id: DoorwayId) -> bool {
        let behind = self.doorways.get(&id).map_or(0, |d| d.n_behind);
        behind.saturating_mul(4) <= self.options.max_triangles
    }
}

//! Textures that were made, and the layers that they take.

use std::collections::BTreeMap;

use enfilade_cpg::CellId;
use enfilade_runtime::{SightState, Stops};
use glam::DVec2;

use super::ahead::{ANCHOR_REACH, AheadTextures, millimeters};
use super::arrays::TextureArrays;
use super::conditions::TextureConditions;
use super::doorway::{Doorway, DoorwayPlace};
use super::draw::Component;
use super::texels::unpack;
use super::viewpoints::{DoorwayId, TextureKey};
use crate::frame::Style;
use crate::gpu::Gpu;
use crate::lamps::LampLight;
use crate::portal_texture_options::PortalTextureOptions;
use crate::scene::GpuWorld;

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
    /// True if there are textures made ahead at this height.
    pub(crate) is_anchored_ahead: bool,
    /// True if a special portal is in view behind it, which textures do not show.
    pub(crate) is_special: bool,
    /// Triangles of the last texture.
    pub(crate) n_behind: u64,
}

impl DoorwayState {
    /// Chooses the height of viewpoints for an eye that comes into view of it.
    pub(crate) fn anchor_at(&mut self, eye: DoorwayPlace, ahead: Option<i32>) {
        self.is_anchored_ahead = ahead.is_some();
        self.anchor = ahead.unwrap_or_else(|| millimeters(eye.at.y));
    }

    /// Returns the place for which viewpoints are chosen: an eye near the height of textures made ahead counts as at that
    /// height, and a higher or lower one is that much nearer to it, so that the choice changes evenly.
    pub(crate) fn lattice_place(&self, eye: DoorwayPlace) -> DoorwayPlace {
        if !self.is_anchored_ahead {
            return eye;
        }
        let anchor = f64::from(self.anchor) * 1e-3;
        let off = eye.at.y - anchor;
        let left = (off.abs() - f64::from(ANCHOR_REACH) * 1e-3).max(0.0);
        DoorwayPlace {
            at: DVec2::new(eye.at.x, anchor + left.copysign(off)),
            ..eye
        }
    }
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
    conditions: Option<TextureConditions>,
    /// Lamps of the last frame.
    pub(crate) lamps: Vec<LampLight>,
    /// Textures in host memory that were made ahead.
    pub(crate) ahead: Option<AheadTextures>,
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
            lamps: Vec::new(),
            ahead: None,
            last_eye: None,
        }
    }

    /// Begins a frame: drops textures that are no longer true.
    pub(crate) fn begin(&mut self, world: &GpuWorld, state: &SightState, style: &Style, day: f32) {
        self.frame += 1;
        self.shown.clear();
        let now = TextureConditions::now(state, style, day);
        if let Some(ahead) = &mut self.ahead {
            ahead.follow(world, &now);
        }
        let Some(before) = self.conditions.take() else {
            self.conditions = Some(now);
            return;
        };
        if before != now {
            match before.changed_cells(world, &now) {
                Some(changed) => self.drop_in(&changed),
                None => self.clear(),
            }
        }
        self.conditions = Some(now);
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
        self.last_eye = None;
    }

    /// Returns the state of a doorway.
    pub(crate) fn doorway(&mut self, world: &GpuWorld, id: DoorwayId) -> &mut DoorwayState {
        self.doorways.entry(id).or_insert_with(|| DoorwayState {
            doorway: Doorway::of(world, id.0, id.1),
            frame: 0,
            turn: 0,
            anchor: 0,
            is_anchored_ahead: false,
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

    /// Returns the height of the textures of a doorway that were made ahead for eyes like this, if there are any. [Units: mm]
    pub(crate) fn anchor_ahead(&self, id: DoorwayId, eye: DoorwayPlace) -> Option<i32> {
        let ahead = self.ahead.as_ref()?;
        let is_anchored = self.options.viewpoints.are_warped();
        is_anchored.then(|| ahead.anchor(id, millimeters(eye.at.y)))?
    }

    /// Takes a texture from those made ahead. Returns `false` if it is not there, or not true, or if all layers are needed.
    pub(crate) fn load(
        &mut self,
        gpu: &Gpu,
        world: &GpuWorld,
        key: TextureKey,
        from: DoorwayPlace,
    ) -> bool {
        let Some(ahead) = &mut self.ahead else {
            return false;
        };
        let Some(entry) = ahead.find(key) else {
            return false;
        };
        let side = self.options.side as usize;
        let Some(texels) = unpack(&entry.packed, side, self.arrays.is_blue_first()) else {
            ahead.forget(key);
            return false;
        };
        let (exposure, cells, n_triangles) =
            (entry.exposure, entry.cells.clone(), entry.n_triangles);
        let Some(layer) = self.free_layer() else {
            return false;
        };
        self.arrays.write(gpu, layer, &texels);
        self.doorway(world, key.0).n_behind = n_triangles;
        self.put(
            key,
            HeldTexture {
                layer,
                from,
                exposure,
                cells,
            },
        );
        true
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

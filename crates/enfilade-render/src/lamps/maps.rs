//! The maps of lamps: an array of depth pictures, six for each lamp, kept from frame to frame.

use enfilade_world::{PartId, Pose};
use glam::{DVec3, Mat4, Vec3, Vec4};

use super::{ActiveLamp, LampLight, LampOptions, LampReach};
use crate::camera::Projection;
use crate::formats::DEPTH;
use crate::gpu::{Gpu, RenderError};
use crate::light::Light;

/// Distance of the near plane: a bulb around the lamp does not shade it. The same number is in `lamps.wgsl`. [Units: wu]
const NEAR: f32 = 0.05;
/// Texels beyond the edge of a face, so that softened edges of shadows do not end there; as in `lamps.wgsl`.
const MARGIN: f32 = 3.0;

/// The map of one lamp.
struct Slot {
    light: Option<LampLight>,
    is_current: bool,
    reach: LampReach,
    /// Number of the last frame that used it.
    used: u64,
}

/// A change of a world since the last frame.
pub(crate) enum LampEvent<'a> {
    /// Doors of these cells have changed.
    Doors(PartId, &'a [enfilade_cpg::CellId]),
    /// A part has moved; centers and radius of balls around it, before and after, in the frame of the first world.
    Moved(PartId, [DVec3; 2], f64),
    /// Anything may have changed.
    All,
}

pub(crate) struct LampMaps {
    pub(crate) array: wgpu::TextureView,
    layers: Vec<wgpu::TextureView>,
    slots: Vec<Slot>,
    options: LampOptions,
    frame: u64,
}

impl LampMaps {
    /// Makes maps for no lamps.
    pub(crate) fn none(gpu: &Gpu) -> Self {
        let (array, layers) = array(gpu, 1, 1);
        Self {
            array,
            layers,
            slots: Vec::new(),
            options: LampOptions::default(),
            frame: 0,
        }
    }

    /// Makes room for `n` lamps; returns `true` if the array is a new one.
    pub(crate) fn reserve(
        &mut self,
        gpu: &Gpu,
        n: usize,
        options: &LampOptions,
    ) -> Result<bool, RenderError> {
        if self.options != *options {
            self.options = *options;
            self.slots.clear();
        }
        if n <= self.slots.len() {
            return Ok(false);
        }
        let limits = gpu.device.limits();
        let n_layers = 6 * n as u32;
        Gpu::check("lamps", n_layers.into(), limits.max_texture_array_layers)?;
        Gpu::check(
            "a side of a lamp's map",
            options.side.into(),
            limits.max_texture_dimension_2d,
        )?;
        (self.array, self.layers) = array(gpu, options.side.max(8), n_layers);
        let slot = || Slot {
            light: None,
            is_current: false,
            reach: Vec::new(),
            used: 0,
        };
        self.slots.clear();
        self.slots.resize_with(n, slot);
        Ok(true)
    }

    pub(crate) fn options(&self) -> &LampOptions {
        &self.options
    }

    /// Gives each lamp a slot; returns it, and whether its map must be drawn.
    pub(crate) fn assign(&mut self, lights: &[LampLight]) -> Vec<(usize, bool)> {
        self.frame += 1;
        let mut out = vec![None; lights.len()];
        for (light, out) in lights.iter().zip(&mut out) {
            let has_it =
                |s: &Slot| s.used < self.frame && s.light.is_some_and(|l| l.has_map_of(light));
            if let Some(at) = self.slots.iter().position(has_it) {
                self.slots[at].used = self.frame;
                *out = Some(at);
            }
        }
        let mut given = Vec::new();
        for (light, out) in lights.iter().zip(out) {
            let at = out.unwrap_or_else(|| {
                let slots = self.slots.iter().enumerate();
                let oldest = slots.min_by_key(|(_, s)| s.used).map_or(0, |(i, _)| i);
                self.slots[oldest].is_current = false;
                self.slots[oldest].used = self.frame;
                oldest
            });
            self.slots[at].light = Some(*light);
            given.push((at, !self.slots[at].is_current));
        }
        given
    }

    /// Marks a slot's map as drawn, from what the lamp reaches.
    pub(crate) fn set_current(&mut self, slot: usize, reach: LampReach) {
        let slot = &mut self.slots[slot];
        slot.is_current = true;
        slot.reach = reach;
    }

    pub(crate) fn layers(&self, slot: usize) -> &[wgpu::TextureView] {
        &self.layers[6 * slot..6 * slot + 6]
    }

    /// Writes which lamps of a frame reach each cell of a part, if its cells are known.
    pub(crate) fn write_lit(
        &self,
        gpu: &Gpu,
        part: PartId,
        lamps: &[ActiveLamp],
        light: &mut Light,
    ) {
        if lamps.is_empty() || !light.is_known() {
            return;
        }
        let cells = lamps.iter().map(|lamp| {
            let reach = &self.slots[lamp.layer as usize / 6].reach;
            let own = reach.iter().find(|r| r.0 == part);
            own.map_or(&[][..], |r| &r.1)
        });
        light.lit.write(gpu, cells);
    }

    /// Returns `true` if a lamp of the frame reaches any of some cells.
    pub(crate) fn reaches(&self, lamp: &ActiveLamp, cells: &LampReach) -> bool {
        let reach = &self.slots[lamp.layer as usize / 6].reach;
        reach.iter().any(|(part, own)| {
            // A part may be seen more than once, in special portals.
            let mut others = cells.iter().filter(|c| c.0 == *part);
            others.any(|(_, others)| own.iter().any(|c| others.binary_search(c).is_ok()))
        })
    }

    /// Marks the maps that an event may have changed. `pose` of parts now.
    pub(crate) fn follow(&mut self, event: &LampEvent<'_>, pose: impl Fn(PartId) -> Pose) {
        for slot in &mut self.slots {
            let Some(light) = slot.light else { continue };
            let reached = |part: PartId| slot.reach.iter().find(|r| r.0 == part);
            slot.is_current &= match *event {
                LampEvent::All => false,
                LampEvent::Doors(part, cells) => reached(part)
                    .is_none_or(|(_, own)| cells.iter().all(|c| own.binary_search(c).is_err())),
                LampEvent::Moved(part, centers, radius) => {
                    let at = pose(light.part).point(light.point());
                    let reach = radius + f64::from(light.range);
                    let is_near = centers.iter().any(|c| c.distance(at) < reach);
                    light.part != part && reached(part).is_none() && !is_near
                }
            };
        }
    }
}

/// Makes an array of depth pictures; returns it, and each of them.
fn array(gpu: &Gpu, side: u32, n: u32) -> (wgpu::TextureView, Vec<wgpu::TextureView>) {
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("lamps"),
        size: wgpu::Extent3d {
            width: side,
            height: side,
            depth_or_array_layers: n,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: DEPTH,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    let view = |first, n, dimension| {
        texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(dimension),
            base_array_layer: first,
            array_layer_count: Some(n),
            ..wgpu::TextureViewDescriptor::default()
        })
    };
    let all = view(0, n, wgpu::TextureViewDimension::D2Array);
    let each = (0..n).map(|i| view(i, 1, wgpu::TextureViewDimension::D2));
    (all, each.collect())
}

/// Returns the projection to a face of a lamp's map, in the lamp's own frame: faces +x, -x, +y, -y, +z, -z; the columns of
/// a picture run along the next axis, and its rows, upwards, along the one after.
pub(crate) fn face_projection(light: &LampLight, face: usize, side: u32) -> Projection {
    let axis = |k: usize| [Vec3::X, Vec3::Y, Vec3::Z][k % 3];
    let k = face / 2;
    let out = axis(k) * if face.is_multiple_of(2) { 1.0 } else { -1.0 };
    let spread = side as f32 / (side as f32 - 2.0 * MARGIN);
    let depth = light.range / (light.range - NEAR).max(1e-3);
    let rows = [
        (axis(k + 1) / spread).extend(0.0),
        (axis(k + 2) / spread).extend(0.0),
        (out * depth).extend(-NEAR * depth),
        out.extend(0.0),
    ];
    let [x, y, z, w]: [Vec4; 4] = rows;
    Projection {
        clip_from_relative: Mat4::from_cols(x, y, z, w).transpose(),
        origin: light.at.into(),
        origin_low: Vec3::ZERO,
        eye: light.at.into(),
        is_parallel: false,
    }
}

//! Light of a world by place: the cell of a point, and the light in the air there.
//!
//! Both depend on the point alone. So culling does not change the look of what remains, and a floor that reaches
//! through five rooms is lit and painted by each of them up to its borders.

mod balance;
mod field;
mod form;
mod probes;

use enfilade_cpg::{CellId, World};
use enfilade_runtime::Sight;
use glam::{DVec3, UVec3, Vec3};
use wgpu::util::DeviceExt;

use crate::gpu::{Gpu, RenderError};
use crate::scene::{OUTDOORS, packed_cell_color};
use field::Field;
use probes::Probes;

pub(crate) use balance::sun_of;

/// Texels in a row of a table; `light.wgsl` uses the same number.
const ROW: u32 = 1024;
/// Mean brightness of a room in its pictures, relative to the outdoors.
const MIDDLE: f32 = 0.9;
/// The longest exposure, relative to that of the outdoors.
const LONGEST: f32 = 8.0;
/// … and the shortest: of a court with white walls, in the sun.
const SHORTEST: f32 = 0.3;
/// Texels of a cell in the table.
const CELL_TEXELS: usize = 4;

/// Shader parameters besides the textures, laid out as in `common.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct LightGlobals {
    /// Offset from the camera's position to the field's origin, added to relative points; w: exposure.
    pub(crate) shift: [f32; 4],
    low: [f32; 4],
    density: [f32; 4],
    /// Leaf of the outside, first cell of the table, 1 if there is a field, number of cells.
    info: [i32; 4],
}

/// The light of a world on the adapter.
pub(crate) struct Light {
    field: Field,
    /// For each cell, brightness of its air; 0 outdoors.
    brightness: Vec<f32>,
    globals: LightGlobals,
    pub(crate) table: wgpu::TextureView,
    pub(crate) starts: wgpu::TextureView,
    pub(crate) probes: wgpu::TextureView,
    pub(crate) sampler: wgpu::Sampler,
    /// The lamps that reach each cell, where cells are known.
    pub(crate) lit: LitCells,
}

fn volume(
    gpu: &Gpu,
    label: &'static str,
    size: UVec3,
    format: wgpu::TextureFormat,
    bytes: &[u8],
) -> Result<wgpu::TextureView, RenderError> {
    Gpu::check(
        label,
        size.max_element().into(),
        gpu.device.limits().max_texture_dimension_3d,
    )?;
    let texture = gpu.device.create_texture_with_data(
        &gpu.queue,
        &wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width: size.x,
                height: size.y,
                depth_or_array_layers: size.z,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D3,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        },
        wgpu::util::TextureDataOrder::LayerMajor,
        bytes,
    );
    Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
}

/// Uploads words that a shader looks up by index, four per texel.
pub(crate) fn table(
    gpu: &Gpu,
    what: &'static str,
    texels: &[[u32; 4]],
) -> Result<wgpu::TextureView, RenderError> {
    let texture = table_texture(gpu, what, texels)?;
    Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
}

fn table_texture(
    gpu: &Gpu,
    what: &'static str,
    texels: &[[u32; 4]],
) -> Result<wgpu::Texture, RenderError> {
    let rows = (texels.len() as u32).div_ceil(ROW).max(1);
    Gpu::check(
        what,
        rows.into(),
        gpu.device.limits().max_texture_dimension_2d,
    )?;
    let mut texels = texels.to_vec();
    texels.resize((rows * ROW) as usize, [0; 4]);
    Ok(gpu.device.create_texture_with_data(
        &gpu.queue,
        &wgpu::TextureDescriptor {
            label: Some(what),
            size: wgpu::Extent3d {
                width: ROW,
                height: rows,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Uint,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        },
        wgpu::util::TextureDataOrder::LayerMajor,
        bytemuck::cast_slice(&texels),
    ))
}

/// Texels of a cell in a table of lamps: a bit for each.
const LIT_TEXELS: usize = 2;

/// A table of the lamps that reach each cell.
pub(crate) struct LitCells {
    texture: wgpu::Texture,
    texels: Vec<[u32; 4]>,
}

impl LitCells {
    fn new(gpu: &Gpu, n_cells: usize) -> Result<Self, RenderError> {
        let n = (LIT_TEXELS * n_cells).next_multiple_of(ROW as usize);
        let texels = vec![[0; 4]; n.max(ROW as usize)];
        Ok(Self {
            texture: table_texture(gpu, "the lamps of cells", &texels)?,
            texels,
        })
    }

    /// Writes the lamps, each with its cells.
    pub(crate) fn write<'c>(&mut self, gpu: &Gpu, lamps: impl Iterator<Item = &'c [CellId]>) {
        let mut texels = vec![[0; 4]; self.texels.len()];
        for (lamp, cells) in lamps.enumerate() {
            for cell in cells {
                let at = LIT_TEXELS * cell.idx() + lamp / 128;
                if let Some(texel) = texels.get_mut(at) {
                    texel[lamp / 32 % 4] |= 1_u32 << (lamp % 32);
                }
            }
        }
        if texels == self.texels {
            return;
        }
        self.texels = texels;
        gpu.queue.write_texture(
            self.texture.as_image_copy(),
            bytemuck::cast_slice(&self.texels),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(16 * ROW),
                rows_per_image: None,
            },
            self.texture.size(),
        );
    }

    pub(crate) fn view(&self) -> wgpu::TextureView {
        (self.texture).create_view(&wgpu::TextureViewDescriptor::default())
    }
}

impl Light {
    fn new(
        gpu: &Gpu,
        field: Field,
        texels: &[[u32; 4]],
        first_cell: usize,
        n_cells: usize,
        probes: Probes,
        has_field: bool,
    ) -> Result<Self, RenderError> {
        let linear = wgpu::FilterMode::Linear;
        Ok(Self {
            globals: LightGlobals {
                shift: [0.0; 4],
                low: field.low.extend(0.0).to_array(),
                density: field.density.extend(0.0).to_array(),
                info: [
                    field.outside,
                    first_cell as i32,
                    i32::from(has_field),
                    n_cells as i32,
                ],
            },
            table: table(gpu, "the locator's tree", texels)?,
            starts: volume(
                gpu,
                "where to begin in the locator",
                field.n,
                wgpu::TextureFormat::R32Sint,
                bytemuck::cast_slice(&field.starts),
            )?,
            probes: volume(
                gpu,
                "light",
                probes.size,
                wgpu::TextureFormat::Rgb9e5Ufloat,
                bytemuck::cast_slice(&probes.texels),
            )?,
            sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                mag_filter: linear,
                min_filter: linear,
                ..wgpu::SamplerDescriptor::default()
            }),
            field,
            brightness: probes.brightness,
            lit: LitCells::new(gpu, n_cells)?,
        })
    }

    /// Uniform light, until the light of a world is [computed](Light::of_world).
    pub(crate) fn uniform(gpu: &Gpu) -> Result<Self, RenderError> {
        let field = Field::build(&enfilade_cpg::Locator::default(), 1);
        let probes = Probes {
            grids: Vec::new(),
            size: UVec3::ONE,
            texels: vec![0],
            brightness: Vec::new(),
        };
        Self::new(gpu, field, &[], 0, 0, probes, false)
    }

    /// Computes the light of a world under a sun in direction `sun`.
    pub(crate) fn of_world(
        gpu: &Gpu,
        world: &World,
        sight: &Sight,
        sun: Vec3,
    ) -> Result<Self, RenderError> {
        // Larger textures save nothing.
        let side = gpu.device.limits().max_texture_dimension_3d.min(512);
        let field = Field::build(&world.graph.locator, side);
        let probes = Probes::build(world, sight, sun, side);
        let mut texels = field.nodes.clone();
        let first = texels.len();
        for (id, (cell, grid)) in (0..).zip(world.graph.cells.iter().zip(&probes.grids)) {
            let words = |v: Vec3, w: u32| [v.x.to_bits(), v.y.to_bits(), v.z.to_bits(), w];
            let color = match cell.outdoor {
                true => OUTDOORS,
                false => packed_cell_color(CellId(id)),
            };
            let entry: [[u32; 4]; CELL_TEXELS] = match grid {
                Some(g) => {
                    let low = (g.low.as_dvec3() - field.origin).as_vec3();
                    [
                        words(low, u32::from(cell.outdoor)),
                        words(g.density, color),
                        words(g.n.as_vec3(), 0),
                        words(g.at.as_vec3(), 0),
                    ]
                }
                None => [[0, 0, 0, 1], [0, 0, 0, color], [0; 4], [0; 4]],
            };
            texels.extend(entry);
        }
        let n_cells = world.graph.cells.len();
        Self::new(gpu, field, &texels, first, n_cells, probes, true)
    }

    /// Returns the exposure for an eye at a place, relative to the outdoors: longer in dim rooms, from which the
    /// outdoors then looks overexposed.
    ///
    /// `surroundings` is the [brightness](Light::brightness_at) around the world, relative to the outdoors.
    pub(crate) fn exposure(&self, eye: Vec3, surroundings: f32) -> f32 {
        match self.brightness_at(eye) {
            Some(b) => (MIDDLE / (b * surroundings)).clamp(SHORTEST, LONGEST),
            None if surroundings < 1.0 => (MIDDLE / surroundings).clamp(1.0, LONGEST),
            None => 1.0,
        }
    }

    /// Returns the brightness of the air at a place, relative to the outdoors; `None` outdoors.
    pub(crate) fn brightness_at(&self, p: Vec3) -> Option<f32> {
        let cell = self.field.locate(p.to_array());
        let cell = usize::try_from(cell).ok()?;
        self.brightness.get(cell).copied().filter(|b| *b > 0.0)
    }

    /// Returns the shader parameters for a camera at `origin`.
    pub(crate) fn globals(&self, origin: DVec3, exposure: f32) -> LightGlobals {
        let shift = (origin - self.field.origin).as_vec3();
        LightGlobals {
            shift: shift.extend(exposure).to_array(),
            ..self.globals
        }
    }

    /// Returns the origin of the field's coordinates. [Units: wu]
    pub(crate) fn origin(&self) -> DVec3 {
        self.field.origin
    }

    /// Returns `true` if the light of a world was computed.
    pub(crate) fn is_known(&self) -> bool {
        self.globals.info[2] != 0
    }
}

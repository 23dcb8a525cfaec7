//! A world on the adapter: corners, indices, materials, textures, placed objects.
//!
//! All triangles stand in one buffer, in the order in which chunks of [`Sight`] are ranges, and those of
//! detail meshes after them, each mesh once. What is drawn is a list of ranges, so that neighboring
//! chunks join to one draw whatever room they belong to.

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::scene::Primitive;
use enfilade_runtime::Sight;
use glam::{Mat4, Vec3, Vec4};
use wgpu::util::DeviceExt;

use crate::gpu::{Gpu, RenderError};
use crate::levels::coarser;
use crate::marks::{Mark, Shape};
use crate::materials::{Look, decode, wrapping};

/// A corner of a triangle, 40 bytes. The shader that draws ids reads it as ten words.
///
/// What a material says comes with each corner: to look it up by pixel costs software more than light
/// does.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Corner {
    position: [f32; 3],
    normal: [i8; 4],
    uv: [f32; 2],
    /// The material's times the corner's own; 16 bits, for dark ones.
    color: [u16; 4],
    /// Light of its own, and the least alpha that is drawn.
    emissive: [u8; 4],
    part: u32,
}

pub(crate) const CORNER_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<Corner>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![
        0 => Float32x3, 1 => Snorm8x4, 2 => Float32x2, 3 => Unorm16x4, 4 => Unorm8x4, 5 => Uint32
    ],
};

/// Where something stands, 56 bytes: structure, or a detail object.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Instance {
    rows: [[f32; 4]; 3],
    /// Its number and the reason why it is drawn, as in [`crate::DrawList`].
    key: u32,
    /// Color of its cell.
    color: u32,
}

impl Instance {
    /// The same, drawn for a reason.
    pub(crate) fn drawn(self, key: u32) -> Self {
        Self { key, ..self }
    }
}

pub(crate) const INSTANCE_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<Instance>() as u64,
    step_mode: wgpu::VertexStepMode::Instance,
    attributes: &wgpu::vertex_attr_array![
        6 => Float32x4, 7 => Float32x4, 8 => Float32x4, 9 => Uint32x2
    ],
};

/// Triangles that are drawn alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    pub(crate) first: u32,
    pub(crate) n: u32,
    /// Index into [`GpuWorld::textures`].
    pub(crate) texture: u32,
    pub(crate) finish: Finish,
    /// Whether its corners have normals.
    pub(crate) is_smooth: bool,
    pub(crate) is_transparent: bool,
}

/// What it takes to shade a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Finish {
    Plain = 0,
    Textured = 1,
    /// With holes.
    Masked = 2,
}

/// A detail mesh as drawn from some distance.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    /// How far its surface is from where it should be, at most. [Units: wu of the mesh]
    pub(crate) error: f32,
    /// By part.
    pub(crate) spans: Vec<Span>,
}

/// A placed detail object, as drawn.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    pub(crate) mesh: u32,
    /// Those that it stands in.
    pub(crate) cells: Vec<CellId>,
    pub(crate) center: Vec3,
    /// Of a sphere that holds it. [Units: wu]
    pub(crate) radius: f32,
    /// How much longer than in the mesh a length of it can be.
    pub(crate) stretch: f32,
}

/// A world on the adapter, ready to be drawn.
pub struct GpuWorld {
    pub(crate) corners: wgpu::Buffer,
    pub(crate) indices: wgpu::Buffer,
    /// By part: the color of its cell.
    pub(crate) cell_colors: wgpu::Buffer,
    /// By number of an instance: 0 for structure, then objects.
    pub(crate) instances: Vec<Instance>,
    /// Base color textures; the first is white.
    pub(crate) textures: Vec<wgpu::BindGroup>,
    /// By chunk of the sight.
    pub(crate) chunks: Vec<Span>,
    /// By chunk: its batch.
    pub(crate) batch_of: Vec<u32>,
    /// By batch: the cells that see it.
    pub(crate) batch_cells: Vec<Vec<CellId>>,
    /// By detail mesh: its levels, the finest first.
    pub(crate) meshes: Vec<Vec<Level>>,
    pub(crate) details: Vec<Placed>,
    /// Least and greatest corner of all that is drawn. [Units: wu]
    pub(crate) bounds: [Vec3; 2],
    /// By portal: its outline. [Units: wu]
    pub(crate) outlines: Vec<Vec<[f32; 3]>>,
    /// By cell: the color of what stands in for it far away, lit.
    pub(crate) cell_looks: Vec<[f32; 3]>,
    pub(crate) n_triangles: u64,
    n_missing_pictures: u32,
}

/// The color of a cell, here and in drawings: neighbors in number differ most. sRGB, 0 to 1.
#[must_use]
pub fn cell_color(cell: CellId) -> [f32; 3] {
    let hue = (cell.0 as f32 * 0.618_034 + 0.08).fract() * 6.0;
    let (saturation, value) = ([0.55, 0.42][cell.0 as usize / 2 % 2], 0.92);
    [5.0_f32, 3.0, 1.0].map(|n| {
        let k = (n + hue) % 6.0;
        value - value * saturation * k.min(4.0 - k).clamp(0.0, 1.0)
    })
}

fn packed(c: [f32; 3]) -> u32 {
    let [r, g, b] = c.map(|x| (x.clamp(0.0, 1.0) * 255.0) as u32);
    r | g << 8 | b << 16 | 0xff << 24
}

fn color_of(cells: &[CellId]) -> u32 {
    packed(cells.first().map_or([0.35; 3], |&c| cell_color(c)))
}

/// Fills the buffers; what is on the adapter is made of it at the end.
struct Filling<'w> {
    world: &'w World,
    looks: Vec<Look>,
    /// By texture of the world: index into the textures drawn, 0 for none.
    texture_of: Vec<u32>,
    corners: Vec<Corner>,
    indices: Vec<u32>,
    cell_colors: Vec<u32>,
}

impl Filling<'_> {
    fn look(&self, primitive: &Primitive) -> Look {
        // The last stands for none.
        let none = self.looks.len() - 1;
        let at = primitive.material.map_or(none, |m| m as usize).min(none);
        self.looks[at]
    }

    /// Adds a primitive's triangles, by `order` of its positions; returns where they stand.
    fn add(&mut self, primitive: &Primitive, order: &[u32], color: u32) -> Span {
        let look = self.look(primitive);
        let part = self.cell_colors.len() as u32;
        self.cell_colors.push(color);
        let [r, g, b] = look.emissive;
        let emissive = [r, g, b, look.cutoff].map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8);
        let uvs = primitive.uvs.get(look.uv_set);
        let base = self.corners.len() as u32;
        for (i, &position) in primitive.positions.iter().enumerate() {
            let normal = primitive.normals.get(i).map_or([0; 4], |n| {
                let [x, y, z] = n.map(|v| (v.clamp(-1.0, 1.0) * 127.0).round() as i8);
                [x, y, z, 127]
            });
            let color = primitive.colors.get(i).copied().unwrap_or([1.0; 4]);
            self.corners.push(Corner {
                position,
                normal,
                uv: uvs.and_then(|u| u.get(i)).copied().unwrap_or_default(),
                color: [0, 1, 2, 3].map(|k| {
                    let c = color[k] * look.base_color[k];
                    (c.clamp(0.0, 1.0) * 65535.0).round() as u16
                }),
                emissive,
                part,
            });
        }
        let first = self.indices.len() as u32;
        self.indices.extend(order.iter().map(|&i| base + i));
        let texture = look
            .texture
            .and_then(|t| self.texture_of.get(t as usize))
            .copied()
            .filter(|_| uvs.is_some());
        let texture = texture.unwrap_or(0);
        Span {
            first,
            n: order.len() as u32,
            texture,
            finish: if look.cutoff > 0.0 {
                Finish::Masked
            } else if texture > 0 {
                Finish::Textured
            } else {
                Finish::Plain
            },
            is_smooth: primitive.normals.len() == primitive.positions.len(),
            is_transparent: look.is_transparent,
        }
    }
}

impl GpuWorld {
    /// Puts a world on the adapter. `sight` was made of the same world.
    ///
    /// Pictures that are missing or damaged are drawn as their material's color.
    ///
    /// # Errors
    ///
    /// A world larger than the adapter's buffers.
    pub fn load(gpu: &Gpu, world: &World, sight: &Sight) -> Result<Self, RenderError> {
        Self::load_with(gpu, world, sight, false)
    }

    /// The same with levels of detail for objects: see [`Sparing::lod`](crate::Sparing::lod). Takes about half a
    /// minute for each million triangles of meshes, nearly all of it to measure how far levels are off.
    ///
    /// # Errors
    ///
    /// As [`GpuWorld::load`].
    pub fn load_with_levels(gpu: &Gpu, world: &World, sight: &Sight) -> Result<Self, RenderError> {
        Self::load_with(gpu, world, sight, true)
    }

    fn load_with(
        gpu: &Gpu,
        world: &World,
        sight: &Sight,
        has_levels: bool,
    ) -> Result<Self, RenderError> {
        let mut looks: Vec<Look> = world.materials.iter().map(Look::of).collect();
        looks.push(Look::default());
        let (textures, texture_of, n_missing_pictures) = load_textures(gpu, world, &looks)?;
        let mut filling = Filling {
            world,
            looks,
            texture_of,
            corners: Vec::new(),
            indices: Vec::new(),
            cell_colors: Vec::new(),
        };
        let batches = filling.add_batches(sight);
        let meshes = filling.add_meshes(has_levels);
        let (instances, details) = placed(world);
        let chunks: Vec<Span> = sight
            .chunks()
            .iter()
            .map(|c| Span {
                first: batches[c.batch as usize].first + c.first_index,
                n: c.n_indices,
                ..batches[c.batch as usize]
            })
            .collect();
        let bounds = bounds_of(world, &details);
        let storage = wgpu::BufferUsages::STORAGE;
        let buffer = |what, bytes: &[u8], usage| make_buffer(gpu, what, bytes, usage);
        let corners = bytemuck::cast_slice(&filling.corners);
        let indices = bytemuck::cast_slice(&filling.indices);
        Ok(Self {
            corners: buffer("the world's corners", corners, wgpu::BufferUsages::VERTEX)?,
            indices: buffer("the world's indices", indices, wgpu::BufferUsages::INDEX)?,
            cell_colors: buffer("parts", bytemuck::cast_slice(&filling.cell_colors), storage)?,
            instances,
            textures,
            chunks,
            batch_of: sight.chunks().iter().map(|c| c.batch).collect(),
            batch_cells: world.batches.iter().map(|b| b.cells.clone()).collect(),
            meshes,
            details,
            bounds,
            outlines: world
                .graph
                .portals
                .iter()
                .map(|p| p.outline.clone())
                .collect(),
            cell_looks: filling.cell_looks(),
            n_triangles: sight.n_triangles(),
            n_missing_pictures,
        })
    }

    /// The level that an object is drawn at, to be off by `lod` pixels at most. `pixels` tells how many a meter has.
    pub(crate) fn level(&self, placed: &Placed, lod: f32, pixels: impl FnOnce() -> f32) -> u32 {
        let levels = self.meshes.get(placed.mesh as usize).map_or(&[][..], |l| l);
        if lod <= 0.0 || levels.len() < 2 {
            return 0;
        }
        let scale = placed.stretch * pixels();
        // Not a number where the eye is in the object: the finest.
        let n = levels.partition_point(|l| l.error * scale <= lod);
        n.saturating_sub(1) as u32
    }

    /// What is drawn in a portal instead of what is behind it.
    pub(crate) fn stand_in(&self, portal: PortalId, cell: CellId) -> Mark {
        let [r, g, b] = self
            .cell_looks
            .get(cell.0 as usize)
            .copied()
            .unwrap_or_default();
        Mark {
            shape: Shape::Area(
                self.outlines
                    .get(portal.0 as usize)
                    .cloned()
                    .unwrap_or_default(),
            ),
            color: [r, g, b, 1.0],
            width: 0.0,
            on_top: false,
        }
    }

    /// Triangles of structure and placed objects.
    #[must_use]
    pub fn n_triangles(&self) -> u64 {
        self.n_triangles
    }

    /// Pictures of textures that are missing or damaged.
    #[must_use]
    pub fn n_missing_pictures(&self) -> u32 {
        self.n_missing_pictures
    }

    /// Least and greatest corner of all that is drawn; of an empty world, a box around its origin.
    /// [Units: wu]
    #[must_use]
    pub fn bounds(&self) -> [[f32; 3]; 2] {
        self.bounds.map(|p| p.to_array())
    }

    /// The chunk of a structural triangle, by its number in an id picture.
    #[must_use]
    pub fn chunk_of_triangle(&self, triangle: u32) -> Option<u32> {
        // Chunks come in ascending order of their ranges.
        let at = self
            .chunks
            .partition_point(|c| c.first + c.n <= triangle * 3);
        let chunk = self.chunks.get(at)?;
        (chunk.first <= triangle * 3).then_some(at as u32)
    }

    /// The batch of a chunk, and the triangle's place in it as [`Sight::indices`] orders them.
    #[must_use]
    pub fn batch_of_chunk(&self, chunk: u32) -> Option<u32> {
        self.batch_of.get(chunk as usize).copied()
    }
}

impl Filling<'_> {
    fn add_batches(&mut self, sight: &Sight) -> Vec<Span> {
        let batches = &self.world.batches;
        batches
            .iter()
            .enumerate()
            .map(|(i, batch)| {
                let order = sight.indices(i as u32);
                self.add(&batch.primitive, order, color_of(&batch.cells))
            })
            .collect()
    }

    /// The mean color of what is seen of each cell's surfaces, by area, in the light of the sky.
    fn cell_looks(&self) -> Vec<[f32; 3]> {
        const SKY: f32 = 0.55;
        let mut sums = vec![[0.0; 4]; self.world.graph.cells.len()];
        for batch in &self.world.batches {
            let color = self.look(&batch.primitive).base_color;
            let corner = |i: u32| Vec3::from(batch.primitive.positions[i as usize]);
            let triangles = batch.primitive.indices.chunks_exact(3);
            let area: f32 = triangles
                .map(|t| {
                    let [a, b, c] = [t[0], t[1], t[2]].map(corner);
                    (b - a).cross(c - a).length() * 0.5
                })
                .sum();
            for cell in &batch.cells {
                if let Some(sum) = sums.get_mut(cell.0 as usize) {
                    for k in 0..3 {
                        sum[k] += color[k] * area;
                    }
                    sum[3] += area;
                }
            }
        }
        let mean =
            |s: [f32; 4]| [0, 1, 2].map(|k| SKY * if s[3] > 0.0 { s[k] / s[3] } else { 0.8 });
        sums.into_iter().map(mean).collect()
    }

    fn add_meshes(&mut self, has_levels: bool) -> Vec<Vec<Level>> {
        let meshes = &self.world.detail_meshes;
        meshes
            .iter()
            .map(|mesh| {
                let parts: Vec<&Primitive> = mesh
                    .primitives
                    .iter()
                    .filter(|p| !p.indices.is_empty())
                    .collect();
                // Where the corners of each part begin.
                let mut bases = Vec::new();
                let spans = parts
                    .iter()
                    .map(|p| {
                        bases.push(self.corners.len() as u32);
                        self.add(p, &p.indices, 0)
                    })
                    .collect();
                let mut levels = vec![Level { error: 0.0, spans }];
                let coarser = if has_levels {
                    coarser(&parts)
                } else {
                    Vec::new()
                };
                for less in coarser {
                    let spans = (levels[0].spans.clone().into_iter())
                        .zip(bases.iter().zip(&less.indices))
                        .map(|(span, (base, order))| {
                            let first = self.indices.len() as u32;
                            self.indices.extend(order.iter().map(|&i| base + i));
                            Span {
                                first,
                                n: order.len() as u32,
                                ..span
                            }
                        })
                        .collect();
                    levels.push(Level {
                        error: less.error as f32,
                        spans,
                    });
                }
                levels
            })
            .collect()
    }
}

fn placed(world: &World) -> (Vec<Instance>, Vec<Placed>) {
    // The first is where structure stands: where it is.
    let mut instances = vec![Instance {
        rows: [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ],
        key: 0,
        color: packed([0.35; 3]),
    }];
    let mut details = Vec::new();
    for detail in &world.details {
        let m = Mat4::from_cols_array(&detail.transform);
        instances.push(Instance {
            rows: [m.row(0), m.row(1), m.row(2)].map(|r| r.to_array()),
            key: 0,
            color: color_of(&detail.cells),
        });
        let mut low = Vec3::INFINITY;
        let mut high = Vec3::NEG_INFINITY;
        let mesh = world.detail_meshes.get(detail.mesh as usize);
        for p in mesh.iter().flat_map(|m| &m.primitives) {
            for &q in &p.positions {
                let q = m.transform_point3(q.into());
                (low, high) = (low.min(q), high.max(q));
            }
        }
        let is_empty = low.x > high.x;
        details.push(Placed {
            mesh: detail.mesh,
            cells: detail.cells.clone(),
            center: if is_empty {
                m.w_axis.truncate()
            } else {
                (low + high) * 0.5
            },
            radius: if is_empty {
                0.0
            } else {
                (high - low).length() * 0.5
            },
            stretch: stretch(&m),
        });
    }
    (instances, details)
}

/// How much longer a map can make a length, at most; exact where its axes stay at right angles.
fn stretch(m: &Mat4) -> f32 {
    let axes = [m.x_axis, m.y_axis, m.z_axis].map(Vec4::truncate);
    // The greatest eigenvalue of the matrix of these products is its square; Gershgorin's bound on that.
    let rows = axes.map(|a| axes.iter().map(|b| a.dot(*b).abs()).sum::<f32>());
    rows.into_iter().fold(0.0, f32::max).sqrt()
}

fn bounds_of(world: &World, details: &[Placed]) -> [Vec3; 2] {
    let mut low = Vec3::INFINITY;
    let mut high = Vec3::NEG_INFINITY;
    for p in world.batches.iter().flat_map(|b| &b.primitive.positions) {
        (low, high) = (low.min((*p).into()), high.max((*p).into()));
    }
    for d in details {
        (low, high) = (low.min(d.center - d.radius), high.max(d.center + d.radius));
    }
    if low.is_finite() && high.is_finite() && low.x <= high.x {
        [low, high]
    } else {
        [Vec3::NEG_ONE, Vec3::ONE]
    }
}

fn make_buffer(
    gpu: &Gpu,
    what: &'static str,
    bytes: &[u8],
    usage: wgpu::BufferUsages,
) -> Result<wgpu::Buffer, RenderError> {
    let limits = gpu.device.limits();
    Gpu::check(what, bytes.len() as u64, limits.max_buffer_size)?;
    Gpu::check(
        what,
        bytes.len() as u64,
        limits.max_storage_buffer_binding_size,
    )?;
    // A buffer must not be empty; 64 bytes are as large as the largest element.
    let empty = [0; 64];
    let contents = if bytes.is_empty() { &empty } else { bytes };
    Ok(gpu
        .device
        .create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(what),
            contents,
            usage: usage | wgpu::BufferUsages::STORAGE,
        }))
}

/// The layout of a texture's bind group.
pub(crate) fn texture_layout(gpu: &Gpu) -> wgpu::BindGroupLayout {
    gpu.device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("texture"),
            entries: &[
                wgpu::BindGroupLayoutEntry {
                    binding: 0,
                    visibility: wgpu::ShaderStages::FRAGMENT,
                    ty: wgpu::BindingType::Texture {
                        sample_type: wgpu::TextureSampleType::Float { filterable: true },
                        view_dimension: wgpu::TextureViewDimension::D2,
                        multisampled: false,
                    },
                    count: None,
                },
                wgpu::BindGroupLayoutEntry {
                    binding: 1,
                    visibility: wgpu::ShaderStages::FRAGMENT,
                    ty: wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
                    count: None,
                },
            ],
        })
}

/// The textures that materials use; by texture of the world, which of them; how many are missing.
fn load_textures(
    gpu: &Gpu,
    world: &World,
    looks: &[Look],
) -> Result<(Vec<wgpu::BindGroup>, Vec<u32>, u32), RenderError> {
    let layout = texture_layout(gpu);
    let white = image::RgbaImage::from_pixel(1, 1, image::Rgba([255; 4]));
    let repeat = [wgpu::AddressMode::Repeat; 2];
    let mut groups = vec![texture_group(gpu, &layout, &[white], repeat)?];
    let mut texture_of = vec![0; world.textures.len()];
    let mut n_missing = 0;
    for look in looks {
        let Some(t) = look.texture else { continue };
        if texture_of.get(t as usize).is_none_or(|&g| g != 0) {
            continue;
        }
        match decode(world, t) {
            Some(picture) => {
                texture_of[t as usize] = groups.len() as u32;
                let wrap = wrapping(world, t);
                groups.push(texture_group(gpu, &layout, &picture.levels, wrap)?);
            }
            None => n_missing += 1,
        }
    }
    Ok((groups, texture_of, n_missing))
}

fn texture_group(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    levels: &[image::RgbaImage],
    wrap: [wgpu::AddressMode; 2],
) -> Result<wgpu::BindGroup, RenderError> {
    let (width, height) = levels[0].dimensions();
    Gpu::check(
        "a texture's side",
        width.max(height).into(),
        gpu.device.limits().max_texture_dimension_2d,
    )?;
    let size = wgpu::Extent3d {
        width,
        height,
        depth_or_array_layers: 1,
    };
    let texels: Vec<u8> = levels
        .iter()
        .flat_map(|l| l.as_raw().iter().copied())
        .collect();
    let texture = gpu.device.create_texture_with_data(
        &gpu.queue,
        &wgpu::TextureDescriptor {
            label: Some("base color"),
            size,
            mip_level_count: levels.len() as u32,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8UnormSrgb,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        },
        wgpu::util::TextureDataOrder::MipMajor,
        &texels,
    );
    let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        address_mode_u: wrap[0],
        address_mode_v: wrap[1],
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        mipmap_filter: wgpu::MipmapFilterMode::Linear,
        ..wgpu::SamplerDescriptor::default()
    });
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    Ok(gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("base color"),
        layout,
        entries: &[
            wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::TextureView(&view),
            },
            wgpu::BindGroupEntry {
                binding: 1,
                resource: wgpu::BindingResource::Sampler(&sampler),
            },
        ],
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::Rng;
    use glam::Quat;

    #[test]
    fn no_length_grows_more_than_the_stretch_says() {
        let mut rng = Rng::new(4);
        for _ in 0..1000 {
            let mut number = || rng.range(-2.0, 2.0) as f32;
            let m = Mat4::from_cols_array(&std::array::from_fn(|_| number()));
            let v = Vec3::new(number(), number(), number());
            let long = m.transform_vector3(v).length();
            assert!(long <= stretch(&m) * v.length() * 1.0001, "{m} {v}");
        }
        let turned = Quat::from_rotation_x(0.7) * Quat::from_rotation_y(1.9);
        let m = Mat4::from_scale_rotation_translation(Vec3::new(2.0, 0.5, -3.0), turned, Vec3::ONE);
        assert!((stretch(&m) - 3.0).abs() < 1e-5);
    }
}

//! The triangles of all batches and meshes in one buffer.

use std::ops::Range;

use enfilade_cpg::{PortalId, World};
use enfilade_geom::scene::Primitive;
use enfilade_runtime::Sight;

use super::color::color_of;
use super::plug::plug;
use crate::levels::coarser;
use crate::materials::Look;

/// A vertex of a triangle, 40 bytes. The id shader reads it as ten words if it can.
///
/// It carries the material's properties: a look-up per pixel costs software more than lighting does.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Corner {
    position: [f32; 3],
    normal: [i8; 4],
    uv: [f32; 2],
    /// The material's color times the vertex's own; 16 bits, for dark colors.
    color: [u16; 4],
    /// Emission, and the least alpha that is drawn.
    emissive: [u8; 4],
    /// Color of its cell, for structure.
    cell: u32,
}

impl Corner {
    /// Returns a vertex of a prop, whose color is that of its instance.
    pub(crate) fn of_prop(position: [f32; 3], normal: [f32; 3]) -> Self {
        Self {
            position,
            normal: packed_normal(normal),
            uv: [0.0; 2],
            color: [u16::MAX; 4],
            emissive: [0; 4],
            cell: 0,
        }
    }

    pub(crate) fn position(&self) -> [f32; 3] {
        self.position
    }

    /// Returns the vertex at a share of the way to another of the same surface.
    pub(crate) fn between(&self, other: &Self, share: f32) -> Self {
        let lerp = |a: f32, b: f32| a + (b - a) * share;
        let normal = |k: usize| lerp(self.normal[k].into(), other.normal[k].into());
        Self {
            position: [0, 1, 2].map(|k| lerp(self.position[k], other.position[k])),
            normal: [0, 1, 2, 3].map(|k| normal(k).round() as i8),
            uv: [0, 1].map(|k| lerp(self.uv[k], other.uv[k])),
            ..*self
        }
    }
}

fn packed_normal(n: [f32; 3]) -> [i8; 4] {
    let [x, y, z] = n.map(|v| (v.clamp(-1.0, 1.0) * 127.0).round() as i8);
    [x, y, z, 127]
}

pub(crate) const CORNER_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<Corner>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![
        0 => Float32x3, 1 => Snorm8x4, 2 => Float32x2, 3 => Unorm16x4, 4 => Unorm8x4, 5 => Uint32
    ],
};

/// Triangles with the same state of the pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    pub(crate) first: u32,
    pub(crate) n: u32,
    /// Index into [`GpuWorld::textures`].
    pub(crate) texture: u32,
    pub(crate) finish: Finish,
    /// True if its vertices have normals.
    pub(crate) is_smooth: bool,
    pub(crate) is_transparent: bool,
}

impl Span {
    /// No triangles.
    pub(super) const NONE: Self = Self {
        first: 0,
        n: 0,
        texture: 0,
        finish: Finish::Plain,
        is_smooth: false,
        is_transparent: false,
    };

    /// Returns the spans that its triangles become if all indices of its piece are put into `ranges` in order.
    pub(super) fn put_into(self, ranges: &[Range<u32>]) -> impl Iterator<Item = Self> {
        let mut before = 0;
        ranges.iter().filter_map(move |range| {
            let own = before..before + (range.end - range.start);
            before = own.end;
            let (from, to) = (own.start.max(self.first), own.end.min(self.first + self.n));
            (from < to).then(|| Self {
                first: range.start + (from - own.start),
                n: to - from,
                ..self
            })
        })
    }
}

/// Shading that a surface needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Finish {
    Plain = 0,
    Textured = 1,
    /// With transparent texels.
    Masked = 2,
}

/// A version of a detail mesh.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    /// Largest distance between its surface and the original. [Units: wu of the mesh]
    pub(crate) error: f32,
    /// One entry per primitive.
    pub(crate) spans: Vec<Span>,
}

/// The looks of a world's surfaces.
#[derive(Default)]
pub(super) struct Dress {
    /// For each material.
    pub(super) looks: Vec<Look>,
    /// For each texture of the world, index into [`super::GpuWorld::textures`], 0 for none.
    pub(super) texture_of: Vec<u32>,
}

impl Dress {
    fn look(&self, primitive: &Primitive) -> Look {
        let look = primitive.material.and_then(|m| self.looks.get(m as usize));
        look.copied().unwrap_or_default()
    }

    /// Returns the mean color of the surfaces of each cell, by area, in the light of the sky.
    pub(super) fn cell_looks(&self, world: &World, sight: &Sight) -> Vec<[f32; 3]> {
        const SKY: f32 = 0.55;
        let mut sums = vec![[0.0; 4]; world.graph.cells.len()];
        for (i, batch) in (0..).zip(&world.batches) {
            let color = self.look(&batch.primitive).base_color;
            let area = sight.batch_area(i);
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
}

/// Collects the contents of the buffers for upload.
pub(super) struct Filling<'d> {
    dress: &'d Dress,
    pub(super) corners: Vec<Corner>,
    pub(super) indices: Vec<u32>,
}

impl<'d> Filling<'d> {
    pub(super) fn new(dress: &'d Dress) -> Self {
        Self {
            dress,
            corners: Vec::new(),
            indices: Vec::new(),
        }
    }

    /// Adds a primitive's triangles by `order`, indices of its positions; returns their span.
    pub(super) fn add(&mut self, primitive: &Primitive, order: &[u32], cell: u32) -> Span {
        let look = self.dress.look(primitive);
        self.add_dressed(primitive, order, cell, &look)
    }

    fn add_dressed(
        &mut self,
        primitive: &Primitive,
        order: &[u32],
        cell: u32,
        look: &Look,
    ) -> Span {
        let [r, g, b] = look.emissive;
        let emissive = [r, g, b, look.cutoff].map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8);
        let uvs = primitive.uvs.get(look.uv_set);
        let base = self.corners.len() as u32;
        // An alpha of 0 marks bare surfaces for the shader; that of other opaque ones is ignored.
        let is_bare = look.is_bare && primitive.colors.is_empty();
        let is_opaque = !look.is_transparent && look.cutoff <= 0.0;
        for (i, &position) in primitive.positions.iter().enumerate() {
            let normal = primitive.normals.get(i);
            let normal = normal.map_or([0; 4], |n| packed_normal(*n));
            let mut color = primitive.colors.get(i).copied().unwrap_or([1.0; 4]);
            color = [0, 1, 2, 3].map(|k| color[k] * look.base_color[k]);
            if is_opaque {
                color[3] = if is_bare { 0.0 } else { 1.0 };
            }
            self.corners.push(Corner {
                position,
                normal,
                uv: uvs.and_then(|u| u.get(i)).copied().unwrap_or_default(),
                color: color.map(|c| (c.clamp(0.0, 1.0) * 65535.0).round() as u16),
                emissive,
                cell,
            });
        }
        let first = self.indices.len() as u32;
        self.indices.extend(order.iter().map(|&i| base + i));
        let texture = look
            .texture
            .and_then(|t| self.dress.texture_of.get(t as usize))
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

    pub(super) fn add_batches(&mut self, world: &World, sight: &Sight) -> Vec<Span> {
        (world.batches.iter())
            .enumerate()
            .map(|(i, batch)| {
                let order = sight.indices(i as u32);
                self.add(
                    &batch.primitive,
                    order,
                    color_of(&world.graph, &batch.cells),
                )
            })
            .collect()
    }

    /// Adds the plugs; returns their spans by portal.
    pub(super) fn add_plugs(&mut self, world: &World, sight: &Sight) -> Vec<Span> {
        let look = Look {
            base_color: super::plug::COLOR,
            is_bare: false,
            ..Look::default()
        };
        (0..world.graph.portals.len() as u32)
            .map(|p| {
                let plug = plug(world, sight, PortalId(p));
                self.add_dressed(&plug, &plug.indices, color_of(&world.graph, &[]), &look)
            })
            .collect()
    }

    /// Adds the parts of a mesh that have triangles; returns their spans.
    pub(super) fn add_mesh<'p>(&mut self, parts: impl Iterator<Item = &'p Primitive>) -> Vec<Span> {
        let parts = parts.filter(|p| !p.indices.is_empty());
        parts.map(|p| self.add(p, &p.indices, 0)).collect()
    }

    pub(super) fn add_meshes(&mut self, world: &World, has_levels: bool) -> Vec<Vec<Level>> {
        (world.detail_meshes.iter())
            .map(|mesh| {
                let parts: Vec<&Primitive> = mesh
                    .primitives
                    .iter()
                    .filter(|p| !p.indices.is_empty())
                    .collect();
                let mut next = self.corners.len() as u32;
                let spans = self.add_mesh(parts.iter().copied());
                // First vertex of each primitive.
                let bases = parts.iter().map(|p| {
                    next += p.positions.len() as u32;
                    next - p.positions.len() as u32
                });
                let bases: Vec<u32> = bases.collect();
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

/// Returns the positions of the vertices of triangles, three each.
pub(super) fn listed(corners: &[Corner], indices: &[u32]) -> Vec<[f32; 3]> {
    let position = |&i: &u32| corners[i as usize].position;
    indices.iter().map(position).collect()
}

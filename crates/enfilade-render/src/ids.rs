//! Id pictures: the triangle visible at each pixel, and its depth.
//!
//! They are drawn through the same lists as color pictures, scissors included, so that a test of culling tests real
//! frames. There are two layers: opaque surfaces, and the nearest transparent one.

use enfilade_cpg::PortalId;

use crate::camera::Projection;
use crate::formats::ID;
use crate::gpu::{Gpu, RenderError};
use crate::list::RenderList;
use crate::renderer::Renderer;
use crate::resources::{bound, color_attachment, depth_attachment, read_texture, texture};
use crate::scene::GpuWorld;
use crate::stage::RenderStage;

/// The object visible at one pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum PixelContent {
    /// The sky.
    Sky,
    /// A structural triangle.
    Structure {
        /// Index of the triangle among all; see [`GpuWorld::chunk_of_triangle`].
        triangle: u32,
    },
    /// A triangle of a detail object.
    Detail {
        /// Index into `World::details`.
        detail: u32,
        /// Index of the triangle among all.
        triangle: u32,
    },
    /// The plug of a shut portal.
    Plug {
        /// The portal.
        portal: PortalId,
    },
}

/// A picture of ids.
#[derive(Clone, Debug, PartialEq)]
pub struct IdPicture {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// For each pixel, the visible object and its depth (1 at the near plane, 0 at infinity).
    pub pixels: Vec<(PixelContent, f32)>,
}

/// The pixels in which two id pictures differ.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Difference {
    /// Number of all pixels.
    pub n_pixels: u64,
    /// Pixels that show a different object.
    pub lost: Vec<LostPixel>,
}

/// A pixel that shows a different object than expected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LostPixel {
    /// Column and row.
    pub at: [u32; 2],
    /// The expected object and its depth.
    pub expected: (PixelContent, f32),
    /// The visible object and its depth.
    pub found: (PixelContent, f32),
}

impl IdPicture {
    /// Returns the object visible at a pixel, and its depth.
    ///
    /// # Panics
    ///
    /// If the pixel lies outside the picture.
    #[must_use]
    pub fn at(&self, [x, y]: [u32; 2]) -> (PixelContent, f32) {
        self.pixels[y as usize * self.width as usize + x as usize]
    }

    /// Returns the differences of `found` from this, the expected picture.
    ///
    /// # Panics
    ///
    /// If sizes differ.
    #[must_use]
    pub fn difference(&self, found: &Self) -> Difference {
        assert_eq!(self.pixels.len(), found.pixels.len(), "sizes differ");
        let mut out = Difference {
            n_pixels: self.pixels.len() as u64,
            ..Difference::default()
        };
        for (i, (a, b)) in self.pixels.iter().zip(&found.pixels).enumerate() {
            if a.0 == b.0 {
                continue;
            }
            let i = i as u32;
            out.lost.push(LostPixel {
                at: [i % self.width, i / self.width],
                expected: *a,
                found: *b,
            });
        }
        out
    }
}

impl Renderer {
    /// Draws both id pictures of a list: opaque surfaces, and the nearest transparent one. Where two triangles
    /// coincide, the one listed first wins.
    pub(crate) fn ids(
        &mut self,
        gpu: &Gpu,
        world: &GpuWorld,
        stage: &mut RenderStage,
        projection: &Projection,
        list: &RenderList,
        size: [u32; 2],
    ) -> Result<[IdPicture; 2], RenderError> {
        self.resize(gpu, size)?;
        self.write_camera(gpu, projection, size);
        stage.write_instances(gpu, world, list);
        let entries = [
            bound(0, &self.camera.buffer),
            bound(1, &world.triangles.corners),
            bound(2, &world.triangles.indices),
        ];
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("ids"),
            layout: &self.layouts.ids,
            entries: if world.triangles.listed.is_some() {
                &entries[..1]
            } else {
                &entries
            },
        });
        let target = || texture(gpu, "ids", size, ID, wgpu::TextureUsages::COPY_SRC);
        let layers = [target(), target()];
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        if let Some(targets) = &self.targets {
            for (i, runs) in [&list.opaque, &list.transparent].into_iter().enumerate() {
                let view = layers[i].create_view(&wgpu::TextureViewDescriptor::default());
                // Transparent surfaces are drawn over the depth of the opaque ones.
                let depth = (i == 0).then_some(0.0);
                let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some("ids"),
                    color_attachments: &[Some(color_attachment(
                        &view,
                        Some(wgpu::Color::TRANSPARENT),
                    ))],
                    depth_stencil_attachment: Some(depth_attachment(&targets.depth, depth)),
                    ..wgpu::RenderPassDescriptor::default()
                });
                pass.set_pipeline(&self.pipelines.id);
                pass.set_bind_group(0, &group, &[]);
                pass.set_vertex_buffer(0, stage.first().instances.buffer.slice(..));
                if let Some(listed) = &world.triangles.listed {
                    pass.set_vertex_buffer(1, listed.slice(..));
                }
                for run in runs {
                    let [x, y, w, h] = run.scissor.unwrap_or([0, 0, size[0], size[1]]);
                    pass.set_scissor_rect(x, y, w, h);
                    pass.draw(run.first..run.first + run.n, run.instances.clone());
                }
            }
        }
        gpu.queue.submit([encoder.finish()]);
        let [a, b] = &layers;
        Ok([
            read_ids(gpu, world, a, size)?,
            read_ids(gpu, world, b, size)?,
        ])
    }
}

fn read_ids(
    gpu: &Gpu,
    world: &GpuWorld,
    texture: &wgpu::Texture,
    size: [u32; 2],
) -> Result<IdPicture, RenderError> {
    let bytes = read_texture(gpu, texture, size, 16)?;
    let pixels = bytes
        .chunks_exact(16)
        .map(|p| {
            let word = |i: usize| u32::from_le_bytes([p[i], p[i + 1], p[i + 2], p[i + 3]]);
            let triangle = word(4);
            let shown = match word(0) {
                0 => PixelContent::Sky,
                1 => match world.portal_of_plug(triangle) {
                    Some(portal) => PixelContent::Plug { portal },
                    None => PixelContent::Structure { triangle },
                },
                n => PixelContent::Detail {
                    detail: n - 2,
                    triangle,
                },
            };
            (shown, f32::from_bits(word(8)))
        })
        .collect();
    Ok(IdPicture {
        width: size[0],
        height: size[1],
        pixels,
    })
}

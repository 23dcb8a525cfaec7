//! The polygons of special portals: their vertices, and the pipelines that draw them.
//!
//! Each pixel of a picture is in the region of one context; the stencil holds its number. A special portal's polygon takes
//! pixels of its context's region, where nothing hides it, for the context that is seen in it; when that one is drawn, it
//! gives them back, with its own depth.

use enfilade_geom::DVec3;
use enfilade_world::Opening;

use crate::camera::{Camera, Projection};
use crate::gpu::Gpu;
use crate::list::Scissor;
use crate::pipelines::{
    CHOSEN, Kind, Layouts, MARK_LAYOUT, NEARER, REGION, SKY, Stencil, pipeline, shader,
};

/// Least distance of an eye from a special portal's plane, as drawn. An eye in the opening is this far before it. [Units: wu]
const AT_EYE: f64 = 1e-6;

/// Share of its distance by which a polygon counts as nearer, so that it wins over a wall in which it lies.
const LIFT: f64 = 2e-5;

/// A vertex of a polygon, laid out as in `panes.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct PaneCorner {
    /// Relative to the eye; w: 1 before the near plane.
    position: [f32; 4],
    /// Place in a monitor's picture, or the first pixel of a picture that was kept.
    uv: [f32; 2],
    /// Linear factors; the last is the share by which it covers what was there.
    color: [f32; 4],
}

pub(crate) const PANE_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<PaneCorner>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![0 => Float32x4, 1 => Float32x2, 2 => Float32x4],
};

/// A special portal's polygon as seen from an eye.
pub(crate) struct Pane<'a> {
    pub(crate) opening: Opening<'a>,
    /// A vertex and the edges, to the right and up, of the rectangle that a monitor's picture fills.
    pub(crate) rectangle: [DVec3; 3],
    /// In the frame of the opening.
    pub(crate) projection: &'a Projection,
    /// Plane before which nothing is seen, relative to the eye.
    pub(crate) gate: Option<(DVec3, f64)>,
    /// Deviation of stored planes. [Units: wu]
    pub(crate) tolerance: f64,
}

impl Pane<'_> {
    /// Returns the height of the eye before the plane. [Units: wu]
    pub(crate) fn height(&self) -> f64 {
        -self.opening.height_of(self.projection.exact_origin())
    }

    /// Returns the triangles of the polygon, to be shown with a picture of the same camera of which only a part was kept.
    pub(crate) fn corners_at(&self, color: [f32; 4], [x, y, ..]: Scissor) -> Vec<PaneCorner> {
        let uv = [x as f32, y as f32];
        let corners = self.corners(color).into_iter();
        corners.map(|corner| PaneCorner { uv, ..corner }).collect()
    }

    /// Returns the triangles of the polygon.
    pub(crate) fn corners(&self, color: [f32; 4]) -> Vec<PaneCorner> {
        let eye = self.projection.exact_origin();
        let height = self.height();
        // Moved on, so that an eye in the opening is before it.
        let shift = self.opening.normal() * (AT_EYE.max(self.tolerance) - height).max(0.0);
        let lift = 1.0 - (LIFT + 2.0 * self.tolerance / height.abs().max(AT_EYE)).min(0.5);
        let ahead = self.projection.ahead();
        let near = f64::from(Camera::NEAR);
        let mut out = Vec::new();
        for piece in self.opening.pieces() {
            let mut points: Vec<DVec3> = piece.iter().map(|p| *p - eye + shift).collect();
            if let Some((n, h)) = self.gate {
                points = clipped(&points, |p| n.dot(p) - h);
            }
            // Parted beyond the near plane, so that the adapter cuts neither: both then have the same vertices at the seam, which
            // leaves no gap, and nothing is blended twice.
            let depth = |p: DVec3| ahead.dot(p) * lift - 1.01 * near;
            let far = clipped(&points, depth);
            let close = clipped(&points, |p| -depth(p));
            let close = clipped(&close, |p| ahead.dot(p) - 1e-3 * AT_EYE);
            for (polygon, is_close) in [(far, false), (close, true)] {
                let corner = |p: DVec3| {
                    let at = p - shift + eye - self.rectangle[0];
                    let [u, v] = [self.rectangle[1], self.rectangle[2]]
                        .map(|edge| (edge.dot(at) / edge.length_squared()) as f32);
                    let [x, y, z] = (p * lift).as_vec3().to_array();
                    PaneCorner {
                        position: [x, y, z, f32::from(u8::from(is_close))],
                        uv: [u, 1.0 - v],
                        color,
                    }
                };
                for i in 2..polygon.len() {
                    out.extend([polygon[0], polygon[i - 1], polygon[i]].map(corner));
                }
            }
        }
        out
    }
}

/// Returns the part of a convex polygon where `height` is at least 0.
fn clipped(polygon: &[DVec3], height: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (i, &b) in polygon.iter().enumerate() {
        let a = polygon[(i + polygon.len() - 1) % polygon.len()];
        let (from, to) = (height(a), height(b));
        if (from < 0.0) != (to < 0.0) {
            out.push(a.lerp(b, from / (from - to)));
        }
        if to >= 0.0 {
            out.push(b);
        }
    }
    out
}

/// Chooses pixels of a region.
const CHOOSES: Stencil = Stencil {
    writes: CHOSEN,
    ..Stencil::IN_REGION
};

/// Gives chosen pixels to a region. The reference is without the bit: pixels that differ are chosen.
const TAKES: Stencil = Stencil {
    compare: wgpu::CompareFunction::NotEqual,
    reads: CHOSEN,
    writes: REGION | CHOSEN,
};

/// Pipelines for pictures of one format.
pub(crate) struct PanePipelines {
    /// Depth of polygons, where nothing hides them.
    pub(crate) depth: wgpu::RenderPipeline,
    /// Chooses the pixels where a polygon is nearest.
    pub(crate) choose: wgpu::RenderPipeline,
    /// Makes the chosen pixels a region, and empties it.
    pub(crate) open: wgpu::RenderPipeline,
    pub(crate) sky: wgpu::RenderPipeline,
    /// Polygons of one color.
    pub(crate) fill: wgpu::RenderPipeline,
    /// Polygons with a picture of a camera.
    pub(crate) monitor: wgpu::RenderPipeline,
    /// Chooses the pixels of a region.
    pub(crate) choose_region: wgpu::RenderPipeline,
    /// Gives chosen pixels to another region, with the polygon's depth and tint.
    pub(crate) close: wgpu::RenderPipeline,
    /// Tinted polygons.
    pub(crate) tint: wgpu::RenderPipeline,
    /// Polygons blended over what was there, with a picture of a camera.
    pub(crate) over_monitor: wgpu::RenderPipeline,
    /// The same, with a picture of this camera's.
    pub(crate) over: wgpu::RenderPipeline,
    /// Copies a picture.
    pub(crate) copy: wgpu::RenderPipeline,
    /// Marks hidden by surfaces.
    pub(crate) marks: wgpu::RenderPipeline,
    pub(crate) marks_on_top: wgpu::RenderPipeline,
    /// The effects of a whole picture that has its sky.
    pub(crate) post: wgpu::RenderPipeline,
}

impl PanePipelines {
    pub(crate) fn new(gpu: &Gpu, layouts: &Layouts, format: wgpu::TextureFormat) -> Self {
        use wgpu::CompareFunction::{Always, Equal, GreaterEqual};
        let module = shader(gpu, "panes", &[SKY, include_str!("shaders/panes.wgsl")]);
        let polygon = Kind {
            label: "pane",
            module: &module,
            vertex: "pane",
            fragment: Some("filled"),
            layouts: &[&layouts.globals],
            buffers: &[PANE_LAYOUT],
            target: Some((format, None)),
            depth: Some((true, NEARER)),
            constants: &[],
            stencil: Some(Stencil::IN_REGION),
            writes_color: true,
        };
        let pictured = Kind {
            layouts: &[&layouts.globals, &layouts.texture],
            fragment: Some("shown"),
            ..polygon
        };
        let over = Kind {
            target: Some((format, Some(wgpu::BlendState::ALPHA_BLENDING))),
            depth: Some((false, GreaterEqual)),
            ..pictured
        };
        let screen = Kind {
            vertex: "whole",
            buffers: &[],
            ..polygon
        };
        let [marks, marks_on_top] = marks(gpu, layouts, format);
        let make = |kind| pipeline(gpu, &kind);
        Self {
            depth: make(Kind {
                writes_color: false,
                ..polygon
            }),
            choose: make(Kind {
                depth: Some((false, Equal)),
                stencil: Some(CHOOSES),
                writes_color: false,
                ..polygon
            }),
            open: make(Kind {
                fragment: Some("far_away"),
                depth: Some((true, Always)),
                stencil: Some(TAKES),
                writes_color: false,
                ..screen
            }),
            sky: make(Kind {
                fragment: Some("open_air"),
                depth: Some((false, GreaterEqual)),
                ..screen
            }),
            fill: make(polygon),
            monitor: make(pictured),
            choose_region: make(Kind {
                fragment: Some("far_away"),
                depth: Some((false, Always)),
                stencil: Some(CHOOSES),
                writes_color: false,
                ..screen
            }),
            close: make(Kind {
                target: Some((format, Some(multiply()))),
                depth: Some((true, Always)),
                stencil: Some(TAKES),
                ..polygon
            }),
            tint: make(Kind {
                target: Some((format, Some(multiply()))),
                depth: Some((false, GreaterEqual)),
                ..polygon
            }),
            over_monitor: make(over),
            over: make(Kind {
                fragment: Some("seen_through"),
                ..over
            }),
            copy: make(Kind {
                label: "copy",
                fragment: Some("copied"),
                depth: None,
                stencil: None,
                buffers: &[],
                vertex: "whole",
                ..pictured
            }),
            marks,
            marks_on_top,
            post: post(gpu, layouts, format),
        }
    }
}

/// Returns the blending that multiplies by the color drawn.
fn multiply() -> wgpu::BlendState {
    let component = |src_factor, dst_factor| wgpu::BlendComponent {
        src_factor,
        dst_factor,
        operation: wgpu::BlendOperation::Add,
    };
    wgpu::BlendState {
        color: component(wgpu::BlendFactor::Dst, wgpu::BlendFactor::Zero),
        alpha: component(wgpu::BlendFactor::Zero, wgpu::BlendFactor::One),
    }
}

/// Makes the pipelines of marks: hidden by surfaces, and on top.
fn marks(gpu: &Gpu, layouts: &Layouts, format: wgpu::TextureFormat) -> [wgpu::RenderPipeline; 2] {
    use wgpu::CompareFunction::{Always, GreaterEqual};
    let lines = shader(gpu, "lines", &[include_str!("shaders/lines.wgsl")]);
    [GreaterEqual, Always].map(|compare| {
        let kind = Kind {
            label: "marks",
            module: &lines,
            vertex: "corner",
            fragment: Some("mark"),
            layouts: &[&layouts.globals],
            buffers: &[MARK_LAYOUT],
            target: Some((format, Some(wgpu::BlendState::ALPHA_BLENDING))),
            depth: Some((false, compare)),
            constants: &[],
            stencil: Some(Stencil {
                compare: Always,
                reads: 0,
                writes: 0,
            }),
            writes_color: true,
        };
        pipeline(gpu, &kind)
    })
}

/// Makes the pipeline of the effects of a whole picture that has its sky.
fn post(gpu: &Gpu, layouts: &Layouts, format: wgpu::TextureFormat) -> wgpu::RenderPipeline {
    let module = shader(gpu, "post", &[SKY, include_str!("shaders/post.wgsl")]);
    let kind = Kind {
        label: "post",
        module: &module,
        vertex: "whole",
        fragment: Some("finish"),
        layouts: &[&layouts.globals, &layouts.post],
        buffers: &[],
        target: Some((format, None)),
        depth: None,
        constants: &[("KEEPS_SKY", 1.0)],
        stencil: None,
        writes_color: true,
    };
    pipeline(gpu, &kind)
}

/// A picture to be shown in a polygon.
pub(crate) struct PanePicture {
    pub(crate) size: [u32; 2],
    pub(crate) format: wgpu::TextureFormat,
    texture: wgpu::Texture,
    pub(crate) view: wgpu::TextureView,
    pub(crate) group: wgpu::BindGroup,
}

impl PanePicture {
    pub(crate) fn new(
        gpu: &Gpu,
        layouts: &Layouts,
        format: wgpu::TextureFormat,
        size: [u32; 2],
    ) -> Self {
        let usage = wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC
            | wgpu::TextureUsages::COPY_DST;
        let texture = crate::resources::texture(gpu, "pane", size, format, usage);
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("pane"),
            layout: &layouts.texture,
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
        });
        Self {
            size,
            format,
            texture,
            view,
            group,
        }
    }

    /// Copies a part of `from`, which it must hold, to its first pixels.
    pub(crate) fn copy(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        from: &Self,
        [x, y, width, height]: Scissor,
    ) {
        let mut source = from.texture.as_image_copy();
        source.origin = wgpu::Origin3d { x, y, z: 0 };
        let size = wgpu::Extent3d {
            width,
            height,
            depth_or_array_layers: 1,
        };
        encoder.copy_texture_to_texture(source, self.texture.as_image_copy(), size);
    }
}

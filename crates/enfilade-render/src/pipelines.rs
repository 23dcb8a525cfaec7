//! Pipelines and layouts: made once for an adapter and a format of picture.

use crate::gpu::Gpu;
use crate::scene::{CORNER_LAYOUT, texture_layout};

pub(crate) const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
pub(crate) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
pub(crate) const ID: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;

const COMMON: &str = include_str!("shaders/common.wgsl");

pub(crate) struct Layouts {
    /// Globals, parts, materials, instances, shadow map and its sampler.
    pub(crate) world: wgpu::BindGroupLayout,
    /// Globals, instances, corners, indices.
    pub(crate) ids: wgpu::BindGroupLayout,
    /// Globals, instances.
    pub(crate) shadow: wgpu::BindGroupLayout,
    /// Globals.
    pub(crate) globals: wgpu::BindGroupLayout,
    /// Color and depth.
    pub(crate) post: wgpu::BindGroupLayout,
}

pub(crate) struct Pipelines {
    /// By [`Finish`](crate::scene::Finish).
    pub(crate) surfaces: [wgpu::RenderPipeline; 3],
    pub(crate) count: wgpu::RenderPipeline,
    pub(crate) glass: wgpu::RenderPipeline,
    pub(crate) id: wgpu::RenderPipeline,
    pub(crate) shadow: wgpu::RenderPipeline,
    pub(crate) post: wgpu::RenderPipeline,
    /// Marks that surfaces hide.
    pub(crate) marks: wgpu::RenderPipeline,
    /// Marks that nothing hides.
    pub(crate) marks_on_top: wgpu::RenderPipeline,
}

fn entry(
    binding: u32,
    visibility: wgpu::ShaderStages,
    ty: wgpu::BindingType,
) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty,
        count: None,
    }
}

fn storage(binding: u32) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Storage { read_only: true },
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    entry(binding, wgpu::ShaderStages::VERTEX_FRAGMENT, ty)
}

fn uniform(binding: u32) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    entry(binding, wgpu::ShaderStages::VERTEX_FRAGMENT, ty)
}

fn texture(binding: u32, sample_type: wgpu::TextureSampleType) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Texture {
        sample_type,
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    entry(binding, wgpu::ShaderStages::FRAGMENT, ty)
}

impl Layouts {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let layout = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
            gpu.device
                .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                    label: Some(label),
                    entries,
                })
        };
        let compare = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Comparison);
        let depth = wgpu::TextureSampleType::Depth;
        let unfiltered = wgpu::TextureSampleType::Float { filterable: false };
        Self {
            world: layout(
                "world",
                &[
                    uniform(0),
                    storage(1),
                    storage(2),
                    storage(3),
                    texture(4, depth),
                    entry(5, wgpu::ShaderStages::FRAGMENT, compare),
                ],
            ),
            ids: layout("ids", &[uniform(0), storage(3), storage(6), storage(7)]),
            shadow: layout("shadow", &[uniform(0), storage(3)]),
            globals: layout("globals", &[uniform(0)]),
            post: layout("post", &[texture(0, unfiltered), texture(1, depth)]),
        }
    }
}

/// Which number of [`crate::list::DrawList::instances`] is drawn.
const fn instance_layout(attributes: &[wgpu::VertexAttribute]) -> wgpu::VertexBufferLayout<'_> {
    wgpu::VertexBufferLayout {
        array_stride: 4,
        step_mode: wgpu::VertexStepMode::Instance,
        attributes,
    }
}

const MARK_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: 32,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![0 => Float32x4, 1 => Float32x4],
};

/// What one pipeline differs from others in.
#[derive(Clone, Copy)]
struct Kind<'a> {
    label: &'a str,
    module: &'a wgpu::ShaderModule,
    vertex: &'a str,
    fragment: Option<&'a str>,
    layouts: &'a [&'a wgpu::BindGroupLayout],
    buffers: &'a [wgpu::VertexBufferLayout<'a>],
    target: Option<(wgpu::TextureFormat, Option<wgpu::BlendState>)>,
    depth: Option<(bool, wgpu::CompareFunction)>,
}

fn pipeline(gpu: &Gpu, kind: &Kind<'_>) -> wgpu::RenderPipeline {
    let layouts: Vec<_> = kind.layouts.iter().map(|l| Some(*l)).collect();
    let layout = gpu
        .device
        .create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(kind.label),
            bind_group_layouts: &layouts,
            immediate_size: 0,
        });
    let buffers: Vec<_> = kind.buffers.iter().map(|b| Some(b.clone())).collect();
    let targets = [kind.target.map(|(format, blend)| wgpu::ColorTargetState {
        format,
        blend,
        write_mask: wgpu::ColorWrites::ALL,
    })];
    gpu.device
        .create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(kind.label),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: kind.module,
                entry_point: Some(kind.vertex),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &buffers,
            },
            // Both sides of all: models of buildings seldom say which one is meant.
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: kind.depth.map(|(writes, compare)| wgpu::DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(writes),
                depth_compare: Some(compare),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState::default(),
            fragment: kind.fragment.map(|fragment| wgpu::FragmentState {
                module: kind.module,
                entry_point: Some(fragment),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: if kind.target.is_some() { &targets } else { &[] },
            }),
            multiview_mask: None,
            cache: None,
        })
}

impl Pipelines {
    pub(crate) fn new(gpu: &Gpu, layouts: &Layouts, output: wgpu::TextureFormat) -> Self {
        let module = |label, source: &str| {
            gpu.device
                .create_shader_module(wgpu::ShaderModuleDescriptor {
                    label: Some(label),
                    source: wgpu::ShaderSource::Wgsl([COMMON, source].concat().into()),
                })
        };
        let surface = module("surface", include_str!("shaders/surface.wgsl"));
        let ids = module("ids", include_str!("shaders/ids.wgsl"));
        let depth = module("depth", include_str!("shaders/depth.wgsl"));
        let post = module("post", include_str!("shaders/post.wgsl"));
        let lines = module("lines", include_str!("shaders/lines.wgsl"));
        let texture = texture_layout(gpu);
        let instance_at = |location| {
            [wgpu::VertexAttribute {
                format: wgpu::VertexFormat::Uint32,
                offset: 0,
                shader_location: location,
            }]
        };
        let (after_corner, alone) = (instance_at(5), instance_at(0));
        let drawn = [CORNER_LAYOUT, instance_layout(&after_corner)];
        let add = wgpu::BlendComponent {
            src_factor: wgpu::BlendFactor::One,
            dst_factor: wgpu::BlendFactor::One,
            operation: wgpu::BlendOperation::Add,
        };
        let add = wgpu::BlendState {
            color: add,
            alpha: add,
        };
        let over = wgpu::BlendState::ALPHA_BLENDING;
        let nearer = wgpu::CompareFunction::Greater;
        let base = Kind {
            label: "surface",
            module: &surface,
            vertex: "corner",
            fragment: Some("plain"),
            layouts: &[&layouts.world, &texture],
            buffers: &drawn,
            target: Some((COLOR, None)),
            depth: Some((true, nearer)),
        };
        let marks = Kind {
            label: "marks",
            module: &lines,
            fragment: Some("mark"),
            layouts: &[&layouts.globals],
            buffers: &[MARK_LAYOUT],
            target: Some((output, Some(over))),
            depth: Some((false, wgpu::CompareFunction::GreaterEqual)),
            ..base
        };
        let make = |kind| pipeline(gpu, &kind);
        Self {
            count: make(Kind {
                label: "count",
                fragment: Some("count"),
                target: Some((COLOR, Some(add))),
                ..base
            }),
            glass: make(Kind {
                label: "glass",
                fragment: Some("glass"),
                target: Some((output, Some(over))),
                depth: Some((false, nearer)),
                ..base
            }),
            id: make(Kind {
                label: "id",
                module: &ids,
                fragment: Some("id"),
                layouts: &[&layouts.ids],
                buffers: &[instance_layout(&alone)],
                target: Some((ID, None)),
                ..base
            }),
            shadow: make(Kind {
                label: "shadow",
                module: &depth,
                fragment: None,
                layouts: &[&layouts.shadow],
                target: None,
                depth: Some((true, wgpu::CompareFunction::Less)),
                ..base
            }),
            post: make(Kind {
                label: "post",
                module: &post,
                vertex: "whole",
                fragment: Some("finish"),
                layouts: &[&layouts.globals, &layouts.post],
                buffers: &[],
                target: Some((output, None)),
                depth: None,
            }),
            marks_on_top: make(Kind {
                label: "marks on top",
                depth: Some((false, wgpu::CompareFunction::Always)),
                ..marks
            }),
            marks: make(marks),
            surfaces: ["plain", "textured", "masked"].map(|fragment| {
                make(Kind {
                    label: fragment,
                    fragment: Some(fragment),
                    ..base
                })
            }),
        }
    }
}

//! Pipelines and bind group layouts for an adapter and a texture format. Surface pipelines are made when a frame first
//! needs them: each omits the features that its frames do not use.

use std::collections::BTreeMap;

use crate::formats::{BLENDED, COLOR, DEPTH, DEPTH_STENCIL, ID};
use crate::gpu::Gpu;
use crate::scene::{CORNER_LAYOUT, INSTANCE_LAYOUT, texture_layout};

const COMMON: &str = include_str!("shaders/common.wgsl");
pub(crate) const SKY: &str = include_str!("shaders/sky.wgsl");

pub(crate) struct Layouts {
    /// Globals; shadow map and its sampler; the locator and the light of places; lamps and their maps.
    pub(crate) world: wgpu::BindGroupLayout,
    /// A base color texture.
    pub(crate) texture: wgpu::BindGroupLayout,
    /// Globals; vertices and indices for shaders that fetch them.
    pub(crate) ids: wgpu::BindGroupLayout,
    /// Globals.
    pub(crate) globals: wgpu::BindGroupLayout,
    /// Color and depth.
    pub(crate) post: wgpu::BindGroupLayout,
}

/// How surfaces are shaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Shading {
    Plain,
    Textured,
    /// With transparent texels.
    Masked,
    /// A pane: transparent and reflecting.
    Glass,
    /// A partly transparent texture: a leaf of a plant, a curtain.
    Sheer,
    /// Number of times that each pixel is drawn.
    Count,
}

/// The target of a pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Canvas {
    /// The intermediate target of the post pass.
    Surfaces,
    /// The picture.
    Output,
    /// A picture of finer colors, in which layers are blended.
    Blended,
}

/// Differences between surface pipelines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Variant {
    pub(crate) shading: Shading,
    pub(crate) is_smooth: bool,
    pub(crate) casts_shadows: bool,
    pub(crate) has_light: bool,
    pub(crate) explains: bool,
    /// True if the color is that of the instance.
    pub(crate) is_prop: bool,
    pub(crate) has_lamps: bool,
    pub(crate) canvas: Canvas,
    /// True if it draws in the region of one context: see `contexts.rs`.
    pub(crate) is_in_context: bool,
}

pub(crate) struct Pipelines {
    surface: wgpu::ShaderModule,
    output: wgpu::TextureFormat,
    surfaces: BTreeMap<Variant, wgpu::RenderPipeline>,
    pub(crate) id: wgpu::RenderPipeline,
    pub(crate) shadow: wgpu::RenderPipeline,
    /// Surfaces from a lamp, depth only.
    pub(crate) lamp: wgpu::RenderPipeline,
    /// Surfaces from the camera, depth only.
    pub(crate) depth: wgpu::RenderPipeline,
    /// Outlines of portals for occlusion queries.
    pub(crate) outline: wgpu::RenderPipeline,
    pub(crate) sky: wgpu::RenderPipeline,
    /// Ambient occlusion.
    pub(crate) post: wgpu::RenderPipeline,
    /// Ambient occlusion, but for pixels of portal textures, which have it.
    pub(crate) post_textured: wgpu::RenderPipeline,
    pub(crate) heat_map: wgpu::RenderPipeline,
    /// Marks hidden by surfaces.
    pub(crate) marks: wgpu::RenderPipeline,
    /// Marks on top of surfaces.
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
    entry(binding, wgpu::ShaderStages::VERTEX, ty)
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

fn volume(binding: u32, sample_type: wgpu::TextureSampleType) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Texture {
        sample_type,
        view_dimension: wgpu::TextureViewDimension::D3,
        multisampled: false,
    };
    entry(binding, wgpu::ShaderStages::FRAGMENT, ty)
}

fn layers(binding: u32) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Depth,
        view_dimension: wgpu::TextureViewDimension::D2Array,
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
        let filtering = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
        let depth = wgpu::TextureSampleType::Depth;
        let unfiltered = wgpu::TextureSampleType::Float { filterable: false };
        Self {
            world: layout(
                "world",
                &[
                    uniform(0),
                    texture(1, depth),
                    entry(2, wgpu::ShaderStages::FRAGMENT, compare),
                    texture(3, wgpu::TextureSampleType::Uint),
                    volume(4, wgpu::TextureSampleType::Sint),
                    volume(5, wgpu::TextureSampleType::Float { filterable: true }),
                    entry(6, wgpu::ShaderStages::FRAGMENT, filtering),
                    texture(7, wgpu::TextureSampleType::Uint),
                    uniform(8),
                    layers(9),
                    texture(10, wgpu::TextureSampleType::Uint),
                ],
            ),
            texture: texture_layout(gpu),
            ids: if gpu.fetches() {
                layout("ids", &[uniform(0), storage(1), storage(2)])
            } else {
                layout("ids", &[uniform(0)])
            },
            globals: layout("globals", &[uniform(0)]),
            post: layout("post", &[texture(0, unfiltered), texture(1, unfiltered)]),
        }
    }
}

pub(crate) const MARK_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: 32,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![0 => Float32x4, 1 => Float32x4],
};

/// Listed vertices of triangles, for adapters whose shaders cannot fetch them.
const LISTED_LAYOUT: wgpu::VertexBufferLayout<'static> = OUTLINE_LAYOUT;

/// Vertices of outlines in world coordinates. [Units: wu]
const OUTLINE_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: 12,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![0 => Float32x3],
};

/// Differences between pipelines.
#[derive(Clone, Copy)]
pub(crate) struct Kind<'a> {
    pub(crate) label: &'a str,
    pub(crate) module: &'a wgpu::ShaderModule,
    pub(crate) vertex: &'a str,
    pub(crate) fragment: Option<&'a str>,
    pub(crate) layouts: &'a [&'a wgpu::BindGroupLayout],
    pub(crate) buffers: &'a [wgpu::VertexBufferLayout<'a>],
    pub(crate) target: Option<(wgpu::TextureFormat, Option<wgpu::BlendState>)>,
    pub(crate) depth: Option<(bool, wgpu::CompareFunction)>,
    /// Constants of the shader.
    pub(crate) constants: &'a [(&'a str, f64)],
    /// Test of the region; `None` for passes without a stencil.
    pub(crate) stencil: Option<Stencil>,
    pub(crate) writes_color: bool,
}

/// A test of the stencil. What passes replaces the bits of `writes` by those of the reference.
#[derive(Clone, Copy)]
pub(crate) struct Stencil {
    pub(crate) compare: wgpu::CompareFunction,
    pub(crate) reads: u32,
    pub(crate) writes: u32,
}

impl Stencil {
    /// Where the region is that of the reference.
    pub(crate) const IN_REGION: Self = Self {
        compare: wgpu::CompareFunction::Equal,
        reads: REGION,
        writes: 0,
    };

    fn state(self) -> wgpu::StencilState {
        let face = wgpu::StencilFaceState {
            compare: self.compare,
            fail_op: wgpu::StencilOperation::Keep,
            depth_fail_op: wgpu::StencilOperation::Keep,
            pass_op: if self.writes == 0 {
                wgpu::StencilOperation::Keep
            } else {
                wgpu::StencilOperation::Replace
            },
        };
        wgpu::StencilState {
            front: face,
            back: face,
            read_mask: self.reads,
            write_mask: self.writes,
        }
    }
}

/// Bits of the stencil that number the region of a context.
pub(crate) const REGION: u32 = 0x7f;
/// The bit that marks pixels about to change their region.
pub(crate) const CHOSEN: u32 = 0x80;

pub(crate) fn pipeline(gpu: &Gpu, kind: &Kind<'_>) -> wgpu::RenderPipeline {
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
        write_mask: if kind.writes_color {
            wgpu::ColorWrites::ALL
        } else {
            wgpu::ColorWrites::empty()
        },
    })];
    let compilation_options = wgpu::PipelineCompilationOptions {
        constants: kind.constants,
        ..wgpu::PipelineCompilationOptions::default()
    };
    gpu.device
        .create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(kind.label),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: kind.module,
                entry_point: Some(kind.vertex),
                compilation_options: compilation_options.clone(),
                buffers: &buffers,
            },
            // Draw both sides: models of buildings seldom have a consistent front side.
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: kind.depth.map(|(writes, compare)| wgpu::DepthStencilState {
                format: if kind.stencil.is_some() {
                    DEPTH_STENCIL
                } else {
                    DEPTH
                },
                depth_write_enabled: Some(writes),
                depth_compare: Some(compare),
                stencil: kind.stencil.map_or_else(Default::default, Stencil::state),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState::default(),
            fragment: kind.fragment.map(|fragment| wgpu::FragmentState {
                module: kind.module,
                entry_point: Some(fragment),
                compilation_options,
                targets: if kind.target.is_some() { &targets } else { &[] },
            }),
            multiview_mask: None,
            cache: None,
        })
}

pub(crate) const NEARER: wgpu::CompareFunction = wgpu::CompareFunction::Greater;

struct Modules {
    surface: wgpu::ShaderModule,
    ids: wgpu::ShaderModule,
    depth: wgpu::ShaderModule,
    post: wgpu::ShaderModule,
    lines: wgpu::ShaderModule,
}

/// Makes a shader module of texts, after those that all shaders share.
pub(crate) fn shader(gpu: &Gpu, label: &str, source: &[&str]) -> wgpu::ShaderModule {
    let drawn = if gpu.writes_depth() {
        include_str!("shaders/depth_written.wgsl")
    } else {
        include_str!("shaders/depth_drawn.wgsl")
    };
    let source = [&[COMMON, drawn], source].concat().concat();
    gpu.device
        .create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(label),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        })
}

impl Modules {
    fn new(gpu: &Gpu) -> Self {
        let module = |label, source: &[&str]| shader(gpu, label, source);
        let sky = SKY;
        let light = include_str!("shaders/light.wgsl");
        let surface = include_str!("shaders/surface.wgsl");
        let lamps = include_str!("shaders/lamps.wgsl");
        let surface = module("surface", &[sky, light, lamps, surface]);
        let corner = if gpu.fetches() {
            include_str!("shaders/ids_fetched.wgsl")
        } else {
            include_str!("shaders/ids_listed.wgsl")
        };
        let ids = module("ids", &[include_str!("shaders/ids.wgsl"), corner]);
        let depth = module("depth", &[include_str!("shaders/depth.wgsl")]);
        let post = module("post", &[sky, include_str!("shaders/post.wgsl")]);
        let lines = module("lines", &[include_str!("shaders/lines.wgsl")]);
        Self {
            surface,
            ids,
            depth,
            post,
            lines,
        }
    }
}

/// Makes the pipeline of id pictures.
fn id_pipeline(gpu: &Gpu, module: &wgpu::ShaderModule, layouts: &Layouts) -> wgpu::RenderPipeline {
    let kind = Kind {
        label: "id",
        module,
        vertex: "corner",
        fragment: Some("id"),
        layouts: &[&layouts.ids],
        buffers: if gpu.fetches() {
            &[INSTANCE_LAYOUT]
        } else {
            &[INSTANCE_LAYOUT, LISTED_LAYOUT]
        },
        target: Some((ID, None)),
        depth: Some((true, NEARER)),
        constants: &[],
        stencil: None,
        writes_color: true,
    };
    pipeline(gpu, &kind)
}

impl Pipelines {
    pub(crate) fn new(gpu: &Gpu, layouts: &Layouts, output: wgpu::TextureFormat) -> Self {
        let writes_depth = gpu.writes_depth();
        let Modules {
            surface,
            ids,
            depth,
            post,
            lines,
        } = Modules::new(gpu);
        let surfaces = [CORNER_LAYOUT, INSTANCE_LAYOUT];
        let at_least = wgpu::CompareFunction::GreaterEqual;
        let base = Kind {
            label: "depth",
            module: &depth,
            vertex: "from_eye",
            fragment: writes_depth.then_some("only_depth"),
            layouts: &[&layouts.globals],
            buffers: &surfaces,
            target: None,
            depth: Some((true, NEARER)),
            constants: &[],
            stencil: None,
            writes_color: true,
        };
        let marks = Kind {
            label: "marks",
            module: &lines,
            vertex: "corner",
            fragment: Some("mark"),
            buffers: &[MARK_LAYOUT],
            target: Some((output, Some(wgpu::BlendState::ALPHA_BLENDING))),
            depth: Some((false, at_least)),
            ..base
        };
        let post = Kind {
            label: "post",
            module: &post,
            vertex: "whole",
            fragment: Some("finish"),
            layouts: &[&layouts.globals, &layouts.post],
            buffers: &[],
            target: Some((output, None)),
            depth: None,
            ..base
        };
        let make = |kind| pipeline(gpu, &kind);
        Self {
            id: id_pipeline(gpu, &ids, layouts),
            shadow: make(Kind {
                label: "shadow",
                vertex: "from_sun",
                // Parallel light: these depths are fine enough.
                fragment: None,
                depth: Some((true, wgpu::CompareFunction::Less)),
                ..base
            }),
            lamp: make(Kind {
                label: "lamp",
                fragment: None,
                depth: Some((true, wgpu::CompareFunction::Less)),
                ..base
            }),
            outline: make(Kind {
                label: "outline",
                vertex: "outline",
                buffers: &[OUTLINE_LAYOUT],
                depth: Some((false, at_least)),
                ..base
            }),
            depth: make(base),
            sky: make(Kind {
                label: "sky",
                fragment: Some("open_air"),
                layouts: &[&layouts.globals],
                // At depth 0: only where nothing was drawn.
                depth: Some((false, at_least)),
                ..post
            }),
            heat_map: make(Kind {
                label: "heat map",
                fragment: Some("heat_map"),
                ..post
            }),
            post_textured: make(Kind {
                constants: &[("HAS_TEXTURES", 1.0)],
                ..post
            }),
            post: make(post),
            marks_on_top: make(Kind {
                label: "marks on top",
                depth: Some((false, wgpu::CompareFunction::Always)),
                ..marks
            }),
            marks: make(marks),
            surface,
            output,
            surfaces: BTreeMap::new(),
        }
    }

    /// Makes a pipeline unless it exists.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, layouts: &Layouts, variant: Variant) {
        if self.surfaces.contains_key(&variant) {
            return;
        }
        let add = wgpu::BlendComponent {
            src_factor: wgpu::BlendFactor::One,
            dst_factor: wgpu::BlendFactor::One,
            operation: wgpu::BlendOperation::Add,
        };
        let (fragment, blend, writes) = match variant.shading {
            Shading::Plain => ("plain", None, true),
            Shading::Textured => ("textured", None, true),
            Shading::Masked => ("masked", None, true),
            Shading::Glass => (
                "glass",
                Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
                false,
            ),
            Shading::Sheer => ("sheer", Some(wgpu::BlendState::ALPHA_BLENDING), false),
            Shading::Count => {
                let both = wgpu::BlendState {
                    color: add,
                    alpha: add,
                };
                ("count", Some(both), true)
            }
        };
        let format = match variant.canvas {
            Canvas::Surfaces => COLOR,
            Canvas::Output => self.output,
            Canvas::Blended => BLENDED,
        };
        let number = |b: bool| f64::from(u8::from(b));
        let made = pipeline(
            gpu,
            &Kind {
                label: fragment,
                module: &self.surface,
                vertex: "corner",
                fragment: Some(fragment),
                layouts: &[&layouts.world, &layouts.texture],
                buffers: &[CORNER_LAYOUT, INSTANCE_LAYOUT],
                target: Some((format, blend)),
                depth: Some((writes, NEARER)),
                constants: &[
                    ("CASTS_SHADOWS", number(variant.casts_shadows)),
                    ("HAS_LIGHT", number(variant.has_light)),
                    ("IS_SMOOTH", number(variant.is_smooth)),
                    ("EXPLAINS", number(variant.explains)),
                    ("IS_PROP", number(variant.is_prop)),
                    ("HAS_LAMPS", number(variant.has_lamps)),
                    ("HAS_GATE", number(variant.is_in_context)),
                ],
                stencil: variant.is_in_context.then_some(Stencil::IN_REGION),
                writes_color: true,
            },
        );
        self.surfaces.insert(variant, made);
    }

    /// Returns a [prepared](Pipelines::prepare) pipeline.
    pub(crate) fn surface(&self, variant: Variant) -> Option<&wgpu::RenderPipeline> {
        self.surfaces.get(&variant)
    }
}

//! Base color textures and their bind groups.

use enfilade_cpg::World;
use wgpu::util::DeviceExt;

use crate::gpu::{Gpu, RenderError};
use crate::materials::{Decoder, Look, NoPicture, wrapping};

/// Returns the layout of a texture's bind group.
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

/// Textures on the adapter.
pub(super) struct Textures {
    /// Textures used by materials; the first is white.
    pub(super) groups: Vec<wgpu::BindGroup>,
    /// For each texture of the world, index into `groups`.
    pub(super) of: Vec<u32>,
    /// Number of images missing or damaged.
    pub(super) n_missing: u32,
    /// Number of images beyond the limits.
    pub(super) n_too_large: u32,
}

/// Uploads the textures used by materials.
pub(super) fn load_textures(
    gpu: &Gpu,
    world: &World,
    looks: &[Look],
) -> Result<Textures, RenderError> {
    let layout = texture_layout(gpu);
    let mut groups = vec![white_group(gpu, &layout)?];
    let mut texture_of = vec![0; world.textures.len()];
    let (mut n_missing, mut n_too_large) = (0, 0);
    let mut decoder = Decoder::new(world);
    // Try a texture without an image only once.
    let mut is_without = vec![false; world.textures.len()];
    for look in looks {
        let Some(t) = look.texture else { continue };
        let is_known = |of: &u32| *of != 0 || is_without[t as usize];
        if texture_of.get(t as usize).is_none_or(is_known) {
            continue;
        }
        match decoder.decode(t) {
            Ok(picture) => {
                texture_of[t as usize] = groups.len() as u32;
                let wrap = wrapping(world, t);
                let view = upload(gpu, &picture.levels)?;
                groups.push(texture_group(gpu, &layout, &view, wrap));
            }
            Err(why) => {
                is_without[t as usize] = true;
                match why {
                    NoPicture::Broken => n_missing += 1,
                    NoPicture::TooLarge => n_too_large += 1,
                }
            }
        }
    }
    Ok(Textures {
        groups,
        of: texture_of,
        n_missing,
        n_too_large,
    })
}

/// Returns the bind group of surfaces without a texture.
pub(super) fn white_group(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
) -> Result<wgpu::BindGroup, RenderError> {
    let white = image::RgbaImage::from_pixel(1, 1, image::Rgba([255; 4]));
    let repeat = [wgpu::AddressMode::Repeat; 2];
    Ok(texture_group(gpu, layout, &upload(gpu, &[white])?, repeat))
}

/// Uploads a picture with its mipmaps.
pub(super) fn upload(
    gpu: &Gpu,
    levels: &[image::RgbaImage],
) -> Result<wgpu::TextureView, RenderError> {
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
    Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
}

pub(super) fn texture_group(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    view: &wgpu::TextureView,
    wrap: [wgpu::AddressMode; 2],
) -> wgpu::BindGroup {
    let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        address_mode_u: wrap[0],
        address_mode_v: wrap[1],
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        mipmap_filter: wgpu::MipmapFilterMode::Linear,
        ..wgpu::SamplerDescriptor::default()
    });
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("base color"),
        layout,
        entries: &[
            wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::TextureView(view),
            },
            wgpu::BindGroupEntry {
                binding: 1,
                resource: wgpu::BindingResource::Sampler(&sampler),
            },
        ],
    })
}

//! Texture formats of the color, depth and id targets.

pub(crate) const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
pub(crate) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
pub(crate) const ID: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;

//! Texture formats of the color, depth and id targets.

pub(crate) const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
/// For pictures in which layers are blended over each other, so that only the last color is rounded to 8 bits.
pub(crate) const BLENDED: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
pub(crate) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// For pictures with special portals: the stencil tells whose region a pixel is in.
pub(crate) const DEPTH_STENCIL: wgpu::TextureFormat = wgpu::TextureFormat::Depth32FloatStencil8;
pub(crate) const ID: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;

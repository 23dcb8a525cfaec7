//! A window, and an adapter that draws to it, before there is anything to draw.

use std::sync::Arc;

use anyhow::anyhow;
use enfilade_cli::adapter;
use enfilade_render::{AdapterChoice, Gpu};
use winit::dpi::PhysicalSize;
use winit::event_loop::ActiveEventLoop;
use winit::window::Window;

/// A window without contents.
pub(super) struct BareWindow {
    pub(super) window: Arc<Window>,
    pub(super) surface: wgpu::Surface<'static>,
    pub(super) config: wgpu::SurfaceConfiguration,
    pub(super) gpu: Gpu,
}

impl BareWindow {
    /// Opens a window of a size in pixels.
    ///
    /// # Errors
    ///
    /// If the system opens none, or the adapter cannot draw to it.
    pub(super) fn open(
        events: &ActiveEventLoop,
        title: String,
        [w, h]: [u32; 2],
        asked: &AdapterChoice,
    ) -> anyhow::Result<Self> {
        let attributes = Window::default_attributes()
            .with_title(title)
            .with_inner_size(PhysicalSize::new(w, h));
        let window = Arc::new(events.create_window(attributes)?);
        let display = Box::new(events.owned_display_handle());
        let with = wgpu::InstanceDescriptor::new_with_display_handle_from_env(display);
        let instance = wgpu::Instance::new(with);
        let surface = instance.create_surface(window.clone())?;
        let gpu = adapter::open_with(&instance, asked, Some(&surface))?;
        let size = window.inner_size();
        let mut config = surface
            .get_default_config(&gpu.adapter, size.width.max(1), size.height.max(1))
            .ok_or_else(|| anyhow!("{} cannot draw to this window", gpu.name()))?;
        let formats = surface.get_capabilities(&gpu.adapter).formats;
        // Shading is in linear light: the window's texture format converts it.
        if let Some(&format) = formats.iter().find(|f| f.is_srgb()) {
            config.format = format;
        }
        surface.configure(&gpu.device, &config);
        Ok(Self {
            window,
            surface,
            config,
            gpu,
        })
    }
}

//! Opens adapters according to the environment, which no library reads.

use enfilade_render::{AdapterChoice, Gpu, RenderError};

const BACKEND: &str = "WGPU_BACKEND";

/// Opens an adapter; no display is needed. `WGPU_BACKEND`, a list such as `vulkan,gl`, restricts the drivers, as in
/// all programs that draw with wgpu.
///
/// # Errors
///
/// As [`Gpu::open`].
pub fn open(choice: &AdapterChoice) -> Result<Gpu, RenderError> {
    let asked = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
    open_with(&wgpu::Instance::new(asked), choice, None)
}

/// Like [`open`], for an instance made from the environment, to draw to a surface.
///
/// # Errors
///
/// As [`Gpu::open_with`].
pub fn open_with(
    instance: &wgpu::Instance,
    choice: &AdapterChoice,
    surface: Option<&wgpu::Surface<'_>>,
) -> Result<Gpu, RenderError> {
    let opened = Gpu::open_with(instance, choice, surface);
    match (&opened, std::env::var(BACKEND)) {
        (Err(RenderError::NoAdapter), Ok(backends)) => {
            let all = wgpu::InstanceDescriptor::new_without_display_handle();
            let found = Gpu::names(&wgpu::Instance::new(all));
            if found.is_empty() {
                return opened;
            }
            Err(RenderError::NoSuchAdapter {
                asked: format!("of {BACKEND}={backends}"),
                found: found.join(", "),
            })
        }
        _ => opened,
    }
}

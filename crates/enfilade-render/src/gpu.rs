//! The adapter: a graphics card, or a software renderer.

use std::fmt;
use std::str::FromStr;
use std::sync::{Arc, OnceLock};

use crate::formats::{COLOR, DEPTH, ID};
use crate::piece_of::PieceOf;

/// An error of drawing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// There is no adapter.
    #[error(
        "no graphics adapter found: install a driver or a software renderer \
         (Debian and Ubuntu: `apt-get install mesa-vulkan-drivers libvulkan1`)"
    )]
    NoAdapter,
    /// No adapter matches the choice.
    #[error("no adapter is {asked}; available: {found}")]
    NoSuchAdapter {
        /// The choice.
        asked: String,
        /// Names of the available adapters.
        found: String,
    },
    /// The adapter provides no device, or lacks a required feature.
    #[error("{adapter} cannot be used: {why}; choose another with --adapter")]
    Device {
        /// Name of the adapter.
        adapter: String,
        /// The cause.
        why: String,
    },
    /// A world or picture beyond a limit of the adapter.
    #[error(
        "{what}: {needed} needed, but the adapter's limit is {limit}; choose another adapter, or draw less"
    )]
    TooLarge {
        /// The item that is too large.
        what: &'static str,
        /// The size that it needs.
        needed: u64,
        /// The limit.
        limit: u64,
    },
    /// A picture with more pixels than one call draws.
    #[error(
        "a picture of {}x{} has {} pixels, more than the limit of {}; the largest of this shape is {}x{}",
        .size[0], .size[1], u64::from(.size[0]) * u64::from(.size[1]), MOST_PIXELS, .most[0], .most[1]
    )]
    TooManyPixels {
        /// The requested size.
        size: [u32; 2],
        /// The largest of this shape.
        most: [u32; 2],
    },
    /// Settings of portal textures that cannot be.
    #[error(transparent)]
    PortalTextures(#[from] crate::portal_texture_options::PortalTextureError),
    /// Portal textures that cannot be made ahead, or a file of them that cannot be used.
    #[error(transparent)]
    PortalTextureFile(#[from] crate::portal_texture_file::PortalTextureFileError),
    /// The device was lost or ran out of memory while drawing.
    #[error("the adapter failed while drawing: {0}")]
    Lost(String),
    /// A picture could not be encoded.
    #[error("the picture cannot be encoded: {0}")]
    Encode(String),
    /// Bytes that are not a PNG picture.
    #[error("not a PNG picture: {0}")]
    Decode(String),
    /// A camera without a direction, or with numbers that are not finite.
    #[error(transparent)]
    Camera(#[from] enfilade_runtime::ViewError),
    /// Pieces were put into a world that was loaded whole.
    #[error("pieces come and go only in a hollow world; this one was loaded whole")]
    NotHollow,
    /// A piece is not one of the world's.
    #[error("{of:?} is not a piece of this world; fetch it again, or pack the world again")]
    OtherPiece {
        /// The piece that it was to be.
        of: PieceOf,
    },
    /// Something needs all triangles of a world at once.
    #[error(
        "{what} needs all triangles at once, but those of a hollow world come and go; load the world whole"
    )]
    NeedsWhole {
        /// The user of them.
        what: &'static str,
    },
    /// A world that breaks invariants; decoded worlds never do.
    #[error(transparent)]
    World(#[from] enfilade_runtime::SightError),
}

/// Choice of adapter.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum AdapterChoice {
    /// The fastest available: a discrete card, else an integrated one, else software.
    #[default]
    Best,
    /// A graphics card only.
    Gpu,
    /// Software only: the same pictures on every machine.
    Software,
    /// The first whose name contains this text, ignoring case.
    Named(String),
}

impl FromStr for AdapterChoice {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(match text {
            "best" => Self::Best,
            "gpu" => Self::Gpu,
            "software" => Self::Software,
            name => Self::Named(name.to_owned()),
        })
    }
}

impl fmt::Display for AdapterChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Best => f.write_str("usable"),
            Self::Gpu => f.write_str("a graphics card"),
            Self::Software => f.write_str("software"),
            Self::Named(name) => write!(f, "named `{name}`"),
        }
    }
}

/// Largest picture: 8192 × 8192. On the adapter and on its way to a file, a pixel takes up to 30 bytes.
pub(crate) const MOST_PIXELS: u64 = 1 << 26;

/// A point in the sequence of submitted work.
#[derive(Clone, Debug)]
pub struct Submitted(wgpu::SubmissionIndex);

/// An open adapter.
pub struct Gpu {
    /// The wgpu instance; windows create surfaces from it.
    pub instance: wgpu::Instance,
    /// The adapter.
    pub adapter: wgpu::Adapter,
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// The first error that no call returned, such as lack of memory.
    failed: Arc<OnceLock<String>>,
}

impl fmt::Debug for Gpu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Gpu({})", self.name())
    }
}

fn named(info: &wgpu::AdapterInfo) -> String {
    format!("{} ({})", info.name, info.backend)
}

fn rank(info: &wgpu::AdapterInfo) -> u32 {
    let kind = match info.device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    };
    // OpenGL is the last resort.
    kind * 2 + u32::from(info.backend == wgpu::Backend::Gl)
}

fn fits(choice: &AdapterChoice, info: &wgpu::AdapterInfo) -> bool {
    match choice {
        AdapterChoice::Best => true,
        AdapterChoice::Gpu => info.device_type != wgpu::DeviceType::Cpu,
        AdapterChoice::Software => info.device_type == wgpu::DeviceType::Cpu,
        AdapterChoice::Named(name) => {
            let text = format!("{} {} {}", info.name, info.driver, info.backend);
            text.to_lowercase().contains(&name.to_lowercase())
        }
    }
}

/// Returns a required feature that an adapter lacks.
fn lacking(adapter: &wgpu::Adapter) -> Option<String> {
    let drawn = wgpu::TextureUsages::RENDER_ATTACHMENT;
    let read = drawn | wgpu::TextureUsages::TEXTURE_BINDING;
    for (format, usages) in [(COLOR, read), (DEPTH, read), (ID, drawn)] {
        let features = adapter.get_texture_format_features(format);
        if !features.allowed_usages.contains(usages) {
            return Some(format!("pictures of {format:?}"));
        }
    }
    let flags = adapter.get_downlevel_capabilities().flags;
    let compares = flags.contains(wgpu::DownlevelFlags::COMPARISON_SAMPLERS);
    (!compares).then(|| "samplers that compare".into())
}

impl Gpu {
    /// Opens an adapter; needs no display.
    ///
    /// # Errors
    ///
    /// No matching adapter, or one that provides no device.
    pub fn open(choice: &AdapterChoice) -> Result<Self, RenderError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        Self::open_with(&instance, choice, None)
    }

    /// Returns the adapters of an instance with their backends, e.g. `llvmpipe (vulkan)`.
    #[must_use]
    #[doc(hidden)]
    pub fn names(instance: &wgpu::Instance) -> Vec<String> {
        let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
        adapters.iter().map(|a| named(&a.get_info())).collect()
    }

    /// Opens an adapter of `instance` that can draw to `surface`.
    ///
    /// # Errors
    ///
    /// As [`Gpu::open`].
    pub fn open_with(
        instance: &wgpu::Instance,
        choice: &AdapterChoice,
        surface: Option<&wgpu::Surface<'_>>,
    ) -> Result<Self, RenderError> {
        let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
        adapters.retain(|a| surface.is_none_or(|s| a.is_surface_supported(s)));
        adapters.sort_by_key(|a| rank(&a.get_info()));
        if adapters.is_empty() {
            return Err(RenderError::NoAdapter);
        }
        let names: Vec<String> = adapters.iter().map(|a| named(&a.get_info())).collect();
        let mut failed = None;
        for adapter in adapters {
            if !fits(choice, &adapter.get_info()) {
                continue;
            }
            match Self::of_adapter(instance.clone(), adapter) {
                Ok(gpu) => return Ok(gpu),
                // Try the next best.
                Err(why) => failed = failed.or(Some(why)),
            }
        }
        Err(failed.unwrap_or_else(|| RenderError::NoSuchAdapter {
            asked: choice.to_string(),
            found: names.join(", "),
        }))
    }

    fn of_adapter(instance: wgpu::Instance, adapter: wgpu::Adapter) -> Result<Self, RenderError> {
        let name = adapter.get_info().name;
        let limits = adapter.limits();
        let broken = |why: String| RenderError::Device {
            adapter: name.clone(),
            why,
        };
        if let Some(what) = lacking(&adapter) {
            return Err(broken(format!("it lacks {what}, which are required")));
        }
        let wanted = wgpu::Features::TIMESTAMP_QUERY
            | wgpu::Features::INDIRECT_FIRST_INSTANCE
            | wgpu::Features::DEPTH32FLOAT_STENCIL8;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("enfilade"),
            required_features: wanted & adapter.features(),
            required_limits: limits,
            ..wgpu::DeviceDescriptor::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|why| broken(why.to_string()))?;
        let failed = Arc::new(OnceLock::new());
        let first = Arc::clone(&failed);
        // Without a handler, wgpu panics.
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let _ = first.set(error.to_string());
        }));
        Ok(Self {
            instance,
            adapter,
            device,
            queue,
            failed,
        })
    }

    /// Returns `true` if vertex shaders can read storage buffers. Otherwise, as on WebGL 2, a world takes 36 more
    /// bytes per triangle.
    pub(crate) fn fetches(&self) -> bool {
        let flags = self.adapter.get_downlevel_capabilities().flags;
        flags.contains(wgpu::DownlevelFlags::VERTEX_STORAGE)
            && self.device.limits().max_storage_buffers_per_shader_stage >= 2
    }

    /// Returns `true` if pictures can show what special portals show. Otherwise these are not drawn.
    #[must_use]
    pub fn has_stencil(&self) -> bool {
        let features = self.device.features();
        features.contains(wgpu::Features::DEPTH32FLOAT_STENCIL8)
    }

    /// Returns `true` if shaders must write depths themselves, as on OpenGL: see `depth_written.wgsl`.
    pub(crate) fn writes_depth(&self) -> bool {
        self.adapter.get_info().backend == wgpu::Backend::Gl
    }

    /// Returns the adapter's name and backend, e.g. `llvmpipe (vulkan)`.
    #[must_use]
    pub fn name(&self) -> String {
        named(&self.adapter.get_info())
    }

    /// Returns `true` for a software renderer, whose times say little about graphics cards.
    #[must_use]
    pub fn is_software(&self) -> bool {
        self.adapter.get_info().device_type == wgpu::DeviceType::Cpu
    }

    /// Waits for all submitted work.
    ///
    /// # Errors
    ///
    /// The device was lost.
    #[doc(hidden)]
    pub fn wait(&self) -> Result<(), RenderError> {
        self.device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|why| RenderError::Lost(why.to_string()))?;
        self.check_failed()
    }

    /// Returns the first error that no call returned.
    pub(crate) fn check_failed(&self) -> Result<(), RenderError> {
        match self.failed.get() {
            Some(why) => Err(RenderError::Lost(why.clone())),
            None => Ok(()),
        }
    }

    /// Returns a mark after all work submitted so far, for [`Gpu::wait_for`].
    #[must_use]
    #[doc(hidden)]
    pub fn mark(&self) -> Submitted {
        Submitted(self.queue.submit([]))
    }

    /// Waits for all work submitted before the mark.
    ///
    /// # Errors
    ///
    /// The device was lost.
    #[doc(hidden)]
    pub fn wait_for(&self, mark: Submitted) -> Result<(), RenderError> {
        let submission_index = Some(mark.0);
        let wait = wgpu::PollType::Wait {
            submission_index,
            timeout: None,
        };
        let done = self.device.poll(wait);
        done.map(|_| ())
            .map_err(|why| RenderError::Lost(why.to_string()))
    }

    /// Checks the size of a picture.
    pub(crate) fn check_picture(&self, size: [u32; 2]) -> Result<(), RenderError> {
        let n = u64::from(size[0]) * u64::from(size[1]);
        let side = self.device.limits().max_texture_dimension_2d;
        if n > MOST_PIXELS {
            let share = (MOST_PIXELS as f64 / n as f64).sqrt();
            let share = share.min(f64::from(side) / f64::from(size[0].max(size[1])));
            let most = size.map(|s| ((f64::from(s) * share) as u32).max(1));
            return Err(RenderError::TooManyPixels { size, most });
        }
        Self::check("a side of the picture", size[0].max(size[1]).into(), side)
    }

    /// Checks a size against a limit, with a more helpful error than the device's.
    pub(crate) fn check(
        what: &'static str,
        needed: u64,
        limit: impl Into<u64>,
    ) -> Result<(), RenderError> {
        let limit = limit.into();
        if needed > limit {
            return Err(RenderError::TooLarge {
                what,
                needed,
                limit,
            });
        }
        Ok(())
    }
}

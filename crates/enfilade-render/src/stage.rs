//! A world's place in a frame: its parameters for shaders, its instances, and its bind groups.

use enfilade_world::Pose;
use glam::{Mat4, Vec3};

use crate::camera::Projection;
use crate::frame::{Paint, Style};
use crate::gpu::Gpu;
use crate::lamps::{ActiveLamp, LampGlobals, MOST_LAMPS};
use crate::light::{Light, LightGlobals};
use crate::list::RenderList;
use crate::pipelines::Layouts;
use crate::resources::{Grown, bound};
use crate::scene::{GpuWorld, Instance};

/// Parameters of a frame for one world, laid out as in `common.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Globals {
    clip_from_relative: [[f32; 4]; 4],
    relative_from_clip: [[f32; 4]; 4],
    shadow_from_world: [[f32; 4]; 4],
    origin: [f32; 4],
    eye: [f32; 4],
    sun: [f32; 4],
    size: [f32; 4],
    style: [u32; 4],
    light: LightGlobals,
    origin_low: [f32; 4],
    root_rows: [[f32; 4]; 3],
    gate: [f32; 4],
}

/// The sun, and the map of its shadows. In the frame of the first world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sunlight {
    /// Direction to the sun.
    pub(crate) toward: Vec3,
    pub(crate) map_from_root: Mat4,
    /// Size of a texel of the map. [Units: wu]
    pub(crate) texel: f32,
}

/// Properties that all worlds of a frame share.
#[derive(Clone, Copy)]
pub(crate) struct Exposed<'a> {
    pub(crate) style: &'a Style,
    pub(crate) size: [u32; 2],
    pub(crate) sun: Sunlight,
    pub(crate) exposure: f32,
    /// Share of the daylight that is left, 0 to 1.
    pub(crate) day: f32,
    pub(crate) lamps: &'a [ActiveLamp],
}

/// A buffer of [`Globals`] with a bind group of its own.
pub(crate) struct GlobalsBuffer {
    pub(crate) buffer: wgpu::Buffer,
    pub(crate) group: wgpu::BindGroup,
}

impl GlobalsBuffer {
    pub(crate) fn new(gpu: &Gpu, layouts: &Layouts) -> Self {
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("globals"),
            size: size_of::<Globals>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("globals"),
            layout: &layouts.globals,
            entries: &[bound(0, &buffer)],
        });
        Self { buffer, group }
    }

    pub(crate) fn write(&self, gpu: &Gpu, globals: &Globals) {
        gpu.queue
            .write_buffer(&self.buffer, 0, bytemuck::bytes_of(globals));
    }
}

/// The plane before which nothing lies.
pub(crate) const NO_GATE: [f32; 4] = [0.0, 0.0, 0.0, -1.0];

/// Bind groups and buffers for one view of a world.
pub(crate) struct StageView {
    pub(crate) group: wgpu::BindGroup,
    pub(crate) globals: GlobalsBuffer,
    /// The lamps of the frame.
    pub(crate) lamps: wgpu::Buffer,
    pub(crate) instances: Grown,
}

impl StageView {
    /// Makes the buffers of a view; `group` is the world's bind group over the first two.
    pub(crate) fn new(
        gpu: &Gpu,
        group: wgpu::BindGroup,
        globals: GlobalsBuffer,
        lamps: wgpu::Buffer,
    ) -> Self {
        Self {
            group,
            globals,
            lamps,
            instances: Grown::new(gpu, wgpu::BufferUsages::VERTEX),
        }
    }
}

/// A world's bind groups and buffers.
pub(crate) struct RenderStage {
    /// The first is that of frames without special portals; more for the same world seen through these, in one picture.
    pub(crate) views: Vec<StageView>,
    /// Instances of the last list, reused from frame to frame.
    drawn: Vec<Instance>,
    pub(crate) light: Light,
    /// The explanation of visibility, if requested.
    pub(crate) explanation: Option<wgpu::TextureView>,
    /// Motion to the frame of the first world.
    pub(crate) pose: Pose,
    /// Brightness around the world relative to the outdoors.
    pub(crate) surroundings: f32,
}

impl RenderStage {
    /// Makes a stage at the origin.
    pub(crate) fn new(view: StageView, light: Light) -> Self {
        Self {
            views: vec![view],
            drawn: Vec::new(),
            light,
            explanation: None,
            pose: Pose::IDENTITY,
            surroundings: 1.0,
        }
    }

    /// Returns the view of frames without special portals.
    pub(crate) fn first(&self) -> &StageView {
        &self.views[0]
    }

    /// Writes the instances of a list in its order.
    pub(crate) fn write_instances(&mut self, gpu: &Gpu, world: &GpuWorld, list: &RenderList) {
        self.write_instances_of(gpu, 0, world, list);
    }

    /// As [`RenderStage::write_instances`], for one of its views.
    pub(crate) fn write_instances_of(
        &mut self,
        gpu: &Gpu,
        view: usize,
        world: &GpuWorld,
        list: &RenderList,
    ) {
        self.drawn.clear();
        self.drawn.extend(list.instances.iter().map(|&key| {
            let number = (key & crate::list::INSTANCE_MASK) as usize;
            world.instances[number].drawn(key)
        }));
        let instances = &mut self.views[view].instances;
        instances.write(gpu, bytemuck::cast_slice(&self.drawn));
    }

    /// Writes the parameters of a frame. `projection` is in the world's own frame.
    pub(crate) fn write_globals(&self, gpu: &Gpu, projection: &Projection, exposed: &Exposed<'_>) {
        self.write_globals_of(gpu, 0, projection, exposed, NO_GATE);
    }

    /// As [`RenderStage::write_globals`], for one of its views. `gate` is the plane before which nothing is drawn, relative
    /// to the eye.
    pub(crate) fn write_globals_of(
        &self,
        gpu: &Gpu,
        view: usize,
        projection: &Projection,
        exposed: &Exposed<'_>,
        gate: [f32; 4],
    ) {
        let view = &self.views[view];
        let origin = projection.exact_origin();
        let mut globals = Globals::new(projection, &self.pose, exposed);
        globals.light = self.light.globals(origin, exposed.exposure);
        globals.style[1] = u32::from(self.explanation.is_some());
        globals.origin_low[3] = self.surroundings;
        globals.gate = gate;
        view.globals.write(gpu, &globals);
        if exposed.lamps.is_empty() {
            return;
        }
        let n = exposed.lamps.len().min(MOST_LAMPS);
        let lamps: Vec<LampGlobals> = (exposed.lamps[..n].iter())
            .map(|lamp| LampGlobals::new(lamp, &self.pose, projection))
            .collect();
        let head = [n as u32, 0, 0, 0];
        let bytes = [bytemuck::bytes_of(&head), bytemuck::cast_slice(&lamps)].concat();
        gpu.queue.write_buffer(&view.lamps, 0, &bytes);
    }
}

/// A world and its buffers.
pub(crate) type StagedWorld<'a> = (&'a GpuWorld, &'a mut RenderStage);

/// Makes a buffer of the lamps of a frame.
pub(crate) fn lamp_buffer(gpu: &Gpu) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("lamps"),
        size: 16 + (MOST_LAMPS * size_of::<LampGlobals>()) as u64,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

impl Globals {
    /// Returns the parameters for a frame at `pose`, without light by place.
    pub(crate) fn new(projection: &Projection, pose: &Pose, exposed: &Exposed<'_>) -> Self {
        let Exposed {
            style,
            size,
            sun,
            exposure,
            day,
            ..
        } = *exposed;
        let [w, h] = size.map(|n| n as f32);
        let turn = pose.matrix3().as_mat3();
        let map_from_root = sun.map_from_root;
        let map = if *pose == Pose::IDENTITY {
            map_from_root
        } else {
            (map_from_root.as_dmat4() * pose.matrix()).as_mat4()
        };
        let height = pose.point(projection.exact_origin()).y as f32;
        let row = |k: usize, w: f32| turn.row(k).extend(w).to_array();
        let mut light = LightGlobals::default();
        light.shift[3] = exposure;
        Self {
            clip_from_relative: projection.clip_from_relative.to_cols_array_2d(),
            relative_from_clip: projection.clip_from_relative.inverse().to_cols_array_2d(),
            shadow_from_world: map.to_cols_array_2d(),
            origin: projection.origin.extend(style.cut_above).to_array(),
            eye: projection
                .eye
                .extend(f32::from(u8::from(projection.is_parallel)))
                .to_array(),
            sun: (turn.transpose() * sun.toward).extend(sun.texel).to_array(),
            size: [w, h, 1.0 / w, 1.0 / h],
            style: [u32::from(style.paint == Paint::Cells), 0, 0, 0],
            light,
            origin_low: projection.origin_low.extend(1.0).to_array(),
            root_rows: [row(0, 0.0), row(1, height), row(2, day)],
            gate: NO_GATE,
        }
    }
}

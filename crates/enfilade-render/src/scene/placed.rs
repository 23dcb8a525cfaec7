//! Transforms of structure and detail objects.

use enfilade_cpg::{CellId, World};
use enfilade_runtime::{DetailId, Sight, SightState};
use glam::{DMat4, Mat4, Vec3, Vec4};

use super::color::{color_of, packed};

/// The transform of structure or of a detail object, 56 bytes.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Instance {
    rows: [[f32; 4]; 3],
    /// Its index and the reason why it is drawn, as in [`crate::DrawList`].
    key: u32,
    /// Color of its cell.
    color: u32,
}

impl Instance {
    /// Returns the transform of a prop of a linear color that emits a share of it.
    pub(crate) fn of_prop(placed: &Mat4, color: [f32; 3], glow: f32) -> Self {
        let glow = (glow.clamp(0.0, 1.0) * 255.0) as u32;
        let color = packed(color.map(|c| (c.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0) as u8));
        Self {
            rows: rows(placed),
            // Not structure.
            key: 1,
            color: color & 0x00ff_ffff | glow << 24,
        }
    }

    /// Returns it with the key of a draw.
    pub(crate) fn drawn(self, key: u32) -> Self {
        Self { key, ..self }
    }
}

pub(crate) const INSTANCE_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<Instance>() as u64,
    step_mode: wgpu::VertexStepMode::Instance,
    attributes: &wgpu::vertex_attr_array![
        6 => Float32x4, 7 => Float32x4, 8 => Float32x4, 9 => Uint32x2
    ],
};

/// A placed detail object, as drawn.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    pub(crate) mesh: u32,
    /// The cells that it stands in.
    pub(crate) cells: Vec<CellId>,
    pub(crate) center: Vec3,
    /// Radius of a sphere that contains it. [Units: wu]
    pub(crate) radius: f32,
    /// Largest factor by which a length of the mesh can grow.
    pub(crate) stretch: f32,
}

/// The leaf of a door.
#[derive(Clone)]
pub(super) struct Moving {
    pub(super) detail: DetailId,
    /// As modeled.
    transform: DMat4,
    center: Vec3,
}

impl Moving {
    /// Moves it as `state` has it.
    pub(super) fn place(&self, state: &SightState, instance: &mut Instance, placed: &mut Placed) {
        let pose = state.pose(self.detail);
        let m = pose.map_or(self.transform, |p| p * self.transform);
        instance.rows = rows(&m.as_mat4());
        let center = pose.map(|p| p.transform_point3(self.center.as_dvec3()).as_vec3());
        placed.center = center.unwrap_or(self.center);
    }
}

fn rows(m: &Mat4) -> [[f32; 4]; 3] {
    [m.row(0), m.row(1), m.row(2)].map(|r| r.to_array())
}

pub(super) fn placed(world: &World, sight: &Sight) -> (Vec<Instance>, Vec<Placed>, Vec<Moving>) {
    // The first instance is structure, which is not transformed.
    let mut instances = vec![Instance {
        rows: [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ],
        key: 0,
        color: color_of(&world.graph, &[]),
    }];
    let mut details: Vec<Placed> = Vec::new();
    let mut moving = Vec::new();
    for (id, detail) in (0..).map(DetailId).zip(&world.details) {
        let m = Mat4::from_cols_array(&detail.transform);
        instances.push(Instance {
            rows: rows(&m),
            key: 0,
            color: color_of(&world.graph, &detail.cells),
        });
        let bounds = sight.detail_box(id);
        details.push(Placed {
            mesh: detail.mesh,
            cells: sight.cells_of_detail(world, id),
            center: bounds.map_or(m.w_axis.truncate(), |[low, high]| {
                ((low + high) * 0.5).as_vec3()
            }),
            radius: bounds.map_or(0.0, |[low, high]| ((high - low).length() * 0.5) as f32),
            stretch: stretch(&m),
        });
        if sight.portals_of(id).next().is_some() {
            moving.push(Moving {
                detail: id,
                transform: detail.placement(),
                center: details[details.len() - 1].center,
            });
        }
    }
    (instances, details, moving)
}

/// Returns a bound on the factor by which a map stretches a length; exact if its axes stay at right angles.
fn stretch(m: &Mat4) -> f32 {
    let axes = [m.x_axis, m.y_axis, m.z_axis].map(Vec4::truncate);
    // Its square is the greatest eigenvalue of the matrix of these products; this is Gershgorin's bound.
    let rows = axes.map(|a| axes.iter().map(|b| a.dot(*b).abs()).sum::<f32>());
    rows.into_iter().fold(0.0, f32::max).sqrt()
}

pub(super) fn bounds_of(sight: &Sight, details: &[Placed]) -> [Vec3; 2] {
    let mut low = Vec3::INFINITY;
    let mut high = Vec3::NEG_INFINITY;
    for chunk in sight.chunks() {
        let [from, to] = chunk.aabb.map(Vec3::from);
        (low, high) = (low.min(from), high.max(to));
    }
    for d in details {
        (low, high) = (low.min(d.center - d.radius), high.max(d.center + d.radius));
    }
    if low.is_finite() && high.is_finite() && low.x <= high.x {
        [low, high]
    } else {
        [Vec3::NEG_ONE, Vec3::ONE]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::Rng;
    use glam::Quat;

    #[test]
    fn no_length_grows_more_than_the_stretch_says() {
        let mut rng = Rng::new(4);
        for _ in 0..1000 {
            let mut number = || rng.range(-2.0, 2.0) as f32;
            let m = Mat4::from_cols_array(&std::array::from_fn(|_| number()));
            let v = Vec3::new(number(), number(), number());
            let long = m.transform_vector3(v).length();
            assert!(long <= stretch(&m) * v.length() * 1.0001, "{m} {v}");
        }
        let turned = Quat::from_rotation_x(0.7) * Quat::from_rotation_y(1.9);
        let m = Mat4::from_scale_rotation_translation(Vec3::new(2.0, 0.5, -3.0), turned, Vec3::ONE);
        assert!((stretch(&m) - 3.0).abs() < 1e-5);
    }
}

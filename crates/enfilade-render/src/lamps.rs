//! Lamps that light what they reach: point and spot lights, each with a map of the distances around it.
//!
//! A lamp's map is a cube of six depth pictures, drawn from what a traversal of portals reaches from the lamp, within its range
//! and through open doors only. A surface is lit if nothing is nearer to the lamp in its direction: nothing is lit behind a
//! wall. Maps are kept until the lamp moves, or a door or part that it reaches. Props cast no shadows.
//!
//! A picture uses at most [`LampOptions::most`] lamps: those that shine brightest at the eye, walls disregarded, or those that
//! the caller chooses, for example by [`Lights::that_matter`](enfilade_world::Lights::that_matter).

mod khr;
mod maps;

use enfilade_cpg::{CellId, PortalId};
use enfilade_runtime::Viewer;
use enfilade_world::{PartId, Pose, SpaceViewer};
use glam::{DVec3, Vec3};

use crate::camera::Projection;

pub use khr::lamp_lights;
pub(crate) use maps::{LampEvent, LampMaps, face_projection};

/// Most lamps of a picture that shaders can take.
pub(crate) const MOST_LAMPS: usize = 200;

/// Choice and quality of lamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LampOptions {
    /// Most lamps of a picture. The memory of maps grows with it: 24 bytes per square of `side` each. [Limit: at most 200]
    pub most: usize,
    /// Side of each of the six pictures of a map. [Units: texels]
    pub side: u32,
    /// True to draw maps from what a lamp reaches; false from everything, with the same pictures, to check that.
    pub is_culled: bool,
}

impl Default for LampOptions {
    fn default() -> Self {
        Self {
            most: 16,
            side: 512,
            is_culled: true,
        }
    }
}

/// A lamp as drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LampLight {
    /// The part in whose frame it stands, and with which it moves.
    pub part: PartId,
    /// Position. [Units: wu]
    pub at: [f32; 3],
    /// Linear light on a surface 1 m away that faces it; 1 is as bright as an outdoor surface in the shade. Falls with
    /// the square of the distance.
    pub color: [f32; 3],
    /// Distance at which the light ends. [Units: wu] [Limit: above 0]
    pub range: f32,
    /// Limits of its light; `None` if it shines in all directions.
    pub cone: Option<LampCone>,
}

/// The cone of a spot light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LampCone {
    /// Direction of its axis, of any length.
    pub toward: [f32; 3],
    /// Angle from the axis within which the light is full. [Units: rad]
    pub inner: f32,
    /// Angle from the axis at which it ends. [Units: rad]
    pub outer: f32,
}

impl LampLight {
    pub(crate) fn point(&self) -> DVec3 {
        Vec3::from(self.at).as_dvec3()
    }

    /// Returns `true` if it needs the same map as another.
    fn has_map_of(&self, other: &Self) -> bool {
        (self.part, self.at, self.range) == (other.part, other.at, other.range)
    }

    /// Returns its light at a distance, in full brightness. [Units: as the color]
    fn brightness_at(&self, distance: f32) -> f32 {
        let [r, g, b] = self.color;
        r.max(g).max(b) / distance.powi(2).max(1.0)
    }
}

/// A lamp of a frame, with its map.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ActiveLamp {
    pub(crate) light: LampLight,
    /// Motion from its frame to that of the first world.
    pub(crate) pose: Pose,
    /// First layer of its map.
    pub(crate) layer: u32,
}

/// Parameters of a lamp in the frame of a world, laid out as in `lamps.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct LampGlobals {
    /// Position relative to the camera; w: range.
    at: [f32; 4],
    /// w: first layer.
    color: [f32; 4],
    /// Rotation to the lamp's own frame.
    turn: [f32; 4],
    /// Axis of the cone; w: scale of its rim.
    toward: [f32; 4],
    /// x: offset of the rim.
    rim: [f32; 4],
}

impl LampGlobals {
    /// Returns the parameters for a world at `pose`, drawn by `projection` of its frame.
    pub(crate) fn new(lamp: &ActiveLamp, pose: &Pose, projection: &Projection) -> Self {
        let light = &lamp.light;
        let motion = pose.inverse().after(&lamp.pose);
        let at = motion.point(light.point()) - projection.exact_origin();
        // As the extension KHR_lights_punctual computes it.
        let (toward, scale, offset) = match light.cone {
            Some(cone) => {
                let [inner, outer] = [cone.inner, cone.outer].map(f32::cos);
                let scale = 1.0 / (inner - outer).max(1e-3);
                (Vec3::from(cone.toward), scale, -outer * scale)
            }
            None => (Vec3::NEG_Z, 0.0, 1.0),
        };
        let toward = motion.direction(toward.as_dvec3()).as_vec3();
        let turn = motion.turn.conjugate().as_quat();
        Self {
            at: at.as_vec3().extend(light.range).to_array(),
            color: Vec3::from(light.color).extend(lamp.layer as f32).to_array(),
            turn: turn.to_array(),
            toward: toward.normalize_or_zero().extend(scale).to_array(),
            rim: [offset, 0.0, 0.0, 0.0],
        }
    }
}

/// The lamps of a studio, and its knowledge of the worlds around them.
#[derive(Default)]
pub(crate) struct LampState {
    pub(crate) lights: Vec<LampLight>,
    pub(crate) options: LampOptions,
    /// One entry per part, as in the last frame.
    pub(crate) watched: Vec<WatchedPart>,
    pub(crate) viewer: Option<Viewer>,
    pub(crate) space_viewer: Option<SpaceViewer>,
}

/// Doors and pose of a part.
#[derive(Clone, PartialEq)]
pub(crate) struct WatchedPart {
    pub(crate) shares: Vec<Option<f32>>,
    pub(crate) shut: Vec<PortalId>,
    pub(crate) pose: Pose,
}

/// The cells that a lamp reaches, by part, ascending.
pub(crate) type LampReach = Vec<(PartId, Vec<CellId>)>;

/// Returns the lamps for a picture, ascending: the brightest at the eye, or those of `chosen`, `most` at most. `eye` and the
/// poses of parts are in the frame of the first world.
pub(crate) fn chosen_lamps(
    lights: &[LampLight],
    chosen: Option<&[u32]>,
    most: usize,
    brightness: impl Fn(&LampLight) -> f32,
) -> Vec<u32> {
    let mut out: Vec<u32> = match chosen {
        Some(ids) => (ids.iter().copied())
            .filter(|i| (*i as usize) < lights.len())
            .collect(),
        None => (0..lights.len() as u32).collect(),
    };
    if out.len() > most {
        let key = |i: &u32| brightness(&lights[*i as usize]);
        out.sort_by(|a, b| key(b).total_cmp(&key(a)).then(a.cmp(b)));
        out.truncate(most);
    }
    out.sort_unstable();
    out.dedup();
    out
}

/// Returns the light of a lamp at an eye.
pub(crate) fn brightness_at(light: &LampLight, pose: &Pose, eye: DVec3) -> f32 {
    let distance = pose.point(light.point()).distance(eye) as f32;
    light.brightness_at(distance)
}

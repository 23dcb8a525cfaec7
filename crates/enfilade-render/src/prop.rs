//! A thing that moves through worlds, as a copy of a simple mesh.

use enfilade_world::{PartId, Pose};

/// A mesh of props, by number; more by [`Studio::add_prop_mesh`](crate::Studio::add_prop_mesh).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PropMesh(pub(crate) u32);

impl PropMesh {
    /// A box with sides of 1 m around its origin.
    pub const BOX: Self = Self(0);
    /// A ball of radius 1 m around its origin.
    pub const BALL: Self = Self(1);
    /// A figure 1.75 m high and 0.5 m wide that stands on its origin and faces -z.
    pub const PERSON: Self = Self(2);
}

/// A copy of a mesh in a frame of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prop {
    /// The mesh.
    pub mesh: PropMesh,
    /// The part in whose frame it stands, and by whose light it is lit.
    pub part: PartId,
    /// Its place in that frame.
    pub pose: Pose,
    /// Factors of the mesh along its own axes.
    pub size: [f32; 3],
    /// Linear color, 0 to 1.
    pub color: [f32; 3],
    /// Share of its color that it emits, 0 to 1: a bulb, a display.
    pub glow: f32,
}

impl Default for Prop {
    fn default() -> Self {
        Self {
            mesh: PropMesh::BOX,
            part: PartId::ROOT,
            pose: Pose::IDENTITY,
            size: [1.0; 3],
            color: [0.8; 3],
            glow: 0.0,
        }
    }
}

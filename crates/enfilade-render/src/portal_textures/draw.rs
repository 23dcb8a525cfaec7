//! Vertices of doorways that textures fill.

use glam::{DVec3, Vec3};

use super::doorway::{Doorway, DoorwayPlace};
use crate::portal_texture_options::PortalTexturePaint;

/// Textures from which a doorway is composed at most: four of a lattice, and one of a transition.
pub(crate) const MOST_COMPOSED: usize = 5;

/// A texture as one of those from which a doorway is composed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Component {
    pub(crate) layer: usize,
    /// Its viewpoint.
    pub(crate) from: DoorwayPlace,
    pub(crate) weight: f64,
    /// Exposure with which it was made.
    pub(crate) exposure: f32,
}

/// A vertex of a doorway, laid out as in `portal_textures.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct DoorwayCorner {
    position: [f32; 3],
    right: [f32; 4],
    up: [f32; 4],
    normal: [f32; 4],
    scale: [f32; 4],
    from: [[f32; 4]; 5],
    layers: [f32; 4],
    exposures: [f32; 4],
    last: [f32; 4],
}

pub(crate) const DOORWAY_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<DoorwayCorner>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![
        0 => Float32x3, 1 => Float32x4, 2 => Float32x4, 3 => Float32x4, 4 => Float32x4,
        5 => Float32x4, 6 => Float32x4, 7 => Float32x4, 8 => Float32x4, 9 => Float32x4,
        10 => Float32x4, 11 => Float32x4, 12 => Float32x4
    ],
};

/// The frame that doorways are drawn in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DoorwayFrame {
    /// In the frame of the world. [Units: wu]
    pub(crate) eye: DVec3,
    pub(crate) exposure: f32,
    /// Side of a texture. [Units: px]
    pub(crate) side: u32,
    pub(crate) paint: PortalTexturePaint,
}

/// Adds the triangles of a doorway composed of textures.
pub(crate) fn add_corners(
    out: &mut Vec<DoorwayCorner>,
    doorway: &Doorway,
    components: &[Component],
    frame: &DoorwayFrame,
) {
    let [right, up, normal] = doorway.axes.map(|a| a.as_vec3());
    let eye = doorway.place(frame.eye);
    let low = (doorway.low - eye.at).as_vec2();
    let size = (doorway.high - doorway.low).as_vec2();
    let mut corner = DoorwayCorner {
        right: right.extend(low.x).to_array(),
        up: up.extend(low.y).to_array(),
        normal: normal.extend(eye.height as f32).to_array(),
        scale: [
            1.0 / size.x,
            1.0 / size.y,
            frame.paint as u8 as f32,
            frame.side as f32,
        ],
        ..DoorwayCorner::default()
    };
    for (k, own) in components.iter().take(MOST_COMPOSED).enumerate() {
        let at = (own.from.at - eye.at).as_vec2();
        corner.from[k] = [at.x, at.y, own.from.height as f32, own.weight as f32];
        let (layer, exposure) = (own.layer as f32, frame.exposure / own.exposure);
        if k < 4 {
            (corner.layers[k], corner.exposures[k]) = (layer, exposure);
        } else {
            (corner.last[0], corner.last[1]) = (layer, exposure);
        }
    }
    let at = |p: DVec3| DoorwayCorner {
        position: Vec3::to_array(&(p - frame.eye).as_vec3()),
        ..corner
    };
    let outline = doorway.outline();
    for pair in outline.windows(2).skip(1) {
        out.extend([outline[0], pair[0], pair[1]].map(at));
    }
}

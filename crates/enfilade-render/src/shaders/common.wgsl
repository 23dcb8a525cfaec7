// What every shader knows of a frame.

struct Globals {
    clip_from_relative: mat4x4<f32>,
    relative_from_clip: mat4x4<f32>,
    // From the world to the sun's picture of it.
    shadow_from_world: mat4x4<f32>,
    // Camera; w: what is above this height is not drawn.
    origin: vec4<f32>,
    // Where sight lines come from; w: 1 where they are parallel.
    eye: vec4<f32>,
    // Towards the sun; w: size of a shadow's texel.
    sun: vec4<f32>,
    // Width, height, 1 / width, 1 / height.
    size: vec4<f32>,
    // x: 1 where surfaces are painted by cell; y: 1 where it is explained why they are seen.
    style: vec4<u32>,
    // As in `light.rs`: from relative points to those of the field; w: exposure.
    field_shift: vec4<f32>,
    starts_low: vec4<f32>,
    starts_density: vec4<f32>,
    // Outside; where cells begin in the table; 1 where there is a field; number of cells.
    light: vec4<i32>,
}

@group(0) @binding(0) var<uniform> globals: Globals;

// The number of an instance; what is above tells why it is drawn.
const INSTANCE_MASK: u32 = 0x0fffffffu;

// From a mesh to the world. Structure is there already, and comes with the identity: to multiply by
// ones and to add zeros changes no bit of it.
fn place(p: vec3<f32>, row_x: vec4<f32>, row_y: vec4<f32>, row_z: vec4<f32>) -> vec3<f32> {
    let q = vec4(p, 1.0);
    return vec3(dot(row_x, q), dot(row_y, q), dot(row_z, q));
}

fn to_clip(relative: vec3<f32>) -> vec4<f32> {
    return globals.clip_from_relative * vec4(relative, 1.0);
}

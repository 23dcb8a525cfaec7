// What every shader knows of a frame and a world.

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
    // Paint, whether corners are darkened, whether the sun casts shadows.
    style: vec4<u32>,
}

struct Part {
    material: u32,
    color: u32,
}

struct Material {
    base_color: vec4<f32>,
    // w: least alpha that is drawn.
    emissive: vec4<f32>,
}

struct Instance {
    // Rows of the map from mesh to world.
    rows: array<vec4<f32>, 3>,
    // x: color of its cell.
    color: vec4<u32>,
}

@group(0) @binding(0) var<uniform> globals: Globals;
@group(0) @binding(1) var<storage, read> parts: array<Part>;
@group(0) @binding(2) var<storage, read> materials: array<Material>;
@group(0) @binding(3) var<storage, read> instances: array<Instance>;

const PAINT_LIT: u32 = 0u;
const PAINT_CELLS: u32 = 1u;
const PAINT_OVERDRAW: u32 = 2u;

// The number of an instance; what is above tells why it is drawn.
const INSTANCE_MASK: u32 = 0x0fffffffu;

fn place(instance: u32, p: vec3<f32>) -> vec3<f32> {
    // Structure is in the world already: not a bit of it may change.
    if (instance & INSTANCE_MASK) == 0u {
        return p;
    }
    let i = instances[instance & INSTANCE_MASK];
    let q = vec4(p, 1.0);
    return vec3(dot(i.rows[0], q), dot(i.rows[1], q), dot(i.rows[2], q));
}

fn to_clip(world: vec3<f32>) -> vec4<f32> {
    return globals.clip_from_relative * vec4(world - globals.origin.xyz, 1.0);
}

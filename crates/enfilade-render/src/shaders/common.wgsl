// Parameters of a frame for every shader.

struct Globals {
    clip_from_relative: mat4x4<f32>,
    relative_from_clip: mat4x4<f32>,
    // From the world to the shadow map.
    shadow_from_world: mat4x4<f32>,
    // Camera; w: height above which nothing is drawn.
    origin: vec4<f32>,
    // Origin of lines of sight; w: 1 if they are parallel.
    eye: vec4<f32>,
    // Towards the sun; w: size of a shadow's texel.
    sun: vec4<f32>,
    // Width, height, 1 / width, 1 / height.
    size: vec4<f32>,
    // x: 1 if surfaces are painted by cell; y: 1 if pictures explain why surfaces are visible.
    style: vec4<u32>,
    // As in `light.rs`: offset from relative points to those of the field; w: exposure.
    field_shift: vec4<f32>,
    starts_low: vec4<f32>,
    starts_density: vec4<f32>,
    // Leaf of the outside; first cell of the table; 1 if there is a field; number of cells.
    light: vec4<i32>,
    // Remainder of the origin beyond floats; w: brightness of the surroundings, 1 outdoors.
    origin_low: vec4<f32>,
    // Rows of the rotation to the frame of the first world, whose +y is up; w of the second: height of the origin;
    // of the third: share of the daylight that is left.
    root_x: vec4<f32>,
    root_y: vec4<f32>,
    root_z: vec4<f32>,
    // Plane of the special portal by which the view comes: nothing nearer than `w` along the normal is drawn.
    gate: vec4<f32>,
}

@group(0) @binding(0) var<uniform> globals: Globals;

// Bits of an instance's index; the bits above hold its reason.
const INSTANCE_MASK: u32 = 0x0fffffffu;

// Maps a mesh to the world. Structure uses the identity: multiplying by ones and adding zeros changes no bit.
fn place(p: vec3<f32>, row_x: vec4<f32>, row_y: vec4<f32>, row_z: vec4<f32>) -> vec3<f32> {
    let q = vec4(p, 1.0);
    return vec3(dot(row_x, q), dot(row_y, q), dot(row_z, q));
}

// Returns a point relative to the camera.
fn relative_of(p: vec3<f32>) -> vec3<f32> {
    return (p - globals.origin.xyz) - globals.origin_low.xyz;
}

// Turns a direction to the frame of the first world.
fn to_root(v: vec3<f32>) -> vec3<f32> {
    return vec3(dot(globals.root_x.xyz, v), dot(globals.root_y.xyz, v), dot(globals.root_z.xyz, v));
}

fn to_clip(relative: vec3<f32>) -> vec4<f32> {
    return globals.clip_from_relative * vec4(relative, 1.0);
}

// Returns the exposure of what is outdoors. For an eye in a dim room it is longer, but less than that of the room, as a
// photographer takes two pictures and joins them: else windows would be white.
fn outdoor_exposure() -> f32 {
    return pow(globals.field_shift.w, 0.3);
}

// Exponent of the contrast: middle tones are darker than the light on them, as on film; else white rooms are pale.
const CONTRAST: f32 = 1.35;

// Compresses bright values instead of clipping them: the brightest channel stays below 1, and all keep their ratio.
fn toned(c: vec3<f32>) -> vec3<f32> {
    let most = max(c.r, max(c.g, c.b));
    let fitted = pow(1.0 + most * most * most, -1.0 / 3.0);
    return c * (fitted * pow(max(most * fitted, 1e-6), CONTRAST - 1.0));
}

// Undoes `toned`.
fn untoned(c: vec3<f32>) -> vec3<f32> {
    let most = clamp(max(c.r, max(c.g, c.b)), 1e-6, 0.99);
    let fitted = pow(most, 1.0 / CONTRAST);
    return c * (fitted / most * pow(1.0 - fitted * fitted * fitted, -1.0 / 3.0));
}

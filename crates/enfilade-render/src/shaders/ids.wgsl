// Which triangle each pixel shows: numbers instead of colors.
//
// Corners are fetched by number, without an index buffer, so that three corners in a row know their
// triangle, however a draw is divided into ranges.

@group(0) @binding(1) var<storage, read> corners: array<u32>;
@group(0) @binding(2) var<storage, read> indices: array<u32>;

// Words of a corner.
const STRIDE: u32 = 10u;

struct Id {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) id: vec2<u32>,
}

@vertex
fn corner(
    @builtin(vertex_index) at: u32,
    @location(6) row_x: vec4<f32>,
    @location(7) row_y: vec4<f32>,
    @location(8) row_z: vec4<f32>,
    @location(9) key: vec2<u32>,
) -> Id {
    let first = indices[at] * STRIDE;
    let p = vec3(
        bitcast<f32>(corners[first]),
        bitcast<f32>(corners[first + 1u]),
        bitcast<f32>(corners[first + 2u]),
    );
    var out: Id;
    out.clip = to_clip(place(p, row_x, row_y, row_z) - globals.origin.xyz);
    // 0 is for the sky.
    out.id = vec2((key.x & INSTANCE_MASK) + 1u, at / 3u);
    return out;
}

@fragment
fn id(in: Id) -> @location(0) vec4<u32> {
    // The depth, too: what ties with another is told from what is behind it.
    return vec4(in.id, bitcast<u32>(in.clip.z), 0u);
}

// Which triangle each pixel shows: numbers instead of colors.
//
// Corners are fetched by number, without an index buffer, so that three corners in a row know their
// triangle, however a draw is divided into ranges.

@group(0) @binding(6) var<storage, read> corners: array<u32>;
@group(0) @binding(7) var<storage, read> indices: array<u32>;

struct Id {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) id: vec2<u32>,
}

@vertex
fn corner(@builtin(vertex_index) at: u32, @location(0) instance: u32) -> Id {
    let first = indices[at] * 8u;
    let p = vec3(
        bitcast<f32>(corners[first]),
        bitcast<f32>(corners[first + 1u]),
        bitcast<f32>(corners[first + 2u]),
    );
    var out: Id;
    out.clip = to_clip(place(instance, p));
    // 0 is for the sky.
    out.id = vec2((instance & INSTANCE_MASK) + 1u, at / 3u);
    return out;
}

@fragment
fn id(in: Id) -> @location(0) vec4<u32> {
    // The depth, too: what ties with another is told from what is behind it.
    return vec4(in.id, bitcast<u32>(in.clip.z), 0u);
}

// Vertices are fetched by index, without an index buffer, so that three vertices in a row determine their triangle,
// however a draw is divided into ranges.

@group(0) @binding(1) var<storage, read> corners: array<u32>;
@group(0) @binding(2) var<storage, read> indices: array<u32>;

// Words per vertex.
const STRIDE: u32 = 10u;

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
    return id_corner(p, at, row_x, row_y, row_z, key.x);
}

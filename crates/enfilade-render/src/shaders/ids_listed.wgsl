// If vertex shaders cannot read storage buffers, each triangle's vertices are listed once more.

@vertex
fn corner(
    @builtin(vertex_index) at: u32,
    @location(0) position: vec3<f32>,
    @location(6) row_x: vec4<f32>,
    @location(7) row_y: vec4<f32>,
    @location(8) row_z: vec4<f32>,
    @location(9) key: vec2<u32>,
) -> Id {
    return id_corner(position, at, row_x, row_y, row_z, key.x);
}

// Depth only: the shadow map, and surfaces that hide portals.

struct Corner {
    @location(0) position: vec3<f32>,
    @location(6) row_x: vec4<f32>,
    @location(7) row_y: vec4<f32>,
    @location(8) row_z: vec4<f32>,
}

@vertex
fn from_sun(in: Corner) -> @builtin(position) vec4<f32> {
    return globals.shadow_from_world * vec4(place(in.position, in.row_x, in.row_y, in.row_z), 1.0);
}

@vertex
fn from_eye(in: Corner) -> @builtin(position) vec4<f32> {
    return to_clip(relative_of(place(in.position, in.row_x, in.row_y, in.row_z)));
}

// For outlines, from their vertices alone.
@vertex
fn outline(@location(0) position: vec3<f32>) -> @builtin(position) vec4<f32> {
    return to_clip(relative_of(position));
}

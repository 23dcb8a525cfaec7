// The sun's picture of the world: depth alone.

@vertex
fn corner(@location(0) position: vec3<f32>, @location(5) instance: u32) -> @builtin(position) vec4<f32> {
    return globals.shadow_from_world * vec4(place(instance, position), 1.0);
}

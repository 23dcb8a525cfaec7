// Lines and translucent polygons over the picture, already in clip space.

struct Mark {
    @builtin(position) clip: vec4<f32>,
    @location(0) color: vec4<f32>,
    // Depth and distance: marks lie nearer than coincident surfaces.
    @location(1) depth: vec2<f32>,
}

@vertex
fn corner(@location(0) position: vec4<f32>, @location(1) color: vec4<f32>) -> Mark {
    return Mark(position, color, position.zw);
}

@fragment
fn mark(in: Mark) -> Drawn {
    return drawn_at(in.color, in.depth.x / in.depth.y);
}

// Lines and see-through polygons over the picture; already in clip space.

struct Mark {
    @builtin(position) clip: vec4<f32>,
    @location(0) color: vec4<f32>,
}

@vertex
fn corner(@location(0) position: vec4<f32>, @location(1) color: vec4<f32>) -> Mark {
    return Mark(position, color);
}

@fragment
fn mark(in: Mark) -> @location(0) vec4<f32> {
    return in.color;
}

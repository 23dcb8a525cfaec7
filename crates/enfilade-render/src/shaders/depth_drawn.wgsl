// Output of surfaces where the adapter's depth is as fine as the shader's.

struct Drawn {
    @location(0) color: vec4<f32>,
}

fn depth_of(clip: vec4<f32>) -> f32 {
    return clip.z;
}

struct DrawnId {
    @location(0) id: vec4<u32>,
}

fn drawn_id(id: vec4<u32>, depth: f32) -> DrawnId {
    return DrawnId(id);
}

fn drawn(clip: vec4<f32>, color: vec4<f32>) -> Drawn {
    return Drawn(color);
}

fn drawn_at(color: vec4<f32>, depth: f32) -> Drawn {
    return Drawn(color);
}

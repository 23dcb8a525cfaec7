// Output of surfaces on OpenGL: depth as well.
//
// There, clip space runs from -1 to 1, and distant points, here at 0, would be at -1, where floats are coarse: at
// 600 m, surfaces half a meter apart have equal depths. So the depth is computed again, exactly.

struct Drawn {
    @location(0) color: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

fn depth_of(clip: vec4<f32>) -> f32 {
    // Parallel lines: fine enough.
    if globals.eye.w > 0.5 {
        return clip.z;
    }
    // Distance of the near plane over that of the surface; `w` of a fragment is 1 / distance.
    return globals.clip_from_relative[3].z * clip.w;
}

struct DrawnId {
    @location(0) id: vec4<u32>,
    @builtin(frag_depth) depth: f32,
}

fn drawn_id(id: vec4<u32>, depth: f32) -> DrawnId {
    return DrawnId(id, depth);
}

fn drawn(clip: vec4<f32>, color: vec4<f32>) -> Drawn {
    return Drawn(color, depth_of(clip));
}

fn drawn_at(color: vec4<f32>, depth: f32) -> Drawn {
    return Drawn(color, depth);
}

// Depth only.
@fragment
fn only_depth(@builtin(position) clip: vec4<f32>) -> @builtin(frag_depth) f32 {
    return depth_of(clip);
}

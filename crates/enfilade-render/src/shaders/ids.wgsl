// Triangle of each pixel: indices instead of colors.

struct Id {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) id: vec2<u32>,
}

// Output for vertex `at` of all, three in a row per triangle.
fn id_corner(p: vec3<f32>, at: u32, row_x: vec4<f32>, row_y: vec4<f32>, row_z: vec4<f32>, key: u32) -> Id {
    var out: Id;
    out.clip = to_clip(relative_of(place(p, row_x, row_y, row_z)));
    // 0 means sky.
    out.id = vec2((key & INSTANCE_MASK) + 1u, at / 3u);
    return out;
}

@fragment
fn id(in: Id) -> DrawnId {
    // The depth, too: it distinguishes a tie from a hidden surface.
    let depth = depth_of(in.clip);
    return drawn_id(vec4(in.id, bitcast<u32>(depth), 0u), depth);
}

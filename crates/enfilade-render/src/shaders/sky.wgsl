// The sky, and the triangle that covers the screen to paint it.

@vertex
fn whole(@builtin(vertex_index) i: u32) -> @builtin(position) vec4<f32> {
    // Farthest: depth 0.
    return vec4(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// Returns the position of a pixel's surface relative to the camera.
fn point_at(p: vec2<i32>, z: f32) -> vec3<f32> {
    let uv = (vec2<f32>(p) + 0.5) * globals.size.zw;
    let q = globals.relative_from_clip * vec4(uv.x * 2.0 - 1.0, 1.0 - uv.y * 2.0, z, 1.0);
    return q.xyz / q.w;
}

// Returns the color of the sky, or of open land up to the horizon, along a line.
fn sky_along(ray: vec3<f32>) -> vec3<f32> {
    let t = clamp(to_root(ray).y, -1.0, 1.0);
    let haze = vec3(0.80, 0.85, 0.91);
    let land = mix(haze, vec3(0.40, 0.47, 0.33), sqrt(min(-t / 0.25, 1.0)));
    let above = mix(haze, vec3(0.30, 0.48, 0.78), sqrt(max(t, 0.0)));
    return min(select(above, land, t < 0.0) * outdoor_exposure(), vec3(1.0)) * globals.root_z.w;
}

fn sky(p: vec2<i32>) -> vec3<f32> {
    if globals.eye.w > 0.5 {
        return vec3(0.93, 0.94, 0.96);
    }
    return sky_along(normalize(point_at(p, 0.5)));
}

@fragment
fn open_air(@builtin(position) clip: vec4<f32>) -> @location(0) vec4<f32> {
    return vec4(sky(vec2<i32>(clip.xy)), 1.0);
}

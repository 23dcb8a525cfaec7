// Effects on the image of the surfaces: ambient occlusion, heat map of overdraw.

@group(1) @binding(0) var color: texture_2d<f32>;
// Floats instead of a depth texture: GLSL cannot load texels of those.
@group(1) @binding(1) var depth: texture_2d<f32>;

fn depth_at(p: vec2<i32>) -> f32 {
    let limit = vec2<i32>(globals.size.xy) - 1;
    return textureLoad(depth, clamp(p, vec2(0), limit), 0).x;
}

const SAMPLES: i32 = 20;
// Reach of ambient occlusion. [Units: wu]
const REACH: f32 = 1.0;

// Ambient occlusion from depths alone, after McGuire et al., "The Alchemy Screen-Space Ambient
// Obscurance Algorithm" (HPG 2011), section 2.
fn open_sky(p: vec2<i32>, at: vec3<f32>, z: f32) -> f32 {
    // The neighbor along an axis that lies on the same surface.
    let left = point_at(p + vec2(-1, 0), depth_at(p + vec2(-1, 0)));
    let right = point_at(p + vec2(1, 0), depth_at(p + vec2(1, 0)));
    let above = point_at(p + vec2(0, -1), depth_at(p + vec2(0, -1)));
    let below = point_at(p + vec2(0, 1), depth_at(p + vec2(0, 1)));
    var dx = right - at;
    if distance(left, at) < distance(right, at) { dx = at - left; }
    var dy = above - at;
    if distance(below, at) < distance(above, at) { dy = at - below; }
    let normal = normalize(cross(dx, dy));
    // The reach in pixels at this depth.
    let clip = globals.clip_from_relative * vec4(at, 1.0);
    let scale = length(vec3(
        globals.clip_from_relative[0].y,
        globals.clip_from_relative[1].y,
        globals.clip_from_relative[2].y,
    ));
    let radius = clamp(0.5 * globals.size.y * scale * REACH / clip.w, 3.0, 0.2 * globals.size.y);
    // Rotated differently in each pixel of a block: noise finer than the eye sees, the same in each frame.
    let noise = fract(52.9829189 * fract(dot(vec2<f32>(p), vec2(0.06711056, 0.00583715))));
    var sum = 0.0;
    for (var i = 0; i < SAMPLES; i++) {
        let share = (f32(i) + 0.5) / f32(SAMPLES);
        let angle = (noise + f32(i) * 0.381966) * 6.2831853;
        let offset = vec2<i32>(vec2(cos(angle), sin(angle)) * radius * share);
        let zq = depth_at(p + offset);
        if zq <= 0.0 { continue; }
        let v = point_at(p + offset, zq) - at;
        let d2 = dot(v, v);
        let near = max(1.0 - d2 / (REACH * REACH), 0.0);
        sum += near * max(dot(v, normal) - 0.006 - 0.002 * clip.w, 0.0) * inverseSqrt(d2 + 1e-4);
    }
    return clamp(1.0 - 1.7 * sum / f32(SAMPLES), 0.0, 1.0);
}

// Black, blue, red, yellow, white.
fn heat(n: f32) -> vec3<f32> {
    let t = clamp(n / 16.0, 0.0, 1.0) * 4.0;
    let a = mix(vec3(0.0), vec3(0.05, 0.08, 0.5), min(t, 1.0));
    let b = mix(a, vec3(0.75, 0.08, 0.15), clamp(t - 1.0, 0.0, 1.0));
    let c = mix(b, vec3(1.0, 0.75, 0.1), clamp(t - 2.0, 0.0, 1.0));
    return mix(c, vec3(1.0), clamp(t - 3.0, 0.0, 1.0));
}

@fragment
fn heat_map(@builtin(position) clip: vec4<f32>) -> @location(0) vec4<f32> {
    let drawn = textureLoad(color, vec2<i32>(clip.xy), 0);
    return vec4(heat(drawn.a * 255.0 / 8.0), 1.0);
}

// True if the sky is in the picture already.
override KEEPS_SKY: bool = false;

// True if pixels of alpha 0 come from portal textures, which were finished when they were made.
override HAS_TEXTURES: bool = false;

@fragment
fn finish(@builtin(position) clip: vec4<f32>) -> @location(0) vec4<f32> {
    let p = vec2<i32>(clip.xy);
    let z = depth_at(p);
    // Only the sky is at the far end.
    let drawn = textureLoad(color, p, 0);
    if z <= 0.0 {
        if KEEPS_SKY {
            return vec4(drawn.rgb, 1.0);
        }
        return vec4(sky(p), 1.0);
    }
    if HAS_TEXTURES {
        if drawn.a == 0.0 {
            return vec4(drawn.rgb, 1.0);
        }
    }
    return vec4(drawn.rgb * open_sky(p, point_at(p, z), z), 1.0);
}

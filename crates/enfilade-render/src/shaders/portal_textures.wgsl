// Portals filled by textures of what lies behind them, warped by their depths.
//
// A texture was taken from a viewpoint at height `h` before the portal's plane. A point behind the plane, at distance `w`
// from the viewpoint along the normal, has depth `h / w`. Let a line of sight have parameter `l = 1 - h / w`: 0 in the plane,
// 1 at infinity. Its image in the texture is then a segment that is linear in `l`, from where the line meets the plane
// to its vanishing point; so the search for the first surface is a walk along texels in equal steps, after Policarpo,
// Oliveira & Comba, "Real-time relief mapping on arbitrary polygonal surfaces" (I3D 2005).

@group(1) @binding(0) var colors: texture_2d_array<f32>;
@group(1) @binding(1) var depths: texture_2d_array<f32>;
@group(1) @binding(2) var filtered: sampler;

// True if textures are warped.
override WARPS: bool = true;
// True if the pass after this one must know which pixels are from textures.
override MARKS: bool = false;

const N: i32 = 5;
// Steps along a segment at most. Longer ones skip texels.
const MOST_STEPS: f32 = 64.0;
// A surface is met if the line is behind it by no more than this many steps: otherwise it passed behind its edge.
const STEEPEST: f32 = 5.0;
// Weights of what is known less surely: lines that passed behind an edge, and those that no texture shows.
const PASSED: f32 = 0.2;
const UNKNOWN: f32 = 0.002;

struct Doorway {
    @builtin(position) clip: vec4<f32>,
    // Relative to the eye.
    @location(0) relative: vec3<f32>,
    // Right; w: lower edge along it.
    @location(1) @interpolate(flat) right: vec4<f32>,
    // Up.
    @location(2) @interpolate(flat) up: vec4<f32>,
    // Normal; w: height of the eye.
    @location(3) @interpolate(flat) normal: vec4<f32>,
    // x, y: inverse size of the rectangle; z: 1 to show holes, 2 to tint; w: side of a texture.
    @location(4) @interpolate(flat) scale: vec4<f32>,
    // Viewpoints: in the plane, height, weight.
    @location(5) @interpolate(flat) from_0: vec4<f32>,
    @location(6) @interpolate(flat) from_1: vec4<f32>,
    @location(7) @interpolate(flat) from_2: vec4<f32>,
    @location(8) @interpolate(flat) from_3: vec4<f32>,
    @location(9) @interpolate(flat) from_4: vec4<f32>,
    // Layers; of the last: layer, exposure.
    @location(10) @interpolate(flat) layers: vec4<f32>,
    @location(11) @interpolate(flat) exposures: vec4<f32>,
    @location(12) @interpolate(flat) last: vec4<f32>,
}

@vertex
fn doorway(
    @location(0) position: vec3<f32>,
    @location(1) right: vec4<f32>,
    @location(2) up: vec4<f32>,
    @location(3) normal: vec4<f32>,
    @location(4) scale: vec4<f32>,
    @location(5) from_0: vec4<f32>,
    @location(6) from_1: vec4<f32>,
    @location(7) from_2: vec4<f32>,
    @location(8) from_3: vec4<f32>,
    @location(9) from_4: vec4<f32>,
    @location(10) layers: vec4<f32>,
    @location(11) exposures: vec4<f32>,
    @location(12) last: vec4<f32>,
) -> Doorway {
    return Doorway(to_clip(position), position, right, up, normal, scale,
        from_0, from_1, from_2, from_3, from_4, layers, exposures, last);
}

struct Found {
    color: vec3<f32>,
    // 1 - h / w.
    l: f32,
    sureness: f32,
}

fn surface_at(uv: vec2<f32>, layer: i32, side: f32) -> f32 {
    let p = clamp(vec2<i32>(floor(uv * side)), vec2(0), vec2(i32(side) - 1));
    return 1.0 - textureLoad(depths, p, layer, 0).x;
}

fn color_at(uv: vec2<f32>, layer: i32) -> vec3<f32> {
    return textureSampleLevel(colors, filtered, uv, layer, 0.0).rgb;
}

// Walks from `a`, in the plane, to `b`, the vanishing point.
fn found(a: vec2<f32>, b: vec2<f32>, layer: i32, side: f32) -> Found {
    if !WARPS {
        return Found(color_at(a, layer), surface_at(a, layer, side), 1.0);
    }
    let n = clamp(ceil(length(b - a) * side), 4.0, MOST_STEPS);
    let step = 1.0 / n;
    var before = surface_at(a, layer, side);
    // The line begins in the plane: behind nothing.
    var before_l = 0.0;
    var is_behind = false;
    var sureness = 1.0;
    // Where the line was last before a surface.
    var clear_uv = a;
    var clear_l = before;
    for (var i = 1.0; i <= n; i += 1.0) {
        // The last step is exact: the sky is at 1.
        let l = select(i * step, 1.0, i == n);
        let uv = mix(a, b, l);
        if any(uv < vec2(0.0)) || any(uv > vec2(1.0)) {
            // No texel shows what is seen beyond the rectangle.
            let edge = clamp(uv, vec2(0.0), vec2(1.0));
            return Found(color_at(edge, layer), max(l, surface_at(edge, layer, side)), UNKNOWN);
        }
        let here = surface_at(uv, layer, side);
        if l < here {
            is_behind = false;
            clear_uv = uv;
            clear_l = here;
        } else if !is_behind {
            if l - here <= STEEPEST * step {
                // Between the last two steps, both surface and line are straight.
                let ahead = before - before_l;
                let past = l - here;
                let t = select(0.0, clamp(ahead / (ahead + past), 0.0, 1.0), ahead > 0.0);
                let at = mix(before_l, l, t);
                return Found(color_at(mix(a, b, at), layer), at, sureness);
            }
            is_behind = true;
            sureness = PASSED;
        }
        before = here;
        before_l = l;
    }
    // Hidden to the end: the surface that was seen beside the edge goes on behind it.
    return Found(color_at(clear_uv, layer), clear_l, UNKNOWN);
}

// Changes the exposure of what has its tones already.
fn exposed(c: vec3<f32>, by: f32) -> vec3<f32> {
    return toned(untoned(c) * by);
}

struct Filled {
    @location(0) color: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn filled(in: Doorway) -> Filled {
    let height = in.normal.w;
    let in_plane = vec2(dot(in.right.xyz, in.relative), dot(in.up.xyz, in.relative));
    let low = vec2(in.right.w, in.up.w);
    let direction = in_plane / height;
    let viewpoints = array<vec4<f32>, N>(in.from_0, in.from_1, in.from_2, in.from_3, in.from_4);
    let layers = array<f32, N>(in.layers.x, in.layers.y, in.layers.z, in.layers.w, in.last.x);
    let exposures = array<f32, N>(in.exposures.x, in.exposures.y, in.exposures.z, in.exposures.w, in.last.y);
    var sum = vec4(0.0);
    var surest = 0.0;
    var weightiest = 0.0;
    // Distance behind the plane along the normal, over the eye's height; negative at infinity.
    var beyond = 0.0;
    for (var k = 0; k < N; k++) {
        let own = viewpoints[k];
        if own.w <= 0.0 { continue; }
        let vanishing = own.xy + direction * own.z;
        let a = (in_plane - low) * in.scale.xy;
        let b = (vanishing - low) * in.scale.xy;
        let f = found(vec2(a.x, 1.0 - a.y), vec2(b.x, 1.0 - b.y), i32(layers[k] + 0.5), in.scale.w);
        let weight = own.w * f.sureness;
        sum += vec4(exposed(f.color, exposures[k]), 1.0) * weight;
        surest = max(surest, f.sureness);
        if weight > weightiest {
            weightiest = weight;
            beyond = select(-1.0, own.z / height * f.l / max(1.0 - f.l, 1e-6), f.l < 0.9999999);
        }
    }
    var color = sum.rgb / max(sum.w, 1e-9);
    if in.scale.z > 1.5 {
        color = mix(color, vec3(0.0, 0.7, 1.0), 0.4);
    } else if in.scale.z > 0.5 && surest < 0.5 * PASSED {
        color = vec3(1.0, 0.0, 1.0);
    }
    // Slightly farther, so that a surface drawn as geometry as well wins.
    // The sky is nearer than nothing, or the sky of the view would be drawn over it.
    let depth = select(depth_of(in.clip) / (1.0 + beyond) * 0.9999, 1e-20, beyond < 0.0);
    return Filled(vec4(color, select(1.0, 0.0, MARKS)), depth);
}

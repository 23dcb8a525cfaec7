// Light of lamps, each with a map of the distances around it: see `lamps.rs`.

struct Lamp {
    // Relative to the camera; w: range.
    at: vec4<f32>,
    // w: first layer of its map.
    color: vec4<f32>,
    // Rotation to the lamp's own frame.
    turn: vec4<f32>,
    // Axis of its cone; w: scale of the rim.
    toward: vec4<f32>,
    // x: offset of the rim.
    rim: vec4<f32>,
}

struct Lamps {
    n: vec4<u32>,
    lamps: array<Lamp, 200>,
}

@group(0) @binding(8) var<uniform> lamps: Lamps;
@group(0) @binding(9) var lamp_maps: texture_depth_2d_array;

// For each cell, a bit for each lamp that reaches it.
@group(0) @binding(10) var lit_cells: texture_2d<u32>;

// Near plane of the maps, and texels beyond the edge of a face: as in `maps.rs`.
const LAMP_NEAR: f32 = 0.05;
const LAMP_MARGIN: f32 = 3.0;

fn turned(q: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
    let t = 2.0 * cross(q.xyz, v);
    return v + q.w * t + cross(q.xyz, t);
}

// Returns 1 at a point that the lamp reaches, 0 in shadow. `p` is relative to the lamp, in its frame; `lift` moves it off
// its surface, by texels of the map there.
fn reached(p: vec3<f32>, lift: vec3<f32>, range: f32, layer: i32) -> f32 {
    let side = f32(textureDimensions(lamp_maps).x);
    let far = max(abs(p.x), max(abs(p.y), abs(p.z)));
    let texel = 2.0 * far / side;
    let q = p + lift * (1.5 * texel + 0.002);
    let a = abs(q);
    var face = 4;
    var uvw = vec3(q.x, q.y, q.z);
    if a.x >= a.y && a.x >= a.z {
        face = 0;
        uvw = vec3(q.y, q.z, q.x);
    } else if a.y >= a.z {
        face = 2;
        uvw = vec3(q.z, q.x, q.y);
    }
    if uvw.z < 0.0 { face += 1; }
    let w = abs(uvw.z);
    let at = uvw.xy / w * (0.5 * (1.0 - 2.0 * LAMP_MARGIN / side));
    let uv = vec2(0.5 + at.x, 0.5 - at.y);
    let near = max(w - 0.5 * texel - 0.003, LAMP_NEAR);
    let depth = range / (range - LAMP_NEAR) * (1.0 - LAMP_NEAR / near);
    // Four samples, each of four texels: an edge as soft as that of a lamp the size of a fist.
    let step = 0.7 / side;
    var lit = 0.0;
    for (var i = 0; i < 4; i++) {
        let by = vec2(f32(i & 1) * 2.0 - 1.0, f32(i >> 1) * 2.0 - 1.0) * step;
        lit += textureSampleCompareLevel(lamp_maps, shadow_sampler, uv + by, layer + face, depth);
    }
    return 0.25 * lit;
}

fn lit_word(cell: i32, texel: u32) -> vec4<u32> {
    let at = 2u * u32(cell) + texel;
    return textureLoad(lit_cells, vec2(at % ROW, at / ROW), 0);
}

// Returns the light of all lamps on a surface of a cell: -1 in no air, -2 if cells are unknown. `relative` to the camera.
//
// A lamp lights only cells that it reaches: along a thin wall, the texels of a map show both of its sides. For the same
// reason, the map is read a little nearer to the eye, where there is air for certain.
fn lamplight(relative: vec3<f32>, normal: vec3<f32>, toward_eye: vec3<f32>, cell: i32) -> vec3<f32> {
    var sum = vec3(0.0);
    var bits = array<vec4<u32>, 2>(vec4(0xffffffffu), vec4(0xffffffffu));
    if cell == -1 { return sum; }
    if cell >= 0 {
        bits = array<vec4<u32>, 2>(lit_word(cell, 0u), lit_word(cell, 1u));
    }
    for (var i = 0u; i < lamps.n.x; i++) {
        if ((bits[i / 128u][i / 32u % 4u] >> (i % 32u)) & 1u) == 0u { continue; }
        let lamp = lamps.lamps[i];
        let way = lamp.at.xyz - relative;
        let distance = length(way);
        let facing = dot(normal, way);
        if distance >= lamp.at.w || facing <= 0.0 { continue; }
        // Falloff, range and cone as in the glTF extension KHR_lights_punctual.
        let part = distance / lamp.at.w;
        let window = 1.0 - part * part * part * part;
        let near = max(distance, 0.1);
        let along = dot(lamp.toward.xyz, -way) / distance;
        let rim = clamp(along * lamp.toward.w + lamp.rim.x, 0.0, 1.0);
        let bright = facing / near * window / (near * near) * rim * rim;
        if bright <= 0.0 { continue; }
        let p = turned(lamp.turn, -way);
        let lift = turned(lamp.turn, normal + toward_eye);
        sum += lamp.color.rgb * (bright * reached(p, lift, lamp.at.w, i32(lamp.color.w)));
    }
    // The eye gets used to bright places near a lamp.
    return sum / (1.0 + 0.8 * max(sum.r, max(sum.g, sum.b)));
}

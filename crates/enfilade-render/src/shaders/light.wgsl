// The cell of a point, and the light of the air there: see `light.rs`.

@group(0) @binding(3) var table: texture_2d<u32>;
@group(0) @binding(4) var starts: texture_3d<i32>;
@group(0) @binding(5) var probes: texture_3d<f32>;
@group(0) @binding(6) var probe_sampler: sampler;
// The explanation of visibility: see `explain.rs`.
@group(0) @binding(7) var explanation: texture_2d<u32>;

const ROW: u32 = 1024u;
const CELL_TEXELS: i32 = 4;

fn entry(i: i32) -> vec4<u32> {
    let at = u32(i);
    return textureLoad(table, vec2(at % ROW, at / ROW), 0);
}

// Returns the cell of a point of the field, or -1 in solid matter.
fn locate(p: vec3<f32>) -> i32 {
    let q = vec3<i32>(floor((p - globals.starts_low.xyz) * globals.starts_density.xyz));
    let n = vec3<i32>(textureDimensions(starts));
    var at = globals.light.x;
    if all(q >= vec3(0)) && all(q < n) {
        at = textureLoad(starts, q, 0).x;
    }
    // No tree is deeper; and no loop may run forever.
    for (var i = 0; i < 256 && at >= 0; i++) {
        let plane = bitcast<vec4<f32>>(entry(2 * at));
        let children = bitcast<vec2<i32>>(entry(2 * at + 1).xy);
        at = select(children.y, children.x, dot(plane.xyz, p) + plane.w >= 0.0);
    }
    return select(-1, -2 - at, at < -1);
}

// Returns the cell of the air before a surface.
fn cell_before(p: vec3<f32>, normal: vec3<f32>, toward_eye: vec3<f32>) -> i32 {
    var cell = locate(p + normal * 0.02);
    if cell < 0 { cell = locate(p + normal * 0.1); }
    if cell < 0 { cell = locate(p + normal * 0.15 + toward_eye * 0.3); }
    return cell;
}

fn probe(at: vec3<f32>, slab: f32, rows: f32) -> vec3<f32> {
    let size = vec3<f32>(textureDimensions(probes));
    let uvw = (at + vec3(0.0, slab * rows, 0.0)) / size;
    return textureSampleLevel(probes, probe_sampler, uvw, 0.0).rgb;
}

// Outdoors: the sky above, the ground's reflection below; walls shaded by direction, so that their edges show.
fn open_light(own: vec3<f32>) -> vec3<f32> {
    let normal = to_root(own);
    let up = normal.y * 0.5 + 0.5;
    return mix(vec3(0.30, 0.28, 0.26), vec3(0.50, 0.54, 0.60), up)
        * (0.90 + 0.10 * normal.x - 0.06 * normal.z);
}

// Returns the light on a surface of a cell, without direct sun.
fn light_in(cell: i32, p: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    if cell < 0 {
        return open_light(normal) * 0.6;
    }
    let first = globals.light.y + cell * CELL_TEXELS;
    let low = entry(first);
    if low.w != 0u {
        return open_light(normal) * 1.15;
    }
    let density = bitcast<vec3<f32>>(entry(first + 1).xyz);
    let n = bitcast<vec3<f32>>(entry(first + 2).xyz);
    let base = bitcast<vec3<f32>>(entry(first + 3).xyz);
    // Between the centers of the outermost texels, so that slabs do not bleed into each other.
    let q = clamp((p - bitcast<vec3<f32>>(low.xyz)) * density, vec3(0.5), n - 0.5);
    let share = normal * normal;
    let slab = select(vec3(1.0, 3.0, 5.0), vec3(0.0, 2.0, 4.0), normal >= vec3(0.0));
    return share.x * probe(base + q, slab.x, n.y)
        + share.y * probe(base + q, slab.y, n.y)
        + share.z * probe(base + q, slab.z, n.y);
}

// Returns `true` for a cell outdoors, and for surfaces that face no cell.
fn is_outdoors(cell: i32) -> bool {
    return cell < 0 || entry(globals.light.y + cell * CELL_TEXELS).w != 0u;
}

fn color_of_cell(cell: i32) -> u32 {
    return entry(globals.light.y + cell * CELL_TEXELS + 1).w;
}

fn said(i: u32) -> vec4<u32> {
    return textureLoad(explanation, vec2(i % ROW, i / ROW), 0);
}

fn is_within(p: vec3<f32>, planes: vec2<u32>) -> bool {
    for (var i = 0u; i < planes.y; i++) {
        let plane = bitcast<vec4<f32>>(said(planes.x + i));
        if dot(plane.xyz, p) + plane.w < 0.0 { return false; }
    }
    return true;
}

fn is_within_any(p: vec3<f32>, visits: vec2<u32>) -> bool {
    for (var i = 0u; i < visits.y; i++) {
        if is_within(p, said(visits.x + i).xy) { return true; }
    }
    return false;
}

// Returns why a point of a cell is not visible: 0 visible, 1 out of view, 2 behind walls, 3 behind a large
// polygon, 4 not in air.
fn reason_of(cell: i32, p: vec3<f32>) -> u32 {
    if cell < 0 { return 4u; }
    if !is_within(p, said(0u).xy) { return 1u; }
    let visits = said(1u + u32(cell));
    if is_within_any(p, visits.xy) { return 0u; }
    if is_within_any(p, visits.zw) { return 3u; }
    return 2u;
}

// Surfaces: textures, sun, sky.
//
// Features that a frame does not use are left out of the shader, not skipped by a branch: a software renderer
// that shades eight pixels at a time takes both sides of each branch, and nine unused shadow samples cost more than
// everything else. For the same reason, values that are constant along a surface come with its vertices.

override CASTS_SHADOWS: bool = false;
// True if the light of each place is known.
override HAS_LIGHT: bool = false;
// True if vertices have normals.
override IS_SMOOTH: bool = false;
// True if cells, or reasons of visibility, may determine the color.
override EXPLAINS: bool = false;
// True for copies of a mesh that have the color of their instance.
override IS_PROP: bool = false;
// True if lamps shine.
override HAS_LAMPS: bool = false;
// True if the view may come by a special portal.
override HAS_GATE: bool = false;

@group(0) @binding(1) var shadow_map: texture_depth_2d;
@group(0) @binding(2) var shadow_sampler: sampler_comparison;
@group(1) @binding(0) var base_texture: texture_2d<f32>;
@group(1) @binding(1) var base_sampler: sampler;

struct Corner {
    @location(0) position: vec3<f32>,
    @location(1) normal: vec4<f32>,
    @location(2) uv: vec2<f32>,
    // The material's color times the vertex's own.
    @location(3) color: vec4<f32>,
    // w: least alpha that is drawn.
    @location(4) emissive: vec4<f32>,
    // Color of its cell, for structure.
    @location(5) cell: u32,
    // Rows of the map from mesh to world.
    @location(6) row_x: vec4<f32>,
    @location(7) row_y: vec4<f32>,
    @location(8) row_z: vec4<f32>,
    // Index and reason; color of its cell.
    @location(9) key: vec2<u32>,
}

struct Surface {
    @builtin(position) clip: vec4<f32>,
    // Relative to the camera.
    @location(0) relative: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) uv: vec2<f32>,
    @location(3) color: vec4<f32>,
    @location(4) @interpolate(flat) emissive: vec4<f32>,
    // Color of its cell, reason.
    @location(5) @interpolate(flat) explained: vec2<u32>,
}

@vertex
fn corner(in: Corner) -> Surface {
    var out: Surface;
    out.relative = relative_of(place(in.position, in.row_x, in.row_y, in.row_z));
    out.clip = to_clip(out.relative);
    if IS_SMOOTH {
        let n = in.normal.xyz;
        // The cofactors: the inverse transposed, up to a factor.
        out.normal = vec3(
            dot(cross(in.row_y.xyz, in.row_z.xyz), n),
            dot(cross(in.row_z.xyz, in.row_x.xyz), n),
            dot(cross(in.row_x.xyz, in.row_y.xyz), n),
        );
    }
    out.uv = in.uv;
    out.color = in.color;
    if IS_PROP {
        out.color = vec4(unpacked(in.key.y), 1.0);
    }
    out.emissive = in.emissive;
    if IS_PROP {
        out.emissive = vec4(out.color.rgb * unpack4x8unorm(in.key.y).a, 0.0);
    }
    if EXPLAINS {
        let is_structure = (in.key.x & INSTANCE_MASK) == 0u;
        let cell = select(in.key.y, in.cell, is_structure);
        out.explained = vec2(cell, in.key.x >> 28u);
    }
    return out;
}

// Returns the color of a surface without a material: boards below, plaster around, white above.
fn bare_color(own: vec3<f32>) -> vec3<f32> {
    let up = to_root(own).y;
    let wall = vec3(0.70, 0.67, 0.61);
    let low = mix(wall, vec3(0.45, 0.35, 0.25), smoothstep(0.5, 0.8, up));
    return mix(low, vec3(0.80, 0.80, 0.78), smoothstep(0.5, 0.8, -up));
}

fn unpacked(c: u32) -> vec3<f32> {
    let v = unpack4x8unorm(c);
    return pow(v.rgb, vec3(2.2));
}

// Returns 1 in the sun, 0 in shadow.
fn sunlit(world: vec3<f32>, normal: vec3<f32>) -> f32 {
    let lifted = world + normal * globals.sun.w * 2.0;
    let q = globals.shadow_from_world * vec4(lifted, 1.0);
    let uv = vec2(0.5 + 0.5 * q.x, 0.5 - 0.5 * q.y);
    let texel = 1.0 / f32(textureDimensions(shadow_map).x);
    var lit = 0.0;
    for (var y = -1; y <= 1; y++) {
        for (var x = -1; x <= 1; x++) {
            let at = uv + vec2(f32(x), f32(y)) * texel;
            lit += textureSampleCompareLevel(shadow_map, shadow_sampler, at, q.z);
        }
    }
    return lit / 9.0;
}

// The light from a surface to the eye, and the data for a reflection.
struct Shaded {
    color: vec4<f32>,
    normal: vec3<f32>,
    toward_eye: vec3<f32>,
    // The cell before it, or -1.
    cell: i32,
}

fn shaded(in: Surface, texel: vec4<f32>) -> Shaded {
    // From the camera's position, or along parallel lines.
    let eye = (globals.eye.xyz - globals.origin.xyz) - in.relative * (1.0 - globals.eye.w);
    let toward_eye = normalize(eye);
    var normal = in.normal;
    if !IS_SMOOTH {
        normal = cross(dpdx(in.relative), dpdy(in.relative));
    }
    // A sliver, or a faulty file, has none: then only the sky's light is left.
    normal *= inverseSqrt(max(dot(normal, normal), 1e-30));
    // Turn the normal towards the eye.
    var facing = dot(normal, toward_eye);
    normal = select(normal, -normal, facing < 0.0);
    facing = abs(facing);

    var base = in.color * texel;
    if in.color.a == 0.0 { base = vec4(bare_color(normal), 1.0) * texel; }
    var emissive = in.emissive.rgb;
    var cell = -1;
    let place = in.relative + globals.field_shift.xyz;
    if HAS_LIGHT || EXPLAINS {
        if globals.light.z != 0 {
            cell = cell_before(place, normal, toward_eye);
        }
    }
    var reason = 0u;
    if EXPLAINS {
        reason = in.explained.y;
        if globals.style.y != 0u { reason = reason_of(cell, place); }
        if globals.style.x != 0u || reason != 0u {
            var color = in.explained.x;
            if cell >= 0 { color = color_of_cell(cell); }
            base = vec4(unpacked(color), base.a);
            emissive = vec3(0.0);
            // Reason: out of view, behind walls, behind an occluder; or not a surface of a room.
            if reason == 1u { base = vec4(0.25, 0.27, 0.31, base.a); }
            if reason == 2u { base = vec4(0.47, 0.23, 0.18, base.a); }
            if reason == 3u { base = vec4(0.55, 0.38, 0.12, base.a); }
            // The ground around is paper.
            if cell >= 0 && reason != 0u && is_outdoors(cell) { base = vec4(0.66, 0.68, 0.72, base.a); }
            if reason == 4u { base = vec4(0.015, 0.015, 0.018, base.a); }
        }
    }
    // Flat light, brightest on surfaces that face the eye; or the light of the place.
    var ambient = open_light(normal) + vec3(0.16 * facing);
    if HAS_LIGHT {
        ambient = light_in(cell, place, normal) * (globals.origin_low.w * (0.94 + 0.08 * facing));
    }
    var sun = max(dot(normal, globals.sun.xyz), 0.0);
    if CASTS_SHADOWS {
        sun *= sunlit(in.relative + globals.origin.xyz, normal);
    }
    var exposure = globals.field_shift.w;
    if HAS_LIGHT && is_outdoors(cell) { exposure = outdoor_exposure(); }
    // At night, less of both.
    var light = (ambient + vec3(1.25, 1.13, 0.92) * sun) * (exposure * globals.root_z.w);
    if HAS_LAMPS {
        var lit_cell = -2;
        if HAS_LIGHT { lit_cell = cell; }
        light += lamplight(in.relative, normal, toward_eye, lit_cell);
    }
    // Invisible surfaces get a plain color: shading would make them look real.
    if reason != 0u { light = vec3(1.0 + 0.25 * normal.y); }
    return Shaded(vec4(base.rgb * light + emissive, base.a), normal, toward_eye, cell);
}

fn is_above_cut(in: Surface) -> bool {
    return dot(globals.root_y.xyz, in.relative) + globals.root_y.w > globals.origin.w;
}

// Drops what lies before the special portal by which the view comes.
fn pass_gate(in: Surface) {
    if HAS_GATE {
        if dot(globals.gate.xyz, in.relative) < globals.gate.w {
            discard;
        }
    }
}

fn cut(in: Surface, texel: vec4<f32>) {
    if is_above_cut(in) || in.color.a * texel.a < in.emissive.w {
        discard;
    }
}

// Three kinds, from cheap to expensive: a surface that may discard pixels is shaded before its depth is known, and a
// texture costs software as much as everything else.

@fragment
fn plain(in: Surface) -> Drawn {
    let c = shaded(in, vec4(1.0)).color;
    pass_gate(in);
    return drawn(in.clip, vec4(toned(c.rgb), 1.0));
}

@fragment
fn textured(in: Surface) -> Drawn {
    let texel = textureSample(base_texture, base_sampler, in.uv);
    let c = shaded(in, texel).color;
    pass_gate(in);
    return drawn(in.clip, vec4(toned(c.rgb), 1.0));
}

@fragment
fn masked(in: Surface) -> Drawn {
    let texel = textureSample(base_texture, base_sampler, in.uv);
    let c = shaded(in, texel).color;
    pass_gate(in);
    cut(in, texel);
    return drawn(in.clip, vec4(toned(c.rgb), 1.0));
}

@fragment
fn glass(in: Surface) -> Drawn {
    let texel = textureSample(base_texture, base_sampler, in.uv);
    let s = shaded(in, texel);
    pass_gate(in);
    cut(in, texel);
    // Schlick, "An Inexpensive BRDF Model for Physically-based Rendering" (1994), for glass with two faces.
    let grazing = 1.0 - abs(dot(s.normal, s.toward_eye));
    let mirror = 0.08 + 0.92 * pow(grazing, 5.0);
    // Outdoors, panes reflect the sky or the ground; indoors, the room.
    let along = reflect(-s.toward_eye, s.normal);
    var around = sky_along(along);
    if HAS_LIGHT {
        let place = in.relative + globals.field_shift.xyz;
        if s.cell >= 0 && !is_outdoors(s.cell) {
            let inside = light_in(s.cell, place, along) * (globals.origin_low.w * globals.root_z.w);
            around = 0.7 * toned(inside * globals.field_shift.w);
        }
    }
    // A pane's own color is faint: mostly, it shows the things behind it.
    let alpha = s.color.a * 0.6;
    let body = toned(s.color.rgb) * alpha * (1.0 - mirror);
    return drawn(in.clip, vec4(body + around * mirror, alpha + (1.0 - alpha) * mirror));
}

@fragment
fn sheer(in: Surface) -> Drawn {
    let texel = textureSample(base_texture, base_sampler, in.uv);
    let c = shaded(in, texel).color;
    pass_gate(in);
    cut(in, texel);
    return drawn(in.clip, vec4(toned(c.rgb), c.a));
}

// A step of brightness for each draw of a pixel.
@fragment
fn count(in: Surface) -> Drawn {
    pass_gate(in);
    if is_above_cut(in) {
        discard;
    }
    return drawn(in.clip, vec4(8.0 / 255.0));
}

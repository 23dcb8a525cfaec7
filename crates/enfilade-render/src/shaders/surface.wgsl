// Surfaces as they look: textures, sun, sky.

@group(0) @binding(4) var shadow_map: texture_depth_2d;
@group(0) @binding(5) var shadow_sampler: sampler_comparison;
@group(1) @binding(0) var base_texture: texture_2d<f32>;
@group(1) @binding(1) var base_sampler: sampler;

struct Corner {
    @location(0) position: vec3<f32>,
    // w: 0 where there is none.
    @location(1) normal: vec4<f32>,
    @location(2) uv: vec2<f32>,
    @location(3) color: vec4<f32>,
    @location(4) part: u32,
    @location(5) instance: u32,
}

struct Surface {
    @builtin(position) clip: vec4<f32>,
    @location(0) world: vec3<f32>,
    @location(1) normal: vec4<f32>,
    @location(2) uv: vec2<f32>,
    @location(3) color: vec4<f32>,
    @location(4) @interpolate(flat) part: u32,
    @location(5) @interpolate(flat) instance: u32,
}

@vertex
fn corner(in: Corner) -> Surface {
    var out: Surface;
    out.world = place(in.instance, in.position);
    out.clip = to_clip(out.world);
    out.normal = in.normal;
    let i = in.instance & INSTANCE_MASK;
    if i != 0u {
        let rows = instances[i].rows;
        let n = in.normal.xyz;
        // By the cofactors: the inverse transposed, but for a factor.
        let m = vec3(
            dot(cross(rows[1].xyz, rows[2].xyz), n),
            dot(cross(rows[2].xyz, rows[0].xyz), n),
            dot(cross(rows[0].xyz, rows[1].xyz), n),
        );
        out.normal = vec4(m, in.normal.w);
    }
    out.uv = in.uv;
    out.color = in.color;
    out.part = in.part;
    out.instance = in.instance;
    return out;
}

fn unpacked(c: u32) -> vec3<f32> {
    let v = unpack4x8unorm(c);
    return pow(v.rgb, vec3(2.2));
}

// 1 in the sun, 0 in the shade.
fn sunlit(world: vec3<f32>, normal: vec3<f32>) -> f32 {
    if globals.style.z == 0u {
        return 1.0;
    }
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

fn shaded(in: Surface, texel: vec4<f32>) -> vec4<f32> {
    let eye = select(globals.eye.xyz - in.world, globals.eye.xyz - globals.origin.xyz, globals.eye.w > 0.5);
    let toward_eye = normalize(eye);
    let relative = in.world - globals.origin.xyz;
    let flat_normal = cross(dpdx(relative), dpdy(relative));
    var normal = select(flat_normal, in.normal.xyz, in.normal.w != 0.0);
    let length = length(normal);
    normal = select(vec3(0.0, 1.0, 0.0), normal / length, length > 1e-20);
    // What is seen of a surface is the side towards the eye.
    normal = select(normal, -normal, dot(normal, toward_eye) < 0.0);

    let material = materials[parts[in.part].material];
    var base = material.base_color * in.color * texel;
    var emissive = material.emissive.rgb;
    let i = in.instance & INSTANCE_MASK;
    let reason = in.instance >> 28u;
    if globals.style.x == PAINT_CELLS || reason != 0u {
        var cell = parts[in.part].color;
        if i != 0u {
            cell = instances[i].color.x;
        }
        base = vec4(unpacked(cell), base.a);
        emissive = vec3(0.0);
        // Why it is not drawn: out of view, behind no open portals, behind an occluder.
        if reason == 1u { base = vec4(0.10, 0.10, 0.11, base.a); }
        if reason == 2u { base = vec4(0.42, 0.10, 0.07, base.a); }
        if reason == 3u { base = vec4(0.62, 0.36, 0.05, base.a); }
    }
    // The sky above, the ground's reflection below; walls by where they face, so that corners show.
    let up = normal.y * 0.5 + 0.5;
    let ambient = mix(vec3(0.30, 0.28, 0.26), vec3(0.50, 0.54, 0.60), up)
        * (0.90 + 0.10 * normal.x - 0.06 * normal.z);
    let fill = 0.16 * max(dot(normal, toward_eye), 0.0);
    let sun = max(dot(normal, globals.sun.xyz), 0.0);
    var light = ambient + vec3(fill);
    if sun > 0.0 {
        light += vec3(1.25, 1.13, 0.92) * sun * sunlit(in.world, normal);
    }
    return vec4(base.rgb * light + emissive, base.a);
}

// Bright is compressed rather than cut off.
fn toned(c: vec3<f32>) -> vec3<f32> {
    return c / (1.0 + 0.28 * c);
}

fn cut(in: Surface, texel: vec4<f32>) {
    let material = materials[parts[in.part].material];
    let alpha = material.base_color.a * in.color.a * texel.a;
    if in.world.y > globals.origin.w || alpha < material.emissive.w {
        discard;
    }
}

// Three ways, from cheap to dear: what may discard a pixel is shaded before its depth is known, and a
// texture costs software as much as all else.

@fragment
fn plain(in: Surface) -> @location(0) vec4<f32> {
    return vec4(toned(shaded(in, vec4(1.0)).rgb), 1.0);
}

@fragment
fn textured(in: Surface) -> @location(0) vec4<f32> {
    let texel = textureSample(base_texture, base_sampler, in.uv);
    return vec4(toned(shaded(in, texel).rgb), 1.0);
}

@fragment
fn masked(in: Surface) -> @location(0) vec4<f32> {
    let texel = textureSample(base_texture, base_sampler, in.uv);
    cut(in, texel);
    return vec4(toned(shaded(in, texel).rgb), 1.0);
}

@fragment
fn glass(in: Surface) -> @location(0) vec4<f32> {
    let texel = textureSample(base_texture, base_sampler, in.uv);
    cut(in, texel);
    let c = shaded(in, texel);
    return vec4(toned(c.rgb), c.a);
}

// A step of brightness for each time that a pixel is drawn.
@fragment
fn count(in: Surface) -> @location(0) vec4<f32> {
    if in.world.y > globals.origin.w {
        discard;
    }
    return vec4(8.0 / 255.0);
}

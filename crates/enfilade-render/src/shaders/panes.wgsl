// Polygons of special portals.

@group(1) @binding(0) var picture: texture_2d<f32>;
@group(1) @binding(1) var picture_sampler: sampler;

struct Pane {
    // The same polygon is drawn more than once, and meets its own depths.
    @builtin(position) @invariant clip: vec4<f32>,
    @location(0) uv: vec2<f32>,
    @location(1) color: vec4<f32>,
}

// `position` is relative to the eye; w: 1 before the near plane.
@vertex
fn pane(@location(0) position: vec4<f32>, @location(1) uv: vec2<f32>, @location(2) color: vec4<f32>) -> Pane {
    var clip = to_clip(position.xyz);
    if position.w > 0.5 {
        clip.z = clip.w;
    }
    return Pane(clip, uv, color);
}

@fragment
fn filled(in: Pane) -> Drawn {
    return drawn(in.clip, in.color);
}

// A picture that fills a rectangle.
@fragment
fn shown(in: Pane) -> Drawn {
    let texel = textureSample(picture, picture_sampler, in.uv);
    return drawn(in.clip, vec4(texel.rgb * in.color.rgb, in.color.a));
}

// A picture of the same camera, from its pixel `uv` on.
@fragment
fn seen_through(in: Pane) -> Drawn {
    let texel = textureLoad(picture, vec2<i32>(in.clip.xy) - vec2<i32>(round(in.uv)), 0);
    return drawn(in.clip, vec4(texel.rgb * in.color.rgb, in.color.a));
}

@fragment
fn copied(@builtin(position) clip: vec4<f32>) -> @location(0) vec4<f32> {
    return textureLoad(picture, vec2<i32>(clip.xy), 0);
}

@fragment
fn far_away() -> Drawn {
    return drawn_at(vec4(0.0), 0.0);
}

// Copies the depth of a portal texture to a texture that shaders can read.

@group(1) @binding(0) var color: texture_2d<f32>;
@group(1) @binding(1) var depth: texture_2d<f32>;

@fragment
fn stored(@builtin(position) clip: vec4<f32>) -> @location(0) vec4<f32> {
    return vec4(textureLoad(depth, vec2<i32>(clip.xy), 0).x, 0.0, 0.0, 1.0);
}

// The depth at which the opacity has reached a value (a first hit), in world units along the view direction, from the eye or, orthographic,
// from the plane through the camera's centre.
//
// #import shared/cut
// #import shared/frame

@group(0) @binding(1) var<uniform> cut: Cut;
@group(0) @binding(2) var surfaces: texture_depth_2d;
@group(0) @binding(3) var<storage, read> hits: array<u32>;

// A triangle that covers the screen.
@vertex
fn vertex(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    return vec4f(select(-1.0, 3.0, corner == 1u), select(-1.0, 3.0, corner == 2u), 0.0, 1.0);
}

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
    start(u32(position.z));
    let pixel = vec2u(position.xy);
    let hit = hits[pixel.y * frame.size.x + pixel.x];
    let depth = depth_along_ray(position.xy, bitcast<f32>(hit)) * cut.unit;
    return vec4f(select(depth, cut.none, hit == 0u), 0.0, 0.0, 1.0);
}

// Lays the compositing buffer over the background (SPEC §5): premultiplied in, premultiplied out.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> band: Band;
@group(0) @binding(2) var<storage, read> acc: array<vec4f>;

// One triangle that covers the screen; a scissor limits it to the band.
@vertex
fn vertex(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    return vec4f(select(-1.0, 3.0, corner == 1u), select(-1.0, 3.0, corner == 2u), 0.0, 1.0);
}

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = vec2u(position.xy);
    var image = acc[(pixel.y - band.first_row) * frame.size.x + pixel.x];
    if frame.compositing == XRAY {
        image = min(image, vec4f(1.0));
    }
    return image + (1.0 - image.a) * frame.background;
}

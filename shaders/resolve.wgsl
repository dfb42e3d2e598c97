// Composites the compositing buffer over the background (SPEC §5), with premultiplied input and output.
//
// #import shared/band
// #import shared/finished
// #import shared/frame

@group(0) @binding(1) var<uniform> band: Band;
@group(0) @binding(2) var<storage, read> acc: array<vec4f>;

// Whether the target holds linear light.
override LINEAR_LIGHT: bool;

struct Corner {
    @builtin(position) position: vec4f,
    // The target's pixel for the image's upper left pixel.
    @location(0) @interpolate(flat) origin: vec2i,
}

// A triangle that covers the viewport, which is the image; a scissor limits it to the band. The instance index encodes the origin, see
// `pass::resolve`.
@vertex
fn vertex(@builtin(vertex_index) corner: u32, @builtin(instance_index) instance: u32) -> Corner {
    let position = vec4f(select(-1.0, 3.0, corner == 1u), select(-1.0, 3.0, corner == 2u), 0.0, 1.0);
    return Corner(position, vec2i(vec2u(instance & 0xffffu, instance >> 16u)) - 32767);
}

@fragment
fn fragment(corner: Corner) -> @location(0) vec4f {
    start(u32(corner.position.z));
    let pixel = vec2u(vec2i(corner.position.xy) - corner.origin);
    var image = finished(acc[(pixel.y - band.first_row) * frame.size.x + pixel.x], frame.compositing);
    image += (1.0 - image.a) * frame.background;
    if LINEAR_LIGHT && image.a > 0.0 {
        image = vec4f(decode(image.rgb / image.a) * image.a, image.a);
    }
    return image;
}

// sRGB's curve.
fn decode(color: vec3f) -> vec3f {
    return select(pow((color + 0.055) / 1.055, vec3f(2.4)), color / 12.92, color <= vec3f(0.04045));
}

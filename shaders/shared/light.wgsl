// The light that light sheets leave at a point (SPEC §14): A of ambient light and S of other light. Both follow from T, which the CPU makes (`src/light/`).
// `light_sheets` holds the planes of occlusion's stack, then those of shadow's.
// The stage declares `light_sheets`.
//
// #import shared/frame

// Whether there are light sheets.
override LIGHT: bool = false;

// A and S at a point in voxel coordinates.
fn light_left(voxel: vec3f) -> vec2f {
    if !LIGHT {
        return vec2f(1.0);
    }
    return vec2f(left_by(0u, voxel), left_by(1u, voxel));
}

// The share of its light that a stack of sheets, given by its number, leaves at a point.
fn left_by(stack: u32, voxel: vec3f) -> f32 {
    let of_stack = frame.light_stacks[stack];
    if of_stack.x == 0.0 {
        return 1.0;
    }
    let point = vec4f(voxel, 1.0);
    let x = dot(frame.light_place[3u * stack], point);
    let y = dot(frame.light_place[3u * stack + 1u], point);
    // The first and the last plane hold beyond them.
    let plane = clamp(dot(frame.light_place[3u * stack + 2u], point), 0.0, of_stack.z);
    let near = floor(plane);
    let far = min(near + 1.0, of_stack.z);
    let remaining = mix(light_in(near + of_stack.y, x, y), light_in(far + of_stack.y, x, y), plane - near);
    return 1.0 - of_stack.x * (1.0 - remaining);
}

// T in a plane, bilinear between pixel centres. Sampled by hand, because not every device filters 32 bits.
fn light_in(plane: f32, x: f32, y: f32) -> f32 {
    let side = f32(textureDimensions(light_sheets).x);
    // Far beyond the image there is as much light as beside it.
    let at = clamp(vec2f(x, y), vec2f(-2.0), vec2f(side + 1.0));
    let first = floor(at);
    let upper = mix(light_at(first, plane), light_at(first + vec2f(1.0, 0.0), plane), at.x - first.x);
    let lower = mix(light_at(first + vec2f(0.0, 1.0), plane), light_at(first + vec2f(1.0, 1.0), plane), at.x - first.x);
    return mix(upper, lower, at.y - first.y);
}

// T at a pixel of a plane; 1 beyond the image.
fn light_at(pixel: vec2f, plane: f32) -> f32 {
    let side = f32(textureDimensions(light_sheets).x);
    let texel = vec3i(vec3f(clamp(pixel, vec2f(0.0), vec2f(side - 1.0)), plane));
    let is_inside = all(pixel >= vec2f(0.0)) && all(pixel < vec2f(side));
    return select(1.0, textureLoad(light_sheets, texel, 0).x, is_inside);
}

// Classification and shading (SPEC §3).
//
// #import shared/frame
// #import shared/light
// #import shared/project
// #import shared/volume

// The value on the line between two control points.
fn between(a: vec4f, b: vec4f, value: f32) -> vec3f {
    // Eighths, because points may be more than the largest f32 apart, and GPUs divide by at most 2¹²⁶.
    let start = eighth(a.x);
    let t = select(0.0, (eighth(value) - start) / (eighth(b.x) - start), a.x < b.x);
    return mix(a.yzw, b.yzw, t);
}

// The amount per unit length, m of SPEC §5.
fn amount(alpha: f32) -> f32 {
    if frame.compositing != EXPONENTIAL {
        return alpha;
    }
    // 1 - α cancels in f32 for small α, where the series of -ln(1-α) is exact.
    if alpha < 0.0625 {
        return alpha * (1.0 + alpha * (0.5 + alpha * (1.0 / 3.0 + alpha * (0.25 + alpha * 0.2))));
    }
    return -log(1.0 - min(alpha, 0.9999));
}

// Unit vectors to the light, and between it and the eye; 0 where those cancel.
struct Lighting {
    light: vec3f,
    half_vector: vec3f,
    // Whether this is at a cut face that is not shaded.
    is_face: bool,
}

// The distances of a voxel from four planes of cuts, in extents of its cell.
fn from_planes(first: u32, voxel: vec3f) -> vec4f {
    let faces = mat4x4f(frame.faces[first], frame.faces[first + 1u], frame.faces[first + 2u], frame.faces[first + 3u]);
    return faces * vec4f(voxel, 1.0);
}

// The slack of distances of planes that meet a cell's very end.
const HAIR_OF_FACE = 3e-5;

// Whether a voxel's cell meets a cut, or a face of the crop box, that is not shaded (SPEC §3).
fn is_at_face(voxel: vec3f) -> bool {
    let near = vec4f(0.5 + HAIR_OF_FACE);
    let planes = from_planes(0u, voxel);
    let mixed = from_planes(4u, voxel);
    let crop = from_planes(8u, voxel);
    let meets_crop = any(abs(mixed.zw) <= near.zw) || any(abs(crop) <= near);
    let touches_box = all(mixed.zw >= -near.zw) && all(crop >= -near);
    return any(abs(planes) <= near) || any(abs(mixed.xy) <= near.xy) || (meets_crop && touches_box);
}

// A voxel's lighting.
fn voxel_lighting(voxel: vec3u, px: vec2f, in_perspective: bool) -> Lighting {
    var light = lighting(px, in_perspective);
    light.is_face = is_at_face(vec3f(voxel));
    return light;
}

// In perspective the direction to the eye, and to a light at it, differs between voxels.
fn lighting(px: vec2f, in_perspective: bool) -> Lighting {
    if !in_perspective {
        return Lighting(frame.light.xyz, frame.half_vector.xyz, false);
    }
    let to_eye = -normalize(warped_ray(px) * frame.aspect.xyz);
    let light = select(frame.light.xyz, to_eye, frame.headlight != 0u);
    let sum = light + to_eye;
    // Opposite unit vectors add up to rounding noise, not to 0.
    let size = length(sum);
    return Lighting(light, select(sum / max(size, 1e-6), vec3f(0.0), size < 1e-6), false);
}

// The colour of a point, given in voxel coordinates.
fn shade(color: vec3f, gradient: Gradient, lighting: Lighting, voxel: vec3f) -> vec3f {
    if frame.light.w == 0.0 || lighting.is_face {
        return color;
    }
    let left = light_left(voxel);
    let ambient = frame.shading.x * left.x;
    if gradient.magnitude == 0.0 {
        return clamp(color * ambient, vec3f(0.0), vec3f(1.0));
    }
    let n = gradient.normal;
    let diffuse = frame.shading.y * left.y * abs(dot(n, lighting.light));
    let cosine = min(abs(dot(n, lighting.half_vector)), 1.0);
    // Of 0 a driver's power may be NaN.
    let highlight = frame.shading.z * left.y * select(0.0, pow(cosine, frame.shading.w), cosine > 0.0);
    return clamp(color * (ambient + diffuse) + highlight, vec3f(0.0), vec3f(1.0));
}

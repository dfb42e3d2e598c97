// Adds the image of a channel that shares no sheets with others to that of the channels before it (SPEC §10): at every pixel their sum, or of surfaces
// the nearest one, or the sum of equally near ones. One thread per pixel of a band.
//
// #import shared/band
// #import shared/brick
// #import shared/cut
// #import shared/finished
// #import shared/frame

@group(0) @binding(1) var<uniform> band: Band;
// The channel's compositing buffer, and its first hits.
@group(0) @binding(2) var<storage, read> acc: array<vec4f>;
@group(0) @binding(3) var<storage, read> hits: array<u32>;
// Those of all channels.
@group(0) @binding(4) var<storage, read_write> joined: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> joined_hits: array<u32>;
@group(0) @binding(6) var<uniform> cut: Cut;
@group(0) @binding(7) var surfaces: texture_depth_2d;

// Whether the nearest surface counts, and whether first hits are asked for, which it needs.
override NEAREST: bool = false;
override FIRST_HIT: bool = false;

const JOIN_WORKGROUP = 256u;

// The depth of a first hit; `FAR`, which is beyond every depth, if the ray hits nothing.
fn depth_of(hit: u32, point_px: vec2f) -> f32 {
    return select(depth_along_ray(point_px, bitcast<f32>(hit)), FAR, hit == 0u);
}

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) workgroup: vec3u) {
    start(workgroup.z);
    let slot = unfold(workgroup) * JOIN_WORKGROUP + thread;
    if slot >= band.rows * frame.size.x {
        return;
    }
    let image = finished(acc[slot], frame.compositing);
    let before = joined[slot];
    if !FIRST_HIT {
        joined[slot] = before + image;
        return;
    }
    let place = band.first_row * frame.size.x + slot;
    let point_px = vec2f(vec2u(place % frame.size.x, place / frame.size.x)) + 0.5;
    let depth = depth_of(hits[place], point_px);
    let depth_before = depth_of(joined_hits[place], point_px);
    if !NEAREST || depth == depth_before {
        joined[slot] = before + image;
    } else if depth < depth_before {
        joined[slot] = image;
    }
    if depth < depth_before {
        joined_hits[place] = hits[place];
    }
}

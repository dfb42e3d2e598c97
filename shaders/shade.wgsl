// Projects and shades the voxels that are drawn for the first time, so each only once (Fig. 12). SPEC §3 defines classification and shading. Only
// here does a voxel need its gradient; most voxels are hidden and never do (§6).
//
// #import shared/brick
// #import shared/channels
// #import shared/frame
// #import shared/gradient
// #import shared/own_color
// #import shared/project
// #import shared/ramps
// #import shared/shading
// #import shared/splat
// #import shared/texels
// #import shared/volume

@group(0) @binding(1) var<storage, read> bricks: array<Brick>;
@group(0) @binding(2) var values: texture_2d_array<u32>;
// The control points of all ramps, one ramp after the other: value, then rgb or (ordinate, 0, 0); then the tables of labels and channels.
@group(0) @binding(3) var<storage, read> control_points: array<vec4f>;
// Places: 64 times the brick's index, plus the slot.
@group(0) @binding(4) var<storage, read> fresh: array<u32>;
@group(0) @binding(5) var<storage, read> args: Indirect;
@group(0) @binding(6) var<storage, read_write> splats: array<Splat>;
@group(0) @binding(7) var labels: texture_2d_array<u32>;
@group(0) @binding(8) var colors: texture_2d_array<u32>;
// The slots of pages, where voxels are in pages.
@group(0) @binding(9) var pages: texture_2d_array<u32>;
// The gradients of the membership of labels.
@group(0) @binding(10) var membership: texture_2d_array<u32>;
// See `shared/light`.
@group(0) @binding(11) var light_sheets: texture_3d<f32>;

@compute @workgroup_size(64)
fn main(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) workgroup: vec3u) {
    start(workgroup.z);
    let at = unfold(workgroup) * SHADE_WORKGROUP + thread;
    if at >= args.count {
        return;
    }
    let id = fresh[at];
    let voxel = voxel_of(bricks[id / BRICK_VOXELS], id % BRICK_VOXELS);
    let p = project(voxel);
    let light = voxel_lighting(voxel, p.xy, frame.near > 0.0);
    // A voxel's footprint is the same in all channels, so their amounts are drawn as one (SPEC §10).
    var channels = ChannelSum();
    for (var channel = 0u; channel < CHANNELS; channel += 1u) {
        channels = with_channel(channels, amount_in_channel(voxel, channel, light));
    }
    let sum = total(channels);
    splats[id] = Splat(p.x, p.y, p.z, p.w, pack2x16float(sum.rg), pack2x16float(sum.ba));
}

// A voxel's colour and amount per unit length in a channel, `(C·m, m)`; 0 in a hole.
fn amount_in_channel(voxel: vec3u, channel: u32, light: Lighting) -> vec4f {
    read_channel(channel);
    let index = index_of(voxel);
    let ramps = ramps_of(channel, index);
    let stored = stored_at(index);
    let value = value_of(stored);
    let gradient = gradient_at(voxel);
    let own = own_color(channel, index, ramp(ramps.x, ramps.y, value));
    let opacity = ramp(ramps.y, ramps.z, value).x;
    let gradient_opacity = ramp(ramps.z, ramps.w, gradient.magnitude).x;
    let m = amount(opacity * gradient_opacity * own.a);
    return select(vec4f(shade(own.rgb, gradient, light, vec3f(voxel)) * m, m), vec4f(0.0), HOLES && is_hole(stored));
}

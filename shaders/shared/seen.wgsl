// The look of a channel's values and gradients on a pixel's ray (SPEC §§9, 10).
// The stage declares `control_points`.
//
// #import shared/cells
// #import shared/frame
// #import shared/light
// #import shared/ramps
// #import shared/shading
// #import shared/slab_integral
// #import shared/texels
// #import shared/volume

// Whether voxels of any channel have colours of their own.
override OWN_COLORS: bool = false;

// A channel that is looked at.
struct SeenChannel {
    // Its number among those that share sheets.
    number: u32,
    // The factor from numbers to values.
    per_number: f32,
    // See `FieldPlanes`.
    min_moment: f32,
    // Its number among the channels with colours of voxels' own, from 1; 0 if it has none.
    colors: u32,
}

var<private> seen_channel: SeenChannel;

// Its transfer function, where voxels have none of their own.
var<private> seen_table: Table;

// Makes a channel the one that is read and looked at.
fn see_channel(channel: u32) {
    read_channel(channel);
    let scale = control_points[frame.channel_table + CHANNEL_ENTRIES * channel + 2u];
    seen_channel = SeenChannel(channel, scale.x, scale.y, u32(scale.z));
}

// Finds the transfer function of the channel that is looked at: read from memory once, instead of for every slab.
fn see_table() {
    if !LABELS {
        seen_table = table_of(ramps_of(seen_channel.number, 0u));
    }
}

// Whether voxels have colours of their own.
fn has_own_colors() -> bool {
    return OWN_COLORS && seen_channel.colors != 0u;
}

// The colour and the factor of its opacity: a given colour and 1, or the voxels' own.
fn colored(given: vec3f, own: vec4f) -> vec4f {
    return select(vec4f(given, 1.0), own, has_own_colors());
}

// The transfer function of the voxel whose cell holds the point of a pixel's ray at a sheet depth, moved by `hair` voxels along each axis.
fn table_at(at: vec3f, sheet_depth: f32, hair: f32) -> Table {
    if !LABELS {
        return seen_table;
    }
    return table_of(ramps_of(seen_channel.number, index_of(nearest_voxel(voxel_at(at, sheet_depth) + hair))));
}

// The amount per unit length (without a logarithm: the opacity) and the colour.
struct Look {
    amount: f32,
    color: vec3f,
}

// The gradient between those of two samples.
fn gradient_between(near: vec4f, far: vec4f, share: f32) -> Gradient {
    return gradient_of(0.5 * seen_channel.per_number * mix(near.yzw, far.yzw, share));
}

// A stretch of a pixel's ray: the position on the image that identifies it, and the sheet depths of its ends.
struct Way {
    at: vec3f,
    near: f32,
    far: f32,
}

// A point of a stretch in voxel coordinates. Only light sheets need it.
fn point_on(way: Way, share: f32) -> vec3f {
    if !LIGHT {
        return vec3f(0.0);
    }
    return voxel_at(way.at, mix(way.near, way.far, share));
}

// The opacity of a gradient.
fn gradient_opacity(table: Table, gradient: Gradient) -> f32 {
    // Without gradient opacity the ramp is a single point. (A loop is left out where no thread needs it.)
    var opacity = table.first_graded;
    for (var is_graded = table.ramps.w > table.ramps.z + 1u; is_graded; is_graded = false) {
        opacity = ramp(table.ramps.z, table.ramps.w, gradient.magnitude).x;
    }
    return opacity;
}

// The shaded means over the values between two samples, each a number and its gradient, from the nearer to the farther one, at the ends of a
// stretch of the ray. `own` is the colour of the voxels' own there.
fn look(near: vec4f, far: vec4f, way: Way, own: vec4f, table: Table, light: Lighting) -> Look {
    let means = slab_integral(table, near.x, far.x);
    if means.amount <= 0.0 {
        return Look(0.0, vec3f(0.0));
    }
    return look_at(means, near, far, way, own, table, light);
}

// The same, given the means.
fn look_at(means: SlabIntegral, near: vec4f, far: vec4f, way: Way, own: vec4f, table: Table, light: Lighting) -> Look {
    let gradient = gradient_between(near, far, means.share);
    let color = colored(means.color, own);
    let voxel = point_on(way, means.share);
    return Look(means.amount * color.a * gradient_opacity(table, gradient), shade(color.rgb, gradient, light, voxel));
}

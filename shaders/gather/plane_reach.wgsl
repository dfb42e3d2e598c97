// Where kernels reach the planes of a group, and the layers of its planes (SPEC §9).
//
// #import gather/group
// #import gather/region
// #import gather/state
// #import shared/channels
// #import shared/frame
// #import shared/planes
// #import shared/project
// #import shared/seen

// The planes of the layer that is drawn.
var<private> planes: FieldPlanes;

// The first of a group's planes is one slab behind its near plane.
const FIRST_PLANE = 1.0;

fn layers() -> u32 {
    return CHANNELS;
}

fn current_layer() -> u32 {
    return seen_channel.number;
}

// Whether the layer is the group's last one, with which its slabs are composited.
fn is_last_layer() -> bool {
    return seen_channel.number + 1u == CHANNELS;
}

// Rays end where they leave the box of voxel centres.
fn cuts_rays() -> bool {
    return true;
}

// A voxel's place: pixels right of the image's middle and below it, both times the depth from the eye, and sheet depth.
fn placed(voxel: vec3u) -> vec4f {
    return homogeneous(vec4f(vec3f(voxel), 1.0));
}

// The screen box that a kernel reaches on the group's far planes. From the first plane to the last its nearest point moves in one direction.
fn screen_box(p: vec4f) -> ScreenBox {
    let middle = 0.5 * vec2f(frame.size) - first_px;
    if !PERSPECTIVE {
        return ScreenBox(p.xy + middle, sheet_group.half_box);
    }
    let first = on_plane(p.xy, p.z, sheet_group.near + frame.slab_width).center_px - first_px;
    let last = on_plane(p.xy, p.z, sheet_group.near + f32(SHEETS) * frame.slab_width).center_px - first_px;
    return ScreenBox(0.5 * (first + last), 0.5 * abs(last - first) + sheet_group.half_box);
}

// Whether a kernel may be seen on some plane of the group.
fn is_searched_in_perspective(search: SearchBounds, p: vec4f) -> bool {
    let middle = 0.5 * vec2f(frame.size);
    let first = on_plane(p.xy, p.z, sheet_group.near + frame.slab_width).center_px - middle;
    let last = on_plane(p.xy, p.z, sheet_group.near + f32(SHEETS) * frame.slab_width).center_px - middle;
    return all(max(first, last) >= search.low.xy) && all(min(first, last) <= search.high.xy)
        && p.z >= search.low.z && p.z <= search.high.z;
}

// The least reach of a kernel in sheet depth: where its Gaussian vanishes in f32, which may be closer than its radius.
fn least_kernel_reach() -> f32 {
    return frame.support / planes.step.w;
}

// The range of the frame's sheets whose far planes a kernel reaches, from the first to the one after the last.
fn overlapped_sheets(p: vec4f) -> vec2f {
    let reach = least_kernel_reach() - gather.depth_error;
    let sheets = (p.z + vec2f(-reach, reach) - gather.near) / frame.slab_width;
    return vec2f(floor(sheets.x), ceil(sheets.y) - 1.0);
}

// The planes of a group that a voxel is gathered on.
fn sections_here(p: vec4f, sheets: vec2f) -> u32 {
    let here = sheets_here(sheets);
    return u32(here.y - here.x);
}

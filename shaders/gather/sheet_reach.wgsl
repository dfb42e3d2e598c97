// Where kernels reach the sheets of a group, if voxels are classified before splatting (§3).
//
// #import gather/group
// #import gather/kernel
// #import gather/region
// #import gather/state
// #import shared/frame
// #import shared/local_ray
// #import shared/project

// A kernel's sections begin at a group's near plane.
const FIRST_PLANE = 0.0;

// Channels share sheets, in which a voxel's footprint is the same.
fn layers() -> u32 {
    return 1u;
}

fn current_layer() -> u32 {
    return 0u;
}

// Whether rays have ends that hide what lies behind.
fn cuts_rays() -> bool {
    return CUT;
}

// The least reach of a kernel in sheet depth.
fn least_kernel_reach() -> f32 {
    return select(frame.reach, 0.0, frame.kernel_per_depth == 0.0);
}

// The range of the frame's sheets that a kernel overlaps, from the first to the one after the last.
fn overlapped_sheets(p: vec4f) -> vec2f {
    let sheets = (overlapped(p, gather.depth_error, PERSPECTIVE) - gather.near) / frame.slab_width;
    return vec2f(floor(sheets.x), ceil(sheets.y));
}

// The number of a kernel's sections in the group that are drawn.
fn sections_here(p: vec4f, sheets: vec2f) -> u32 {
    let here = sheets_here(sheets);
    if PERSPECTIVE {
        let footprint = footprint_at(p, sheet_group.near, -1.0, vec4f(0.0));
        return sections_on_screen(p.xy, footprint.axis, footprint.maps, here - sheet_group.first_sheet);
    }
    return u32(here.y - here.x);
}

// A voxel's projection.
fn placed(voxel: vec3u) -> vec4f {
    return project(voxel);
}

// The box around the footprint at a projection.
fn screen_box(p: vec4f) -> ScreenBox {
    return ScreenBox(p.xy - first_px, sheet_group.half_box);
}

// Whether a voxel's footprint may be seen on the screen, and its kernel reaches the group.
fn is_searched_in_perspective(search: SearchBounds, p: vec4f) -> bool {
    let is_on_screen = all(p.xy >= search.low.xy * p.w) && all(p.xy <= search.high.xy * p.w);
    return is_on_screen && p.z >= search.low.z && p.z <= search.high.z && p.w > frame.near;
}

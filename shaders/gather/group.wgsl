// The group of sheets that is being drawn, and the bounds of a search for its voxels.
//
// #import gather/state
// #import shared/frame

// The number of sheets in a sheet group.
const SHEETS = 4u;

// A group of sheets: its number, its first sheet, the depth where that begins, and half the box around its footprints.
struct GatheredGroup {
    number: u32,
    first_sheet: f32,
    near: f32,
    half_box: vec2f,
}

var<private> sheet_group: GatheredGroup;

// The part of a range of the frame's sheets in the sheet group.
fn sheets_here(sheets: vec2f) -> vec2f {
    return clamp(sheets, vec2f(sheet_group.first_sheet), vec2f(sheet_group.first_sheet + f32(SHEETS)));
}

// The first group, in drawing order, that a kernel overlaps.
fn first_group(sheets: vec2f) -> f32 {
    let sheet = select(min(sheets.y, f32(gather.groups * SHEETS)) - 1.0, max(sheets.x, 0.0), ORDER == FRONT_TO_BACK);
    return floor(sheet / f32(SHEETS));
}

// The bounds of a search: homogeneous pixel coordinates relative to the image's middle, and sheet depths.
struct SearchBounds {
    low: vec3f,
    high: vec3f,
}

// The tile rasterizer's uniforms and counts; `gpu::layout` documents the fields.
//
// #import shared/tally

struct Gather {
    along: array<vec4f, 4>,
    chord: array<vec4f, 2>,
    metric: vec4f,
    chord_scale: vec2f,
    along_scale: f32,
    near: f32,
    depth_error: f32,
    groups: u32,
    bricks: u32,
    drawn: u32,
    composited: u32,
    shear: f32,
    half_width: f32,
    whole_below: f32,
    beta: f32,
    peak: f32,
    reached: u32,
    most_passes: u32,
    passes_per_group: u32,
    passes_per_brick: u32,
    search_passes: u32,
    hits: u32,
}

struct PatchRange {
    first_row: u32,
    first_patch: u32,
    end_patch: u32,
    row_step: u32,
}

struct Gathered {
    tally: Tally,
    words: array<atomic<u32>>,
}

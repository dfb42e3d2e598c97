// The constants of a frame; `gpu::layout::Frame` documents the fields.
struct Frame {
    screen_from_voxel: array<vec4f, 4>,
    right: vec4f,
    down: vec4f,
    ahead: vec4f,
    aspect: vec4f,
    pixels_from_footprint: mat2x2f,
    footprint_from_pixels: mat2x2f,
    light: vec4f,
    half_vector: vec4f,
    shading: vec4f,
    background: vec4f,
    gradient: vec4f,
    light_place: array<vec4f, 6>,
    light_stacks: array<vec4f, 2>,
    faces: array<vec4f, 12>,
    dims: vec4u,
    ramps: vec4u,
    size: vec2u,
    amplitude: f32,
    radius: f32,
    support: f32,
    falloff: f32,
    slab_width: f32,
    reach: f32,
    kernel_per_depth: f32,
    section_width: f32,
    near: f32,
    pixel_per_depth: f32,
    opacity_threshold: f32,
    compositing: u32,
    order: u32,
    culling: u32,
    tiles: u32,
    per_unit: f32,
    headlight: u32,
    first_channel: u32,
    value_offset: f32,
    whole_values: u32,
    channel_table: u32,
    closing: f32,
}

@group(0) @binding(0) var<uniform> frames: array<Frame, 1>;
var<private> frame: Frame;
var<private> zero: u32;

// The first step of every entry point, called with a 0 that no driver can prove to be 0, such as its workgroup's z. Lavapipe inserts the values of
// uniforms that decide an `if` or end a loop into a stage, and compiles it again for each draw; values read at an unknown index are left
// alone. Reading them here also reads them once: in a loop each read costs it a gather. Loops that begin at `zero` are not unrolled: drivers would compile
// their bodies for every pass.
fn start(unknown_zero: u32) {
    zero = unknown_zero;
    frame = frames[unknown_zero];
}

const LINEAR = 0u;
const EXPONENTIAL = 1u;
const XRAY = 2u;
const MAXIMUM = 3u;
const MINIMUM = 4u;
const AVERAGE = 5u;
const SURFACE = 6u;

const FRONT_TO_BACK = 0u;
const BACK_TO_FRONT = 1u;

// The slack with which footprints' boxes are rounded to pixels, for the rounding errors of f32 coordinates.
const BOX_SLACK = 0.01;

// The side of a tile in pixels: one word of an opacity mask per row of a tile (§6).
const TILE = 32u;

fn tile_grid(size: vec2u) -> vec2u {
    return (size + TILE - 1u) / TILE;
}

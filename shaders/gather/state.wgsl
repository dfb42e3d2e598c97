// What the files of the tile rasterizer share: bindings, overrides, the state of a lane, and counts of passes.
//
// #import gather/uniforms
// #import shared/brick
// #import shared/cut

@group(0) @binding(1) var<uniform> gathers: array<Gather, 1>;
@group(0) @binding(2) var<uniform> patch_range: PatchRange;
@group(0) @binding(3) var<storage, read> bricks: array<Brick>;
// For every patch and sheet group the place of its first brick in this list; behind all of these the indices of bricks.
@group(0) @binding(4) var<storage, read> bins: array<u32>;
// The control points of all ramps, one ramp after the other: value, then rgb or (ordinate, 0, 0); then the table of labels.
@group(0) @binding(6) var<storage, read> control_points: array<vec4f>;
@group(0) @binding(7) var values: texture_2d_array<u32>;
@group(0) @binding(8) var<storage, read_write> acc: array<vec4f>;
@group(0) @binding(9) var<storage, read_write> gathered: Gathered;
// For every group, nearest first, half the screen box in pixels around its footprints.
@group(0) @binding(10) var<storage, read> half_boxes: array<vec2f>;
@group(0) @binding(11) var labels: texture_2d_array<u32>;
// The arguments of the next dispatch, which is empty unless a subgroup has left work for it.
@group(0) @binding(12) var<storage, read_write> next: Indirect;
@group(0) @binding(13) var<uniform> cut: Cut;
@group(0) @binding(14) var surfaces: texture_depth_2d;
// The slots of pages, where voxels are in pages.
@group(0) @binding(18) var pages: texture_2d_array<u32>;

// `frame.compositing` and `frame.order`.
override COMPOSITING: u32 = 0u;
override ORDER: u32 = 0u;
// Whether every voxel has its own ray.
override PERSPECTIVE: bool = false;
// Whether a footprint's box is the parallelogram of Fig. 13, else its bounding rectangle.
override PARALLELOGRAM: bool = false;
// Whether anything is cut, and whether first hits are requested.
override CUT: bool = false;
override FIRST_HIT: bool = false;
// Whether any economy of §8 is on; they apply only to splatted colours.
override ECONOMIES: bool = false;

// The number of threads in a workgroup: those of the largest subgroup, but at most those that hold a patch.
override THREADS: u32 = 32u;
// The number of workgroups per patch: more than one only if too much lies behind it.
override WORKGROUPS_PER_PATCH: u32 = 1u;

var<private> gather: Gather;

// The subgroup.
var<private> lane: u32;
var<private> lanes: u32;

// The patch: the centre of its first pixel, and a mask of the subgroup's pixels, over all its rounds, that are not opaque.
var<private> first_px: vec2f;
var<private> open: vec4u;
// The same of those that have not reached β.
var<private> shallow: vec4u;

// Counts of passes through loops, bricks visited, and voxels and sections drawn.
var<private> passes: u32;
var<private> bricks_visited: u32;
var<private> drawn: vec2u;

// The number of threads that hold a patch, and of its halves of blocks, which the smallest subgroups draw.
const PATCH_THREADS = 32u;
const HALVES = 8u;

// Passes through loops that are not counted where they occur. Every loop costs one extra pass for its exit check, and so do the loops nested
// in it; one-shot loops cost two.
const PASSES_PER_GROUP = 6u;
const PASSES_PER_FILL = 36u;
const PASSES_PER_FIND = 5u;
const PASSES_PER_SHADING = 7u;
const PASSES_PER_ROUND = 18u;
const PASSES_PER_BATCH = 4u;
const PASSES_PER_ADDITION = 2u;

// The passes that determine how four rays are cut, or over which stretch means count.
const PASSES_PER_LOOK = 140u;

// The progress in a patch: a mask of its pixels that stay open after the group, and a mask of halves of blocks whose sheets are not empty.
struct Progress {
    open: vec4u,
    shallow: vec4u,
    begun: u32,
}

// A ramp: the range of its control points, and this lane's share of the first of them.
struct Ramp {
    first: u32,
    end: u32,
    own: vec4f,
}

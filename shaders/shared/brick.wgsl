// Bricks with 64 slots for voxels, and the data about them that the passes of a sheet group exchange. `gpu::layout` documents the fields.
struct Brick {
    present: vec2u,
    x: u32,
    y: u32,
    z: u32,
    extent: u32,
}

// One bit per voxel of a brick.
struct BrickState {
    hidden: vec2u,
    shaded: vec2u,
}

// A brick that a sheet group visits, with the voxels that are drawn, and those that are drawn for the first time.
struct Visit {
    drawn: vec2u,
    fresh: vec2u,
    brick: u32,
    padding: u32,
}

struct SheetGroup {
    half_box: vec2f,
    box_filter: vec2u,
    culling: u32,
    near: f32,
    first_brick: u32,
    brick_count: u32,
    index: u32,
    number: u32,
}

// The size of a draw or dispatch, determined on the GPU.
struct Indirect {
    draw: array<u32, 5>,
    dispatch: array<u32, 3>,
    count: u32,
}

// Dispatches of more than this many workgroups are folded into two dimensions.
const FOLD = 32768u;

// The number of slots in a brick.
const BRICK_VOXELS = 64u;

// The number of quads drawn by one instance: vertices are processed an instance at a time, and four of them would leave a software
// rasterizer's vectors half empty.
const QUADS = 16u;

// What is that many times a kernel's reach from the eye, or behind it, has no place on the screen, but may bear on planes before it.
const CLOSE = 1.001;

// The number of voxels shaded by one workgroup.
const SHADE_WORKGROUP = 64u;

// Arguments for `count` items, of which a workgroup processes `each`.
fn indirect_workgroups(count: u32, each: u32) -> Indirect {
    let workgroups = (count + each - 1u) / each;
    return Indirect(
        array(6u * QUADS, (count + QUADS - 1u) / QUADS, 0u, 0u, 0u),
        array(min(workgroups, FOLD), (workgroups + FOLD - 1u) / FOLD, 1u),
        count,
    );
}

fn indirect(count: u32) -> Indirect {
    return indirect_workgroups(count, 1u);
}

fn unfold(workgroup: vec3u) -> u32 {
    return workgroup.x + workgroup.y * FOLD;
}

// The position in the volume of a brick's slot: slots are those of the aligned 4×4×4 voxels that contain the brick's minimum.
fn voxel_of(brick: Brick, slot: u32) -> vec3u {
    let origin = vec3u(brick.x, brick.y, brick.z) & vec3u(~3u);
    return origin + in_brick(slot);
}

// A mask of the layers that a brick is of, from bit 16 on.
fn layers_of(brick: Brick) -> u32 {
    return brick.extent & LAYER_BITS;
}

const LAYER_BITS = 0xffff0000u;

// The bit of a layer in it.
fn layer_bit(layer: u32) -> u32 {
    return 1u << (16u + layer);
}

fn in_brick(slot: u32) -> vec3u {
    return vec3u(slot & 3u, (slot >> 2u) & 3u, slot >> 4u);
}

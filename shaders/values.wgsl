// Projects every voxel that is drawn onto a slab plane for the first time, and computes its number and gradient, once per frame (SPEC §9).
//
// #import shared/brick
// #import shared/field_voxel
// #import shared/frame
// #import shared/number
// #import shared/planes
// #import shared/project
// #import shared/texels
// #import shared/volume

@group(0) @binding(1) var<storage, read> bricks: array<Brick>;
@group(0) @binding(2) var values: texture_2d_array<u32>;
// The bits of every voxel's coefficient as a number; read only if `EXACT`.
@group(0) @binding(3) var coefficients: texture_2d_array<u32>;
// Voxels: 64 times the brick's index, plus the slot in the brick.
@group(0) @binding(4) var<storage, read> fresh: array<u32>;
@group(0) @binding(5) var<storage, read> args: Indirect;
@group(0) @binding(6) var<storage, read_write> voxels: array<FieldVoxel>;
@group(0) @binding(7) var<uniform> planes: FieldPlanes;
// The slots of pages, where voxels are in pages.
@group(0) @binding(8) var pages: texture_2d_array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) workgroup: vec3u) {
    start(workgroup.z);
    let at = unfold(workgroup) * SHADE_WORKGROUP + thread;
    if at >= args.count {
        return;
    }
    let id = fresh[at];
    let voxel = voxel_of(bricks[id / BRICK_VOXELS], id % BRICK_VOXELS);
    let p = homogeneous(vec4f(vec3f(voxel), 1.0));
    read_channel(planes.channel);
    let gradient = half_differences(voxel) * (2.0 * planes.value_scale);
    let bits = packed(gradient);
    voxels[id] = FieldVoxel(p.x, p.y, p.z, number_at(index_of(voxel)), bits.x, bits.y);
}

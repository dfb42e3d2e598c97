// Puts the voxels that enter the iso-ranges at their places in the list (§5.1): a change touches them alone.

struct Entry {
    at: u32,
    voxel: Voxel,
}

@group(0) @binding(0) var<storage, read> entries: array<Entry>;
@group(0) @binding(1) var<storage, read_write> voxels: array<Voxel>;

@compute @workgroup_size(64)
fn main(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) workgroup: vec3u) {
    let at = unfold(workgroup) * 64u + thread;
    if at < arrayLength(&entries) {
        voxels[entries[at].at] = entries[at].voxel;
    }
}

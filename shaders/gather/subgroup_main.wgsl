// Draws patches, each by a subgroup.
//
// #import gather/patch
// #import gather/state

@compute @workgroup_size(THREADS)
fn main(
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(subgroup_size) subgroup_size: u32,
    @builtin(subgroup_invocation_id) subgroup_invocation_id: u32,
) {
    // A larger subgroup has the patch's threads and no others.
    lanes = min(subgroup_size, THREADS);
    lane = subgroup_invocation_id;
    draw_of_workgroup(workgroup, thread);
}

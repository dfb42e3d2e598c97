// Draws patches, each by a workgroup.
//
// #import gather/patch
// #import gather/state

@compute @workgroup_size(THREADS)
fn main(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) workgroup: vec3u) {
    lanes = THREADS;
    lane = thread;
    draw_of_workgroup(workgroup, thread);
}

// Prefix sums over a workgroup's threads, with which threads write lists in a fixed order without gaps.
const WORKGROUP_SIZE = 256u;

var<workgroup> ends: array<vec2u, 256>;

// The sum over the threads up to and including this one. All threads must call it; afterwards `ends` holds every thread's sum.
fn sum_up_to(thread: u32, own: vec2u) -> vec2u {
    ends[thread] = own;
    workgroupBarrier();
    for (var step = 1u; step < WORKGROUP_SIZE; step *= 2u) {
        var sum = ends[thread];
        if thread >= step {
            sum += ends[thread - step];
        }
        workgroupBarrier();
        ends[thread] = sum;
        workgroupBarrier();
    }
    return ends[thread];
}

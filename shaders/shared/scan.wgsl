// Sums over a workgroup's threads in their order: what lets them write side by side and keep that order.
const WORKGROUP_SIZE = 256u;

var<workgroup> ends: array<vec2u, 256>;

// What the threads up to and with this one hold. All threads must call it; afterwards `ends` has every thread's.
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

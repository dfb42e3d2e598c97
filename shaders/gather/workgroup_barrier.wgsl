// The same where a workgroup has no other lanes, for devices without barriers of subgroups.
fn meet() {
    workgroupBarrier();
}

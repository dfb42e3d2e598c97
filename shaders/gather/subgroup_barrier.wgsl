// Where the lanes that draw a patch meet: what each has written to workgroup memory, the others can read.
fn meet() {
    subgroupBarrier();
}

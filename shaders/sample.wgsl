// Draws whole kernels one by one, each composited by itself as a sheet with nothing else in it would be (§3, composite-every-sample).

@fragment
fn fragment(quad: Quad) -> One {
    start(u32(quad.position.z));
    return One(composite(vec4f(0.0), quad.amount * section(quad, 0u), frame.compositing, FRONT_TO_BACK));
}

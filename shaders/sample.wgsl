// Draws whole kernels one by one, each composited like a sheet that contains nothing else (§3, composite-every-sample).
//
// #import shared/compositing
// #import shared/frame
// #import shared/sheets
// #import shared/turned_quads

@fragment
fn fragment(quad: Quad) -> One {
    start(u32(quad.position.z));
    return One(composite(vec4f(0.0), quad.amount * section(quad, 0u), frame.compositing, FRONT_TO_BACK));
}

// Draws the kernel sections of a group of sheets as footprint quads in perspective.
//
// #import shared/frame
// #import shared/sheets
// #import shared/turned_quads

@fragment
fn fragment_1(quad: Quad) -> One {
    start(u32(quad.position.z));
    return One(quad.amount * section(quad, 0u));
}

@fragment
fn fragment_2(quad: Quad) -> Two {
    start(u32(quad.position.z));
    return Two(quad.amount * section(quad, 0u), quad.amount * section(quad, 1u));
}

@fragment
fn fragment_4(quad: Quad) -> Four {
    start(u32(quad.position.z));
    return Four(
        quad.amount * section(quad, 0u),
        quad.amount * section(quad, 1u),
        quad.amount * section(quad, 2u),
        quad.amount * section(quad, 3u),
    );
}

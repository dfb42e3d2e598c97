// Zeroes the sheet buffers in the tiles that are about to receive splats.
//
// #import shared/brick
// #import shared/frame
// #import shared/sheets
// #import shared/tile_list

@group(0) @binding(1) var<storage, read> composited: TileList;

@vertex
fn vertex(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> @builtin(position) vec4f {
    start(vertex >> 31u);
    let quad = instance * QUADS + vertex / 4u;
    let corner = vertex % 4u;
    if quad >= composited.args.count {
        return vec4f(2.0, 2.0, 0.0, 1.0);
    }
    let tile = composited.tiles[quad];
    let columns = tile_grid(frame.size).x;
    let at = vec2u(tile % columns, tile / columns) + vec2u(corner & 1u, corner >> 1u);
    let p = vec2f(min(at * TILE, frame.size)) / vec2f(frame.size);
    return vec4f(2.0 * p.x - 1.0, 1.0 - 2.0 * p.y, 0.0, 1.0);
}

@fragment
fn fragment_1() -> One {
    return One();
}

@fragment
fn fragment_2() -> Two {
    return Two();
}

@fragment
fn fragment_4() -> Four {
    return Four();
}

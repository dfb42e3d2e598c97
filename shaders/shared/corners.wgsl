// Where the corners of quads are drawn.
//
// #import shared/frame

// The maximum distance in pixels from the image's corner at which a footprint's corners are drawn.
const FAR_PX = 65536.0;

// The margin of a quad around its sections in grid units. A grid unit is at least a pixel, and the rasterizer snaps corners to 1/256 of a pixel:
// without a margin it would lose pixels just inside the rim, where a wide kernel is not yet 0.
const MARGIN = 1.0 / 64.0;

// The corner of a quad that a vertex is.
fn side_of(vertex: u32) -> vec2f {
    return vec2f(select(-1.0, 1.0, (vertex & 1u) != 0u), select(-1.0, 1.0, (vertex & 2u) != 0u));
}

// The clip coordinates of a quad's corner, at an offset from its centre, for a footprint whose box has this half size.
fn clip_corner(center_px: vec2f, offset: vec2f, side: vec2f, half_box: vec2f) -> vec4f {
    let size = vec2f(frame.size);
    var corner_px = center_px + offset;
    // Corners far off the screen would cost the rasterizer precision, so such a footprint's box is clipped near the screen.
    let farthest = abs(center_px) + half_box;
    if max(farthest.x, farthest.y) > FAR_PX {
        corner_px = clamp(center_px + side * half_box, vec2f(-1.0), size + 1.0);
    }
    let p = corner_px / size;
    return vec4f(2.0 * p.x - 1.0, 1.0 - 2.0 * p.y, 0.0, 1.0);
}

// A vertex off the screen, for quads without area.
const NOWHERE = vec4f(2.0, 2.0, 0.0, 1.0);

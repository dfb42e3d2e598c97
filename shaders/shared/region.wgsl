// The pixels that a subgroup of the tile rasteriser holds, and what of them is not opaque (§6).

// The pixels of a subgroup.
struct Region {
    // Bounds of its pixel centres.
    low: vec2f,
    high: vec2f,
    // Bounds of those that are not opaque.
    open_low: vec2f,
    open_high: vec2f,
    // For each of the units' rows the lanes whose pixel there is not opaque.
    open: vec4u,
    // The same for pixels that have not reached β.
    shallow: vec4u,
}

// Which pixels are not opaque, and their bounds.
fn opened(region: Region, is_inside: vec4<bool>, opacity: vec4f, column: f32, rows: vec4f) -> Region {
    // Pixels off the image count as opaque.
    let is_open = is_inside & (opacity < vec4f(select(3e38, frame.opacity_threshold, frame.culling != 0u)));
    var result = region;
    if ECONOMIES {
        let is_shallow = is_inside & (opacity < vec4f(gather.beta));
        result.shallow = vec4u(
            subgroupBallot(is_shallow.x).x,
            subgroupBallot(is_shallow.y).x,
            subgroupBallot(is_shallow.z).x,
            subgroupBallot(is_shallow.w).x,
        );
    }
    result.open = vec4u(
        subgroupBallot(is_open.x).x,
        subgroupBallot(is_open.y).x,
        subgroupBallot(is_open.z).x,
        subgroupBallot(is_open.w).x,
    );
    let from_top = select(vec4f(1e9), rows, is_open);
    let from_bottom = select(vec4f(-1e9), rows, is_open);
    let top = min(min(from_top.x, from_top.y), min(from_top.z, from_top.w));
    let bottom = max(max(from_bottom.x, from_bottom.y), max(from_bottom.z, from_bottom.w));
    result.open_low = subgroupMin(vec2f(select(1e9, column, any(is_open)), top));
    result.open_high = subgroupMax(vec2f(select(-1e9, column, any(is_open)), bottom));
    return result;
}

// Whether the box around a voxel's footprint holds a pixel of those in `open`. Lanes 0 to 15 hold the pixels across the upper
// units of a region, 16 to 31 those across the lower.
fn is_visible(center_px: vec2f, margin: vec2f, region: Region, open: vec4u) -> bool {
    let center = center_px - region.low;
    let size = region.high - region.low;
    let first_row = i32(clamp(ceil(center.y - margin.y), 0.0, 16.0));
    let end_row = i32(clamp(floor(center.y + margin.y), -1.0, size.y)) + 1;
    let down = i32((1u << u32(end_row)) - (1u << u32(first_row)));
    let upper = vec4u(-(vec4i(down) >> vec4u(0u, 1u, 2u, 3u) & vec4i(1)));
    let lower = vec4u(-(vec4i(down) >> vec4u(4u, 5u, 6u, 7u) & vec4i(1)));
    var across_upper = across(vec4f(center.x), margin.x, size.x);
    var across_lower = across_upper;
    if PARALLELOGRAM {
        // The sides follow the shear of eq. 9.
        let rows = vec4f(0.0, 1.0, 2.0, 3.0) - center.y;
        let half_width = gather.half_width + BOX_SLACK;
        across_upper = across(center.x + gather.shear * rows, half_width, size.x);
        across_lower = across(center.x + gather.shear * (rows + 4.0), half_width, size.x);
    }
    let box = (upper & across_upper) | (lower & (across_lower << vec4u(16u)));
    return end_row > first_row && any((box & open) != vec4u(0u));
}

// The pixels of a row within a distance of a point, one bit each.
fn across(center: vec4f, half_width: f32, last: f32) -> vec4u {
    let first = vec4i(clamp(ceil(center - half_width), vec4f(0.0), vec4f(16.0)));
    let end = vec4i(clamp(floor(center + half_width), vec4f(-1.0), vec4f(last))) + 1;
    return select(vec4u(0u), (vec4u(1u) << vec4u(end)) - (vec4u(1u) << vec4u(first)), end > first);
}

// Footprint quads of kernels that are each turned to their own ray, with every section mapped at its own depth (§3.3.2, end of §4.2), for
// `splat_perspective` and `sample`.
//
// #import shared/brick
// #import shared/corners
// #import shared/footprints
// #import shared/frame
// #import shared/local_ray

// The data that the fragments of a quad share.
struct Quad {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) center_px: vec2f,
    // The unit vector on the screen along one axis of the footprints' ellipses.
    @location(1) @interpolate(flat) axis: vec2f,
    // For every sheet the footprint coordinates of a pixel along the axis and across it, in texels of the summed-area table or in grid units.
    @location(2) @interpolate(flat) along: vec4f,
    @location(3) @interpolate(flat) across: vec4f,
    @location(4) @interpolate(flat) amount: vec4f,
    // For every sheet the low-pass rule's amplitude.
    @location(5) @interpolate(flat) amplitude: vec4f,
    // Summed-area: the rest of H(0, 0, z) beyond the sheets' near planes, with the planes' signs.
    // Sections: the positions of the slabs' middles relative to the kernel's centre.
    @location(6) @interpolate(flat) near: vec4f,
    // Summed-area: the same beyond the far planes.
    @location(7) @interpolate(flat) far: vec4f,
    // Summed-area: the whole H(0, 0, z) on both sides of the centre, for the sheet that contains the centre.
    @location(8) @interpolate(flat) whole: vec4f,
    // Summed-area: falloff times the squared distance of layers.
    @location(9) @interpolate(flat) falloff: f32,
}

@vertex
fn vertex(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Quad {
    start(vertex >> 31u);
    let quad = instance * QUADS + vertex / 4u;
    let splat = splats[instances[min(quad, args.count - 1u)]];
    let center_px = vec2f(splat.x_px, splat.y_px);
    let ray = local_ray(center_px);
    let planes = sheet_planes(ray, splat.depth, splat.from_eye, sheet_group.near);
    let near = planes.near;
    let far = planes.far;
    let maps = section_maps(ray, splat.from_eye, near, far);
    let along = sqrt(maps.along);
    let across = sqrt(maps.across);

    let extent = quad_extent(near.x, far[SHEETS - 1u]);
    let reach = (extent + MARGIN) / vec2f(min_of(along), min_of(across));
    let side = side_of(vertex);
    let a = ray.axis * reach.x;
    let b = vec2f(-ray.axis.y, ray.axis.x) * reach.y;
    let corner = clip_corner(center_px, a * side.x + b * side.y, side, abs(a) + abs(b));
    let position = select(NOWHERE, corner, extent > 0.0 && near.x < far[SHEETS - 1u] && quad < args.count);
    let amount = vec4f(unpack2x16float(splat.rg), unpack2x16float(splat.ba)) * ray.per_lambda;
    if SECTIONS {
        // Stored sections are whole, so those entirely before the near plane are left out.
        let middle = select(vec4f(1e9), far - 0.5 * planes.thickness, far > near);
        return Quad(position, center_px, ray.axis, along, across, amount, maps.amplitude, middle, vec4f(0.0), vec4f(0.0), 0.0);
    }
    let falloff = layer_falloff();
    let center = textureLoad(footprints, vec2u(0u), 0, 0).xy;
    let texels = (PLANE_TEXELS - 1.0) / frame.support;
    return Quad(
        position,
        center_px,
        ray.axis,
        along * texels,
        across * texels,
        amount / center.y,
        maps.amplitude,
        beyond_planes(near, falloff),
        beyond_planes(far, falloff),
        select(vec4f(0.0), vec4f(2.0 * center.x), (near < vec4f(0.0)) & (far >= vec4f(0.0))),
        falloff,
    );
}

// The minimum over the sheets of the group.
fn min_of(sheets: vec4f) -> f32 {
    var least = sheets.x;
    for (var i = 1u; i < SHEETS; i += 1u) {
        least = min(least, sheets[i]);
    }
    return least;
}

fn section(quad: Quad, sheet: u32) -> f32 {
    let offset = quad.position.xy - quad.center_px;
    let along = dot(quad.axis, offset) * quad.along[sheet];
    let across = (quad.axis.x * offset.y - quad.axis.y * offset.x) * quad.across[sheet];
    let footprint = vec2f(along, across);
    if SECTIONS {
        return section_pre_integrated(footprint, quad.near[sheet]) * quad.amplitude[sheet];
    }
    let planes = vec4f(quad.near[sheet], quad.far[sheet], 0.0, 0.0);
    let cut = cut_by_ball(planes, beyond_chord(footprint, quad.falloff));
    return (quad.whole[sheet] + cut.x - cut.y) * in_plane(footprint, quad.falloff) * quad.amplitude[sheet];
}

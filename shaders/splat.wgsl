// Draws the kernel sections of a group of sheets as footprint quads that add up in the group's sheet buffers (§3.2), one quad per voxel. All
// footprints have the same shape on the screen.
//
// #import shared/brick
// #import shared/corners
// #import shared/footprints
// #import shared/frame
// #import shared/sheets

// The vertices of a quad provide everything that its fragments share, because on software rasterizers an interpolated constant costs a
// fraction of a uniform.
struct Quad {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) center_px: vec2f,
    // Maps a pixel offset to footprint coordinates, in texels of the summed-area table or in grid units.
    @location(1) @interpolate(flat) footprint_from_pixels: vec4f,
    @location(2) @interpolate(flat) amount: vec4f,
    // Summed-area: the rest of H(0, 0, z) beyond the group's first plane, with the plane's sign.
    // Sections: the plane's position relative to the kernel's centre.
    @location(3) @interpolate(flat) first: f32,
    // Summed-area: the same for the next four planes.
    @location(4) @interpolate(flat) next: vec4f,
    // Summed-area: the whole H(0, 0, z) on both sides of the centre, for the sheet that contains the centre.
    @location(5) @interpolate(flat) whole: vec4f,
    // Summed-area: falloff times the squared distance of layers.
    @location(6) @interpolate(flat) falloff: f32,
}

@vertex
fn vertex(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Quad {
    start(vertex >> 31u);
    // The last instance may have fewer quads: the others repeat the last one without area.
    let quad = instance * QUADS + vertex / 4u;
    let splat = splats[instances[min(quad, args.count - 1u)]];
    let t0 = (sheet_group.near - splat.depth) * frame.kernel_per_depth;
    let t1 = t0 + f32(SHEETS) * frame.section_width;
    let extent = quad_extent(t0, t1);

    let center_px = vec2f(splat.x_px, splat.y_px);
    let side = side_of(vertex);
    let reach = extent + MARGIN;
    let half_box = (abs(frame.pixels_from_footprint[0]) + abs(frame.pixels_from_footprint[1])) * reach;
    let corner = clip_corner(center_px, frame.pixels_from_footprint * (side * reach), side, half_box);
    // A kernel that does not reach this group becomes a quad without area.
    let position = select(NOWHERE, corner, extent > 0.0 && quad < args.count);
    // The amplitude is applied here because under strong minification it leaves the range of f16.
    let amount = vec4f(unpack2x16float(splat.rg), unpack2x16float(splat.ba)) * frame.amplitude;
    let map = frame.footprint_from_pixels;
    if SECTIONS {
        return Quad(position, center_px, vec4f(map[0], map[1]), amount, t0, vec4f(0.0), vec4f(0.0), 0.0);
    }
    let falloff = layer_falloff();
    let near = t0 + vec4f(0.0, 1.0, 2.0, 3.0) * frame.section_width;
    let far = near + frame.section_width;
    let center = textureLoad(footprints, vec2u(0u), 0, 0).xy;
    return Quad(
        position,
        center_px,
        vec4f(map[0], map[1]) * ((PLANE_TEXELS - 1.0) / frame.support),
        amount / center.y,
        beyond_plane(t0, falloff),
        beyond_planes(far, falloff),
        select(vec4f(0.0), vec4f(2.0 * center.x), (near < vec4f(0.0)) & (far >= vec4f(0.0))),
        falloff,
    );
}

// The differences of two entries of eq. 3 for every sheet of the group; neighbouring sheets share an entry. H(a, b, z) is H(0, 0, z) times
// the table's value at (a, b). An entry is counted from the rim on its side of the centre, because a slab that barely reaches into the
// kernel has few digits to lose.
fn sections_summed_area(footprint: vec2f, quad: Quad) -> vec4f {
    let least = beyond_chord(footprint, quad.falloff);
    let first = cut_by_ball(vec4f(quad.first), least).x;
    let far = cut_by_ball(quad.next, least);
    return (quad.whole + vec4f(first, far.xyz) - far) * in_plane(footprint, quad.falloff);
}

fn sections(quad: Quad) -> vec4f {
    // The offset is measured from the pixel's centre, not interpolated: the rasterizer snaps corners to a coarse grid.
    let offset = quad.position.xy - quad.center_px;
    let footprint = quad.footprint_from_pixels.xy * offset.x + quad.footprint_from_pixels.zw * offset.y;
    if !SECTIONS {
        return sections_summed_area(footprint, quad);
    }
    let middle = quad.first + 0.5 * frame.section_width;
    var sections = vec4f(section_pre_integrated(footprint, middle), 0.0, 0.0, 0.0);
    if SHEETS > 1u {
        sections.y = section_pre_integrated(footprint, middle + frame.section_width);
    }
    if SHEETS > 2u {
        sections.z = section_pre_integrated(footprint, middle + 2.0 * frame.section_width);
        sections.w = section_pre_integrated(footprint, middle + 3.0 * frame.section_width);
    }
    return sections;
}

@fragment
fn fragment_1(quad: Quad) -> One {
    start(u32(quad.position.z));
    return One(quad.amount * sections(quad).x);
}

@fragment
fn fragment_2(quad: Quad) -> Two {
    start(u32(quad.position.z));
    let s = sections(quad);
    return Two(quad.amount * s.x, quad.amount * s.y);
}

@fragment
fn fragment_4(quad: Quad) -> Four {
    start(u32(quad.position.z));
    let s = sections(quad);
    return Four(quad.amount * s.x, quad.amount * s.y, quad.amount * s.z, quad.amount * s.w);
}

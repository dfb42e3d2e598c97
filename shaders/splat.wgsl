// Draws the kernel sections of a group of sheets as footprint quads, one quad per voxel, added up in the group's sheet
// buffers (§3.2).

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> group: Group;
@group(0) @binding(2) var<storage, read> splats: array<Splat>;
@group(0) @binding(3) var<storage, read> instances: array<u32>;
@group(0) @binding(4) var<storage, read> args: Indirect;
@group(0) @binding(5) var footprints: texture_2d_array<f32>;

// True for the 128 pre-integrated sections (§3.2), false for the summed-area form (§3.3.1, eq. 3).
override SECTIONS: bool = false;
// Sheets of a group: 1, 2 or 4.
override SHEETS: u32 = 4u;

// Beyond this many pixels from the image's corner a footprint's own corners are not drawn at.
const FAR_PX = 65536.0;

// What a quad reaches beyond its sections, grid units. A grid unit is at least a pixel, and the rasteriser snaps corners to
// 1/256 of one: without a margin it would lose pixels just inside the rim, where a wide kernel is not yet 0.
const MARGIN = 1.0 / 64.0;

// The summed-area table: texels along a side of its quadrant, and layers, from the centre to the support.
override PLANE_TEXELS: f32 = 32.0;
override LAYERS: f32 = 64.0;

// All that the fragments of a quad share comes from its vertices: on software rasterisers an interpolated constant costs a
// fraction of a uniform.
struct Quad {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) center_px: vec2f,
    // Pixel offset → footprint coordinates, in texels of the summed-area table or in grid units.
    @location(1) @interpolate(flat) footprint_from_pixels: vec4f,
    @location(2) @interpolate(flat) amount: vec4f,
    // Summed-area: what of H(0, 0, z) is left beyond the group's first plane, with the plane's sign.
    // Sections: the plane, seen from the kernel's centre.
    @location(3) @interpolate(flat) first: f32,
    // Summed-area: the same for the next four planes.
    @location(4) @interpolate(flat) next: vec4f,
    // Summed-area: all of H(0, 0, z) on both sides of the centre, for the sheet that the centre lies in.
    @location(5) @interpolate(flat) whole: vec4f,
    // Summed-area: falloff times the square of the layers' distance.
    @location(6) @interpolate(flat) falloff: f32,
}

// Distance between the middles of neighbouring stored sections.
fn section_spacing() -> f32 {
    return (frame.radius + 0.5 * frame.slab_width) / f32(textureNumLayers(footprints));
}

// Where the section between t0 and t1 ends, seen from the ray through the kernel's centre.
fn section_extent(t0: f32, t1: f32) -> f32 {
    let nearest = select(min(abs(t0), abs(t1)), 0.0, t0 * t1 <= 0.0);
    return sqrt(max(frame.support * frame.support - nearest * nearest, 0.0));
}

// What of eq. 3's H(0, 0, z) is left beyond a depth z ≥ 0 counted in layers: from the nearest layer, along which the derivative
// h falls off with exp(-falloff·z²). The series of its integral makes a coarse table accurate.
fn beyond(z: f32, falloff: f32) -> f32 {
    let layer = round(z);
    let entry = textureLoad(footprints, vec2u(0u), u32(layer), 0).xy;
    let d = z - layer;
    let a = falloff * layer;
    let h = 1.0 - d * (a - d * ((2.0 * a * a - falloff) / 3.0 + d * a * (0.5 * falloff - a * a / 3.0)));
    return entry.x - entry.y * d * h;
}

// The same beyond a plane on either side of the centre, with the plane's sign; never 0, which has none.
fn beyond_plane(t: f32, falloff: f32) -> f32 {
    let left = beyond(min(abs(t) / frame.support, 1.0) * (LAYERS - 1.0), falloff);
    return select(max(left, 1e-30), -max(left, 1e-30), t < 0.0);
}

@vertex
fn vertex(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Quad {
    // The last instance may have fewer quads: the others repeat the last one, without area.
    let quad = instance * QUADS + vertex / 4u;
    let corner = vertex % 4u;
    let splat = splats[instances[min(quad, args.count - 1u)]];
    let t0 = group.near - splat.depth;
    let t1 = t0 + f32(SHEETS) * frame.slab_width;
    // A stored section may be half a spacing nearer than the one asked for.
    let slack = select(0.0, 0.5 * section_spacing(), SECTIONS);
    let extent = section_extent(t0 - slack, t1 + slack);

    let center_px = vec2f(splat.x_px, splat.y_px);
    let side = vec2f(select(-1.0, 1.0, (corner & 1u) != 0u), select(-1.0, 1.0, (corner & 2u) != 0u));
    let reach = extent + MARGIN;
    let size = vec2f(frame.size);
    var corner_px = center_px + frame.pixels_from_footprint * (side * reach);
    // Corners far off the screen cost the rasteriser its precision: such a footprint's box is cut off near the screen.
    let half_box = (abs(frame.pixels_from_footprint[0]) + abs(frame.pixels_from_footprint[1])) * reach;
    let farthest = abs(center_px) + half_box;
    if max(farthest.x, farthest.y) > FAR_PX {
        corner_px = clamp(center_px + side * half_box, vec2f(-1.0), size + 1.0);
    }
    let p = corner_px / size;
    // A kernel that does not reach this group becomes a quad without area, off the screen.
    let position = select(vec4f(2.0, 2.0, 0.0, 1.0), vec4f(2.0 * p.x - 1.0, 1.0 - 2.0 * p.y, 0.0, 1.0), extent > 0.0 && quad < args.count);
    // The amplitude only here: under a strong minification it leaves the range of f16.
    let amount = vec4f(unpack2x16float(splat.rg), unpack2x16float(splat.ba)) * frame.amplitude;
    let map = frame.footprint_from_pixels;
    if SECTIONS {
        return Quad(position, center_px, vec4f(map[0], map[1]), amount, t0, vec4f(0.0), vec4f(0.0), 0.0);
    }
    let layer = frame.support / (LAYERS - 1.0);
    let falloff = frame.falloff * layer * layer;
    let near = t0 + vec4f(0.0, 1.0, 2.0, 3.0) * frame.slab_width;
    let far = near + frame.slab_width;
    let center = textureLoad(footprints, vec2u(0u), 0, 0).xy;
    return Quad(
        position,
        center_px,
        vec4f(map[0], map[1]) * ((PLANE_TEXELS - 1.0) / frame.support),
        amount / center.y,
        beyond_plane(t0, falloff),
        vec4f(
            beyond_plane(far.x, falloff),
            beyond_plane(far.y, falloff),
            beyond_plane(far.z, falloff),
            beyond_plane(far.w, falloff),
        ),
        select(vec4f(0.0), vec4f(2.0 * center.x), (near < vec4f(0.0)) & (far >= vec4f(0.0))),
        falloff,
    );
}

// Two entries of eq. 3 subtracted, for every sheet of the group; neighbours share an entry. H(a, b, z) is H(0, 0, z) times
// what the table says of (a, b). An entry is counted from the rim on its side of the centre: a slab that just reaches into
// the kernel has few digits to lose.
fn sections_summed_area(footprint: vec2f, quad: Quad) -> vec4f {
    // The ball's truncation, t within the chord: what is left beyond falls with |t|.
    let rho_squared = dot(footprint, footprint);
    let last = PLANE_TEXELS - 1.0;
    let chord = sqrt(max(last * last - rho_squared, 0.0)) * ((LAYERS - 1.0) / last);
    let least = beyond(chord, quad.falloff);
    let first = select(-max(-quad.first, least), max(quad.first, least), quad.first > 0.0);
    let far = select(-max(-quad.next, vec4f(least)), max(quad.next, vec4f(least)), quad.next > vec4f(0.0));
    let sections = quad.whole + vec4f(first, far.xyz) - far;

    // In the plane h falls off with exp(-falloff·(a² + b²)): the nearest texel, and the step from there.
    let texel = min(round(abs(footprint)), vec2f(last));
    let plane = (LAYERS - 1.0) / last;
    let u = quad.falloff * plane * plane * (dot(texel, texel) - rho_squared);
    let in_plane = textureLoad(footprints, vec2u(texel), 0, 0).y * (1.0 + u * (1.0 + u * (0.5 + u / 6.0)));
    return sections * in_plane;
}

// The nearest of the stored sections, bilinear between the four nearest texels of its quadrant.
fn section_pre_integrated(footprint: vec2f, t0: f32) -> f32 {
    let layer = round(abs(t0 + 0.5 * frame.slab_width) / section_spacing());
    let middle = layer * section_spacing();
    let extent = section_extent(middle - 0.5 * frame.slab_width, middle + 0.5 * frame.slab_width);
    if layer >= f32(textureNumLayers(footprints)) || dot(footprint, footprint) >= extent * extent {
        return 0.0;
    }
    let last = vec2f(textureDimensions(footprints) - 1u);
    let at = min(abs(footprint) / extent, vec2f(1.0)) * last;
    let low = min(floor(at), last - 1.0);
    let t = at - low;
    let p = vec2u(low);
    let l = u32(layer);
    let top = mix(textureLoad(footprints, p, l, 0).x, textureLoad(footprints, p + vec2u(1, 0), l, 0).x, t.x);
    let bottom = mix(textureLoad(footprints, p + vec2u(0, 1), l, 0).x, textureLoad(footprints, p + vec2u(1, 1), l, 0).x, t.x);
    return mix(top, bottom, t.y);
}

fn sections(quad: Quad) -> vec4f {
    // From the pixel's centre, not an interpolated coordinate: the rasteriser snaps corners to a coarse grid.
    let offset = quad.position.xy - quad.center_px;
    let footprint = quad.footprint_from_pixels.xy * offset.x + quad.footprint_from_pixels.zw * offset.y;
    if !SECTIONS {
        return sections_summed_area(footprint, quad);
    }
    var sections = vec4f(section_pre_integrated(footprint, quad.first), 0.0, 0.0, 0.0);
    if SHEETS > 1u {
        sections.y = section_pre_integrated(footprint, quad.first + frame.slab_width);
    }
    if SHEETS > 2u {
        sections.z = section_pre_integrated(footprint, quad.first + 2.0 * frame.slab_width);
        sections.w = section_pre_integrated(footprint, quad.first + 3.0 * frame.slab_width);
    }
    return sections;
}

@fragment
fn fragment_1(quad: Quad) -> One {
    return One(quad.amount * sections(quad).x);
}

@fragment
fn fragment_2(quad: Quad) -> Two {
    let s = sections(quad);
    return Two(quad.amount * s.x, quad.amount * s.y);
}

@fragment
fn fragment_4(quad: Quad) -> Four {
    let s = sections(quad);
    return Four(quad.amount * s.x, quad.amount * s.y, quad.amount * s.z, quad.amount * s.w);
}

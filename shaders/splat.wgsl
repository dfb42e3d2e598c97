// Draws the kernel sections between two slab planes as footprint quads, added up in the sheet buffer (§3.2).

struct Slab {
    near: f32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> slab: Slab;
@group(0) @binding(2) var<storage, read> splats: array<Splat>;
@group(0) @binding(3) var footprints: texture_2d_array<f32>;

// True for the 128 pre-integrated sections (§3.2), false for the summed-area form (§3.3.1, eq. 3).
override SECTIONS: bool = false;

// Beyond this many pixels from the image's corner a footprint's own corners are not drawn at.
const FAR_PX = 65536.0;

struct Section {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) center_px: vec2f,
    @location(1) @interpolate(flat) amount: vec4f,
    // Summed-area: the depths t0, t1 of the slab planes, seen from the kernel's centre.
    // Sections: the layer and its trimmed extent.
    @location(2) @interpolate(flat) section: vec2f,
}

// What a quad reaches beyond its section, grid units. A grid unit is at least a pixel, and the rasteriser snaps corners to
// 1/256 of one: without a margin it would lose pixels just inside the rim, where a wide kernel is not yet 0.
const MARGIN = 1.0 / 64.0;

// Depth interval of a stored section, folded to non-negative middles.
fn section_spacing() -> f32 {
    return (frame.radius + 0.5 * frame.slab_width) / f32(textureNumLayers(footprints));
}

// Where the section between t0 and t1 ends, seen from the ray through the kernel's centre.
fn section_extent(t0: f32, t1: f32) -> f32 {
    let nearest = select(min(abs(t0), abs(t1)), 0.0, t0 * t1 <= 0.0);
    return sqrt(max(frame.support * frame.support - nearest * nearest, 0.0));
}

@vertex
fn vertex(@builtin(vertex_index) corner: u32, @builtin(instance_index) instance: u32) -> Section {
    let splat = splats[instance];
    let t0 = slab.near - splat.depth;
    let t1 = t0 + frame.slab_width;

    var section = vec2f(t0, t1);
    var extent: f32;
    if SECTIONS {
        let layer = round(abs(0.5 * (t0 + t1)) / section_spacing());
        let middle = layer * section_spacing();
        extent = section_extent(middle - 0.5 * frame.slab_width, middle + 0.5 * frame.slab_width);
        extent = select(0.0, extent, layer < f32(textureNumLayers(footprints)));
        section = vec2f(layer, extent);
    } else {
        extent = section_extent(t0, t1);
    }

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
    // A kernel that does not reach this slab becomes a quad without area, off the screen.
    let position = select(vec4f(2.0, 2.0, 0.0, 1.0), vec4f(2.0 * p.x - 1.0, 1.0 - 2.0 * p.y, 0.0, 1.0), extent > 0.0);
    // The amplitude only here: under a strong minification it leaves the range of f16.
    let amount = vec4f(unpack2x16float(splat.rg), unpack2x16float(splat.ba)) * frame.amplitude;
    return Section(position, center_px, amount, section);
}

// What of eq. 3's H(a, b, z) is left beyond a z ≥ 0, over the texel's place in the plane: from the nearest layer, along
// which the derivative is h and falls off with exp(-falloff·z²). The series of its integral makes a coarse table accurate.
fn beyond(texel: vec2u, z: f32) -> f32 {
    let last = f32(textureNumLayers(footprints) - 1u);
    let layer = min(round(z / frame.support * last), last);
    let at = layer / last * frame.support;
    let entry = textureLoad(footprints, texel, u32(layer), 0).xy;
    let d = z - at;
    let f = frame.falloff;
    let a = f * at;
    return entry.x - entry.y * d * (1.0 - d * (a - d * ((2.0 * a * a - f) / 3.0 + d * a * (0.5 * f - a * a / 3.0))));
}

// eq. 3's two entries, subtracted; each counted from the rim on its side of the centre.
fn section_summed_area(footprint: vec2f, t0: f32, t1: f32) -> f32 {
    // The ball's truncation: t within the chord.
    let rho_squared = dot(footprint, footprint);
    let chord = sqrt(max(frame.support * frame.support - rho_squared, 0.0));
    let near = clamp(t0, -chord, chord);
    let far = clamp(t1, -chord, chord);

    // The nearest entry in the plane, where H falls off with exp(-falloff·(a² + b²)): so does the step from there.
    let last = vec2f(textureDimensions(footprints) - 1u);
    let texel = min(round(abs(footprint) / frame.support * last), last);
    let at = texel / last * frame.support;
    let u = frame.falloff * (dot(at, at) - rho_squared);
    let step = 1.0 + u * (1.0 + u * (0.5 + u / 6.0));

    let place = vec2u(texel);
    let beyond_near = beyond(place, abs(near));
    let beyond_far = beyond(place, abs(far));
    let half = textureLoad(footprints, place, 0, 0).x;
    let across = near < 0.0 && far > 0.0;
    return step * select(abs(beyond_near - beyond_far), 2.0 * half - beyond_near - beyond_far, across);
}

// A stored section, bilinear between the four nearest texels of its quadrant.
fn section_pre_integrated(footprint: vec2f, layer: f32, extent: f32) -> f32 {
    if dot(footprint, footprint) >= extent * extent {
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

@fragment
fn fragment(section: Section) -> @location(0) vec4f {
    // From the pixel's centre, not an interpolated coordinate: the rasteriser snaps corners to a coarse grid.
    let footprint = frame.footprint_from_pixels * (section.position.xy - section.center_px);
    var s: f32;
    if SECTIONS {
        s = section_pre_integrated(footprint, section.section.x, section.section.y);
    } else {
        s = section_summed_area(footprint, section.section.x, section.section.y);
    }
    return section.amount * s;
}

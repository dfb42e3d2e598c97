// Draws the kernel sections between two slab planes as footprint quads, added up in the sheet buffer (§3.2).

struct Slab {
    near: f32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> slab: Slab;
@group(0) @binding(2) var<storage, read> splats: array<Splat>;
@group(0) @binding(3) var footprints: texture_2d_array<f32>;
@group(0) @binding(4) var bilinear: sampler;

// True for the 128 pre-integrated sections (§3.2), false for the summed-area form (§3.3.1, eq. 3).
override SECTIONS: bool = false;

struct Section {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) center_px: vec2f,
    @location(1) @interpolate(flat) amount: vec4f,
    // Summed-area: the depths t0, t1 of the slab planes, seen from the kernel's centre.
    // Sections: the layer and its trimmed extent.
    @location(2) @interpolate(flat) section: vec2f,
}

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
    let p = (center_px + frame.pixels_from_footprint * (side * extent)) / vec2f(frame.size);
    // A kernel that does not reach this slab becomes a quad without area, off the screen.
    let position = select(vec4f(2.0, 2.0, 0.0, 1.0), vec4f(2.0 * p.x - 1.0, 1.0 - 2.0 * p.y, 0.0, 1.0), extent > 0.0);
    return Section(position, center_px, vec4f(unpack2x16float(splat.rg), unpack2x16float(splat.ba)), section);
}

// H(a, b, z) of eq. 3 for z ≥ 0: the nearest layer, expanded to second order in z with its derivative h and
// ∂h/∂z = -2·falloff·z·h.
fn cumulative(texture_coordinate: vec2f, z: f32) -> f32 {
    let last = f32(textureNumLayers(footprints) - 1u);
    let layer = min(round(z / frame.support * last), last);
    let at = layer / last * frame.support;
    let dz = z - at;
    let entry = textureSampleLevel(footprints, bilinear, texture_coordinate, u32(layer), 0.0);
    return entry.x + entry.y + entry.z * dz * (1.0 - frame.falloff * at * dz);
}

// Texel centres lie on the quadrant's border, half a texel inside the texture.
fn texture_coordinate(footprint: vec2f, extent: f32) -> vec2f {
    let texels = vec2f(textureDimensions(footprints));
    return (abs(footprint) / extent * (texels - 1.0) + 0.5) / texels;
}

fn section_summed_area(footprint: vec2f, t0: f32, t1: f32) -> f32 {
    // The ball's truncation: t within the chord.
    let chord = sqrt(max(frame.support * frame.support - dot(footprint, footprint), 0.0));
    let near = clamp(t0, -chord, chord);
    let far = clamp(t1, -chord, chord);
    let uv = texture_coordinate(footprint, frame.support);
    return sign(far) * cumulative(uv, abs(far)) - sign(near) * cumulative(uv, abs(near));
}

fn section_pre_integrated(footprint: vec2f, layer: f32, extent: f32) -> f32 {
    let inside = dot(footprint, footprint) < extent * extent;
    return select(0.0, textureSampleLevel(footprints, bilinear, texture_coordinate(footprint, extent), u32(layer), 0.0).x, inside);
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

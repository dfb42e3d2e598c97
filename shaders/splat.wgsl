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

// H(a, b, z) of eq. 3 for z ≥ 0 and the Gaussian without its truncation, from the nearest entry of the table. In the
// plane H falls off with exp(-falloff·(a² + b²)), along z its derivative is h: the steps to (a, b, z) follow from both,
// so a coarse table is accurate.
fn cumulative(footprint: vec2f, z: f32) -> f32 {
    let last = vec3f(vec3u(textureDimensions(footprints), textureNumLayers(footprints)) - 1u);
    let texel = min(round(vec3f(abs(footprint), z) / frame.support * last), last);
    let at = texel / last * frame.support;
    let entry = textureLoad(footprints, vec2u(texel.xy), u32(texel.z), 0).xy;

    let dz = z - at.z;
    let along_z = entry.x + entry.y * dz * (1.0 - frame.falloff * at.z * dz);
    let u = frame.falloff * (dot(at.xy, at.xy) - dot(footprint, footprint));
    return along_z * (1.0 + u * (1.0 + u * (0.5 + u / 6.0)));
}

// eq. 3's two entries, subtracted.
fn section_summed_area(footprint: vec2f, t0: f32, t1: f32) -> f32 {
    // The ball's truncation: t within the chord.
    let chord = sqrt(max(frame.support * frame.support - dot(footprint, footprint), 0.0));
    let near = clamp(t0, -chord, chord);
    let far = clamp(t1, -chord, chord);
    return sign(far) * cumulative(footprint, abs(far)) - sign(near) * cumulative(footprint, abs(near));
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

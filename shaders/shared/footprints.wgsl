// Kernel footprints from their stored forms (§§3.2, 3.3.1), and the quads with which they are drawn, for `splat` and `splat_perspective`.
//
// #import shared/brick
// #import shared/frame
// #import shared/splat

@group(0) @binding(1) var<uniform> sheet_group: SheetGroup;
@group(0) @binding(2) var<storage, read> splats: array<Splat>;
@group(0) @binding(3) var<storage, read> instances: array<u32>;
@group(0) @binding(4) var<storage, read> args: Indirect;
@group(0) @binding(5) var footprints: texture_2d_array<f32>;

// True for the 128 pre-integrated sections (§3.2), false for the summed-area form (§3.3.1, eq. 3).
override SECTIONS: bool = false;
// The number of sheets in a group: 1, 2 or 4.
override SHEETS: u32 = 4u;

// The summed-area table: the texels along a side of its quadrant, and the number of layers from the centre to the support.
override PLANE_TEXELS: f32 = 32.0;
override LAYERS: f32 = 64.0;

// The distance between the middles of neighbouring stored sections.
fn section_spacing() -> f32 {
    return (frame.radius + 0.5 * frame.section_width) / f32(textureNumLayers(footprints));
}

// The extent of the section between t0 and t1, measured from the ray through the kernel's centre.
fn section_extent(t0: f32, t1: f32) -> f32 {
    let nearest = select(min(abs(t0), abs(t1)), 0.0, t0 * t1 <= 0.0);
    return sqrt(max(frame.support * frame.support - nearest * nearest, 0.0));
}

// The rest of eq. 3's H(0, 0, z) beyond a depth z ≥ 0 counted in layers, from the nearest layer, in which the derivative h falls off with
// exp(-falloff·z²). The series of its integral makes a coarse table accurate.
fn beyond(z: f32, falloff: f32) -> f32 {
    let layer = round(z);
    let entry = textureLoad(footprints, vec2u(0u), u32(layer), 0).xy;
    let d = z - layer;
    let a = falloff * layer;
    let h = 1.0 - d * (a - d * ((2.0 * a * a - falloff) / 3.0 + d * a * (0.5 * falloff - a * a / 3.0)));
    return entry.x - entry.y * d * h;
}

// The same beyond a plane on either side of the centre, with the plane's sign; never 0, because 0 has no sign.
fn beyond_plane(t: f32, falloff: f32) -> f32 {
    let left = beyond(min(abs(t) / frame.support, 1.0) * (LAYERS - 1.0), falloff);
    return select(max(left, 1e-30), -max(left, 1e-30), t < 0.0);
}

// The extent of a quad's sections, between t0 and t1.
fn quad_extent(t0: f32, t1: f32) -> f32 {
    // A stored section may be half a spacing nearer than the requested one.
    let slack = select(0.0, 0.5 * section_spacing(), SECTIONS);
    return section_extent(t0 - slack, t1 + slack);
}

// The nearest of the stored sections, given the position of its slab's middle relative to the kernel's centre, interpolated bilinearly between
// the four nearest texels of its quadrant.
fn section_pre_integrated(footprint: vec2f, slab_middle: f32) -> f32 {
    let layer = round(abs(slab_middle) / section_spacing());
    let middle = layer * section_spacing();
    let extent = section_extent(middle - 0.5 * frame.section_width, middle + 0.5 * frame.section_width);
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

// The factor for H(0, 0, z) of eq. 3 at a footprint coordinate counted in texels. In the plane h falls off with exp(-falloff·(a² + b²)): the
// nearest texel, extrapolated from there.
fn in_plane(footprint: vec2f, falloff: f32) -> f32 {
    let last = PLANE_TEXELS - 1.0;
    let texel = min(round(abs(footprint)), vec2f(last));
    let plane = (LAYERS - 1.0) / last;
    let u = falloff * plane * plane * (dot(texel, texel) - dot(footprint, footprint));
    return textureLoad(footprints, vec2u(texel), 0, 0).y * (1.0 + u * (1.0 + u * (0.5 + u / 6.0)));
}

// The rest of H(0, 0, z) beyond the ball, where z ends at the chord.
fn beyond_chord(footprint: vec2f, falloff: f32) -> f32 {
    let last = PLANE_TEXELS - 1.0;
    let chord = sqrt(max(last * last - dot(footprint, footprint), 0.0)) * ((LAYERS - 1.0) / last);
    return beyond(chord, falloff);
}

// The rests beyond planes, with their signs, raised in magnitude to at least `least`: the rest decreases with the planes' distance.
fn cut_by_ball(beyond: vec4f, least: f32) -> vec4f {
    return select(-max(-beyond, vec4f(least)), max(beyond, vec4f(least)), beyond > vec4f(0.0));
}

// The falloff for depths counted in layers.
fn layer_falloff() -> f32 {
    let layer = frame.support / (LAYERS - 1.0);
    return frame.falloff * layer * layer;
}

// `beyond_plane` for four planes.
fn beyond_planes(t: vec4f, falloff: f32) -> vec4f {
    return vec4f(
        beyond_plane(t.x, falloff),
        beyond_plane(t.y, falloff),
        beyond_plane(t.z, falloff),
        beyond_plane(t.w, falloff),
    );
}

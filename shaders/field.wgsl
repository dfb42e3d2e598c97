// Draws voxels onto a slab plane, one quad per voxel, and adds them up in two sheet buffers, as the sums for the field and its gradient (SPEC §9;
// Mueller, Möller, Crawfis 1999).
//
// #import shared/brick
// #import shared/field_voxel
// #import shared/frame
// #import shared/plane_quads
// #import shared/planes
// #import shared/sheets

@group(0) @binding(1) var<uniform> sheet_group: SheetGroup;
@group(0) @binding(2) var<storage, read> voxels: array<FieldVoxel>;
@group(0) @binding(3) var<storage, read> instances: array<u32>;
@group(0) @binding(4) var<storage, read> args: Indirect;
@group(0) @binding(5) var<uniform> planes: FieldPlanes;

// Whether gradients are the derivative of the field, and not means of the voxels' differences.
override KERNEL_GRADIENT: bool = false;

struct Quad {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) center_px: vec2f,
    // Two rows: from pixel offsets to grid units along the planes' axes.
    @location(1) @interpolate(flat) rows: vec4f,
    @location(2) @interpolate(flat) number: f32,
    // The voxel's gradient, and the plane's distance from the voxel.
    @location(3) @interpolate(flat) gradient: vec4f,
    // -falloff, and the radius squared.
    @location(4) @interpolate(flat) kernel: vec2f,
}

@vertex
fn vertex(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Quad {
    start(vertex >> 31u);
    // The last instance may have fewer quads: the others repeat the last one, without area.
    let quad = instance * QUADS + vertex / 4u;
    let voxel = voxels[instances[min(quad, args.count - 1u)]];
    let lies = quad_on_plane(voxel, vertex, quad < args.count);
    return Quad(
        lies.position,
        lies.center_px,
        lies.rows,
        voxel.number,
        vec4f(unpacked(voxel.gradient_xy, voxel.gradient_z), lies.distance),
        plane_kernel(),
    );
}

// A voxel's terms of (N, Σ c·g, Σ dx·g, Σ dy·g) and (Σ dz·g, 0, 0, 0). For the kernel's derivative, with (a, b, t) from the voxel to the
// point, those of (N, Σ c·g, Σ g·a, Σ g·b) and (Σ g·t, Σ c·g·a, Σ c·g·b, Σ c·g·t).
@fragment
fn fragment(quad: Quad) -> Two {
    start(u32(quad.position.z));
    // From the pixel's centre, not an interpolated coordinate: the rasterizer snaps corners to a coarse grid.
    let offset = quad.position.xy - quad.center_px;
    let place = from_voxel(quad.rows, offset, quad.gradient.w);
    let weight = weight_at(place, quad.kernel);
    let both = weight * vec2f(1.0, quad.number);
    if KERNEL_GRADIENT {
        let moment = weight * place;
        return Two(vec4f(both, moment.xy), vec4f(moment.z, moment * quad.number));
    }
    let gradient = weight * quad.gradient.xyz;
    return Two(vec4f(both, gradient.xy), vec4f(gradient.z, 0.0, 0.0, 0.0));
}

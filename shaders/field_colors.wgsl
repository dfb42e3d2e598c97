// Draws voxels with colours of their own onto a slab plane, as `field` draws their values, and adds the colours up in a sheet buffer (SPEC §10).
//
// #import shared/brick
// #import shared/field_voxel
// #import shared/frame
// #import shared/plane_quads
// #import shared/planes
// #import shared/sheets
// #import shared/splatted_color
// #import shared/texels

@group(0) @binding(1) var<uniform> sheet_group: SheetGroup;
@group(0) @binding(2) var<storage, read> voxels: array<FieldVoxel>;
@group(0) @binding(3) var<storage, read> instances: array<u32>;
@group(0) @binding(4) var<storage, read> args: Indirect;
@group(0) @binding(5) var<uniform> planes: FieldPlanes;
@group(0) @binding(6) var<storage, read> bricks: array<Brick>;
// The colours of voxels; if `EXACT` the bits of the coefficients that interpolate them.
@group(0) @binding(7) var colors: texture_2d_array<u32>;
// The slots of pages, where voxels are in pages.
@group(0) @binding(8) var pages: texture_2d_array<u32>;

struct Quad {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) center_px: vec2f,
    // Two rows: from pixel offsets to grid units along the planes' axes.
    @location(1) @interpolate(flat) rows: vec4f,
    // The plane's distance from the voxel.
    @location(2) @interpolate(flat) distance: f32,
    // The voxel's colour and A.
    @location(3) @interpolate(flat) color: vec4f,
    // -falloff, and the radius squared.
    @location(4) @interpolate(flat) kernel: vec2f,
}

@vertex
fn vertex(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Quad {
    start(vertex >> 31u);
    // The last instance may have fewer quads: the others repeat the last one, without area.
    let quad = instance * QUADS + vertex / 4u;
    let id = instances[min(quad, args.count - 1u)];
    let lies = quad_on_plane(voxels[id], vertex, quad < args.count);
    let color = splatted_color(planes.colors, index_of(voxel_of(bricks[id / BRICK_VOXELS], id % BRICK_VOXELS)));
    return Quad(lies.position, lies.center_px, lies.rows, lies.distance, color, plane_kernel());
}

// A voxel's term of Σ colour·g.
@fragment
fn fragment(quad: Quad) -> One {
    start(u32(quad.position.z));
    let place = from_voxel(quad.rows, quad.position.xy - quad.center_px, quad.distance);
    return One(quad.color * weight_at(place, quad.kernel));
}

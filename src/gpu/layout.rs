//! Every type that Rust and WGSL share. Field names, offsets and sizes are compared with the shaders by
//! `tests/layout.rs`.

use bytemuck::{Pod, Zeroable};

/// A projected and shaded voxel.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Splat {
    /// Pixel coordinate, right.
    pub x_px: f32,
    /// Pixel coordinate, down.
    pub y_px: f32,
    /// Sheet depth.
    pub depth: f32,
    /// Depth from the eye; 1 without one.
    pub from_eye: f32,
    /// `C.rg·m`, two f16.
    pub rg: u32,
    /// `C.b·m` and `m`, two f16.
    pub ba: u32,
}

/// What is constant over a frame.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Frame {
    /// Rows that map (i, j, k, 1) to pixels right of the image's middle and below it, both times the fourth; to sheet depth; and to
    /// the depth from the eye, 1 without one.
    pub screen_from_voxel: [[f32; 4]; 4],
    /// With an eye, the warped grid's directions right (`u/ar`), down (`-v/ar`) and ahead (`w/ar`) of it; w unused.
    pub right: [f32; 4],
    /// See `right`.
    pub down: [f32; 4],
    /// See `right`.
    pub ahead: [f32; 4],
    /// Grid aspect; w unused.
    pub aspect: [f32; 4],
    /// Columns of the 2×2 map footprint → pixels.
    pub pixels_from_footprint: [f32; 4],
    /// Columns of its inverse.
    pub footprint_from_pixels: [f32; 4],
    /// Unit vector to the light; w is 1 with shading, 0 without.
    pub light: [f32; 4],
    /// `normalize(light + to eye)`, 0 where they cancel.
    pub half_vector: [f32; 4],
    /// Ambient, diffuse, specular, shininess.
    pub shading: [f32; 4],
    /// Premultiplied background.
    pub background: [f32; 4],
    /// `½/ar`: what half the difference of two neighbours but one is multiplied by; and the least |g| with a direction, value per
    /// world unit.
    pub gradient: [f32; 4],
    /// Volume dimensions; w unused.
    pub dims: [u32; 4],
    /// Ends of the colour, opacity and gradient opacity ramps in the control points, and where there the table of labels starts.
    pub ramps: [u32; 4],
    /// Image width and height, pixels.
    pub size: [u32; 2],
    /// The low-pass amplitude over λ: what a splat's amounts are multiplied by.
    pub amplitude: f32,
    /// Kernel radius, grid units.
    pub radius: f32,
    /// Radius beyond which the kernel is negligible.
    pub support: f32,
    /// Exponent of the kernel.
    pub falloff: f32,
    /// Slab width in sheet depth.
    pub slab_width: f32,
    /// How far a kernel reaches at most, in sheet depth.
    pub reach: f32,
    /// Grid units of a kernel to one of sheet depth; 0 where every voxel has its own.
    pub kernel_per_depth: f32,
    /// Width of the stored sections, grid units.
    pub section_width: f32,
    /// Depth of the near plane; 0 without an eye.
    pub near: f32,
    /// Size of a pixel at depth 1 from the eye, `unit`s; without one of every pixel.
    pub pixel_per_depth: f32,
    /// Opacity from which a pixel counts as opaque; of surfaces 1.
    pub opacity_threshold: f32,
    /// 0 linear, 1 exponential, 2 xray, 3 maximum, 4 minimum, 5 average, 6 surface.
    pub compositing: u32,
    /// 0 front to back, 1 back to front.
    pub order: u32,
    /// 1 with early splat elimination, 0 without.
    pub culling: u32,
    /// 1 to composite only tiles that received splats, 0 to composite all.
    pub tiles: u32,
    /// Applied twice it turns value per `unit` into value per world unit: the root of one over `unit`, which itself may leave the
    /// range of `f32`.
    pub per_unit: f32,
    /// 1 if the light is at the eye, 0 if it is elsewhere.
    pub headlight: u32,
    /// Last entry of the table of labels, which is that of all greater labels, too.
    pub last_label: u32,
    /// What is added to the texels of values that are whole numbers.
    pub value_offset: f32,
    /// 1 if they are, 0 if texels are the values' bits.
    pub whole_values: u32,
    /// Unused.
    pub padding_0: u32,
    /// Unused.
    pub padding_1: u32,
}

/// One sheet group and one list's bricks that may reach into it.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SheetGroup {
    /// Half the screen box around its footprints, pixels.
    pub half_box: [f32; 2],
    /// The occlusion buffer's box filter reads a pixel and so many to the right of it and below.
    pub box_filter: [u32; 2],
    /// 1 with early splat elimination, 0 without.
    pub culling: u32,
    /// Sheet depth of the group's near plane.
    pub near: f32,
    /// First of its bricks in the bucket order.
    pub first_brick: u32,
    /// Number of its bricks.
    pub brick_count: u32,
    /// The group's number in the frame.
    pub index: u32,
    /// The same, but for groups that the frame leaves out counted, too, from the nearest on; the first is 1.
    pub number: u32,
}

/// What clip planes and a host's surfaces leave of rays, and the volume's box. A pixel's ray is found by its place (x right of the image's middle, y below it,
/// pixels, and 1), and on it a point by its depth along w, `unit`s from the eye, orthographic from the camera's centre.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Cut {
    /// The product with the place is the sheet depth at depth 0.
    pub sheet_at: [f32; 4],
    /// The product with the place is the sheet depth per depth.
    pub sheet_along: [f32; 4],
    /// The product with (x, y, the host's depth, 1), over that of [`Self::surface_w`], is the depth of a surface.
    pub surface_depth: [f32; 4],
    /// See there.
    pub surface_w: [f32; 4],
    /// Two for each plane, whose products with the place are the distance from it at depth 0 and per depth.
    pub planes: [[f32; 4]; 24],
    /// For each axis of the grid what the product with the place is where the ray is at depth 0: grid steps from the volume's centre.
    pub box_at: [[f32; 4]; 3],
    /// The same per depth.
    pub box_along: [[f32; 4]; 3],
    /// Half the extent of a [`RayBox`](crate::geometry::means::RayBox), grid steps, and its nearest depth.
    pub box_half: [f32; 4],
    /// The texel of the host's depth that is the image's first.
    pub surface_origin: [u32; 2],
    /// The host's depth where there is no surface.
    pub no_surface: f32,
    /// The opacity whose depth is asked for.
    pub first_hit: f32,
    /// World units of a `unit`.
    pub unit: f32,
    /// The depth where that opacity is not reached.
    pub none: f32,
    /// Number of planes.
    pub plane_count: u32,
    /// 1 with surfaces, 0 without.
    pub has_surfaces: u32,
}

/// How kernels lie on slab planes, and what values are splatted as (SPEC §9): [`PlaneGeometry`](crate::after::plane_geometry::PlaneGeometry) and
/// [`Normalization`](crate::after::normalization::Normalization).
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Planes {
    /// Unit vectors in the grid: two within planes, and the planes' normal; w unused.
    pub axes: [[f32; 4]; 3],
    /// What a grid unit along the normal moves a voxel right and down, pixels times the depth from the eye, and away from the eye; and
    /// the grid units along the normal that sheet depth 1 is.
    pub step: [f32; 4],
    /// The pixel offset of length 1 that the first axis belongs to.
    pub screen_axis: [f32; 2],
    /// Grid units that a pixel is along the first two axes; with an eye at depth 1 from it.
    pub per_pixel: [f32; 2],
    /// Sheet depth of plane 0, with an eye also the eye's.
    pub origin: f32,
    /// What is added to texels of values, or to values whose bits texels are, before they are scaled.
    pub value_bias: f32,
    /// Numbers to a value.
    pub value_scale: f32,
    /// Values to a number.
    pub per_number: f32,
}

/// A voxel on its way to slab planes, as large as a [`Splat`].
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FieldVoxel {
    /// Pixels right of the image's middle, times the depth from the eye.
    pub x: f32,
    /// Pixels below it, the same.
    pub y: f32,
    /// Sheet depth.
    pub depth: f32,
    /// Its coefficient, a number.
    pub number: f32,
    /// The values' central differences, numbers per `unit`, along x and y: two `snorm16`.
    pub gradient_xy: u32,
    /// Along z, the same, and 256 more than the exponent that the three are scaled by.
    pub gradient_z: u32,
}

/// 4×4×4 places for voxels, x fastest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Brick {
    /// Which of the places hold a voxel that takes part, one bit each.
    pub present: [u32; 2],
    /// Least x of its voxels.
    pub x: u32,
    /// Least y.
    pub y: u32,
    /// Least z.
    pub z: u32,
    /// Greatest minus least x, y and z, in bytes 0, 1 and 2.
    pub extent: u32,
}

/// What a frame has found out about a brick: one bit per voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct BrickState {
    /// Hidden once, hidden for good.
    pub hidden: [u32; 2],
    /// Shaded already.
    pub shaded: [u32; 2],
}

/// A brick that the current sheet group visits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Visit {
    /// The voxels that are drawn.
    pub drawn: [u32; 2],
    /// Those of them that are drawn for the first time.
    pub fresh: [u32; 2],
    /// The brick.
    pub brick: u32,
    /// Unused.
    pub padding: u32,
}

/// Arguments of an indirect draw and an indirect dispatch of the same number of things.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Indirect {
    /// Indices per instance, instances, first index, base vertex, first instance: one quad per thing, [`QUADS`] quads per
    /// instance.
    pub draw: [u32; 5],
    /// Workgroups along x, y and z.
    pub dispatch: [u32; 3],
    /// The number of things.
    pub count: u32,
}

/// Dispatches of more than this many workgroups are folded into two dimensions.
pub const FOLD: u32 = 32768;

/// Quads drawn by one instance.
pub const QUADS: u16 = 16;

/// The start of a list of tiles, which goes on to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct TileList {
    /// How many there are.
    pub args: Indirect,
    /// The first of them.
    pub tiles: [u32; 1],
}

/// Counts of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Tally {
    /// Voxels shaded.
    pub voxels_shaded: u32,
    /// Voxel–sheet pairs drawn.
    pub sections_rasterized: u32,
    /// Quads drawn.
    pub quads: u32,
    /// Bricks tested.
    pub bricks_tested: u32,
    /// Bricks whose voxels were looked at.
    pub bricks_visited: u32,
    /// Unused.
    pub padding_0: u32,
    /// Unused.
    pub padding_1: u32,
    /// Unused.
    pub padding_2: u32,
}

/// What the quad rasterizer's culling finds out. Tiles go on to the buffer's end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Culled {
    /// Counts of the frame.
    pub tally: Tally,
    /// The first of the tiles: 1 where the current sheet group draws.
    pub tiles: [u32; 1],
}

/// Rows of the image whose compositing buffer is one binding.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Band {
    /// First row, pixels from the top.
    pub first_row: u32,
    /// Number of rows.
    pub rows: u32,
}

/// What the tile rasterizer's threads share.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Gather {
    /// Coefficients of the polynomial in z that `H(0, 0, t) / t` of eq. 3 is.
    pub along: [[f32; 4]; 4],
    /// The same for t half a chord of the kernel's ball; accurate where the footprint is large.
    pub chord: [[f32; 4]; 2],
    /// `ρ² = x·dx² + y·dx·dy + z·dy²` of a pixel offset, and the exponent of the kernel per ρ², to base 2.
    pub metric: [f32; 4],
    /// z of `chord` is x times the half chord's square, plus y.
    pub chord_scale: [f32; 2],
    /// z of `along` is this times t², minus 1.
    pub along_scale: f32,
    /// Sheet depth of the nearest group's near plane.
    pub near: f32,
    /// Bound of the depths' rounding errors.
    pub depth_error: f32,
    /// Sheet groups.
    pub groups: u32,
    /// Bricks of the volume.
    pub bricks: u32,
    /// This and the next three: see [`GatheredLayout`](super::gathered_layout::GatheredLayout), also for `hits`.
    pub drawn: u32,
    /// The first word of the bits of composited tiles.
    pub composited: u32,
    /// Of the parallelogram of Fig. 13: pixels that its sides move right on every row down.
    pub shear: f32,
    /// Half its width, pixels.
    pub half_width: f32,
    /// Voxels of less opacity are projected whole.
    pub whole_below: f32,
    /// From this opacity on kernels are projected whole.
    pub beta: f32,
    /// A whole kernel's integral through its centre, over what a footprint must add to a sheet's alpha.
    pub peak: f32,
    /// The first word of where subgroups go on.
    pub reached: u32,
    /// Passes through loops that a thread may take in one dispatch; see [`patch_bins`](crate::lists::patch_bins).
    pub most_passes: u32,
    /// Those of a group at most, bricks not counted.
    pub passes_per_group: u32,
    /// Those of a brick in a group at most.
    pub passes_per_brick: u32,
    /// Those to look up a voxel's control points in memory at most.
    pub search_passes: u32,
    /// The first word of first hits.
    pub hits: u32,
}

/// The patches that a dispatch draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct PatchRange {
    /// First row of pixels of the compositing buffer that is bound.
    pub first_row: u32,
    /// The first patch.
    pub first_patch: u32,
    /// The patch after the last.
    pub end_patch: u32,
}

/// The tile rasterizer's results; [`GatheredLayout`](super::gathered_layout::GatheredLayout) says where they lie among the words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Gathered {
    /// Counts of the frame.
    pub tally: Tally,
    /// The first of the words.
    pub words: [u32; 1],
}

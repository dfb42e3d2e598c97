//! Every type shared by Rust and WGSL. `tests/house/layout.rs` compares field names, offsets and sizes with the shaders.

use bytemuck::{Pod, Zeroable};

pub use crate::lists::brick::Brick;

/// A projected and shaded voxel.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Splat {
    /// The pixel coordinate to the right.
    pub x_px: f32,
    /// The pixel coordinate downwards.
    pub y_px: f32,
    /// Sheet depth.
    pub depth: f32,
    /// The depth from the eye; 1 without an eye.
    pub from_eye: f32,
    /// `C.rg·m` as two f16.
    pub rg: u32,
    /// `C.b·m` and `m` as two f16.
    pub ba: u32,
}

/// The constants of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Frame {
    /// Rows whose products with (i, j, k, 1) are the pixels right of the image's middle and below it, both multiplied by the fourth product; the
    /// sheet depth; and the depth from the eye (1 without an eye).
    pub screen_from_voxel: [[f32; 4]; 4],
    /// With an eye, the warped grid's directions to the right (`u/ar`), down (`-v/ar`) and ahead (`w/ar`); w is unused.
    pub right: [f32; 4],
    /// See `right`.
    pub down: [f32; 4],
    /// See `right`.
    pub ahead: [f32; 4],
    /// The grid aspect; w is unused.
    pub aspect: [f32; 4],
    /// The columns of the 2×2 map from footprint to pixels.
    pub pixels_from_footprint: [f32; 4],
    /// The columns of its inverse.
    pub footprint_from_pixels: [f32; 4],
    /// The unit vector to the light; w is 1 with shading, 0 without.
    pub light: [f32; 4],
    /// `normalize(light + to eye)`; 0 where they cancel.
    pub half_vector: [f32; 4],
    /// Ambient, diffuse, specular, shininess.
    pub shading: [f32; 4],
    /// The premultiplied background.
    pub background: [f32; 4],
    /// `½/ar`, the factor for the difference of the two neighbours along each axis; and in w the minimum |g| that has a direction, in value per
    /// world unit.
    pub gradient: [f32; 4],
    /// For the stack of occlusion's light sheets and then for that of shadow's three rows, whose products with voxel coordinates and 1 give where a point is
    /// looked up: in pixels right of the first one's centre and below it, and in planes from the stack's first one on.
    pub light_place: [[f32; 4]; 6],
    /// For each of the two stacks the amount, 0 if there is none, its first plane in the texture, and its last plane from there on; w is unused.
    pub light_stacks: [[f32; 4]; 2],
    /// The planes of cuts whose faces are not shaded (SPEC §3): three matrices, whose products with (i, j, k, 1) are a voxel's distances from four planes each,
    /// in extents of a cell along their normals. The last six planes are the crop box's faces; planes that are missing are far away.
    pub faces: [[f32; 4]; 12],
    /// The volume's dimensions; w is unused.
    pub dims: [u32; 4],
    /// The ends of the first drawn channel's colour, opacity and gradient opacity ramps in the control points; w is unused.
    pub ramps: [u32; 4],
    /// The image's width and height in pixels.
    pub size: [u32; 2],
    /// The factor for a splat's amounts: the low-pass amplitude divided by λ.
    pub amplitude: f32,
    /// The kernel's radius in grid units.
    pub radius: f32,
    /// The radius beyond which the kernel is negligible.
    pub support: f32,
    /// The kernel's exponent.
    pub falloff: f32,
    /// The slab width in sheet depth.
    pub slab_width: f32,
    /// The maximum reach of a kernel in sheet depth.
    pub reach: f32,
    /// Grid units of a kernel per unit of sheet depth; 0 where it differs between voxels.
    pub kernel_per_depth: f32,
    /// The width of the stored sections in grid units.
    pub section_width: f32,
    /// The depth of the near plane; 0 without an eye.
    pub near: f32,
    /// The size of a pixel at depth 1 from the eye in `unit`s; without an eye, of every pixel.
    pub pixel_per_depth: f32,
    /// The opacity from which a pixel counts as opaque; 1 for surfaces.
    pub opacity_threshold: f32,
    /// 0 linear, 1 exponential, 2 xray, 3 maximum, 4 minimum, 5 average, 6 surface.
    pub compositing: u32,
    /// 0 front to back, 1 back to front.
    pub order: u32,
    /// 1 with early splat elimination, 0 without.
    pub culling: u32,
    /// 1 to composite only tiles that received splats, 0 to composite all.
    pub tiles: u32,
    /// The root of one over `unit`. Applied twice, it converts value per `unit` to value per world unit; its square may leave the range of
    /// `f32`.
    pub per_unit: f32,
    /// 1 if the light is at the eye, 0 if it is elsewhere.
    pub headlight: u32,
    /// The number of the first channel that is drawn (SPEC §10).
    pub first_channel: u32,
    /// The number that is added to the texels of values that are whole numbers.
    pub value_offset: f32,
    /// 1 if values are whole numbers, 0 if texels are the values' bits.
    pub whole_values: u32,
    /// The start of the table of channels in the control points.
    pub channel_table: u32,
    /// The threshold of closing (SPEC §6); 0 where pixels are not closed.
    pub closing: f32,
}

/// One sheet group, with the bricks of one list that may reach into it.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SheetGroup {
    /// Half the screen box in pixels around its footprints.
    pub half_box: [f32; 2],
    /// The size of the occlusion buffer's box filter: it reads a pixel and this many to the right of it and below.
    pub box_filter: [u32; 2],
    /// 1 with early splat elimination, 0 without.
    pub culling: u32,
    /// The sheet depth of the group's near plane.
    pub near: f32,
    /// The first of its bricks in bucket order.
    pub first_brick: u32,
    /// The number of its bricks.
    pub brick_count: u32,
    /// The group's index in the frame.
    pub index: u32,
    /// The group's number, from 1 for the nearest, also counting groups that the frame leaves out.
    pub number: u32,
}

/// The cuts of rays by clip planes and a host's surfaces, and the volume's box. A pixel's ray is identified by the pixel's position (x right of
/// the image's middle, y below it, in pixels, and 1), and a point on it by its depth along w in `unit`s, from the eye or, orthographic,
/// from the camera's centre.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Cut {
    /// The row whose product with the position is the sheet depth at depth 0.
    pub sheet_at: [f32; 4],
    /// The row whose product with the position is the change of sheet depth per unit of depth.
    pub sheet_along: [f32; 4],
    /// The depth of a surface is the product of this row with (x, y, the host's depth, 1) divided by that of [`Self::surface_w`].
    pub surface_depth: [f32; 4],
    /// The row for the divisor of [`Self::surface_depth`].
    pub surface_w: [f32; 4],
    /// Two rows for each plane, whose products with the position are the distance from the plane at depth 0 and its change per unit of depth.
    pub planes: [[f32; 4]; 24],
    /// For each axis of the grid the row whose product with the position is the ray's coordinate at depth 0, in grid steps from the grid's centre, and then the
    /// coordinate there of the centre of the [`RayBox`](crate::geometry::means::RayBox).
    pub box_at: [[f32; 4]; 3],
    /// The same for its change per unit of depth.
    pub box_along: [[f32; 4]; 3],
    /// Half the size of a [`RayBox`](crate::geometry::means::RayBox) in grid steps, and its minimum depth.
    pub box_half: [f32; 4],
    /// The texel of the host's depth texture at the image's first pixel.
    pub surface_origin: [u32; 2],
    /// The host's depth where there is no surface.
    pub no_surface: f32,
    /// The opacity whose depth is requested.
    pub first_hit: f32,
    /// The length of a `unit` in world units.
    pub unit: f32,
    /// The depth where that opacity is not reached.
    pub none: f32,
    /// The number of planes.
    pub plane_count: u32,
    /// 1 with surfaces, 0 without.
    pub has_surfaces: u32,
    /// The pixels that are drawn (SPEC §11), to the right of and below the first two numbers, to the left of and above the others.
    pub region: [f32; 4],
    /// The sheet depths between which slabs are composited; 1 where cut faces are not shaded, or else 0; w is unused.
    pub slabs: [f32; 4],
}

/// The position of kernels on slab planes, and the scale of splatted numbers (SPEC §9): a `PlaneGeometry` and
/// a [`Normalization`](crate::after::normalization::Normalization).
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FieldPlanes {
    /// Unit vectors in the grid: two within planes, and the planes' normal; w unused.
    pub axes: [[f32; 4]; 3],
    /// The change of a voxel's position for one grid unit along the normal: right and down in pixels times the depth from the eye, and away
    /// from the eye. Then the number of grid units along the normal for a sheet depth of 1.
    pub step: [f32; 4],
    /// The pixel offset of length 1 whose image in the plane is along the first axis.
    pub screen_axis: [f32; 2],
    /// The length of a pixel along the first two axes in grid units; with an eye, at depth 1 from it.
    pub per_pixel: [f32; 2],
    /// The sheet depth of plane 0, which with an eye is the eye's.
    pub origin: f32,
    /// The term that is added to a value, or to the integer stored for it, before scaling.
    pub value_bias: f32,
    /// The factor from values to numbers.
    pub value_scale: f32,
    /// The factor from numbers to values.
    pub per_number: f32,
    /// Where `Σ (c - f)·g·δ / N` is shorter, it is rounding errors, and the kernel's gradient is 0.
    pub min_moment: f32,
    /// The number of the channel whose numbers these are, among those that share sheets (SPEC §10).
    pub channel: u32,
    /// Its number among the channels whose colours of voxels' own are stored, from 1; 0 if it has none.
    pub colors: u32,
    /// Unused.
    pub padding_0: f32,
}

/// A voxel that is drawn onto slab planes, as large as a [`Splat`].
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FieldVoxel {
    /// The offset to the right of the image's middle in pixels, times the depth from the eye.
    pub x: f32,
    /// The offset below the image's middle, likewise.
    pub y: f32,
    /// Sheet depth.
    pub depth: f32,
    /// The coefficient as a number.
    pub number: f32,
    /// The values' central differences, numbers per `unit`, along x and y: two `snorm16`.
    pub gradient_xy: u32,
    /// Along z, likewise; then 256 plus the exponent of the power of 2 by which all three are scaled.
    pub gradient_z: u32,
}

/// The state of a brick within a frame, with one bit per voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct BrickState {
    /// Voxels that are hidden, and stay so.
    pub hidden: [u32; 2],
    /// Voxels that are shaded.
    pub shaded: [u32; 2],
}

/// A brick that the current sheet group visits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Visit {
    /// The voxels that are drawn.
    pub drawn: [u32; 2],
    /// The voxels that are drawn for the first time.
    pub fresh: [u32; 2],
    /// The brick.
    pub brick: u32,
    /// Unused.
    pub padding: u32,
}

/// Arguments for an indirect draw and an indirect dispatch over the same number of items.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Indirect {
    /// Indices per instance, instances, first index, base vertex, first instance: one quad per item, [`QUADS`] quads per instance.
    pub draw: [u32; 5],
    /// Workgroups along x, y and z.
    pub dispatch: [u32; 3],
    /// The number of items.
    pub count: u32,
}

/// Dispatches of more than this many workgroups are folded into two dimensions.
pub const FOLD: u32 = 32768;

/// The number of quads drawn by one instance.
pub const QUADS: u16 = 16;

/// The start of a list of tiles, which continues to the buffer's end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct TileList {
    /// The number of tiles.
    pub args: Indirect,
    /// The first of the tiles.
    pub tiles: [u32; 1],
}

/// The counts of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Tally {
    /// The number of voxels shaded.
    pub voxels_shaded: u32,
    /// The number of voxel–sheet pairs drawn.
    pub sections_rasterized: u32,
    /// The number of quads drawn.
    pub quads: u32,
    /// The number of bricks tested.
    pub bricks_tested: u32,
    /// The number of bricks whose voxels were visited.
    pub bricks_visited: u32,
    /// Unused.
    pub padding_0: u32,
    /// Unused.
    pub padding_1: u32,
    /// Unused.
    pub padding_2: u32,
}

/// The results of the quad rasterizer's culling. The tiles continue to the buffer's end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Culled {
    /// The counts of the frame.
    pub tally: Tally,
    /// The first of the tiles: 1 where the current sheet group draws.
    pub tiles: [u32; 1],
}

/// The rows of the image whose compositing buffer is one binding.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Band {
    /// The first row, counted in pixels from the top.
    pub first_row: u32,
    /// The number of rows.
    pub rows: u32,
}

/// The constants of the tile rasterizer.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Gather {
    /// The coefficients of the polynomial in z for `H(0, 0, t) / t` of eq. 3.
    pub along: [[f32; 4]; 4],
    /// The same for t half a chord of the kernel's ball; it is accurate where the footprint is large.
    pub chord: [[f32; 4]; 2],
    /// `ρ² = x·dx² + y·dx·dy + z·dy²` of a pixel offset; w is the kernel's exponent per ρ², to base 2.
    pub metric: [f32; 4],
    /// z of `chord` is x times the squared half chord, plus y.
    pub chord_scale: [f32; 2],
    /// z of `along` is this times t², minus 1.
    pub along_scale: f32,
    /// The sheet depth of the nearest group's near plane.
    pub near: f32,
    /// A bound on the rounding errors of depths.
    pub depth_error: f32,
    /// The number of sheet groups.
    pub groups: u32,
    /// The number of bricks in the volume.
    pub bricks: u32,
    /// For this and the next three, and `hits`, see [`GatheredLayout`](super::gathered_layout::GatheredLayout).
    pub drawn: u32,
    /// The first word of the bits of composited tiles.
    pub composited: u32,
    /// For the parallelogram of Fig. 13, the shift of its sides in pixels to the right per row down.
    pub shear: f32,
    /// Half its width in pixels.
    pub half_width: f32,
    /// Voxels with less opacity are projected whole.
    pub whole_below: f32,
    /// Behind this opacity kernels are projected whole.
    pub beta: f32,
    /// A whole kernel's integral through its centre, divided by the minimum that a footprint must add to a sheet's alpha.
    pub peak: f32,
    /// The first word of the groups at which subgroups continue.
    pub reached: u32,
    /// The maximum number of passes through loops per thread in one dispatch; see [`patch_bins`](crate::lists::patch_bins).
    pub most_passes: u32,
    /// The maximum number of passes for a group without its bricks.
    pub passes_per_group: u32,
    /// The maximum number of passes for a brick in a group.
    pub passes_per_brick: u32,
    /// The maximum number of passes to look up a voxel's control points in memory.
    pub search_passes: u32,
    /// The first word of first hits.
    pub hits: u32,
}

/// The patches that a dispatch draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct PatchRange {
    /// The first row of pixels of the bound compositing buffer.
    pub first_row: u32,
    /// The first patch.
    pub first_patch: u32,
    /// The patch after the last.
    pub end_patch: u32,
    /// The number of rows of patches from one that is drawn to the next, counted around the end: one that has no factor in common with the number of rows.
    pub row_step: u32,
}

/// The tile rasterizer's results; [`GatheredLayout`](super::gathered_layout::GatheredLayout) is their layout in the words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Gathered {
    /// The counts of the frame.
    pub tally: Tally,
    /// The first of the words.
    pub words: [u32; 1],
}

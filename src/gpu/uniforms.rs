//! A frame's plain data in the GPU's layout.

use std::ops::Range;

use glam::{DMat2, DVec2, DVec3, DVec4};

use super::gathered_layout::GatheredLayout;
use super::layout::{Cut, FieldPlanes, Frame, Gather, SheetGroup};
use super::ramps::Ramps;
use super::volume_texture::ValueFormat;
use crate::after::normalization::Normalization;
use crate::geometry::grid_warp::{self, FootprintMap};
use crate::geometry::means::RayBox;
use crate::geometry::plane_geometry::PlaneGeometry;
use crate::geometry::surfaces::SurfaceDepths;
use crate::geometry::view_geometry::{Rays, ViewGeometry};
use crate::kernel::Kernel;
use crate::lists::patch_bins::PatchBins;
use crate::lists::quad_plan::FramePlan;
use crate::scene::Scene;
use crate::scene::image_settings::premultiplied;
use crate::settings::clip::{CutCells, HalfSpace, MAX_PLANES};
use crate::settings::closing::Closing;
use crate::settings::light::Light;
use crate::settings::shading::{MAX_SHADING, MIN_GRADIENT, Shading};
use crate::settings::splatting::Splatting;
use crate::settings::window::Window;
use crate::volume::Grid;

/// The constants of a frame without light sheets, for a volume with this grid and format of values.
pub fn frame(
    view: &ViewGeometry,
    kernel: &Kernel,
    (grid, values): (&Grid, ValueFormat),
    ramps: &Ramps,
    scene: &Scene,
) -> Frame {
    let to_eye = -view.basis.w;
    let to_light = scene.shading.light.direction(&view.basis).unwrap_or(to_eye);
    let Shading { enabled, ambient, diffuse, specular, shininess, .. } = scene.shading;
    let matrix = |m: &DMat2| m.to_cols_array().map(|x| x as f32);
    let [color_end, opacity_end, gradient_opacity_end] = ramps.ends;
    let warped = grid_warp::m_view_warped(&view.basis, grid.aspect());
    let direction = |row: usize, sign: f64| (warped.row(row) * sign).extend(0.0).as_vec4().to_array();
    let eye = view.perspective.as_ref().map(|perspective| perspective.eye);
    let own_depths = view.perspective.is_some_and(|perspective| perspective.is_image_aligned);
    Frame {
        screen_from_voxel: view.screen_from_voxel.map(|row| row.as_vec4().to_array()),
        right: direction(0, 1.0),
        down: direction(1, -1.0),
        ahead: direction(2, 1.0),
        aspect: grid.aspect().extend(0.0).as_vec4().to_array(),
        pixels_from_footprint: matrix(&view.footprint.pixels_from_footprint),
        footprint_from_pixels: matrix(&view.footprint.footprint_from_pixels),
        light: to_light.extend(f64::from(u8::from(enabled))).as_vec4().to_array(),
        half_vector: half_vector(to_light, to_eye).extend(0.0).as_vec4().to_array(),
        shading: [ambient, diffuse, specular, shininess].map(|x| x.clamp(0.0, MAX_SHADING) as f32),
        background: premultiplied(scene.image.background),
        gradient: (0.5 / grid.aspect()).extend(MIN_GRADIENT).as_vec4().to_array(),
        light_place: [[0.0; 4]; 6],
        light_stacks: [[0.0; 4]; 2],
        faces: faces(scene.clip.unshaded_cells(grid).as_ref()),
        dims: grid.dims.extend(0).to_array(),
        ramps: [color_end, opacity_end, gradient_opacity_end, 0],
        size: view.size,
        amplitude: (view.footprint.amplitude / view.lambda) as f32,
        radius: kernel.radius() as f32,
        support: scene.splatting.drawn_radius(kernel) as f32,
        falloff: kernel.falloff() as f32,
        slab_width: view.slabs.width as f32,
        reach: view.reach as f32,
        kernel_per_depth: if own_depths { 0.0 } else { view.kernel_per_depth as f32 },
        section_width: view.section_width() as f32,
        near: eye.map_or(0.0, |eye| eye.near) as f32,
        pixel_per_depth: eye.map_or(view.pix, |eye| eye.pixel_per_depth) as f32,
        opacity_threshold: scene.splatting.opaque_from() as f32,
        compositing: scene.splatting.compositing as u32,
        order: scene.splatting.order as u32,
        culling: u32::from(scene.splatting.culling && scene.splatting.hides()),
        tiles: u32::from(
            scene.splatting.tiles && !scene.splatting.compositing.counts_empty(scene.splatting.classification),
        ),
        per_unit: grid.unit().recip().sqrt().min(f32::MAX.into()) as f32,
        headlight: u32::from(scene.shading.light == Light::Headlight),
        first_channel: ramps.first_channel,
        value_offset: match values {
            ValueFormat::Offset8(least) | ValueFormat::Offset16(least) => least,
            ValueFormat::Bits => 0.0,
        },
        whole_values: u32::from(values != ValueFormat::Bits),
        channel_table: ramps.channel_table,
        closing: Closing::of(&scene.splatting).map_or(0.0, Closing::threshold),
    }
}

/// [`Frame::faces`].
fn faces(cells: Option<&CutCells>) -> [[f32; 4]; 12] {
    let mut rows = [DVec4::W * FAR_AWAY; 12];
    if let Some(CutCells { planes, crop }) = cells {
        rows[..planes.len()].copy_from_slice(planes);
        rows[MAX_PLANES..][..crop.len()].copy_from_slice(crop);
    }
    let of_matrix = |matrix: usize, column: usize| [0, 1, 2, 3].map(|row| rows[4 * matrix + row][column] as f32);
    std::array::from_fn(|at| of_matrix(at / 4, at % 4))
}

/// The distance of planes that are missing.
const FAR_AWAY: f64 = 1e9;

/// The constants of the tile rasterizer. `results` is the layout of its results.
pub fn gather(
    view: &ViewGeometry,
    kernel: &Kernel,
    splatting: &Splatting,
    bins: &PatchBins,
    results: &GatheredLayout,
) -> Gather {
    let economies = splatting.experimental;
    // Only what lies behind a surface is culled.
    let has_beta = splatting.hides() && !splatting.compositing.has_surface() && economies.beta < 1.0;
    let whole = kernel.section(0.0, -kernel.radius(), kernel.radius());
    let support_squared = kernel.support().powi(2);
    let in_f32 = |numbers: [f64; 4]| numbers.map(|x| x as f32);
    let FootprintMap { footprint_from_pixels, .. } = view.footprint;
    let (x, y) = (footprint_from_pixels.x_axis, footprint_from_pixels.y_axis);
    let (shear, half_width) = view.footprint.parallelogram(splatting.drawn_radius(kernel));
    Gather {
        along: bytemuck::cast(kernel.cumulative_polynomial::<16>(1.0).map(|x| x as f32)),
        chord: bytemuck::cast(kernel.cumulative_polynomial::<8>(CHORD_SPAN).map(|x| x as f32)),
        metric: in_f32([x.dot(x), 2.0 * x.dot(y), y.dot(y), -kernel.falloff() * std::f64::consts::LOG2_E]),
        chord_scale: [(2.0 / (CHORD_SPAN * support_squared)) as f32, (1.0 - 2.0 / CHORD_SPAN) as f32],
        along_scale: (2.0 / support_squared) as f32,
        near: view.slabs.plane(bins.first_slab) as f32,
        // Relative to the depths of the volume's corners, of which the first voxel is one.
        depth_error: (2e-7 * (kernel.radius() + 2.0 * view.screen_from_voxel[2].w.abs())) as f32,
        groups: bins.groups,
        bricks: results.bricks,
        drawn: results.drawn,
        composited: results.composited,
        shear: shear as f32,
        half_width: half_width as f32,
        whole_below: economies.whole_below as f32,
        beta: if has_beta { economies.beta as f32 } else { f32::MAX },
        peak: (whole / economies.resolution).min(f32::MAX.into()) as f32,
        reached: results.reached,
        most_passes: bins.passes.most,
        passes_per_group: bins.passes.per_group,
        passes_per_brick: bins.passes.per_brick,
        search_passes: bins.passes.search,
        hits: results.hits,
    }
}

/// The cuts of rays by clip planes and a host's surfaces, the box that compositing by means uses, and what is drawn.
pub fn cut(
    view: &ViewGeometry,
    grid: &Grid,
    Scene { clip, splatting, .. }: &Scene,
    surfaces: Option<(SurfaceDepths, [u32; 2])>,
    first_hit: Option<f64>,
    Window { slabs, region }: &Window,
) -> Cut {
    let Rays { origin, along } = view.rays();
    let row = |normal: DVec3, [right, down, middle]: [DVec3; 3], offset: f64| {
        let middle = normal.dot(middle) + offset;
        DVec4::new(normal.dot(right), normal.dot(down), middle, 0.0).as_vec4().to_array()
    };
    let half_spaces = clip.half_spaces(grid);
    let mut planes = [[0.0; 4]; 24];
    for (rows, &HalfSpace { normal, offset }) in planes.chunks_exact_mut(2).zip(&half_spaces) {
        rows.copy_from_slice(&[row(normal, origin, offset), row(normal, along, 0.0)]);
    }
    let RayBox { center, half, nearest } = RayBox::new(view, grid, splatting);
    let axes = DVec3::AXES.map(|axis| axis / grid.aspect());
    let sheet_depth = view.sheet_depth_row(grid.aspect(), grid.center());
    let (normal, offset) = (sheet_depth.truncate(), sheet_depth.w);
    let in_f32 = |row: DVec4| row.as_vec4().to_array();
    Cut {
        sheet_at: row(normal, origin, offset),
        sheet_along: row(normal, along, 0.0),
        surface_depth: surfaces.map_or([0.0; 4], |(depths, _)| in_f32(depths.depth)),
        surface_w: surfaces.map_or([0.0; 4], |(depths, _)| in_f32(depths.w)),
        planes,
        box_at: [0, 1, 2].map(|at| {
            let [right, down, middle, _] = row(axes[at], origin, 0.0);
            [right, down, middle, center[at] as f32]
        }),
        box_along: axes.map(|axis| row(axis, along, 0.0)),
        box_half: in_f32(half.extend(nearest.max(f64::from(f32::MIN)))),
        surface_origin: surfaces.map_or([0; 2], |(_, origin)| origin),
        no_surface: surfaces.map_or(1.0, |(depths, _)| depths.none) as f32,
        first_hit: first_hit.unwrap_or(f64::INFINITY) as f32,
        unit: grid.unit() as f32,
        none: f32::INFINITY,
        plane_count: half_spaces.len() as u32,
        has_surfaces: surfaces.is_some().into(),
        region: [region.x, region.y, region.x + region.width, region.y + region.height].map(|edge| edge as f32),
        slabs: [
            view.slabs.plane(slabs.start) as f32,
            view.slabs.plane(slabs.end) as f32,
            u8::from(!clip.shade_faces).into(),
            0.0,
        ],
    }
}

/// How kernels lie on slab planes, and the numbers that values stored so are splatted as (SPEC §9).
pub fn planes(
    geometry: &PlaneGeometry,
    view: &ViewGeometry,
    values: ValueFormat,
    numbers: &Normalization,
) -> FieldPlanes {
    let offset = match values {
        ValueFormat::Offset8(least) | ValueFormat::Offset16(least) => f64::from(least),
        ValueFormat::Bits => 0.0,
    };
    FieldPlanes {
        axes: geometry.axes.map(|axis| axis.extend(0.0).as_vec4().to_array()),
        step: geometry.step.extend(geometry.per_depth).as_vec4().to_array(),
        screen_axis: geometry.screen_axis.as_vec2().to_array(),
        per_pixel: geometry.per_pixel.as_vec2().to_array(),
        origin: view.slabs.origin as f32,
        value_bias: (offset - numbers.base) as f32,
        value_scale: numbers.scale as f32,
        per_number: numbers.scale.recip() as f32,
        min_moment: numbers.min_moment(view.radius),
        channel: 0,
        colors: 0,
        padding_0: 0.0,
    }
}

/// The fraction of the kernel's ball, from the middle out, for which the polynomial for chords is fitted: where chords are long, they cut
/// small sections. Farther out they cut only large ones, and the Gaussian is small; errors stay below 5e-6 of a whole footprint's peak.
const CHORD_SPAN: f64 = 0.45;

/// One [`SheetGroup`] every `stride` bytes: group after group, and for every group list after list.
pub fn groups(plan: &FramePlan, kernel: &Kernel, splatting: &Splatting, stride: usize) -> Vec<u8> {
    groups_of(plan, stride, |planes| group(&plan.view, kernel, splatting, planes))
}

/// The same where groups are single planes (SPEC §9).
pub fn plane_groups(plan: &FramePlan, geometry: &PlaneGeometry, splatting: &Splatting, stride: usize) -> Vec<u8> {
    let half_box = |plane| geometry.half_box_px(plane, plan.view.size);
    groups_of(plan, stride, |planes| group_of(half_box(planes.start), splatting, planes.start))
}

fn groups_of(plan: &FramePlan, stride: usize, of: impl Fn(Range<f64>) -> SheetGroup) -> Vec<u8> {
    let mut bytes = Vec::new();
    let first_slab = plan.groups.iter().map(|group| group.first_slab).min().unwrap_or(0);
    for (index, group) in (0..).zip(&plan.groups) {
        let number = (group.first_slab - first_slab) as u32 / plan.sheets + 1;
        let uniform = SheetGroup { number, ..of(group.planes.clone()) };
        for bricks in &group.bricks {
            let count = bricks.end - bricks.start;
            let uniform = SheetGroup { first_brick: bricks.start, brick_count: count, index, ..uniform };
            bytes.extend_from_slice(bytemuck::bytes_of(&uniform));
            bytes.resize(bytes.len().next_multiple_of(stride), 0);
        }
    }
    bytes.resize(bytes.len().max(stride), 0);
    bytes
}

/// The group of sheets between two planes of sheet depth, without bricks.
pub fn group(view: &ViewGeometry, kernel: &Kernel, splatting: &Splatting, planes: Range<f64>) -> SheetGroup {
    group_of(view.half_box(kernel.support(), planes.clone()), splatting, planes.start)
}

/// A group from `near` on whose footprints' boxes have this half, pixels.
fn group_of(half_box: DVec2, splatting: &Splatting, near: f64) -> SheetGroup {
    SheetGroup {
        half_box: in_f32_pixels(half_box),
        // A footprint's box contains this many pixel centres, plus or minus one.
        box_filter: ((2.0 * half_box.min(DVec2::splat(MAX_HALF_BOX))).floor() - 1.0).as_uvec2().to_array(),
        culling: u32::from(splatting.culling && splatting.hides() && half_box.max_element() <= MAX_HALF_BOX),
        near: near as f32,
        first_brick: 0,
        brick_count: 0,
        index: 0,
        number: 1,
    }
}

/// Half a box in pixels as f32. An infinite one becomes a number larger than in any orthographic view, whose pixels measure at least 1e-25
/// `unit`s.
pub fn in_f32_pixels(half_box: DVec2) -> [f32; 2] {
    half_box.min(DVec2::splat(1e30)).as_vec2().to_array()
}

/// Half the largest box that is tested, in pixels. Few larger footprints fit the screen, and they are hardly ever hidden.
const MAX_HALF_BOX: f64 = 256.0;

/// `hv = normalize(l + c)`; 0 where they cancel (SPEC §3).
fn half_vector(to_light: DVec3, to_eye: DVec3) -> DVec3 {
    let sum = to_light + to_eye;
    // Opposite unit vectors add up to rounding noise, not to 0.
    if sum.length() < 1e-12 { DVec3::ZERO } else { sum.normalize() }
}

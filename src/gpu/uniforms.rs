//! A frame's plain data in the GPU's layout.

use std::ops::{Add, Mul, Range};

use glam::{DMat2, DVec2, DVec3, DVec4};

use super::gathered_layout::GatheredLayout;
use super::layout::{Cut, FieldPlanes, Frame, Gather, SheetGroup};
use super::volume_texture::ValueFormat;
use crate::after::normalization::Normalization;
use crate::after::slab_integral;
use crate::error::setting::scaled;
use crate::geometry::grid_warp::{self, FootprintMap};
use crate::geometry::means::RayBox;
use crate::geometry::plane_geometry::PlaneGeometry;
use crate::geometry::surfaces::SurfaceDepths;
use crate::geometry::view_geometry::{Rays, ViewGeometry};
use crate::kernel::Kernel;
use crate::lists::iso_range::{ValueSet, of_ordinal, ordinal};
use crate::lists::patch_bins::PatchBins;
use crate::lists::quad_plan::FramePlan;
use crate::scene::Scene;
use crate::settings::clip::HalfSpace;
use crate::settings::shading::{Light, MIN_GRADIENT, Shading};
use crate::settings::splatting::{Classification, Compositing, Order, Splatting};
use crate::settings::transfer_function::{LabelTables, Ramp, Tables, TransferFunction};
use crate::settings::window::Window;
use crate::volume::Grid;

/// The cap of ambient, diffuse, specular and shininess, beyond which images no longer change. It avoids infinities in `f32`.
const MAX_SHADING: f64 = 1e30;

/// The constants of a frame, for a volume with this grid and format of values.
pub fn frame(
    view: &ViewGeometry,
    kernel: &Kernel,
    (grid, values): (&Grid, ValueFormat),
    ramps: &Ramps,
    scene: &Scene,
) -> Frame {
    let to_eye = -view.basis.w;
    let to_light = match scene.shading.light {
        Light::Headlight => to_eye,
        Light::Direction(direction) => scaled(direction).normalize(),
    };
    let Shading { enabled, ambient, diffuse, specular, shininess, .. } = scene.shading;
    let [r, g, b, a] = scene.image.background;
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
        background: DVec4::new(r * a, g * a, b * a, a).as_vec4().to_array(),
        gradient: (0.5 / grid.aspect()).extend(MIN_GRADIENT).as_vec4().to_array(),
        dims: grid.dims.extend(0).to_array(),
        ramps: [color_end, opacity_end, gradient_opacity_end, ramps.label_table.start],
        size: view.size,
        amplitude: (view.footprint.amplitude / view.lambda) as f32,
        radius: kernel.radius() as f32,
        support: kernel.support() as f32,
        falloff: kernel.falloff() as f32,
        slab_width: view.slabs.width as f32,
        reach: view.reach as f32,
        kernel_per_depth: if own_depths { 0.0 } else { view.kernel_per_depth as f32 },
        section_width: view.section_width() as f32,
        near: eye.map_or(0.0, |eye| eye.near) as f32,
        pixel_per_depth: eye.map_or(view.pix, |eye| eye.pixel_per_depth) as f32,
        opacity_threshold: opacity_threshold(&scene.splatting) as f32,
        compositing: scene.splatting.compositing as u32,
        order: scene.splatting.order as u32,
        culling: u32::from(scene.splatting.culling && hides(&scene.splatting)),
        tiles: u32::from(scene.splatting.tiles && !counts_empty_tiles(&scene.splatting)),
        per_unit: grid.unit().recip().sqrt().min(f32::MAX.into()) as f32,
        headlight: u32::from(scene.shading.light == Light::Headlight),
        last_label: ramps.label_table.len().saturating_sub(1) as u32,
        value_offset: match values {
            ValueFormat::Offset8(least) | ValueFormat::Offset16(least) => least,
            ValueFormat::Bits => 0.0,
        },
        whole_values: u32::from(values != ValueFormat::Bits),
        channel_table: ramps.channel_table,
        padding_1: 0,
    }
}

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
    let has_beta = hides(splatting) && splatting.compositing != Compositing::Surface && economies.beta < 1.0;
    let whole = kernel.section(0.0, -kernel.radius(), kernel.radius());
    let support_squared = kernel.support().powi(2);
    let in_f32 = |numbers: [f64; 4]| numbers.map(|x| x as f32);
    let FootprintMap { footprint_from_pixels, .. } = view.footprint;
    let (x, y) = (footprint_from_pixels.x_axis, footprint_from_pixels.y_axis);
    let (shear, half_width) = view.footprint.parallelogram(kernel.support());
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
    let RayBox { half, nearest } = RayBox::new(view, grid, splatting);
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
        box_at: axes.map(|axis| row(axis, origin, 0.0)),
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
        slabs: [view.slabs.plane(slabs.start) as f32, view.slabs.plane(slabs.end) as f32, 0.0, 0.0],
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
        min_moment: min_moment(view.radius, numbers.range),
        padding_0: 0.0,
        padding_1: 0.0,
        padding_2: 0.0,
    }
}

/// The rounding error of `Σ c·g·δ / N - f·Σ g·δ / N`, whose terms are added one by one: where all values are equal it is no longer, and a direction
/// made of it would be noise.
fn min_moment(radius: f64, range: [f32; 2]) -> f32 {
    // About as many units in the last place as a kernel of the default radius reaches voxels.
    const UNITS: f32 = 32.0;
    UNITS * f32::EPSILON * radius as f32 * range[0].abs().max(range[1].abs())
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
        culling: u32::from(splatting.culling && hides(splatting) && half_box.max_element() <= MAX_HALF_BOX),
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

/// Whether tiles without splats count: before splatting, empty sheets are minima.
fn counts_empty_tiles(splatting: &Splatting) -> bool {
    splatting.compositing == Compositing::Minimum && splatting.classification == Classification::Before
}

/// Whether what is drawn hides what comes later (SPEC §5): front to back, with a compositing that hides.
fn hides(splatting: &Splatting) -> bool {
    splatting.order == Order::FrontToBack && splatting.compositing.hides()
}

/// The opacity from which pixels count as opaque. While no surface has been reached, alpha is below one half; a surface itself is opaque.
fn opacity_threshold(splatting: &Splatting) -> f64 {
    if splatting.compositing == Compositing::Surface { 1.0 } else { splatting.opacity_threshold }
}

/// `hv = normalize(l + c)`; 0 where they cancel (SPEC §3).
fn half_vector(to_light: DVec3, to_eye: DVec3) -> DVec3 {
    let sum = to_light + to_eye;
    // Opposite unit vectors add up to rounding noise, not to 0.
    if sum.length() < 1e-12 { DVec3::ZERO } else { sum.normalize() }
}

/// A transfer function's control points, for the stages that shade.
#[derive(Clone, Debug, PartialEq)]
pub struct Ramps {
    /// The value, then rgb or (ordinate, 0, 0); colour, opacity and gradient opacity in turn, and after them the table of their integrals
    /// ([`slab_integral`]) if there is one: first the main ramps, then those of labels. The table of labels follows.
    pub points: Vec<[f32; 4]>,
    /// The end of each of the main ramps.
    pub ends: [u32; 3],
    /// The part of `points` that holds for every label the start of its ramps and the end of each, as numbers that are exact in `f32`. The last
    /// entry is the main ramps', and serves all greater labels. Empty if no label has its own ramps.
    pub label_table: Range<u32>,
    /// The start of the part of `points` that holds the same for every channel after the first (SPEC §10).
    pub channel_table: u32,
    /// The number of channels.
    pub channels: u32,
    /// The maximum number of control points in each ramp.
    lengths: [u32; 3],
}

impl Ramps {
    /// All ramps of a transfer function; a missing gradient opacity is 1 everywhere.
    pub fn new(transfer: &TransferFunction) -> Self {
        // A voxel that takes part in one channel may be invisible in another.
        let is_alone = transfer.further.is_empty();
        let matter = |tables: &LabelTables| if is_alone { tables.matter_to_shading() } else { tables.matter() };
        Self::with(transfer, matter, |_| Vec::new())
    }

    /// The same with tables of the ramps' integrals, for classification after splatting.
    pub fn with_integrals(transfer: &TransferFunction, compositing: Compositing, numbers: &Normalization) -> Self {
        Self::with(transfer, LabelTables::matter, |tables| slab_integral::table(tables, compositing, numbers))
    }

    fn with(
        transfer: &TransferFunction,
        matter: impl Fn(&LabelTables) -> bool,
        integrals: impl Fn(&Tables) -> Vec<[f32; 4]>,
    ) -> Self {
        let is_alone = transfer.further.is_empty();
        let append = |points: &mut Vec<[f32; 4]>, label| {
            let tables = transfer.tables(label);
            let bounds = append(points, &tables, is_alone);
            points.extend(integrals(&tables));
            bounds
        };
        let mut points = Vec::new();
        let main @ [_, ends @ ..] = append(&mut points, None);
        let mut all = vec![main];
        let own: Vec<u16> =
            (transfer.labels.iter()).filter(|(_, tables)| matter(tables)).map(|(&label, _)| label).collect();
        let mut label_table = 0..0;
        if let Some(&last) = own.last() {
            let mut table = vec![main; usize::from(last) + 2];
            for label in own {
                table[usize::from(label)] = append(&mut points, Some(label));
                all.push(table[usize::from(label)]);
            }
            label_table = points.len() as u32..(points.len() + table.len()) as u32;
            points.extend(table.into_iter().map(|numbers| numbers.map(|number| number as f32)));
        }
        let further: Vec<[u32; 4]> =
            transfer.further.iter().map(|transfer| self::append(&mut points, &transfer.tables(None), false)).collect();
        all.extend(&further);
        let (channel_table, channels) = (points.len() as u32, 1 + further.len() as u32);
        points.extend(further.into_iter().map(|numbers| numbers.map(|number| number as f32)));
        let lengths = [0, 1, 2].map(|ramp| all.iter().map(|ends| ends[ramp + 1] - ends[ramp]).max().unwrap_or(0));
        Self { points, ends, label_table, channel_table, channels, lengths }
    }

    /// The maximum number of control points in each ramp, over all labels and channels.
    pub fn lengths(&self) -> [u32; 3] {
        self.lengths
    }
}

/// Appends the control points of a label's ramps. Returns their start, and the end of each. Unless the channel is alone, the opacity is 0 at values
/// with which its voxels do not take part: they may be drawn for another channel.
fn append(points: &mut Vec<[f32; 4]>, tables: &Tables, is_alone: bool) -> [u32; 4] {
    let mut bounds = [points.len() as u32; 4];
    let scalar = |(at, y): (f64, f64)| DVec4::new(at, y, 0.0, 0.0);
    let color = in_f32(tables.color).into_iter().map(|(at, rgb)| DVec4::new(at, rgb.x, rgb.y, rgb.z)).collect();
    let opacity = if is_alone { in_f32(tables.opacity) } else { in_f32(&visible_opacity(tables)) };
    let opacity = opacity.into_iter().map(scalar).collect();
    let gradient_opacity = tables.gradient_opacity.map_or(vec![(0.0, 1.0)], in_f32).into_iter().map(scalar).collect();
    let ramps: [Vec<DVec4>; 3] = [color, opacity, gradient_opacity];
    for (end, ramp) in bounds[1..].iter_mut().zip(ramps) {
        points.extend(ramp.iter().map(|point| point.as_vec4().to_array()));
        *end = points.len() as u32;
    }
    bounds
}

/// The opacity of `f32` values, 0 at those outside the iso-ranges and where nothing is visible.
fn visible_opacity(tables: &Tables) -> Ramp<f64> {
    if tables.visible && tables.iso_ranges.is_none() {
        return tables.opacity.clone();
    }
    let ends = [f32::MIN, f32::MAX].map(ordinal);
    let mut points: Vec<(f64, f64)> = Vec::new();
    for range in ValueSet::of_tables(tables).ranges() {
        let [first, last] = [range.start, range.end - 1].map(|at| at.clamp(ends[0], ends[1]));
        let inner = tables
            .opacity
            .points()
            .iter()
            .filter(|point| f64::from(of_ordinal(first)) < point.0 && point.0 < f64::from(of_ordinal(last)));
        let value = |at: u32| f64::from(of_ordinal(at));
        let seen = |at: u32| (value(at), tables.opacity.at(value(at)));
        // Between neighbouring numbers there are no values.
        points.extend((first > ends[0]).then(|| (value(first - 1), 0.0)));
        points.push(seen(first));
        points.extend(inner);
        points.push(seen(last));
        points.extend((last < ends[1]).then(|| (value(last + 1), 0.0)));
    }
    // A range of one value, and one that begins right behind another's end, give points twice.
    points.dedup_by_key(|point| point.0);
    Ramp::new(points).unwrap_or_else(|_| Ramp::through(vec![(0.0, 0.0)]))
}

/// A ramp's control points, clipped to the range of `f32`, like values.
fn in_f32<T>(ramp: &Ramp<T>) -> Vec<(f64, T)>
where
    T: Copy + Add<Output = T> + Mul<f64, Output = T>,
{
    let limit = f64::from(f32::MAX);
    let given = ramp.points();
    let cut = |at: f64| Some((at, ramp.at(at)));
    let before = cut(-limit).filter(|_| given.iter().any(|point| point.0 <= -limit));
    let after = cut(limit).filter(|_| given.iter().any(|point| point.0 >= limit));
    let between = given.iter().copied().filter(|point| point.0.abs() < limit);
    before.into_iter().chain(between).chain(after).collect()
}

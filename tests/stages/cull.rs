//! `shaders/cull_bricks.wgsl`, `shaders/cull_voxels.wgsl` and `shaders/compact.wgsl` against a plain evaluation of their rules (§6): what a
//! sheet group draws, in which order, and the state of every brick afterwards. `shade.rs` tests the appearance of drawn voxels.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec2, DVec3, DVec4, UVec3};
use sheetsplat::headless::GpuHeadless;
use sheetsplat::internals::brick::{self, BRICK_VOXELS};
use sheetsplat::internals::gpu::brick_lists::BrickLists;
use sheetsplat::internals::gpu::layout::{self, Brick, BrickState, Frame, Indirect, SheetGroup, Tally};
use sheetsplat::internals::gpu::targets::Targets;
use sheetsplat::internals::gpu::uniforms::{self, Ramps};
use sheetsplat::internals::gpu::volume_texture::VolumeTexture;
use sheetsplat::internals::kernel::Kernel;
use sheetsplat::internals::pass::cull::{Cull, CullBuffers, CullList};
use sheetsplat::internals::quad_plan::{FramePlan, TILE, tile_grid};
use sheetsplat::internals::reference::{self, Geometry};
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Method, Order};
use sheetsplat::settings::{Ramp, TransferFunction};
use sheetsplat::volume::Grid;
use sheetsplat::wgpu::{self, BufferUsages, TextureFormat};

use crate::common::{F32, Random, SPACINGS, camera, gpu, random_eye, scene};
use crate::shade::place_error;
use crate::{compute, contents, indirect, init};

/// The stages with one list of bricks and the buffers that they read and write.
pub(crate) struct Culling<'a> {
    gpu: &'a GpuHeadless,
    stage: &'a Cull,
    pub(crate) view: ViewGeometry,
    pub(crate) frame: Frame,
    pub(crate) plan: FramePlan,
    /// The uniform of every group of the plan.
    groups: Vec<SheetGroup>,
    /// For every slot of every brick the voxel's index in the volume, or [`ABSENT`].
    pub(crate) indices: Vec<u32>,
    pub(crate) bricks: Vec<Brick>,
    pub(crate) list: CullList,
    targets: Targets,
    culled: wgpu::Buffer,
    stride: u32,
}

impl<'a> Culling<'a> {
    /// The stages for voxels in memory order, in a grid with these values and labels.
    pub(crate) fn new(
        gpu: &'a GpuHeadless,
        (stage, sheets): (&'a Cull, u32),
        (grid, values, labels): (&Grid, &[f32], Option<&[u16]>),
        voxels: &[u32],
        transfer: &TransferFunction,
        scene: &Scene,
    ) -> Self {
        let device = gpu.device();
        let size = [scene.image.width, scene.image.height];
        let view = ViewGeometry::new(grid, &scene.camera, &scene.splatting, size).unwrap();
        let lists = BrickLists::upload(device, grid, voxels);
        let bricks = lists.bricks().next().unwrap().to_vec();
        let plan = FramePlan::new([bricks.as_slice()], view, sheets, scene.splatting.order, 0.0..0.0);
        let [list] = &lists.lists[..] else { panic!("{} lists", lists.lists.len()) };
        let ramps = Ramps::new(transfer);
        let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
        let uploaded = VolumeTexture::upload(device, gpu.queue(), values).unwrap();
        let frame = uniforms::frame(&view, &kernel, (grid, uploaded.format), &ramps, scene);
        let targets = Targets::new(device, size, TextureFormat::Rgba32Float, sheets).unwrap();
        let stride = device.limits().min_uniform_buffer_offset_alignment;
        let group_bytes = uniforms::groups(&plan, &kernel, &scene.splatting, stride as usize);
        let groups = init(device, &group_bytes, BufferUsages::UNIFORM);
        let bytes = vec![0_u8; size_of::<Tally>() + targets.opaque_tiles.size() as usize];
        let culled = init(device, &bytes, BufferUsages::STORAGE);
        let labels = labels.map(|labels| VolumeTexture::upload_labels(device, gpu.queue(), labels).unwrap());
        let shared = CullBuffers {
            frame: &init(device, &[frame], BufferUsages::UNIFORM),
            groups: &groups,
            values: &uploaded.view,
            has_holes: values.iter().any(|value| value.is_nan()),
            labels: labels.as_ref().map(|labels| &labels.view),
            control_points: &init(device, &ramps.points, BufferUsages::STORAGE),
            occluded: &targets.occluded,
            culled: &culled,
            planes: None,
        };
        let order = init(device, &plan.orders[0], BufferUsages::STORAGE);
        let counts = |group: &sheetsplat::internals::quad_plan::GroupPlan| {
            let range = group.bricks[0].start as usize..group.bricks[0].end as usize;
            plan.orders[0][range]
                .iter()
                .map(|&at| brick::present(&bricks[at as usize]).count_ones())
                .collect::<Vec<_>>()
        };
        let most_bricks = plan.groups.iter().map(|group| counts(group).len()).max().unwrap();
        let most_voxels = plan.groups.iter().map(|group| counts(group).iter().sum()).max().unwrap();
        Self {
            list: stage.prepare(device, shared, list, &order, (most_bricks as u32, most_voxels), None).unwrap(),
            indices: bricks.iter().flat_map(|brick| indices(grid, brick)).collect(),
            gpu,
            stage,
            view,
            frame,
            groups: group_bytes.chunks(stride as usize).map(uniform).collect(),
            plan,
            bricks,
            targets,
            culled,
            stride,
        }
    }

    /// Runs the stages for a group of the plan.
    pub(crate) fn cull(&self, group: usize) {
        compute(self.gpu, |pass| self.stage.record(pass, &self.list, group as u32 * self.stride));
    }

    /// The state of each brick's voxels as bits: hidden, shaded.
    pub(crate) fn states(&self) -> Vec<(u64, u64)> {
        let bits = |words: [u32; 2]| u64::from(words[0]) | u64::from(words[1]) << 32;
        let states: Vec<BrickState> = contents(self.gpu, &self.list.states);
        states.iter().map(|state| (bits(state.hidden), bits(state.shaded))).collect()
    }

    pub(crate) fn splats(&self) -> Vec<layout::Splat> {
        contents(self.gpu, &self.list.splats)
    }
}

/// The uniform at the start of `bytes`.
fn uniform(bytes: &[u8]) -> SheetGroup {
    bytemuck::pod_read_unaligned(&bytes[..size_of::<SheetGroup>()])
}

/// A slot without a voxel.
const ABSENT: u32 = u32::MAX;

fn indices(grid: &Grid, brick: &Brick) -> [u32; BRICK_VOXELS as usize] {
    let mut indices = [ABSENT; BRICK_VOXELS as usize];
    for (slot, at) in brick::voxels(brick) {
        indices[slot as usize] = at.x + grid.dims.x * (at.y + grid.dims.y * at.z);
    }
    indices
}

/// An upper bound on the f32 errors of pixel coordinates and depths in these tests: sums of numbers below 600. Close to an eye pixel
/// coordinates are large, and so are their errors.
const EPSILON: f64 = 5e-4;

/// Decisions that f32 arithmetic makes like f64; those that it may make differently are noted.
struct Decisions {
    unsure: bool,
    /// The f32 error of pixel coordinates.
    pixels: f64,
}

impl Decisions {
    fn new(pixels: f64) -> Self {
        Self { unsure: false, pixels: pixels.max(EPSILON) }
    }

    fn at_least(&mut self, a: f64, b: f64, epsilon: f64) -> bool {
        self.unsure |= (a - b).abs() < epsilon;
        a >= b
    }

    /// `x` between 0 and `last`, rounded down.
    fn floor(&mut self, x: f64, last: f64, epsilon: f64) -> u32 {
        let [low, floor, high] = [x - epsilon, x, x + epsilon].map(|x| x.clamp(0.0, last).floor());
        self.unsure |= low != high;
        floor as u32
    }

    /// `x` between 0 and `last`, rounded up.
    fn ceil(&mut self, x: f64, last: f64) -> u32 {
        last as u32 - self.floor(last - x, last, self.pixels)
    }

    /// The first and last pixel from which the box filter covers the boxes of footprints with centres from `low` to `high`.
    fn filter(&mut self, size: [u32; 2], group: &SheetGroup, low: DVec2, high: DVec2) -> [[u32; 2]; 2] {
        // Pixel centres are at half-integers; the shader adds its slack.
        let margin = half_box(group) + 0.01;
        let (low, high) = ((low - margin - 0.5).to_array(), (high + margin - 0.5).to_array());
        let axes = [0, 1].map(|axis| {
            let last = f64::from(size[axis] - 1);
            let first = self.ceil(low[axis], last);
            [first, self.floor(high[axis] - f64::from(group.box_filter[axis]), last, self.pixels).max(first)]
        });
        [[axes[0][0], axes[1][0]], [axes[0][1], axes[1][1]]]
    }

    fn pixel(&mut self, center: DVec2, size: [u32; 2]) -> [u32; 2] {
        [0, 1].map(|axis| self.floor(center[axis], f64::from(size[axis] - 1), self.pixels))
    }
}

fn half_box(group: &SheetGroup) -> DVec2 {
    DVec2::from(group.half_box.map(f64::from))
}

/// An image's occlusion buffer, as a set of hidden boxes.
#[derive(Clone)]
struct Occluded {
    size: [u32; 2],
    bits: Vec<bool>,
}

impl Occluded {
    fn at(&self, [x, y]: [u32; 2]) -> bool {
        self.bits[(y * self.size[0] + x) as usize]
    }

    fn words(&self) -> Vec<u32> {
        let columns = tile_grid(self.size)[0];
        (0..self.size[1])
            .flat_map(|y| (0..columns).map(move |column| (column * TILE, y)))
            .map(|(left, y)| {
                let is_set = |i: &u32| left + i < self.size[0] && self.at([left + i, y]);
                (0..TILE).filter(is_set).fold(0, |word, i| word | 1 << i)
            })
            .collect()
    }

    fn new(size: [u32; 2], value: bool) -> Self {
        Self { size, bits: vec![value; (size[0] * size[1]) as usize] }
    }

    /// Rectangles of random sides.
    fn random(random: &mut Random, size: [u32; 2]) -> Self {
        let mut mask = Self::new(size, false);
        for _ in 0..3 {
            let low = size.map(|side| random.uniform(-10.0, f64::from(side)).max(0.0) as u32);
            let sides = size.map(|side| random.uniform(1.0, f64::from(side)) as u32);
            for y in low[1]..size[1].min(low[1] + sides[1]) {
                for x in low[0]..size[0].min(low[0] + sides[0]) {
                    mask.bits[(y * size[0] + x) as usize] = true;
                }
            }
        }
        mask
    }
}

/// The expected results, accumulated from the start of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
struct Expected {
    /// The list's voxels that the last group draws, in order.
    drawn: Vec<u32>,
    /// Hidden and shaded voxels by brick.
    states: Vec<(u64, u64)>,
    /// The numbers of voxels shaded, sections, quads, bricks tested and bricks visited.
    counts: [u32; 5],
    tiles: BTreeSet<u32>,
}

/// A frame's rules: those of §6, as in the shaders' comments.
struct Rules<'a> {
    grid: &'a Grid,
    frame: &'a Frame,
    view: &'a ViewGeometry,
    geometry: Geometry,
    kernel: Kernel,
    order_of_sheets: Order,
    sheets: u32,
    bricks: &'a [Brick],
    indices: &'a [u32],
    groups: &'a [SheetGroup],
    /// The list's bricks in bucket order.
    order: &'a [u32],
    /// Voxels, by index in the volume, that f32 arithmetic may treat differently.
    unsure: BTreeSet<u32>,
}

impl Rules<'_> {
    /// A voxel's pixel coordinates, sheet depth, and depth from the eye; a voxel nearer than the near plane is projected as if it were on it.
    fn project(&self, p: DVec3) -> DVec4 {
        let [x, y, depth, from_eye] =
            self.frame.screen_from_voxel.map(|row| DVec4::from(row.map(f64::from)).dot(p.extend(1.0)));
        let center = DVec2::new(x, y) / from_eye.max(self.frame.near.into()) + self.geometry.size / 2.0;
        center.extend(depth).extend(from_eye)
    }

    /// Whether any pixel of the image lies in the box around `low..high` widened by the footprint.
    fn is_on_screen(&self, decisions: &mut Decisions, group: &SheetGroup, low: DVec2, high: DVec2) -> bool {
        let (low, high) = (low - half_box(group), high + half_box(group));
        let size = self.frame.size.map(f64::from);
        // All four sides are tested, so that every uncertain one is noted.
        let sides = [(high.x, 0.5), (high.y, 0.5), (size[0] - 0.5, low.x), (size[1] - 0.5, low.y)]
            .map(|(a, b)| decisions.at_least(a, b, decisions.pixels));
        sides.into_iter().all(|side| side)
    }

    fn visits(
        &self,
        decisions: &mut Decisions,
        brick: &Brick,
        hidden: u64,
        group: &SheetGroup,
        occluded: &Occluded,
    ) -> bool {
        if brick::present(brick) & !hidden == 0 {
            return false;
        }
        let (middle, half) = brick::bounds(brick);
        let [_, _, depth, from_eye] = self.view.screen_from_voxel.map(|row| row.dot(middle.extend(1.0)));
        let [_, _, spread, thickness] = self.view.screen_from_voxel.map(|row| row.truncate().abs().dot(half));
        // The shader adds this slack.
        let reach = spread + f64::from(self.frame.reach) + 1e-3;
        let near = f64::from(group.near);
        let far = near + f64::from(self.sheets) * f64::from(self.frame.slab_width);
        let is_before = decisions.at_least(near, depth + reach, EPSILON);
        let is_behind = decisions.at_least(depth - reach, far, EPSILON);
        let is_clipped = decisions.at_least(self.frame.near.into(), from_eye + thickness, EPSILON);
        let Some(bounds) = self.view.bounds(middle, half) else { return false };
        let (low, high) = (bounds.low - 1e-3, bounds.high + 1e-3);
        if is_before || is_behind || is_clipped || !self.is_on_screen(decisions, group, low, high) {
            return false;
        }
        if group.culling == 0 {
            return true;
        }
        let all_occluded = |margin: f64| {
            let [first, last] = Decisions::new(0.0).filter(self.frame.size, group, low - margin, high + margin);
            (first[1]..=last[1]).all(|y| (first[0]..=last[0]).all(|x| occluded.at([x, y])))
        };
        decisions.unsure |= all_occluded(decisions.pixels) != all_occluded(-decisions.pixels);
        !all_occluded(0.0)
    }

    /// Adds what a group draws to the results expected so far.
    fn cull(&mut self, group: usize, occluded: &Occluded, so_far: &mut Expected) {
        so_far.drawn.clear();
        let group = &self.groups[group];
        for &at in &self.order[group.first_brick as usize..][..group.brick_count as usize] {
            let brick = self.bricks[at as usize];
            so_far.counts[3] += 1;
            let corner = UVec3::new(brick.x, brick.y, brick.z);
            let mut decisions = Decisions::new(self.pixel_error(corner.as_dvec3()));
            let visits = self.visits(&mut decisions, &brick, so_far.states[at as usize].0, group, occluded);
            if decisions.unsure {
                // The brick reaches the group only barely: its box, which has slack, does, but perhaps none of its voxels.
                self.unsure.extend(indices(self.grid, &brick).into_iter().filter(|&index| index != ABSENT));
            }
            if !visits {
                continue;
            }
            so_far.counts[4] += 1;
            let left = brick::present(&brick) & !so_far.states[at as usize].0;
            for slot in (0..BRICK_VOXELS).filter(|slot| left >> slot & 1 == 1) {
                let id = at * BRICK_VOXELS + slot;
                let voxel = self.grid.voxel_at(self.indices[id as usize]);
                let mut decisions = Decisions::new(self.pixel_error(voxel.as_dvec3()));
                self.cull_voxel(&mut decisions, (at, slot, id), voxel, group, occluded, so_far);
                if decisions.unsure {
                    self.unsure.insert(self.indices[id as usize]);
                }
            }
        }
        so_far.counts[2] += so_far.drawn.len() as u32;
    }

    /// The f32 error of a voxel's pixel coordinates, or of its surroundings; bounded by that at the near plane.
    fn pixel_error(&self, p: DVec3) -> f64 {
        let nearest = self.view.screen_from_voxel[3].dot(p.extend(1.0)).abs().max(self.frame.near.into());
        let [x, y] = [0, 1].map(|row| (self.view.screen_from_voxel[row] * p.extend(1.0)).abs().element_sum());
        if self.geometry.eye.is_some() { 16.0 * F32 * x.max(y) / nearest } else { 0.0 }
    }

    /// The number of a voxel's sections that the group draws, by the f64 evaluation: those with a footprint whose own box contains a pixel.
    fn sections(&self, decisions: &mut Decisions, voxel: UVec3, group: &SheetGroup) -> u32 {
        let Geometry { method, eye, .. } = self.geometry;
        if eye.is_some_and(|eye| !decisions.at_least(self.geometry.depth(voxel), eye.near, EPSILON)) {
            return 0;
        }
        let splat =
            |depth| reference::Splat { center: self.geometry.pixel(voxel), depth, amount: DVec4::ONE, alpha: 1.0 };
        let depth = self.geometry.depth(voxel);
        let first = ((f64::from(group.near) - self.view.slabs.origin) / self.view.slabs.width).round() as i32;
        let within = |depth: f64| {
            let sheets = match method {
                Method::ImageAligned => self.geometry.slabs(&splat(depth), self.kernel.radius()),
                _ => self.geometry.slice(voxel)..self.geometry.slice(voxel) + 1,
            };
            sheets.start.max(first)..sheets.end.min(first + self.sheets as i32)
        };
        decisions.unsure |= within(depth - EPSILON) != within(depth + EPSILON);
        let (half_group, epsilon) = (half_box(group), decisions.pixels);
        let is_on_screen = |k: &i32| {
            let Some(section) = self.geometry.section(&splat(depth), *k, &self.kernel) else { return false };
            let half_box = section.footprint.half_box(self.kernel.support());
            assert!(
                half_box.cmple(half_group * (1.0 + 4.0 * F32)).all(),
                "{voxel}: {half_box}, the group's {half_group}"
            );
            let inside = (section.center + half_box - 0.5).min(self.geometry.size - 0.5 - section.center + half_box);
            decisions.unsure |= inside.min_element().abs() < epsilon + 1e-4 * half_box.max_element();
            inside.min_element() >= 0.0
        };
        within(depth).filter(is_on_screen).count() as u32
    }

    fn cull_voxel(
        &self,
        decisions: &mut Decisions,
        (brick, slot, id): (u32, u32, u32),
        voxel: UVec3,
        group: &SheetGroup,
        occluded: &Occluded,
        so_far: &mut Expected,
    ) {
        let size = self.frame.size;
        let p = self.project(voxel.as_dvec3());
        let center = DVec2::new(p.x, p.y);
        let is_on_screen = self.is_on_screen(decisions, group, center, center);
        let [first, last] = decisions.filter(size, group, center, center);
        let corners = [first, [last[0], first[1]], [first[0], last[1]], last];
        let is_hidden = group.culling == 1 && corners.into_iter().all(|corner| occluded.at(corner));
        let state = &mut so_far.states[brick as usize];
        if !is_on_screen || is_hidden {
            // Back to front, where nothing is hidden, boxes may grow.
            state.0 |= u64::from(self.order_of_sheets == Order::FrontToBack) << slot;
            return;
        }
        let sections = self.sections(decisions, voxel, group);
        if sections == 0 {
            return;
        }
        so_far.drawn.push(id);
        so_far.counts[1] += sections;
        so_far.counts[0] += u32::from(state.1 >> slot & 1 == 0);
        state.1 |= 1 << slot;
        // Every tile with a pixel whose centre is in the footprint's box, plus at most one more row or column of tiles.
        let low = decisions.pixel(center - half_box(group) - 0.5, size).map(|pixel| pixel / TILE);
        let high = decisions.pixel(center + half_box(group), size).map(|pixel| pixel / TILE);
        let columns = tile_grid(size)[0];
        so_far.tiles.extend((low[1]..=high[1]).flat_map(|y| (low[0]..=high[0]).map(move |x| y * columns + x)));
    }
}

/// A grid, its voxels in memory order, and a view of them.
struct Case {
    grid: Grid,
    voxels: Vec<u32>,
    scene: Scene,
    sheets: u32,
}

/// Counts of events in a run, so that a test can require them.
#[derive(Debug, Default)]
struct Seen {
    most_bricks: u32,
    drawn: usize,
    /// Groups that visit nothing, and groups that visit some bricks of those they test.
    without_visits: usize,
    with_some: usize,
    /// Voxels that an earlier occlusion buffer hid and a later one would not.
    hidden_for_good: u32,
}

impl Case {
    fn transfer() -> TransferFunction {
        TransferFunction {
            color: Ramp::new(vec![(0.0, DVec3::ONE)]).unwrap(),
            opacity: Ramp::new(vec![(0.0, 0.5)]).unwrap(),
            gradient_opacity: None,
            iso_ranges: None,
            labels: BTreeMap::new(),
        }
    }

    /// Draws the groups of the plan in order, with the given occlusion buffers in turn, and checks all results.
    fn check(mut self, gpu: &GpuHeadless, stage: &Cull, masks: &[Occluded]) -> Seen {
        let transfer = Self::transfer();
        let values = vec![1.0; self.grid.dims.element_product() as usize];
        // Voxels whose decisions may differ in f32 are removed, which changes their bricks.
        for _ in 0..30 {
            let volume = (&self.grid, &values[..], None);
            let culling = Culling::new(gpu, (stage, self.sheets), volume, &self.voxels, &transfer, &self.scene);
            let (_, unsure) = self.expected(&culling, masks);
            if unsure.is_empty() {
                return self.compare(&culling, masks);
            }
            self.voxels.retain(|voxel| !unsure.contains(voxel));
        }
        panic!("no voxels are left that f32 arithmetic is sure about");
    }

    fn expected(&self, culling: &Culling<'_>, masks: &[Occluded]) -> (Vec<Expected>, BTreeSet<u32>) {
        let mut rules = Rules {
            grid: &self.grid,
            frame: &culling.frame,
            view: &culling.view,
            geometry: Geometry::new(&self.grid, &self.scene).unwrap(),
            kernel: Kernel::new(self.scene.splatting.radius, self.scene.splatting.falloff),
            order_of_sheets: self.scene.splatting.order,
            sheets: self.sheets,
            bricks: &culling.bricks,
            indices: &culling.indices,
            groups: &culling.groups,
            order: &culling.plan.orders[0],
            unsure: BTreeSet::new(),
        };
        let mut so_far = Expected { states: vec![(0, 0); culling.bricks.len()], ..Expected::default() };
        let steps = (0..culling.plan.groups.len())
            .map(|group| {
                rules.cull(group, &masks[group % masks.len()], &mut so_far);
                so_far.clone()
            })
            .collect();
        (steps, rules.unsure)
    }

    fn compare(&self, culling: &Culling<'_>, masks: &[Occluded]) -> Seen {
        let Culling { gpu, list, culled, targets, .. } = culling;
        let (steps, _) = self.expected(culling, masks);
        let mut seen = Seen::default();
        let mut visited_before = 0;
        for (group, expected) in steps.iter().enumerate() {
            let mask = &masks[group % masks.len()];
            let name = format!("group {group} of {}, {} sheets", steps.len(), self.sheets);
            gpu.queue().write_buffer(&targets.occluded, 0, bytemuck::cast_slice(&mask.words()));
            culling.cull(group);

            let args: Vec<Indirect> = contents(gpu, &list.draw_args);
            assert_eq!(args, [indirect(expected.drawn.len() as u32)], "{name}");
            let instances: Vec<u32> = contents(gpu, &list.instances);
            assert!(
                instances[..expected.drawn.len()] == expected.drawn,
                "{name}: which voxels are drawn, in which order"
            );
            let states = culling.states();
            assert!(states[..expected.states.len()] == expected.states, "{name}: what is known of the bricks");
            let culled: Vec<u32> = contents(gpu, culled);
            let (counts, tiles) = culled.split_at(size_of::<Tally>() / 4);
            assert_eq!(counts[..5], expected.counts, "{name}: shaded, sections, quads, tested, visited");
            assert_eq!(counts[5..], [0; 3], "{name}: padding");
            let flags: Vec<u32> = (0..tiles.len() as u32).map(|tile| expected.tiles.contains(&tile).into()).collect();
            assert_eq!(tiles, flags, "{name}: tiles");
            let splats = culling.splats();
            for &id in &expected.drawn {
                let voxel = self.grid.voxel_at(culling.indices[id as usize]);
                let record = splats[id as usize];
                let found = DVec3::new(record.x_px.into(), record.y_px.into(), record.depth.into());
                let wanted = culling.view.project(voxel);
                let error = place_error(&culling.view, voxel, wanted.truncate()).truncate();
                assert!((found - wanted).abs().cmple(error).all(), "{name}: {voxel} at {found}, not {wanted}");
            }

            let tested = culling.plan.groups[group].bricks[0].len() as u32;
            let visited = expected.counts[4] - visited_before;
            visited_before = expected.counts[4];
            seen.most_bricks = seen.most_bricks.max(tested);
            seen.drawn += expected.drawn.len();
            seen.without_visits += usize::from(visited == 0);
            seen.with_some += usize::from(visited > 0 && visited < tested);
            if mask.bits.iter().all(|bit| !bit) {
                seen.hidden_for_good += expected.states.iter().map(|state| state.0.count_ones()).sum::<u32>();
            }
        }
        seen
    }
}

/// Occlusion buffers that hide something, nothing (hidden voxels stay hidden), something else, everything, and nothing again.
fn masks(random: &mut Random, size: [u32; 2]) -> Vec<Occluded> {
    let [some, others] = [(); 2].map(|()| Occluded::random(random, size));
    vec![
        some,
        Occluded::new(size, false),
        others.clone(),
        others,
        Occluded::new(size, true),
        Occluded::new(size, false),
    ]
}

/// A dense volume with gaps, in bricks of up to 64 voxels.
fn dense(random: &mut Random, sheets: u32, culling: bool) -> Case {
    let grid = Grid { dims: UVec3::new(14, 11, 17), spacing: DVec3::new(1.0, 1.0, 1.3) };
    let holes = random.uniform(0.0, 0.6);
    let count = grid.dims.element_product();
    // The first bricks are full.
    let voxels = (0..count).filter(|&i| i % 14 < 8 || random.uniform(0.0, 1.0) > holes).collect();
    let mut scene = scene(75, 45);
    scene.camera = camera(random.direction().to_array(), random.uniform(9.0, 30.0));
    scene.splatting.slab_width = [0.3, 1.0, 2.6][random.bits() as usize % 3];
    scene.splatting.radius = random.uniform(1.0, 3.0);
    scene.splatting.culling = culling;
    Case { grid, voxels, scene, sheets }
}

const SHEETS: [u32; 3] = [1, 2, 4];

#[test]
fn dense_bricks() {
    let gpu = gpu();
    let mut random = Random(31);
    let mut all = Seen::default();
    for sheets in SHEETS {
        let stage = Cull::new(gpu.device(), sheets);
        for _ in 0..6 {
            let case = dense(&mut random, sheets, true);
            let masks = masks(&mut random, [case.scene.image.width, case.scene.image.height]);
            let seen = case.check(&gpu, &stage, &masks);
            all.drawn += seen.drawn;
            all.without_visits += seen.without_visits;
            all.with_some += seen.with_some;
            all.hidden_for_good += seen.hidden_for_good;
        }
    }
    assert!(all.drawn > 10_000 && all.hidden_for_good > 1000, "{all:?}");
    assert!(all.without_visits > 10 && all.with_some > 30, "{all:?}");
}

/// Boxes that differ between groups, bricks and kernels that the near plane cuts, kernels that only their group's box puts onto the screen, and
/// slices. Also back to front, where nothing is hidden.
#[test]
fn any_eye_and_slices() {
    let gpu = gpu();
    let mut random = Random(34);
    let mut all = Seen::default();
    for sheets in SHEETS {
        let stage = Cull::new(gpu.device(), sheets);
        for spacing in SPACINGS.into_iter().cycle().take(6) {
            let mut case = dense(&mut random, sheets, true);
            case.grid.spacing = spacing.into();
            let splatting = &mut case.scene.splatting;
            splatting.method = random.pick(&[Method::ImageAligned, Method::ImageAligned, Method::AxisAligned]);
            splatting.order = random.pick(&[Order::FrontToBack, Order::FrontToBack, Order::BackToFront]);
            if splatting.method == Method::ImageAligned || !random.bits().is_multiple_of(3) {
                case.scene.camera = random_eye(&mut random, &case.grid);
            }
            let masks = masks(&mut random, [case.scene.image.width, case.scene.image.height]);
            let seen = case.check(&gpu, &stage, &masks);
            all.drawn += seen.drawn;
            all.without_visits += seen.without_visits;
            all.with_some += seen.with_some;
            all.hidden_for_good += seen.hidden_for_good;
        }
    }
    println!("{all:?}");
    assert!(all.drawn > 10_000 && all.hidden_for_good > 1000, "{all:?}");
    assert!(all.without_visits > 10 && all.with_some > 30, "{all:?}");
}

/// Without culling the occlusion buffer is not used: only what lies off the screen is left out.
#[test]
fn culling_off() {
    let gpu = gpu();
    let mut random = Random(32);
    for sheets in SHEETS {
        let stage = Cull::new(gpu.device(), sheets);
        let case = dense(&mut random, sheets, false);
        let size = [case.scene.image.width, case.scene.image.height];
        let seen = case.check(&gpu, &stage, &[Occluded::new(size, true)]);
        assert!(seen.drawn > 1000, "{seen:?}");
    }
}

/// More bricks than threads, and more than threads times the bits of a word, so that every thread has several long runs.
#[test]
fn many_bricks() {
    let gpu = gpu();
    let mut random = Random(33);
    for (sheets, side, height, least) in [(4, 370, 170.0, 256 * 32), (1, 370, 260.0, 256), (2, 150, 170.0, 256)] {
        let stage = Cull::new(gpu.device(), sheets);
        // Adjacent bricks with one or two voxels each.
        let grid = Grid { dims: UVec3::new(side, 6, side), spacing: DVec3::ONE };
        let mut chosen = BTreeSet::new();
        for z in (0..side).step_by(4) {
            for y in [0, 4] {
                for x in (0..side).step_by(4) {
                    for _ in 0..1 + random.bits() % 2 {
                        let within = [(); 3].map(|()| (random.bits() % 4) as u32);
                        let at = (UVec3::new(x, y, z) + UVec3::from(within)).min(grid.dims - 1);
                        chosen.insert(at.x + side * (at.y + 6 * at.z));
                    }
                }
            }
        }
        let mut scene = scene(150, 77);
        scene.camera = camera([0.04, 0.9, -0.03], height);
        scene.splatting.slab_width = 8.0;
        let masks = masks(&mut random, [150, 77]);
        let case = Case { grid, voxels: chosen.into_iter().collect(), scene, sheets };
        let seen = case.check(&gpu, &stage, &masks);
        assert!(seen.most_bricks > least && seen.drawn > 1000, "{seen:?}");
    }
}

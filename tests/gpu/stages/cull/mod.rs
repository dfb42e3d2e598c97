//! `shaders/cull_bricks.wgsl`, `shaders/cull_voxels.wgsl` and `shaders/compact.wgsl` against a plain evaluation of their rules (§6): what a
//! sheet group draws, in which order, and the state of every brick afterwards. `shade.rs` tests the appearance of drawn voxels.

mod rules;

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec3, UVec3};
use sheetsplat::headless::GpuHeadless;
use sheetsplat::internals::after::normalization::Normalization;
use sheetsplat::internals::brick::{self, BRICK_VOXELS, BrickList};
use sheetsplat::internals::gpu::brick_lists::BrickLists;
use sheetsplat::internals::gpu::layout::{self, Brick, BrickState, FieldVoxel, Frame, Indirect, SheetGroup, Tally};
use sheetsplat::internals::gpu::ramps::Ramps;
use sheetsplat::internals::gpu::targets::Targets;
use sheetsplat::internals::gpu::uniforms;
use sheetsplat::internals::gpu::volume_texture::VolumeTexture;
use sheetsplat::internals::kernel::Kernel;
use sheetsplat::internals::pass::cull::{Cull, CullBuffers, CullList};
use sheetsplat::internals::pass::values::PlaneBuffers;
use sheetsplat::internals::plane_geometry::PlaneGeometry;
use sheetsplat::internals::quad_plan::FramePlan;
use sheetsplat::internals::reference::Geometry;
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Classification, Method, Order, Ramp, TransferFunction, Window};
use sheetsplat::volume::{Grid, ValueSlice};
use sheetsplat::wgpu::{self, BufferUsages, TextureFormat};

use crate::common::devices::gpu;
use crate::common::{Random, SPACINGS, camera, random_eye, scene};
use crate::stages::shade::place_error;
use crate::stages::{compute, contents, indirect, init};
use rules::{Expected, Occluded, Rules};

/// What groups are: some sheets each, or single planes (SPEC §9).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Groups {
    Sheets(u32),
    Planes,
}

impl Groups {
    fn sheets(self) -> u32 {
        match self {
            Self::Sheets(sheets) => sheets,
            Self::Planes => 1,
        }
    }
}

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
        (stage, kind): (&'a Cull, Groups),
        (grid, values, labels): (&Grid, ValueSlice<'_>, Option<&[u16]>),
        voxels: &[u32],
        transfer: &TransferFunction,
        scene: &Scene,
    ) -> Self {
        let (device, sheets) = (gpu.device(), kind.sheets());
        let size = [scene.image.width, scene.image.height];
        let view = ViewGeometry::new(grid, &scene.camera, &scene.splatting, size).unwrap();
        let lists = BrickLists::upload(device, BrickList::new(grid, voxels));
        let bricks = lists.bricks().next().unwrap().to_vec();
        let plan = FramePlan::new(
            [bricks.as_slice()],
            view,
            sheets,
            scene.splatting.order,
            0.0..0.0,
            &Window::whole([1; 2]).slabs,
        );
        let [list] = &lists.lists[..] else { panic!("{} lists", lists.lists.len()) };
        let ramps = Ramps::new(transfer);
        let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
        let uploaded = VolumeTexture::upload(device, gpu.queue(), values).unwrap();
        let frame = uniforms::frame(&view, &kernel, (grid, uploaded.format), &ramps, scene);
        let targets = Targets::new(device, size, TextureFormat::Rgba32Float, sheets).unwrap();
        let stride = device.limits().min_uniform_buffer_offset_alignment;
        let geometry = PlaneGeometry::new(&view, grid);
        let group_bytes = match kind {
            Groups::Sheets(_) => uniforms::groups(&plan, &kernel, &scene.splatting, stride as usize),
            Groups::Planes => uniforms::plane_groups(&plan, &geometry, &scene.splatting, stride as usize),
        };
        let planes = uniforms::planes(&geometry, &view, uploaded.format, &Normalization::new([0.0, 1.0]));
        let planes = init(device, &[planes], BufferUsages::UNIFORM);
        let groups = init(device, &group_bytes, BufferUsages::UNIFORM);
        let bytes = vec![0_u8; size_of::<Tally>() + targets.opaque_tiles.size() as usize];
        let culled = init(device, &bytes, BufferUsages::STORAGE);
        let labels = labels.map(|labels| VolumeTexture::upload_labels(device, gpu.queue(), labels).unwrap());
        let shared = CullBuffers {
            light: None,
            frame: &init(device, &[frame], BufferUsages::UNIFORM),
            groups: &groups,
            values: &uploaded.view,
            pages: None,
            has_holes: values.iter().any(|value| value.is_nan()),
            channels: 1,
            colors: None,
            labels: labels.as_ref().map(|labels| &labels.view),
            membership: None,
            control_points: &init(device, &ramps.points, BufferUsages::STORAGE),
            occluded: &targets.occluded,
            culled: &culled,
            planes: (kind == Groups::Planes).then_some(PlaneBuffers { planes: &planes, coefficients: None }),
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

/// A grid, its voxels in memory order, and a view of them.
struct Case {
    grid: Grid,
    voxels: Vec<u32>,
    scene: Scene,
    kind: Groups,
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

impl Seen {
    fn add(&mut self, other: &Self) {
        self.most_bricks = self.most_bricks.max(other.most_bricks);
        self.drawn += other.drawn;
        self.without_visits += other.without_visits;
        self.with_some += other.with_some;
        self.hidden_for_good += other.hidden_for_good;
    }
}

impl Case {
    fn transfer() -> TransferFunction {
        TransferFunction {
            color: Ramp::new(vec![(0.0, DVec3::ONE)]).unwrap(),
            opacity: Ramp::new(vec![(0.0, 0.5)]).unwrap(),
            gradient_opacity: None,
            iso_ranges: None,
            membership: false,
            labels: BTreeMap::new(),
        }
    }

    /// Draws the groups of the plan in order, with the given occlusion buffers in turn, and checks all results.
    fn check(mut self, gpu: &GpuHeadless, stage: &Cull, masks: &[Occluded]) -> Seen {
        let transfer = Self::transfer();
        let values = vec![1.0; self.grid.dims.element_product() as usize];
        // Voxels whose decisions may differ in f32 are removed, which changes their bricks.
        for _ in 0..30 {
            let volume = (&self.grid, ValueSlice::F32(&values), None);
            let culling = Culling::new(gpu, (stage, self.kind), volume, &self.voxels, &transfer, &self.scene);
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
            kind: self.kind,
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
            let name = format!("group {group} of {}, {:?}", steps.len(), self.kind);
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
            if self.kind == Groups::Planes {
                // `tests/gpu/stages/after/values.rs` tests what else they hold.
                let records: Vec<FieldVoxel> = contents(gpu, &list.splats);
                for &id in &expected.drawn {
                    let voxel = self.grid.voxel_at(culling.indices[id as usize]);
                    let depth = culling.view.screen_from_voxel[2].dot(voxel.as_dvec3().extend(1.0));
                    let off = (f64::from(records[id as usize].depth) - depth).abs();
                    assert!(off <= 1e-4 * depth.abs().max(1.0), "{name}: {voxel} is {off} off {depth}");
                }
            }
            let splats = if self.kind == Groups::Planes { Vec::new() } else { culling.splats() };
            for &id in expected.drawn.iter().filter(|_| self.kind != Groups::Planes) {
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
    let grid = Grid::new(UVec3::new(14, 11, 17), DVec3::new(1.0, 1.0, 1.3));
    let holes = random.uniform(0.0, 0.6);
    let count = grid.dims.element_product();
    // The first bricks are full.
    let voxels = (0..count).filter(|&i| i % 14 < 8 || random.uniform(0.0, 1.0) > holes).collect();
    let mut scene = scene(75, 45);
    scene.camera = camera(random.direction().to_array(), random.uniform(9.0, 30.0));
    scene.splatting.slab_width = [0.3, 1.0, 2.6][random.bits() as usize % 3];
    scene.splatting.radius = random.uniform(1.0, 3.0);
    scene.splatting.culling = culling;
    Case { grid, voxels, scene, kind: Groups::Sheets(sheets) }
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
            let seen = case.check(gpu, &stage, &masks);
            all.add(&seen);
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
            let seen = case.check(gpu, &stage, &masks);
            all.add(&seen);
        }
    }
    println!("{all:?}");
    assert!(all.drawn > 10_000 && all.hidden_for_good > 1000, "{all:?}");
    assert!(all.without_visits > 10 && all.with_some > 30, "{all:?}");
}

/// Groups that are planes, orthographic and with eyes anywhere: what is close to the eye has no place on the screen, and is always drawn.
#[test]
fn planes_of_any_eye() {
    let gpu = gpu();
    let mut random = Random(36);
    let stage = Cull::of_planes(gpu.device());
    let mut all = Seen::default();
    for (at, spacing) in SPACINGS.into_iter().cycle().take(12).enumerate() {
        let mut case = dense(&mut random, 1, true);
        case.kind = Groups::Planes;
        case.grid.spacing = spacing.into();
        case.scene.splatting.classification = Classification::After;
        case.scene.splatting.order = random.pick(&[Order::FrontToBack, Order::FrontToBack, Order::BackToFront]);
        if at % 3 > 0 {
            case.scene.camera = random_eye(&mut random, &case.grid);
        }
        let masks = masks(&mut random, [case.scene.image.width, case.scene.image.height]);
        let seen = case.check(gpu, &stage, &masks);
        all.add(&seen);
    }
    println!("{all:?}");
    assert!(all.drawn > 10_000 && all.hidden_for_good > 1000 && all.with_some > 30, "{all:?}");
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
        let seen = case.check(gpu, &stage, &[Occluded::new(size, true)]);
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
        let grid = Grid::new(UVec3::new(side, 6, side), DVec3::ONE);
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
        let case = Case { grid, voxels: chosen.into_iter().collect(), scene, kind: Groups::Sheets(sheets) };
        let seen = case.check(gpu, &stage, &masks);
        assert!(seen.most_bricks > least && seen.drawn > 1000, "{seen:?}");
    }
}

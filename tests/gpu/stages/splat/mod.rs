//! `shaders/splat.wgsl`, `shaders/splat_perspective.wgsl` and `shaders/clear.wgsl` against `reference::splat`: hand-made splat records
//! drawn into f32 sheet buffers, in groups of 1, 2 and 4 sheets.

mod sums;

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::Deref;

use bytemuck::Zeroable;
use glam::{DVec2, DVec3, DVec4, UVec3};
use sheetsplat::headless::{GpuHeadless, readback};
use sheetsplat::internals::brick::BrickList;
use sheetsplat::internals::footprint::{FootprintTable, SECTION_SIZE, SECTIONS, section_extent, section_spacing};
use sheetsplat::internals::gpu::brick_lists::BrickLists;
use sheetsplat::internals::gpu::footprint_texture::FootprintTexture;
use sheetsplat::internals::gpu::layout;
use sheetsplat::internals::gpu::volume_texture::VolumeTexture;
use sheetsplat::internals::pass::cull::{Cull, CullBuffers, CullList};
use sheetsplat::internals::pass::splat::{Splat as Stage, SplatMode};
use sheetsplat::internals::quad_plan::tile_grid;
use sheetsplat::internals::reference;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{FootprintForm, Method};
use sheetsplat::volume::{Grid, ValueSlice};
use sheetsplat::wgpu::{self, BufferUsages, TextureFormat, TextureUsages};

use crate::common::compare::{apart, assert_at_most, largest};
use crate::common::devices::gpu;
use crate::common::{F32, Random, pixels};
use crate::stages::kernel_in_view::{KernelInView, random_view};
use crate::stages::section::{AMOUNT, AMOUNT_BA, AMOUNT_RG, KERNELS, Seen, VIEWS, view_scene};
use crate::stages::{at_offsets, frame_over, indirect, init, tile_list};

/// The stage for groups of `sheets` sheets, and a list to draw, with what the culling stages write.
struct Stages<'a> {
    gpu: &'a GpuHeadless,
    sheets: u32,
    splat: Stage,
    list: RefCell<CullList>,
}

impl<'a> Stages<'a> {
    fn new(gpu: &'a GpuHeadless, sheets: u32) -> Self {
        let device = gpu.device();
        let any = |usage| init(device, &[0_u8; 1024], usage);
        let storage = any(BufferUsages::STORAGE);
        let uniform = any(BufferUsages::UNIFORM);
        let shared = CullBuffers {
            light: None,
            frame: &uniform,
            groups: &uniform,
            values: &VolumeTexture::upload(device, gpu.queue(), ValueSlice::F32(&[0.0])).unwrap().view,
            pages: None,
            has_holes: false,
            channels: 1,
            colors: None,
            labels: None,
            membership: None,
            control_points: &storage,
            occluded: &storage,
            culled: &storage,
            planes: None,
        };
        let grid = Grid::new(UVec3::ONE, DVec3::ONE);
        let lists = BrickLists::upload(device, BrickList::new(&grid, &[0]));
        let list = Cull::new(device, sheets).prepare(device, shared, &lists.lists[0], &storage, (1, 1), None).unwrap();
        let splat = Stage::new(device, TextureFormat::Rgba32Float, sheets);
        Self { gpu, sheets, splat, list: RefCell::new(list) }
    }
}

/// One view of one kernel, on the GPU and in the f64 evaluation.
struct Fixture<'a> {
    gpu: &'a GpuHeadless,
    stage: &'a Stages<'a>,
    seen: Seen,
    frame: wgpu::Buffer,
    footprints: FootprintTexture,
    /// The sheet buffers of a group.
    sheets: Vec<wgpu::Texture>,
    /// All tiles of the image.
    tiles: Vec<u32>,
}

impl Deref for Fixture<'_> {
    type Target = Seen;

    fn deref(&self) -> &Seen {
        &self.seen
    }
}

/// An f32 sheet buffer, read back.
type Sheet = Vec<DVec4>;

impl<'a> Fixture<'a> {
    fn new(stage: &'a Stages<'a>, scene: Scene, spacing: [f64; 3]) -> Self {
        Self::over(stage, scene, &Grid::new(UVec3::splat(9), DVec3::from(spacing)))
    }

    fn over(stage: &'a Stages<'a>, scene: Scene, grid: &Grid) -> Self {
        let gpu = stage.gpu;
        let seen = Seen::new(grid, scene);
        let size = seen.view.size;
        let table = FootprintTable::new(seen.scene.splatting.footprint, &seen.kernel, seen.view.section_width());
        let sheet = |_| {
            gpu.device().create_texture(&wgpu::TextureDescriptor {
                label: Some("sheet"),
                size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: TextureFormat::Rgba32Float,
                usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC | TextureUsages::COPY_DST,
                view_formats: &[],
            })
        };
        let [columns, rows] = tile_grid(size);
        Self {
            gpu,
            stage,
            frame: init(gpu.device(), &[frame_over(grid, &seen.scene)], BufferUsages::UNIFORM),
            footprints: FootprintTexture::upload(gpu.device(), gpu.queue(), &table),
            sheets: (0..stage.sheets).map(sheet).collect(),
            tiles: (0..columns * rows).collect(),
            seen,
        }
    }

    /// The sheet buffers, by slab, of the groups that contain some slabs, with some of the splats, in any order. The previous content of
    /// the sheet buffers is lost.
    fn draw(&self, splats: &[layout::Splat], instances: &[u32], slabs: &[i32]) -> BTreeMap<i32, Sheet> {
        let mut sheets = BTreeMap::new();
        for &k in slabs {
            if !sheets.contains_key(&k) {
                let first = self.first_of_group(k);
                sheets.extend((first..).zip(self.draw_group(splats, instances, first, &self.tiles)));
            }
        }
        sheets
    }

    /// The first slab of a slab's group.
    fn first_of_group(&self, k: i32) -> i32 {
        k - k.rem_euclid(self.stage.sheets as i32)
    }

    /// The error bound of the summed-area form in a section.
    fn tolerance(&self, splat: &reference::Splat, k: i32) -> f64 {
        self.summed_area_tolerance(splat, self.first_of_group(k), k)
    }

    fn draw_group(&self, splats: &[layout::Splat], instances: &[u32], first_slab: i32, tiles: &[u32]) -> Vec<Sheet> {
        let device = self.gpu.device();
        let near = self.view.slabs.plane(first_slab) as f32;
        // The group is not at the first offset.
        let of = |near| layout::SheetGroup { near, ..layout::SheetGroup::zeroed() };
        let (groups, offset) = at_offsets(device, &[of(1e9), of(near)]);
        let args = init(device, &[indirect(instances.len() as u32)], BufferUsages::INDIRECT | BufferUsages::STORAGE);
        let tiles = tile_list(device, tiles);
        let clear = self.stage.splat.bind_clear(device, &self.frame, &tiles);
        let group = {
            let mut list = self.stage.list.borrow_mut();
            list.splats = init(device, splats, BufferUsages::STORAGE);
            // One more instance than is drawn.
            let instances: Vec<u32> = instances.iter().copied().chain([0]).collect();
            list.instances = init(device, &instances, BufferUsages::STORAGE);
            list.draw_args = args.clone();
            self.stage.splat.bind(device, &self.frame, &groups, &list, &self.footprints)
        };
        let views: Vec<_> =
            self.sheets.iter().map(|sheet| sheet.create_view(&wgpu::TextureViewDescriptor::default())).collect();
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let perspective = self.view.perspective.is_some();
        let mode = SplatMode { form: self.scene.splatting.footprint, perspective };
        self.stage.splat.prepare(device, mode);
        self.stage.splat.record(&mut encoder, None, mode, &views, (&clear, &tiles), [(&group, offset, &args)]);
        self.gpu.queue().submit([encoder.finish()]);
        let read = |sheet| pixels(&readback::texture(device, self.gpu.queue(), sheet).unwrap());
        self.sheets.iter().map(read).collect()
    }

    /// A splat for the f64 evaluation with the record's f32 coordinates, so that only the stage's own errors count.
    fn twin_of(&self, splat: &layout::Splat) -> reference::Splat {
        let layout::Splat { x_px, y_px, depth, rg, ba, .. } = *splat;
        assert_eq!((rg, ba), (AMOUNT_RG, AMOUNT_BA));
        let center = DVec2::new(x_px.into(), y_px.into());
        reference::Splat { center, depth: depth.into(), amount: AMOUNT * self.amplitude(), alpha: 1.0 }
    }

    /// A random splat whose footprint is at least partly on the screen.
    fn random_splat(&self, random: &mut Random) -> layout::Splat {
        let coordinate = |random: &mut Random, size: u32| random.uniform(-2.0, f64::from(size) + 2.0) as f32;
        layout::Splat {
            x_px: coordinate(random, self.scene.image.width),
            y_px: coordinate(random, self.scene.image.height),
            depth: random.uniform(-60.0, 60.0) as f32,
            from_eye: 1.0,
            rg: AMOUNT_RG,
            ba: AMOUNT_BA,
        }
    }
}

/// The numbers of sheets in a group.
const GROUPS: [u32; 3] = [1, 2, 4];

/// Calls `check` with random splats of every kernel and view, one at a time, and each slab that they touch or that shares a group with one:
/// fixture, splat, slab, sheet buffer.
fn for_random_sections(
    form: FootprintForm,
    widths: &[f64],
    mut check: impl FnMut(&Fixture<'_>, &reference::Splat, i32, &[DVec4]),
) {
    let gpu = gpu();
    let mut random = Random(3);
    for stage in GROUPS.map(|sheets| Stages::new(gpu, sheets)) {
        for (kernel, view) in KERNELS.into_iter().flat_map(|kernel| VIEWS.map(|view| (kernel, view))) {
            for &width in widths {
                let fixture = Fixture::new(&stage, view_scene(view, kernel, width, form), view.1);
                let splat = fixture.random_splat(&mut random);
                let twin = fixture.twin_of(&splat);
                let slabs: Vec<i32> = fixture.touched(&twin).collect();
                for (k, sheet) in fixture.draw(&[splat], &[0], &slabs) {
                    check(&fixture, &twin, k, &sheet);
                }
            }
        }
    }
}

#[test]
fn summed_area_sections() {
    let mut lit = 0;
    for_random_sections(FootprintForm::SummedArea, &[0.25, 1.0, 3.7], |fixture, splat, k, sheet| {
        let expected = fixture.twin(&[*splat], k);
        // SPEC §4 allows a thousandth; the table is four times as accurate.
        let tolerance = fixture.tolerance(splat, k) / 4.0;
        fixture.assert_close(sheet, &expected, |_| tolerance, &format!("{splat:?} in slab {k}"));
        lit += expected.iter().filter(|pixel| pixel.w > 0.0).count();
    });
    assert!(lit > 100_000, "only {lit} pixels were compared");
}

/// The nearest of the 128 stored sections is that of a splat displaced by up to half their spacing: compared with that one, only the bilinear
/// interpolation between the texels of its quadrant counts.
#[test]
fn stored_sections() {
    let mut lit = 0;
    for_random_sections(FootprintForm::Sections, &[0.25, 1.0, 3.7], |fixture, splat, k, sheet| {
        let Seen { kernel, view, .. } = &fixture.seen;
        let (t0, t1) = fixture.planes(splat, k);
        let middle = (t0 + t1) / 2.0;
        let spacing = section_spacing(kernel, view.slabs.width);
        let layer = (middle.abs() / spacing).round();
        if (middle.abs() / spacing - layer).abs() > 0.499 {
            // Half way between two sections f32 decides which one is the nearest.
            return;
        }
        let stored =
            reference::Splat { depth: splat.depth + middle.signum() * (middle.abs() - layer * spacing), ..*splat };
        let expected =
            if layer < f64::from(SECTIONS) { fixture.twin(&[stored], k) } else { vec![DVec4::ZERO; sheet.len()] };

        let (t0, t1) = fixture.planes(&stored, k);
        let texel = section_extent(kernel, t0, t1) / f64::from(SECTION_SIZE - 1);
        let diagonal = 2.0_f64.sqrt() * texel;
        let section = |rho: f64| kernel.section(rho.max(0.0).powi(2), t0, t1);
        let tolerance = |pixel: usize| {
            // A section falls off from its centre, so the values at a cell's corners lie between its values a diagonal away.
            let rho = fixture.rho(splat, pixel);
            let monotone = (section(rho - diagonal) - section(rho)).max(section(rho) - section(rho + diagonal));
            // Where the slab's planes end the section, not the ball, it is a Gaussian in both directions: its second derivatives are at
            // most 2·falloff of the peak, and bilinear interpolation errs by texel²/8 of their sum.
            let chord = kernel.half_chord((rho + diagonal).powi(2));
            let smooth = t0.abs().max(t1.abs()) < chord;
            let interpolation =
                if smooth { monotone.min(kernel.falloff() * texel * texel / 2.0 * section(0.0)) } else { monotone };
            // The kernel's support leaves out 2⁻²⁴; the rest is the error of f32.
            interpolation + 8.0 * F32 * fixture.whole()
        };
        fixture.assert_close(sheet, &expected, tolerance, &format!("{splat:?} in slab {k}"));
        lit += expected.iter().filter(|pixel| pixel.w > 0.0).count();
    });
    assert!(lit > 100_000, "only {lit} pixels were compared");
}

/// Kernels with a ray each, cut by the near plane or not, in slabs and in slices, the latter also without an eye.
#[test]
fn any_eye_and_slices() {
    let gpu = gpu();
    let mut random = Random(17);
    for (method, form) in [Method::ImageAligned, Method::AxisAligned]
        .into_iter()
        .flat_map(|method| [FootprintForm::SummedArea, FootprintForm::Sections].map(|form| (method, form)))
    {
        let (mut lit, mut cut, mut worst) = (0, 0, 0.0_f64);
        for stage in GROUPS.map(|sheets| Stages::new(gpu, sheets)) {
            for _ in 0..16 {
                let (grid, scene) = random_view(&mut random, method, form);
                let fixture = Fixture::over(&stage, scene, &grid);
                let kernel = KernelInView::random(&fixture.seen, &mut random);
                let sheets = kernel.sheets();
                let slabs =
                    [(); 3].map(|()| random.uniform(f64::from(sheets.start) - 2.0, f64::from(sheets.end) + 1.0));
                for (k, sheet) in fixture.draw(&[kernel.record], &[0], &slabs.map(|k| k.floor() as i32)) {
                    let section = match (kernel.section(k), form) {
                        (Some(section), FootprintForm::Sections) => kernel.stored(section, k),
                        (section, FootprintForm::SummedArea) => section,
                        // Stored sections have the thickness of the central ray's, so they may reach into sheets that the kernel does not.
                        (None, FootprintForm::Sections) => continue,
                    };
                    let Some(section) = section else {
                        let most = largest(sheet.iter().map(|pixel| pixel.w));
                        let is_none = form == FootprintForm::Sections || most <= kernel.rounding(k);
                        assert!(
                            is_none,
                            "{most} in sheet {k} of {sheets:?}, {:?}, {:?}",
                            fixture.kernel, fixture.scene
                        );
                        continue;
                    };
                    kernel.draw(&section, k, |pixel, expected, tolerance| {
                        let (error, Seen { kernel, scene, .. }) = (apart(sheet[pixel], expected), &fixture.seen);
                        let what = format_args!("{section:?} in sheet {k}, {kernel:?}, {scene:?}, pixel {pixel}");
                        assert_at_most(error, tolerance, what);
                        worst = worst.max(error / tolerance.max(1e-300));
                        lit += usize::from(expected.w > 0.0);
                    });
                    cut += usize::from(kernel.is_cut());
                }
            }
        }
        println!(
            "{method:?}, {form:?}: {lit} pixels lit, {cut} sections of cut kernels, errors up to {worst:.3} of the tolerance"
        );
        assert!(lit > 10_000 && cut > 3, "only {lit} pixels, {cut} sections of cut kernels");
    }
}

/// Pixel centres just inside the rim, where it touches the quad's sides, of a kernel that is not small there: the rasterizer, which snaps
/// corners to 1/256 pixel, must not lose them.
#[test]
fn pixels_just_inside_the_rim_are_drawn() {
    let gpu = gpu();
    let stages = GROUPS.map(|sheets| Stages::new(gpu, sheets));
    for (form, stage) in [FootprintForm::SummedArea, FootprintForm::Sections]
        .into_iter()
        .flat_map(|form| stages.iter().map(move |stage| (form, stage)))
    {
        let view = VIEWS[0];
        let fixture = Fixture::new(stage, view_scene(view, (1.0, 0.1), 8.0, form), view.1);
        assert_eq!(fixture.view.footprint.pixels_from_footprint.row(0).length(), 4.0, "pixels per grid unit");
        for inside in [0.0005, 0.001, 0.0015, 0.0019] {
            for side in [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y] {
                let center = DVec2::new(30.5, 20.5) - side * (4.0 - inside);
                let (x_px, y_px) = (center.x as f32, center.y as f32);
                let splat = layout::Splat { x_px, y_px, depth: 4.0, from_eye: 1.0, rg: AMOUNT_RG, ba: AMOUNT_BA };
                let sheet = &fixture.draw(&[splat], &[0], &[0])[&0];
                let pixel = 20 * 70 + 30;
                let actual = sheet[pixel].w;
                // The chord is √(1 - ρ²) to each side, and the kernel's value there κ·exp(-0.1).
                let expected = fixture.twin(&[fixture.twin_of(&splat)], 0)[pixel].w;
                assert!(expected > 0.01 * fixture.whole(), "{expected} is not worth testing");
                match form {
                    FootprintForm::SummedArea => {
                        assert_at_most((actual - expected).abs(), 4e-6 * fixture.whole(), "just inside the rim");
                    }
                    // Interpolated between the last texel inside and 0 on the rim.
                    FootprintForm::Sections => assert!(actual > 0.0 && actual < expected, "{actual} {expected}"),
                }
            }
        }
    }
}

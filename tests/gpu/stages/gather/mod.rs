//! `shaders/gather.wgsl` against the f64 evaluation: sections of single kernels, frames of random volumes, and hidden voxels.

mod frames;

use glam::{DVec2, DVec3, DVec4, UVec3};
use sheetsplat::headless::GpuHeadless;
use sheetsplat::internals::brick::BrickList;
use sheetsplat::internals::classify::classify;
use sheetsplat::internals::gpu::gathered_layout::GatheredLayout;
use sheetsplat::internals::gpu::layout::{Gathered, PatchRange, Tally};
use sheetsplat::internals::gpu::ramps::Ramps;
use sheetsplat::internals::gpu::uniforms;
use sheetsplat::internals::gpu::volume_texture::{SIDES, VolumeTexture};
use sheetsplat::internals::pass::composite::{CutBuffers, RayMode};
use sheetsplat::internals::pass::gather::{Gather, GatherBuffers, GatherMode};
use sheetsplat::internals::patch_bins::{self, HALVES, PatchBins, SHEETS, Work};
use sheetsplat::internals::{ClippedVoxels, means, reference};
use sheetsplat::scene::{Scene, TransferSettings};
use sheetsplat::settings::{Compositing, FootprintForm, TransferFunction, Window};
use sheetsplat::volume::{Grid, Volume};
use sheetsplat::wgpu::BufferUsages;

use crate::common::devices::gpu;
use crate::common::{Random, pixels, transfer};
use crate::stages::section::{AMOUNT, KERNELS, Seen, VIEWS, view_scene};
use crate::stages::{Uncut, at_offsets, compute, contents, init};

/// A scene over a volume, on the GPU and in the f64 evaluation.
struct Fixture<'a> {
    gpu: &'a GpuHeadless,
    stage: &'a Gather,
    seen: Seen,
    volume: Volume,
    transfer: TransferFunction,
    bricks: BrickList,
}

/// The results of the stage.
#[derive(Debug, PartialEq)]
struct Drawn {
    acc: Vec<DVec4>,
    tally: Tally,
    /// The 32×32 tiles that every group composited.
    tiles: Vec<u32>,
    /// For every group of those that a kernel reaches, one bit per slot: two words per brick.
    drawn: Vec<u32>,
}

impl<'a> Fixture<'a> {
    fn new(gpu: &'a GpuHeadless, stage: &'a Gather, scene: Scene, volume: Volume) -> Self {
        let transfer = scene.channels[0].transfer.resolve(&volume);
        let voxels = classify(&volume, std::slice::from_ref(&transfer), &ClippedVoxels::default());
        let bricks = BrickList::new(volume.grid(), &voxels);
        Self { gpu, stage, seen: Seen::new(volume.grid(), scene), volume, transfer, bricks }
    }

    fn bins(&self) -> PatchBins {
        let Seen { view, kernel, scene: Scene { splatting, .. }, .. } = &self.seen;
        let covered = means::covered(view, self.volume.grid(), splatting);
        PatchBins::new(
            self.bricks.bricks(),
            (view, None),
            splatting.order,
            (covered, &Window::whole([1; 2]).slabs),
            kernel.support(),
            Work { search: 0, threads: 8, layers: 1, looks: true },
            u64::MAX,
        )
        .unwrap()
    }

    /// Draws over `acc`, in bands of at most `band_rows` rows. The nearest group begins at `near`, if stated.
    fn draw(&self, bins: &PatchBins, near: Option<f32>, acc: &[DVec4], band_rows: u32) -> Drawn {
        let Self { gpu, stage, seen, volume, bricks, .. } = self;
        let (device, size) = (gpu.device(), seen.view.size);
        let bricks = bricks.bricks();
        let ramps = Ramps::new(&self.transfer);
        let side = SIDES[size[0] as usize % SIDES.len()];
        let values = VolumeTexture::upload_folded(device, gpu.queue(), volume.values(), side);
        let grid = (volume.grid(), values.format);
        let frame = uniforms::frame(&seen.view, &seen.kernel, grid, &ramps, &seen.scene);
        let results = GatheredLayout::new(&seen.view, bins, bricks.len() as u32, 1);
        let mut gather = uniforms::gather(&seen.view, &seen.kernel, &seen.scene.splatting, bins, &results);
        gather.near = near.unwrap_or(gather.near);
        let ([columns, _], tile_rows) = (patch_bins::grid(size), patch_bins::PATCH[1]);
        let bands: Vec<(u32, u32)> =
            (0..size[1]).step_by(band_rows as usize).map(|first| (first, band_rows.min(size[1] - first))).collect();
        let ranges: Vec<PatchRange> = bands
            .iter()
            .map(|&(first_row, rows)| PatchRange {
                first_row,
                first_patch: first_row / tile_rows * columns,
                end_patch: (first_row / tile_rows + rows.div_ceil(tile_rows)) * columns,
                row_step: 1,
            })
            .collect();
        let accs: Vec<_> = bands
            .iter()
            .map(|&(first, rows)| {
                let [first, end] = [first, first + rows].map(|row| (row * size[0]) as usize);
                let pixels: Vec<[f32; 4]> = acc[first..end].iter().map(|pixel| pixel.as_vec4().to_array()).collect();
                init(device, &pixels, BufferUsages::STORAGE)
            })
            .collect();
        let storage = |words: &[u32]| init(device, words, BufferUsages::STORAGE);
        let words = gather.reached + bins.patches * HALVES;
        let gathered = storage(&vec![0; size_of::<Gathered>() / 4 + words as usize]);
        let (ranges_buffer, stride) = at_offsets(device, &ranges);
        let half_boxes: Vec<[f32; 2]> = bins.half_boxes.iter().map(|half| half.as_vec2().to_array()).collect();
        let (uncut, cut) = (
            Uncut::new(device),
            uniforms::cut(&seen.view, volume.grid(), &seen.scene, None, None, &Window::whole(seen.view.size)),
        );
        let mode = GatherMode::of(
            &seen.scene.splatting,
            None,
            seen.view.perspective.is_some(),
            [false, volume.holes() > 0],
            RayMode::default(),
            bins.workgroups,
        );
        let buffers = GatherBuffers {
            light: None,
            frame: &init(device, &[frame], BufferUsages::UNIFORM),
            gather: &init(device, &[gather], BufferUsages::UNIFORM),
            planes: None,
            patch_ranges: &ranges_buffer,
            bricks: &init(device, bricks, BufferUsages::STORAGE),
            bins: &storage(&bins.words),
            control_points: &init(device, &ramps.points, BufferUsages::STORAGE),
            values: &values.view,
            pages: None,
            colors: None,
            labels: None,
            membership: None,
            gathered: &gathered,
            half_boxes: &init(device, &half_boxes, BufferUsages::STORAGE),
            cut: CutBuffers { uniform: &init(device, &[cut], BufferUsages::UNIFORM), ..uncut.buffers() },
        };
        let bound: Vec<_> =
            accs.iter().map(|acc| stage.bind(device, mode, buffers, (acc, None), bins.dispatches)).collect();
        compute(gpu, |pass| {
            for (at, range) in ranges.iter().enumerate() {
                let tiles = range.end_patch - range.first_patch;
                stage.record(pass, &bound[at], at as u32 * stride, tiles);
            }
        });
        let acc = accs.iter().flat_map(|acc| pixels(&contents::<u8>(gpu, acc))).collect();
        let left: Vec<u32> = contents(gpu, &gathered);
        let (tally, words) = left.split_at(size_of::<Tally>() / 4);
        Drawn {
            acc,
            tally: bytemuck::pod_read_unaligned(bytemuck::cast_slice(tally)),
            tiles: words[..bins.groups as usize].to_vec(),
            drawn: words[gather.drawn as usize..gather.composited as usize].to_vec(),
        }
    }

    /// Draws the whole image over an empty buffer.
    fn draw_all(&self) -> Drawn {
        let bins = self.bins();
        self.draw(&bins, None, &self.empty(), u32::MAX)
    }

    fn empty(&self) -> Vec<DVec4> {
        vec![DVec4::ZERO; self.seen.view.size.map(|pixels| pixels as usize).iter().product()]
    }

    /// The f64 compositing buffer, with nothing culled.
    fn twin(&self) -> Vec<DVec4> {
        let mut scene = self.seen.scene.clone();
        scene.image.background = [0.0; 4];
        let image = reference::render(&self.volume, std::slice::from_ref(&self.transfer), &scene).unwrap();
        image.pixels.iter().map(|pixel| DVec4::from_array(pixel.map(f64::from))).collect()
    }
}

/// A voxel at a corner of a volume, whose position on the screen is known to the last bit.
fn one_voxel(spacing: [f64; 3]) -> (Volume, TransferSettings) {
    let mut values = vec![0.0; 729];
    values[0] = 1.0;
    let volume = Volume::new("voxel", UVec3::splat(9), DVec3::from(spacing), values).unwrap();
    let color = AMOUNT.truncate().to_array();
    (volume, transfer(&[(0.0, color)], &[(0.0, 0.0), (1.0, AMOUNT.w)]))
}

/// Moves a scene's camera so that a voxel is at a point of the screen.
fn look_at(scene: &mut Scene, grid: &Grid, voxel: UVec3, at: DVec2) {
    let seen = Seen::new(grid, scene.clone());
    let offset = (at - seen.geometry.size / 2.0) * seen.geometry.pix * grid.unit();
    let basis = seen.view.basis;
    scene.camera.center = Some(grid.world_position(voxel) - offset.x * basis.u + offset.y * basis.v);
}

/// Four sheets at a time are added up, including only the first sheet, only the first two, and so on, to the same precision as for quads.
#[test]
fn sections() {
    let (gpu, stage) = (gpu(), Gather::default());
    let mut random = Random(41);
    let mut lit = 0;
    for (kernel, view) in KERNELS.into_iter().flat_map(|kernel| VIEWS.map(|view| (kernel, view))) {
        for width in [0.25, 1.0, 3.7] {
            let (volume, transfer) = one_voxel(view.1);
            let mut scene = view_scene(view, kernel, width, FootprintForm::SummedArea);
            (scene.channels[0].transfer, scene.shading.enabled) = (transfer, false);
            scene.splatting.compositing = Compositing::Xray;
            let at = DVec2::new(random.uniform(-2.0, 72.0), random.uniform(-2.0, 47.0));
            look_at(&mut scene, volume.grid(), UVec3::ZERO, at);
            let fixture = Fixture::new(gpu, &stage, scene, volume);
            let Seen { view, kernel, .. } = &fixture.seen;

            // The f64 splat is at the f32 position of the voxel, at any depth.
            let [x, y, z, _] = view.screen_from_voxel.map(|row| row.w as f32);
            let splat = reference::Splat {
                center: DVec2::new((x + 35.0).into(), (y + 22.5).into()),
                depth: random.uniform(-60.0, 60.0),
                amount: AMOUNT * fixture.seen.amplitude(),
                alpha: AMOUNT.w,
            };
            let touched = fixture.seen.touched(&splat);
            let first = random.uniform(f64::from(touched.start) - 4.0, f64::from(touched.end)) as i32;
            for first in [touched.start - 3, touched.start - 2, first] {
                let near = (f64::from(first) * view.slabs.width - splat.depth + f64::from(z)) as f32;
                // The near plane as rounded to f32.
                let depth = f64::from(first) * view.slabs.width - (f64::from(near) - f64::from(z));
                let splat = reference::Splat { depth, ..splat };
                let tiles = patch_bins::grid(view.size).iter().product::<u32>();
                let bins = PatchBins {
                    first_slab: first,
                    patches: tiles,
                    groups: 1,
                    words: (tiles + 1..=2 * tiles + 1).chain((0..tiles).map(|_| 0)).collect(),
                    bins: tiles,
                    half_boxes: vec![view.half_box(kernel.support(), 0.0..1.0)],
                    workgroups: 1,
                    passes: fixture.bins().passes,
                    dispatches: 1,
                };
                let drawn = fixture.draw(&bins, Some(near), &fixture.empty(), u32::MAX);
                let group = first..first + SHEETS as i32;
                let expected = group
                    .clone()
                    .map(|k| fixture.seen.twin(&[splat], k))
                    .reduce(|sum, sheet| sum.iter().zip(&sheet).map(|(sum, sheet)| sum + sheet).collect())
                    .unwrap();
                let tolerance: f64 = group.clone().map(|k| fixture.seen.summed_area_tolerance(&splat, first, k)).sum();
                let what = format!("{splat:?} in slabs {group:?}");
                fixture.seen.assert_close(&drawn.acc, &expected, |_| tolerance, &what);
                lit += expected.iter().filter(|pixel| pixel.w > 0.0).count();

                let sections = group.filter(|k| fixture.seen.touched(&splat).contains(k)).count() as u32;
                let half_box = view.footprint.half_box(kernel.support());
                let is_on_screen = (splat.center + half_box - 0.5).min_element() >= 0.0
                    && (fixture.seen.geometry.size - 0.5 - splat.center + half_box).min_element() >= 0.0;
                let sections = if is_on_screen { sections } else { 0 };
                assert_eq!(drawn.tally.sections_rasterized, sections, "{what}");
                assert_eq!(drawn.tally.voxels_shaded, sections.min(1), "{what}");
            }
        }
    }
    assert!(lit > 100_000, "only {lit} pixels were compared");
}

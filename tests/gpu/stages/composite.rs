//! `shaders/composite.wgsl` against `reference::composite`: random sheets over random compositing buffers, in some tiles.

use glam::{DVec3, DVec4};
use sheetsplat::headless::{GpuHeadless, readback};
use sheetsplat::internals::gpu::layout::SheetGroup;
use sheetsplat::internals::gpu::targets::{BandBuffer, CompositingBuffer, Targets};
use sheetsplat::internals::pass::composite::{Composite, CompositeBuffers, CompositeMode, RayMode};
use sheetsplat::internals::quad_plan::{TILE, tile_grid};
use sheetsplat::internals::reference::Buffer;
use sheetsplat::internals::reference::composite::composite;
use sheetsplat::settings::{Compositing, Order};
use sheetsplat::wgpu::{self, BufferUsages};

use crate::common::compare::{apart, assert_at_most};
use crate::common::devices::{gpu, gpu_with_small_bindings};
use crate::common::{BY_AMOUNTS, F32, Random};
use crate::stages::{Uncut, compute, contents, frame, init, tile_list};

/// Premultiplied colours in f32: some pixels have alpha 0, some a tiny alpha, and, if requested, some exceed 1.
fn random_pixels(random: &mut Random, size: [u32; 2], above_one: bool) -> Vec<[f32; 4]> {
    let alpha = |random: &mut Random| match random.bits() % 6 {
        0 => 0.0,
        1 => 1e-6 * random.uniform(0.5, 2.0),
        // Values around the shader's switch from a series to exp.
        2 => random.uniform(0.06, 0.065),
        3 => 1.0,
        4 if above_one => random.uniform(1.0, 30.0),
        _ => random.uniform(0.0, 1.0),
    };
    (0..size[0] * size[1])
        .map(|_| {
            let alpha = alpha(random);
            let rgb = DVec3::from([(); 3].map(|()| random.uniform(0.0, 1.0))) * alpha;
            rgb.extend(alpha).as_vec4().to_array()
        })
        .collect()
}

fn to_f64(width: u32, pixels: &[[f32; 4]]) -> Buffer {
    Buffer { width: width as usize, pixels: pixels.iter().map(|pixel| DVec4::from(pixel.map(f64::from))).collect() }
}

/// The maximum f32 error of one sheet in a pixel. A sum and a product of numbers up to `most` have a few roundings; WGSL's division is
/// accurate to 2.5 ULP, its exp to (3 + 2|x|) ULP, of which 1 - exp(-a) keeps all in absolute terms; the shader's series below 1/16 errs by
/// a⁵/720.
fn tolerance(compositing: Compositing, alpha: f64, most: f64) -> f64 {
    let exp_error = match compositing {
        Compositing::Exponential if alpha >= 0.06 => (3.0 + 2.0 * alpha) * 2.0 * F32 * (-alpha).exp(),
        Compositing::Exponential => alpha.powi(6) / 720.0,
        _ => 0.0,
    };
    exp_error + 5.0 * F32 * most
}

/// One case: sheets over a compositing buffer.
struct Case {
    size: [u32; 2],
    compositing: Compositing,
    order: Order,
    threshold: f64,
    /// Premultiplied pixels of every sheet, the nearest first.
    sheets: Vec<Vec<[f32; 4]>>,
    acc: Vec<[f32; 4]>,
    /// Tiles to composite.
    tiles: Vec<u32>,
    /// The previous content of the masks.
    stale: u32,
}

/// The results of the stage: pixels, the mask of opaque pixels, and flags of opaque tiles.
struct Outcome {
    acc: Vec<[f32; 4]>,
    opaque: Vec<u32>,
    opaque_tiles: Vec<u32>,
}

impl Case {
    fn run(&self, gpu: &GpuHeadless, stage: &Composite, bands: usize) -> Outcome {
        let (device, queue) = (gpu.device(), gpu.queue());
        let Self { size, compositing, order, threshold, .. } = *self;
        let layers = self.sheets.len() as u32;
        let targets = Targets::new(device, size, wgpu::TextureFormat::Rgba32Float, layers).unwrap();
        let cut = CompositingBuffer::bands(&device.limits(), size).unwrap();
        let compositing_buffer = CompositingBuffer::new(device, size, &cut);
        assert_eq!(compositing_buffer.bands.len(), bands);
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(size[0] * 16), rows_per_image: Some(size[1]) };
        let texels = self.sheets.concat();
        let bytes = bytemuck::cast_slice(&texels);
        queue.write_texture(targets.sheets.as_image_copy(), bytes, layout, targets.sheets.size());
        for band in &compositing_buffer.bands {
            let first = (band.band.first_row * size[0]) as usize;
            let acc = &self.acc[first..first + (band.band.rows * size[0]) as usize];
            queue.write_buffer(&band.acc, 0, bytemuck::cast_slice(acc));
        }
        for mask in [&targets.opaque, &targets.opaque_tiles] {
            queue.write_buffer(mask, 0, bytemuck::cast_slice(&vec![self.stale; mask.size() as usize / 4]));
        }
        let frame = frame(|scene| {
            (scene.image.width, scene.image.height) = (size[0], size[1]);
            (scene.splatting.compositing, scene.splatting.order) = (compositing, order);
            scene.splatting.opacity_threshold = threshold;
        });
        let frame = init(device, &[frame], BufferUsages::UNIFORM);
        let view = targets.sheets.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..wgpu::TextureViewDescriptor::default()
        });
        let tiles = tile_list(device, &self.tiles);
        let uncut = Uncut::new(device);
        let words = |usage| init(device, &[0_u32; size_of::<SheetGroup>() / 4], usage);
        let buffers = CompositeBuffers {
            frame: &frame,
            groups: &words(BufferUsages::UNIFORM),
            sheets: &view,
            tiles: &tiles,
            targets: &targets,
            cut: uncut.buffers(),
            hits: &words(BufferUsages::STORAGE),
        };
        let mode = CompositeMode { compositing, rays: RayMode::default() };
        let bind = |band| stage.bind(device, mode, buffers, band);
        let groups: Vec<_> = compositing_buffer.bands.iter().map(bind).collect();
        compute(gpu, |pass| stage.record(pass, mode, &groups, 0, &tiles));
        let acc = |band: &BandBuffer| readback::buffer(device, queue, &band.acc).unwrap();
        Outcome {
            acc: compositing_buffer.bands.iter().flat_map(|band| bytemuck::pod_collect_to_vec(&acc(band))).collect(),
            opaque: contents(gpu, &targets.opaque),
            opaque_tiles: contents(gpu, &targets.opaque_tiles),
        }
    }

    fn check(&self, outcome: &Outcome) {
        let Self { size, compositing, order, threshold, .. } = *self;
        let name = format!("{compositing:?} {order:?} {size:?} {} sheets", self.sheets.len());
        let [columns, rows] = tile_grid(size);
        let sheets: Vec<Buffer> = self.sheets.iter().map(|sheet| to_f64(size[0], sheet)).collect();
        let mut expected = to_f64(size[0], &self.acc);
        match order {
            Order::FrontToBack => {
                sheets.iter().for_each(|sheet| composite(&mut expected, sheet, compositing, order));
            }
            Order::BackToFront => {
                sheets.iter().rev().for_each(|sheet| composite(&mut expected, sheet, compositing, order));
            }
        }
        let actual = to_f64(size[0], &outcome.acc);
        assert_eq!(actual.pixels.len(), expected.pixels.len());
        for (i, (actual, expected)) in actual.pixels.iter().zip(&expected.pixels).enumerate() {
            let [x, y] = [i as u32 % size[0], i as u32 / size[0]];
            let is_listed = self.tiles.contains(&(y / TILE * columns + x / TILE));
            let alphas = || sheets.iter().map(|sheet| sheet.pixels[i].w);
            // Pixels on which nothing was drawn, or whose tile is not listed, stay the same to the last bit.
            if !is_listed || alphas().all(|alpha| alpha == 0.0) {
                assert_eq!(outcome.acc[i], self.acc[i], "{name}, pixel {x} {y}, listed: {is_listed}");
                continue;
            }
            let most = expected.max_element().max(1.0);
            // The errors of sheets add up, because a sheet does not enlarge those before it.
            let tolerance: f64 = alphas().map(|alpha| tolerance(compositing, alpha, most)).sum();
            let what = format_args!("{name}, pixel {x} {y} over {:?}: {actual}, not {expected}", self.acc[i]);
            assert_at_most(apart(*actual, *expected), tolerance, what);
        }
        // The masks match the compositing buffer exactly; off the image all pixels are opaque.
        let is_opaque = |x: u32, y: u32| {
            x >= size[0] || y >= size[1] || outcome.acc[(y * size[0] + x) as usize][3] >= threshold as f32
        };
        for tile in 0..columns * rows {
            let (left, top) = (tile % columns * TILE, tile / columns * TILE);
            let is_listed = self.tiles.contains(&tile);
            let words: Vec<u32> = (top..top + TILE)
                .map(|y| (0..TILE).filter(|bit| is_opaque(left + bit, y)).fold(0, |word, bit| word | 1 << bit))
                .collect();
            let flag = u32::from(words.iter().all(|&word| word == u32::MAX));
            let flag = if is_listed { flag } else { self.stale };
            assert_eq!(outcome.opaque_tiles[tile as usize], flag, "{name}, tile {tile}, listed: {is_listed}");
            for (y, word) in (top..size[1].min(top + TILE)).zip(words) {
                let word = if is_listed { word } else { self.stale };
                let actual = outcome.opaque[(y * columns + left / TILE) as usize];
                assert_eq!(actual, word, "{name}, row {y} of tile {tile}, listed: {is_listed}: {actual:#x} {word:#x}");
            }
        }
    }
}

fn check(gpu: &GpuHeadless, size: [u32; 2], bands: usize) {
    let stage = Composite::default();
    let mut random = Random(u64::from(size[0]));
    let [columns, rows] = tile_grid(size);
    let (mut opaque, mut listed) = (0, 0);
    for compositing in BY_AMOUNTS {
        for (order, layers) in [Order::FrontToBack, Order::BackToFront]
            .into_iter()
            .flat_map(|order| [1, 2, 4].map(|layers| (order, layers)))
        {
            let mut acc = random_pixels(&mut random, size, compositing == Compositing::Xray);
            // Every other tile starts with only high opacities.
            for (i, pixel) in (0..).zip(&mut acc) {
                let tile = i / size[0] / TILE * columns + i % size[0] / TILE;
                if tile % 2 == 1 {
                    *pixel = [0.25, 0.5, 0.125, random.uniform(0.9, 1.0) as f32];
                }
            }
            let case = Case {
                size,
                compositing,
                order,
                threshold: [0.5, 0.9, 1.0][random.bits() as usize % 3],
                sheets: (0..layers).map(|_| random_pixels(&mut random, size, true)).collect(),
                acc,
                // Tiles do not overlap, so their order is arbitrary.
                tiles: (0..columns * rows).rev().filter(|_| !random.bits().is_multiple_of(4)).collect(),
                stale: random.bits() as u32,
            };
            let outcome = case.run(gpu, &stage, bands);
            case.check(&outcome);
            listed += case.tiles.len();
            opaque += case.tiles.iter().filter(|&&tile| outcome.opaque_tiles[tile as usize] == 1).count();
        }
    }
    assert!(listed > 5, "{listed} tiles were composited");
    assert!(columns * rows == 1 || opaque > 0 && opaque < listed, "{opaque} of {listed} tiles became opaque");
}

#[test]
fn every_compositing_and_order() {
    let gpu = gpu();
    for size in [[1, 1], [16, 16], [61, 37], [130, 5], [7, 100], [64, 64]] {
        check(gpu, size, 1);
    }
}

#[test]
fn several_bands() {
    // Rows have 61 pixels: 33 of them fit a binding, and a band consists of whole tiles.
    check(&gpu_with_small_bindings(32768), [61, 137], 5);
}

#[test]
fn no_tile_listed() {
    let gpu = gpu();
    let size = [40, 70];
    let mut random = Random(8);
    let case = Case {
        size,
        compositing: Compositing::Linear,
        order: Order::FrontToBack,
        threshold: 0.95,
        sheets: vec![random_pixels(&mut random, size, true); 4],
        acc: random_pixels(&mut random, size, false),
        tiles: Vec::new(),
        stale: 0xdead_beef,
    };
    case.check(&case.run(gpu, &Composite::default(), 1));
}

//! `shaders/composite.wgsl` with `shaders/shared/means.wgsl` against `reference::means` and `reference::composite`: random sheets, from any
//! view, with and without cuts, some of them left out.

use bytemuck::Zeroable;
use glam::{DVec3, DVec4, UVec3};
use sheetsplat::headless::{GpuHeadless, readback};
use sheetsplat::internals::gpu::layout::SheetGroup;
use sheetsplat::internals::gpu::targets::{CompositingBuffer, Targets};
use sheetsplat::internals::gpu::uniforms;
use sheetsplat::internals::pass::composite::{Composite, CompositeBuffers, CompositeMode, CutBuffers, RayMode};
use sheetsplat::internals::quad_plan::tile_grid;
use sheetsplat::internals::reference::composite::composite;
use sheetsplat::internals::reference::{Buffer, Cuts, Means};
use sheetsplat::settings::Clip;
use sheetsplat::settings::Projection;
use sheetsplat::settings::{Compositing, Method, Order, Window};
use sheetsplat::volume::Grid;
use sheetsplat::wgpu::{self, BufferUsages};

use crate::common::compare::{apart, assert_at_most};
use crate::common::devices::gpu;
use crate::common::{BY_MEANS, Random, SPACINGS, pixels, random_eye, scene};
use crate::stages::section::Seen;
use crate::stages::{Uncut, at_offsets, compute, contents, frame_over, init, tile_list};

/// The number of sheets in a group.
const LAYERS: u32 = 4;

/// The number of groups before and behind the middle of the volume.
const REACH: i32 = 3;

/// A view from anywhere, sometimes with planes that cut.
fn random_view(random: &mut Random, compositing: Compositing) -> (Grid, Seen) {
    let dims = [(); 3].map(|()| random.uniform(1.0, 14.0) as u32);
    let grid = Grid::new(UVec3::from(dims), random.pick(&SPACINGS).into());
    let mut scene = scene(61, 37);
    scene.splatting.method = random.pick(&[Method::ImageAligned, Method::AxisAligned]);
    scene.splatting.slab_width = random.pick(&[0.3, 1.0, 2.6]);
    scene.splatting.radius = random.pick(&[1.0, 2.0, 3.1]);
    scene.splatting.compositing = compositing;
    if compositing != Compositing::Surface {
        scene.splatting.order = random.pick(&[Order::FrontToBack, Order::BackToFront]);
    }
    let oblique = random.direction();
    scene.camera.direction = random.pick(&[DVec3::Y, DVec3::NEG_Z, oblique, oblique]);
    scene.camera.up = DVec3::new(0.3, 0.1, 1.0);
    let extent = (grid.dims.as_dvec3() * grid.spacing).length();
    scene.camera.projection = Projection::Orthographic { height: Some(extent * random.uniform(0.2, 1.0)) };
    if random.bits().is_multiple_of(2) {
        scene.camera = random_eye(random, &grid);
    }
    if random.bits().is_multiple_of(2) {
        let normal = random.direction();
        scene.clip =
            Clip { planes: vec![[normal.x, normal.y, normal.z, random.uniform(-1.0, 4.0)]], ..Clip::default() };
    }
    let seen = Seen::new(&grid, scene);
    (grid, seen)
}

/// A sheet's premultiplied pixels, mostly with amounts like those of a slab with opacities of up to 1 per `unit`.
fn random_sheet(random: &mut Random, seen: &Seen) -> Vec<[f32; 4]> {
    let most = seen.scene.splatting.slab_width * random.pick(&[0.4, 1.0, 1.3]);
    (0..seen.view.size[0] * seen.view.size[1])
        .map(|_| {
            let alpha = if random.bits().is_multiple_of(30) { 0.0 } else { random.uniform(0.0, most) };
            let rgb = DVec3::from([(); 3].map(|()| random.uniform(0.0, 1.0))) * alpha;
            rgb.extend(alpha).as_vec4().to_array()
        })
        .collect()
}

/// Composites groups one after the other, each given by its first slab and the pixels of its sheets, nearest first.
fn composited(
    gpu: &GpuHeadless,
    stage: &Composite,
    (grid, seen): (&Grid, &Seen),
    groups: &[(i32, Vec<[f32; 4]>)],
) -> Buffer {
    let (device, queue, view) = (gpu.device(), gpu.queue(), &seen.view);
    let targets = Targets::new(device, view.size, wgpu::TextureFormat::Rgba32Float, LAYERS).unwrap();
    let bands = CompositingBuffer::bands(&device.limits(), view.size).unwrap();
    let compositing_buffer = CompositingBuffer::new(device, view.size, &bands);
    let uniform = |slab: i32| SheetGroup {
        near: view.slabs.plane(slab) as f32,
        number: ((slab - slabs(seen).start) / LAYERS as i32 + 1) as u32,
        ..SheetGroup::zeroed()
    };
    let (group_buffer, stride) = at_offsets(device, &groups.iter().map(|group| uniform(group.0)).collect::<Vec<_>>());
    let [columns, rows] = tile_grid(view.size);
    let tiles = tile_list(device, &(0..columns * rows).collect::<Vec<_>>());
    let (uncut, cut) =
        (Uncut::new(device), uniforms::cut(view, grid, &seen.scene, None, None, &Window::whole(view.size)));
    let rays = RayMode { cut: !seen.scene.clip.is_empty(), first_hit: false };
    let mode = CompositeMode { compositing: seen.scene.splatting.compositing, rays };
    let sheets = targets.sheets_view();
    let buffers = CompositeBuffers {
        frame: &init(device, &[frame_over(grid, &seen.scene)], BufferUsages::UNIFORM),
        groups: &group_buffer,
        sheets: &sheets,
        tiles: &tiles,
        targets: &targets,
        cut: CutBuffers { uniform: &init(device, &[cut], BufferUsages::UNIFORM), ..uncut.buffers() },
        hits: &init(device, &[0_u32], BufferUsages::STORAGE),
    };
    let bands: Vec<_> = compositing_buffer.bands.iter().map(|band| stage.bind(device, mode, buffers, band)).collect();
    for (at, (_, texels)) in (0..).zip(groups) {
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(view.size[0] * 16),
            rows_per_image: Some(view.size[1]),
        };
        queue.write_texture(
            targets.sheets.as_image_copy(),
            bytemuck::cast_slice(texels),
            layout,
            targets.sheets.size(),
        );
        compute(gpu, |pass| stage.record(pass, mode, &bands, at * stride, &tiles));
    }
    let last: Vec<u32> = contents(gpu, &targets.last_groups);
    assert!(last.iter().all(|&number| number == uniform(groups.last().unwrap().0).number), "{last:?}");
    let acc = readback::buffer(device, queue, &compositing_buffer.bands[0].acc).unwrap();
    Buffer { width: view.size[0] as usize, pixels: pixels(&acc) }
}

/// Slabs around the middle of the volume.
fn slabs(seen: &Seen) -> std::ops::Range<i32> {
    let view = &seen.view;
    let depth = view.screen_from_voxel[2].dot(seen.geometry.grid.center().extend(1.0));
    let group = ((depth - view.slabs.origin) / view.slabs.width / f64::from(LAYERS)).floor() as i32;
    (group - REACH) * LAYERS as i32..(group + REACH) * LAYERS as i32
}

/// The same by the f64 evaluation, in which a sheet that is left out is empty.
fn expected(seen: &Seen, groups: &[(i32, Vec<[f32; 4]>)]) -> Buffer {
    let (compositing, order) = (seen.scene.splatting.compositing, seen.scene.splatting.order);
    let means = Means::new(&seen.geometry, compositing, None);
    let cuts = (!seen.scene.clip.is_empty()).then(|| Cuts::new(&seen.geometry, None));
    let [width, height] = seen.view.size;
    let mut acc = Buffer::new(width, height);
    let mut all: Vec<i32> = slabs(seen).collect();
    if order == Order::BackToFront {
        all.reverse();
    }
    for slab in all {
        let mut sheet = Buffer::new(width, height);
        let group = groups.iter().find(|group| (group.0..group.0 + LAYERS as i32).contains(&slab));
        if let Some((first, texels)) = group {
            let layer = texels.chunks(sheet.pixels.len()).nth((slab - first) as usize).unwrap();
            sheet.pixels = layer.iter().map(|pixel| DVec4::from(pixel.map(f64::from))).collect();
        }
        if let Some(cuts) = cuts.as_ref().filter(|_| compositing != Compositing::Minimum) {
            cuts.apply(&mut sheet, slab);
        }
        means.apply(&mut sheet);
        let before = acc.clone();
        composite(&mut acc, &sheet, compositing, order);
        for (at, (pixel, before)) in acc.pixels.iter_mut().zip(&before.pixels).enumerate() {
            *pixel = if means.counts(at, slab) { *pixel } else { *before };
        }
    }
    acc
}

#[test]
fn any_sheets_of_any_view() {
    let (gpu, stage) = (gpu(), Composite::default());
    let mut random = Random(57);
    for compositing in BY_MEANS {
        let (mut compared, mut off, mut lit) = (0, 0, 0_usize);
        for case in 0..30 {
            let (grid, seen) = random_view(&mut random, compositing);
            // Only `Minimum` composites empty sheets.
            let leaves_out = compositing != Compositing::Minimum;
            let mut groups: Vec<(i32, Vec<[f32; 4]>)> = Vec::new();
            for slab in slabs(&seen).step_by(LAYERS as usize) {
                if !(leaves_out && random.bits().is_multiple_of(4)) {
                    let layers = (0..LAYERS).flat_map(|_| random_sheet(&mut random, &seen)).collect();
                    groups.push((slab, layers));
                }
            }
            if groups.is_empty() {
                continue;
            }
            if seen.scene.splatting.order == Order::BackToFront {
                groups.reverse();
            }
            let actual = composited(gpu, &stage, (&grid, &seen), &groups);
            let expected = expected(&seen, &groups);
            // What is stored while no surface has been reached is not visible.
            let shown =
                |pixel: &DVec4| if compositing == Compositing::Surface && pixel.w < 1.0 { DVec4::ZERO } else { *pixel };
            for (actual, expected) in actual.pixels.iter().map(shown).zip(expected.pixels.iter().map(shown)) {
                compared += 1;
                lit += usize::from(expected.w > 0.0 && expected != DVec4::W * 2.0);
                // A few ULP of the ray's own numbers, and of sums that are divided by the length of a short ray.
                let error = apart(actual, expected) / expected.abs().max_element().max(1.0);
                off += u32::from(error > 2e-4);
            }
            assert!(
                actual.pixels.iter().all(|pixel| pixel.is_finite()),
                "{compositing:?}, case {case}: {:?}",
                seen.scene
            );
        }
        println!("{compositing:?}: {off} of {compared} pixels are off, {lit} show something");
        // Where a slab's middle, an opacity or a ray lies on an edge, f32 may decide differently.
        assert_at_most(f64::from(off) / f64::from(compared), 5e-5, format_args!("{compositing:?}: pixels"));
        assert!(lit > 5000, "{compositing:?}: only {lit} pixels show something");
    }
}

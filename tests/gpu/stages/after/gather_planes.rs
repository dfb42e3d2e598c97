//! `shaders/gather_planes.wgsl`, the whole tile rasterizer of classification after splatting, against the twin's composited pixels.

use std::collections::BTreeMap;

use bytemuck::Zeroable;
use glam::DVec4;
use sheetsplat::internals::brick::BrickList;
use sheetsplat::internals::gpu::gathered_layout::GatheredLayout;
use sheetsplat::internals::gpu::layout::{FieldPlanes, Gathered, PatchRange, Tally};
use sheetsplat::internals::gpu::targets::no_surfaces;
use sheetsplat::internals::gpu::uniforms;
use sheetsplat::internals::gpu::volume_texture::VolumeTexture;
use sheetsplat::internals::kernel::Kernel;
use sheetsplat::internals::means;
use sheetsplat::internals::pass::classify::CARRIED_BYTES;
use sheetsplat::internals::pass::composite::{CutBuffers, RayMode};
use sheetsplat::internals::pass::gather::{Gather, GatherBuffers, GatherMode, GatheredPlanes, MOST_LAYERS, PlaneMode};
use sheetsplat::internals::patch_bins::{self, PatchBins, Work};
use sheetsplat::internals::plane_geometry::PlaneGeometry;
use sheetsplat::internals::reference::Host;
use sheetsplat::internals::reference::after::Frame;
use sheetsplat::settings::{Compositing, Gradient, LabelTables, Order, Ramp, Window};
use sheetsplat::volume::{Labels, Volume};
use sheetsplat::wgpu::{Buffer, BufferUsages};

use super::{
    PERSPECTIVE, Prepared, assert_hits, cases, cut, head, head_scene, resolved, shown_by, with_case, with_host,
};
use crate::common::compare::{apart, assert_at_least, decibels, root_mean_square};
use crate::common::devices::gpu;
use crate::common::{BY_AMOUNTS, BY_MEANS, Random, pixels};
use crate::stages::{at_offsets, compute, contents, init};

/// The results of the stage.
struct Drawn {
    acc: Vec<DVec4>,
    tally: Tally,
    /// The words of first hits.
    hits: Vec<u32>,
}

/// The passes to find a surface in a slab, more than needed.
fn search(prepared: &Prepared<'_>) -> u32 {
    if prepared.scene.splatting.compositing == Compositing::Surface { 500 } else { 0 }
}

/// Draws the whole image over an empty buffer, in bands of at most `band_rows` rows.
fn gathered(prepared: &Prepared<'_>, stage: &Gather, first_hit: Option<f64>, band_rows: u32) -> Drawn {
    let Prepared { gpu, view, volume, scene, .. } = prepared;
    // The stage gets no holes.
    let voxels: Vec<u32> = (0..).zip(volume.values()).filter(|(_, value)| !value.is_nan()).map(|(at, _)| at).collect();
    let list = BrickList::new(volume.grid(), &voxels);
    let bricks = list.bricks();
    let (device, queue, size, splatting) = (gpu.device(), gpu.queue(), view.size, &scene.splatting);
    let kernel = Kernel::new(splatting.radius, splatting.falloff);
    let geometry = PlaneGeometry::new(view, volume.grid());
    let covered = means::covered(view, volume.grid(), splatting);
    let bins = PatchBins::new(
        bricks,
        (view, Some(&geometry)),
        Order::FrontToBack,
        (covered, &Window::whole([1; 2]).slabs),
        kernel.support(),
        Work { search: search(prepared), threads: 8, layers: 1, looks: true },
        u64::MAX,
    )
    .unwrap();
    let mut planes = [FieldPlanes::zeroed(); MOST_LAYERS];
    planes[0] = prepared.field_planes;
    let results = GatheredLayout::new(view, &bins, bricks.len() as u32, 1);
    let gather = uniforms::gather(view, &kernel, splatting, &bins, &results);
    let [columns, _] = patch_bins::grid(size);
    let bands: Vec<(u32, u32)> =
        (0..size[1]).step_by(band_rows as usize).map(|first| (first, band_rows.min(size[1] - first))).collect();
    let range = |&(first_row, rows): &(u32, u32)| PatchRange {
        first_row,
        first_patch: first_row / patch_bins::PATCH[1] * columns,
        end_patch: (first_row / patch_bins::PATCH[1] + rows.div_ceil(patch_bins::PATCH[1])) * columns,
        row_step: 1,
    };
    let ranges: Vec<PatchRange> = bands.iter().map(range).collect();
    let empty =
        |&(_, rows): &(u32, u32)| init(device, &vec![[0.0_f32; 4]; (rows * size[0]) as usize], BufferUsages::STORAGE);
    let accs: Vec<_> = bands.iter().map(empty).collect();
    let storage = |words: &[u32]| init(device, words, BufferUsages::STORAGE);
    let words = results.hits_byte() / 4 + u64::from(size[0] * size[1]);
    let gathered = storage(&vec![0; words as usize]);
    let (ranges_buffer, stride) = at_offsets(device, &ranges);
    let half_boxes: Vec<[f32; 2]> = bins.half_boxes.iter().map(|half| half.as_vec2().to_array()).collect();
    let cut = uniforms::cut(view, volume.grid(), scene, None, first_hit, &Window::whole(size));
    let rays = RayMode { cut: !scene.clip.is_empty(), first_hit: first_hit.is_some() };
    let labels = volume.labels().map(|labels| VolumeTexture::upload_labels(device, queue, labels).unwrap());
    let mode = GatherMode::of(
        splatting,
        Some(PlaneMode {
            gradient: scene.shading.gradient,
            exact: prepared.is_exact(),
            layers: 1,
            own_colors: false,
            segments: splatting.segments(),
        }),
        view.perspective.is_some(),
        [labels.is_some(), prepared.has_holes()],
        rays,
        bins.workgroups,
    );
    let coefficients = prepared
        .is_exact()
        .then(|| VolumeTexture::upload_bits(device, queue, &super::values::numbers_of(prepared)).unwrap());
    let buffers = GatherBuffers {
        light: None,
        frame: &prepared.frame,
        gather: &init(device, &[gather], BufferUsages::UNIFORM),
        planes: Some(GatheredPlanes {
            planes: &init(device, &planes, BufferUsages::UNIFORM),
            coefficients: coefficients.as_ref().map(|texture| &texture.view),
        }),
        patch_ranges: &ranges_buffer,
        bricks: &init(device, bricks, BufferUsages::STORAGE),
        bins: &storage(&bins.words),
        control_points: &prepared.control_points,
        values: &prepared.values.view,
        pages: None,
        colors: None,
        labels: labels.as_ref().map(|texture| &texture.view),
        membership: None,
        gathered: &gathered,
        half_boxes: &init(device, &half_boxes, BufferUsages::STORAGE),
        cut: CutBuffers { uniform: &init(device, &[cut], BufferUsages::UNIFORM), surfaces: &no_surfaces(device) },
    };
    let records =
        |acc: &Buffer| init(device, &vec![0_u8; (acc.size() / 16 * CARRIED_BYTES) as usize], BufferUsages::STORAGE);
    let carried: Vec<_> = accs.iter().map(records).collect();
    let bands = accs.iter().zip(&carried);
    let bound: Vec<_> =
        bands.map(|(acc, carried)| stage.bind(device, mode, buffers, (acc, Some(carried)), bins.dispatches)).collect();
    compute(gpu, |pass| {
        for (at, range) in ranges.iter().enumerate() {
            stage.record(pass, &bound[at], at as u32 * stride, range.end_patch - range.first_patch);
        }
    });
    let left: Vec<u32> = contents(gpu, &gathered);
    let (tally, words) = left.split_at(size_of::<Gathered>() / 4 - 1);
    Drawn {
        acc: accs.iter().flat_map(|acc| pixels(&contents::<u8>(gpu, acc))).collect(),
        tally: bytemuck::pod_read_unaligned(&bytemuck::cast_slice::<u32, u8>(tally)[..size_of::<Tally>()]),
        hits: words[gather.hits as usize..].to_vec(),
    }
}

fn check(prepared: &Prepared<'_>, twin: &Frame<'_>, stage: &Gather, first_hit: Option<f64>) {
    let Prepared { scene, name, .. } = prepared;
    let drawn = gathered(prepared, stage, first_hit, u32::MAX);
    let found: Vec<DVec4> = drawn.acc.iter().map(|color| resolved(scene.splatting.compositing, *color)).collect();
    let expected: Vec<DVec4> = twin.composite().iter().map(|pixel| pixel.color).collect();
    let name = format!("{name}, {:?}", scene.splatting.compositing);
    let shown = expected.iter().filter(|color| color.w > 0.02).count();
    assert!(shown * 20 > expected.len(), "{name}: {shown} pixels");
    let rms = root_mean_square(found.iter().zip(&expected).map(|(found, expected)| apart(*found, *expected)));
    println!("{name}: {:.1} dB", decibels(rms));
    // SPEC §12 asks for 60 dB, and with the kernel's gradient for 55.
    let least = if scene.shading.gradient == Gradient::Kernel { 70.0 } else { 90.0 };
    assert_at_least(decibels(rms), least, &name);
    assert!(drawn.tally.sections_rasterized > 1000, "{name}: {:?}", drawn.tally);
    if first_hit.is_some() {
        let hits = assert_hits(prepared, twin, &drawn.hits, &name);
        assert!(hits > 20, "{name}: {hits} hits");
    }
}

#[test]
fn pixels_are_the_twins() {
    let (gpu, stage) = (gpu(), Gather::default());
    for (name, volume, mut scene) in cases() {
        for compositing in BY_AMOUNTS {
            (scene.splatting.compositing, scene.splatting.culling) = (compositing, false);
            with_case(gpu, (name, &volume, &scene), |prepared, twin| check(prepared, twin, &stage, None));
        }
    }
}

/// The same volume with noise, so that no two points of a ray have the least value.
fn uneven(volume: &Volume) -> Volume {
    let mut random = Random(23);
    let values = volume.values().iter().map(|value| value + random.uniform(0.0, 15.0) as f32).collect();
    Volume::new("uneven", volume.dims(), volume.spacing(), values).unwrap()
}

#[test]
fn chosen_numbers_and_surfaces_are_the_twins() {
    let (gpu, stage) = (gpu(), Gather::default());
    for (compositing, projection) in
        BY_MEANS.into_iter().flat_map(|compositing| [None, Some(PERSPECTIVE)].map(|eye| (compositing, eye)))
    {
        let mut scene = shown_by(compositing, projection);
        scene.splatting.culling = false;
        let head = uneven(&head([1.0, 1.3, 2.0], projection.is_none()));
        with_case(gpu, ("head", &head, &scene), |prepared, twin| check(prepared, twin, &stage, None));
        scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.6), (40.0, 1.0)]).unwrap());
        cut(&mut scene);
        let first_hit = (compositing != Compositing::Minimum).then_some(0.15);
        let host = Host { first_hit, ..Host::default() };
        with_host(gpu, host, ("cut", &head, &scene), |prepared, twin| check(prepared, twin, &stage, first_hit));
    }
}

#[test]
fn cut_pixels_first_hits_and_labels_are_the_twins() {
    let (gpu, stage) = (gpu(), Gather::default());
    let head = head([1.0, 0.8, 1.6], false);
    let values = (0..head.values().len()).map(|index| u16::from(index % 16 > 7)).collect();
    let (dims, origin) = (head.dims(), "labels".to_owned());
    let labelled = Labels { origin, dims, spacing: None, values, names: BTreeMap::new() };
    let labelled = head.clone().with_labels(labelled).unwrap();
    for (compositing, projection) in
        BY_AMOUNTS.into_iter().flat_map(|compositing| [None, Some(PERSPECTIVE)].map(|eye| (compositing, eye)))
    {
        let mut scene = head_scene(projection);
        (scene.splatting.compositing, scene.splatting.culling) = (compositing, false);
        scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.1), (40.0, 1.0)]).unwrap());
        let own =
            LabelTables { opacity: Some(Ramp::new(vec![(60.0, 0.0), (90.0, 0.9)]).unwrap()), ..LabelTables::default() };
        scene.channels[0].transfer.labels.insert(1, own);
        with_case(gpu, ("labels", &labelled, &scene), |prepared, twin| check(prepared, twin, &stage, None));
        let mut scene = head_scene(projection);
        (scene.splatting.compositing, scene.splatting.culling) = (compositing, false);
        cut(&mut scene);
        let first_hit = Some(0.15);
        let host = Host { first_hit, ..Host::default() };
        with_host(gpu, host, ("cut", &head, &scene), |prepared, twin| check(prepared, twin, &stage, first_hit));
    }
}

/// However rows are divided among bindings, the bytes are the same.
#[test]
fn bands_change_no_bit() {
    let (gpu, stage) = (gpu(), Gather::default());
    let mut scene = head_scene(None);
    scene.splatting.compositing = Compositing::Exponential;
    with_case(gpu, ("bands", &head([1.0; 3], true), &scene), |prepared, _| {
        let whole = gathered(prepared, &stage, Some(0.15), u32::MAX);
        let rows = 2 * patch_bins::PATCH[1];
        assert!(rows < prepared.view.size[1]);
        let parts = gathered(prepared, &stage, Some(0.15), rows);
        assert!(whole.acc == parts.acc && whole.hits == parts.hits);
    });
}

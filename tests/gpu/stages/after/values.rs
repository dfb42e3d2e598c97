//! `shaders/values.wgsl`: the places, numbers and differences of voxels.

use glam::DVec2;
use sheetsplat::internals::gpu::layout::{FieldVoxel, Indirect};
use sheetsplat::internals::gpu::volume_texture::{Pages, VolumeTexture};
use sheetsplat::internals::pass::values::{PlaneBuffers, Values, ValuesBuffers};
use sheetsplat::internals::reference::after::Frame;
use sheetsplat::volume::ValueSlice;
use sheetsplat::wgpu::{BufferUsages, TextureView};

use super::{Prepared, each_case, gradient_of};
use crate::common::F32;
use crate::common::compare::assert_at_most;
use crate::common::devices::gpu;
use crate::stages::shade::place_error;
use crate::stages::{compute, contents, indirect, init};

/// What a record holds that the stage did not write.
const UNTOUCHED: u32 = 0x7f7f_7f7f;

/// The records of some voxels, and [`UNTOUCHED`] for all others.
pub(super) fn records(prepared: &Prepared<'_>, places: &[u32]) -> Vec<FieldVoxel> {
    records_of(prepared, (&prepared.values.view, None), places)
}

/// As [`records`], for values that may lie in pages.
fn records_of(
    prepared: &Prepared<'_>,
    (values, pages): (&TextureView, Option<Pages<'_>>),
    places: &[u32],
) -> Vec<FieldVoxel> {
    let (gpu, device) = (prepared.gpu, prepared.gpu.device());
    let stage = Values::default();
    let coefficients =
        prepared.is_exact().then(|| VolumeTexture::upload_bits(device, gpu.queue(), &numbers_of(prepared)).unwrap());
    let coefficients = coefficients.as_ref().map(|texture| &texture.view);
    // One more place than is asked for.
    let listed: Vec<u32> = places.iter().copied().chain([0]).collect();
    let args = init(device, &[indirect(places.len() as u32)], BufferUsages::STORAGE | BufferUsages::INDIRECT);
    let arguments = Indirect { dispatch: [(places.len() as u32).div_ceil(64), 1, 1], ..indirect(places.len() as u32) };
    let dispatch = init(device, &[arguments], BufferUsages::STORAGE | BufferUsages::INDIRECT);
    let words = prepared.bricks.len() * 64 * size_of::<FieldVoxel>() / 4;
    let voxels = init(device, &vec![UNTOUCHED; words], BufferUsages::STORAGE);
    let group = stage.bind(
        device,
        ValuesBuffers {
            frame: &prepared.frame,
            bricks: &init(device, &prepared.bricks, BufferUsages::STORAGE),
            values,
            pages,
            has_holes: prepared.has_holes(),
            planes: PlaneBuffers { planes: &prepared.planes, coefficients },
            places: &init(device, &listed, BufferUsages::STORAGE),
            args: &args,
            voxels: &voxels,
        },
    );
    compute(gpu, |pass| stage.record(pass, &group, &dispatch));
    contents(gpu, &voxels)
}

/// The bits of a voxel's place in a page along each axis.
const PAGE_BITS: u32 = 3;

/// The values of a volume page by page, and the slots of all pages: the pages lie in no order, with others between them.
fn in_pages(prepared: &Prepared<'_>) -> [VolumeTexture; 2] {
    let (device, queue, grid) = (prepared.gpu.device(), prepared.gpu.queue(), prepared.volume.grid());
    let (side, voxels) = (1 << PAGE_BITS, 1_usize << (3 * PAGE_BITS));
    let across = grid.dims.map(|n| n.div_ceil(side));
    let count = across.element_product();
    // Odd factors have no common divisor with a power of two.
    let slots = (2 * count).next_power_of_two();
    let slot_of = |page: u32| page.wrapping_mul(29).wrapping_add(5) % slots;
    // Elsewhere there is a value that is somewhere else in the volume.
    let mut values = vec![prepared.volume.values().at(0); slots as usize * voxels];
    for (index, value) in (0..).zip(prepared.volume.values().iter()) {
        let (page, at) = (grid.voxel_at(index) / side, grid.voxel_at(index) % side);
        let slot = slot_of(page.x + across.x * (page.y + across.y * page.z)) as usize;
        values[slot * voxels + (at.x + side * (at.y + side * at.z)) as usize] = value;
    }
    let slots: Vec<f32> = (0..count).map(|page| f32::from_bits(slot_of(page))).collect();
    let values = VolumeTexture::upload(device, queue, ValueSlice::F32(&values)).unwrap();
    assert_eq!(values.format, prepared.values.format);
    [values, VolumeTexture::upload_bits(device, queue, &slots).unwrap()]
}

/// The coefficients as numbers.
pub(super) fn numbers_of(prepared: &Prepared<'_>) -> Vec<f32> {
    prepared.coefficients.iter().map(|&c| prepared.numbers.apply(f64::from(c)) as f32).collect()
}

fn check(prepared: &Prepared<'_>, _: &Frame<'_>) {
    let Prepared { volume, numbers, view, .. } = prepared;
    let voxels = prepared.voxels();
    // Every other voxel.
    let places: Vec<u32> = voxels.keys().copied().step_by(2).collect();
    let records = records(prepared, &places);
    let [values, slots] = in_pages(prepared);
    let pages = Pages { view: &slots.view, bits: PAGE_BITS };
    let of_pages = records_of(prepared, (&values.view, Some(pages)), &places);
    assert!(prepared.is_exact() || of_pages == records, "{}: in pages", prepared.name);
    let spread = f64::from(numbers.range[1] - numbers.range[0]);
    let mut longest = 0.0_f64;
    for (place, record) in (0..).zip(&records) {
        let Some(&voxel) = voxels.get(&place).filter(|_| places.binary_search(&place).is_ok()) else {
            assert_eq!(bytemuck::cast::<_, [u32; 6]>(*record), [UNTOUCHED; 6], "{}: {place}", prepared.name);
            continue;
        };
        let what = format!("{}: voxel {voxel}", prepared.name);
        let rows = view.screen_from_voxel.map(|row| row.dot(voxel.as_dvec3().extend(1.0)));
        let [x, y, depth, from_eye] = rows;
        let error = place_error(view, voxel, DVec2::ZERO);
        let size = from_eye.abs().max(1.0) * f64::from(view.size[0]);
        assert_at_most((f64::from(record.x) - x).abs(), error.x * from_eye.max(1.0) + F32 * size, &what);
        assert_at_most((f64::from(record.y) - y).abs(), error.y * from_eye.max(1.0) + F32 * size, &what);
        assert_at_most((f64::from(record.depth) - depth).abs(), error.z + F32 * depth.abs(), &what);
        let coefficient = f64::from(prepared.coefficients[volume.grid().index_of(voxel) as usize]);
        let number = numbers.apply(coefficient);
        assert_at_most((f64::from(record.number) - number).abs(), 2.0 * F32 * (number.abs() + 1.0), &what);
        // Differences of the values, never of the coefficients, per `unit`; 15 bits of the largest component.
        let expected = volume.gradient(voxel) * numbers.scale * volume.grid().unit();
        let most = expected.abs().max_element();
        let found = gradient_of(record);
        assert_at_most((found - expected).abs().max_element(), most / 32767.0 + 16.0 * F32 * spread, &what);
        longest = longest.max(expected.length());
    }
    assert!(longest > 0.1 * spread, "{}: no gradient", prepared.name);
}

#[test]
fn records_are_the_voxels() {
    each_case(gpu(), check);
}

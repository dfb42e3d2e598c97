//! `shaders/values.wgsl`: the places, numbers and differences of voxels.

use glam::DVec2;
use sheetsplat::internals::gpu::layout::{FieldVoxel, Indirect};
use sheetsplat::internals::gpu::volume_texture::VolumeTexture;
use sheetsplat::internals::pass::values::{PlaneBuffers, Values, ValuesBuffers};
use sheetsplat::internals::reference::after::Frame;
use sheetsplat::wgpu::BufferUsages;

use super::{Prepared, each_case, gradient_of};
use crate::common::compare::assert_at_most;
use crate::common::{F32, gpu};
use crate::shade::place_error;
use crate::{compute, contents, indirect, init};

/// What a record holds that the stage did not write.
const UNTOUCHED: u32 = 0x7f7f_7f7f;

/// The records of some voxels, and [`UNTOUCHED`] for all others.
pub(super) fn records(prepared: &Prepared<'_>, places: &[u32]) -> Vec<FieldVoxel> {
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
            values: &prepared.values.view,
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

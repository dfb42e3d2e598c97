//! A volume's values as stages read them (`shaders/shared/volume.wgsl`): each is exact to the last bit, in any format.

use glam::{DVec3, UVec3};
use sheetsplat::headless::GpuHeadless;
use sheetsplat::internals::gpu::layout::Frame;
use sheetsplat::internals::gpu::ramps::Ramps;
use sheetsplat::internals::gpu::uniforms;
use sheetsplat::internals::gpu::volume_texture::{SIDES, ValueFormat, VolumeTexture};
use sheetsplat::internals::kernel::Kernel;
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::volume::{ValueSlice, Volume};
use sheetsplat::wgpu::{BindingResource, BufferUsages};

use crate::common::devices::gpu;
use crate::common::{Random, scene, transfer};
use crate::stages::{init, written};

/// A shader that writes the bits of a value into every word of the result.
const READ: &str = concat!(
    include_str!("../../../shaders/shared/frame.wgsl"),
    include_str!("../../../shaders/shared/texels.wgsl"),
    include_str!("../../../shaders/shared/volume.wgsl"),
    "
    @group(0) @binding(1) var values: texture_2d_array<u32>;
    @group(0) @binding(2) var pages: texture_2d_array<u32>;
    @group(0) @binding(3) var<storage, read_write> result: array<u32>;
    @compute @workgroup_size(64)
    fn main(@builtin(global_invocation_id) id: vec3u, @builtin(workgroup_id) workgroup: vec3u) {
        start(workgroup.z);
        let at = id.x + id.y * 64u * 32768u;
        if at < arrayLength(&result) { result[at] = bitcast<u32>(value_at(at)); }
    }"
);

/// A frame with the format of values for the shader.
fn frame(values: ValueFormat) -> Frame {
    let mut scene = scene(8, 8);
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 1.0)]);
    let volume = Volume::new("one", UVec3::ONE, DVec3::ONE, vec![0.0]).unwrap();
    let view = ViewGeometry::new(volume.grid(), &scene.camera, &scene.splatting, [8; 2]).unwrap();
    let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
    let ramps = Ramps::new(&scene.channels[0].transfer.resolve(&volume));
    uniforms::frame(&view, &kernel, (volume.grid(), values), &ramps, &scene)
}

/// Uploads values in layers of this side and lets a shader read them.
fn seen(gpu: &GpuHeadless, values: ValueSlice<'_>, side: u32) -> Vec<f32> {
    seen_by(gpu, READ, values, side)
}

/// The same with this shader source.
fn seen_by(gpu: &GpuHeadless, source: &str, values: ValueSlice<'_>, side: u32) -> Vec<f32> {
    let device = gpu.device();
    let uploaded = VolumeTexture::upload_folded(device, gpu.queue(), values, side);
    let frame = init(device, &[frame(uploaded.format)], BufferUsages::UNIFORM);
    // Voxels are not in pages, so that any texture stands for theirs.
    let texture = || BindingResource::TextureView(&uploaded.view);
    let given = [frame.as_entire_binding(), texture(), texture()];
    written(gpu, source, &given, values.len() as u64)
}

/// Checks the format and the bits that are read back, for layers of every side.
fn check(name: &str, values: &[f32], format: ValueFormat) {
    let gpu = gpu();
    assert_eq!(ValueFormat::of(values.into()), format, "{name}");
    for side in SIDES {
        let seen = seen(gpu, values.into(), side);
        let differs = (0..values.len()).find(|&at| seen[at].to_bits() != values[at].to_bits());
        assert_eq!(differs.map(|at| (at, values[at], seen[at])), None, "{name}, side {side}");
    }
}

/// Random whole numbers in a range, including both its ends.
fn whole(count: usize, [least, greatest]: [i32; 2]) -> Vec<f32> {
    let (mut random, values) = (Random(7), f64::from(greatest) - f64::from(least) + 1.0);
    let inside = (2..count).map(|_| least + (random.uniform(0.0, values) as i32));
    inside.chain([greatest, least]).map(|value| value as f32).collect()
}

#[test]
fn small_ranges_take_a_byte() {
    check("bytes", &whole(5000, [0, 255]), ValueFormat::Offset8(0.0));
    check("below 0", &whole(5000, [-200, 55]), ValueFormat::Offset8(-200.0));
    check("around 0", &whole(5000, [-1, 1]), ValueFormat::Offset8(-1.0));
    check("large", &whole(5000, [(1 << 24) - 255, 1 << 24]), ValueFormat::Offset8(16_776_961.0));
    check("one", &[7.0], ValueFormat::Offset8(7.0));
}

#[test]
fn larger_ones_take_two() {
    check("256", &whole(5000, [0, 256]), ValueFormat::Offset16(0.0));
    check("Hounsfield units", &whole(5000, [-1024, 3071]), ValueFormat::Offset16(-1024.0));
    check("65535", &whole(5000, [-32768, 32767]), ValueFormat::Offset16(-32768.0));
    check("far below 0", &whole(5000, [-(1 << 24), 65535 - (1 << 24)]), ValueFormat::Offset16(-16_777_216.0));
}

#[test]
fn all_others_are_kept_as_they_are() {
    check("65536", &whole(5000, [0, 65536]), ValueFormat::Bits);
    let large = 16_777_218.0;
    check("beyond 2^24", &[large, large + 2.0], ValueFormat::Bits);
    check("beyond -2^24", &[-large, -large + 2.0], ValueFormat::Bits);
    check("beyond i32", &[2.0_f32.powi(31), 2.0_f32.powi(31), 2.0_f32.powi(40)], ValueFormat::Bits);
    check("fractions", &[0.0, 1.0, 1.5, 2.0], ValueFormat::Bits);
    check("signed 0", &[-0.0, 0.0, 1.0], ValueFormat::Bits);
    let ends = [f32::MAX, f32::MIN_POSITIVE, f32::from_bits(1), f32::EPSILON];
    check("ends", &ends.into_iter().chain(ends.map(|value| -value)).collect::<Vec<_>>(), ValueFormat::Bits);
    let mut random = Random(3);
    let anything = std::iter::repeat_with(|| f32::from_bits(random.bits() as u32)).filter(|value| value.is_finite());
    check("anything", &anything.take(5000).collect::<Vec<_>>(), ValueFormat::Bits);
}

/// The bits of holes are read back, too, and distinguish them from all other values; the result marks them.
#[test]
fn holes_are_told_by_their_bits() {
    const MARK: u32 = 0xffc0_0001;
    let gpu = gpu();
    let mut random = Random(8);
    let anything = std::iter::repeat_with(|| f32::from_bits(random.bits() as u32));
    let values: Vec<f32> = anything.take(5000).chain([f32::MAX, f32::MIN, 0.0, -0.0, f32::NAN]).collect();
    let volume = Volume::new("holes", UVec3::new(values.len() as u32, 1, 1), DVec3::ONE, values.clone()).unwrap();
    assert!(volume.holes() > 20);
    assert_eq!(ValueFormat::of(ValueSlice::F32(&[1.0, f32::NAN, 2.0])), ValueFormat::Bits);
    let marked = READ.replace(
        "bitcast<u32>(value_at(at))",
        &format!("select(bitcast<u32>(value_at(at)), {MARK}u, is_hole(stored_at(at)))"),
    );
    assert_ne!(marked, READ);
    let seen = seen_by(gpu, &marked, volume.values(), SIDES[0]);
    for (seen, value) in seen.into_iter().zip(values) {
        let expected = if value.is_finite() { value.to_bits() } else { MARK };
        assert_eq!(seen.to_bits(), expected, "{value}");
    }
}

/// There are more values than are sent at a time: in layers of the smallest side the second chunk begins a layer, in others it continues
/// the first.
#[test]
fn layers_go_on_where_they_were_left() {
    let mut values = whole(2048 * 2050 + 77, [-1000, 9000]);
    check("two bytes", &values, ValueFormat::Offset16(-1000.0));
    // A single value decides, wherever it is.
    *values.last_mut().unwrap() = 0.5;
    check("four", &values, ValueFormat::Bits);
    values[3] = -0.0;
    *values.last_mut().unwrap() = 1.0;
    assert_eq!(ValueFormat::of((&values).into()), ValueFormat::Bits);
}

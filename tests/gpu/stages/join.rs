//! `shaders/join.wgsl`: random images of channels that share no sheets, against their sums and the nearest ones of them (SPEC §10).

use bytemuck::Zeroable;
use glam::DVec4;
use sheetsplat::headless::{GpuHeadless, readback};
use sheetsplat::internals::gpu::layout::Cut;
use sheetsplat::internals::gpu::targets::{CompositingBuffer, no_surfaces};
use sheetsplat::internals::pass::composite::CutBuffers;
use sheetsplat::internals::pass::join::{Join, JoinBuffers, JoinMode};
use sheetsplat::settings::Compositing;
use sheetsplat::wgpu::BufferUsages;

use crate::common::compare::{apart, assert_at_most};
use crate::common::devices::{gpu, gpu_with_small_bindings};
use crate::common::{F32, Random};
use crate::stages::{compute, frame, init};

/// A channel's pixels as the compositing buffer stores them, what they stand for, and the sheet depths of their first hits.
struct Channel {
    stored: Vec<[f32; 4]>,
    colors: Vec<DVec4>,
    depths: Vec<Option<f32>>,
}

impl Channel {
    fn random(random: &mut Random, compositing: Compositing, pixels: usize) -> Self {
        // Some are equal.
        let depths: Vec<Option<f32>> =
            (0..pixels).map(|_| random.pick(&[None, Some(-1.5), Some(2.0), Some(3.25)])).collect();
        let colors: Vec<DVec4> = (depths.iter())
            .map(|depth| {
                let alpha = match (compositing, depth) {
                    (Compositing::Surface, Some(_)) => 1.0,
                    (Compositing::Surface, None) => 0.0,
                    _ => random.uniform(0.1, 1.0),
                };
                let color = glam::DVec3::from([(); 3].map(|()| random.uniform(0.0, 1.0))) * alpha;
                color.extend(alpha).as_vec4().as_dvec4()
            })
            .collect();
        let stored = |color: &DVec4| {
            let alpha = if compositing == Compositing::Minimum { 2.0 - color.w } else { color.w };
            color.truncate().extend(alpha).as_vec4().to_array()
        };
        Self { stored: colors.iter().map(stored).collect(), colors, depths }
    }
}

fn check(gpu: &GpuHeadless, size: [u32; 2], band_count: usize) {
    let (device, queue) = (gpu.device(), gpu.queue());
    let stage = Join::default();
    let mut random = Random(19);
    let pixels = (size[0] * size[1]) as usize;
    let bands = CompositingBuffer::bands(&device.limits(), size).unwrap();
    assert_eq!(bands.len(), band_count);
    // Depths are sheet depths.
    let cut = Cut { sheet_along: [0.0, 0.0, 1.0, 0.0], ..Cut::zeroed() };
    let cut = init(device, &[cut], BufferUsages::UNIFORM);
    let surfaces = no_surfaces(device);
    for (nearest, first_hit, compositing) in
        [(false, false, Compositing::Minimum), (false, true, Compositing::Maximum), (true, true, Compositing::Surface)]
    {
        let mode = JoinMode { nearest, first_hit };
        let frame = frame(|scene| {
            (scene.image.width, scene.image.height) = (size[0], size[1]);
            scene.splatting.compositing = compositing;
        });
        let frame = init(device, &[frame], BufferUsages::UNIFORM);
        let joined = CompositingBuffer::new(device, size, &bands);
        let words = if first_hit { pixels } else { 1 };
        let joined_hits = init(device, &vec![0_u32; words], BufferUsages::STORAGE | BufferUsages::COPY_SRC);
        let channels = [(); 3].map(|()| Channel::random(&mut random, compositing, pixels));
        for channel in &channels {
            let own = CompositingBuffer::new(device, size, &bands);
            let bits = |depth: &Option<f32>| depth.map_or(0, f32::to_bits);
            let hits: Vec<u32> = channel.depths.iter().map(bits).take(words).collect();
            let hits = init(device, &hits, BufferUsages::STORAGE);
            let buffers = JoinBuffers {
                frame: &frame,
                hits: (&hits, 0),
                joined_hits: &joined_hits,
                cut: CutBuffers { uniform: &cut, surfaces: &surfaces },
            };
            let groups: Vec<_> = (own.bands.iter().zip(&joined.bands))
                .map(|(band, all)| {
                    let first = (band.band.first_row * size[0]) as usize;
                    let count = (band.band.rows * size[0]) as usize;
                    let stored = &channel.stored[first..first + count];
                    queue.write_buffer(&band.acc, 0, bytemuck::cast_slice(stored));
                    (stage.bind(device, mode, buffers, (band, all)), count as u32)
                })
                .collect();
            compute(gpu, |pass| stage.record(pass, mode, groups.iter().map(|(group, pixels)| (group, *pixels))));
        }
        let found: Vec<[f32; 4]> = (joined.bands.iter())
            .flat_map(|band| {
                let bytes = readback::buffer(device, queue, &band.acc).unwrap();
                bytemuck::pod_collect_to_vec::<_, [f32; 4]>(&bytes)
            })
            .collect();
        let found_hits: Vec<u32> =
            bytemuck::pod_collect_to_vec(&readback::buffer(device, queue, &joined_hits).unwrap());
        for pixel in 0..pixels {
            let depth = |channel: &Channel| channel.depths[pixel].unwrap_or(f32::INFINITY);
            let least = channels.iter().map(depth).fold(f32::INFINITY, f32::min);
            let counted = channels.iter().filter(|channel| !nearest || depth(channel) == least);
            let expected: DVec4 = counted.map(|channel| channel.colors[pixel]).sum();
            let actual = DVec4::from(found[pixel].map(f64::from));
            let what = format!("{mode:?} {compositing:?} pixel {pixel}: {actual}, not {expected}");
            assert_at_most(apart(actual, expected), 8.0 * F32, what);
            if first_hit {
                let expected = if least.is_finite() { least.to_bits() } else { 0 };
                assert_eq!(found_hits[pixel], expected, "{mode:?} pixel {pixel}");
            }
        }
    }
}

#[test]
fn images_are_added_or_the_nearest_is_taken() {
    check(gpu(), [61, 37], 1);
}

#[test]
fn in_several_bands() {
    // Rows have 61 pixels: 33 of them fit a binding, and a band consists of whole tiles. First hits of all pixels fit one, too.
    check(&gpu_with_small_bindings(32768), [61, 134], 5);
}

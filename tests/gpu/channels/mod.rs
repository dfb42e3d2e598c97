//! Several channels (SPEC §10): scenes that name them, and images whose sheets are sums over them.

mod cases;
mod colors;
mod fusion;
mod gpu;
mod images;
mod scenes;
mod segmentation;
mod sums;

use glam::UVec3;
use sheetsplat::headless::{Backend, Headless, HeadlessOptions, Rendering};
use sheetsplat::scene::{Channel, Scene, TransferSettings, VolumeSource};
use sheetsplat::settings::{Classification, Compositing, Projection};
use sheetsplat::volume::{Channels, Volume};

use crate::common::{Random, SPACINGS, random_eye, random_volume, scene, transfer};

/// The backends without a GPU.
const NATIVE: [Backend; 2] = [Backend::Cpu, Backend::Reference];

fn draw(backend: Backend, volume: &Volume, scene: &Scene) -> Rendering {
    let headless = Headless::new(&HeadlessOptions::default().with_backend(backend)).unwrap();
    headless.render_volume(volume.clone(), scene).unwrap()
}

/// The settings of a channel of a volume in memory.
fn channel(transfer: TransferSettings) -> Channel {
    let mut channel = Channel::new(VolumeSource::Memory);
    channel.transfer = transfer;
    channel
}

/// Gives a scene transfer functions for all channels.
fn set_transfers(scene: &mut Scene, transfers: &[TransferSettings]) {
    scene.channels = Channels::of(transfers.iter().cloned().map(channel)).unwrap();
}

/// A volume of the channels in another order.
fn joined(channels: &[&Volume]) -> Volume {
    let others = channels[1..].iter().map(|channel| single(channel)).collect();
    single(channels[0]).with_channels("test", others).unwrap()
}

/// A channel by itself.
fn single(channel: &Volume) -> Volume {
    channel.clone().with_channels("test", Vec::new()).unwrap()
}

/// Balls in haze, different ones in every channel, and a scene that shows them in different colours, some with gradient opacity, some with
/// iso-ranges. Nothing is culled.
fn random_case(random: &mut Random, count: usize) -> (Volume, Scene) {
    let spacing = random.pick(&SPACINGS);
    let first = random_volume(random, (8.0, 15.0), spacing);
    let (dims, spacing) = (first.dims(), first.spacing());
    let others = (1..count).map(|_| {
        let values = (0..dims.element_product()).map(|index| {
            let voxel = UVec3::new(index % dims.x, index / dims.x % dims.y, index / dims.x / dims.y).as_dvec3();
            let wave = ((voxel * 0.7).element_sum() + random.uniform(0.0, 0.4)).sin();
            if random.bits().is_multiple_of(97) { f32::NAN } else { (wave * 100.0 + 120.0) as f32 }
        });
        Volume::new("waves", dims, spacing, values.collect()).unwrap()
    });
    let volume = first.with_channels("test", others.collect()).unwrap();
    let mut scene = scene(random.uniform(24.0, 40.0) as u32, random.uniform(24.0, 40.0) as u32);
    scene.camera.direction = random.direction();
    scene.camera.up = random.direction();
    if random.bits().is_multiple_of(3) {
        scene.camera = random_eye(random, volume.grid());
    } else {
        scene.camera.projection = Projection::Orthographic { height: None };
    }
    scene.splatting.culling = false;
    scene.splatting.slab_width = random.pick(&[0.6, 1.0, 1.7]);
    scene.shading.enabled = random.pick(&[true, false]);
    let transfers: Vec<TransferSettings> = (0..count)
        .map(|_| {
            let color = |random: &mut Random| [(); 3].map(|()| random.uniform(0.0, 1.0));
            let low = random.uniform(10.0, 150.0);
            let ramp = [(low, 0.0), (low + 60.0, random.uniform(0.1, 0.9))];
            let mut transfer = transfer(&[(0.0, color(random)), (200.0, color(random))], &ramp);
            if random.bits().is_multiple_of(3) {
                let factors = vec![(0.0, 0.3), (60.0, 1.0)];
                transfer.gradient_opacity = Some(sheetsplat::settings::Ramp::new(factors).unwrap());
            }
            if random.bits().is_multiple_of(3) {
                transfer.iso_ranges = Some(vec![[0.0, 190.0]]);
            }
            transfer
        })
        .collect();
    set_transfers(&mut scene, &transfers);
    (volume, scene)
}

/// The compositings whose sheets are sums over channels before splatting.
const BY_SUMS: [Compositing; 4] =
    [Compositing::Linear, Compositing::Exponential, Compositing::Xray, Compositing::Surface];

/// Both ways to classify.
const CLASSIFICATIONS: [Classification; 2] = [Classification::Before, Classification::After];

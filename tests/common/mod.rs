//! What the GPU tests share.

use glam::{DVec3, DVec4};
use sheetsplat::camera::{Camera, Projection};
use sheetsplat::gpu::device::DeviceRequirements;
use sheetsplat::headless::{Headless, HeadlessOptions};
use sheetsplat::scene::{ImageSettings, Scene, TransferSettings, VolumeSource};
use sheetsplat::transfer_function::Ramp;
use sheetsplat::wgpu::{Features, Limits, TextureFormat};

/// What rounding to the nearest f32 changes at most, relative.
pub(crate) const F32: f64 = 1.0 / (1 << 24) as f64;
/// What rounding to the nearest f16 changes at most, relative; below 2⁻¹⁴ half a step of 2⁻²⁴ instead.
pub(crate) const F16: f64 = 1.0 / (1 << 11) as f64;

/// Mesa's software driver: the tests compare images on it, so that they mean the same on every machine.
pub(crate) fn lavapipe() -> HeadlessOptions {
    HeadlessOptions { adapter: Some("llvmpipe".to_owned()), ..HeadlessOptions::default() }
}

/// A device as the program opens it, with f32 sheets. Without any GPU or software driver the test fails.
pub(crate) fn gpu() -> Headless {
    let options = HeadlessOptions { sheet_format: Some(TextureFormat::Rgba32Float), ..lavapipe() };
    Headless::new(&options).unwrap_or_else(|error| panic!("these tests need Mesa's lavapipe: {error}"))
}

/// A device with WebGPU's default limits, but for storage bindings of at most so many bytes.
pub(crate) fn gpu_with_small_bindings(bytes: u64) -> Headless {
    let limits = Limits { max_storage_buffer_binding_size: bytes, ..Limits::default() };
    let options = HeadlessOptions {
        requirements: Some(DeviceRequirements { features: Features::FLOAT32_BLENDABLE, limits }),
        sheet_format: Some(TextureFormat::Rgba32Float),
        ..lavapipe()
    };
    Headless::new(&options).unwrap_or_else(|error| panic!("these tests need Mesa's lavapipe: {error}"))
}

/// Four f32 per pixel, as read back.
pub(crate) fn pixels(bytes: &[u8]) -> Vec<DVec4> {
    bytemuck::pod_collect_to_vec::<_, [f32; 4]>(bytes).iter().map(|pixel| DVec4::from(pixel.map(f64::from))).collect()
}

/// A scene for a volume that the test brings itself.
pub(crate) fn scene(width: u32, height: u32) -> Scene {
    let image = ImageSettings { width, height, ..ImageSettings::default() };
    Scene { image, ..Scene::new(VolumeSource::Builtin("cube".to_owned())) }
}

/// An orthographic camera that shows `height` world units.
pub(crate) fn camera(direction: [f64; 3], height: f64) -> Camera {
    let projection = Projection::Orthographic { height: Some(height) };
    Camera { projection, direction: DVec3::from(direction), ..Camera::default() }
}

/// Control points of a colour and an opacity ramp.
pub(crate) fn transfer(color: &[(f64, [f64; 3])], opacity: &[(f64, f64)]) -> TransferSettings {
    TransferSettings {
        color: Some(Ramp::new(color.iter().map(|&(at, rgb)| (at, DVec3::from(rgb))).collect()).unwrap()),
        opacity: Some(Ramp::new(opacity.to_vec()).unwrap()),
        ..TransferSettings::default()
    }
}

/// SplitMix64: the same numbers in every run.
#[derive(Debug)]
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// 64 random bits.
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [low, high).
    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A direction, uniform over the sphere.
    pub(crate) fn direction(&mut self) -> DVec3 {
        loop {
            let p = DVec3::from_array([(); 3].map(|()| self.uniform(-1.0, 1.0)));
            if (0.1..1.0).contains(&p.length()) {
                return p.normalize();
            }
        }
    }
}

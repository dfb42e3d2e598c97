//! Volumes whose values take few bits.

use glam::DVec3;
use sheetsplat::Scene;
use sheetsplat::volume::{Volume, builtin};

use super::{scene, transfer};

/// Volumes of 8 and 16 bits, with and without a sign; the bytes of their values; and a scene that shows much of them.
pub(crate) fn cases() -> Vec<(Volume, usize, Scene)> {
    let head = builtin::volume("head:24").unwrap();
    let cases = [(1.0, 0.0, 1), (0.5, -64.0, 1), (200.0, 0.0, 2), (200.0, -20_000.0, 2)];
    let case = |(slope, intercept, bytes): (f32, f32, usize)| {
        let mut values: Vec<f32> = head.values().iter().map(|value| (value * slope).floor() + intercept).collect();
        values[0] = 0.0;
        let volume = Volume::new("head", head.dims(), DVec3::new(1.0, 1.2, 0.9), values).unwrap();
        let at = |value: f64| value * f64::from(slope) + f64::from(intercept);
        let mut scene = scene(96, 80);
        scene.camera.direction = DVec3::new(0.4, 0.9, -0.3);
        scene.splatting.culling = false;
        scene.channels[0].transfer = transfer(
            &[(at(40.0), [0.9, 0.6, 0.4]), (at(220.0), [1.0, 1.0, 0.9])],
            &[(at(30.0), 0.0), (at(80.0), 0.15), (at(200.0), 0.9)],
        );
        (volume, bytes, scene)
    };
    cases.into_iter().map(case).collect()
}

/// The same volume with the sign of its first value, a zero, which only `f32` holds.
pub(crate) fn as_f32(volume: &Volume) -> Volume {
    let mut values = volume.values().to_vec();
    values[0] = -0.0;
    let volume = Volume::new("head", volume.dims(), volume.spacing(), values).unwrap();
    assert_eq!(volume.values().bytes(), 4 * volume.values().len());
    volume
}

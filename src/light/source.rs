//! Where the light of a stack of light sheets comes from.

use glam::DVec3;

use crate::scene::Scene;
use crate::settings::camera::Camera;
use crate::settings::shading::Shading;

/// A stack of sheets depends on this besides the matter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LightSource {
    /// The unit vector to the light.
    pub(crate) to_light: DVec3,
    /// The camera's.
    pub(crate) up: DVec3,
    /// In `unit`s² per `unit`.
    pub(crate) spread: f64,
    /// In `unit`s.
    pub(crate) step: f64,
    /// Radius and falloff.
    pub(crate) kernel: [f64; 2],
}

impl LightSource {
    /// Its fields by name, as text.
    pub(crate) fn fields(&self) -> [(&'static str, String); 5] {
        let Self { to_light, up, spread, step, kernel } = self;
        [
            ("to_light", format!("{:?}", to_light.to_array())),
            ("up", format!("{:?}", up.to_array())),
            ("spread", spread.to_string()),
            ("step", step.to_string()),
            ("kernel", format!("{kernel:?}")),
        ]
    }
}

/// The sources of the stacks of occlusion and of shadow that a scene with a framed camera has.
pub(crate) fn sources(scene: &Scene, camera: &Camera) -> [Option<LightSource>; 2] {
    let Shading { occlusion, occlusion_spread, shadow, shadow_spread, light_step: step, light, .. } = scene.shading;
    let basis = camera.basis();
    let front = -basis.w;
    let source = |(amount, spread, to_light): (f64, f64, DVec3)| {
        let kernel = [scene.splatting.radius, scene.splatting.falloff];
        let is_wanted = amount > 0.0 && scene.shading.enabled;
        is_wanted.then_some(LightSource { to_light, up: camera.up, spread, step, kernel })
    };
    let to_light = light.direction(&basis).unwrap_or(front);
    [(occlusion, occlusion_spread, front), (shadow, shadow_spread, to_light)].map(source)
}

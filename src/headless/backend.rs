//! The choice of a backend (SPEC §12).

use super::HeadlessOptions;
#[cfg(feature = "gpu")]
use super::device;
use crate::rendering::Backend;
use crate::scene::Scene;
#[cfg(feature = "gpu")]
use crate::settings::splatting::Rasterizer;

impl Backend {
    /// The backend that draws; scenes can decide where the options leave the choice.
    pub(super) fn resolved<'a>(options: &HeadlessOptions, scenes: impl IntoIterator<Item = &'a Scene>) -> Self {
        match options.backend {
            Self::Auto if wants_gpu(options, scenes) => Self::Gpu,
            Self::Auto => Self::Cpu,
            named => named,
        }
    }
}

/// Whether options ask for the GPU.
#[cfg(feature = "gpu")]
fn names_gpu(options: &HeadlessOptions) -> bool {
    let HeadlessOptions { backend: _, adapter, requirements, sheet_format, sheets_per_group, rasterizer, profile } =
        options;
    adapter.is_some()
        || requirements.is_some()
        || sheet_format.is_some()
        || sheets_per_group.is_some()
        || *rasterizer != Rasterizer::Auto
        || *profile
}

/// Whether a scene needs the GPU.
#[cfg(feature = "gpu")]
fn is_for_gpu(scene: &Scene) -> bool {
    scene.splatting.rasterizer != Rasterizer::Auto || !is_drawn_by_cpu(scene)
}

/// Whether options or scenes need the GPU, or a GPU that is no software driver can run the renderer.
#[cfg(feature = "gpu")]
fn wants_gpu<'a>(options: &HeadlessOptions, scenes: impl IntoIterator<Item = &'a Scene>) -> bool {
    cfg!(not(feature = "cpu")) || names_gpu(options) || scenes.into_iter().any(is_for_gpu) || device::has_gpu()
}

/// Without the feature `gpu` no GPU can be chosen.
#[cfg(not(feature = "gpu"))]
fn wants_gpu<'a>(_: &HeadlessOptions, _: impl IntoIterator<Item = &'a Scene>) -> bool {
    false
}

/// Whether the native backend draws every setting of a scene.
#[cfg(all(feature = "gpu", feature = "cpu"))]
fn is_drawn_by_cpu(scene: &Scene) -> bool {
    crate::cpu::check(scene).is_ok()
}

/// The native backend is not compiled in.
#[cfg(all(feature = "gpu", not(feature = "cpu")))]
fn is_drawn_by_cpu(_: &Scene) -> bool {
    false
}

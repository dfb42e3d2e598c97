//! The backends that compute images (SPEC §12), and how one is chosen.

use std::fmt;
use std::str::FromStr;

use super::HeadlessOptions;
#[cfg(feature = "gpu")]
use super::device;
use crate::scene::Scene;
#[cfg(feature = "gpu")]
use crate::settings::splatting::Rasterizer;

/// The program part that computes an image (SPEC §12).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Backend {
    /// The GPU where one can run the renderer and is no software driver, else the CPU. Naming an adapter or a rasterizer chooses the GPU, and
    /// so do options and settings that only the GPU supports.
    #[default]
    Auto,
    /// wgpu: a GPU, or a software driver.
    Gpu,
    /// The processor's cores, without a driver: [`cpu`](crate::cpu).
    Cpu,
    /// The slow f64 evaluation that the other backends are tested against.
    Reference,
}

impl Backend {
    /// All backends.
    pub const ALL: [Self; 4] = [Self::Auto, Self::Gpu, Self::Cpu, Self::Reference];

    /// The name in scenes and on the command line: `auto`, `gpu`, `cpu`, `reference`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Gpu => "gpu",
            Self::Cpu => "cpu",
            Self::Reference => "reference",
        }
    }

    /// The backend that draws; scenes can decide where the options leave the choice.
    pub(super) fn resolved<'a>(options: &HeadlessOptions, scenes: impl IntoIterator<Item = &'a Scene>) -> Self {
        match options.backend {
            Self::Auto if wants_gpu(options, scenes) => Self::Gpu,
            Self::Auto => Self::Cpu,
            named => named,
        }
    }
}

impl fmt::Display for Backend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Backend {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let named = Self::ALL.into_iter().find(|backend| backend.name() == name);
        named.ok_or_else(|| format!("allowed: {}", Self::ALL.map(Self::name).join(", ")))
    }
}

/// Whether options or scenes need the GPU, or a GPU that is no software driver can run the renderer.
#[cfg(feature = "gpu")]
fn wants_gpu<'a>(options: &HeadlessOptions, scenes: impl IntoIterator<Item = &'a Scene>) -> bool {
    let HeadlessOptions { backend: _, adapter, requirements, sheet_format, sheets_per_group, rasterizer, profile } =
        options;
    let is_named = adapter.is_some()
        || requirements.is_some()
        || sheet_format.is_some()
        || sheets_per_group.is_some()
        || *rasterizer != Rasterizer::Auto
        || *profile;
    let is_for_gpu = |scene: &Scene| scene.splatting.rasterizer != Rasterizer::Auto || !is_drawn_by_cpu(scene);
    cfg!(not(feature = "cpu")) || is_named || scenes.into_iter().any(is_for_gpu) || device::has_gpu()
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

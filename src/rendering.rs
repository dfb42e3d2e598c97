//! Images with their statistics, and the backends that compute them (SPEC §12).

use std::fmt;
use std::str::FromStr;

use crate::image::Image;
use crate::stats::Stats;

/// An image with its statistics.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendering {
    /// The image, over the scene's background.
    pub image: Image,
    /// Its counts and times.
    pub stats: Stats,
}

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

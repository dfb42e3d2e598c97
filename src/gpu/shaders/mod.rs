//! Shader sources: every stage's own file, preceded by the files that it imports, and those that these import. Each WGSL file says at its head what it
//! imports, in lines `// #import FILE`.

mod files;
mod imports;

use files::{FILES, IMPORTS};
use imports::Order;

/// A stage's name, and the files that its source is assembled from. Each file is in the program once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shader {
    /// The stage's name, which is also its file's name.
    pub stage: &'static str,
    /// Imports that mean different files in different shaders, each with a file that stands for it here. Several may stand for one.
    pub variant: &'static [(&'static str, &'static str)],
    /// The parts of the source in order: each file's path below `shaders/`, and its text. Files follow those that they import.
    pub files: &'static [(&'static str, &'static str)],
}

/// A stage, whose files are found from its own or, if that does not have the entry point, from the file that has.
macro_rules! shader {
    ($stage:literal) => {
        shader!($stage from $stage)
    };
    ($stage:literal from $first:literal $(, $import:literal = $file:literal)*) => {{
        const VARIANT: &[(&str, &str)] = &[$(($import, $file)),*];
        const ORDER: Order<{ FILES.len() }> = Order::new(FILES, IMPORTS, $first, VARIANT);
        const PARTS: [(&str, &str); ORDER.count] = ORDER.parts(FILES);
        Shader { stage: $stage, variant: VARIANT, files: &PARTS }
    }};
}

/// The stage's variants for every kind of [`Lanes`].
macro_rules! of_lanes {
    ($stage:literal $(, $import:literal = $file:literal)*) => {
        [
            shader!($stage from "gather/subgroup_main", "gather/lanes" = "gather/subgroup_lanes",
                "gather/barrier" = "gather/subgroup_barrier" $(, $import = $file)*),
            shader!($stage from "gather/subgroup_main", "gather/lanes" = "gather/subgroup_lanes",
                "gather/barrier" = "gather/workgroup_barrier" $(, $import = $file)*),
            shader!($stage from "gather/workgroup_main", "gather/lanes" = "gather/workgroup_lanes",
                "gather/barrier" = "gather/workgroup_barrier" $(, $import = $file)*),
        ]
    };
}

/// Finds the bricks that a sheet group visits.
pub const CULL_BRICKS: Shader = shader!("cull_bricks");
/// Finds the voxels that a sheet group draws.
pub const CULL_VOXELS: Shader = shader!("cull_voxels");
/// Lists the voxels that are drawn without gaps.
pub const COMPACT: Shader = shader!("compact");
/// Shades the voxels that were not shaded before.
pub const SHADE: Shader = shader!("shade");
/// Marks the tiles that splats touch.
pub const TILES: Shader = shader!("tiles");
/// Zeroes the sheet buffers in these tiles.
pub const CLEAR: Shader = shader!("clear");
/// Draws footprints into the sheet buffers.
pub const SPLAT: Shader = shader!("splat");
/// Draws footprints in perspective into the sheet buffers.
pub const SPLAT_PERSPECTIVE: Shader = shader!("splat_perspective");
/// Draws whole kernels, each composited by itself.
pub const SAMPLE: Shader = shader!("sample");
/// Composites the sheet buffers.
pub const COMPOSITE: Shader = shader!("composite");
/// Finds the values and gradients of voxels that are drawn onto slab planes.
pub const VALUES: Shader = shader!("values");
/// Draws them onto a slab plane.
pub const FIELD: Shader = shader!("field");
/// Draws colours of voxels' own onto a slab plane.
pub const FIELD_COLORS: Shader = shader!("field_colors");
/// Classifies, shades and composites slabs between planes.
pub const CLASSIFY: Shader = shader!("classify");
/// Computes the occlusion buffer.
pub const OCCLUDE: Shader = shader!("occlude");
/// Draws whole tiles from front to back, for every kind of [`Lanes`].
pub const GATHER: [Shader; 3] = of_lanes!(
    "gather",
    "gather/reach" = "gather/sheet_reach",
    "gather/stage" = "gather",
    "gather/stage" = "gather/amounts",
    "gather/stage" = "gather/economies",
    "gather/stage" = "gather/sheets"
);
/// The same with classification after splatting.
pub const GATHER_PLANES: [Shader; 3] = of_lanes!(
    "gather_planes",
    "gather/reach" = "gather/plane_reach",
    "gather/stage" = "gather_planes",
    "gather/stage" = "gather/planes",
    "gather/stage" = "gather/slabs"
);
/// Adds up the images of channels that share no sheets.
pub const JOIN: Shader = shader!("join");
/// Writes the depths of first hits.
pub const FIRST_HIT: Shader = shader!("first_hit");
/// Composites the result over the background.
pub const RESOLVE: Shader = shader!("resolve");

/// The threads that draw a patch of the tile rasterizer together. The numbers are those of the variants of [`GATHER`] and [`GATHER_PLANES`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lanes {
    /// A subgroup, whose threads read one another's registers.
    Subgroup,
    /// A subgroup that is all of a workgroup, and meets at barriers of workgroups.
    OnlySubgroup,
    /// A workgroup, whose threads read one another's values from its memory.
    Workgroup,
}

/// Every shader, in the order of the data flow. A page has none of tiles, for which browsers lack what they need.
pub const ALL: &[Shader] = &[
    CULL_BRICKS,
    CULL_VOXELS,
    COMPACT,
    SHADE,
    TILES,
    CLEAR,
    SPLAT,
    SPLAT_PERSPECTIVE,
    SAMPLE,
    COMPOSITE,
    VALUES,
    FIELD,
    FIELD_COLORS,
    CLASSIFY,
    OCCLUDE,
    #[cfg(not(target_arch = "wasm32"))]
    GATHER[0],
    #[cfg(not(target_arch = "wasm32"))]
    GATHER[1],
    #[cfg(not(target_arch = "wasm32"))]
    GATHER[2],
    #[cfg(not(target_arch = "wasm32"))]
    GATHER_PLANES[0],
    #[cfg(not(target_arch = "wasm32"))]
    GATHER_PLANES[1],
    #[cfg(not(target_arch = "wasm32"))]
    GATHER_PLANES[2],
    JOIN,
    FIRST_HIT,
    RESOLVE,
];

impl Shader {
    /// Whether workgroup memory must be zeroed. The tile rasterizer's memory is large, and it writes everything before reading it.
    pub fn needs_zeroed_memory(&self) -> bool {
        !self.stage.starts_with("gather")
    }

    /// The complete WGSL.
    pub fn source(&self) -> String {
        self.files.iter().map(|&(_, text)| text).collect()
    }

    /// Compiles the shader.
    pub fn module(&self, device: &wgpu::Device) -> wgpu::ShaderModule {
        device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(&format!("sheetsplat.{}", self.stage)),
            source: wgpu::ShaderSource::Wgsl(self.source().into()),
        })
    }

    /// The file below `shaders/` that a line of the source comes from, and the line's number in that file. Lines count from 1, as in compilers'
    /// messages.
    pub fn origin(&self, line: u32) -> (&'static str, u32) {
        let mut first = 1;
        for &(path, text) in self.files {
            let lines = text.lines().count() as u32;
            if line < first + lines {
                return (path, line + 1 - first);
            }
            first += lines;
        }
        (self.stage, line)
    }

    /// A message of wgpu about this shader, with `wgsl:LINE:COLUMN` replaced by the file and the line there.
    pub fn explain(&self, message: &str) -> String {
        let mut explained = String::new();
        let mut rest = message;
        while let Some((before, after)) = rest.split_once("wgsl:") {
            let digits = after.len() - after.trim_start_matches(|c: char| c.is_ascii_digit()).len();
            explained += before;
            match after[..digits].parse() {
                Ok(line) => {
                    let (path, line) = self.origin(line);
                    explained += &format!("shaders/{path}:{line}");
                }
                Err(_) => explained += "wgsl:",
            }
            rest = &after[digits..];
        }
        explained + rest
    }

    /// The number of a binding of group 0 by its name in the shader; `None` if there is no such binding.
    pub fn binding(&self, name: &str) -> Option<u32> {
        self.files.iter().flat_map(|(_, text)| text.lines()).find_map(|line| {
            // In a page there is no space beside a sign.
            let binding = line.strip_prefix("@group(0)")?.trim_start().strip_prefix("@binding(")?;
            let (number, declaration) = binding.split_once(')')?;
            let declared = declaration.split_once(':')?.0.rsplit([' ', '>']).next()?;
            if declared == name { number.parse().ok() } else { None }
        })
    }
}

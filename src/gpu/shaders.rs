//! Shader sources: the shared structs first, then the stage's own file.

/// A stage's name and its complete WGSL source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shader {
    /// The stage's word, which is also its file's name.
    pub stage: &'static str,
    /// WGSL.
    pub source: &'static str,
}

macro_rules! shader {
    ($stage:literal $(, $shared:literal)*) => {
        Shader {
            stage: $stage,
            source: concat!(
                $(include_str!(concat!("../../shaders/shared/", $shared, ".wgsl")),)*
                include_str!(concat!("../../shaders/", $stage, ".wgsl")),
            ),
        }
    };
}

/// Which bricks a sheet group visits.
pub const CULL_BRICKS: Shader = shader!("cull_bricks", "frame", "brick", "tally", "culled", "scan", "project");
/// Which voxels it draws.
pub const CULL_VOXELS: Shader = shader!("cull_voxels", "frame", "brick", "tally", "culled", "project", "local_ray");
/// Those voxels in a row.
pub const COMPACT: Shader = shader!("compact", "brick", "tally", "culled", "scan");
/// Shades those that were not shaded before.
pub const SHADE: Shader = shader!("shade", "frame", "brick", "volume", "project", "splat", "shading", "ramps");
/// The tiles they touch.
pub const TILES: Shader = shader!("tiles", "frame", "brick", "tally", "culled", "tile_list");
/// Zeroes the sheet buffers there.
pub const CLEAR: Shader = shader!("clear", "frame", "brick", "tile_list", "sheets");
/// Draws footprints into the sheet buffers.
pub const SPLAT: Shader = shader!("splat", "frame", "brick", "splat", "sheets", "footprints");
/// The same in perspective.
pub const SPLAT_PERSPECTIVE: Shader = shader!(
    "splat_perspective",
    "frame",
    "brick",
    "splat",
    "sheets",
    "footprints",
    "project",
    "local_ray",
    "turned_quads"
);
/// Draws whole kernels, each composited by itself.
pub const SAMPLE: Shader = shader!(
    "sample",
    "frame",
    "brick",
    "splat",
    "sheets",
    "footprints",
    "project",
    "local_ray",
    "turned_quads",
    "compositing"
);
/// Composites the sheet buffers.
pub const COMPOSITE: Shader =
    shader!("composite", "frame", "brick", "band", "tile_list", "compositing", "cut", "means");
/// Computes the occlusion buffer.
pub const OCCLUDE: Shader = shader!("occlude", "frame", "brick", "tile_list");
/// Draws whole tiles from front to back.
pub const GATHER: Shader = shader!(
    "gather",
    "frame",
    "brick",
    "tally",
    "gather",
    "bits",
    "region",
    "queue",
    "walk",
    "gathered_pixels",
    "gathered_voxels",
    "gathered_kernel",
    "held_ramps",
    "volume",
    "project",
    "local_ray",
    "shading",
    "ramps",
    "compositing",
    "cut",
    "means",
    "gathered_sheets"
);
/// Writes the depths of first hits.
pub const FIRST_HIT: Shader = shader!("first_hit", "frame", "cut");
/// Lays the result over the background.
pub const RESOLVE: Shader = shader!("resolve", "frame", "band");

/// Every shader, in the order of the data flow.
pub const ALL: [Shader; 14] = [
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
    OCCLUDE,
    GATHER,
    FIRST_HIT,
    RESOLVE,
];

impl Shader {
    /// Whether its workgroups' memory must hold zeros at first. The tile rasterizer reads nothing of its own, which is large, before
    /// it has written it.
    pub fn needs_zeroed_memory(&self) -> bool {
        *self != GATHER
    }

    /// Compiles the shader.
    pub fn module(&self, device: &wgpu::Device) -> wgpu::ShaderModule {
        device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(&format!("sheetsplat.{}", self.stage)),
            source: wgpu::ShaderSource::Wgsl(self.source.into()),
        })
    }
}

//! Shader sources: every stage's own file, preceded by the files that it shares with others.

/// A stage's name, and the files that its source is assembled from. Files that shaders share are in the program once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shader {
    /// The stage's name, which is also its file's name.
    pub stage: &'static str,
    /// The parts of the source in order: each file's path below `shaders/`, and its text.
    pub files: &'static [(&'static str, &'static str)],
}

macro_rules! shader {
    ($stage:literal $(, $file:literal)*) => {
        Shader {
            stage: $stage,
            files: &[
                $((concat!($file, ".wgsl"), text!($file)),)*
                (concat!($stage, ".wgsl"), text!($stage)),
            ],
        }
    };
}

/// The stage's variants for every kind of [`Lanes`].
macro_rules! of_lanes {
    ($stage:literal $(, $file:literal)*) => {
        [
            shader!($stage $(, $file)*, "gather/subgroup_lanes", "gather/subgroup_barrier"),
            shader!($stage $(, $file)*, "gather/subgroup_lanes", "gather/workgroup_barrier"),
            shader!($stage $(, $file)*, "gather/workgroup_lanes", "gather/workgroup_barrier"),
        ]
    };
}

/// The text of a file.
#[cfg(not(target_arch = "wasm32"))]
macro_rules! text {
    ($file:expr) => {
        include_str!(concat!("../../shaders/", $file, ".wgsl"))
    };
}

/// The text of a file without comments, indents and spaces beside signs, because a page's code must be short. Lines stay, so that messages name the right ones.
#[cfg(target_arch = "wasm32")]
macro_rules! text {
    ($file:expr) => {{
        const TEXT: &str = include_str!(concat!("../../shaders/", $file, ".wgsl"));
        const CODE: ([u8; TEXT.len()], usize) = comments::without(TEXT);
        const BYTES: [u8; CODE.1] = comments::first(&CODE.0);
        match std::str::from_utf8(&BYTES) {
            Ok(code) => code,
            Err(_) => panic!("comments end at characters"),
        }
    }};
}

#[cfg(target_arch = "wasm32")]
mod comments {
    /// The bytes of a text without its comments, indents and spaces beside signs, and their number. WGSL has no strings.
    pub(super) const fn without<const N: usize>(text: &str) -> ([u8; N], usize) {
        let (text, mut code, mut count, mut at, mut is_comment) = (text.as_bytes(), [0; N], 0, 0, false);
        while at < N {
            is_comment = text[at] != b'\n' && (is_comment || text[at] == b'/' && at + 1 < N && text[at + 1] == b'/');
            let is_indent = text[at] == b' ' && (count == 0 || code[count - 1] == b'\n');
            // A space may divide two signs that would be another one together, `> =` or `- -`.
            let is_beside_sign = text[at] == b' ' && count > 0 && at + 1 < N && {
                let (before, after) = (code[count - 1], text[at + 1]);
                (is_sign(before) || is_sign(after))
                    && !(matches!(before, b'<' | b'>') && after == b'=')
                    && !(before == b'-' && after == b'-')
            };
            if !is_comment && !is_indent && !is_beside_sign {
                code[count] = text[at];
                count += 1;
            }
            at += 1;
        }
        (code, count)
    }

    const fn is_sign(byte: u8) -> bool {
        matches!(byte, b'%'..=b'/' | b':'..=b'>' | b'[' | b']' | b'{'..=b'}') && byte != b'.'
    }

    pub(super) const fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
        let (mut first, mut at) = ([0; N], 0);
        while at < N {
            first[at] = bytes[at];
            at += 1;
        }
        first
    }
}

/// Finds the bricks that a sheet group visits.
pub const CULL_BRICKS: Shader = shader!(
    "cull_bricks",
    "shared/frame",
    "shared/brick",
    "shared/tally",
    "shared/culled",
    "shared/scan",
    "shared/project"
);
/// Finds the voxels that a sheet group draws.
pub const CULL_VOXELS: Shader = shader!(
    "cull_voxels",
    "shared/frame",
    "shared/brick",
    "shared/tally",
    "shared/culled",
    "shared/project",
    "shared/local_ray"
);
/// Lists the voxels that are drawn without gaps.
pub const COMPACT: Shader = shader!("compact", "shared/brick", "shared/tally", "shared/culled", "shared/scan");
/// Shades the voxels that were not shaded before.
pub const SHADE: Shader = shader!(
    "shade",
    "shared/frame",
    "shared/brick",
    "shared/texels",
    "shared/volume",
    "shared/channels",
    "shared/colors",
    "shared/own_color",
    "shared/project",
    "shared/splat",
    "shared/shading",
    "shared/ramps"
);
/// Marks the tiles that splats touch.
pub const TILES: Shader =
    shader!("tiles", "shared/frame", "shared/brick", "shared/tally", "shared/culled", "shared/tile_list");
/// Zeroes the sheet buffers in these tiles.
pub const CLEAR: Shader = shader!("clear", "shared/frame", "shared/brick", "shared/tile_list", "shared/sheets");
/// Draws footprints into the sheet buffers.
pub const SPLAT: Shader = shader!(
    "splat",
    "shared/frame",
    "shared/brick",
    "shared/splat",
    "shared/sheets",
    "shared/corners",
    "shared/footprints"
);
/// Draws footprints in perspective into the sheet buffers.
pub const SPLAT_PERSPECTIVE: Shader = shader!(
    "splat_perspective",
    "shared/frame",
    "shared/brick",
    "shared/splat",
    "shared/sheets",
    "shared/corners",
    "shared/footprints",
    "shared/project",
    "shared/local_ray",
    "shared/turned_quads"
);
/// Draws whole kernels, each composited by itself.
pub const SAMPLE: Shader = shader!(
    "sample",
    "shared/frame",
    "shared/brick",
    "shared/splat",
    "shared/sheets",
    "shared/corners",
    "shared/footprints",
    "shared/project",
    "shared/local_ray",
    "shared/turned_quads",
    "shared/compositing"
);
/// Composites the sheet buffers.
pub const COMPOSITE: Shader = shader!(
    "composite",
    "shared/frame",
    "shared/brick",
    "shared/band",
    "shared/tile_list",
    "shared/opaque",
    "shared/compositing",
    "shared/cut",
    "shared/means"
);
/// Finds the values and gradients of voxels that are drawn onto slab planes.
pub const VALUES: Shader = shader!(
    "values",
    "shared/frame",
    "shared/brick",
    "shared/texels",
    "shared/volume",
    "shared/project",
    "shared/field_voxel",
    "shared/planes",
    "shared/exact",
    "shared/number"
);
/// Draws them onto a slab plane.
pub const FIELD: Shader = shader!(
    "field",
    "shared/frame",
    "shared/brick",
    "shared/field_voxel",
    "shared/planes",
    "shared/sheets",
    "shared/corners",
    "shared/plane_quads"
);
/// Draws colours of voxels' own onto a slab plane.
pub const FIELD_COLORS: Shader = shader!(
    "field_colors",
    "shared/frame",
    "shared/brick",
    "shared/texels",
    "shared/colors",
    "shared/exact",
    "shared/splatted_color",
    "shared/field_voxel",
    "shared/planes",
    "shared/sheets",
    "shared/corners",
    "shared/plane_quads"
);
/// Classifies, shades and composites slabs between planes.
pub const CLASSIFY: Shader = shader!(
    "classify",
    "shared/frame",
    "shared/brick",
    "shared/band",
    "shared/tile_list",
    "shared/opaque",
    "shared/compositing",
    "shared/cut",
    "shared/means",
    "shared/planes",
    "shared/project",
    "shared/texels",
    "shared/volume",
    "shared/channels",
    "shared/shading",
    "shared/ramps",
    "shared/slab_integral",
    "shared/field_voxel",
    "shared/cells",
    "shared/seen",
    "shared/first_surface",
    "shared/slab"
);
/// Computes the occlusion buffer.
pub const OCCLUDE: Shader = shader!("occlude", "shared/frame", "shared/brick", "shared/tile_list");
/// Draws whole tiles from front to back, for every kind of [`Lanes`].
pub const GATHER: [Shader; 3] = of_lanes!(
    "gather",
    "shared/frame",
    "shared/brick",
    "shared/tally",
    "gather/uniforms",
    "gather/patch",
    "gather/bits",
    "gather/region",
    "gather/queue",
    "gather/walk",
    "gather/pixels",
    "gather/voxels",
    "gather/amounts",
    "gather/kernel",
    "gather/economies",
    "gather/ramps",
    "shared/texels",
    "shared/volume",
    "shared/channels",
    "shared/colors",
    "shared/own_color",
    "shared/project",
    "shared/local_ray",
    "shared/shading",
    "shared/ramps",
    "shared/compositing",
    "shared/cut",
    "shared/means",
    "gather/sheets"
);
/// The same with classification after splatting.
pub const GATHER_PLANES: [Shader; 3] = of_lanes!(
    "gather_planes",
    "shared/frame",
    "shared/brick",
    "shared/tally",
    "gather/uniforms",
    "gather/patch",
    "gather/bits",
    "gather/region",
    "gather/queue",
    "gather/walk",
    "gather/pixels",
    "gather/voxels",
    "gather/planes",
    "gather/ramps",
    "shared/texels",
    "shared/volume",
    "shared/channels",
    "shared/colors",
    "shared/exact",
    "shared/splatted_color",
    "shared/project",
    "shared/shading",
    "shared/ramps",
    "shared/compositing",
    "shared/cut",
    "shared/means",
    "shared/field_voxel",
    "shared/cells",
    "shared/planes",
    "shared/number",
    "shared/slab_integral",
    "shared/seen",
    "shared/first_surface",
    "shared/slab",
    "gather/slabs"
);
/// Adds up the images of channels that share no sheets.
pub const JOIN: Shader =
    shader!("join", "shared/frame", "shared/brick", "shared/band", "shared/cut", "shared/finished");
/// Writes the depths of first hits.
pub const FIRST_HIT: Shader = shader!("first_hit", "shared/frame", "shared/cut");
/// Composites the result over the background.
pub const RESOLVE: Shader = shader!("resolve", "shared/frame", "shared/band", "shared/finished");

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

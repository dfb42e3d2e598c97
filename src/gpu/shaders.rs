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

/// Projects and shades voxels.
pub const SHADE: Shader = shader!("shade", "frame", "splat");
/// Draws footprints into the sheet buffer.
pub const SPLAT: Shader = shader!("splat", "frame", "splat");
/// Composites a sheet buffer.
pub const COMPOSITE: Shader = shader!("composite", "frame", "band");
/// Lays the result over the background.
pub const RESOLVE: Shader = shader!("resolve", "frame", "band");

/// Every shader, in the order of the data flow.
pub const ALL: [Shader; 4] = [SHADE, SPLAT, COMPOSITE, RESOLVE];

impl Shader {
    /// Compiles the shader.
    pub fn module(&self, device: &wgpu::Device) -> wgpu::ShaderModule {
        device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(&format!("sheetsplat.{}", self.stage)),
            source: wgpu::ShaderSource::Wgsl(self.source.into()),
        })
    }
}

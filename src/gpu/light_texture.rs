//! Light sheets (SPEC §14) on the GPU: the planes of both stacks in a texture of three dimensions, which shading looks up by `shaders/shared/light.wgsl`.

use std::sync::{Arc, Weak};

use wgpu::{
    Device, Extent3d, Limits, Origin3d, Queue, TexelCopyBufferLayout, TexelCopyTextureInfo, Texture, TextureAspect,
    TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView,
};

use super::layout::Frame;
use crate::error::RenderError;
use crate::light::{LightSheets, LightStack, Lights};

/// The texels that are written at a time.
const WRITTEN: usize = 1 << 24;

/// Bytes of a texel.
const TEXEL: u64 = size_of::<f32>() as u64;

/// A scene's light sheets on a device.
#[derive(Debug)]
pub struct LightTexture {
    /// `R32Float`: the planes of occlusion's stack, then those of shadow's.
    pub view: TextureView,
    texture: Texture,
    /// The stacks, which may be freed meanwhile.
    sheets: [Option<Weak<LightSheets>>; 2],
    /// Bytes of GPU memory.
    pub gpu_bytes: u64,
}

/// The stacks of some lights.
fn stacks(lights: &Lights) -> [Option<&LightStack>; 2] {
    [&lights.occlusion, &lights.shadow].map(Option::as_ref)
}

impl LightTexture {
    /// The light sheets of a frame, in the texture of the previous one if that has the right size.
    ///
    /// # Errors
    /// If the device's textures are too small.
    pub fn renewed(
        device: &Device,
        queue: &Queue,
        lights: &Lights,
        mut previous: Option<Self>,
    ) -> Result<Self, RenderError> {
        let sheets = stacks(lights).map(|stack| stack.map(|light| &light.sheets));
        let is_same = |previous: &Self| {
            previous.sheets.iter().zip(&sheets).all(|pair| match pair {
                (Some(old), Some(new)) => old.ptr_eq(&Arc::downgrade(new)),
                (old, new) => old.is_none() && new.is_none(),
            })
        };
        if let Some(previous) = previous.take_if(|previous| is_same(previous)) {
            return Ok(previous);
        }
        let side = sheets.iter().flatten().map(|sheets| sheets.side as u32).max().unwrap_or(1);
        let planes = sheets.iter().flatten().map(|sheets| sheets.planes() as u32).sum::<u32>();
        let gpu_bytes = Self::estimate(&device.limits(), [side, planes])?;
        let size = [side, side, planes.max(1)];
        let has_size = |texture: &Texture| texture.size() == extent(size);
        let kept = previous.map(|previous| previous.texture).filter(has_size);
        let texture = kept.unwrap_or_else(|| texture(device, "sheetsplat.light_sheets", size));
        let mut first = 0;
        for sheets in sheets.iter().flatten().filter(|sheets| sheets.planes() > 0) {
            let of_stack = sheets.planes() as u32;
            // Some planes at a time, because a device's staging memory is limited.
            let at_a_time = (WRITTEN / (side as usize * side as usize)).max(1);
            for (planes, at) in
                sheets.light.chunks(at_a_time * side as usize * side as usize).zip((first..).step_by(at_a_time))
            {
                queue.write_texture(
                    TexelCopyTextureInfo {
                        texture: &texture,
                        mip_level: 0,
                        origin: Origin3d { x: 0, y: 0, z: at },
                        aspect: TextureAspect::All,
                    },
                    bytemuck::cast_slice(planes),
                    TexelCopyBufferLayout {
                        offset: 0,
                        bytes_per_row: Some(side * TEXEL as u32),
                        rows_per_image: Some(side),
                    },
                    extent([side, side, (planes.len() / (side as usize * side as usize)) as u32]),
                );
            }
            first += of_stack;
        }
        Ok(Self {
            view: texture.create_view(&wgpu::TextureViewDescriptor::default()),
            sheets: sheets.map(|sheets| sheets.map(Arc::downgrade)),
            texture,
            gpu_bytes,
        })
    }

    /// The bytes of a texture for sheets of some pixels along each side and as many planes; 0 without sheets.
    ///
    /// # Errors
    /// If the device's textures are too small.
    pub(crate) fn estimate(limits: &Limits, [side, planes]: [u32; 2]) -> Result<u64, RenderError> {
        let (largest, most) = (side.max(planes), limits.max_texture_dimension_3d);
        if largest > most {
            let (what, limit) = ("the light sheets", "max_texture_dimension_3d");
            return Err(RenderError::Limit { what, limit, required: largest.into(), actual: most.into() });
        }
        let planes = if side > 0 { planes.max(1) } else { 0 };
        Ok(u64::from(side) * u64::from(side) * u64::from(planes) * TEXEL)
    }

    /// A texture of one texel, for frames without light sheets.
    pub fn none(device: &Device) -> TextureView {
        texture(device, "sheetsplat.no_light_sheets", [1; 3]).create_view(&wgpu::TextureViewDescriptor::default())
    }
}

/// Writes where points are looked up into a frame's constants.
pub fn note(frame: &mut Frame, lights: &Lights) {
    let mut first = 0;
    for (number, stack) in stacks(lights).into_iter().enumerate() {
        // Without a voxel that takes part there is all light.
        let Some(LightStack { amount, sheets, rows }) = stack.filter(|light| light.sheets.planes() > 0) else {
            continue;
        };
        let rows = rows.map(|row| row.as_vec4().to_array());
        frame.light_place[3 * number..3 * number + 3].copy_from_slice(&rows);
        frame.light_stacks[number] = [*amount, first as f32, (sheets.planes() - 1) as f32, 0.0];
        first += sheets.planes();
    }
}

fn extent([width, height, depth]: [u32; 3]) -> Extent3d {
    Extent3d { width, height, depth_or_array_layers: depth }
}

fn texture(device: &Device, label: &str, size: [u32; 3]) -> Texture {
    device.create_texture(&TextureDescriptor {
        label: Some(label),
        size: extent(size),
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D3,
        format: TextureFormat::R32Float,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
        view_formats: &[],
    })
}

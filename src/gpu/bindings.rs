//! Shorthand for bind group layouts, bind groups and buffers.

use wgpu::{
    BindGroup, BindGroupLayout, BindGroupLayoutEntry, BindingResource, BindingType, Buffer, BufferBindingType,
    BufferDescriptor, BufferUsages, ComputePass, ComputePipeline, Device, Limits, PipelineLayout, Queue, ShaderStages,
    TextureSampleType, TextureViewDimension,
};

use super::layout::{FOLD, Indirect};
use super::shaders::Shader;
use crate::error::RenderError;

/// The shader stages that see a binding, and its type.
pub type Slot = (ShaderStages, BindingType);

/// A uniform buffer that holds one `T`, at a dynamic offset if `dynamic`.
pub fn uniform<T>(stages: ShaderStages, dynamic: bool) -> Slot {
    let min_binding_size = wgpu::BufferSize::new(size_of::<T>() as u64);
    (stages, BindingType::Buffer { ty: BufferBindingType::Uniform, has_dynamic_offset: dynamic, min_binding_size })
}

/// A storage buffer that holds `T`s.
pub fn storage<T>(stages: ShaderStages, read_only: bool) -> Slot {
    let min_binding_size = wgpu::BufferSize::new(size_of::<T>() as u64);
    let ty = BufferBindingType::Storage { read_only };
    (stages, BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size })
}

/// The first `T` of a buffer that holds one at every dynamic offset.
pub fn at_offset<T>(buffer: &Buffer) -> BindingResource<'_> {
    let size = wgpu::BufferSize::new(size_of::<T>() as u64);
    BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size })
}

/// A float texture that is read texel by texel, so its format need not be filterable.
pub fn texture(stages: ShaderStages, view_dimension: TextureViewDimension) -> Slot {
    let sample_type = TextureSampleType::Float { filterable: false };
    (stages, BindingType::Texture { sample_type, view_dimension, multisampled: false })
}

/// A depth texture.
pub fn depth_texture(stages: ShaderStages) -> Slot {
    let view_dimension = TextureViewDimension::D2;
    (stages, BindingType::Texture { sample_type: TextureSampleType::Depth, view_dimension, multisampled: false })
}

/// A texture of integers.
pub fn texture_of_integers(stages: ShaderStages, view_dimension: TextureViewDimension) -> Slot {
    let sample_type = TextureSampleType::Uint;
    (stages, BindingType::Texture { sample_type, view_dimension, multisampled: false })
}

/// The description of a buffer that is not allocated yet.
pub type BufferSpec = BufferDescriptor<'static>;

/// A buffer of `size` bytes.
pub fn buffer_spec(label: &'static str, size: u64, usage: BufferUsages) -> BufferSpec {
    BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false }
}

/// A buffer for a content of `bytes` bytes.
pub fn content_spec(label: &'static str, bytes: u64, usage: BufferUsages) -> BufferSpec {
    // It has at least one element, because bindings may not be empty.
    buffer_spec(label, bytes.max(8), usage | BufferUsages::COPY_DST)
}

/// The total size of some buffers in bytes.
///
/// # Errors
/// If one of them exceeds the device's maximum size of buffers or bindings.
pub fn sizes(limits: &Limits, buffers: &[BufferSpec]) -> Result<u64, RenderError> {
    buffers.iter().map(|buffer| check(limits, buffer)).sum()
}

fn check(limits: &Limits, &BufferSpec { label, size, usage, .. }: &BufferSpec) -> Result<u64, RenderError> {
    let (limit, actual) = match usage.contains(BufferUsages::STORAGE) {
        true if limits.max_storage_buffer_binding_size < limits.max_buffer_size => {
            ("max_storage_buffer_binding_size", limits.max_storage_buffer_binding_size)
        }
        _ => ("max_buffer_size", limits.max_buffer_size),
    };
    if size > actual {
        return Err(RenderError::Limit { what: label.unwrap_or_default(), limit, required: size, actual });
    }
    Ok(size)
}

/// A buffer of at least the spec's size: the previous one if it is large enough but at most 4 times too large.
///
/// # Errors
/// If it exceeds the device's maximum size of buffers or bindings.
pub fn grown(device: &Device, previous: Option<Buffer>, spec: &BufferSpec) -> Result<Buffer, RenderError> {
    let size = check(&device.limits(), spec)?;
    let fits = |buffer: &Buffer| (size..=4 * size).contains(&buffer.size()) && buffer.usage().contains(spec.usage);
    Ok(previous.filter(fits).unwrap_or_else(|| device.create_buffer(spec)))
}

/// A buffer with this content; the old one is reused if it has the right size.
///
/// # Errors
/// If it exceeds the device's maximum size of buffers.
pub fn filled(
    device: &Device,
    queue: &Queue,
    old: Option<Buffer>,
    label: &'static str,
    bytes: &[u8],
    usage: BufferUsages,
) -> Result<Buffer, RenderError> {
    written(device, queue, old, &content_spec(label, bytes.len() as u64, usage), bytes)
}

/// Like [`filled`], with the buffer described by a spec.
///
/// # Errors
/// As for [`filled`].
pub fn written(
    device: &Device,
    queue: &Queue,
    old: Option<Buffer>,
    spec: &BufferSpec,
    bytes: &[u8],
) -> Result<Buffer, RenderError> {
    let buffer = grown(device, old, spec)?;
    queue.write_buffer(&buffer, 0, bytes);
    Ok(buffer)
}

/// A new buffer of `size` bytes that starts with `bytes`, which must not be empty. If the device cannot allocate it, an error scope says
/// why, and nothing is written.
pub fn uploaded(device: &Device, label: &str, bytes: &[u8], size: u64, usage: BufferUsages) -> Buffer {
    let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: true };
    let buffer = device.create_buffer(&descriptor);
    if let Ok(mut mapped) = buffer.get_mapped_range_mut(..bytes.len() as u64) {
        mapped.copy_from_slice(bytes);
        drop(mapped);
        buffer.unmap();
    }
    buffer
}

/// The layout of a shader's bind group 0. Bindings are matched by the names of the shader's variables, so that two cannot be confused.
#[derive(Debug)]
pub struct Bindings {
    label: String,
    numbers: Vec<(&'static str, u32)>,
    layout: BindGroupLayout,
    /// The layout of pipelines with only this group.
    pub pipeline_layout: PipelineLayout,
}

impl Bindings {
    /// A layout with these slots. If the shader does not declare a name, the device refuses the layout.
    pub fn new(device: &Device, shader: Shader, slots: &[(&'static str, Slot)]) -> Self {
        let label = format!("sheetsplat.{}", shader.stage);
        let numbers: Vec<_> = slots.iter().map(|&(name, _)| (name, shader.binding(name).unwrap_or(u32::MAX))).collect();
        let entries: Vec<BindGroupLayoutEntry> = (numbers.iter().zip(slots))
            .map(|(&(_, binding), &(_, (visibility, ty)))| BindGroupLayoutEntry {
                binding,
                visibility,
                ty,
                count: None,
            })
            .collect();
        let layout = device
            .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(&label), entries: &entries });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(&label),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        Self { label, numbers, layout, pipeline_layout }
    }

    /// A bind group with a resource for every name, in any order.
    pub fn bind(&self, device: &Device, resources: &[(&str, BindingResource<'_>)]) -> BindGroup {
        let number =
            |name| self.numbers.iter().find(|(known, _)| *known == name).map_or(u32::MAX, |&(_, number)| number);
        let entries: Vec<_> = (resources.iter())
            .map(|(name, resource)| wgpu::BindGroupEntry { binding: number(*name), resource: resource.clone() })
            .collect();
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(&self.label),
            layout: &self.layout,
            entries: &entries,
        })
    }
}

/// A compute shader and the layout of its bind group.
#[derive(Debug)]
pub struct ComputeStage {
    bindings: Bindings,
    pipeline: ComputePipeline,
}

impl ComputeStage {
    /// Compiles an entry point of a shader, with the given bindings and pipeline constants.
    pub fn new(
        device: &Device,
        shader: Shader,
        entry: &str,
        slots: &[(&'static str, Slot)],
        constants: &[(&str, f64)],
    ) -> Self {
        let bindings = Bindings::new(device, shader, slots);
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(&bindings.label),
            layout: Some(&bindings.pipeline_layout),
            module: &shader.module(device),
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants,
                zero_initialize_workgroup_memory: shader.needs_zeroed_memory(),
            },
            cache: None,
        });
        Self { bindings, pipeline }
    }

    /// Binds a resource for every name, in any order.
    pub fn bind(&self, device: &Device, resources: &[(&str, BindingResource<'_>)]) -> BindGroup {
        self.bindings.bind(device, resources)
    }

    /// Dispatches a fixed number of workgroups, folded as in [`Indirect`].
    pub fn dispatch(&self, pass: &mut ComputePass<'_>, group: &BindGroup, offsets: &[u32], workgroups: u32) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, group, offsets);
        pass.dispatch_workgroups(workgroups.min(FOLD), workgroups.div_ceil(FOLD), 1);
    }

    /// Dispatches the number of workgroups in an [`Indirect`].
    pub fn dispatch_indirect(&self, pass: &mut ComputePass<'_>, group: &BindGroup, offsets: &[u32], args: &Buffer) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, group, offsets);
        pass.dispatch_workgroups_indirect(args, std::mem::offset_of!(Indirect, dispatch) as u64);
    }
}

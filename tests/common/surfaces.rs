//! A host's depth texture with chosen depths.

use glam::{DMat4, DVec3, DVec4};
use sheetsplat::Surfaces;
use sheetsplat::headless::GpuHeadless;
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::wgpu::util::DeviceExt;
use sheetsplat::wgpu::{self, BufferUsages, TextureFormat, TextureUsages};

const WRITE_DEPTH: &str = "
@group(0) @binding(0) var<storage, read> values: array<f32>;
@group(0) @binding(1) var<uniform> width: u32;
@vertex fn vertex(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    return vec4f(select(-1.0, 3.0, corner == 1u), select(-1.0, 3.0, corner == 2u), 0.0, 1.0);
}
@fragment fn fragment(@builtin(position) position: vec4f) -> @builtin(frag_depth) f32 {
    let pixel = vec2u(position.xy);
    return values[pixel.y * width + pixel.x];
}";

/// How a host's clip space encodes depth.
#[derive(Clone, Copy, Debug)]
pub(crate) enum DepthRange {
    Standard,
    Reversed,
    /// Reversed, with the far plane at infinity. For orthographic cameras it is merely reversed.
    Infinite,
}

/// A host's matrix for the view, from the volume's world coordinates to clip space, with planes at these depths in `unit`s.
pub(crate) fn clip_from_world(view: &ViewGeometry, unit: f64, range: DepthRange, [near, far]: [f64; 2]) -> DMat4 {
    let rays = view.rays();
    let half = DVec3::new(f64::from(view.size[0]), f64::from(view.size[1]), 0.0) / 2.0;
    let (u, v, w) = (view.basis.u, view.basis.v, view.basis.w);
    let from = rays.origin[2];
    let row = |axis: DVec3, scale: f64| (axis * scale / unit).extend(-axis.dot(from) * scale);
    let depth = row(w, 1.0);
    let [x, y, z, last] = match &view.perspective {
        None => {
            let z = (depth - DVec4::W * near) / (far - near);
            let z = if matches!(range, DepthRange::Standard) { z } else { DVec4::W - z };
            [row(u, 1.0 / (half.x * view.pix)), row(v, 1.0 / (half.y * view.pix)), z, DVec4::W]
        }
        Some(perspective) => {
            let per_depth = perspective.eye.pixel_per_depth;
            // z = a·depth + b, divided by the depth.
            let (a, b) = match range {
                DepthRange::Standard => (far / (far - near), -near * far / (far - near)),
                DepthRange::Reversed => (-near / (far - near), near * far / (far - near)),
                DepthRange::Infinite => (0.0, near),
            };
            let z = depth * a + DVec4::W * b;
            [row(u, 1.0 / (half.x * per_depth)), row(v, 1.0 / (half.y * per_depth)), z, depth]
        }
    };
    DMat4::from_cols(x, y, z, last).transpose()
}

/// A texture that holds the depths (`unit`s along w, infinite without a surface) of an image's pixels from `origin` on, with its matrix.
pub(crate) fn surfaces(
    gpu: &GpuHeadless,
    view: &ViewGeometry,
    unit: f64,
    range: DepthRange,
    planes: [f64; 2],
    depths: &[f64],
    origin: [u32; 2],
) -> Surfaces {
    let clip_from_world = clip_from_world(view, unit, range, planes);
    let rays = view.rays();
    let [width, height] = [view.size[0] + origin[0] + 3, view.size[1] + origin[1] + 2];
    let none = if matches!(range, DepthRange::Standard) { 1.0 } else { 0.0 };
    let value = |at: u32| {
        let texel = glam::UVec2::new(at % width, at / width);
        let pixel = texel.as_ivec2() - glam::UVec2::from(origin).as_ivec2();
        let is_inside =
            pixel.cmpge(glam::IVec2::ZERO).all() && pixel.cmplt(glam::UVec2::from(view.size).as_ivec2()).all();
        // Texels around the image must not matter.
        let depth = if is_inside { depths[(pixel.y * view.size[0] as i32 + pixel.x) as usize] } else { planes[0] };
        if depth.is_infinite() {
            return none;
        }
        let place = pixel.as_dvec2() + 0.5 - glam::UVec2::from(view.size).as_dvec2() / 2.0;
        let clip = clip_from_world * (rays.at(place, depth) * unit).extend(1.0);
        (clip.z / clip.w) as f32
    };
    let values: Vec<f32> = (0..width * height).map(value).collect();
    Surfaces { depth: depth_texture(gpu, [width, height], &values), origin, clip_from_world }
}

/// A depth texture that holds these values, row by row.
fn depth_texture(gpu: &GpuHeadless, [width, height]: [u32; 2], values: &[f32]) -> wgpu::TextureView {
    let device = gpu.device();
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("host.depth"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: TextureFormat::Depth32Float,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("host.depth"),
        source: wgpu::ShaderSource::Wgsl(WRITE_DEPTH.into()),
    });
    let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("host.depth"),
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: None,
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: TextureFormat::Depth32Float,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Always),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: None,
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[],
        }),
        multiview_mask: None,
        cache: None,
    });
    let buffer = |contents: &[u8], usage| {
        device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some("host.depth"), contents, usage })
    };
    let values = buffer(bytemuck::cast_slice(values), BufferUsages::STORAGE);
    let width = buffer(bytemuck::bytes_of(&width), BufferUsages::UNIFORM);
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("host.depth"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: values.as_entire_binding() },
            wgpu::BindGroupEntry { binding: 1, resource: width.as_entire_binding() },
        ],
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("host.depth"),
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: &view,
            depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store: wgpu::StoreOp::Store }),
            stencil_ops: None,
        }),
        ..wgpu::RenderPassDescriptor::default()
    });
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.draw(0..3, 0..1);
    drop(pass);
    gpu.queue().submit([encoder.finish()]);
    view
}

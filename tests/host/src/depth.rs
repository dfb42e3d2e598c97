//! A volume among a host's surfaces: the host draws them with its own camera, and they hide the volume behind them.

use glam::{DMat4, DVec3, DVec4};
use sheetsplat::Surfaces;
use sheetsplat::settings::Clip;
use sheetsplat::{Camera, Placement, RendererOptions, Scene};
use wgpu::util::DeviceExt;
use wgpu::{BufferUsages, CompareFunction, LoadOp, Operations, StoreOp, Texture, TextureFormat, TextureView};

use crate::compare::assert_at_most;
use crate::{Host, TRANSPARENT, headless, pixels, scene};

const F32: TextureFormat = TextureFormat::Rgba32Float;
const SIZE: [u32; 2] = [90, 70];
const PAINT: [f32; 4] = [0.1, 0.6, 0.2, 1.0];

/// The host's matrix from the volume's coordinates to its clip space, with reversed depths and without a far plane.
fn clip_from_world() -> DMat4 {
    let (eye, near, fov) = (DVec3::new(-150.0, -220.0, 60.0), 5.0, 0.6_f64);
    let w = -eye.normalize();
    let u = w.cross(DVec3::Z).normalize();
    let v = u.cross(w);
    let focal = 1.0 / (fov / 2.0).tan();
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let row = |axis: DVec3, scale: f64| (axis * scale).extend(-axis.dot(eye) * scale);
    DMat4::from_cols(row(u, focal / aspect), row(v, focal), DVec4::W * near, row(w, 1.0)).transpose()
}

/// A wall of the host's through the volume's middle that ends within the image: a normal that points away from the eye, and corners.
fn wall() -> (DVec3, [DVec3; 4]) {
    let (along, up) = (DVec3::new(1.0, -0.3, 0.0), DVec3::new(0.0, 0.2, 1.0));
    let corners = [(-200.0, -200.0), (10.0, -200.0), (-200.0, 200.0), (10.0, 200.0)];
    (up.cross(along).normalize(), corners.map(|(a, b)| along * a + up * b))
}

/// What the host draws itself: the wall, in colour and depth.
fn draw_wall(host: &Host) -> (Texture, TextureView) {
    let (device, depth_format) = (&host.device, TextureFormat::Depth32Float);
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("host.wall"),
        source: wgpu::ShaderSource::Wgsl(
            "@vertex fn vertex(@location(0) position: vec4f) -> @builtin(position) vec4f { return position; }
             @fragment fn fragment() -> @location(0) vec4f { return vec4f(0.1, 0.6, 0.2, 1.0); }"
                .into(),
        ),
    });
    let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("host.wall"),
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: None,
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[Some(wgpu::VertexBufferLayout {
                array_stride: 16,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: &wgpu::vertex_attr_array![0 => Float32x4],
            })],
        },
        primitive: wgpu::PrimitiveState {
            topology: wgpu::PrimitiveTopology::TriangleStrip,
            ..wgpu::PrimitiveState::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: depth_format,
            depth_write_enabled: Some(true),
            depth_compare: Some(CompareFunction::Greater),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: None,
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(F32.into())],
        }),
        multiview_mask: None,
        cache: None,
    });
    let corners = wall().1.map(|corner| (clip_from_world() * corner.extend(1.0)).as_vec4().to_array());
    let vertices = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("host.wall"),
        contents: bytemuck::cast_slice(&corners),
        usage: BufferUsages::VERTEX,
    });
    let target = host.target(F32, SIZE, 1);
    let depth = host.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("host.depth"),
        size: target.size(),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: depth_format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    let (color, depth) = (target.create_view(&Default::default()), depth.create_view(&Default::default()));
    let mut encoder = host.encoder();
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: &color,
            depth_slice: None,
            resolve_target: None,
            ops: Operations { load: LoadOp::Clear(wgpu::Color::TRANSPARENT), store: StoreOp::Store },
        })],
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: &depth,
            depth_ops: Some(Operations { load: LoadOp::Clear(0.0), store: StoreOp::Store }),
            stencil_ops: None,
        }),
        ..wgpu::RenderPassDescriptor::default()
    });
    pass.set_pipeline(&pipeline);
    pass.set_vertex_buffer(0, vertices.slice(..));
    pass.draw(0..4, 0..1);
    drop(pass);
    host.submit(encoder);
    (target, depth)
}

/// The scene with the host's camera.
fn seen() -> Scene {
    let camera = Camera::from_clip_from_world(clip_from_world(), SIZE).unwrap();
    let mut scene = Scene { camera, ..scene(TRANSPARENT) };
    // Culling would change the image within its bound.
    scene.splatting.culling = false;
    scene
}

#[test]
fn walls_cut_as_clip_planes_do() {
    let host = Host::new();
    let renderer = host.renderer(RendererOptions::for_target(F32));
    let mut view = host.view(&seen());
    let (target, depth) = draw_wall(&host);
    let is_wall: Vec<bool> = pixels(&host.read(&target)).iter().map(|pixel| pixel[3] > 0.0).collect();
    view.set_surfaces(Some(Surfaces { depth, origin: [0, 0], clip_from_world: clip_from_world() })).unwrap();
    view.set_first_hit(Some(0.5)).unwrap();
    renderer.prepare(&host.device, &host.queue, &mut view).unwrap();
    let mut encoder = host.encoder();
    renderer.record(&mut encoder, &mut view);
    renderer
        .present(&mut encoder, &mut view, &target.create_view(&Default::default()), Placement::whole(SIZE))
        .unwrap();
    host.submit(encoder);
    let actual = pixels(&host.read(&target));

    let whole = headless(&seen());
    let normal = wall().0;
    let clip = Clip { planes: vec![[-normal.x, -normal.y, -normal.z, 0.0]], ..Clip::default() };
    let before = headless(&Scene { clip, ..seen() });
    let mut shows = [0; 2];
    for (at, actual) in actual.iter().enumerate() {
        let (image, there) = if is_wall[at] { (before[at], PAINT) } else { (whole[at], [0.0; 4]) };
        shows[usize::from(is_wall[at])] += usize::from(image[3] > 0.05);
        for channel in 0..4 {
            let expected = image[channel] + (1.0 - image[3]) * there[channel];
            // Kernels of voxels behind the wall reach before it; the clipped volume has fewer voxels.
            let error = f64::from((actual[channel] - expected).abs());
            assert_at_most(error, 1.6e-4, format_args!("{at}: {actual:?}, {image:?} over {there:?}"));
        }
    }
    assert!(shows.iter().all(|&shows| shows > 200), "{shows:?} pixels of the volume, beside and before the wall");

    // First hits lie before the wall or on it.
    let hits: Vec<f32> = bytemuck::pod_collect_to_vec(&host.read(view.first_hits().unwrap()));
    let eye = DVec3::new(-150.0, -220.0, 60.0);
    let finite = hits.iter().zip(&is_wall).filter(|(hit, _)| hit.is_finite());
    assert!(finite.clone().any(|(_, is_wall)| *is_wall) && finite.clone().any(|(_, is_wall)| !is_wall));
    assert!(finite.clone().all(|(&hit, _)| f64::from(hit) < eye.length() + 150.0 && hit > 50.0));

    // A pick gives the same at a pixel, once the application's own submission is done.
    let at = hits.iter().position(|hit| hit.is_finite()).unwrap();
    let mut encoder = host.encoder();
    let pixel = [at as u32 % SIZE[0], at as u32 / SIZE[0]];
    let mut pending = view.pick(&host.device, &mut encoder, pixel).unwrap();
    assert!(view.pick(&host.device, &mut encoder, [SIZE[0], 0]).is_none(), "off the image");
    host.submit(encoder);
    assert!(pending.try_get().is_none(), "nothing waits");
    host.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    let pick = pending.try_get().unwrap().unwrap().unwrap();
    assert_eq!(pick.depth, f64::from(hits[at]));
    let clip = clip_from_world() * pick.position.extend(1.0);
    let there =
        [(clip.x / clip.w + 1.0) / 2.0 * f64::from(SIZE[0]), (1.0 - clip.y / clip.w) / 2.0 * f64::from(SIZE[1])];
    for axis in 0..2 {
        assert!((there[axis] - f64::from(pixel[axis]) - 0.5).abs() < 1e-6, "{there:?} for {pixel:?}");
    }
}

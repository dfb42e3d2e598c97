//! Devices that fail while they render without a host: typed errors, and what still works afterwards.

use sheetsplat::DeviceError;
use sheetsplat::RenderError;
use sheetsplat::Surfaces;
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::scene::Scene;
use sheetsplat::settings::Rasterizer;
use sheetsplat::volume::{Volume, builtin};
use sheetsplat::wgpu::{self, TextureFormat, TextureViewDescriptor};
use sheetsplat::{DeviceFault, scoped};
use sheetsplat::{GpuVolume, Renderer, RendererOptions, SceneView};

use crate::common::devices::new_gpu;
use crate::common::surfaces::{DepthRange, clip_from_world};
use crate::common::{RASTERIZERS, scene, transfer};

fn head() -> (Volume, Scene) {
    let mut scene = scene(60, 50);
    scene.channels[0].transfer = transfer(&[(40.0, [0.9, 0.6, 0.4])], &[(30.0, 0.0), (120.0, 0.3)]);
    (builtin::volume("head:16").unwrap(), scene)
}

fn is_lost<T: std::fmt::Debug>(result: Result<T, RenderError>) {
    match result {
        Err(error @ RenderError::Device(DeviceFault::Lost)) => assert_eq!(error.to_string(), "the device is lost"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_lost_device_is_an_error_everywhere_and_another_one_renders() {
    for rasterizer in RASTERIZERS {
        let (volume, mut scene) = head();
        scene.splatting.rasterizer = rasterizer;
        let gpu = new_gpu();
        let mut view = gpu.view(volume.clone(), &scene).unwrap();
        view.set_first_hit(Some(0.1)).unwrap();
        let before = gpu.draw(&mut view).unwrap().image;
        let mut prepared = gpu.view(volume.clone(), &scene).unwrap();
        gpu.renderer().prepare(gpu.device(), gpu.queue(), &mut prepared).unwrap();

        let volumes = view.volume().gpu_volume().clone();
        gpu.device().destroy();
        is_lost(gpu.pick(&view, [30, 20]));
        is_lost(gpu.draw(&mut view));
        is_lost(gpu.draw(&mut view));
        is_lost(gpu.renderer().prepare(gpu.device(), gpu.queue(), &mut prepared));
        is_lost(GpuVolume::new(gpu.device(), gpu.queue(), volume.clone()));
        is_lost(SceneView::new(gpu.device(), &volumes, &scene));
        is_lost(gpu.render_volume(volume.clone(), &scene));
        let options = RendererOptions::DETERMINISTIC;
        match Renderer::new(gpu.device(), gpu.queue(), &options) {
            Err(DeviceError::Pipelines { fault: DeviceFault::Lost, .. }) => {}
            other => panic!("{other:?}"),
        }

        let other = new_gpu();
        let mut view = other.view(volume, &scene).unwrap();
        view.set_first_hit(Some(0.1)).unwrap();
        assert!(other.draw(&mut view).unwrap().image == before);
    }
}

#[test]
fn objects_of_another_device_are_an_error() {
    let (volume, scene) = head();
    let [one, other] = [new_gpu(), new_gpu()];
    let mut view = one.view(volume, &scene).unwrap();
    let refused = |result: Result<(), RenderError>| match result {
        Err(RenderError::OutOfRange(error)) if error.key == "device" => error.to_string(),
        result => panic!("{result:?}"),
    };
    let message = refused(other.draw(&mut view).map(|_| ()));
    assert_eq!(message, "device: found another device than that of the view, allowed: the device of the view");
    let volume = view.volume().gpu_volume().clone();
    assert!(refused(SceneView::new(other.device(), &volume, &scene).map(|_| ())).contains("the volume"));
    let prepared = other.renderer().prepare(one.device(), one.queue(), &mut view).map(|_| ());
    assert!(refused(prepared).contains("the renderer"));
    one.draw(&mut view).unwrap();
}

/// A depth texture view that is not restricted to the depth aspect, which only the device detects.
#[test]
fn validation_errors_are_returned_and_the_device_goes_on() {
    let (volume, scene) = head();
    let gpu = new_gpu();
    let mut view = gpu.view(volume, &scene).unwrap();
    let before = gpu.draw(&mut view).unwrap().image;
    let depth = gpu.device().create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: 60, height: 50, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: TextureFormat::Depth24PlusStencil8,
        usage: wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    let grid = *view.volume().grid();
    let shown = ViewGeometry::new(&grid, &scene.camera, &scene.splatting, [60, 50]).unwrap();
    let clip_from_world = clip_from_world(&shown, grid.unit(), DepthRange::Standard, [-50.0, 50.0]);
    let depth = depth.create_view(&TextureViewDescriptor::default());
    view.set_surfaces(Some(Surfaces { depth, origin: [0; 2], clip_from_world })).unwrap();
    for _ in 0..2 {
        match gpu.draw(&mut view) {
            Err(error @ RenderError::Device(DeviceFault::Validation(_))) => {
                let message = error.to_string();
                assert!(message.starts_with("device error: ") && message.lines().count() == 1, "{message}");
            }
            other => panic!("{other:?}"),
        }
    }
    view.set_surfaces(None).unwrap();
    assert!(gpu.draw(&mut view).unwrap().image == before);
}

/// The driver's textures cannot be that large. Nothing of that size is written.
#[test]
fn too_large_an_image_is_out_of_memory_and_the_device_goes_on() {
    let (volume, mut scene) = head();
    scene.splatting.rasterizer = Rasterizer::Quads;
    let gpu = new_gpu();
    let mut view = gpu.view(volume, &scene).unwrap();
    let before = gpu.draw(&mut view).unwrap();
    let small = scene.image;
    (scene.image.width, scene.image.height) = (16384, 16384);
    view.set_image(scene.image).unwrap();
    for _ in 0..2 {
        match gpu.renderer().prepare(gpu.device(), gpu.queue(), &mut view) {
            Err(error @ RenderError::Device(DeviceFault::OutOfMemory(_))) => {
                let message = error.to_string();
                assert!(
                    message.starts_with("the device is out of memory: ") && message.lines().count() == 1,
                    "{message}"
                );
            }
            other => panic!("{other:?}"),
        }
        assert_eq!(view.gpu_bytes(), view.volume().gpu_bytes(), "no frame is kept");
    }
    view.set_image(small).unwrap();
    let after = gpu.draw(&mut view).unwrap();
    assert!(after.image == before.image);
    assert_eq!(after.stats.gpu_bytes, before.stats.gpu_bytes);
}

/// The device cannot compile a host's shader in the library's error scope. It continues to work.
#[test]
fn a_shader_that_does_not_compile_is_an_error_and_the_device_goes_on() {
    let gpu = new_gpu();
    let descriptor = |source: &'static str| wgpu::ShaderModuleDescriptor {
        label: Some("host.shader"),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    };
    let compiled = |source| scoped(gpu.device(), || gpu.device().create_shader_module(descriptor(source)));
    for source in ["fn main() { return 1; }", "@compute fn main() {}", "not a shader"] {
        match compiled(source) {
            Err(DeviceFault::Validation(message)) => assert!(message.contains("host.shader"), "{message}"),
            other => panic!("{source}: {other:?}"),
        }
    }
    assert!(compiled("@compute @workgroup_size(1) fn main() {}").is_ok());
    let (volume, scene) = head();
    gpu.render_volume(volume, &scene).unwrap();
}

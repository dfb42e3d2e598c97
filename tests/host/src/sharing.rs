//! Volumes shared by views and renderers, views that change their size, and what is left when all of them are dropped.

use sheetsplat::{Blend, GpuVolume, Placement, RendererOptions, SceneView};
use wgpu::TextureFormat;

use crate::{Host, OPAQUE, headless, pixels, scene, size};

const F32: TextureFormat = TextureFormat::Rgba32Float;
const BYTES: TextureFormat = TextureFormat::Rgba8Unorm;

fn replacing(format: TextureFormat) -> RendererOptions {
    RendererOptions::for_target(format).with_blend(Blend::Replace)
}

fn bytes(image: &[[f32; 4]]) -> Vec<u8> {
    image.as_flattened().iter().map(|channel| (channel.min(1.0) * 255.0).round() as u8).collect()
}

fn assert_within_one(actual: &[u8], expected: &[u8]) {
    assert_eq!(actual.len(), expected.len());
    let most = actual.iter().zip(expected).map(|(actual, expected)| actual.abs_diff(*expected)).max();
    assert!(most <= Some(1), "bytes differ by {most:?}");
}

/// Two views of one volume, drawn by two renderers into two formats: the volume is on the GPU once.
#[test]
fn a_volume_is_uploaded_once() {
    let host = Host::new();
    let renderers = [F32, BYTES].map(|format| host.renderer(replacing(format)));
    let scene = scene(OPAQUE);
    let volume = host.volume(&scene);
    let [estimate, _] = GpuVolume::estimate(&host.device, volume.volume()).unwrap();
    assert_eq!(volume.gpu_bytes(), estimate);
    let mut turned = scene.clone();
    turned.camera.direction.x = -1.0;
    let mut views = [&scene, &turned].map(|scene| SceneView::new(&host.device, &volume, scene).unwrap());
    let shared = views.each_ref().map(|view| view.volume().gpu_volume().gpu_bytes());
    assert_eq!(shared, [volume.gpu_bytes(); 2]);
    assert!(std::ptr::eq(views[0].volume().value_list(), views[1].volume().value_list()), "sorted once");

    let images = [&scene, &turned].map(headless);
    assert!(images[0] != images[1]);
    let [first, second] = &mut views;
    assert!(pixels(&host.render(&renderers[0], F32, first)) == images[0]);
    assert_within_one(&host.render(&renderers[1], BYTES, second), &bytes(&images[1]));
    // Each view changes its own transfer function.
    first.set_iso_ranges(Some(vec![[150.0, 255.0]])).unwrap();
    assert!(pixels(&host.render(&renderers[0], F32, first)) != images[0]);
    assert_within_one(&host.render(&renderers[1], BYTES, second), &bytes(&images[1]));
}

/// One view is recorded once and presented in two formats, and drawn alternately by renderers with different sheets.
#[test]
fn a_view_serves_several_renderers() {
    let host = Host::new();
    let quads = |format, sheet_format, sheets| {
        let options = replacing(format).with_rasterizer(sheetsplat::settings::Rasterizer::Quads);
        host.renderer(options.with_sheet_format(sheet_format).with_sheets_per_group(sheets))
    };
    let renderers = [quads(F32, F32, 4), quads(BYTES, TextureFormat::Rgba16Float, 2)];
    let mut view = host.view(&scene(OPAQUE));
    let alone = pixels(&host.render(&renderers[0], F32, &mut view));
    let target = host.target(BYTES, size(&view), 1);
    let mut encoder = host.encoder();
    let to = target.create_view(&wgpu::TextureViewDescriptor::default());
    renderers[1].present(&mut encoder, &mut view, &to, Placement::whole([90, 70])).unwrap();
    host.submit(encoder);
    assert_within_one(&host.read(&target), &bytes(&alone));
    for _ in 0..2 {
        let mut fresh = host.view(&scene(OPAQUE));
        let expected = host.render(&renderers[1], BYTES, &mut fresh);
        assert!(host.render(&renderers[1], BYTES, &mut view) == expected);
        assert!(pixels(&host.render(&renderers[0], F32, &mut view)) == alone);
    }
}

#[test]
fn views_change_their_size() {
    let host = Host::new();
    let renderer = host.renderer(replacing(F32));
    let mut scene = scene(OPAQUE);
    let mut view = host.view(&scene);
    let mut held = Vec::new();
    for size in [[90, 70], [200, 150], [1, 1], [33, 64], [90, 70]] {
        [scene.image.width, scene.image.height] = size;
        view.set_image(scene.image).unwrap();
        assert!(pixels(&host.render(&renderer, F32, &mut view)) == headless(&scene), "{size:?}");
        held.push(view.gpu_bytes());
    }
    assert!(held[1] > held[0] && held[2] < held[0], "{held:?} bytes held");
}

/// After a failed preparation a view still shows its last image.
#[test]
fn a_failed_preparation_leaves_the_last_image() {
    let host = Host::new();
    let renderer = host.renderer(replacing(F32));
    let mut view = host.view(&scene(OPAQUE));
    let before = host.render(&renderer, F32, &mut view);
    let mut image = view.scene().image;
    image.width = 1_000_000;
    view.set_image(image).unwrap();
    let error = renderer.prepare(&host.device, &host.queue, &mut view).unwrap_err().to_string();
    assert!(error.contains("image.width") && error.contains("1000000"), "{error}");
    let target = host.target(F32, [90, 70], 1);
    let mut encoder = host.encoder();
    let to = target.create_view(&wgpu::TextureViewDescriptor::default());
    renderer.present(&mut encoder, &mut view, &to, Placement::whole([90, 70])).unwrap();
    host.submit(encoder);
    assert!(host.read(&target) == before);
}

/// A view that was never prepared draws nothing.
#[test]
fn a_view_that_was_never_prepared_draws_nothing() {
    let host = Host::new();
    let renderer = host.renderer(replacing(BYTES));
    let mut view = host.view(&scene(OPAQUE));
    let there: Vec<u8> = (0..90 * 70 * 4).map(|at| (at % 251) as u8).collect();
    let target = host.filled(BYTES, [90, 70], &there);
    let mut encoder = host.encoder();
    renderer.record(&mut encoder, &mut view);
    let to = target.create_view(&wgpu::TextureViewDescriptor::default());
    renderer.present(&mut encoder, &mut view, &to, Placement::whole([90, 70])).unwrap();
    host.submit(encoder);
    assert!(host.read(&target) == there);
}

/// Everything of the library is dropped while its frame is in flight; the frame arrives, and the host's device continues to work. The frame is
/// prepared and recorded on another thread.
#[test]
fn everything_may_be_dropped() {
    let host = Host::new();
    let target = host.target(F32, [90, 70], 1);
    let to = target.create_view(&wgpu::TextureViewDescriptor::default());
    let ours = || {
        let report = host.device.generate_allocator_report().unwrap();
        report.allocations.iter().filter(|allocation| allocation.name.starts_with("sheetsplat")).count()
    };
    let encoder = std::thread::scope(|scope| {
        let thread = scope.spawn(|| {
            let renderer = host.renderer(replacing(F32));
            let mut view = host.view(&scene(OPAQUE));
            renderer.prepare(&host.device, &host.queue, &mut view).unwrap();
            let mut encoder = host.encoder();
            renderer.record(&mut encoder, &mut view);
            renderer.present(&mut encoder, &mut view, &to, Placement::whole([90, 70])).unwrap();
            assert!(ours() > 5, "{} allocations", ours());
            encoder
        });
        thread.join().unwrap()
    });
    host.submit(encoder);
    assert!(pixels(&host.read(&target)) == headless(&scene(OPAQUE)));
    host.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    assert_eq!(ours(), 0, "allocations are left");
}

/// A frame's counts and times arrive while it is presented again; times cover only the library's own passes.
#[test]
fn counts_come_while_the_image_is_presented() {
    let host = Host::new();
    let renderer = host.renderer(replacing(F32).with_profile(true));
    let target = host.target(F32, [90, 70], 1);
    let to = target.create_view(&wgpu::TextureViewDescriptor::default());
    let mut view = host.view(&scene(OPAQUE));
    for presents in [0, 1, 3] {
        renderer.prepare(&host.device, &host.queue, &mut view).unwrap();
        let mut encoder = host.encoder();
        renderer.record(&mut encoder, &mut view);
        for _ in 0..presents {
            renderer.present(&mut encoder, &mut view, &to, Placement::whole([90, 70])).unwrap();
        }
        host.submit(encoder);
        let counts = view.counts().unwrap();
        assert!(view.counts().is_none(), "once per frame");
        let mut encoder = host.encoder();
        renderer.present(&mut encoder, &mut view, &to, Placement::whole([90, 70])).unwrap();
        host.submit(encoder);
        host.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        let (counts, times) = counts.try_get().unwrap().unwrap();
        assert!(counts.voxels_shaded > 1000 && counts.sections_rasterized > counts.voxels_shaded, "{counts:?}");
        let stages: Vec<_> = times.keys().copied().collect();
        let expected = if presents == 0 { &["gather"][..] } else { &["gather", "resolve"] };
        assert_eq!(stages, expected, "presented {presents} times");
        assert!(times.values().all(|&ms| ms > 0.0), "{times:?}");
    }
}

//! Failures of the host's device are returned as errors of the call that caused them: none reaches the device's own handler.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use sheetsplat::DeviceError;
use sheetsplat::RenderError;
use sheetsplat::{DeviceFault, scoped};
use sheetsplat::{Placement, Renderer, RendererOptions};
use wgpu::{TextureFormat, TextureViewDescriptor};

use crate::{Host, OPAQUE, scene, size};

const F32: TextureFormat = TextureFormat::Rgba32Float;

/// Counts the errors that no scope caught.
fn uncaptured(host: &Host) -> Arc<AtomicUsize> {
    let count = Arc::new(AtomicUsize::new(0));
    let counted = count.clone();
    host.device.on_uncaptured_error(Arc::new(move |_| _ = counted.fetch_add(1, Ordering::Relaxed)));
    count
}

#[test]
fn validation_errors_of_a_scope_are_returned() {
    let host = Host::new();
    let uncaptured = uncaptured(&host);
    let renderer = host.renderer(RendererOptions::for_target(TextureFormat::Rgba8Unorm));
    let mut view = host.view(&scene(OPAQUE));
    let before = host.render(&renderer, TextureFormat::Rgba8Unorm, &mut view);
    // Only the device can refuse this: a target of another format.
    let target = host.target(F32, size(&view), 1).create_view(&TextureViewDescriptor::default());
    let submitted = scoped(&host.device, || {
        let mut encoder = host.encoder();
        renderer.present(&mut encoder, &mut view, &target, Placement::whole([90, 70])).unwrap();
        host.submit(encoder);
    });
    assert!(matches!(submitted, Err(DeviceFault::Validation(_))), "{submitted:?}");
    assert!(host.render(&renderer, TextureFormat::Rgba8Unorm, &mut view) == before, "nothing has changed");
    assert_eq!(scoped(&host.device, || 7), Ok(7));
    assert_eq!(uncaptured.load(Ordering::Relaxed), 0);
}

#[test]
fn a_lost_device_is_lost_to_its_host() {
    let host = Host::new();
    let uncaptured = uncaptured(&host);
    let renderer = host.renderer(RendererOptions::for_target(TextureFormat::Rgba8Unorm));
    let mut view = host.view(&scene(OPAQUE));
    let before = host.render(&renderer, TextureFormat::Rgba8Unorm, &mut view);
    let target = host.target(TextureFormat::Rgba8Unorm, size(&view), 1);
    host.device.destroy();
    // A frame that is already prepared may still be recorded.
    let submitted = scoped(&host.device, || {
        let mut encoder = host.encoder();
        renderer.record(&mut encoder, &mut view);
        let target = target.create_view(&TextureViewDescriptor::default());
        renderer.present(&mut encoder, &mut view, &target, Placement::whole([90, 70])).unwrap();
        host.submit(encoder);
    });
    assert_eq!(submitted, Err(DeviceFault::Lost));
    let prepared = renderer.prepare(&host.device, &host.queue, &mut view);
    assert!(matches!(prepared, Err(RenderError::Device(DeviceFault::Lost))), "{prepared:?}");
    let options = RendererOptions::for_target(TextureFormat::Rgba8Unorm);
    let renderer = Renderer::new(&host.device, &host.queue, &options);
    assert!(matches!(renderer, Err(DeviceError::Pipelines { fault: DeviceFault::Lost, .. })), "{renderer:?}");
    assert_eq!(uncaptured.load(Ordering::Relaxed), 0);

    let other = Host::new();
    let renderer = other.renderer(options);
    assert!(other.render(&renderer, TextureFormat::Rgba8Unorm, &mut other.view(&scene(OPAQUE))) == before);
}

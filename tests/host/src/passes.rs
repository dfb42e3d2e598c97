//! Images in the host's passes, at any place in a target, over its content.

use sheetsplat::{Blend, Placement, RendererOptions, SceneView};
use wgpu::{Color, LoadOp, Operations, StoreOp, Texture, TextureFormat, TextureView};

use crate::compare::{assert_at_most, largest};
use crate::{F16, Host, OPAQUE, TRANSPARENT, f16, headless, pixels, scene, size};

const F32: TextureFormat = TextureFormat::Rgba32Float;
const DEPTH: TextureFormat = TextureFormat::Depth24PlusStencil8;

/// Numbers to fill a target with, all different.
fn noise(texels: u32) -> Vec<[f32; 4]> {
    (0..texels).map(|at| [0, 1, 2, 3].map(|channel| ((at * 4 + channel) as f32 * 0.618_034).fract())).collect()
}

fn view_of(texture: &Texture) -> TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

fn over(image: [f32; 4], target: [f32; 4]) -> [f32; 4] {
    [0, 1, 2, 3].map(|channel| image[channel] + (1.0 - image[3]) * target[channel])
}

#[track_caller]
fn assert_near(actual: [f32; 4], expected: [f32; 4], tolerance: f32, what: &str) {
    let error = largest(actual.into_iter().zip(expected).map(|(a, b)| f64::from(a) - f64::from(b)));
    assert_at_most(error, tolerance.into(), format_args!("{what}: {actual:?}, not {expected:?}"));
}

#[test]
fn the_image_goes_over_what_is_there() {
    let host = Host::new();
    let renderer = host.renderer(RendererOptions::for_target(F32));
    let mut view = host.view(&scene(TRANSPARENT));
    let [width, height] = size(&view);
    let there = noise(width * height);
    let target = host.filled(F32, size(&view), bytemuck::cast_slice(&there));
    renderer.prepare(&host.device, &host.queue, &mut view).unwrap();
    let mut encoder = host.encoder();
    renderer.record(&mut encoder, &mut view);
    renderer.present(&mut encoder, &mut view, &view_of(&target), Placement::whole([width, height])).unwrap();
    host.submit(encoder);
    let image = headless(&scene(TRANSPARENT));
    let translucent = image.iter().filter(|pixel| (0.1..0.9).contains(&pixel[3])).count();
    assert!(translucent > 500, "{translucent} translucent pixels");
    for ((actual, image), there) in pixels(&host.read(&target)).into_iter().zip(image).zip(there) {
        assert_near(actual, over(image, there), 2e-7, "over");
    }
}

/// The image is placed at every corner of a target, in its middle, and outside it, with and without a scissor. It has several bands where
/// bindings are small.
#[test]
fn images_go_anywhere_and_nothing_else_changes() {
    let limits = wgpu::Limits { max_storage_buffer_binding_size: 1 << 16, ..wgpu::Limits::default() };
    for host in [Host::new(), Host::with(wgpu::Features::FLOAT32_BLENDABLE, limits)] {
        let options = RendererOptions::for_target(F32).with_blend(Blend::Replace);
        let renderer = host.renderer(options);
        let mut view = host.view(&scene(OPAQUE));
        let [width, height] = size(&view).map(i64::from);
        let image = pixels(&host.render(&renderer, F32, &mut view));
        let large = [160, 120];
        let there = noise(large[0] * large[1]);
        for origin in
            [[0, 0], [30, 20], [-41, -33], [110, 90], [-5, 60], [159, 119], [-89, -69], [-90, 0], [i32::MIN, 7]]
        {
            for scissor in [[0, 0, 160, 120], [33, 21, 40, 57], [0, 0, 1, 1], [5, 5, 0, 9]] {
                let target = host.filled(F32, large, bytemuck::cast_slice(&there));
                let mut encoder = host.encoder();
                // The image is still there and need not be recorded again.
                renderer.present(&mut encoder, &mut view, &view_of(&target), Placement { origin, scissor }).unwrap();
                host.submit(encoder);
                let actual = pixels(&host.read(&target));
                let [x, y, w, h] = scissor.map(i64::from);
                let mut changed = 0;
                for (at, (actual, there)) in (0..).zip(actual.into_iter().zip(&there)) {
                    let (column, row) = (at % i64::from(large[0]), at / i64::from(large[0]));
                    let (i, j) = (column - i64::from(origin[0]), row - i64::from(origin[1]));
                    let inside = (x..x + w).contains(&column) && (y..y + h).contains(&row);
                    if inside && (0..width).contains(&i) && (0..height).contains(&j) {
                        changed += 1;
                        assert_eq!(actual, image[(j * width + i) as usize], "{origin:?} {scissor:?}, pixel {i} {j}");
                    } else {
                        assert_eq!(actual, *there, "{origin:?} {scissor:?}: the host's texel {column} {row}");
                    }
                }
                assert_eq!(changed > 0, covers(origin, scissor), "{origin:?} {scissor:?}");
            }
        }
    }
}

/// Whether a 90 by 70 image covers any part of a scissor rectangle in a 160 by 120 target.
fn covers(origin: [i32; 2], [x, y, w, h]: [u32; 4]) -> bool {
    let meet = |at: i32, length: i64, start: u32, extent: u32| {
        i64::from(at).max(start.into()) < (i64::from(at) + length).min(i64::from(start) + i64::from(extent))
    };
    meet(origin[0], 90, x, w) && meet(origin[1], 70, y, h)
}

/// A host's pass with a colour attachment, several samples and a depth buffer, whose viewport is elsewhere.
struct Pass<'a> {
    host: &'a Host,
    size: [u32; 2],
    sample_count: u32,
    depth: Option<TextureFormat>,
}

impl Pass<'_> {
    fn draw(&self, format: TextureFormat, clear: Color, draw: impl FnOnce(&mut wgpu::RenderPass<'_>)) -> Vec<u8> {
        let target = self.host.target(format, self.size, 1);
        let resolved = view_of(&target);
        let samples = (self.sample_count > 1).then(|| view_of(&self.host.target(format, self.size, self.sample_count)));
        let depth = self.depth.map(|depth| view_of(&self.host.target(depth, self.size, self.sample_count)));
        let mut encoder = self.host.encoder();
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: samples.as_ref().unwrap_or(&resolved),
                depth_slice: None,
                resolve_target: samples.as_ref().map(|_| &resolved),
                ops: Operations { load: LoadOp::Clear(clear), store: StoreOp::Store },
            })],
            // Nearer than anything, so a depth test would fail.
            depth_stencil_attachment: depth.as_ref().map(|view| wgpu::RenderPassDepthStencilAttachment {
                view,
                depth_ops: Some(Operations { load: LoadOp::Clear(0.0), store: StoreOp::Store }),
                stencil_ops: Some(Operations { load: LoadOp::Clear(0), store: StoreOp::Store }),
            }),
            ..wgpu::RenderPassDescriptor::default()
        });
        pass.set_viewport(3.0, 5.0, 20.0, 10.0, 0.2, 0.7);
        pass.set_scissor_rect(1, 2, 3, 4);
        draw(&mut pass);
        drop(pass);
        self.host.submit(encoder);
        self.host.read(&target)
    }
}

fn recorded(host: &Host, renderer: &sheetsplat::Renderer, background: &str) -> SceneView {
    let mut view = host.view(&scene(background));
    renderer.prepare(&host.device, &host.queue, &mut view).unwrap();
    let mut encoder = host.encoder();
    renderer.record(&mut encoder, &mut view);
    host.submit(encoder);
    view
}

#[test]
fn in_the_hosts_pass_with_depth_and_samples() {
    let host = Host::new();
    let format = TextureFormat::Rgba16Float;
    let image = headless(&scene(TRANSPARENT));
    for (sample_count, depth) in [(1, None), (1, Some(DEPTH)), (4, None), (4, Some(DEPTH))] {
        let mut options = RendererOptions::for_target(format).with_sample_count(sample_count);
        options.depth_format = depth;
        let renderer = host.renderer(options);
        let view = recorded(&host, &renderer, TRANSPARENT);
        let pass = Pass { host: &host, size: [100, 80], sample_count, depth };
        let there = [0.2, 0.4, 0.6, 1.0];
        let [r, g, b, a] = there;
        let bytes = pass.draw(format, Color { r, g, b, a }, |pass| {
            renderer.draw(pass, &view, Placement { origin: [-7, 22], scissor: [0, 0, 100, 80] });
        });
        for (at, actual) in bytemuck::pod_collect_to_vec::<_, [u16; 4]>(&bytes).into_iter().enumerate() {
            let (column, row) = (at % 100, at / 100);
            let there = there.map(|channel| channel as f32);
            let expected = match row.checked_sub(22) {
                Some(j) if column + 7 < 90 => over(image[j * 90 + column + 7], there),
                _ => there,
            };
            let actual = actual.map(|bits| f16(bits) as f32);
            // The target's own number is truncated, and so is the sum.
            let what = format!("{sample_count} samples, {depth:?}, {column} {row}");
            assert_near(actual, expected, 2.0 * F16 as f32, &what);
        }
    }
}

/// Two volumes drawn in one encoder, side by side and on top of one another in one pass.
#[test]
fn several_views_in_one_encoder_and_one_pass() {
    let host = Host::new();
    let renderer = host.renderer(RendererOptions::for_target(F32));
    let mut other = scene(TRANSPARENT);
    other.channels[0].volume = sheetsplat::scene::VolumeSource::Builtin("tomato:32".to_owned());
    (other.image.width, other.image.height) = (61, 83);
    let scenes = [scene(TRANSPARENT), other];
    let mut views = scenes.each_ref().map(|scene| host.view(scene));
    for view in &mut views {
        renderer.prepare(&host.device, &host.queue, view).unwrap();
    }
    let size = [140, 90];
    let target = host.filled(F32, size, bytemuck::cast_slice(&noise(140 * 90)));
    let mut encoder = host.encoder();
    views.iter_mut().for_each(|view| renderer.record(&mut encoder, view));
    let origins = [[4, 9], [70, 2]];
    let at = |origin| Placement { origin, scissor: [0, 0, size[0], size[1]] };
    let resolved = view_of(&target);
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: &resolved,
            depth_slice: None,
            resolve_target: None,
            ops: Operations { load: LoadOp::Load, store: StoreOp::Store },
        })],
        ..wgpu::RenderPassDescriptor::default()
    });
    for (view, origin) in views.iter().zip(origins) {
        renderer.draw(&mut pass, view, at(origin));
    }
    drop(pass);
    host.submit(encoder);
    let mut expected = noise(140 * 90);
    for (scene, [x, y]) in scenes.iter().zip(origins) {
        let width = scene.image.width as usize;
        let image = headless(scene);
        assert!(image.iter().any(|pixel| pixel[3] > 0.5), "something is to be seen");
        for (at, image) in image.into_iter().enumerate() {
            let there = &mut expected[(at / width + y as usize) * 140 + at % width + x as usize];
            *there = over(image, *there);
        }
    }
    for (actual, expected) in pixels(&host.read(&target)).into_iter().zip(expected) {
        assert_near(actual, expected, 5e-7, "two views");
    }
}

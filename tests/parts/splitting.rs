//! Windows of about equal work.

use std::sync::Arc;

use sheetsplat::headless::Backend;
use sheetsplat::settings::{Projection, Window};
use sheetsplat::{Image, part};

use crate::common::compare::assert_at_most;
use crate::merging::{head, headless};

/// Every pixel's slabs are in one window, whatever the number of parts.
#[test]
fn windows_cover_all_once() {
    let (volume, scene) = head(32, [70, 41]);
    for count in [1, 2, 3, 7, 16, 64] {
        let windows = part::split(&Arc::clone(&volume).into(), &scene, count).unwrap();
        assert_eq!(windows.len(), count);
        let first = windows.iter().map(|window| window.slabs.start).min().unwrap();
        let end = windows.iter().map(|window| window.slabs.end).max().unwrap();
        for (x, y) in (0..70).step_by(3).flat_map(|x| (0..41).step_by(3).map(move |y| (x, y))) {
            let shows = |window: &&Window| {
                let region = window.region;
                (region.x..region.x + region.width).contains(&x) && (region.y..region.y + region.height).contains(&y)
            };
            let mut next = first;
            for window in windows.iter().filter(shows) {
                assert_eq!(window.slabs.start, next, "{count}: {x}, {y}");
                assert!(!window.slabs.is_empty());
                next = window.slabs.end;
            }
            assert_eq!(next, end, "{count}: {x}, {y}");
        }
    }
    let error = part::split(&Arc::clone(&volume).into(), &scene, 60_000).unwrap_err().to_string();
    assert!(error.starts_with("parts: found 60000, allowed: at most "), "{error}");
}

/// A view that shows no slab is one of parts, too.
#[test]
fn an_empty_view_has_parts() {
    let (volume, mut scene) = head(32, [70, 41]);
    scene.camera.projection = Projection::Perspective { fov_y: 30.0, distance: Some(100.0), near: Some(1000.0) };
    let headless = headless(Backend::Cpu);
    let windows = part::split(&Arc::clone(&volume).into(), &scene, 9).unwrap();
    assert_eq!(windows.len(), 3);
    assert!(windows.iter().all(|window| window.slabs.is_empty()));
    let mut view = headless.view(Arc::clone(&volume), &scene).unwrap();
    let parts: Vec<_> = windows.iter().map(|window| headless.draw_part(&mut view, window).unwrap().0).collect();
    let whole = headless.render_volume(volume, &scene).unwrap().image;
    assert_eq!(Image::merge(parts).unwrap().pixels, whole.pixels);
}

/// The work of windows, measured in the sections that they draw, is about equal; equal shares of slabs and pixels are not.
#[test]
fn windows_have_equal_work() {
    let (volume, mut scene) = head(64, [128, 128]);
    // Air takes no part.
    scene.channels[0].transfer.iso_ranges = Some(vec![[30.0, 255.0]]);
    scene.splatting.culling = false;
    let headless = headless(Backend::Cpu);
    let mut view = headless.view(Arc::clone(&volume), &scene).unwrap();
    let mut parts = Vec::new();
    let mut work = Vec::new();
    for window in part::split(&Arc::clone(&volume).into(), &scene, 16).unwrap() {
        let (part, stats) = headless.draw_part(&mut view, &window).unwrap();
        work.push(stats.counts.sections_rasterized as f64);
        parts.push(part);
    }
    let mean = work.iter().sum::<f64>() / work.len() as f64;
    let most = work.iter().fold(0.0, |most, &work| f64::max(most, work));
    println!("{:.2} of the mean: {work:?}", most / mean);
    assert_at_most(most / mean, 1.5, "the largest part's work");
    let whole = headless.render_volume(volume, &scene).unwrap().image;
    assert_at_most(crate::common::images::largest_difference(&Image::merge(parts).unwrap(), &whole), 1e-6, "merged");
}

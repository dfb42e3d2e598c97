//! Parts of random scenes over every key's range merge into the whole image.

use std::sync::Arc;

use sheetsplat::Image;
use sheetsplat::headless::Backend;
use sheetsplat::part::{self, Part};
use sheetsplat::settings::Compositing;

use crate::common::cases::cases;
use crate::common::images::largest_difference;
use crate::common::random_scene::Case;
use crate::merging::headless;

/// Pixels stop at other slabs in parts than in a whole, so nothing is culled; several ways of drawing have no parts, and say so.
#[test]
fn parts_of_random_scenes_merge() {
    let headless = headless(Backend::Cpu);
    let (mut merged, mut worst) = (0, 0.0);
    for seed in 0..cases(200, 1500) as u64 {
        let Case { volume, mut scene, .. } = Case::new(seed, seed);
        // Tables multiply the rounding errors of means, which parts carry as `f32`s, by their slopes.
        if scene.splatting.compositing == Compositing::Average {
            continue;
        }
        scene.splatting.culling = false;
        scene.splatting.opacity_threshold = 1.0;
        let volume = Arc::new(volume);
        let Ok(windows) = part::split(&Arc::clone(&volume).into(), &scene, 6) else { continue };
        let mut view = headless.view(Arc::clone(&volume), &scene).unwrap();
        let parts: Vec<Part> =
            windows.into_iter().map(|window| headless.draw_part(&mut view, &window).unwrap().0).collect();
        let whole = headless.render_volume(volume, &scene).unwrap().image;
        let difference = largest_difference(&Image::merge(parts).unwrap(), &whole);
        if difference > 1e-6 {
            println!("{difference:e} {}", Case::new(seed, seed).describe());
        }
        merged += 1;
        worst = f64::max(worst, difference);
    }
    println!("{merged} scenes, at most {worst:e}");
    assert!(worst <= 1e-6 && merged > 50, "{merged} scenes, at most {worst:e}");
}

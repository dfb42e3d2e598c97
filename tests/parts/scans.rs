//! Parts of a scan, streamed and in memory.

use std::sync::Arc;

use sheetsplat::Image;
use sheetsplat::headless::Backend;
use sheetsplat::scene::Scene;

use crate::common::compare::{assert_at_least, assert_at_most};
use crate::common::images::largest_difference;
use crate::common::shared::shared;
use crate::merging::{headless, parts};

#[test]
#[ignore = "needs the shared data"]
fn shared_parts_of_an_opaque_head_merge() {
    let path = shared("scenes/ct-head-opaque.toml");
    let mut volume = None;
    for classification in ["before", "after"] {
        for compositing in ["linear", "exponential", "xray", "maximum"] {
            let sets = [
                "image={width=128,height=128}".to_owned(),
                format!(
                    "splatting={{classification=\"{classification}\",compositing=\"{compositing}\",opacity_threshold=1}}"
                ),
            ];
            let scene = Scene::open(&path, &sets).unwrap();
            let volume = volume.get_or_insert_with(|| Arc::new(scene.load_volume().unwrap()));
            let headless = headless(Backend::Cpu);
            let whole = headless.render_volume(Arc::clone(volume), &scene).unwrap().image;
            // Eight slab ranges of four regions.
            let parts = parts(headless, volume, &scene, 8);
            assert_eq!(parts.len(), 32);
            let what = format!("{classification} {compositing}");
            let shown = whole.pixels.iter().filter(|pixel| **pixel != whole.pixels[0]).count();
            assert_at_least(shown as f64 / whole.pixels.len() as f64, 0.3, &what);
            assert_at_most(largest_difference(&Image::merge(parts).unwrap(), &whole), 1e-6, what);
        }
    }
}

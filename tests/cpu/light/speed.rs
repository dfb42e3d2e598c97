//! Times of light sheets. `cargo test --release --test cpu light::speed -- --ignored --nocapture` prints them.

use std::time::Instant;

use sheetsplat::Scene;
use sheetsplat::cpu::CpuRenderer;

use crate::common::shared::shared;

#[test]
#[ignore = "measures"]
fn shared_frames_with_and_without_light() {
    let scenes = ["ct-head-semi", "ct-head-opaque", "mr-head-opaque", "engine-semi", "bonsai-gradient"];
    for name in scenes {
        for classification in ["before", "after"] {
            let mut times = Vec::new();
            for (occlusion, shadow) in [(0.0, 0.0), (0.7, 0.0), (0.7, 0.6)] {
                let sets = [
                    "image={width=512,height=512}".to_owned(),
                    format!("shading.occlusion={occlusion}"),
                    format!("shading.shadow={shadow}"),
                    format!("splatting.classification={classification}"),
                ];
                let scene = Scene::open(&shared(&format!("scenes/{name}.toml")), &sets).unwrap();
                let mut renderer = CpuRenderer::new(scene.load_volume().unwrap(), &scene).unwrap();
                let mut of_frames: Vec<f64> = (0..4)
                    .map(|_| {
                        renderer.turn(3.0).unwrap();
                        let start = Instant::now();
                        renderer.draw().unwrap();
                        start.elapsed().as_secs_f64() * 1e3
                    })
                    .collect();
                let first = of_frames.remove(0);
                of_frames.sort_by(f64::total_cmp);
                times.push(format!("{:.0} (first {first:.0})", of_frames[1]));
            }
            println!("{name}, {classification}: {} ms", times.join(", "));
        }
    }
}

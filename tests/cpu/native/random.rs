//! Random scenes over every key's range against the f64 evaluation, and with culling against without.

use sheetsplat::cpu;
use sheetsplat::image::Image;

use crate::common::cases::cases;
use crate::common::random_scene::Case;
use crate::common::tally::{Tally, evaluate, required};

fn draw(case: &Case) -> Image {
    let rendering = cpu::render(case.volume.clone(), &case.scene);
    rendering.unwrap_or_else(|error| panic!("{error}: {}", case.describe())).image
}

fn check(tally: &mut Tally, mut case: Case) {
    case.scene.splatting.culling = false;
    let whole = draw(&case);
    tally.compare(&case, (&evaluate(&case), &whole), required(&case.scene), "cpu");
    case.scene.splatting.culling = true;
    tally.compare_culled(&case, (&whole, &draw(&case)), "cpu");
}

#[test]
fn random_scenes_are_the_twins() {
    let mut tally = Tally::new();
    for seed in 0..cases(500, 2000) as u64 {
        check(&mut tally, Case::new(seed, seed));
    }
    tally.finish();
}

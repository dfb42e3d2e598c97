//! Random scenes over every key's range, by quads and tiles, against the f64 evaluation, and with culling against without.

use sheetsplat::headless::GpuHeadless;
use sheetsplat::image::Image;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{FootprintBox, Method, Projection, Rasterizer, Splatting};

use crate::common::cases::cases;
use crate::common::devices::gpu;
use crate::common::random_scene::Case;
use crate::common::tally::{Tally, evaluate, required};

/// The dB that SPEC §12 asks of a GPU's images. After splatting with the kernel's gradient it asks less of all backends.
const REQUIRED: f64 = 60.0;

/// Scenes whose seeds differ by this have other styles.
const SEEDS_PER_STYLE: u64 = 1000;

/// The image of a case, or nothing where tiles refuse it, because they would take too long for one dispatch.
fn draw(gpu: &GpuHeadless, case: &Case, rasterizer: Rasterizer) -> Option<Image> {
    let splatting = Splatting { rasterizer, ..case.scene.splatting };
    let scene = Scene { splatting, ..case.scene.clone() };
    match gpu.render_volume(case.volume.clone(), &scene) {
        Ok(rendering) => Some(rendering.image),
        Err(error) => {
            let text = error.to_string();
            let is_too_long = ["passes through loops", "bricks behind a patch"].iter().any(|what| text.contains(what));
            assert!(rasterizer == Rasterizer::Tiles && is_too_long, "{text}: {}", case.describe());
            None
        }
    }
}

fn check(tally: &mut Tally, mut case: Case, rasterizer: Rasterizer) -> bool {
    let (gpu, by) = (gpu(), format!("{rasterizer:?}"));
    // Headless views warn of these.
    if case.scene.loses_normals_on_gpu() {
        return false;
    }
    case.scene.splatting.culling = false;
    let Some(whole) = draw(gpu, &case, rasterizer) else { return false };
    tally.compare(&case, (&evaluate(&case), &whole), required(&case.scene).min(REQUIRED), &by);
    case.scene.splatting.culling = true;
    if let Some(culled) = draw(gpu, &case, rasterizer) {
        tally.compare_culled(&case, (&whole, &culled), &by);
    }
    true
}

/// Whether a rasterizer draws scenes of a style: parallelograms are drawn by tiles alone, and every sample by quads alone.
fn draws(rasterizer: Rasterizer, style: u64) -> bool {
    let splatting = Case::new(style, SEEDS_PER_STYLE * style).scene.splatting;
    match rasterizer {
        Rasterizer::Tiles => splatting.method != Method::CompositeEverySample,
        _ => splatting.footprint_box != FootprintBox::Parallelogram,
    }
}

/// Draws some scenes of each style. A style's first scenes compile most of its pipelines.
fn check_styles(rasterizer: Rasterizer, styles: usize, seeds: usize) {
    let (mut tally, mut refused) = (Tally::new(), 0);
    for style in (0..).filter(|&style| draws(rasterizer, style)).take(styles) {
        for seed in 0..seeds as u64 {
            let case = Case::new(style, SEEDS_PER_STYLE * style + seed);
            refused += usize::from(!check(&mut tally, case, rasterizer));
        }
    }
    println!("{rasterizer:?}: {styles} styles of {seeds} seeds, {refused} scenes refused");
    tally.finish();
    assert!(refused * 4 <= styles * seeds, "{refused} scenes are refused");
}

#[test]
fn random_scenes_by_quads_are_the_twins() {
    check_styles(Rasterizer::Quads, cases(3, 40), cases(40, 30));
}

#[test]
fn random_scenes_by_tiles_are_the_twins() {
    check_styles(Rasterizer::Tiles, cases(3, 25), cases(20, 40));
}

/// The voxels that decide where a gradient points may be those of the least weights.
#[test]
fn gradients_of_steep_kernels_reach_as_far_as_the_kernel() {
    for rasterizer in [Rasterizer::Quads, Rasterizer::Tiles] {
        let (mut tally, mut case) = (Tally::new(), Case::new(0, 9));
        case.scene.camera.projection = Projection::Orthographic { height: Some(1000.0) };
        assert!(check(&mut tally, case, rasterizer), "{rasterizer:?} draws it");
        tally.finish();
    }
}

/// Many surfaces lie on the border of two cells, where rounding must not decide whose table colours them.
#[test]
fn surfaces_at_borders_of_cells_have_their_own_tables() {
    for rasterizer in [Rasterizer::Quads, Rasterizer::Tiles] {
        let mut tally = Tally::new();
        assert!(check(&mut tally, Case::new(7, 7004), rasterizer), "{rasterizer:?} draws it");
        tally.finish();
    }
}

/// A software driver ends loops that take longer than was counted, and the rest of a patch would be left out.
#[test]
fn searches_of_halves_count_as_passes() {
    let mut tally = Tally::new();
    assert!(check(&mut tally, Case::new(1, 1005), Rasterizer::Tiles));
    tally.finish();
}

/// Nothing takes part, and nothing is drawn.
#[test]
fn samples_of_no_voxels_are_the_background() {
    let case = Case::new(5, 5005);
    let image = draw(gpu(), &case, Rasterizer::Quads).unwrap();
    assert_eq!(image, evaluate(&case));
}

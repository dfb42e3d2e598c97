//! Whole frames against the f64 evaluation: PSNR and the largest single error, over slab widths, radii, spacings, directions and
//! compositings. `cargo test --test gpu accuracy:: -- --nocapture` prints the measurements as a table.

use glam::DVec3;
use sheetsplat::headless::GpuHeadless;
use sheetsplat::internals::reference;
use sheetsplat::settings::{Compositing, FootprintForm, Rasterizer};
use sheetsplat::volume::builtin;
use sheetsplat::wgpu::TextureFormat;

use crate::common::compare::assert_at_least;
use crate::common::images::{largest_difference, psnr};
use crate::common::{camera, scene, transfer};

/// The rasterizer, the footprint form, the sheet format, and the PSNR in dB that is required at every spacing. Tiles have their sheets in
/// registers, and amounts that are not rounded to f16.
const VARIANTS: [(&str, Rasterizer, FootprintForm, TextureFormat, [f64; SPACINGS.len()]); 4] = [
    ("summed-area, tiles", Rasterizer::Tiles, FootprintForm::SummedArea, TextureFormat::Rgba32Float, [111.0; 4]),
    ("summed-area, Rgba32Float", Rasterizer::Quads, FootprintForm::SummedArea, TextureFormat::Rgba32Float, [88.0; 4]),
    (
        "sections, Rgba32Float",
        Rasterizer::Quads,
        FootprintForm::Sections,
        TextureFormat::Rgba32Float,
        [64.0, 63.5, 71.0, 62.5],
    ),
    (
        "summed-area, Rgba16Float",
        Rasterizer::Quads,
        FootprintForm::SummedArea,
        TextureFormat::Rgba16Float,
        [60.0, 60.0, 62.0, 59.0],
    ),
];
const COMPOSITINGS: [Compositing; 2] = [Compositing::Linear, Compositing::Exponential];
const SPACINGS: [[f64; 3]; 4] = [[1.0, 1.0, 1.0], [1.0, 1.0, 2.0], [3.2, 3.2, 1.5], [1.0, 1.0, 5.0]];
const DIRECTIONS: [[f64; 3]; 3] = [[0.0, 1.0, 0.0], [0.3, 0.8, -0.5], [-0.7, 0.2, -0.9]];
const RADII: [f64; 2] = [1.4, 2.0];
const SLAB_WIDTHS: [f64; 4] = [0.5, 1.0, 2.0, 3.0];

/// The worst results of some images.
#[derive(Clone, Copy, Debug)]
struct Worst {
    psnr: f64,
    error: f64,
}

impl Worst {
    const NONE: Self = Self { psnr: f64::INFINITY, error: 0.0 };

    /// Neither number is NaN: the helpers that measure them assert that.
    fn and(self, other: Self) -> Self {
        Self { psnr: self.psnr.min(other.psnr), error: self.error.max(other.error) }
    }
}

#[test]
fn psnr_against_the_reference() {
    let devices = VARIANTS.map(|(_, _, _, format, _)| {
        GpuHeadless::new(&crate::common::devices::on_adapter().with_sheet_format(format)).unwrap()
    });
    let head = builtin::volume("head:24").unwrap();
    // A translucent skin and a denser skull, shaded, give gradients of many lengths and sums of many sheets.
    let mut scene = scene(96, 80);
    // The reference culls nothing; `tests/gpu/culling.rs` tests what culling may change.
    scene.splatting.culling = false;
    scene.channels[0].transfer = transfer(
        &[(40.0, [0.9, 0.6, 0.4]), (120.0, [0.8, 0.3, 0.2]), (220.0, [1.0, 1.0, 0.9])],
        &[(30.0, 0.0), (80.0, 0.15), (130.0, 0.1), (200.0, 0.9)],
    );
    let mut worst = [[[Worst::NONE; SPACINGS.len()]; COMPOSITINGS.len()]; VARIANTS.len()];
    for (s, spacing) in SPACINGS.into_iter().enumerate() {
        let volume = head.clone().with_spacing("head", DVec3::from(spacing)).unwrap();
        let transfer = scene.channels[0].transfer.resolve(&volume);
        for (c, compositing) in COMPOSITINGS.into_iter().enumerate() {
            for (direction, radius, slab_width) in DIRECTIONS.into_iter().flat_map(|direction| {
                RADII.into_iter().flat_map(move |radius| SLAB_WIDTHS.map(|width| (direction, radius, width)))
            }) {
                let half_diagonal = (volume.grid().center() * volume.spacing()).length();
                scene.camera = camera(direction, 1.7 * half_diagonal);
                (scene.splatting.radius, scene.splatting.slab_width) = (radius, slab_width);
                scene.splatting.compositing = compositing;
                scene.splatting.footprint = FootprintForm::SummedArea;
                let expected = reference::render(&volume, std::slice::from_ref(&transfer), &scene).unwrap();
                let background = scene.image.background.map(|channel| channel as f32);
                for (v, (_, rasterizer, footprint, ..)) in VARIANTS.into_iter().enumerate() {
                    (scene.splatting.rasterizer, scene.splatting.footprint) = (rasterizer, footprint);
                    let actual = devices[v].render_volume(volume.clone(), &scene).unwrap().image;
                    let this = Worst {
                        psnr: psnr(&actual.pixels, &expected.pixels, background, 501),
                        error: largest_difference(&actual, &expected),
                    };
                    worst[v][c][s] = worst[v][c][s].and(this);
                }
            }
        }
    }
    println!("{}", table(&worst));
    for (v, (name, .., required)) in VARIANTS.into_iter().enumerate() {
        for (c, s) in (0..COMPOSITINGS.len()).flat_map(|c| (0..SPACINGS.len()).map(move |s| (c, s))) {
            let what = format_args!("{name}, {:?}, {:?}", COMPOSITINGS[c], SPACINGS[s]);
            assert_at_least(worst[v][c][s].psnr, required[s], what);
        }
    }
}

/// Lowest PSNR and largest error of any channel, by variant, compositing and spacing.
fn table(worst: &[[[Worst; SPACINGS.len()]; COMPOSITINGS.len()]; VARIANTS.len()]) -> String {
    let mut table = "| footprint, sheet | compositing |".to_owned();
    SPACINGS.iter().for_each(|[x, y, z]| table += &format!(" {x}:{y}:{z} |"));
    table += "\n|---|---|---|---|---|---|\n";
    for (v, (name, ..)) in VARIANTS.into_iter().enumerate() {
        for (c, compositing) in COMPOSITINGS.into_iter().enumerate() {
            table += &format!("| {name} | {} |", format!("{compositing:?}").to_lowercase());
            worst[v][c].iter().for_each(|worst| table += &format!(" {:.1} dB, {:.1e} |", worst.psnr, worst.error));
            table += "\n";
        }
    }
    table
}

//! Sums of footprints: sections sum to the footprint, footprints that overlap add up, and tiles are zeroed before.

use glam::DVec4;
use sheetsplat::internals::footprint::{SECTION_SIZE, section_spacing};
use sheetsplat::internals::gpu::layout;
use sheetsplat::internals::quad_plan::{TILE, tile_grid};
use sheetsplat::settings::FootprintForm;
use sheetsplat::wgpu;

use super::{Fixture, GROUPS, Stages};
use crate::common::compare::{apart, assert_at_most, largest};
use crate::common::devices::gpu;
use crate::common::{F32, Random};
use crate::stages::section::{AMOUNT, VIEWS, view_scene};

/// As a function of ρ, all slabs' sheet buffers add up to the kernel's whole footprint. Over pixels, that footprint adds up to the kernel's
/// integral, 1.
#[test]
fn sections_sum_to_the_footprint_and_the_footprint_to_one() {
    let gpu = gpu();
    let stages = GROUPS.map(|sheets| Stages::new(gpu, sheets));
    let mut random = Random(11);
    let views = [
        ([0.0, 1.0, 0.0], [1.0, 1.0, 1.0], 0.16),
        ([0.3, 0.9, -0.2], [1.0, 1.0, 1.0], 0.15),
        ([0.6, 0.5, 0.6], [1.0, 1.0, 2.0], 0.21),
    ];
    // Kernels far from 0 at their rims are left out: for them the sum over pixels is not close to the integral.
    let kernels = [(2.0, 2.0), (1.4, 2.0), (4.0, 2.0), (3.0, 0.8)];
    for (kernel, view) in kernels.into_iter().flat_map(|kernel| views.map(|view| (kernel, view))) {
        for (form, (width, stage)) in [FootprintForm::SummedArea, FootprintForm::Sections]
            .into_iter()
            .flat_map(|form| [0.3, 1.0, 1.7].into_iter().zip(&stages).map(move |of| (form, of)))
        {
            let fixture = Fixture::new(stage, view_scene(view, kernel, width, form), view.1);
            let splat = layout::Splat {
                x_px: random.uniform(34.0, 36.0) as f32,
                y_px: random.uniform(22.0, 23.0) as f32,
                ..fixture.random_splat(&mut random)
            };
            let twin = fixture.twin_of(&splat);
            let slabs: Vec<i32> = fixture.touched(&twin).collect();
            let sheets = fixture.draw(&[splat], &[0], &slabs);
            let sum: Vec<DVec4> =
                (0..sheets[&slabs[0]].len()).map(|i| sheets.values().map(|sheet| sheet[i]).sum()).collect();

            let tolerance = match form {
                // The planes between slabs cancel except for the rounding of them and of the table entries. The rest is the step to the
                // nearest texel in the plane, u⁴/24 of the peak, at most 3e-5 for any kernel.
                FootprintForm::SummedArea => {
                    let plane_error = 4.0 * F32 * (twin.depth.abs() + kernel.0);
                    let per_plane = 4.0 * F32 * fixture.whole() + plane_error * fixture.kernel.value(0.0);
                    3e-5 * fixture.whole() + slabs.len() as f64 * per_plane
                }
                // Each section is up to half a spacing beside its position. The sum of these changes is the kernel's variation, up and down
                // again, over half a spacing; bilinear interpolation errs as above.
                FootprintForm::Sections => {
                    let spacing = section_spacing(&fixture.kernel, fixture.view.slabs.width);
                    let texel = fixture.kernel.support() / f64::from(SECTION_SIZE - 1);
                    spacing * fixture.kernel.value(0.0)
                        + fixture.kernel.falloff() * texel * texel / 2.0 * fixture.whole()
                }
            };
            let whole: Vec<DVec4> = (0..sum.len())
                .map(|pixel| fixture.kernel.section(fixture.rho(&twin, pixel).powi(2), -9.0, 9.0) * twin.amount)
                .collect();
            fixture.assert_close(&sum, &whole, |_| tolerance, &format!("{form:?} {splat:?}"));

            let pixel_area = fixture.geometry.footprint_from_pixels.determinant().abs() / fixture.amplitude();
            let sampled = whole.iter().sum::<DVec4>() * pixel_area;
            // The kernel's own error: at 4 and more pixels per grid unit a Gaussian's sum over pixels is its integral, and the jump of at
            // most h(radius) = 0.02·h(0) at the rim adds little.
            assert_at_most(apart(sampled, AMOUNT), 1e-3, format_args!("{kernel:?} {view:?}: {sampled}"));
            let total = sum.iter().sum::<DVec4>() * pixel_area;
            // Over the footprint the GPU errs by less than the tolerance times its effective area, π/falloff.
            let error = tolerance * std::f64::consts::PI / fixture.kernel.falloff();
            assert_at_most(apart(total, sampled), error, format_args!("{form:?} {kernel:?} {view:?}: {total}"));
        }
    }
}

/// Overlapping splats add up, and only the instances that are drawn count.
#[test]
fn instances_add_up() {
    let gpu = gpu();
    let mut random = Random(5);
    for stage in GROUPS.map(|sheets| Stages::new(gpu, sheets)) {
        let scene = view_scene(VIEWS[0], (2.0, 2.0), 1.0, FootprintForm::SummedArea);
        let fixture = Fixture::new(&stage, scene, VIEWS[0].1);
        let splats: Vec<_> = (0..300)
            .map(|_| layout::Splat { depth: random.uniform(-2.0, 5.0) as f32, ..fixture.random_splat(&mut random) })
            .collect();
        let instances: Vec<u32> = (0..300).rev().filter(|_| !random.bits().is_multiple_of(8)).collect();
        let twins: Vec<_> = instances.iter().map(|&at| fixture.twin_of(&splats[at as usize])).collect();
        let sheets = fixture.draw(&splats, &instances, &[0]);
        assert_eq!(sheets.len(), stage.sheets as usize);
        for (k, sheet) in sheets {
            let expected = fixture.twin(&twins, k);
            let most = largest(expected.iter().map(|pixel| pixel.w));
            assert!(most > fixture.whole(), "{most}: splats overlap");
            let tolerance = |pixel: usize| {
                let here = twins.iter().filter(|twin| fixture.rho(twin, pixel) <= 2.0);
                // Each has its own error, and the sum so far is rounded at each addition. These errors have either sign and are mostly far
                // below their bounds.
                here.map(|twin| fixture.tolerance(twin, k) / 100.0 + F32 * most).sum()
            };
            fixture.assert_close(&sheet, &expected, tolerance, "many splats");
        }
    }
}

/// Listed tiles are zeroed before anything is drawn; others are not zeroed, but footprints that reach there are added. The tiles stage
/// lists all tiles that are drawn to.
#[test]
fn listed_tiles_are_zeroed_and_no_others() {
    let gpu = gpu();
    let mut random = Random(6);
    for (stage, form) in GROUPS.map(|sheets| Stages::new(gpu, sheets)).iter().zip([
        FootprintForm::SummedArea,
        FootprintForm::Sections,
        FootprintForm::SummedArea,
    ]) {
        let mut scene = view_scene(VIEWS[0], (2.0, 2.0), 1.0, form);
        // Neither is a multiple of 32.
        (scene.image.width, scene.image.height) = (150, 77);
        let fixture = Fixture::new(stage, scene, VIEWS[0].1);
        let splats: Vec<_> = (0..40)
            .map(|_| layout::Splat { depth: random.uniform(-1.0, 4.0) as f32, ..fixture.random_splat(&mut random) })
            .collect();
        let all: Vec<u32> = (0..40).collect();
        let columns = tile_grid(fixture.view.size)[0] as usize;
        let tile_of = |pixel: usize| (pixel / 150 / TILE as usize * columns + pixel % 150 / TILE as usize) as u32;
        let clean = fixture.draw_group(&splats, &all, 0, &fixture.tiles);
        assert!(clean.iter().all(|sheet| sheet.iter().any(|pixel| pixel.w > 0.0)));
        // Each sheet has another content: a power of two, so that sums with it show what was added.
        let stale = |sheet: usize| (sheet as f32 - 2.5) * 16384.0;
        for listed in [vec![], vec![7], vec![0, 4, 9, 10, 14, 11], (0..15).rev().collect::<Vec<u32>>()] {
            for instances in [&all[..0], &all[..]] {
                for (at, sheet) in fixture.sheets.iter().enumerate() {
                    let layout =
                        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(150 * 16), rows_per_image: None };
                    let texels = vec![stale(at); 150 * 77 * 4];
                    let bytes = bytemuck::cast_slice(&texels);
                    gpu.queue().write_texture(sheet.as_image_copy(), bytes, layout, sheet.size());
                }
                let drawn = fixture.draw_group(&splats, instances, 0, &listed);
                for (at, (sheet, clean)) in drawn.iter().zip(&clean).enumerate() {
                    for (pixel, (actual, &clean)) in sheet.iter().zip(clean).enumerate() {
                        let clean = if instances.is_empty() { DVec4::ZERO } else { clean };
                        let is_listed = listed.contains(&tile_of(pixel));
                        let name = format!("sheet {at}, pixel {pixel}, {listed:?}, {} splats", instances.len());
                        if is_listed {
                            assert_eq!(*actual, clean, "{name}");
                        } else if clean == DVec4::ZERO {
                            assert_eq!(*actual, DVec4::splat(stale(at).into()), "{name}");
                        } else {
                            // Every addition is rounded to the precision of an f32 of that size.
                            let error = apart(*actual - f64::from(stale(at)), clean);
                            assert_at_most(error, 4.0 * 65536.0 * F32, name);
                        }
                    }
                }
            }
        }
    }
}

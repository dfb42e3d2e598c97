//! `splatting.rasterizer` and `splatting.footprint_box`, and devices whose subgroups have other sizes.

use crate::errors::assert_fails;
use crate::*;

#[test]
fn settings_that_exclude_each_other_are_2() {
    for (sets, words) in [
        (
            "--set splatting.rasterizer=quads --set splatting.footprint_box=parallelogram",
            ["splatting.rasterizer", "\"quads\"", "splatting.footprint_box", "\"parallelogram\""],
        ),
        (
            "--set splatting.rasterizer=tiles --set splatting.footprint=sections",
            ["splatting.rasterizer", "\"tiles\"", "splatting.footprint", "\"summed-area\""],
        ),
        (
            "--set splatting.footprint_box=parallelogram --set splatting.footprint=sections",
            ["splatting.rasterizer", "\"tiles\"", "splatting.footprint", "\"sections\""],
        ),
    ] {
        assert_fails(2, &format!("render good.nrrd -o out.png {sets}"), &[&["good.nrrd"], &words[..]].concat());
    }
}

/// Lavapipe's subgroups are as wide as its vectors: 8 threads, unless told otherwise.
const VECTORS: &str = "LP_NATIVE_VECTOR_WIDTH";

#[test]
fn subgroups_of_four_and_sixteen_threads_draw_the_same() {
    let folder = Folder::new();
    let oblique = "--set volume.spacing=[1,1,5] --set camera.direction=[0.4,0.7,-0.6] --set image.width=160 --set image.height=120";
    let perspective =
        "--set camera={projection=\"perspective\",direction=[0.5,0.8,-0.3]} --set splatting.compositing=exponential";
    let before = "--set splatting.classification=before";
    for sets in [
        format!("{oblique} {UNCULLED} {before}"),
        format!(
            "{oblique} {before} --set splatting.opacity_threshold=0.9999 --set splatting.footprint_box=parallelogram"
        ),
        format!("{perspective} {before} --set splatting.opacity_threshold=0.9999"),
        format!("{oblique} {before} --set splatting.compositing=minimum --set splatting.slab_width=0.4"),
        format!("{oblique} {UNCULLED} --set splatting.classification=after"),
        format!("{perspective} --set splatting.classification=after --set splatting.opacity_threshold=0.9999"),
    ] {
        let drawn = |width: &str| {
            let render = format!("render {SMALL} {sets} {TILES} -o out.npy --stats stats.json");
            folder.run_with(&[(VECTORS, width)], "", &render).assert_success();
            let stats: Value = serde_json::from_slice(&folder.read("stats.json")).unwrap();
            assert_eq!(stats["rasterizer"], "tiles");
            (folder.read_npy("out.npy").2, stats)
        };
        let (eight, stats) = drawn("256");
        for width in ["128", "512"] {
            let (other, of_other) = drawn(width);
            let decibels = psnr(&eight, &other, BLACK, 100);
            assert_at_least(decibels, 100.0, format_args!("{width} bits: {sets}"));
            if sets.contains(UNCULLED) {
                for count in ["voxels_shaded", "sections_rasterized", "tiles_composited"] {
                    assert_eq!(of_other[count], stats[count], "{width} bits, {count}: {sets}");
                }
            }
        }
    }
}

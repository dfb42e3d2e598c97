//! `splatting.rasterizer` and `splatting.footprint_box`, and devices whose subgroups have other sizes.

use crate::errors::assert_fails;
use crate::statistics::count;
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
fn subgroups_of_sixteen_threads_draw_the_same() {
    let folder = Folder::new();
    let oblique = "--set volume.spacing=[1,1,5] --set camera.direction=[0.4,0.7,-0.6] --set image.width=160 --set image.height=120";
    for sets in [UNCULLED, "--set splatting.opacity_threshold=0.9999 --set splatting.footprint_box=parallelogram"] {
        let [(eight, visits), (sixteen, as_many)] = ["256", "512"].map(|width| {
            let render = format!("render {SMALL} {oblique} {sets} {TILES} -o out.npy --stats stats.json");
            folder.run_with(&[(VECTORS, width)], "", &render).assert_success();
            let stats: Value = serde_json::from_slice(&folder.read("stats.json")).unwrap();
            (folder.read_npy("out.npy").2, count(&stats, "bricks_visited"))
        });
        assert_eq!(as_many, visits, "{sets}: a tile's visits serve all of its units");
        let decibels = psnr(&eight, &sixteen, BLACK, 250);
        assert_at_least(decibels, 120.0, sets);
    }
}

#[test]
fn subgroups_of_four_threads_leave_it_to_quads() {
    let folder = Folder::new();
    let narrow = [(VECTORS, "128")];
    folder.run_with(&narrow, "", &format!("render {SMALL} -o out.npy --stats stats.json")).assert_success();
    let stats: Value = serde_json::from_slice(&folder.read("stats.json")).unwrap();
    assert_eq!(stats["rasterizer"], "quads");
    let run = folder.run_with(&narrow, "", &format!("render {SMALL} {TILES} -o refused.npy"));
    run.assert_failure(2, &["splatting.rasterizer", "\"tiles\"", "subgroups of 4 to 4 threads", "\"quads\""]);
}

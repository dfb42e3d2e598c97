//! Scenes at the limits of what is allowed.

use crate::*;

#[track_caller]
fn assert_near(actual: f32, expected: f32, allowed: f32, what: &str) {
    let error = (f64::from(actual) - f64::from(expected)).abs();
    assert_at_most(error, allowed.into(), format_args!("{what}: {actual}, not {expected}"));
}

/// A ball of radius 4 with the value 200 in a background of 10, in 12³ voxels.
fn ball() -> Vec<f32> {
    let voxel = |i: i32| DVec3::new(f64::from(i % 12), f64::from(i / 12 % 12), f64::from(i / 144)) - 5.5;
    (0..1728).map(|i| if voxel(i).length() < 4.0 { 200.0 } else { 10.0 }).collect()
}

#[test]
fn extremes_agree_with_the_reference() {
    let folder = Folder::new();
    folder.write_nrrd("ball.nrrd", [12; 3], [1.0; 3], &ball());
    let huge: Vec<f32> = ball().into_iter().map(|value| if value > 100.0 { 3e38 } else { -3e38 }).collect();
    folder.write_nrrd("huge.nrrd", [12; 3], [1.0; 3], &huge);
    let view = "--set image={width=48,height=40} --set camera.direction=[0.3,0.9,-0.2]";
    for case in [
        "ball.nrrd --set volume.spacing=[1e-30,1e-30,1e-30]",
        "ball.nrrd --set volume.spacing=[1e30,1e30,1e30]",
        "ball.nrrd --set volume.spacing=[1000,1,1000]",
        "ball.nrrd --set volume.spacing=[1,1,10000] --set camera.height=30",
        "ball.nrrd --set camera.direction=[1e-300,1e-300,1e-301]",
        "ball.nrrd --set camera.height=1e-6 --set camera.center=[0.3,0.2,0.1]",
        "ball.nrrd --set camera.height=1e-12 --set camera.center=[2.91,0.2,1.3]",
        "ball.nrrd --set transfer.opacity=[[-1e300,0],[1e300,1]]",
        "ball.nrrd --set transfer.opacity=[[-1e300,0.2],[100,0.5],[1e300,0.1]]",
        "ball.nrrd --set transfer.opacity=[[-3e38,0],[3e38,1]]",
        "ball.nrrd --set transfer.gradient_opacity=[[-1e300,0],[1e300,1]]",
        "ball.nrrd --set transfer.color=[[-1e300,[1,0,0]],[1e300,[0,1,1]]]",
        "ball.nrrd --set shading.ambient=1e300 --set transfer.color=[[0,[0,0.5,1]]]",
        "ball.nrrd --set shading.shininess=1e300",
        "ball.nrrd --set shading.shininess=1e-300 --set shading.light=[0.3,0.9,-0.2]",
        "huge.nrrd",
        "huge.nrrd --set transfer.opacity=[[-3e38,0],[3e38,0.9]]",
    ] {
        for (classification, required) in [("before", 75.0), ("after", 100.0)] {
            let case = format!("{case} {view} --set splatting.classification={classification}");
            let (.., reference) = folder.pixels(&format!("{case} {UNCULLED} --backend reference"));
            for drawing in DRAWINGS {
                let (.., drawn) = folder.pixels(&format!("{case} {UNCULLED} {drawing}"));
                assert!(drawn.iter().flatten().all(|channel| channel.is_finite()), "{case} {drawing}");
                let decibels = psnr(&drawn, &reference, BLACK, 50);
                assert_at_least(decibels, required, format_args!("{case} {drawing}"));
            }
        }
    }
}

/// The low-pass rule makes amounts tiny, and a pixel adds up very many of them.
#[test]
fn minified_volumes_keep_their_opacity() {
    let folder = Folder::new();
    folder.write_nrrd("haze.nrrd", [24; 3], [1.0; 3], &[1.0; 24 * 24 * 24]);
    for opacity in [0.01, 0.0001] {
        let render = format!("haze.nrrd --set image={{width=2,height=2}} --set transfer.opacity=[[0,{opacity}]]");
        let (.., reference) = folder.pixels(&format!("{render} --backend reference"));
        for drawing in DRAWINGS {
            let (.., drawn) = folder.pixels(&format!("{render} {drawing}"));
            for (drawn, reference) in drawn.iter().flatten().zip(reference.iter().flatten()) {
                assert_near(*drawn, *reference, 1e-3 * reference, &format!("{opacity} {drawing}"));
            }
        }
    }
}

/// Drivers end long loops, so what lies behind a pixel is drawn in as many dispatches as necessary.
#[test]
fn deep_volumes_are_drawn_to_their_end() {
    let folder = Folder::new();
    let zeros = |dims: [usize; 3]| vec![0.0_f32; dims.iter().product()];
    // One voxel at either end, with thousands of empty sheet groups between them.
    let mut ends = zeros([1, 12, 1]);
    (ends[0], ends[11]) = (1.0, 1.0);
    folder.write_nrrd("ends.nrrd", [1, 12, 1], [1.0, 1000.0, 1.0], &ends);
    // Few voxels in many bricks, and many voxels in few bricks, all behind one or two pixels.
    let mut sparse = zeros([28; 3]);
    (0..343).for_each(|i| sparse[4 * (i % 7 + 28 * (i / 7 % 7 + 28 * (i / 49)))] = 1.0);
    folder.write_nrrd("sparse.nrrd", [28; 3], [1.0; 3], &sparse);
    folder.write_nrrd("dense.nrrd", [24; 3], [1.0; 3], &[1.0; 24 * 24 * 24]);
    // There are more control points than threads in a subgroup.
    let many: Vec<String> = (0..40).map(|i| format!("[{},{}]", f64::from(i) / 39.0, f64::from(i) * 1e-6)).collect();
    let many = format!("[{}]", many.join(","));
    for (volume, opacity, slab_width) in [
        ("ends", "[[0,0],[1,0.001]]", 0.25),
        ("sparse", "[[0,0],[1,0.001]]", 0.3),
        ("sparse", "[[0,0],[1,0.001]]", 8.0),
        ("dense", "[[0,0.0001]]", 0.3),
        ("dense", &many, 0.3),
        ("dense", &many, 8.0),
    ] {
        let render = format!(
            "{volume}.nrrd --set image={{width=2,height=2}} --set splatting.slab_width={slab_width} \
             --set transfer.opacity={opacity} --set splatting.compositing=exponential"
        );
        let (.., reference) = folder.pixels(&format!("{render} --backend reference"));
        for drawing in [TILES, "--backend cpu"] {
            let stats = folder.stats(&format!("{render} {drawing}"));
            assert_eq!(stats["sections_rasterized"], stats["sections_total"], "{render} {drawing}");
            let (.., drawn) = folder.read_npy("stats.npy");
            for (drawn, reference) in drawn.iter().flatten().zip(reference.iter().flatten()) {
                assert!(*reference > 0.0, "{render}");
                assert_near(*drawn, *reference, 1e-5 * reference, &format!("{render} {drawing}"));
            }
        }
    }
}

#[test]
fn the_smallest_and_the_narrowest() {
    let folder = Folder::new();
    folder.write_nrrd("ball.nrrd", [12; 3], [1.0; 3], &ball());
    folder.write_nrrd("one.nrrd", [1; 3], [1.0; 3], &[5.0]);
    for (volume, width, height) in
        [("one", 1, 1), ("ball", 1, 1), ("ball", 1, 200), ("ball", 8192, 1), ("ball", 1, 8192), ("one", 3, 5)]
    {
        // Classified after splatting, nothing shows where no pixel's ray meets the volume.
        let before = "--set splatting.classification=before";
        let render = format!("{volume}.nrrd --set image={{width={width},height={height}}} {WHOLE} {before}");
        let (.., reference) = folder.pixels(&format!("{render} --backend reference"));
        assert!(reference.iter().any(|pixel| pixel[0] > 0.0), "{render} is black");
        for drawing in DRAWINGS {
            let (found_width, found_height, drawn) = folder.pixels(&format!("{render} {UNCULLED} {drawing}"));
            assert_eq!((found_width, found_height), (width, height));
            for (drawn, reference) in drawn.iter().flatten().zip(reference.iter().flatten()) {
                assert_near(*drawn, *reference, 5e-5, &format!("{render} {drawing}"));
            }
        }
    }
    // Only the background is visible.
    for sets in [
        "camera={center=[1e300,1e300,1e300],fit='volume'}",
        "transfer.iso_ranges=[[1e30,2e30]]",
        "transfer.opacity=[[0,0]]",
    ] {
        for drawing in DRAWINGS {
            let render = format!("ball.nrrd --set image={{width=9,height=7}} --set {sets} {drawing}");
            assert_eq!(folder.pixels(&render).2, [BLACK; 63], "{render}");
        }
    }
}

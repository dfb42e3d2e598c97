//! Scenes at the ends of what is allowed.

use crate::*;

/// A ball of radius 4, 200 in 10, in 12³ voxels.
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
        let (.., gpu) = folder.pixels(&format!("{case} {view} {UNCULLED}"));
        let (.., reference) = folder.pixels(&format!("{case} {view} --backend reference"));
        assert!(gpu.iter().flatten().all(|channel| channel.is_finite()), "{case}");
        let decibels = psnr(&gpu, &reference, BLACK);
        assert!(decibels >= 60.0, "{case}: {decibels:.1} dB");
    }
}

/// The low-pass rule makes amounts tiny, of which a pixel adds up very many.
#[test]
fn minified_volumes_keep_their_opacity() {
    let folder = Folder::new();
    folder.write_nrrd("haze.nrrd", [24; 3], [1.0; 3], &[1.0; 24 * 24 * 24]);
    for opacity in [0.01, 0.0001] {
        let render = format!("haze.nrrd --set image={{width=2,height=2}} --set transfer.opacity=[[0,{opacity}]]");
        let (.., gpu) = folder.pixels(&render);
        let (.., reference) = folder.pixels(&format!("{render} --backend reference"));
        for (gpu, reference) in gpu.iter().flatten().zip(reference.iter().flatten()) {
            assert!((gpu - reference).abs() <= 1e-3 * reference, "{opacity}: {gpu}, not {reference}");
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
        let render = format!("{volume}.nrrd --set image={{width={width},height={height}}}");
        let (found_width, found_height, gpu) = folder.pixels(&format!("{render} {UNCULLED}"));
        assert_eq!((found_width, found_height), (width, height));
        let (.., reference) = folder.pixels(&format!("{render} --backend reference"));
        assert!(reference.iter().any(|pixel| pixel[0] > 0.0), "{render} is black");
        for (gpu, reference) in gpu.iter().flatten().zip(reference.iter().flatten()) {
            assert!((gpu - reference).abs() <= 2e-3, "{render}: {gpu}, not {reference}");
        }
    }
    // Nothing but background.
    for sets in ["camera.center=[1e300,1e300,1e300]", "transfer.iso_ranges=[[1e30,2e30]]", "transfer.opacity=[[0,0]]"] {
        let (.., pixels) = folder.pixels(&format!("ball.nrrd --set image={{width=9,height=7}} --set {sets}"));
        assert_eq!(pixels, [BLACK; 63], "{sets}");
    }
}

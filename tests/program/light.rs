//! `sheetsplat light`, and `--light`.

use crate::*;

/// A small scene in a fixed light, whose shadow does not depend on the camera.
const SCENE: &str =
    "builtin:head:24 --backend cpu --set image={width=40,height=30} --set transfer.opacity=[[40,0],[70,0.6]]";
const FIXED: &str = "--set shading={light=[-1,-2,2],shadow=0.8}";

#[test]
fn pictures_movies_and_parts_are_the_same() {
    let folder = Folder::new();
    folder.run(&format!("light {SCENE} {FIXED} -o light.npz")).assert_success();
    for (output, options) in [("image.npy", "--quiet"), ("part.npz", "--slabs -5..4 --region 3,2,20,21")] {
        folder.render(&format!("{SCENE} {FIXED} -o {output} {options} --stats stats.json"));
        let made = folder.read(output);
        assert!(String::from_utf8(folder.read("stats.json")).unwrap().contains("light_ms"));
        folder
            .run(&format!("render {SCENE} {FIXED} -o stored-{output} {options} --light light.npz --stats stats.json"))
            .assert_success();
        assert!(made == folder.read(&format!("stored-{output}")), "{output}");
        assert!(!String::from_utf8(folder.read("stats.json")).unwrap().contains("light_ms"));
    }
    // A shadow of a fixed light is that of all frames.
    folder.run(&format!("orbit {SCENE} {FIXED} --count 3 -o made-%d.npy")).assert_success();
    folder.run(&format!("orbit {SCENE} {FIXED} --count 3 -o stored-%d.npy --light light.npz")).assert_success();
    for frame in 0..3 {
        assert!(folder.read(&format!("made-{frame}.npy")) == folder.read(&format!("stored-{frame}.npy")), "{frame}");
    }
    // Without a transfer function, presets choose light that follows the camera.
    let bare = "builtin:head:24 --backend cpu --size 40x30";
    folder.run(&format!("light {bare} -o bare.npz --quiet")).assert_success();
    folder.render(&format!("{bare} -o image.npy"));
    folder.render(&format!("{bare} -o stored.npy --light bare.npz"));
    assert!(folder.read("image.npy") == folder.read("stored.npy"));
    folder.run(&format!("orbit {bare} --count 3 -o frame-%d.npy --light bare.npz")).assert_failure(
        2,
        &["builtin:head:24: bare.npz: occlusion.to_light: found [", "allowed: [", "as in the scene"],
    );
    assert!(!folder.path("frame-0.npy").exists());
}

#[test]
fn light_of_other_scenes_and_other_files_are_refused() {
    let folder = Folder::new();
    folder.run(&format!("light {SCENE} {FIXED} -o light.npz")).assert_success();
    let refused = |arguments: &str, words: &[&str]| {
        folder.run(&format!("render {SCENE} -o image.npy {arguments}")).assert_failure(2, words);
        assert!(!folder.path("image.npy").exists());
    };
    let lit = format!("--light light.npz {FIXED}");
    refused(&format!("{lit} --set shading.light_step=4"), &["light.npz: shadow.step: found 2, allowed: 4, as in"]);
    refused(&format!("{lit} --set transfer.opacity=[[40,0],[70,0.5]]"), &["light.npz: matter: found "]);
    refused("--light light.npz", &["light.npz: found a scene without light sheets", "shading.occlusion or"]);
    refused(&format!("{lit} --set shading.occlusion=0.5"), &["light.npz: occlusion: found none"]);
    refused("--light missing.npz", &["missing.npz: "]);
    refused("--light light.exr", &["light.exr: extension: found \".exr\", allowed: .npz"]);
    folder.run(&format!("render {SCENE} -o part.npz --slabs 0..3")).assert_success();
    refused("--light part.npz", &["part.npz: archive: found none with this name, allowed: a file light.json"]);
    let reference = format!("render {SCENE} {lit} -o image.npy").replace("--backend cpu", "--backend reference");
    folder.run(&reference).assert_failure(2, &["light: found stored light for backend \"reference\""]);
    let light = |arguments: &str, words: &[&str]| {
        folder.run(&format!("light {SCENE} {arguments}")).assert_failure(2, words);
    };
    light("-o other.npz", &["shading: found a scene without light sheets", "shading.shadow above 0"]);
    light(&format!("{FIXED} -o light.png"), &["light.png: extension: found \".png\", allowed: .npz for light"]);
    light(&format!("{FIXED} --set shading.light_step=0.1 -o other.npz"), &["shading.light_step: found 0.1"]);
    assert!(!folder.path("other.npz").exists());
    let lit = folder.read("light.npz");
    folder
        .run(&format!("render {SCENE} {FIXED} --light light.npz -o light.npz --slabs 0..3"))
        .assert_failure(2, &["--output light.npz: found the same file as the input light.npz"]);
    assert!(lit == folder.read("light.npz"));
}

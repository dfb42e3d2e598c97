//! `assets/paper`: the paper's figures, with captions that state measurements.

use std::fmt::Write;
use std::sync::Arc;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{Rgb, RgbImage};
use sheetsplat::headless::GpuHeadless;
use sheetsplat::image::Image;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Method, Splatting};
use sheetsplat::volume::Volume;

use crate::measures::{METHODS, Turn, ball, difference, right_over_left, rms, warp_or_slices};
use crate::scenes::{folder, neuron, open, turned};
use crate::{plot, tables};

/// The maximum size of a picture in bytes.
const MAX_BYTES: usize = 64 << 10;

const SIZE: [&str; 2] = ["image.width=240", "image.height=240"];
const SMALL: [&str; 2] = ["image.width=200", "image.height=200"];

/// Makes every picture, with captions from its measurements.
pub(crate) fn make(headless: &GpuHeadless) {
    let parts = [cube(headless), turns(headless), views(headless), accelerations(headless), anisotropy(headless)];
    let head = "# The paper's figures\n\n\
        `cargo bench --bench paper -- gallery` makes this page and its pictures from the scenes in this folder. The objects are the builtin ones, not the\n\
        paper's; cameras have a headlight, and settings that a caption does not name have their defaults. `sheetsplat render assets/paper/tomato.toml -o\n\
        tomato.png` draws one of the scenes at its full size.\n\n";
    std::fs::write(folder().join("README.md"), head.to_owned() + parts.join("\n").trim_end() + "\n").unwrap();
}

/// Figs. 3 and 6.
fn cube(headless: &GpuHeadless) -> String {
    const ANGLES: [f64; 2] = [44.8, 45.2];
    let mut text = "## Figs. 3 and 6: a cube before and after 45°\n\n| | 44.8° | 45.2° |\n|---|---|---|\n".to_owned();
    let scene = open("cube", &[]);
    let volume = Arc::new(scene.load_volume().unwrap());
    let mut measured = String::new();
    for (method, figure) in METHODS.into_iter().zip(["fig06", "fig03"]) {
        let images = ANGLES.map(|angle| {
            let scene = with_method(&turned(&scene, -angle), method);
            headless.render_volume(volume.clone(), &scene).unwrap().image
        });
        let names = ANGLES.map(|angle| format!("{figure}-cube-{angle}"));
        names.iter().zip(&images).for_each(|(name, image)| save(name, &picture(image)));
        let [before, after] = &images;
        text += &row(name(method), &names);
        let faces = images.each_ref().map(right_over_left);
        let _ = writeln!(
            measured,
            "- {}: rms difference of the two pictures {:.4}; the right face is {:.4} times as bright as the left one, then {:.4} times.",
            name(method),
            rms(before, after),
            faces[0],
            faces[1],
        );
    }
    let [before, after] = ANGLES.map(|angle| angle.to_radians().cos());
    text + &format!(
        "\nThe opacity is 0.5 per unit, with only diffuse light. A lit plane would be {:.4} times as bright as its neighbour.\n\n{measured}",
        before / after
    )
}

/// Fig. 14, and the brightness of all frames in between.
fn turns(headless: &GpuHeadless) -> String {
    const ANGLES: [f64; 3] = [41.0, 44.0, 47.0];
    let mut text = "## Fig. 14: turning the nerve cell\n\n| | 41° | 44° | 47° |\n|---|---|---|---|\n".to_owned();
    let translucent = open("nerve", &[SIZE[0], SIZE[1], "transfer.opacity=[[30,0],[90,0.2]]"]);
    let volume = Arc::new(translucent.load_volume().unwrap());
    for method in METHODS {
        let names = ANGLES.map(|angle| format!("fig14-nerve-{}-{angle}", name(method)));
        for (name, angle) in names.iter().zip(ANGLES) {
            let scene = with_method(&turned(&translucent, angle), method);
            save(name, &picture(&headless.render_volume(volume.clone(), &scene).unwrap().image));
        }
        text += &row(name(method), &names);
    }
    let _ = writeln!(
        text,
        "\nThe cell has an opacity of 0.2 per unit and turns from head-on, along z, at 0° to side-on, along x, at 90°. At 45° the axis-aligned sheets\n\
        change to other slices. Curves show the mean brightness of {0}×{0} pixels from 0° to 90° in steps of 0.5°, from 0 upwards, blue image-aligned\n\
        and red axis-aligned, with grid lines every 15° and at quarters of the upper end. A pop is how much more a frame differs from one neighbour\n\
        than from the other. The neuron is a measured cell, whose slices are assumed to be 5 voxels apart.\n",
        Turn::SIDE
    );
    let neuron = neuron().map(|neuron| ("neuron", Arc::new(neuron.load_volume().unwrap()), neuron));
    let opaque = open("nerve", &[]);
    for (object, volume, scene) in [("nerve", volume, opaque)].into_iter().chain(neuron) {
        let translucent = scene.clone().with_transfer(translucent.channels[0].transfer.clone());
        text += &curve(headless, object, &volume, &translucent);
        text += &curve(headless, &format!("{object}-opaque"), &volume, &scene);
    }
    text + "At opacity 0.9 little pops: a sheet's opacity is clamped to 1, whatever kernels it holds.\n"
}

/// The curve of one turn, and its largest changes.
fn curve(headless: &GpuHeadless, object: &str, volume: &Arc<Volume>, scene: &Scene) -> String {
    let turns = METHODS.map(|method| Turn::new(headless, volume, scene, method));
    let top = turns.iter().flat_map(|turn| &turn.brightness).fold(0.0, |top: f64, &b| top.max(b)) * 1.05;
    let file = format!("turn-{object}");
    save(&file, &plot::curves([&turns[0].brightness, &turns[1].brightness], top));
    let mut text = format!("![{file}]({file}.png)\n\n{object}, upper end {top:.4}:\n\n");
    for (method, turn) in METHODS.into_iter().zip(&turns) {
        let (pop, at) = turn.largest_pop();
        let _ = writeln!(
            text,
            "- {}: largest change from frame to frame {:.2e}; largest pop {pop:.2e}, at {at}°; the brightest frame is {:.3} times the darkest.",
            name(method),
            turn.largest_change(),
            turn.spread()
        );
    }
    let [image_aligned, axis_aligned] = &turns;
    let ratios =
        [0.0, 44.5, 45.5, 90.0].map(|angle| format!("{:.3}", axis_aligned.at(angle) / image_aligned.at(angle)));
    let _ = writeln!(
        text,
        "- Axis-aligned changes are {:.1} times, pops {:.1} times as large; frames are {} times as bright at 0°, 44.5°, 45.5°, 90°.\n",
        axis_aligned.largest_change() / image_aligned.largest_change(),
        axis_aligned.largest_pop().0 / image_aligned.largest_pop().0,
        ratios.join(", "),
    );
    text
}

/// Fig. 15.
fn views(headless: &GpuHeadless) -> String {
    let mut text =
        "## Fig. 15: semi-transparent objects, and the nerve cell\n\n| | | | |\n|---|---|---|---|\n".to_owned();
    let scenes = ["glass-head", "transparent-head", "tomato", "nerve"];
    let names = ["a", "b", "c", "d"].map(|letter| format!("fig15{letter}"));
    let mut drawn = Vec::new();
    for (name, scene) in names.iter().zip(scenes) {
        let rendering = headless.render(&open(scene, &SIZE)).unwrap();
        let counts = rendering.stats.counts;
        drawn.push(format!("{:.0} %", 100.0 * counts.sections_rasterized as f64 / counts.sections_total as f64));
        save(name, &picture(&rendering.image));
    }
    text += &row("", &names).replacen("|  |", "|", 1);
    text + &format!(
        "\n(a) Head of glass; (b) eyes and brain in a faint head; (c) tomato with seeds, core and placenta; (d) nerve cell, head-on. Of their\n\
        kernel sections {} are drawn.\n",
        drawn.join(", ")
    )
}

/// Fig. 16.
fn accelerations(headless: &GpuHeadless) -> String {
    let columns = tables::accelerations(Splatting::default()).map(|(name, _)| name);
    let mut text = format!(
        "## Fig. 16: the effect of accelerations on the image\n\n| {} |\n|---|---|---|---|---|\n",
        columns.join(" | ")
    );
    for scene_name in ["tomato", "opaque-head", "nerve"] {
        let scene = open(scene_name, &SMALL);
        let mut view = headless.view(scene.load_volume().unwrap(), &scene).unwrap();
        let images = tables::accelerations(scene.splatting).map(|(_, splatting)| {
            view.set_splatting(splatting).unwrap();
            headless.draw(&mut view).unwrap().image
        });
        let names: Vec<String> = (1..=5).map(|column| format!("fig16-{scene_name}-{column}")).collect();
        names.iter().zip(&images).for_each(|(name, image)| save(name, &picture(image)));
        text += &row("", &names).replacen("|  |", "|", 1);
        let errors: Vec<String> =
            images[1..].iter().map(|image| format!("{:.1} dB", difference(image, &images[0]).0)).collect();
        let _ = writeln!(text, "| | {} |", errors.join(" | "));
    }
    text + "\nPSNR against the first picture of the row.\n"
}

/// §4.2.
fn anisotropy(headless: &GpuHeadless) -> String {
    let volume = Arc::new(ball());
    let mut text = "## §4.2: a ball on a grid of 1:1:5\n\nIts value is constant and it is not shaded, so it should look the same from all directions.\n\n".to_owned();
    text += &curve(headless, "ball", &volume, &open("ball", &[]));
    text += "A test in `src/reference/footprint.rs` shows that the warped footprint of a whole kernel is the ellipsoid's, to 1e-6. The table shows how the\n\
        ball's X-ray image changes if slices are interpolated to 1:1:1 instead, by the f64 evaluation: rms and largest difference, relative to its\n\
        maximum. The Gaussian is the one that turns the round kernel into the ellipsoid.\n\n\
        | | interpolated by that Gaussian | linearly |\n|---|---|---|\n";
    for degrees in [0.0, 30.0, 60.0, 90.0] {
        let cells = warp_or_slices(degrees).map(|(rms, largest)| format!("{rms:.1e}, {largest:.1e}"));
        let _ = writeln!(text, "| {degrees}° | {} |", cells.join(" | "));
    }
    text + "\nSide-on, rows of round kernels lie one behind the other; the difference is their ripple from slice to slice, 2·exp(-π²/2) or 1.4 %.\n"
}

fn with_method(scene: &Scene, method: Method) -> Scene {
    let mut scene = scene.clone();
    scene.splatting.method = method;
    scene
}

fn name(method: Method) -> &'static str {
    match method {
        Method::ImageAligned => "image-aligned",
        Method::AxisAligned => "axis-aligned",
        Method::CompositeEverySample => "composite-every-sample",
        other => unreachable!("{other:?}"),
    }
}

/// A row of pictures in a table.
fn row(label: &str, names: &[String]) -> String {
    let cells: Vec<String> = names.iter().map(|name| format!("![{name}]({name}.png)")).collect();
    format!("| {label} | {} |\n", cells.join(" | "))
}

/// All scenes have a black background, over which premultiplied colours equal straight ones.
fn picture(image: &Image) -> RgbImage {
    RgbImage::from_fn(image.width, image.height, |x, y| {
        let [r, g, b, _] = image.pixels[(y * image.width + x) as usize];
        Rgb([r, g, b].map(|channel| (channel * 255.0).round() as u8))
    })
}

/// Saves a PNG, compressed as far as possible.
fn save(name: &str, picture: &RgbImage) {
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive);
    picture.write_with_encoder(encoder).unwrap();
    assert!(bytes.len() <= MAX_BYTES, "{name} takes {} bytes, allowed: {MAX_BYTES}", bytes.len());
    std::fs::write(folder().join(format!("{name}.png")), bytes).unwrap();
}

//! The settings panel beside the picture.

use std::ops::RangeInclusive;

use eframe::egui::{ComboBox, Grid, Slider, Ui};
use glam::DVec3;
use sheetsplat::settings::{Classification, Compositing, Interpolation, Method, Rasterizer, SlabProfile, Splatting};
use sheetsplat::settings::{Gradient, Light, Shading};
use sheetsplat::stats::Stats;

/// Kernel, slabs, compositing and culling, with the names and ranges of scene files.
pub(super) fn splatting(ui: &mut Ui, splatting: &mut Splatting) {
    ui.add(Slider::new(&mut splatting.slab_width, 0.05..=8.0).logarithmic(true).text("slab width"));
    ui.add(Slider::new(&mut splatting.radius, 1.0..=4.0).text("kernel radius"));
    slider(ui, &mut splatting.opacity_threshold, 0.01..=1.0, "opacity threshold");
    ui.checkbox(&mut splatting.culling, "culling");
    choice(
        ui,
        "compositing",
        &mut splatting.compositing,
        &Compositing::ALL.map(|(name, compositing)| (compositing, name)),
    );
    choice(
        ui,
        "method",
        &mut splatting.method,
        &[
            (Method::ImageAligned, "image-aligned"),
            (Method::AxisAligned, "axis-aligned"),
            (Method::CompositeEverySample, "composite-every-sample"),
        ],
    );
    if splatting.method != Method::ImageAligned {
        splatting.classification = Classification::Before;
    }
    ui.add_enabled_ui(splatting.method == Method::ImageAligned, |ui| {
        let classifications = [(Classification::Before, "before"), (Classification::After, "after")];
        choice(ui, "classification", &mut splatting.classification, &classifications);
    });
    if splatting.classification == Classification::After {
        let interpolations =
            [(Interpolation::Smooth, "smooth"), (Interpolation::Exact, "exact"), (Interpolation::Auto, "auto")];
        choice(ui, "interpolation", &mut splatting.interpolation, &interpolations);
        let profiles = [(SlabProfile::Linear, "linear"), (SlabProfile::Cubic, "cubic")];
        choice(ui, "slab profile", &mut splatting.slab_profile, &profiles);
    }
    choice(
        ui,
        "rasterizer",
        &mut splatting.rasterizer,
        &[(Rasterizer::Auto, "auto"), (Rasterizer::Tiles, "tiles"), (Rasterizer::Quads, "quads")],
    );
}

/// Light, material, and the gradients that a classification has normals of.
pub(super) fn shading(ui: &mut Ui, shading: &mut Shading, classification: Classification) {
    ui.checkbox(&mut shading.enabled, "shading");
    if !shading.enabled {
        return;
    }
    let fixed = match shading.light {
        light @ Light::Direction(_) => light,
        _ => Light::Direction(direction([-135.0, 45.0])),
    };
    let lights = [(Light::Headlight, "headlight"), (Light::UpperLeft, "upper left"), (fixed, "fixed")];
    choice(ui, "light", &mut shading.light, &lights);
    if let Light::Direction(to_light) = &mut shading.light {
        let [mut azimuth, mut elevation] = angles(*to_light);
        let across = ui.add(Slider::new(&mut azimuth, -180.0..=180.0).suffix("°").text("light azimuth"));
        // Straight above, the azimuth is undefined.
        let above = ui.add(Slider::new(&mut elevation, -89.0..=89.0).suffix("°").text("light elevation"));
        if across.union(above).changed() {
            *to_light = direction([azimuth, elevation]);
        }
    }
    let other = match classification {
        Classification::After => (Gradient::Kernel, "kernel"),
        _ => (Gradient::Membership, "membership"),
    };
    let gradients = [(Gradient::Auto, "automatic"), (Gradient::Differences, "differences"), other];
    choice(ui, "gradient", &mut shading.gradient, &gradients);
    slider(ui, &mut shading.ambient, 0.0..=1.0, "ambient");
    slider(ui, &mut shading.diffuse, 0.0..=1.0, "diffuse");
    slider(ui, &mut shading.specular, 0.0..=1.0, "specular");
    slider(ui, &mut shading.occlusion, 0.0..=1.0, "occlusion");
    slider(ui, &mut shading.shadow, 0.0..=1.0, "shadow");
}

/// The last frame's statistics.
pub(super) fn stats(ui: &mut Ui, stats: &Stats) {
    let counts = &stats.counts;
    let rows = [
        ("frame", format!("{:.1} ms, prepared in {:.1} ms", stats.frame_ms, stats.prepare_ms)),
        ("image", format!("{} × {}", stats.width, stats.height)),
        ("voxels", format!("{} of {} shaded", counts.voxels_shaded, counts.voxels_in_range)),
        ("sections", format!("{} of {}", counts.sections_rasterized, counts.sections_total)),
        ("sheets", counts.sheets.to_string()),
        ("rasterizer", stats.rasterizer.clone()),
        ("GPU memory", format!("{:.1} MiB", stats.gpu_bytes as f64 / 1024.0 / 1024.0)),
        ("adapter", format!("{}, {}", stats.adapter, stats.api)),
    ];
    Grid::new("statistics").num_columns(2).show(ui, |ui| {
        for (name, value) in rows {
            ui.weak(name);
            ui.label(value);
            ui.end_row();
        }
    });
}

/// A slider that does not clamp the scene's value if that lies beyond its ends.
fn slider(ui: &mut Ui, value: &mut f64, range: RangeInclusive<f64>, name: &str) {
    ui.add(Slider::new(value, range).clamping(eframe::egui::SliderClamping::Edits).text(name));
}

/// A choice of one value.
fn choice<T: Copy + PartialEq>(ui: &mut Ui, name: &str, value: &mut T, choices: &[(T, &str)]) {
    let current = choices.iter().find(|choice| choice.0 == *value).map_or("", |choice| choice.1);
    ComboBox::from_label(name).selected_text(current).show_ui(ui, |ui| {
        for &(choice, text) in choices {
            ui.selectable_value(value, choice, text);
        }
    });
}

/// The world direction with this azimuth, from x towards y, and elevation over the xy plane, in degrees.
fn direction(angles: [f64; 2]) -> DVec3 {
    let [(azimuth_sine, azimuth_cosine), (sine, cosine)] = angles.map(|angle| angle.to_radians().sin_cos());
    DVec3::new(azimuth_cosine * cosine, azimuth_sine * cosine, sine)
}

/// The azimuth and elevation of a direction of any length except 0.
fn angles(direction: DVec3) -> [f64; 2] {
    let DVec3 { x, y, z } = direction.normalize();
    [y.atan2(x).to_degrees(), z.clamp(-1.0, 1.0).asin().to_degrees()]
}

#[cfg(test)]
mod tests {
    use eframe::egui::{Context, Event, Modifiers, PointerButton, Pos2, RawInput, Rect, Shape, vec2};

    use super::*;

    /// The panel in a context without a window.
    #[derive(Default)]
    struct Panel {
        context: Context,
        settings: Splatting,
    }

    impl Panel {
        /// Shows a frame after some events, and returns its texts and where they are.
        fn frame(&mut self, events: Vec<Event>) -> Vec<(String, Rect)> {
            let screen_rect = Some(Rect::from_min_size(Pos2::ZERO, vec2(400.0, 900.0)));
            let input = RawInput { screen_rect, events, ..RawInput::default() };
            let settings = &mut self.settings;
            let mut output = self.context.run_ui(input, |ui| splatting(ui, settings));
            // Nothing is drawn.
            output.textures_delta.clear();
            let mut texts = Vec::new();
            output.shapes.iter().for_each(|clipped| collect(&clipped.shape, &mut texts));
            texts
        }

        /// Clicks the text, which the panel must show once.
        fn click(&mut self, text: &str) {
            let texts = self.frame(Vec::new());
            let found: Vec<&(String, Rect)> = texts.iter().filter(|(shown, _)| shown == text).collect();
            let [(_, place)] = found[..] else { panic!("{text:?}, {} times among {texts:?}", found.len()) };
            let pos = place.center();
            let pressed = |pressed| Event::PointerButton {
                pos,
                button: PointerButton::Primary,
                pressed,
                modifiers: Modifiers::NONE,
            };
            for event in [Event::PointerMoved(pos), pressed(true), pressed(false)] {
                self.frame(vec![event]);
            }
            // Lists open a frame later.
            self.frame(Vec::new());
        }

        fn shows(&mut self, text: &str) -> bool {
            self.frame(Vec::new()).iter().any(|(shown, _)| shown == text)
        }
    }

    fn collect(shape: &Shape, texts: &mut Vec<(String, Rect)>) {
        match shape {
            Shape::Text(text) => texts.push((text.galley.text().to_owned(), shape.visual_bounding_rect())),
            Shape::Vec(shapes) => shapes.iter().for_each(|shape| collect(shape, texts)),
            _ => {}
        }
    }

    #[test]
    fn classification_is_switched_by_clicks() {
        let mut panel = Panel::default();
        assert_eq!(panel.settings.classification, Classification::Before);
        assert!(panel.shows("classification") && !panel.shows("interpolation"));
        panel.click("before");
        panel.click("after");
        assert_eq!(panel.settings.classification, Classification::After);
        // Only then is there an interpolation to choose.
        panel.click("smooth");
        panel.click("exact");
        assert_eq!(panel.settings.interpolation, Interpolation::Exact);
        panel.click("after");
        panel.click("before");
        assert_eq!(panel.settings.classification, Classification::Before);
        assert!(!panel.shows("interpolation"));
    }

    #[test]
    fn other_methods_classify_before_splatting() {
        let mut panel = Panel::default();
        panel.settings.classification = Classification::After;
        panel.click("image-aligned");
        panel.click("axis-aligned");
        panel.frame(Vec::new());
        assert_eq!(
            (panel.settings.method, panel.settings.classification),
            (Method::AxisAligned, Classification::Before)
        );
        // The choice is shown, but cannot be made.
        panel.click("before");
        assert!(!panel.shows("after"));
    }

    #[test]
    fn angles_are_those_of_the_direction() {
        assert!(direction([90.0, 0.0]).abs_diff_eq(DVec3::Y, 1e-12));
        assert!(direction([0.0, 89.0]).z > 0.99);
        for expected in [[-135.0, 45.0], [20.0, -89.0], [180.0, 0.0]] {
            let found = angles(3.0 * direction(expected));
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?} {expected:?}");
        }
    }
}

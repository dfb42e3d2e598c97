//! The transfer function editor: its control points drawn over the histogram.

use eframe::egui::{Color32, DragValue, Mesh, PointerButton, Pos2, Rect, Sense, Shape, Stroke, Ui, pos2, vec2};
use glam::DVec3;

use super::editor::{ControlPoint, Editor};
use super::histogram::Histogram;

const HEIGHT: f32 = 150.0;
/// The height of the strip of colours below the plot.
const STRIP: f32 = 12.0;
const POINT_RADIUS: f32 = 5.0;
/// The maximum distance at which the pointer hits a point.
const REACH: f64 = 9.0;

/// Maps values and opacities to positions on the screen and back.
#[derive(Clone, Copy)]
struct Space {
    rect: Rect,
    range: [f64; 2],
}

impl Space {
    fn x(&self, value: f64) -> f32 {
        let share = (value - self.range[0]) / (self.range[1] - self.range[0]);
        self.rect.left() + share as f32 * self.rect.width()
    }

    fn at(&self, point: &ControlPoint) -> Pos2 {
        pos2(self.x(point.value), self.rect.bottom() - point.opacity as f32 * self.rect.height())
    }

    /// The value and opacity at a position on the screen.
    fn from(&self, place: Pos2) -> (f64, f64) {
        let share = f64::from((place.x - self.rect.left()) / self.rect.width());
        let opacity = f64::from((self.rect.bottom() - place.y) / self.rect.height());
        (self.range[0] + share * (self.range[1] - self.range[0]), opacity)
    }
}

/// Shows the editor, in which points are dragged, added by a double click and removed by a right click. Below are the opacity and colour
/// of the selected point.
pub(super) fn show(ui: &mut Ui, editor: &mut Editor, histogram: &Histogram) {
    let size = vec2(ui.available_width(), HEIGHT + STRIP);
    let (response, painter) = ui.allocate_painter(size, Sense::click_and_drag());
    // The margin leaves room for the points at the ends.
    let rect = response.rect.shrink2(vec2(POINT_RADIUS + 2.0, 0.0));
    let rect =
        Rect::from_min_max(rect.min + vec2(0.0, POINT_RADIUS + 2.0), rect.max - vec2(0.0, STRIP + POINT_RADIUS + 2.0));
    let space = Space { rect, range: editor.range() };

    let hit = |editor: &Editor, place: Pos2| editor.hit(REACH, |point| space.at(point).distance(place).into());
    if response.drag_started_by(PointerButton::Primary) || response.clicked() {
        editor.selected = ui
            .input(|input| input.pointer.press_origin().or(input.pointer.interact_pos()))
            .and_then(|place| hit(editor, place));
    }
    if let Some(place) = response.interact_pointer_pos() {
        let (value, opacity) = space.from(place);
        if response.dragged_by(PointerButton::Primary)
            && let Some(index) = editor.selected
        {
            editor.drag(index, value, opacity);
        } else if response.double_clicked() && hit(editor, place).is_none() {
            editor.add(value, opacity);
        } else if response.secondary_clicked()
            && let Some(index) = hit(editor, place)
        {
            editor.remove(index);
        }
    }

    painter.rect_filled(response.rect, 2.0, ui.visuals().extreme_bg_color);
    let mut bars = Mesh::default();
    let width = rect.width() / histogram.heights.len() as f32;
    for (index, &height) in histogram.heights.iter().enumerate() {
        let low = pos2(rect.left() + index as f32 * width, rect.bottom());
        bars.add_colored_rect(
            Rect::from_two_pos(low, low + vec2(width, -height * rect.height())),
            Color32::from_gray(90),
        );
    }
    painter.add(Shape::mesh(bars));
    painter.add(Shape::mesh(strip(editor, space)));

    let mut curve: Vec<Pos2> = editor.points().iter().map(|point| space.at(point)).collect();
    // The curve is constant beyond its ends.
    if let (Some(&first), Some(&last)) = (curve.first(), curve.last()) {
        curve.insert(0, pos2(rect.left(), first.y));
        curve.push(pos2(rect.right(), last.y));
    }
    painter.line(curve, Stroke::new(1.5, Color32::from_gray(220)));
    let hovered = response.hover_pos().and_then(|place| hit(editor, place));
    for (index, point) in editor.points().iter().enumerate() {
        let outline = if editor.selected == Some(index) { 2.5 } else { 1.0 };
        let radius = POINT_RADIUS + if hovered == Some(index) { 1.5 } else { 0.0 };
        painter.circle(space.at(point), radius, color32(point.color), Stroke::new(outline, Color32::WHITE));
    }
    selected(ui, editor);
}

/// The strip of colours along the values.
fn strip(editor: &Editor, space: Space) -> Mesh {
    let rect = space.rect;
    let stops = editor.points().iter().map(|point| (space.x(point.value), color32(point.color)));
    let mut stops: Vec<(f32, Color32)> = stops.collect();
    if let (Some(&first), Some(&last)) = (stops.first(), stops.last()) {
        stops.insert(0, (rect.left(), first.1));
        stops.push((rect.right(), last.1));
    }
    let top = rect.bottom() + POINT_RADIUS + 2.0;
    let mut mesh = Mesh::default();
    for (index, (x, color)) in stops.into_iter().enumerate() {
        mesh.colored_vertex(pos2(x, top), color);
        mesh.colored_vertex(pos2(x, top + STRIP - 1.0), color);
        if let Some(before) = (index as u32).checked_sub(1) {
            mesh.add_triangle(2 * before, 2 * before + 1, 2 * before + 2);
            mesh.add_triangle(2 * before + 1, 2 * before + 2, 2 * before + 3);
        }
    }
    mesh
}

/// The selected point's colour, value and opacity, or a hint in a row of equal height, so that nothing below moves.
fn selected(ui: &mut Ui, editor: &mut Editor) {
    let [lo, hi] = editor.range();
    let point = editor.selected.and_then(|index| Some((index, *editor.points().get(index)?)));
    ui.horizontal(|ui| {
        let Some((index, ControlPoint { mut value, mut opacity, color })) = point else {
            ui.weak("Drag; double click adds, right click removes.");
            return;
        };
        let [r, g, b, _] = color32(color).to_array();
        let mut srgb = [r, g, b];
        if ui.color_edit_button_srgb(&mut srgb).changed() {
            editor.recolor(index, DVec3::from_array(srgb.map(f64::from)) / 255.0);
        }
        let value_field = ui.add(DragValue::new(&mut value).speed((hi - lo) / 500.0).range(lo..=hi).prefix("value "));
        let opacity_field = DragValue::new(&mut opacity).speed(0.005).range(0.0..=1.0).prefix("opacity ");
        if value_field.union(ui.add(opacity_field)).changed() {
            editor.drag(index, value, opacity);
        }
    });
}

/// Colours of a scene are display-referred, like the window's.
fn color32(color: DVec3) -> Color32 {
    let [r, g, b] = (color * 255.0).round().to_array().map(|channel| channel as u8);
    Color32::from_rgb(r, g, b)
}

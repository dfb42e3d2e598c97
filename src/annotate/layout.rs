//! Where words and the picture are in an image.

use glam::DMat3;

use super::canvas::{empty, filled, lay};
use super::kind::Annotation;
use super::style::Style;
use super::{color_bar, legend, scale_bar, sides};
use crate::SettingError;
use crate::image::Image;
use crate::scene::Scene;
use crate::scene::image_settings::premultiplied;
use crate::volume::Volume;

/// The least width and height of the picture, as a share of the image's and in pixels.
const SHARE: u32 = 4;
const LEAST: u32 = 16;

/// The room for words around a picture: the legend to the left, colour bars to the right, the scale bar below, and sides of the patient at each edge.
#[derive(Clone, Debug)]
pub struct Layout {
    style: Style,
    background: [f32; 4],
    /// The size of the image.
    size: [u32; 2],
    /// The upper left corner and the size of the picture.
    corner: [u32; 2],
    picture: [u32; 2],
    has_scale: bool,
    /// The volume's axes in RAS, if sides are shown.
    axes: Option<DMat3>,
    legend: Option<Image>,
    colors: Option<Image>,
}

impl Layout {
    pub(super) fn new(annotations: &[Annotation], scene: &Scene, volume: &Volume) -> Result<Self, SettingError> {
        let has = |annotation| annotations.contains(&annotation);
        let size = [scene.image.width, scene.image.height];
        let style = Style::of(size, scene.image.background);
        let (pad, line) = (style.pad(), style.line());
        let has_scale = has(Annotation::Scale);
        if has_scale {
            scale_bar::check(scene)?;
        }
        let axes = has(Annotation::Sides).then(|| sides::axes(volume)).transpose()?;
        let below = if has_scale { scale_bar::height(&style) + 2 * pad } else { 0 };
        let room = size[1].saturating_sub(below + 2 * pad);
        let needs_transfer = has(Annotation::Colors) || has(Annotation::Legend);
        let transfer = needs_transfer.then(|| scene.resolve(volume));
        let of = |annotation| transfer.as_ref().filter(|_| has(annotation));
        let colors = of(Annotation::Colors).map(|transfer| color_bar::plate(scene, volume, transfer, &style, room));
        let legend = of(Annotation::Legend).map(|transfer| legend::plate(scene, volume, transfer, &style, room));
        let [colors, legend] = [colors.transpose()?, legend.transpose()?];
        let [left, right] =
            [&legend, &colors].map(|plate| plate.as_ref().map_or(0, |plate| plate.width.saturating_add(2 * pad)));
        let [aside, above] = if axes.is_some() { [style.width(sides::WIDEST) + pad, line] } else { [0, 0] };
        let taken = [left.saturating_add(right).saturating_add(2 * aside), below + 2 * above];
        let least = size.map(|side| (side / SHARE).max(LEAST));
        // Where the shorter side grows, so does the text: enough for the text as it is now.
        if (0..2).any(|axis| size[axis] < taken[axis].saturating_add(least[axis])) {
            let needed = [0, 1].map(|axis| u64::from(taken[axis]) + u64::from(least[axis]));
            let ([width, height], [needed_width, needed_height]) = (size, needed);
            let allowed = format!("at least {needed_width}×{needed_height} for these");
            return Err(SettingError::new(
                "annotate: image.width × image.height",
                format!("{width}×{height}"),
                allowed,
            ));
        }
        let picture = [0, 1].map(|axis| size[axis] - taken[axis]);
        let background = premultiplied(scene.image.background);
        let corner = [left + aside, above];
        Ok(Self { style, background, size, corner, picture, has_scale, axes, legend, colors })
    }

    /// The scene of the picture beside the words: the same with a smaller image. Its camera fits what it shows into the picture.
    pub fn scene(&self, scene: &Scene) -> Scene {
        let mut beside = scene.clone();
        [beside.image.width, beside.image.height] = self.picture;
        beside
    }

    /// The scene of the whole image, for a scene of the picture: it states everything that the volume and the picture determined, and annotated it
    /// gives the same image.
    pub fn whole(&self, scene: &Scene) -> Scene {
        let mut whole = scene.clone();
        [whole.image.width, whole.image.height] = self.size;
        whole
    }

    /// The image of a picture and its words. The scene is that of the picture, with its camera stated ([`Scene::explicit`]).
    ///
    /// # Panics
    /// If the picture's size is not that of [`Self::scene`].
    pub fn draw(&self, picture: &Image, scene: &Scene, volume: &Volume) -> Image {
        assert_eq!([picture.width, picture.height], self.picture, "the picture of another layout");
        let mut image = filled(self.size, self.background);
        let ([left, top], [width, height]) = (self.corner, self.picture);
        for (row, pixels) in picture.pixels.chunks(width as usize).enumerate() {
            let start = (top as usize + row) * self.size[0] as usize + left as usize;
            image.pixels[start..start + pixels.len()].copy_from_slice(pixels);
        }
        let (style, pad) = (&self.style, self.style.pad());
        let mut words = empty(self.size);
        if let Some(legend) = &self.legend {
            lay(&mut words, [pad, pad], legend);
        }
        if let Some(colors) = &self.colors {
            // Beside the picture's middle, and within the image.
            let middle = (top + height / 2).saturating_sub(colors.height / 2);
            lay(&mut words, [self.size[0] - pad - colors.width, middle], colors);
        }
        if self.has_scale
            && let Some(bar) = scale_bar::plate(scene, volume, style, self.size[0] - 2 * pad)
        {
            let across = (left + pad).min(self.size[0] - pad - bar.width);
            lay(&mut words, [across, self.size[1] - pad - bar.height], &bar);
        }
        if let Some(axes) = self.axes {
            let [at_left, at_right, at_top, at_bottom] =
                sides::letters(&scene.camera, axes).map(|text| style.words(&text));
            let (row, column) = (
                |plate: &Image| top + (height - plate.height.min(height)) / 2,
                |plate: &Image| left + (width - plate.width.min(width)) / 2,
            );
            lay(&mut words, [left.saturating_sub(pad / 2 + at_left.width), row(&at_left)], &at_left);
            lay(&mut words, [left + width + pad / 2, row(&at_right)], &at_right);
            lay(&mut words, [column(&at_top), 0], &at_top);
            lay(&mut words, [column(&at_bottom), top + height], &at_bottom);
        }
        style.finish(&mut image, &words);
        image
    }
}

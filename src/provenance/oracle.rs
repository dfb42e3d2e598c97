//! Some pixels of a picture beside the f64 evaluation of the same scene.

use std::fmt::{self, Display, Formatter};
use std::sync::Arc;

use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::finished::FinishedScene;
use crate::image::Image;
use crate::part::{self, Identity};
use crate::reference::{self, Lights};
use crate::scene::{OpenVolume, Scene};
use crate::settings::window::{Region, Window};

/// How far pixels of a picture are from the f64 evaluation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// The number of pixels that were evaluated.
    pub pixels: u32,
    /// The largest difference of a channel, of 255, premultiplied.
    pub largest: f64,
    /// Column and row of the pixel that has it.
    pub at: [u32; 2],
}

impl Deviation {
    /// The deviation of `count` pixels of a scene's picture, without words, chosen by a fixed sequence.
    ///
    /// # Errors
    /// If the volume is streamed, or the scene needs more than the f64 evaluation can compute.
    pub(super) fn of(volume: &OpenVolume, scene: &Scene, picture: &Image, count: u32) -> Result<Self, RenderError> {
        let size = [picture.width, picture.height];
        let chosen: Vec<[u32; 2]> = (0..count).map(|number| chosen(number, size)).collect();
        let exact = pixels(volume, scene, &chosen)?;
        let mut deviation = Self { pixels: count, largest: 0.0, at: [0, 0] };
        for (at, exact) in chosen.into_iter().zip(exact) {
            let drawn = picture.pixels[at[1] as usize * size[0] as usize + at[0] as usize];
            let channels =
                drawn.into_iter().zip(exact).map(|(drawn, exact)| (f64::from(drawn) - f64::from(exact)).abs());
            // In total order NaN is larger than any number.
            let largest = 255.0 * channels.max_by(f64::total_cmp).unwrap_or(0.0);
            if largest.total_cmp(&deviation.largest).is_gt() {
                (deviation.largest, deviation.at) = (largest, at);
            }
        }
        Ok(deviation)
    }
}

/// Pixels of a scene's image by the f64 evaluation, given by their columns and rows. Each by itself takes a fraction of the whole image's time, except where
/// a scene's image has no parts, or its parts need more than their pixels.
///
/// # Errors
/// If the volume is streamed, or the scene needs more than can be computed.
fn pixels(volume: &OpenVolume, scene: &Scene, at: &[[u32; 2]]) -> Result<Vec<[f32; 4]>, RenderError> {
    let OpenVolume::Whole(whole) = volume else {
        return Err(SettingError::new("volume", "one that is streamed", "one that fits into memory").into());
    };
    let finished = FinishedScene::new(whole, scene)?;
    let FinishedScene { scene, transfer } = &finished;
    let window = Window::whole(finished.size());
    let (framed, view) = finished.framed(whole, whole.grid())?;
    let identity = Identity::of((volume, scene), &view)?;
    let is_parted = part::check(whole, scene, &window).is_ok() && !part::adds_up(whole, scene);
    if !is_parted || identity.notes_labels() {
        let Image { width, pixels, .. } = reference::render(whole, transfer, scene)?;
        return Ok(at.iter().map(|[x, y]| pixels[(y * width + x) as usize]).collect());
    }
    let lights = Arc::new(Lights::new(whole, transfer, &framed)?);
    let slabs = view.slabs_of(whole.grid());
    let pixel = |&[x, y]: &[u32; 2]| {
        let window = Window { region: Region { x, y, width: 1, height: 1 }, ..window.clone() };
        let content = reference::part(whole, transfer, (scene, Some(&lights)), &window.opened(&slabs))?;
        Ok(part::resolved(content.into(), &identity).first().copied().unwrap_or_default())
    };
    at.iter().map(pixel).collect()
}

/// A pixel by its number in a sequence that looks random and is the same everywhere.
fn chosen(number: u32, [width, height]: [u32; 2]) -> [u32; 2] {
    let hash = blake3::hash(&number.to_le_bytes());
    let (words, _) = hash.as_bytes().as_chunks::<8>();
    let below = |word: [u8; 8], side: u32| (u64::from_le_bytes(word) % u64::from(side)) as u32;
    [below(words[0], width), below(words[1], height)]
}

impl Display for Deviation {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { pixels, largest, at: [x, y] } = self;
        write!(f, "{pixels} pixels differ from the f64 evaluation by at most ")?;
        // Rounding alone is far below a hundredth.
        if *largest < 0.01 { write!(f, "{largest:.1e}") } else { write!(f, "{largest:.2}") }?;
        write!(f, " of 255, at x {x}, y {y}")
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::scene::VolumeSource;

    /// Single pixels are those of the whole evaluation, whatever a scene composites, and a pixel that is wrong is found.
    #[test]
    fn single_pixels_are_those_of_the_whole_evaluation() {
        for settings in [
            "splatting.classification=before",
            "splatting.classification=after",
            "splatting={compositing=\"average\",classification=\"after\"}",
            "splatting={compositing=\"maximum\"}",
            "splatting={compositing=\"surface\",classification=\"before\"}",
            "splatting={method=\"axis-aligned\"}",
            "shading={occlusion=0.7,shadow=0.5}",
            "clip.crop=[[-20,-20,-20],[9,20,20]]",
        ] {
            let sets = ["image={width=14,height=11,background=[0.2,0.1,0.3,0.5]}".to_owned(), settings.to_owned()];
            let scene = Scene::from_volume(VolumeSource::Builtin("head:12".to_owned()), &sets).unwrap();
            let volume = OpenVolume::from(scene.load_volume().unwrap());
            let scene = scene.explicit(volume.sample());
            let transfer = scene.resolve(volume.sample());
            let mut image = crate::reference::render(volume.sample(), &transfer, &scene).unwrap();
            let deviation = Deviation::of(&volume, &scene, &image, 60).unwrap();
            assert!(deviation.largest < 1e-4, "{settings}: {deviation}");
            let [x, y] = chosen(59, [14, 11]);
            image.pixels[(y * 14 + x) as usize][2] += 0.5;
            let deviation = Deviation::of(&volume, &scene, &image, 60).unwrap();
            assert!((deviation.largest - 127.5).abs() < 1e-3 && deviation.at == [x, y], "{settings}: {deviation}");
            image.pixels[(y * 14 + x) as usize][2] = f32::NAN;
            assert!(Deviation::of(&volume, &scene, &image, 60).unwrap().largest.is_nan());
        }
    }
}

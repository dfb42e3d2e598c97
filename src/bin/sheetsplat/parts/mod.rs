//! Parts of an image: the options of `sheetsplat render` that draw one, `sheetsplat merge` and `sheetsplat split`.

pub(crate) mod merge;
pub(crate) mod split;

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use sheetsplat::scene::{OpenVolume, Scene};
use sheetsplat::settings::{Region, Window};
use sheetsplat::volume::ReadOptions;
use sheetsplat::{Stats, StoredLight};

use crate::arguments::Input;
use crate::failure::Failure;
use crate::light;

/// The part of an image that is drawn.
#[derive(clap::Args)]
pub(crate) struct Part {
    /// Draw only slabs A to B - 1, into a part of the image for `sheetsplat merge`. A part that exists and shows the same is not drawn again.
    #[arg(long, value_name = "A..B", allow_hyphen_values = true, value_parser = parse_slabs)]
    slabs: Option<Range<i32>>,
    /// Draw only these pixels of the whole image, into a part for `sheetsplat merge`.
    #[arg(long, value_name = "X,Y,W,H", value_parser = parse_region)]
    region: Option<Region>,
    /// Draw a part again that already exists.
    #[arg(long)]
    overwrite: bool,
}

impl Part {
    /// Whether a part is to be drawn.
    fn is_stated(&self) -> bool {
        self.slabs.is_some() || self.region.is_some()
    }

    /// Whether none of these options is stated.
    pub(crate) fn is_empty(&self) -> bool {
        !self.is_stated() && !self.overwrite
    }

    /// Whether a part exists and is to be kept: one that is whole, and that shows the same. Any other is drawn again.
    pub(crate) fn is_done(
        &self,
        output: &Path,
        input: &Input,
        (volume, scene): (&OpenVolume, &Scene),
        window: &Window,
    ) -> Result<bool, Failure> {
        if self.overwrite || !output.exists() {
            return Ok(false);
        }
        let mut options = ReadOptions::default();
        options.memory = input.options().memory;
        let reason = match sheetsplat::Part::open_with(output, &options) {
            Ok(part) if part.shows(volume, scene, window)? => return Ok(true),
            Ok(_) => "it is part of another image".to_owned(),
            Err(error) => error.to_string(),
        };
        log::info!("{}: drawn again: {reason}", output.display());
        Ok(false)
    }

    /// Checks the options beside a part, and the name of its file.
    pub(crate) fn check(&self, output: &Path, annotates: bool) -> Result<(), Failure> {
        if !self.is_stated() {
            let allowed = "it with --slabs or --region; other images are always drawn";
            return Err(Failure::Input(format!("--overwrite: found it alone, allowed: {allowed}")));
        }
        if annotates {
            let allowed = "no annotation of a part of an image";
            return Err(Failure::Input(format!("--annotate: found it with --slabs or --region, allowed: {allowed}")));
        }
        sheetsplat::Part::check_format(output).map_err(|error| Failure::Input(error.to_string()))
    }

    /// The window on a scene's image, if only a part of that is drawn.
    pub(crate) fn window(&self, scene: &Scene) -> Option<Window> {
        if !self.is_stated() {
            return None;
        }
        let whole = Window::whole([scene.image.width, scene.image.height]);
        let slabs = self.slabs.clone().unwrap_or(whole.slabs);
        Some(Window { slabs, region: self.region.unwrap_or(whole.region) })
    }

    /// Draws a part, in the light of a file if there is one.
    pub(crate) fn draw(
        &self,
        input: &Input,
        (volume, scene): (OpenVolume, &Scene),
        window: &Window,
        light: Option<&Arc<StoredLight>>,
    ) -> Result<(sheetsplat::Part, Stats), Failure> {
        let headless = input.headless(false, [scene])?;
        let failed = |error: sheetsplat::RenderError| input.failure(error);
        let mut view = light::view(&headless, volume, scene, light).map_err(failed)?;
        headless.draw_part(&mut view, window).map_err(failed)
    }
}

/// Parses `A..B`, A at most B.
fn parse_slabs(text: &str) -> Result<Range<i32>, String> {
    let within = |number: &i32| (-(1 << 29)..=1 << 29).contains(number);
    let parse = |text: &str| text.parse().ok().filter(within);
    let ends = text.split_once("..").and_then(|(from, to)| Some((parse(from)?, parse(to)?)));
    let ends = ends.filter(|(start, end)| start <= end);
    ends.map(|(start, end)| start..end).ok_or_else(|| "allowed: A..B, A at most B, within ±2^29".to_owned())
}

/// Parses `X,Y,W,H`.
fn parse_region(text: &str) -> Result<Region, String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|number| number.parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, width, height]) if width > 0 && height > 0 => Ok(Region { x, y, width, height }),
        _ => Err("allowed: X,Y,W,H, four integers, W and H at least 1".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slabs_and_regions() {
        assert_eq!(parse_slabs("-3..4"), Ok(-3..4));
        assert_eq!(parse_slabs("5..5"), Ok(5..5));
        for text in ["", "3", "4..3", "a..b", "1...3", "-2147483648..0", "1.5..3"] {
            assert!(parse_slabs(text).is_err(), "{text}");
        }
        assert_eq!(parse_region("1,2,3,4"), Ok(Region { x: 1, y: 2, width: 3, height: 4 }));
        for text in ["", "1,2,3", "1,2,3,4,5", "-1,0,1,1", "0,0,0,1", "0,0,1,0", "1,2,3,x"] {
            assert!(parse_region(text).is_err(), "{text}");
        }
    }
}

//! What a file states about its pages: the description by ImageJ or OME, and the resolution.

use ::tiff::tags::Tag;

use glam::DVec3;

use super::super::VolumeError;
use super::super::display::ChannelDisplay;
use super::super::fields::Fields;
use super::super::series::MAX_CHANNELS;
use super::super::text::number;
use super::super::unit::{shared, unit};
use super::calibration::Calibration;
use super::display;
use super::ome;
use super::pages::Pages;
use super::shaped::Shaped;
use super::stack::Stack;

/// A resolution in pixels per inch that programs write by default, without meaning.
const NOMINAL_DPI: f64 = 72.0;

impl Calibration {
    /// The calibration on the first page.
    pub(super) fn of(pages: &mut Pages) -> Result<Self, VolumeError> {
        // The first one that is known decides, as for tifffile.
        for description in pages.descriptions()? {
            if description.starts_with("ImageJ=") {
                return Self::of_image_j(pages, &description);
            }
            if description.contains("<OME") || description.contains("<ome:OME") {
                return ome::read(&pages.path, pages.page.samples, &description);
            }
            if let Some(shaped) = Shaped::parse(&description) {
                let (stack, is_contiguous) = (shaped.stack(&pages.path, pages.page)?, shaped.is_truncated);
                return Ok(Self { stack, is_contiguous, ..Self::of_resolution(pages)? });
            }
        }
        // Slices of one directory: MetaMorph's stacks state something about each, and others a depth.
        let slices = match pages.count_of(UIC2)? {
            0 | 1 => pages.depth()?,
            planes => planes,
        };
        let stack = (slices > 1).then(|| Stack::of_slices(slices));
        Ok(Self { is_contiguous: stack.is_some(), stack, ..Self::of_resolution(pages)? })
    }

    /// The distances between pixels that the resolution states.
    fn of_resolution(pages: &mut Pages) -> Result<Self, VolumeError> {
        let resolution_unit = pages.unsigned::<u16>(Tag::ResolutionUnit)?.unwrap_or(INCH);
        let (spacing, unit) = match (pixels_per_unit(pages), resolution_unit) {
            (Some([x, y]), INCH) if [x, y] != [NOMINAL_DPI; 2] => (Some([25.4 / x, 25.4 / y]), unit("mm")),
            (Some([x, y]), CENTIMETER) => (Some([10.0 / x, 10.0 / y]), unit("mm")),
            // Without a unit only the ratio of the two matters.
            (Some([x, y]), NO_UNIT) if x != y => (Some([1.0, x / y]), None),
            _ => (None, None),
        };
        Ok(Self { spacing, unit, ..Self::default() })
    }

    /// Parses lines of `name=value`; other lines may lie between them.
    fn of_image_j(pages: &mut Pages, description: &str) -> Result<Self, VolumeError> {
        let mut fields = Fields::new(pages.path.clone());
        for (name, value) in description.lines().filter_map(|line| line.split_once('=')) {
            if fields.get(name).is_none() {
                fields.add(name, value)?;
            }
        }
        let count = |name: &str| {
            let parse = |text: Option<&str>| text.unwrap_or("1").parse::<u32>().ok().filter(|&count| count > 0);
            fields.value(name, "a positive integer", parse)
        };
        let [slices, channels, frames] = [count("slices")?, count("channels")?, count("frames")?];
        // Micro-Manager leaves it out; then all pages count.
        let is_counted = fields.get("images").is_some();
        let product = slices.saturating_mul(channels).saturating_mul(frames);
        let images = if is_counted { count("images")? } else { product };
        let mut stack = Stack::of_slices(images);
        match [slices, channels, frames].map(|count| count > 1) {
            [_, false, false] => {}
            // Programs without a notion of axes write this.
            [false, true, false] | [false, false, true] if is_counted => {
                let what = if channels > 1 { "channels" } else { "frames" };
                log::warn!("{}: the description says {images} {what}: taken to be slices", pages.path.display());
            }
            _ => {
                stack = Stack { slices, channels, times: frames, order: Stack::IMAGE_J };
                if stack.pages() != Some(images) {
                    let found = format!("{slices}, {channels}, {frames}");
                    let allowed = format!("numbers whose product is images, {images}, at most {MAX_CHANNELS} channels");
                    return Err(fields.invalid("slices, channels, frames", found, allowed));
                }
            }
        }
        let units = ["unit", "yunit", "zunit"].map(|name| fields.get(name));
        // ImageJ ignores the sign of the spacing.
        let between = fields.value("spacing", "a finite number", |text| match text {
            None => Some(None),
            // A spacing of 0 counts as not stated.
            Some(text) => number(text).map(|spacing| Some(spacing.abs()).filter(|&spacing| spacing > 0.0)),
        })?;
        let sizes = pixels_per_unit(pages).map_or([1.0; 2], |[x, y]| [1.0 / x, 1.0 / y]);
        // Units along y and z that are not stated are the one along x.
        let names = units.map(|name| name.or(units[0]));
        let stated = DVec3::new(sizes[0], sizes[1], between.unwrap_or(1.0));
        let (mut length_unit, factors) = shared((&pages.path, "unit, yunit, zunit"), stated, names);
        let mut spacing = None;
        if let Some([x, y]) = pixels_per_unit(pages) {
            let resolution_unit = pages.unsigned::<u16>(Tag::ResolutionUnit)?;
            if length_unit.is_none() {
                length_unit = match resolution_unit {
                    Some(INCH) if [x, y] != [NOMINAL_DPI; 2] => unit("inch"),
                    Some(CENTIMETER) => unit("cm"),
                    _ => None,
                };
            }
            if length_unit.is_some() || resolution_unit == Some(NO_UNIT) {
                spacing = Some([factors.x / x, factors.y / y]);
            }
        }
        if between.is_some() {
            spacing = spacing.or(Some([1.0, 1.0]));
        }
        let rescale = value_function(&fields)?;
        let mut displays = pages.image_j_displays()?;
        // The image's own window is that of its only channel.
        if displays.iter().all(|display| display.window.is_none()) && stack.channels == 1 {
            let [low, high] = ["min", "max"].map(|name| fields.get(name).and_then(number));
            let window = low.zip(high).and_then(|(low, high)| display::valid([low, high]));
            let first = displays.first().cloned().unwrap_or_default();
            displays = vec![ChannelDisplay { window, ..first }];
        }
        // Windows are stated in stored numbers.
        let [slope, intercept] = rescale.unwrap_or([1.0, 0.0]);
        for display in &mut displays {
            display.window = display.window.and_then(|ends| display::valid(ends.map(|end| end * slope + intercept)));
            if fields.get("mode") == Some("grayscale") {
                display.colors.clear();
            }
        }
        // ImageJ omits a distance of 1.
        let between_slices = between.or((images > 1).then_some(1.0)).map(|z| z * factors.z);
        let stack = Some(stack).filter(|_| is_counted || images > 1);
        let unit = length_unit;
        // ImageJ writes data too large for TIFF as one directory, followed by all slices.
        let is_contiguous = is_counted;
        Ok(Self { spacing, between_slices, unit, stack, is_contiguous, displays, rescale, ..Self::default() })
    }
}

/// A tag of MetaMorph's stacks with as many values as there are planes.
const UIC2: u16 = 33629;

/// Values of the tag `ResolutionUnit`.
const NO_UNIT: u16 = 1;
const INCH: u16 = 2;
const CENTIMETER: u16 = 3;

fn pixels_per_unit(pages: &mut Pages) -> Option<[f64; 2]> {
    Some([pages.fraction(Tag::XResolution)?, pages.fraction(Tag::YResolution)?])
}

/// ImageJ's calibration of values, if it is linear.
fn value_function(fields: &Fields) -> Result<Option<[f64; 2]>, VolumeError> {
    match fields.get("cf") {
        None => Ok(None),
        Some("0") => {
            let coefficient = |name: &str| fields.value(name, "a finite number", |text| number(text?));
            Ok(Some([coefficient("c1")?, coefficient("c0")?]))
        }
        Some(other) => {
            let path = fields.path.display();
            log::warn!(
                "{path}: the description's calibration function {other} is no straight line: values are those stored"
            );
            Ok(None)
        }
    }
}

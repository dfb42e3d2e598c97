//! What a file states about its pages: the description by ImageJ or OME, and the resolution.

use std::path::Path;

use ::tiff::tags::Tag;
use glam::DVec3;
use quick_xml::Reader;
use quick_xml::events::Event;

use super::super::VolumeError;
use super::super::display::ChannelDisplay;
use super::super::error::volume::invalid;
use super::super::fields::Fields;
use super::super::series::MAX_CHANNELS;
use super::super::text::number;
use super::super::unit::{common, unit};
use super::super::xml;
use super::display;
use super::pages::Pages;
use super::stack::{Axis, Place, Run, Runs, Stack};

/// A resolution in pixels per inch that programs write by default, without meaning.
const NOMINAL_DPI: f64 = 72.0;

/// The voxel sizes, the expected number of slices, and the meaning of samples.
#[derive(Default)]
pub(super) struct Calibration {
    /// The spacing along x and y.
    pub(super) spacing: Option<[f64; 2]>,
    /// The spacing along z; ignored where x and y have none.
    pub(super) between_slices: Option<f64>,
    pub(super) unit: Option<String>,
    /// What the pages show.
    pub(super) stack: Option<Stack>,
    /// Where pages are not in the stack's order.
    pub(super) runs: Runs,
    pub(super) channel_names: Vec<String>,
    pub(super) displays: Vec<ChannelDisplay>,
    /// Slope and intercept.
    pub(super) rescale: Option<[f64; 2]>,
}

impl Calibration {
    /// The calibration on the first page.
    pub(super) fn of(pages: &mut Pages) -> Result<Self, VolumeError> {
        let description = pages.description()?;
        if description.starts_with("ImageJ=") {
            return Self::of_image_j(pages, &description);
        }
        if description.contains("<OME") || description.contains("<ome:OME") {
            return Self::of_ome(&pages.path, pages.page.samples, &description);
        }
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
        let images = count("images")?;
        let [slices, channels, frames] = [count("slices")?, count("channels")?, count("frames")?];
        let mut stack = Stack::of_slices(images);
        match [slices, channels, frames].map(|count| count > 1) {
            [_, false, false] => {}
            // Programs without a notion of axes write this.
            [false, true, false] | [false, false, true] => {
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
        let along_x = units[0].and_then(unit);
        if units[1..].iter().flatten().any(|&other| unit(other) != along_x) {
            let found = units.map(|unit| unit.unwrap_or("unit's")).join(", ");
            return Err(fields.invalid("unit, yunit, zunit", found, "one unit for all"));
        }
        // ImageJ ignores the sign of the spacing.
        let between = fields.value("spacing", "a finite number other than 0", |text| match text {
            None => Some(None),
            Some(text) => number(text).map(f64::abs).filter(|&spacing| spacing > 0.0).map(Some),
        })?;
        let (mut spacing, mut length_unit) = (None, along_x);
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
                spacing = Some([1.0 / x, 1.0 / y]);
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
        let between_slices = between.or((images > 1).then_some(1.0));
        let (stack, channel_names) = (Some(stack), Vec::new());
        let (unit, runs) = (length_unit, Runs::default());
        Ok(Self { spacing, between_slices, unit, stack, runs, channel_names, displays, rescale })
    }

    /// Parses the attributes of the single element `Pixels`. A pixel has a number of samples.
    fn of_ome(path: &Path, samples: u32, description: &str) -> Result<Self, VolumeError> {
        let damage = |error| xml::damage(path, error);
        let mut reader = Reader::from_str(description);
        let mut pixels: Option<Fields> = None;
        let (mut tiff_data, mut channel_names, mut colors) = (Vec::new(), Vec::new(), Vec::new());
        loop {
            match reader.read_event().map_err(damage)? {
                Event::Start(element) | Event::Empty(element) => match element.local_name().as_ref() {
                    "Pixels" if pixels.is_some() => {
                        return Err(invalid(path, "Pixels", "more than one image", "one image"));
                    }
                    "Pixels" => pixels = Some(xml::attributes(path, &element)?),
                    "TiffData" => tiff_data.push(xml::attributes(path, &element)?),
                    "Channel" => {
                        let channel = xml::attributes(path, &element)?;
                        let number = channel_names.len();
                        colors.push(channel.get("Color").and_then(display::of_ome));
                        channel_names.push(channel.get("Name").map_or(format!("channel {number}"), str::to_owned));
                    }
                    _ => {}
                },
                Event::Eof => break,
                _ => {}
            }
        }
        let Some(pixels) = pixels else {
            return Err(invalid(path, "Pixels", "no such element", "one image"));
        };
        let count = |name: &str| {
            pixels.value(name, "a positive integer", |text| text?.parse::<u32>().ok().filter(|&count| count > 0))
        };
        let order = pixels.value("DimensionOrder", "XY and the letters Z, C and T in any order", |text| {
            // Without channels and times the order does not matter.
            let axes: Vec<Axis> =
                text.unwrap_or("XYZCT").strip_prefix("XY")?.chars().map(axis).collect::<Option<_>>()?;
            let has = |axis| axes.contains(&axis);
            let is_all = has(Axis::Slice) && has(Axis::Channel) && has(Axis::Time);
            axes.as_slice().try_into().ok().filter(|_| is_all)
        })?;
        let [slices, channels, times] = [count("SizeZ")?, count("SizeC")?, count("SizeT")?];
        let stack = Stack { slices, channels, times, order }.of_pixels(samples);
        if stack.pages().is_none() {
            let found = format!("{slices}, {channels}, {times}");
            let allowed = format!("at most {} pages, and {MAX_CHANNELS} channels", u32::MAX);
            return Err(pixels.invalid("SizeZ, SizeC, SizeT", found, allowed));
        }
        let runs = tiff_data.iter().map(|tiff_data| run(tiff_data, &stack)).collect::<Result<Vec<Run>, _>>()?;
        let runs = Runs::new(&runs);
        let size = |name: &str| {
            pixels.value(name, "a positive finite number", |text| match text {
                None => Some(None),
                Some(text) => number(text).filter(|&size| size > 0.0).map(Some),
            })
        };
        let [x, y, z] = [size("PhysicalSizeX")?, size("PhysicalSizeY")?, size("PhysicalSizeZ")?];
        let names = ["PhysicalSizeXUnit", "PhysicalSizeYUnit", "PhysicalSizeZUnit"];
        let units = names.map(|name| pixels.get(name).unwrap_or("µm"));
        let unit = common(units);
        if units.iter().any(|&other| unit != super::super::unit::unit(other)) {
            return Err(pixels.invalid("PhysicalSizeXUnit, YUnit, ZUnit", units.join(", "), "one unit for all"));
        }
        let spacing = x.zip(y).map(|(x, y)| [x, y]);
        let unit = unit.filter(|_| spacing.is_some());
        // White is what a file states that states nothing.
        if colors.iter().flatten().all(|&color| color == DVec3::ONE) {
            colors.clear();
        }
        let display =
            |color: Option<DVec3>| ChannelDisplay { colors: color.into_iter().collect(), ..ChannelDisplay::default() };
        let displays = colors.into_iter().map(display).collect();
        let stack = Some(stack);
        Ok(Self { spacing, between_slices: z, unit, stack, runs, channel_names, displays, rescale: None })
    }
}

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

/// The pages that an element `TiffData` is about: one if it names the first, all that are left if it does not, or as many as it says.
fn run(tiff_data: &Fields, stack: &Stack) -> Result<Run, VolumeError> {
    let number = |name: &str, default: u32| {
        tiff_data.value(name, "a number", |text| text.map_or(Some(default), |text| text.parse::<u32>().ok()))
    };
    let place = Place { slice: number("FirstZ", 0)?, channel: number("FirstC", 0)?, time: number("FirstT", 0)? };
    let first = stack.number(place).ok_or_else(|| {
        let Place { slice, channel, time } = place;
        let Stack { slices, channels, times, .. } = stack;
        let allowed = format!("numbers below SizeZ, SizeC and SizeT: {slices}, {channels}, {times}");
        tiff_data.invalid("FirstZ, FirstC, FirstT", format!("{slice}, {channel}, {time}"), allowed)
    })?;
    let count = if tiff_data.get("IFD").is_some() { 1 } else { u32::MAX };
    Ok(Run { page: number("IFD", 0)?, number: first, count: number("PlaneCount", count)? })
}

/// The axis that a letter stands for.
fn axis(letter: char) -> Option<Axis> {
    match letter {
        'Z' => Some(Axis::Slice),
        'C' => Some(Axis::Channel),
        'T' => Some(Axis::Time),
        _ => None,
    }
}

//! OME's description of a file, or of a set of files, in XML: <https://docs.openmicroscopy.org/ome-model/latest/ome-tiff/specification.html>.

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;
use quick_xml::Reader;
use quick_xml::events::Event;

use super::super::VolumeError;
use super::super::display::ChannelDisplay;
use super::super::error::volume::invalid;
use super::super::fields::Fields;
use super::super::series::MAX_CHANNELS;
use super::super::text::number;
use super::super::{unit, xml};
use super::calibration::Calibration;
use super::display;
use super::stack::{Axis, Place, Run, Runs, Stack};

/// An element that says where planes are.
struct TiffData {
    fields: Fields,
    /// The name and the identity of the file that holds them, if the element states these.
    file: Option<String>,
    uuid: Option<String>,
}

impl TiffData {
    /// The name of the other file that holds the planes. A file that was renamed keeps its identity.
    fn elsewhere(&self, own: Option<&str>, own_name: &str) -> Option<&str> {
        let is_own = self.uuid.is_some() && self.uuid.as_deref() == own;
        self.file.as_deref().filter(|&name| !is_own && name != own_name)
    }
}

/// Parses the attributes of the single element `Pixels`. A pixel has a number of samples.
pub(super) fn read(path: &Path, samples: u32, description: &str) -> Result<Calibration, VolumeError> {
    let damage = |error| xml::damage(path, error);
    let mut reader = Reader::from_str(description);
    let mut pixels: Option<Fields> = None;
    let (mut tiff_data, mut channel_names, mut colors) = (Vec::<TiffData>::new(), Vec::new(), Vec::new());
    // The file's own identity, and whether the text is that of an element of the file that holds planes.
    let (mut own, mut is_uuid) = (None, false);
    loop {
        match reader.read_event().map_err(damage)? {
            Event::Start(element) | Event::Empty(element) => match element.local_name().as_ref() {
                "Pixels" if pixels.is_some() => {
                    return Err(invalid(path, "Pixels", "more than one image", "one image"));
                }
                "Pixels" => pixels = Some(xml::attributes(path, &element)?),
                "OME" => own = xml::attributes(path, &element)?.get("UUID").map(str::to_owned),
                "BinaryOnly" => {
                    let elsewhere = xml::attributes(path, &element)?;
                    let found =
                        format!("planes that {} describes", elsewhere.get("MetadataFile").unwrap_or("another file"));
                    return Err(invalid(path, "BinaryOnly", found, "a file that describes its planes itself"));
                }
                "TiffData" => {
                    tiff_data.push(TiffData { fields: xml::attributes(path, &element)?, file: None, uuid: None });
                }
                "UUID" => {
                    is_uuid = true;
                    if let Some(last) = tiff_data.last_mut() {
                        last.file = xml::attributes(path, &element)?.get("FileName").map(str::to_owned);
                    }
                }
                "Channel" => {
                    let channel = xml::attributes(path, &element)?;
                    let number = channel_names.len();
                    colors.push(channel.get("Color").and_then(display::of_ome));
                    channel_names.push(channel.get("Name").map_or(format!("channel {number}"), str::to_owned));
                }
                _ => {}
            },
            Event::Text(text) if is_uuid => {
                if let Some(last) = tiff_data.last_mut() {
                    last.uuid = Some(text.as_ref().trim().to_owned());
                }
            }
            Event::End(_) => is_uuid = false,
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
        let axes: Vec<Axis> = text.unwrap_or("XYZCT").strip_prefix("XY")?.chars().map(axis).collect::<Option<_>>()?;
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
    let own_name = path.file_name().unwrap_or_default().to_string_lossy();
    let (mut of_own, mut of_others) = (Vec::new(), BTreeMap::<&str, Vec<Run>>::new());
    for tiff_data in &tiff_data {
        let run = run(&tiff_data.fields, &stack)?;
        match tiff_data.elsewhere(own.as_deref(), &own_name) {
            Some(name) => of_others.entry(name).or_default().push(run),
            None => of_own.push(run),
        }
    }
    // A file that was renamed, and that states no identity, names a single other one.
    if of_own.is_empty() && of_others.len() == 1 {
        of_own = of_others.pop_first().map(|(_, runs)| runs).unwrap_or_default();
    }
    let runs = Runs::new(&of_own);
    let others = of_others.into_iter().map(|(name, runs)| (name.to_owned(), Runs::new(&runs))).collect();
    let size = |name: &str| {
        pixels.value(name, "a positive finite number, or 0", |text| match text {
            None => Some(None),
            // Programs write 0 where they know no size.
            Some(text) => number(text).filter(|&size| size >= 0.0).map(Some),
        })
    };
    let mut sizes = [size("PhysicalSizeX")?, size("PhysicalSizeY")?, size("PhysicalSizeZ")?];
    let names = ["PhysicalSizeXUnit", "PhysicalSizeYUnit", "PhysicalSizeZUnit"];
    let units = names.map(|name| pixels.get(name).unwrap_or("µm"));
    // Units of sizes that are not stated do not count.
    let names = [0, 1, 2].map(|axis| sizes[axis].filter(|&size| size > 0.0).map(|_| units[axis]));
    let of_units = (path, "PhysicalSizeXUnit, YUnit, ZUnit");
    let (unit, factors) = unit::shared(of_units, DVec3::from_array(sizes.map(|size| size.unwrap_or(1.0))), names);
    for (size, factor) in sizes.iter_mut().zip(factors.to_array()) {
        *size = size.map(|size| size * factor);
    }
    if sizes.contains(&Some(0.0)) {
        let open = sizes.map(|size| size.unwrap_or_default());
        let known = unit::known((path, "PhysicalSizeX, Y, Z"), open);
        sizes = known.map_or([None; 3], |known| known.to_array().map(Some));
    }
    let [x, y, z] = sizes;
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
    let between_slices = z;
    Ok(Calibration {
        spacing,
        between_slices,
        unit,
        stack,
        runs,
        others,
        channel_names,
        displays,
        ..Calibration::default()
    })
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

//! Parts in EXR files: the data window is the part's region, the display window the whole image, and an attribute holds the description.

use std::io::Cursor;
use std::path::Path;

use ::exr::error::Error;
use ::exr::meta::MetaData;
use ::exr::meta::attribute::{AttributeValue, IntegerBounds, Text};
use ::exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, ReadChannels, ReadLayers, Vec2,
    WritableImage,
};

use super::Part;
use super::channels::{Decoded, channel_names, check_hash, reserve, to_channels};
use super::description::{from_json, to_json};
use crate::image::ImageError;
use crate::image::open::{check_blocks, content};
use crate::volume::Access;

/// The attribute that holds the description.
const ATTRIBUTE: &str = "sheetsplat";

/// The bytes of a part's file.
pub(super) fn encode(path: &Path, part: &Part) -> Result<Vec<u8>, ImageError> {
    let failed = |error: Error| ImageError::Io { path: path.to_owned(), source: std::io::Error::other(error) };
    let json = to_json(part).map_err(|error| ImageError::Io { path: path.to_owned(), source: error.into() })?;
    let region = part.window.region;
    let channel = |(name, samples): (&String, Vec<f32>)| AnyChannel::new(name.as_str(), FlatSamples::F32(samples));
    let channels = channel_names(&part.identity).iter().zip(to_channels(part)).map(channel).collect();
    let description = (Text::from(ATTRIBUTE), AttributeValue::Text(Text::from(json.as_str())));
    let attributes = LayerAttributes {
        layer_position: Vec2(region.x as i32, region.y as i32),
        other: [description].into(),
        ..LayerAttributes::default()
    };
    let size = Vec2(region.width as usize, region.height as usize);
    let layer = Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, AnyChannels::sort(channels));
    let mut image = Image::from_layer(layer);
    let [width, height] = part.identity.size;
    image.attributes.display_window = IntegerBounds::from_dimensions((width as usize, height as usize));
    let mut bytes = Cursor::new(Vec::new());
    image.write().non_parallel().to_buffered(&mut bytes).map_err(failed)?;
    Ok(bytes.into_inner())
}

/// What identifies the part in a file, and its channels.
pub(super) fn decode(path: &Path, bytes: &[u8], access: &Access) -> Result<Decoded, ImageError> {
    let failed = |source: Error| ImageError::Decode { path: path.to_owned(), source: source.into() };
    let metadata = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(failed)?;
    let described =
        metadata.headers.iter().find_map(|header| match header.own_attributes.other.get(ATTRIBUTE.as_bytes()) {
            Some(AttributeValue::Text(text)) => Some((header, text.to_string())),
            _ => None,
        });
    let Some((header, json)) = described.filter(|_| metadata.headers.len() == 1) else {
        let found = format!("no attribute {ATTRIBUTE:?} in an image of {} layers", metadata.headers.len());
        return Err(content(path, "part", found, "a part of an image, as sheetsplat render writes it".to_owned()));
    };
    let (identity, window, pixels) = from_json(path, &json)?;
    let size = header.layer_size;
    let region = window.region;
    if (size.width(), size.height()) != (region.width as usize, region.height as usize) {
        let found = format!("{}×{} pixels", size.width(), size.height());
        return Err(content(path, "size", found, format!("{}×{}, as its region", region.width, region.height)));
    }
    let names = channel_names(&identity);
    let found: Vec<String> = header.channels.list.iter().map(|channel| channel.name.to_string()).collect();
    if found.len() != names.len() || names.iter().any(|name| !found.iter().any(|found| found == name)) {
        return Err(content(path, "channels", found.join(", "), names.join(", ")));
    }
    check_blocks(path, bytes)?;
    reserve(path, (&identity, &window), bytes.len(), access)?;
    let reader = ::exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
    let image = reader.first_valid_layer().all_attributes().non_parallel();
    let image = image.from_buffered(Cursor::new(bytes)).map_err(failed)?;
    let channel = |name: &String| {
        let samples = image.layer_data.channel_data.list.iter().find(|channel| channel.name.to_string() == *name);
        match samples.map(|channel| &channel.sample_data) {
            Some(FlatSamples::F32(samples)) if samples.len() == region.pixels() => Ok(samples.clone()),
            _ => Err(content(path, name, "other samples".to_owned(), "a 32-bit float for every pixel".to_owned())),
        }
    };
    let channels: Vec<_> = names.iter().map(channel).collect::<Result<_, _>>()?;
    check_hash(path, &pixels, &channels)?;
    Ok((identity, window, channels))
}

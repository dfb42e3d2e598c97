//! OpenEXR files: premultiplied floats.

use std::io::Cursor;

use ::exr::error::Error;
use ::exr::meta::MetaData;
use ::exr::meta::attribute::{AttributeValue, Text};
use ::exr::meta::header::Header;
use ::exr::prelude::{Image as File, ReadChannels, ReadLayers, SpecificChannels, Vec2, WritableImage};

use super::Image;
use super::format::KEYWORD;

/// The bytes of a file with a text, of ASCII alone, that describes it.
pub(super) fn encode(image: &Image, text: Option<&str>) -> Result<Vec<u8>, Error> {
    let size = (image.width as usize, image.height as usize);
    let pixel = |Vec2(x, y): Vec2<usize>| {
        let [red, green, blue, alpha] = image.pixels[x + y * size.0];
        (red, green, blue, alpha)
    };
    let mut file = File::from_channels(size, SpecificChannels::rgba(pixel));
    if let Some(text) = text {
        let text = Text::new_or_none(text).ok_or(Error::Invalid("text beyond Latin-1".into()))?;
        file.layer_data.attributes.other.insert(Text::from(KEYWORD), AttributeValue::Text(text));
    }
    let mut bytes = Cursor::new(Vec::new());
    file.write().non_parallel().to_buffered(&mut bytes)?;
    Ok(bytes.into_inner())
}

/// The text that describes a file.
#[cfg(feature = "golden")]
pub(super) fn text(bytes: &[u8]) -> Result<Option<String>, Error> {
    let text = |header: &Header| match header.own_attributes.other.get(KEYWORD.as_bytes()) {
        Some(AttributeValue::Text(text)) => Some(text.to_string()),
        _ => None,
    };
    Ok(headers(bytes)?.iter().find_map(text))
}

/// The headers of a file's layers.
pub(super) fn headers(bytes: &[u8]) -> Result<Vec<Header>, Error> {
    Ok(MetaData::read_from_buffered(Cursor::new(bytes), false)?.headers.into_vec())
}

/// The pixels of the first layer that has red, green and blue, in the window that the file displays; transparent where it has none, and opaque
/// without alpha.
pub(super) fn decode(bytes: &[u8]) -> Result<Image, Error> {
    let reader = ::exr::prelude::read().no_deep_data().largest_resolution_level().rgba_channels(
        |size, _| (size.width(), vec![[0.0; 4]; size.area()]),
        |(width, pixels): &mut (usize, Vec<[f32; 4]>), Vec2(x, y), (red, green, blue, alpha): (f32, f32, f32, f32)| {
            pixels[x + y * *width] = [red, green, blue, alpha];
        },
    );
    let file = reader.first_valid_layer().all_attributes().non_parallel().from_buffered(Cursor::new(bytes))?;
    let (layer, window) = (file.layer_data, file.attributes.display_window);
    let [width, height] = [window.size.width(), window.size.height()];
    let Vec2(left, top) = layer.attributes.layer_position - window.position;
    let (layer_width, pixels) = layer.channel_data.pixels;
    let mut image = Image { width: width as u32, height: height as u32, pixels: vec![[0.0; 4]; width * height] };
    for (at, pixel) in pixels.into_iter().enumerate() {
        let x = usize::try_from((at % layer_width) as i64 + i64::from(left)).unwrap_or(usize::MAX);
        let y = usize::try_from((at / layer_width) as i64 + i64::from(top)).unwrap_or(usize::MAX);
        if x < width && y < height {
            image.pixels[x + y * width] = pixel;
        }
    }
    Ok(image)
}

//! Reading back the pixels of a part of an image (SPEC §11).

use wgpu::{Device, Queue};

use super::readback;
use crate::error::RenderError;
use crate::part::{Content, Extreme};
use crate::rasterizer::carried::Carried;
use crate::renderer::prepared_frame::{Drawing, PreparedFrame};
use crate::settings::splatting::Compositing;
use crate::settings::window::Region;

/// The number of a pixel that has chosen none. Records of pixels hold the bits in which a number differs from it.
const NO_NUMBER: f32 = 1e30;

/// The compositing buffer's pixels in a region of a frame that was submitted. If the compositing has them choose values (SPEC §9), `chosen`, also
/// the values.
///
/// # Errors
/// If the device is lost.
pub(super) fn content(
    (device, queue): (&Device, &Queue),
    frame: &PreparedFrame,
    region: &Region,
    chosen: Option<Compositing>,
) -> Result<Content, RenderError> {
    let buffers = frame.compositing.bands.iter().map(|band| &band.acc);
    let mut colors = Vec::with_capacity(region.pixels());
    for (band, buffer) in frame.compositing.bands.iter().zip(buffers) {
        let pixels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&readback::buffer(device, queue, buffer)?);
        crop(&pixels, (frame, band.band.first_row), region, &mut colors);
    }
    let extremes = match frame.first_drawing().and_then(Drawing::carried) {
        Some(carried) if chosen.is_some() => extremes((device, queue), frame, carried, region, &colors)?,
        _ => Vec::new(),
    };
    if chosen == Some(Compositing::Minimum) {
        // The buffer holds 2 minus the opacity, 0 for none.
        let drawn = colors.iter_mut().filter(|color| color[3] != 0.0);
        drawn.for_each(|color| color[3] = 2.0 - color[3]);
    }
    Ok(Content { colors, extremes })
}

/// Appends those of a band's pixels that lie in a region.
fn crop<T: Copy>(pixels: &[T], (frame, first_row): (&PreparedFrame, u32), region: &Region, cropped: &mut Vec<T>) {
    let rows = (first_row as usize..).zip(pixels.chunks_exact(frame.compositing.size[0] as usize));
    for (_, row) in rows.filter(|(y, _)| region.rows().contains(y)) {
        cropped.extend_from_slice(&row[region.columns()]);
    }
}

/// The values that the pixels of a region chose in a volume of one channel, by what they carry and their colours.
fn extremes(
    (device, queue): (&Device, &Queue),
    frame: &PreparedFrame,
    Carried { bands, range: [low, high], .. }: &Carried,
    region: &Region,
    colors: &[[f32; 4]],
) -> Result<Vec<Extreme>, RenderError> {
    let mut held = Vec::with_capacity(region.pixels());
    for (band, buffer) in frame.compositing.bands.iter().zip(bands) {
        let bytes = readback::buffer(device, queue, buffer)?;
        // The buffer may be larger than the band.
        let size = band.band.rows as usize * frame.compositing.size[0] as usize;
        let words: Vec<[u32; 4]> = bytemuck::pod_collect_to_vec(&bytes[..size * size_of::<[f32; 4]>()]);
        crop(&words, (frame, band.band.first_row), region, &mut held);
    }
    let span = if high > low { high - low } else { 1.0 };
    let extreme = |([.., bits], color): ([u32; 4], &[f32; 4])| match f32::from_bits(bits ^ NO_NUMBER.to_bits()) {
        NO_NUMBER if color[3] == 0.0 => Extreme::default(),
        NO_NUMBER => Extreme { value: 0.0, counted: Extreme::MIDDLE },
        number => Extreme { value: (number - low) / span, counted: Extreme::POINT },
    };
    Ok(held.into_iter().zip(colors).map(extreme).collect())
}

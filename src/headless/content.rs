//! Reading back the pixels of a part of an image (SPEC §11).

use bytemuck::Pod;
use wgpu::{Buffer, Device, Queue};

use super::readback;
use crate::error::RenderError;
use crate::gpu::layout::Band;
use crate::image::channels::Joining;
use crate::part::{Content, Extreme};
use crate::rasterizer::carried::Carried;
use crate::renderer::prepared_frame::{Drawing, PreparedFrame};
use crate::settings::splatting::Compositing;
use crate::settings::window::Region;

/// The number of a pixel that has chosen none. Records of pixels hold the bits in which a number differs from it.
const NO_NUMBER: f32 = 1e30;

/// The compositing buffer's pixels in a region of a frame that was submitted. If the compositing has them choose values (SPEC §9), `chosen`, also
/// the values; of means the own colours, if voxels have any, in place of classified ones.
///
/// # Errors
/// If the device is lost.
pub(super) fn content(
    (device, queue): (&Device, &Queue),
    frame: &PreparedFrame,
    region: &Region,
    chosen: Option<Compositing>,
) -> Result<Content, RenderError> {
    let mut colors = Vec::with_capacity(region.pixels());
    let image = frame.joined.as_ref().map_or(&frame.compositing, |joined| &joined.compositing);
    for band in &image.bands {
        read_rows((device, queue), (frame, &band.band), (&band.acc, 0), region, &mut colors)?;
    }
    if frame.joined.is_some() {
        // Images that add up are drawn one by one.
        Joining::Nearest.finish(&mut colors, [0.0; 4]);
    }
    let extremes = match (chosen, frame.first_drawing().and_then(Drawing::carried)) {
        (Some(chosen), Some(carried)) if chosen.is_average() => {
            means((device, queue), frame, carried, region, &mut colors)?
        }
        (Some(_), Some(carried)) => extremes((device, queue), frame, carried, region, &colors)?,
        _ => Vec::new(),
    };
    if chosen.is_some_and(Compositing::keeps_least) {
        // The buffer holds 2 minus the opacity, 0 for none.
        let drawn = colors.iter_mut().filter(|color| color[3] != 0.0);
        drawn.for_each(|color| color[3] = 2.0 - color[3]);
    }
    Ok(Content { colors, extremes })
}

/// Reads those of a band's pixels that lie in a region from one of a buffer's records of them all, and appends them.
fn read_rows<T: Pod>(
    (device, queue): (&Device, &Queue),
    (frame, band): (&PreparedFrame, &Band),
    (buffer, record): (&Buffer, u32),
    region: &Region,
    read: &mut Vec<T>,
) -> Result<(), RenderError> {
    let (first, end) = (region.y.max(band.first_row), (region.y + region.height).min(band.first_row + band.rows));
    if first >= end {
        return Ok(());
    }
    let row = frame.compositing.size[0] as usize;
    let bytes_before = |y: u32| u64::from(record * band.rows + y - band.first_row) * (row * size_of::<T>()) as u64;
    let bytes = readback::buffer_part(device, queue, buffer, bytes_before(first)..bytes_before(end))?;
    let pixels: Vec<T> = bytemuck::pod_collect_to_vec(&bytes);
    pixels.chunks_exact(row).for_each(|row| read.extend_from_slice(&row[region.columns()]));
    Ok(())
}

/// The records that the pixels of a region carry in a volume of one channel, and those of its own colours, if it has any.
fn records(
    device: (&Device, &Queue),
    frame: &PreparedFrame,
    carried: &Carried,
    region: &Region,
) -> Result<[Vec<[u32; 4]>; 2], RenderError> {
    let mut records = [const { Vec::new() }; 2];
    for (band, buffer) in frame.compositing.bands.iter().zip(&carried.bands) {
        for (record, number) in records.iter_mut().zip(0..carried.records) {
            read_rows(device, (frame, &band.band), (buffer, number), region, record)?;
        }
    }
    Ok(records)
}

/// The mean values of a region's pixels. Pixels with points on planes get their own colours, or none.
fn means(
    device: (&Device, &Queue),
    frame: &PreparedFrame,
    carried: &Carried,
    region: &Region,
    colors: &mut [[f32; 4]],
) -> Result<Vec<Extreme>, RenderError> {
    let [held, own] = records(device, frame, carried, region)?;
    let numbers = &carried.numbers;
    let mut own = own.into_iter();
    let mean = |([_, sum, count, _], color): ([u32; 4], &mut [f32; 4])| {
        let [sum, count] = [sum, count].map(f32::from_bits);
        let own = own.next().unwrap_or_default();
        if count > 0.0 {
            *color = own.map(|sum| f32::from_bits(sum) / count);
            let value = numbers.base + f64::from(sum) / f64::from(count) / numbers.scale;
            return Extreme { value: value as f32, counted: Extreme::MIDDLE + count, ..Extreme::default() };
        }
        Extreme { counted: if color[3] == 0.0 { 0.0 } else { Extreme::MIDDLE }, ..Extreme::default() }
    };
    Ok(held.into_iter().zip(colors).map(mean).collect())
}

/// The values that the pixels of a region chose in a volume of one channel, by what they carry and their colours.
fn extremes(
    device: (&Device, &Queue),
    frame: &PreparedFrame,
    carried: &Carried,
    region: &Region,
    colors: &[[f32; 4]],
) -> Result<Vec<Extreme>, RenderError> {
    let [held, _] = records(device, frame, carried, region)?;
    let [low, high] = carried.numbers.range;
    let span = if high > low { high - low } else { 1.0 };
    let extreme = |([.., bits], color): ([u32; 4], &[f32; 4])| match f32::from_bits(bits ^ NO_NUMBER.to_bits()) {
        NO_NUMBER if color[3] == 0.0 => Extreme::default(),
        NO_NUMBER => Extreme { counted: Extreme::MIDDLE, ..Extreme::default() },
        number => Extreme { value: (number - low) / span, counted: Extreme::POINT, ..Extreme::default() },
    };
    Ok(held.into_iter().zip(colors).map(extreme).collect())
}

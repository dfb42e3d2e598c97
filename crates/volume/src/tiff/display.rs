//! Colours and windows of channels: OME's `Color`, and ImageJ's ranges and lookup tables.

use glam::DVec3;

use super::super::display::ChannelDisplay;

/// The number of colours of a lookup table.
const LEVELS: usize = 256;

/// The number of colours that stand for a lookup table which is no scale of one colour.
const STEPS: usize = 17;

/// The colour of OME's attribute `Color`: red, green, blue and A from the highest byte on, in a signed number.
pub(super) fn of_ome(text: &str) -> Option<DVec3> {
    let [red, green, blue, _] = text.parse::<i32>().ok()?.to_be_bytes();
    Some(rgb([red, green, blue]))
}

/// The displays of ImageJ's tags `IJMetadata` and `IJMetadataByteCounts`, by channel. The first block lists the kinds of the others, each with
/// how many there are: `rang`, the windows of all channels; `luts`, a lookup table for each. `None` if the tag is damaged.
pub(super) fn of_image_j(bytes: &[u8], counts: &[u64], big_endian: bool) -> Option<Vec<ChannelDisplay>> {
    let mut rest = bytes;
    let mut blocks = counts.iter().map(|&count| {
        let (block, after) = rest.split_at_checked(usize::try_from(count).ok()?)?;
        rest = after;
        Some(block)
    });
    let header = blocks.next()??;
    // Words that are written as text are numbers to a machine of the other order.
    let word = |bytes: &[u8]| -> Option<[u8; 4]> {
        let mut word: [u8; 4] = bytes.try_into().ok()?;
        if !big_endian {
            word.reverse();
        }
        Some(word)
    };
    let mut words = header.chunks(4).map(word);
    if words.next()?? != *b"IJIJ" {
        return None;
    }
    let mut displays: Vec<ChannelDisplay> = Vec::new();
    let mut of = |channel: usize, set: &dyn Fn(&mut ChannelDisplay)| {
        if displays.len() <= channel {
            displays.resize_with(channel + 1, ChannelDisplay::default);
        }
        set(&mut displays[channel]);
    };
    while let Some(kind) = words.next() {
        let (kind, count) = (kind?, u32::from_be_bytes(words.next()??));
        for number in 0..count {
            let block = blocks.next()??;
            match &kind {
                b"rang" => {
                    let numbers: Vec<f64> = block.chunks(8).map_while(|bytes| number_of(bytes, big_endian)).collect();
                    for (channel, &window) in numbers.as_chunks().0.iter().enumerate() {
                        of(channel, &|display| display.window = valid(window));
                    }
                }
                b"luts" => {
                    let colors = colors_of(block)?;
                    of(number as usize, &|display| display.colors.clone_from(&colors));
                }
                _ => {}
            }
        }
    }
    Some(displays)
}

/// A window whose ends are finite and ascend.
pub(super) fn valid(window: [f64; 2]) -> Option<[f64; 2]> {
    Some(window).filter(|[low, high]| low.is_finite() && high.is_finite() && low < high)
}

fn number_of(bytes: &[u8], big_endian: bool) -> Option<f64> {
    let bytes = bytes.try_into().ok()?;
    Some(if big_endian { f64::from_be_bytes(bytes) } else { f64::from_le_bytes(bytes) })
}

/// The colours of a lookup table: one if it is a scale from black to that.
fn colors_of(table: &[u8]) -> Option<Vec<DVec3>> {
    if table.len() != 3 * LEVELS {
        return None;
    }
    let color = |level: usize| [0, 1, 2].map(|channel| table[channel * LEVELS + level]);
    let brightest = color(LEVELS - 1);
    let is_scaled = |level: usize| {
        let scaled = brightest.map(|full| f64::from(full) * level as f64 / (LEVELS - 1) as f64);
        color(level).iter().zip(scaled).all(|(&number, scaled)| (f64::from(number) - scaled).abs() <= 1.5)
    };
    if (0..LEVELS).all(is_scaled) {
        return Some(vec![rgb(brightest)]);
    }
    Some((0..STEPS).map(|step| rgb(color(step * (LEVELS - 1) / (STEPS - 1)))).collect())
}

fn rgb(color: [u8; 3]) -> DVec3 {
    DVec3::from(color.map(|channel| f64::from(channel) / 255.0))
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    #[test]
    fn omes_colours_are_signed_numbers() {
        assert_eq!(of_ome("-16776961"), Some(DVec3::X));
        assert_eq!(of_ome("16711935"), Some(DVec3::Y));
        assert_eq!(of_ome("-1"), Some(DVec3::ONE));
        assert_eq!(of_ome("red"), None);
    }

    #[test]
    fn damaged_tags_are_told() {
        let header = [b"IJIJ", &b"rang"[..], &1_u32.to_be_bytes()].concat();
        let window = [10.0_f64.to_be_bytes(), 200.0_f64.to_be_bytes()].concat();
        let whole = [header.clone(), window].concat();
        let displays = of_image_j(&whole, &[12, 16], true).unwrap();
        assert_eq!(displays[0].window, Some([10.0, 200.0]));
        for (bytes, counts) in [
            (&whole[..], &[12, 17][..]),
            (&whole[..], &[11, 16]),
            (&whole[..], &[12]),
            (&whole[..], &[]),
            (&whole[4..], &[12, 12]),
            (&header[..], &[12, u64::MAX]),
        ] {
            assert_eq!(of_image_j(bytes, counts, true), None, "{counts:?}");
        }
        let tables = [b"IJIJ", &b"luts"[..], &1_u32.to_be_bytes(), &[0; 767]].concat();
        assert_eq!(of_image_j(&tables, &[12, 767], true), None);
    }
}

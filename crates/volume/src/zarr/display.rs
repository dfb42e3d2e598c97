//! How an image's channels are shown, and what labels mean.

use glam::DVec3;

use super::super::loaded::Legend;

use super::super::display::ChannelDisplay;
use super::super::sample_type::Sample;
use super::json::Json;

/// The names of channels and how they are shown, as `omero` states them.
pub(super) fn channels(omero: &Json) -> (Vec<String>, Vec<ChannelDisplay>) {
    let channels = omero.get("channels").members();
    let name = |(number, channel): (usize, &Json)| {
        channel.get("label").text().map_or_else(|| format!("channel {number}"), str::to_owned)
    };
    let names = channels.iter().enumerate().map(name).collect();
    let mut displays: Vec<ChannelDisplay> = channels
        .iter()
        .map(|channel| {
            let [low, high] = ["start", "end"].map(|end| channel.get("window").get(end).number());
            let window = low.zip(high).filter(|(low, high)| low < high).map(|(low, high)| [low, high]);
            let colors = channel.get("color").text().and_then(color).into_iter().collect();
            ChannelDisplay { colors, window }
        })
        .collect();
    // White is what a file states that states nothing.
    if displays.iter().flat_map(|display| &display.colors).all(|&color| color == DVec3::ONE) {
        displays.iter_mut().for_each(|display| display.colors.clear());
    }
    (names, displays)
}

/// The colour of six hexadecimal digits.
fn color(text: &str) -> Option<DVec3> {
    let digits = text.strip_prefix('#').unwrap_or(text);
    let number = u32::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 6)?;
    Some(DVec3::from([16, 8, 0].map(|shift| f64::from(number >> shift & 0xff) / 255.0)))
}

/// The names and colours of labels, as `image-label` states them.
pub(super) fn labels(image_label: &Json) -> Legend {
    let value = |label: &Json| {
        let number = label.get("label-value").number()?;
        number.to_id()
    };
    let name = |label: &Json| {
        let name = ["name", "class", "label"].iter().find_map(|key| label.get(key).text())?;
        Some((value(label)?, name.to_owned()))
    };
    let color = |label: &Json| {
        let numbers: Vec<f64> = label.get("rgba").members().iter().filter_map(Json::number).collect();
        let &[red, green, blue, ..] = numbers.as_slice() else { return None };
        Some((value(label)? as f64, DVec3::new(red, green, blue).clamp(DVec3::ZERO, DVec3::splat(255.0)) / 255.0))
    };
    let names = image_label.get("properties").members().iter().filter_map(name).collect();
    let palette = Legend::ascending(image_label.get("colors").members().iter().filter_map(color).collect());
    Legend { names, palette, are_labels: image_label.is_some() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_six_hexadecimal_digits() {
        assert_eq!(color("FF0000"), Some(DVec3::X));
        assert_eq!(color("#00ff00"), Some(DVec3::Y));
        for other in ["", "red", "FF00", "FF0000FF"] {
            assert_eq!(color(other), None, "{other}");
        }
    }
}

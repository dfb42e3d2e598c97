//! Units of length, as files call them.

/// Synonymous names of units, the symbol first.
const UNITS: [&[&str]; 6] = [
    &["nm", "nanometer", "nanometers", "nanometre", "nanometres"],
    &["µm", "μm", "um", "micron", "microns", "micrometer", "micrometers", "micrometre", "micrometres", "\\u00b5m"],
    &["mm", "millimeter", "millimeters", "millimetre", "millimetres"],
    &["cm", "centimeter", "centimeters", "centimetre", "centimetres"],
    &["m", "meter", "meters", "metre", "metres"],
    &["inch", "inches", "in", "\""],
];

/// The symbol of a known unit, or else the name itself; `None` if the name says that there is no unit.
pub fn unit(name: &str) -> Option<String> {
    let lower = name.trim().to_lowercase();
    if ["", "none", "unknown", "pixel", "pixels", "voxel", "voxels", "???"].contains(&lower.as_str()) {
        return None;
    }
    let known = UNITS.iter().find(|names| names.contains(&lower.as_str()));
    Some(known.map_or(name.trim(), |names| names[0]).to_owned())
}

/// The unit of all axes, if they share one.
pub(super) fn common<'a>(names: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let mut units = names.into_iter().map(unit);
    let first = units.next()??;
    units.all(|unit| unit.as_deref() == Some(&first)).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_unit_has_many_names() {
        for name in ["um", "µm", "\u{3bc}m", "micron", "Microns", "\\u00B5m", " micrometer "] {
            assert_eq!(unit(name).as_deref(), Some("µm"), "{name}");
        }
        assert_eq!(unit("parsec").as_deref(), Some("parsec"));
        assert_eq!(unit("Pixel"), None);
    }

    #[test]
    fn axes_of_several_units_have_none() {
        assert_eq!(common(["mm", "millimeter", "mm"]).as_deref(), Some("mm"));
        assert_eq!(common(["mm", "mm", "s"]), None);
        assert_eq!(common(["", "mm", "mm"]), None);
        assert_eq!(common([]), None);
    }
}

//! Units of length, as files call them, and spacings that files leave open.

use std::path::Path;

use glam::DVec3;

use super::text::shown;

/// Synonymous names of units, the symbol first.
const UNITS: [&[&str]; 7] = [
    &["Å", "Å", "angstrom", "angstroms"],
    &["nm", "nanometer", "nanometers", "nanometre", "nanometres"],
    &["µm", "μm", "um", "micron", "microns", "micrometer", "micrometers", "micrometre", "micrometres", "\\u00b5m"],
    &["mm", "millimeter", "millimeters", "millimetre", "millimetres"],
    &["cm", "centimeter", "centimeters", "centimetre", "centimetres"],
    &["m", "meter", "meters", "metre", "metres"],
    &["inch", "inches", "in", "\""],
];

/// The lengths of [`UNITS`] in metres.
const METERS: [f64; 7] = [1e-10, 1e-9, 1e-6, 1e-3, 1e-2, 1.0, 0.0254];

/// The symbol of a known unit, or else the name itself; `None` if the name says that there is no unit.
pub fn unit(name: &str) -> Option<String> {
    let lower = name.trim().to_lowercase();
    if ["", "none", "unknown", "pixel", "pixels", "voxel", "voxels", "???"].contains(&lower.as_str()) {
        return None;
    }
    let known = UNITS.iter().find(|names| names.contains(&lower.as_str()));
    Some(known.map_or(name.trim(), |names| names[0]).to_owned())
}

/// The one unit for axes with some spacings and names of units, and the factors by which the axes' lengths are to be multiplied: that of the axis with
/// the finest spacing, where they differ. An axis without a unit has the others'. A name is `None` where there is no such axis. If units differ of which one
/// is no known length, there is none. `field` names the units in warnings.
pub(super) fn shared(
    (path, field): (&Path, &str),
    spacing: DVec3,
    names: [Option<&str>; 3],
) -> (Option<String>, DVec3) {
    let units = names.map(|name| name.and_then(unit));
    let all = || names.iter().flatten().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ");
    let Some(first) = units.iter().flatten().next() else { return (None, DVec3::ONE) };
    if units.iter().flatten().all(|unit| unit == first) {
        if units.iter().flatten().count() < names.iter().flatten().count() {
            log::warn!("{}: {field}: {}: an axis without a unit is taken to be in {first}", path.display(), all());
        }
        return (Some(first.clone()), DVec3::ONE);
    }
    let meters = units.each_ref().map(|unit| {
        let Some(unit) = unit else { return Some(None) };
        UNITS.iter().position(|names| names[0] == unit).map(|at| Some(METERS[at]))
    });
    let [Some(x), Some(y), Some(z)] = meters else {
        log::warn!("{}: {field}: {}: not all are lengths, so that no unit is taken", path.display(), all());
        return (None, DVec3::ONE);
    };
    let meters = [x, y, z];
    let length = |axis: &usize| meters[*axis].map_or(f64::INFINITY, |meters| meters * spacing[*axis]);
    let finest = [0, 1, 2].into_iter().min_by(|a, b| length(a).total_cmp(&length(b))).unwrap_or_default();
    let unit = units[finest].clone();
    let name = unit.as_deref().unwrap_or_default();
    log::warn!("{}: {field}: {}: lengths are converted to {name}, the finest axis' unit", path.display(), all());
    let to = meters[finest].unwrap_or(1.0);
    (unit, DVec3::from_array(meters.map(|meters| meters.map_or(1.0, |meters| meters / to))))
}

/// Spacings of which some are 0 or NaN, which says that they are unknown: those become the finest of the others, or 1. `None` if one is negative or
/// infinite.
pub(super) fn known((path, field): (&Path, &str), spacings: [f64; 3]) -> Option<DVec3> {
    let is_known = |spacing: &f64| *spacing > 0.0 && spacing.is_finite();
    let is_open = |spacing: &f64| *spacing == 0.0 || spacing.is_nan();
    if !spacings.iter().all(|spacing| is_known(spacing) || is_open(spacing)) {
        return None;
    }
    let finest = spacings.into_iter().filter(is_known).reduce(f64::min).unwrap_or(1.0);
    if !spacings.iter().all(is_known) {
        log::warn!("{}: {field}: {spacings:?}: an axis without a spacing is taken to have {finest}", path.display());
    }
    Some(DVec3::from_array(spacings.map(|spacing| if is_known(&spacing) { spacing } else { finest })))
}

/// The entry by which ITK says that the slices of the series that it made a file of were not evenly spaced.
pub(super) const NON_UNIFORM: &str = "ITK_non_uniform_sampling_deviation";

/// Warns of what such an entry says. Where the slices lay, such files do not say.
pub(super) fn warn_of_itk(path: &Path, deviation: Option<&str>) {
    if let Some(deviation) = deviation {
        let (path, deviation) = (path.display(), shown(deviation));
        log::warn!(
            "{path}: {NON_UNIFORM}: {deviation}: its slices were not evenly spaced, and it does not say how: read the series itself"
        );
    }
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
    fn axes_have_the_unit_of_the_finest() {
        let of = |spacing: [f64; 3], names: [&str; 3]| {
            let (unit, factors) = shared((Path::new("a"), "units"), spacing.into(), names.map(Some));
            (unit, factors * DVec3::from_array(spacing))
        };
        let is = |unit: &str, spacing: [f64; 3]| (Some(unit.to_owned()), DVec3::from_array(spacing));
        assert_eq!(of([1.0, 2.0, 3.0], ["mm", "millimeter", "mm"]), is("mm", [1.0, 2.0, 3.0]));
        assert_eq!(of([1.0, 2.0, 3.0], ["", "mm", "mm"]), is("mm", [1.0, 2.0, 3.0]));
        assert_eq!(of([1.0, 2.0, 3.0], ["", "pixel", ""]), (None, DVec3::new(1.0, 2.0, 3.0)));
        let (unit, spacing) = of([0.25, 0.25, 500.0], ["µm", "um", "nm"]);
        assert!((spacing - DVec3::new(0.25, 0.25, 0.5)).abs().max_element() < 1e-15 && unit.as_deref() == Some("µm"));
        let (unit, spacing) = of([100.0, 100.0, 0.5], ["nm", "", "µm"]);
        assert!((spacing - DVec3::new(100.0, 100.0, 500.0)).abs().max_element() < 1e-9);
        assert_eq!(unit.as_deref(), Some("nm"));
        assert_eq!(of([1.0, 2.0, 3.0], ["mm", "mm", "s"]), (None, DVec3::new(1.0, 2.0, 3.0)));
    }

    #[test]
    fn unknown_spacings_are_those_of_the_finest_axis() {
        let of = |spacings: [f64; 3]| known((Path::new("a"), "spacings"), spacings);
        assert_eq!(of([0.5, 2.0, 3.0]), Some(DVec3::new(0.5, 2.0, 3.0)));
        assert_eq!(of([0.5, 2.0, 0.0]), Some(DVec3::new(0.5, 2.0, 0.5)));
        assert_eq!(of([0.0, f64::NAN, 3.0]), Some(DVec3::splat(3.0)));
        assert_eq!(of([0.0; 3]), Some(DVec3::ONE));
        assert_eq!((of([-1.0, 1.0, 1.0]), of([f64::INFINITY, 1.0, 1.0])), (None, None));
    }
}

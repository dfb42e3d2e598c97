//! `maximum`, `minimum` and `average` after splatting (SPEC §9): one value is chosen per pixel, and that value is classified.

use glam::{DVec3, DVec4};

use super::pixel::{Composited, Pixel};
use crate::part::Extreme;

/// A position on a pixel's ray, with the field there.
struct Point {
    sheet: f64,
    value: f64,
    gradient: DVec3,
    /// The colour and A, if voxels have their own.
    own: Option<DVec4>,
    /// As in [`Extreme::counted`].
    counted: f32,
}

/// The pixel of its chosen value. Its first hit is the chosen point, or for `average` the middle of the stretch, if the opacity reaches
/// the requested value.
pub(super) fn composite(pixel: &Pixel) -> Composited {
    let (scene, stretch) = (&pixel.frame().scene, pixel.stretch());
    let compositing = scene.splatting.compositing;
    let chosen = match compositing {
        _ if stretch.is_empty() => None,
        _ if compositing.is_average() => average(pixel),
        _ => extreme(pixel, compositing.keeps_least()),
    };
    let Some(Point { sheet, value, gradient, own, counted }) = chosen else {
        return Composited::new(DVec4::ZERO, None);
    };
    let [min, max] = pixel.frame().field.range();
    let share = if max > min { (value - min) / (max - min) } else { 0.0 };
    let kept = if compositing.is_average() { value } else { share };
    let tables = if compositing.is_average() { pixel.middle_tables() } else { pixel.tables(sheet) };
    let base = own.map_or_else(|| tables.color.at(value), DVec4::truncate);
    let opacity = own.map_or(1.0, |own| own.w);
    let color = if compositing.is_average() {
        let alpha = if tables.visible && tables.in_iso_range(value) { tables.opacity.at(value) } else { 0.0 };
        base.extend(1.0) * alpha * opacity
    } else {
        let alpha = tables.alpha(value, gradient.length());
        pixel.shaded(base, gradient, (sheet.floor() as i32, sheet)).extend(1.0) * alpha * opacity
    };
    let first_hit = pixel.frame().host.first_hit.filter(|&opacity| color.w >= opacity).map(|_| sheet);
    Composited { color, first_hit, extreme: Extreme { value: kept as f32, counted, label: 0.0 }, own }
}

/// The planes' points within the stretch that have a value, of those that are drawn, each as plane and value. The plane before a slab belongs
/// to that slab.
fn points<'a>(pixel: &'a Pixel) -> impl Iterator<Item = (i32, f64)> + 'a {
    let planes = pixel.stretch().start.ceil() as i32..=pixel.stretch().end.floor() as i32;
    let drawn = &pixel.frame().slabs;
    planes.filter(move |plane| drawn.contains(plane)).filter_map(|plane| pixel.value(plane).map(|value| (plane, value)))
}

/// Values that differ by less, relative to the range of the coefficients, count as equal: in homogeneous matter only rounding tells them apart.
const HAIR_OF_RANGE: f64 = 2e-6;

/// The point with the maximum or minimum value, the nearest of equal ones.
fn extreme(pixel: &Pixel, is_minimum: bool) -> Option<Point> {
    let [min, max] = pixel.frame().field.range();
    let hair = HAIR_OF_RANGE * (max - min);
    let nearest = |best: (i32, f64), other: (i32, f64)| {
        let is_better = if is_minimum { other.1 < best.1 - hair } else { other.1 > best.1 + hair };
        if is_better { other } else { best }
    };
    let Some((plane, _)) = points(pixel).reduce(nearest) else { return middle(pixel) };
    let value = points(pixel).map(|(_, value)| value).reduce(if is_minimum { f64::min } else { f64::max })?;
    let (gradient, own) = (pixel.gradient(plane), pixel.color(plane));
    Some(Point { sheet: plane.into(), value, gradient, own, counted: Extreme::POINT })
}

/// The mean value, placed in the middle of the stretch.
fn average(pixel: &Pixel) -> Option<Point> {
    let (count, sum) = points(pixel).fold((0.0, 0.0), |(count, sum), (_, value)| (count + 1.0, sum + value));
    if count == 0.0 {
        return middle(pixel);
    }
    let stretch = pixel.stretch();
    let sheet = (stretch.start + stretch.end) / 2.0;
    let own = points(pixel).map(|(plane, _)| pixel.color(plane)).sum::<Option<DVec4>>().map(|sum| sum / count);
    let counted = Extreme::MIDDLE + count as f32;
    Some(Point { sheet, value: sum / count, gradient: DVec3::ZERO, own, counted })
}

/// If the stretch contains no plane's value: the point in its middle, on the line of values of the slab there.
fn middle(pixel: &Pixel) -> Option<Point> {
    let sheet = (pixel.stretch().start + pixel.stretch().end) / 2.0;
    let number = sheet.floor() as i32;
    let slab = pixel.slab(number).filter(|_| pixel.frame().slabs.contains(&number))?;
    let (share, [f0, f1], [near, far]) = (sheet - sheet.floor(), slab.values, pixel.gradients(&slab));
    let (value, gradient, own) = (f0 + (f1 - f0) * share, near.lerp(far, share), pixel.slab_color(&slab));
    Some(Point { sheet, value, gradient, own, counted: Extreme::MIDDLE })
}

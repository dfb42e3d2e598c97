//! Merging parts into the whole image (SPEC §11).

use std::collections::BTreeMap;
use std::ops::Range;

use super::content::Content;
use super::resolve::Resolver;
use super::{Identity, Part};
use crate::image::Image;
use crate::image::channels::Joining;
use crate::settings::keys::{CLASSIFICATIONS, COMPOSITINGS, ORDERS, name_of};
use crate::settings::window::{Region, Window};
use crate::volume::Channels;

/// Why parts do not merge into an image.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MergeError {
    /// There is no part.
    #[error("parts: found none, allowed: all parts of one image")]
    Empty,
    /// A part belongs to another image.
    #[error("{part}: {field}: found {found}, allowed: {expected}, as in {other}")]
    #[non_exhaustive]
    Different {
        /// The part.
        part: String,
        /// What differs.
        field: &'static str,
        /// Its value.
        found: String,
        /// The part that it is compared with.
        other: String,
        /// The value there.
        expected: String,
    },
    /// Two parts show the same slabs of the same pixels.
    #[error("{part}: found {what}, which {other} also shows, allowed: parts that do not overlap")]
    #[non_exhaustive]
    Overlap {
        /// The part.
        part: String,
        /// The slabs or pixels that both show.
        what: String,
        /// The other part.
        other: String,
    },
    /// No part shows some slabs of some pixels.
    #[error("parts: found none with {missing}, allowed: parts that show the whole image")]
    #[non_exhaustive]
    Missing {
        /// The first slabs and pixels that are missing.
        missing: String,
    },
    /// A part's pixels do not fill its region.
    #[error("{part}: {field}: found {found}, allowed: {allowed}")]
    #[non_exhaustive]
    Content {
        /// The part.
        part: String,
        /// What is wrong.
        field: &'static str,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
}

impl Part {
    /// Merges parts of the same pixels, whose slabs follow one another, into one part. [`Image::merge`] takes it for them; the bytes are the same
    /// if all slabs of these pixels are joined, or neighbours in pairs, as `Image::merge` does.
    ///
    /// # Errors
    /// If there is no part, if parts differ in their scene or region, or if their slabs overlap or leave a gap.
    pub fn join(parts: impl IntoIterator<Item = Self>) -> Result<Self, MergeError> {
        let parts: Vec<Self> = parts.into_iter().collect();
        let first = parts.first().cloned().ok_or(MergeError::Empty)?;
        let Self { name, identity, window: Window { region, .. }, .. } = &first;
        for part in &parts {
            check_identity(part, name, identity)?;
            check_content(part)?;
            if part.window.region != *region {
                let (found, expected) = (part.window.region.to_string(), region.to_string());
                let (part, field, other) = (part.name.clone(), "region", name.clone());
                return Err(MergeError::Different { part, field, found, other, expected });
            }
        }
        Ok(match merge_neighbours(parts, identity, *region)? {
            Some((slabs, contents)) => Self::named(identity.clone(), Window { slabs, region: *region }, contents),
            // None of them shows a slab.
            None => first,
        })
    }
}

impl Image {
    /// Merges all parts of an image, in any order. The image is that of the whole scene: to rounding with an
    /// [`opacity_threshold`](crate::settings::Splatting::opacity_threshold) T of 1, and to 1 - T of the un-culled one with any.
    ///
    /// # Errors
    /// If the parts are not of one scene, leave out slabs or pixels, or overlap.
    pub fn merge(parts: impl IntoIterator<Item = Part>) -> Result<Self, MergeError> {
        let mut regions = BTreeMap::<Region, Vec<Part>>::new();
        let mut first: Option<(String, Identity)> = None;
        for part in parts {
            let (other, expected) = first.get_or_insert_with(|| (part.name.clone(), part.identity.clone()));
            check_identity(&part, other, expected)?;
            check_content(&part)?;
            regions.entry(part.window.region).or_default().push(part);
        }
        let (_, identity) = first.ok_or(MergeError::Empty)?;
        check_regions(&regions, &identity)?;
        let [width, height] = identity.size;
        let mut image = Self { width, height, pixels: vec![[0.0; 4]; width as usize * height as usize] };
        for (region, parts) in regions {
            let pixels = resolved(merge_slabs(parts, &identity, region)?, &identity);
            for (row, y) in pixels.chunks_exact(region.width as usize).zip(region.rows()) {
                image.pixels[y * width as usize..][region.columns()].copy_from_slice(row);
            }
        }
        Ok(image)
    }
}

/// The pixels of an image of merged slabs.
pub(crate) fn resolved(contents: Channels<Content>, identity: &Identity) -> Vec<[f32; 4]> {
    let Identity { classification, background, means, .. } = identity;
    let are_joined = contents.len() > 1;
    let behind = if are_joined { [0.0; 4] } else { *background };
    let resolver = Resolver::new(&identity.splatting(), *classification, behind);
    let of_image = |(number, Content { mut colors, extremes }): (usize, Content)| {
        if let Some(tables) = means.get(number) {
            colors.iter_mut().zip(&extremes).for_each(|(color, mean)| *color = tables.pixel(*color, *mean));
        }
        colors.iter_mut().for_each(|color| *color = resolver.pixel(*color));
        colors
    };
    let mut images = contents.into_iter().enumerate().map(of_image);
    let mut pixels = images.next().unwrap_or_default();
    for image in images {
        Joining::Sum.join((&mut pixels, &mut [0.0; 0]), (&image, &[]));
    }
    if are_joined {
        Joining::Sum.finish(&mut pixels, *background);
    }
    pixels
}

/// Checks that a part belongs to the image of another one.
fn check_identity(part: &Part, other: &str, expected: &Identity) -> Result<(), MergeError> {
    let shown = |identity: &Identity| {
        let [width, height] = identity.size;
        [
            ("order", name_of(ORDERS, identity.order).to_owned()),
            ("compositing", name_of(COMPOSITINGS, identity.compositing).to_owned()),
            ("classification", name_of(CLASSIFICATIONS, identity.classification).to_owned()),
            ("size", format!("{width}×{height}")),
            ("opacity threshold", identity.opacity_threshold.to_string()),
            ("culling", identity.culling.to_string()),
            ("background", format!("{:?}", identity.background)),
            ("images of channels", identity.images.to_string()),
            ("scene's slabs", format!("{}..{}", identity.slabs.start, identity.slabs.end)),
            ("scene", identity.fingerprint.clone()),
        ]
    };
    for ((field, found), (_, expected)) in shown(&part.identity).into_iter().zip(shown(expected)) {
        if found != expected {
            let (part, other) = (part.name.clone(), other.to_owned());
            return Err(MergeError::Different { part, field, found, other, expected });
        }
    }
    Ok(())
}

/// Checks that a part's pixels fill its region, which lies in the image.
fn check_content(part: &Part) -> Result<(), MergeError> {
    let Part { name, identity, window, .. } = part;
    let wrong =
        |field, found: String, allowed: String| MergeError::Content { part: name.clone(), field, found, allowed };
    if window.region.check(identity.size).is_err() {
        let [width, height] = identity.size;
        return Err(wrong("region", window.region.to_string(), format!("a region of the image of {width}×{height}")));
    }
    let pixels = window.region.pixels();
    let extremes = if identity.has_extremes() { pixels } else { 0 };
    let images = ("images of channels", part.contents.len(), identity.images);
    let of_image =
        |content: &Content| [("pixels", content.colors.len(), pixels), ("extremes", content.extremes.len(), extremes)];
    for (field, found, allowed) in std::iter::once(images).chain(part.contents.iter().flat_map(of_image)) {
        if found != allowed {
            return Err(wrong(field, found.to_string(), allowed.to_string()));
        }
    }
    Ok(())
}

/// Checks that regions fill an image, and that those of parts that show something share no pixels.
fn check_regions<'a>(regions: &'a BTreeMap<Region, Vec<Part>>, identity: &Identity) -> Result<(), MergeError> {
    let [width, height] = identity.size;
    let all: Vec<&Region> = regions.keys().collect();
    let shown_parts = |(region, parts): (&'a Region, &'a Vec<Part>)| {
        let within = parts.iter().map(|part| (part, part.window.within(&identity.slabs)));
        let shown: Vec<_> = within.filter(|(_, slabs)| !slabs.is_empty()).collect();
        (!shown.is_empty()).then_some((region, shown))
    };
    let shown: Vec<_> = regions.iter().filter_map(shown_parts).collect();
    for (at, (region, parts)) in shown.iter().enumerate() {
        if let Some((other, others)) = shown[..at].iter().find(|(other, _)| other.overlaps(region)) {
            return Err(sharing((region, parts), (other, others)));
        }
    }
    // Between neighbouring edges all pixels are alike.
    let edges = |ends: &dyn Fn(&Region) -> [u32; 2], end: u32| {
        let mut edges: Vec<u32> = all.iter().flat_map(|region| ends(region)).chain([0, end]).collect();
        edges.sort_unstable();
        edges.dedup();
        edges
    };
    let columns = edges(&|region| [region.x, region.x + region.width], width);
    let rows = edges(&|region| [region.y, region.y + region.height], height);
    for y in rows.windows(2) {
        for x in columns.windows(2) {
            let cell = Region { x: x[0], y: y[0], width: x[1] - x[0], height: y[1] - y[0] };
            if !all.iter().any(|region| region.overlaps(&cell)) {
                return Err(MergeError::Missing { missing: format!("pixels of region {cell}") });
            }
        }
    }
    Ok(())
}

/// A region, and the parts that show some slabs of it.
type Shown<'a> = (&'a Region, &'a [(&'a Part, Range<i32>)]);

/// The error for two regions that share pixels: parts overlap that show the same slabs; others cannot be joined, as their pixels differ.
fn sharing((region, parts): Shown<'_>, (other, others): Shown<'_>) -> MergeError {
    let name = |(part, _): &(&Part, Range<i32>)| part.name.clone();
    let pairs = parts.iter().flat_map(|part| others.iter().map(move |other| (part, other)));
    let both = |(_, a): &(&Part, Range<i32>), (_, b): &(&Part, Range<i32>)| a.start.max(b.start)..a.end.min(b.end);
    match pairs.map(|(a, b)| (a, b, both(a, b))).find(|(.., slabs)| !slabs.is_empty()) {
        Some((part, other_part, Range { start, end })) => {
            let common = region.common(other);
            let what = format!("slabs {start}..{end} of region {common}");
            MergeError::Overlap { part: name(part), what, other: name(other_part) }
        }
        None => MergeError::Different {
            part: parts.first().map(name).unwrap_or_default(),
            field: "region",
            found: region.to_string(),
            other: others.first().map(name).unwrap_or_default(),
            expected: format!("{other}, or a region that shares no pixels with it"),
        },
    }
}

/// The content of a region for every image that is added up, whose parts must show each of the scene's slabs once.
fn merge_slabs(parts: Vec<Part>, identity: &Identity, region: Region) -> Result<Channels<Content>, MergeError> {
    let scene = &identity.slabs;
    let Some((slabs, contents)) = merge_neighbours(parts, identity, region)? else {
        if !scene.is_empty() {
            return Err(missing(scene.clone(), region));
        }
        // A scene without slabs shows nothing.
        let empty = Content::empty(region.pixels(), identity.has_extremes());
        return Ok(Channels::new(empty.clone(), vec![empty; identity.images.saturating_sub(1)]));
    };
    if slabs.start > scene.start {
        return Err(missing(scene.start..slabs.start, region));
    }
    if slabs.end < scene.end {
        return Err(missing(slabs.end..scene.end, region));
    }
    Ok(contents)
}

fn missing(Range { start, end }: Range<i32>, region: Region) -> MergeError {
    MergeError::Missing { missing: format!("slabs {start}..{end} of region {region}") }
}

/// Slabs, and their content for every image that is added up.
type Merged = (Range<i32>, Channels<Content>);

/// The scene's slabs that parts of a region show without a gap, and their content; nothing if they show none.
///
/// Neighbours merge in pairs, again and again, so that processes that merge pairs get the same bytes.
fn merge_neighbours(parts: Vec<Part>, identity: &Identity, region: Region) -> Result<Option<Merged>, MergeError> {
    let within = |part: Part| {
        let slabs = Window::within(&part.window, &identity.slabs);
        (slabs, part.name, part.contents)
    };
    let mut shown: Vec<_> = parts.into_iter().map(within).filter(|(slabs, ..)| !slabs.is_empty()).collect();
    shown.sort_by_key(|(slabs, ..)| (slabs.start, slabs.end));
    for pair in shown.windows(2) {
        let ((before, other, _), (slabs, part, _)) = (&pair[0], &pair[1]);
        if slabs.start < before.end {
            let what = format!("slabs {}..{} of region {region}", slabs.start, slabs.end.min(before.end));
            return Err(MergeError::Overlap { part: part.clone(), what, other: other.clone() });
        }
        if slabs.start > before.end {
            return Err(missing(before.end..slabs.start, region));
        }
    }
    let rule = (identity.compositing, identity.classification);
    let mut merged: Vec<Merged> = shown.into_iter().map(|(slabs, _, contents)| (slabs, contents)).collect();
    while merged.len() > 1 {
        let mut rest = merged.into_iter();
        merged = std::iter::from_fn(|| {
            let (mut slabs, mut front) = rest.next()?;
            if let Some((behind, back)) = rest.next() {
                front.iter_mut().zip(&back).for_each(|(front, back)| front.merge(back, rule));
                slabs.end = behind.end;
            }
            Some((slabs, front))
        })
        .collect();
    }
    Ok(merged.pop())
}

//! The description by tifffile: the shape of all pages together, and perhaps the names of its axes, as JSON.

use std::path::Path;

use serde_json::Value;

use super::super::VolumeError;
use super::super::error::volume::invalid;
use super::super::series::MAX_CHANNELS;
use super::pages::Page;
use super::stack::{Axis, Stack};

/// The description's statement: `{"shape": [2, 5, 16, 20], "axes": "CZYX"}`.
#[derive(Debug, PartialEq)]
pub(super) struct Shaped {
    /// The lengths of the axes, the slowest one first; the last ones are those of a page.
    shape: Vec<u64>,
    /// A letter for each axis.
    axes: Option<String>,
    /// Whether the first page has the only directory, and all others follow its samples.
    pub(super) is_truncated: bool,
}

impl Shaped {
    /// `None` if the description is another one.
    pub(super) fn parse(description: &str) -> Option<Self> {
        let text = description.trim();
        // Before 2014.
        if let Some(shape) = text.strip_prefix("shape=(").and_then(|text| text.strip_suffix(')')) {
            let sizes = shape.split(',').map(str::trim).filter(|size| !size.is_empty());
            let shape = sizes.map(|size| size.parse().ok()).collect::<Option<_>>()?;
            return Some(Self { shape, axes: None, is_truncated: false });
        }
        if !(text.starts_with('{') && text.contains("\"shape\"")) {
            return None;
        }
        let value: Value = serde_json::from_str(text).ok()?;
        let shape = value.get("shape")?.as_array()?.iter().map(Value::as_u64).collect::<Option<Vec<_>>>()?;
        let axes = value.get("axes").and_then(Value::as_str).map(str::to_owned);
        let axes = axes.filter(|axes| axes.chars().count() == shape.len());
        let is_truncated = value.get("truncated").and_then(Value::as_bool).unwrap_or(false);
        Some(Self { shape, axes, is_truncated })
    }

    /// The order of the pages. `None` if the shape is that of one page, as where pages were written one by one, or of other pages.
    pub(super) fn stack(&self, path: &Path, page: Page) -> Result<Option<Stack>, VolumeError> {
        let [width, height, samples] = [page.size[0], page.size[1], page.samples].map(u64::from);
        let of_page = [&[height, width, samples][..], &[samples, height, width], &[height, width]];
        let Some(of_page) =
            of_page.into_iter().find(|of_page| (samples == 1 || of_page.len() == 3) && self.shape.ends_with(of_page))
        else {
            return Ok(None);
        };
        let letters = self.axes.as_deref().unwrap_or_default().chars().map(Some);
        let letters = letters.chain(std::iter::repeat(None));
        let before = &self.shape[..self.shape.len() - of_page.len()];
        let longer: Vec<(u64, Option<char>)> =
            before.iter().copied().zip(letters).filter(|&(size, _)| size != 1).collect();
        if longer.is_empty() {
            return Ok(None);
        }
        let shown = || {
            let axes = self.axes.as_deref().map(|axes| format!(" {axes}")).unwrap_or_default();
            format!("{:?}{axes}", self.shape)
        };
        let refused = || {
            invalid(
                path,
                "shape",
                shown(),
                format!("at most {} pages and {MAX_CHANNELS} channels, none of them empty", u32::MAX),
            )
        };
        let sizes: Option<Vec<u32>> =
            longer.iter().map(|&(size, _)| size.try_into().ok().filter(|&size| size > 0)).collect();
        let sizes = sizes.ok_or_else(refused)?;
        let axes = axes_of(&longer.iter().map(|&(_, letter)| letter).collect::<Vec<_>>());
        let mut stack = Stack::of_slices(1);
        match axes {
            Some(axes) => {
                // The axis that changes from page to page comes first.
                let mut order: Vec<Axis> = axes.iter().rev().copied().collect();
                order.extend(Stack::IMAGE_J.into_iter().filter(|axis| !axes.contains(axis)));
                stack.order = [order[0], order[1], order[2]];
                for (axis, &size) in axes.into_iter().zip(&sizes) {
                    match axis {
                        Axis::Slice => stack.slices = size,
                        Axis::Channel => stack.channels = size,
                        Axis::Time => stack.times = size,
                    }
                }
            }
            None => {
                let slices = sizes.iter().try_fold(1_u32, |product, &size| product.checked_mul(size));
                stack.slices = slices.ok_or_else(refused)?;
                let (path, slices) = (path.display(), stack.slices);
                log::warn!("{path}: the shape {}: its planes are taken to be {slices} slices", shown());
            }
        }
        if stack.pages().is_none() { Err(refused()) } else { Ok(Some(stack)) }
    }
}

/// The meaning of the axes before those of a page, by their letters; `None` if they do not tell. One axis that is none of time, channel and z is z.
fn axes_of(letters: &[Option<char>]) -> Option<Vec<Axis>> {
    let axes: Vec<Option<Axis>> = letters
        .iter()
        .map(|letter| match letter {
            Some('T') => Some(Axis::Time),
            Some('C') => Some(Axis::Channel),
            Some('Z') => Some(Axis::Slice),
            _ => None,
        })
        .collect();
    let has = |axis: Axis| axes.iter().filter(|&&other| other == Some(axis)).count();
    let unknown = axes.iter().filter(|axis| axis.is_none()).count();
    let is_told = has(Axis::Time) <= 1 && has(Axis::Channel) <= 1 && has(Axis::Slice) + unknown <= 1;
    is_told.then(|| axes.into_iter().map(|axis| axis.unwrap_or(Axis::Slice)).collect())
}

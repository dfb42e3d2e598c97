//! One pixel composited (SPEC §9).

use std::ops::Range;

use glam::DVec4;

use super::pixel::{Composited, Pixel, Slab};
use super::{extreme, surface};
use crate::reference::composite::composite_pixel;
use crate::settings::splatting::Order;

/// Compositing ends early when the pixel cannot change by more than this.
const REST: f64 = 1e-12;

/// A pixel composited from all slabs by the scene's rule, given in every channel. Where channels share no sheets there is one.
pub(super) fn composite(channels: &[Pixel]) -> Composited {
    let first = &channels[0];
    match first.frame.scene.splatting.compositing {
        compositing if compositing.has_surface() => surface::composite(first),
        compositing if compositing.is_choice() => extreme::composite(first),
        _ => composite_sheets(channels),
    }
}

/// Composites front to back; the other order gives the same image. A sheet is the sum of all channels' (SPEC §10), a slab's
/// one or two.
fn composite_sheets(channels: &[Pixel]) -> Composited {
    let first = &channels[0];
    let (compositing, wanted) = (first.frame.scene.splatting.compositing, first.frame.host.first_hit);
    let mut pixel = Composited::new(DVec4::ZERO, None);
    let slabs = first.slabs();
    let mut nears: Vec<Option<f64>> = channels.iter().map(|channel| channel.value(slabs.start)).collect();
    for k in slabs {
        let mut sums: Vec<(Range<f64>, DVec4)> = Vec::new();
        for (channel, near) in channels.iter().zip(&mut nears) {
            let far = channel.value(k + 1);
            let sheets = Slab::new(k, *near, far).map(|slab| channel.sheets(&slab)).unwrap_or_default();
            if sums.is_empty() {
                sums = sheets;
            } else {
                sums.iter_mut().zip(sheets).for_each(|((_, sum), (_, sheet))| *sum += sheet);
            }
            *near = far;
        }
        for (shown, sheet) in sums {
            let before = pixel.color.w;
            composite_pixel(&mut pixel.color, sheet, compositing, Order::FrontToBack);
            let after = pixel.color.w;
            if let Some(opacity) = wanted.filter(|&opacity| pixel.first_hit.is_none() && after >= opacity) {
                let share = if after > before { (opacity - before) / (after - before) } else { 0.0 };
                pixel.first_hit = Some(shown.start + (shown.end - shown.start) * share);
            }
        }
        let hit = wanted.is_none() || pixel.first_hit.is_some();
        if compositing.hides() && hit && pixel.color.w >= 1.0 - REST {
            break;
        }
    }
    pixel
}

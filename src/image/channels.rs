//! One image from those of single channels, where channels do not share sheets (SPEC §10).

use std::cmp::Ordering;

use crate::scene::image_settings::premultiplied;
use crate::settings::splatting::{Classification, Compositing};

/// How the images of channels become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Joining {
    /// Their sum, at most 1.
    Sum,
    /// At every pixel the nearest one, by first hits, or the mean of equally near ones. Each is opaque where it has a first hit.
    Nearest,
}

impl Joining {
    /// For some channels; `None` where they share sheets, or there is one.
    pub(crate) fn of_channels(count: usize, compositing: Compositing, classification: Classification) -> Option<Self> {
        Self::of(compositing, classification).filter(|_| count > 1)
    }

    /// `None` where channels share sheets.
    pub(crate) fn of(compositing: Compositing, classification: Classification) -> Option<Self> {
        let has_surface = compositing.has_surface() && classification == Classification::After;
        if compositing.is_choice() { Some(Self::Sum) } else { has_surface.then_some(Self::Nearest) }
    }

    /// The opacity whose depth is asked of every channel, if a host asks for one of the image: the nearest surface is the one with the nearest first hit, for
    /// any opacity.
    pub(crate) fn first_hit(self, asked: Option<f64>) -> Option<f64> {
        asked.or((self == Self::Nearest).then_some(1.0))
    }

    /// Adds a channel's pixels, which have no background, to those of the channels before it. First hits become the nearest ones; they may be
    /// empty for a sum.
    pub(crate) fn join<T: PartialOrd + Copy>(self, all: (&mut [[f32; 4]], &mut [T]), channel: (&[[f32; 4]], &[T])) {
        for (at, (pixel, new)) in all.0.iter_mut().zip(channel.0).enumerate() {
            let order = channel.1.get(at).zip(all.1.get(at)).and_then(|(new, old)| new.partial_cmp(old));
            if self == Self::Sum || order == Some(Ordering::Equal) {
                *pixel = std::array::from_fn(|channel| pixel[channel] + new[channel]);
            } else if order == Some(Ordering::Less) {
                *pixel = *new;
            }
            if order == Some(Ordering::Less) {
                all.1[at] = channel.1[at];
            }
        }
    }

    /// Makes joined pixels an image over a background of straight alpha.
    pub(crate) fn finish(self, pixels: &mut [[f32; 4]], background: [f64; 4]) {
        let background = premultiplied(background);
        for pixel in pixels {
            let joined = match self {
                Self::Sum => pixel.map(|channel| channel.min(1.0)),
                // Alpha counts the channels that are equally near.
                Self::Nearest => pixel.map(|channel| channel / pixel[3].max(1.0)),
            };
            *pixel = std::array::from_fn(|channel| joined[channel] + (1.0 - joined[3]) * background[channel]);
        }
    }
}

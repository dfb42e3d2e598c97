//! Classification after splatting (SPEC §9): values and gradients are splatted onto the slab planes, and what a pixel sees between two
//! planes is classified and shaded there.
//!
//! The method is from Mueller, Möller and Crawfis, *Splatting without the blur* (IEEE Visualization 1999). The transfer function is
//! integrated between planes as by Engel, Kraus and Ertl for slices (*High-quality pre-integrated volume rendering using
//! hardware-accelerated pixel shading*, Graphics Hardware 2001). The modules, in the order of the stages:
//!
//! - [`coefficients`]: `c = v` (`smooth`), or the c for which `f(v_j) = v_j` at every voxel (`exact`).
//! - [`field`]: `f = Σ c_i·g_i / N` with `g_i = exp(-falloff·|δ_i|²)`, `N = Σ g_i`, and `∇f`, on the slab planes ([`Frame::plane_field`]);
//!   [`low_pass`] transforms the offsets δ_i where pixels are large.
//! - [`slab_integral`]: `m̄ = mean of m`, `C̄ = ∫m·C / ∫m`, `v̄ = ∫m·v / ∫m` over the values of a segment: from plane to plane, or to the middle between them.
//! - [`pixel`]: the sheet `(C·m̄, m̄)·ℓ` with C the C̄ shaded by the gradient at v̄, ℓ the length of the pixel's ray ([`Frame::slab_sheet`]);
//!   its compositing; `extreme` and `surface` use the values themselves.
//!
//! Everything is computed pixel by pixel from the voxels around a point, in f64 and without tables, lists or culling. Each pixel has its
//! own ray, and rounding is the only approximation.

pub mod coefficients;
mod composite;
mod counts;
mod extreme;
pub mod field;
mod frame;
pub mod low_pass;
pub mod pixel;
pub mod slab_integral;
mod surface;

use std::sync::Arc;

use glam::{DVec4, UVec2};

use super::{Areas, Buffer, Culled, Host, Lights, resolve};
use crate::error::RenderError;
use crate::image::channels::Joining;
use crate::lists::classify::channels;
use crate::parallel::prelude::*;
use crate::part::{Content, Extreme};
use crate::scene::Scene;
use crate::settings::splatting::Classification;
use crate::settings::transfer_function::TransferFunction;
use crate::settings::window::{Region, Window};
use crate::volume::Volume;

pub use counts::count;
pub use field::Field;
pub use frame::Frame;
pub use pixel::{Composited, Pixel, Sample, Segment, Slab};

impl Frame<'_> {
    /// The pixel at a position counted from the upper left.
    pub fn pixel(&self, pixel: UVec2) -> Pixel<'_> {
        Pixel::new(self, pixel)
    }

    /// The field where the rays of all pixels meet a plane, row by row; `None` where there is no value.
    pub fn plane_field(&self, plane: i32) -> Vec<Option<Sample>> {
        self.each_pixel(|pixel| pixel.sample(plane))
    }

    /// The sheet of one of a slab's segments for all pixels.
    pub fn slab_sheet(&self, number: i32, segment: usize) -> Buffer {
        let sheet = |pixel: Pixel| {
            let sheets = pixel.slab(number).map(|slab| pixel.sheets(&slab)).unwrap_or_default();
            sheets.get(segment).map_or(DVec4::ZERO, |(_, sheet)| *sheet)
        };
        Buffer { width: self.geometry.size.x as usize, pixels: self.each_pixel(sheet) }
    }

    /// All pixels composited from this channel, row by row.
    pub fn composite(&self) -> Vec<Composited> {
        composite(std::slice::from_ref(self), &Region::whole(self.geometry.size.as_uvec2().to_array()))
    }

    fn each_pixel<T: Send>(&self, of: impl Fn(Pixel) -> T + Sync) -> Vec<T> {
        each_place_in(&Region::whole(self.geometry.size.as_uvec2().to_array()), |at| of(self.pixel(at)))
    }
}

/// The pixels of a region composited from all channels, row by row.
fn composite(frames: &[Frame], region: &Region) -> Vec<Composited> {
    let pixel = |at: UVec2| composite::composite(&frames.iter().map(|frame| frame.pixel(at)).collect::<Vec<_>>());
    each_place_in(region, pixel)
}

fn each_place_in<T: Send>(region: &Region, of: impl Fn(UVec2) -> T + Sync) -> Vec<T> {
    let Region { x, y, width, height } = *region;
    let pixels = (0..width * height).into_par_iter();
    pixels.map(|at| of(UVec2::new(x + at % width, y + at / width))).collect()
}

/// The pixels of a window composited from all channels, row by row.
fn composite_window(
    host: Host<'_>,
    (volume, transfer): (&Volume, &[TransferFunction]),
    (scene, lights): (&Scene, Option<&Arc<Lights>>),
    Window { slabs, region }: &Window,
) -> Result<Vec<Composited>, RenderError> {
    let mut frames = Frame::of_channels(host, volume, transfer, (scene, lights))?;
    frames.iter_mut().for_each(|frame| frame.slabs = slabs.clone());
    Ok(composite(&frames, region))
}

/// The pixels of a part that shows the nearest of the channels' surfaces (SPEC §10).
pub(super) fn nearest_part(
    volume: &Volume,
    transfer: &[TransferFunction],
    (scene, lights): (&Scene, Option<&Arc<Lights>>),
    window: &Window,
) -> Result<Content, RenderError> {
    // All channels share a camera.
    let scene = scene.framed(volume, transfer);
    let lights = Lights::or_new(lights, volume, transfer, &scene)?;
    let host = Host { first_hit: Some(1.0), ..Host::default() };
    let (mut colors, mut hits) = (vec![[0.0; 4]; window.region.pixels()], vec![f64::INFINITY; window.region.pixels()]);
    for (channel, transfer) in channels(volume, transfer) {
        let pixels =
            composite_window(host, (channel, std::slice::from_ref(transfer)), (&scene, Some(&lights)), window)?;
        let own = pixels.iter().map(|pixel| pixel.color.as_vec4().to_array()).collect::<Vec<_>>();
        let own_hits = pixels.iter().map(|pixel| pixel.first_hit.unwrap_or(f64::INFINITY)).collect::<Vec<_>>();
        Joining::Nearest.join((&mut colors, &mut hits), (&own, &own_hits));
    }
    Joining::Nearest.finish(&mut colors, [0.0; 4]);
    Ok(Content { colors, extremes: Vec::new() })
}

/// See [`super::part`].
pub(super) fn part(
    volume: &Volume,
    transfer: &[TransferFunction],
    (scene, lights): (&Scene, Option<&Arc<Lights>>),
    window: &Window,
) -> Result<Content, RenderError> {
    let pixels = composite_window(Host::default(), (volume, transfer), (scene, lights), window)?;
    let compositing = scene.splatting.compositing;
    let is_mean = |pixel: &Composited| compositing.is_average() && pixel.extreme.counted > Extreme::MIDDLE;
    // Means are classified where parts are merged.
    let color = |pixel: &Composited| if is_mean(pixel) { pixel.own.unwrap_or_default() } else { pixel.color };
    let colors = pixels.iter().map(|pixel| color(pixel).as_vec4().to_array()).collect();
    let extremes = pixels.iter().filter(|_| compositing.is_choice()).map(|pixel| pixel.extreme).collect();
    Ok(Content { colors, extremes })
}

/// Renders a scene as [`super::render_for`] does. Nothing is culled, and the order of compositing does not matter. `lights` are those of all channels, where one
/// of them is drawn by itself.
///
/// # Errors
/// If the scene needs more than can be computed.
pub(super) fn render_lit(
    host: Host<'_>,
    volume: &Volume,
    transfer: &[TransferFunction],
    (scene, lights): (&Scene, Option<&Arc<Lights>>),
) -> Result<Culled, RenderError> {
    let frames = Frame::of_channels(host, volume, transfer, (scene, lights))?;
    let pixels = composite(&frames, &Region::whole([scene.image.width, scene.image.height]));
    let acc = Buffer { width: scene.image.width as usize, pixels: pixels.iter().map(|pixel| pixel.color).collect() };
    let resolved_as = scene.splatting.compositing.finished_as(Classification::After);
    let image = resolve::resolve(&acc, (resolved_as, &scene.splatting), scene.image.background).into_image();
    let depth = |(at, pixel): (usize, &Composited)| {
        let at = UVec2::new((at % acc.width) as u32, (at / acc.width) as u32);
        pixel.first_hit.map_or(f64::INFINITY, |sheet| frames[0].pixel(at).depth(sheet))
    };
    let first_hits = match host.first_hit {
        Some(_) => pixels.iter().enumerate().map(depth).collect(),
        None => Vec::new(),
    };
    let sections = counts::count_in(&frames).sections_total;
    Ok(Culled { image, sections, areas: Areas::default(), first_hits })
}

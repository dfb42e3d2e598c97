//! Which rasterizer draws a view, and what it does not draw.

use wgpu::Device;

use crate::error::RenderError;
use crate::gpu::device::TILE_FEATURES;
use crate::pass::composite::RayMode;
use crate::pass::gather::WORKGROUP_BYTES;
use crate::setting_error::SettingError;
use crate::settings::splatting::{
    Compositing, Economies, FootprintBox, FootprintForm, Method, Order, Rasterizer, Splatting, check_first_hit,
};

/// Threads that a subgroup may have.
pub(super) const SUBGROUP_SIZES: std::ops::RangeInclusive<u32> = 8..=32;

/// How to draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    Quads,
    /// If the view fits.
    Tiles,
    Samples,
}

impl Way {
    /// That of some settings.
    ///
    /// # Errors
    /// If they insist on what the device or the other settings do not allow.
    pub(crate) fn of(device: &Device, splatting: &Splatting) -> Result<Self, RenderError> {
        let insists = insists_on_tiles(splatting);
        match (splatting.rasterizer, obstacle_to_tiles(device, splatting)) {
            (Rasterizer::Quads, _) if insists => {
                let found =
                    "\"quads\" with splatting.footprint_box = \"parallelogram\", whole_below, beta or resolution";
                Err(SettingError::new("splatting.rasterizer", found, "\"tiles\" or \"auto\" with them").into())
            }
            (Rasterizer::Tiles | Rasterizer::Auto, Some(obstacle)) if insists => Err(obstacle),
            _ if splatting.method == Method::CompositeEverySample => Ok(Self::Samples),
            (Rasterizer::Tiles | Rasterizer::Auto, None) => Ok(Self::Tiles),
            _ => Ok(Self::Quads),
        }
    }
}

/// Why a device or some settings cannot be drawn by tiles; `None` if they can.
fn obstacle_to_tiles(device: &Device, splatting: &Splatting) -> Option<RenderError> {
    let refused = |found: String, allowed: &'static str| {
        Some(SettingError::new("splatting.rasterizer", format!("\"tiles\" with {found}"), allowed).into())
    };
    if splatting.method == Method::CompositeEverySample {
        let found = "splatting.method = \"composite-every-sample\"".to_owned();
        return refused(found, "\"image-aligned\" or \"axis-aligned\" with it, or \"quads\"");
    }
    if splatting.footprint != FootprintForm::SummedArea {
        return refused("splatting.footprint = \"sections\"".to_owned(), "\"summed-area\" with it, or \"quads\"");
    }
    if !device.features().contains(TILE_FEATURES) {
        return refused("a device without subgroups, or barriers for them".to_owned(), "\"quads\"");
    }
    let info = device.adapter_info();
    let sizes = [info.subgroup_min_size, info.subgroup_max_size];
    if sizes.iter().any(|size| !SUBGROUP_SIZES.contains(size)) {
        let found = format!("subgroups of {} to {} threads", sizes[0], sizes[1]);
        return refused(found, "subgroups of 8 to 32 threads, or \"quads\"");
    }
    let bytes = device.limits().max_compute_workgroup_storage_size;
    if bytes < WORKGROUP_BYTES {
        return refused(format!("max_compute_workgroup_storage_size of {bytes}"), "at least 16384, or \"quads\"");
    }
    None
}

/// Whether quads will not do.
pub(crate) fn insists_on_tiles(splatting: &Splatting) -> bool {
    splatting.rasterizer == Rasterizer::Tiles
        || splatting.footprint_box == FootprintBox::Parallelogram
        || splatting.economies != Economies::default()
}

/// Checks that the settings allow what of rays is looked at.
///
/// # Errors
/// If they do not, or first hits are more than a binding.
pub(crate) fn check_rays(
    device: &Device,
    splatting: &Splatting,
    rays: RayMode,
    first_hit: Option<f64>,
    [width, height]: [u32; 2],
) -> Result<(), RenderError> {
    let refused = |key, found: &str, allowed: &str| Err(SettingError::new(key, found, allowed).into());
    if splatting.method == Method::CompositeEverySample && rays != RayMode::default() {
        let found = "\"composite-every-sample\" with clip planes, surfaces or first hits";
        return refused("splatting.method", found, "a method with sheets");
    }
    let Some(opacity) = first_hit else { return Ok(()) };
    if splatting.compositing == Compositing::Minimum {
        let allowed = "another one: the least is known at the end of a ray";
        return refused("splatting.compositing", "\"minimum\" with first hits", allowed);
    }
    check_first_hit(opacity)?;
    if splatting.culling && splatting.compositing.hides() && opacity > splatting.opacity_threshold {
        let allowed = format!("above 0, at most {}, the opacity_threshold", splatting.opacity_threshold);
        return Err(SettingError::new("first_hit", opacity, allowed).into());
    }
    if splatting.order != Order::FrontToBack {
        return refused("splatting.order", "\"back-to-front\" with first hits", "\"front-to-back\"");
    }
    let limits = device.limits();
    let actual = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let required = 4 * u64::from(width) * u64::from(height);
    if required > actual {
        let (what, limit) = ("the image's first hits", "max_storage_buffer_binding_size");
        return Err(RenderError::Limit { what, limit, required, actual });
    }
    Ok(())
}

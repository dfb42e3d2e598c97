//! The choice of the rasterizer for a view, and what each one refuses.

use wgpu::{Backend, Device, Features};

use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::pass::composite::RayMode;
use crate::pass::gather::{MOST_LAYERS, WORKGROUP_BYTES};
use crate::settings::splatting::{Classification, FootprintBox, FootprintForm, Method, Rasterizer, Splatting};

/// Whether tiles are compiled in: browsers' compilers refuse their barriers, and a page's code must be short.
pub(crate) const HAS_TILES: bool = cfg!(not(target_arch = "wasm32"));

/// The rasterizer of a frame, which follows from the [`Rasterizer`] that the scene and the renderer name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RasterizerKind {
    Quads,
    /// Tiles, if the view fits. A view that does not fit is an error if tiles are required; otherwise quads draw it.
    Tiles {
        insisted: bool,
    },
    Samples,
}

impl RasterizerKind {
    /// The rasterizer for some settings and the number of channels that share sheets; if it is quads only because of the device, also the reason. `preferred` is the
    /// renderer's choice, for settings that do not name one.
    ///
    /// # Errors
    /// If the settings require what the device or the other settings do not allow.
    pub(crate) fn of(
        device: &Device,
        splatting: &Splatting,
        channels: usize,
        preferred: Rasterizer,
    ) -> Result<(Self, Option<RenderError>), RenderError> {
        let needs_tiles =
            splatting.footprint_box == FootprintBox::Parallelogram || splatting.experimental.in_use().is_some();
        let choice = match splatting.rasterizer {
            Rasterizer::Auto if !needs_tiles => preferred,
            choice => choice,
        };
        let insisted = needs_tiles || choice == Rasterizer::Tiles;
        let by_settings = obstacle_in_settings(splatting, channels);
        let is_by_settings = by_settings.is_some();
        match (choice, by_settings.or_else(|| obstacle_in_device(device))) {
            (Rasterizer::Quads, _) if needs_tiles => {
                let setting = match splatting.experimental.in_use() {
                    Some(economy) => economy.to_string(),
                    None => "splatting.footprint_box = \"parallelogram\"".to_owned(),
                };
                let found = format!("\"quads\" with {setting}");
                Err(SettingError::new("splatting.rasterizer", found, "\"tiles\" or \"auto\" with it").into())
            }
            (Rasterizer::Tiles | Rasterizer::Auto, Some(obstacle)) if insisted => Err(obstacle),
            _ if splatting.method == Method::CompositeEverySample => Ok((Self::Samples, None)),
            (Rasterizer::Tiles | Rasterizer::Auto, None) => Ok((Self::Tiles { insisted }, None)),
            (Rasterizer::Auto, Some(obstacle)) if !is_by_settings => Ok((Self::Quads, Some(obstacle))),
            _ => Ok((Self::Quads, None)),
        }
    }
}

fn refused_tiles(found: String, allowed: &str) -> Option<RenderError> {
    Some(SettingError::new("splatting.rasterizer", format!("\"tiles\" with {found}"), allowed).into())
}

/// Why tiles cannot draw with these settings and this number of channels; `None` if they can.
fn obstacle_in_settings(splatting: &Splatting, channels: usize) -> Option<RenderError> {
    let is_after = splatting.classification == Classification::After;
    if is_after && channels > MOST_LAYERS {
        let found = format!("splatting.classification = \"after\" and {channels} channels");
        return refused_tiles(found, &format!("at most {MOST_LAYERS}, \"before\" with them, or \"quads\""));
    }
    if splatting.method == Method::CompositeEverySample {
        let found = "splatting.method = \"composite-every-sample\"".to_owned();
        return refused_tiles(found, "\"image-aligned\" or \"axis-aligned\" with it, or \"quads\"");
    }
    if splatting.footprint != FootprintForm::SummedArea {
        return refused_tiles("splatting.footprint = \"sections\"".to_owned(), "\"summed-area\" with it, or \"quads\"");
    }
    None
}

/// Why a device does not support tiles; `None` if it does.
fn obstacle_in_device(device: &Device) -> Option<RenderError> {
    let bytes = device.limits().max_compute_workgroup_storage_size;
    obstacle_in(device.adapter_info().backend, device.features(), bytes)
}

/// The same, given the device's API, its features, and its bytes of workgroup memory.
fn obstacle_in(backend: Backend, features: Features, bytes: u32) -> Option<RenderError> {
    // Without subgroups tiles have barriers in loops that all threads leave together. Two compilers refuse barriers unless they can prove that, and cannot prove it:
    // that of browsers, and FXC, DirectX 12's old one, by which a device has no subgroups.
    let needs_proof = matches!(backend, Backend::Dx12 | Backend::BrowserWebGpu);
    if !HAS_TILES || needs_proof && !features.contains(Features::SUBGROUP) {
        return refused_tiles(format!("{backend:?} without subgroups"), "\"quads\"");
    }
    if bytes < WORKGROUP_BYTES {
        return refused_tiles(format!("max_compute_workgroup_storage_size of {bytes}"), "at least 16384, or \"quads\"");
    }
    None
}

/// Checks that first hits, if there are any, fit one binding.
///
/// # Errors
/// If they do not.
pub(crate) fn check_hits(device: &Device, rays: RayMode, [width, height]: [u32; 2]) -> Result<(), RenderError> {
    let limits = device.limits();
    let actual = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let required = 4 * u64::from(width) * u64::from(height);
    if rays.first_hit && required > actual {
        let (what, limit) = ("the image's first hits", "max_storage_buffer_binding_size");
        return Err(RenderError::Limit { what, limit, required, actual });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_need_subgroups_only_where_barriers_must_be_proved() {
        let none = Features::empty();
        for (backend, features, bytes) in [
            (Backend::Vulkan, none, 16384),
            (Backend::Metal, none, 32768),
            (Backend::Gl, none, 16384),
            (Backend::Dx12, Features::SUBGROUP, 16384),
        ] {
            assert!(obstacle_in(backend, features, bytes).is_none(), "{backend:?}");
        }
        for (backend, features, bytes, words) in [
            (Backend::Dx12, none, 32768, ["Dx12 without subgroups", "\"quads\""]),
            (Backend::BrowserWebGpu, none, 32768, ["without subgroups", "\"quads\""]),
            (Backend::Vulkan, Features::SUBGROUP, 16383, ["16383", "16384"]),
        ] {
            let message = obstacle_in(backend, features, bytes).map(|error| error.to_string()).unwrap_or_default();
            words.iter().for_each(|word| assert!(message.contains(word), "no {word:?} in {message:?}"));
        }
    }
}

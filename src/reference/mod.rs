//! The f64 evaluation of every GPU stage, as the specification states it: plain and slow, without the tables, the bucket sort and the
//! matrices of eqs. 4–11. Tests compare every stage with it; `sheetsplat render --backend reference` shows its images.

pub mod after;
mod before;
mod buffer;
pub mod composite;
mod culled;
pub mod cut;
mod first_hit;
pub mod footprint;
mod framed;
pub mod geometry;
mod host;
pub mod light;
pub mod means;
pub mod membership;
mod opacity;
pub mod ray_march;
pub mod resolve;
mod section;
pub mod shading;
pub mod sheets;
pub mod splat;
pub mod visibility;

use std::slice::from_ref;
use std::sync::Arc;

use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::image::Image;
use crate::image::channels::Joining;
use crate::lists::classify::channels;
use crate::part::Content;
use crate::scene::Scene;
use crate::settings::splatting::Classification;
use crate::settings::transfer_function::TransferFunction;
use crate::settings::window::Window;
use crate::stats::Counts;
use crate::volume::Volume;

pub use buffer::Buffer;
pub use culled::Culled;
pub use cut::Cuts;
use framed::framed;
pub use geometry::Geometry;
pub use host::Host;
pub use light::Lights;
pub use means::Means;
pub use section::{Section, Splat};
pub use visibility::Areas;

/// Renders the scene's camera, image, shading and splatting settings over a volume, with nothing culled.
///
/// # Errors
/// If the scene needs more than can be computed.
pub fn render(volume: &Volume, transfer: &[TransferFunction], scene: &Scene) -> Result<Image, RenderError> {
    render_culled(volume, transfer, scene, None).map(|culled| culled.image)
}

/// The counts of what [`render`] draws. Voxels composited one by one count as one section each, and have neither sheets nor tiles.
///
/// # Errors
/// If the scene needs more than can be computed.
pub fn count(volume: &Volume, transfer: &[TransferFunction], scene: &Scene) -> Result<Counts, RenderError> {
    let classification = scene.classification(volume);
    if joining(volume, transfer, scene).is_some() {
        let scene = scene.framed(volume, transfer);
        let mut counts = channels(volume, transfer).map(|(volume, of)| count(volume, from_ref(of), &scene));
        let mut all = counts.next().unwrap_or_else(|| Ok(Counts::default()))?;
        for of_channel in counts {
            all.add_channel(&of_channel?);
        }
        return Ok(all);
    }
    if classification == Classification::After {
        return after::count(volume, transfer, scene);
    }
    before::count(volume, transfer, scene)
}

/// Renders with early splat elimination by one of the paper's tests, sheet by sheet, and counts what is drawn. Nothing is culled back to
/// front, where nothing hides ([`Compositing::hides`](crate::settings::Compositing::hides)), and where voxels are composited one by one.
///
/// # Errors
/// If the scene needs more than can be computed.
pub fn render_culled(
    volume: &Volume,
    transfer: &[TransferFunction],
    scene: &Scene,
    test: Option<visibility::Test>,
) -> Result<Culled, RenderError> {
    render_for(Host::default(), volume, transfer, scene, test)
}

/// Like [`render_culled`], between a host's surfaces. Voxels composited one by one ignore surfaces and clip planes.
///
/// # Errors
/// If the scene needs more than can be computed.
pub fn render_for(
    host: Host<'_>,
    volume: &Volume,
    transfer: &[TransferFunction],
    scene: &Scene,
    test: Option<visibility::Test>,
) -> Result<Culled, RenderError> {
    render_lit(host, volume, transfer, (scene, None), test)
}

/// [`render_for`]; `lights` are those of all channels, where one of them is drawn by itself.
fn render_lit(
    host: Host<'_>,
    volume: &Volume,
    transfer: &[TransferFunction],
    (scene, lights): (&Scene, Option<&Arc<Lights>>),
    test: Option<visibility::Test>,
) -> Result<Culled, RenderError> {
    let classification = scene.classification(volume);
    if let Some(joining) = joining(volume, transfer, scene) {
        return render_joined(host, volume, transfer, scene, test, joining);
    }
    if classification == Classification::After {
        return after::render_lit(host, volume, transfer, (scene, lights));
    }
    before::render_for(host, volume, transfer, (scene, lights), test)
}

/// How the images of the channels that are drawn become one; `None` if they share sheets, or there is one.
fn joining(volume: &Volume, transfer: &[TransferFunction], scene: &Scene) -> Option<Joining> {
    let (count, compositing) = (channels(volume, transfer).count(), scene.splatting.compositing);
    Joining::of_channels(count, compositing, scene.classification(volume))
}

/// Renders every channel by itself, and joins the images (SPEC §10).
fn render_joined(
    host: Host<'_>,
    volume: &Volume,
    transfer: &[TransferFunction],
    scene: &Scene,
    test: Option<visibility::Test>,
    joining: Joining,
) -> Result<Culled, RenderError> {
    // All channels share a camera.
    let mut scene = framed(volume, transfer, scene)?;
    let lights = Arc::new(Lights::new(volume, transfer, &scene)?);
    let background = std::mem::replace(&mut scene.image.background, [0.0; 4]);
    let of_channel = Host { first_hit: joining.first_hit(host.first_hit), ..host };
    let mut all: Option<Culled> = None;
    for (volume, transfer) in channels(volume, transfer) {
        let channel = render_lit(of_channel, volume, from_ref(transfer), (&scene, Some(&lights)), test)?;
        let Some(all) = &mut all else {
            all = Some(channel);
            continue;
        };
        let joined = (&mut all.image.pixels[..], &mut all.first_hits[..]);
        joining.join(joined, (&channel.image.pixels, &channel.first_hits));
        all.sections += channel.sections;
        all.areas.join(&channel.areas);
    }
    let mut all = all.ok_or_else(|| SettingError::new("channel", "none", "at least one"))?;
    joining.finish(&mut all.image.pixels, background);
    if host.first_hit.is_none() {
        all.first_hits.clear();
    }
    Ok(all)
}

/// The pixels of a part of a scene's image, before the background (SPEC §11). Nothing is culled. The window has no end where it reaches an end
/// of the scene. `lights` are those of all channels, or of the whole volume of a box, if they are not the volume's own.
///
/// # Errors
/// If the scene needs more than can be computed.
pub fn part(
    volume: &Volume,
    transfer: &[TransferFunction],
    (scene, lights): (&Scene, Option<&Arc<Lights>>),
    window: &Window,
) -> Result<Content, RenderError> {
    let classification = scene.classification(volume);
    if joining(volume, transfer, scene) == Some(Joining::Nearest) {
        return after::nearest_part(volume, transfer, (scene, lights), window);
    }
    if classification == Classification::After {
        return after::part(volume, transfer, (scene, lights), window);
    }
    before::part(volume, transfer, (scene, lights), window)
}

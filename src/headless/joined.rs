//! Channels that share no sheets (SPEC §10): the image of each by itself, and their sum, or parts of it.

use web_time::Instant;

use super::Headless;
use super::boxed::opaque_values;
use super::given_light::{GivenLight, Noted};
use super::timed::milliseconds_since;
use super::view::HeadlessView;
use crate::error::RenderError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::image::Image;
use crate::image::channels::Joining;
use crate::part::{self, Content, Identity, Part};
use crate::rendering::Rendering;
use crate::scene::{ImageSettings, OpenVolume, Scene};
use crate::settings::window::Window;
use crate::stats::{Counts, Stats, StoreCounts};
use crate::volume::{Channels, StreamedVolume};

/// Draws a frame of channels whose images add up, of a volume that is streamed.
pub(super) fn draw(
    (volume, scene): (&StreamedVolume, &Scene),
    light: Option<&GivenLight>,
    headless: &Headless,
) -> Result<Rendering, RenderError> {
    let explicit = scene.explicit(&volume.sample);
    let ImageSettings { width, height, background } = explicit.image;
    let mut pixels = vec![[0.0; 4]; width as usize * height as usize];
    let stats = each_channel(headless, (&volume.clone().into(), &explicit), light, |view| {
        let Some(view) = view else { return Ok(None) };
        let Rendering { image, stats } = headless.draw(view)?;
        Joining::Sum.join((&mut pixels, &mut [0.0; 0]), (&image.pixels, &[]));
        Ok(Some(stats))
    })?;
    Joining::Sum.finish(&mut pixels, background);
    Ok(Rendering { image: Image { width, height, pixels }, stats })
}

/// Draws a part of every channel's image. Merging adds these up.
pub(super) fn draw_part(
    (volume, scene): (&OpenVolume, &Scene),
    (window, light): (&Window, Option<&GivenLight>),
    headless: &Headless,
) -> Result<(Part, Stats), RenderError> {
    part::check(volume.sample(), scene, window)?;
    let explicit = scene.explicit(volume.sample());
    let ImageSettings { width, height, .. } = explicit.image;
    let view = ViewGeometry::new(volume.grid(), &explicit.camera, &explicit.splatting, [width, height])?;
    let identity = Identity::of((volume, scene), &view)?;
    let mut contents = Vec::new();
    let stats = each_channel(headless, (volume, &explicit), light, |view| {
        let Some(view) = view else {
            contents.push(Content::empty(window.region.pixels(), identity.has_extremes()));
            return Ok(None);
        };
        let (drawn, stats) = headless.draw_part(view, window)?;
        contents.extend(drawn.contents);
        Ok(Some(stats))
    })?;
    // A volume has a channel.
    let contents = Channels::of(contents).unwrap_or_else(|| Content::default().into());
    Ok((Part::named(identity, window.clone(), contents), stats))
}

/// Draws every channel by itself, without a background, where it has an opacity, given a scene with everything stated. Returns the statistics of all together.
fn each_channel(
    headless: &Headless,
    (volume, explicit): (&OpenVolume, &Scene),
    light: Option<&GivenLight>,
    mut draw: impl FnMut(Option<&mut HeadlessView>) -> Result<Option<Stats>, RenderError>,
) -> Result<Stats, RenderError> {
    let start = Instant::now();
    let ImageSettings { width, height, .. } = explicit.image;
    // Nothing may have an opacity.
    let backend = headless.backend().name().to_owned();
    let counts = Counts { voxels_total: volume.grid().voxels(), ..Counts::default() };
    let mut all = Stats { width, height, backend, counts, ..Stats::default() };
    let mut store = StoreCounts::default();
    let light = match light {
        Some(light) => Some((light.clone(), Noted::Nothing)),
        None => GivenLight::of_channels((volume, explicit), headless.backend())?,
    };
    for (number, transfer) in explicit.resolve(volume.sample()).iter().enumerate() {
        if opaque_values(transfer).ranges().is_empty() {
            draw(None)?;
            continue;
        }
        let mut by_itself = explicit.of_channels(&[number]);
        by_itself.image.background = [0.0; 4];
        let begin = Instant::now();
        let mut view = headless.view(volume.of_channel(number), &by_itself)?;
        if let Some((light, _)) = &light {
            view.set_light(light);
        }
        let classify_ms = milliseconds_since(begin);
        let Some(stats) = draw(Some(&mut view))? else { continue };
        let mut counts = all.counts;
        counts.add_channel(&stats.counts);
        all = Stats { counts, prepare_ms: all.prepare_ms + classify_ms + stats.prepare_ms, ..stats };
        let own = all.store.unwrap_or_default();
        store.chunks_read += own.chunks_read;
        store.bytes_read += own.bytes_read;
        store.chunk_bytes = store.chunk_bytes.max(own.chunk_bytes);
    }
    let store = match volume {
        OpenVolume::Whole(volume) => volume.reads(),
        OpenVolume::Streamed(volume) => {
            (store.level, store.chunks_total) = (volume.level() as u64, volume.chunks());
            Some(volume.with_sample(store))
        }
    };
    let all = Stats { store, frame_ms: milliseconds_since(start), ..all };
    Ok(match light {
        Some((_, noted)) => noted.noted_in(all),
        None => all,
    })
}

//! Channels that share no sheets (SPEC §10): the image of each by itself, and their sum.

use web_time::Instant;

use super::channel::opaque_values;
use super::{Headless, milliseconds_since};
use crate::error::RenderError;
use crate::image::Image;
use crate::image::channels::Joining;
use crate::rendering::Rendering;
use crate::scene::{ImageSettings, Scene};
use crate::stats::{Counts, Stats, StoreCounts};
use crate::volume::StreamedVolume;

/// Draws a frame of channels whose images add up.
pub(super) fn draw(volume: &StreamedVolume, scene: &Scene, headless: &Headless) -> Result<Rendering, RenderError> {
    let start = Instant::now();
    let explicit = scene.explicit(&volume.sample);
    let ImageSettings { width, height, background } = explicit.image;
    let mut pixels = vec![[0.0; 4]; width as usize * height as usize];
    // Nothing may have an opacity.
    let backend = headless.backend().name().to_owned();
    let counts = Counts { voxels_total: volume.grid().voxels(), ..Counts::default() };
    let mut all = Stats { width, height, backend, counts, ..Stats::default() };
    let mut store = StoreCounts::default();
    for (number, transfer) in explicit.resolve(&volume.sample).channels().enumerate() {
        if opaque_values(transfer).ranges().is_empty() {
            continue;
        }
        let mut by_itself = explicit.of_channels(&[number]);
        by_itself.image.background = [0.0; 4];
        let Rendering { image, stats } = headless.render_volume(volume.of_channel(number), &by_itself)?;
        Joining::Sum.join((&mut pixels, &mut [0.0; 0]), (&image.pixels, &[]));
        let mut counts = all.counts;
        counts.add_channel(&stats.counts);
        all = Stats { counts, prepare_ms: all.prepare_ms + stats.prepare_ms, ..stats };
        let own = all.store.unwrap_or_default();
        store.chunks_read += own.chunks_read;
        store.bytes_read += own.bytes_read;
        store.chunk_bytes = store.chunk_bytes.max(own.chunk_bytes);
    }
    Joining::Sum.finish(&mut pixels, background);
    let store = StoreCounts { level: volume.level() as u64, chunks_total: volume.chunks(), ..store };
    let stats = Stats { store: Some(volume.with_sample(store)), frame_ms: milliseconds_since(start), ..all };
    Ok(Rendering { image: Image { width, height, pixels }, stats })
}

//! Loading and drawing whose times are counted.

use web_time::Instant;

use super::Error;
use crate::error::RenderError;
use crate::rendering::Rendering;
use crate::scene::Scene;
use crate::volume::VolumeError;

/// Opens a scene's volume and renders it by `render_volume`; the statistics hold the time of loading.
pub(super) fn load_and_render<V>(
    scene: &Scene,
    open: impl FnOnce(&Scene) -> Result<V, VolumeError>,
    render_volume: impl FnOnce(V) -> Result<Rendering, RenderError>,
) -> Result<Rendering, Error> {
    let start = Instant::now();
    let volume = opened(scene, open)?;
    let load_ms = milliseconds_since(start);
    let mut rendering = render_volume(volume)?;
    rendering.stats.load_ms = load_ms;
    Ok(rendering)
}

/// Opens a scene's volume. An invalid scene is refused before its volume is read.
pub(super) fn opened<V>(scene: &Scene, open: impl FnOnce(&Scene) -> Result<V, VolumeError>) -> Result<V, Error> {
    scene.check().map_err(RenderError::from)?;
    Ok(open(scene)?)
}

/// Sets up a view and draws its first frame; the statistics count the set-up as preparation.
pub(super) fn view_and_draw<View>(
    view: impl FnOnce() -> Result<View, RenderError>,
    draw: impl FnOnce(&mut View) -> Result<Rendering, RenderError>,
) -> Result<Rendering, RenderError> {
    let start = Instant::now();
    let mut view = view()?;
    let classify_ms = milliseconds_since(start);
    let mut rendering = draw(&mut view)?;
    rendering.stats.prepare_ms += classify_ms;
    Ok(rendering)
}

pub(super) fn milliseconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

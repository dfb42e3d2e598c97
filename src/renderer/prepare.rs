//! The preparing of frames: buffers are written, and allocated again where they no longer fit.

use wgpu::{Buffer, Device, Queue};

use super::Renderer;
use super::buffers::{
    control_points, cut_uniform, frame_uniform, frame_values, joined_hits, needs_of, staging, timestamps_at,
};
use crate::error::RenderError;
use crate::gpu::bindings::{BufferSpec, grown, written};
use crate::gpu::classified_volume::{ClassifiedVolume, Layer};
use crate::gpu::counts::{self, Staging};
use crate::gpu::light_texture::{self, LightTexture};
use crate::gpu::targets::{CompositingBuffer, no_surfaces};
use crate::gpu::timer::Timer;
use crate::gpu::uniforms;
use crate::image::channels::Joining;
use crate::pass::composite::CutBuffers;
use crate::pass::first_hit::FirstHit;
use crate::pass::join::{JoinBuffers, JoinMode};
use crate::rasterizer::FrameInputs;
use crate::rasterizer::fields::FieldRasterizer;
use crate::rasterizer::kind::{HAS_TILES, RasterizerKind};
use crate::rasterizer::quads::QuadRasterizer;
use crate::rasterizer::request::FrameRequest;
use crate::rasterizer::samples::SampleRasterizer;
use crate::renderer::prepared_frame::{Drawing, FirstHits, Joined, PreparedFrame, PreparedLayer, PreviousFrame};
use crate::renderer::scene_view::{Prepared, SceneView};
use crate::scene::Scene;
use crate::settings::splatting::Compositing;

impl Renderer {
    /// One request for each layer of a view, whose images are joined if there are several.
    pub(super) fn requests(
        &self,
        view: &SceneView,
        layers: &[Layer],
        joining: Option<Joining>,
    ) -> Result<Vec<FrameRequest>, RenderError> {
        let SceneView { volume, scene, hiding, first_hit, window, .. } = view;
        let camera = view.camera();
        let request = |layer| {
            let host = (hiding.as_ref(), *first_hit, window.as_ref());
            FrameRequest::new(&self.device, (volume, layer, joining), (scene, &camera), host, self.rasterizer)
        };
        layers.iter().map(request).collect()
    }

    /// See [`Self::prepare`].
    pub(super) fn prepare_unscoped(
        &self,
        device: &Device,
        queue: &Queue,
        view: &mut SceneView,
    ) -> Result<Prepared, RenderError> {
        // Everything that can fail comes before anything is taken from the last frame.
        let (layers, joining) = view.volume.layers();
        let mut requests = self.requests(view, &layers, joining)?;
        let lights = view.lights()?;
        let SceneView { volume, scene, hiding, first_hit, frame, light_texture, .. } = view;
        *light_texture = match &lights {
            Some(lights) => Some(LightTexture::renewed(device, queue, lights, light_texture.take())?),
            None => None,
        };
        let light = light_texture.as_ref().map(|texture| &texture.view);
        let mut fallback = requests.iter_mut().find_map(|request| request.fallback.take());
        if let Some(needs) = needs_of(&requests[0]) {
            volume.show(needs);
        }
        volume.flush(device, queue)?;
        let sheets = (self.sheet_format, self.sheets);
        let first = &requests[0];
        let (seen, bands, size) = (first.view, &first.bands, first.view.size);
        let kept = PreviousFrame::of(frame.take(), sheets, &seen, (&layers, bands));
        let grid = *volume.grid();
        let compositing = kept.compositing.unwrap_or_else(|| CompositingBuffer::new(device, size, bands));
        let write = |old, spec: &BufferSpec, bytes: &[u8]| written(device, queue, old, spec, bytes);
        let cut_values = uniforms::cut(&seen, &grid, scene, first.surfaces, first.first_hit, &first.window);
        let cut = write(kept.cut, &cut_uniform(), bytemuck::bytes_of(&cut_values))?;
        let cut_buffers = CutBuffers {
            uniform: &cut,
            surfaces: match hiding {
                Some(hiding) => hiding.depth(),
                None => self.no_surfaces.get_or_init(|| no_surfaces(device)),
            },
        };

        let mut old_layers = kept.layers.into_iter();
        let mut prepared = Prepared::default();
        let mut is_other_rasterizer = false;
        let mut drawn_layers = Vec::new();
        for request in &requests {
            let old = old_layers.next().unwrap_or_default();
            let points = bytemuck::cast_slice(&request.ramps.points);
            let control_points = write(old.control_points, &control_points(request), points)?;
            let mut values = frame_values(volume, request, scene);
            if let Some(lights) = &lights {
                light_texture::note(&mut values, lights);
            }
            let uniform = write(old.uniform, &frame_uniform(), bytemuck::bytes_of(&values))?;
            let inputs = FrameInputs {
                device,
                queue,
                volume,
                request,
                frame: &uniform,
                control_points: &control_points,
                compositing: &compositing,
                cut: cut_buffers,
                light,
            };
            let was = old.drawing.as_ref().map(Drawing::rasterizer);
            let (drawing, of_layer, too_much) = self.draw_with(inputs, old.drawing)?;
            fallback = fallback.or(too_much);
            prepared.bucketed |= of_layer.bucketed;
            prepared.tabled |= of_layer.tabled;
            is_other_rasterizer |= was != Some(drawing.rasterizer());
            drawn_layers.push(PreparedLayer { layer: request.layer.clone(), drawing, uniform, control_points });
        }
        if let Some(reason) = &fallback {
            self.fell_back.call_once(|| {
                log::warn!("drawn by quads, which may take longer than by tiles: {reason}");
            });
        }
        let totals = kept.totals.filter(|_| !prepared.bucketed && !is_other_rasterizer);
        let joined = match joining {
            Some(joining) => {
                let buffers = (&compositing, cut_buffers);
                Some(self.joined(
                    (device, queue),
                    joining,
                    (volume, first, scene),
                    buffers,
                    &drawn_layers,
                    kept.joined,
                )?)
            }
            None => None,
        };

        let hit_words = match &joined {
            Some(joined) => Some((&joined.hits, 0)),
            None => drawn_layers[0].drawing.first_hits(),
        };
        let image_uniform = joined.as_ref().map_or(&drawn_layers[0].uniform, |joined| &joined.uniform);
        let first_hits = hit_words.filter(|_| first_hit.is_some()).map(|words| {
            let stage = self.first_hit.get_or_init(|| FirstHit::new(device));
            let texture = kept.first_hits.unwrap_or_else(|| FirstHit::texture(device, size));
            let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
            FirstHits { group: stage.bind(device, image_uniform, cut_buffers, words), texture, view }
        });

        // The layers' passes, those that join their images, and resolve.
        let joins = if joined.is_some() { drawn_layers.len() } else { 0 };
        let passes = drawn_layers.iter().map(|layer| layer.drawing.passes()).sum::<usize>() + joins + 1;
        let timer = if self.profile { Timer::new(device, passes) } else { None };
        let count_bytes = |layer: &PreparedLayer| counts::count_bytes(layer.drawing.group_slabs().firsts.len());
        let timestamps = timestamps_at(drawn_layers.iter().map(count_bytes).sum());
        let staging = grown(device, kept.staging, &staging(timestamps, timer.is_some(), passes))?;
        let of_layers: u64 = drawn_layers.iter().map(PreparedLayer::gpu_bytes).sum();
        let shared_bytes = compositing.gpu_bytes()
            + joined.as_ref().map_or(0, Joined::gpu_bytes)
            + [&cut, &staging].map(Buffer::size).iter().sum::<u64>()
            + if first_hits.is_some() { first.hit_bytes() } else { 0 }
            + timer.as_ref().map_or(0, Timer::gpu_bytes)
            + light_texture.as_ref().map_or(0, |texture| texture.gpu_bytes);
        let image = joined.as_ref().map_or(&compositing, |joined| &joined.compositing);
        let resolve_groups = image.bands.iter().map(|band| self.resolve.bind(device, image_uniform, band)).collect();
        *frame = Some(PreparedFrame {
            gpu_bytes: volume.gpu_bytes() + of_layers + shared_bytes,
            sheets,
            resolve_groups,
            view: seen,
            layers: drawn_layers,
            fallback,
            compositing,
            joined,
            cut,
            first_hits,
            timer,
            totals,
            staging: Some(Staging { buffer: staging, timestamps, stages: Vec::new(), period: self.period }),
        });
        Ok(prepared)
    }

    /// Prepares the image of all layers of a view, given by the request of the first one.
    fn joined(
        &self,
        (device, queue): (&Device, &Queue),
        joining: Joining,
        (volume, first, scene): (&ClassifiedVolume, &FrameRequest, &Scene),
        (compositing, cut): (&CompositingBuffer, CutBuffers<'_>),
        layers: &[PreparedLayer],
        old: Option<Joined>,
    ) -> Result<Joined, RenderError> {
        let (old_buffer, old_hits, old_uniform) = match old {
            Some(Joined { compositing, hits, uniform, .. }) => (Some(compositing), Some(hits), Some(uniform)),
            None => (None, None, None),
        };
        let joined = old_buffer.unwrap_or_else(|| CompositingBuffer::new(device, first.view.size, &first.bands));
        let hits = grown(device, old_hits, &joined_hits(first))?;
        let mode = JoinMode::of(joining, first.rays.first_hit);
        let bind = |layer: &PreparedLayer| {
            // Only samples have no first hits, and share sheets.
            let hits_of_layer = layer.drawing.first_hits().unwrap_or((&hits, 0));
            let buffers = JoinBuffers { frame: &layer.uniform, hits: hits_of_layer, joined_hits: &hits, cut };
            let bands = compositing.bands.iter().zip(&joined.bands);
            bands.map(|band| self.join.bind(device, mode, buffers, band)).collect()
        };
        let mut values = frame_values(volume, first, scene);
        if joining == Joining::Sum {
            // Sums of finished images are at most 1, as those of an x-ray's sheets are.
            values.compositing = Compositing::Xray as u32;
        }
        Ok(Joined {
            mode,
            groups: layers.iter().map(bind).collect(),
            uniform: written(device, queue, old_uniform, &frame_uniform(), bytemuck::bytes_of(&values))?,
            compositing: joined,
            hits,
        })
    }

    /// Prepares a rasterizer's part: tiles, or quads if the view does not fit tiles and the scene does not require them. The error then says
    /// why.
    fn draw_with(
        &self,
        inputs: FrameInputs<'_>,
        previous: Option<Drawing>,
    ) -> Result<(Drawing, Prepared, Option<RenderError>), RenderError> {
        let (mut old_quads, mut old_tiles, mut old_samples, mut old_fields) = (None, None, None, None);
        match previous {
            Some(Drawing::Quads(frame)) => old_quads = Some(*frame),
            Some(Drawing::Fields(frame)) => old_fields = Some(*frame),
            Some(Drawing::Tiles(frame)) => old_tiles = Some(*frame),
            Some(Drawing::Samples(frame)) => old_samples = Some(*frame),
            None => {}
        }
        let kind = inputs.request.kind;
        if kind == RasterizerKind::Samples {
            let (frame, prepared) = self.samples(inputs.device).prepare(inputs, old_samples)?;
            return Ok((Drawing::Samples(Box::new(frame)), prepared, None));
        }
        let mut fallback = None;
        if let RasterizerKind::Tiles { insisted } = kind
            && HAS_TILES
        {
            match self.tiles.prepare(inputs, old_tiles) {
                Ok((frame, prepared)) => return Ok((Drawing::Tiles(Box::new(frame)), prepared, None)),
                Err(error) if insisted => return Err(error),
                Err(error) => fallback = Some(error),
            }
        }
        if let Some(after) = &inputs.request.after {
            let (frame, prepared) = self.fields(inputs.device).prepare(inputs, after, old_fields)?;
            return Ok((Drawing::Fields(Box::new(frame)), prepared, fallback));
        }
        let (frame, prepared) = self.quads(inputs.device).prepare(inputs, old_quads)?;
        Ok((Drawing::Quads(Box::new(frame)), prepared, fallback))
    }

    fn samples(&self, device: &Device) -> &SampleRasterizer {
        self.samples.get_or_init(|| SampleRasterizer::new(device, self.sheet_format))
    }

    fn fields(&self, device: &Device) -> &FieldRasterizer {
        self.fields.get_or_init(|| FieldRasterizer::new(device, self.sheet_format))
    }

    fn quads(&self, device: &Device) -> &QuadRasterizer {
        self.quads.get_or_init(|| QuadRasterizer::new(device, self.sheet_format, self.sheets))
    }
}

//! Picking on the GPU: what a pixel shows first.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};

use wgpu::{Buffer, BufferAsyncError, BufferDescriptor, BufferUsages, CommandEncoder, Device, MapMode, Texture};

use crate::error::RenderError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::pick::Pick;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::Volume;

/// A pick on its way from the GPU.
#[derive(Debug)]
pub struct PendingPick {
    staging: Buffer,
    view: ViewGeometry,
    pixel: [u32; 2],
    volume: Arc<Volume>,
    transfer: Vec<TransferFunction>,
    arrival: Option<Receiver<Result<(), BufferAsyncError>>>,
}

impl PendingPick {
    pub(crate) fn record(
        device: &Device,
        encoder: &mut CommandEncoder,
        first_hits: &Texture,
        pixel: [u32; 2],
        view: &ViewGeometry,
        (volume, transfer): (&Arc<Volume>, &[TransferFunction]),
    ) -> Self {
        let staging = device.create_buffer(&BufferDescriptor {
            label: Some("sheetsplat.pick"),
            size: 4,
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo {
                texture: first_hits,
                mip_level: 0,
                origin: wgpu::Origin3d { x: pixel[0], y: pixel[1], z: 0 },
                aspect: wgpu::TextureAspect::All,
            },
            wgpu::TexelCopyBufferInfo { buffer: &staging, layout: wgpu::TexelCopyBufferLayout::default() },
            wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
        );
        Self { staging, view: *view, pixel, volume: volume.clone(), transfer: transfer.to_vec(), arrival: None }
    }

    /// The picked point, once the encoder was submitted, its work is done, and the device was polled. The first call after submitting requests
    /// it, so at least two calls are needed; until the point has arrived they return `None`. Never waits. The inner `None` means that the
    /// opacity is not reached.
    ///
    /// # Errors
    /// If the device was lost in the meantime.
    pub fn try_get(&mut self) -> Option<Result<Option<Pick>, RenderError>> {
        let news = self.request().try_recv().ok()?;
        Some(self.arrived(news))
    }

    /// Requests the point, once the encoder was submitted. The device tells there, once it was polled after its work was done, that [`Self::arrived`] has it;
    /// another thread that polled it, too, may be the one that brings this news.
    pub(crate) fn request(&mut self) -> &Receiver<Result<(), BufferAsyncError>> {
        self.arrival.get_or_insert_with(|| {
            let (sender, arrival) = channel();
            self.staging.map_async(MapMode::Read, .., move |result| {
                // The receiver may have been dropped.
                let _ = sender.send(result);
            });
            arrival
        })
    }

    /// The point, after this news.
    pub(crate) fn arrived(&self, news: Result<(), BufferAsyncError>) -> Result<Option<Pick>, RenderError> {
        let failed = |reason: String| RenderError::Readback(reason);
        news.map_err(|error| failed(error.to_string()))?;
        let bytes = self.staging.get_mapped_range(..).map_err(|error| failed(error.to_string()))?;
        let depth: f32 = bytemuck::pod_read_unaligned(&bytes[..4]);
        let of = (&*self.volume, &*self.transfer);
        Ok(depth.is_finite().then(|| Pick::at(&self.view, of, self.pixel, depth.into())))
    }
}

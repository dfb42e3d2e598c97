//! Picking: the first point that is visible at a pixel.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};

use glam::{DVec2, DVec3, UVec3};
use wgpu::{Buffer, BufferAsyncError, BufferDescriptor, BufferUsages, CommandEncoder, Device, MapMode, Texture};

use crate::error::RenderError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::volume::Volume;

/// A point of a volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// The position in world units from the volume's centre.
    pub position: DVec3,
    /// The depth along the camera's direction in world units, from the eye or, orthographic, from the camera's centre.
    pub depth: f64,
    /// The nearest voxel.
    pub voxel: UVec3,
    /// That voxel's value, NaN in a hole.
    pub value: f32,
    /// That voxel's label, if the volume is segmented.
    pub label: Option<u16>,
}

/// A pick that is being read back from the GPU.
#[derive(Debug)]
pub struct PendingPick {
    staging: Buffer,
    view: ViewGeometry,
    pixel: [u32; 2],
    volume: Arc<Volume>,
    arrival: Option<Receiver<Result<(), BufferAsyncError>>>,
}

impl PendingPick {
    pub(crate) fn record(
        device: &Device,
        encoder: &mut CommandEncoder,
        first_hits: &Texture,
        pixel: [u32; 2],
        view: &ViewGeometry,
        volume: &Arc<Volume>,
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
        Self { staging, view: *view, pixel, volume: volume.clone(), arrival: None }
    }

    /// The picked point, once the encoder was submitted, its work is done, and the device was polled. The first call after submitting requests
    /// it, so at least two calls are needed; until the point has arrived they return `None`. Never waits. The inner `None` means that the
    /// opacity is not reached.
    /// opacity is not reached.
    ///
    /// # Errors
    /// If the device was lost in the meantime.
    pub fn try_get(&mut self) -> Option<Result<Option<Pick>, RenderError>> {
        let failed = |reason: String| RenderError::Readback(reason);
        let arrival = self.arrival.get_or_insert_with(|| {
            let (sender, arrival) = channel();
            self.staging.map_async(MapMode::Read, .., move |result| {
                // The receiver may have been dropped.
                let _ = sender.send(result);
            });
            arrival
        });
        let result = arrival.try_recv().ok()?;
        Some(result.map_err(|error| failed(error.to_string())).and_then(|()| {
            let bytes = self.staging.get_mapped_range(..).map_err(|error| failed(error.to_string()))?;
            let depth: f32 = bytemuck::pod_read_unaligned(&bytes[..4]);
            Ok(depth.is_finite().then(|| self.at(depth.into())))
        }))
    }

    /// The point at a depth.
    fn at(&self, depth: f64) -> Pick {
        let grid = self.volume.grid();
        let place = DVec2::from(self.pixel.map(f64::from)) + 0.5 - DVec2::from(self.view.size.map(f64::from)) / 2.0;
        let position = self.view.rays().at(place, depth / grid.unit()) * grid.unit();
        let last = grid.dims.as_dvec3() - 1.0;
        let voxel = (position / grid.spacing + grid.center()).round().clamp(DVec3::ZERO, last).as_uvec3();
        let index = grid.index_of(voxel);
        let (value, label) = (self.volume.values()[index as usize], self.volume.label(index));
        Pick { position, depth, voxel, value, label }
    }
}

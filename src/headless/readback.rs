//! Blocking readback of buffers and textures.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};

use wgpu::{Buffer, BufferUsages, Device, Queue, Texture};

use crate::error::RenderError;
use crate::error::device::DeviceFault;

/// The bytes of a buffer that has the usage `COPY_SRC`.
///
/// # Errors
/// If the device is lost.
pub fn buffer(device: &Device, queue: &Queue, source: &Buffer) -> Result<Vec<u8>, RenderError> {
    buffer_part(device, queue, source, 0..source.size())
}

/// The bytes of a range of them, whose ends are multiples of four.
///
/// # Errors
/// If the device is lost.
pub fn buffer_part(device: &Device, queue: &Queue, source: &Buffer, range: Range<u64>) -> Result<Vec<u8>, RenderError> {
    let size = range.end - range.start;
    let staging = staging(device, size);
    let mut encoder =
        device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("sheetsplat.readback") });
    encoder.copy_buffer_to_buffer(source, range.start, &staging, 0, size);
    queue.submit([encoder.finish()]);
    let mut bytes = Vec::with_capacity(size as usize);
    read(device, &staging, |mapped| bytes.extend_from_slice(mapped))?;
    Ok(bytes)
}

/// The texels of a 2D texture that has the usage `COPY_SRC`, row by row without padding. It is copied in as many pieces as the device's
/// maximum buffer size requires.
///
/// # Errors
/// If the device is lost.
pub fn texture(device: &Device, queue: &Queue, source: &Texture) -> Result<Vec<u8>, RenderError> {
    let texel = source.format().block_copy_size(None).unwrap_or(0);
    let row = source.width() * texel;
    let padded_row = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let rows_per_copy =
        (device.limits().max_buffer_size / u64::from(padded_row)).clamp(1, source.height().into()) as u32;
    let staging = staging(device, u64::from(padded_row) * u64::from(rows_per_copy));
    let mut bytes = Vec::with_capacity(row as usize * source.height() as usize);
    for first_row in (0..source.height()).step_by(rows_per_copy as usize) {
        let rows = rows_per_copy.min(source.height() - first_row);
        let mut encoder =
            device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("sheetsplat.readback") });
        encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo {
                texture: source,
                mip_level: 0,
                origin: wgpu::Origin3d { x: 0, y: first_row, z: 0 },
                aspect: wgpu::TextureAspect::All,
            },
            wgpu::TexelCopyBufferInfo {
                buffer: &staging,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(padded_row),
                    rows_per_image: None,
                },
            },
            wgpu::Extent3d { width: source.width(), height: rows, depth_or_array_layers: 1 },
        );
        queue.submit([encoder.finish()]);
        read(device, &staging, |mapped| {
            for padded in mapped.chunks(padded_row as usize).take(rows as usize) {
                bytes.extend_from_slice(&padded[..row as usize]);
            }
        })?;
    }
    Ok(bytes)
}

fn staging(device: &Device, size: u64) -> Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("sheetsplat.readback"),
        size,
        usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
        mapped_at_creation: false,
    })
}

/// Waits for the GPU, passes the buffer's bytes to `use_bytes`, and unmaps it.
fn read(device: &Device, staging: &Buffer, use_bytes: impl FnOnce(&[u8])) -> Result<(), RenderError> {
    let failed = |reason: String| RenderError::Readback(reason);
    let (sender, receiver) = std::sync::mpsc::channel();
    staging.map_async(wgpu::MapMode::Read, .., move |result| {
        // The receiver is gone only if polling failed, and that error is returned.
        let _ = sender.send(result);
    });
    wait(device)?;
    let mapped = receiver.recv().map_err(|error| failed(error.to_string()))?;
    mapped.map_err(|error| failed(error.to_string()))?;
    use_bytes(&staging.get_mapped_range(..).map_err(|error| failed(error.to_string()))?);
    staging.unmap();
    Ok(())
}

/// Waits until everything submitted is done.
///
/// # Errors
/// If the device is lost.
pub(super) fn wait(device: &Device) -> Result<(), RenderError> {
    // wgpu panics where the driver loses the device meanwhile.
    match catch_unwind(AssertUnwindSafe(|| device.poll(wgpu::PollType::wait_indefinitely()))) {
        Ok(Ok(_)) => Ok(()),
        Ok(Err(error)) => Err(RenderError::Readback(error.to_string())),
        Err(_) => Err(DeviceFault::Lost.into()),
    }
}

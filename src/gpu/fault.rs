//! Failures of a device, returned as errors of the call that caused them.

use std::future::Future;
use std::pin::pin;
use std::task::{Context, Poll, Waker};

use wgpu::{BufferDescriptor, BufferUsages, Device, ErrorFilter};

use crate::error::device::DeviceFault;
use crate::gpu::shaders::{self, Shader};

impl From<wgpu::Error> for DeviceFault {
    fn from(error: wgpu::Error) -> Self {
        let message = |error: &dyn std::error::Error| {
            let mut message = error.to_string();
            let mut source = error.source();
            while let Some(cause) = source {
                message = format!("{message}\n{cause}");
                source = cause.source();
            }
            let lines: Vec<&str> = message.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
            let message = lines.join(": ");
            let is_of = |shader: &&Shader| message.contains(&format!("sheetsplat.{}'", shader.stage));
            shaders::ALL.iter().find(is_of).map_or(message.clone(), |shader| shader.explain(&message))
        };
        match error {
            wgpu::Error::OutOfMemory { source } => Self::OutOfMemory(message(&*source)),
            // In browsers only the description tells what happened.
            wgpu::Error::Validation { description, .. } if cfg!(target_family = "wasm") => {
                Self::Validation(description)
            }
            wgpu::Error::Internal { description, .. } if cfg!(target_family = "wasm") => Self::Internal(description),
            wgpu::Error::Validation { source, .. } => Self::Validation(message(&*source)),
            wgpu::Error::Internal { source, .. } => Self::Internal(message(&*source)),
        }
    }
}

/// Does some work with a device in its own error scopes, and never waits. A host uses it where only the device can refuse the work: for
/// recording, submitting, and creating its targets. Everything in this library that accepts a device and can fail already has such scopes.
///
/// In browsers errors arrive later, so the work is done without scopes of its own, and errors arrive in the host's scopes.
///
/// # Errors
/// The error that the device reported during the work, whatever its result: that it is lost, or else that memory ran out, or else the first
/// of the other errors.
pub fn scoped<T>(device: &Device, work: impl FnOnce() -> T) -> Result<T, DeviceFault> {
    if cfg!(target_family = "wasm") {
        return Ok(work());
    }
    let scopes = [ErrorFilter::Validation, ErrorFilter::Internal, ErrorFilter::OutOfMemory]
        .map(|filter| device.push_error_scope(filter));
    let result = work();
    let is_lost = is_lost(device);
    // Scopes are a stack: the last pushed is the first popped. All must be popped even after an error. Objects that could not be allocated
    // are invalid, so running out of memory causes further errors.
    let errors: Vec<_> = scopes.into_iter().rev().map(|scope| now(scope.pop())).collect();
    match errors.into_iter().flatten().next() {
        _ if is_lost => Err(DeviceFault::Lost),
        Some(error) => Err(error.into()),
        None => Ok(result),
    }
}

/// Whether the device is lost. Error scopes do not tell, and the callback that does belongs to the host; but a lost device cannot write to
/// valid buffers.
fn is_lost(device: &Device) -> bool {
    let scopes = [ErrorFilter::Internal, ErrorFilter::OutOfMemory].map(|filter| device.push_error_scope(filter));
    let buffer = device.create_buffer(&BufferDescriptor {
        label: Some("sheetsplat.is_lost"),
        size: wgpu::COPY_BUFFER_ALIGNMENT,
        usage: BufferUsages::COPY_SRC,
        mapped_at_creation: true,
    });
    let is_written = buffer.get_mapped_range_mut(..).is_ok();
    let errors = scopes.into_iter().rev().filter_map(|scope| now(scope.pop())).count();
    !is_written && errors == 0
}

/// The result of a future that is ready; `None` if it is not.
fn now<T>(future: impl Future<Output = Option<T>>) -> Option<T> {
    match Future::poll(pin!(future), &mut Context::from_waker(Waker::noop())) {
        Poll::Ready(result) => result,
        Poll::Pending => None,
    }
}

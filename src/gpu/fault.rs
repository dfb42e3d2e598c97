//! What a device reports when it fails, as an error of whoever asked for the work.

use std::future::Future;
use std::pin::pin;
use std::task::{Context, Poll, Waker};

use wgpu::{BufferDescriptor, BufferUsages, Device, ErrorFilter};

use crate::gpu::shaders::{self, Shader};

/// A failure that the device reported. Messages are one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceFault {
    /// Memory ran out: less of it may still be had, of the same device.
    #[error("the device is out of memory: {0}")]
    OutOfMemory(String),
    /// wgpu's validation found a mistake, of this library's or in what a host gave it.
    #[error("device error: {0}")]
    Validation(String),
    /// The driver failed, as where it cannot compile a shader.
    #[error("internal device error: {0}")]
    Internal(String),
    /// The device does nothing any more. Another one, with volumes and a renderer of its own, may.
    #[error("the device is lost")]
    Lost,
}

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
            wgpu::Error::Validation { source, .. } => Self::Validation(message(&*source)),
            wgpu::Error::Internal { source, .. } => Self::Internal(message(&*source)),
        }
    }
}

/// Does some work with a device in error scopes of its own, and never waits. A host does so what only the device can refuse: recording,
/// submitting, making its own targets. What takes a device in this library and can fail has such scopes already.
///
/// In a browser errors arrive later: there the work is done without scopes of its own, and what fails arrives in those of the host.
///
/// # Errors
/// What the device reported meanwhile, whatever the work gave: that it is lost, or else that memory ran out, or else the first of the
/// other reports.
pub fn scoped<T>(device: &Device, work: impl FnOnce() -> T) -> Result<T, DeviceFault> {
    if cfg!(target_family = "wasm") {
        return Ok(work());
    }
    let scopes = [ErrorFilter::Validation, ErrorFilter::Internal, ErrorFilter::OutOfMemory]
        .map(|filter| device.push_error_scope(filter));
    let result = work();
    let is_lost = is_lost(device);
    // Scopes are a stack: the last pushed is the first popped. All must be popped even after an error. What memory was too little for is
    // not valid, so that there are other errors, too.
    let errors: Vec<_> = scopes.into_iter().rev().map(|scope| now(scope.pop())).collect();
    match errors.into_iter().flatten().next() {
        _ if is_lost => Err(DeviceFault::Lost),
        Some(error) => Err(error.into()),
        None => Ok(result),
    }
}

/// Whether the device is lost, which no error scope says, only a callback, and that one is the host's. But then buffers cannot be written,
/// though nothing is wrong with them.
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

/// What a future that is ready gives; `None` of one that is not.
fn now<T>(future: impl Future<Output = Option<T>>) -> Option<T> {
    match Future::poll(pin!(future), &mut Context::from_waker(Waker::noop())) {
        Poll::Ready(result) => result,
        Poll::Pending => None,
    }
}

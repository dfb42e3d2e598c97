//! The place where a volume keeps the coefficients of `interpolation = "exact"`, which depend on nothing but its values and the kernel.

use std::sync::{Arc, Mutex, PoisonError};

/// The coefficients for the last kernel that was requested, shared by all clones of a volume.
#[derive(Clone, Debug, Default)]
pub(super) struct KeptCoefficients(Arc<Mutex<Option<Kept>>>);

#[derive(Debug)]
struct Kept {
    /// The kernel's radius and falloff.
    kernel: (f64, f64),
    coefficients: Arc<[f32]>,
}

impl KeptCoefficients {
    /// The kept coefficients for a kernel, or new ones, which replace them. Threads that ask meanwhile wait for them.
    pub(super) fn get_or_compute<E>(
        &self,
        kernel: (f64, f64),
        compute: impl FnOnce() -> Result<Arc<[f32]>, E>,
    ) -> Result<Arc<[f32]>, E> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(Kept { coefficients, .. }) = kept.as_ref().filter(|kept| kept.kernel == kernel) {
            return Ok(Arc::clone(coefficients));
        }
        // The former ones make room before more are computed.
        *kept = None;
        let coefficients = compute()?;
        *kept = Some(Kept { kernel, coefficients: Arc::clone(&coefficients) });
        Ok(coefficients)
    }
}

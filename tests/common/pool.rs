//! Devices and the like that one test after another uses.

use std::sync::{Mutex, PoisonError};

/// Devices that stay until the process ends, as many as tests run at once. A software driver compiles a device's pipelines on one core, which takes
/// longer than most tests: so a test takes the device of an earlier one, but never one that another test uses.
pub(crate) struct Pool<T: 'static>(Mutex<Vec<&'static T>>);

impl<T> Pool<T> {
    pub(crate) const fn new() -> Self {
        Self(Mutex::new(Vec::new()))
    }

    /// One that nobody has, or a new one.
    pub(crate) fn lend(&'static self, new: impl FnOnce() -> T) -> Lent<T> {
        let free = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop();
        Lent { of: self, thing: free.unwrap_or_else(|| Box::leak(Box::new(new()))) }
    }
}

/// A thing of a pool, which has it again when this is dropped; in a thread-local variable, when the test ends.
pub(crate) struct Lent<T: 'static> {
    of: &'static Pool<T>,
    pub(crate) thing: &'static T,
}

impl<T> Drop for Lent<T> {
    fn drop(&mut self) {
        self.of.0.lock().unwrap_or_else(PoisonError::into_inner).push(self.thing);
    }
}

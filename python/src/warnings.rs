//! Warnings of the library, on their way to Python's `logging` and `warnings`.

use std::cell::RefCell;
use std::sync::{Mutex, PoisonError};

use log::{Level, LevelFilter, Log, Metadata, Record};
use pyo3::prelude::*;
use sheetsplat::internals::plain;

/// The crate that reads volumes, whose warnings bear on the picture; those of others are about devices and time.
const READERS: &str = "sheetsplat_volume";

/// A warning: whether it is an error of a driver, whether the picture is another one than might be expected, and the message.
pub(crate) type Warning = (bool, bool, String);

thread_local! {
    /// The warnings of the work that a thread does.
    static HEARD: RefCell<Option<Vec<Warning>>> = const { RefCell::new(None) };
}

/// The warnings of threads that share work.
static OF_OTHERS: Mutex<Vec<Warning>> = Mutex::new(Vec::new());

fn of_others() -> Vec<Warning> {
    std::mem::take(&mut *OF_OTHERS.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Hears what the library logs.
struct Listener;

impl Log for Listener {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.level() <= Level::Error
            || metadata.level() <= Level::Warn && metadata.target().starts_with("sheetsplat")
    }

    fn log(&self, record: &Record<'_>) {
        if self.enabled(record.metadata()) {
            let bears_on_picture = record.target().starts_with(READERS);
            hear((record.level() == Level::Error, bears_on_picture, plain(&record.args().to_string()).to_string()));
        }
    }

    fn flush(&self) {}
}

fn hear(warning: Warning) {
    HEARD.with_borrow_mut(|heard| match heard {
        Some(heard) => heard.push(warning),
        None => OF_OTHERS.lock().unwrap_or_else(PoisonError::into_inner).push(warning),
    });
}

/// Warns that a picture is another one than might be expected.
pub(crate) fn warn(message: String) {
    hear((false, true, message));
}

/// Begins to hear what the library logs.
pub(crate) fn listen() {
    // Nobody else listens in this module's copy of the library.
    if log::set_logger(&Listener).is_ok() {
        log::set_max_level(LevelFilter::Warn);
    }
}

/// Does some work, and returns its warnings, too.
pub(crate) fn heard<T>(work: impl FnOnce() -> T) -> (T, Vec<Warning>) {
    HEARD.set(Some(Vec::new()));
    let result = work();
    let mut heard = HEARD.take().unwrap_or_default();
    heard.extend(of_others());
    (result, heard)
}

/// Warns in Python, of each thing once.
pub(crate) fn give(py: Python<'_>, heard: Vec<Warning>) -> PyResult<()> {
    if heard.is_empty() {
        return Ok(());
    }
    let module = py.import("sheetsplat._warnings")?;
    let mut given: Vec<&Warning> = Vec::new();
    for warning in &heard {
        if !given.contains(&warning) {
            given.push(warning);
            module.call_method1("give", warning.clone())?;
        }
    }
    Ok(())
}

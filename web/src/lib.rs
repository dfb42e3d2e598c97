//! What a Web Worker calls: a volume, its scene, and pictures of it. `js/` makes a page's API of it. The feature chooses what draws, `cpu` or `gpu`.
#![cfg(all(target_arch = "wasm32", any(feature = "cpu", feature = "gpu")))]

#[cfg(not(feature = "gpu"))]
mod cpu;
mod facts;
#[cfg(feature = "gpu")]
mod gpu;
mod session;
mod unset;

#[cfg(not(feature = "gpu"))]
pub(crate) use cpu::Cpu as Drawer;
#[cfg(feature = "gpu")]
pub(crate) use gpu::Gpu as Drawer;
use log::{Level, LevelFilter, Log, Metadata, Record};
pub use session::Session;
use wasm_bindgen::JsValue;
use wasm_bindgen::prelude::wasm_bindgen;

/// The opacity whose depth a pick finds.
const PICKED: f64 = 0.5;

#[wasm_bindgen]
extern "C" {
    /// The worker's function that tells the page of a warning.
    #[wasm_bindgen(js_name = sheetsplatWarn)]
    fn warn(message: &str);
}

/// Hears the library's warnings: those of other crates are about devices.
struct Listener;

impl Log for Listener {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.level() <= Level::Warn && metadata.target().starts_with("sheetsplat")
    }

    fn log(&self, record: &Record<'_>) {
        if self.enabled(record.metadata()) {
            warn(&record.args().to_string());
        }
    }

    fn flush(&self) {}
}

/// Passes warnings to JavaScript, and the messages of panics, of which it otherwise learns only that something unreachable was reached.
#[wasm_bindgen(start)]
fn start() {
    // Nobody else listens in this module's copy of the library.
    if log::set_logger(&Listener).is_ok() {
        log::set_max_level(LevelFilter::Warn);
    }
    std::panic::set_hook(Box::new(|panic| {
        let _ = js_sys::Reflect::set(&js_sys::global(), &"sheetsplatPanic".into(), &panic.to_string().into());
    }));
}

/// An error as JavaScript gets it: the whole message.
fn error(error: impl std::fmt::Display) -> JsValue {
    js_sys::Error::new(&error.to_string()).into()
}

fn nothing() -> JsValue {
    error("no volume is loaded")
}

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
pub use session::Session;
use wasm_bindgen::JsValue;
use wasm_bindgen::prelude::wasm_bindgen;

/// The opacity whose depth a pick finds.
const PICKED: f64 = 0.5;

/// Passes the messages of panics to JavaScript, which otherwise learns only that something unreachable was reached.
#[wasm_bindgen(start)]
fn start() {
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

//! The CPU: pixels of a region, which the worker puts onto its canvas.

use std::sync::Arc;

use js_sys::{Float32Array, Object, Reflect, Uint8ClampedArray};
use sheetsplat::cpu::CpuRenderer;
use sheetsplat::settings::Region;
use sheetsplat::{Pick, Scene, Volume};
use wasm_bindgen::JsValue;
use wasm_bindgen::prelude::wasm_bindgen;

use crate::session::{Session, plain};
use crate::{PICKED, error, nothing};

/// A renderer of a volume, once there is one.
#[derive(Default)]
pub(crate) struct Cpu(Option<(Arc<Volume>, CpuRenderer)>);

impl Cpu {
    /// Shows a volume. After an error the old one stays.
    #[expect(clippy::unused_async, reason = "the GPU waits here")]
    pub(crate) async fn set_volume(&mut self, volume: &Arc<Volume>, scene: &Scene) -> Result<(), JsValue> {
        match &mut self.0 {
            Some((old, renderer)) if Arc::ptr_eq(old, volume) => renderer.set_scene(scene).map_err(error),
            shown => {
                let renderer = CpuRenderer::new(Arc::clone(volume), scene).map_err(error)?;
                *shown = Some((Arc::clone(volume), renderer));
                Ok(())
            }
        }
    }

    /// The first hit of a scene of the volume at a pixel.
    #[expect(clippy::unused_async, reason = "the GPU waits here")]
    pub(crate) async fn pick(&mut self, scene: &Scene, [x, y]: [u32; 2]) -> Result<Option<Pick>, JsValue> {
        let renderer = self.renderer(scene)?;
        renderer.set_first_hit(Some(PICKED)).map_err(error)?;
        let drawn = renderer.draw_region(Region { x, y, width: 1, height: 1 }).map_err(error);
        let pick = drawn.and_then(|_| renderer.pick([x, y]).map_err(error));
        renderer.set_first_hit(None).map_err(error)?;
        pick
    }

    fn renderer(&mut self, scene: &Scene) -> Result<&mut CpuRenderer, JsValue> {
        let (_, renderer) = self.0.as_mut().ok_or_else(nothing)?;
        if renderer.scene() != scene {
            renderer.set_scene(scene).map_err(error)?;
        }
        Ok(renderer)
    }
}

#[wasm_bindgen]
impl Session {
    /// Without a volume. With `all_around` a camera that fits the object is placed so that the object keeps its size from every direction.
    #[wasm_bindgen(constructor)]
    pub fn new(all_around: bool) -> Self {
        Self::with(all_around, Cpu::default())
    }

    /// Draws the pixels of a region: `{rgba, stats}`, bytes with straight alpha, and with `floats` also `pixels`, premultiplied.
    pub fn draw(&mut self, x: u32, y: u32, width: u32, height: u32, floats: bool) -> Result<Object, JsValue> {
        let region = Region { x, y, width, height };
        let drawn = self.drawn()?;
        let rendering = self.drawer.renderer(&drawn)?.draw_region(region).map_err(error)?;
        let frame = Object::new();
        let bytes: Vec<u8> = rendering.image.straight_channels(255).flatten().map(|channel| channel as u8).collect();
        set(&frame, "rgba", &Uint8ClampedArray::from(&bytes[..]))?;
        if floats {
            set(&frame, "pixels", &Float32Array::from(rendering.image.pixels.as_flattened()))?;
        }
        set(&frame, "stats", &plain(&rendering.stats)?)?;
        Ok(frame)
    }
}

fn set(object: &Object, key: &str, value: &JsValue) -> Result<(), JsValue> {
    Reflect::set(object, &key.into(), value).map(drop)
}

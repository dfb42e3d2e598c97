//! The f64 CPU twin of every GPU stage, in SPEC's direct form: plain, independent of the tables, the bucket sort and the
//! matrices of eqs. 4–11, and slow. Tests compare every stage with it; `sheetsplat render --backend reference` shows it.

pub mod composite;
pub mod geometry;
pub mod resolve;
pub mod shading;
pub mod splat;

use glam::DVec4;

use crate::error::RenderError;
use crate::image::Image;
use crate::kernel::Kernel;
use crate::scene::Scene;
use crate::splatting::Order;
use crate::transfer_function::TransferFunction;
use crate::volume::Volume;

pub use geometry::Geometry;
pub use shading::Splat;

/// An f64 image of premultiplied RGBA, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Buffer {
    /// Pixels per row.
    pub width: usize,
    /// Row by row.
    pub pixels: Vec<DVec4>,
}

impl Buffer {
    /// A buffer of zeros.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width: width as usize, pixels: vec![DVec4::ZERO; width as usize * height as usize] }
    }
}

/// Renders the scene's camera, image, shading and splatting settings over a volume, with nothing culled.
///
/// # Errors
/// If the scene asks for something that is not implemented yet.
pub fn render(volume: &Volume, transfer: &TransferFunction, scene: &Scene) -> Result<Image, RenderError> {
    let geometry = Geometry::new(volume.grid(), scene)?;
    let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
    let splats = shading::shade(volume, transfer, scene, &geometry);

    let mut sheets: Vec<(i32, Vec<Splat>)> = splat::buckets(&splats, &geometry, &kernel).into_iter().collect();
    if scene.splatting.order == Order::BackToFront {
        sheets.reverse();
    }
    let mut acc = Buffer::new(scene.image.width, scene.image.height);
    for (k, bucket) in &sheets {
        let sheet = splat::sheet(bucket, *k, &geometry, &kernel);
        composite::composite(&mut acc, &sheet, scene.splatting.compositing, scene.splatting.order);
    }
    let image = resolve::resolve(&acc, scene.splatting.compositing, scene.image.background);
    Ok(Image {
        width: scene.image.width,
        height: scene.image.height,
        pixels: image.pixels.iter().map(|pixel| pixel.as_vec4().to_array()).collect(),
    })
}

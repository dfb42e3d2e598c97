//! The f64 CPU twin of every GPU stage, in SPEC's direct form: plain, independent of the tables, the bucket sort and the
//! matrices of eqs. 4–11, and slow. Tests compare every stage with it; `sheetsplat render --backend reference` shows it.

pub mod composite;
pub mod geometry;
pub mod resolve;
pub mod shading;
pub mod splat;
pub mod visibility;

use glam::DVec4;

use crate::error::RenderError;
use crate::image::Image;
use crate::kernel::Kernel;
use crate::plan::tile_grid;
use crate::scene::Scene;
use crate::splatting::Order;
use crate::stats::Counts;
use crate::transfer_function::TransferFunction;
use crate::volume::Volume;

pub use geometry::Geometry;
pub use shading::Splat;
pub use visibility::Areas;

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
    render_culled(volume, transfer, scene, None).map(|culled| culled.image)
}

/// What [`render`] draws: all there is.
///
/// # Errors
/// If the scene asks for something that is not implemented yet.
pub fn count(volume: &Volume, transfer: &TransferFunction, scene: &Scene) -> Result<Counts, RenderError> {
    let geometry = Geometry::new(volume.grid(), scene)?;
    let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
    let splats = shading::shade(volume, transfer, scene, &geometry);
    let buckets = splat::buckets(&splats, &geometry, &kernel);
    let sections = buckets.values().map(|bucket| bucket.len() as u64).sum();
    let sheets =
        buckets.first_key_value().zip(buckets.last_key_value()).map_or(0, |((first, _), (last, _))| last - first + 1);
    let [columns, rows] = tile_grid([scene.image.width, scene.image.height]).map(u64::from);
    Ok(Counts {
        voxels_total: volume.values().len() as u64,
        voxels_in_range: splats.len() as u64,
        voxels_shaded: splats.len() as u64,
        sections_total: sections,
        sections_rasterized: sections,
        sheets: sheets as u64,
        tiles_total: columns * rows * sheets as u64,
        tiles_composited: columns * rows * buckets.len() as u64,
        ..Counts::default()
    })
}

/// An image with early splat elimination, and what was drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Culled {
    /// The image.
    pub image: Image,
    /// Voxel–sheet pairs that passed the test.
    pub sections: u64,
    /// Where they fell.
    pub areas: Areas,
}

/// Renders with early splat elimination by one of the paper's tests, sheet by sheet, and counts what is drawn.
///
/// # Errors
/// If the scene asks for something that is not implemented yet.
pub fn render_culled(
    volume: &Volume,
    transfer: &TransferFunction,
    scene: &Scene,
    test: Option<visibility::Test>,
) -> Result<Culled, RenderError> {
    let geometry = Geometry::new(volume.grid(), scene)?;
    let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
    let splats = shading::shade(volume, transfer, scene, &geometry);

    let mut sheets: Vec<(i32, Vec<Splat>)> = splat::buckets(&splats, &geometry, &kernel).into_iter().collect();
    if scene.splatting.order == Order::BackToFront {
        sheets.reverse();
    }
    let mut acc = Buffer::new(scene.image.width, scene.image.height);
    let (mut sections, mut areas) = (0, Areas::default());
    for (k, mut bucket) in sheets {
        if let Some(test) = test {
            let mask = visibility::OpaqueMask::new(&acc, scene.splatting.opacity_threshold);
            bucket = mask.visible(&bucket, test, &geometry, kernel.support());
        }
        sections += bucket.len() as u64;
        areas.add(&bucket, &geometry, kernel.support());
        let sheet = splat::sheet(&bucket, k, &geometry, &kernel);
        composite::composite(&mut acc, &sheet, scene.splatting.compositing, scene.splatting.order);
    }
    let image = resolve::resolve(&acc, scene.splatting.compositing, scene.image.background);
    let image = Image {
        width: scene.image.width,
        height: scene.image.height,
        pixels: image.pixels.iter().map(|pixel| pixel.as_vec4().to_array()).collect(),
    };
    Ok(Culled { image, sections, areas })
}

//! The f64 evaluation of every GPU stage, as the specification states it: plain and slow, without the tables, the bucket sort and the
//! matrices of eqs. 4–11. Tests compare every stage with it; `sheetsplat render --backend reference` shows its images.

pub mod after;
pub mod composite;
pub mod cut;
mod first_hit;
pub mod footprint;
pub mod geometry;
pub mod means;
pub mod ray_march;
pub mod resolve;
pub mod shading;
pub mod sheets;
pub mod splat;
pub mod visibility;

use std::collections::BTreeMap;

use glam::DVec4;
use rayon::prelude::*;

use crate::error::RenderError;
use crate::geometry::kernel::Kernel;
use crate::image::Image;
use crate::lists::quad_plan::tile_grid;
use crate::scene::Scene;
use crate::setting_error::SettingError;
use crate::settings::splatting::{Classification, Compositing, Method, Order, check_first_hit};
use crate::settings::transfer_function::TransferFunction;
use crate::stats::Counts;
use crate::volume::Volume;

pub use cut::Cuts;
use first_hit::FirstHits;
pub use geometry::Geometry;
pub use means::Means;
pub use shading::Splat;
pub use splat::Section;
pub use visibility::Areas;

/// An f64 image of premultiplied RGBA, with row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Buffer {
    /// Pixels per row.
    pub width: usize,
    /// The pixels, row by row.
    pub pixels: Vec<DVec4>,
}

impl Buffer {
    /// A buffer of zeros.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width: width as usize, pixels: vec![DVec4::ZERO; width as usize * height as usize] }
    }

    /// Converts the buffer to an f32 image.
    pub fn into_image(self) -> Image {
        Image {
            width: self.width as u32,
            height: (self.pixels.len() / self.width) as u32,
            pixels: self.pixels.iter().map(|pixel| pixel.as_vec4().to_array()).collect(),
        }
    }
}

/// A scene's voxels, ready to be drawn.
struct Frame {
    geometry: Geometry,
    kernel: Kernel,
    /// The indices in memory of the voxels that take part.
    voxels: Vec<u32>,
    splats: Vec<Splat>,
}

impl Frame {
    fn new(volume: &Volume, transfer: &TransferFunction, scene: &Scene) -> Result<Self, RenderError> {
        // The settings are checked before the camera is framed, which needs valid ones.
        scene.check()?;
        transfer.check()?;
        let scene = &scene.framed(volume, transfer);
        let geometry = Geometry::new(volume.grid(), scene)?;
        let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
        let voxels = shading::taking_part(volume, transfer, &geometry);
        let splats = shading::splats(&voxels, volume, transfer, scene, &geometry);
        Ok(Self { geometry, kernel, voxels, splats })
    }

    fn buckets(&self) -> BTreeMap<i32, Vec<u32>> {
        sheets::buckets(&self.voxels, &self.splats, &self.geometry, &self.kernel)
    }

    /// The sections of some splats, given by index, in a sheet.
    fn sections(&self, indices: &[u32], sheet: i32) -> Vec<Section> {
        let section = |&index: &u32| self.geometry.section(&self.splats[index as usize], sheet, &self.kernel);
        indices.par_iter().filter_map(section).collect()
    }
}

/// Renders the scene's camera, image, shading and splatting settings over a volume, with nothing culled.
///
/// # Errors
/// If the scene needs more than can be computed.
pub fn render(volume: &Volume, transfer: &TransferFunction, scene: &Scene) -> Result<Image, RenderError> {
    render_culled(volume, transfer, scene, None).map(|culled| culled.image)
}

/// What a host adds to a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Host<'a> {
    /// For every pixel the depth along w of an opaque surface, in `unit`s from the eye (orthographic: from the camera's centre).
    pub surfaces: Option<&'a [f64]>,
    /// The opacity whose depth is requested.
    pub first_hit: Option<f64>,
}

impl Host<'_> {
    /// Checks that there is a surface depth for every pixel, and the requested opacity, as [`SceneView`](crate::SceneView) does.
    fn check(&self, scene: &Scene) -> Result<(), SettingError> {
        let pixels = scene.image.width as usize * scene.image.height as usize;
        if let Some(depths) = self.surfaces {
            if depths.len() != pixels {
                let found = format!("{} depths", depths.len());
                return Err(SettingError::new("surfaces", found, format!("{pixels}, one for every pixel")));
            }
            if let Some(at) = depths.iter().position(|depth| depth.is_nan()) {
                return Err(SettingError::new(format!("surfaces[{at}]"), depths[at], "a number, or infinity"));
            }
        }
        self.first_hit.map_or(Ok(()), check_first_hit)
    }
}

/// The counts of what [`render`] draws. Voxels composited one by one count as one section each, and have neither sheets nor tiles.
///
/// # Errors
/// If the scene needs more than can be computed.
pub fn count(volume: &Volume, transfer: &TransferFunction, scene: &Scene) -> Result<Counts, RenderError> {
    if scene.splatting.classification == Classification::After {
        return after::count(volume, transfer, scene);
    }
    let frame = Frame::new(volume, transfer, scene)?;
    let buckets = frame.buckets();
    let sections = match scene.splatting.method {
        Method::CompositeEverySample => frame.splats.len() as u64,
        Method::AxisAligned => frame.splats.len() as u64,
        Method::ImageAligned => {
            frame.splats.iter().map(|splat| frame.geometry.slabs(splat, frame.kernel.radius()).len() as u64).sum()
        }
    };
    let sheets =
        buckets.first_key_value().zip(buckets.last_key_value()).map_or(0, |((first, _), (last, _))| last - first + 1);
    let [columns, rows] = tile_grid([scene.image.width, scene.image.height]).map(u64::from);
    Ok(Counts {
        voxels_total: volume.values().len() as u64,
        voxels_in_range: frame.splats.len() as u64,
        voxels_shaded: frame.splats.len() as u64,
        sections_total: sections,
        sections_rasterized: sections,
        sheets: sheets as u64,
        tiles_total: columns * rows * sheets as u64,
        tiles_composited: columns * rows * buckets.len() as u64,
        ..Counts::default()
    })
}

/// An image with early splat elimination, and counts of what was drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Culled {
    /// The image.
    pub image: Image,
    /// Voxel–sheet pairs that passed the test.
    pub sections: u64,
    /// The areas they covered.
    pub areas: Areas,
    /// For every pixel the depth along w at which the requested opacity is reached, in `unit`s like the depths of surfaces; infinite where it
    /// is not reached. Within a sheet opacity grows linearly. Empty if none was requested.
    pub first_hits: Vec<f64>,
}

/// Renders with early splat elimination by one of the paper's tests, sheet by sheet, and counts what is drawn. Nothing is culled back to
/// front, where nothing hides ([`Compositing::hides`]), and where voxels are composited one by one.
///
/// # Errors
/// If the scene needs more than can be computed.
pub fn render_culled(
    volume: &Volume,
    transfer: &TransferFunction,
    scene: &Scene,
    test: Option<visibility::Test>,
) -> Result<Culled, RenderError> {
    render_for(Host::default(), volume, transfer, scene, test)
}

/// Like [`render_culled`], between a host's surfaces. Voxels composited one by one ignore surfaces and clip planes.
///
/// # Errors
/// If the scene needs more than can be computed.
pub fn render_for(
    host: Host<'_>,
    volume: &Volume,
    transfer: &TransferFunction,
    scene: &Scene,
    test: Option<visibility::Test>,
) -> Result<Culled, RenderError> {
    if scene.splatting.classification == Classification::After {
        return after::render_for(host, volume, transfer, scene);
    }
    let frame = Frame::new(volume, transfer, scene)?;
    host.check(scene)?;
    let (compositing, order) = (scene.splatting.compositing, scene.splatting.order);
    let test = test.filter(|_| order == Order::FrontToBack && compositing.hides());
    // While no surface has been reached, alpha is below one half; a surface itself is opaque.
    let threshold = if compositing == Compositing::Surface { 1.0 } else { scene.splatting.opacity_threshold };
    let support = frame.kernel.support();
    let is_cut = host.surfaces.is_some() || !scene.clip.is_empty();
    let cuts = is_cut.then(|| Cuts::new(&frame.geometry, host.surfaces));
    let means = compositing.is_by_means().then(|| Means::new(&frame.geometry, compositing, host.surfaces));
    let mut first_hits = FirstHits::new(host.first_hit, compositing, &frame.geometry);

    let mut acc = Buffer::new(scene.image.width, scene.image.height);
    let (mut sections, mut areas) = (0, Areas::default());
    if scene.splatting.method == Method::CompositeEverySample {
        let mut indices = sheets::by_depth(&frame.voxels, &frame.geometry);
        if order == Order::BackToFront {
            indices.reverse();
        }
        let kernels = frame.sections(&indices, 0);
        sections += kernels.len() as u64;
        let over = |acc: &mut DVec4, amount| composite::composite_pixel(acc, amount, compositing, order);
        splat::draw(&kernels, &frame.kernel, &mut acc, over);
    }
    let mut buckets = frame.buckets();
    if let Some(means) = &means {
        // Empty sheets between the first and the last count as sheets.
        let touched = buckets.first_key_value().zip(buckets.last_key_value()).map(|(first, last)| *first.0..last.0 + 1);
        for k in touched.into_iter().chain([means.sheets()]).flatten() {
            buckets.entry(k).or_default();
        }
    }
    let mut buckets: Vec<(i32, Vec<u32>)> = buckets.into_iter().collect();
    if order == Order::BackToFront {
        buckets.reverse();
    }
    for (k, bucket) in buckets {
        let mut in_sheet = frame.sections(&bucket, k);
        if let Some(test) = test {
            let cuts = cuts.as_ref().map(|cuts| (cuts, k));
            let mask = visibility::OpaqueMask::new(&acc, threshold, cuts);
            in_sheet = mask.visible(&in_sheet, test, support);
        }
        sections += in_sheet.len() as u64;
        areas.add(&in_sheet, frame.geometry.size, support);
        let mut sheet = Buffer::new(scene.image.width, scene.image.height);
        splat::draw(&in_sheet, &frame.kernel, &mut sheet, |pixel, amount| *pixel += amount);
        // A cut does not lower the mean of a slab's visible part, which is what `Minimum` looks for.
        if let Some(cuts) = cuts.as_ref().filter(|_| compositing != Compositing::Minimum) {
            cuts.apply(&mut sheet, k);
        }
        let before = (means.is_some() || host.first_hit.is_some()).then(|| acc.clone());
        if let Some(means) = &means {
            means.apply(&mut sheet);
        }
        composite::composite(&mut acc, &sheet, compositing, order);
        if let (Some(means), Some(before)) = (&means, &before) {
            let uncounted = |pixel: &usize| !means.counts(*pixel, k);
            (0..acc.pixels.len()).filter(uncounted).for_each(|pixel| acc.pixels[pixel] = before.pixels[pixel]);
        }
        if let (Some(_), Some(before)) = (host.first_hit, &before) {
            first_hits.note(before, &sheet, &acc, k, cuts.as_ref());
        }
    }
    let image = resolve::resolve(&acc, compositing, scene.image.background).into_image();
    Ok(Culled { image, sections, areas, first_hits: first_hits.depths(&frame.geometry) })
}

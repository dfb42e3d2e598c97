//! Classification before splatting (the paper, SPEC §§3–6): voxels are classified and shaded, the sections of their kernels are drawn into
//! sheets, and sheets are composited in order. Each step of [`Picture`] is a stage of the GPU.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use glam::DVec4;

use super::first_hit::FirstHits;
use super::framed::framed;
use super::visibility::{OpaqueMask, Test};
use super::{Areas, Buffer, Culled, Cuts, Geometry, Host, Lights, Means, Section, Splat};
use super::{composite, resolve, shading, sheets, splat};
use crate::error::RenderError;
use crate::kernel::Kernel;
use crate::lists::quad_plan::tile_grid;
use crate::parallel::prelude::*;
use crate::part::Content;
use crate::scene::Scene;
use crate::settings::splatting::{Compositing, Method, Order};
use crate::settings::transfer_function::TransferFunction;
use crate::settings::window::Window;
use crate::stats::Counts;
use crate::volume::Volume;

/// A scene's voxels, ready to be drawn.
struct Frame {
    geometry: Geometry,
    kernel: Kernel,
    /// The indices in memory of the voxels that take part.
    voxels: Vec<u32>,
    splats: Vec<Splat>,
}

impl Frame {
    fn new(
        volume: &Volume,
        transfer: &[TransferFunction],
        (scene, lights): (&Scene, Option<&Arc<Lights>>),
    ) -> Result<Self, RenderError> {
        let scene = &framed(volume, transfer, scene)?;
        let geometry = Geometry::new(volume.grid(), scene)?;
        let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
        let voxels = shading::taking_part(volume, transfer, &geometry);
        let lights = Lights::or_new(lights, volume, transfer, scene)?;
        let splats = shading::splats(&voxels, volume, transfer, (scene, &lights), &geometry);
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

/// See [`super::count`].
pub(super) fn count(volume: &Volume, transfer: &[TransferFunction], scene: &Scene) -> Result<Counts, RenderError> {
    // Counts do not depend on light.
    let frame = Frame::new(volume, transfer, (scene, Some(&Arc::default())))?;
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

/// See [`super::render_for`].
pub(super) fn render_for(
    host: Host<'_>,
    volume: &Volume,
    transfer: &[TransferFunction],
    (scene, lights): (&Scene, Option<&Arc<Lights>>),
    test: Option<Test>,
) -> Result<Culled, RenderError> {
    let frame = Frame::new(volume, transfer, (scene, lights))?;
    host.check(scene)?;
    let picture = Picture::drawn(&frame, scene, (host, Window::ALL_SLABS), test);
    let image =
        resolve::resolve(&picture.acc, (picture.compositing, &scene.splatting), scene.image.background).into_image();
    let Picture { sections, areas, first_hits, .. } = picture;
    let first_hits = first_hits.map_or(Vec::new(), |hits| hits.depths(&frame.geometry));
    Ok(Culled { image, sections, areas, first_hits })
}

/// See [`super::part`].
pub(super) fn part(
    volume: &Volume,
    transfer: &[TransferFunction],
    (scene, lights): (&Scene, Option<&Arc<Lights>>),
    Window { slabs, region }: &Window,
) -> Result<Content, RenderError> {
    let frame = Frame::new(volume, transfer, (scene, lights))?;
    let acc = Picture::drawn(&frame, scene, (Host::default(), slabs.clone()), None).acc;
    let rows = acc.pixels.chunks(acc.width).skip(region.rows().start).take(region.rows().len());
    let colors = rows.flat_map(|row| &row[region.columns()]).map(|pixel| pixel.as_vec4().to_array());
    Ok(Content { colors: colors.collect(), extremes: Vec::new() })
}

/// A frame while it is drawn.
struct Picture<'a> {
    frame: &'a Frame,
    /// The slabs that are drawn.
    slabs: Range<i32>,
    compositing: Compositing,
    order: Order,
    /// The culling test, if anything is culled, and the opacity from which a pixel counts as opaque.
    test: Option<(Test, f64)>,
    /// The cuts by clip planes and surfaces, if there are any.
    cuts: Option<Cuts>,
    /// The weights of sheets, for compositings by means.
    means: Option<Means>,
    /// First hits, if they are requested.
    first_hits: Option<FirstHits>,
    /// The compositing buffer.
    acc: Buffer,
    sections: u64,
    areas: Areas,
}

impl<'a> Picture<'a> {
    /// A picture with all its sheets.
    fn drawn(frame: &'a Frame, scene: &Scene, of: (Host<'_>, Range<i32>), test: Option<Test>) -> Self {
        let mut picture = Self::new(frame, scene, of, test);
        if scene.splatting.method == Method::CompositeEverySample {
            picture.composite_every_sample();
        }
        for (k, bucket) in picture.buckets() {
            let sections = picture.cull(frame.sections(&bucket, k), k);
            let sheet = picture.splat(&sections, k);
            picture.composite(&sheet, k);
        }
        picture
    }

    /// An empty picture.
    fn new(frame: &'a Frame, scene: &Scene, (host, slabs): (Host<'_>, Range<i32>), test: Option<Test>) -> Self {
        let (compositing, order) = (scene.splatting.compositing, scene.splatting.order);
        // While no surface has been reached, alpha is below one half; a surface itself is opaque.
        let threshold = if compositing.has_surface() { 1.0 } else { scene.splatting.opacity_threshold };
        let test = test.filter(|_| order == Order::FrontToBack && compositing.hides());
        let is_cut = host.surfaces.is_some() || !scene.clip.is_empty();
        let geometry = &frame.geometry;
        let Range { start, end } = slabs;
        // A surface may begin to rise in the slab before.
        let start = if compositing.has_surface() && start < end { start - 1 } else { start };
        Self {
            frame,
            slabs: start..end,
            compositing,
            order,
            test: test.map(|test| (test, threshold)),
            cuts: is_cut.then(|| Cuts::new(geometry, host.surfaces)),
            means: compositing.is_by_means().then(|| Means::new(geometry, compositing, host.surfaces)),
            first_hits: host.first_hit.map(|opacity| FirstHits::new(opacity, compositing, geometry)),
            acc: Buffer::new(scene.image.width, scene.image.height),
            sections: 0,
            areas: Areas::default(),
        }
    }

    /// Composites voxels one by one (§3, Westover's first form).
    fn composite_every_sample(&mut self) {
        let Self { frame, compositing, order, .. } = *self;
        let mut indices = sheets::by_depth(&frame.voxels, &frame.geometry);
        if order == Order::BackToFront {
            indices.reverse();
        }
        let kernels = frame.sections(&indices, 0);
        self.sections += kernels.len() as u64;
        let over = |acc: &mut DVec4, amount| composite::composite_pixel(acc, amount, compositing, order);
        splat::draw(&kernels, &frame.kernel, &mut self.acc, over);
    }

    /// The splats of every sheet, in the order of compositing. For compositings by means, empty sheets count as well.
    fn buckets(&self) -> Vec<(i32, Vec<u32>)> {
        let mut buckets = self.frame.buckets();
        if let Some(means) = &self.means {
            let touched =
                buckets.first_key_value().zip(buckets.last_key_value()).map(|(first, last)| *first.0..last.0 + 1);
            for k in touched.into_iter().chain([means.sheets()]).flatten() {
                buckets.entry(k).or_default();
            }
        }
        let drawn = buckets.into_iter().filter(|(k, _)| self.slabs.contains(k));
        match self.order {
            Order::FrontToBack => drawn.collect(),
            Order::BackToFront => drawn.rev().collect(),
        }
    }

    /// Counts and returns the sections of sheet k that pass the test (§6).
    fn cull(&mut self, sections: Vec<Section>, k: i32) -> Vec<Section> {
        let support = self.frame.kernel.support();
        let visible = match self.test {
            Some((test, threshold)) => {
                let cuts = self.cuts.as_ref().map(|cuts| (cuts, k));
                OpaqueMask::new(&self.acc, threshold, cuts).visible(&sections, test, support)
            }
            None => sections,
        };
        self.sections += visible.len() as u64;
        self.areas.add(&visible, self.frame.geometry.size, support);
        visible
    }

    /// Sheet k: the sum of its sections (§5), cut, and turned into means where the compositing needs them.
    fn splat(&self, sections: &[Section], k: i32) -> Buffer {
        let mut sheet = Buffer { width: self.acc.width, pixels: vec![DVec4::ZERO; self.acc.pixels.len()] };
        splat::draw(sections, &self.frame.kernel, &mut sheet, |pixel, amount| *pixel += amount);
        // A cut does not lower the mean of a slab's visible part, which is what `Minimum` looks for.
        if let Some(cuts) = self.cuts.as_ref().filter(|_| !self.compositing.keeps_least()) {
            cuts.apply(&mut sheet, k);
        }
        if let Some(means) = &self.means {
            means.apply(&mut sheet);
        }
        sheet
    }

    /// Composites sheet k at the pixels where it counts, and notes first hits.
    fn composite(&mut self, sheet: &Buffer, k: i32) {
        let before = (self.means.is_some() || self.first_hits.is_some()).then(|| self.acc.clone());
        composite::composite(&mut self.acc, sheet, self.compositing, self.order);
        let Some(before) = before else { return };
        if let Some(means) = &self.means {
            let uncounted = |pixel: &usize| !means.counts(*pixel, k);
            (0..before.pixels.len()).filter(uncounted).for_each(|pixel| self.acc.pixels[pixel] = before.pixels[pixel]);
        }
        if let Some(hits) = &mut self.first_hits {
            hits.note(&before, sheet, &self.acc, k, self.cuts.as_ref());
        }
    }
}

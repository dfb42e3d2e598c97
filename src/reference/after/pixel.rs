//! One pixel: its ray, the fields on the planes along it, their sheets, and the composited result (SPEC §9).

use std::ops::Range;

use glam::{DVec3, DVec4, UVec2};

use super::field::nearest;
use super::frame::Frame;
use super::slab_integral::SlabIntegral;
use crate::geometry::pixel_ray::HAIR_OF_CELL;
use crate::part::Extreme;
use crate::reference::cut::{self, PixelRay};
use crate::reference::means::volume_box;
use crate::reference::shading;
use crate::settings::splatting::SlabProfile;
use crate::settings::transfer_function::Tables;

/// The ray of a pixel's centre. Positions on it are counted in sheets: slab k lies between planes k and k + 1.
#[derive(Debug)]
pub struct Pixel<'a> {
    pub(super) frame: &'a Frame<'a>,
    ray: PixelRay,
    /// The part of the ray in the box of voxel cells, beyond the near plane, within the cuts and before a host's surface; may be empty.
    stretch: Range<f64>,
    /// The length of the ray from plane to plane in `unit`s.
    length_per_sheet: f64,
    /// The slab in which the ray enters through a cut whose face is not shaded (SPEC §3).
    face: Option<i32>,
}

/// The slack in sheets for rays that enter where two slabs meet, which is in the farther one.
const FACE_SLACK: f64 = 1e-9;

/// The field at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// f.
    pub value: f64,
    /// ∇f, per world unit.
    pub gradient: DVec3,
}

/// The values at the two planes of a slab.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slab {
    /// The slab's index k.
    pub number: i32,
    /// f0 and f1.
    pub values: [f64; 2],
    /// The planes of these values: if only one plane has a value, it stands for both.
    pub planes: [i32; 2],
}

impl Slab {
    /// Slab k, from the values at its planes; `None` if neither has one.
    pub fn new(number: i32, near: Option<f64>, far: Option<f64>) -> Option<Self> {
        let (values, planes) = match (near, far) {
            (Some(f0), Some(f1)) => ([f0, f1], [number, number + 1]),
            (Some(f0), None) => ([f0; 2], [number; 2]),
            (None, Some(f1)) => ([f1; 2], [number + 1; 2]),
            (None, None) => return None,
        };
        Some(Self { number, values, planes })
    }
}

/// A stretch of a slab along which values run linearly: the slab, or one of the halves of its cubic profile. Gradients run linearly along the slab.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Its ends, from 0 at the slab's near plane to 1 at its far plane.
    pub ends: [f64; 2],
    /// The values there.
    pub values: [f64; 2],
}

/// A composited pixel, before the background.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Composited {
    /// Premultiplied RGBA.
    pub color: DVec4,
    /// The position in sheets at which the host's opacity is reached.
    pub first_hit: Option<f64>,
    /// For `maximum`, `minimum` and `average` the value that was chosen (SPEC §11).
    pub extreme: Extreme,
    /// Its own colour and A, if voxels have their own.
    pub own: Option<DVec4>,
}

impl Composited {
    /// A pixel that does not choose one value.
    pub(super) fn new(color: DVec4, first_hit: Option<f64>) -> Self {
        Self { color, first_hit, extreme: Extreme::default(), own: None }
    }
}

impl<'a> Pixel<'a> {
    /// The pixel at a position counted from the upper left.
    pub fn new(frame: &'a Frame<'a>, pixel: UVec2) -> Self {
        let geometry = &frame.geometry;
        let ray = PixelRay::new(geometry, pixel);
        let index = pixel.x + pixel.y * geometry.size.x as u32;
        let cells = ray.inside(&volume_box(geometry, geometry.grid.whole().1 + 0.5));
        let shown = cut::shown(geometry, frame.host.surfaces, index);
        let near = geometry.eye.map_or(f64::NEG_INFINITY, |eye| eye.near);
        let (start, end) = (cells.start.max(shown.start).max(near), cells.end.min(shown.end));
        let stretch = if start < end { ray.sheet(geometry, start)..ray.sheet(geometry, end) } else { 0.0..0.0 };
        let depth_per_sheet = ray.depth(geometry, 1.0) - ray.depth(geometry, 0.0);
        let cut = ray.inside(&geometry.clip).start;
        let is_face = !frame.scene.clip.shade_faces && cut > cells.start.max(near);
        let face = is_face.then(|| (ray.sheet(geometry, cut) + FACE_SLACK).floor() as i32);
        Self { frame, length_per_sheet: ray.along.length() * depth_per_sheet, ray, stretch, face }
    }

    /// The visible stretch of the ray, in sheets.
    pub fn stretch(&self) -> &Range<f64> {
        &self.stretch
    }

    /// The slabs that the stretch reaches into, of those that are drawn.
    pub fn slabs(&self) -> Range<i32> {
        let (first, end) = (self.stretch.start.floor() as i32, self.stretch.end.ceil() as i32);
        let drawn = &self.frame.slabs;
        if self.stretch.is_empty() { 0..0 } else { first.max(drawn.start)..end.min(drawn.end) }
    }

    /// The part of the stretch in a slab; may be empty.
    pub fn shown(&self, slab: i32) -> Range<f64> {
        self.stretch.start.max(f64::from(slab))..self.stretch.end.min(f64::from(slab) + 1.0)
    }

    /// The voxel coordinates of a position on the ray.
    pub fn at(&self, sheet: f64) -> DVec3 {
        let geometry = &self.frame.geometry;
        self.position(sheet) / geometry.grid.aspect() + geometry.grid.center()
    }

    /// A position on the ray, in `unit`s from the grid's centre.
    fn position(&self, sheet: f64) -> DVec3 {
        self.ray.origin + self.ray.depth(&self.frame.geometry, sheet) * self.ray.along
    }

    /// A colour shaded by a gradient at a position on the ray in a slab, unless the ray enters the slab through a cut whose face is not shaded.
    pub(super) fn shaded(&self, color: DVec3, gradient: DVec3, (slab, sheet): (i32, f64)) -> DVec3 {
        if self.face == Some(slab) {
            return color;
        }
        shading::color(&self.frame.scene, color, gradient, self.to_eye(), self.frame.lights.left(self.position(sheet)))
    }

    /// The unit vector towards the eye.
    pub fn to_eye(&self) -> DVec3 {
        -self.ray.along.normalize()
    }

    /// The step along the ray from plane to plane, in voxels along each axis.
    pub fn step(&self) -> DVec3 {
        (self.at(1.0) - self.at(0.0)).abs()
    }

    /// The depth of a position along w, in `unit`s from the eye (orthographic: from the camera's centre).
    pub fn depth(&self, sheet: f64) -> f64 {
        self.ray.depth(&self.frame.geometry, sheet)
    }

    /// The tables of the voxel whose cell contains a position.
    pub fn tables(&self, sheet: f64) -> Tables<'a> {
        self.tables_at(self.at(sheet))
    }

    /// Those for the middle of the stretch; where cells meet, those of the last.
    pub fn middle_tables(&self) -> Tables<'a> {
        self.tables_at(self.at((self.stretch.start + self.stretch.end) / 2.0) + HAIR_OF_CELL)
    }

    fn tables_at(&self, at: DVec3) -> Tables<'a> {
        let cell = || nearest(&self.frame.geometry.grid, at) as usize;
        let label = self.frame.volume.labels().map(|labels| labels[cell()]);
        self.frame.transfer.tables(label)
    }

    /// The frame.
    pub fn frame(&self) -> &'a Frame<'a> {
        self.frame
    }

    /// f where the ray meets a plane.
    pub fn value(&self, plane: i32) -> Option<f64> {
        self.frame.field.value(self.at(plane.into()), &self.frame.low_pass(plane)?)
    }

    /// ∇f where the ray meets a plane that has a value there.
    pub fn gradient(&self, plane: i32) -> DVec3 {
        self.frame.low_pass(plane).map_or(DVec3::ZERO, |rule| self.frame.field.gradient(self.at(plane.into()), &rule))
    }

    /// The colour and A where the ray meets a plane that has a value there, if voxels have their own (SPEC §10).
    pub fn color(&self, plane: i32) -> Option<DVec4> {
        self.frame.field.color(self.at(plane.into()), &self.frame.low_pass(plane)?)
    }

    /// Those of a slab: the mean of its two planes'.
    pub fn slab_color(&self, slab: &Slab) -> Option<DVec4> {
        let [near, far] = slab.planes;
        Some((self.color(near)? + self.color(far)?) / 2.0)
    }

    /// f and ∇f where the ray meets a plane.
    pub fn sample(&self, plane: i32) -> Option<Sample> {
        self.value(plane).map(|value| Sample { value, gradient: self.gradient(plane) })
    }

    /// The values at the planes of a slab.
    pub fn slab(&self, number: i32) -> Option<Slab> {
        Slab::new(number, self.value(number), self.value(number + 1))
    }

    /// The gradients at the two planes of a slab.
    pub fn gradients(&self, slab: &Slab) -> [DVec3; 2] {
        let [near, far] = slab.planes;
        let first = self.gradient(near);
        [first, if near == far { first } else { self.gradient(far) }]
    }

    /// The segments of a slab: by the cubic profile two halves, unless the slab shows nothing.
    pub fn segments(&self, slab: &Slab) -> Vec<Segment> {
        if self.frame.scene.splatting.slab_profile == SlabProfile::Linear || self.means(slab).is_none() {
            return vec![Segment { ends: [0.0, 1.0], values: slab.values }];
        }
        // The middle of the cubic through both values and slopes.
        let ([f0, f1], [g0, g1]) = (slab.values, self.gradients(slab));
        let way = (self.at(1.0) - self.at(0.0)) * self.frame.geometry.grid.spacing;
        let middle = (f0 + f1) / 2.0 + (g0 - g1).dot(way) / 8.0;
        vec![Segment { ends: [0.0, 0.5], values: [f0, middle] }, Segment { ends: [0.5, 1.0], values: [middle, f1] }]
    }

    /// The tables for the middle of the stretch in a slab.
    fn slab_tables(&self, slab: i32) -> Tables<'a> {
        let shown = self.shown(slab);
        self.tables((shown.start + shown.end) / 2.0)
    }

    /// The means over the values between a slab's planes.
    fn means(&self, slab: &Slab) -> Option<SlabIntegral> {
        let compositing = self.frame.scene.splatting.compositing;
        SlabIntegral::new(&self.slab_tables(slab.number), compositing, slab.values)
    }

    /// A slab's sheets, `(C·m, m)·ℓ`, one for each segment, with the part of the ray that it shows; none if the slab shows nothing.
    pub fn sheets(&self, slab: &Slab) -> Vec<(Range<f64>, DVec4)> {
        let (scene, shown, first) = (&self.frame.scene, self.shown(slab.number), f64::from(slab.number));
        if shown.is_empty() || self.means(slab).is_none() {
            return Vec::new();
        }
        let tables = self.slab_tables(slab.number);
        let own = self.slab_color(slab);
        let needs_gradients = scene.shading.enabled || tables.gradient_opacity.is_some();
        let gradients = needs_gradients.then(|| self.gradients(slab));
        let sheet = |Segment { ends, values }: Segment| {
            let part = shown.start.max(first + ends[0])..shown.end.min(first + ends[1]);
            let means = SlabIntegral::new(&tables, scene.splatting.compositing, values);
            let Some(means) = means.filter(|_| part.start < part.end) else { return (part, DVec4::ZERO) };
            let (mut amount, mut color) = (means.amount, means.color);
            if let Some(own) = own {
                (amount, color) = (amount * own.w, own.truncate());
            }
            if let Some([near, far]) = gradients {
                let place = ends[0] + (ends[1] - ends[0]) * means.share;
                let gradient = near.lerp(far, place);
                amount *= tables.gradient_opacity.map_or(1.0, |ramp| ramp.at(gradient.length()));
                color = self.shaded(color, gradient, (slab.number, first + place));
            }
            let length = (part.end - part.start) * self.length_per_sheet;
            (part, color.extend(1.0) * amount * length)
        };
        self.segments(slab).into_iter().map(sheet).collect()
    }
}

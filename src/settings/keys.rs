//! The keys of `[camera]`, `[clip]`, `[shading]` and `[splatting]` in scene files. Lengths are in the volume's world units, or in its smallest voxel spacing.

use std::ops::Bound::{Excluded, Included};

use super::camera::Fit;
use super::camera_table::CameraTable;
use super::clip::Clip;
use super::economies::Economies;
use super::key::Slot::{Crop, Direction, Given, Light, Number, Planes, Switch, Vector};
use super::key::{Key, Keyed, choice, key};
use super::shading::{Gradient, Shading};
use super::splatting::{
    Classification, Compositing, FootprintBox, FootprintForm, Interpolation, Method, Order, Rasterizer, SlabProfile,
    Splatting,
};
use crate::error::setting::Interval;

const FOV_Y: Interval = Interval::new(Excluded(0.0), Excluded(180.0)).of("degrees");
const LIGHT_SPREAD: Interval = Interval::new(Included(0.0), Included(64.0));
const LIGHT_STEP: Interval = Interval::new(Included(0.5), Included(16.0));
const RADIUS: Interval = Interval::new(Included(1.0), Included(4.0));
const FALLOFF: Interval = Interval::new(Excluded(0.0), Included(16.0));
const SLAB_WIDTH: Interval = Interval::new(Included(0.05), Included(8.0));

pub(crate) const FITS: &[(&str, Fit)] = &[("volume", Fit::Volume), ("object", Fit::Object)];
pub(crate) const METHODS: &[(&str, Method)] = &[
    ("image-aligned", Method::ImageAligned),
    ("axis-aligned", Method::AxisAligned),
    ("composite-every-sample", Method::CompositeEverySample),
];
pub(crate) const CLASSIFICATIONS: &[(&str, Classification)] =
    &[("before", Classification::Before), ("after", Classification::After)];
pub(crate) const INTERPOLATIONS: &[(&str, Interpolation)] =
    &[("smooth", Interpolation::Smooth), ("exact", Interpolation::Exact), ("auto", Interpolation::Auto)];
/// Whether a label's normals are those of its membership.
pub(crate) const LABEL_GRADIENTS: &[(&str, bool)] = &[("differences", false), ("membership", true)];
pub(crate) const PROFILES: &[(&str, SlabProfile)] = &[("linear", SlabProfile::Linear), ("cubic", SlabProfile::Cubic)];
pub(crate) const GRADIENTS: &[(&str, Gradient)] =
    &[("differences", Gradient::Differences), ("kernel", Gradient::Kernel), ("membership", Gradient::Membership)];
pub(crate) const FORMS: &[(&str, FootprintForm)] =
    &[("summed-area", FootprintForm::SummedArea), ("sections", FootprintForm::Sections)];
pub(crate) const COMPOSITINGS: &[(&str, Compositing)] = &Compositing::ALL;
/// Whether rays run through an eye.
pub(crate) const PROJECTIONS: &[(&str, bool)] = &[("orthographic", false), ("perspective", true)];
/// Whether the most significant byte of a sample comes first.
pub(crate) const ENDIANS: &[(&str, bool)] = &[("little", false), ("big", true)];
pub(crate) const ORDERS: &[(&str, Order)] =
    &[("front-to-back", Order::FrontToBack), ("back-to-front", Order::BackToFront)];
pub(crate) const RASTERIZERS: &[(&str, Rasterizer)] =
    &[("auto", Rasterizer::Auto), ("quads", Rasterizer::Quads), ("tiles", Rasterizer::Tiles)];
pub(crate) const BOXES: &[(&str, FootprintBox)] =
    &[("rectangle", FootprintBox::Rectangle), ("parallelogram", FootprintBox::Parallelogram)];

impl Keyed for CameraTable {
    const KEYS: &'static [Key<Self>] = &[
        key!("projection", is_perspective, choice(PROJECTIONS), "Parallel rays, or rays through an eye"),
        key!("direction", camera.direction, Direction, "The way from the eye into the scene"),
        key!("up", camera.up, Direction, "Up on the screen; not parallel to direction"),
        key!("center", camera.center, Vector(Interval::FINITE), "The world point at the image's centre"),
        key!("fit", camera.fit, choice(FITS), "Which box fills the picture: all, or all visible"),
        key!(height, Given(Interval::POSITIVE), "World units over the image's height"),
        key!(fov_y, Number(FOV_Y), "Perspective: degrees over the image's height"),
        key!(distance, Given(Interval::POSITIVE), "Perspective: world units from the eye to center"),
        key!(near, Given(Interval::POSITIVE), "Perspective: world units to the near plane"),
    ];
}

impl Keyed for Clip {
    const KEYS: &'static [Key<Self>] = &[
        key!(planes, Planes, "Planes [nx, ny, nz, d], which keep n·p + d ≥ 0, in world units"),
        key!(crop, Crop, "The lower and the upper corner of the box that is kept, in world units"),
        key!(shade_faces, Switch, "Whether cut faces are shaded, or show the slice's own colours"),
    ];
}

impl Keyed for Shading {
    const KEYS: &'static [Key<Self>] = &[
        key!(enabled, Switch, "Whether voxels are shaded"),
        key!(light, Light, "The direction towards the light"),
        key!(ambient, Number(Interval::NOT_NEGATIVE), "The part of the colour that needs no light"),
        key!(diffuse, Number(Interval::NOT_NEGATIVE), "The weight of diffuse light"),
        key!(specular, Number(Interval::NOT_NEGATIVE), "The weight of the highlight"),
        key!(shininess, Number(Interval::POSITIVE), "The exponent of the highlight"),
        key!(gradient, choice(GRADIENTS), "Where normals come from; kernel needs classification after"),
        key!(occlusion, Number(Interval::SHARE), "How much matter in front dims ambient light"),
        key!(occlusion_spread, Number(LIGHT_SPREAD), "The spread of ambient light: smallest spacings² per spacing"),
        key!(shadow, Number(Interval::SHARE), "How much matter towards the light dims other light"),
        key!(shadow_spread, Number(LIGHT_SPREAD), "The softness of shadows: smallest spacings² per spacing"),
        key!(light_step, Number(LIGHT_STEP), "The distance of light sheets, in smallest voxel spacings"),
    ];
}

impl Keyed for Splatting {
    const KEYS: &'static [Key<Self>] = &[
        key!(method, choice(METHODS), "Which voxels share a sheet"),
        key!(radius, Number(RADIUS), "The kernel's radius, in voxels"),
        key!(falloff, Number(FALLOFF), "The exponent of the kernel's Gaussian"),
        key!(slab_width, Number(SLAB_WIDTH), "The slabs' width along a ray, in smallest voxel spacings"),
        key!(slab_profile, choice(PROFILES), "How values run between slab planes, with classification after"),
        key!(classification, choice(CLASSIFICATIONS), "Whether voxels are classified, or what a pixel sees of them"),
        key!(
            interpolation,
            choice(INTERPOLATIONS),
            "Whether voxels keep their exact values, with classification after"
        ),
        key!(footprint, choice(FORMS), "How kernel sections are stored"),
        key!(compositing, choice(COMPOSITINGS), "How sheets become the picture"),
        key!(order, choice(ORDERS), "The order in which sheets are composited"),
        key!(opacity_threshold, Number(Interval::THRESHOLD), "The opacity from which a pixel hides what is behind it"),
        key!(culling, Switch, "Whether hidden voxels are left out"),
        key!(tiles, Switch, "Whether only tiles that a group of sheets touches are composited"),
        key!(rasterizer, choice(RASTERIZERS), "How the GPU draws kernel sections"),
        key!(footprint_box, choice(BOXES), "The pixels that culling tests"),
    ];
}

impl Keyed for Economies {
    const KEYS: &'static [Key<Self>] = &[
        key!(whole_below, Number(Interval::SHARE), "Voxels of a lower opacity are projected whole"),
        key!(beta, Number(Interval::THRESHOLD), "Voxels behind this opacity are projected whole"),
        key!(resolution, Number(Interval::SHARE), "Footprints end where they add less alpha"),
    ];
}

/// The name of a choice.
pub(crate) fn name_of<T: Copy + PartialEq>(choices: &[(&'static str, T)], choice: T) -> &'static str {
    choices.iter().find(|(_, other)| *other == choice).map_or("", |(name, _)| name)
}

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
        key("projection", "Parallel rays, or rays through the eye", |c| choice(PROJECTIONS, &mut c.is_perspective)),
        key("direction", "From the eye into the scene", |c| Direction(&mut c.camera.direction)),
        key("up", "Up on the screen, not parallel to direction", |c| Direction(&mut c.camera.up)),
        key("center", "The world point at the image's centre", |c| Vector(Interval::FINITE, &mut c.camera.center)),
        key("fit", "What the keys that are not stated show", |c| choice(FITS, &mut c.camera.fit)),
        key("height", "World units over the image's height", |c| Given(Interval::POSITIVE, &mut c.height)),
        key("fov_y", "Perspective: degrees over the image's height", |c| Number(FOV_Y, &mut c.fov_y)),
        key("distance", "Perspective: world units from the eye to center", |c| {
            Given(Interval::POSITIVE, &mut c.distance)
        }),
        key("near", "Perspective: world units to the near plane", |c| Given(Interval::POSITIVE, &mut c.near)),
    ];
}

impl Keyed for Clip {
    const KEYS: &'static [Key<Self>] = &[
        key("planes", "Planes [nx, ny, nz, d], which keep n·p + d ≥ 0, in world units", |c| Planes(&mut c.planes)),
        key("crop", "The lower and the upper corner of the box that is kept, in world units", |c| Crop(&mut c.crop)),
        key("shade_faces", "Whether cut faces are shaded, or show the slice's own colours", |c| {
            Switch(&mut c.shade_faces)
        }),
    ];
}

impl Keyed for Shading {
    const KEYS: &'static [Key<Self>] = &[
        key("enabled", "Whether voxels are shaded", |s| Switch(&mut s.enabled)),
        key("light", "The direction towards the light", |s| Light(&mut s.light)),
        key("ambient", "The share of the colour without light", |s| Number(Interval::NOT_NEGATIVE, &mut s.ambient)),
        key("diffuse", "The weight of diffuse light", |s| Number(Interval::NOT_NEGATIVE, &mut s.diffuse)),
        key("specular", "The weight of the highlight", |s| Number(Interval::NOT_NEGATIVE, &mut s.specular)),
        key("shininess", "The exponent of the highlight", |s| Number(Interval::POSITIVE, &mut s.shininess)),
        key(
            "gradient",
            "What gives normals: kernel only with classification after, membership only for label maps",
            |s| choice(GRADIENTS, &mut s.gradient),
        ),
        key("occlusion", "How much matter in front dims ambient light", |s| Number(Interval::SHARE, &mut s.occlusion)),
        key("occlusion_spread", "How far ambient light spreads, in squared smallest voxel spacings per spacing", |s| {
            Number(LIGHT_SPREAD, &mut s.occlusion_spread)
        }),
        key("shadow", "How much matter towards the light dims other light", |s| Number(Interval::SHARE, &mut s.shadow)),
        key("shadow_spread", "How soft shadows are, in squared smallest voxel spacings per spacing", |s| {
            Number(LIGHT_SPREAD, &mut s.shadow_spread)
        }),
        key("light_step", "The distance of light sheets, in smallest voxel spacings", |s| {
            Number(LIGHT_STEP, &mut s.light_step)
        }),
    ];
}

impl Keyed for Splatting {
    const KEYS: &'static [Key<Self>] = &[
        key("method", "Which voxels share a sheet", |s| choice(METHODS, &mut s.method)),
        key("radius", "The kernel's radius, in voxels", |s| Number(RADIUS, &mut s.radius)),
        key("falloff", "The exponent of the kernel's Gaussian", |s| Number(FALLOFF, &mut s.falloff)),
        key("slab_width", "In smallest voxel spacings along a ray", |s| Number(SLAB_WIDTH, &mut s.slab_width)),
        key("slab_profile", "How values run between slab planes, with classification after", |s| {
            choice(PROFILES, &mut s.slab_profile)
        }),
        key("classification", "Whether voxels are classified, or what a pixel sees of them", |s| {
            choice(CLASSIFICATIONS, &mut s.classification)
        }),
        key("interpolation", "Whether each voxel keeps its exact value, with classification after", |s| {
            choice(INTERPOLATIONS, &mut s.interpolation)
        }),
        key("footprint", "How kernel sections are stored", |s| choice(FORMS, &mut s.footprint)),
        key("compositing", "How sheets become a pixel", |s| choice(COMPOSITINGS, &mut s.compositing)),
        key("order", "The order of the sheets", |s| choice(ORDERS, &mut s.order)),
        key("opacity_threshold", "The opacity from which a pixel hides what is behind it", |s| {
            Number(Interval::THRESHOLD, &mut s.opacity_threshold)
        }),
        key("culling", "Whether hidden voxels are left out", |s| Switch(&mut s.culling)),
        key("tiles", "Whether only tiles that a group of sheets touches are composited", |s| Switch(&mut s.tiles)),
        key("rasterizer", "How the GPU draws kernel sections", |s| choice(RASTERIZERS, &mut s.rasterizer)),
        key("footprint_box", "The pixels that culling tests", |s| choice(BOXES, &mut s.footprint_box)),
    ];
}

impl Keyed for Economies {
    const KEYS: &'static [Key<Self>] = &[
        key("whole_below", "Voxels of a lower opacity are projected whole", |e| {
            Number(Interval::SHARE, &mut e.whole_below)
        }),
        key("beta", "Voxels behind this opacity are projected whole", |e| Number(Interval::THRESHOLD, &mut e.beta)),
        key("resolution", "The least alpha that a footprint adds", |e| Number(Interval::SHARE, &mut e.resolution)),
    ];
}

/// The name of a choice.
pub(crate) fn name_of<T: Copy + PartialEq>(choices: &[(&'static str, T)], choice: T) -> &'static str {
    choices.iter().find(|(_, other)| *other == choice).map_or("", |(name, _)| name)
}

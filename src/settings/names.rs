//! The names of choices in scene files.

use crate::settings::camera::Fit;
use crate::settings::shading::Gradient;
use crate::settings::splatting::{
    Classification, Compositing, FootprintBox, FootprintForm, Interpolation, Method, Order, Rasterizer, SlabProfile,
};

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

/// The name of a choice.
pub(crate) fn name_of<T: Copy + PartialEq>(choices: &[(&'static str, T)], choice: T) -> &'static str {
    choices.iter().find(|(_, other)| *other == choice).map_or("", |(name, _)| name)
}

//! What is kept of a volume under a transfer function (§5, Table 1), and which part of it each sheet looks at: value lists, bricks,
//! buckets, and the plans that the rasterizers draw a frame by. Plain data, made without a GPU.

pub mod brick;
pub mod bucket;
pub mod classify;
pub(crate) mod extent;
pub mod iso_range;
pub mod matter;
pub mod patch_bins;
pub mod quad_plan;
pub mod value_list;

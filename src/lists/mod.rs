//! The lists that are kept of a volume under a transfer function (§5, Table 1), and the parts of them that each sheet visits: value lists,
//! bricks, buckets, and the rasterizers' plans of a frame. All of it is plain data, made without a GPU.

pub mod brick;
pub mod brick_union;
pub mod bucket;
pub mod classify;
pub(crate) mod extent;
pub mod iso_range;
pub mod patch_bins;
pub mod quad_plan;
pub mod value_list;

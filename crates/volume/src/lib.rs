//! Volumes by themselves: readers of files, stores that are read by boxes, series, and procedural volumes. No renderer, no GPU.
//!
//! [`Volume::open`] reads a whole file, [`open_store`] reads boxes of one. Every reader is bounded: a damaged or hostile file gives a [`VolumeError`] that names
//! the file, the field, what was found and what is allowed, and never takes more memory than [`ReadOptions::memory`].
//!
//! ```
//! use sheetsplat_volume::{Volume, glam::{DVec3, UVec3}};
//!
//! let volume = Volume::from_values("ramp", UVec3::new(4, 1, 1), DVec3::ONE, vec![0_u8, 1, 2, 3])?;
//! assert_eq!(volume.value(UVec3::new(2, 0, 0)), 2.0);
//! # Ok::<(), sheetsplat_volume::VolumeError>(())
//! ```

mod access;
mod adapted;
mod address;
mod assumed;
mod borders;
pub mod builtin;
mod channels;
mod coefficients;
mod colors;
mod counts;
mod data_files;
#[cfg(feature = "dicom")]
mod dicom;
mod display;
mod encoding;
mod error;
mod fields;
mod file;
mod folder;
mod format;
mod grid;
mod guard;
mod half;
mod head;
mod identity;
mod index;
mod inputs;
mod label_facts;
mod label_gradients;
mod label_ids;
mod label_table;
mod labels;
mod loaded;
mod located;
mod membership;
mod memory;
#[cfg(feature = "metaimage")]
mod metaimage;
#[cfg(feature = "mgh")]
mod mgh;
#[cfg(feature = "nifti")]
mod nifti;
#[cfg(feature = "npy")]
pub mod npy;
#[cfg(feature = "npy")]
pub mod npz;
mod nrrd;
mod numbered;
mod numbers;
mod open;
mod orientation;
mod outputs;
pub mod parallel;
pub mod range;
mod raw;
mod resample;
mod rounding;
mod sample;
mod sample_type;
mod samples;
mod seek;
mod series;
mod shear;
mod source;
mod store;
mod stream;
mod stream_series;
mod streamed;
mod texel;
mod text;
#[cfg(feature = "tiff")]
mod tiff;
mod turned;
#[cfg(any(feature = "dicom", feature = "vtk"))]
mod uneven;
mod unit;
mod value_slice;
mod values;
mod volume;
mod voxel;
mod voxels;
#[cfg(feature = "vtk")]
mod vtk;
#[cfg(any(feature = "tiff", feature = "vtk"))]
mod xml;
#[cfg(feature = "zarr")]
mod zarr;
#[cfg(any(feature = "npy", feature = "zarr"))]
mod zip;

pub use access::ReadOptions;
pub use adapted::ChunkProgress;
pub use channels::Channels;
pub use counts::StoreCounts;
pub use display::ChannelDisplay;
pub use encoding::Encoding;
pub use error::setting::{Allowed, Found, Interval, SettingError};
pub use error::volume::VolumeError;
pub use file::{BytesRead, Files};
pub use grid::Grid;
pub use index::{IndexedStore, StoreIndex};
pub use inputs::Inputs;
pub use label_table::LabelTable;
pub use labels::Labels;
pub use membership::Members;
pub use open::open_store;
pub use orientation::{Orientation, PatientSide};
pub use outputs::Outputs;
pub use raw::{RawLayout, open_raw_store};
pub use sample::sample;
pub use sample_type::SampleType;
pub use store::{Store, StoreFacts, StoreLevel};
pub use streamed::{StreamedChannel, StreamedLevel, StreamedVolume};
pub use texel::Texel;
pub use value_slice::{ValueIter, ValueSlice};
pub use values::Values;
pub use volume::Volume;

pub use glam;

/// Items that only the renderer needs. They are not part of the public interface and change without notice.
#[doc(hidden)]
pub mod internals {
    pub use crate::access::Access;
    pub use crate::adapted::AdaptedStore;
    pub use crate::address::{archive_and_inner, builtin_name, is_address, written_in};
    pub use crate::borders::are_sharp;
    pub use crate::error::setting;
    pub use crate::format::levels;
    pub use crate::grid::{SIZES, dims_of};
    pub use crate::grid::{SPACING, check_spacing};
    /// Files, whatever names lead to them.
    pub mod identity {
        pub use crate::identity::{folder, resolved};
    }
    pub use crate::labels::labels_of;
    pub use crate::membership::MEMBERSHIP_REACH;
    #[cfg(feature = "npy")]
    pub use crate::npy;
    #[cfg(feature = "npy")]
    pub use crate::npz;
    pub use crate::open::{store, stores};
    pub use crate::parallel;
    pub use crate::range;
    pub use crate::raw::raw_store;
    pub use crate::resample::Resampling;
    pub use crate::sample_type::Sample;
    pub use crate::series::Selection;
    pub use crate::streamed::{Thinned, check_grids, sample_of_channels};
    pub use crate::texel::COLOR_BYTES;
    pub use crate::text::{plain, plain_lines, plain_whole};
    pub use crate::unit::unit;
    pub use crate::volume::HollowChannel;
}

//! Scalar volumes: dimensions, spacing and values, without any appearance. They are a crate by themselves, `sheetsplat-volume`.

#[doc(inline)]
pub use sheetsplat_volume::{
    BytesRead, ChannelDisplay, Channels, ChunkProgress, Encoding, Files, Grid, IndexedStore, Inputs, LabelTable,
    Labels, Members, Orientation, Outputs, PatientSide, RawLayout, ReadOptions, SampleType, Store, StoreFacts,
    StoreIndex, StoreLevel, StreamedChannel, StreamedLevel, StreamedVolume, Texel, ValueIter, ValueSlice, Values,
    Volume, VolumeError, builtin, open_raw_store, open_store, sample,
};

#[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
pub(crate) use sheetsplat_volume::internals::HollowChannel;
#[cfg(feature = "golden")]
pub(crate) use sheetsplat_volume::internals::archive_and_inner;
pub(crate) use sheetsplat_volume::internals::{
    Access, AdaptedStore, COLOR_BYTES, MEMBERSHIP_REACH, Resampling, SIZES, SPACING, Selection, Thinned, are_sharp,
    builtin_name, check_grids, check_spacing, dims_of, is_address, labels_of, levels, range, raw_store,
    sample_of_channels, store, stores, written_in,
};
#[cfg(feature = "codecs")]
pub(crate) use sheetsplat_volume::internals::{npy, npz};
#[cfg(feature = "cpu")]
pub(crate) use sheetsplat_volume::{for_type, internals::Sample};

//! The elements that are kept, by tag.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::super::VolumeError;
use super::super::error::volume::invalid;
use super::super::text::{number, shown};

/// A group and an element in one number.
pub(super) type Tag = u32;

macro_rules! tags {
    ($($constant:ident = $tag:literal $name:literal,)*) => {
        /// The elements that are kept, and the sequences that hold them.
        pub(super) mod tags {
            $(pub(in super::super) const $constant: super::Tag = $tag;)*
        }

        /// An element's name in the standard, if it is kept.
        pub(super) fn name(tag: Tag) -> Option<&'static str> {
            match tag {
                $($tag => Some($name),)*
                _ => None,
            }
        }
    };
}

tags! {
    MEDIA_SOP_CLASS = 0x0002_0002 "MediaStorageSOPClassUID",
    TRANSFER_SYNTAX = 0x0002_0010 "TransferSyntaxUID",
    IMAGE_TYPE = 0x0008_0008 "ImageType",
    SOP_CLASS = 0x0008_0016 "SOPClassUID",
    SOP_INSTANCE = 0x0008_0018 "SOPInstanceUID",
    ACQUISITION_TIME = 0x0008_0032 "AcquisitionTime",
    MODALITY = 0x0008_0060 "Modality",
    SERIES_DESCRIPTION = 0x0008_103e "SeriesDescription",
    FRAME_TYPE = 0x0008_9007 "FrameType",
    COMPLEX_COMPONENT = 0x0008_9208 "ComplexImageComponent",
    SLICE_THICKNESS = 0x0018_0050 "SliceThickness",
    ECHO_TIME = 0x0018_0081 "EchoTime",
    ECHO_NUMBERS = 0x0018_0086 "EchoNumbers",
    SPACING_BETWEEN_SLICES = 0x0018_0088 "SpacingBetweenSlices",
    TRIGGER_TIME = 0x0018_1060 "TriggerTime",
    IMAGER_SPACING = 0x0018_1164 "ImagerPixelSpacing",
    EFFECTIVE_ECHO_TIME = 0x0018_9082 "EffectiveEchoTime",
    B_VALUE = 0x0018_9087 "DiffusionBValue",
    GRADIENT = 0x0018_9089 "DiffusionGradientOrientation",
    GRADIENTS = 0x0018_9076 "DiffusionGradientDirectionSequence",
    ECHO = 0x0018_9114 "MREchoSequence",
    DIFFUSION = 0x0018_9117 "MRDiffusionSequence",
    CARDIAC = 0x0018_9118 "CardiacSynchronizationSequence",
    MR_FRAME_TYPE = 0x0018_9226 "MRImageFrameTypeSequence",
    SERIES = 0x0020_000e "SeriesInstanceUID",
    SERIES_NUMBER = 0x0020_0011 "SeriesNumber",
    ACQUISITION_NUMBER = 0x0020_0012 "AcquisitionNumber",
    INSTANCE_NUMBER = 0x0020_0013 "InstanceNumber",
    POSITION = 0x0020_0032 "ImagePositionPatient",
    ORIENTATION = 0x0020_0037 "ImageOrientationPatient",
    TEMPORAL_POSITION = 0x0020_0100 "TemporalPositionIdentifier",
    FRAME_CONTENT = 0x0020_9111 "FrameContentSequence",
    PLANE_POSITION = 0x0020_9113 "PlanePositionSequence",
    TEMPORAL_INDEX = 0x0020_9128 "TemporalPositionIndex",
    TRIGGER_DELAY = 0x0020_9153 "NominalCardiacTriggerDelayTime",
    PLANE_ORIENTATION = 0x0020_9116 "PlaneOrientationSequence",
    SAMPLES_PER_PIXEL = 0x0028_0002 "SamplesPerPixel",
    PHOTOMETRIC = 0x0028_0004 "PhotometricInterpretation",
    PLANAR = 0x0028_0006 "PlanarConfiguration",
    FRAMES = 0x0028_0008 "NumberOfFrames",
    ROWS = 0x0028_0010 "Rows",
    COLUMNS = 0x0028_0011 "Columns",
    PIXEL_SPACING = 0x0028_0030 "PixelSpacing",
    BITS_ALLOCATED = 0x0028_0100 "BitsAllocated",
    BITS_STORED = 0x0028_0101 "BitsStored",
    HIGH_BIT = 0x0028_0102 "HighBit",
    PIXEL_REPRESENTATION = 0x0028_0103 "PixelRepresentation",
    INTERCEPT = 0x0028_1052 "RescaleIntercept",
    SLOPE = 0x0028_1053 "RescaleSlope",
    RESCALE_TYPE = 0x0028_1054 "RescaleType",
    RED_DESCRIPTOR = 0x0028_1101 "RedPaletteColorLookupTableDescriptor",
    GREEN_DESCRIPTOR = 0x0028_1102 "GreenPaletteColorLookupTableDescriptor",
    BLUE_DESCRIPTOR = 0x0028_1103 "BluePaletteColorLookupTableDescriptor",
    RED_TABLE = 0x0028_1201 "RedPaletteColorLookupTableData",
    GREEN_TABLE = 0x0028_1202 "GreenPaletteColorLookupTableData",
    BLUE_TABLE = 0x0028_1203 "BluePaletteColorLookupTableData",
    MODALITY_LUT = 0x0028_3000 "ModalityLUTSequence",
    LUT_DESCRIPTOR = 0x0028_3002 "LUTDescriptor",
    LUT_DATA = 0x0028_3006 "LUTData",
    PIXEL_MEASURES = 0x0028_9110 "PixelMeasuresSequence",
    PIXEL_TRANSFORMATION = 0x0028_9145 "PixelValueTransformationSequence",
    ENERGY_WINDOW_VECTOR = 0x0054_0010 "EnergyWindowVector",
    DETECTORS = 0x0054_0022 "DetectorInformationSequence",
    PHASE_VECTOR = 0x0054_0030 "PhaseVector",
    TIME_SLOT_VECTOR = 0x0054_0070 "TimeSlotVector",
    SLICE_VECTOR = 0x0054_0080 "SliceVector",
    TIME_SLICE_VECTOR = 0x0054_0100 "TimeSliceVector",
    FRAME_REFERENCE_TIME = 0x0054_1300 "FrameReferenceTime",
    SEGMENTATION_TYPE = 0x0062_0001 "SegmentationType",
    SEGMENTS = 0x0062_0002 "SegmentSequence",
    SEGMENT_NUMBER = 0x0062_0004 "SegmentNumber",
    SEGMENT_LABEL = 0x0062_0005 "SegmentLabel",
    SEGMENT_IDENTIFICATION = 0x0062_000a "SegmentIdentificationSequence",
    REFERENCED_SEGMENT = 0x0062_000b "ReferencedSegmentNumber",
    RECOMMENDED_COLOR = 0x0062_000d "RecommendedDisplayCIELabValue",
    MAX_FRACTION = 0x0062_000e "MaximumFractionalValue",
    OFFSETS = 0x3004_000c "GridFrameOffsetVector",
    DOSE_SCALING = 0x3004_000e "DoseGridScaling",
    SHARED_GROUPS = 0x5200_9229 "SharedFunctionalGroupsSequence",
    FRAME_GROUPS = 0x5200_9230 "PerFrameFunctionalGroupsSequence",
    FLOAT_PIXEL_DATA = 0x7fe0_0008 "FloatPixelData",
    DOUBLE_PIXEL_DATA = 0x7fe0_0009 "DoubleFloatPixelData",
    PIXEL_DATA = 0x7fe0_0010 "PixelData",
}

/// The kept elements of a file or of an item in it.
pub(super) struct Dataset {
    path: Arc<Path>,
    big_endian: bool,
    pub(super) values: BTreeMap<Tag, Vec<u8>>,
    pub(super) items: BTreeMap<Tag, Vec<Dataset>>,
}

impl Dataset {
    /// An empty data set of a file in one of the two byte orders.
    pub(super) fn new(path: Arc<Path>, big_endian: bool) -> Self {
        Self { path, big_endian, values: BTreeMap::new(), items: BTreeMap::new() }
    }

    /// A value as text, without padding.
    pub(super) fn text(&self, tag: Tag) -> Option<String> {
        let text = String::from_utf8_lossy(self.values.get(&tag)?).into_owned();
        Some(text.trim_matches([' ', '\0']).to_owned()).filter(|text| !text.is_empty())
    }

    /// A value that is one number of 16 bits.
    pub(super) fn unsigned(&self, tag: Tag) -> Result<Option<u16>, VolumeError> {
        let Some(value) = self.values.get(&tag) else { return Ok(None) };
        match *value.as_slice() {
            [low, high] if !self.big_endian => Ok(Some(u16::from_le_bytes([low, high]))),
            [high, low] => Ok(Some(u16::from_be_bytes([high, low]))),
            _ => Err(self.invalid(tag, format!("{} bytes", value.len()), "one number of 2 bytes")),
        }
    }

    /// A value that is numbers of 16 bits.
    pub(super) fn shorts(&self, tag: Tag) -> Option<Vec<u16>> {
        let number = if self.big_endian { u16::from_be_bytes } else { u16::from_le_bytes };
        let value = self.values.get(&tag)?;
        Some(value.as_chunks().0.iter().map(|&bytes| number(bytes)).collect())
    }

    /// A value that is N finite numbers written as text.
    pub(super) fn numbers<const N: usize>(&self, tag: Tag) -> Result<Option<[f64; N]>, VolumeError> {
        let Some(numbers) = self.list(tag, N)? else { return Ok(None) };
        Ok(numbers.try_into().ok())
    }

    /// A value that is a number of finite numbers written as text.
    pub(super) fn list(&self, tag: Tag, count: usize) -> Result<Option<Vec<f64>>, VolumeError> {
        let Some(text) = self.text(tag) else { return Ok(None) };
        let numbers: Option<Vec<f64>> = text.split('\\').map(number).collect();
        let numbers = numbers.filter(|numbers| numbers.len() == count);
        numbers.map(Some).ok_or_else(|| self.invalid(tag, shown(&text), format!("finite numbers, {count} of them")))
    }

    /// A value of binary numbers of 4 bytes (whole) or 8 (floats), as text.
    pub(super) fn binary(&self, tag: Tag) -> Option<String> {
        let value = self.values.get(&tag)?;
        let order = |bytes: &[u8]| if self.big_endian { bytes.iter().rev().copied().collect() } else { bytes.to_vec() };
        let texts: Vec<String> = match value.len() {
            4 => value
                .as_chunks()
                .0
                .iter()
                .map(|word: &[u8; 4]| u32::from_le_bytes(order(word).try_into().unwrap_or_default()).to_string())
                .collect(),
            _ => value
                .as_chunks()
                .0
                .iter()
                .map(|word: &[u8; 8]| f64::from_le_bytes(order(word).try_into().unwrap_or_default()).to_string())
                .collect(),
        };
        Some(texts.join("\\")).filter(|text| !text.is_empty())
    }

    /// The items of a sequence; empty if the sequence is missing.
    pub(super) fn items(&self, tag: Tag) -> &[Self] {
        self.items.get(&tag).map_or(&[], Vec::as_slice)
    }

    pub(super) fn invalid(
        &self,
        tag: Tag,
        found: impl std::fmt::Display,
        allowed: impl std::fmt::Display,
    ) -> VolumeError {
        invalid(&self.path, &shown_tag(tag), found, allowed)
    }

    pub(super) fn missing(&self, tag: Tag, allowed: &str) -> VolumeError {
        self.invalid(tag, "no such element", allowed)
    }
}

/// An element's name in errors.
pub(super) fn shown_tag(tag: Tag) -> String {
    name(tag).map_or_else(|| format!("element ({:04x},{:04x})", tag >> 16, tag & 0xffff), str::to_owned)
}

//! The types of samples: the numbers in a file.

use std::fmt::{self, Display, Formatter};

/// A number as stored in a file.
pub trait Sample: Copy {
    /// The nearest `f32`.
    fn to_f32(self) -> f32;
    /// The nearest `f64`.
    fn to_f64(self) -> f64;

    /// The number if it is whole and at least 0: the id of a label.
    fn to_id(self) -> Option<u64>;

    /// Whether all numbers of the type are whole.
    const IS_WHOLE: bool;

    /// Whether some are no `f32`.
    const MAY_ROUND: bool;

    /// The difference between the number, if it is whole, and the nearest `f32`; else 0.
    fn error_if_whole(self) -> f64;
}

macro_rules! sample_types {
    ($($name:ident: $type:ty = $text:literal),*) => {
        /// The type of the samples in a file, displayed as in scene files: `int8`, `float32`.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[non_exhaustive]
        pub enum SampleType {
            $(#[doc = concat!("`", $text, "`")] $name),*
        }

        impl Display for SampleType {
            fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
                f.write_str(match self {
                    $(Self::$name => $text),*
                })
            }
        }

        impl SampleType {
            /// All types by name.
            #[doc(hidden)]
            pub const NAMED: [(&'static str, Self); 11] = [$(($text, Self::$name)),*];
        }

    };
}

macro_rules! primitive_samples {
    ($($type:ty),*) => {
        $(impl Sample for $type {
            fn to_f32(self) -> f32 {
                self as f32
            }

            fn to_f64(self) -> f64 {
                self as f64
            }

            fn to_id(self) -> Option<u64> {
                // Every other type has a double for each of its numbers.
                if Self::IS_WHOLE && size_of::<$type>() == 8 {
                    return (self as f64 >= 0.0).then_some(self as u64);
                }
                id_of(self as f64)
            }

            const IS_WHOLE: bool = 0.5_f64 as $type as f64 == 0.0;
            const MAY_ROUND: bool = size_of::<$type>() > 4 || size_of::<$type>() == 4 && Self::IS_WHOLE;

            fn error_if_whole(self) -> f64 {
                let whole = self as i128;
                if whole as $type == self { whole.abs_diff(self.to_f32() as i128) as f64 } else { 0.0 }
            }
        })*
    };
}

/// The whole number from 0 on that a double is, if it is one.
fn id_of(value: f64) -> Option<u64> {
    const END: f64 = 18_446_744_073_709_551_616.0;
    let id = value as u64;
    ((0.0..END).contains(&value) && id as f64 == value).then_some(id)
}

sample_types!(
    I8: i8 = "int8",
    U8: u8 = "uint8",
    I16: i16 = "int16",
    U16: u16 = "uint16",
    I32: i32 = "int32",
    U32: u32 = "uint32",
    I64: i64 = "int64",
    U64: u64 = "uint64",
    F16: crate::half::Half = "float16",
    F32: f32 = "float32",
    F64: f64 = "float64"
);
primitive_samples!(i8, u8, i16, u16, i32, u32, i64, u64, f32, f64);

/// Every one is an `f32`.
impl Sample for crate::half::Half {
    const IS_WHOLE: bool = false;
    const MAY_ROUND: bool = false;

    fn to_f32(self) -> f32 {
        self.value()
    }

    fn to_f64(self) -> f64 {
        self.value().into()
    }

    fn to_id(self) -> Option<u64> {
        self.value().to_id()
    }

    fn error_if_whole(self) -> f64 {
        0.0
    }
}

/// Evaluates an expression in which a name stands for the type of a [`SampleType`]. It is compiled for each type.
macro_rules! for_sample_type {
    (@ $kind:expr, $type:ident => $result:expr; $($name:ident: $of:ty),*) => {
        match $kind {
            $($crate::sample_type::SampleType::$name => {
                type $type = $of;
                $result
            })*
        }
    };
    ($kind:expr, $type:ident => $result:expr) => {
        for_sample_type!(@ $kind, $type => $result;
            I8: i8, U8: u8, I16: i16, U16: u16, I32: i32, U32: u32, I64: i64, U64: u64, F16: $crate::half::Half, F32: f32, F64: f64)
    };
}
pub(crate) use for_sample_type;

impl SampleType {
    /// The size of a sample in bytes.
    pub(super) fn bytes(self) -> u64 {
        for_sample_type!(self, Number => size_of::<Number>() as u64)
    }

    /// The number that stands for a full colour: an integer's maximum; 1 for floats.
    pub(super) fn full(self) -> f64 {
        match self {
            Self::F16 | Self::F32 | Self::F64 => 1.0,
            _ => for_sample_type!(self, Number => Number::MAX.to_f64()),
        }
    }

    /// The numbers of which `bytes` are a whole number of samples.
    #[cfg(feature = "vtk")]
    pub(super) fn numbers(self, bytes: &[u8], big_endian: bool) -> Vec<f64> {
        let ordered = |sample: &[u8]| {
            let mut sample = sample.to_vec();
            if big_endian {
                sample.reverse();
            }
            sample
        };
        let bytes: Vec<u8> = bytes.chunks_exact(self.bytes() as usize).flat_map(ordered).collect();
        for_sample_type!(self, Number => {
            bytes.as_chunks().0.iter().map(|&sample| Number::from_le_bytes(sample).to_f64()).collect()
        })
    }

    /// Appends the bytes, in the machine's order, of a sample written as text.
    pub(super) fn parse(self, text: &str, into: &mut Vec<u8>) -> Option<()> {
        for_sample_type!(self, Number => into.extend(text.parse::<Number>().ok()?.to_ne_bytes()));
        Some(())
    }
}

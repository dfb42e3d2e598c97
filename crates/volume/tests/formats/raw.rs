//! Raw files, as NumPy writes them.

use sheetsplat_volume::{RawLayout, SampleType};

use crate::*;

const LAYOUT: RawLayout = RawLayout { dims: DIMS, sample_type: SampleType::F32, big_endian: true, offset: 7 };

#[test]
fn of_numpy() {
    let volume = Volume::open_raw(&fixture("float32-big-7.raw"), &LAYOUT).unwrap();
    assert_eq!((volume.dims(), volume.values(), volume.spacing()), (DIMS, (&values()).into(), DVec3::ONE));
    assert_eq!(volume.orientation(), None);
}

#[test]
fn every_type_both_byte_orders() {
    let folder = Folder::new();
    macro_rules! check {
        ($($type:ty: $sample_type:ident);*) => {$(
            let samples: Vec<$type> = [<$type>::MIN, 0 as $type, <$type>::MAX].map(|x| x.clamp(f32::MIN as $type, f32::MAX as $type)).into();
            let expected: Vec<f32> = samples.iter().map(|&sample| sample as f32).collect();
            for (big_endian, to_bytes) in
                [(false, <$type>::to_le_bytes as fn($type) -> [u8; size_of::<$type>()]), (true, <$type>::to_be_bytes)]
            {
                let bytes: Vec<u8> = samples.iter().flat_map(|&sample| to_bytes(sample)).collect();
                let (dims, sample_type) = (UVec3::new(1, 3, 1), SampleType::$sample_type);
                let layout = RawLayout { dims, sample_type, big_endian, offset: 0 };
                let volume = Volume::open_raw(&folder.write("a.raw", &[&bytes]), &layout).unwrap();
                assert_eq!(volume.values(), expected, "{layout:?}");
            }
        )*};
    }
    check!(i8: I8; u8: U8; i16: I16; u16: U16; i32: I32; u32: U32; i64: I64; u64: U64; f32: F32; f64: F64);
}

/// The file must end where the samples do.
#[test]
fn wrong_sizes() {
    let deep = |z: u32| RawLayout { dims: UVec3::new(5, 4, z), ..LAYOUT };
    let from = |offset: u64| RawLayout { offset, ..LAYOUT };
    for (layout, found, allowed) in [
        (deep(4), "240 bytes", "320 bytes (80 samples of 4)"),
        (deep(2), "240 bytes", "160 bytes"),
        (RawLayout { dims: UVec3::splat(1600), ..LAYOUT }, "240 bytes", "16384000000 bytes"),
        (from(0), "247 bytes", "240 bytes"),
        (from(8), "239 bytes", "240 bytes"),
        (from(i64::MAX as u64), "0 bytes", "240 bytes"),
        (RawLayout { sample_type: SampleType::F64, ..LAYOUT }, "240 bytes", "480 bytes"),
    ] {
        let result = Volume::open_raw(&fixture("float32-big-7.raw"), &layout);
        assert_refused(result, "float32-big-7.raw", "data", found, allowed);
    }
    let empty = RawLayout { dims: UVec3::new(5, 0, 3), ..LAYOUT };
    let result = Volume::open_raw(&fixture("float32-big-7.raw"), &empty);
    assert_refused(result, "float32-big-7.raw", "sizes", "[5, 0, 3]", "three positive integers");
}

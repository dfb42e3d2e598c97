#![no_main]

use sheetsplat::volume::{RawLayout, SampleType, Volume};

// The first bytes say what the others are.
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some(([x, y, z, kind, offset], samples)) = bytes.split_first_chunk() else { return };
    let kinds = [SampleType::I8, SampleType::U16, SampleType::I32, SampleType::F32, SampleType::F64, SampleType::U64];
    let layout = RawLayout {
        dims: [*x, *y, *z].map(u32::from).into(),
        sample_type: kinds[usize::from(*kind) % kinds.len()],
        big_endian: kind & 0x80 != 0,
        offset: (*offset).into(),
    };
    sheetsplat_fuzz::volume("volume.raw", samples, |path| Volume::open_raw(path, &layout));
});

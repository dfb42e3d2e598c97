//! Raw files, as NumPy writes them, in scenes.

use sheetsplat::scene::{Scene, SceneError, VolumeSource};
use sheetsplat::volume::{RawLayout, SampleType};

use crate::*;

const KEYS: &str = "dims = [5, 4, 3]\ntype = 'float32'\nendian = 'big'\noffset = 7\n";

fn parse(keys: &str) -> Result<Scene, SceneError> {
    let path = format!("[volume]\npath = '{}'\n", fixture("float32-big-7.raw").display());
    Scene::parse(&format!("{path}{keys}"), "scene.toml", Path::new(""), &[])
}

#[test]
fn of_numpy() {
    let volume = parse(&format!("{KEYS}spacing = [0.5, 2, 3]")).unwrap().load_volume().unwrap();
    assert_eq!((volume.dims(), volume.values(), volume.spacing()), (DIMS, (&values()).into(), SPACING));
    assert_eq!(volume.orientation(), None);
}

#[test]
fn every_type_both_byte_orders() {
    let folder = Folder::new();
    let path = folder.0.path().join("a.raw");
    macro_rules! check {
        ($($type:ty: $name:literal, $sample_type:ident);*) => {$(
            let samples: Vec<$type> = [<$type>::MIN, 0 as $type, <$type>::MAX].map(|x| x.clamp(f32::MIN as $type, f32::MAX as $type)).into();
            let expected: Vec<f32> = samples.iter().map(|&sample| sample as f32).collect();
            for (endian, to_bytes) in
                [("little", <$type>::to_le_bytes as fn($type) -> [u8; size_of::<$type>()]), ("big", <$type>::to_be_bytes)]
            {
                fs::write(&path, samples.iter().flat_map(|&sample| to_bytes(sample)).collect::<Vec<_>>()).unwrap();
                let text = format!("volume = {{path = 'a.raw', dims = [1, 3, 1], type = '{}', endian = '{endian}'}}", $name);
                let scene = Scene::parse(&text, "scene.toml", folder.0.path(), &[]).unwrap();
                let (dims, sample_type, big_endian) = (UVec3::new(1, 3, 1), SampleType::$sample_type, endian == "big");
                let layout = RawLayout { dims, sample_type, big_endian, offset: 0 };
                assert_eq!(scene.volume, VolumeSource::Raw(path.clone(), layout));
                assert_eq!(scene.load_volume().unwrap().values(), expected, "{text}");
            }
        )*};
    }
    check!(
        i8: "int8", I8; u8: "uint8", U8; i16: "int16", I16; u16: "uint16", U16; i32: "int32", I32; u32: "uint32", U32;
        i64: "int64", I64; u64: "uint64", U64; f32: "float32", F32; f64: "float64", F64
    );
}

/// The file must end where the samples do.
#[test]
fn wrong_sizes() {
    for (from, to, found, allowed) in [
        ("[5, 4, 3]", "[5, 4, 4]", "240 bytes", "320 bytes (80 samples of 4)"),
        ("[5, 4, 3]", "[5, 4, 2]", "240 bytes", "160 bytes"),
        ("[5, 4, 3]", "[1600, 1600, 1600]", "240 bytes", "16384000000 bytes"),
        ("offset = 7", "offset = 0", "247 bytes", "240 bytes"),
        ("offset = 7", "offset = 8", "239 bytes", "240 bytes"),
        ("offset = 7", "offset = 9223372036854775807", "0 bytes", "240 bytes"),
        ("float32", "float64", "240 bytes", "480 bytes"),
    ] {
        let result = parse(&KEYS.replace(from, to)).unwrap().load_volume();
        assert_refused(result, "float32-big-7.raw", "data", found, allowed);
    }
    let layout = RawLayout { dims: UVec3::new(5, 0, 3), sample_type: SampleType::U8, big_endian: false, offset: 0 };
    let result = Volume::open_raw(&fixture("float32-big-7.raw"), &layout);
    assert_refused(result, "float32-big-7.raw", "sizes", "[5, 0, 3]", "three positive integers");
}

#[test]
fn wrong_keys() {
    for (from, to, key, found, allowed) in [
        ("[5, 4, 3]", "[5, 4]", "volume.dims", "[5, 4]", "three positive integers"),
        ("[5, 4, 3]", "[5, 4, 0]", "volume.dims", "[5, 4, 0]", "three positive integers"),
        ("[5, 4, 3]", "[5, 4, -3]", "volume.dims", "-3", "three positive integers"),
        ("[5, 4, 3]", "[5, 4, 1.5]", "volume.dims[2]", "1.5 (float)", "three positive integers"),
        ("[5, 4, 3]", "[65536, 65536, 1]", "volume.dims", "65536", "at most 4294967295 voxels"),
        ("dims = [5, 4, 3]", "", "volume.dims", "no such key", "the sizes of a raw file"),
        ("float32", "float16", "volume.type", "float16", "\"uint8\" or"),
        ("type = 'float32'", "", "volume.type", "no such key", "\"uint8\" or"),
        ("big", "middle", "volume.endian", "middle", "\"little\" or \"big\""),
        ("endian = 'big'", "", "volume.endian", "no such key", "\"little\" or \"big\""),
        ("offset = 7", "offset = -7", "volume.offset", "-7", "an integer >= 0"),
        ("offset = 7", "offset = '7'", "volume.offset", "string", "an integer >= 0"),
    ] {
        assert!(KEYS.contains(from), "{from}");
        let error = parse(&KEYS.replace(from, to)).unwrap_err();
        let SceneError::Invalid { key: at, found: what, allowed: instead, .. } = &error else { panic!("{error}") };
        assert_eq!(at, key, "{error}");
        assert!(what.contains(found) && instead.to_string().contains(allowed), "{error}");
    }
    let builtin = Scene::parse(&format!("[volume]\nbuiltin = 'cube'\n{KEYS}"), "", Path::new(""), &[]).unwrap_err();
    assert!(builtin.to_string().contains("volume.dims: found a volume that is not a file"), "{builtin}");
    // A single byte has no order; and an override of the volume removes the whole layout.
    assert!(parse(&KEYS.replace("float32", "int8").replace("endian = 'big'\n", "")).is_ok());
    let text = format!("[volume]\npath = 'a.raw'\n{KEYS}");
    let sets = ["volume.builtin=cube".to_owned()];
    let scene = Scene::parse(&text, "", Path::new(""), &sets).unwrap();
    assert_eq!(scene.volume, VolumeSource::Builtin("cube".to_owned()));
}

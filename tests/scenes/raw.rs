//! The keys of raw files.

use std::path::Path;

use glam::{DVec3, UVec3};
use sheetsplat::scene::{Scene, SceneError, VolumeSource};
use sheetsplat::volume::{RawLayout, SampleType};

use crate::{DIMS, fixture, values};

const KEYS: &str = "dims = [5, 4, 3]\ntype = 'float32'\nendian = 'big'\noffset = 7\n";

fn parse(keys: &str) -> Result<Scene, SceneError> {
    let path = format!("[volume]\npath = '{}'\n", fixture("float32-big-7.raw").display());
    Scene::parse(&format!("{path}{keys}"), "scene.toml", Path::new(""), &[])
}

#[test]
fn keys_say_how_a_file_is_read() {
    let volume = parse(&format!("{KEYS}spacing = [0.5, 2, 3]")).unwrap().load_volume().unwrap();
    let spacing = DVec3::new(0.5, 2.0, 3.0);
    assert_eq!((volume.dims(), volume.values(), volume.spacing()), (DIMS, (&values()).into(), spacing));
    let message = parse(&KEYS.replace("[5, 4, 3]", "[5, 4, 4]")).unwrap().load_volume().unwrap_err().to_string();
    let expected = "float32-big-7.raw: data: found 240 bytes, allowed: 320 bytes (80 samples of 4)";
    assert!(message.contains(expected), "{message}");
}

#[test]
fn every_type_both_byte_orders() {
    use SampleType::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
    let folder = Path::new("folder");
    for (name, sample_type) in [
        ("int8", I8),
        ("uint8", U8),
        ("int16", I16),
        ("uint16", U16),
        ("int32", I32),
        ("uint32", U32),
        ("int64", I64),
        ("uint64", U64),
        ("float32", F32),
        ("float64", F64),
    ] {
        for (endian, big_endian) in [("little", false), ("big", true)] {
            let keys = format!("path = 'a.raw', dims = [1, 3, 1], type = '{name}', endian = '{endian}'");
            let scene = Scene::parse(&format!("volume = {{{keys}}}"), "scene.toml", folder, &[]).unwrap();
            let layout = RawLayout { dims: UVec3::new(1, 3, 1), sample_type, big_endian, offset: 0 };
            assert_eq!(scene.channels[0].volume, VolumeSource::Raw(folder.join("a.raw"), layout));
        }
    }
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
        ("float32", "float8", "volume.type", "float8", "\"uint8\" or"),
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
    assert_eq!(scene.channels[0].volume, VolumeSource::Builtin("cube".to_owned()));
}

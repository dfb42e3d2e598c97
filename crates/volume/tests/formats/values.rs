//! Volumes keep their values in the fewest bits that hold every one of them, exactly.

use sheetsplat_volume::{RawLayout, ReadOptions, SampleType, ValueSlice, Values};

use crate::*;

fn volume_of(values: impl Into<Values>) -> Volume {
    let values = values.into();
    let dims = UVec3::new(values.as_slice().len() as u32, 1, 1);
    Volume::from_values("test", dims, DVec3::ONE, values).unwrap()
}

/// The bits of some values; those of all holes are the same.
fn bits(values: ValueSlice<'_>) -> Vec<u32> {
    values.iter().map(|value| if value.is_finite() { value.to_bits() } else { f32::NAN.to_bits() }).collect()
}

/// The bytes of a value of each volume, whatever type its values are given in.
#[test]
fn the_fewest_bits_that_hold_every_value() {
    let below_two_powers: Vec<f32> = (0..24).map(|power| 2.0_f32.powi(power) - 1.0).collect();
    let cases: [(&[f32], usize); 17] = [
        (&[0.0], 1),
        (&[0.0, 255.0], 1),
        (&[0.0, 256.0], 2),
        (&[-1.0, 127.0], 1),
        (&[-128.0, 0.0], 1),
        (&[-1.0, 128.0], 2),
        (&[-129.0, 5.0], 2),
        (&[0.0, 65535.0], 2),
        (&[0.0, 65536.0], 4),
        (&[-32768.0, 32767.0], 2),
        (&[-1.0, 32768.0], 4),
        (&[-32769.0, 0.0], 4),
        (&[1.0, 0.5], 4),
        (&[0.0, -0.0], 4),
        (&[7.0, f32::NAN], 4),
        (&[7.0, f32::INFINITY, f32::MAX], 4),
        (&below_two_powers, 4),
    ];
    for (values, bytes) in cases {
        let volume = volume_of(values.to_vec());
        assert_eq!(volume.values().bytes(), bytes * values.len(), "{values:?}");
        assert_eq!(bits(volume.values()), bits(values.into()), "{values:?}");
        assert_eq!(Volume::new("test", volume.dims(), DVec3::ONE, values.to_vec()).unwrap(), volume);
    }
    assert_eq!(volume_of(vec![0_u16, 255]).values().bytes(), 2);
    assert_eq!(volume_of(vec![-128_i16, 127]).values().bytes(), 2);
    assert_eq!(volume_of(vec![-1_i16, 255]).values().bytes(), 4);
}

#[test]
fn every_number_of_every_type_is_itself() {
    let (all_u8, all_i8) = ((0..=u8::MAX).collect::<Vec<_>>(), (i8::MIN..=i8::MAX).collect::<Vec<_>>());
    let (all_u16, all_i16) = ((0..=u16::MAX).collect::<Vec<_>>(), (i16::MIN..=i16::MAX).collect::<Vec<_>>());
    let cases: [(Values, usize, i32); 4] =
        [(all_u8.into(), 1, 0), (all_i8.into(), 1, -128), (all_u16.into(), 2, 0), (all_i16.into(), 2, -32768)];
    for (values, bytes, first) in cases {
        let volume = volume_of(values);
        let (values, count) = (volume.values(), volume.values().len());
        let expected: Vec<f32> = (0..count as i32).map(|at| (first + at) as f32).collect();
        assert_eq!((values.bytes(), values), (bytes * count, (&expected).into()));
        assert_eq!(values.to_vec(), expected);
        assert!((0..count).all(|at| values.at(at) == expected[at]));
        assert!(values.iter().rev().eq(expected.iter().rev().copied()));
        assert_eq!(values.iter().len(), count);
        assert_eq!(values.slice(3..count - 5), expected[3..count - 5]);
        assert!(values.chunks(100).zip(expected.chunks(100)).all(|(a, b)| a == b));
        assert_eq!(values.chunks(100).len(), count.div_ceil(100));
        assert_eq!(values.iter().nth(200), Some(expected[200]));
    }
}

/// A volume whose values become `f32` only with the last of several pieces in which they are read and change their type.
#[test]
fn values_change_their_type_when_one_needs_more_bits() {
    const COUNT: usize = 300_000;
    let folder = Folder::new();
    let path = folder.0.path().join("values.raw");
    let dims = UVec3::new(COUNT as u32, 1, 1);
    for last in
        [[200.0, 255.0], [200.0, -1.0], [-1.0, 300.0], [256.0, 65535.0], [65535.0, -1.0], [1e9, 1.0], [0.5, 3.0]]
    {
        let mut values: Vec<f64> = (0..COUNT).map(|at| (at % 101) as f64).collect();
        values[COUNT - 2..].copy_from_slice(&last);
        let expected: Vec<f32> = values.iter().map(|&value| value as f32).collect();
        fs::write(&path, values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>()).unwrap();
        let layout = RawLayout { dims, sample_type: SampleType::F64, big_endian: false, offset: 0 };
        let volume = Volume::open_raw(&path, &layout).unwrap();
        assert!(volume.values() == expected, "{last:?}");
        let bytes = volume.values().bytes() / COUNT;
        let fits = |low: f64, high: f64| last.iter().all(|value| value.fract() == 0.0 && (low..=high).contains(value));
        let expected = match () {
            () if fits(0.0, 255.0) || fits(-128.0, 127.0) => 1,
            () if fits(0.0, 65535.0) || fits(-32768.0, 32767.0) => 2,
            () => 4,
        };
        assert_eq!(bytes, expected, "{last:?}");
    }
}

/// Files of 8 and 16 bits are read in a memory of as many bytes as their voxels have, and in no smaller one.
#[test]
fn files_take_the_bytes_of_their_samples() {
    let folder = Folder::new();
    let path = folder.0.path().join("values.raw");
    let cases =
        [(SampleType::U8, 1), (SampleType::I8, 1), (SampleType::U16, 2), (SampleType::I16, 2), (SampleType::U32, 4)];
    for (sample_type, bytes) in cases {
        fs::write(&path, vec![1; 60 * bytes]).unwrap();
        let layout = RawLayout { dims: DIMS, sample_type, big_endian: false, offset: 0 };
        let options = |memory: usize| ReadOptions::default().with_memory(memory as u64);
        let volume = Volume::open_raw_with(&path, &layout, &options(60 * bytes)).unwrap();
        assert_eq!(volume.values().bytes(), 60 * bytes, "{sample_type}");
        let error = Volume::open_raw_with(&path, &layout, &options(60 * bytes - 1)).unwrap_err().to_string();
        assert!(error.contains(&format!("which take {} bytes", 60 * bytes)), "{error}");
    }
}

/// Whole numbers after slope and intercept take as few bits as others.
#[test]
fn rescaled_values_that_are_whole() {
    let folder = Folder::new();
    let header = |slope: f32, intercept: f32| {
        let mut file = fs::read(fixture("sform.nii")).unwrap();
        file[112..116].copy_from_slice(&slope.to_le_bytes());
        file[116..120].copy_from_slice(&intercept.to_le_bytes());
        folder.open("a.nii", &file).unwrap()
    };
    for (slope, intercept, bytes) in [(1.0, 0.0, 1), (1.0, -1024.0, 2), (2.0, 3.0, 2), (0.5, 0.0, 4), (1000.0, 0.0, 4)]
    {
        let volume = header(slope, intercept);
        let expected: Vec<f32> = values().iter().map(|value| value * slope + intercept).collect();
        assert_eq!((volume.values(), volume.values().bytes()), ((&expected).into(), 60 * bytes), "{slope} {intercept}");
    }
}

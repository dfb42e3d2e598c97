//! Labels beyond 16 bits, such as those of Allen's atlases: kept as places among all, and told by the numbers of the file.

use std::path::PathBuf;

use glam::{DVec3, UVec3};
use sheetsplat_volume::{Labels, ReadOptions, SampleType, Volume};

use super::{Folder, warned};

/// Regions of Allen's atlas of a mouse's brain; the last two differ beyond the 24 bits of an `f32`.
const IDS: [u64; 4] = [0, 997, 312_782_546, 312_782_547];

/// The sizes of the blocks, and their regions: 12 × 4 × 3 voxels, a quarter of x each.
const DIMS: UVec3 = UVec3::new(12, 4, 3);

fn region(index: u32) -> usize {
    (index % 12 / 3) as usize
}

fn bytes(kind: SampleType, id: u64) -> Vec<u8> {
    match kind {
        SampleType::U32 => (id as u32).to_le_bytes().to_vec(),
        SampleType::I64 => (id as i64).to_le_bytes().to_vec(),
        SampleType::U64 => id.to_le_bytes().to_vec(),
        _ => (id as f64).to_le_bytes().to_vec(),
    }
}

/// A NRRD file of the blocks, whose regions have these ids.
fn blocks(folder: &Folder, kind: SampleType, ids: [u64; 4], fields: &str) -> PathBuf {
    let name = if kind == SampleType::F64 { "double".to_owned() } else { kind.to_string() };
    let header = format!(
        "NRRD0004\ntype: {name}\ndimension: 3\nsizes: 12 4 3\nspacings: 1 1 1\nendian: little\nencoding: raw\n{fields}\n"
    );
    let samples: Vec<u8> = (0..144).flat_map(|index| bytes(kind, ids[region(index)])).collect();
    folder.write("ids.nrrd", &[header.as_bytes(), &samples])
}

const KINDS: [SampleType; 4] = [SampleType::U32, SampleType::I64, SampleType::U64, SampleType::F64];

/// The values are labels by their looks: blocks with sharp borders. No two regions become one.
#[test]
fn values_are_labels_of_any_size() {
    let folder = Folder::new();
    for kind in KINDS {
        let (volume, warnings) = warned(|| Volume::open(&blocks(&folder, kind, IDS, "")).unwrap());
        assert!(warnings.is_empty(), "{kind}: {warnings:?}");
        assert_eq!(volume.label_ids(), Some(&IDS[..]), "{kind}");
        for index in 0..144 {
            assert_eq!(volume.values().at(index as usize), region(index) as f32, "{kind}: {index}");
        }
        assert_eq!((volume.label_id(3), volume.label_of_id(312_782_547)), (312_782_547, Some(3)));
        assert_eq!((volume.label_of_id(3), volume.encoding().unwrap().sample_type), (None, kind));
    }
}

#[test]
fn the_largest_ids_are_exact() {
    let folder = Folder::new();
    let ids = [0, u64::MAX - 2, u64::MAX - 1, u64::MAX];
    let volume = Volume::open(&blocks(&folder, SampleType::U64, ids, "")).unwrap();
    assert_eq!(volume.label_ids(), Some(&ids[..]));
    // Seven bytes, as neurons of connectomes have.
    let ids = [0, 720_575_940_621_039_145, 720_575_940_621_039_146, 720_575_940_621_039_147];
    let volume = Volume::open(&blocks(&folder, SampleType::I64, ids, "")).unwrap();
    assert_eq!(volume.label_ids(), Some(&ids[..]));
}

/// Amounts that happen to be whole numbers stay values, with the warning that they are rounded.
#[test]
fn amounts_stay_amounts() {
    let folder = Folder::new();
    let header =
        "NRRD0004\ntype: uint32\ndimension: 3\nsizes: 12 4 3\nspacings: 1 1 1\nendian: little\nencoding: raw\n\n";
    let sample = |index: u32| 16_777_217 + 2 * (index.wrapping_mul(2_654_435_761) >> 12);
    let samples: Vec<u8> = (0..144).flat_map(|index| sample(index).to_le_bytes()).collect();
    let path = folder.write("counts.nrrd", &[header.as_bytes(), &samples]);
    let (volume, warnings) = warned(|| Volume::open(&path).unwrap());
    assert_eq!((volume.label_ids(), volume.values().at(7)), (None, sample(7) as f32));
    assert!(warnings.iter().any(|warning| warning.contains("rounded to float32")), "{warnings:?}");
}

/// Names and colours of segments are those of their ids, also where a file with one segment says that values are labels.
#[test]
fn names_and_colours_follow_their_ids() {
    let folder = Folder::new();
    let fields = "Segment0_LabelValue:=312782547\nSegment0_Name:=visual area\nSegment0_Color:=1 0.5 0\n";
    let path = blocks(&folder, SampleType::U32, [0, 0, 0, IDS[3]], fields);
    let volume = Volume::open(&path).unwrap();
    assert_eq!(volume.label_ids(), Some(&[0, IDS[3]][..]));
    assert!(volume.is_known_label_map());
    assert_eq!(volume.label_names().get(&1).map(String::as_str), Some("visual area"));
    assert_eq!(volume.palette(), Some(&[(1.0, DVec3::new(1.0, 0.5, 0.0))][..]));
}

/// Labels beside values keep their ids, names and colours; without a volume nothing could tell them.
#[test]
fn labels_beside_values_keep_their_ids() {
    let folder = Folder::new();
    let fields = "Segment0_LabelValue:=997\nSegment0_Name:=root\nSegment0_Color:=0 0 1\n";
    let access = sheetsplat_volume::internals::Access::new(&ReadOptions::default()).unwrap();
    for kind in KINDS {
        let path = blocks(&folder, kind, IDS, fields);
        let scan = Volume::new("scan", DIMS, DVec3::ONE, vec![1.0; 144]).unwrap();
        let volume = scan.with_labels_of(&path, false, &access).unwrap();
        assert_eq!(volume.label_ids(), Some(&IDS[..]), "{kind}");
        let expected: Vec<u16> = (0..144).map(|index| region(index) as u16).collect();
        assert_eq!(volume.labels(), Some(&expected[..]), "{kind}");
        assert_eq!(volume.label_names().get(&1).map(String::as_str), Some("root"));
        assert_eq!(volume.label_colors(), [(1.0, DVec3::Z)]);
        let allowed = "labels, whole numbers from 0 to 65535";
        let message = Labels::open(&path).unwrap_err().to_string();
        assert!(
            message.contains(&format!("ids.nrrd: data: found labels up to 312782547, allowed: {allowed}")),
            "{message}"
        );
    }
}

//! Segmentations as 3D Slicer writes them: overlapping segments lie in several layers, a first axis of the kind `list`.

use std::collections::BTreeMap;

use sheetsplat_volume::{Labels, ReadOptions, open_store};

use crate::*;

/// Two voxels of two layers. Label 1 is in each layer another segment; the keys are those that 3D Slicer 5 writes, and SimpleITK reads the same numbers.
const LAYERS: &str = "NRRD0004\ntype: uint8\ndimension: 4\nspace: left-posterior-superior\nsizes: 2 2 1 1\n\
    space directions: none (1,0,0) (0,1,0) (0,0,1)\nkinds: list domain domain domain\nencoding: raw\nspace origin: (0,0,0)\n\
    Segment0_Color:=1 0 0\nSegment0_LabelValue:=1\nSegment0_Layer:=0\nSegment0_Name:=liver\n\
    Segment1_Color:=0 1 0\nSegment1_LabelValue:=1\nSegment1_Layer:=1\nSegment1_Name:=lesion\n\
    Segment2_Color:=0 0 1\nSegment2_LabelValue:=2\nSegment2_Layer:=1\nSegment2_Name:=vein\n\n";

fn names(of: &[(u16, &str)]) -> BTreeMap<u16, String> {
    of.iter().map(|&(label, name)| (label, name.to_owned())).collect()
}

#[test]
fn every_layer_has_its_own_segments() {
    let folder = Folder::new();
    let path = folder.write("a.seg.nrrd", &[LAYERS.as_bytes(), &[1, 1, 0, 2]]);
    let volume = Volume::open(&path).unwrap();
    let layers: Vec<&Volume> = volume.channels().collect();
    let legends = [
        (names(&[(1, "liver")]), vec![(1.0, DVec3::X)]),
        (names(&[(1, "lesion"), (2, "vein")]), vec![(1.0, DVec3::Y), (2.0, DVec3::Z)]),
    ];
    assert_eq!(layers[0].values(), [1.0, 0.0]);
    assert_eq!(layers[1].values(), [1.0, 2.0]);
    for (number, (layer, (names, palette))) in layers.iter().zip(&legends).enumerate() {
        assert_eq!((layer.label_names(), layer.palette()), (names, Some(&palette[..])), "{number}");
        // The same by itself, as labels of another volume, and read by boxes.
        let options = ReadOptions::default().with_channel(number as u32);
        let alone = Volume::open_with(&path, &options).unwrap();
        assert_eq!((alone.label_names(), alone.palette()), (names, Some(&palette[..])), "{number}");
        assert_eq!(&Labels::open_with(&path, &options).unwrap().names, names, "{number}");
        let facts = open_store(&path, &options).unwrap().facts();
        assert_eq!((&facts.label_names, facts.palette.as_ref()), (names, Some(palette)), "{number}");
    }
}

/// In a file of one layer all segments are in it, whatever they state. One of several that states no layer lies in the first, and one that states no number in none.
#[test]
fn segments_without_a_layer_of_the_file() {
    let folder = Folder::new();
    let one = LAYERS.replace("dimension: 4", "dimension: 3").replace("sizes: 2 2", "sizes: 2");
    let one = one.replace("none (1", "(1").replace("list ", "");
    let volume = folder.open("a.nrrd", &[one.as_bytes(), &[1, 2]].concat()).unwrap();
    assert_eq!(volume.label_names().len(), 2);
    assert_eq!(volume.label_names().get(&2).unwrap(), "vein");
    let none = LAYERS.replace("Segment1_Layer:=1\n", "").replace("Segment2_Layer:=1", "Segment2_Layer:=x");
    let volume = folder.open("a.nrrd", &[none.as_bytes(), &[1, 1, 0, 2]].concat()).unwrap();
    assert_eq!(volume.label_names().len(), 1);
    let second = volume.channel(1).unwrap();
    assert_eq!((second.label_names(), second.palette()), (&BTreeMap::new(), None));
}

//! Spacings and units that a file states in several ways, and a scene's spacing in place of them.

use sheetsplat_volume::ReadOptions;
use sheetsplat_volume::internals::Access;

use crate::*;

/// A spacing that the scene states counts, whatever the file says: here one that is more than 10⁴ times another.
#[test]
fn a_stated_spacing_is_in_place_of_the_files() {
    let folder = Folder::new();
    let header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 1 1\nspacings: 1 1 99999\nencoding: raw\n\n";
    let path = folder.write("a.nrrd", &[header.as_bytes(), &[1, 2]]);
    assert_refused(Volume::open(&path), "a.nrrd", "spacing", "99999", "none above 10000 times another");
    let access = Access::new(&ReadOptions::default()).unwrap().of_spacing(Some(SPACING));
    assert_eq!(Volume::read(&path, &access).unwrap().spacing(), SPACING);
    // Levels keep their proportion.
    let store = Volume::read(&fixture("zarr/image-0.5.zarr"), &access.whole_at(0)).unwrap();
    assert_ne!(store.levels().len(), 0);
    let stated = Access::new(&ReadOptions::default()).unwrap().of_spacing(Some(2.0 * SPACING));
    assert_eq!(Volume::read(&fixture("zarr/image-0.5.zarr"), &stated).unwrap().spacing(), 2.0 * SPACING);
}

/// The store's image, of which the axes of space have these units.
fn open_zarr(units: [&str; 3]) -> (Volume, Vec<String>) {
    let axes = |(name, unit): (&str, &str)| format!(r#"{{"name": "{name}", "type": "space", "unit": "{unit}"}}"#);
    let axes: Vec<String> = ["z", "y", "x"].into_iter().zip(units).map(axes).collect();
    let scale = r#"[{"type": "scale", "scale": [500, 0.25, 0.5]}]"#;
    let datasets = format!(r#"[{{"path": "0", "coordinateTransformations": {scale}}}]"#);
    let attributes =
        format!(r#"{{"multiscales": [{{"version": "0.4", "axes": [{}], "datasets": {datasets}}}]}}"#, axes.join(", "));
    let array = r#"{"zarr_format": 2, "shape": [1, 1, 2], "chunks": [1, 1, 2], "dtype": "|u1", "compressor": null,
        "fill_value": 0, "order": "C", "filters": null}"#;
    let folder = Folder::new();
    fs::create_dir(folder.0.path().join("0")).unwrap();
    folder.write(".zgroup", &[br#"{"zarr_format": 2}"#]);
    folder.write(".zattrs", &[attributes.as_bytes()]);
    folder.write("0/.zarray", &[array.as_bytes()]);
    folder.write("0/0.0.0", &[&[1, 2]]);
    warned(|| Volume::open(folder.0.path()).unwrap_or_else(|error| panic!("{error}")))
}

#[test]
fn units_of_ome_zarr() {
    let (volume, warnings) = open_zarr(["nanometer", "micrometer", "micrometer"]);
    assert_near(volume.spacing(), DVec3::new(0.5, 0.25, 0.5));
    assert_eq!(volume.unit(), Some("µm"));
    assert_warned(&warnings, "lengths are converted to µm, the finest axis' unit");
    let (volume, warnings) = open_zarr(["", "micrometer", "micrometer"]);
    assert_near(volume.spacing(), DVec3::new(0.5, 0.25, 500.0));
    assert_eq!(volume.unit(), Some("µm"));
    assert_warned(&warnings, "an axis without a unit is taken to be in µm");
    let (volume, warnings) = open_zarr(["parsec", "micrometer", "micrometer"]);
    assert_eq!(volume.unit(), None);
    assert_warned(&warnings, "not all are lengths, so that no unit is taken");
    let (_, warnings) = open_zarr(["micrometer"; 3]);
    assert!(warnings.is_empty(), "{warnings:?}");
}

/// ITK notes that the series which it made a file of had uneven slices (`itk::ImageSeriesReader`), of which the file lacks the places.
#[test]
fn uneven_slices_of_itk() {
    let folder = Folder::new();
    let nrrd = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 1 1\nencoding: raw\nITK_non_uniform_sampling_deviation:=1.5\n\n\x01\x02";
    let meta = "ObjectType = Image\nNDims = 3\nBinaryData = True\nITK_non_uniform_sampling_deviation = 1.5\nDimSize = 2 1 1\n\
                ElementType = MET_UCHAR\nElementDataFile = LOCAL\n\x01\x02";
    for (name, file) in [("a.nrrd", nrrd), ("a.mha", meta)] {
        let (volume, warnings) = warned(|| folder.open(name, file.as_bytes()).unwrap());
        assert_eq!(volume.values(), [1.0, 2.0], "{name}");
        assert_warned(&warnings, "ITK_non_uniform_sampling_deviation: \"1.5\": its slices were not evenly spaced");
    }
}

/// Of MetaImage and VTK an axis without a spacing has the finest of the others, as of NRRD and OME-TIFF.
#[test]
fn axes_without_a_spacing() {
    let files = [
        ("a.mha", replaced("local.mha", "ElementSpacing = 0.5 2 3", "ElementSpacing = 0.5 2 0"), 0.5),
        ("a.vti", replaced("text.vti", "Spacing=\"0.5 2 3\"", "Spacing=\"0.5 2 0\""), 0.5),
        ("a.vtk", replaced("text.vtk", "SPACING 0.5 2 3", "SPACING 0.5 2 0"), 0.5),
    ];
    for (name, file, expected) in files {
        let (volume, warnings) = warned(|| Folder::new().open(name, &file).unwrap());
        assert_eq!(volume.spacing(), SPACING.with_z(expected), "{name}");
        assert_warned(&warnings, "an axis without a spacing is taken to have 0.5");
    }
}

//! Headers that promise as much as their compression could hold, before code that yields almost nothing.

use std::fs;

use glam::UVec3;
use sheetsplat_volume::{ReadOptions, Volume, open_store};

use crate::bounded::{ROOM, alone, bounded};
use crate::files::no_panic;

/// The number of bytes of code in every file.
const CODE: usize = 1 << 20;

#[test]
fn files_that_promise_too_much_are_refused() {
    let _alone = alone();
    let temporary = tempfile::tempdir().unwrap();
    let folder = temporary.path();
    let zeros = vec![0; CODE];
    // Empty blocks of stored bytes, a valid beginning of any stream.
    let stored: Vec<u8> = [0, 0, 0, 0xff, 0xff].iter().copied().cycle().take(CODE).collect();
    let deflate = |head: &[u8]| [head, &stored[head.len()..]].concat();
    let gzip = deflate(&[0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 3]);
    let zlib = deflate(&[0x78, 0x9c]);
    let noise: Vec<u8> = (0..CODE).map(|at| ((at * at) >> 3) as u8).collect();

    let nrrd = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 1000 1000 1000\nencoding: gzip\n\n";
    let meta_image = "ObjectType = Image\nNDims = 3\nBinaryData = True\nCompressedData = True\nDimSize = 1000 1000 1000\n\
                      ElementType = MET_UCHAR\nElementDataFile = LOCAL\n";
    let mut files = vec![
        ("gzip.nrrd".to_owned(), [nrrd.as_bytes(), &gzip].concat()),
        ("zlib.mha".to_owned(), [meta_image.as_bytes(), &zlib].concat()),
    ];
    for (compression, code) in [(5, &zeros), (5, &noise), (8, &zlib), (32773, &zeros), (32773, &noise)] {
        files.push((format!("{compression}.tif"), tiff(compression, code)));
    }
    for (compressor, code) in [("ZLib", &zlib), ("LZ4", &noise), ("LZ4", &vec![0xff; CODE])] {
        files.push((format!("{compressor}.vti"), image_data(compressor, code)));
    }
    for syntax in ["1.2.840.10008.1.2.5\0", "1.2.840.10008.1.2.4.70"] {
        files.push((format!("{}.dcm", syntax.trim_end_matches('\0')), dicom(syntax, &jpeg())));
        files.push(("zeros.dcm".to_owned(), dicom(syntax, &zeros)));
    }
    // The beginning of a lossless JPEG 2000 image of 30000 × 30000 samples.
    let codestream = jpeg_2000();
    for code in [&codestream, &zeros] {
        files.push(("jpeg2000.dcm".to_owned(), dicom("1.2.840.10008.1.2.4.90", code)));
    }
    for code in [&stored, &zeros, &noise] {
        files.push(("deflated.dcm".to_owned(), [&dicom_head("1.2.840.10008.1.2.1.99")[..], code].concat()));
    }
    files.push(("gzip.mgz".to_owned(), gzip.clone()));
    files.push(("short.mgh".to_owned(), mgh([1000, 1000, 1000])));
    for (name, bytes) in files {
        let path = folder.join(&name);
        fs::write(&path, &bytes).unwrap();
        let result = bounded(&name, bytes.len(), || Volume::open(&path), |_| 0);
        no_panic(&name, &result);
        assert!(result.is_err(), "{name}");
    }
}

/// Stores whose metadata promise more chunks, larger ones, or more chunks in a shard than anyone has, and a shard whose index leads beyond it.
#[test]
fn stores_that_promise_too_much_are_refused() {
    let _alone = alone();
    let temporary = tempfile::tempdir().unwrap();
    let folder = temporary.path();
    let array = |shape: &str, chunk: &str, codecs: &str| {
        format!(
            "{{\"zarr_format\":3,\"node_type\":\"array\",\"shape\":[{shape}],\"data_type\":\"uint8\",\"fill_value\":0,\
             \"chunk_grid\":{{\"name\":\"regular\",\"configuration\":{{\"chunk_shape\":[{chunk}]}}}},\
             \"chunk_key_encoding\":{{\"name\":\"default\"}},\"codecs\":[{codecs}]}}"
        )
    };
    let bytes = "{\"name\":\"bytes\"}";
    let little = "{\"name\":\"bytes\",\"configuration\":{\"endian\":\"little\"}}";
    let sharded = |chunk: &str| {
        format!(
            "{{\"name\":\"sharding_indexed\",\"configuration\":{{\"chunk_shape\":[{chunk}],\"codecs\":[{bytes}],\
             \"index_codecs\":[{little}],\"index_location\":\"end\"}}}}"
        )
    };
    let gzip = format!("{bytes},{{\"name\":\"gzip\",\"configuration\":{{\"level\":5}}}}");
    let far = [u64::MAX / 2, 100, u64::MAX, u64::MAX, 0, 1 << 40, 7, u64::MAX - 3].map(u64::to_le_bytes).concat();
    for (name, metadata, chunk) in [
        ("many", array("1000,1000,1000", "1,1,1", bytes), vec![0]),
        ("large", array("1000000,1000000,1000000", "1000000,1000000,1000000", bytes), vec![0; CODE]),
        ("deep", array("1000,1000,1000", "1000,1000,1000", &gzip), vec![0; CODE]),
        ("shards", array("4096,4096,4096", "4096,4096,4096", &sharded("1,1,1")), vec![0xff; CODE]),
        ("indices", array("2048,2048,2048", "2048,2048,2048", &sharded("16,16,16")), vec![0; CODE]),
        ("beyond", array("2,2,2", "2,2,2", &sharded("1,2,1")), far),
    ] {
        let path = folder.join(format!("{name}.zarr"));
        fs::create_dir_all(path.join("c/0/0")).unwrap();
        fs::write(path.join("zarr.json"), &metadata).unwrap();
        fs::write(path.join("c/0/0/0"), &chunk).unwrap();
        let size = metadata.len() + chunk.len();
        let options = ReadOptions::default().with_memory(ROOM as u64);
        let result = bounded(name, size, || Volume::open_with(&path, &options), |_| 0);
        assert!(result.is_err(), "{name}");
        // By boxes a store may be opened that does not fit.
        let store = bounded(name, size, || open_store(&path, &options), |_| 0);
        let Ok(store) = store else { continue };
        let side = UVec3::ONE.min(store.levels()[0].grid.dims);
        let read = bounded(name, size, || store.read(0, UVec3::ZERO, side, &mut [0.0]), |_| 0);
        assert!(read.is_err(), "{name}: {read:?}");
    }
}

/// One strip of the maximum size for 2³⁰ bytes.
fn tiff(compression: u32, code: &[u8]) -> Vec<u8> {
    let side = 1 << 15;
    let tags: [(u16, u32); 8] = [
        (256, side),
        (257, side),
        (258, 8),
        (259, compression),
        (262, 1),
        (273, 8),
        (278, side),
        (279, code.len() as u32),
    ];
    let mut bytes = [&b"II*\0"[..], &(8 + code.len() as u32).to_le_bytes(), code].concat();
    bytes.extend((tags.len() as u16).to_le_bytes());
    for (tag, value) in tags {
        bytes.extend(tag.to_le_bytes());
        bytes.extend(4_u16.to_le_bytes());
        bytes.extend(1_u32.to_le_bytes());
        bytes.extend(value.to_le_bytes());
    }
    bytes.extend([0; 4]);
    bytes
}

/// One block of 2²⁷ bytes.
fn image_data(compressor: &str, code: &[u8]) -> Vec<u8> {
    let header = format!(
        "<VTKFile type=\"ImageData\" compressor=\"vtk{compressor}DataCompressor\"><ImageData WholeExtent=\"0 511 0 511 0 511\">\
         <Piece Extent=\"0 511 0 511 0 511\"><PointData Scalars=\"a\"><DataArray Name=\"a\" type=\"UInt8\" \
         format=\"appended\" offset=\"0\"/></PointData></Piece></ImageData><AppendedData encoding=\"raw\">_"
    );
    let sizes = [1, 1_u32 << 27, 0, code.len() as u32].map(u32::to_le_bytes).concat();
    [header.as_bytes(), &sizes, code].concat()
}

/// The beginning of a lossless frame of 30000 × 30000 samples.
fn jpeg() -> Vec<u8> {
    let side = [0x75, 0x30];
    let frame = [&[0xff, 0xd8, 0xff, 0xc3, 0, 11, 16], &side[..], &side, &[1, 1, 0x11, 0]].concat();
    let scan = [0xff, 0xda, 0, 8, 1, 1, 0, 1, 0, 0];
    let mut bytes = [&frame[..], &scan].concat();
    bytes.resize(CODE, 0);
    bytes
}

/// The beginning of a DICOM file.
fn dicom_head(syntax: &str) -> Vec<u8> {
    let length = (syntax.len() as u16).to_le_bytes();
    [&[0; 128], &b"DICM\x02\0\x10\0UI"[..], &length, syntax.as_bytes()].concat()
}

fn jpeg_2000() -> Vec<u8> {
    let side = 30000_u32.to_be_bytes();
    let zero = [0; 4];
    let size =
        [&[0xff, 0x4f, 0xff, 0x51, 0, 41, 0, 0], &side[..], &side, &zero, &zero, &side, &side, &zero, &zero].concat();
    let component = [0, 1, 15, 1, 1];
    let style = [0xff, 0x52, 0, 12, 0, 0, 0, 1, 0, 5, 4, 4, 0, 1];
    let steps = [&[0xff, 0x5c, 0, 19, 0x40][..], &[0x80; 16]].concat();
    let tile = [0xff, 0x90, 0, 10, 0, 0, 0, 0, 0, 0, 0, 1, 0xff, 0x93];
    let mut bytes = [&size[..], &component, &style, &steps, &tile].concat();
    bytes.resize(CODE, 0);
    bytes
}

/// A header of 16-bit samples, with nothing after it.
fn mgh(sizes: [u32; 3]) -> Vec<u8> {
    let numbers = [1, sizes[0], sizes[1], sizes[2], 1, 4, 0].map(u32::to_be_bytes).concat();
    let mut bytes = numbers;
    bytes.resize(284, 0);
    bytes
}

/// A frame of 30000 × 30000 16-bit samples in one fragment.
fn dicom(syntax: &str, code: &[u8]) -> Vec<u8> {
    let element = |group: u16, element: u16, kind: &[u8], value: &[u8]| {
        let length = (value.len() as u16).to_le_bytes();
        [&group.to_le_bytes(), &element.to_le_bytes(), kind, &length, value].concat()
    };
    let number = |number: u16| number.to_le_bytes();
    let parts = [
        dicom_head(syntax),
        element(0x20, 0x32, b"DS", b"0\\0\\0 "),
        element(0x20, 0x37, b"DS", b"1\\0\\0\\0\\1\\0 "),
        element(0x28, 0x04, b"CS", b"MONOCHROME2 "),
        element(0x28, 0x10, b"US", &number(30000)),
        element(0x28, 0x11, b"US", &number(30000)),
        element(0x28, 0x30, b"DS", b"1\\1 "),
        element(0x28, 0x100, b"US", &number(16)),
        [0xe0, 0x7f, 0x10, 0x00, b'O', b'W', 0, 0, 0xff, 0xff, 0xff, 0xff].to_vec(),
        [0xfe, 0xff, 0x00, 0xe0, 0, 0, 0, 0].to_vec(),
        [&[0xfe, 0xff, 0x00, 0xe0], &(code.len() as u32).to_le_bytes()[..], code].concat(),
        [0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0].to_vec(),
    ];
    parts.concat()
}

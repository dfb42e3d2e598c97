//! NRRD's encodings besides raw and gzip, as pynrrd writes them, or as NRRD's own library reads them.

use sheetsplat_volume::{Encoding, SampleType};

use crate::*;

#[test]
fn other_encodings() {
    use SampleType::{F32, I16, U16};
    for (name, sample_type) in [("bzip2.nrrd", I16), ("text.nrrd", F32), ("hex.nrrd", U16)] {
        let volume = open(name);
        assert_eq!(volume.spacing(), SPACING, "{name}");
        assert_eq!(volume.encoding(), Some(Encoding { format: "NRRD", sample_type, channels: 1, times: 1 }), "{name}");
    }
    let folder = Folder::new();
    for (name, encoding, instead) in
        [("bzip2.nrrd", "bzip2", "bz2"), ("text.nrrd", "ascii", "txt"), ("text.nrrd", "ascii", "Text")]
    {
        let (text, instead) = (format!("encoding: {encoding}\n"), format!("encoding: {instead}\n"));
        assert_eq!(folder.open(name, &replaced(name, &text, &instead)).unwrap().values(), values(), "{instead}");
    }
    let uppercase = replaced("hex.nrrd", "00c8", "00C8");
    assert_eq!(folder.open("hex.nrrd", &uppercase).unwrap().values(), values());
}

#[test]
fn damaged_data() {
    let refused = |name: &str, text: &str, instead: &str, found: &str, allowed: &str| {
        assert_refused(Folder::new().open(name, &replaced(name, text, instead)), name, "data", found, allowed);
    };
    refused("text.nrrd", "\n234\n", "\n", "236 bytes", "240 bytes (60 samples of 4)");
    refused("text.nrrd", "\n234\n", "\n234\n235\n", "more than 240 bytes", "240 bytes");
    refused("text.nrrd", "\n234\n", "\n23x\n", "\"23x\", no number of type float32", "numbers as text");
    refused("text.nrrd", "\n234\n", "\n234", "the end of the file after a digit", "numbers as text");
    refused("hex.nrrd", "00ea\n", "00e\n", "a digit without a second one", "pairs of hexadecimal digits");
    refused("hex.nrrd", "00ea\n", "00\n", "119 bytes", "120 bytes");
    refused("hex.nrrd", "00ea\n", "00ea00\n", "more than 120 bytes", "120 bytes");
    refused("hex.nrrd", "00ea\n", "00eg\n", "\"g\", no hexadecimal digit", "pairs of hexadecimal digits");
    refused("bzip2.nrrd", "sizes: 5 4 3", "sizes: 5 4 2", "more than 80 bytes", "80 bytes");
    refused("bzip2.nrrd", "sizes: 5 4 3", "sizes: 5 4 4", "120 bytes", "160 bytes");
    refused("bzip2.nrrd", "BZh9", "BZh0", "", "whole and undamaged bzip2 streams");
    let unknown = replaced("hex.nrrd", "encoding: hex", "encoding: base64");
    assert_refused(
        Folder::new().open("a.nrrd", &unknown),
        "a.nrrd",
        "encoding",
        "base64",
        "ascii, text or txt, or hex",
    );
    let without = replaced("hex.nrrd", "endian: big\n", "");
    assert_refused(Folder::new().open("a.nrrd", &without), "a.nrrd", "endian", "no such field", "little or big");
}

#[test]
fn damage() {
    for name in ["bzip2.nrrd", "text.nrrd"] {
        let whole = fs::read(fixture(name)).unwrap();
        let folder = Folder::new();
        for length in 0..whole.len() {
            assert!(folder.open(name, &whole[..length]).is_err(), "{name}: {length} bytes");
        }
    }
    // White space may follow text.
    for name in ["text.nrrd", "hex.nrrd"] {
        let whole = fs::read(fixture(name)).unwrap();
        assert_eq!(Folder::new().open(name, &[&whole[..], b" \n"].concat()).unwrap().values(), values(), "{name}");
    }
}

/// Lines and bytes before text are skipped in the file.
#[test]
fn skips_before_text() {
    for (name, skip, before) in [
        ("text.nrrd", "line skip: 2", "one\ntwo\n"),
        ("hex.nrrd", "byte skip: 3", "xyz"),
        ("text.nrrd", "byte skip: 1", "x"),
    ] {
        let whole = String::from_utf8(fs::read(fixture(name)).unwrap()).unwrap();
        let skipped =
            whole.replace("dimension: 3", &format!("dimension: 3\n{skip}")).replace("\n\n", &format!("\n\n{before}"));
        assert_eq!(Folder::new().open(name, skipped.as_bytes()).unwrap().values(), values(), "{skip}");
    }
}

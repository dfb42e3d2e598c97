//! Headers without an end, data that are damaged or lie, and files that are cut off or mutated.

use sheetsplat_volume::{Volume, VolumeError};

use super::{Folder, PLAIN, assert_plain, assert_refused, bytes, gzip};

#[test]
fn endless_headers() {
    let folder = Folder::new();
    let open = |parts: &[&[u8]]| Volume::open(&folder.write("volume.nrrd", parts));
    let long = vec![b'x'; 70_000];
    assert_refused(open(&[b"NRRD0005\n", &long]), "volume.nrrd", "header", "more", "lines of less than 65536 bytes");
    assert_refused(open(&[&long]), "volume.nrrd", "magic", "xxxxxxxxxx", "NRRD0001");
    let comments = b"# a comment\n".repeat(100_000);
    assert_refused(open(&[b"NRRD0005\n", &comments]), "volume.nrrd", "header", "more", "1048576 bytes in all");
    assert_refused(open(&[PLAIN.as_bytes()]), "volume.nrrd", "header", "the end of the file", "a blank line");

    // A long but legal line is shortened in the message.
    let line = format!("{PLAIN}endian: {}\n", "é".repeat(30_000));
    let message = folder.attached(&line, &bytes()).expect_err("a volume").to_string();
    assert!(message.contains("éé") && message.chars().count() < 500, "{message}");
}

#[test]
fn damaged_data() {
    let folder = Folder::new();
    let raw = |data: &[u8]| folder.attached(PLAIN, data);
    assert_refused(raw(&bytes()[1..]), "volume.nrrd", "data", "23 bytes", "24");
    assert_refused(raw(&[&bytes()[..], b"\n"].concat()), "volume.nrrd", "data", "25 bytes", "24");

    let zipped = |data: &[u8]| folder.attached(&PLAIN.replace("raw", "gzip"), data);
    let whole = gzip(&bytes());
    assert_plain(&zipped(&whole).unwrap());
    assert_plain(&zipped(&[gzip(&bytes()[..7]), gzip(&[]), gzip(&bytes()[7..])].concat()).unwrap());
    assert_refused(zipped(&gzip(&bytes()[1..])), "volume.nrrd", "data", "23 bytes", "24");
    assert_refused(zipped(&gzip(&[1; 25])), "volume.nrrd", "data", "more than 24 bytes", "24");
    assert_refused(zipped(&[&whole[..], &whole[..]].concat()), "volume.nrrd", "data", "more than 24 bytes", "24");
    assert_refused(zipped(&[&whole[..], b"tail of a file"].concat()), "volume.nrrd", "data", "", "gzip members");
    assert_refused(zipped(&bytes()), "volume.nrrd", "data", "", "gzip members");
    assert_refused(zipped(&[]), "volume.nrrd", "data", "0 bytes", "24");
    for at in [whole.len() - 1, whole.len() - 8] {
        let mut wrong = whole.clone();
        wrong[at] ^= 1;
        assert_refused(zipped(&wrong), "volume.nrrd", "data", "", "gzip members");
    }
}

#[test]
fn promises_of_more_than_the_file_holds_cost_nothing() {
    let folder = Folder::new();
    for (sizes, field) in [
        ("60000 60000 60000", "sizes"),
        ("4294967295 4294967295 4294967295", "sizes"),
        ("18446744073709551616 1 1", "sizes"),
        ("4294967295 1 1", "data"),
        ("1600 1600 1600", "data"),
    ] {
        for encoding in ["raw", "gzip"] {
            let header = PLAIN.replace("2 3 4", sizes).replace("raw", encoding).replace("uint8", "double\nendian: big");
            let refused = folder.attached(&header, &gzip(&bytes()));
            assert_refused(refused, "volume.nrrd", field, "", if field == "data" { "samples of 8" } else { "voxels" });
        }
    }
}

/// One valid file of each kind: the header's length, and the whole.
fn valid_files() -> Vec<(usize, Vec<u8>)> {
    let header = "NRRD0004\ntype: short\ndimension: 3\nsizes: 5 4 3\nendian: big\nencoding: raw\nspacings: 1 2 0.5\n\n";
    let directions = "space directions: (1,0,0) (0,2,0) (0,0,.5)\nline skip: 0\nbyte skip: 0";
    let samples: Vec<u8> = (0..60_i16).flat_map(|i| (i * 311).to_be_bytes()).collect();
    let file = |header: String, data: &[u8]| (header.len(), [header.as_bytes(), data].concat());
    vec![
        file(header.to_owned(), &samples),
        file(header.replace("raw", "gzip").replace("spacings: 1 2 0.5", directions), &gzip(&samples)),
    ]
}

#[test]
fn truncated_files_are_refused() {
    let folder = Folder::new();
    for (_, whole) in valid_files() {
        assert!(Volume::open(&folder.write("volume.nrrd", &[&whole])).is_ok());
        for length in 0..whole.len() {
            let result = Volume::open(&folder.write("volume.nrrd", &[&whole[..length]]));
            assert!(matches!(result, Err(VolumeError::Invalid { .. })), "{length} of {} bytes", whole.len());
        }
    }
}

#[test]
fn mutated_files_are_volumes_or_errors() {
    let folder = Folder::new();
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % below as u64) as usize
    };
    let mut volumes = 0;
    for (header, whole) in valid_files() {
        for round in 0..1500 {
            let mut mutant = whole.clone();
            // Half of the mutants spare the data, where damage to a stream would hide the header's effect.
            let reach = if round % 2 == 0 { header } else { whole.len() };
            for _ in 0..=random(3) {
                let at = random(reach.min(mutant.len()));
                match random(5) {
                    0 => mutant[at] = random(256) as u8,
                    1 => mutant[at] ^= 1 << random(8),
                    2 => mutant[at] = b"0123456789-+.:=# \r\n()"[random(21)],
                    3 => mutant.insert(at, b'0' + random(10) as u8),
                    _ => _ = mutant.remove(at),
                }
            }
            match Volume::open(&folder.write("volume.nrrd", &[&mutant])) {
                Ok(volume) => {
                    assert_eq!(volume.values().len(), volume.dims().element_product() as usize);
                    assert!(volume.spacing().min_element() > 0.0);
                    volumes += 1;
                }
                Err(error) => assert!(error.to_string().contains("volume.nrrd"), "{error}"),
            }
        }
    }
    // The mutants are neither harmless nor hopeless: a file with a changed sample or comment is still valid.
    assert!((100..2900).contains(&volumes), "{volumes}");
}

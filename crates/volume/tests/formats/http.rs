//! Zarr stores that are read over HTTP, from a server in this process.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use glam::UVec3;
use sheetsplat_volume::{Files, ReadOptions, Volume, VolumeError, open_store};

use super::server::Server;
use super::zarr::write_sparse;
use super::{DIMS, Folder, fixture, values};

/// An image of whole chunks, and one of shards.
const STORES: [&str; 2] = ["image-0.5.zarr", "ngff.zarr"];

fn server() -> Server {
    Server::new(fixture("zarr"))
}

fn open(address: &str) -> Result<Volume, VolumeError> {
    Volume::open_with(Path::new(address), &ReadOptions::default().with_channel(0))
}

#[test]
fn stores_have_the_values_of_those_on_disk() {
    let server = server();
    for (store, prefix) in STORES
        .iter()
        .flat_map(|store| ["files", "query", "forbidden", "redirect", "busy", "whole"].map(|prefix| (*store, prefix)))
    {
        // Of a shard, only some bytes are asked for.
        if (store, prefix) == ("ngff.zarr", "whole") {
            continue;
        }
        let query = if prefix == "query" { "/?key=1" } else { "" };
        let found = open(&format!("{}/{prefix}/{store}{query}", server.address)).unwrap();
        let expected = open(fixture(&format!("zarr/{store}")).to_str().unwrap()).unwrap();
        assert_eq!((found.dims(), found.values()), (DIMS, (&values()).into()), "{prefix}/{store}");
        assert_eq!(found, expected, "{prefix}/{store}");
        assert_eq!(found.reads().map(|reads| reads.chunks_read), expected.reads().map(|reads| reads.chunks_read));
    }
    let labels = open(&format!("{}/files/image-0.5.zarr/labels/cells", server.address)).unwrap();
    assert_eq!(labels.label_names().len(), 2);
}

#[test]
fn chunks_are_asked_for_once() {
    let server = server();
    let chunks = |server: &Server| -> Vec<String> {
        let requests = server.take_requests().into_iter();
        requests.filter_map(|request| Some(request.split_once("/c/")?.1.to_owned())).collect()
    };
    let volume = open(&format!("{}/files/image-0.5.zarr", server.address)).unwrap();
    let mut asked = chunks(&server);
    asked.sort();
    assert_eq!(asked, ["0/0/0/0/0 ", "0/0/1/0/0 "]);
    assert_eq!(volume.reads().unwrap().bytes_read, {
        let chunk = |name: &str| std::fs::metadata(fixture(&format!("zarr/image-0.5.zarr/s0/c/{name}"))).unwrap().len();
        chunk("0/0/0/0/0") + chunk("0/0/1/0/0")
    });

    // Of each shard its length, its index and its chunks, which are parts of it.
    open(&format!("{}/files/ngff.zarr", server.address)).unwrap();
    // Threads may ask for the same at once.
    let asked: BTreeSet<String> = chunks(&server).into_iter().collect();
    assert_eq!(asked.iter().filter(|request| request.ends_with(" 0-0")).count(), 2, "{asked:?}");
    assert_eq!(asked.len(), 2 + 2 + 12, "{asked:?}");

    // A box asks for the chunks that it meets.
    let store = Path::new(&server.address).join("files/image-0.5.zarr");
    let store = open_store(&store, &ReadOptions::default().with_channel(1)).unwrap();
    server.take_requests();
    let mut value = [0.0];
    let bytes = store.read(0, UVec3::new(4, 3, 2), UVec3::ONE, &mut value).unwrap();
    assert_eq!((value, chunks(&server)), ([1234.0], vec!["0/0/1/0/0 ".to_owned()]));
    assert!(bytes > 0 && store.contains(0, UVec3::ZERO).unwrap());
}

/// Chunks of a store that is gone are no chunks that it never held.
#[test]
fn stores_that_are_removed_are_errors() {
    let folder = Folder::new();
    let store = folder.0.path().join("a.zarr");
    write_sparse(&store);
    let server = Server::new(folder.0.path().to_owned());
    let address = format!("{}/files/a.zarr", server.address);
    let opened = open_store(Path::new(&address), &ReadOptions::default()).unwrap();
    let read = |from: UVec3| {
        let mut value = [0.0];
        opened.read(0, from, UVec3::ONE, &mut value).map(|_| value[0])
    };
    assert_eq!([UVec3::ZERO, UVec3::splat(2)].map(|from| read(from).unwrap()), [1.0, 7.0]);
    assert!(!opened.contains(0, UVec3::X).unwrap());
    fs::remove_dir_all(&store).unwrap();
    let errors = [read(UVec3::ZERO).unwrap_err(), opened.contains(0, UVec3::Y).unwrap_err()];
    for message in errors.map(|error| error.to_string()) {
        assert!(message.contains("a.zarr/zarr.json: ") && message.contains("not found"), "{message}");
    }
}

#[test]
fn servers_that_lie_are_refused() {
    let server = server();
    for (prefix, store, words) in [
        ("broken", "image-0.5.zarr", ["status: found 500", "allowed: 200 or 206, or 404 or 403"]),
        ("short", "image-0.5.zarr", ["/c/0/0/", ""]),
        ("endless", "image-0.5.zarr", ["chunk: found more", "allowed: at most "]),
        ("shifted", "ngff.zarr", ["range: found bytes from ", "allowed: bytes from "]),
        ("whole", "ngff.zarr", ["range: found bytes from 0", "a server that answers requests for ranges"]),
        ("loop", "image-0.5.zarr", ["address: found too many redirects", "at most 5 redirects"]),
        ("elsewhere", "image-0.5.zarr", ["address: found ", "allowed: "]),
    ] {
        let message = open(&format!("{}/{prefix}/{store}", server.address)).unwrap_err().to_string();
        assert!(message.starts_with(&format!("{}/{prefix}/{store}/", server.address)), "{message}");
        assert!(words.iter().all(|word| message.contains(word)), "{prefix}: {message}");
    }
    // A server that is at fault is asked three times for a chunk. Which chunks are asked for before the first failure is left to the threads.
    server.take_requests();
    open(&format!("{}/broken/image-0.5.zarr", server.address)).unwrap_err();
    let asked = server.take_requests();
    let chunks: Vec<&String> = asked.iter().filter(|request| request.contains("/c/")).collect();
    assert!(!chunks.is_empty(), "{asked:?}");
    for chunk in &chunks {
        assert_eq!(chunks.iter().filter(|other| *other == chunk).count(), 3, "{asked:?}");
    }

    let missing = open(&format!("{}/files/none.zarr", server.address)).unwrap_err().to_string();
    assert!(missing.contains("metadata: found nothing, allowed: a Zarr store"), "{missing}");
    // Nothing can listen at port 0.
    let closed = "http://127.0.0.1:0/store.zarr";
    assert!(open(closed).unwrap_err().to_string().starts_with(closed));
}

/// Where reading is confined, or files are given, nothing is asked for.
#[test]
fn addresses_are_no_paths() {
    let server = server();
    let address = format!("{}/files/image-0.5.zarr", server.address);
    let folder = tempfile::tempdir().unwrap();
    let confined = ReadOptions::default().with_channel(0).confined_to(folder.path());
    for error in [
        Volume::open_with(Path::new(&address), &confined).unwrap_err(),
        open_store(Path::new(&address), &confined).unwrap_err(),
    ] {
        let message = error.to_string();
        assert!(message.starts_with(&format!("{address}: file: found an address")), "{message}");
    }
    let given = ReadOptions::default().with_files(Files::from_iter([("a.raw", [0_u8].as_slice())]));
    assert!(Volume::open_with(Path::new(&address), &given).is_err());
    assert_eq!(server.take_requests(), [""; 0]);
}

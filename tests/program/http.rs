//! Stores that are read over HTTP.

use crate::levels::write_pyramid;
use crate::server::Server;
use crate::*;

#[test]
fn a_store_at_an_address_is_drawn_like_one_on_disk() {
    let folder = Folder::new();
    write_pyramid(&folder);
    let server = Server::new(folder.path(""));
    let two = [("RAYON_NUM_THREADS", "2")];
    let draw = |volume: &str, rest: &str| {
        let ball = "--backend cpu --memory 3MiB --set splatting.classification=before --stats stats.json";
        folder.run_with(&two, "", &format!("render {volume} {ball} {rest}")).assert_success();
        let stats: Value = serde_json::from_slice(&folder.read("stats.json")).unwrap();
        ["level", "chunks_total", "chunks_read", "bytes_read"].map(|key| stats[key].as_u64().unwrap())
    };
    let address = format!("{}/files/ball.zarr", server.address);
    // Level 0 is larger than the memory, so it is streamed.
    for (size, level) in [(100, 0), (20, 1)] {
        let image = format!("--set image={{width={size},height={size}}}");
        let on_disk = draw("ball.zarr", &format!("{image} -o disk.npy"));
        server.take_requests();
        let found = draw(&address, &format!("{image} -o address.npy"));
        assert_eq!((found, found[0]), (on_disk, level));
        assert!(folder.read("address.npy") == folder.read("disk.npy"), "the images differ");
        let asked = server.take_requests();
        let chunks = asked.iter().filter(|request| request.contains(&format!("/{level}/c/"))).count();
        assert!(chunks as u64 >= found[2], "{asked:#?}");
    }

    // A scene names an address as it does a path.
    folder.write("scene.toml", format!("[volume]\npath = \"{address}\"\n[image]\nwidth = 20\nheight = 20\n"));
    folder.render("scene.toml --backend cpu -o scene.npy --save-scene saved.toml");
    assert!(String::from_utf8(folder.read("saved.toml")).unwrap().contains(&format!("path = \"{address}\"")));
    folder.render("saved.toml --backend cpu -o saved.npy");
    assert!(folder.read("saved.npy") == folder.read("scene.npy"), "the images differ");

    // No message tells a password.
    let with = |rest: &str| {
        format!("{}/{rest}", address.replace("http://", "http://me:secret@").trim_end_matches("/files/ball.zarr"))
    };
    for rest in
        ["broken/ball.zarr", "files/none.zarr", "short/ball.zarr", "loop/ball.zarr", "files/ball.zarr --slabs 0..1"]
    {
        for verbosity in ["-v", "-q"] {
            let run = folder.run(&format!("render {} --backend cpu -o no.png {verbosity}", with(rest)));
            assert!(!run.stderr.contains("secret"), "{}", run.stderr);
            assert!(run.code == Some(2) && (run.stderr.contains("://…@") || rest.contains("slabs")), "{}", run.stderr);
        }
    }
    let run = folder.run(&format!("info {} -v", with("files/ball.zarr")));
    assert!(
        run.code == Some(0) && !run.stderr.contains("secret") && !run.stdout.contains("secret"),
        "{}{}",
        run.stdout,
        run.stderr
    );

    // Nor does a picture, which is drawn again from the address.
    folder.render(&format!("{} --backend cpu --size 20 -o told.exr", with("files/ball.zarr")));
    let run = folder.run("info told.exr");
    assert!(run.stdout.contains(&format!("path = \"{address}\"")) && !run.stdout.contains("secret"), "{}", run.stdout);
    let run = folder.run("verify told.exr");
    assert!(run.code == Some(0) && run.stdout.contains("the same pixels"), "{}{}", run.stdout, run.stderr);

    server.take_requests();
    folder
        .run("render scene.toml --confine . -o no.png")
        .assert_failure(2, &[&address, "to which reading is confined"]);
    assert_eq!(server.take_requests(), [""; 0]);
    let broken = format!("{}/broken/ball.zarr", server.address);
    folder.run(&format!("render {broken} -o no.png")).assert_failure(2, &["status: found 500, allowed: 200 or 206"]);
    assert!(!folder.path("no.png").exists());
}

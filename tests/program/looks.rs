//! Appearance by name, and scenes saved as they were rendered.

use sheetsplat::appearance::Preset;

use crate::*;

const HEAD: &str = "builtin:head:32 --set image.width=60 --set image.height=50 --set camera.direction=[0.5,0.8,-0.2]";

/// The numbers of rows and columns from the first to the last that are not black.
fn lit(folder: &Folder, arguments: &str) -> [usize; 4] {
    let (width, height, pixels) = folder.pixels(arguments);
    let is_lit = |x: usize, y: usize| pixels[x + y * width][..3].iter().any(|&channel| channel > 0.02);
    let columns: Vec<usize> = (0..width).filter(|&x| (0..height).any(|y| is_lit(x, y))).collect();
    let rows: Vec<usize> = (0..height).filter(|&y| (0..width).any(|x| is_lit(x, y))).collect();
    [columns[0], columns[columns.len() - 1], rows[0], rows[rows.len() - 1]]
}

#[test]
fn without_a_scene_file_the_object_fills_the_image() {
    let folder = Folder::new();
    let size = "--set image={width=100,height=80} --set camera.direction=[0,1,0]";
    for set in [
        "--set image.background=[0,0,0,1]",
        "--set camera.projection=perspective",
        "--preset mr-head",
        "--set camera.direction=[1,0.4,0.1]",
    ] {
        let [left, right, top, bottom] = lit(&folder, &format!("builtin:head:40 {size} {set}"));
        let (wide, high) = (right + 1 - left, bottom + 1 - top);
        // The object fills 0.9 of an axis, minus the kernels' faint rims and, in perspective, because of the box's depth.
        assert!((54..=73).contains(&high) && wide <= 91, "{set}: {wide} × {high}");
        assert!(
            left.abs_diff(99 - right) <= 6 && top.abs_diff(79 - bottom) <= 6,
            "{set}: {left} {right} {top} {bottom}"
        );
    }
    // A scene file with a camera or transfer function frames the volume, whose diagonal is twice as long.
    for keys in ["[camera]", "[transfer]\niso_ranges = [[0, 300]]"] {
        folder.write("a.toml", format!("volume.builtin = 'head:40'\n{keys}"));
        let [_, _, top, bottom] = lit(&folder, &format!("a.toml {size}"));
        assert!(bottom - top < 50, "{keys}: {top} {bottom}");
        let [_, _, top, bottom] = lit(&folder, &format!("a.toml {size} --set camera.fit=object"));
        assert!(bottom - top >= 55, "{keys}: {top} {bottom}");
    }
}

/// A ball of soft tissue with a core of bone, in air, whose file states no orientation.
fn write_body(folder: &Folder) {
    let values = (0..20 * 20 * 20).map(|at: u32| {
        let [x, y, z] = [at % 20, at / 20 % 20, at / 400].map(|at| f64::from(at) - 9.5);
        match (x * x + y * y + z * z).sqrt() {
            radius if radius < 4.0 => 700.0 + (at % 50) as f32,
            radius if radius < 8.0 => 40.0 + (at % 7) as f32,
            _ => -1000.0,
        }
    });
    folder.write_nrrd("body.nrrd", [20, 20, 20], [1.0; 3], &values.collect::<Vec<_>>());
}

#[test]
fn the_preset_that_fits_is_used_and_told() {
    let folder = Folder::new();
    write_body(&folder);
    let said = |arguments: &str| {
        let run = folder.run(&format!("render {arguments} --size 24 --backend cpu -o out.npy"));
        run.assert_success();
        (run.stderr, folder.read("out.npy"))
    };
    let (text, fitting) = said("body.nrrd");
    let [preset, orientation] = text.lines().collect::<Vec<_>>()[..] else { panic!("{text}") };
    assert!(preset.starts_with("body.nrrd: preset ct-bone, as the values are Hounsfield units"), "{text}");
    assert!(orientation.contains("states no orientation") && orientation.contains("camera.up"), "{text}");
    assert_eq!(said("body.nrrd -q"), (String::new(), fitting.clone()));

    let (text, named) = said("body.nrrd --preset ct-bone --set camera.direction=[0,1,0]");
    assert_eq!(text, "");
    assert_eq!(named, said("body.nrrd -q --set camera.direction=[0,1,0]").1);
    let (text, surface) = said("body.nrrd --preset none");
    assert!(text.lines().count() == 1 && !text.contains("preset"), "{text}");
    assert_ne!(surface, fitting);
    // Whatever states an appearance has no preset that was not asked for.
    for stated in ["--colormap gray", "--set transfer.iso_ranges=[[-500,2000]]"] {
        assert_eq!(
            said(&format!("body.nrrd {stated}")),
            said(&format!("body.nrrd --preset none {stated}")),
            "{stated}"
        );
    }

    // The scene that is saved states what was chosen.
    folder.render("body.nrrd -q --size 24 --backend cpu -o out.npy --save-scene saved.toml");
    assert_eq!(said("saved.toml"), (String::new(), fitting));
}

#[test]
fn presets_and_colour_maps_are_short_for_settings() {
    let folder = Folder::new();
    let mut images = BTreeSet::new();
    for (short, long) in [
        ("--preset ct-bone", "--set preset=ct-bone"),
        ("--colormap inferno", "--set transfer.colormap=inferno"),
        ("--preset confocal --colormap magma", "--set transfer.colormap=magma --set preset=confocal"),
        // Keys that are set explicitly apply later.
        ("--preset xray --set preset=labels", "--set preset=labels"),
    ] {
        folder.render(&format!("{HEAD} {short} -o short.npy"));
        folder.render(&format!("{HEAD} {long} -o long.npy"));
        assert_eq!(folder.read("short.npy"), folder.read("long.npy"), "{short}");
        images.insert(folder.read("short.npy"));
    }
    assert_eq!(images.len(), 4, "all differ");
    // Other subcommands have them too, and sweeps.
    folder.run(&format!("orbit {HEAD} {WHOLE} --preset ct-bone --count 1 -o %d.npy")).assert_success();
    folder.render(&format!("{HEAD} {WHOLE} --preset ct-bone -o bone.npy"));
    assert_eq!(folder.read("0.npy"), folder.read("bone.npy"));
    folder.run(&format!("sweep {HEAD} --set preset=ct-bone,xray --colormap hot -o sheet.png")).assert_success();
    assert!(image::open(folder.path("sheet.png")).unwrap().width() > 120);
    let bench = folder.run(&format!("bench {HEAD} --preset labels --frames 1"));
    assert_eq!(bench.code, Some(0), "{}", bench.stderr);
}

#[test]
fn one_label_is_drawn_alone() {
    let folder = Folder::new();
    let labels = "--set preset=labels --size 40 --backend cpu";
    folder.render(&format!("builtin:head:32 {labels} --only skull -o only.npy --save-scene only.toml"));
    folder.render("only.toml --backend cpu -o saved.npy");
    assert_eq!(folder.read("only.npy"), folder.read("saved.npy"));
    folder.render(&format!("builtin:head:32 {labels} -o all.npy"));
    assert_ne!(folder.read("only.npy"), folder.read("all.npy"));
    let run = folder.run("render builtin:head:32 --only liver -o none.npy");
    assert_eq!(run.code, Some(2), "{}", run.stderr);
    assert!(
        run.stderr.contains("--only: found \"liver\", allowed: ") && run.stderr.contains("\"skull\""),
        "{}",
        run.stderr
    );
    assert!(!folder.path("none.npy").exists());
}

/// A table beside a scene names labels and gives them colours, here and in the saved scene.
#[test]
fn labels_have_a_tables_names_and_colours() {
    let folder = Folder::new();
    folder.write("names.txt", "# number, name, colour\n2 bone 255 0 0 0\n");
    let head = "builtin:head:32 --set preset=labels --size 40 --backend cpu --set volume.label_table";
    folder.render(&format!("{head}=names.txt --only bone -o bone.npy --save-scene bone.toml"));
    folder.render("bone.toml --backend cpu -o saved.npy");
    assert_eq!(folder.read("bone.npy"), folder.read("saved.npy"));
    let (_, _, pixels) = folder.pixels("bone.toml");
    assert!(pixels.iter().any(|[r, ..]| *r > 0.1) && pixels.iter().all(|[_, g, b, _]| g == b));
    folder.render(&format!("{head}=builtin:freesurfer --only Left-Cerebral-White-Matter -o white.npy"));
    let preset = "builtin:head:32 --preset freesurfer --size 40 --backend cpu --only Left-Cerebral-White-Matter";
    assert_eq!(folder.pixels(preset).2, folder.read_npy("white.npy").2);
    folder.write("wrong.txt", "2 bone 255 0\n");
    for (table, found) in
        [("wrong.txt", "wrong.txt: line 1: found 2 bone 255 0, allowed: "), ("builtin:allen", "label table: found ")]
    {
        let run = folder.run(&format!("render {head}={table} -o none.npy"));
        assert!(run.code == Some(2) && run.stderr.contains(found), "{}", run.stderr);
        assert!(!folder.path("none.npy").exists());
    }
}

#[test]
fn a_scene_files_colours_give_way_to_a_colour_map_alone() {
    let folder = Folder::new();
    let scene = "[volume]\nbuiltin = \"head:24\"\n[image]\nwidth = 40\nheight = 40\n";
    let transfer = "[transfer]\ncolor = [[0, [0, 0, 1]]]\nopacity = [[60, 0], [90, 0.9]]\n";
    folder.write("scene.toml", format!("{scene}{transfer}"));
    folder.write("mapped.toml", format!("{scene}[transfer]\ncolormap = \"hot\"\nopacity = [[60, 0], [90, 0.9]]\n"));
    folder.write("preset.toml", format!("preset = \"ct-skin\"\n{scene}{transfer}"));
    for (with, without) in
        [("scene.toml --colormap hot", "mapped.toml"), ("scene.toml --preset ct-skin", "preset.toml")]
    {
        assert!(folder.pixels(with) == folder.pixels(without), "{with}");
    }
    let blue = |pixels: &[[f32; 4]]| pixels.iter().all(|[r, g, b, _]| r <= b && g <= b);
    assert!(blue(&folder.pixels("preset.toml").2), "the file's colours stay");
}

#[test]
fn a_saved_scene_renders_the_same_bytes_from_wherever_it_is() {
    let folder = Folder::new();
    for name in ["scenes", "data", "elsewhere"] {
        fs::create_dir(folder.path(name)).unwrap();
    }
    let values: Vec<f32> =
        (0..512).map(|i| if i % 8 > 2 && i / 64 > 1 { 900.0 + (i % 13) as f32 } else { -1000.0 }).collect();
    folder.write_nrrd("data/small.nrrd", [8, 8, 8], [1.0, 1.0, 2.0], &values);
    let labels: Vec<f32> = (0..512).map(|i| (i / 8 % 3) as f32).collect();
    folder.write_nrrd("data/labels.nrrd", [8, 8, 8], [1.0, 1.0, 2.0], &labels);
    folder.write(
        "data/scene.toml",
        "volume = { path = \"small.nrrd\", labels = \"labels.nrrd\" }\nimage = { width = 40, height = 30 }\n",
    );
    let small = "--set image.width=40 --set image.height=30";
    for (at, arguments) in [
        format!("data/small.nrrd {small}"),
        format!("data/small.nrrd {small} --preset ct-bone --colormap viridis --set clip.planes=[[1,0,0,1]]"),
        "data/scene.toml --preset labels --set transfer.label=[{label=2,visible=false}]".to_owned(),
        format!("builtin:tomato:24 {small} --set camera.projection=perspective --set image.background=[1,1,1,0]"),
        format!("{SMALL} --set splatting.rasterizer=quads --set camera.center=[1,0.1,-2]"),
    ]
    .iter()
    .enumerate()
    {
        folder.render(&format!("{arguments} -o first.png --save-scene scenes/{at}.toml"));
        folder.run_in("elsewhere", &format!("render ../scenes/{at}.toml -o ../second.png")).assert_success();
        assert_eq!(folder.read("first.png"), folder.read("second.png"), "{arguments}");
        let text = String::from_utf8(folder.read(&format!("scenes/{at}.toml"))).unwrap();
        for key in ["color = ", "opacity = ", "compositing = ", "ambient = ", "direction = ", "width = "] {
            assert!(text.contains(key), "{key} in {text}");
        }
        // Saved again, the text is the same.
        folder.render(&format!("{arguments} -o first.npy"));
        folder.render(&format!("scenes/{at}.toml -o again.npy --save-scene scenes/again.toml"));
        assert_eq!(folder.read("first.npy"), folder.read("again.npy"), "{arguments}");
        assert_eq!(String::from_utf8(folder.read("scenes/again.toml")).unwrap(), text);
    }
    assert!(String::from_utf8(folder.read("scenes/0.toml")).unwrap().contains("path = \"../data/small.nrrd\""));
}

#[test]
fn bad_names_and_files_are_2_and_leave_nothing() {
    let folder = Folder::new();
    folder.write_nrrd("halves.nrrd", [2, 2, 2], [1.0, 1.0, 1.0], &[0.5; 8]);
    let before = folder.names();
    for (arguments, words) in [
        (
            format!("render {HEAD} -o a.png --preset ct-brain"),
            &["--preset", "ct-brain", "ct-skin", "mr-head", "labels"] as &[&str],
        ),
        (format!("render {HEAD} -o a.png --colormap jet"), &["--colormap", "jet", "viridis", "coolwarm"]),
        (format!("render {HEAD} -o a.png --set preset=jet"), &["--set: preset", "jet", "ct-skin"]),
        (format!("render {HEAD} -o a.png --save-scene a.json"), &["--save-scene", "a.json", ".toml"]),
        (format!("render {HEAD} -o a.png --save-scene s.toml --stats s.toml"), &["--stats", "s.toml", "--save-scene"]),
        (
            "render halves.nrrd -o a.png --preset labels --save-scene s.toml".to_owned(),
            &["halves.nrrd", "preset", "0 to 65535"],
        ),
        ("render halves.nrrd -o a.png --preset labels --backend reference".to_owned(), &["halves.nrrd", "preset"]),
        ("orbit halves.nrrd -o a.gif --preset labels".to_owned(), &["halves.nrrd", "preset", "0 to 65535"]),
    ] {
        folder.run(&arguments).assert_failure(2, words);
        assert_eq!(folder.names(), before, "{arguments}");
    }
    let run = folder.run(&format!("render {HEAD} -o a.png --save-scene no/s.toml"));
    run.assert_failure(2, &["no/s.toml", "No such file"]);
    folder.run(&format!("render {HEAD} -o no/a.png --save-scene s.toml")).assert_failure(2, &["no/a.png"]);
    assert_eq!(folder.names(), before);
}

#[test]
fn the_gallery_has_a_picture_of_every_preset_by_its_command() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join("docs/guide/gallery.md")).unwrap();
    let folder = Folder::new();
    for (preset, _) in Preset::ALL {
        let file = format!("{preset}.png");
        let command = text.lines().find(|line| line.ends_with(&format!(" -o {file}")));
        let command = command.and_then(|line| line.strip_prefix("sheetsplat ")).unwrap_or_else(|| panic!("{preset}"));
        assert!(command.contains(&format!(" --preset {preset} ")) && text.contains(&format!("](../gallery/{file})")));
        let bytes = std::fs::read(root.join("docs/gallery").join(&file)).unwrap();
        let picture = image::load_from_memory(&bytes).unwrap();
        assert!(bytes.len() <= 64 << 10 && (picture.width(), picture.height()) == (256, 256), "{file}");
        // Smaller, the same is drawn.
        let small = command
            .replace(":256 ", ":24 ")
            .replace("builtin:head ", "builtin:head:24 ")
            .replace("builtin:tomato ", "builtin:tomato:24 ");
        folder.run(&small.replace("--size 256", "--size 16")).assert_success();
        let drawn = image::open(folder.path(&file)).unwrap().into_rgb8();
        assert!(drawn.pixels().any(|pixel| pixel.0 != drawn.get_pixel(0, 0).0), "{command}");
    }
}

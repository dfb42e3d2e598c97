//! Regions of a frame that several renderers share.

use std::sync::Arc;

use sheetsplat::Scene;
use sheetsplat::cpu::CpuRenderer;
use sheetsplat::scene::VolumeSource;
use sheetsplat::settings::Region;

const SIZE: [u32; 2] = [101, 83];

fn scene(sets: &[&str]) -> Scene {
    let sets = sets.iter().copied().chain(["image={width=101,height=83,background=[0.2,0.4,0.1,0.5]}"]);
    let sets: Vec<String> = sets.map(str::to_owned).collect();
    Scene::from_volume(VolumeSource::Builtin("head:40".to_owned()), &sets).unwrap()
}

#[test]
fn regions_are_those_of_the_whole_image() {
    // One of few pixels in one tile, one over several tiles, and a border.
    let regions = [[3, 70, 2, 1], [30, 10, 50, 64], [96, 0, 5, 83]];
    for sets in [
        &[][..],
        &["splatting.classification=before"],
        &["splatting.classification=after", "splatting.compositing=average"],
        &["splatting.classification=before", "splatting.compositing=surface"],
        &["splatting.classification=before", "splatting.compositing=minimum"],
        &[
            "camera.projection=perspective",
            "splatting.classification=before",
            "splatting.method=composite-every-sample",
        ],
    ] {
        let scene = scene(sets);
        let volume = Arc::new(scene.load_volume().unwrap());
        let mut renderer = CpuRenderer::new(Arc::clone(&volume), &scene).unwrap();
        let whole = renderer.draw().unwrap().image;
        for [x, y, width, height] in regions {
            let part = renderer.draw_region(Region { x, y, width, height }).unwrap();
            assert_eq!((part.image.width, part.image.height), (width, height));
            for (row, line) in part.image.pixels.chunks(width as usize).enumerate() {
                let first = (y as usize + row) * SIZE[0] as usize + x as usize;
                assert_eq!(line, &whole.pixels[first..first + width as usize], "{sets:?}: row {row} of {x},{y}");
            }
        }
    }
}

#[test]
fn regions_have_picks_and_bounds() {
    let scene = scene(&[]);
    let mut renderer = CpuRenderer::new(scene.load_volume().unwrap(), &scene).unwrap();
    renderer.set_first_hit(Some(0.5)).unwrap();
    renderer.draw().unwrap();
    let whole = renderer.pick([50, 41]).unwrap();
    assert!(whole.is_some());
    renderer.draw_region(Region { x: 50, y: 40, width: 1, height: 2 }).unwrap();
    assert_eq!(renderer.pick([50, 41]).unwrap(), whole);
    assert!(renderer.pick([49, 41]).unwrap_err().to_string().contains("in a frame with first hits"));
    for [x, y, width, height] in [[100, 0, 2, 1], [0, 82, 1, 2], [0, 0, 0, 1]] {
        let error = renderer.draw_region(Region { x, y, width, height }).unwrap_err().to_string();
        assert!(error.contains("within the image of 101×83"), "{error}");
    }
}

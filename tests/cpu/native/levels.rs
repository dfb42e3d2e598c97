//! Coarser levels of a store (SPEC §13): lengths mean what they mean at the finest level.

use std::fs;

use glam::{DVec3, UVec3};
use serde_json::{Value, json};
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Classification, Clip, Compositing, Projection, Ramp};
use sheetsplat::volume::{ReadOptions, Volume};

use crate::common::images::largest_difference;
use crate::common::{Random, camera, scene, transfer};
use crate::native::{draw, shown, twin};

const DIMS: UVec3 = UVec3::new(13, 11, 9);
/// Where the coarse level's centre lies from the fine one's.
const PLACE: DVec3 = DVec3::new(0.5, -1.25, 2.0);

/// The metadata of an array of 32-bit floats in one chunk.
fn array(dims: UVec3) -> Value {
    let shape = [dims.z, dims.y, dims.x];
    json!({
        "zarr_format": 3, "node_type": "array", "shape": shape, "data_type": "float32", "fill_value": 0,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": shape}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}],
    })
}

/// The coarse one of two levels of a store, with twice the fine one's spacing, and a volume of the same values with that spacing alone.
fn coarse_and_plain() -> (Volume, Volume) {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(13);
    let values: Vec<f32> = (0..DIMS.element_product()).map(|_| random.uniform(0.0, 255.0) as f32).collect();
    // Both levels have voxels of one number, so that centres differ by translations and half a voxel of each.
    let fine = 2 * DIMS;
    let first = PLACE + (fine.as_dvec3() - 1.0) / 2.0 - (DIMS.as_dvec3() - 1.0);
    let scales = [(1.0, DVec3::ZERO), (2.0, first)].into_iter().zip(["fine", "coarse"]).map(|((scale, at), path)| {
        let transformations = json!([
            {"type": "scale", "scale": [scale, scale, scale]}, {"type": "translation", "translation": [at.z, at.y, at.x]}
        ]);
        json!({"path": path, "coordinateTransformations": transformations})
    });
    let axes = ["z", "y", "x"].map(|name| json!({"name": name, "type": "space"}));
    let multiscale = json!({"axes": axes, "datasets": scales.collect::<Vec<_>>()});
    let group = json!({"zarr_format": 3, "node_type": "group", "attributes": {"ome": {"multiscales": [multiscale]}}});
    for path in ["fine", "coarse/c/0/0"] {
        fs::create_dir_all(folder.path().join(path)).unwrap();
    }
    let write = |path: &str, bytes: &[u8]| fs::write(folder.path().join(path), bytes).unwrap();
    write("zarr.json", group.to_string().as_bytes());
    write("fine/zarr.json", array(fine).to_string().as_bytes());
    write("coarse/zarr.json", array(DIMS).to_string().as_bytes());
    write("coarse/c/0/0/0", &values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>());
    let coarse = Volume::open_with(folder.path(), &ReadOptions::default().with_level(1)).unwrap();
    assert_eq!((coarse.values(), coarse.grid().unit(), coarse.grid().place()), ((&values).into(), 1.0, PLACE));
    (coarse, Volume::new("plain", DIMS, DVec3::splat(2.0), values).unwrap())
}

/// The same picture by the unit of the coarse spacing, about the coarse level's centre.
fn in_coarse_units(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    scene.camera.center = Some(scene.camera.center.unwrap() - PLACE);
    scene.splatting.slab_width /= 2.0;
    for [x, y, z, d] in &mut scene.clip.planes {
        *d += DVec3::new(*x, *y, *z).dot(PLACE);
    }
    let opacity = scene.channels[0].transfer.opacity.as_ref().unwrap();
    let is_exponential = scene.splatting.compositing == Compositing::Exponential;
    let double = |alpha: f64| if is_exponential { 1.0 - (1.0 - alpha).powi(2) } else { 2.0 * alpha };
    let points = opacity.points().iter().map(|&(at, alpha)| (at, double(alpha))).collect();
    scene.channels[0].transfer.opacity = Some(Ramp::new(points).unwrap());
    scene
}

#[test]
fn a_level_looks_as_the_same_values_in_units_of_the_finest() {
    let (coarse, plain) = coarse_and_plain();
    for compositing in [Compositing::Linear, Compositing::Exponential, Compositing::Xray] {
        for classification in [Classification::Before, Classification::After] {
            for is_perspective in [false, true] {
                let mut scene = scene(60, 50);
                // Slabs are counted from the finest level's centre: with an eye, or where both centres are as deep, they are the same.
                let direction = DVec3::new(0.4, 0.8, -0.3).reject_from(PLACE);
                scene.camera = camera(direction.to_array(), 30.0);
                scene.camera.center = Some(DVec3::new(1.0, -0.5, 0.75));
                if is_perspective {
                    let (distance, near) = (Some(60.0), Some(1.5));
                    scene.camera.projection = Projection::Perspective { fov_y: 30.0, distance, near };
                }
                scene.clip = Clip { planes: vec![[1.0, 0.5, 0.25, 6.0]], ..Clip::default() };
                scene.splatting.compositing = compositing;
                scene.splatting.classification = classification;
                scene.splatting.culling = false;
                // Steps, between which doubled opacities are straight too.
                scene.channels[0].transfer = transfer(
                    &[(0.0, [0.2, 0.5, 1.0]), (255.0, [1.0, 0.9, 0.8])],
                    &[(0.0, 0.02), (120.0, 0.02), (120.001, 0.3), (255.0, 0.3)],
                );
                let other = in_coarse_units(&scene);
                let what = format!("{compositing:?}, {classification:?}, perspective: {is_perspective}");
                let [by_twin, expected] = [twin(&coarse, &scene), twin(&plain, &other)];
                assert!(shown(&expected) > 0.3, "{what}");
                let off = largest_difference(&by_twin, &expected);
                assert!(off < 1e-5, "{what}: {off}");
                let off = largest_difference(&draw(&coarse, &scene).image, &draw(&plain, &other).image);
                assert!(off < 1e-4, "{what}: {off} on the CPU");
                // In other directions the same slabs, too.
                scene.camera.direction = DVec3::new(0.4, 0.8, -0.3);
                let off = largest_difference(&draw(&coarse, &scene).image, &twin(&coarse, &scene));
                assert!(off < 1e-4, "{what}: {off} on the CPU from another direction");
            }
        }
    }
}

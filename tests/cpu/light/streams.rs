//! Light of volumes that are read while they are drawn: that of one level, whatever level is drawn.

use std::sync::Arc;

use glam::{DVec3, UVec3};
use sheetsplat::cpu::{CpuRenderer, StreamRenderer};
use sheetsplat::internals::reference::{self, Lights};
use sheetsplat::settings::{Classification, Projection, Region, Window};
use sheetsplat::volume::{Grid, Store, StoreLevel, StreamedVolume, Volume, VolumeError};
use sheetsplat::{Image, Scene};

use crate::common::compare::{assert_at_least, assert_at_most, decibels};
use crate::common::images::{bits, largest_difference};
use crate::common::lit_by_sheets;
use crate::common::store::{MemoryStore, streamed};
use crate::native::head;

const CLASSIFICATIONS: [Classification; 2] = [Classification::Before, Classification::After];

/// Volumes as the levels of a store.
#[derive(Debug)]
struct Levels {
    volumes: Vec<Volume>,
    levels: Vec<StoreLevel>,
}

impl Store for Levels {
    fn levels(&self) -> &[StoreLevel] {
        &self.levels
    }

    fn read(&self, level: usize, from: UVec3, dims: UVec3, values: &mut [f32]) -> Result<u64, VolumeError> {
        let own = Grid::new(dims, DVec3::ONE);
        let value = |index: usize| self.volumes[level].value(from + own.voxel_at(index as u32));
        values.iter_mut().enumerate().for_each(|(index, to)| *to = value(index));
        Ok(values.len() as u64)
    }

    fn contains(&self, _: usize, _: UVec3) -> Result<bool, VolumeError> {
        Ok(true)
    }

    fn fill(&self) -> f32 {
        0.0
    }

    fn identity(&self) -> String {
        "levels".to_owned()
    }
}

/// A head in the light of both kinds of sheets.
fn lit(classification: Classification, projection: Option<Projection>) -> (Volume, Scene) {
    let (volume, mut scene) = head();
    // Without the labels.
    let volume = Volume::new("head", volume.dims(), volume.spacing(), volume.values().to_vec()).unwrap();
    scene.splatting.classification = classification;
    scene.shading = lit_by_sheets(scene.shading);
    scene.camera.projection = projection.unwrap_or(scene.camera.projection);
    (volume, scene)
}

#[test]
fn a_stream_has_the_bytes_of_the_volume_in_memory() {
    let perspective = Projection::Perspective { fov_y: 40.0, distance: None, near: None };
    for classification in CLASSIFICATIONS {
        for projection in [None, Some(perspective)] {
            let (volume, scene) = lit(classification, projection);
            let store = Arc::new(MemoryStore::new(&volume, UVec3::new(8, 9, 7)));
            let mut stream = StreamRenderer::new(streamed(store, 0, &volume, 1 << 25), &scene).unwrap();
            let mut whole = CpuRenderer::new(volume, &scene).unwrap();
            let mut turned = scene.clone();
            turned.camera = scene.camera.turned(35.0);
            let mut unlit = scene.clone();
            (unlit.shading.occlusion, unlit.shading.shadow) = (0.0, 0.0);
            for scene in [&scene, &turned, &unlit, &scene] {
                stream.set_scene(scene).unwrap();
                whole.set_scene(scene).unwrap();
                let (drawn, expected) = (stream.draw().unwrap(), whole.draw().unwrap());
                assert!(bits(&drawn.image) == bits(&expected.image), "{classification:?} {projection:?}");
                let is_lit = scene.shading.occlusion > 0.0;
                assert_eq!(drawn.stats.light_bytes, expected.stats.light_bytes);
                assert_eq!(drawn.stats.light_bytes.is_some(), is_lit);
                let made_of = (drawn.stats.light_level, drawn.stats.light_stride);
                assert_eq!(made_of, if is_lit { (Some(0), Some(1)) } else { (None, None) });
            }
        }
    }
}

/// The coarser level of a store is drawn in the light of the finer one, which lies elsewhere, against the f64 evaluation of both.
#[test]
fn a_coarser_level_is_drawn_in_the_light_of_a_finer_one() {
    for classification in CLASSIFICATIONS {
        let (fine, mut scene) = lit(classification, None);
        scene.splatting.culling = false;
        scene.splatting.opacity_threshold = 1.0;
        let dims = fine.dims().map(|count| count.div_ceil(2));
        let place = DVec3::new(0.5, -0.25, 0.75) * fine.spacing();
        let grid = Grid::new(dims, 2.0 * fine.spacing()).coarser_than(fine.grid(), place);
        let values: Vec<f32> = (0..dims.element_product())
            .map(|index| fine.value((2 * grid.voxel_at(index)).min(fine.dims() - 1)))
            .collect();
        let coarse = Volume::punched(grid, values);
        let levels = [&fine, &coarse].map(|volume| StoreLevel { grid: *volume.grid(), chunk: UVec3::splat(7) });
        let store = Levels { volumes: vec![fine.clone(), coarse.clone()], levels: levels.to_vec() };
        let volume = StreamedVolume { memory: 1 << 25, ..streamed(Arc::new(store), 1, &coarse, 0) };
        let stream = StreamRenderer::new(volume, &scene).unwrap();
        let window = Window { region: Region::whole([scene.image.width, scene.image.height]), slabs: -1000..1000 };
        let (part, stats) = stream.draw_part(&window).unwrap();
        assert_eq!((stats.light_level, stats.light_stride, stats.store.unwrap().level), (Some(0), Some(1), 1));

        let (transfer, framed) = (scene.resolve(&coarse), scene.explicit(&coarse));
        let lights = Arc::new(Lights::new(&fine, &transfer, &framed).unwrap().on(coarse.grid()));
        let expected = |lights| reference::part(&coarse, &transfer, (&scene, lights), &window).unwrap().colors;
        let (whole, own) = (expected(Some(&lights)), expected(None));
        let apart = |other: &[[f32; 4]]| {
            let differences = part.contents[0].colors.iter().flatten().zip(other.iter().flatten()).map(|(a, b)| {
                assert!(a.is_finite() && b.is_finite());
                f64::from(a - b).powi(2)
            });
            decibels((differences.sum::<f64>() / (4 * other.len()) as f64).sqrt())
        };
        println!("{classification:?}: {:.1} dB, by its own light {:.1}", apart(&whole), apart(&own));
        assert_at_least(apart(&whole), 100.0, format_args!("{classification:?}"));
        assert!(apart(&own) < 60.0, "{classification:?}: the coarse level's own light is the same");
    }
}

#[test]
fn parts_of_streams_merge_to_the_whole() {
    for classification in CLASSIFICATIONS {
        let (volume, mut scene) = lit(classification, None);
        scene.splatting.opacity_threshold = 1.0;
        let store = Arc::new(MemoryStore::new(&volume, UVec3::splat(8)));
        let stream = StreamRenderer::new(streamed(store, 0, &volume, 1 << 25), &scene).unwrap();
        let whole = stream.draw().unwrap().image;
        let region = Region::whole([scene.image.width, scene.image.height]);
        let part = |slabs| stream.draw_part(&Window { slabs, region }).unwrap().0;
        let merged = Image::merge([part(-100..-2), part(-2..3), part(3..100)]).unwrap();
        assert_at_most(largest_difference(&merged, &whole), 1e-6, format_args!("{classification:?}"));
    }
}

//! Label maps, and scenes of them.

use glam::{DVec3, UVec3};
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Gradient, Ramp};
use sheetsplat::volume::{Grid, Labels, Volume};

use super::{Random, scene, transfer};

/// Labels 0 to 4: balls in noise, of a few of which each other voxel has another label.
pub(crate) fn labels(random: &mut Random, dims: UVec3) -> Vec<u16> {
    let centers = [(); 4].map(|()| random.within(DVec3::ZERO, dims.as_dvec3()));
    let radius = random.uniform(2.0, 7.0);
    let grid = Grid::new(dims, DVec3::ONE);
    let label = |index: u32| {
        let voxel = grid.voxel_at(index).as_dvec3();
        let nearest = (1..).zip(centers).find(|(_, center)| voxel.distance(*center) < radius);
        let specks = random.bits().is_multiple_of(40);
        if specks { random.bits() as u16 % 5 } else { nearest.map_or(0, |(label, _)| label) }
    };
    (0..dims.element_product()).map(label).collect()
}

/// A label map of any size and shape, with or without holes.
pub(crate) fn label_map(random: &mut Random) -> Volume {
    let side = |random: &mut Random| random.pick(&[1, 2, 5, 9, 14, 19, 23]);
    let dims = UVec3::new(side(random).max(5), side(random).max(5), side(random));
    let spacing = DVec3::new(1.0, random.uniform(0.5, 2.0), random.uniform(0.5, 3.0));
    let holes = random.pick(&[u64::MAX, 30]);
    let values = labels(random, dims);
    let value = |label: u16| if random.bits().is_multiple_of(holes) { f32::NAN } else { label.into() };
    let values = values.into_iter().map(value).collect();
    Volume::new("labels", dims, spacing, values).unwrap().as_label_map()
}

/// Values with labels beside them.
pub(crate) fn segmented(random: &mut Random) -> Volume {
    let map = label_map(random);
    let (dims, spacing) = (map.dims(), map.spacing());
    let values =
        map.values().iter().map(|label| if label.is_nan() { label } else { random.uniform(0.0, 200.0) as f32 });
    let volume = Volume::new("values", dims, spacing, values.collect()).unwrap();
    let labels = labels(random, dims).into();
    let labels = Labels { origin: "labels".to_owned(), dims, spacing: None, values: labels, names: [].into() };
    volume.with_labels(labels).unwrap()
}

/// A scene of a label map in its labels' colours, translucent or opaque, some with opacities by gradient.
pub(crate) fn scene_of_labels(random: &mut Random) -> Scene {
    let mut scene = scene(61, 47);
    let opacity = random.pick(&[0.3, 0.9, 1.0]);
    scene.channels[0].transfer = transfer(
        &[(0.0, [0.2, 0.4, 0.9]), (1.0, [0.9, 0.6, 0.4]), (3.0, [0.3, 0.9, 0.5]), (4.0, [1.0; 3])],
        &[(0.0, 0.0), (1.0, opacity)],
    );
    if random.bits().is_multiple_of(3) {
        scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.2), (0.1, 1.0)]).unwrap());
    }
    scene.camera.direction = random.direction();
    scene.shading.gradient = Gradient::Membership;
    scene.shading.specular = 0.4;
    scene.splatting.culling = false;
    scene
}

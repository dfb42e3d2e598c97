//! Volumes whose values take few bits: the GPU's images are the bytes that the same values give as `f32`.

use sheetsplat::settings::Classification;

use crate::common::devices::gpu;
use crate::common::images::bits;
use crate::common::values::{as_f32, cases};

#[test]
fn images_do_not_depend_on_how_values_are_kept() {
    let gpu = gpu();
    for (volume, bytes, mut scene) in cases() {
        for classification in [Classification::Before, Classification::After] {
            scene.splatting.classification = classification;
            let [drawn, expected] =
                [volume.clone(), as_f32(&volume)].map(|volume| gpu.render_volume(volume, &scene).unwrap().image);
            assert!(bits(&drawn) == bits(&expected), "{bytes} bytes: {classification:?}");
        }
    }
}

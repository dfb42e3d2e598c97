//! `shaders/enter.wgsl`: voxels at their places, and nothing anywhere else. Copies, so exact.

use std::collections::BTreeSet;

use sheetsplat::gpu::layout::{Entry, Voxel};
use sheetsplat::pass::enter::Enter;
use sheetsplat::wgpu::BufferUsages;

use crate::common::{Random, gpu};
use crate::{compute, contents, init};

fn voxel(index: u32) -> Voxel {
    Voxel { index, value: 0.5 * index as f32, normal: !index, gradient_magnitude: 3.0 - index as f32 }
}

#[test]
fn voxels_take_their_places() {
    let gpu = gpu();
    let stage = Enter::new(gpu.device());
    let mut random = Random(77);
    // The last are more than one row of folded workgroups takes: 32768 of 64.
    for (places, entering) in [(1, 1), (64, 1), (1000, 63), (1000, 65), (2_200_000, 2_150_000)] {
        let before: Vec<Voxel> = (0..places).map(|at| voxel(at + 7)).collect();
        let mut expected = before.clone();
        let entries: Vec<Entry> = if entering * 2 > places {
            // Each at most once, in an order that is not that of the places.
            (0..entering).rev().map(|at| Entry { at, voxel: voxel(5 * at + 1) }).collect()
        } else {
            let chosen: BTreeSet<u32> = (0..entering).map(|_| (random.bits() % u64::from(places)) as u32).collect();
            chosen.into_iter().map(|at| Entry { at, voxel: voxel(5 * at + 1) }).collect()
        };
        entries.iter().for_each(|entry| expected[entry.at as usize] = entry.voxel);
        let entries = init(gpu.device(), &entries, BufferUsages::STORAGE);
        let voxels = init(gpu.device(), &before, BufferUsages::STORAGE);
        let entering = stage.bind(gpu.device(), &entries, &voxels);
        compute(&gpu, |pass| stage.record(pass, &entering));
        assert!(contents::<Voxel>(&gpu, &voxels) == expected, "{places} places");
    }
}

//! The extent of the voxels that take part.

use glam::UVec3;

use super::classify::TakingPart;
use crate::parallel::prelude::*;
use crate::settings::clip::ClippedVoxels;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::Volume;

/// The first and last position along each axis of the voxels that take part, ignoring at either end at most the fraction `specks` of
/// them. `None` if no voxel takes part.
pub(crate) fn of_voxels(
    volume: &Volume,
    transfer: &[TransferFunction],
    clipped: &ClippedVoxels,
    specks: f64,
) -> Option<[UVec3; 2]> {
    let dims = volume.dims();
    let [nx, ny, nz] = dims.to_array().map(|n| n as usize);
    let taking_part = TakingPart::new(volume, transfer);
    // Counts of voxels by x and by y over the slices of a thread, and for every slice.
    let zeros = || (vec![0_u64; nx], vec![0_u64; ny], vec![0_u64; nz]);
    let counted = (0..dims.z).into_par_iter().fold(zeros, |(mut xs, mut ys, mut zs), z| {
        let mut flags = vec![false; nx];
        for y in 0..dims.y {
            flags.fill(false);
            taking_part.flag(dims.x * (y + dims.y * z), clipped.in_row(y, z, dims.x), &mut flags);
            xs.iter_mut().zip(&flags).for_each(|(x, &flag)| *x += u64::from(flag));
            let in_row = flags.iter().map(|&flag| u64::from(flag)).sum::<u64>();
            ys[y as usize] += in_row;
            zs[z as usize] += in_row;
        }
        (xs, ys, zs)
    });
    let (xs, ys, zs) = counted.reduce(zeros, |a, b| (sums(a.0, &b.0), sums(a.1, &b.1), sums(a.2, &b.2)));
    let [x, y, z] = [xs, ys, zs].map(|counts| ends(&counts, specks));
    let ([x, y], z) = ([x?, y?], z?);
    Some([0, 1].map(|end| UVec3::new(x[end], y[end], z[end])))
}

/// The maximum distance, in world units, of a voxel that takes part from the middle of the box of voxels `[first, last]`, among those in this box; 0 if
/// none is there.
pub(crate) fn farthest(
    volume: &Volume,
    transfer: &[TransferFunction],
    clipped: &ClippedVoxels,
    [first, last]: [UVec3; 2],
) -> f64 {
    let (dims, spacing) = (volume.dims(), volume.spacing());
    let middle = (first + last).as_dvec3() / 2.0;
    let square = |x: u32, y: u32, z: u32| ((UVec3::new(x, y, z).as_dvec3() - middle) * spacing).length_squared();
    let taking_part = TakingPart::new(volume, transfer);
    let of_slice = |z: u32| {
        let mut flags = vec![false; dims.x as usize];
        (first.y..=last.y).fold(0.0_f64, |farthest, y| {
            // No voxel of a row is farther than its ends.
            if square(first.x, y, z) <= farthest {
                return farthest;
            }
            flags.fill(false);
            taking_part.flag(dims.x * (y + dims.y * z), clipped.in_row(y, z, dims.x), &mut flags);
            let shown = (first.x..=last.x).filter(|&x| flags[x as usize]);
            shown.map(|x| square(x, y, z)).fold(farthest, f64::max)
        })
    };
    (first.z..last.z + 1).into_par_iter().map(of_slice).reduce(|| 0.0, f64::max).sqrt()
}

fn sums(mut a: Vec<u64>, b: &[u64]) -> Vec<u64> {
    a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
    a
}

/// The positions at which, counted from either end, more than a fraction of all counts has been passed.
fn ends(counts: &[u64], share: f64) -> Option<[u32; 2]> {
    let most = share * counts.iter().sum::<u64>() as f64;
    let is_end = |passed: &mut u64, &count: &u64| {
        *passed += count;
        Some(*passed > 0 && *passed as f64 > most)
    };
    let first = counts.iter().scan(0, is_end).position(|is_end| is_end)?;
    let from_last = counts.iter().rev().scan(0, is_end).position(|is_end| is_end)?;
    Some([first as u32, (counts.len() - 1 - from_last) as u32])
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::settings::clip::Clip;
    use crate::settings::transfer_function::Ramp;

    const DIMS: UVec3 = UVec3::new(30, 20, 25);

    /// A volume with the value 100 in the block `[first, last]` and in some single voxels.
    fn volume([first, last]: [UVec3; 2], specks: &[UVec3]) -> Volume {
        let is_in = |voxel: UVec3| voxel.cmpge(first).all() && voxel.cmple(last).all();
        let voxels =
            (0..DIMS.z).flat_map(|z| (0..DIMS.y).flat_map(move |y| (0..DIMS.x).map(move |x| UVec3::new(x, y, z))));
        let value = |voxel| if is_in(voxel) || specks.contains(&voxel) { 100.0 } else { 0.0 };
        Volume::new("block", DIMS, DVec3::ONE, voxels.map(value).collect()).unwrap()
    }

    fn transfer() -> TransferFunction {
        let opacity = Ramp::new(vec![(50.0, 0.0), (60.0, 1.0)]).unwrap();
        TransferFunction::by_value(Ramp::new(vec![(0.0, DVec3::ONE)]).unwrap(), opacity)
    }

    #[test]
    fn specks_count_only_as_long_as_they_are_many() {
        let block = [UVec3::new(4, 3, 6), UVec3::new(20, 13, 16)];
        let specks = [UVec3::new(1, 19, 0), UVec3::new(29, 0, 24)];
        let volume = volume(block, &specks);
        let of = |share| of_voxels(&volume, &[transfer()], &ClippedVoxels::default(), share);
        // Of 17·11·11 + 2 = 2059 voxels, 0.1 % are two: one speck is ignored at either end.
        assert_eq!(of(0.001), Some(block));
        assert_eq!(of(0.0004), Some([UVec3::new(1, 0, 0), UVec3::new(29, 19, 24)]));
        assert_eq!(of(0.0), Some([UVec3::new(1, 0, 0), UVec3::new(29, 19, 24)]));
    }

    #[test]
    fn the_farthest_voxel_is_that_of_the_box() {
        let block = [UVec3::new(4, 3, 6), UVec3::new(20, 13, 16)];
        // Two specks that make the box wider, but lie no farther from its middle than its corners: one of them is nearer than the other.
        let specks = [UVec3::new(1, 8, 11), UVec3::new(29, 0, 24)];
        let volume = volume(block, &specks);
        let of = |bounds: [UVec3; 2], clip: Clip| {
            let found = farthest(&volume, &[transfer()], &clip.voxels(volume.grid(), 2.0), bounds);
            let middle = (bounds[0] + bounds[1]).as_dvec3() / 2.0;
            (found, middle)
        };
        let (whole, middle) = of([UVec3::new(1, 0, 6), UVec3::new(29, 13, 24)], Clip::default());
        assert!((whole - middle.distance(specks[1].as_dvec3())).abs() < 1e-12, "{whole}");
        // Specks that the box leaves out do not count.
        let (inner, middle) = of(block, Clip::default());
        assert!((inner - middle.distance(block[1].as_dvec3())).abs() < 1e-12, "{inner}");
        // Neither do voxels that are cut away: x ≥ 0 keeps the kernels of voxels from 14.5 - 2 on.
        let clip = Clip { planes: vec![[1.0, 0.0, 0.0, 0.0]], ..Clip::default() };
        let (cut, middle) = of([block[0], UVec3::new(24, 13, 16)], clip);
        assert!((cut - middle.distance(UVec3::new(20, 13, 16).as_dvec3())).abs() < 1e-12, "{cut}");
        assert_eq!(of([UVec3::new(22, 0, 0), UVec3::new(25, 3, 4)], Clip::default()).0, 0.0);
    }

    #[test]
    fn cuts_iso_ranges_and_gradients_rule_voxels_out() {
        let block = [UVec3::new(4, 3, 6), UVec3::new(20, 13, 16)];
        let volume = volume(block, &[]);
        let of = |transfer: &[TransferFunction], clip: Clip| {
            of_voxels(&volume, transfer, &clip.voxels(volume.grid(), 2.0), 0.0)
        };
        assert_eq!(of(&[transfer()], Clip::default()), Some(block));
        // x ≥ 0 keeps the kernels of voxels from 14.5 - 2 on.
        let clip = Clip { planes: vec![[1.0, 0.0, 0.0, 0.0]], ..Clip::default() };
        assert_eq!(of(&[transfer()], clip), Some([UVec3::new(13, 3, 6), block[1]]));
        let nothing = TransferFunction { iso_ranges: Some(vec![[200.0, 300.0]]), ..transfer() };
        assert_eq!(of(&[nothing], Clip::default()), None);
        let flat = Ramp::new(vec![(0.0, 1.0), (10.0, 0.0)]).unwrap();
        let inner = TransferFunction { gradient_opacity: Some(flat), ..transfer() };
        assert_eq!(of(&[inner], Clip::default()), Some([block[0] + 1, block[1] - 1]));
    }
}

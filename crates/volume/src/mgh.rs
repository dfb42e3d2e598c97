//! FreeSurfer's MGH files, plain (`.mgh`) or gzipped (`.mgz`): a big-endian binary header of 284 bytes, then the samples. Scan
//! parameters and a history may follow; they do not affect the volume.

use std::io::BufRead;
use std::path::Path;

use glam::{DMat3, DVec3};

use super::VolumeError;
use super::access::Access;
use super::error::volume::{invalid, io_error};
use super::grid::{SIZES, dims_of};
use super::loaded::Loaded;
use super::orientation::Orientation;
use super::sample_type::SampleType;
use super::samples::Samples;
use super::series::Series;
use super::shear::{self, Lattice};
use super::stream::Stream;

/// The size of the header in bytes.
const HEADER: u64 = 284;

/// The format's codes of data types.
const TYPES: [(i32, SampleType); 4] =
    [(0, SampleType::U8), (1, SampleType::I32), (3, SampleType::F32), (4, SampleType::I16)];

/// The fields with the directions.
const DIRECTIONS: &str = "x_ras, y_ras, z_ras";

/// Reads a file, whose frames are times.
pub(super) fn read(path: &Path, access: &Access) -> Result<Loaded, VolumeError> {
    let mut file = access.open(path)?;
    let is_gzip = file.reader.fill_buf().map_err(io_error(path))?.starts_with(&[0x1f, 0x8b]);
    let mut stream = if is_gzip { Stream::gzip(file)? } else { Stream::raw(file)? };
    let header = Header(stream.bytes(HEADER)?);
    if header.i32(0) != 1 {
        return Err(invalid(path, "version", header.i32(0), "1"));
    }
    let sizes = [4, 8, 12].map(|at| header.i32(at));
    let dims = dims_of(sizes).ok_or_else(|| invalid(path, "width, height, depth", format!("{sizes:?}"), SIZES))?;
    let times = u32::try_from(header.i32(16)).ok().filter(|&frames| frames > 0);
    let times = times.ok_or_else(|| invalid(path, "nframes", header.i32(16), "a positive number of frames"))?;
    let series = Series { times, ..Series::default() };
    let code = header.i32(20);
    let Some(&(_, kind)) = TYPES.iter().find(|(known, _)| *known == code) else {
        let allowed = TYPES.map(|(code, kind)| format!("{code} ({kind})")).join(", ");
        return Err(invalid(path, "type", code, allowed));
    };
    let [spacing, x, y, z, center] = header.geometry();
    let numbers = [("spacing", spacing), (DIRECTIONS, x + y + z), ("c_ras", center)];
    if let Some((field, numbers)) = numbers.into_iter().find(|(_, numbers)| !numbers.is_finite()) {
        return Err(invalid(path, field, numbers, "finite numbers"));
    }
    if spacing.min_element() <= 0.0 {
        return Err(invalid(path, "spacing", spacing, "three positive numbers"));
    }
    let steps = [x * spacing.x, y * spacing.y, z * spacing.z];
    let lattice = Lattice::of(steps).map_err(|found| invalid(path, DIRECTIONS, found, shear::allowed()))?;
    // The stated centre is the position of voxel `dims / 2`, half a voxel beyond the middle of the voxel centres.
    let origin = center - DMat3::from_cols(steps[0], steps[1], steps[2]) * (dims.as_dvec3() / 2.0);
    let samples = Samples { kind, dims, big_endian: true, rescale: None, z_fastest: false };
    let orientation = Some(Orientation { axes: lattice.axes, origin });
    let (spacing, unit) = (Some(lattice.spacing), Some("mm".to_owned()));
    let loaded = Loaded::new(dims, kind, stream.series(&samples, &series, true)?);
    let loaded = Loaded { spacing, unit, orientation, series, ..loaded };
    lattice.straighten(path, DIRECTIONS, loaded, access)
}

/// A header's bytes.
struct Header(Vec<u8>);

impl Header {
    fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        std::array::from_fn(|i| self.0[at + i])
    }

    fn i32(&self, at: usize) -> i32 {
        i32::from_be_bytes(self.bytes(at))
    }

    fn vector(&self, at: usize) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|i| f32::from_be_bytes(self.bytes(at + 4 * i)).into()))
    }

    /// Spacing, directions of x, y and z, and centre, in RAS and millimetres. Without `goodRASFlag` these are FreeSurfer's defaults:
    /// coronal slices, 1 mm apart.
    fn geometry(&self) -> [DVec3; 5] {
        match i16::from_be_bytes(self.bytes(28)) {
            1.. => [30, 42, 54, 66, 78].map(|at| self.vector(at)),
            _ => [DVec3::ONE, DVec3::NEG_X, DVec3::NEG_Z, DVec3::Y, DVec3::ZERO],
        }
    }
}

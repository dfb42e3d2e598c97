//! The preset that fits a volume, judged by its values and its file.

use super::categories;
use super::hounsfield::offset_of;
use super::object::Object;
use super::preset::Preset;
use super::quantile::quantiles;
use crate::volume::{ValueSlice, Volume};

/// Hounsfield units of air, of soft tissue, and of everything denser than lungs.
const AIR: [f64; 2] = [-1100.0, -850.0];
const SOFT_TISSUE: [f64; 2] = [-150.0, 150.0];
const BODY: [f64; 2] = [-500.0, f64::INFINITY];
const BONE: [f64; 2] = [300.0, f64::INFINITY];

/// The sides of a box around a head in mm.
const HEAD: std::ops::RangeInclusive<f64> = 100.0..=300.0;

impl Preset {
    /// The preset that fits a volume, judged by its values and its file; `None` if these do not tell, in which case
    /// [`TransferFunction::from_histogram`](crate::settings::TransferFunction::from_histogram) is the best choice.
    ///
    /// - `photo`: a volume of colours.
    /// - `labels`: a label map ([`categories::is_label_map`]).
    /// - `confocal`: several channels, or lengths in µm or nm.
    /// - `ct-bone`, or without bone `ct-skin`: Hounsfield units, plain or with 1024 added: air around tissue, most of which is soft.
    /// - `mr-head`: sides of 100 to 300 mm (or without unit), no negative values, and an object in at least three tenths of the voxels.
    pub fn suggested(volume: &Volume) -> Option<Self> {
        if volume.colors().is_some() {
            return Some(Self::Photo);
        }
        if categories::is_label_map(volume) {
            return Some(Self::Labels);
        }
        if volume.channel_count() > 1 || volume.unit().is_some_and(|unit| ["µm", "nm"].contains(&unit)) {
            return Some(Self::Confocal);
        }
        let values = volume.values();
        if let Some(offset) = offset_of(values)
            && let Some(has_bone) = is_ct(values, offset)
        {
            return Some(if has_bone { Self::CtBone } else { Self::CtSkin });
        }
        is_head(volume).then_some(Self::MrHead)
    }
}

/// Whether values minus an offset are Hounsfield units of a body in air (`None` if not), and if so, whether there is bone.
fn is_ct(values: ValueSlice<'_>, offset: f64) -> Option<bool> {
    let count = |[low, high]: [f64; 2]| {
        let is_in = |value: &f32| (low..=high).contains(&(f64::from(*value) - offset));
        values.par_iter().filter(is_in).count() as f64
    };
    let body = count(BODY);
    // In other measured data, such as MR, no range of 300 units contains half of the body's values.
    let is_ct = count(AIR) >= 0.02 * values.len() as f64 && count(SOFT_TISSUE) >= body / 2.0 && body > 0.0;
    is_ct.then(|| count(BONE) >= 0.01 * body)
}

fn is_head(volume: &Volume) -> bool {
    let values = volume.values();
    let size = volume.dims().as_dvec3() * volume.spacing();
    let may_be_mm = volume.unit().is_none_or(|unit| unit == "mm") && volume.encoding().is_some();
    let is_positive = || quantiles(values, |_| true, [0.0]).is_some_and(|[least]| least >= 0.0);
    may_be_mm
        && size.to_array().iter().all(|side| HEAD.contains(side))
        && is_positive()
        && Object::find(values).is_some_and(|object| {
            let threshold = object.threshold() as f32;
            values.par_iter().filter(|&value| value > threshold).count() * 10 >= values.len() * 3
        })
}

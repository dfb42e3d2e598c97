//! The samples of several volumes in a stream (SPEC §10).

use super::error::volume::{VolumeError, invalid};
use super::grid::dims_of;
use super::located::Located;
use super::samples::Samples;
use super::series::{Series, SeriesOrder};
use super::stream::Stream;
use super::voxels::Voxels;

impl Stream {
    /// The samples of the selected volumes of a series, channel by channel; `samples` are those of one volume. The stream must end after them as in
    /// [`Self::samples`].
    pub(super) fn series(mut self, samples: &Samples, series: &Series, window: bool) -> Result<Voxels, VolumeError> {
        let selection = self.access.selection();
        series.check(&self.path, selection)?;
        if self.access.is_noting() {
            let located = self.locate(samples, series)?;
            self.access.note(located);
            return Ok(self.access.wanted().none());
        }
        let channels = series.channels(selection);
        if series.count() == 1 {
            return self.samples(samples, window);
        }
        let total = samples.bytes().saturating_mul(series.count());
        let is_wrong = |left: u64| left < total || left > total && !window;
        if let Some(left) = self.exactly_left().filter(|&left| is_wrong(left)) {
            let allowed = format!("{total} bytes ({} volumes of {} samples)", series.count(), samples.count());
            return Err(invalid(&self.path, "data", format!("{left} bytes"), allowed));
        }
        let time = selection.time.unwrap_or(0);
        match series.order {
            SeriesOrder::Interleaved => {
                self.skip(u64::from(time) * u64::from(series.channels) * samples.bytes())?;
                let numbers = channels.map(u64::from);
                return self.interleaved(samples, (series.channels.into(), numbers), window || series.times > 1);
            }
            #[cfg(feature = "npy")]
            SeriesOrder::TimesInChannels => {
                let numbers = channels.map(|channel| u64::from(channel) * u64::from(series.times) + u64::from(time));
                return self.interleaved(samples, (series.count(), numbers), window);
            }
            _ => {}
        }
        let (mut values, mut at) = (self.access.wanted().none(), 0);
        for channel in channels {
            let block = series.block(channel, selection);
            self.skip((block - at) * samples.bytes())?;
            samples.reserve(&self.path, &self.access)?;
            let of_channel = self.read_samples(samples)?;
            if values.count() == 0 {
                values = of_channel;
            } else {
                let appended = values.append_from(&of_channel, 0..of_channel.count());
                appended.map_err(samples.too_many(&self.path))?;
            }
            at = block + 1;
        }
        Ok(values)
    }

    /// Where the samples are in an uncompressed file, which must hold them all.
    fn locate(&mut self, samples: &Samples, series: &Series) -> Result<Located, VolumeError> {
        let total = samples.bytes().saturating_mul(series.count());
        let allowed = format!("at least {total} bytes, uncompressed, x fastest");
        let at =
            self.position()?.filter(|_| !samples.z_fastest && self.exactly_left().is_some_and(|left| left >= total));
        let at = at.ok_or_else(|| {
            let found = self.exactly_left().map_or("a compressed stream".to_owned(), |left| format!("{left} bytes"));
            let found = if samples.z_fastest { "z fastest".to_owned() } else { found };
            invalid(&self.path, "data", found, allowed)
        })?;
        Ok(Located { path: self.path.clone(), at, samples: *samples, series: *series })
    }

    /// The samples with some numbers, of `count` that each voxel has side by side.
    fn interleaved(
        self,
        samples: &Samples,
        (count, numbers): (u64, impl Iterator<Item = u64>),
        window: bool,
    ) -> Result<Voxels, VolumeError> {
        let [x, y, z] = samples.dims.to_array().map(u64::from);
        // They count as voxels along the axis that changes first.
        let sides = if samples.z_fastest { [x, y, z.saturating_mul(count)] } else { [x.saturating_mul(count), y, z] };
        let Some(dims) = dims_of(sides) else {
            let found = format!("{count} channels of {} voxels", samples.count());
            return Err(invalid(&self.path, "sizes", found, "at most 4294967295 samples"));
        };
        let (path, access) = (self.path.clone(), self.access.clone());
        let all = self.samples(&Samples { dims, ..*samples }, window)?;
        // Those of a voxel lie together, or where z changes first, those of a slice.
        let together = if samples.z_fastest { (x * y) as usize } else { 1 };
        let (count, mut values) = (count as usize, all.none_alike());
        for number in numbers {
            samples.reserve(&path, &access)?;
            let runs = (number as usize * together..all.count()).step_by(count * together);
            let appended = values.append_from(&all, runs.flat_map(|first| first..first + together));
            appended.map_err(samples.too_many(&path))?;
        }
        Ok(values)
    }
}

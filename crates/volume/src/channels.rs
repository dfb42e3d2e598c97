//! Volumes of several channels: values of several kinds on one grid (SPEC §10).

use std::sync::Arc;

use super::{Volume, VolumeError};

impl Volume {
    /// The same volume with other further channels, which lie on its grid and take its spacing. `origin` names the volumes in errors.
    ///
    /// # Errors
    /// If a channel has other dimensions than this volume, or further channels of its own.
    pub fn with_channels(mut self, origin: &str, further: Vec<Self>) -> Result<Self, VolumeError> {
        for (number, channel) in (1..).zip(&further) {
            let key = format!("channel[{number}]");
            if channel.dims() != self.dims() {
                let allowed = format!("{}, those of channel[0]", self.dims());
                return Err(VolumeError::invalid(origin, &key, format!("the sizes {}", channel.dims()), allowed));
            }
            if !channel.further.is_empty() {
                let found = format!("a volume of {} channels", channel.channels().count());
                return Err(VolumeError::invalid(origin, &key, found, "a volume of one channel".to_owned()));
            }
        }
        let grid = self.grid;
        self.further = further.into_iter().map(|channel| Arc::new(Self { grid, ..channel })).collect();
        Ok(self)
    }

    /// The same volume with a name for its first channel, in place of the file's.
    pub fn with_channel_name(mut self, name: Option<String>) -> Self {
        self.channel_name = name;
        self
    }

    /// The channels after the first. They have no further ones themselves.
    pub fn further(&self) -> &[Arc<Self>] {
        &self.further
    }

    /// All channels. The first is this volume itself, whose own values, labels and gradients are those of the first channel alone.
    pub fn channels(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(self.further.iter().map(Arc::as_ref))
    }

    /// This channel without further ones.
    #[doc(hidden)]
    pub fn alone(&self) -> Self {
        Self { further: Vec::new(), ..self.clone() }
    }

    /// A channel by its number, from 0; `None` if there are fewer channels.
    pub fn channel(&self, number: usize) -> Option<&Self> {
        self.channels().nth(number)
    }

    /// The name of the first channel, if its file states one.
    pub fn channel_name(&self) -> Option<&str> {
        self.channel_name.as_deref()
    }
}

//! Lists of channels, and volumes of several: values of several kinds on one grid (SPEC §10).

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use super::{Volume, VolumeError};

/// One item for every channel (SPEC §10), from the first on: a list that is never empty. It reads as a slice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channels<T>(Vec<T>);

impl<T> Channels<T> {
    /// A list of the first channel's item and those of the channels after it.
    pub fn new(first: T, others: impl IntoIterator<Item = T>) -> Self {
        Self(std::iter::once(first).chain(others).collect())
    }

    /// Makes a list of items; `None` if `items` is empty.
    pub fn of(items: impl IntoIterator<Item = T>) -> Option<Self> {
        let items: Vec<T> = items.into_iter().collect();
        (!items.is_empty()).then_some(Self(items))
    }

    /// The first channel's item.
    pub fn first(&self) -> &T {
        &self.0[0]
    }

    /// The first channel's item.
    pub fn first_mut(&mut self) -> &mut T {
        &mut self.0[0]
    }

    /// Adds a channel's item behind the others.
    pub fn push(&mut self, item: T) {
        self.0.push(item);
    }

    /// Keeps at most the first `count` items, and at least one.
    pub fn truncate(&mut self, count: usize) {
        self.0.truncate(count.max(1));
    }

    /// A list of what a function makes of every item.
    pub fn map<U>(self, of: impl FnMut(T) -> U) -> Channels<U> {
        Channels(self.0.into_iter().map(of).collect())
    }

    /// [`Self::map`] by a function that may fail.
    ///
    /// # Errors
    /// The first one.
    pub fn try_map<U, E>(self, of: impl FnMut(T) -> Result<U, E>) -> Result<Channels<U>, E> {
        Ok(Channels(self.0.into_iter().map(of).collect::<Result<_, E>>()?))
    }
}

impl<T> From<T> for Channels<T> {
    /// A list of one.
    fn from(only: T) -> Self {
        Self(vec![only])
    }
}

impl<T> Deref for Channels<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.0
    }
}

impl<T> DerefMut for Channels<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.0
    }
}

impl<T> IntoIterator for Channels<T> {
    type Item = T;
    type IntoIter = std::vec::IntoIter<T>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

impl<'a, T> IntoIterator for &'a Channels<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

impl Volume {
    /// The same volume with other channels after its first, which lie on its grid and take its spacing. `origin` names the volumes in errors.
    ///
    /// # Errors
    /// If a channel has other dimensions than this volume, or several channels itself.
    pub fn with_channels(mut self, origin: &str, others: Vec<Self>) -> Result<Self, VolumeError> {
        for (number, channel) in (1..).zip(&others) {
            let key = format!("channel[{number}]");
            if channel.dims() != self.dims() {
                let allowed = format!("{}, those of channel[0]", self.dims());
                return Err(VolumeError::invalid(origin, &key, format!("the sizes {}", channel.dims()), allowed));
            }
            if channel.channel_count() > 1 {
                let found = format!("a volume of {} channels", channel.channel_count());
                return Err(VolumeError::invalid(origin, &key, found, "a volume of one channel".to_owned()));
            }
        }
        let grid = self.grid;
        self.others = others.into_iter().map(|channel| Arc::new(Self { grid, ..channel })).collect();
        Ok(self)
    }

    /// The volume of several channels' volumes, on the first one's grid ([`Self::with_channels`]).
    ///
    /// # Errors
    /// As for [`Self::with_channels`].
    pub fn of_channels(origin: &str, channels: Channels<Self>) -> Result<Self, VolumeError> {
        let Channels(mut channels) = channels;
        let others = channels.split_off(1);
        channels.remove(0).with_channels(origin, others)
    }

    /// The same volume with a name for its first channel, in place of the file's.
    pub fn with_channel_name(mut self, name: Option<String>) -> Self {
        self.channel_name = name;
        self
    }

    /// All channels, each a volume of one. The first is this volume itself, whose own values, labels and gradients are those of the first channel alone.
    pub fn channels(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(self.others.iter().map(Arc::as_ref))
    }

    /// All channels of a volume that is shared, which share their values with it.
    #[doc(hidden)]
    pub fn shared_channels(self: &Arc<Self>) -> impl Iterator<Item = &Arc<Self>> {
        std::iter::once(self).chain(&self.others)
    }

    /// Calls a function with every channel and its number, from 0 on, and lists the results.
    pub fn each_channel<T>(&self, mut of: impl FnMut(usize, &Self) -> T) -> Channels<T> {
        Channels(self.channels().enumerate().map(|(number, channel)| of(number, channel)).collect())
    }

    /// The number of channels, at least 1.
    pub fn channel_count(&self) -> usize {
        1 + self.others.len()
    }

    /// This channel by itself.
    #[doc(hidden)]
    pub fn alone(&self) -> Self {
        Self { others: Vec::new(), ..self.clone() }
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

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_never_empty() {
        assert_eq!(Channels::<u8>::of([]), None);
        let mut list = Channels::of([3, 4, 5]).unwrap();
        assert_eq!(list, Channels::new(3, [4, 5]));
        list.truncate(0);
        assert_eq!((list.len(), *list.first()), (1, 3));
        list.push(7);
        assert_eq!(list.clone().map(|item| item * 2)[..], [6, 14]);
        assert_eq!(list.try_map(|item| if item == 7 { Err("seven") } else { Ok(item) }), Err("seven"));
    }
}

//! The numbers of a volume's channels, one channel after the other.

use std::borrow::Cow;

/// The numbers of all channels that have any; `None` if no channel has.
pub(super) fn one_after_the_other<'a, T: Copy>(mut channels: impl Iterator<Item = &'a [T]>) -> Option<Cow<'a, [T]>> {
    let mut all = Cow::Borrowed(channels.next()?);
    channels.for_each(|channel| all.to_mut().extend_from_slice(channel));
    Some(all)
}

//! The order of a file's pages: slices, channels and times.

use super::super::series::{MAX_CHANNELS, Series, SeriesOrder};

/// How many slices, channels and times the pages show, and in which order they come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stack {
    pub(super) slices: u32,
    pub(super) channels: u32,
    pub(super) times: u32,
    /// The axes, that which changes from page to page first.
    pub(super) order: [Axis; 3],
}

/// An axis of a stack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axis {
    Slice,
    Channel,
    Time,
}

/// What a page shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) slice: u32,
    pub(super) channel: u32,
    pub(super) time: u32,
}

impl Stack {
    /// The order in which ImageJ writes pages.
    pub(super) const IMAGE_J: [Axis; 3] = [Axis::Channel, Axis::Slice, Axis::Time];

    /// Pages that are the slices of one volume.
    pub(super) fn of_slices(slices: u32) -> Self {
        Self { slices, channels: 1, times: 1, order: Self::IMAGE_J }
    }

    /// The number of pages; `None` if they are too many, or channels are.
    pub(super) fn pages(&self) -> Option<u32> {
        let pages = self.slices.checked_mul(self.channels)?.checked_mul(self.times);
        pages.filter(|_| self.channels <= MAX_CHANNELS)
    }

    /// The same where every pixel has a number of samples: OME counts each as a channel.
    pub(super) fn of_pixels(self, samples: u32) -> Self {
        if samples > 1 && self.channels == samples { Self { channels: 1, ..self } } else { self }
    }

    fn count(&self, axis: Axis) -> u32 {
        match axis {
            Axis::Slice => self.slices,
            Axis::Channel => self.channels,
            Axis::Time => self.times,
        }
    }

    /// What a page shows, counted from 0.
    pub(super) fn place(&self, mut page: u32) -> Place {
        let mut place = Place::default();
        for axis in self.order {
            let at = page % self.count(axis);
            page /= self.count(axis);
            match axis {
                Axis::Slice => place.slice = at,
                Axis::Channel => place.channel = at,
                Axis::Time => place.time = at,
            }
        }
        place
    }

    /// The volumes of the pages.
    pub(super) fn series(&self) -> Series {
        Series { channels: self.channels, times: self.times, order: SeriesOrder::ChannelsFirst, is_color: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_come_in_the_order_of_the_axes() {
        let stack = Stack { slices: 5, channels: 3, times: 2, order: [Axis::Slice, Axis::Time, Axis::Channel] };
        assert_eq!(stack.pages(), Some(30));
        let places: Vec<Place> = (0..30).map(|page| stack.place(page)).collect();
        let expected = (0..3)
            .flat_map(|channel| (0..2).map(move |time| (channel, time)))
            .flat_map(|(channel, time)| (0..5).map(move |slice| Place { slice, channel, time }));
        assert_eq!(places, expected.collect::<Vec<_>>());
    }
}

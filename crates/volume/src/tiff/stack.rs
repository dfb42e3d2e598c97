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

/// Pages one after the other, which show what is one after the other in a stack's order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    /// The first page, counted from 0.
    pub(super) page: u32,
    /// The number that it would have if all pages came in the stack's order.
    pub(super) number: u32,
    pub(super) count: u32,
}

impl Run {
    /// The number of a page in the stack's order: that of the first run that holds it, or else its own.
    pub(super) fn number_of(runs: &[Self], page: u32) -> u32 {
        let within = |run: &Self| {
            let at = page.checked_sub(run.page).filter(|&at| at < run.count)?;
            run.number.checked_add(at)
        };
        runs.iter().find_map(within).unwrap_or(page)
    }
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

    /// The page that shows what is at a place, if pages come in order; `None` if the stack has no such place.
    pub(super) fn number(&self, place: Place) -> Option<u32> {
        let (mut number, mut step) = (0_u32, 1_u32);
        for axis in self.order {
            let at = match axis {
                Axis::Slice => place.slice,
                Axis::Channel => place.channel,
                Axis::Time => place.time,
            };
            if at >= self.count(axis) {
                return None;
            }
            number = number.checked_add(at.checked_mul(step)?)?;
            step = step.checked_mul(self.count(axis))?;
        }
        Some(number)
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
        assert!(places.iter().zip(0..).all(|(&place, page)| stack.number(place) == Some(page)));
        assert_eq!(stack.number(Place { slice: 5, channel: 0, time: 0 }), None);
    }

    #[test]
    fn runs_of_pages() {
        let runs = [Run { page: 4, number: 0, count: 2 }, Run { page: 0, number: 2, count: 3 }];
        let numbers: Vec<u32> = (0..8).map(|page| Run::number_of(&runs, page)).collect();
        assert_eq!(numbers, [2, 3, 4, 3, 0, 1, 6, 7]);
        let all = [Run { page: 0, number: 0, count: u32::MAX }];
        assert_eq!(Run::number_of(&all, u32::MAX), u32::MAX);
    }
}

//! The order of a file's pages: slices, channels and times.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;

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

/// The pages of all runs. A page that several runs hold belongs to the first of these.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Runs(Vec<Piece>);

/// Pages of one run.
#[derive(Clone, Debug, PartialEq)]
struct Piece {
    pages: Range<u64>,
    /// The number of the first page.
    number: u64,
}

impl Runs {
    /// Cuts the runs into pieces that share no pages, in the order of their pages, by one walk over all first and last pages.
    pub(super) fn new(runs: &[Run]) -> Self {
        let numbers = |run: &Run| u64::from(run.count).min((1 << 32) - u64::from(run.number));
        let pages = |run: &Run| u64::from(run.page)..u64::from(run.page) + numbers(run);
        let mut starts: Vec<(u64, usize)> = runs.iter().enumerate().map(|(at, run)| (pages(run).start, at)).collect();
        let mut ends: Vec<u64> = runs.iter().map(pages).flat_map(|pages| [pages.start, pages.end]).collect();
        starts.sort_unstable();
        ends.sort_unstable();
        ends.dedup();
        let (mut open, mut starts, mut pieces) = (BinaryHeap::new(), starts.into_iter().peekable(), Vec::new());
        for pair in ends.windows(2) {
            while let Some((_, at)) = starts.next_if(|&(start, _)| start <= pair[0]) {
                open.push(Reverse(at));
            }
            while open.peek().is_some_and(|&Reverse(at)| pages(&runs[at]).end <= pair[0]) {
                open.pop();
            }
            if let Some(&Reverse(first)) = open.peek() {
                let number = u64::from(runs[first].number) + pair[0] - u64::from(runs[first].page);
                pieces.push(Piece { pages: pair[0]..pair[1], number });
            }
        }
        Self(pieces)
    }

    /// The number of a page in the stack's order: that of the first run that holds it, if any does.
    pub(super) fn stated(&self, page: u32) -> Option<u32> {
        let at = self.0.partition_point(|piece| piece.pages.end <= page.into());
        let piece = self.0.get(at).filter(|piece| piece.pages.start <= page.into())?;
        Some((piece.number + u64::from(page) - piece.pages.start) as u32)
    }

    /// The number of a page in the stack's order: that of the first run that holds it, or else its own.
    pub(super) fn number_of(&self, page: u32) -> u32 {
        self.stated(page).unwrap_or(page)
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
        let runs = Runs::new(&[Run { page: 4, number: 0, count: 2 }, Run { page: 0, number: 2, count: 3 }]);
        let numbers: Vec<u32> = (0..8).map(|page| runs.number_of(page)).collect();
        assert_eq!(numbers, [2, 3, 4, 3, 0, 1, 6, 7]);
        let all = Runs::new(&[Run { page: 0, number: 0, count: u32::MAX }]);
        assert_eq!(all.number_of(u32::MAX), u32::MAX);
        // Every run is shorter than all before it, which hold its pages too, and begins where none did.
        let count = 100_000;
        let nested = (0..count).map(|at| Run { page: count - at, number: at, count: 2 * at }).collect::<Vec<_>>();
        let numbers = Runs::new(&nested);
        assert!(numbers.0.len() <= 2 * nested.len(), "{}", numbers.0.len());
        for page in (0..2 * count).step_by(1001) {
            let within = |run: &Run| page.checked_sub(run.page).filter(|&at| at < run.count).map(|at| run.number + at);
            assert_eq!(numbers.number_of(page), nested.iter().find_map(within).unwrap_or(page), "{page}");
        }
    }
}

//! The pixels of a region behind which anything can be seen.

use glam::DVec2;

use crate::settings::window::Region;

/// For every corner of a region's pixels how many open ones lie above it and to the left, so that those of any rectangle are known at once.
#[derive(Debug)]
pub(super) struct OpenPixels {
    region: Region,
    counts: Vec<u32>,
}

impl OpenPixels {
    /// The pixels of a region that are open, row by row.
    pub(super) fn new(region: Region, is_open: impl Iterator<Item = bool>) -> Self {
        let across = region.width as usize + 1;
        let mut counts = vec![0; across];
        let mut row = 0;
        for (at, is_open) in is_open.enumerate() {
            if at % region.width as usize == 0 {
                counts.push(0);
                row = 0;
            }
            row += u32::from(is_open);
            counts.push(counts[counts.len() - across] + row);
        }
        Self { region, counts }
    }

    /// All pixels of a region.
    pub(super) fn all(region: Region) -> Self {
        Self::new(region, std::iter::repeat_n(true, region.pixels()))
    }

    /// Whether a pixel is open of those between two places on the image, or around them.
    pub(super) fn any_between(&self, low: DVec2, high: DVec2) -> bool {
        let Region { x, y, width, height } = self.region;
        let place = |at: f64, first: u32, length: u32| (at - f64::from(first)).clamp(0.0, length.into()) as usize;
        let [left, right] = [low.x.floor(), high.x.floor() + 1.0].map(|at| place(at, x, width));
        let [top, bottom] = [low.y.floor(), high.y.floor() + 1.0].map(|at| place(at, y, height));
        if left >= right || top >= bottom {
            return false;
        }
        let count = |x: usize, y: usize| self.counts[y * (width as usize + 1) + x];
        count(right, bottom) + count(left, top) > count(left, bottom) + count(right, top)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_rectangle_is_known() {
        let region = Region { x: 3, y: 5, width: 7, height: 4 };
        let is_open = |at: u32| at % 5 == 1 && at > 6;
        let open = OpenPixels::new(region, (0..28).map(is_open));
        let (mut some, mut none) = (0, 0);
        for (left, top) in (0..12).flat_map(|x| (0..12).map(move |y| (x, y))) {
            for (right, bottom) in (left..12).flat_map(|x| (top..12).map(move |y| (x, y))) {
                let pixels = (3..10).flat_map(|x| (5..9).map(move |y| (x, y)));
                let inside = pixels
                    .filter(|&(x, y)| (left..=right).contains(&x) && (top..=bottom).contains(&y))
                    .filter(|&(x, y)| is_open(x - 3 + 7 * (y - 5)));
                let expected = inside.count() > 0;
                let place = |x: u32, y: u32| DVec2::new(x.into(), y.into());
                assert_eq!(open.any_between(place(left, top) + 0.6, place(right, bottom) + 0.4), expected);
                if expected { some += 1 } else { none += 1 }
            }
        }
        assert!(some > 100 && none > 100, "{some} {none}");
        assert!(open.any_between(DVec2::NEG_INFINITY, DVec2::INFINITY));
    }
}

//! Where in a target an image goes.

use std::ops::Range;

/// Where in a target an image goes. Pixels, from the target's upper left corner, right and down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Placement {
    /// Where the image's upper left pixel goes: anywhere, also outside of the target.
    pub origin: [i32; 2],
    /// The part of the target that may change: x, y, width and height. It must lie in the target.
    pub scissor: [u32; 4],
}

impl Placement {
    /// The image in the upper left corner of a target of the given width and height, all of which it may change.
    pub const fn whole([width, height]: [u32; 2]) -> Self {
        Self { origin: [0, 0], scissor: [0, 0, width, height] }
    }

    /// The part of the target that some rows of an image `width` pixels wide cover: x, y, width and height; `None` if they cover
    /// nothing.
    pub(crate) fn covered(&self, width: u32, rows: Range<u32>) -> Option<[u32; 4]> {
        let [x, y, scissor_width, scissor_height] = self.scissor;
        let (x, width) = overlap(self.origin[0], 0..width, x, scissor_width)?;
        let (y, height) = overlap(self.origin[1], rows, y, scissor_height)?;
        Some([x, y, width, height])
    }
}

/// Start and length of what `image` pixels from an origin on, and `length` pixels from `start` on, have in common.
fn overlap(origin: i32, image: Range<u32>, start: u32, length: u32) -> Option<(u32, u32)> {
    let (origin, start, length) = (i64::from(origin), i64::from(start), i64::from(length));
    let first = start.max(origin + i64::from(image.start));
    let end = (start + length).min(origin + i64::from(image.end));
    (first < end).then_some((first as u32, (end - first) as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rows_cover() {
        let at = |origin, scissor| Placement { origin, scissor };
        let target = [0, 0, 100, 80];
        assert_eq!(Placement::whole([100, 80]).covered(100, 0..80), Some(target));
        assert_eq!(at([-10, 60], target).covered(30, 0..32), Some([0, 60, 20, 20]));
        assert_eq!(at([-10, 60], target).covered(30, 32..64), None);
        assert_eq!(at([90, -40], target).covered(30, 32..64), Some([90, 0, 10, 24]));
        assert_eq!(at([5, 6], [8, 8, 4, 3]).covered(30, 0..32), Some([8, 8, 4, 3]));
        assert_eq!(at([5, 6], [8, 8, 0, 3]).covered(30, 0..32), None);
        assert_eq!(at([i32::MIN, i32::MAX], [0, 0, u32::MAX, u32::MAX]).covered(30, 0..32), None);
    }
}

//! The position of an image in a target.

use std::ops::Range;

use crate::error::setting::SettingError;

/// The position of an image in a target, in pixels right and down from the target's upper left corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Placement {
    /// The position of the image's upper left pixel, which may lie outside the target.
    pub origin: [i32; 2],
    /// The part of the target that may change: x, y, width and height. It must lie within the target.
    pub scissor: [u32; 4],
}

impl Placement {
    /// The image in the upper left corner of a target of the given width and height, which may change everywhere.
    pub const fn whole([width, height]: [u32; 2]) -> Self {
        Self { origin: [0, 0], scissor: [0, 0, width, height] }
    }

    /// Checks that the scissor lies in a target of the given width and height.
    ///
    /// # Errors
    /// If it does not lie within the target.
    pub fn check(&self, target: [u32; 2]) -> Result<(), SettingError> {
        let [x, y, width, height] = self.scissor.map(u64::from);
        if x + width <= target[0].into() && y + height <= target[1].into() {
            return Ok(());
        }
        let allowed = format!("[x, y, width, height] within the target's {}×{}", target[0], target[1]);
        Err(SettingError::new("placement.scissor", &self.scissor.map(f64::from)[..], allowed))
    }

    /// The part of the target, as x, y, width and height, that some rows of an image `width` pixels wide cover; `None` if that is empty.
    pub(crate) fn covered(&self, width: u32, rows: Range<u32>) -> Option<[u32; 4]> {
        let [x, y, scissor_width, scissor_height] = self.scissor;
        let (x, width) = overlap(self.origin[0], 0..width, x, scissor_width)?;
        let (y, height) = overlap(self.origin[1], rows, y, scissor_height)?;
        Some([x, y, width, height])
    }
}

/// The start and length of the overlap between the `image` pixels from an origin on and the `length` pixels from `start` on.
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
    fn scissors_lie_in_the_target() {
        let check = |scissor| Placement { origin: [-5, i32::MAX], scissor }.check([100, 80]);
        assert_eq!([[0, 0, 100, 80], [99, 79, 1, 1], [100, 80, 0, 0]].map(check), [const { Ok(()) }; 3]);
        for scissor in [[0, 0, 101, 80], [0, 1, 100, 80], [u32::MAX, 0, u32::MAX, 1]] {
            let message = check(scissor).expect_err("it reaches beyond").to_string();
            assert!(message.starts_with("placement.scissor: found [") && message.ends_with("100×80"), "{message}");
        }
    }

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

//! The slabs and pixels of a frame that are drawn (SPEC §11).

use std::ops::Range;

use crate::error::setting::SettingError;
#[cfg(any(feature = "cpu", feature = "gpu"))]
use crate::settings::splatting::{Classification, Compositing};

/// A rectangle of pixels of an image, at least one pixel wide and high.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Region {
    /// The first column, counted from the left.
    pub x: u32,
    /// The first row, counted from the top.
    pub y: u32,
    /// The number of columns.
    pub width: u32,
    /// The number of rows.
    pub height: u32,
}

impl Region {
    /// A whole image of some width and height.
    pub fn whole([width, height]: [u32; 2]) -> Self {
        Self { x: 0, y: 0, width, height }
    }

    /// The columns.
    pub(crate) fn columns(&self) -> Range<usize> {
        self.x as usize..self.x as usize + self.width as usize
    }

    /// The rows.
    pub(crate) fn rows(&self) -> Range<usize> {
        self.y as usize..self.y as usize + self.height as usize
    }

    /// The number of pixels.
    pub(crate) fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Whether two regions share a pixel.
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        let meet = |a: Range<usize>, b: Range<usize>| a.start < b.end && b.start < a.end;
        meet(self.columns(), other.columns()) && meet(self.rows(), other.rows())
    }

    /// The pixels of both of two regions that overlap.
    pub(crate) fn common(&self, other: &Self) -> Self {
        let (x, y) = (self.x.max(other.x), self.y.max(other.y));
        let right = (self.x + self.width).min(other.x + other.width);
        let bottom = (self.y + self.height).min(other.y + other.height);
        Self { x, y, width: right.saturating_sub(x), height: bottom.saturating_sub(y) }
    }

    /// Checks that the region lies within an image.
    ///
    /// # Errors
    /// If it does not, or is empty.
    pub(crate) fn check(&self, [width, height]: [u32; 2]) -> Result<(), SettingError> {
        let is_within = self.columns().end <= width as usize && self.rows().end <= height as usize;
        if is_within && self.width > 0 && self.height > 0 {
            return Ok(());
        }
        let allowed = format!("X,Y,W,H of at least one pixel within the image of {width}×{height}");
        Err(SettingError::new("region", self.to_string(), allowed))
    }
}

impl std::fmt::Display for Region {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { x, y, width, height } = self;
        write!(f, "{x},{y},{width},{height}")
    }
}

/// A range of slabs, and a region of the image's pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Window {
    /// The slabs k, between planes k and k + 1 (SPEC §5). The range may be empty, and reach beyond the scene's first and last slab.
    pub slabs: Range<i32>,
    /// The pixels.
    pub region: Region,
}

impl Window {
    /// More slabs than any scene has ([`MAX_SLABS`](crate::geometry::slab::MAX_SLABS)).
    pub(crate) const ALL_SLABS: Range<i32> = -(1 << 30)..1 << 30;

    /// All slabs and pixels of an image of some width and height.
    pub fn whole(size: [u32; 2]) -> Self {
        Self { slabs: Self::ALL_SLABS, region: Region::whole(size) }
    }

    /// The same window for a scene with these slabs. Where it reaches an end of the scene it has no end there: the plane behind the last slab
    /// belongs to that slab.
    pub(crate) fn opened(&self, scene: &Range<i32>) -> Self {
        let Range { start, end } = self.slabs;
        let start = if start <= scene.start { Self::ALL_SLABS.start } else { start };
        let end = if end >= scene.end { Self::ALL_SLABS.end } else { end };
        // A range that is empty stays so, as does one that lies beyond an end.
        let slabs = if self.slabs.is_empty() || self.within(scene).is_empty() { 0..0 } else { start..end };
        Self { slabs, region: self.region }
    }

    /// The same window with the slab before its first, if the compositing finds surfaces between the middles of neighbouring slabs (SPEC §5).
    #[cfg(any(feature = "cpu", feature = "gpu"))]
    pub(crate) fn with_lead(&self, compositing: Compositing, classification: Classification) -> Self {
        let is_between = compositing.has_surface() && classification == Classification::Before;
        // An open start has no slab before it.
        let lead = i32::from(is_between && !self.slabs.is_empty() && self.slabs.start != Self::ALL_SLABS.start);
        Self { slabs: self.slabs.start - lead..self.slabs.end, region: self.region }
    }

    /// Those of its slabs that a scene has.
    pub(crate) fn within(&self, scene: &Range<i32>) -> Range<i32> {
        self.slabs.start.max(scene.start)..self.slabs.end.min(scene.end)
    }
}

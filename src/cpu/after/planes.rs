//! A tile's planes: a ring of open ones onto which values, weights and gradients are splatted (SPEC §9), and the two around the current slab.

use crate::cpu::sheets::{Layer, Ring};

/// The maximum number of sums that a plane holds for every pixel: N and Σc·g, and then Σd·g, or for the kernel's gradient Σa·g, Σb·g, Σt·g and
/// Σc·a·g, Σc·b·g, Σc·t·g, with (a, b, t) the offset along two axes in the plane and along its normal.
pub(super) const CHANNELS: usize = 8;

/// The planes of one tile.
#[derive(Debug)]
pub(super) struct Planes {
    /// Those that voxels are splatted onto: plane k is in slot k mod 8.
    pub(super) ring: Ring,
    /// The plane before the current slab.
    pub(super) near: Layer<CHANNELS>,
    /// The plane behind it.
    pub(super) far: Layer<CHANNELS>,
}

impl Planes {
    /// Empty planes with a number of sums.
    pub(super) fn new(channels: usize) -> Self {
        Self { ring: Ring::new(channels), near: Layer::new(), far: Layer::new() }
    }

    /// Moves on to the slab before the plane of a slot.
    pub(super) fn advance(&mut self, slot: usize) {
        std::mem::swap(&mut self.near, &mut self.far);
        self.far.clear();
        self.ring.take(slot, &mut self.far);
    }

    /// Makes all planes empty.
    pub(super) fn clear(&mut self) {
        self.ring.clear();
        self.near.clear();
        self.far.clear();
    }
}

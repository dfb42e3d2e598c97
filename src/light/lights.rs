//! The light that light sheets leave in a scene: A and S of SPEC §14.

use std::sync::Arc;

use glam::{DVec3, DVec4};

use super::sheets::LightSheets;
use crate::volume::Grid;

/// The shares that are left of ambient and of other light: A and S.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Left {
    /// A.
    pub ambient: f32,
    /// S.
    pub direct: f32,
}

/// A stack of light sheets among the voxels that are drawn.
#[derive(Clone, Debug)]
pub struct LightStack {
    /// The amount of occlusion or of shadow.
    pub amount: f32,
    /// The stack.
    pub sheets: Arc<LightSheets>,
    /// Rows whose products with voxel coordinates (i, j, k, 1) are a point's place in the stack ([`LightSheets::rows`]).
    pub rows: [DVec4; 3],
}

impl LightStack {
    /// T at a point in voxel coordinates.
    pub fn at(&self, voxel: DVec3) -> f32 {
        self.sheets.at_place(self.rows.map(|row| row.dot(voxel.extend(1.0)) as f32))
    }
}

/// The light sheets of a scene.
#[derive(Clone, Debug, Default)]
pub struct Lights {
    /// The sheets of occlusion.
    pub occlusion: Option<LightStack>,
    /// The sheets of shadow.
    pub shadow: Option<LightStack>,
}

impl Lights {
    /// The light that is left at a point in voxel coordinates.
    pub fn left(&self, voxel: DVec3) -> Left {
        let left = |light: &Option<LightStack>| {
            light.as_ref().map_or(1.0, |light| 1.0 - light.amount * (1.0 - light.at(voxel)))
        };
        Left { ambient: left(&self.occlusion), direct: left(&self.shadow) }
    }

    /// The same light for the voxels of another grid of the volume: of another level, or of a box.
    pub fn on(&self, grid: &Grid) -> Self {
        let on = |light: &LightStack| LightStack { rows: light.sheets.rows(grid), ..light.clone() };
        Self { occlusion: self.occlusion.as_ref().map(on), shadow: self.shadow.as_ref().map(on) }
    }
}

//! The light that light sheets leave in a scene: A and S of SPEC §14.

use std::sync::Arc;

use glam::DVec3;

use super::sheets::LightSheets;

/// The shares that are left of ambient and of other light: A and S.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Left {
    /// A.
    pub ambient: f32,
    /// S.
    pub direct: f32,
}

/// The light sheets of a scene.
#[derive(Clone, Debug, Default)]
pub struct Lights {
    /// The amount of occlusion, and its sheets.
    pub occlusion: Option<(f32, Arc<LightSheets>)>,
    /// The amount of shadow, and its sheets.
    pub shadow: Option<(f32, Arc<LightSheets>)>,
}

impl Lights {
    /// The light that is left at a point in voxel coordinates.
    pub fn left(&self, voxel: DVec3) -> Left {
        let left = |light: &Option<(f32, Arc<LightSheets>)>| {
            light.as_ref().map_or(1.0, |(amount, sheets)| 1.0 - amount * (1.0 - sheets.at(voxel)))
        };
        Left { ambient: left(&self.occlusion), direct: left(&self.shadow) }
    }
}

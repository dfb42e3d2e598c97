//! What the stages of a channel share.

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;

use super::field::Field;
use super::low_pass::LowPass;
use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::lists::classify::channels;
use crate::reference::framed::framed;
use crate::reference::{Geometry, Host, Lights};
use crate::scene::Scene;
use crate::settings::transfer_function::TransferFunction;
use crate::settings::window::Window;
use crate::volume::Volume;

/// One channel of a scene, ready to be drawn.
#[derive(Debug)]
pub struct Frame<'a> {
    pub(super) volume: &'a Volume,
    pub(super) transfer: &'a TransferFunction,
    pub(super) scene: Scene,
    pub(super) host: Host<'a>,
    /// The slabs that are drawn.
    pub(super) slabs: Range<i32>,
    pub(super) geometry: Geometry,
    pub(super) field: Field<'a>,
    /// The light sheets of all channels.
    pub(super) lights: Arc<Lights>,
}

impl<'a> Frame<'a> {
    /// The first channel's.
    ///
    /// # Errors
    /// If the scene needs more than can be computed.
    pub fn new(
        host: Host<'a>,
        volume: &'a Volume,
        transfer: &'a [TransferFunction],
        scene: &Scene,
    ) -> Result<Self, RenderError> {
        let first = Self::of_channels(host, volume, transfer, (scene, None))?.into_iter().next();
        Ok(first.ok_or_else(|| SettingError::new("channel", "none", "at least one"))?)
    }

    /// The frames of all channels, which share what depends on the view. Where one channel is drawn by itself, `lights` still holds the light of all.
    ///
    /// # Errors
    /// If the scene needs more than can be computed.
    pub fn of_channels(
        host: Host<'a>,
        volume: &'a Volume,
        transfer: &'a [TransferFunction],
        (scene, lights): (&Scene, Option<&Arc<Lights>>),
    ) -> Result<Vec<Self>, RenderError> {
        let scene = framed(volume, transfer, scene)?;
        host.check(&scene)?;
        let of = (Lights::or_new(lights, volume, transfer, &scene)?, scene);
        let frame = |(volume, transfer)| Self::of_channel(host, volume, transfer, (of.1.clone(), of.0.clone()));
        channels(volume, transfer).map(frame).collect()
    }

    fn of_channel(
        host: Host<'a>,
        volume: &'a Volume,
        transfer: &'a TransferFunction,
        (scene, lights): (Scene, Arc<Lights>),
    ) -> Result<Self, RenderError> {
        let geometry = Geometry::new(volume.grid(), &scene)?;
        let field = Field::new(volume, &scene)?;
        Ok(Self { volume, transfer, scene, host, slabs: Window::ALL_SLABS, geometry, field, lights })
    }

    /// The view's geometry.
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// The field.
    pub fn field(&self) -> &Field<'a> {
        &self.field
    }

    /// The low-pass rule on a plane; `None` at the eye and behind it.
    pub fn low_pass(&self, plane: i32) -> Option<LowPass> {
        self.low_pass_at(f64::from(plane) * self.geometry.slab_width)
    }

    /// The low-pass rule at a sheet depth; `None` at the eye and behind it.
    pub(super) fn low_pass_at(&self, depth: f64) -> Option<LowPass> {
        let geometry = &self.geometry;
        let aspect = geometry.grid.aspect();
        let (right, down) = (geometry.basis.u / aspect, -geometry.basis.v / aspect);
        match &geometry.eye {
            None => {
                let in_plane = |step: DVec3| (step - step.dot(geometry.ro) * geometry.ro) * geometry.pix;
                Some(LowPass::new(in_plane(right), in_plane(down)))
            }
            // Planes are parallel to the image, and therefore to the steps from pixel to pixel.
            Some(eye) => {
                let pix = eye.pix(depth);
                (depth > 0.0).then(|| LowPass::new(right * pix, down * pix))
            }
        }
    }
}

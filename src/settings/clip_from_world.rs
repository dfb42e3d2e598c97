//! Cameras from a host's matrices.

use glam::{DMat3, DMat4, DVec2, DVec3, DVec4};

use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::settings::camera::{Camera, Projection};

/// The maximum relative difference of lengths, and the maximum cosine of right angles: more than the rounding errors of products in f32,
/// and less than a screen shows.
const TOLERANCE: f64 = 1e-5;

impl Camera {
    /// The camera that agrees with a host whose `clip_from_world` maps the volume's coordinates (origin at its centre, lengths as in its
    /// spacing) to wgpu's clip space, for a viewport of `size` pixels: width, height. If the volume is placed in the host's scene, the host
    /// multiplies by that placement, a rotation, translation and uniform scale.
    ///
    /// The mapping may be perspective or orthographic, with depths that increase or decrease (reversed z), with or without a far plane. In
    /// perspective the volume is clipped at the host's near plane. There is no far plane, and orthographic cameras have no near plane.
    ///
    /// # Errors
    /// [`RenderError::OutOfRange`] for any other mapping: mirrored, sheared, scaled unevenly, off centre, with pixels that are not square or
    /// a near plane that is not parallel to the image; or if a component of `size` is 0.
    pub fn from_clip_from_world(clip_from_world: DMat4, size: [u32; 2]) -> Result<Self, RenderError> {
        let pixels = DVec2::from(size.map(f64::from)) / 2.0;
        if pixels.min_element() == 0.0 {
            return Err(refused(format!("an image of {} by {} pixels", size[0], size[1]), "images of 1 pixel or more"));
        }
        if !clip_from_world.is_finite() {
            return Err(refused(clip_from_world.to_string(), "finite numbers"));
        }
        let [x, y, z, w] = [0, 1, 2, 3].map(|row| clip_from_world.row(row));
        let camera = match w.truncate() == DVec3::ZERO {
            true => orthographic([x, y].map(|row| row / w.w), pixels)?,
            false => {
                let scale = w.truncate().length();
                perspective([x, y, z, w].map(|row| row / scale), pixels)?
            }
        };
        let Self { direction, up, .. } = camera;
        match [direction, up, camera.middle()].iter().all(|v| v.is_finite()) {
            true => Ok(camera),
            false => Err(singular()),
        }
    }
}

/// The camera by the rows of x and y, where w is 1.
fn orthographic([x, y]: [DVec4; 2], pixels: DVec2) -> Result<Camera, RenderError> {
    let [right, up] = [x.truncate(), y.truncate()];
    check_screen(right, up, pixels)?;
    // The point of the central ray that is nearest to the volume's centre.
    let center = -(right * (x.w / right.length_squared()) + up * (y.w / up.length_squared()));
    let projection = Projection::Orthographic { height: Some(2.0 / up.length()) };
    Ok(Camera {
        projection,
        direction: up.cross(right).normalize(),
        up: up.normalize(),
        center: Some(center),
        ..Camera::default()
    })
}

/// The camera by all rows, where w is the depth from the eye.
fn perspective([x, y, z, w]: [DVec4; 4], pixels: DVec2) -> Result<Camera, RenderError> {
    let [right, up, depth, ahead] = [x, y, z, w].map(DVec4::truncate);
    for (axis, off) in [("width", right.dot(ahead)), ("height", up.dot(ahead))] {
        if off.abs() > TOLERANCE {
            let found = format!("an eye {off:.6} of half the image's {axis} off its centre");
            return Err(refused(found, "eyes before the centre, and volumes scaled alike along all axes"));
        }
    }
    check_screen(right, up, pixels)?;
    if up.cross(right).dot(ahead) < 0.0 {
        return Err(refused("a mirrored image".to_owned(), "right-handed axes right, up and towards the eye"));
    }
    let from_eye = DMat3::from_cols(right, up, ahead).transpose();
    let eye = from_eye.inverse() * -DVec3::new(x.w, y.w, w.w);
    if !eye.is_finite() {
        return Err(singular());
    }
    // z is `slope + at_eye / depth from the eye`.
    let slope = depth.dot(ahead);
    let tilt = (depth - slope * ahead).length();
    if tilt > TOLERANCE * depth.length().max(1.0) {
        return Err(refused(
            format!("a near plane tilted by {tilt:.6} against the image"),
            "near planes parallel to it",
        ));
    }
    let at_eye = depth.dot(eye) + z.w;
    let planes = [-at_eye / slope, at_eye / (1.0 - slope)];
    let near = planes.into_iter().filter(|near| near.is_finite() && *near > 0.0).reduce(f64::min);
    let Some(near) = near else {
        return Err(refused("no near plane".to_owned(), "clip space with depths from 0 to 1, or 1 to 0"));
    };
    // The image's centre is the point of the central ray beside the volume's centre, if that is visible.
    let distance = (-eye.dot(ahead)).max(near);
    let projection = Projection::Perspective {
        fov_y: 2.0 * libm::atan(up.length().recip()).to_degrees(),
        distance: Some(distance),
        near: Some(near),
    };
    Ok(Camera {
        projection,
        direction: ahead,
        up: up.normalize(),
        center: Some(eye + distance * ahead),
        ..Camera::default()
    })
}

/// Checks that pixels are square.
fn check_screen(right: DVec3, up: DVec3, pixels: DVec2) -> Result<(), RenderError> {
    let (width, height) = (pixels.x * right.length(), pixels.y * up.length());
    if width == 0.0 || height == 0.0 {
        return Err(singular());
    }
    let cosine = right.dot(up) / (right.length() * up.length());
    if cosine.abs() > TOLERANCE {
        let angle = libm::acos(cosine).to_degrees();
        return Err(refused(format!("a sheared image, whose axes are {angle:.4}° apart"), "axes 90° apart"));
    }
    if (width / height - 1.0).abs() > TOLERANCE {
        let found = format!("pixels {:.6} times as wide as high", height / width);
        return Err(refused(found, "square pixels, and volumes scaled alike along all axes"));
    }
    Ok(())
}

fn singular() -> RenderError {
    refused("a matrix without an inverse".to_owned(), "projections of space onto the screen")
}

fn refused(found: String, allowed: &str) -> RenderError {
    SettingError::new("clip_from_world", found, allowed).into()
}

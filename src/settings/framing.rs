//! Framing: the position of a camera that leaves it open, such that an object fills the image (SPEC §2, `camera.fit = "object"`).

use glam::DVec3;

use crate::settings::camera::{Camera, Fit, Projection};
use crate::volume::Grid;

/// The fraction of the image's width or height that the object fills.
const SHARE: f64 = 0.9;

/// An axis-aligned box around an object in world units, with a size above 0 along each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// The corner with the minimum coordinates.
    pub low: DVec3,
    /// The corner with the maximum coordinates.
    pub high: DVec3,
}

impl Extent {
    /// The box around the voxels from `first` to `last` of a grid and their kernels, whose radius is in grid units.
    pub fn of_voxels(grid: &Grid, [first, last]: [glam::UVec3; 2], kernel_radius: f64) -> Self {
        let (margin, place) = (kernel_radius * grid.spacing, grid.place());
        Self { low: grid.world_position(first) - margin + place, high: grid.world_position(last) + margin + place }
    }

    /// The middle of the box.
    pub fn center(&self) -> DVec3 {
        self.low.midpoint(self.high)
    }

    fn corners(&self) -> [DVec3; 8] {
        let Self { low, high } = *self;
        std::array::from_fn(|at| DVec3::select(glam::BVec3::new(at & 1 != 0, at & 2 != 0, at & 4 != 0), high, low))
    }

    /// The camera with its open values chosen such that the box fills an image of `size` pixels in the camera's direction. A camera that does
    /// not fit an object is returned unchanged.
    pub fn fit(&self, camera: &Camera, size: [u32; 2]) -> Camera {
        let basis = camera.basis();
        let center = camera.center.unwrap_or(self.center());
        let largest = |length: &dyn Fn(DVec3) -> f64| {
            self.corners().map(|corner| length(corner - center)).into_iter().fold(f64::NEG_INFINITY, f64::max)
        };
        let [width, height] = size.map(f64::from);
        let half_height = |q: DVec3| q.dot(basis.v).abs().max(q.dot(basis.u).abs() * height / width) / SHARE;
        filled(camera, self.center(), &|| 2.0 * largest(&half_height), &|tangent| {
            // A stated centre may lie so far behind the box that the eye would have to stand behind the centre.
            largest(&|q| half_height(q) / tangent - q.dot(basis.w)).max((self.high - self.low).min_element())
        })
    }
}

/// A sphere around an object in world units, which looks the same from everywhere: a camera that turns about it keeps its distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// The middle of the object's box ([`Extent::center`]).
    pub center: DVec3,
    /// The radius, above 0: voxels that take part lie inside with their kernels.
    pub radius: f64,
}

impl Sphere {
    /// The camera with its open values chosen such that the sphere fills an image of `size` pixels from every direction. A camera that does not
    /// fit an object is returned unchanged.
    pub fn fit(&self, camera: &Camera, size: [u32; 2]) -> Camera {
        let [width, height] = size.map(f64::from);
        filled(camera, self.center, &|| 2.0 * self.radius * (height / width).max(1.0) / SHARE, &|tangent| {
            self.radius / libm::sin(libm::atan(SHARE * tangent * (width / height).min(1.0)))
        })
    }
}

/// The camera with its open values filled in; `distance` is a function of `tan(fov_y/2)`.
fn filled(camera: &Camera, center: DVec3, height: &dyn Fn() -> f64, distance: &dyn Fn(f64) -> f64) -> Camera {
    if camera.fit != Fit::Object {
        return *camera;
    }
    let projection = match camera.projection {
        Projection::Orthographic { height: None } => Projection::Orthographic { height: Some(height()) },
        Projection::Perspective { fov_y, distance: None, near } => {
            let distance = Some(distance(libm::tan(fov_y.to_radians() / 2.0)));
            Projection::Perspective { fov_y, distance, near }
        }
        given => given,
    };
    Camera { projection, center: Some(camera.center.unwrap_or(center)), ..*camera }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, UVec3};

    use super::*;

    const EXTENT: Extent = Extent { low: DVec3::new(-30.0, 4.0, -7.0), high: DVec3::new(-9.0, 21.0, 55.0) };
    /// About the box's corners.
    const SPHERE: Sphere = Sphere { center: DVec3::new(-19.5, 12.5, 24.0), radius: 33.8 };
    const SIZES: [[u32; 2]; 3] = [[300, 300], [640, 200], [90, 500]];

    fn cameras() -> Vec<Camera> {
        let directions = [DVec3::Y, -DVec3::X, DVec3::new(0.3, 0.9, -0.2), DVec3::new(-1.0, 0.2, 2.5)];
        let up = DVec3::new(0.1, 0.2, 1.0);
        let camera =
            |direction, projection| Camera { direction, up, projection, fit: Fit::Object, ..Camera::default() };
        let eye = |fov_y| Projection::Perspective { fov_y, distance: None, near: None };
        let projections = [Projection::Orthographic { height: None }, eye(30.0), eye(95.0)];
        directions.into_iter().flat_map(|way| projections.map(|projection| camera(way, projection))).collect()
    }

    /// A point's position in the image: from -1 at the left and lower edge to 1 at the right and upper one.
    fn place(camera: &Camera, [width, height]: [u32; 2], point: DVec3) -> DVec2 {
        let basis = camera.basis();
        let q = point - camera.center.expect("a camera that was fitted has a centre");
        let half_height = match camera.projection {
            Projection::Orthographic { height } => height.expect("a height was chosen") / 2.0,
            Projection::Perspective { fov_y, distance, .. } => {
                let depth = distance.expect("a distance was chosen") + q.dot(basis.w);
                assert!(depth > 0.0, "a corner lies behind the eye");
                depth * (fov_y.to_radians() / 2.0).tan()
            }
        };
        DVec2::new(q.dot(basis.u) * f64::from(height) / f64::from(width), q.dot(basis.v)) / half_height
    }

    /// The maximum distance of a corner from the image's middle, in half widths or half heights.
    fn reach(camera: &Camera, size: [u32; 2], extent: &Extent) -> f64 {
        extent.corners().map(|corner| place(camera, size, corner).abs().max_element()).into_iter().fold(0.0, f64::max)
    }

    #[test]
    fn a_box_fills_nine_tenths_of_the_image() {
        for (camera, size) in cameras().into_iter().flat_map(|camera| SIZES.map(|size| (camera, size))) {
            let fitted = EXTENT.fit(&camera, size);
            assert_eq!(fitted.center, Some(DVec3::new(-19.5, 12.5, 24.0)));
            let reach = reach(&fitted, size, &EXTENT);
            assert!((reach - SHARE).abs() < 1e-12, "{reach}: {fitted:?} {size:?}");
        }
    }

    #[test]
    fn a_sphere_is_in_the_image_from_everywhere() {
        let radius = SPHERE.radius;
        for size in SIZES {
            let fitted: Vec<Camera> = cameras().iter().map(|camera| SPHERE.fit(camera, size)).collect();
            for (at, camera) in fitted.iter().enumerate() {
                // The projection is the same for every direction.
                assert_eq!(camera.projection, fitted[at % 3].projection);
                assert!(reach(camera, size, &EXTENT) <= SHARE + 1e-12, "{camera:?} {size:?}");
                // The rays through the edges of nine tenths of the shorter axis touch the sphere.
                let (width, height) = (f64::from(size[0]), f64::from(size[1]));
                let edge = match camera.projection {
                    Projection::Orthographic { height: shown } => {
                        SHARE * shown.expect("a height was chosen") / 2.0 * (width / height).min(1.0)
                    }
                    Projection::Perspective { fov_y, distance, .. } => {
                        let tangent = SHARE * (fov_y.to_radians() / 2.0).tan() * (width / height).min(1.0);
                        distance.expect("a distance was chosen") * tangent / tangent.hypot(1.0)
                    }
                };
                assert!((edge / radius - 1.0).abs() < 1e-12, "{edge} {radius}: {camera:?} {size:?}");
            }
        }
    }

    #[test]
    fn values_that_are_given_stay() {
        for camera in cameras() {
            let center = Some(DVec3::new(-25.0, 30.0, 20.0));
            let off_center = EXTENT.fit(&Camera { center, ..camera }, [200, 100]);
            assert_eq!(off_center.center, center);
            assert!((reach(&off_center, [200, 100], &EXTENT) - SHARE).abs() < 1e-12);
            let given = match camera.projection {
                Projection::Orthographic { .. } => Projection::Orthographic { height: Some(7.0) },
                Projection::Perspective { fov_y, .. } => {
                    Projection::Perspective { fov_y, distance: Some(7.0), near: Some(0.5) }
                }
            };
            let given = Camera { projection: given, ..camera };
            assert_eq!(EXTENT.fit(&given, [9, 9]), Camera { center: Some(EXTENT.center()), ..given });
            assert_eq!(SPHERE.fit(&given, [9, 9]), Camera { center: Some(SPHERE.center), ..given });
            let whole = Camera { fit: Fit::Volume, ..camera };
            assert_eq!([EXTENT.fit(&whole, [9, 9]), SPHERE.fit(&whole, [9, 9])], [whole; 2]);
        }
    }

    #[test]
    fn a_center_far_behind_the_box_leaves_an_eye_before_it() {
        let projection = Projection::Perspective { fov_y: 40.0, distance: None, near: None };
        let center = Some(EXTENT.center() - 1e4 * DVec3::Y);
        let camera = Camera { projection, center, fit: Fit::Object, ..Camera::default() };
        let fitted = EXTENT.fit(&camera, [64, 64]);
        assert!(
            matches!(fitted.projection, Projection::Perspective { distance: Some(distance), .. } if distance > 0.0)
        );
        assert!(reach(&fitted, [64, 64], &EXTENT) <= SHARE);
    }

    #[test]
    fn kernels_belong_to_the_box() {
        let grid = Grid::new(UVec3::new(11, 21, 5), DVec3::new(1.0, 0.5, 3.0));
        let extent = Extent::of_voxels(&grid, [UVec3::new(2, 0, 4), UVec3::new(7, 20, 4)], 2.0);
        assert_eq!(extent, Extent { low: DVec3::new(-5.0, -6.0, 0.0), high: DVec3::new(4.0, 6.0, 12.0) });
    }
}

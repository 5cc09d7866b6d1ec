//! The model of camera and projector: a pinhole with Brown's distortion, in OpenCV's convention. A
//! projector is an inverse camera.
//!
//! X_device = R · X_world + t; x = X/Z, y = Y/Z; from (x, y) to pixels as in [`Lens`]. Pixel
//! centres at integers, x right, y down, z forward.

use super::lens::Rays;
use super::{Lens, Vector};
use alloc::vec::Vec;

/// The parameters of a device model as a calibration gives them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PinholeModel {
    /// Focal length along x, in pixels.
    pub fx: f64,
    /// Focal length along y, in pixels.
    pub fy: f64,
    /// Principal point, column.
    pub cx: f64,
    /// Principal point, row.
    pub cy: f64,
    /// k₁, k₂, p₁, p₂, k₃.
    pub distortion: [f64; 5],
    /// R, row-major.
    pub rotation: [f64; 9],
    /// t in mm.
    pub translation: [f64; 3],
}

/// A checked device model: every pixel of its frame has exactly one ray, and the iteration that
/// finds it converges.
#[derive(Clone, Debug, PartialEq)]
pub struct Pinhole {
    model: PinholeModel,
    lens: Lens,
    width: usize,
    height: usize,
    centre: Vector,
    /// R as rows; its transpose turns rays into the world.
    rows: [Vector; 3],
    /// Square of the normalised radius up to which the distortion is one-to-one; beyond it the
    /// distortion is continued linearly.
    radius_square: f64,
    rays: Rays,
}

/// A device model that cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A number is not finite.
    #[error("{0} is not a finite number")]
    NotFinite(&'static str),
    /// A focal length is not positive, or absurd for the frame: less than a hundredth of it (an
    /// angle of view of 179°) or more than 1e6 pixels.
    #[error(
        "focal lengths {fx} and {fy}: both must be positive, at least a hundredth of the frame and \
         at most 1e6 pixels"
    )]
    Focal {
        /// f_x.
        fx: f64,
        /// f_y.
        fy: f64,
    },
    /// The principal point lies more than ten frames away.
    #[error("the principal point ({cx}, {cy}) lies more than ten frames away: it is in pixels")]
    PrincipalPoint {
        /// c_x.
        cx: f64,
        /// c_y.
        cy: f64,
    },
    /// R · Rᵀ is not the unit matrix, or R is a reflection.
    #[error(
        "the rotation is not a rotation matrix: R·Rᵀ is off the unit matrix by {deviation:.2e}, det R = \
         {determinant:.6}; write its 9 numbers row by row"
    )]
    Rotation {
        /// Largest deviation of R · Rᵀ from the unit matrix.
        deviation: f64,
        /// det R.
        determinant: f64,
    },
    /// The device stands more than a kilometre from the origin.
    #[error("the translation of {distance:e} mm is over a kilometre: it is in mm")]
    Translation {
        /// Its distance from the origin, mm.
        distance: f64,
    },
    /// The distortion folds over: two rays meet in one pixel of the frame.
    #[error("the distortion folds over at pixel ({u:.1}, {v:.1}): the order is k1, k2, p1, p2, k3")]
    Distortion {
        /// Column of the pixel.
        u: f64,
        /// Row of the pixel.
        v: f64,
    },
}

/// Largest deviation of R · Rᵀ from the unit matrix; rounded calibrations stay below it.
const ROTATION_TOLERANCE: f64 = 1e-4;
/// A kilometre in mm: a larger translation is in another unit, and f64 no longer resolves 1e-9 mm.
const MAX_DISTANCE: f64 = 1e6;
/// Radii up to which the distortion is checked, as multiples of the radius at the frame's border:
/// the reference phase map is evaluated up to 15 % outside. The largest radius up to which the
/// distortion is one-to-one is used; the distortion of a usable model is one-to-one at least up to
/// the last of them.
const REACHES: [f64; 4] = [1.3, 1.2, 1.1, 1.02];

impl Pinhole {
    /// Checks a model for a frame of `width` × `height` pixels.
    ///
    /// # Errors
    /// If a number is not finite or absurd, R is not a rotation, or the distortion is not
    /// one-to-one over the frame.
    pub fn new(model: PinholeModel, width: usize, height: usize) -> Result<Self, ModelError> {
        let finite = |what, numbers: &[f64]| {
            if numbers.iter().all(|x| x.is_finite()) {
                Ok(())
            } else {
                Err(ModelError::NotFinite(what))
            }
        };
        let PinholeModel { fx, fy, cx, cy, .. } = model;
        finite("the focal length", &[fx, fy])?;
        finite("the principal point", &[cx, cy])?;
        finite("the distortion", &model.distortion)?;
        finite("the rotation", &model.rotation)?;
        finite("the translation", &model.translation)?;
        let focal =
            |focal: f64, size: usize| focal > 0.0 && focal >= size as f64 / 100.0 && focal <= 1e6;
        if !(focal(fx, width) && focal(fy, height)) {
            return Err(ModelError::Focal { fx, fy });
        }
        let away = |centre: f64, size: usize| libm::fabs(centre) > 10.0 * size as f64;
        if away(cx, width) || away(cy, height) {
            return Err(ModelError::PrincipalPoint { cx, cy });
        }
        let rows = rotation(&model.rotation)?;
        let [a, b, c] = model.translation;
        let distance = Vector::new(a, b, c).length();
        if !(distance <= MAX_DISTANCE) {
            return Err(ModelError::Translation { distance });
        }
        let centre = (rows[0] * a + rows[1] * b + rows[2] * c) * -1.0;
        let pinhole = Self {
            model,
            lens: Lens {
                fx,
                fy,
                cx,
                cy,
                distortion: model.distortion,
            },
            width,
            height,
            centre,
            rows,
            radius_square: f64::INFINITY,
            rays: Rays::default(),
        };
        pinhole.with_checked_distortion()
    }

    /// Checks that the distortion is one-to-one, that is, its Jacobian's determinant is positive,
    /// from the axis to each border pixel. Sets the radius up to which it is used.
    fn with_checked_distortion(mut self) -> Result<Self, ModelError> {
        let mut reach_left = 0;
        let mut radius_square = 0.0_f64;
        let (right, bottom) = (self.width as f64 - 0.5, self.height as f64 - 0.5);
        for i in 0..=32 {
            let share = f64::from(i) / 32.0;
            let (u, v) = (-0.5 + share * (right + 0.5), -0.5 + share * (bottom + 0.5));
            for (u, v) in [(u, -0.5), (u, bottom), (-0.5, v), (right, v)] {
                let error = ModelError::Distortion { u, v };
                let (x, y) = self.lens.undistorted(u, v).ok_or(error.clone())?;
                let one_to_one = |reach: f64| {
                    (0..=16).all(|step| {
                        let along = reach * f64::from(step) / 16.0;
                        self.lens.jacobian(x * along, y * along).3 > 0.0
                    })
                };
                while !one_to_one(REACHES[reach_left]) {
                    reach_left += 1;
                    if reach_left == REACHES.len() {
                        return Err(error);
                    }
                }
                radius_square = radius_square.max(x * x + y * y);
            }
        }
        let reach = REACHES[reach_left];
        self.radius_square = radius_square * reach * reach;
        Ok(self)
    }

    /// The parameters as given.
    pub fn model(&self) -> &PinholeModel {
        &self.model
    }

    /// Width of the frame in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height of the frame in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The centre of projection in the world, mm.
    pub fn centre(&self) -> Vector {
        self.centre
    }

    /// The direction of the optical axis in the world, of length 1.
    pub fn axis(&self) -> Vector {
        self.rows[2]
    }

    /// The direction of pixel (u, v)'s ray in the world, with a component of 1 along the
    /// optical axis; `None` where the iteration does not converge (never inside the frame).
    #[inline]
    pub fn ray(&self, u: f64, v: f64) -> Option<Vector> {
        let known = self.rays.at(u, v, self.width);
        let (x, y) = known.or_else(|| self.lens.undistorted(u, v))?;
        Some(self.rows[0] * x + self.rows[1] * y + self.rows[2])
    }

    /// The same device with these directions of its whole pixels, row-major.
    pub(crate) fn knowing(mut self, directions: Vec<(f64, f64)>) -> Self {
        self.rays = Rays::new(directions);
        self
    }

    /// Whether it knows the directions of its whole pixels.
    pub(crate) fn knows_rays(&self) -> bool {
        self.rays.are_known()
    }

    /// Focal lengths, principal point and distortion.
    pub(crate) fn lens(&self) -> &Lens {
        &self.lens
    }

    /// The pixel (u, v) that sees a point of the world, also outside the frame; `None` behind the
    /// device.
    #[inline]
    pub fn project(&self, point: Vector) -> Option<(f64, f64)> {
        self.pixel(self.turned(point - self.centre))
    }

    /// A direction of the world in the device's coordinates: z along its optical axis.
    #[inline]
    pub(super) fn turned(&self, direction: Vector) -> Vector {
        let [x, y, z] = &self.rows;
        Vector::new(x.dot(direction), y.dot(direction), z.dot(direction))
    }

    /// The pixel that sees a point given in the device's coordinates; `None` behind the device.
    #[inline]
    pub(super) fn pixel(&self, from: Vector) -> Option<(f64, f64)> {
        let depth = from.z;
        if !(depth > 0.0) {
            return None;
        }
        let (x, y) = (from.x / depth, from.y / depth);
        let r2 = x * x + y * y;
        let (xd, yd) = if r2 <= self.radius_square {
            self.lens.distorted(x, y)
        } else {
            let outside = libm::sqrt(r2 / self.radius_square);
            let (xd, yd) = self.lens.distorted(x / outside, y / outside);
            (xd * outside, yd * outside)
        };
        Some(self.lens.scaled(xd, yd))
    }
}

/// R as rows, if it is a rotation.
fn rotation(r: &[f64; 9]) -> Result<[Vector; 3], ModelError> {
    let rows = [
        Vector::new(r[0], r[1], r[2]),
        Vector::new(r[3], r[4], r[5]),
        Vector::new(r[6], r[7], r[8]),
    ];
    let mut deviation = 0.0_f64;
    for i in 0..3 {
        for j in 0..3 {
            let unit = if i == j { 1.0 } else { 0.0 };
            deviation = deviation.max(libm::fabs(rows[i].dot(rows[j]) - unit));
        }
    }
    let determinant = rows[0].x * (rows[1].y * rows[2].z - rows[1].z * rows[2].y)
        - rows[0].y * (rows[1].x * rows[2].z - rows[1].z * rows[2].x)
        + rows[0].z * (rows[1].x * rows[2].y - rows[1].y * rows[2].x);
    if deviation > ROTATION_TOLERANCE || determinant < 0.0 {
        return Err(ModelError::Rotation {
            deviation,
            determinant,
        });
    }
    Ok(rows)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A device that looks at the origin from `distance` mm, `angle` degrees from +z towards +x.
    pub fn looking_at_origin(
        (width, height): (usize, usize),
        (fov_h, fov_v): (f64, f64),
        angle: f64,
        distance: f64,
        distortion: [f64; 5],
    ) -> Pinhole {
        let (sin, cos) = (libm::sin(angle.to_radians()), libm::cos(angle.to_radians()));
        let focal = |size: usize, fov: f64| size as f64 / 2.0 / libm::tan(fov.to_radians() / 2.0);
        Pinhole::new(
            PinholeModel {
                fx: focal(width, fov_h),
                fy: focal(height, fov_v),
                cx: (width - 1) as f64 / 2.0,
                cy: (height - 1) as f64 / 2.0,
                distortion,
                rotation: [cos, 0.0, -sin, 0.0, -1.0, 0.0, -sin, 0.0, -cos],
                translation: [0.0, 0.0, distance],
            },
            width,
            height,
        )
        .unwrap()
    }

    pub fn camera() -> Pinhole {
        let distortion = [-0.12, 0.15, 2e-4, -3e-4, 0.0];
        looking_at_origin((512, 512), (20.0, 20.0), 20.0, 600.0, distortion)
    }

    pub fn projector() -> Pinhole {
        let distortion = [-0.05, 0.03, -3e-4, 2e-4, 0.0];
        looking_at_origin((1024, 768), (43.6, 33.4), -7.0, 600.0, distortion)
    }

    #[test]
    fn a_ray_leads_back_to_its_pixel() {
        for device in [camera(), projector()] {
            let (width, height) = (device.width() as f64, device.height() as f64);
            for i in 0..=20 {
                for j in 0..=20 {
                    let (u, v) = (width * f64::from(i) / 20.0, height * f64::from(j) / 20.0);
                    let ray = device.ray(u, v).unwrap();
                    for distance in [1.0, 600.0, 1e4] {
                        let (a, b) = device.project(device.centre() + ray * distance).unwrap();
                        assert!((a - u).abs() < 1e-8 && (b - v).abs() < 1e-8);
                    }
                }
            }
        }
    }

    #[test]
    fn the_axis_looks_at_the_origin_and_points_behind_are_not_seen() {
        let camera = camera();
        let origin = camera.centre() + camera.axis() * 600.0;
        assert!(origin.length() < 1e-9);
        assert!(camera.project(camera.centre() - camera.axis()).is_none());
    }

    #[test]
    fn absurd_models_are_refused_by_name() {
        let good = camera().model;
        let check = |model| Pinhole::new(model, 512, 512).unwrap_err();
        let model = PinholeModel {
            fx: f64::NAN,
            ..good
        };
        assert!(matches!(
            check(model),
            ModelError::NotFinite("the focal length")
        ));
        let model = PinholeModel {
            fy: -1000.0,
            ..good
        };
        assert!(matches!(check(model), ModelError::Focal { .. }));
        let mut model = good;
        model.rotation[0] = 0.5;
        assert!(matches!(check(model), ModelError::Rotation { .. }));
        let mut model = good;
        model.rotation.iter_mut().for_each(|r| *r = -*r);
        assert!(matches!(check(model), ModelError::Rotation { .. }));
        let mut model = good;
        model.distortion[0] = -20.0;
        assert!(matches!(check(model), ModelError::Distortion { .. }));
        let model = PinholeModel { cx: 1e9, ..good };
        assert!(matches!(check(model), ModelError::PrincipalPoint { .. }));
    }
}

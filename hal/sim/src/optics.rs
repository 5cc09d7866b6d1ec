//! Pinhole camera with Brown distortion, in both directions, for the devices of the simulated rig.
//!
//! Brown's model as OpenCV writes it (D. C. Brown, "Close-range camera calibration", 1971): with
//! r² = x² + y², x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²), and the like for
//! y with p1 and p2 exchanged.

use hal::model::DeviceModel;

/// A point or direction in mm.
pub type Vector = [f64; 3];

/// Most iterations of the inversion; it converges quadratically and needs three for the default
/// lenses.
const MAX_ITERATIONS: usize = 20;
/// The inversion ends when the distorted point is met this closely, in units of the focal length.
const CONVERGED: f64 = 1e-13;

/// A device's model with its centre of projection.
#[derive(Clone, Debug)]
pub struct Lens {
    model: DeviceModel,
    centre: Vector,
}

impl Lens {
    /// A lens of this geometry.
    #[must_use]
    pub fn new(model: DeviceModel) -> Self {
        // The centre is where X_device = 0: −Rᵀ t.
        let [x, y, z] = turned_back(&model.rotation, model.translation_mm);
        Self {
            model,
            centre: [-x, -y, -z],
        }
    }

    /// The centre of projection in the world, mm.
    #[must_use]
    pub fn centre(&self) -> Vector {
        self.centre
    }

    /// The pixel onto which the world point `point` (mm) is projected; none if it is behind the
    /// device.
    #[must_use]
    pub fn project(&self, point: Vector) -> Option<[f64; 2]> {
        let turned = turned(&self.model.rotation, point);
        let [x, y, z] = plus(turned, self.model.translation_mm);
        if z <= 0.0 {
            return None;
        }
        let [x, y] = distort(&self.model.distortion, [x / z, y / z]);
        Some([
            self.model.fx * x + self.model.cx,
            self.model.fy * y + self.model.cy,
        ])
    }

    /// Unit vector in world coordinates along the ray through pixel (u, v); pixel centres are
    /// integers.
    #[must_use]
    pub fn ray(&self, u: f64, v: f64) -> Vector {
        let seen = [
            (u - self.model.cx) / self.model.fx,
            (v - self.model.cy) / self.model.fy,
        ];
        let [x, y] = undistort(&self.model.distortion, seen);
        normalised(turned_back(&self.model.rotation, [x, y, 1.0]))
    }
}

fn distort(&[k1, k2, p1, p2, k3]: &[f64; 5], [x, y]: [f64; 2]) -> [f64; 2] {
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    [
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    ]
}

/// Newton's iteration on [`distort`], from the distorted point itself.
fn undistort(coefficients: &[f64; 5], seen: [f64; 2]) -> [f64; 2] {
    let &[k1, k2, p1, p2, k3] = coefficients;
    let [mut x, mut y] = seen;
    for _ in 0..MAX_ITERATIONS {
        let at = distort(coefficients, [x, y]);
        let (dx, dy) = (at[0] - seen[0], at[1] - seen[1]);
        if dx.abs() + dy.abs() < CONVERGED {
            break;
        }
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        // d radial / d r²
        let slope = k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3);
        let xx = radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x;
        let yy = radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x;
        let xy = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
        let determinant = xx * yy - xy * xy;
        if determinant.abs() < 1e-9 {
            // The distortion folds back here, which no real lens does; any point will do.
            break;
        }
        x -= (yy * dx - xy * dy) / determinant;
        y -= (xx * dy - xy * dx) / determinant;
    }
    [x, y]
}

/// Rz · Ry · Rx for turns about x, y and z in degrees, row-major.
pub(crate) fn turn(degrees: [f64; 3]) -> [f64; 9] {
    let [(sx, cx), (sy, cy), (sz, cz)] = degrees.map(|angle| angle.to_radians().sin_cos());
    [
        cz * cy,
        cz * sy * sx - sz * cx,
        cz * sy * cx + sz * sx,
        sz * cy,
        sz * sy * sx + cz * cx,
        sz * sy * cx - cz * sx,
        -sy,
        cy * sx,
        cy * cx,
    ]
}

/// R · v, R row-major.
pub(crate) fn turned(r: &[f64; 9], v: Vector) -> Vector {
    [0, 3, 6].map(|row| dot([r[row], r[row + 1], r[row + 2]], v))
}

/// Rᵀ · v, R row-major.
pub(crate) fn turned_back(r: &[f64; 9], v: Vector) -> Vector {
    [0, 1, 2].map(|column| dot([r[column], r[column + 3], r[column + 6]], v))
}

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn plus(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(crate) fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn along(origin: Vector, direction: Vector, t: f64) -> Vector {
    [
        origin[0] + t * direction[0],
        origin[1] + t * direction[1],
        origin[2] + t * direction[2],
    ]
}

pub(crate) fn normalised(v: Vector) -> Vector {
    let length = dot(v, v).sqrt();
    [v[0] / length, v[1] / length, v[2] / length]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Rig;

    #[test]
    fn a_point_on_the_ray_of_a_pixel_projects_back_onto_it() {
        let rig = Rig::default();
        for device in [rig.camera, rig.projector] {
            let lens = Lens::new(device.model());
            for (u, v) in [(0.0, 0.0), (511.0, 13.5), (255.5, 255.5), (100.25, 500.75)] {
                let [u2, v2] = lens
                    .project(along(lens.centre(), lens.ray(u, v), 640.0))
                    .unwrap();
                assert!(
                    (u - u2).abs() < 1e-9 && (v - v2).abs() < 1e-9,
                    "({u}, {v}) → ({u2}, {v2})"
                );
            }
        }
    }

    #[test]
    fn both_devices_look_at_the_origin_from_their_angle() {
        let rig = Rig::default();
        for device in [rig.camera, rig.projector] {
            let lens = Lens::new(device.model());
            let angle = device.angle_deg.to_radians();
            let expected = [600.0 * angle.sin(), 0.0, 600.0 * angle.cos()];
            let off = minus(lens.centre(), expected);
            assert!(dot(off, off) < 1e-18, "{:?}", lens.centre());
            let [u, v] = lens.project([0.0; 3]).unwrap();
            assert_eq!(
                (u, v),
                (
                    (f64::from(device.width) - 1.0) / 2.0,
                    (f64::from(device.height) - 1.0) / 2.0
                )
            );
            assert!(
                lens.project([1.0, 0.0, 0.0]).unwrap()[0] > u,
                "image x runs along +x"
            );
            assert!(
                lens.project([0.0, 1.0, 0.0]).unwrap()[1] < v,
                "image y runs along −y"
            );
        }
    }
}

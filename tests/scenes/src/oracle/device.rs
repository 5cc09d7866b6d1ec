//! Pinhole camera with Brown distortion in OpenCV's convention (recording format 1).

use hal::model::DeviceModel;

/// A point or direction: x, y, z.
pub type Point = [f64; 3];

/// A camera or a projector; a projector has the model of a camera.
#[derive(Clone, Debug)]
pub struct Device {
    model: DeviceModel,
}

impl Device {
    /// The device of a valid model.
    pub fn new(model: &DeviceModel) -> Self {
        Self {
            model: model.clone(),
        }
    }

    /// The centre of projection, −Rᵀ t.
    pub fn centre(&self) -> Point {
        let [a, b, c] = self.model.translation_mm;
        self.to_world([-a, -b, -c])
    }

    /// The optical axis in the world.
    pub fn axis(&self) -> Point {
        self.to_world([0.0, 0.0, 1.0])
    }

    /// Rᵀ applied to a direction of the device.
    fn to_world(&self, d: Point) -> Point {
        let r = &self.model.rotation;
        [0, 1, 2].map(|i| r[i] * d[0] + r[3 + i] * d[1] + r[6 + i] * d[2])
    }

    /// The pixel (u, v) of a world point.
    pub fn project(&self, point: Point) -> (f64, f64) {
        let (r, t) = (&self.model.rotation, &self.model.translation_mm);
        let [x, y, z] = [0, 1, 2].map(|i| {
            r[3 * i] * point[0] + r[3 * i + 1] * point[1] + r[3 * i + 2] * point[2] + t[i]
        });
        let (xd, yd) = self.distort(x / z, y / z);
        (
            self.model.fx * xd + self.model.cx,
            self.model.fy * yd + self.model.cy,
        )
    }

    /// The direction in the world of pixel (u, v).
    pub fn ray(&self, u: f64, v: f64) -> Point {
        let xd = (u - self.model.cx) / self.model.fx;
        let yd = (v - self.model.cy) / self.model.fy;
        // Fixed-point iteration: x = x_d − (the distortion at x), until x does not change any more.
        let (mut x, mut y) = (xd, yd);
        for _ in 0..1000 {
            let (bent_x, bent_y) = self.distort(x, y);
            let (next_x, next_y) = (xd - (bent_x - x), yd - (bent_y - y));
            let moved = (next_x - x).abs() + (next_y - y).abs();
            (x, y) = (next_x, next_y);
            if moved < 1e-16 {
                break;
            }
        }
        self.to_world([x, y, 1.0])
    }

    /// The point at height `z` on the ray of pixel (u, v).
    pub fn point_at(&self, u: f64, v: f64, z: f64) -> Point {
        on_ray(self.centre(), self.ray(u, v), z)
    }

    fn distort(&self, x: f64, y: f64) -> (f64, f64) {
        let [k1, k2, p1, p2, k3] = self.model.distortion;
        let r2 = x * x + y * y;
        let radial = 1.0 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2;
        (
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    }
}

/// The point at height `z` on a ray.
pub fn on_ray(centre: Point, ray: Point, z: f64) -> Point {
    let s = (z - centre[2]) / ray[2];
    [centre[0] + s * ray[0], centre[1] + s * ray[1], z]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_leads_back_to_its_pixel() {
        let device = Device::new(&crate::rig::camera(96));
        for (u, v) in [(0.0, 0.0), (95.0, 3.0), (40.5, 95.0)] {
            let (a, b) = device.project(device.point_at(u, v, 7.0));
            assert!((a - u).abs() + (b - v).abs() < 1e-9, "{a} {b}");
        }
    }
}

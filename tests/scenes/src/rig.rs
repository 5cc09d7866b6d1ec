//! The rig of the study (docs/measurement.md, *The study's head and parts*) with any number of
//! pixels.

use hal::model::DeviceModel;

/// The camera: +20° from +z towards +x, 600 mm from the origin, 20° × 20°, `size` × `size` pixels.
pub fn camera(size: u32) -> DeviceModel {
    looking_at_origin(
        (size, size),
        (20.0, 20.0),
        20.0,
        [-0.12, 0.15, 2e-4, -3e-4, 0.0],
    )
}

/// The projector: −7° from +z towards +x, 600 mm from the origin, 43.6° × 33.4°.
pub fn projector(columns: u32, rows: u32) -> DeviceModel {
    looking_at_origin(
        (columns, rows),
        (43.6, 33.4),
        -7.0,
        [-0.05, 0.03, -3e-4, 2e-4, 0.0],
    )
}

/// A device that is as far from +z towards +y as this one is towards +x, and lies like it.
pub fn above(device: DeviceModel) -> DeviceModel {
    let (sin, cos) = (-device.rotation[2], device.rotation[0]);
    DeviceModel {
        rotation: [1.0, 0.0, 0.0, 0.0, -cos, sin, 0.0, -sin, -cos],
        ..device
    }
}

fn looking_at_origin(
    (width, height): (u32, u32),
    (fov_x, fov_y): (f64, f64),
    degrees: f64,
    distortion: [f64; 5],
) -> DeviceModel {
    let focal = |size: u32, fov: f64| f64::from(size) / 2.0 / (fov.to_radians() / 2.0).tan();
    let (sin, cos) = degrees.to_radians().sin_cos();
    DeviceModel {
        fx: focal(width, fov_x),
        fy: focal(height, fov_y),
        cx: f64::from(width - 1) / 2.0,
        cy: f64::from(height - 1) / 2.0,
        distortion,
        rotation: [cos, 0.0, -sin, 0.0, -1.0, 0.0, -sin, 0.0, -cos],
        translation_mm: [0.0, 0.0, 600.0],
    }
}

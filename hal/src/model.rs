//! The geometry of a device as files state it: pinhole and Brown distortion in OpenCV's convention.
//!
//! X_device = R · X_world + t in mm, pixel centres at integer coordinates, x right, y down, z
//! forward. A projector has the model of a camera; light only goes the other way. Here the numbers
//! are only stored, and refused if they are not finite; the crate that measures with them checks
//! whether they describe a usable camera.

use crate::bounds::{Bound, Fields, MAX_SIDE, OutOfBounds, within};
use serde::{Deserialize, Serialize};

/// `MODEL` of recording format 1 (docs/formats.md).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeviceModel {
    /// Focal length in pixels along x.
    pub fx: f64,
    /// Focal length in pixels along y.
    pub fy: f64,
    /// Principal point, column.
    pub cx: f64,
    /// Principal point, row.
    pub cy: f64,
    /// Brown distortion k1, k2, p1, p2, k3.
    pub distortion: [f64; 5],
    /// Rotation from the world to the device, row-major.
    pub rotation: [f64; 9],
    /// Translation from the world to the device, mm.
    pub translation_mm: [f64; 3],
}

/// What the measured projector points of the plane z = 0 are off those of the models: two
/// polynomials of degree 6 over the camera's frame.
///
/// Each has 28 coefficients of T_i(x)·T_j(y), i + j ≤ 6, ordered by i and then by j, where T are
/// Chebyshev polynomials and x, y run from -1 to 1 over the frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaneModel {
    /// Of ξ(u, v), in projector columns.
    pub xi: [f64; 28],
    /// Of η(u, v), in projector rows.
    pub eta: [f64; 28],
}

impl Bound<PlaneModel> for Fields {
    /// None of the coefficients can be longer than the longest raster. A message names the key of
    /// the whole plane.
    fn check(&self, key: &str, plane: &PlaneModel) -> Result<(), OutOfBounds> {
        let most = f64::from(MAX_SIDE);
        let mut all = plane.xi.iter().chain(&plane.eta);
        all.try_for_each(|&coefficient| within(key, coefficient, -most, most))
    }
}

impl DeviceModel {
    /// The geometry of a picture of every second column and row, from `column` and `row` on: one
    /// plane of a colour sensor.
    #[must_use]
    pub fn every_second(&self, column: u32, row: u32) -> Self {
        Self {
            fx: self.fx / 2.0,
            fy: self.fy / 2.0,
            cx: (self.cx - f64::from(column)) / 2.0,
            cy: (self.cy - f64::from(row)) / 2.0,
            ..self.clone()
        }
    }

    /// The name of the first number that is not finite, if any.
    #[must_use]
    pub fn first_not_finite(&self) -> Option<&'static str> {
        let groups: [(&'static str, &[f64]); 7] = [
            ("fx", &[self.fx]),
            ("fy", &[self.fy]),
            ("cx", &[self.cx]),
            ("cy", &[self.cy]),
            ("distortion", &self.distortion),
            ("rotation", &self.rotation),
            ("translation_mm", &self.translation_mm),
        ];
        groups
            .into_iter()
            .find(|(_, values)| !values.iter().all(|v| v.is_finite()))
            .map(|(name, _)| name)
    }
}

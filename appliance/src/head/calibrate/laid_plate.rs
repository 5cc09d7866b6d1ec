//! Where the plate lies in the world of the models, if it does not lie in their z = 0.

use super::PLATE_PITCH;
use crate::head::calibration::Calibration;
use crate::head::calibration::geometry::PoseFile;
use algo::geometry::{FittedMap, Vector};

/// A plate by triangulation.
pub(super) struct LaidPlate {
    /// Angle between the plate and z = 0, degrees.
    tilt_degrees: f64,
    /// Mean height of the plate where the camera sees it, mm.
    height_mm: f64,
    /// RMS distance of the rays of camera and projector that should meet on it, projector pixels.
    pub apart_px: f64,
}

impl LaidPlate {
    /// Where the plate lies, by how far the projector points on it are off those of z = 0, in
    /// fringes along ξ and along η. `None` where the rays do not meet in front of the head.
    pub fn of(calibration: &Calibration, corrections: [&FittedMap; 2]) -> Option<Self> {
        let (camera, projector) = (&calibration.camera, &calibration.projector);
        let (mut points, mut squares) = (Vec::new(), 0.0);
        for (u, v) in calibration.grid() {
            let ray = camera.ray(u, v)?;
            let eye = camera.centre();
            let on_plane = projector.project(eye + ray * (-eye.z / ray.z))?;
            let [xi, eta] = corrections.map(|map| PLATE_PITCH * map.at(u, v));
            let lit_by = (on_plane.0 + xi, on_plane.1 + eta);
            let point = nearest(
                (eye, ray),
                (projector.centre(), projector.ray(lit_by.0, lit_by.1)?),
            )?;
            let seen = projector.project(point)?;
            squares += (seen.0 - lit_by.0).powi(2) + (seen.1 - lit_by.1).powi(2);
            points.push(point);
        }
        let (slope, height_mm) = plane(&points)?;
        Some(Self {
            tilt_degrees: slope.atan().to_degrees(),
            height_mm,
            apart_px: (squares / points.len() as f64).sqrt(),
        })
    }

    /// What is wrong, and what to do about it; `ground` is the pose of the board that z = 0 goes
    /// by.
    pub fn elsewhere(&self, ground: Option<&PoseFile>) -> (String, String) {
        let Self {
            tilt_degrees,
            height_mm,
            ..
        } = self;
        let remedy = match ground {
            Some(pose) => format!(
                "z = 0 is the board as it lay in {0}: lay the plate like that, or, if the board did not lie flat in {0}, take this pose again as the last one, with the board where the plate lies now, and make the models anew",
                pose.recording
            ),
            None => "lay it into z = 0 of the models; if it lies there, the imported models are off the measured plate: import those of this camera and this projector, with the pose of this plate"
                .into(),
        };
        let side = if *height_mm < 0.0 { "below" } else { "above" };
        let problem = format!(
            "the plate does not lie in the plane z = 0, it is tilted by {tilt_degrees:.1}° against it and on average {:.1} mm {side} it",
            height_mm.abs()
        );
        (problem, remedy)
    }
}

/// The point of the first line that is nearest to the second one; lines are points and directions.
fn nearest((a, along): (Vector, Vector), (b, other): (Vector, Vector)) -> Option<Vector> {
    let between = b - a;
    let (aa, ab, bb) = (along.dot(along), along.dot(other), other.dot(other));
    let far = (between.dot(along) * bb - between.dot(other) * ab) / (aa * bb - ab * ab);
    (far.is_finite() && far > 0.0).then(|| a + along * far)
}

/// Slope and mean height of the plane of least squares through points.
fn plane(points: &[Vector]) -> Option<(f64, f64)> {
    let share = 1.0 / points.len() as f64;
    let sum = |of: &dyn Fn(Vector) -> f64| points.iter().map(|point| of(*point)).sum::<f64>();
    let mean = points
        .iter()
        .fold(Vector::default(), |sum, point| sum + *point * share);
    let off = |point: Vector| point - mean;
    let (xx, xy, yy) = (
        sum(&|point| off(point).x.powi(2)),
        sum(&|point| off(point).x * off(point).y),
        sum(&|point| off(point).y.powi(2)),
    );
    let (xz, yz) = (
        sum(&|point| off(point).x * off(point).z),
        sum(&|point| off(point).y * off(point).z),
    );
    let all = xx * yy - xy * xy;
    let slope = ((xz * yy - yz * xy) / all).hypot((yz * xx - xz * xy) / all);
    slope.is_finite().then_some((slope, mean.z))
}

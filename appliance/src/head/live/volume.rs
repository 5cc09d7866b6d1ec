//! The measuring volume in the camera's picture: at the lowest height, at z = 0 and at the highest
//! one, the outline of what the projector lights and the camera sees.

use crate::head::calibration::Calibration;
use algo::geometry::{HeightRange, Pinhole, Vector};
use serde::Serialize;

/// Points along each edge of the projector's raster: lenses bend them.
const STEPS: u32 = 8;
/// Places are rounded to this share of a pixel.
const PER_PIXEL: f64 = 10.0;

/// The outline at one height.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VolumeOutline {
    /// The height, mm.
    pub z_mm: f64,
    /// Its corners in pixels of the frame, in order.
    pub points: Vec<[f64; 2]>,
}

/// The outlines at both ends of the default working range and between them at z = 0; heights at
/// which camera and projector see no common region are left out.
pub fn outlines(calibration: &Calibration) -> Vec<VolumeOutline> {
    let (camera, projector) = (&calibration.camera, &calibration.projector);
    let range = HeightRange::of(camera, projector);
    let heights = [range.low, 0.0, range.high].into_iter();
    let seen = heights.map(|z_mm| VolumeOutline {
        z_mm: z_mm.round(),
        points: outline(camera, projector, z_mm),
    });
    seen.filter(|outline| outline.points.len() > 2).collect()
}

fn outline(camera: &Pinhole, projector: &Pinhole, z: f64) -> Vec<[f64; 2]> {
    let lamp = projector.centre();
    let lit = |(xi, eta): (f64, f64)| {
        let ray = projector.ray(xi, eta).filter(|ray| ray.z < 0.0)?;
        let point: Vector = lamp + ray * ((z - lamp.z) / ray.z);
        let (u, v) = camera.project(point)?;
        Some([u, v])
    };
    let (columns, rows) = (projector.width() as f64, projector.height() as f64);
    let share = |at: u32| f64::from(at) / f64::from(STEPS);
    let edge = (0..4 * STEPS).map(|at| {
        let along = share(at % STEPS);
        match at / STEPS {
            0 => (along * columns, 0.0),
            1 => (columns, along * rows),
            2 => ((1.0 - along) * columns, rows),
            _ => (0.0, (1.0 - along) * rows),
        }
    });
    let mut points: Vec<[f64; 2]> = edge.filter_map(lit).collect();
    for (axis, size) in [camera.width(), camera.height()].into_iter().enumerate() {
        points = clipped(&points, axis, 1.0, 0.0);
        points = clipped(&points, axis, -1.0, -(size as f64));
    }
    let rounded = |at: f64| (at * PER_PIXEL).round() / PER_PIXEL;
    points.iter().map(|point| point.map(rounded)).collect()
}

/// The part of a polygon where `sign` times a coordinate is at least `least` (I. Sutherland, G.
/// Hodgman, "Reentrant polygon clipping", Communications of the ACM 17, 1974).
fn clipped(points: &[[f64; 2]], axis: usize, sign: f64, least: f64) -> Vec<[f64; 2]> {
    let over = |point: &[f64; 2]| sign * point[axis] - least;
    let before = points.iter().cycle().skip(points.len().saturating_sub(1));
    let mut kept = Vec::with_capacity(points.len() + 4);
    for (from, to) in before.zip(points) {
        let (a, b) = (over(from), over(to));
        if (a < 0.0) != (b < 0.0) {
            let share = a / (a - b);
            kept.push([0, 1].map(|at| from[at] + share * (to[at] - from[at])));
        }
        if b >= 0.0 {
            kept.push(*to);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::Scenario;

    #[test]
    fn an_outline_holds_exactly_the_pixels_that_the_projector_lights_at_its_height() {
        let mut scenario = Scenario::default();
        // Narrow, so that the edges of its light lie in the frame.
        scenario.rig.projector.fov_deg = [8.0, 6.0];
        let calibration = Calibration::of_scenario(&scenario).unwrap();
        let (camera, projector) = (&calibration.camera, &calibration.projector);
        let all = outlines(&calibration);
        assert_eq!(all.len(), 3);
        assert!(all[0].z_mm < 0.0 && all[1].z_mm == 0.0 && all[2].z_mm > 0.0);
        let inside = |points: &[[f64; 2]], u: f64, v: f64| {
            let edges = points.iter().zip(points.iter().cycle().skip(1));
            let crossed = edges.filter(|(a, b)| {
                (a[1] > v) != (b[1] > v) && u < a[0] + (v - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
            });
            crossed.count() % 2 == 1
        };
        let (width, height) = (camera.width() as f64, camera.height() as f64);
        for (outline, z) in all.iter().zip([
            HeightRange::of(camera, projector).low,
            0.0,
            HeightRange::of(camera, projector).high,
        ]) {
            let (mut lit, mut dark) = (0, 0);
            for at in 0..40 * 40 {
                let u = (f64::from(at % 40) + 0.5) / 40.0 * width;
                let v = (f64::from(at / 40) + 0.5) / 40.0 * height;
                let ray = camera.ray(u, v).unwrap();
                let eye = camera.centre();
                let seen = projector.project(eye + ray * ((z - eye.z) / ray.z));
                let (xi, eta) = seen.unwrap();
                // How far the point is inside the raster, as a share of it.
                let share = |at: f64, size: usize| (at / size as f64).min(1.0 - at / size as f64);
                let within = share(xi, projector.width()).min(share(eta, projector.height()));
                if within.abs() > 0.01 {
                    assert_eq!(inside(&outline.points, u, v), within > 0.0, "{u} {v} {z}");
                    *(if within > 0.0 { &mut lit } else { &mut dark }) += 1;
                }
            }
            assert!(lit > 50 && dark > 50, "{lit} {dark} at {z}");
        }
    }

    #[test]
    fn what_lies_outside_of_the_frame_is_cut_off() {
        let square = [[-1.0, -1.0], [3.0, -1.0], [3.0, 3.0], [-1.0, 3.0]];
        let kept = clipped(&square, 0, 1.0, 0.0);
        assert_eq!(kept.iter().map(|p| p[0]).fold(9.0, f64::min), 0.0);
        assert!(clipped(&kept, 0, -1.0, 1.0).is_empty());
        assert!(clipped(&[], 1, 1.0, 0.0).is_empty());
    }
}

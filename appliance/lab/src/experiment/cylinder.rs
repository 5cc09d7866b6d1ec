//! Fits a cylinder to a point cloud by least squares.
//!
//! Gauss–Newton over the five parameters of a cylinder along y: its axis (x₀ + a y, y, z₀ + c y)
//! and its radius. Outliers are left out round by round, so that wrong fringe orders do not bias
//! the fit.

use algo::math::solve::Normal;

/// A fitted cylinder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// Radius, mm.
    pub radius_mm: f64,
    /// RMS distance of the points from the surface, without those left out, mm.
    pub residual_mm: f64,
    /// Points further than 1 mm from the surface.
    pub left_out: usize,
}

/// In each round, points further than this from the surface are left out, mm.
const CUTS: [f64; 4] = [f64::INFINITY, 5.0, 1.0, 1.0];
/// Iterations of one round; the fit converges quadratically in three or four.
const ITERATIONS: usize = 12;
/// x₀, a, z₀, c, radius.
const UNKNOWNS: usize = 5;

/// Fits a cylinder along y to points (x, y, z) in mm that lie on the side towards +z; `None` where
/// they do not determine one.
pub fn fit(points: &[[f64; 3]]) -> Option<Cylinder> {
    let count = points.len() as f64;
    let extent = |axis: usize| {
        let values = points.iter().map(|point| point[axis]);
        values.fold([f64::MAX, f64::MIN], |[low, high], value| {
            [low.min(value), high.max(value)]
        })
    };
    let ([left, right], [_, top]) = (extent(0), extent(2));
    let radius = (right - left) / 2.0;
    let mut shape = [(left + right) / 2.0, 0.0, top - radius, 0.0, radius];
    for cut in CUTS {
        for _ in 0..ITERATIONS {
            shape = iterate(points, shape, cut)?;
        }
    }
    let [.., last] = CUTS;
    let inliers = points.iter().filter_map(|point| {
        let (distance, _) = distance(point, &shape);
        (distance.abs() <= last).then_some(distance * distance)
    });
    let (squares, used) = inliers.fold((0.0, 0.0), |(sum, n), square| (sum + square, n + 1.0));
    (used > UNKNOWNS as f64).then(|| Cylinder {
        radius_mm: shape[4],
        residual_mm: f64::sqrt(squares / used),
        left_out: (count - used) as usize,
    })
}

/// Distance of a point from the surface, and its derivatives by the five unknowns.
fn distance(point: &[f64; 3], shape: &[f64; UNKNOWNS]) -> (f64, [f64; UNKNOWNS]) {
    let [x0, a, z0, c, radius] = *shape;
    let (x, y, z) = (point[0] - x0, point[1], point[2] - z0);
    // The foot of the perpendicular on the axis, in multiples of (a, 1, c).
    let foot = (a * x + y + c * z) / (a * a + 1.0 + c * c);
    let (wx, wy, wz) = (x - foot * a, y - foot, z - foot * c);
    let across = (wx * wx + wy * wy + wz * wz).sqrt().max(1e-12);
    let (nx, nz) = (wx / across, wz / across);
    (across - radius, [-nx, -foot * nx, -nz, -foot * nz, -1.0])
}

/// One Gauss–Newton iteration over the points within `cut` of the surface.
fn iterate(points: &[[f64; 3]], shape: [f64; UNKNOWNS], cut: f64) -> Option<[f64; UNKNOWNS]> {
    let mut normal = Normal::default();
    for point in points {
        let (error, slopes) = distance(point, &shape);
        if error.abs() > cut {
            continue;
        }
        normal.add(&slopes, -error);
    }
    let change = normal.solve()?;
    let mut next = shape;
    for (value, change) in next.iter_mut().zip(change) {
        *value += change;
    }
    next.iter().all(|value| value.is_finite()).then_some(next)
}

#[cfg(test)]
mod tests {
    use super::fit;

    /// Points of the upper side of a cylinder of radius 60 about a crooked axis.
    fn points() -> Vec<[f64; 3]> {
        let mut points = Vec::new();
        for i in -60..=60 {
            for j in -20..=20 {
                let (angle, y) = (f64::from(i).to_radians(), 2.0 * f64::from(j));
                // Turned by 0.05 about z: the cross section stays a circle.
                let (sin, cos) = 0.05_f64.sin_cos();
                let x = 60.0 * angle.sin();
                points.push([
                    3.0 + cos * x - sin * y,
                    sin * x + cos * y,
                    60.0 * angle.cos() - 20.0,
                ]);
            }
        }
        points
    }

    #[test]
    fn a_cylinder_about_a_crooked_axis_is_found() {
        let found = fit(&points()).unwrap();
        assert!((found.radius_mm - 60.0).abs() < 1e-9, "{found:?}");
        assert!(found.residual_mm < 1e-9 && found.left_out == 0, "{found:?}");
    }

    #[test]
    fn wrong_fringe_orders_do_not_bend_the_fit() {
        let mut points = points();
        for point in points.iter_mut().step_by(50) {
            point[2] += 8.0;
        }
        let found = fit(&points).unwrap();
        assert!((found.radius_mm - 60.0).abs() < 1e-9, "{found:?}");
        assert_eq!(found.left_out, points.len().div_ceil(50));
    }

    #[test]
    fn too_few_points_give_no_cylinder() {
        assert_eq!(fit(&[]), None);
        assert_eq!(fit(&[[0.0; 3]; 9]), None);
    }
}

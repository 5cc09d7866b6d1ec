//! Judges a run: errors against truth, coverage, and the fit of a cylinder.

use super::compared::Judged;
use super::table::Values;
use algo::math::solve::Normal;
use algo::phase::Trust;
use appliance::head::calibrated::MeasuredPart;
use appliance::measure::{GROSS_MM, Score, Truth};

/// Compares a measurement of a simulated part with the truth. All figures are over the pixels that
/// truth calls wholly lit, as in the study; the ratio to the paper's run is not known yet.
pub fn judge(truth: &sim::Truth, measured: &MeasuredPart, judged: Judged) -> Values {
    let known = Truth::from(truth);
    let (phases, heights) = (&measured.phases, &measured.heights);
    let whole: Vec<usize> = known.whole_pixels().collect();
    let resolved: Vec<usize> = whole
        .iter()
        .copied()
        .filter(|&at| phases.trust[at] == Trust::Resolved)
        .collect();
    let (mut squares, mut count) = (0.0, 0.0);
    for &at in &resolved {
        let sigma = f64::from(heights.sigma[at]);
        let error = heights.height[at].mm() - f64::from(truth.height[at]);
        if error.abs() <= GROSS_MM && sigma > 0.0 {
            squares += (error / sigma).powi(2);
            count += 1.0;
        }
    }
    let cylinder = (judged == Judged::CylinderFit)
        .then(|| {
            let width = heights.width;
            let point = |&at: &usize| {
                let found = measured
                    .triangulator
                    .point(at % width, at / width, heights.height[at]);
                found.map(|point| [point.x, point.y, point.z])
            };
            fit_cylinder(&resolved.iter().filter_map(point).collect::<Vec<_>>())
        })
        .flatten();
    let score = known.score(phases, heights);
    let scored = |value: fn(&Score) -> f64| score.as_ref().map(value);
    Values {
        scored_px: scored(|score| score.scored as f64).unwrap_or(0.0),
        lit_px: whole.len() as f64,
        unresolved_px: (whole.len() - resolved.len()) as f64,
        gross_px: scored(|score| score.gross as f64).unwrap_or(0.0),
        rms_mm: scored(|score| score.rms_mm).unwrap_or(f64::NAN),
        bias_mm: scored(|score| score.bias_mm).unwrap_or(f64::NAN),
        median_mm: scored(|score| score.median_mm).unwrap_or(f64::NAN),
        p99_mm: scored(|score| score.p99_mm).unwrap_or(f64::NAN),
        error_over_sigma: (squares / f64::max(count, 1.0)).sqrt(),
        ratio_to_paper: f64::NAN,
        coverage: resolved.len() as f64 / whole.len().max(1) as f64,
        fit_residual_mm: cylinder.map_or(f64::NAN, |fit| fit.residual_mm),
        fit_radius_mm: cylinder.map_or(f64::NAN, |fit| fit.radius_mm),
    }
}

/// A fitted cylinder.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cylinder {
    /// Radius, mm.
    radius_mm: f64,
    /// RMS distance of the points from the surface, without those left out, mm.
    residual_mm: f64,
    /// Points further than 1 mm from the surface.
    left_out: usize,
}

/// In each round, points further than this from the surface are left out, mm.
const CUTS: [f64; 4] = [f64::INFINITY, 5.0, 1.0, 1.0];
/// Iterations of one round; the fit converges quadratically in three or four.
const ITERATIONS: usize = 12;
/// x₀, a, z₀, c, radius.
const UNKNOWNS: usize = 5;

/// Fits a cylinder to points (x, y, z) in mm that lie on its side towards +z; `None` where they do
/// not determine one.
///
/// Least squares by Gauss–Newton over the five parameters of a cylinder along y: its axis
/// (x₀ + a y, y, z₀ + c y) and its radius. Outliers are left out round by round, so that wrong
/// fringe orders do not bias the fit.
fn fit_cylinder(points: &[[f64; 3]]) -> Option<Cylinder> {
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
    use super::fit_cylinder;

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
        let found = fit_cylinder(&points()).unwrap();
        assert!((found.radius_mm - 60.0).abs() < 1e-9, "{found:?}");
        assert!(found.residual_mm < 1e-9 && found.left_out == 0, "{found:?}");
    }

    #[test]
    fn wrong_fringe_orders_do_not_bend_the_fit() {
        let mut points = points();
        for point in points.iter_mut().step_by(50) {
            point[2] += 8.0;
        }
        let found = fit_cylinder(&points).unwrap();
        assert!((found.radius_mm - 60.0).abs() < 1e-9, "{found:?}");
        assert_eq!(found.left_out, points.len().div_ceil(50));
    }

    #[test]
    fn too_few_points_give_no_cylinder() {
        assert_eq!(fit_cylinder(&[]), None);
        assert_eq!(fit_cylinder(&[[0.0; 3]; 9]), None);
    }
}

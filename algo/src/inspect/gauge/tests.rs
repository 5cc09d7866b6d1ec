//! Every gauge on made cells, with exact answers.

use super::*;
use std::vec::Vec;

/// A square of `side` × `side` cells of 4 pixels, 2 mm apart, about (0, 0), taught flat at 0.
fn grid(side: usize, height: impl Fn(f64, f64) -> f64) -> (Vec<Sum>, Vec<TaughtCell>) {
    let middle = (side - 1) as f64;
    let places = (0..side * side).map(|at| {
        let x = (at % side) as f64 * 2.0 - middle;
        (x, (at / side) as f64 * 2.0 - middle)
    });
    let cells = places.map(|(x, y)| {
        let sum = Sum {
            count: 4,
            deviation: 4 * (height(x, y) * 1e6).round() as i64,
        };
        let taught = TaughtCell {
            normal: 1.0,
            pixels: 4,
            height: 0.0,
            x,
            y,
            area: 1.5,
            jacobian: [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            variance: 4.0 * 0.01,
        };
        (sum, taught)
    });
    cells.unzip()
}

fn seen(sums: &[Sum], taught: &[TaughtCell], least: Option<i64>) -> Vec<Cell> {
    let mut out = Vec::new();
    cells(sums, taught, least, &mut out);
    out
}

fn sigma(found: Found) -> f64 {
    libm::sqrt(found.pixels + found.motion)
}

fn of_weights(
    weights: &[f64],
    cells: &[Cell],
    variance: impl Fn(usize) -> f64,
    placed: Option<&crate::inspect::align::Placed>,
) -> f64 {
    sigma(found(0.0, weights, cells, variance, placed))
}

fn close(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-6, "{found} {expected}");
}

#[test]
fn a_mean_height_is_the_mean_of_its_pixels_and_its_error_falls_with_their_root() {
    let (sums, taught) = grid(5, |x, _| 8.0 + 0.25 * x);
    let cells = seen(&sums, &taught, None);
    let mut weights = Vec::new();
    close(mean(&cells, &mut weights).unwrap(), 8.0);
    // 100 pixels of 0.1 mm.
    close(of_weights(&weights, &cells, |_| 0.01, None), 0.01);
}

#[test]
fn a_step_is_the_difference_of_two_means_and_has_the_errors_of_both() {
    let (low, taught) = grid(4, |_, _| 8.0);
    let (high, _) = grid(4, |_, _| 10.5);
    let (high, low) = (seen(&high, &taught, None), seen(&low, &taught, None));
    let mut weights = Vec::new();
    close(step(&high, &low, &mut weights).unwrap(), 2.5);
    let all: Vec<_> = high.into_iter().chain(low).collect();
    // 64 pixels of 0.1 mm on each side.
    close(
        of_weights(&weights, &all, |_| 0.01, None),
        0.1 / 8.0 * core::f64::consts::SQRT_2,
    );
}

#[test]
fn tilts_are_right_handed_angles_of_the_plane_whatever_its_height() {
    let slope = |degrees: f64| libm::tan(degrees.to_radians());
    let (sums, taught) = grid(9, |x, y| 3.0 + slope(0.5) * y - slope(1.5) * x);
    let cells = seen(&sums, &taught, None);
    let mut weights = Vec::new();
    let about_x = tilt(&cells, Axis::X, &mut weights).unwrap();
    let about_y = tilt(&cells, Axis::Y, &mut Vec::new()).unwrap();
    // Heights are whole nm: 1 nm over 16 mm is 4e-6 degrees.
    assert!((about_x - 0.5).abs() < 4e-6 && (about_y - 1.5).abs() < 4e-6);
    // σ of a slope: σ / √Σ y² over 4 · 9 columns of y = −8, −6, … 8.
    let squares: f64 = (-4..=4).map(|y| f64::from(4 * y * y)).sum::<f64>() * 36.0;
    let expected = (0.1 / squares.sqrt()).to_degrees() / (1.0 + slope(0.5).powi(2));
    close(of_weights(&weights, &cells, |_| 0.01, None), expected);
}

#[test]
fn flatness_is_about_the_least_squares_plane_and_peak_to_valley_is_not() {
    // A saddle 0.2 x y / 16 on a plane of 45 degrees.
    let saddle = |x: f64, y: f64| 0.2 * x * y / 16.0;
    let (sums, taught) = grid(5, |x, y| x + saddle(x, y));
    let cells = seen(&sums, &taught, None);
    let flat = flatness(&cells, 0.0, None, &mut Vec::new()).unwrap();
    close(flat.value, 0.4 / core::f64::consts::SQRT_2);
    let range = peak_to_valley(&cells, 0.0, None, &mut Vec::new()).unwrap();
    close(range.value, 8.4);
}

#[test]
fn a_volume_is_area_times_height_above_the_plane_and_what_was_not_measured_counts_as_the_rest() {
    let (mut sums, taught) = grid(4, |_, _| 9.0);
    sums[5] = Sum::default();
    let cells = seen(&sums, &taught, None);
    let mut weights = Vec::new();
    close(volume(&cells, 7.0, &mut weights).unwrap(), 16.0 * 1.5 * 2.0);
    close(
        of_weights(&weights, &cells, |_| 0.01, None),
        24.0 * 0.1 / 8.0,
    );
}

#[test]
fn deviations_have_a_root_mean_square_and_a_share_out_of_tolerance() {
    let (sums, taught) = grid(4, |x, _| if x > 2.0 { -0.3 } else { 0.1 });
    let cells = seen(&sums, &taught, None);
    let expected: f64 = (4.0 * 0.09 + 12.0 * 0.01) / 16.0;
    close(rms(&cells, 0.0, None).unwrap().value, expected.sqrt());
    let share = share_outside((&cells, 4), 0.001, 0.2, None, &mut Vec::new()).unwrap();
    close(share.value, 0.25);
    // Nothing lies within 100 σ of the tolerance.
    close(sigma(share), 0.0);
    // One cell at the tolerance is a coin.
    let (sums, taught) = grid(1, |_, _| 0.2);
    let one = seen(&sums, &taught, None);
    let coin = sigma(share_outside((&one, 1), 0.01, 0.2, None, &mut Vec::new()).unwrap());
    close(coin, 0.5);
}

#[test]
fn a_region_of_which_less_than_half_is_left_measures_nothing() {
    let (mut sums, taught) = grid(4, |_, _| 1.0);
    sums[..9].fill(Sum::default());
    assert!(seen(&sums, &taught, None).is_empty());
    sums[8] = sums[15];
    assert_eq!(seen(&sums, &taught, None).len(), 16);
    assert_eq!(seen(&sums, &taught, Some(1)).len(), 8);
    // Cells with fewer pixels than asked for are left out.
    sums[8].count = 2;
    sums[7] = sums[15];
    assert_eq!(seen(&sums, &taught, Some(3)).len(), 8);
    assert!(mean(&[], &mut Vec::new()).is_none() && tilt(&[], Axis::X, &mut Vec::new()).is_none());
    assert!(
        rms(&[], 0.1, None).is_none() && peak_to_valley(&[], 0.1, None, &mut Vec::new()).is_none()
    );
}

#[test]
fn the_motion_moves_a_mean_as_a_whole_and_leaves_a_step_alone() {
    let (sums, taught) = grid(4, |_, _| 1.0);
    let cells = seen(&sums, &taught, None);
    let mut covariance = [[0.0; 6]; 6];
    covariance[2][2] = 0.02 * 0.02;
    let placed = crate::inspect::align::Placed {
        motion: crate::inspect::align::Motion::none(crate::geometry::Vector::default()),
        covariance,
        radius: 50.0,
        left_out: [false; 6],
        points: 100,
        outliers: 0.0,
        reach: 0.0,
        reach_sigma: 0.0,
    };
    let mut weights = Vec::new();
    mean(&cells, &mut weights).unwrap();
    close(of_weights(&weights, &cells, |_| 0.0, Some(&placed)), 0.02);
    weights.clear();
    step(&cells, &cells, &mut weights).unwrap();
    let all: Vec<_> = cells.iter().chain(&cells).copied().collect();
    close(of_weights(&weights, &all, |_| 0.0, Some(&placed)), 0.0);
    assert_eq!(placed.component(2), Some((0.0, 0.02)));
    close(placed.component(3).unwrap().1, 0.0);
}

#[test]
fn a_region_with_too_many_cells_is_refused_and_others_hold_every_pixel() {
    let side = 300.0;
    let corners = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)];
    let region = crate::inspect::Region::polygon(&corners, 300, 300).unwrap();
    assert_eq!(
        Grid::over(&region, 1),
        Err(TooFine {
            side: 1,
            cells: 90_000
        })
    );
    let grid = Grid::over(&region, 7).unwrap();
    assert_eq!(grid.len(), 43 * 43);
    assert_eq!(
        (grid.cell(0, 0), grid.cell(6, 6), grid.cell(7, 0)),
        (0, 0, 1)
    );
    // Beside the box: the nearest.
    assert_eq!((grid.cell(-3, -9), grid.cell(400, 400)), (0, 43 * 43 - 1));
    assert!(Grid::over(&region, 0).unwrap().len() <= 1024);
}

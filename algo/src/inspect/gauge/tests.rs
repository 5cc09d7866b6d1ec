//! Every gauge on made cells, with exact answers.

use super::kinds::*;
use super::*;
use crate::inspect::align::Placed;

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

/// What a kind finds in the cells of two regions, with errors per cell and per pixel.
fn find_in(
    kind: &dyn Kind,
    regions: [&[Cell]; 2],
    (sigma, pixel): (f64, f64),
    placed: Option<&Placed>,
) -> Option<Found> {
    kind.find(Evidence {
        all: &regions.concat(),
        count: regions[0].len(),
        columns: 4,
        sigma,
        variances: [pixel * pixel; 2],
        placed,
        room: &mut Vec::new(),
    })
}

fn find(kind: &dyn Kind, cells: &[Cell], sigma: f64) -> Option<Found> {
    find_in(kind, [cells, &[]], (sigma, 0.1), None)
}

fn close(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-6, "{found} {expected}");
}

#[test]
fn a_mean_height_is_the_mean_of_its_pixels_and_its_error_falls_with_their_root() {
    let (sums, taught) = grid(5, |x, _| 8.0 + 0.25 * x);
    let cells = seen(&sums, &taught, None);
    let mean = find(&MeanHeight {}, &cells, 0.0).unwrap();
    close(mean.value, 8.0);
    // 100 pixels of 0.1 mm.
    close(sigma(mean), 0.01);
}

#[test]
fn a_step_is_the_difference_of_two_means_and_has_the_errors_of_both() {
    let (low, taught) = grid(4, |_, _| 8.0);
    let (high, _) = grid(4, |_, _| 10.5);
    let (high, low) = (seen(&high, &taught, None), seen(&low, &taught, None));
    let from = "low".into();
    let step = find_in(&Step { from }, [&high, &low], (0.0, 0.1), None).unwrap();
    close(step.value, 2.5);
    // 64 pixels of 0.1 mm on each side.
    close(sigma(step), 0.1 / 8.0 * core::f64::consts::SQRT_2);
}

#[test]
fn tilts_are_right_handed_angles_of_the_plane_whatever_its_height() {
    let slope = |degrees: f64| libm::tan(degrees.to_radians());
    let (sums, taught) = grid(9, |x, y| 3.0 + slope(0.5) * y - slope(1.5) * x);
    let cells = seen(&sums, &taught, None);
    let tilt = |about| find(&Tilt { about }, &cells, 0.0).unwrap();
    let (about_x, about_y) = (tilt(Axis::X), tilt(Axis::Y));
    // Heights are whole nm: 1 nm over 16 mm is 4e-6 degrees.
    assert!((about_x.value - 0.5).abs() < 4e-6 && (about_y.value - 1.5).abs() < 4e-6);
    // σ of a slope: σ / √Σ y² over 4 · 9 columns of y = −8, −6, … 8.
    let squares: f64 = (-4..=4).map(|y| f64::from(4 * y * y)).sum::<f64>() * 36.0;
    let expected = (0.1 / squares.sqrt()).to_degrees() / (1.0 + slope(0.5).powi(2));
    close(sigma(about_x), expected);
}

#[test]
fn flatness_is_about_the_least_squares_plane_and_peak_to_valley_is_not() {
    let smoothing_px = 2;
    // A saddle 0.2 x y / 16 on a plane of 45 degrees.
    let saddle = |x: f64, y: f64| 0.2 * x * y / 16.0;
    let (sums, taught) = grid(5, |x, y| x + saddle(x, y));
    let cells = seen(&sums, &taught, None);
    let flat = find(&Flatness { smoothing_px }, &cells, 0.0).unwrap();
    close(flat.value, 0.4 / core::f64::consts::SQRT_2);
    let range = find(&PeakToValley { smoothing_px }, &cells, 0.0).unwrap();
    close(range.value, 8.4);
}

#[test]
fn a_volume_is_area_times_height_above_the_plane_and_what_was_not_measured_counts_as_the_rest() {
    let (mut sums, taught) = grid(4, |_, _| 9.0);
    sums[5] = Sum::default();
    let cells = seen(&sums, &taught, None);
    let volume = find(&Volume { above_mm: 7.0 }, &cells, 0.0).unwrap();
    close(volume.value, 16.0 * 1.5 * 2.0);
    close(sigma(volume), 24.0 * 0.1 / 8.0);
}

#[test]
fn deviations_have_a_root_mean_square_and_a_share_out_of_tolerance() {
    let (sums, taught) = grid(4, |x, _| if x > 2.0 { -0.3 } else { 0.1 });
    let cells = seen(&sums, &taught, None);
    let expected: f64 = (4.0 * 0.09 + 12.0 * 0.01) / 16.0;
    let smoothing_px = 2;
    let rms = find(&RmsDeviation { smoothing_px }, &cells, 0.0).unwrap();
    close(rms.value, expected.sqrt());
    let outside = OutOfTolerance {
        smoothing_px,
        tolerance_mm: 0.2,
    };
    let share = find(&outside, &cells, 0.001).unwrap();
    close(share.value, 0.25);
    // Nothing lies within 100 σ of the tolerance.
    close(sigma(share), 0.0);
    // One cell at the tolerance is a coin.
    let (sums, taught) = grid(1, |_, _| 0.2);
    let one = seen(&sums, &taught, None);
    close(sigma(find(&outside, &one, 0.01).unwrap()), 0.5);
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
    // The others are of squares, pixels and the motion.
    for kind in Measure::examples() {
        assert_eq!(find(kind.kind(), &[], 0.1), None, "{kind:?}");
    }
}

#[test]
fn the_motion_moves_a_mean_as_a_whole_and_leaves_a_step_alone() {
    let (sums, taught) = grid(4, |_, _| 1.0);
    let cells = seen(&sums, &taught, None);
    let mut covariance = [[0.0; 6]; 6];
    covariance[2][2] = 0.02 * 0.02;
    let placed = Placed {
        motion: crate::inspect::align::Motion::none(crate::geometry::Vector::default()),
        covariance,
        radius: 50.0,
        left_out: [false; 6],
        points: 100,
        outliers: 0.0,
        reach: 0.0,
        reach_sigma: 0.0,
    };
    let moved = |kind: &dyn Kind| {
        let found = find_in(kind, [&cells, &cells], (0.0, 0.0), Some(&placed));
        sigma(found.unwrap())
    };
    close(moved(&MeanHeight {}), 0.02);
    let from = "itself".into();
    close(moved(&Step { from }), 0.0);
    assert_eq!(placed.component(2), Some((0.0, 0.02)));
    close(placed.component(3).unwrap().1, 0.0);
}

#[test]
fn a_region_with_too_many_cells_is_refused_and_others_hold_every_pixel() {
    let side = 300.0;
    let corners = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)];
    let region = crate::inspect::region::Region::polygon(&corners, 300, 300).unwrap();
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

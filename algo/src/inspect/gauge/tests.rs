//! Every gauge on made cells, with exact answers.

use super::FoundValue;
use super::kinds::*;
use super::*;
use crate::geometry::Vector;
use crate::inspect::align::{Motion, Placed};
use crate::inspect::feature::{
    Cell, FeatureKind, FittedPlane, Geometry, Grid, Middle, Sum, TaughtCell, TooFine, cells,
};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

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
            ray: [0.0; 2],
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

fn sigma(found: FoundValue) -> f64 {
    libm::sqrt(found.pixels + found.motion)
}

/// What a kind finds in the cells of two regions, with errors per cell and per pixel.
fn find_in(
    kind: &dyn Kind,
    regions: [&[Cell]; 2],
    (sigma, pixel): (f64, f64),
    placed: Option<&Placed>,
) -> Option<FoundValue> {
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

fn find(kind: &dyn Kind, cells: &[Cell], sigma: f64) -> Option<FoundValue> {
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
    let step = find_in(&Step {}, [&high, &low], (0.0, 0.1), None).unwrap();
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
    let placed = lying(covariance);
    let moved = |kind: &dyn Kind| {
        let found = find_in(kind, [&cells, &cells], (0.0, 0.0), Some(&placed));
        sigma(found.unwrap())
    };
    close(moved(&MeanHeight {}), 0.02);
    close(moved(&Step {}), 0.0);
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

/// A plane of 9 × 9 cells about (x, y) with these slopes, measured with this error of a pixel; and
/// what its cells add to its parameters.
fn plane((x, y): (f64, f64), slopes: [f64; 2], pixel: f64) -> (FittedPlane, Vec<[f64; 3]>) {
    let (sums, mut taught) = grid(9, |_, _| 0.0);
    for cell in &mut taught {
        (cell.x, cell.y) = (cell.x + x, cell.y + y);
        cell.height = 5.0 + slopes[0] * cell.x + slopes[1] * cell.y;
        cell.ray = [0.364, 0.001 * cell.y];
    }
    let (cells, mut rows) = (seen(&sums, &taught, None), Vec::new());
    let middle = Middle::of(&taught);
    let plane = FittedPlane::of(&cells, middle, pixel * pixel, &mut rows);
    (plane.unwrap(), rows)
}

/// A part whose motion has this covariance.
fn lying(covariance: [[f64; 6]; 6]) -> Placed {
    Placed::lying(Vector::new(1.0, -2.0, 4.0), covariance)
}

/// Planes as values depend on them.
fn sensitive<'a>(both: &'a [(FittedPlane, Vec<[f64; 3]>)]) -> Vec<Sensitive<'a>> {
    let planes = both.iter().enumerate();
    planes
        .map(|(id, (plane, rows))| Sensitive::Plane(SensitivePlane { id, plane, rows }))
        .collect()
}

/// The value of a kind with its errors.
fn propagate(kind: &dyn Kind, of: &[Sensitive<'_>], placed: Option<&Placed>) -> Option<FoundValue> {
    let value = Characteristic {
        kind,
        of,
        datum: &[],
        taught: [&[]; 2],
    };
    Some(value.propagate(placed, 0.0)?.found)
}

/// A lower triangle L with L Lᵀ = C.
fn root<const N: usize>(c: &[[f64; N]; N]) -> [[f64; N]; N] {
    let mut l = [[0.0; N]; N];
    for i in 0..N {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            l[i][j] = match i == j {
                true => (c[i][i] - sum).max(0.0).sqrt(),
                false => (c[i][j] - sum) / l[j][j],
            };
        }
    }
    l
}

/// Normal numbers with a covariance of which this is the root.
fn draw<const N: usize>(root: &[[f64; N]; N], random: &mut SplitMix64) -> [f64; N] {
    let mut share = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let own: [f64; N] = core::array::from_fn(|_| {
        let (length, angle) = ((-2.0 * (1.0 - share()).ln()).sqrt(), share());
        length * (core::f64::consts::TAU * angle).cos()
    });
    core::array::from_fn(|i| (0..=i).map(|j| root[i][j] * own[j]).sum())
}

#[test]
fn errors_of_geometric_kinds_are_the_scatter_of_random_draws() {
    const DRAWS: usize = 20_000;
    const KINK: f64 = 10.0;
    const WITHIN: f64 = 0.02;
    // Shifts of some µm and turns by as much at the radius, correlated.
    let covariance: [[f64; 6]; 6] = core::array::from_fn(|i| {
        core::array::from_fn(|j| if i == j { 9e-6 } else { 3e-6 } * (1.0 + 0.2 * (i * j) as f64))
    });
    let placed = lying(covariance);
    let mut random = SplitMix64::seed_from_u64(3);
    let mut compared = 0;
    for (one, other) in [
        ([0.0, 0.0], [0.0, 0.0]),
        ([0.0, 0.0], [0.08, 0.02]),
        ([0.4, 0.1], [-0.4, 0.0]),
        ([1.0, 0.0], [-1.0, 0.3]),
        ([0.0, 0.0], [-5.0, 0.0]),
    ] {
        let both = [
            plane((-20.0, 3.0), one, 0.03),
            plane((15.0, -8.0), other, 0.05),
        ];
        let of = sensitive(&both);
        let roots = both.each_ref().map(|(plane, _)| root(&plane.covariance));
        let moving = root(&placed.covariance);
        for measure in Measure::examples() {
            let Facts {
                basis,
                takes,
                never_negative,
                ..
            } = measure.facts();
            if basis != Basis::Geometry {
                continue;
            }
            let count = takes.len();
            // Contours are not planes.
            if !takes
                .iter()
                .all(|kinds| kinds.contains(&FeatureKind::Plane))
            {
                continue;
            }
            let found = propagate(measure.kind(), &of[..count], Some(&placed)).unwrap();
            if never_negative && found.value < KINK * sigma(found) {
                continue;
            }
            let (mut sum, mut squares) = (0.0, 0.0);
            for _ in 0..DRAWS {
                let [x, y, z, about_x, about_y, about_z] = draw(&moving, &mut random);
                let turn = Vector::new(about_x, about_y, about_z) * (1.0 / placed.radius);
                let motion = Motion::new(placed.motion.centre, Vector::new(x, y, z), turn);
                let drawn: Vec<Geometry> = (0..count)
                    .map(|at| {
                        let mut plane = both[at].0;
                        let noise = draw(&roots[at], &mut random);
                        plane.parameters = core::array::from_fn(|i| plane.parameters[i] + noise[i]);
                        plane.geometry(plane.moved(&motion))
                    })
                    .collect();
                let off = measure.kind().value(&drawn).unwrap() - found.value;
                (sum, squares) = (sum + off, squares + off * off);
            }
            let mean = sum / DRAWS as f64;
            let scatter = (squares / DRAWS as f64 - mean * mean).sqrt();
            let ratio = sigma(found) / scatter;
            assert!(
                (ratio - 1.0).abs() < WITHIN,
                "{measure:?} of {one:?} {other:?}: {ratio}"
            );
            compared += 1;
        }
    }
    // z of all five; distance and angle of all but the first, which are 0.
    assert_eq!(compared, 13);
}

#[test]
fn the_motion_cancels_in_the_distance_and_the_angle_of_planes_and_not_in_z() {
    let mut covariance = [[0.0; 6]; 6];
    for (at, row) in covariance.iter_mut().enumerate() {
        row[at] = 0.02 * 0.02;
    }
    let placed = lying(covariance);
    let motion = |kind: &dyn Kind, other: [f64; 2]| {
        let both = [
            plane((-20.0, 3.0), [0.3, 0.1], 0.0),
            plane((15.0, -8.0), other, 0.0),
        ];
        let of = sensitive(&both);
        let count = kind.facts().takes.len();
        sigma(propagate(kind, &of[..count], Some(&placed)).unwrap())
    };
    // Parallel planes, and any angle.
    assert!(motion(&Distance {}, [0.3, 0.1]) < 1e-7);
    assert!(motion(&Angle {}, [-0.9, 0.4]) < 1e-7);
    // The middle of an inclined plane's region stays in the frame as taught: displaced by a along
    // y, it lies on another place of the part.
    assert!(motion(&Distance {}, [0.3, 0.9]) > 0.01);
    assert!(motion(&Z {}, [0.3, 0.1]) > 0.02);
}

#[test]
fn distances_and_angles_of_planes_are_those_of_a_drawing() {
    let value = |kind: &dyn Kind, one, other| {
        let both = [
            plane((-20.0, 0.0), one, 0.03),
            plane((15.0, 0.0), other, 0.03),
        ];
        let of = sensitive(&both);
        propagate(kind, &of[..kind.facts().takes.len()], None).unwrap()
    };
    let slope = |degrees: f64| libm::tan(degrees.to_radians());
    close(value(&Z {}, [0.1, 0.0], [0.0, 0.0]).value, 5.0 - 2.0);
    // Bent by 5°, 45° and 90° towards the camera.
    for bend in [0.0, 5.0, 45.0, 90.0] {
        let (one, other) = (slope(bend / 2.0), -slope(bend / 2.0));
        close(value(&Angle {}, [one, 0.0], [other, 0.0]).value, bend);
        // Both planes are at 5 mm where x is 0.
        let distance = 15.0 * 2.0 * slope(bend / 2.0) / libm::hypot(1.0, one);
        close(
            value(&Distance {}, [one, 0.0], [other, 0.0]).value,
            distance,
        );
    }
    // Parallel planes have an error although the angle has its kink there.
    let parallel = value(&Angle {}, [0.1, 0.0], [0.1, 0.0]);
    assert!(
        parallel.pixels > 0.0 && parallel.value < 1e-6,
        "{parallel:?}"
    );
    // An error of all heights moves a level plane by as much; its distance from the middle of
    // another region, beside it, by more.
    let lever = |kind: &dyn Kind| value(kind, [0.0, 0.0], [0.0, 0.0]).lever;
    assert!((lever(&Z {}) - 1.0).abs() < 0.1 && lever(&Distance {}) > 2.0);
}

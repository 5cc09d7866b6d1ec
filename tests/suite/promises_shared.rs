//! What a measurement promises, tested on the shared recordings beside the project.

use crate::measured::{BOARD, CONE, Measured, SKULL, SPHERE, SPLINE, shared_recording};
use algo::phase::Trust;
use tests::oracle::{Device, device::Point};
use tests::plane::Plane;
use tests::score::{rms, score};
use tests::{files, shared};

#[test]
fn the_skull_agrees_with_its_gray_code() {
    let Some(measured) = shared_recording(SKULL) else {
        return;
    };
    let folder = shared::folder(SKULL).unwrap();
    let gray = files::picture(&folder.join("truth/gray_column.png"));
    let phases = &measured.result.phases[0];
    // 16 fringes over 1824 columns; a wrong order is more than half of 114 columns off.
    let columns = 1824.0 / 16.0;
    let (mut known, mut near, mut wrong) = (0_usize, 0_usize, 0_usize);
    for (pixel, &column) in gray.samples.iter().enumerate() {
        if column == u16::MAX || phases.trust[pixel] != Trust::Resolved {
            continue;
        }
        let off = (phases.phase[pixel].turns() * columns - f64::from(column)).abs();
        known += 1;
        near += usize::from(off <= 3.0);
        wrong += usize::from(off > 57.0);
    }
    let share = |count: usize| count as f64 / known as f64;
    println!(
        "skull: {known} px, {:.5} near, {:.5} wrong",
        share(near),
        share(wrong)
    );
    assert!(known >= 330_000, "{known}");
    assert!(share(near) >= 0.975, "{}", share(near));
    assert!(share(wrong) <= 0.003, "{}", share(wrong));
}

#[test]
fn the_board_is_flat_and_its_corners_are_ten_millimetres_apart() {
    let Some(measured) = shared_recording(BOARD) else {
        return;
    };
    let board = Board::new(measured);
    let corner = |row: usize, column: usize| board.corners[COLUMNS * row + column];
    let outline = [(0, 0), (0, 8), (12, 8), (12, 0)].map(|(row, column)| corner(row, column));
    let area = board.points(|u, v| inside(&outline, u, v));
    let plane = Plane::fit(&area).unwrap();
    let off: Vec<f64> = area.iter().map(|point| plane.distance(*point)).collect();
    println!(
        "board: plane RMS {:.4} mm over {} px",
        rms(&off),
        area.len()
    );
    // Everything inside the outline except the edges between black and white.
    assert!(area.len() > 400_000, "{}", area.len());
    assert!(rms(&off) <= 0.205, "{}", rms(&off));

    let across = mean_step(&board, |row, column| (row, column + 1));
    let down = mean_step(&board, |row, column| (row + 1, column));
    println!("board: corners {across:.4} and {down:.4} mm apart");
    for step in [across, down] {
        assert!((step - 10.0).abs() <= 0.1, "{step}");
    }
}

/// Inner corners of the board.
const ROWS: usize = 13;
const COLUMNS: usize = 9;
/// A third of a square of the board, pixels.
const REACH: usize = 20;

/// Mean distance from each corner to its neighbour in one direction.
fn mean_step(board: &Board<'_>, next: impl Fn(usize, usize) -> (usize, usize)) -> f64 {
    let mut steps = Vec::new();
    for row in 0..ROWS {
        for column in 0..COLUMNS {
            let (next_row, next_column) = next(row, column);
            if next_row < ROWS && next_column < COLUMNS {
                let a = board.surface_at(board.corners[COLUMNS * row + column]);
                let b = board.surface_at(board.corners[COLUMNS * next_row + next_column]);
                let square: f64 = (0..3).map(|i| (a[i] - b[i]).powi(2)).sum();
                steps.push(square.sqrt());
            }
        }
    }
    steps.iter().sum::<f64>() / steps.len() as f64
}

/// The measured checkerboard with its 13 × 9 inner corners, row by row.
struct Board<'a> {
    heights: Vec<f32>,
    camera: Device,
    corners: Vec<(f64, f64)>,
    measured: &'a Measured,
}

impl<'a> Board<'a> {
    fn new(measured: &'a Measured) -> Self {
        let folder = shared::folder(BOARD).unwrap();
        let csv = std::fs::read_to_string(folder.join("truth/corners.csv")).unwrap();
        let corners: Vec<(f64, f64)> = csv
            .lines()
            .skip(1)
            .map(|line| {
                let numbers: Vec<f64> = line.split(',').map(|n| n.parse().unwrap()).collect();
                (numbers[2], numbers[3])
            })
            .collect();
        assert_eq!(corners.len(), ROWS * COLUMNS);
        Self {
            heights: measured.heights(),
            camera: Device::new(measured.recording.camera_model.as_ref().unwrap()),
            corners,
            measured,
        }
    }

    /// The resolved points whose pixel satisfies `wanted`.
    fn points(&self, wanted: impl Fn(f64, f64) -> bool) -> Vec<Point> {
        let width = self.measured.recording.width as usize;
        let mut points = Vec::new();
        for (pixel, z) in self.heights.iter().enumerate() {
            let (u, v) = ((pixel % width) as f64, (pixel / width) as f64);
            if !z.is_nan() && wanted(u, v) {
                points.push(self.camera.point_at(u, v, f64::from(*z)));
            }
        }
        points
    }

    /// The surface at a corner between pixels: where its ray meets the plane through the resolved
    /// points around it, up to a third of a square away (the black squares have few).
    fn surface_at(&self, (u, v): (f64, f64)) -> Point {
        let width = self.measured.recording.width as usize;
        let mut near = Vec::new();
        for row in v as usize - REACH..=v as usize + REACH {
            for column in u as usize - REACH..=u as usize + REACH {
                let z = self.heights[row * width + column];
                if !z.is_nan() {
                    let (u, v) = (column as f64, row as f64);
                    near.push(self.camera.point_at(u, v, f64::from(z)));
                }
            }
        }
        let plane = Plane::fit(&near).expect("a corner with measured pixels around it");
        let mut z = 0.0;
        for _ in 0..50 {
            let [x, y, _] = self.camera.point_at(u, v, z);
            z = plane.at(x, y);
        }
        self.camera.point_at(u, v, z)
    }
}

/// Whether a point lies inside a convex outline.
fn inside(outline: &[(f64, f64); 4], u: f64, v: f64) -> bool {
    let side = |i: usize| {
        let (a, b) = (outline[i], outline[(i + 1) % 4]);
        (b.0 - a.0) * (v - a.1) - (b.1 - a.1) * (u - a.0)
    };
    let sides = [0, 1, 2, 3].map(side);
    sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0)
}

/// Compares with the score of an independent f64 decoder under the same rules, with a margin.
fn check_score(name: &str, rms_mm: f64, gross: usize, scored: usize) {
    let Some(measured) = shared_recording(name) else {
        return;
    };
    let truth = measured.recording.truth_height.as_deref().unwrap();
    let class = measured.recording.truth_class.as_deref().unwrap();
    let found = score(&measured.heights(), truth, class);
    println!("{name}: {found:?}");
    assert!(found.rms_mm <= rms_mm, "{found:?}");
    assert!(found.gross <= gross, "{found:?}");
    assert!(found.scored >= scored, "{found:?}");
    let theirs = measured.result.report.score.as_ref().unwrap();
    assert_eq!((found.scored, found.gross), (theirs.scored, theirs.gross));
}

#[test]
fn the_sphere_is_as_accurate_as_an_independent_decode() {
    check_score(SPHERE, 0.083, 0, 47_400);
}

#[test]
fn the_adaptive_cone_is_as_accurate_as_an_independent_decode() {
    check_score(CONE, 0.083, 4, 57_800);
}

#[test]
fn the_dense_spline_is_as_accurate_as_an_independent_decode() {
    check_score(SPLINE, 0.031, 0, 53_800);
}

#[test]
fn the_studys_errors_are_what_sigma_predicts() {
    for name in [SPHERE, CONE, SPLINE] {
        let Some(measured) = shared_recording(name) else {
            return;
        };
        let truth = measured.recording.truth_height.as_deref().unwrap();
        let class = measured.recording.truth_class.as_deref().unwrap();
        let sigma = &measured.result.heights.as_ref().unwrap().map.sigma;
        let heights = measured.heights();
        let errors: Vec<f64> = (0..heights.len())
            .filter(|&at| class[at] == 2 && !heights[at].is_nan())
            .filter(|&at| (heights[at] - truth[at]).abs() <= 1.0)
            .map(|at| f64::from((heights[at] - truth[at]) / sigma[at]))
            .collect();
        println!("{name}: error / sigma {:.3}", rms(&errors));
        // The study has 1.00–1.05 at 512 px; with 256 px curvature inside a pixel adds a little.
        assert!(
            (0.9..=1.2).contains(&rms(&errors)),
            "{name}: {}",
            rms(&errors)
        );
    }
}

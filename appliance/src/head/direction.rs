//! Which fringes tell heights best. Along a camera's ray the projector point moves on an epipolar
//! line: fringes that run along it hardly change their phase with the height.

use algo::geometry::Triangulator;
use algo::units::Height;
use hal::replay::recording::PatternSpec;

/// Places along each side of the frame that are looked at.
const GRID: usize = 16;
/// Rise over which slopes are taken, mm.
const RISE_MM: f64 = 0.5;
/// Fringes that use less than this share of their frequency are poor: heights are five times as
/// noisy as by fringes across.
const LEAST_SHARE: f64 = 0.2;

/// What fringes tell of heights near z = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensitivity {
    /// Median of |∂Φ/∂z| over the lit part of the frame, turns per mm.
    pub turns_per_mm: f64,
    /// Median of the sine of the angle between fringes and epipolar lines.
    share: f64,
}

impl Sensitivity {
    /// What a phase function tells of heights with a rig; `None` if the projector lights nothing of
    /// z = 0 that the camera sees.
    pub fn of(triangulator: &Triangulator) -> Option<Self> {
        let (camera, function) = (triangulator.camera(), triangulator.function());
        let inside = |at: f64, size: usize| (0.0..size as f64).contains(&at);
        let place = |at: usize, size: usize| (2 * at + 1) * size / (2 * GRID);
        let each = (0..GRID * GRID).filter_map(|at| {
            let (u, v) = (
                place(at % GRID, camera.width()),
                place(at / GRID, camera.height()),
            );
            let lit_by = |z: f64| {
                let point = triangulator.point(u, v, Height::from_mm(z))?;
                triangulator.projector_point(point)
            };
            let ((xi, eta), (next_xi, next_eta)) = (lit_by(0.0)?, lit_by(RISE_MM)?);
            if !(inside(xi, function.columns()) && inside(eta, function.rows())) {
                return None;
            }
            let turns = (function.at(next_xi, next_eta) - function.at(xi, eta)).abs();
            let slope =
                |(a, b): (f64, f64)| function.at(xi + a, eta + b) - function.at(xi - a, eta - b);
            let frequency = slope((0.5, 0.0)).hypot(slope((0.0, 0.5)));
            let way = (next_xi - xi).hypot(next_eta - eta);
            Some((turns / RISE_MM, turns / (frequency * way)))
        });
        let (mut slopes, mut shares): (Vec<f64>, Vec<f64>) = each.unzip();
        Some(Self {
            turns_per_mm: median(&mut slopes)?,
            share: median(&mut shares)?,
        })
    }

    /// A note that these fringes tell little of heights, if they do.
    pub fn poor(&self) -> Option<String> {
        (self.share < LEAST_SHARE).then(|| {
            format!(
                "the fringes run along the epipolar lines, within {:.0}°, and heights scatter {:.0} times as much as by fringes across them",
                self.share.min(1.0).asin().to_degrees().ceil(),
                1.0 / self.share.max(1e-3)
            )
        })
    }
}

/// The word for the fringes of a pattern.
pub fn word(pattern: &PatternSpec) -> &'static str {
    match pattern {
        PatternSpec::Vertical { .. } => "vertical",
        PatternSpec::Horizontal { .. } => "horizontal",
        PatternSpec::File { .. } => "file",
    }
}

fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

//! The light of the pixels about a contour: what the caller knows of camera, plane and levels, and
//! what a pixel tells, demodulated by the phase that the plane has there.
//!
//! # Idea
//! w = Z e^{−2πi r Φ̂}: light from the plane is real and positive, light from elsewhere has another
//! phase, and light that is not projected has no Z. Material is in phase in every level, so levels
//! are added once per pixel, with weights N r over their sum: N is for the noise, r for coarse
//! fringes, in which a floor hardly differs from the sheet.

use crate::geometry::Vector;
use crate::math::complex::Complex;
use alloc::vec::Vec;

/// What a pixel's line of sight meets on the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneSpot {
    /// Coordinate in the plane's frame, mm.
    pub x: f64,
    /// The other one, mm.
    pub y: f64,
    /// Φ̂: the phase that the plane has there, of a level of ratio 1, turns.
    pub phase: f64,
}

/// A camera that looks at a plane. The plane's frame is right-handed and its z axis points to the
/// side that the camera is on.
pub trait PlaneView {
    /// Columns and rows of the frame.
    fn size(&self) -> (usize, usize);

    /// What the line of sight through (u, v) meets, between pixels too; `None` if it does not meet
    /// the plane, or nothing is projected there.
    fn spot(&self, u: f64, v: f64) -> Option<PlaneSpot>;

    /// What the lines of sight of a row meet, each asked for by its column: [`Self::spot`], where a
    /// view knows more of a row than of a place.
    fn row(&self, v: f64) -> impl Fn(f64) -> Option<PlaneSpot> {
        move |u| self.spot(u, v)
    }

    /// Where the camera sees a point of the plane.
    fn pixel(&self, x: f64, y: f64) -> Option<(f64, f64)>;

    /// Z = (2/N) Σ I_k (sin 2πs_k + i cos 2πs_k) = B e^{2πiφ} of a level at the pixels of a row that
    /// begin with `at`, in counts; [`Complex::UNKNOWN`] where a sample is overexposed.
    fn signals(&self, at: (usize, usize), level: usize, row: &mut [Complex]);

    /// The same of one pixel; `None` where a sample is overexposed.
    fn signal(&self, at: (usize, usize), level: usize) -> Option<Complex> {
        let mut signal = Complex::default();
        self.signals(at, level, core::slice::from_mut(&mut signal));
        signal.known()
    }
}

/// A level's fringes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fringes {
    /// Its share r of the full phase function.
    pub ratio: f64,
    /// N, the number of its shifts.
    pub shifts: usize,
    /// The modulation that the material beside the contour was taught with, counts.
    pub taught: f64,
}

/// What is known of light, material and camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// The camera's centre in the plane's frame, mm.
    pub camera: Vector,
    /// The projector's centre in the plane's frame, mm.
    pub projector: Vector,
    /// By how much the phase of ratio 1 is larger, on a pixel's line of sight, for every mm below
    /// the plane, turns.
    pub turns_per_mm: f64,
    /// The levels, in the order in which [`PlaneView::signal`] has them.
    pub levels: Vec<Fringes>,
    /// σ of one sample, counts.
    pub noise: f64,
    /// The least modulation that is trusted, counts.
    pub least: f64,
    /// Thickness of the sheet, mm; `None` if it is not known. 0: no wall is seen.
    pub thickness: Option<f64>,
    /// How far below the plane a floor lies that may be lit, mm; `None` if it is not known.
    pub floor: Option<f64>,
    /// How far below the plane a floor of unknown depth may lie, mm.
    pub deepest: f64,
    /// How far from its expected place the contour may lie, mm.
    pub reach: f64,
}

impl Fringes {
    /// Variance of each part of Z, counts².
    pub fn variance(&self, noise: f64) -> f64 {
        noise * noise * 2.0 / self.shifts as f64
    }
}

/// A view with what is known of its light.
#[derive(Clone, Debug)]
pub struct Signals<'a, V> {
    /// The camera.
    pub view: &'a V,
    /// Light, material and camera.
    pub setup: &'a Setup,
    /// The weight of each level, 1 together.
    weights: Vec<f64>,
    /// The levels' mean ratio.
    pub ratio: f64,
    /// ⟨r³⟩ / (⟨r²⟩ ⟨r⟩): how fast light turns with the phase whose levels are weighed by their
    /// ratios, over light that turns by the mean ratio.
    pub leading: f64,
    /// Variance of each part of the sum of levels, counts².
    pub variance: f64,
}

impl<'a, V: PlaneView> Signals<'a, V> {
    /// Of this view.
    pub fn new(view: &'a V, setup: &'a Setup) -> Self {
        let weight = |of: &Fringes| of.shifts as f64 * of.ratio;
        let whole: f64 = setup.levels.iter().map(weight).sum();
        let weights: Vec<f64> = setup.levels.iter().map(|of| weight(of) / whole).collect();
        let mut signals = Self {
            view,
            setup,
            weights,
            ratio: 0.0,
            leading: 1.0,
            variance: 0.0,
        };
        signals.variance = signals.mean(|of| weight(of) / whole * of.variance(setup.noise));
        signals.ratio = signals.mean(|of| of.ratio);
        let squares = signals.mean(|of| of.ratio * of.ratio);
        let cubes = signals.mean(|of| of.ratio * of.ratio * of.ratio);
        signals.leading = cubes / (squares * signals.ratio);
        signals
    }

    /// The weighted mean of something of levels.
    pub fn mean(&self, of: impl Fn(&Fringes) -> f64) -> f64 {
        let levels = self.weights.iter().zip(&self.setup.levels);
        levels.map(|(weight, level)| weight * of(level)).sum()
    }

    /// The weighted mean of what levels of these ratios have, each times a factor of its own.
    pub fn sum(&self, factors: &[f64], of: impl Fn(f64) -> Complex) -> Complex {
        let levels = self.weights.iter().zip(&self.setup.levels).zip(factors);
        levels.fold(Complex::default(), |sum, ((weight, level), factor)| {
            sum + of(level.ratio) * (weight * factor)
        })
    }

    /// Reads `count` pixels of a row from `at` on: Z of the first level, then of the next, and so on.
    pub fn read(&self, at: (usize, usize), count: usize, row: &mut Vec<Complex>) {
        row.resize(count * self.weights.len(), Complex::default());
        for (level, row) in row.chunks_exact_mut(count.max(1)).enumerate() {
            self.view.signals(at, level, row);
        }
    }

    /// The sum of levels of a pixel that looks at this spot, and the same with each times its share
    /// of the mean ratio, from Z of each level; `None` if one is overexposed.
    pub fn light(
        &self,
        levels: impl Iterator<Item = Complex>,
        spot: &PlaneSpot,
    ) -> Option<[Complex; 2]> {
        let mut sums = [Complex::default(); 2];
        for ((of, weight), signal) in self.setup.levels.iter().zip(&self.weights).zip(levels) {
            let light = signal * back(of, spot) * *weight;
            sums[0] += light;
            sums[1] += light * (of.ratio / self.ratio);
        }
        sums[0].known().map(|_| sums)
    }

    /// The same of a pixel.
    pub fn light_at(&self, at: (usize, usize), spot: &PlaneSpot) -> Option<[Complex; 2]> {
        let signal = |level| self.view.signal(at, level).unwrap_or(Complex::UNKNOWN);
        self.light((0..self.weights.len()).map(signal), spot)
    }

    /// w of one level of such a pixel.
    pub fn level(&self, at: (usize, usize), spot: &PlaneSpot, level: usize) -> Option<Complex> {
        Some(self.view.signal(at, level)? * back(&self.setup.levels[level], spot))
    }
}

/// e^{−2πi r Φ̂}.
fn back(of: &Fringes, spot: &PlaneSpot) -> Complex {
    Complex::turned(-of.ratio * spot.phase)
}

//! What contours need of the caller: how the camera sees a plane, and what the plane's light is.

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

//! What a line of light that is narrower than a pixel does to heights: by how much a good part
//! deviates that lies elsewhere than golden, because light moves over its surface.
//!
//! # Idea
//! A pixel measures the mean phase of what it sees, weighted by light. Where a rounded edge mirrors
//! the projector, a line far brighter than the rest lies anywhere in the pixel, and the pixel has the
//! phase of that place. Golden has this error, and a part another one, where the line lies then.
//! Where it lies is not known, so the largest error is worked out.
//!
//! # Equations
//! With modulations B of the pixel and B₂ of the brighter one of those two pixels before and behind
//! it, the line has the share f = 1 − B₂/B of the light. It lies up to half a pixel off the middle of
//! a pixel, and less on average over a square that it crosses at an angle: d = 0.4 px. With the
//! phases Φ of the neighbours, each at its own height,
//!
//! ```text
//! E = f d · |Φ₊₁ − Φ₋₁|/2 / |∂Φ/∂z|
//! ```
//!
//! along rows or columns, whichever is larger. The mean over the square about a pixel has Σ E over the
//! number of its compared pixels.
//!
//! # Shapes and units
//! Row-major maps over the camera's frame, mm.
//!
//! # Accuracy
//! Of displaced handsets of rolled and oiled steel, whose rounded edges shine, none deviates by more
//! than teaching says with √2 E (`tests/suite/promised.rs`).

use super::table::IntegralTable;
use super::weight::Weight;
use crate::geometry::Triangulator;
use crate::pipeline::KnownSurface;
use crate::units::Modulation;
use alloc::vec;

/// Lines with a smaller share of the light are those of noise and of the surface's own colours.
const LEAST_SHARE: f64 = 0.3;
/// d, px.
const OFF_PX: f64 = 0.4;
/// Half the step in height over which the phase's slope is worked out, mm.
const STEP_MM: f64 = 0.05;

/// What highlights do to golden.
#[derive(Clone, Debug)]
pub struct Highlights {
    /// Of the pixels: how many are compared, and E.
    sums: IntegralTable<2>,
}

impl Highlights {
    /// Of a surface where it is compared, by its modulation, the largest where it is too bright
    /// to be known; `None` where there is no highlight. `shares` of a height difference lie along
    /// the normal.
    pub fn new(
        (triangulator, surface): (&Triangulator, &KnownSurface),
        light: impl Fn(usize) -> Modulation,
        shares: &[f32],
        weights: &[Weight],
    ) -> Option<Self> {
        let (width, pixels) = (surface.width, weights.len());
        let of = |place: usize, stride: usize| -> Option<f64> {
            let bits = |at: Option<usize>| Some(light(at.filter(|&at| at < pixels)?).to_bits());
            let two = [place.checked_sub(2 * stride), Some(place + 2 * stride)];
            let (before, behind) = (bits(two[0])?, bits(two[1])?);
            let own = bits(Some(place))?;
            let share = 1.0 - f64::from(before.max(behind)) / f64::from(own.max(1));
            // Beside what is not seen is no line, but the part's end.
            if share < LEAST_SHARE || before.min(behind) == 0 {
                return None;
            }
            let mm = |at: usize| surface.height.get(at).filter(|mm| mm.is_known());
            let near = [place - stride, place + stride].map(mm);
            let height = mm(place).or(near[0]).or(near[1])?.mm();
            let sight = |at: usize| triangulator.sight((at % width) as f64, (at / width) as f64);
            let phase = |at: usize, mm: f64| sight(at)?.phase(mm);
            let height_at = |of: Option<&crate::units::Height>| of.map_or(height, |of| of.mm());
            let along = phase(place + stride, height_at(near[1]))?
                - phase(place - stride, height_at(near[0]))?;
            let rise = phase(place, height + STEP_MM)? - phase(place, height - STEP_MM)?;
            let error = share * OFF_PX * libm::fabs(along / 2.0 / (rise / (2.0 * STEP_MM)));
            error
                .is_finite()
                .then(|| error * f64::from(shares[place]).min(1.0))
        };
        let mut errors = vec![0.0_f32; pixels];
        for (place, error) in errors.iter_mut().enumerate() {
            let either = [1, width].map(|stride| of(place, stride).unwrap_or(0.0));
            *error = either[0].max(either[1]) as f32;
        }
        let sums = IntegralTable::new(width, pixels, |place| {
            let compared = f64::from(u8::from(weights[place].compared()));
            Some([compared, f64::from(errors[place])])
        });
        errors
            .iter()
            .any(|error| *error > 0.0)
            .then_some(Self { sums })
    }

    /// The mean over the square of `side` pixels about a pixel, mm; 0 where less than half of it is
    /// compared.
    pub fn at(&self, place: usize, side: usize) -> f64 {
        self.sums.means(place, side).map_or(0.0, |[_, error]| error)
    }
}

//! The pixels about an expected contour, demodulated by the phase that the plane has at each.
//!
//! w = Z e^{−2πi r Φ̂}: light from the plane is real and positive, light from elsewhere has another
//! phase, and light that is not projected has no Z.

use super::complex::Complex;
use super::shape::Shape;
use super::view::{Setup, View};
use alloc::vec::Vec;

/// Pixels of a side of the blocks that are looked at first.
const BLOCK: usize = 8;

/// A pixel whose signal is known.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Where it looks on the plane, x in mm.
    pub x: f64,
    /// y in mm.
    pub y: f64,
}

/// Pixels about a contour.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    /// In rows of blocks, from the top left.
    pub all: Vec<Sample>,
    /// w of every level of every pixel.
    light: Vec<Complex>,
    levels: usize,
}

impl Samples {
    /// The pixels that look at places within `reach` mm of a contour.
    pub fn about<const N: usize>(
        (shape, p): (&impl Shape<N>, &[f64; N]),
        view: &impl View,
        setup: &Setup,
        reach: f64,
    ) -> Self {
        let mut samples = Self {
            levels: setup.levels.len(),
            ..Self::default()
        };
        let Some((columns, rows)) = bounds((shape, p), view, reach) else {
            return samples;
        };
        for top in rows.clone().step_by(BLOCK) {
            for left in columns.clone().step_by(BLOCK) {
                let (u, v) = (left as f64, top as f64);
                let half = BLOCK as f64 / 2.0;
                let middle = view.spot(u + half, v + half);
                let near = middle.zip(view.spot(u, v)).is_none_or(|(middle, corner)| {
                    // Half a diagonal, and a margin for perspective.
                    let (x, y) = (middle.x - corner.x, middle.y - corner.y);
                    let away = libm::fabs(shape.distance(p, middle.x, middle.y));
                    away < reach + 1.5 * libm::sqrt(x * x + y * y)
                });
                if near {
                    for v in top..(top + BLOCK).min(rows.end) {
                        for u in left..(left + BLOCK).min(columns.end) {
                            samples.add((shape, p), view, setup, (u, v), reach);
                        }
                    }
                }
            }
        }
        samples
    }

    /// Adds a pixel if it looks near the contour and has a signal.
    fn add<const N: usize>(
        &mut self,
        (shape, p): (&impl Shape<N>, &[f64; N]),
        view: &impl View,
        setup: &Setup,
        (u, v): (usize, usize),
        reach: f64,
    ) {
        let Some(spot) = view.spot(u as f64, v as f64) else {
            return;
        };
        if libm::fabs(shape.distance(p, spot.x, spot.y)) > reach {
            return;
        }
        let known = self.light.len();
        for (level, fringes) in setup.levels.iter().enumerate() {
            let Some(signal) = view.signal(u, v, level) else {
                self.light.truncate(known);
                return;
            };
            let back = Complex::turned(-fringes.ratio * spot.phase);
            self.light.push(signal * back);
        }
        let (x, y) = (spot.x, spot.y);
        self.all.push(Sample { x, y });
    }

    /// w of a level of a pixel.
    pub fn light(&self, sample: usize, level: usize) -> Complex {
        self.light[sample * self.levels + level]
    }
}

/// Columns and rows of the frame about a contour; `None` if none of it is in the frame.
fn bounds<const N: usize>(
    (shape, p): (&impl Shape<N>, &[f64; N]),
    view: &impl View,
    reach: f64,
) -> Option<(core::ops::Range<usize>, core::ops::Range<usize>)> {
    const PLACES: u32 = 64;
    let (width, height) = view.size();
    let mut low = (f64::INFINITY, f64::INFINITY);
    let mut high = (f64::NEG_INFINITY, f64::NEG_INFINITY);
    for at in 0..=PLACES {
        let foot = shape.foot(p, shape.length(p) * f64::from(at) / f64::from(PLACES));
        for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            if let Some((u, v)) = view.pixel(foot.x + x * reach, foot.y + y * reach) {
                low = (low.0.min(u), low.1.min(v));
                high = (high.0.max(u), high.1.max(v));
            }
        }
    }
    // Casts cut off, and keep to the range of their type.
    let range = |low: f64, high: f64, end: usize| {
        let range = low.max(0.0) as usize..((high.max(-1.0) + 1.0) as usize).min(end);
        (low.is_finite() && !range.is_empty()).then_some(range)
    };
    Some((range(low.0, high.0, width)?, range(low.1, high.1, height)?))
}

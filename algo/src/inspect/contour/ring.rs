//! The pixels of the ring about a contour, gathered row by row for its pieces.
//!
//! Rows of the picture cross the ring in runs, which are read at once, each frame's samples in their
//! order in memory. Between runs the distance from the contour tells how far the next one is.

use super::piece::{BAND, MARGIN, Piece, Pieces, Pixel};
use super::sample::Signals;
use super::shape::{Parameters, Shape};
use super::view::{PlaneSpot, PlaneView};
use crate::math::complex::Complex;
use alloc::vec::Vec;
use core::ops::Range;

/// How much larger a pixel may be elsewhere in the ring than at any piece.
const LARGER: f64 = 1.25;

/// Buffers for gathering.
#[derive(Clone, Debug, Default)]
pub struct Ring {
    /// What the pixels of a run look at, and how far from the contour, mm.
    run: Vec<(PlaneSpot, f64)>,
    /// The light of a run.
    light: Vec<Complex>,
    /// Pixels row by row, each with the number of its piece.
    found: Vec<(usize, Pixel)>,
}

impl Ring {
    /// Gathers the pixels within the band of each piece that look at places nearest to it, piece by
    /// piece.
    pub fn gather(
        &mut self,
        (shape, p): (&dyn Shape, &Parameters),
        signals: &Signals<'_, impl PlaneView>,
        Pieces {
            all: pieces,
            pixels,
        }: &mut Pieces,
    ) {
        self.found.clear();
        let (columns, rows) = signals.view.size();
        // The largest pieces' band, mm, and the most that a step of one column moves on the plane.
        let (mut band, mut step) = (0.0_f64, 0.0_f64);
        for piece in pieces.iter().filter(|piece| piece.middle.is_some()) {
            band = band.max((BAND + MARGIN) * piece.scale);
            step = step.max(LARGER * libm::hypot(piece.across.0, piece.along.0));
        }
        let about = |of: fn((f64, f64)) -> f64, end: usize| {
            let middles = pieces.iter().filter_map(|piece| piece.middle);
            let (low, high) = middles.fold((f64::INFINITY, 0.0_f64), |(low, high), middle| {
                (low.min(of(middle)), high.max(of(middle)))
            });
            let reach = LARGER * BAND + 2.0;
            whole((low - reach, high + reach), end)
        };
        let (across, down) = (about(|at| at.0, columns), about(|at| at.1, rows));
        for v in down {
            let spot = signals.view.row(v as f64);
            let mut u = across.start;
            while u < across.end {
                let at = spot(u as f64);
                let d = at.map(|at| shape.distance(p, at.x, at.y));
                let beyond = d.map_or(0.0, |d| libm::fabs(d) - band);
                match at.zip(d) {
                    Some(here) if beyond <= 0.0 => {
                        self.run.push(here);
                        u += 1;
                    }
                    _ => {
                        self.take((shape, p), signals, (u, v), pieces);
                        // Casts cut off, and keep to the range of their type.
                        u = u.saturating_add(((beyond / step) as usize).max(1));
                    }
                }
            }
            self.take((shape, p), signals, (across.end, v), pieces);
        }
        self.sort(pieces, pixels);
    }

    /// Takes the light of the run that ends before a pixel.
    fn take(
        &mut self,
        (shape, p): (&dyn Shape, &Parameters),
        signals: &Signals<'_, impl PlaneView>,
        (end, v): (usize, usize),
        pieces: &[Piece],
    ) {
        let count = self.run.len();
        if count == 0 {
            return;
        }
        let start = end - count;
        signals.read((start, v), count, &mut self.light);
        let length = shape.length(p) / pieces.len() as f64;
        let per_ratio = signals.ratio * signals.leading;
        for (at, (spot, d)) in self.run.drain(..).enumerate() {
            let Some(along) = shape.along(p, spot.x, spot.y) else {
                continue;
            };
            // Casts cut off, and keep to the range of their type.
            let number = ((along / length) as usize).min(pieces.len() - 1);
            let piece = &pieces[number];
            if piece.middle.is_none() || libm::fabs(d) > (BAND + MARGIN) * piece.scale {
                continue;
            }
            let levels = self.light.iter().skip(at).step_by(count).copied();
            let Some([light, rated]) = signals.light(levels, &spot) else {
                continue;
            };
            let t = along - (number as f64 + 0.5) * length;
            let floor = piece.floor.map(|floor| per_ratio * floor.turns(d, t));
            let pixel = Pixel {
                at: (start + at, v),
                spot,
                light,
                rated,
                floor: floor.map_or(Complex::new(1.0, 0.0), Complex::turned),
                d: 0.0,
                border: f64::NEG_INFINITY,
                follow: 1.0,
                gradient: 0.0,
            };
            self.found.push((number, pixel));
        }
    }

    /// Sorts the pixels by their pieces, in each in the order in which they were found.
    fn sort(&self, pieces: &mut [Piece], pixels: &mut Vec<Pixel>) {
        for (number, _) in &self.found {
            pieces[*number].pixels.end += 1;
        }
        let mut end = 0;
        for piece in pieces.iter_mut() {
            let start = end;
            end += piece.pixels.end;
            piece.pixels = start..start;
        }
        pixels.clear();
        pixels.extend(self.found.iter().map(|(_, pixel)| *pixel));
        for (number, pixel) in &self.found {
            let own = &mut pieces[*number].pixels;
            pixels[own.end] = *pixel;
            own.end += 1;
        }
    }
}

/// The whole numbers below `end` within a range.
fn whole((low, high): (f64, f64), end: usize) -> Range<usize> {
    // Casts cut off, and keep to the range of their type.
    let after = |at: f64| (at.max(-1.0) + 1.0) as usize;
    let (low, high) = (after(low), after(high));
    low.min(end)..high.min(end)
}

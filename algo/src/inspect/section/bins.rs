//! The points beyond a stretch as means of narrow bins, and how far they are one surface.
//!
//! A bin has half the width of what a pixel averages, so its mean lies on the surface to a few
//! hundredths of what blur does. Its cost does not depend on how many points fill it.

use super::line::StretchLine;
use super::request::Optics;
use alloc::vec;
use alloc::vec::Vec;

/// Width of a bin, of the blur.
const WIDTH: f64 = 0.5;
/// Least and largest width, mm.
const WIDTHS: [f64; 2] = [0.02, 0.2];
/// Most bins.
const MOST: f64 = 2048.0;
/// Points of one surface are less apart than this, of the blur: three pixels of a sharp camera.
const APART: f64 = 8.0;
/// σ by which a height rises that does not belong to an edge.
const RISE: f64 = 5.0;
/// The same, mm: more than the ripple of fringes.
const RIPPLE: f64 = 0.02;
/// The steepest fall of an edge from bin to bin: 80°.
const STEEPEST: f64 = 5.7;

/// The mean of the points of a bin, in the line's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bin {
    /// Along the line, mm.
    pub x: f64,
    /// Depth below it, mm.
    pub y: f64,
    /// Variance of a height's mean, mm².
    pub variance: f64,
}

/// The points between both stretches, in bins along the section.
#[derive(Clone, Debug)]
pub struct Bins {
    from: f64,
    /// Width of a bin, mm.
    width: f64,
    per_mm: f64,
    /// Σw, Σw (s − from), Σw z of each.
    sums: Vec<[f64; 3]>,
}

impl Bins {
    /// Empty ones between two places of the section, mm.
    pub fn new(from: f64, to: f64, optics: &Optics) -> Self {
        let width = (WIDTH * optics.blur).clamp(WIDTHS[0], WIDTHS[1]);
        // Of a blur that is not a number, too, there are no more than so many.
        let width = width.max((to - from) / MOST);
        // Casts keep to the range of their type.
        let count = ((to - from) / width) as usize + 1;
        Self {
            from,
            width,
            per_mm: 1.0 / width,
            sums: vec![[0.0; 3]; count],
        }
    }

    /// Without their points.
    pub fn clear(&mut self) {
        self.sums.fill([0.0; 3]);
    }

    /// Adds a point at s with its height and weight; one that is not between the places does not
    /// count.
    #[inline]
    pub fn add(&mut self, s: f64, z: f64, weight: f64) {
        let s = s - self.from;
        let Some(sums) = self.sums.get_mut((s * self.per_mm) as usize) else {
            return;
        };
        sums[0] += weight;
        sums[1] += weight * s;
        sums[2] += weight * z;
    }

    /// The means of one side, from its stretch on: `sign` is 1 on the left, −1 on the right, x =
    /// sign · s.
    pub fn side(&self, line: &StretchLine, sign: f64) -> Vec<Bin> {
        let mean = |&[weight, s, z]: &[f64; 3]| {
            let variance = 1.0 / weight;
            let (x, y) = line.own(sign * (self.from + s * variance), z * variance);
            (weight > 0.0).then_some(Bin { x, y, variance })
        };
        let all = self.sums.iter();
        match sign > 0.0 {
            true => all.filter_map(mean).collect(),
            false => all.rev().filter_map(mean).collect(),
        }
    }

    /// How many of the first bins of a side are one surface that falls from the line, whose stretch
    /// ends here along it.
    pub fn connected(&self, bins: &[Bin], from: f64, optics: &Optics) -> usize {
        let apart = APART * (optics.blur).max(self.width);
        let mut last = Bin {
            x: from,
            ..Bin::default()
        };
        let mut deepest = 0.0_f64;
        for (at, bin) in bins.iter().enumerate() {
            let noise = RISE * libm::sqrt(bin.variance + last.variance) + RIPPLE;
            let (far, fall) = (bin.x - last.x, bin.y - last.y);
            let is_edge = far <= apart
                && bin.y >= deepest - noise
                && fall <= STEEPEST * far.max(self.width) + noise;
            if !is_edge {
                return at;
            }
            deepest = deepest.max(bin.y - RISE * libm::sqrt(bin.variance));
            last = *bin;
        }
        bins.len()
    }
}

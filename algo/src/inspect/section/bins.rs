//! The points beyond a stretch as means of narrow bins, and how far they are one surface.
//!
//! A bin has half the width of what a pixel averages, so its mean lies on the surface to a few
//! hundredths of what blur does. Its cost does not depend on how many points fill it.

use super::line::Line;
use super::request::Optics;
use alloc::vec::Vec;

/// Width of a bin, of the blur.
const WIDTH: f64 = 0.5;
/// Least and largest width, mm.
const WIDTHS: [f64; 2] = [0.02, 0.2];
/// Most bins.
const MOST: usize = 2048;
/// Points of one surface are less apart than this, of the blur: three pixels of a sharp camera.
const APART: f64 = 8.0;
/// σ by which a height rises that does not belong to an edge.
const RISE: f64 = 5.0;
/// The same, mm: more than the ripple of fringes.
const RIPPLE: f64 = 0.02;
/// The steepest fall of an edge from bin to bin: 80°.
const STEEPEST: f64 = 5.7;

/// A point beyond a stretch, as seen from its side: x towards the joint.
#[derive(Clone, Copy, Debug)]
pub struct Beyond {
    /// s, mm.
    pub s: f64,
    /// z, mm.
    pub z: f64,
    /// 1 over the variance of z, 1/mm².
    pub weight: f64,
}

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

/// What is binned of a side.
#[derive(Clone, Copy, Debug)]
pub struct Zone<'a> {
    /// The points between both stretches.
    pub points: &'a [Beyond],
    /// 1 on the left, −1 on the right: x = sign · s.
    pub sign: f64,
    /// The side's line.
    pub line: &'a Line,
    /// Where its stretch ends, along the line, mm.
    pub from: f64,
    /// Width of a bin, mm.
    pub width: f64,
}

impl Zone<'_> {
    /// The width of bins.
    pub fn width(optics: &Optics) -> f64 {
        (WIDTH * optics.blur).clamp(WIDTHS[0], WIDTHS[1])
    }

    /// The means of bins, in their order from the stretch, of the points that are kept: by place in
    /// the line's frame and variance. The first that is too far, steep or high for an edge ends
    /// them.
    pub fn bins(&self, keep: impl Fn(f64, f64, f64) -> bool) -> Vec<Bin> {
        let mut bins: Vec<Bin> = Vec::new();
        for point in self.points {
            let (x, y) = self.line.own(self.sign * point.s, point.z);
            let at = (x - self.from) / self.width;
            if !(0.0..MOST as f64).contains(&at) || !keep(x, y, 1.0 / point.weight) {
                continue;
            }
            let at = at as usize;
            if at >= bins.len() {
                bins.resize(at + 1, Bin::default());
            }
            bins[at].x += point.weight * x;
            bins[at].y += point.weight * y;
            bins[at].variance += point.weight;
        }
        bins.retain(|bin| bin.variance > 0.0);
        for bin in &mut bins {
            bin.variance = 1.0 / bin.variance;
            bin.x *= bin.variance;
            bin.y *= bin.variance;
        }
        bins
    }

    /// How many of the first bins are one surface that falls from the line.
    pub fn connected(&self, bins: &[Bin], optics: &Optics) -> usize {
        let apart = APART * (optics.blur).max(self.width);
        let mut last = Bin {
            x: self.from,
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

//! The picture without fringes, the mean of frames, at a fraction of its resolution.
//!
//! Sums of samples are whole numbers below 2²⁴ and so exact; rows are summed in parallel, with the
//! same bits for any number of threads.

use crate::frame::{FrameView, Sample, Samples};
use crate::pipeline::for_each_row;
use crate::simd::{Backend, Lanes, back_end_entry};
use alloc::vec::Vec;

/// A picture at one scale.
#[derive(Clone, Debug, Default)]
pub struct Coarse {
    pub width: usize,
    pub height: usize,
    /// Counts, row-major.
    pub brightness: Vec<f32>,
}

impl Coarse {
    /// Becomes the mean of frames of one size at half their resolution, in counts. There are 64 at
    /// most.
    pub fn become_mean(&mut self, backend: Backend, frames: &[FrameView<'_>]) {
        let size = frames.first().map_or((0, 0), |f| (f.width(), f.height()));
        self.resize(size.0 / 2, size.1 / 2);
        let samples = (4 * frames.len()) as f32;
        for_each_row(&mut self.brightness, self.width, |v, row| {
            row.fill(0.0);
            for frame in frames {
                for v in [2 * v, 2 * v + 1] {
                    match frame.row(v) {
                        Samples::Eight(samples) => add_pairs(backend, samples, row),
                        Samples::Sixteen(samples) => add_pairs(backend, samples, row),
                    }
                }
            }
            for sum in row {
                *sum /= samples;
            }
        });
    }

    /// Becomes another one at half its resolution.
    pub fn become_half(&mut self, of: &Self) {
        self.resize(of.width / 2, of.height / 2);
        for_each_row(&mut self.brightness, self.width, |v, row| {
            let rows = &of.brightness[2 * v * of.width..][..2 * of.width];
            let (upper, lower) = rows.split_at(of.width);
            let (upper, lower) = (upper.as_chunks::<2>().0, lower.as_chunks::<2>().0);
            for ((out, [a, b]), [c, d]) in row.iter_mut().zip(upper).zip(lower) {
                *out = (a + b + c + d) / 4.0;
            }
        });
    }

    fn resize(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.brightness.resize(width * height, 0.0);
    }

    /// Between four pixels; none outside.
    pub fn at(&self, u: f64, v: f64) -> Option<f64> {
        let inside =
            u >= 0.0 && v >= 0.0 && u < self.width as f64 - 1.0 && v < self.height as f64 - 1.0;
        if !inside {
            return None;
        }
        let (left, top) = (u as usize, v as usize);
        let (across, down) = (u - left as f64, v - top as f64);
        let at = top * self.width + left;
        let [a, b, c, d] = [at, at + 1, at + self.width, at + self.width + 1]
            .map(|at| f64::from(self.brightness[at]));
        let (upper, lower) = (a + (b - a) * across, c + (d - c) * across);
        Some(upper + (lower - upper) * down)
    }
}

back_end_entry! {
    /// Adds each two samples to a sum.
    fn add_pairs [T: Sample] = sum_pairs(samples: &[T], sums: &mut [f32])
}

#[inline(always)]
fn sum_pairs<V: Lanes, T: Sample>(_: V, samples: &[T], sums: &mut [f32]) {
    for (sum, [first, second]) in sums.iter_mut().zip(samples.as_chunks::<2>().0) {
        *sum += (first.count() + second.count()) as f32;
    }
}

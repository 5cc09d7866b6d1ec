//! The mean of a pair at a fraction of its resolution.

use crate::frame::{FrameView, Sample, Samples};
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
    /// Becomes the mean of a pair at half its resolution, in counts.
    pub fn become_mean(&mut self, frames: [FrameView<'_>; 2]) {
        self.clear(frames[0].width() / 2, frames[0].height() / 2);
        for (v, row) in self.brightness.chunks_mut(self.width.max(1)).enumerate() {
            for frame in frames {
                for v in [2 * v, 2 * v + 1] {
                    match frame.row(v) {
                        Samples::Eight(samples) => add(samples, row),
                        Samples::Sixteen(samples) => add(samples, row),
                    }
                }
            }
        }
    }

    /// Becomes another one at half its resolution.
    pub fn become_half(&mut self, of: &Self) {
        self.clear(of.width / 2, of.height / 2);
        for (v, row) in self.brightness.chunks_mut(self.width.max(1)).enumerate() {
            let rows = &of.brightness[2 * v * of.width..][..2 * of.width];
            let (upper, lower) = rows.split_at(of.width);
            let (upper, lower) = (upper.as_chunks::<2>().0, lower.as_chunks::<2>().0);
            for ((out, [a, b]), [c, d]) in row.iter_mut().zip(upper).zip(lower) {
                *out = (a + b + c + d) / 4.0;
            }
        }
    }

    fn clear(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.brightness.clear();
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

/// Adds an eighth of each two samples.
fn add<T: Sample>(samples: &[T], row: &mut [f32]) {
    for (sum, pair) in row.iter_mut().zip(samples.chunks_exact(2)) {
        *sum += (pair[0].count() + pair[1].count()) as f32 / 8.0;
    }
}

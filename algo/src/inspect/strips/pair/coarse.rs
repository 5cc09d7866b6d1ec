//! The mean of a pair at a fraction of its resolution.

use crate::frame::{FrameView, Sample, Samples};
use alloc::vec;
use alloc::vec::Vec;

/// A picture at one scale.
#[derive(Clone, Debug, Default)]
pub(super) struct Coarse {
    pub width: usize,
    pub height: usize,
    /// Counts, row-major.
    pub brightness: Vec<f32>,
}

impl Coarse {
    /// The mean of a pair at half its resolution, in counts.
    pub fn of(frames: [FrameView<'_>; 2]) -> Self {
        let (width, height) = (frames[0].width() / 2, frames[0].height() / 2);
        let mut brightness = vec![0.0; width * height];
        for (v, row) in brightness.chunks_mut(width.max(1)).enumerate() {
            for frame in frames {
                for v in [2 * v, 2 * v + 1] {
                    match frame.row(v) {
                        Samples::Eight(samples) => add(samples, row),
                        Samples::Sixteen(samples) => add(samples, row),
                    }
                }
            }
        }
        Self {
            width,
            height,
            brightness,
        }
    }

    /// At half its resolution.
    pub fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let mut brightness = vec![0.0; width * height];
        for (v, row) in brightness.chunks_mut(width.max(1)).enumerate() {
            for (u, out) in row.iter_mut().enumerate() {
                let at = 2 * v * self.width + 2 * u;
                let four = [at, at + 1, at + self.width, at + self.width + 1];
                *out = four.map(|at| self.brightness[at]).iter().sum::<f32>() / 4.0;
            }
        }
        Self {
            width,
            height,
            brightness,
        }
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

//! The offset of a level's frames in single precision: what the scene looks like under even light,
//! with less noise than one frame.

use crate::frame::{FrameView, Samples};
use alloc::vec;
use alloc::vec::Vec;

/// A grey picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Counts, row-major.
    pub counts: Vec<f32>,
}

impl Picture {
    /// The mean of frames of equal size; over all shifts of one or more levels it is their offset
    /// A.
    pub fn mean(frames: &[FrameView<'_>]) -> Self {
        let (width, height) = frames
            .first()
            .map_or((0, 0), |frame| (frame.width(), frame.height()));
        let mut sums = vec![0_u32; width * height];
        for frame in frames {
            for (v, row) in sums.chunks_mut(width.max(1)).enumerate() {
                match frame.row(v) {
                    Samples::Eight(samples) => add(row, samples),
                    Samples::Sixteen(samples) => add(row, samples),
                }
            }
        }
        let share = 1.0 / frames.len().max(1) as f32;
        Self {
            width,
            height,
            counts: sums.into_iter().map(|sum| sum as f32 * share).collect(),
        }
    }

    /// The sample at column u and row v.
    #[inline]
    pub fn at(&self, u: usize, v: usize) -> f32 {
        self.counts[v * self.width + u]
    }

    /// The picture at half the size: means of 2 × 2 pixels. Pixel (u, v) of it lies at (2u + ½,
    /// 2v + ½) of this one.
    #[must_use]
    pub fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let pixels = (0..height).flat_map(|v| (0..width).map(move |u| (2 * u, 2 * v)));
        Self {
            width,
            height,
            counts: pixels
                .map(|(u, v)| {
                    let above = self.at(u, v) + self.at(u + 1, v);
                    let below = self.at(u, v + 1) + self.at(u + 1, v + 1);
                    0.25 * (above + below)
                })
                .collect(),
        }
    }

    /// The logarithm of the picture, smoothed with the binomial kernel 1 4 6 4 1: even light or
    /// not, an edge between two albedos has the same height. `floor` counts are added, so that
    /// noise in the dark stays small.
    #[must_use]
    pub(super) fn levelled(&self, floor: f32) -> Self {
        let logarithm = |&counts: &f32| libm::logf(counts.max(0.0) + floor);
        let logs = Self {
            counts: self.counts.iter().map(logarithm).collect(),
            ..*self
        };
        logs.smoothed(1, 0).smoothed(0, 1)
    }

    /// Smoothed along one axis; the border's pixels are repeated outside.
    fn smoothed(&self, du: usize, dv: usize) -> Self {
        const KERNEL: [f32; 5] = [1.0 / 16.0, 0.25, 0.375, 0.25, 1.0 / 16.0];
        let (right, bottom) = (self.width.saturating_sub(1), self.height.saturating_sub(1));
        let pixels = (0..self.height).flat_map(|v| (0..self.width).map(move |u| (u, v)));
        let sum = |(u, v): (usize, usize)| {
            let samples = KERNEL.iter().enumerate().map(|(at, weight)| {
                let column = (u + at * du).saturating_sub(2 * du).min(right);
                let row = (v + at * dv).saturating_sub(2 * dv).min(bottom);
                weight * self.at(column, row)
            });
            samples.sum()
        };
        Self {
            counts: pixels.map(sum).collect(),
            ..*self
        }
    }
}

fn add<T: Copy + Into<u32>>(sums: &mut [u32], row: &[T]) {
    for (sum, &sample) in sums.iter_mut().zip(row) {
        *sum += sample.into();
    }
}
